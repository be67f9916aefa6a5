"""The measured fabrics against the thesis's tables, transcribed here anew, and every way to refuse a file."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError

NAMES = ("blend", "duck", "muslin", "denim")
CURVES = ("warp", "weft", "shear")
each = pytest.mark.parametrize("name", NAMES)
each_curve = pytest.mark.parametrize("kind", CURVES)

# label, material, weave, thickness (mm), mass per unit area (g/m2), density (kg/m3)
TABLE_3_3 = {
    "blend": ("CRS8", "Cotton/Poly", "Plain", 0.38, 230, 590),
    "duck": ("WD10", "Cotton", "Basket", 0.62, 290, 470),
    "denim": ("BD11", "Cotton", "Twill", 1.12, 390, 350),
    "muslin": ("WM12", "Cotton", "Plain", 0.28, 100, 370),
}
# warp and weft displacement (mm)
TABLE_3_4 = {"blend": (18.0, 10.0), "denim": (20.0, 9.0), "duck": (6.0, 7.0), "muslin": (3.0, 10.0)}
# loading modulus (MPa) as it is printed, unloading modulus (MPa)
TABLE_7_1 = {
    ("blend", "warp"): (lambda E: 8.26e2 * E + 8, 8.64e2),
    ("blend", "weft"): (lambda E: 1.65e3 * E + 37, 1.08e3),
    ("duck", "warp"): (lambda E: 5.62e3 * E + 9, 1.57e3),
    ("duck", "weft"): (lambda E: -7.92e4 * E**3 + 4.83e4 * E**2 - 1.00e3 * E + 28, 8.87e2),
    ("muslin", "warp"): (lambda E: 1.53e4 * E + 9, 1.57e3),
    ("muslin", "weft"): (lambda E: 2.74e2 * E + 6, 2.05e2),
    ("denim", "warp"): (lambda E: 1.81e3 * E**3 - 2.00e2 * E**2 + 3 * E + 7, 3.85e2),
    ("denim", "weft"): (lambda E: 3.04e3 * E**3 + 6.24e3 * E**2 - 1.84e2 * E + 15, 4.02e2),
}
TABLE_7_2 = {"blend": (0.25, 0.42), "duck": (0.99, 0.68), "muslin": (2.04, 0.41), "denim": (0.12, 0.22)}
TABLE_7_3 = {
    "blend": (lambda E: -24 * E**3 + 90 * E**2 - 18 * E + 2, 12),
    "duck": (lambda E: -143 * E**3 + 105 * E**2 - 10 * E + 1, 14),
    "muslin": (lambda E: 22 * E**3 + 13 * E**2 - 8 * E + 2, 6),
    "denim": (lambda E: -53 * E**3 + 33 * E**2 - 4 * E + 1, 2),
}
TABLE_7_4 = {"duck": (0.40, 0.40), "muslin": (0.40, 0.40)}
TABLE_7_5 = {"blend": 1.09, "duck": 0.82, "muslin": 0.76, "denim": 0.43}  # initial G12 (MPa), "present"


def green(displacement_mm: float) -> float:
    """(3.2) on the gauge length of 3 inches."""
    stretch = 1 + displacement_mm / (3 * 25.4)
    return (stretch**2 - 1) / 2


def test_the_four_fabrics_are_there() -> None:
    assert set(fabrics.names()) == set(NAMES)


@each
def test_description_and_mass(name: str) -> None:
    fabric = fabrics.load(name)
    label, material, weave, thickness_mm, mass, density = TABLE_3_3[name]
    assert (fabric.name, fabric.label, fabric.material, fabric.weave) == (name, label, material, weave)
    assert fabric.thickness == pytest.approx(thickness_mm / 1000, rel=1e-14)
    assert fabric.density == density
    # Density is mass over thickness within the rounding of all three; Table 7.2's 370 for denim is not.
    lowest, highest = (mass - 5) / (thickness_mm + 0.005), (mass + 5) / (thickness_mm - 0.005)
    assert lowest - 5 <= fabric.density <= highest + 5


@each
def test_displacements_and_strip(name: str) -> None:
    fabric = fabrics.load(name)
    warp, weft = TABLE_3_4[name]
    expected = {"warp": warp / 1000, "weft": weft / 1000, "bias": 0.020}
    assert fabric.displacement == pytest.approx(expected, rel=1e-14)
    assert (fabric.gauge_length, fabric.width) == pytest.approx((3 * 0.0254, 0.0254), rel=1e-14)


@each
@pytest.mark.parametrize("kind", ("warp", "weft"))
def test_yarn_curve_is_table_7_1(name: str, kind: str) -> None:
    curve = getattr(fabrics.load(name), kind)
    loading, unloading = TABLE_7_1[name, kind]
    limit = green(TABLE_3_4[name][kind == "weft"])
    strain = np.linspace(0, limit, 50)
    assert curve.limit == pytest.approx(limit, rel=1e-13)
    assert curve.tangent(strain) == pytest.approx(1e6 * loading(strain), rel=1e-12)
    assert curve.unloading == pytest.approx(1e6 * unloading, rel=1e-14)
    assert len(curve.modulus) == 4


@each
def test_shear_curve_is_half_of_table_7_3_at_half_of_gamma(name: str) -> None:
    curve = fabrics.load(name).shear
    loading, unloading = TABLE_7_3[name]
    tensor = np.linspace(0, green(20.0), 50)
    assert curve.limit == pytest.approx(2 * 0.297, abs=1e-3)
    assert curve.tangent(2 * tensor) == pytest.approx(1e6 * loading(tensor) / 2, rel=1e-12)
    assert curve.unloading == pytest.approx(1e6 * unloading / 2, rel=1e-14)
    # The stress does not care how the strain is measured.
    assert curve.stress(2 * 0.25) == pytest.approx(1e6 * quad(loading, 0, 0.25)[0], rel=1e-12)
    assert len(curve.modulus) == 4


@each
def test_initial_shear_modulus_against_table_7_5(name: str) -> None:
    """Table 7.3 rounds to 1 MPa: half of it agrees within +- 0.25 MPa but for duck; all of it for duck alone."""
    half = float(fabrics.load(name).shear.tangent(0)) / 1e6
    assert (abs(half - TABLE_7_5[name]) <= 0.25) == (name != "duck")
    assert (abs(2 * half - TABLE_7_5[name]) <= 0.5) == (name == "duck")


@each
def test_poisson_ratios(name: str) -> None:
    poisson = fabrics.load(name).poisson
    assert poisson == {"measured": TABLE_7_2[name], "lowered": TABLE_7_4.get(name, TABLE_7_2[name])}


@each
def test_every_number_has_its_table(name: str) -> None:
    sources = fabrics.load(name).sources
    tables = {
        "thickness_mm": "3.3",
        "density_kg_per_m3": "3.3",
        "warp": "7.1",
        "weft": "7.1",
        "shear": "7.3",
        "poisson": "7.2",
        "test": "3.4",
    }
    assert sources.keys() == tables.keys()
    assert all(f"Table {table}" in sources[key].replace("Tables", "Table") for key, table in tables.items())


@each
@each_curve
def test_stress_is_the_integral_of_the_tangent(name: str, kind: str) -> None:
    curve = getattr(fabrics.load(name), kind)
    for strain in np.array([-0.3, 0.0, 0.4, 1.0, 1.7]) * curve.limit:
        area = quad(curve.tangent, 0, strain, points=[curve.limit], epsrel=1e-12)[0]
        assert curve.stress(strain) == pytest.approx(area, rel=1e-10, abs=1e-6)


@each
@each_curve
def test_smooth_at_the_limit_and_straight_outside(name: str, kind: str) -> None:
    curve = getattr(fabrics.load(name), kind)
    before, at, after = curve.limit * (1 + np.array([-1e-9, 0, 1e-9]))
    assert curve.tangent([before, after]) == pytest.approx(2 * [float(curve.tangent(at))], rel=1e-7)
    assert curve.stress(after) - curve.stress(before) == pytest.approx(curve.tangent(at) * (after - before), rel=1e-5)
    assert curve.tangent(10.0) == curve.tangent(at)  # never bends down, as the fitted polynomials do
    assert curve.tangent(-1.0) == curve.modulus[0]
    assert curve.stress(-1.0) == -curve.modulus[0]


def test_shapes_and_nan() -> None:
    curve = fabrics.load("duck").weft
    strain = np.array([[-0.1, 0.05, 0.3], [np.nan, 0.0, 2.0]])
    for function in (curve.stress, curve.tangent):
        assert function(strain).shape == strain.shape
        assert (np.isnan(function(strain)) == np.isnan(strain)).all()


@each
def test_plot(name: str, tmp_path: Path) -> None:
    fabric = fabrics.load(name)
    figure = fabric.plot(tmp_path / "curves.png")
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    assert name in figure.get_suptitle()
    for axes, kind in zip(figure.axes, CURVES, strict=True):
        curve = getattr(fabric, kind)
        loading, beyond, unloading, _ = axes.lines
        assert [line.get_linestyle() for line in (loading, beyond, unloading)] == ["-", ":", "--"]
        assert loading.get_xdata()[-1] == beyond.get_xdata()[0] == unloading.get_xdata()[0] == curve.limit
        assert loading.get_ydata()[-1] == pytest.approx(float(curve.stress(curve.limit)) / 1e6)
        (start, end), (high, low) = unloading.get_data()
        assert (low, (high - low) / (start - end)) == pytest.approx((0, curve.unloading / 1e6))
        assert "MPa" in axes.get_ylabel()
        assert "strain" in axes.get_xlabel()


OWN = """
name = "linen"
label = "L1"
material = "Flax"
weave = "Plain"
thickness_mm = 0.5
density_kg_per_m3 = 440
[warp]
loading_MPa = [10, 200.5]
unloading_MPa = 900
[weft]
loading_MPa = [12, -100, 2e3, 5]
unloading_MPa = 800
limit_strain = 0.08
[shear]
strain = "engineering"
loading_MPa = [0.5]
unloading_MPa = 3
[poisson]
measured = { nu12 = 0.3, nu21 = 0 }
[test]
gauge_length_mm = 100
width_mm = 50
warp_displacement_mm = 10
weft_displacement_mm = 5
bias_displacement_mm = 30
"""


def write(folder: Path, text: str | bytes) -> Path:
    file = folder / "own.toml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def test_own_fabric(tmp_path: Path) -> None:
    file = write(tmp_path, OWN)
    own = fabrics.load(file)
    assert own == fabrics.Fabric(
        name="linen",
        label="L1",
        material="Flax",
        weave="Plain",
        thickness=0.5e-3,
        density=440.0,
        warp=fabrics.Curve((10e6, 200.5e6, 0.0, 0.0), 900e6, own.warp.limit),
        weft=fabrics.Curve((12e6, -100e6, 2e9, 5e6), 800e6, 0.08),
        shear=fabrics.Curve((0.5e6, 0.0, 0.0, 0.0), 3e6, own.shear.limit),  # G12 as is
        poisson={"measured": (0.3, 0.0), "lowered": (0.3, 0.0)},
        gauge_length=0.1,
        width=0.05,
        displacement={"warp": 0.01, "weft": 0.005, "bias": 0.03},
        sources={},
    )
    assert own.warp.limit == pytest.approx(0.1 + 0.005)
    assert own.shear.limit == pytest.approx(2 * (0.3 + 0.045))
    assert fabrics.load(str(file)) == own
    assert fabrics.load(write(tmp_path, b"\xef\xbb\xbf" + OWN.replace("\n", "\r\n").encode())) == own  # from Windows


def test_stiffness_across_and_its_source(tmp_path: Path) -> None:
    table = '[transverse]\nwarp = 0.2\nweft = 0.15\nsource = "contraction of clamped strips"\n'
    own = fabrics.load(write(tmp_path, OWN + table))
    assert (own.transverse, own.transverse_source) == ((0.2, 0.15), "contraction of clamped strips")
    without = fabrics.load(write(tmp_path, OWN))
    assert (without.transverse, without.transverse_source) == ((0.3, 0.3), "assumed")


def test_limit_strain_of_a_tensor_curve_is_a_tensor_strain(tmp_path: Path) -> None:
    text = OWN.replace('"engineering"', '"tensor"\nlimit_strain = 0.2')
    assert fabrics.load(write(tmp_path, text)).shear == fabrics.Curve((0.25e6, 0.0, 0.0, 0.0), 1.5e6, 0.4)


@each
def test_a_built_in_file_is_a_pattern(name: str, tmp_path: Path) -> None:
    text = (Path(fabrics.__file__).parent / f"{name}.toml").read_text()
    assert fabrics.load(write(tmp_path, text)) == fabrics.load(name)


# what to replace in OWN, by what, and what the message must contain beside the file's name
FAULTS = {
    "missing text": ('name = "linen"', "", ["name is missing", "add it"]),
    "missing number": ("thickness_mm = 0.5", "", ["thickness_mm is missing"]),
    "missing table": ("[shear]\n", "[shearing]\n", ["shearing", "not a known key", "perhaps shear is meant"]),
    "missing in table": ("unloading_MPa = 900", "", ["warp.unloading_MPa is missing"]),
    "missing measure": ('strain = "engineering"', "", ["shear.strain is missing"]),
    "missing ratio": (", nu21 = 0 ", "", ["poisson.measured.nu21 is missing"]),
    "unknown key": ("thickness_mm", "thickness_m", ["thickness_m = 0.5", "perhaps thickness_mm is meant"]),
    "unknown far": ("[warp]", "zz = 1\n[warp]", ["zz = 1", "known here are name, label"]),
    "unknown in table": ("width_mm", "widht_mm", ["test.widht_mm = 50", "perhaps test.width_mm is meant"]),
    "unknown source": ("[warp]", '[sources]\nwrap = "me"\n[warp]', ["sources.wrap = 'me'", "sources.warp"]),
    "limit of nothing": ("[poisson]", "[poisson]\nlimit_strain = 1", ["poisson.limit_strain = 1"]),
    "text as number": ("= 0.5\n", '= "0.5"\n', ["thickness_mm = '0.5'", "not a number", "without quotes"]),
    "boolean": ("width_mm = 50", "width_mm = true", ["test.width_mm = True", "not a number"]),
    "date": ("width_mm = 50", "width_mm = 2024-01-01", ["test.width_mm", "not a number"]),
    "number as text": ('"Flax"', "7", ["material = 7", "not a text"]),
    "empty text": ('"linen"', '" "', ["name = ' '", "not a text"]),
    "number as table": ("measured = { nu12 = 0.3, nu21 = 0 }", "measured = 3", ["poisson.measured = 3", "not a table"]),
    "number as list": ("[0.5]", "0.5", ["shear.loading_MPa = 0.5", "not a list of one to four"]),
    "text in list": ("200.5", '"200.5"', ["warp.loading_MPa", "'200.5'", "not a number"]),
    "boolean in list": ("200.5", "false", ["warp.loading_MPa", "False", "not a number"]),
    "negative": ("density_kg_per_m3 = 440", "density_kg_per_m3 = -440", ["density_kg_per_m3 = -440", "positive"]),
    "zero": ("thickness_mm = 0.5", "thickness_mm = 0", ["thickness_mm = 0", "not positive"]),
    "zero displacement": ("bias_displacement_mm = 30", "bias_displacement_mm = 0.0", ["test.bias_displacement_mm ="]),
    "zero limit": ("limit_strain = 0.08", "limit_strain = 0", ["weft.limit_strain = 0", "not positive"]),
    "zero unloading": ("unloading_MPa = 3", "unloading_MPa = 0", ["shear.unloading_MPa = 0", "not positive"]),
    "nan": ("width_mm = 50", "width_mm = nan", ["test.width_mm = nan", "not a finite"]),
    "infinite": ("unloading_MPa = 900", "unloading_MPa = inf", ["warp.unloading_MPa = inf", "not a finite"]),
    "nan in list": ("200.5", "nan", ["warp.loading_MPa = [10, nan]", "not a finite"]),
    "nan ratio": ("nu21 = 0", "nu21 = nan", ["poisson.measured.nu21 = nan", "not a finite"]),
    "in micrometres": ("thickness_mm = 0.5", "thickness_mm = 500", ["thickness_mm = 500 is not below test.width_mm"]),
    "huge": ("thickness_mm = 0.5", "thickness_mm = 1" + 400 * "0", ["thickness_mm = 1000", "not a finite"]),
    "five coefficients": ("[0.5]", "[1, 0, 0, 0, 0]", ["shear.loading_MPa = [1, 0, 0, 0, 0]", "one to four"]),
    "no coefficient": ("[0.5]", "[]", ["shear.loading_MPa = []", "one to four"]),
    "soft at zero": ("[10, 200.5]", "[0, 200.5]", ["warp.loading_MPa = [0, 200.5]", "strain 0,", "raise the first"]),
    "soft at the end": ("[10, 200.5]", "[10, -100]", ["warp.loading_MPa", "strain 0.1001,", "warp.limit_strain"]),
    # 12 - 800 E + 12000 E^2 has its lowest value, -4/3, at 1/30 and is 12 or more at both ends
    "soft in between": ("[12, -100, 2e3, 5]", "[12, -800, 1.2e4]", ["weft.loading_MPa", "strain 0.02", "not positive"]),
    # 1e4 ((E - 0.0334)^2 - 1e-10): a dip between two samples
    "soft at one point": ("[12, -100, 2e3, 5]", "[11.155599, -668, 1e4]", ["weft.loading_MPa", "strain 0.0334,"]),
    "creates energy": ("unloading_MPa = 900", "unloading_MPa = 30", ["warp.unloading_MPa = 30", "31.05 MPa", "energy"]),
    "ratios": ("nu12 = 0.3, nu21 = 0", "nu12 = 2, nu21 = 0.5", ["poisson.measured.nu12 = 2", "nu21 = 0.5", "below 1"]),
    "lowered ratios": ("[test]", "lowered = { nu12 = 3, nu21 = 1 }\n[test]", ["poisson.lowered.nu12 = 3", "below 1"]),
    "negative ratio": ("nu12 = 0.3", "nu12 = -0.3", ["poisson.measured.nu12 = -0.3", "negative", "sign"]),
    "unknown measure": ('"engineering"', '"gamma"', ["shear.strain = 'gamma'", '"tensor"', '"engineering"']),
    "measure no text": ('"engineering"', "[2]", ["shear.strain = [2]", '"tensor"']),
    "no source": ("[warp]", "transverse = {warp = 1, weft = 1}\n[warp]", ["transverse.source is missing"]),
    "its source": ("[warp]", 'transverse = {warp = 1, weft = 1, source = ""}\n[warp]', ["known are assumed, biaxial"]),
    "none across": ("[warp]", 'transverse = {warp = 1, weft = 0, source = "assumed"}\n[warp]', ["transverse.weft = 0"]),
    "broken line": ('material = "Flax"', "material = Flax", ["not TOML", "line 4"]),
    "too deep": ("[0.5]", 5000 * "[", ["not TOML"]),
    "same key twice": ('label = "L1"', 'name = "x"', ["not TOML", "line 3"]),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_file_is_refused_in_one_sentence(fault: str, tmp_path: Path) -> None:
    old, new, expected = FAULTS[fault]
    assert OWN.count(old) == 1
    file = write(tmp_path, OWN.replace(old, new))
    with pytest.raises(InputError) as caught:
        fabrics.load(file)
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert [part for part in expected if part not in message] == []
    assert message.endswith(".")
    assert "\n" not in message
    assert ". " not in message


def test_file_that_is_no_text(tmp_path: Path) -> None:
    file = write(tmp_path, OWN.replace("Flax", "Lin \xe9cru").encode("latin-1"))
    with pytest.raises(InputError, match=r"own\.toml: is not TOML, for line 4 is not UTF-8"):
        fabrics.load(file)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.toml: cannot be read \(No such file"):
        fabrics.load(tmp_path / "gone.toml")
    with pytest.raises(InputError, match=r"cannot be read \(Is a directory"):
        fabrics.load(f"{tmp_path}{os.sep}")


@pytest.mark.parametrize("name", ("silk", "Blend", "", "blend.tml"))
def test_unknown_name_lists_the_known(name: str) -> None:
    with pytest.raises(InputError, match=f"'{name}' is no known fabric; give blend, denim, duck, muslin, or"):
        fabrics.load(name)


@pytest.mark.parametrize("thing", (None, 3, True))
def test_neither_name_nor_path(thing: object) -> None:
    with pytest.raises(InputError, match=f"{thing} is no fabric"):
        fabrics.load(thing)  # type: ignore[arg-type]


def test_denim_with_table_7_3_over_engineering_strain_is_refused(tmp_path: Path) -> None:
    """The evidence for the tensor reading: otherwise denim's modulus turns negative inside the tested range."""
    text = (Path(fabrics.__file__).parent / "denim.toml").read_text()
    text = text.replace('strain = "tensor"', 'strain = "engineering"')
    with pytest.raises(
        InputError, match=r"shear\.loading_MPa = \[1, -4, 33, -53\] .* at strain 0\.548\d*, not positive"
    ):
        fabrics.load(write(tmp_path, text))


