"""Pointwise laws: strain and committed state in, stress, tangent and new state out.

Every law works on batches of points in warp/weft axes. For the plane laws of this package a
strain is packed as (E11, E22, 2 E12), Green-Lagrange, and a stress as (S11, S22, S12), second
Piola-Kirchhoff, in Pa; 1 is the warp, 2 the weft.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Law(Protocol):
    """What a law has to offer: three members, nothing else.

    A law is a pure function. The same strain and state give the same answer however often it is
    asked, and what is passed in is never changed: history moves only when the caller commits.
    """

    initial_state: Array
    """State of a point that was never strained; shape (number of state variables,), may be empty."""

    symmetric: bool
    """Whether the tangent is symmetric for every strain and state."""

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Stress, tangent and new state of n points.

        strain (n, m); state (n, number of state variables), the committed one. Returns stress
        (n, m) in Pa, tangent (n, m, m) in Pa with row = stress and column = strain, and the new
        state, shaped as `state`. `out` takes three such arrays to write into. A point with a
        strain that is not finite gets a stress of NaN; nothing raises.
        """
        ...
