"""Reads the bending tests of a fabric from its list of tests, the table [bending] of `identify.listing`, and loops.

A quantity bears its unit in its name, 2HB in gf cm/cm is 2HB_gf_cm_per_cm; a list is one number a specimen.
"""

from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...errors import InputError
from ...laws import Array
from ..files import units
from ..files.keys import expect
from ..files.tables import read_table

WAYS = ("warp", "weft", "bias")
BENDING, CURVATURE, MOMENT = "bending rigidity", "curvature", "moment per width"
QUANTITIES: dict[str, tuple[tuple[str, ...], str]] = {
    "B": ((BENDING,), "B_gf_cm2_per_cm"),
    "2HB": ((MOMENT, "force"), "2HB_gf_cm_per_cm"),
    "bending_length": (("length",), "bending_length_mm"),
    "overhang": (("length",), "overhang_mm"),
    "angle": (("angle",), "angle_deg"),
    "heart_length": (("length",), "heart_length_mm"),
    "heart_height": (("length",), "heart_height_mm"),
}
"""Quantity -> kinds of its unit, and how it is written."""
BOUNDS = {
    "B": (1e-8, 1e-2, "uN m", 1e6),
    "2HB": (0.0, 0.1, "mN", 1e3),
    "bending_length": (1e-3, 0.2, "mm", 1e3),
    "overhang": (2e-3, 0.5, "mm", 1e3),
    "angle": (np.radians(0.5), np.radians(89), "degrees", 180 / np.pi),
    "heart_length": (0.02, 1.0, "mm", 1e3),
    "heart_height": (2e-3, 1.0, "mm", 1e3),
}
"""Quantity -> what cloth and cardboard have, SI, and unit and factor to tell it; beyond them a unit is wrong."""
HEADS = (r"curvature|krümmung|courbure|curvatura|曲率|\bk\b", r"moment|momento|曲げモーメント|\bm\b")


@dataclass(frozen=True)
class Loop:
    """A bending loop in the order of the test: curvature (n,) in 1/m, moment per width (n,) in N."""

    file: str
    curvature: Array
    moment: Array
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class StripTests:
    """What was measured along one direction, SI; one number a specimen, loops by file."""

    numbers: dict[str, Array]  # by the names of QUANTITIES
    loops: tuple[Path, ...] = ()

    @property
    def hangs(self) -> bool:
        """Whether a strip hung under its own weight."""
        return bool({"bending_length", "overhang", "heart_length"} & self.numbers.keys())

    @property
    def gripped(self) -> bool:
        """Whether a strip was bent between grips, as in KES."""
        return "B" in self.numbers or bool(self.loops)


@dataclass(frozen=True)
class BendingTests:
    """The bending tests of a fabric by direction; `strip`: whether the bias strip was narrow or wide."""

    ways: dict[str, StripTests]
    strip: Literal["narrow", "wide"] | None = None


def read(path: str | Path, entries: object) -> BendingTests:
    """The table [bending] of a list of tests; raises InputError for what is unknown, missing or no number."""
    if not isinstance(entries, dict):
        raise InputError(f"{path}: bending is not a table; write its entries under [bending.warp] and so on.")
    expect(path, "bending.", entries, (), (*WAYS, "bias_strip"))
    ways = {way: _strip(path, f"bending.{way}", entries[way]) for way in WAYS if way in entries}
    for way in ("warp", "weft"):
        if way not in ways:
            raise InputError(
                f"{path}: bending has no tests along the {way}; add [bending.{way}], or leave bending out."
            )
    strip: Any = entries.get("bias_strip")
    if strip not in (None, "narrow", "wide"):
        raise InputError(f"{path}: bending.bias_strip = {strip!r} is not narrow (free to twist) or wide (long grips).")
    if "bias" not in ways:
        if strip:
            raise InputError(f"{path}: bending.bias_strip is of no use without tests under [bending.bias]; add them.")
    elif ways["bias"].hangs and ways["bias"].gripped:
        raise InputError(
            f"{path}: bending.bias has strips that hang and strips in grips, which read different rigidities, as they "
            "may twist or not; leave one of them out."
        )
    else:
        strip = strip or ("narrow" if ways["bias"].hangs else "wide")
    return BendingTests(ways, strip)


