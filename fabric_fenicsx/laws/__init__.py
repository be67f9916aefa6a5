"""Pointwise laws: strain and committed state in, stress, tangent and new state out.

`Law` is all that a law has to be. What it may offer besides are the protocols after it, one member each: whoever needs
one asks `isinstance(law, HasPotential)`, and `driver.check` tests those that a law has.

Every law works on batches of points in warp/weft axes. For the plane laws of this package a
strain is packed as (E11, E22, 2 E12), Green-Lagrange, and a stress as (S11, S22, S12), second
Piola-Kirchhoff, in Pa; 1 is the warp, 2 the weft.
"""

from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

type Stiffest = Literal[False, True, "so far"]
"""Whether, for explicit steps, to answer as stiffly as ever, or as is possible at once after the history so far."""
type Poisson = Literal["measured", "lowered"]
"""Which of the pairs of Poisson's ratios of a fabric (Table 7.4)."""


class Law(Protocol):
    """What a law has to offer: three members. What it may offer besides is in protocols of its own.

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


def empty(strain: Array, state: Array) -> tuple[Array, Array, Array]:
    """Arrays for what a law answers to a strain (n, m) and a state, where `out` is not given."""
    n, m = strain.shape
    return np.empty((n, m)), np.empty((n, m, m)), np.empty_like(state)


@runtime_checkable
class HasStiffness(Protocol):
    """A linear law without history: S = C E."""

    stiffness: Array
    """C (m, m) in Pa, row = stress, column = strain."""


@runtime_checkable
class HasStiffest(Protocol):
    """A law of which a bound of the tangent is known, as the step of explicit motion needs it."""

    @property
    def stiffest(self) -> Law:
        """A linear law that is as stiff as this one within its measured range, whatever its history."""
        ...


@runtime_checkable
class HasAdvance(Protocol):
    """A law that can leave its tangent out, as explicit motion does not need it."""

    def advance(self, strain: Array, state: Array, stress: Array, new: Array) -> float:
        """As `Law.respond`, into `stress` and `new`: by how much, at most, `hardened` has become stiffer by this.

        As a part of `stiffest`; 0 of a law without `hardened`.
        """
        ...


@runtime_checkable
class HasHardened(HasAdvance, Protocol):
    """A law whose largest tangent depends on its history, and only grows."""

    @property
    def hardened(self) -> Law:
        """A law, linear in the strain, that is as stiff as this one can be at once after a state, which is its own."""
        ...


@runtime_checkable
class HasRecoverable(Protocol):
    """A law that tells how much of its work can be had back."""

    def recoverable(self, strain: Array, state: Array) -> Array:
        """Work in J/m3 (n,) that points of a strain (n, m), and of the state after it, give back; not negative."""
        ...


@runtime_checkable
class HasPotential(HasRecoverable, Protocol):
    """A law whose stress from a committed state s0 is the gradient of an energy W(E; s0).

    The work of a step from the committed strain E0 to E1 is W(E1; s0) - W(E0; s0), whatever the path between them.
    W(E0; s0) is what E0 gives back. With s1 the state after the step, W(E1; s1) is what E1 gives back, and the
    dissipation of the step, W(E1; s0) - W(E1; s1), is not negative. The tangent is symmetric.
    """

    def potential(self, strain: Array, state: Array) -> Array:
        """W in J/m3 (n,) at a strain (n, m) from a committed state (n, number of state variables)."""
        ...


@runtime_checkable
class HasCalibration(Protocol):
    """A law that was measured up to some strain only."""

    def beyond_calibration(self, strain: Array) -> str | None:
        """One sentence if a strain (n, m) lies beyond the measured range, else None."""
        ...
