"""How much of a Newton correction is taken where forces have kinks or rise steeply, as those of contact.

Where a step has an energy, the residual along the correction, its slope, tells how fast that falls; with friction it
nearly has one. A whole correction is taken unless the slope has turned well round at its end: then Newton's method has
overshot, and a place where the slope is small is looked for between two where it has opposite signs. By one guess of it
alone, or by the size of the residual, two states can follow each other for ever.
"""

from collections.abc import Callable

import numpy as np

SMALL = 0.25
"""Part of the slope at the start that is small."""
TRIALS = 6


def part_to_take(slope: Callable[[float], float], start: float) -> float:
    """The part of a correction to take, above 0 and up to 1; slope: at a part of it, NaN where nothing is defined.

    The slope at the `start` is positive, or else the whole is taken that has one. By the Illinois rule (Dowell and
    Jarratt 1971, doi 10.1007/BF01934364).
    """
    (a, before), (b, after), part = (0.0, start), (1.0, slope(1.0)), 1.0
    if after >= -SMALL * start or (start <= 0.0 and np.isfinite(after)):
        return part
    side = 0
    for _ in range(TRIALS):
        part = (a + b) / 2
        if start > 0.0 and np.isfinite(after):
            part = float(np.clip(b - after * (b - a) / (after - before), a + 0.05 * (b - a), b - 0.05 * (b - a)))
        now = slope(part)
        if abs(now) <= SMALL * abs(start):
            break
        if now > 0.0:
            a, before, after, side = part, now, after / 2 if side > 0 else after, 1
        else:
            b, after, before, side = part, now, before / 2 if side < 0 else before, -1
    return part
