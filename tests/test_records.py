"""Records as laboratories have them: the files of public bug reports, each rule by itself, and random variants."""

import math
import resource
import signal
from dataclasses import replace
from pathlib import Path

import faulty_records
import numpy as np
import pytest
from mpi4py import MPI
from click.testing import CliRunner
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fabric_fenicsx import fabrics, specimen
from fabric_fenicsx.app import cli
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.identify import fabric_file, identification, listing, making
from fabric_fenicsx.identify.files import cleaning, decoding, numerals, records
from fabric_fenicsx.identify.synthetic import synthetic
from fabric_fenicsx.identify.tensile import branches, inverse, markers, origin
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing

MESHES = Path(meshing.__file__).parent.parent / "meshes"
DATA = Path(__file__).parent / "data" / "records"
STRIP = records.Strip(0.1, 0.025, 0.5e-3)


def identified(path, strip=STRIP):
    """The axial curve of a file, its notes and its doubts."""
    read = records.read_all(path, strip)
    begun = [origin.find(record, branches.split(record), strip.gauge_length) for record in read]
    curve = identification._curve([strip] * len(begun), [one for one, _ in begun], [part for _, part in begun])
    said = [note for record, part in begun for note in (*record.notes, *part.notes)]
    return curve, " ".join(said), [doubt for record, _ in begun for doubt in record.doubts]


# --- files with the features of public bug reports


@pytest.mark.parametrize(
    ("name", "times", "note"),
    [
        ("thou_de", 1, ""),
        ("thou_de_int", 1, ""),
        ("thou_us_int", 1, ""),
        ("thou_de_N", 13, ""),
        ("thou_us_N", 13, ""),
        ("thou_ref_N", 13, ""),
        ("col_text", 1, ""),
        ("col_spec", 1, ""),
        ("date", 1, ""),
        ("time_hms", 1, ""),
        ("slack_clean", 1, "slack: the force rises from 2 ±"),
        ("spike", 1, "line 27 holds a force of 1e+05 N, far off its neighbours; left out"),
    ],
)
def test_the_curve_is_that_of_the_file(name, times, note):
    """40 + 3000 E MPa to 0.0832, unloading 847.33 MPa, whatever the file looks like."""
    curve, said, doubts = identified(DATA / f"{name}.csv")
    assert np.array(curve.loading.modulus) / times / 1e6 == pytest.approx([40, 3000], rel=1e-3)
    assert curve.loading.limit == pytest.approx(0.0832, rel=1e-3)
    assert curve.unloading.value / times / 1e6 == pytest.approx(847.33, rel=1e-3)
    assert (note in said) if note else not said
    assert not doubts


@pytest.mark.parametrize(
    ("name", "note"),
    [
        ("d_ok", ""),
        ("d_text", ""),
        ("d_swap", "dot 'a' is far off its path in line 7"),
        ("d_zero", "dot 'a' is at 0, 0 and taken for lost in line 6"),
    ],
)
def test_the_ratio_is_that_of_the_file(name, note):
    one = markers.contraction(DATA / f"{name}.csv")
    assert one.ratio == pytest.approx(0.28797, rel=1e-4) and one.patches < 1e-3
    assert note in " ".join(one.notes) and bool(one.notes) == bool(note)


def test_a_photograph_at_rest_must_be_there(tmp_path):
    with pytest.raises(InputError, match="line 2, the photograph at rest, shows fewer than three dots"):
        markers.contraction(DATA / "d_norest.csv")
    lines = (DATA / "d_ok.csv").read_text().splitlines()
    (tmp_path / "late.csv").write_text("\n".join([lines[0], *lines[2:]]))
    with pytest.raises(InputError, match=r"in line 2, is at a displacement of 1 mm, not at rest"):
        markers.contraction(tmp_path / "late.csv")


