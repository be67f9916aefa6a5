"""What a residual is a sum of: terms, each with its force, its stiffness, its energy and its history.

Solvers, the account of energies and checkpoints go over a list of terms and know none of them by name. Internal work
of a shell (`work`), a UFL form (`form`) and inertia (`solvers.motion`) are terms; so is what a user derives.
"""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from ufl.form import Form

from ..laws import Array, Stiffest

type Indices = np.ndarray
type Residual = Form | Term | int | Sequence[Form | Term]
"""What a solver takes: a UFL form, a term, or a list of both; 0 for nothing."""

NOWHERE: tuple[Indices, Indices] = (np.empty(0, dtype=np.int32), np.empty(0, dtype=np.int32))
"""Pattern of a term without stiffness."""


class Term:
    """A part of a residual; a class derived from this one has to give `add_force`, the rest has defaults.

    Arrays of forces are local ones of the space of the unknown q (of a shell, V), ghosts at their end; what is added
    to a ghost reaches its owner. Nothing may raise once the term is made, and what a method does may depend on q, the
    present loads and the last commit, but not on what was asked before.
    """

    symmetric = False
    """Whether its stiffness is, in every state."""
    pattern_changed = False
    """Whether entries of its stiffness have moved since `pattern` was last asked."""
    has_kinks = False
    """Whether its force has kinks, as that of a measured fabric: implicit motion then takes a line search."""
    account: Literal["external", "damping"] = "external"
    """What its work is in the account of a motion, where it has no energy."""
    loses: Literal["law", "friction"] = "law"
    """By what it loses that of which `dissipated` tells."""
    impulsive = False
    """Whether its force acts at the end of an implicit time step only, and leaves no trace in the acceleration with
    which the next step begins; see `solvers.motion`."""

    def evaluate(self, tangent: bool = True, stiffest: Stiffest = False) -> bool:
        """At the present unknowns, under the present loads; False where something is not finite.

        Args:
            tangent: whether `add_stiffness` will be asked.
            stiffest: answer as stiffly as the material can, whatever its history, which stays: for explicit steps.
                "so far": as it can at once after its history.
        """
        return True

    def hardening(self) -> float | None:
        """By how much its stiffest answer so far has grown with the last evaluation, at most, as a part of the stiffest
        ever, on this rank; None of what does not harden. It is told without a tangent only."""
        return None

    def add_force(self, total: Array) -> None:
        """Add the force (N) of the last evaluation to the total, a local array."""
        raise NotImplementedError

    def add_extra_force(self, total: Array) -> None:
        """Add to a total (count,) what it does to unknowns of an `extra.Extra`, N and N m, the same on every rank."""

    def foresee(self, change: Array) -> None:
        """Keep the strains e to which a change of q (local array) leads to first order."""

    def linearise(self, reach: float) -> None:
        """Have, until the next evaluation, the stress S(e) + reach C(e) (E - e) and the tangent C(e).

        E is the present strain, e what was foreseen, reach 0 or 1.
        """

    def pattern(self) -> tuple[Indices, Indices]:
        """Global rows and columns (n,) of the entries of its stiffness; some may come several times."""
        return NOWHERE

    def add_stiffness(self, values: Array) -> None:
        """Add the derivative of the force by q, at the last evaluation, to values (n,) at the entries of `pattern`."""

    def turned_pattern(self) -> tuple[Indices, Indices] | None:
        """`pattern` by displacements and angles of a shell, if it can tell its stiffness by them; else None.

        A matrix whose terms all can is summed up at once, and not first in displacements and directors.
        """
        return None

    def add_turned(self, values: Array) -> None:
        """As `add_stiffness`, by displacements and angles: add to values, at the entries of `turned_pattern`."""

    def longest_step(self, change: Array) -> float:
        """The part of a change of q (local array) that may be taken at most, on this rank; up to 1."""
        return 1.0

    def fastest(self, mass: Array) -> float:
        """The most by which its present stiffness, over a mass of each unknown (local array), raises the square of a
        frequency, 1/s2, on this rank; what `stiffest` has told apart."""
        return 0.0

    def prepare(self, dt: float) -> None:
        """Before a time step of dt (s)."""

    def follow(self) -> bool:
        """Go on, as far as may be at once, to where it is led; False, on every rank, while there is more to go."""
        return True

    def carry(self, given: Array) -> Array | None:
        """Before `follow`: go on to where it is led and take the sheet along, as far as both may go at once.

        given: change of q, a local array, where supports say it, and NaN elsewhere. Returns that of all q, or None.
        """
        return None

    def energy(self) -> float | None:
        """What it stores at the last evaluation, J on this rank; None if it has none, and its work is all there is."""
        return None

    def potential(self) -> float | None:
        """Energy whose gradient by q is the force, at the last evaluation, J on this rank; None if there is none.

        It belongs to the step from the last commit: a history is what it was then, and a constant may be missing.
        """
        return None

    def dissipated(self) -> float:
        """What it has lost since the last `watch`, J on this rank, at the last evaluation."""
        return 0.0

    def supplied(self) -> float:
        """Work that leads it, since the last `watch`, J on this rank, at the last evaluation."""
        return 0.0

    def watch(self) -> None:
        """Account for energies from the present state on, which is that of the last commit."""

    def commit(self) -> None:
        """Move the past: the step to the last evaluation has happened."""

    def restore(self) -> None:
        """The unknowns are back at the last commit."""
        self.evaluate()

    def past(self) -> Any:
        """What commits move, for `take_back`; asked of impulsive terms, which commit several times in a step."""

    def take_back(self, past: Any) -> None:
        """Unknowns are back where they were as `past` was asked for, some commits ago; `evaluate` follows."""

    def renew(self) -> None:
        """Unknowns and `fields` have been put in place from a checkpoint."""
        self.evaluate()

    def fields(self) -> list[tuple[str, np.ndarray, Array]]:
        """What a checkpoint has to hold: names, local cells (cells,), and an array (cells, numbers of a cell) each."""
        return []

    def worst(self) -> tuple[float, str]:
        """Largest strain on this rank, infinite where it or its stress is not finite; and where, for a message."""
        return 0.0, ""
