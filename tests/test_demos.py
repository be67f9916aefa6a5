"""Every demo: its checked number, its files, its answer on two ranks, and what it says to bad input."""

import csv
import json
import runpy
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image
from scipy import optimize, special

from fabric_fenicsx import fabrics, system

ROOT = Path(__file__).resolve().parent.parent
DEMOS, MESHES = ROOT / "demos", ROOT / "meshes"
COLUMNS = ["step", "displacement_mm", "force_N", "axial_strain", "axial_stress_MPa", "transverse_strain"]
COLUMNS += ["newton_iterations", "step_cuts", "wall_s"]

pytestmark = pytest.mark.filterwarnings("ignore:.*is beyond the measured")


def script(name):
    """Where the demo of this name is; there is one."""
    (path,) = DEMOS.rglob(name)
    return path


@pytest.fixture
def demo(monkeypatch, capsys):
    """Runs a demo in this process as from the command line: its status and what it wrote to the two streams."""
    monkeypatch.setattr(warnings, "formatwarning", warnings.formatwarning)

    def run(name, *words):
        path = script(name)
        monkeypatch.syspath_prepend(path.parent)
        monkeypatch.setattr(sys, "argv", [name, *map(str, words)])
        with pytest.raises(SystemExit) as end:
            runpy.run_path(str(path), run_name="__main__")
        return end.value.code, *capsys.readouterr()

    return run