def test_one_misread_number_changes_nothing(tmp_path):
    """A dot at -1000 mm, and a force times 50 on the way back, in records with 2 % noise."""
    synthetic.write(fabrics.load("blend"), tmp_path, 1, noise=0.02, seed=7)
    dots, force = tmp_path / "weft_1_dots.csv", tmp_path / "weft_1.csv"
    ratio, curve = markers.contraction(dots).ratio, identified(force)[0]
    for path, line, column, wrong in ((dots, 27, 14, lambda x: -1e3), (force, 1125, -1, lambda x: 50 * x)):
        lines = path.read_text().split("\n")
        cells = lines[line].split(",")
        cells[column] = str(wrong(float(cells[column])))
        path.write_text("\n".join([*lines[:line], ",".join(cells), *lines[line + 1 :]]))
    again = markers.contraction(dots)
    assert again.ratio == pytest.approx(ratio, rel=0.01) and "line 28; left out there" in again.notes[0]
    once, said, _ = identified(force)
    assert once.unloading.value == pytest.approx(curve.unloading.value, rel=0.01) and "line 1126" in said


def test_a_poor_fit_shows_in_the_status(tmp_path):
    """A force that follows no curve: files are written, but the status is not 0 and the last sentence says why."""
    tests = synthetic.write(fabrics.load("blend"), tmp_path, 1, noise=0.0)
    path = tmp_path / "warp_1.csv"
    head, rows = path.read_text().splitlines()[:2], np.genfromtxt(path, delimiter=",", skip_header=2)
    wrong = rows[:, 2] * (1 + 0.6 * np.sin(np.arange(len(rows)) / 25))
    np.savetxt(path, np.column_stack([rows[:, :2], wrong]), "%.7g", ",", header="\n".join(head), comments="")
    with pytest.raises(InputError, match=r"is not to be trusted: warp curve: fit error \(rms\) .* is written") as error:
        making.make(tests, tmp_path, say=lambda word: None)
    assert (tmp_path / "fabric.toml").exists() and (tmp_path / "report.pdf").exists()
    assert "\n" not in str(error.value) and str(error.value).endswith(".")


def test_an_overload_of_many_readings_is_refused(tmp_path):
    head, *rows = (DATA / "thou_ref_N.csv").read_text().splitlines()
    cells = [row.split(";") for row in rows]
    for factor in 10, 100:
        text = [f"{t};{d};{float(f) * (factor if 20 <= k < 35 else 1)}" for k, (t, d, f) in enumerate(cells)]
        (tmp_path / "over.csv").write_text("\n".join([head, *text]))
        with pytest.raises(
            InputError, match=r"over\.csv: the force leaps from 308\.9 to [\d.e+]+ N at 2\.533 mm; look for"
        ):
            identified(tmp_path / "over.csv")


# --- numbers


@given(
    st.floats(-9e6, 9e6), st.integers(0, 6), st.sampled_from(".,"), st.sampled_from(["", ",", ".", " ", "'", "\u202f"])
)
def test_a_number_is_the_same_in_any_country(value, decimals, decimal, group):
    """Between a bare number and one that proves the convention, for 1,234 alone tells nothing."""
    if group == decimal:
        group = ""
    whole, _, part = f"{abs(value):.{decimals}f}".partition(".")
    text = ("-" if value < 0 else "") + f"{int(whole):,}".replace(",", group) + (decimal + part if part else "")
    proof = f"1{decimal}5"
    text = decoding.decode(text.encode(), "a.csv")
    assert numerals.numbers([proof, text])[1] == pytest.approx(round(value, decimals), abs=1e-9)


@pytest.mark.parametrize(
    ("cells", "elsewhere", "expected"),
    [
        (["0", "133", "933", "1,067"], "", [0, 133, 933, 1067]),
        (["0", "133", "933", "1.067"], ",", [0, 133, 933, 1067]),
        (["0", "133", "933", "1,067"], ",", "jumps by a thousand between '933' and '1,067'"),
        (["0", "1,067", "2,134"], "", "thousands or decimals"),
        (["9,12", "9.12"], "", "writes both"),
        (["0.000", "1.067", "2.134"], "", [0, 1.067, 2.134]),
        (["1.067", "2.134"], ",", [1067, 2134]),
        (["1,23,456", "998"], "", [123456, 998]),
        (["1.045.95", "998.37"], "", [1045.95, 998.37]),
        (["1,5E+03", "\u22122,5"], "", [1500, -2.5]),
        (["NaN", "---", "1"], "", [math.nan, math.nan, 1]),
    ],
)
def test_a_column_decides_what_its_marks_mean(cells, elsewhere, expected):
    if isinstance(expected, str):
        with pytest.raises(numerals.Unclear, match=expected):
            numerals.numbers(cells, elsewhere)
    else:
        assert numerals.numbers(cells, elsewhere) == pytest.approx(expected, nan_ok=True)


