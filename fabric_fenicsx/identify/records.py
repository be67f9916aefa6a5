"""Reads the records of tensile tests: CSV with named, unit-bearing columns, as testing machines write them.

    time_s,displacement_mm,force_N

or, as other machines write it, `Extension (mm);Load (N)`; the time is optional, and a strain may stand for the
displacement, a stress or a force per width for the force. Several readings up, and where there are any, back.

What a file may have and is mended, with a note: lines of text before the columns, units in a line of their own,
semicolons, tabs and decimal commas, readings that are missing, times out of order, force or displacement with
reversed sign, a displacement that does not begin at zero. Anything else is refused in one sentence (`InputError`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..laws import Array
from . import units
from .tables import Table, read_table

WORDS = {
    "time": ("time",),
    "force": ("force", "load", "stress"),
    "displacement": ("displacement", "extension", "elongation", "stroke", "crosshead", "position", "travel", "strain"),
    "warp_stretch": ("warp stretch",),
    "weft_stretch": ("weft stretch",),
    "angle": ("angle",),
}
ALLOWED = {
    "time": ("time",),
    "force": ("force", "force per width", "stress"),
    "displacement": ("length", "ratio"),
    "warp_stretch": ("ratio",),
    "weft_stretch": ("ratio",),
    "angle": ("angle",),
}
"""Quantity -> kinds of unit, the preferred one first."""
AMBIGUOUS = ("green", "lagrange", "true", "cauchy", "piola", "logarithmic", "transverse", "lateral")


@dataclass(frozen=True)
class Strip:
    """The specimen before the test, in m."""

    gauge_length: float
    width: float
    thickness: float

    @property
    def area(self) -> float:
        """Cross-section A0 of (3.1), m2."""
        return self.width * self.thickness


@dataclass(frozen=True)
class Record:
    """One test in the order of time: displacement (n,) in m from zero, force (n,) in N, tension positive.

    `yarns` holds, if the file does, warp_stretch (n,), weft_stretch (n,) and angle (n,) in radians of the
    marked yarns of a bias test, NaN where there is no photograph. `notes` says what was mended.
    """

    file: str
    displacement: Array
    force: Array
    yarns: dict[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read(path: str | Path, strip: Strip, columns: Sequence[str] = ()) -> Record:
    """A tensile test from a CSV file.

    Columns, by a word in their names: force or load, in a unit of force, of force per width, or of nominal stress
    (force over the first cross-section); displacement, extension, elongation ..., in a unit of length or relative
    to the gauge length; time, if there; and for a bias test with marked yarns "warp_stretch", "weft_stretch" and
    "angle" between them. Other columns are left alone. A file that names no columns has those of `columns`.
    """
    wanted = "force|load|stress", "|".join(WORDS["displacement"])
    table = read_table(path, wanted, "time_s,displacement_mm,force_N", columns)
    kind, force = _find(table, "force")
    force = force * {"force": 1.0, "force per width": strip.width, "stress": strip.area}[kind]
    kind, displacement = _find(table, "displacement")
    displacement = displacement * (strip.gauge_length if kind == "ratio" else 1.0)
    yarns = {
        name: column
        for name in ("warp_stretch", "weft_stretch", "angle")
        if (column := _find(table, name, False)[1]).size
    }
    notes, file = [], table.file
    if 0 < len(yarns) < 3:
        raise InputError(
            f"{file}: has {', '.join(yarns)} of the marked yarns only; give warp_stretch, weft_stretch and angle."
        )

    keep = np.isfinite(force) & np.isfinite(displacement)
    time = _find(table, "time", False)[1]
    if time.size:
        keep &= np.isfinite(time)
    if not keep.all():
        notes.append(f"{file}: {np.count_nonzero(~keep)} of {len(keep)} lines lack a reading and are left out.")
    order = np.flatnonzero(keep)
    if time.size and (np.diff(time[order]) < 0).any():
        notes.append(f"{file}: the times are out of order; the lines are sorted by them.")
        order = order[np.argsort(time[order], kind="stable")]
    force, displacement = force[order], displacement[order]
    if len(order) < 8:
        raise InputError(f"{file}: has {len(order)} complete lines, and a curve needs 8; record the test more densely.")

    displacement = displacement - displacement[0]
    for name, values in (("force", force), ("displacement", displacement)):
        if -values.min() > values.max():
            values *= -1
            notes.append(f"{file}: the {name} is negative in tension; its sign is turned.")
    _plausible(table, displacement, force, strip)
    return Record(file, displacement, force, {name: column[order] for name, column in yarns.items()}, tuple(notes))


def _find(table: Table, quantity: str, needed: bool = True) -> tuple[str, Array]:
    """Kind of unit and values in SI of the one column that holds a quantity; no values if it may be missing and is."""
    found = [i for i, (name, _) in enumerate(table.columns) if any(word in name for word in WORDS[quantity])]
    found = [i for i in found if not any(word in table.columns[i][0] for word in AMBIGUOUS)]
    if not found:
        if not needed:
            return "", np.empty(0)
        example = f"{quantity} ({'N' if quantity == 'force' else 'mm'})"
        raise InputError(f"{table.file}: no column holds a {quantity}; name one as in {example!r}.")
    if quantity in ("force", "displacement"):  # "stress" and "strain" may stand beside the force and the displacement
        kinds = [units.factor(table.columns[i][1] or "") for i in found]
        for kind in ALLOWED[quantity]:
            best = [i for i, k in zip(found, kinds, strict=True) if k and k[0] == kind]
            if best:
                found = best
                break
    if len(found) > 1:
        several = " and ".join(repr(table.headers[i]) for i in found)
        raise InputError(f"{table.file}: columns {several} could each be the {quantity}; rename all but one.")
    return table.si(found[0], ALLOWED[quantity])


def _plausible(table: Table, displacement: Array, force: Array, strip: Strip) -> None:
    """Refuse what a wrong unit or a wrong column would give."""
    reach, peak = displacement.max() / strip.gauge_length, force.max()
    if not reach > 0:
        raise InputError(f"{table.file}: the displacement never changes; check that its column is the machine's.")
    if not 1e-3 < reach < 3:
        raise InputError(
            f"{table.file}: the displacement reaches {1e3 * displacement.max():.4g} mm on a gauge length of "
            f"{1e3 * strip.gauge_length:g} mm; correct the unit of its column, or the gauge length."
        )
    if not peak > 0:
        raise InputError(f"{table.file}: the force is zero throughout; check that its column is the load cell's.")
    if not 1e2 < peak / strip.area < 1e10:
        raise InputError(
            f"{table.file}: the force reaches {peak:.4g} N, a stress of {peak / strip.area / 1e6:.3g} MPa; "
            "correct the unit of its column, or width and thickness."
        )
