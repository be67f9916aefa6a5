"""Sheets of KES-F and FAST, the numbers that textile laboratories give of a cloth: from a table to its curves.

    [kes]                        # of warp and weft, in the units of the sheet; a list is one number a specimen
    warp = { EM = 5.1, LT = 0.72, RT = 58, G = 0.6, 2HG = 0.8, 2HG5 = 1.5, B = 0.10, 2HB = 0.05 }  # WT for LT, too
    weft = { ... }

    [fast]
    warp = { E5 = 0.4, E20 = 1.1, E100 = 3.0, C = 18.5 }    # C: bending length
    weft = { ... }
    EB5 = 4.2

KES (Kawabata 1980): EM % at 500 gf/cm, LT = WT over that of a straight line, WT gf cm/cm2, RT % of WT that comes back,
G gf/cm/degree, 2HG and 2HG5 gf/cm at 0.5 and 5 degrees, B gf cm2/cm, 2HB gf cm/cm; or its curves, from which they are
read (`kes_curves`). FAST: E5, E20, E100 % at 5, 20 and
100 gf/cm, EB5 % in bias at 5 gf/cm, C mm; shear rigidity G = 123/EB5 N/m.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...errors import InputError
from ...fabrics import ShearFriction
from ...fabrics.friction import GF_CM, KES_REACH, kes_unloading, of_kes
from ...laws import Array
from ..bending import tests as bending_tests
from ..files.keys import expect
from ..files.records import Strip
from ..tensile.curves import Estimate, Readings
from . import kes_curves

KES_FORCE = 500 * GF_CM  # N/m, at which EM is read
FAST_SHEAR = 123.0  # N/m x %, G of EB5
POINTS = 101
ALONE = 0.1  # of an unloading modulus: standard error of a single specimen
KES_NEEDED, KES_MORE = ("EM", "RT", "G", "2HG", "2HG5", "B", "2HB"), ("LT", "WT")
FAST_NEEDED = ("E5", "E20", "E100", "C")
STRIPS = {"kes": (0.05, 0.2), "fast": (0.1, 0.05)}
"""Gauge length and width, m."""


@dataclass(frozen=True)
class Sheet:
    """The numbers of a sheet by direction, one a specimen, in its units; EB5 of FAST stands under "bias"."""

    kind: str  # "kes" or "fast"
    numbers: dict[str, dict[str, Array]]

    def strip(self, thickness: float) -> Strip:
        """Its specimen in tension; thickness in m."""
        return Strip(*STRIPS[self.kind], thickness)

    @property
    def bending(self) -> bending_tests.BendingTests:
        """Its bending tests."""
        names = {"kes": {"B": ("B", 9.80665e-5), "2HB": ("2HB", 9.80665e-3)}, "fast": {"C": ("bending_length", 1e-3)}}
        ways = {
            way: bending_tests.StripTests(
                {name: factor * self.numbers[way][key] for key, (name, factor) in names[self.kind].items()}
            )
            for way in ("warp", "weft")
        }
        return bending_tests.BendingTests(ways)


def read(path: str | Path, kind: str, entries: Any) -> Sheet:
    """The table [kes] or [fast] of a list of tests; raises InputError for what is missing, unknown or no number."""
    if not isinstance(entries, dict):
        raise InputError(f"{path}: {kind} is not a table; write its entries under [{kind}].")
    needed, more = (KES_NEEDED, KES_MORE) if kind == "kes" else (FAST_NEEDED, ())
    expect(path, f"{kind}.", entries, ("warp", "weft", *(("EB5",) if kind == "fast" else ())), ())
    numbers = {}
    for way in ("warp", "weft"):
        where = f"{kind}.{way}"
        if not isinstance(entries[way], dict):
            raise InputError(f"{path}: {where} is not a table; write {where} = {{ {needed[0]} = ..., ... }}.")
        told = kes_curves.in_numbers(path, where, entries[way]) if kind == "kes" else entries[way]
        expect(path, f"{where}.", told, needed, more)
        numbers[way] = {key: _numbers(path, f"{where}.{key}", value) for key, value in told.items()}
        _consistent(path, where, kind, numbers[way])
    if kind == "fast":
        numbers["bias"] = {"EB5": _numbers(path, "fast.EB5", entries["EB5"])}
    return Sheet(kind, numbers)


def _numbers(path: str | Path, where: str, value: Any) -> Array:
    values, zero = value if isinstance(value, list) else [value], where.split(".")[-1].startswith("2H")
    for one in values or [None]:
        if isinstance(one, bool) or not isinstance(one, int | float) or not (0 < one < 1e6 or (zero and one == 0)):
            raise InputError(f"{path}: {where} = {one!r} is not {'zero or ' * zero}a positive number.")
    return np.array(values, dtype=np.float64)


def _consistent(path: str | Path, where: str, kind: str, numbers: dict[str, Array]) -> None:
    """Refuse a sheet that contradicts itself; WT is turned into LT."""
    if kind == "fast":
        E5, E20, E100 = (float(np.mean(numbers[key])) for key in ("E5", "E20", "E100"))
        if not E5 < E20 < E100:
            raise InputError(
                f"{path}: {where} has E5 {E5:g}, E20 {E20:g}, E100 {E100:g} %, which must rise; correct it."
            )
        return
    EM = float(np.mean(numbers["EM"]))
    if "WT" in numbers:  # gf cm/cm2 = gf/cm times 1
        LT = np.atleast_1d(numbers["WT"] / (0.5 * 500 * EM / 100))
        if "LT" in numbers and abs(np.mean(LT) / np.mean(numbers["LT"]) - 1) > 0.05:
            said = f"LT {np.mean(numbers['LT']):.3g} and WT {np.mean(numbers['WT']):.3g} gf cm/cm2"
            raise InputError(
                f"{path}: {where} has {said}, but with EM {EM:.3g} % that WT is an LT of {np.mean(LT):.3g}; EM is at "
                "500 gf/cm, so correct one of them, or its unit."
            )
        numbers.setdefault("LT", LT)
    if "LT" not in numbers:
        raise InputError(f"{path}: {where} has neither LT nor WT; add one.")
    line, RT = float(np.mean(numbers["LT"])), float(np.mean(numbers["RT"]))
    if not 0.42 < line < 1.3:
        raise InputError(f"{path}: {where} has an LT of {line:.3g}, which is from 0.42 to 1.3 of cloth; correct it.")
    if not 1 < RT < 100:
        raise InputError(f"{path}: {where} has an RT of {RT:g}, which is a percentage above 1; correct it.")


def tension(sheet: Sheet, way: str, thickness: float) -> tuple[list[Readings], Estimate | None]:
    """Readings of strain and stress (Pa) along a direction, a specimen each, and the unloading modulus (Pa)."""
    numbers, out, slopes = sheet.numbers[way], [], []
    for k in range(max(map(len, numbers.values()))):
        one = {key: float(values[min(k, len(values) - 1)]) for key, values in numbers.items()}
        force = _kes_force if sheet.kind == "kes" else _fast_force
        nominal, F = force(one)
        E, S = nominal + nominal**2 / 2, F / (1 + nominal) / thickness
        out.append(Readings(f"{sheet.kind} {way} {k + 1}", E, S))
        if sheet.kind == "kes":  # RT: the triangle that comes back, over the work
            slopes.append(S[-1] ** 2 / 2 / (one["RT"] / 100 * np.trapezoid(S, E)))
    return out, Estimate.of(slopes, ALONE * slopes[0]) if slopes else None


def _kes_force(one: dict[str, float]) -> tuple[Array, Array]:
    """Nominal strain and force per width (N/m): a straight line and one power, so that the end and the work are met."""
    x, reach = np.linspace(0, 1, POINTS), one["EM"] / 100
    for power in (2, 3, 4):
        line = (one["LT"] / 2 - 1 / (power + 1)) / (0.5 - 1 / (power + 1))
        if line > 0.05:
            break
    return reach * x, KES_FORCE * (line * x + (1 - line) * x**power)


def _fast_force(one: dict[str, float]) -> tuple[Array, Array]:
    """Nominal strain and force per width (N/m): monotone through the three readings."""
    known = np.array([0.0, one["E5"], one["E20"], one["E100"]]) / 100
    strain = np.linspace(0, known[-1], POINTS)
    return strain, GF_CM * PchipInterpolator(known, [0.0, 5.0, 20.0, 100.0])(strain)


@dataclass(frozen=True)
class Sheared:
    """Readings of E12 and S12 (Pa), without the friction that stands on top; unloading modulus dS12/dE12 (Pa)."""

    readings: list[Readings]
    unloading: Estimate | None = None
    friction: ShearFriction | None = None
    notes: tuple[str, ...] = ()


def shear(sheet: Sheet, thickness: float) -> Sheared:
    """Of KES a line, and by closed formulas the friction of its loop, with an unloading that closes it by 5 degrees; of
    a loop that no friction over a line has, a curve that bends where friction builds up. Thickness in m."""
    angle = np.linspace(0, KES_REACH, POINTS)
    if sheet.kind == "fast":
        moduli = FAST_SHEAR / sheet.numbers["bias"]["EB5"]
        return Sheared([Readings(f"fast bias {k}", angle / 2, G * angle / thickness) for k, G in enumerate(moduli, 1)])
    names, rows = [], []
    for way in ("warp", "weft"):
        numbers = [sheet.numbers[way][key] for key in ("G", "2HG", "2HG5")]
        for k in range(max(map(len, numbers))):
            names.append(f"kes shear {way} {k + 1}")
            rows.append([GF_CM * float(one[min(k, len(one) - 1)]) for one in numbers])
    try:
        y0, returned = of_kes(*map(float, np.mean(rows, axis=0)))
        friction = ShearFriction(y0 / thickness, set_in=0.0, returned=returned)
    except InputError as error:
        turned = [G * np.degrees(angle) + at / 2 * (1 - np.exp(-np.degrees(angle) / 0.5)) for G, at, _ in rows]
        bent = [Readings(name, angle / 2, F / thickness) for name, F in zip(names, turned, strict=True)]
        slopes = [2 * (3 * G + at5) / np.radians(3.0) / thickness for G, _, at5 in rows]
        said = f"shear, mean of warp and weft: {error} The loop is left out."
        return Sheared(bent, Estimate.of(slopes, ALONE * slopes[0]), None, (said,))
    lines = [
        Readings(name, angle / 2, G * np.degrees(angle) / thickness) for name, (G, *_) in zip(names, rows, strict=True)
    ]
    slopes = [2 * kes_unloading(G, y0, returned) / np.radians(1.0) / thickness for G, *_ in rows]
    return Sheared(lines, Estimate.of(slopes, ALONE * slopes[0]), friction)
