"""Bending in the list of tests of a fabric: round trips from synthetic records, units, faults, report and file."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import BendingCurve, BendingCurves
from fabric_fenicsx.fabrics.bending import bias_of_twist
from fabric_fenicsx.identify import fabric_file, identify, listing
from fabric_fenicsx.identify.bending import elastica
from fabric_fenicsx.identify.bending import fit as bending_fit
from fabric_fenicsx.identify.bending import tests as bending_tests
from fabric_fenicsx.identify.bending.elastica import Beam
from fabric_fenicsx.identify.files import units
from fabric_fenicsx.identify.report import page as report
from fabric_fenicsx.identify.synthetic import synthetic, synthetic_bending

CURVES = BendingCurves(
    BendingCurve(12e-6, -10e-9, 0.5e-3),
    BendingCurve(8e-6, 0.0, 0.3e-3),
    BendingCurve(5e-6, 0.0, 0.2e-3),
    friction_per_m=12.0,
)
KNOWN = replace(fabrics.load("blend"), bending=CURVES)
MASS = KNOWN.areal_mass


def listed(entries):
    return bending_tests.read("t.toml", entries)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The fabric identified from its records, and its folder."""
    folder = tmp_path_factory.mktemp("bent")
    return identify(listing.read(synthetic.write(KNOWN, folder))), folder


def test_a_fabric_with_bending_comes_back_from_its_records(found):
    """KES loops and overhangs, 2 % noise, 3 specimens: B and 2HB within 5 %, of twist, a difference, within 10."""
    answer, folder = found
    path, again = fabric_file.write(answer, folder)
    for way in ("warp", "weft"):
        true, seen = getattr(CURVES, way), getattr(again.bending, way)
        assert seen.B == pytest.approx(true.B, rel=0.05) and seen.hysteresis == pytest.approx(true.hysteresis, rel=0.05)
    assert again.bending.warp.softening == pytest.approx(-10e-9, rel=0.1) and again.bending.weft.softening == 0
    assert again.bending.twist.B == pytest.approx(5e-6, rel=0.1)
    assert again.bending.friction_per_m == pytest.approx(12, rel=0.05)
    assert set(answer.bending.curves.assumed) == {"friction of twist"} and "# assumed friction" in path.read_text()
    assert not any("differ by more" in note for note in answer.notes)
    figure = report.draw(answer)
    titles = [axes.get_title() for axes in figure.axes]
    assert "bending" in titles and "overhangs" in titles
    panel = figure.axes[titles.index("overhangs")]
    assert any(len(line.get_xdata()) == 15 for line in panel.lines)  # 3 specimens at 5 overhangs
    assert "B by loops" in figure.axes[-1].texts[0].get_text() + "".join(t.get_text() for t in figure.axes[-1].texts)


def test_kes_numbers_and_bending_lengths_agree_where_the_law_is_straight():
    """B and 2HB of KES, and lengths of a strip with that friction: each alone, and both."""
    rng = np.random.default_rng(3)
    curve = BendingCurve(10e-6, 0.0, 0.5e-3)
    numbers = synthetic_bending.numbers(curve, MASS, 15.0, 3, 0.02, rng)
    both = bending_fit.fit(listed({"warp": numbers, "weft": numbers}), MASS)
    kinds = both.ways["warp"].kinds
    assert kinds.keys() == {"KES", "bending lengths"}
    for e in kinds.values():
        assert abs(e.value - 10e-6) < 4 * e.error < 4e-6  # a length counts three times
    assert both.curves.warp.B == pytest.approx(10e-6, rel=0.05) and both.curves.assumed.keys() == {"twist", "friction"}
    lengths = {"bending_length_mm": numbers["bending_length_mm"]}
    alone = bending_fit.fit(listed({"warp": lengths, "weft": lengths}), MASS)
    assert alone.curves.warp.B > 13e-6 and not alone.curves.warp.hysteresis  # B holds the friction
    assert any("add no 2HB" in word for word in alone.undetermined)


def test_a_heart_loop_knows_the_friction_of_another_test():
    curve = BendingCurve(10e-6, 0.0, 0.5e-3)
    height = 1e3 * elastica.heart_loop(Beam(curve, MASS), 0.15)
    entries = {"heart_length_mm": 150, "heart_height_mm": [height, height], "2HB_mN": 0.5}
    both = bending_fit.fit(listed({"warp": entries, "weft": entries}), MASS)
    assert both.curves.warp.B == pytest.approx(10e-6, rel=1e-3) and both.curves.warp.hysteresis == 0.5e-3


@pytest.mark.parametrize("wide", [False, True])
def test_a_bias_strip_is_narrow_or_wide(wide):
    """The twist comes back from KES numbers of either, and without bias_strip KES's is wide."""
    linear = [BendingCurve(c.B, 0.0, c.hysteresis) for c in (CURVES.warp, CURVES.weft, CURVES.twist)]
    bias = bias_of_twist(*linear, wide)
    rows = {
        way: {"B_uN_m": 1e6 * c.B, "2HB_mN": 1e3 * c.hysteresis}
        for way, c in zip(("warp", "weft", "bias"), [*linear[:2], bias], strict=True)
    }
    said = {} if wide else {"bias_strip": "narrow"}
    curves = bending_fit.fit(listed(rows | said), MASS).curves
    assert curves.twist.B == pytest.approx(5e-6) and curves.twist.hysteresis == pytest.approx(0.2e-3)


def test_tests_that_disagree_are_told():
    entries = {"B_uN_m": [10, 10.2], "2HB_mN": 0.1, "bending_length_mm": [25, 25.2]}
    fit = bending_fit.fit(listed({"warp": entries, "weft": entries}), MASS)
    assert len(fit.notes) == 2 and "wrong unit or another cloth" in fit.notes[0]