def _strip(path: str | Path, where: str, entries: Any) -> StripTests:
    """The tests of one direction."""
    if not isinstance(entries, dict) or not entries:
        raise InputError(f"{path}: {where} is not a table with tests; write for instance B_gf_cm2_per_cm = 0.1 there.")
    numbers: dict[str, Array] = {}
    loops: tuple[Path, ...] = ()
    for key, value in entries.items():
        if key == "loops":
            if not isinstance(value, list) or not value or not all(isinstance(name, str) for name in value):
                raise InputError(f'{path}: {where}.loops is not a list of files; write ["loop_1.csv"] or more.')
            loops = tuple(Path(path).parent / name for name in value)
            continue
        quantity, factor = _quantity(path, where, key)
        if quantity in numbers:
            raise InputError(f"{path}: {where} gives {quantity} in two units; leave one of them out.")
        values = value if isinstance(value, list) else [value]
        if not values or any(isinstance(v, bool) or not isinstance(v, int | float) for v in values):
            raise InputError(f"{path}: {where}.{key} = {value!r} is not a number or a list of numbers.")
        numbers[quantity] = factor * np.array(values, dtype=np.float64)
        low, high, unit, scale = BOUNDS[quantity]
        wrong = [v for v, si in zip(values, numbers[quantity], strict=True) if not low <= si <= high]
        if wrong:
            raise InputError(
                f"{path}: {where}.{key} = {wrong[0]!r} is not between {scale * low:.4g} and {scale * high:.4g} {unit}, "
                "as cloth has; correct the number or its unit."
            )
    for one, other in (("overhang", "angle"), ("heart_length", "heart_height")):
        n, m = (len(numbers.get(key, ())) for key in (one, other))
        if one == "heart_length" and n == 1 < m:
            numbers[one] = np.repeat(numbers[one], m)
        elif n != m:
            raise InputError(f"{path}: {where} has {n} of {one} and {m} of {other}; give as many of both.")
    if not loops and ("B" in numbers) > ("2HB" in numbers):
        raise InputError(
            f"{path}: {where} gives B of KES without 2HB, whose friction B does not hold; add 2HB_gf_cm_per_cm (0 if "
            "the loop has no width)."
        )
    if not (loops or numbers.keys() - {"2HB"}):
        raise InputError(f"{path}: {where} gives 2HB alone; add B, a loop, or a strip that hangs.")
    return StripTests(numbers, loops)


def _quantity(path: str | Path, where: str, key: str) -> tuple[str, float]:
    """Which of QUANTITIES a key names, and the factor of its unit to SI."""
    names = [name for name in QUANTITIES if key == name or key.startswith(f"{name}_")]
    if not names:
        known = [example for _, example in QUANTITIES.values()] + ["loops"]
        near = get_close_matches(key, known, n=1) or [", ".join(known)]
        raise InputError(f"{path}: {where}.{key} is not a known key; known is {near[0]}.")
    name = max(names, key=len)
    kinds, example = QUANTITIES[name]
    unit = units.in_name(key[len(name) :])
    for kind in kinds:
        if unit and (factor := units.of_kind(unit, kind)):
            return name, factor
    raise InputError(f"{path}: {where}.{key} does not end in a unit of {kinds[0]}; write it as {example}, say.")


def read_loop(path: str | Path) -> Loop:
    """The bending loop of a CSV file with a curvature and a moment per width; rows that lack one are left out."""
    table = read_table(path, HEADS, "curvature (1/cm),moment (gf cm/cm)")
    names = [name for name, _ in table.columns]
    words = [word.split("|") for word in HEADS]
    found = []
    for quantity, several in zip(("curvature", "moment"), words, strict=True):
        exact = [i for i, name in enumerate(names) if name == several[-1].replace("\\b", "")]
        held = [i for i, name in enumerate(names) if any(word in name for word in several[:-1])] or exact
        if len(held) != 1:
            said = " and ".join(repr(table.headers[i]) for i in held) or "none"
            raise InputError(f"{table.file}: of its columns, {said} could be the {quantity}; name just one so.")
        found += held
    table = table.readings(found)
    curvature, moment = table.si(found[0], (CURVATURE,))[1], table.si(found[1], (MOMENT, "force"))[1]
    known = np.isfinite(curvature) & np.isfinite(moment)
    lost = int(np.count_nonzero(~known))
    notes = [*table.notes, *([f"{table.file}: {lost} lines lack a reading and are left out."] if lost else [])]
    return Loop(table.file, curvature[known], moment[known], tuple(notes))
