"""Impulsive forces in explicit motion, as those of contact: stiffer than the sheet, they act in parts of a step.

At the ends of parts no other force is found; those push at both ends of the step (r-RESPA: Tuckerman, Berne, Martyna
1992, doi 10.1063/1.463137).
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from dolfinx import fem, la

from ..laws import Array, Stiffest
from ..shell.bodies import Body
from ..terms.extra import Extra, extra_force
from ..terms.term import Term
from .drifting import accelerate, drift, kick, weighed
from .leading import free_part, limited
from .stepper import Stepper

SHORTEST, RESOLVING = 1 / 64, 1 / 1024
"""Parts of a step, at least; and where bodies with mass hit."""
RESOLVED, SLOW = 10.0, (1.0, 0.5)
"""Parts, at least, in which a body with mass closes a gap; and the most of a part times the frequency of what limits
it, in a sheet and where bodies with mass hit. Else impacts make energy: of a box at 2 m/s 28 % with 4 and 1.8, and
0.5 % so; of a sheet on a sphere 8 % with 1.8, and 1 % so."""


class InParts(Stepper):
    """A motion with a lumped `mass` (local array) that drifts between two pushes, and in parts where forces are sudden.

    Public: `V`, the space of q; `bodies`, nodes of the sheet that move as one; `pull` and `push`, accelerations by
    steady and by sudden forces, local arrays. A class derived from this one has `_move_supports`.
    """

    V: fem.FunctionSpace
    mass: Array
    bodies: list[Body]
    _displacements: np.ndarray
    _drifting: np.ndarray
    _turning: np.ndarray
    _led, _lag = True, 0.0

    def _split(self) -> None:
        """Tell steady terms from sudden ones."""
        self._sudden = [term for term in self.terms if term.impulsive or term is self.extra]
        self._steady = [term for term in self.terms if term not in self._sudden]
        self._limited = limited(self.terms)
        self._force, self._blow = (la.vector(self.V.dofmap.index_map, self.V.dofmap.index_map_bs) for _ in range(2))
        # to ask DOLFINx for its arrays takes a while
        self._of_q, self._of_v = self.q.x.array, self.motion.velocity.x.array
        self._none_given = np.zeros(len(self.motion.given))
        self.pull, self.push = self.motion.acceleration.x.array, np.zeros_like(self._of_q)
        if self._sudden:
            self.pull = np.zeros_like(self.push)

    def _move_supports(self, dt: float) -> None:
        raise NotImplementedError

    @cached_property
    def owned(self) -> int:
        """Number of the unknowns that are this rank's own; they come first."""
        return int(self.V.dofmap.index_map.size_local * self.V.dofmap.index_map_bs)

    def _summed(self, terms: Sequence[Term], force: la.Vector, stiffest: Stiffest = False) -> Array:
        total = np.asarray(force.array)
        total[:] = 0.0
        for term in terms:
            term.evaluate(tangent=False, stiffest=stiffest)
            term.add_force(total)
        if self.comm.size > 1:
            force.scatter_reverse(la.InsertMode.add)
            force.scatter_forward()
        return total

    def _strike(self) -> Array:
        """Sudden forces at the present q, as `evaluate`."""
        return self._summed(self._sudden, self._blow) if self._sudden else self._blow.array

    def _accelerate(self, force: Array, a: Array, given: Array) -> None:
        """Take the acceleration by a residual, local array, for a; of what is given, the one that is given."""
        accelerate(force, self.mass, self.motion.given, given, self._of_q, self._turning, a)
        for body in self.bodies:
            body.project(a, self._of_q, self.mass)

    def _part(self, dt: float, shortest: float) -> None:
        """Move by dt (s), in halves where terms limit it; if the shortest is too long still, all slows down."""
        q, v = self._of_q, self._of_v
        if self._limited and not self._resolves(dt):
            if dt > shortest:
                self._halves(dt, shortest)
                return
            self._slow_down(free_part(self._limited, self._way(dt), self.comm))
        for term in self._sudden:
            term.prepare(dt)
        if self._sudden:
            start = q.copy(), v.copy(), self.push.copy()
            before = self._square(self.push, self.extra)
            kick(v, self.push, 0.5 * dt)
        drift(q, v, self._drifting, self._turning, dt)
        for body in self.bodies:
            body.drift(q, v, self.mass, dt)
        if self.extra:
            self.extra.drift(dt)
        self.time += dt
        self._move_supports(dt)
        self._led = all([term.follow() for term in self.terms])
        if not self._sudden:
            return
        self._accelerate(self._strike(), self.push, self._none_given)
        if not self.extra and dt > shortest and self._too_stiff(dt):
            # also where it ends: a rule that looks one way only makes energy
            q[:], v[:], self.push[:] = start
            self.time -= dt
            self._move_supports(dt)
            for term in self._sudden:
                term.restore()
            self._halves(dt, shortest)
            return
        kick(v, self.push, 0.5 * dt)
        if self.extra:
            self.extra.kick(extra_force(self.terms, self.extra.count), dt)
        self._lag += dt**2 / 8 * (self._square(self.push, self.extra) - before)
        for term in self._sudden:
            term.commit()

    def _past(self) -> tuple[list[Array], list[Any], float, float]:
        """The state at the end of a step, for `_take_back`."""
        arrays = [array.copy() for array in (self._of_q, self._of_v, self.pull, self.push)]
        return arrays, [term.past() for term in self._sudden], self.time, self._lag

    def _take_back(self, past: tuple[list[Array], list[Any], float, float]) -> None:
        """Undo a step whose steady forces have not been committed."""
        arrays, pasts, self.time, self._lag = past
        for array, before in zip((self._of_q, self._of_v, self.pull, self.push), arrays, strict=True):
            array[:] = before
        for term, before in zip(self._sudden, pasts, strict=True):
            term.take_back(before)
        for term in self._sudden:
            term.evaluate(tangent=False)

    def _halves(self, dt: float, shortest: float) -> None:
        self._part(dt / 2, shortest)
        self._part(dt / 2, shortest)

    def _slow_down(self, part: float) -> None:
        """Go on with a part of all velocities and sudden forces."""
        if part == 1.0:
            return
        v = self.motion.velocity.x.array
        moving = float(weighed(self.mass, v[: self.owned])) / 2
        beside = self.extra.kinetic() if self.extra and self.comm.rank == 0 else 0.0
        self._lag -= (1.0 - part**2) * (moving + beside)
        v *= part
        self.push *= part
        if self.extra:
            self.extra.slow(part)

    def _way(self, dt: float) -> Array:
        """Of q in a part of dt, local array."""
        way, moved = np.zeros_like(self.q.x.array), self._displacements
        way[moved] = dt * (self.motion.velocity.x.array[moved] + 0.5 * dt * self.push[moved])
        if self.extra:
            self.extra.aim(dt)
        return way

    def _too_stiff(self, dt: float) -> bool:
        fastest = self.comm.allreduce(max((term.fastest(self.mass) for term in self._limited), default=0.0), MPI.MAX)
        return bool(dt**2 * fastest > SLOW[self.extra is not None] ** 2)

    def _resolves(self, dt: float) -> bool:
        """Whether terms that limit parts allow one of dt, with some of it left, and are not too stiff for it."""
        if self._too_stiff(dt):
            return False
        way = self._way(dt)
        if self.extra:
            way *= RESOLVED
            self.extra.change = RESOLVED * self.extra.change
        return free_part(self._limited, way, self.comm) == 1.0

    def _square(self, a: Array, extra: Extra | None = None) -> float:
        """Of inertia over mass, on this rank, N m/s2."""
        beside = extra.lag() if extra and self.comm.rank == 0 else 0.0
        return float(weighed(self.mass, a[: self.owned])) + beside