@settings(max_examples=300, deadline=None)
@given(
    numbers=st.lists(st.floats() | st.floats(-2, 2) | st.integers(), min_size=12, max_size=12),
    degree=st.integers(1, 5),
)
def test_any_numbers_give_a_sound_fabric_or_a_refusal(numbers: list[float], degree: int, tmp_path_factory) -> None:
    text = OWN
    new = [f"{number}" for number in numbers]
    text = text.replace("[10, 200.5]", f"[{', '.join(new[:degree])}]").replace("900", new[5])
    text = text.replace("nu12 = 0.3, nu21 = 0", f"nu12 = {new[6]}, nu21 = {new[7]}")
    text = text.replace("gauge_length_mm = 100", f"gauge_length_mm = {new[8]}").replace("0.08", new[9])
    text = text.replace("warp_displacement_mm = 10", f"warp_displacement_mm = {new[10]}")
    file = write(tmp_path_factory.getbasetemp(), text)
    try:
        fabric = fabrics.load(file)
    except InputError:
        return
    for kind in CURVES:
        curve = getattr(fabric, kind)
        moduli = curve.tangent(np.linspace(-1, 2, 301) * curve.limit)
        assert (moduli > 0).all()
        assert (moduli <= curve.unloading * (1 + 1e-12)).all()
    nu12, nu21 = fabric.poisson["measured"]
    assert 0 <= nu12 * nu21 < 1
