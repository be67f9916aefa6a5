"""Curves of KES-F in place of its numbers: EM, LT, RT of a tension, G, 2HG, 2HG5 of a shear, B, 2HB of a bending loop.

    [kes]
    warp = { tension = ["t1.csv", "t2.csv"], shear = ["s1.csv"], bending = ["b1.csv"] }   # or numbers, each for its own

A file is one specimen: "strain (%),force (gf/cm)" to 500 gf/cm and back; "shear angle (deg),force (gf/cm)" to 8 degrees
and back, and where there is one the other side; "curvature (1/cm),moment (gf cm/cm)" as `bending.tests` reads it. Which
column is which is told by its unit. Read off as the instrument does (Kawabata 1980): G is the mean slope from 0.5 to
2.5 degrees, 2HG and 2HG5 are the widths at 0.5 and 5 degrees, B is the mean slope from 0.5 to 1.5 1/cm there and back,
2HB the width at 1 1/cm, all of as many sides as there are.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...fabrics.friction import GF_CM
from ...laws import Array
from ..bending import tests as bending_tests
from ..bending.found import KES_2HB
from ..files import records, units
from ..files.tables import read_table

NUMBERS = {"tension": ("EM", "LT", "WT", "RT"), "shear": ("G", "2HG", "2HG5"), "bending": ("B", "2HB")}
"""Curve -> the numbers that it tells, which must not be given beside it."""
FORCE, NEAR = 500.0, 0.02  # gf/cm, at which KES turns back in tension, and by which part it may miss it
SLOPE, WIDTHS = (0.5, 2.5), (0.5, 5.0)  # degrees
BENT = 0.5, 1.5  # 1/cm, between which B is read, and 2HB in the middle
LEAST = 5  # readings of a branch


def in_numbers(path: str | Path, where: str, entries: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of a direction of a sheet with numbers, a list of one a specimen, in place of curves."""
    out = {key: value for key, value in entries.items() if key not in NUMBERS}
    for key in set(entries) & set(NUMBERS):
        twice = [name for name in NUMBERS[key] if name in entries]
        if twice:
            raise InputError(f"{path}: {where} has {key} curves and {twice[0]}, which they tell; leave one out.")
        names = entries[key]
        if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
            raise InputError(f'{path}: {where}.{key} is not a list of files; write ["{key}_1.csv"] or more.')
        read = {"tension": tension, "shear": shear, "bending": bending}[key]
        several = [read(Path(path).parent / name) for name in names]
        out |= {name: [one[name] for one in several] for name in several[0]}
    return out


def tension(path: str | Path) -> dict[str, float]:
    """EM %, LT, and RT % of a curve of force per width over strain, there and back."""
    file, strain, force = _columns(path, "ratio", "strain (%)")
    top = int(force.argmax())
    if not abs(force[top] / FORCE - 1) < NEAR:
        raise InputError(
            f"{file}: the force reaches {force[top]:.4g} gf/cm, and EM, LT and RT are those of {FORCE:g}; name the "
            "file under [records] instead."
        )
    if min(top, len(force) - 1 - top) < LEAST:
        raise InputError(f"{file}: has fewer than {LEAST} readings on the way there or back; RT needs both.")
    strain = strain - strain[0]
    work, back = np.trapezoid(force[: top + 1], strain[: top + 1]), -np.trapezoid(force[top:], strain[top:])
    line = 0.5 * force[top] * strain[top]
    return {"EM": 100 * float(strain[top]), "LT": float(work / line), "RT": 100 * float(back / work)}


def shear(path: str | Path) -> dict[str, float]:
    """G gf/cm/degree, 2HG and 2HG5 gf/cm of a loop of force per width over the angle of shear."""
    file, angle, force = _columns(path, "angle", "shear angle (deg)")
    slopes, widths = [], []
    for going, coming in _sides(file, np.degrees(angle), force, WIDTHS, "degrees"):
        slopes.append(_slope(file, *going, SLOPE))
        widths.append([_at(*going, at) - _at(*coming, at) for at in WIDTHS])
    at, at5 = np.mean(widths, axis=0)
    return {"G": float(np.mean(slopes)), "2HG": float(at), "2HG5": float(at5)}


def bending(path: str | Path) -> dict[str, float]:
    """B gf cm2/cm and 2HB gf cm/cm of a bending loop."""
    loop = bending_tests.read_loop(path)
    slopes, widths = [], []
    for side in _sides(loop.file, loop.curvature / 100, loop.moment / KES_2HB, BENT, "1/cm"):
        slopes += [_slope(loop.file, *branch, BENT) for branch in side]
        widths.append(_at(*side[0], 1.0) - _at(*side[1], 1.0))
    return {"B": float(np.mean(slopes)), "2HB": float(np.mean(widths))}


type Branch = tuple[Array, Array]


def _sides(file: str, x: Array, y: Array, ends: tuple[float, float], unit: str) -> list[tuple[Branch, Branch]]:
    """There and back of a loop on its first side, and on the other one, if it goes there, both turned to be positive.

    Each must reach from the first to the second of `ends`.
    """
    low, high = ends
    first, last = int(x.argmax()), int(x.argmin())
    last = last if last > first else len(x) - 1
    there, down, up = ((x[some], y[some]) for some in (slice(first + 1), slice(first, last + 1), slice(last, None)))
    if x[first] < high or min(len(there[0]), len(down[0])) < LEAST or there[0].min() > low or down[0].min() > low:
        raise InputError(
            f"{file}: the loop does not go from {low:g} to {high:g} {unit} and back on its first side; enter all of "
            "it, in the order of the test."
        )
    out = [(there, down)]
    if down[0].min() < -high and len(up[0]) >= LEAST and up[0].max() > -low:
        out.append(((-down[0], -down[1]), (-up[0], -up[1])))
    return out


def _slope(file: str, x: Array, y: Array, between: tuple[float, float]) -> float:
    inside = (x >= between[0] - 1e-9) & (x <= between[1] + 1e-9)
    if inside.sum() < 2:
        raise InputError(f"{file}: a branch has fewer than two readings between {between[0]:g} and {between[1]:g}.")
    return float(np.polyfit(x[inside], y[inside], 1)[0])


def _at(x: Array, y: Array, place: float) -> float:
    order = np.argsort(x, kind="stable")
    return float(np.interp(place, x[order], y[order]))


def _columns(path: str | Path, kind: str, example: str) -> tuple[str, Array, Array]:
    """Name of a file, its column of a kind of unit in SI, and its force per width in gf/cm."""
    forced = "|".join(records.WORDS["force"])
    table = read_table(path, (forced,), f"{example},force (gf/cm)")
    found = []
    for wanted, said in ((kind, example), ("force per width", "force (gf/cm)")):
        held = [i for i, (_, unit) in enumerate(table.columns) if (units.factor(unit or "") or ("",))[0] == wanted]
        if len(held) != 1:
            several = " and ".join(repr(table.headers[i]) for i in held) or "none"
            raise InputError(
                f"{table.file}: of its columns {several} has a unit of {wanted}; name just one, as {said!r}."
            )
        found += held
    table = table.readings(found)
    x, force = (table.si(i, (wanted,))[1] for i, wanted in zip(found, (kind, "force per width"), strict=True))
    known = np.isfinite(x) & np.isfinite(force)
    return table.file, x[known], force[known] / GF_CM
