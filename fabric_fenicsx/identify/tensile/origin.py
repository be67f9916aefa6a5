"""Where a record begins: slack before the strip is taut, a pre-load, an offset of the load cell.

The force of a slack strip is that of an empty load cell; from where it rises on, the displacement counts (toe
compensation). A pre-load has drawn the strip before the record begins: the displacement counts from where the force
would be gone. An offset is subtracted.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...errors import InputError
from ...laws import Array
from ..files.cleaning import noise, running_median
from ..files.records import Record
from . import curves
from .branches import Branches

CONSTANT = 0.01  # a force that grows by less than this part of its first value is none of a test
SMALL, OFFSET = 0.005, 0.2  # a force at the start below the first part of its peak is none, above the other no pre-load
EXACT = 2e-4  # part of the peak force: differences below it are none
TINY = 0.002  # part of the range: a first displacement below it is zero
SHORT = 0.003  # part of the range: less slack than that is none
FLAT = 0.15  # slope of the slack, over that of as long a way after it
SURE = 10.0  # by how much slack must raise the logarithm of the likelihood, twice, beyond its two unknowns
TOE = 0.3  # part of the peak: the force at the end of the slack is below it
GRID, ZOOMS = 40, 4  # places that are tried, and how often between the neighbours of the best
VAGUE = 0.005  # part of the range: slack of which four standard errors are more may change the curve by 1 %
NEAR = 0.4  # part of the range: a record that begins so near to the zero of its file may have lost its first lines


def find(
    record: Record, part: Branches, gauge_length: float, preload: float | None = None, *, friction: bool = False
) -> tuple[Record, Branches]:
    """The record with displacement and force from where the strip is taut and free of force, and its branches.

    `preload` (N) is that at which the test began, if it is known; zero if a force at the start is an offset, unless it
    is `friction` of a taut specimen. Raises InputError where the force at the start is too large for a pre-load.
    """
    record = replace(record, doubts=(*record.doubts, *part.doubts)) if part.doubts else record
    d, force = record.displacement[part.virgin], record.force[part.virgin]
    found = _slack(d, force, gauge_length)
    if found is None and friction:
        return record, part
    if found is None:
        return _began(record, part, gauge_length, preload), part
    slack, idle, error = found
    said = [
        f"slack: the force rises from {1e3 * slack:.4g} ± {1e3 * error:.2g} mm on; the displacement counts from there"
    ]
    if abs(idle) > SMALL * (running_median(force).max() - idle):
        said.append(f"the force of {idle:.4g} N before it is subtracted")
    note = f"{record.file}: {'; '.join(said)} (toe compensation)."
    vague = [f"{record.file}: slack of {1e3 * slack:.3g} ± {1e3 * error:.2g} mm, too vague for the curve"]
    if 4 * error <= VAGUE * (d.max() - slack):
        vague = []
    moved = replace(
        record,
        displacement=record.displacement - slack,
        force=record.force - idle,
        notes=(*record.notes, note),
        zero=record.zero + slack,
        doubts=(*record.doubts, *vague),
    )
    return moved, replace(part, virgin=part.virgin[moved.displacement[part.virgin] >= -1e-9])


def _began(record: Record, part: Branches, gauge_length: float, preload: float | None) -> Record:
    """The record of a strip that is taut from the start, from where it is free of force."""
    d, force = record.displacement[part.virgin], record.force[part.virgin]
    first = curves.offset(d, force)
    peak = float(running_median(force).max()) - first
    reach = float(np.ptp(d))
    # a record that has lost its first lines, or begins at a pre-load, and whose displacement is that of the machine
    if TINY * reach < record.zero < NEAR * reach and (first > EXACT * peak or first == 0.0):
        before = curves.offset(d + record.zero, force)
        lost = record.zero < 3 * float(np.median(np.diff(d)))
        if abs(before) < (1.0 if lost else 0.3) * first or (lost and before == 0.0):
            zero = f"{record.file}: the first reading is at {1e3 * record.zero:.4g} mm"
            note = f"{zero}, next to the zero of the file, from which the displacement counts."
            moved = record.displacement + record.zero
            return replace(record, displacement=moved, zero=0.0, notes=(*record.notes, note))
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
    # an empty load cell shows its offset, and no less, so that a force below it on the way back is none of an offset
    lowest = min((float(record.force[run].min()) for run in part.unloading), default=np.inf)
    below = preload is None and lowest < 0.7 * first - 5 * noise(record.force) and first > 2 * SMALL * peak
    if first > 0 and (preload or below):
        drawn, error = _drawn(d, force, gauge_length)
        vague = [f"{start}; how far the strip was drawn before is known to ± {1e3 * error:.2g} mm only"]
        why = "of which the list of tests says" if preload else "for it falls below that on the way back"
        note = f"{start}, a pre-load, {why}; the displacement counts from {1e3 * drawn:.3g} mm before."
        moved = record.displacement + drawn
        return replace(
            record,
            displacement=moved,
            zero=record.zero - drawn,
            notes=(*record.notes, note),
            doubts=(*record.doubts, *vague) if 4 * error > VAGUE * reach else record.doubts,
        )
    note = f"{start} (pre-load, offset or friction); subtracted."
    doubts: tuple[str, ...] = ()
    if preload is None and first > 2 * SMALL * peak and not _idles(record, part, first):
        doubts = (f"{start}; give preload_N in the list of tests, 0 if that is an offset of the load cell",)
    return replace(record, force=record.force - first, notes=(*record.notes, note), doubts=(*record.doubts, *doubts))


def _idles(record: Record, part: Branches, first: float) -> bool:
    """Whether the force comes to rest at its first value on the way back, as that of an empty load cell does."""
    wide = max(0.3 * abs(first), 5 * noise(record.force))
    last = [np.abs(record.force[run[-6:]] - first) < wide for run in part.unloading]
    return any(len(near) == 6 and bool(near.all()) for near in last)


def _misfit(d: Array, force: Array, gauge_length: float, start: float, terms: int) -> tuple[float, float]:
    """Sum of squares that a stress of so many terms from `start` on leaves of the force (N), and the mean before it."""
    taut = d > start
    idle = float(force[~taut].mean()) if not taut.all() else 0.0
    stretch = 1 + (d[taut] - start) / gauge_length
    x = (stretch**2 - 1) / (stretch.max() ** 2 - 1)
    A = x[:, None] ** np.arange(1, terms + 1) * stretch[:, None]
    c, *_ = np.linalg.lstsq(A, force[taut] - idle)
    return float(((A @ c - force[taut] + idle) ** 2).sum() + ((force[~taut] - idle) ** 2).sum()), idle


def _slack(d: Array, force: Array, gauge_length: float) -> tuple[float, float, float] | None:
    """Displacement (m) at which the force rises, the force before, and the error of the former; None if at the start.

    Found as the place from which a polynomial describes the force best, if it is much better than one from the start
    with an offset, and the force before it is flat.
    """
    smooth = running_median(force)
    peak = float(np.ptp(smooth))
    end = float(d[int(np.argmax(smooth - smooth[0] > TOE * peak))])
    if not end > d[0] or np.count_nonzero(d > end) < 8:
        return None
    n, few = len(d), len(d) * (EXACT * peak) ** 2
    # where no load cell is noisy, the last force that has not risen says more than any polynomial
    still = noise(force[: np.count_nonzero(d <= end)]) < 0.1 * EXACT * peak
    low = float(d[0])
    if still:
        risen = int(np.argmax(np.abs(force - force[0]) > EXACT * peak))
        low, end = float(d[max(risen - 2, 0)]), float(d[risen])
        few = 0.0
    A = np.hstack([np.ones((n, 1)), (d[:, None] / d.max()) ** np.arange(1, 5)])
    c, *_ = np.linalg.lstsq(A, force)
    straight = float(((A @ c - force) ** 2).sum())

    def squares(start: float, terms: int) -> float:
        return _misfit(d, force, gauge_length, start, terms)[0]

    # a coarse look first, for most strips are taut
    least = min(squares(float(s), terms) for s in np.linspace(low, end, GRID + 1) for terms in (2, 4))
    if n * np.log((straight + few) / (least + few)) < SURE + np.log(n):
        return None
    slack, spread, terms = _start(squares, low, end, n)
    left, idle = _misfit(d, force, gauge_length, slack, terms)
    before = d <= slack
    if slack - d[0] < SHORT * np.ptp(d) or np.count_nonzero(before) < 3:
        return None
    way = d[before] - d[before].mean()
    width = float(way @ way)
    slope, error = float(way @ force[before]) / width, float(np.sqrt(left / n / width))
    after = (d > slack) & (d <= 2 * slack - d[0])
    rise = float(force[after].mean() - idle) / (0.5 * (slack - d[0])) if after.any() else 0.0
    flat = abs(slope) < FLAT * rise + 2 * error and 2 * error < rise
    return (slack, idle, spread) if flat else None


def _drawn(d: Array, force: Array, gauge_length: float) -> tuple[float, float]:
    """How far (m) before the first reading a strip was free of force, and its standard error."""
    before = float(np.diff(d[d > d[0]], prepend=d[0])[0]) * 1e-3 if d[-1] > d[0] else 0.0  # no reading is at rest
    squares = lambda s, k: _misfit(d + s, force, gauge_length, 0.0, k)[0]  # noqa: E731
    return _start(squares, before, NEAR * float(np.ptp(d)), len(d))[:2]


def _start(squares: Callable[[float, int], float], low: float, high: float, n: int) -> tuple[float, float, int]:
    """Where a curve begins, the standard error, and its terms: four must earn their place, as in `curves.loading`."""
    found = []
    for terms in (2, 4):
        place, spread = _least(lambda s, k=terms: squares(s, k), low, high, n)  # type: ignore[misc]
        score = n * np.log(max(squares(place, terms), 1e-300)) + terms * np.log(n)
        found.append((score, place, spread, terms))
    return min(found)[1:]


def _least(squares: Callable[[float], float], low: float, high: float, n: int) -> tuple[float, float]:
    """Where a sum of n squares is the least, and its standard error there; the sum may have kinks."""
    step, best, spread = (high - low) / GRID, low, 0.0
    for _ in range(ZOOMS):
        places = np.linspace(max(low, best - GRID * step), min(high, best + GRID * step), GRID + 1)
        tried = np.array([squares(float(place)) for place in places])
        likely = places[tried < tried.min() * (1 + 1 / n)]
        best = float(places[int(tried.argmin())])
        if not spread and len(likely) > 2:  # later zooms do not see all of it
            spread = float(np.ptp(likely)) / 2
        step = 4 * float(places[1] - places[0]) / GRID
    return best, spread
