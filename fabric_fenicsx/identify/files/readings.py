"""From the rows of a table to the readings of its specimens: in the order of time, complete, without wild ones."""

import re
from collections.abc import Sequence

import numpy as np

from ...errors import InputError
from ...laws import Array
from . import cleaning, numerals
from .tables import Table

SPECIMEN = re.compile(
    r"(specimen|sample|test piece|probe|prüfkörper|éprouvette|probeta|muestra|provino|campione|試験片)"
    r"( (no\.?|nr\.?|id|name|number|label))?"
)
"""Names of a column that tells specimens apart."""
LEAST = 8  # readings of a curve


def groups(table: Table, used: Sequence[int]) -> dict[str, list[int]]:
    """The rows of each specimen that a column, none of `used`, tells apart; all rows if there is none."""
    for i, (name, _) in enumerate(table.columns):
        if i in used or not SPECIMEN.fullmatch(name):
            continue
        found: dict[str, list[int]] = {}
        last = ""
        for row, cell in enumerate(table.column(i)):
            last = last if numerals.missing(cell) else cell
            found.setdefault(last, []).append(row)
        if len(found) <= max(1, len(table.cells) / LEAST):  # else it counts the readings
            return found
    return {"": list(range(len(table.cells)))}


def times(table: Table, index: int) -> tuple[Array | None, list[str]]:
    """Seconds or whatever the clock counts (rows,), NaN where it cannot be read; None, and a note, if nowhere."""
    cells = table.column(index)
    try:
        time = numerals.numbers([cell if numerals.is_number(cell) else "" for cell in cells])
    except numerals.Unclear:
        time = np.full(len(cells), np.nan)
    of_day = np.array([cleaning.seconds(cell) for cell in cells])
    time = of_day if np.isfinite(of_day).sum() > np.isfinite(time).sum() else time
    if 2 * np.isfinite(time).sum() >= len(time):
        return time, []
    first = next((cell for cell in cells if not numerals.missing(cell)), "")
    return None, [f"the times, {first!r} and so on, cannot be read and are left out"] if first else []


def sort_out(
    table: Table, name: str, displacement: Array, force: Array, time: Array | None
) -> tuple[list[tuple[np.ndarray, float]], list[str]]:
    """Rows of each specimen in the order of time, with the displacement at its first line; and what was mended.

    Arrays (rows,) in m and N, NaN where missing.
    """
    notes: list[str] = []
    known = np.isfinite(displacement) if time is None else np.isfinite(displacement) & np.isfinite(time)
    lost = np.count_nonzero(~(known & np.isfinite(force)))
    if lost:
        notes.append(f"{name}: {lost} of {len(force)} lines lack a reading and are left out.")
    order = np.flatnonzero(known)
    if time is not None:
        sorting, said = cleaning.in_order(time[order], displacement[order])
        order = order[sorting]
        notes += [f"{name}: {said}."] if said else []
    for what, values, unit, scale in (("displacement", displacement, "mm", 1e3), ("force", force, "N", 1.0)):
        seen = order[np.isfinite(values[order])]
        bad = seen[cleaning.wild(values[seen])]
        if len(bad) > max(3, cleaning.MANY * len(seen)):
            raise InputError(
                f"{name}: {len(bad)} of {len(seen)} readings of the {what} are far off their neighbours, the first in "
                f"line {table.lines[bad[0]]}; check its column, or record the test again."
            )
        for i in bad:
            said = f"line {table.lines[i]} holds a {what} of {scale * values[i]:.4g} {unit}, far off its neighbours"
            notes.append(f"{name}: {said}; left out.")
        if what == "force":  # the displacement of such a line may be that at which the record begins
            force = force.copy()
            force[bad] = np.nan
        else:
            order = order[~np.isin(order, bad)]
    if not len(order):
        return [(order, 0.0)], notes

    breaks = np.zeros(len(order), dtype=bool)
    breaks[1:] = np.diff(np.array(table.blocks)[order]) != 0
    if time is not None:
        breaks[1:] |= np.diff(time[order]) < 0
    starts, unknown = cleaning.restarts(displacement[order], np.nan_to_num(force[order]), breaks, time is not None)
    if unknown is not None:
        before, after = 1e3 * displacement[order[unknown - 1 : unknown + 1]]
        raise InputError(
            f"{name}: the displacement jumps from {before:.4g} to {after:.4g} mm in line "
            f"{table.lines[order[unknown]]}; if another specimen begins there, put it into a file of its own."
        )
    parts = np.split(order, starts)
    return [(part[np.isfinite(force[part])], float(displacement[part[0]])) for part in parts], notes