@pytest.mark.parametrize("name", ["06.05.2024", "2024-05-06", "12:30", "1.2.3", "N", "1,2345.6"])
def test_what_is_no_number(name):
    with pytest.raises(numerals.NoNumber):
        numerals.numbers(["1", name])


@pytest.mark.parametrize(
    "name", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp932", "cp1252"]
)
def test_text_of_any_encoding(name):
    text = "荷重(N),変位(mm)\n1,2\n" if "cp1252" != name else "Prüfkraft (N);Weg (µm)\n1;2\n“a”\n"
    assert decoding.decode(text.encode(name), "a.csv") == text.replace("µ", "μ")
    with pytest.raises(InputError, match=r"a\.csv: is no plain text"):
        decoding.decode(b"1,2\n\0\0\0\1", "a.csv")


# --- readings


def test_wild_readings_are_those_that_stand_alone():
    t = np.linspace(0, 1, 200)
    up = np.where(t < 0.7, t**2, 0.49 - 3 * (t - 0.7))
    for values in (up, np.sign(t - 0.5), np.sin(60 * t), np.abs(t - 0.5), np.full(200, 3.0), np.round(up, 2)):
        assert not cleaning.wild(values).any()
    for i, value in ((0, 9.0), (100, -1.0), (140, 99999.0), (199, 7.0)):
        bad = np.where(np.arange(200) == i, value, up)
        assert np.flatnonzero(cleaning.wild(bad)).tolist() == [i]


def test_the_order_of_time():
    time, d = np.arange(40.0), np.minimum(np.arange(40.0), 60 - np.arange(40.0))
    rng = np.random.default_rng(1)
    mixed = rng.permutation(40)
    order, said = cleaning.in_order(time[mixed], d[mixed])
    assert (mixed[order] == np.arange(40)).all() and "out of order" in said
    order, said = cleaning.in_order(np.where(time < 30, time, time - 30), d)
    assert (order == np.arange(40)).all() and "restarts" in said
    halves = np.roll(np.arange(40), 20)
    order, said = cleaning.in_order(time[halves], d[halves])
    assert (halves[order] == np.arange(40)).all()


def test_several_specimens_in_a_file(tmp_path):
    """By a head, a column or a clock each is a specimen; a jump that nobody explains is refused."""
    head, *rows = (DATA / "thou_ref_N.csv").read_text().splitlines()
    named = [f"{head};Specimen", *(f"{row};{who}" for who in ("A", "B") for row in rows)]
    path = tmp_path / "two.csv"
    for lines in ([head, *rows, head, *rows], named, [head, *rows, *rows]):
        path.write_text("\n".join(lines))
        several = records.read_all(path, STRIP)
        assert [len(one.force) for one in several] == [len(rows)] * 2
        assert several[1].force == pytest.approx(several[0].force)
        assert "two.csv: holds 2 specimens." in several[0].notes
        with pytest.raises(InputError, match="holds 2 specimens"):
            records.read(path, STRIP)
    path.write_text("\n".join(line.partition(";")[2] for line in [head, *rows, *rows]))
    with pytest.raises(InputError, match=r"jumps from 6\.56 to 0 mm in line 81; if another specimen begins there"):
        records.read_all(path, STRIP)
    pages = [head, *rows[:20], head, *rows[20:50], head, *rows[50:]]
    path.write_text("\n".join(pages))
    assert len(records.read(path, STRIP).force) == len(rows)