@pytest.mark.parametrize(
    ("key", "si"),
    [("B_gf_cm2_per_cm", 9.80665e-5), ("B_uN_m", 1e-6), ("B_uNm", 1e-6), ("B_cN_cm2_per_cm", 1e-4), ("B_cN_cm", 1e-4),
     ("B_N_m", 1.0), ("2HB_gf_cm_per_cm", 9.80665e-3), ("2HB_mN", 1e-3), ("2HB_cN_cm_per_cm", 1e-2),
     ("2HB_N_m_per_m", 1.0), ("overhang_in", 0.0254), ("angle_deg", np.pi / 180), ("bending_length_cm", 0.01)],
)  # fmt: skip
def test_units_of_keys(key, si):
    name, factor = bending_tests._quantity("t.toml", "bending.warp", key)
    assert factor == pytest.approx(si) and key.startswith(name)


@pytest.mark.parametrize(
    ("head", "unit"),
    [
        ("Moment (gf·cm/cm)", 9.80665e-3),
        ("M [gf cm/cm]", 9.80665e-3),
        ("moment_mN", 1e-3),
        ("曲げモーメント (cN・cm/cm)", 1e-2),
    ],
)
def test_a_loop_is_read_in_its_units(tmp_path, head, unit):
    file = tmp_path / "loop.csv"
    rows = "\n".join(f"{k / 100:.4f};{k:.3f}" for k in synthetic_bending.LOOP)
    curvature = "曲率" if "曲" in head else "K" if head.startswith("M [") else "curvature"
    file.write_text(f"Kato Tech\n{curvature} (1/cm);{head}\n{rows}\n", encoding="utf-8")
    loop = bending_tests.read_loop(file)
    assert loop.curvature == pytest.approx(synthetic_bending.LOOP)
    assert loop.moment == pytest.approx(unit * synthetic_bending.LOOP)


def test_names_end_in_units():
    assert units.split("curvature_per_m") == ("curvature", "1/m")
    assert units.split("moment_gf_cm_per_cm") == ("moment", "gfcm/cm")
    assert units.split("load_N_per_mm") == ("load", "N/mm") and units.split("time_s") == ("time", "s")
    assert units.split("warp_stretch") == ("warp stretch", None)
    assert units.factor("daN/5cm") == ("force per width", pytest.approx(200.0))
    assert units.factor("N / 5 cm") == ("force per width", pytest.approx(20.0))


WARP = {"B_uN_m": 10, "2HB_mN": 0.1}


@pytest.mark.parametrize(
    ("entries", "reason"),
    [
        ([], "bending is not a table"),
        ({"wrap": WARP}, "bending.wrap is not a known key; known is warp"),
        ({"warp": WARP}, "no tests along the weft"),
        ({"warp": WARP, "weft": WARP, "bias_strip": "narrow"}, "no use without tests under"),
        ({"warp": WARP, "weft": WARP, "bias": WARP, "bias_strip": "thin"}, "'thin' is not narrow"),
        ({"warp": WARP, "weft": WARP, "bias": WARP | {"bending_length_mm": 20}}, "leave one of them out"),
        ({"warp": {}, "weft": WARP}, "bending.warp is not a table with tests"),
        ({"warp": WARP | {"bend_length_mm": 20}, "weft": WARP}, "bend_length_mm is not a known key; known is bend"),
        ({"warp": {"B_uN": 10}, "weft": WARP}, "B_uN does not end in a unit of bending rigidity; write it as B_gf"),
        ({"warp": {"B": 10}, "weft": WARP}, "B does not end in a unit"),
        ({"warp": {"B_N_m": 10, "2HB_mN": 0.1}, "weft": WARP}, "is not between 0.01 and 1e+04 uN m"),
        ({"warp": WARP | {"B_mN_m": 0.01}, "weft": WARP}, "gives B in two units"),
        ({"warp": WARP | {"B_uN_m": "10"}, "weft": WARP}, "'10' is not a number"),
        ({"warp": WARP | {"B_uN_m": [10, float("nan")]}, "weft": WARP}, "nan is not between"),
        ({"warp": {"B_uN_m": 10}, "weft": WARP}, "B of KES without 2HB"),
        ({"warp": {"2HB_mN": 1}, "weft": WARP}, "gives 2HB alone"),
        ({"warp": {"overhang_mm": [30, 40], "angle_deg": 20}, "weft": WARP}, "has 2 of overhang and 1 of angle"),
        ({"warp": {"loops": "a.csv"}, "weft": WARP}, "loops is not a list of files"),
        ({"warp": {"bending_length_mm": 2050}, "weft": WARP}, "2050 is not between 1 and 200 mm"),
    ],
)  # fmt: skip
def test_every_fault_is_one_sentence(entries, reason):
    with pytest.raises(InputError, match=re.escape(reason)) as error:
        listed(entries)
    assert str(error.value).startswith("t.toml: ") and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("time,force\n1,2\n", "no line names its columns, one with curvature"),
        ("curvature (1/cm),moment (N/m)\n" + "1,2\n" * 20, "a unit of force per width"),
        ("curvature,moment (mN)\n" + "1,2\n" * 20, "has no unit"),
        ("curvature (1/cm),moment (mN),moment 2 (mN)\n" + "1,2,3\n" * 20, "could be the moment"),
        ("curvature (1/cm),moment (mN)\n1,2\n", "loop.csv: a loop needs at least 10"),
    ],
)
def test_faults_of_loops(tmp_path, text, reason):
    (tmp_path / "loop.csv").write_text(text)
    entries = {"loops": ["loop.csv"]}
    with pytest.raises(InputError, match=reason):
        bending_fit.fit(bending_tests.read(tmp_path / "t.toml", {"warp": entries, "weft": WARP}), MASS)
