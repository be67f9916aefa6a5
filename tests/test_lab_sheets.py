"""Sheets of KES-F and FAST to a fabric: its law, tested as the laboratory does, gives its numbers again."""

import re
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from test_setup import ROOT

from fabric_fenicsx import fabrics
from fabric_fenicsx.app.cli import app
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify import fabric_file, identify, listing
from fabric_fenicsx.identify.bending import loops
from fabric_fenicsx.identify.bending.hanging import ASTM_ANGLE
from fabric_fenicsx.identify.report import page as report
from fabric_fenicsx.identify.sheets import kes_and_fast as sheets
from fabric_fenicsx.identify.synthetic.synthetic_bending import overhangs
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.woven import Woven

HEAD = """
name = "shirting"
label = "K"
material = "Cotton"
weave = "Plain"
thickness_mm = 0.4
density_kg_per_m3 = 300
[assumed]
nu12 = 0.2
nu21 = 0.2
"""
KES = {
    "warp": {"EM": 5.1, "LT": 0.72, "RT": 50, "G": 0.6, "2HG": 0.8, "2HG5": 1.5, "B": 0.10, "2HB": 0.05},
    "weft": {"EM": 8.3, "LT": 0.62, "RT": 45, "G": 0.7, "2HG": 0.9, "2HG5": 1.6, "B": 0.08, "2HB": 0.04},
}
FAST = {"warp": {"E5": 0.4, "E20": 1.1, "E100": 3.0, "C": 18.5}, "weft": {"E5": 0.6, "E20": 1.6, "E100": 4.1, "C": 16}}


def toml(kind, ways, extra=""):
    def inline(numbers):
        return "{ " + ", ".join(f"{key} = {value}" for key, value in numbers.items()) + " }"

    return (
        f"{HEAD}[{kind}]\n" + "\n".join(f"{way} = {inline(numbers)}" for way, numbers in ways.items()) + f"\n{extra}\n"
    )


def made(tmp_path, text):
    (tmp_path / "tests.toml").write_text(text)
    found = identify(listing.read(tmp_path / "tests.toml"))
    return found, fabric_file.write(found, tmp_path)[1]


def cycle(fabric, way, nominal):
    """Nominal strain and force per width (N/m) of a tensile cycle of the law, up to a nominal strain and back."""
    E = nominal + nominal**2 / 2
    path = np.concatenate([np.linspace(0, E, 201)[1:], np.linspace(E, 0.2 * E, 400)])
    result = driver.uniaxial(Woven(fabric), path, angle={"warp": 0.0, "weft": np.pi / 2}[way])
    stretch = np.sqrt(1 + 2 * path)
    return stretch - 1, result.stress[:, 0] * stretch * fabric.thickness


def noisy(ways, rng):
    """Three specimens with 2 % noise."""
    return {
        way: {key: [float(f"{v * (1 + 0.02 * rng.standard_normal()):.5g}") for _ in range(3)] for key, v in row.items()}
        for way, row in ways.items()
    }


@pytest.mark.parametrize("noise", [False, True])
def test_a_kes_sheet_comes_back(tmp_path, noise):
    """EM and LT of the law's tensile cycle, G and 2HB; RT as far as its straight way back reaches."""
    ways = noisy(KES, np.random.default_rng(1)) if noise else KES
    found, fabric = made(tmp_path, toml("kes", ways))
    close = 0.05 if noise else 0.02
    for way, row in KES.items():
        e, F = cycle(fabric, way, row["EM"] / 100)
        top = F[199]
        assert top == pytest.approx(sheets.KES_FORCE, rel=2 * close)
        work, back = np.trapezoid(F[:200], e[:200]), -np.trapezoid(np.clip(F[199:], 0, None), e[199:])
        assert work / (0.5 * top * e[199]) == pytest.approx(row["LT"], rel=close)
        assert 100 * back / work == pytest.approx(row["RT"], rel=2 * close)
        curve = getattr(fabric.bending, way)
        assert curve.B == pytest.approx(row["B"] * 9.80665e-5, rel=close)
        assert curve.hysteresis == pytest.approx(row["2HB"] * 9.80665e-3, rel=close)
    # G: slope of shear between 0.5 and 2.5 degrees, mean of both ways; friction builds up yet
    angle = np.radians([1.0, 5.0])
    force = fabric.shear.stress(angle) * fabric.thickness
    assert np.diff(force)[0] / 4 / sheets.GF_CM == pytest.approx(0.65, rel=0.1)
    assert len(found.curves["warp"].readings) == (3 if noise else 1)
    assert len(report.draw(found).axes) > 8 and "from a sheet of KES" in "".join(found.fits)


@pytest.mark.parametrize("noise", [False, True])
def test_a_fast_sheet_comes_back(tmp_path, noise):
    ways = noisy(FAST, np.random.default_rng(2)) if noise else FAST
    _, fabric = made(tmp_path, toml("fast", ways, "EB5 = 4.2"))
    close = 0.05 if noise else 0.02
    for way, row in FAST.items():
        e, F = cycle(fabric, way, row["E100"] / 100)
        assert F[199] == pytest.approx(100 * sheets.GF_CM, rel=2 * close)
        assert np.interp(20 * sheets.GF_CM, F[:200], 100 * e[:200]) == pytest.approx(row["E20"], rel=3 * close)
        curve = getattr(fabric.bending, way)
        c = 1e3 * overhangs(curve, fabric.areal_mass, 15.0, np.array([ASTM_ANGLE]))[0] / 2
        assert c == pytest.approx(row["C"], rel=close) and curve.hysteresis == 0
    assert fabric.shear.modulus[0] * fabric.thickness == pytest.approx(123 / 4.2, rel=close)