def test_a_pre_load_is_told_from_an_offset(tmp_path):
    """The strip of a pre-load is free of force on the way back; of the rest the list of tests must say what it is."""
    d = np.concatenate([np.linspace(0, 8, 200), np.linspace(8, 6, 60)[1:]])
    x = d * 1e-3 / STRIP.gauge_length
    E, peak = x + x * x / 2, 0.0832
    S = np.where(np.arange(len(d)) < 200, 40e6 * E + 1.5e9 * E**2, 40e6 * peak + 1.5e9 * peak**2 - 8e8 * (peak - E))
    force = np.maximum(S, 0) * (1 + x) * STRIP.area
    first = 25
    head, path = "displacement_mm,force_N", tmp_path / "a.csv"

    def write(rows, d0, f0):
        np.savetxt(path, np.column_stack([d[rows] - d0, force[rows] + f0]), "%.6f", ",", header=head, comments="")

    write(slice(first, None), d[first], 0.0)
    curve, said, doubts = identified(path)
    assert np.array(curve.loading.modulus[:2]) / 1e6 == pytest.approx([40, 3000], rel=0.03) and not doubts
    assert "next to the zero of the file" in said or f"counts from {d[first]:.3g} mm before" in said
    write(slice(first, None), 0.0, 0.0)
    curve, said, doubts = identified(path)
    assert np.array(curve.loading.modulus[:2]) / 1e6 == pytest.approx([40, 3000], rel=1e-3) and not doubts
    write(slice(None), 0.0, 5.0)
    curve, said, doubts = identified(path)
    assert np.array(curve.loading.modulus[:2]) / 1e6 == pytest.approx([40, 3000], rel=0.01) and not doubts
    write(slice(first, 200), d[first], 0.0)
    _, said, doubts = identified(path)
    assert "subtracted" in said and "give preload_N in the list of tests" in doubts[0]
    (record,) = records.read_all(path, STRIP)
    told, _ = origin.find(record, branches.split(record), STRIP.gauge_length, 5.0)
    assert 1e3 * told.displacement[0] == pytest.approx(d[first], rel=0.01) and not told.doubts
    told, _ = origin.find(record, branches.split(record), STRIP.gauge_length, 0.0)
    assert told.force[0] == pytest.approx(0, abs=0.1) and not told.doubts


# --- random variants


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return [faulty_records.good(tmp_path_factory.mktemp(name), name) for name in ("denim", "blend")]


@pytest.mark.parametrize("seeds", [range(k, k + 15) for k in range(0, 60, 15)], ids=lambda seeds: f"from_{seeds[0]}")
def test_a_faulty_record_gives_the_fabric_or_a_sentence(made, seeds):
    """`python tests/faulty_records.py` tries 500."""
    for seed in seeds:
        verdict, told, said = faulty_records.trial(made[seed % 2], seed, made[seed % 2].folder)
        assert verdict != "WRONG", f"{seed}: {told}: {said}"
        assert verdict != "refused" or (said.endswith((".", "load cell")) or said.startswith("doubts")), said


def test_the_list_may_say_the_pre_load(tmp_path):
    tests = synthetic.write(fabrics.load("denim"), tmp_path, 1, noise=0.0)
    tests.write_text(tests.read_text().replace("[records]", "preload_N = -1\n[records]"))
    answer = CliRunner().invoke(cli.app, ["identify", str(tests), "--out", str(tmp_path / "out")])
    assert "preload_N = -1 is not zero or a positive number" in str(answer.exception)


# --- shear from a strip that does not lock


@pytest.fixture(scope="module")
def clamped(made):
    """Tests of denim without photographs of its yarns, and the strip that is searched."""
    answer = identification.identify(made[0].tests)
    known = {way: answer.curves[way] for way in ("warp", "weft")}
    return inverse._Search(replace(answer, curves=known), MESHES / "strip.geo", None, "clamped", 4)


@pytest.mark.filterwarnings("ignore:.*beyond the measured")
def test_the_strip_of_the_search_does_not_lock(clamped):
    """Within 2 % of fully integrated biquadratic cells extrapolated to h = 0; 9 x 3 bilinear ones are 10 % off."""
    fabric, forces = fabrics.load("denim"), {}
    used = inverse.ELEMENTS["clamped"]
    for cells, degree, points in (((15, 5), 2, None), ((30, 10), 2, None), ((9, 3), 1, None), used):
        domain = meshing.read(
            MESHES / "strip.geo", MPI.COMM_SELF, gdim=2, orient=False, nx=cells[0], ny=cells[1],
            length=fabric.gauge_length, width=fabric.width,
        )  # fmt: skip
        scene = specimen.strip(
            domain, fabric, Woven(fabric), np.pi / 4, ends="clamped", degree=degree, quadrature=points
        )
        for _ in statics.march(scene.solver, scene.pull, list(clamped.d)):
            pass
        forces[cells, degree] = scene.solver.reaction(scene.ends[1])
    limit = 2 * forces[(30, 10), 2] - forces[(15, 5), 2]
    assert forces[(18, 6), 2] == pytest.approx(limit, rel=0.02)
    assert forces[(9, 3), 1] > 1.1 * limit