@pytest.fixture
def tensile(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import tensile

    return tensile


def read(path):
    """Columns of a CSV file of numbers."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def look(path):
    """A picture exists and is not blank."""
    if path.name == "deformed.png" and system.can_draw() is not None:
        assert not path.exists(), "left out where nothing can draw it"
        return
    pixels = image.imread(path)
    assert min(pixels.shape[:2]) > 300
    assert len(np.unique(pixels[::3, ::3, :3] @ [1, 300, 90000])) > 20, f"{path} is blank"


def files(folder):
    """The history of a run, which has the agreed columns; fields and pictures are there."""
    table = read(folder / "history.csv")
    assert set(table) >= set(COLUMNS)
    assert (folder / "fields.pvd").exists()
    look(folder / "stress_strain.png")
    look(folder / "deformed.png")
    return table


# --- what each one shows


def test_tensile(demo, tmp_path):
    status, said, _ = demo(
        "tensile.py", "--angle", "all", "--steps", "5", "--ends", "free", "--cells", "9x3", "--out", tmp_path
    )
    assert status == 0 and ": yes;" in said and said.count("force gone") == 3
    for angle in 0, 90, 45:
        table = files(tmp_path / f"blend_{angle}")
        assert table["force_N"][-1] <= 0 < table["force_N"][4]
    look(tmp_path / "stress_strain.png")


def test_tensile_with_a_potential(demo, tmp_path):
    """Between clamps muslin's warp test comes near its curve, and contracts by the measured ratio; whole cycles."""
    options = ("--law", "potential", "--fabric", "muslin", "--steps", "6", "--cells", "9x3", "--ramp", "5e-3")
    status, said, _ = demo("tensile.py", *options, "--out", tmp_path)
    table = files(tmp_path / "muslin_0")
    assert status == 0 and ": yes;" in said and "force gone" in said and not table["step_cuts"].any()
    E, S = table["axial_strain"][:6], table["axial_stress_MPa"][:6]
    over = S / (fabrics.load("muslin").warp.stress(E) / 1e6) - 1
    assert 0 < over[-1] < 0.07
    assert abs(table["transverse_strain"][5] / E[-1] / -2.04 - 1) < 0.05


def test_tensile_reload_and_another_mesh(demo, tmp_path):
    """Reloading comes back to the virgin curve (Figure 7-18)."""
    mesh = tmp_path / "triangles.geo"
    mesh.write_text((MESHES / "strip.geo").read_text().replace("triangles = 0", "triangles = 1"))
    status, said, _ = demo(
        "tensile.py", "--reload", "--steps", "4", "--mesh", mesh, "--ends", "free", "--out", tmp_path
    )
    table = read(tmp_path / "blend_0" / "history.csv")
    assert status == 0 and ": yes;" in said
    d, stress = table["displacement_mm"], table["axial_stress_MPa"]
    assert np.allclose(d[[3, 7, 11]], [13.5, 12.6, 18.0])
    virgin = fabrics.load("blend").warp.stress(table["axial_strain"]) / 1e6
    assert stress[7] < 0.4 * stress[3] and np.allclose(stress[8:12], virgin[8:12], rtol=1e-4)


@pytest.mark.parametrize("cycle", ["sign", "reload"])
def test_simple_shear(demo, tmp_path, cycle):
    status, said, _ = demo("simple_shear.py", "--cycle", cycle, "--steps", "5", "--out", tmp_path)
    table = files(tmp_path / f"blend_{cycle}")
    stress, strain = table["shear_stress_MPa"], table["shear_strain_E12"]
    assert status == 0 and ": yes;" in said
    assert np.allclose(table["transverse_strain"], 2 * strain**2)
    virgin = fabrics.load("blend").shear.stress(2 * strain) / 1e6
    if cycle == "sign":
        assert np.allclose(stress[:5], virgin[:5])
        assert stress.min() < 0 and strain[stress.argmin()] == strain.min() == -0.2
        # the path back begins where the stress has gone, not at zero strain
        assert stress[np.isclose(strain, 0)][0] < 0 < stress[np.isclose(strain, 0)][1]
    else:
        low = 4 + stress[4:].argmin()
        assert (stress > 0).all() and np.isclose(stress[low], virgin[3:5].max() / 2, rtol=0.2)
        assert np.isclose(stress[-1], virgin[-1]), "on the virgin curve again"


def test_simple_shear_says_where_the_printed_law_stops(demo, tmp_path):
    status, said, _ = demo("simple_shear.py", "--law", "printed", "--fabric", "muslin", "--out", tmp_path)
    assert status == 0 and "stopped at load" in said and "not asked of the printed law" in said


def test_biaxial(demo, tmp_path):
    """While both yarns load, S11 is the fitted curve times (1 + nu21)/(1 - nu12 nu21), from (6.11) with dE1 = dE2."""
    status, said, _ = demo("biaxial.py", "--steps", "6", "--cells", "2", "--out", tmp_path)
    assert status == 0 and ": yes;" in said
    look(tmp_path / "stress_strain.png")
    for name in "blend", "denim":
        table, fabric = files(tmp_path / name), fabrics.load(name)
        nu12, nu21 = fabric.poisson["measured"]
        for yarn, ratio, stress in (fabric.warp, nu21, "axial"), (fabric.weft, nu12, "transverse"):
            expected = yarn.stress(table["axial_strain"]) * (1 + ratio) / (1 - nu12 * nu21) / 1e6
            assert np.allclose(table[f"{stress}_stress_MPa"][:6], expected[:6], rtol=1e-8)
        assert table["displacement_mm"].max() == 30
        assert max(table["force_N"][-1], table["transverse_force_N"][-1]) <= 0


@pytest.mark.slow
def test_law_steps(demo, tmp_path):
    status, said, _ = demo("law_steps.py", "--quick", "--out", tmp_path)
    assert status == 0 and ": yes;" in said and "stopped at" in said
    look(tmp_path / "error.png")
    with open(tmp_path / "cycles.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["law"] for row in rows] == ["continuous", "printed"] * 3
    assert not any(row["stopped_at_mm"] for row in rows if row["law"] == "continuous")
    with open(tmp_path / "errors.csv", newline="") as file:
        errors = [float(row["error_to_fitted_percent"]) for row in csv.DictReader(file) if row["law"] == "printed"]
    assert np.allclose(errors[:2], [9.72, 4.86], atol=0.01), "muslin along the warp, 10 and 20 steps"


@pytest.mark.slow
def test_identify_and_pull_the_identified_fabric(demo, tmp_path):
    """Records, report, fabric file, and the tensile tests with it, as a plain user runs them.

    Between clamps its force is that of the first fabric to 3 % along warp and weft; in bias to 5 %.
    """
    status, said, _ = demo("identify.py", "--fabric", "duck", "--out", tmp_path)
    assert status == 0 and "within 5 %: yes;" in said and "not tested: compression" in said
    look(tmp_path / "duck" / "report.png")
    assert (tmp_path / "duck" / "report.pdf").read_bytes().startswith(b"%PDF")
    forces = []
    for fabric, folder in ("duck", "duck"), (tmp_path / "duck" / "fabric.toml", "fabric"):
        status, said, _ = demo(
            "tensile.py",
            "--fabric",
            fabric,
            "--angle",
            "all",
            "--steps",
            "5",
            "--cells",
            "18x6",
            "--out",
            tmp_path / "pull",
        )
        assert status == 0 and ": yes;" in said
        forces.append(
            [read(tmp_path / "pull" / f"{folder}_{angle}" / "history.csv")["force_N"][4] for angle in (0, 90, 45)]
        )
    assert (np.abs(np.divide(*forces) - 1) < [0.03, 0.03, 0.05]).all()


# --- the tests of the thesis, with the measured Poisson's ratios


@pytest.mark.parametrize("ends", ["free", "clamped"])
@pytest.mark.parametrize("angle", [0.0, 90.0, 45.0])
@pytest.mark.parametrize("name", fabrics.names())
def test_every_cycle_completes(tensile, name, angle, ends):
    case = tensile.Case(fabrics.load(name), angle, ends=ends, **tensile.THESIS)
    table, peak, stopped = tensile.run(case)
    assert stopped is None and table.column("force_N")[-1] <= 0
    if ends == "free" and angle != 45:
        top = table.rows[peak - 1]
        assert top["axial_stress_MPa"] == pytest.approx(case.fitted(top["axial_strain"]) / 1e6, rel=0.005)
    if ends == "clamped" and angle != 45:
        assert table.column("newton_iterations")[:peak].mean() <= 4


@pytest.mark.parametrize("angle", [0.0, 90.0])
@pytest.mark.parametrize("name", fabrics.names())
def test_five_steps_are_enough(tensile, name, angle):
    case = tensile.Case(fabrics.load(name), angle, ends="free", steps=5, **tensile.THESIS)
    table, peak, stopped = tensile.run(case)
    top = table.rows[peak - 1]
    assert stopped is None
    assert top["axial_stress_MPa"] == pytest.approx(case.fitted(top["axial_strain"]) / 1e6, rel=0.005)


# --- two ranks

TWICE = """
import json, runpy, sys
for words in json.loads(sys.argv[1]):
    sys.path[0], sys.argv = words[0].rpartition("/")[0], words
    try:
        runpy.run_path(words[0], run_name="__main__")
    except SystemExit as end:
        assert end.code == 0, words
"""


def python_on_two_ranks(*words, timeout=280):
    """How Python ended on two ranks, and what it said."""
    mpirun = system.mpirun()
    assert mpirun, "there is no mpirun: make setup brings it"
    words = [mpirun, "-n", "2", sys.executable, *map(str, words)]
    return subprocess.run(words, capture_output=True, text=True, timeout=timeout, check=False)


def on_two_ranks(commands):
    """Run demos one after the other on two ranks; each must say that its check is met, once, by rank 0."""
    answer = python_on_two_ranks("-c", TWICE, json.dumps(commands))
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.count(": yes;") == len(commands), "said once, by rank 0"


@pytest.mark.slow
def test_two_ranks_give_the_same(demo, tmp_path):
    """To 1e-8 where the demo solves to 1e-10 of the force, to 1e-6 with the 1e-6 of tensile.py."""
    runs = {
        "tensile.py": (["--angle", "30", "--ends", "clamped", "--steps", "5", "--cells", "12x4"], "blend_30", 1e-6),
        "simple_shear.py": (["--steps", "5"], "blend_sign", 1e-8),
        "biaxial.py": (["--fabric", "blend", "--steps", "5"], "blend", 1e-8),
    }
    commands = [[str(script(name)), *words, "--out", str(tmp_path / "two")] for name, (words, *_) in runs.items()]
    on_two_ranks(commands)
    for name, (words, folder, tolerance) in runs.items():
        assert demo(name, *words, "--out", tmp_path / "one")[0] == 0
        one, two = (read(tmp_path / ranks / folder / "history.csv") for ranks in ("one", "two"))
        for column in COLUMNS[:6]:
            scale = np.abs(one[column]).max()
            assert np.abs(one[column] - two[column]).max() <= tolerance * scale, (name, column)
        look(tmp_path / "two" / folder / "deformed.png")


# --- bad input


@pytest.mark.parametrize(
    ("name", "words", "reason"),
    [
        ("tensile.py", "--fabric tweed", "'tweed'"),
        ("tensile.py", "--angle nan", "nan is not a finite number"),
        ("tensile.py", "--steps 0", "0 is not a whole number of at least 1"),
        ("tensile.py", "--steps many", "many is not a whole number of at least 1"),
        ("tensile.py", "--cells 9", "9 is not of the form 9x3"),
        ("tensile.py", "--ends loose", "invalid choice: 'loose'"),
        ("tensile.py", "--out {file}/out", "cannot be written"),
        ("tensile.py", "--mesh {meshes}/square.geo", "no physical group 'fixed_end'"),
        ("tensile.py", "--mesh {prose}", "prose.msh"),
        ("tensile.py", "--mesh {file}.msh", "no mesh file"),
        ("tensile.py", "--fabric {toml}", "thickness_mm = -0.38 is not positive"),
        ("tensile.py", "--fabric {file}", "TOML"),
        ("simple_shear.py", "--fabric tweed", "'tweed'"),
        ("simple_shear.py", "--steps 0", "0 is not a whole number of at least 1"),
        ("simple_shear.py", "--amplitude nan", "nan is not a finite number"),
        ("simple_shear.py", "--amplitude 0", "must be a positive shear"),
        ("simple_shear.py", "--mesh {meshes}/strip.geo", "no physical group 'bottom'"),
        ("biaxial.py", "--fabric blend tweed", "'tweed'"),
        ("biaxial.py", "--displacement -1", "must be a positive extension"),
        ("biaxial.py", "--mesh {meshes}/strip.geo", "no physical group 'left'"),
        ("identify.py", "--fabric tweed", "'tweed'"),
        ("identify.py", "--noise 200", "give percent from 0 to 20"),
        ("snap_through.py", "--longest 0", "0 is not greater than zero"),
        ("hanging_strip.py", "--points 1", "take at least 8"),
        ("sleeve.py", "--move 0", "0 is not greater than zero"),
        ("sleeve.py", "--bend -1", "0 to 180 degrees"),
        ("sleeve.py", "--around 5", "a multiple of 4"),
        ("drape.py", "--patch -1", "less than half the side"),
        ("drape.py", "--against {file}", "no columns time_s and centre_z_m"),
        ("law_steps.py", "--fabric tweed", "'tweed'"),
        ("law_steps.py", "--out {file}", "cannot be written"),
    ],
)
def test_bad_input_is_answered_in_a_sentence(demo, tmp_path, name, words, reason):
    file, toml = tmp_path / "prose.txt", tmp_path / "bad.toml"
    file.write_text("This is no mesh, no folder and no fabric.\n")
    blend = Path(fabrics.__file__).parent / "blend.toml"
    toml.write_text(blend.read_text().replace("thickness_mm = 0.38", "thickness_mm = -0.38"))
    prose = shutil.copy(file, tmp_path / "prose.msh")
    words = words.format(file=file, prose=prose, toml=toml, meshes=MESHES).split()
    if "--out" not in words:
        words += ["--out", tmp_path / "out"]
    status, said, complaint = demo(name, *words)
    assert status == 2 and ": yes;" not in said and "Traceback" not in complaint
    *usage, sentence = (line for line in complaint.splitlines() if line.strip() and "step/s" not in line)
    assert "error: " in sentence and reason in sentence
    assert not usage or usage[0].startswith("usage: ")


@pytest.mark.parametrize("angle", ["0", "45"])
def test_the_flat_strip_is_the_same_at_all_levels_of_kinematics(angle, monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import tensile

    forces = []
    for level in ("plane", "membrane", "shell"):
        case = tensile.Case(
            fabrics.load("blend"), float(angle), steps=6, kinematics=level, search="newton", **tensile.THESIS
        )  # downhill, one that is slack leaves its plane where it can
        scene = tensile.strip(case)
        scene[1].rtol = 1e-10
        forces.append(tensile.run(case, scene=scene)[0].column("force_N"))
    assert len(forces[0]) > 6
    for other in forces[1:]:
        assert np.allclose(other, forces[0], rtol=1e-8, atol=1e-8 * forces[0].max())


def test_an_unloaded_strip_buckles_into_the_elastica(demo, tmp_path):
    """Figure 7-9 c: pulled longer for good and pushed back, a strip stands out as a clamped elastica of that length."""
    status, said, _ = demo(
        "tensile.py",
        "--kinematics",
        "shell",
        "--imperfection",
        "0.1",
        "--whole",
        "--steps",
        "10",
        "--cells",
        "9x3",
        "--out",
        tmp_path,
    )
    table = read(tmp_path / "blend_0" / "history.csv")
    d, force = table["displacement_mm"], table["force_N"]
    assert status == 0 and "back at zero" in said and d[-1] == 0.0
    # it bends, where a flat strip would be pushed together with 17 N
    assert -2e-4 * force.max() < force[-1] < 0
    longer = d[9:][force[9:] < 0][0]
    length = 76.2 + longer
    m = optimize.brentq(lambda m: 2 * special.ellipe(m) / special.ellipk(m) - 76.2 / length - 1, 1e-6, 0.8)
    height = float(said.split("out of its plane by")[1].split()[0])
    assert height == pytest.approx(np.sqrt(m) * length / special.ellipk(m), rel=0.04)
    look(tmp_path / "blend_0" / "unloaded.png")


def test_a_plane_strip_has_no_height(demo, tmp_path):
    status, _, complaint = demo("tensile.py", "--imperfection", "0.1", "--out", tmp_path)
    assert status == 2 and "--kinematics shell" in complaint


@pytest.mark.slow
@pytest.mark.parametrize("case", ["end_shear", "scordelis_lo"])
def test_shell_benchmarks(demo, tmp_path, case):
    status, said, _ = demo("shell_benchmarks.py", "--case", case, "--out", tmp_path)
    assert status == 0 and "within the tolerance of its case: yes" in said