def test_wt_stands_for_lt(tmp_path):
    """WT = LT/2 x 500 gf/cm x EM."""
    ways = {way: {k: v for k, v in row.items() if k != "LT"} for way, row in KES.items()}
    for way, row in ways.items():
        row["WT"] = KES[way]["LT"] / 2 * 500 * row["EM"] / 100
    one, other = (made(tmp_path, toml("kes", rows))[1] for rows in (ways, KES))
    assert one.warp.modulus == pytest.approx(other.warp.modulus) and one.weft.modulus == pytest.approx(
        other.weft.modulus
    )


@pytest.mark.parametrize(
    ("kind", "change", "reason"),
    [
        ("kes", {"LT": None}, "kes.warp has neither LT nor WT"),
        ("kes", {"B": None}, "kes.warp.B is missing"),
        ("kes", {"HB": 0.05}, "kes.warp.HB is not a known key; known is 2HB"),
        ("kes", {"EM": -5}, "kes.warp.EM = -5 is not a positive number"),
        ("kes", {"2HB": -1}, "kes.warp.2HB = -1 is not zero or a positive number"),
        ("kes", {"EM": []}, "kes.warp.EM = None is not a positive number"),
        ("kes", {"LT": 0.2}, "an LT of 0.2, which is from 0.42"),
        ("kes", {"RT": 0.5}, "an RT of 0.5, which is a percentage"),
        ("kes", {"WT": 20}, "that WT is an LT of 1.57"),
        ("fast", {"E20": 0.3}, "which must rise"),
        ("fast", {"C": "18"}, "'18' is not a positive number"),
    ],
)
def test_every_fault_is_one_sentence(tmp_path, kind, change, reason):
    ways = {way: dict(row) for way, row in (KES if kind == "kes" else FAST).items()}
    ways["warp"] |= change
    ways["warp"] = {key: repr(value).replace("'", '"') for key, value in ways["warp"].items() if value is not None}
    (tmp_path / "tests.toml").write_text(toml(kind, ways, "EB5 = 4.2" if kind == "fast" else ""))
    with pytest.raises(InputError, match=re.escape(reason)) as error:
        listing.read(tmp_path / "tests.toml")
    assert "\n" not in str(error.value)


def test_what_a_list_with_a_sheet_lacks(tmp_path):
    for text, reason in (
        (toml("fast", FAST), "fast.EB5 is missing"),
        ("kes = 3" + HEAD, "kes is not a table"),
        (f"{HEAD}[kes]\nwarp = 3\nweft = 4", "kes.warp is not a table"),
        (toml("kes", KES).replace("thickness_mm = 0.4", ""), "thickness_mm is missing"),
        (toml("kes", KES).replace('"Plain"', '""'), "weave is not a text"),
        (toml("kes", KES) + "[records]\n", "records is not a known key"),
    ):
        (tmp_path / "tests.toml").write_text(text)
        with pytest.raises(InputError, match=reason):
            listing.read(tmp_path / "tests.toml")
    with pytest.raises(InputError, match="do not tell nu12"):
        made(tmp_path, toml("kes", KES).replace("nu12 = 0.2", ""))


def test_the_shipped_sheet_is_a_fabric_that_bends_as_it_says(tmp_path):
    """B and 2HB of its bending cycle; the first command of the page from a KES sheet to a drape coefficient."""
    answer = CliRunner().invoke(app, ["identify", str(ROOT / "demos/records/kes_sheet.toml"), "--out", str(tmp_path)])
    assert answer.exit_code == 0 and "nu12: no dots, assumed" in answer.output, answer.output
    fabric = fabrics.load(str(tmp_path / "fabric.toml"))
    reach = np.linspace(-250, 250, 201)
    K = np.concatenate([reach[100:], reach[-2::-1], reach[1:]])
    for way, B, width in (("warp", 0.10, 0.05), ("weft", 0.08, 0.04)):
        curve = getattr(fabric.bending, way)
        M = loops.moments(K, curve, curve, fabric.bending.friction_per_m, True)
        assert loops.read_loop(K, M) == pytest.approx((B * 9.80665e-5, width * 9.80665e-3), rel=0.005)


@pytest.mark.slow
def test_from_a_kes_sheet_to_a_drape_coefficient(tmp_path):
    """Both commands and the page's own check, on a coarse disc."""
    words = ["--cell", "20", "--end", "0.8", "--out", str(tmp_path)]
    answer = subprocess.run(
        [sys.executable, str(ROOT / "demos/kes_to_drape.py"), *words],
        capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert answer.returncode == 0 and "come back: yes" in answer.stdout, answer.stdout + answer.stderr
    assert 60 < float(re.search(r"drape coefficient ([\d.]+) %, and", answer.stdout)[1]) < 95
    for name in ("report.pdf", "cusick/outline.png", "cusick/seed0/deformed.png"):
        assert (tmp_path / name).stat().st_size > 5000