def test_a_trial_that_cannot_be_pulled_is_no_error(clamped, monkeypatch):
    """Every fifth trial fails: the search goes around it; where all do, one sentence."""
    pull, count = inverse._Search._pull, iter(range(10**6))

    def sometimes(self, fabric, path):
        if next(count) % 5 == 0:
            raise StepFailed("no.")
        return pull(self, fabric, path)

    monkeypatch.setattr(inverse._Search, "_pull", sometimes)
    found = inverse.shear(clamped.found, MESHES / "strip.geo", (9, 3), ends="clamped", steps=4).curves["shear"]
    assert found.loading.residual < 0.02

    def never(self, fabric, path):
        raise StepFailed("no.")

    monkeypatch.setattr(inverse._Search, "_pull", never)
    with pytest.raises(StepFailed, match="no strip can be pulled to the end of the bias test; check width"):
        inverse.shear(clamped.found, MESHES / "strip.geo", (9, 3), ends="clamped", steps=4)


# --- machines at the end of their range, and grips that slip


def curve_of(chance):
    """A displacement (m) and a force (N) that grows with it, on a strip of `STRIP`'s size, with noise."""
    d, bent = np.linspace(0, chance.uniform(5e-3, 3e-2), int(chance.integers(60, 600))), chance.uniform(0.4, 4)
    x = d / d[-1]
    force = 200 * (x**bent + chance.uniform(0, 1) * x)
    return d, force, 200 * chance.choice([0.0, 0.002, 0.01]) * chance.standard_normal(len(d))


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from(["force", "displacement"]), st.floats(0.4, 0.75))
def test_a_reading_that_stands_still_ends_the_curve(seed, what, part):
    """A load cell or an extensometer at the end of its range: said, and what is left is the curve before."""
    d, force, noise = curve_of(np.random.default_rng(seed))
    clean = records.Record("a.csv", d, force + noise)
    assert "stays at" not in " ".join(branches.split(clean).notes)
    if what == "force":
        assume((force > part * force.max()).sum() > branches.FEWEST)
        clipped = records.Record("a.csv", d, np.minimum(force + noise, part * force.max()))
    else:
        clipped = records.Record("a.csv", np.minimum(d, part * d[-1]), force + noise)
    split = branches.split(clipped)
    assert f"the {what} stays at" in split.notes[0] and split.notes[0].endswith("the curve ends there.")
    end = d[-1] * part if what == "displacement" else np.interp(part * force.max(), force, d)
    assert 0.85 * end < d[split.virgin].max() < 1.03 * end


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.floats(0.3, 0.7), st.floats(0.12, 0.3))
def test_a_slip_is_a_doubt(seed, where, part):
    """The force falls by a part of its peak and goes on beyond: no curve of one strip; without it there is no doubt."""
    d, force, noise = curve_of(np.random.default_rng(seed))
    assert not branches.split(records.Record("a.csv", d, force + noise)).doubts
    k = int(where * len(d))
    fall = min(part * force.max(), 0.8 * force[k])
    slipped = force - np.where(np.arange(len(d)) > k, fall, 0.0) + noise
    if force[-1] - fall < 1.02 * force[k]:
        return
    doubts = branches.split(records.Record("a.csv", d, slipped)).doubts
    assert bool(doubts) == (fall > 0.1 * force.max()) or 0.05 < fall / force.max() < 0.13
    if doubts:
        begun = origin.find(
            records.Record("a.csv", d, slipped), branches.split(records.Record("a.csv", d, slipped)), 0.1
        )
        assert "and grows again (a slip in the grips, a hold)" in begun[0].doubts[0]


def test_a_full_disk_leaves_no_part_of_a_report(tmp_path, monkeypatch):
    """The file that does not fit is named, and neither it nor a rough copy is left; an old fabric file stays whole."""
    path = synthetic.write(fabrics.load("blend"), tmp_path, 1)
    (tmp_path / "fabric.toml").write_text("old")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    old = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
        with pytest.raises(OSError, match=r"report\.png"):
            making.make(path, tmp_path, say=lambda _: None)
        with pytest.raises(OSError, match=r"fabric\.toml"):
            fabric_file.write(identification.identify(listing.read(path)), tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, old)
    assert (tmp_path / "fabric.toml").read_text() == "old"
    assert not list(tmp_path.glob("report*")) and not list(tmp_path.glob(".*"))
