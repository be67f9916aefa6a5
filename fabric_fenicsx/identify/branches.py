"""Takes a record apart: where the fabric is loaded for the first time, and where it is unloaded from a peak."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..laws import Array
from . import curves
from .records import Record

FALL = 0.8  # a force that ends below this part of its peak, while the strip is still drawn, has passed yield

CONSTANT = 0.01  # a force that grows by less than this part of its first value is none of a test
SMALL, OFFSET = 0.005, 0.2  # a force at the start below the first part of its peak is none, above the other no pre-load


@dataclass(frozen=True)
class Branches:
    """Indices of the readings of a record."""

    virgin: np.ndarray
    """Further out than ever before, from the start to the largest displacement or to yield."""
    unloading: list[np.ndarray]
    """One run of readings for each way back from a virgin peak, the peak first."""
    notes: tuple[str, ...]


def balance(record: Record, virgin: np.ndarray) -> Record:
    """The same without a force at the start that is more than noise: a pre-load, an offset, or a first friction.

    Raises InputError where it is too large for any of these.
    """
    force = record.force[virgin]
    first = curves.offset(record.displacement[virgin], force)
    peak = float(_median(force).max()) - first
    if abs(first) < SMALL * peak:
        return record
    if peak < CONSTANT * abs(first):
        raise InputError(
            f"{record.file}: the force stays near {first:.4g} N; check that its column is the load cell's, and zeroed."
        )
    start = f"{record.file}: the force begins at {100 * first / peak:+.1f} % of its peak"
    if abs(first) > OFFSET * peak:
        raise InputError(
            f"{start}, which is no pre-load; zero the load cell, or subtract the offset from the column of the force."
        )
    note = f"{start} (pre-load, offset or friction); subtracted."
    return replace(record, force=record.force - first, notes=(*record.notes, note))


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
    force = _median(record.force[loading])
    top = int(force.argmax())
    if force[-1] < FALL * force[top]:
        loading = loading[: top + 1]
        unloading = [run for run in unloading if run[0] <= loading[-1]]
        _enough(record, loading, "the force grows")
        end = 1e3 * d[loading[-1]]
        notes.append(f"{record.file}: the force falls from {end:.3g} mm on (yield or break); the curve ends there.")
    return Branches(loading, unloading, (*notes, *_gap(record.file, np.sort(d[loading]))))


def _enough(record: Record, loading: np.ndarray, what: str) -> None:
    if len(loading) < 8:
        raise InputError(
            f"{record.file}: {what} over {len(loading)} readings only, and a curve needs 8; "
            "check the columns of force and displacement, or record more densely."
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


def noise(values: Array) -> float:
    """Standard deviation of the noise on a smooth signal, from its second differences; a few kinks do no harm."""
    if len(values) < 5:
        return 0.0
    second = np.abs(np.diff(values, 2))
    return float(np.median(second) / 0.6745 / np.sqrt(6))


def _median(values: Array, half: int = 2) -> Array:
    """Running median of five: a single bad reading is no peak."""
    padded = np.pad(values, half, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)
