"""The table [bending] of a fabric file, what is assumed where nothing was measured, and every way to refuse it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_fabrics import OWN, write

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import BendingCurve, estimated_bending
from fabric_fenicsx.fabrics.bending import bias_of_twist, published, quantile, twist_of_bias
from fabric_fenicsx.laws.bending import Bending

BENDING = """
[bending]
warp = { B_uNm = 13.8, softening_nNm2 = -35.6, hysteresis_mN = 0.5 }
weft = { B_uNm = 8.8, hysteresis_mN = 0.3 }
bias = { B_uNm = 16, hysteresis_mN = 0.6 }
bias_strip = "wide"
back = { warp = { B_uNm = 12 } }
coupling_uNm = 0.5
friction_per_m = 20
"""


def load(folder, text=BENDING):
    return fabrics.load(write(folder, OWN + text))


def test_every_key_is_read(tmp_path):
    read = load(tmp_path).bending
    assert read.warp == BendingCurve(1e-6 * 13.8, 1e-9 * -35.6, 1e-3 * 0.5)
    assert read.weft == BendingCurve(1e-6 * 8.8, 0.0, 1e-3 * 0.3)
    assert read.twist.B == pytest.approx(16e-6 - (13.8e-6 + 8.8e-6 + 1e-6) / 4)
    assert read.twist.softening == pytest.approx(35.6e-9 / 8) and read.twist.hysteresis == pytest.approx(0.2e-3)
    assert read.back == (BendingCurve(1e-6 * 12), read.weft)
    assert (read.coupling, read.friction_per_m, read.assumed) == (pytest.approx(0.5e-6), 20.0, {})
    assert "assumed" not in str(read) and "2HB 0.5 mN" in read.describe()
    assert load(tmp_path, "").bending is None


def test_a_narrow_strip_and_twist_itself(tmp_path):
    text = '[bending]\nwarp = { B_uNm = 12 }\nweft = { B_uNm = 8 }\nbias = { B_uNm = 10 }\nbias_strip = "narrow"\n'
    twist = load(tmp_path, text).bending.twist
    assert 1 / twist.B == pytest.approx(4 / 10e-6 - 1 / 12e-6 - 1 / 8e-6)
    given = text.split("bias")[0] + f"twist = {{ B_uNm = {1e6 * twist.B!r} }}"
    again = load(tmp_path, given).bending
    assert again.twist.B == pytest.approx(twist.B) and again.warp == load(tmp_path, text).bending.warp


def test_what_is_left_out_is_assumed_and_said(tmp_path):
    text = "[bending]\nwarp = { B_uNm = 12, softening_nNm2 = -30, hysteresis_mN = 0.4 }\n"
    read = load(tmp_path, text + "weft = { B_uNm = 8, softening_nNm2 = -20, hysteresis_mN = 0.2 }").bending
    mean, ratio = np.sqrt(12e-6 * 8e-6), 0.967
    bare = (BendingCurve(12e-6), BendingCurve(8e-6), BendingCurve(read.twist.B))
    assert bias_of_twist(*bare, wide=False).B == pytest.approx(ratio * mean)
    part = read.twist.B / mean
    assert read.twist.softening == pytest.approx(-part * np.sqrt(600e-18))
    assert read.twist.hysteresis == pytest.approx(part * np.sqrt(0.08e-6)) and read.friction_per_m == 15.0
    assert read.assumed.keys() == {"twist", "friction"} and "15 1/m" in read.assumed["friction"]
    assert read.describe().count("(assumed)") == 1 and "assumed twist: no bias strip" in repr(Bending(read))


def test_a_fabric_without_it_is_estimated_from_its_mass():
    """B = mass g c^3, c the median bending length of 618 fabrics; nothing of it looks measured."""
    for name in fabrics.names():
        fabric = fabrics.load(name)
        assert fabric.bending is None
        found = fabric.bending_or_estimate()
        assert found.warp.B == pytest.approx(fabric.areal_mass * 9.80665 * 0.01998**3)
        assert found.weft.B == pytest.approx(fabric.areal_mass * 9.80665 * 0.01733**3)
        assert bias_of_twist(found.warp, found.weft, found.twist, wide=False).B == pytest.approx(
            fabric.areal_mass * 9.80665 * 0.01922**3
        )
        assert not (found.warp.softening or found.warp.hysteresis)
        assert (
            str(found).count("(assumed)") == 3
            and "assumed bending: not measured" in str(found)
            and "618" in repr(Bending.from_fabric(fabric))
        )
    low, high = (estimated_bending(0.2, percent).warp.B for percent in (5, 95))
    assert low == pytest.approx(0.2 * 9.80665 * 0.01059**3) and high == pytest.approx(0.2 * 9.80665 * 0.03286**3)
    assert "95 % quantile" in str(estimated_bending(0.2, 95))


def test_published_quantiles_are_percentiles():
    table = published()
    for name, values in table.items():
        assert len(values) == 7 and (np.diff(values) > 0).all(), name
    assert quantile("B1_warp_uNm", 50) == 13.778 and quantile("B1_weft_uNm", 60) > 8.756


# what to replace in BENDING, by what, and what the message must contain beside the file's name
FAULTS = {
    "not a table": ("back = { warp = { B_uNm = 12 } }", "back = 3", ["bending.back = 3", "not a table"]),
    "unknown key": ("friction_per_m", "friction_per_mm", ["bending.friction_per_mm = 20", "friction_per_m is meant"]),
    "no weft": ("weft = {", "bias_ = {", ["bending.bias_ =", "not a known key"]),
    "no B": ("B_uNm = 8.8, ", "", ["bending.weft.B_uNm is missing"]),
    "B of zero": ("B_uNm = 8.8", "B_uNm = 0", ["bending.weft.B_uNm = 0", "not positive"]),
    "B as text": ("B_uNm = 8.8", 'B_uNm = "8.8"', ["bending.weft.B_uNm = '8.8'", "not a number"]),
    "negative hysteresis": ("= 0.3", "= -0.3", ["bending.weft.hysteresis_mN = -0.3", "create energy", "zero or more"]),
    "softening in other units": ("-35.6", "-3.56e4", ["warp.softening_nNm2 = -35600.0", "0.194 1/m", "below 690"]),
    "bias and twist": ("friction", "twist = { B_uNm = 5 }\nfriction", ["bending.twist =", "both", "keep the one"]),
    "which strip": ('bias_strip = "wide"\n', "", ["bending.bias_strip is missing", '"narrow"', '"wide"', "KES"]),
    "no such strip": ('"wide"', '"broad"', ["bending.bias_strip = 'broad'", "known are narrow, wide"]),
    "strip of nothing": ("bias = { B_uNm = 16, hysteresis_mN = 0.6 }\n", "", ["bias_strip = 'wide'", "there is none"]),
    "wide and too soft": ("B_uNm = 16", "B_uNm = 5.9", ["bias.B_uNm = 5.9", "not above 5.9,", '"narrow" if it was']),
    "less friction": ("= 0.6", "= 0.39", ["bending.bias.hysteresis_mN = 0.39", "below 0.4", "wide strip"]),
    "no friction": (", hysteresis_mN = 0.6", "", ["bias.hysteresis_mN is below 0.4", "which is left out"]),
    "coupling": ("coupling_uNm = 0.5", "coupling_uNm = 4", ["bending.coupling_uNm = 4", "not below 3.48", "smaller"]),
    "friction of the back": ("B_uNm = 12 }", "B_uNm = 12, hysteresis_mN = 1 }", ["back.warp.hysteresis_mN = 1"]),
    "empty back": ("{ warp = { B_uNm = 12 } }", "{}", ["bending.back.warp and weft are both missing"]),
    "twist of the back": ("{ warp = { B_uNm = 12 } }", "{ twist = {} }", ["bending.back.twist", "warp, weft"]),
    "spread of zero": ("friction_per_m = 20", "friction_per_m = 0", ["bending.friction_per_m = 0", "not positive"]),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_refused_in_one_sentence(fault, tmp_path):
    old, new, expected = FAULTS[fault]
    assert BENDING.count(old) == 1
    file = write(tmp_path, OWN + BENDING.replace(old, new))
    with pytest.raises(InputError) as caught:
        fabrics.load(file)
    message = str(caught.value)
    assert message.startswith(f"{file}: ") and message.endswith(".") and "\n" not in message and ". " not in message
    assert [part for part in expected if part not in message] == []


def test_other_faults(tmp_path):
    straight = "[bending]\nwarp = { B_uNm = 12 }\nweft = { B_uNm = 8 }\n"
    with pytest.raises(InputError, match=r"friction_per_m = 15 has no hysteresis to build up"):
        load(tmp_path, straight + "friction_per_m = 15")
    with pytest.raises(InputError, match=r'bias\.B_uNm = 20 is not below 19\.2, .* narrow strip; .*"wide" if it was'):
        load(tmp_path, straight + 'bias = { B_uNm = 20 }\nbias_strip = "narrow"')
    with pytest.raises(InputError, match=r"bending\.bias is missing, and warp and weft are too far apart"):
        load(tmp_path, "[bending]\nwarp = { B_uNm = 200 }\nweft = { B_uNm = 2 }\n")


def test_a_coupling_as_large_as_warp_and_weft_is_refused_by_its_name(tmp_path):
    text = "[bending]\nwarp = { B_uNm = 1 }\nweft = { B_uNm = 1 }\ncoupling_uNm = 1\n"
    with pytest.raises(InputError, match=r"coupling_uNm = 1 is not below 1, the geometric mean"):
        load(tmp_path, text + 'bias = { B_uNm = 1 }\nbias_strip = "narrow"')
    with pytest.raises(InputError, match="is too large for its warp and weft"):
        twist_of_bias(BendingCurve(1e-6), BendingCurve(1e-6), BendingCurve(1e-6), False, 1e-6)


@settings(max_examples=200, deadline=None)
@given(numbers=st.lists(st.floats() | st.floats(-3, 30) | st.integers(), min_size=10, max_size=10), wide=st.booleans())
def test_any_numbers_give_a_sound_law_or_a_refusal(numbers, wide, tmp_path_factory):
    text = BENDING.replace('"wide"', '"wide"' if wide else '"narrow"')
    for old, new in zip(
        ("13.8", "-35.6", "0.5,", "8.8", "0.3", "16", "0.6", "12", "0.5\n", "20"), numbers, strict=False
    ):
        text = text.replace(f"= {old}", f"= {new}" + old.removeprefix(old.rstrip(",\n")), 1)
    try:
        read = load(tmp_path_factory.getbasetemp(), text).bending
    except InputError:
        return
    law = Bending(read)
    K = np.random.default_rng(0).uniform(-1, 1, (50, 3)) * [[400.0]]
    moment, tangent, _ = law.respond(K, np.tile(law.initial_state, (50, 1)))
    assert np.isfinite(moment).all() and np.linalg.eigvalsh(tangent).min() > 0
