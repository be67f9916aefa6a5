"""What is wrong with readings that are numbers: single wild ones, clocks that restart, specimens in one list."""

import re
from itertools import pairwise

import numpy as np

from ...laws import Array

HALF = 3  # readings on either side among which one is judged; as many may be wild in a row
STEPS = 5.0  # further from the median of its neighbours than so many of their usual steps,
SIGMAS = 8.0  # so many standard deviations of the noise,
PART = 0.01  # and this part of the range: wild
RUN = 8  # readings between restarts of a clock, at least
MANY = 0.05  # part of the readings that may be wild: more is a fault of the machine
HOURS = re.compile(r"(?:(\d{4})-(\d\d)-(\d\d)[T ])?(\d{1,3}):(\d\d)(?::(\d\d(?:[.,]\d*)?))?")


def noise(values: Array) -> float:
    """Standard deviation of the noise on a smooth signal, from its second differences; a few kinks do no harm."""
    if len(values) < 5:
        return 0.0
    second = np.abs(np.diff(values, 2))
    return float(np.median(second) / 0.6745 / np.sqrt(6))


def running_median(values: Array, half: int = 2) -> Array:
    """Median of each value (n,) and `half` on either side, fewer at the ends; a single bad reading is no peak."""
    padded = np.pad(np.asarray(values, dtype=np.float64), half, constant_values=np.nan)
    with np.errstate(invalid="ignore"):
        return np.nanmedian(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)


def wild(values: Array, least: float = 0.0) -> np.ndarray:
    """Which of the values (n,) of a signal, without NaN, stand alone off it, by more than `least`.

    The median of the neighbours follows any monotone signal and any step; at a peak it lags by a step or two.
    """
    half = min(HALF, (len(values) - 1) // 2)
    if half < 2:
        return np.zeros(len(values), dtype=bool)
    smooth = running_median(values, half)
    usual = running_median(np.abs(np.diff(values, append=values[-1])), 2 * half)
    far = np.abs(values - smooth)
    return far > np.maximum.reduce([STEPS * usual, 0 * far + max(SIGMAS * noise(values), PART * np.ptp(smooth), least)])


def travel(values: Array) -> float:
    """The way up and down that a signal goes."""
    return float(np.abs(np.diff(values)).sum())


def in_order(time: Array, displacement: Array) -> tuple[np.ndarray, str]:
    """Indices (n,) of readings in the order in which they were taken, and what is wrong with the times, or ''.

    Times that fall are sorted, unless the clock restarts: where they rise in a few runs that overlap, or the
    displacement moves less in the order of the file.
    """
    given = np.arange(len(time))
    falls = np.flatnonzero(np.diff(time) < 0) + 1
    if not len(falls):
        return given, ""
    by_time = np.argsort(time, kind="stable")
    runs = sorted((run[0], run[-1]) for run in np.split(time, falls))
    few = len(runs) <= len(time) / RUN and any(one[1] >= other[0] for one, other in pairwise(runs))
    if few or travel(displacement[by_time]) > travel(displacement):
        return given, "the clock restarts; the lines are taken in the order of the file"
    return by_time, "the times are out of order; the lines are sorted by them"


def restarts(displacement: Array, force: Array, breaks: np.ndarray, clocked: bool) -> tuple[list[int], int | None]:
    """Indices at which another specimen begins, and one at which nobody can tell, or None.

    A specimen begins where the displacement jumps back in one reading and the force is next to nothing, if there is
    a break (n,) at it, a head or a clock that restarts. Without a clock a jump back to the start cannot be told.
    """
    if len(displacement) < 2:
        return [], None
    step = np.abs(np.diff(displacement))
    jump = np.flatnonzero(step > np.maximum(10 * np.median(step), 0.05 * np.ptp(displacement))) + 1
    reach, peak = np.ptp(displacement), np.abs(force).max()
    back = [i for i in jump.tolist() if abs(displacement[i] - displacement[0]) < 0.1 * reach]
    idle = [i for i in back if abs(force[i]) < 0.25 * peak]
    starts = [i for i in idle if breaks[i]]
    unknown = [i for i in jump.tolist() if breaks[i] and i not in starts]
    unknown += [] if clocked else [i for i in back if i not in starts]
    return starts, min(unknown, default=None)


def seconds(cell: str) -> float:
    """Seconds of a time of day, with a date or without, or NaN."""
    match = HOURS.fullmatch(cell.strip())
    if not match:
        return float("nan")
    year, month, day, hour, minute, second = (float((part or "0").replace(",", ".")) for part in match.groups())
    days = float(np.datetime64(f"{int(year):04d}-{int(month):02d}-{int(day):02d}", "D").astype(int)) if year else 0.0
    return 86400 * days + 3600 * hour + 60 * minute + second
