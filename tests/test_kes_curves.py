"""Curves of KES-F: the numbers that the instrument would print of them, and the same fabric as from these numbers."""

import re

import numpy as np
import pytest
from test_lab_sheets import HEAD, KES, made, toml

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify import listing
from fabric_fenicsx.identify.sheets import kes_curves


def table(path, head, *columns):
    np.savetxt(path, np.column_stack(columns), "%.8g", ",", header=head, comments="", encoding="utf-8")


def tension(path, one, top=500.0, back=True):
    """Up by a line and a square, back by a straight line that gives RT."""
    EM, x = one["EM"], np.linspace(0, 1, 400)
    line = (one["LT"] / 2 - 1 / 3) / (1 / 2 - 1 / 3)
    up = top * (line * x + (1 - line) * x**2)
    slack = EM * (1 - one["LT"] * one["RT"] / 100)
    e = EM * x[::-1]
    down = top * np.clip((e - slack) / (EM - slack), 0, None)
    keep = slice(None) if back else slice(0, 0)
    table(path, "Strain (%),Force (gf/cm)", np.append(EM * x, e[1:][keep]), np.append(up, down[1:][keep]))


def shear(path, one, sides=2, head="せん断角(deg),荷重(gf/cm)"):
    """The width grows evenly from 0.5 to 5 degrees."""
    a = np.linspace(0, 8, 161)
    width = one["2HG"] + (one["2HG5"] - one["2HG"]) * (a - 0.5) / 4.5
    up = one["G"] * a + one["2HG"] / 2
    down = up - width
    angle, force = np.append(a, a[-2::-1]), np.append(up, down[-2::-1])
    if sides == 2:
        angle, force = np.append(angle, -angle[1:]), np.append(force, -force[1:])
    table(path, head, angle, force)


def bending(path, one):
    K = np.concatenate([np.linspace(0, 2.5, 101), np.linspace(2.5, -2.5, 201)[1:], np.linspace(-2.5, 0, 101)[1:]])
    sign = np.where((np.arange(401) <= 100) | (np.arange(401) > 300), 1, -1)
    table(path, "curvature (1/cm),moment (gf cm/cm)", K, one["B"] * K + sign * one["2HB"] / 2)


CURVES = {"tension": tension, "shear": shear, "bending": bending}


def test_the_numbers_of_a_sheet_are_read_off_its_curves(tmp_path):
    one = KES["warp"]
    for key, make in CURVES.items():
        make(tmp_path / "a.csv", one)
        read = getattr(kes_curves, key)(tmp_path / "a.csv")
        assert read == {name: pytest.approx(one[name], rel=3e-3) for name in read} and len(read) >= 2
    shear(tmp_path / "a.csv", one, sides=1)
    assert kes_curves.shear(tmp_path / "a.csv") == {name: pytest.approx(one[name]) for name in ("G", "2HG", "2HG5")}


def test_curves_make_the_fabric_of_their_numbers(tmp_path):
    """Of some tests curves, of others numbers; two specimens in tension."""
    from_numbers = made(tmp_path, toml("kes", KES))[1]
    ways = {}
    for way, one in KES.items():
        files = {}
        for key, make in CURVES.items():
            make(tmp_path / f"{way}_{key}.csv", one)
            files[key] = f'["{way}_{key}.csv"]'
        ways[way] = files
    tension(tmp_path / "again.csv", KES["warp"])
    ways["warp"]["tension"] = '["warp_tension.csv", "again.csv"]'
    ways["weft"] = {key: ways["weft"][key] for key in ("tension", "shear")} | {"B": 0.08, "2HB": 0.04}
    fabric = made(tmp_path, toml("kes", ways))[1]
    for way in ("warp", "weft", "shear"):
        one, other = getattr(from_numbers, way), getattr(fabric, way)
        E = np.linspace(0, min(one.limit, other.limit), 51)
        assert np.abs(other.stress(E) - one.stress(E)).max() < 0.01 * one.stress(E).max()
        assert other.unloading == pytest.approx(one.unloading, rel=0.01)
    assert fabric.bending.warp.B == pytest.approx(from_numbers.bending.warp.B, rel=5e-3)
    assert fabric.shear_friction.returned == pytest.approx(from_numbers.shear_friction.returned, abs=5e-3)


@pytest.mark.parametrize(
    ("make", "entries", "reason"),
    [
        (tension, {"tension": '["a.csv"]', "EM": 5}, "kes.warp has tension curves and EM, which they tell"),
        (tension, {"tension": '"a.csv"'}, "kes.warp.tension is not a list of files"),
        (tension, {"tension": '["none.csv"]'}, "none.csv: cannot be read"),
        (lambda path, one: tension(path, one, top=50), {"tension": '["a.csv"]'}, "the force reaches 50 gf/cm"),
        (lambda path, one: tension(path, one, back=False), {"tension": '["a.csv"]'}, "RT needs both"),
        (shear, {"tension": '["a.csv"]'}, "of its columns none has a unit of ratio; name just one, as 'strain (%)'"),
        (lambda path, one: shear(path, one, head="angle (deg),force (N)"), {"shear": '["a.csv"]'}, "force per width"),
        (lambda path, one: shear(path, one | {"G": 0.6}, head="a (rad),force (gf/cm)"), {"shear": '["a.csv"]'}, None),
        (tension, {"shear": '["a.csv"]'}, "of its columns none has a unit of angle"),
    ],
)
def test_every_fault_of_a_curve_is_one_sentence(tmp_path, make, entries, reason):
    make(tmp_path / "a.csv", KES["warp"])
    left = {key: value for key, value in KES["warp"].items() if key not in sum(kes_curves.NUMBERS.values(), ())}
    (tmp_path / "t.toml").write_text(HEAD + toml("kes", {"warp": left | entries, "weft": KES["weft"]})[len(HEAD) :])
    with pytest.raises(InputError, match=re.escape(reason) if reason else None) as error:
        listing.read(tmp_path / "t.toml")
    assert "\n" not in str(error.value)
