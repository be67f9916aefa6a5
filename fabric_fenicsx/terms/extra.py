"""Unknowns beside those of the sheet, with mass: places of bodies that are free to move, say."""

from collections.abc import Iterable
from typing import Protocol

import numpy as np

from ..errors import InputError
from ..laws import Array
from .term import Term


class Rule(Protocol):
    """The time step of an implicit motion, see `solvers.motion.Motion`."""

    alpha_m: float
    beta: float
    gamma: float
    dt: float
    shift: float

    @property
    def impulses(self) -> float: ...


class Extra(Term):
    """A term that brings unknowns of its own, and moves with the sheet by the same rule; terms add forces to them.

    In matrices they come after all unknowns of the sheet, on the last rank, which has their rows. What is told here is
    the same on every rank. They have no place at rest: only a motion can have them.

    Public: `count` of them; `values` (count,), since the last commit; `change` of them, which goes with that of q that
    `Term.longest_step` is asked about.
    """

    count: int
    values: Array
    change: Array

    def join(self, rule: Rule) -> None:
        """The implicit motion that it is part of, before anything else."""

    def start(self, force: Array) -> None:
        """Find the acceleration with which it starts, under this force (count,) at its unknowns, of all terms."""
        raise NotImplementedError

    def rates(self) -> Array:
        """Velocity of its unknowns at the last commit, (count,)."""
        raise NotImplementedError

    def hit(self, force: Array) -> None:
        """An implicit step is solved: impulses of a residual force (count,) act, see `solvers.motion.Motion.hit`."""
        raise NotImplementedError

    def aim(self, dt: float) -> None:
        """Set `change` to that of an explicit step of dt (s)."""
        raise NotImplementedError

    def slow(self, part: float) -> None:
        """Take all but a part from velocity and acceleration."""
        raise NotImplementedError

    def drift(self, dt: float) -> None:
        """The first half of an explicit step: go on to its end."""
        raise NotImplementedError

    def kick(self, force: Array, dt: float) -> None:
        """The second: its acceleration under this force (count,), and its velocity."""
        raise NotImplementedError

    # -- for the account of energies; places are those of mass points, as one row of numbers --------------------------

    def kinetic(self) -> float:
        """Kinetic energy, J."""
        raise NotImplementedError

    def weighed(self) -> tuple[Array, Array, Array]:
        """Places, residual of dead loads, and inertia."""
        raise NotImplementedError

    def jump(self) -> Array:
        """Inertia of what impulses at the end of the last step have added to the velocity, per second of it."""
        raise NotImplementedError

    def lag(self) -> float:
        """Sum of the squares of inertia over mass, N m/s2; see `solvers.explicit.CentralDifference.lag`."""
        raise NotImplementedError

    # -- for checkpoints -----------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, float]:
        """Its state at the last commit."""
        raise NotImplementedError

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them."""
        raise NotImplementedError


def extra_of(terms: Iterable[Term]) -> Extra | None:
    """The one among the terms that has unknowns of its own. Raises InputError where there are two."""
    found = [term for term in terms if isinstance(term, Extra)]
    if len(found) > 1:
        raise InputError("Two terms bring unknowns of their own: put all free bodies into one contact.")
    return found[0] if found else None


def extra_force(terms: Iterable[Term], count: int, impulses: float = 1.0) -> Array:
    """Force (count,) of all terms at the unknowns of an `Extra`, of impulsive ones times `impulses`."""
    total, late = np.zeros(count), np.zeros(count)
    for term in terms:
        term.add_extra_force(late if term.impulsive else total)
    return total + impulses * late if impulses != 0.0 else total
