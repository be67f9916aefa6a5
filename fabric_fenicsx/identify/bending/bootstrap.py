"""How sure the bending of a direction is: its specimens are drawn again, as those of the curves are.

A draw changes the shape of the curve (softening, 2HB) where several loops or several 2HB tell it, and B of each kind of
test by its own specimens and by that shape. Each draw goes one step of Gauss and Newton from what was found: a specimen
counts by how far its own B is from the mean, a shape by how much another one changes B (not that of heart loops).
"""

from dataclasses import dataclass

import numpy as np

from ...fabrics import BendingCurve
from ...fabrics.bending import moment
from ...laws import Array

DRAWS, SEED = 300, 2010
REACH = 250.0  # 1/m, to which KES bends


@dataclass(frozen=True)
class Kind:
    """B (N m) by one kind of test and its weight; of each specimen log of its own B over that (n,); and of B by
    softening over B (1/m), and by 2HB (N), the change of log B."""

    name: str
    B: float
    weight: float
    apart: Array
    by_shape: tuple[float, float] = (0.0, 0.0)


def bootstrap(kinds: list[Kind], shape: str, softening: Array, hysteresis: Array) -> Array:
    """Draws (DRAWS, 3) of B (N m), B2 (N m2) and 2HB (N).

    `softening` over B (m) and `hysteresis` (N), one a specimen of the kind `shape`; all numbers of a specimen are drawn
    together. As large as the specimens scatter; a single one is always drawn.
    """
    rng = np.random.default_rng(SEED)
    known: dict[tuple[str, int], np.ndarray] = {}

    def means(name: str, values: Array) -> Array:
        """(DRAWS,) of values (n,) that are drawn again, with the scatter of a mean of n."""
        n = len(values)
        index = known.setdefault((name, n), rng.integers(n, size=(DRAWS, n)))
        return np.asarray(values.mean() + (values[index].mean(axis=1) - values.mean()) * np.sqrt(n / max(n - 1, 1)))

    ratio, width = means(shape, softening), means(shape, hysteresis)
    weights = np.array([kind.weight for kind in kinds])
    own = []
    for kind in kinds:
        moved = kind.by_shape[0] * (ratio - softening.mean()) + kind.by_shape[1] * (width - hysteresis.mean())
        own.append(kind.B * np.exp(means(kind.name, kind.apart) + moved))
    B = weights @ np.array(own) / weights.sum()
    return np.column_stack([B, ratio * B, width])


def of_curve(draws: Array, curve: BendingCurve) -> float:
    """Largest standard deviation of the moment up to `REACH`, there and back, over that at the end."""
    K = np.linspace(0, REACH, 26)[1:, None]
    B, softening, width = draws.T
    M = moment(K, B, softening, curve.limit) + width / 2
    return float(M.std(axis=1).max() / abs(M[-1].mean()))
