"""Takes a record apart: where the fabric is loaded for the first time, and where it is unloaded from a peak."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...errors import InputError
from ...laws import Array
from ..files.cleaning import noise, running_median
from ..files.records import Record

LEAP = 0.2  # part of its range by which the force of no strip rises from one reading to the next
SLIP = 0.05  # of the peak force: by more it falls while the strip is drawn, and grows again, in grips that slip
STILL, STEEP = 0.01, 8.0  # of its range a reading moves in a stretch, at whose start its slope falls to so small a part
LONG = 0.05  # of the range of displacement or force: a stretch in which the other one stands still
FEWEST = 8  # readings of it
FALL = 0.8  # a force that ends below this part of its peak, while the strip is still drawn, has passed yield


@dataclass(frozen=True)
class Branches:
    """Indices of the readings of a record."""

    virgin: np.ndarray
    """Further out than ever before, from the start to the largest displacement or to yield."""
    unloading: list[np.ndarray]
    """One run of readings for each way back from a virgin peak, the peak first."""
    notes: tuple[str, ...]
    doubts: tuple[str, ...] = ()


def split(record: Record) -> Branches:
    """Virgin loading and unloading of a record of any number of cycles, monotone ones included."""
    d = record.displacement
    notes: list[str] = []
    turns = turning_points(d, max(0.005 * np.ptp(d), 8 * noise(d)))
    virgin: list[np.ndarray] = []
    unloading: list[np.ndarray] = []
    furthest, virgin_peak = -np.inf, False
    for start, end in pairwise(turns):
        run = np.arange(start, end + 1)
        if d[end] > d[start]:
            virgin.append(run[d[run] > furthest])
            virgin_peak = d[end] > furthest
            furthest = max(furthest, d[end])
        elif virgin_peak:
            unloading.append(run)
    loading = np.concatenate(virgin) if virgin else np.empty(0, dtype=int)
    _enough(record, loading, "the displacement grows")
    ends, said = _standing(record, loading)
    if said:
        loading = loading[loading <= ends]
        unloading = [run for run in unloading if run[0] <= ends]
        _enough(record, loading, "before that the displacement grows")
        notes.append(said)
    force = running_median(record.force[loading])
    _jump(record, loading, force)
    top = int(force.argmax())
    if force[-1] < FALL * force[top]:
        loading = loading[: top + 1]
        unloading = [run for run in unloading if run[0] <= loading[-1]]
        _enough(record, loading, "the force grows")
        end = 1e3 * d[loading[-1]]
        notes.append(f"{record.file}: the force falls from {end:.3g} mm on (yield or break); the curve ends there.")
    told = (*notes, *_gap(record.file, np.sort(d[loading])))
    return Branches(loading, unloading, told, _slip(record, loading))


def _standing(record: Record, loading: np.ndarray) -> tuple[int, str]:
    """The reading from which on the force or the displacement stands still while the other one goes on, and a note.

    A load cell or an extensometer at the end of its range, or a strip that yields. No note: none does.
    """
    drawn = np.arange(loading[0], len(record.force))
    drawn = drawn[: int(np.argmax(record.displacement[drawn])) + 1]
    d, force = record.displacement[drawn], running_median(record.force[drawn])
    k = _still(d, force)
    if k is not None:
        still = f"the force stays at {force[k]:.4g} N from {1e3 * d[k]:.3g} mm on (yield, or the end of the load cell)"
        return int(drawn[k]), f"{record.file}: {still}; the curve ends there."
    pulled = np.arange(loading[0], loading[0] + int(np.argmax(record.force[loading[0] :])) + 1)
    d, force = running_median(record.displacement[pulled]), record.force[pulled]
    k = _still(force, d)
    if k is not None:
        still = f"the displacement stays at {1e3 * d[k]:.4g} mm from {force[k]:.3g} N on (the end of the extensometer)"
        return int(pulled[k]), f"{record.file}: {still}; the curve ends there."
    return 0, ""


def _still(x: Array, y: Array) -> int | None:
    """Index from which on y stands at its largest value while x goes on to its own, or None.

    The end of a smooth curve is not meant, however flat: there the slope does not change at once. Nor are fewer than
    `FEWEST` readings.
    """
    span, way = float(np.ptp(y)), float(np.ptp(x))
    top = float(np.median(y[x >= x[-1] - LONG * way]))
    still = max(STILL * span, 3 * noise(y))
    below = np.flatnonzero(np.abs(y - top) > still)
    first = int(below[-1]) + 1 if len(below) else 0
    long = x[-1] - x[min(first, len(x) - 1)]
    if len(y) - first < FEWEST or not long > LONG * way:
        return None
    before = (x > x[first] - long / 2) & (np.arange(len(x)) < first)
    if before.sum() < 2:
        return None
    rise = top - y[np.flatnonzero(before)[0]]
    return first if rise > STEEP * still else None


def _slip(record: Record, loading: np.ndarray) -> tuple[str, ...]:
    """A doubt on a force that falls while the strip is drawn further, and grows beyond what it was again."""
    force = record.force[loading]
    high = np.maximum.accumulate(force)
    beyond = np.maximum.accumulate(force[::-1])[::-1] > high * (1 + STILL)
    fall = np.where(beyond, high - force, 0.0)
    k = int(fall.argmax())
    if not fall[k] > max(SLIP * float(np.ptp(force)), 10 * noise(force)):
        return ()
    said = f"{record.file}: the force falls by {fall[k]:.3g} N until {1e3 * record.displacement[loading[k]]:.3g} mm"
    return (f"{said} and grows again (a slip in the grips, a hold); cut the record off before, or repeat the test",)


def _enough(record: Record, loading: np.ndarray, what: str) -> None:
    if len(loading) < 8:
        raise InputError(
            f"{record.file}: {what} over {len(loading)} readings only, and a curve needs 8; "
            "check the columns of force and displacement, or record more densely."
        )


def _jump(record: Record, loading: np.ndarray, smooth: Array) -> None:
    """Refuse a force that leaps up between two readings that are no further apart than others; a break falls."""
    way, rise = np.diff(record.displacement[loading]), np.diff(smooth)
    least = max(LEAP * float(np.ptp(smooth)), 20 * float(np.median(np.abs(rise))))
    leaps = np.flatnonzero((rise > least) & (way < 5 * np.median(way)))
    if len(leaps):
        k = int(leaps[0])
        before, after = record.force[loading[[max(k - 1, 0), min(k + 2, len(loading) - 1)]]]
        raise InputError(
            f"{record.file}: the force leaps from {before:.4g} to {after:.4g} N at "
            f"{1e3 * record.displacement[loading[k]]:.4g} mm; look for an overload or another unit in its column."
        )


def _gap(file: str, d: Array) -> list[str]:
    """What to say of the widest gap between displacements (n,) in ascending order; refuses one of a quarter of all."""
    steps = np.diff(d)
    widest = int(steps.argmax())
    gap = f"{file}: the displacement has no reading between {1e3 * d[widest]:.3g} and {1e3 * d[widest + 1]:.3g} mm"
    if steps[widest] > 0.25 * d[-1]:
        remedy = "repeat the test, or cut the record off before the gap"
        raise InputError(f"{gap}, a quarter of the range or more; {remedy}.")
    return [f"{gap}."] if steps[widest] > max(0.05 * d[-1], 5 * np.median(steps)) else []


def turning_points(values: Array, threshold: float) -> list[int]:
    """Indices of the start, of every reversal by more than `threshold`, and of the last extreme."""
    points, low, high, extreme, way = [0], 0, 0, 0, 0
    for i, value in enumerate(values):
        if way == 0:
            low, high = (i if value < values[low] else low), (i if value > values[high] else high)
            way = int(value - values[low] > threshold) - int(values[high] - value > threshold)
            extreme = i
        elif way * (value - values[extreme]) > 0:
            extreme = i
        elif way * (values[extreme] - value) > threshold:
            points.append(extreme)
            way, extreme = -way, i
    return points + ([extreme] if extreme > points[-1] else [])
