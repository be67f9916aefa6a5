"""Explicit dynamics: Newmark with beta = 0, gamma = 1/2 (central differences) as a PETSc TS, with lumped mass.

Nothing is solved for, and no tangent is compiled. Mass is lumped, see `motion.Motion.lump`. Directors turn on their
sphere by the angle of a step, rigid bodies freely between two pushes (`bodies.Body.drift`).
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from mpi4py import MPI
from dolfinx import fem, la
from petsc4py import PETSc

from ..errors import InputError, StepFailed
from ..laws import Array
from ..shell.dirichlet import check
from ..terms.extra import extra_force
from ..terms.term import Residual, Term
from . import stable_step
from .checkpoint import Field
from .continuation import Step, progress_bar
from .drifting import drift, lay
from .leading import HELD, free_part, limited
from .motion import Motion
from .stepper import Stepper

SAFETY = 0.9
"""Step as a part of the largest stable one."""
SHORTEST, RESOLVING = 1 / 64, 1 / 1024
"""Of a step that terms shorten, and of one that resolves impacts of bodies with mass."""
STIFF = 1.0
"""The most of a step times the frequency of what limits it: a sheet that is pressed hard has no stable step above 2."""
RESOLVED, SLOW = 10.0, 0.5
"""Steps, at least, in which a body with mass closes a gap; and the most of a step times the frequency of what limits
it. Else impacts make energy: of a box at 2 m/s 28 % with 4 and 1.8, and 0.5 % so."""
WEIGH = 20
"""Steps from one entry of the ledger to the next, if it is not told."""


class CentralDifference(Stepper):
    """M a + residual(q, velocity) = 0 at the start of every step; a Python type of PETSc's TS, which is `ts`.

    `stable` is the largest stable step in s, 2/omega of the fastest oscillation with the stiffest tangent that the law
    tells (`stiffest`, else the one at rest) on the present shape, by power iteration. `weigh`: steps from one entry of
    the ledger to the next.

    Args:
        motion, residual, bcs, set_load, start: as for `newmark.Newmark`. Directors should have the inertia of a cell
            (`Sheet.mass`): with that of the thickness the step is shorter by half.
    """

    def __init__(
        self,
        motion: Motion,
        residual: Residual,
        bcs: Sequence[fem.DirichletBC],
        *,
        set_load: Callable[[float], None] = lambda t: None,
        start: float = 0.0,
    ) -> None:
        super().__init__(motion, residual, bcs, set_load, start)
        self.q, self.V = motion.q, motion.q.function_space
        self.bodies = [] if motion.space is None else motion.space.bodies
        if motion.space is not None:
            start = motion.space.function().x.array
            motion.space.supports(bcs)
            self.q.x.array[:] += motion.space.function().x.array - start
        self._force = la.vector(self.V.dofmap.index_map, self.V.dofmap.index_map_bs)
        self._given_v = self._given_a = np.zeros(len(motion.given))
        self.directors = np.empty((0, 3), dtype=np.int32) if motion.space is None else motion.space.nodes
        self._displacements = np.setdiff1d(np.arange(len(self.q.x.array), dtype=np.int32), self.directors.ravel())
        self._drifting, self._turning = self._displacements, self.directors
        for body in self.bodies:
            self._drifting = np.setdiff1d(self._drifting, body.nodes).astype(np.int32)
            self._turning = self._turning[~np.isin(self._turning[:, 0], body.directors[:, 0])]
        self.mass = motion.lump()
        if self.comm.allreduce(bool((self.mass <= 0.0).any())):
            raise InputError("Explicit motion needs directors with inertia: leave the rotary part of the mass in.")
        self.stable, self.weigh = stable_step.find(self), WEIGH
        lumped = fem.Function(self.V)
        lumped.x.array[:] = self.mass
        motion.mass = PETSc.Mat().createDiagonal(lumped.x.petsc_vec.copy())

    def lay(self, values: Array, q: Array) -> None:
        """Take from values, rates, what is along directors of q or would deform bodies; they keep their momentum."""
        lay(values, q, self._turning)
        for body in self.bodies:
            body.project(values, q, self.mass)

    # -- what a checkpoint asks for -------------------------------------------------------------------------------

    def fields(self) -> list[Field]:
        """The arrays of the last step; see `checkpoint`."""
        moved = zip(("q", "v", "a"), (self.q, self.motion.velocity, self.motion.acceleration), strict=True)
        return [(name, None, function.x.array) for name, function in moved] + super().fields()

    def renew(self) -> None:
        """Go on from what has been put into `fields` and `numbers`."""
        self.set_load(self.time)
        for term in self.terms:
            term.renew()
        self.evaluate()
        self._go_on()

    _weighs = True

    # -- a step ---------------------------------------------------------------------------------------------------

    @property
    def owned(self) -> int:
        """Number of the unknowns that are this rank's own; they come first."""
        return int(self.V.dofmap.index_map.size_local * self.V.dofmap.index_map_bs)

    def evaluate(self, stiffest: bool = False) -> Array:
        """Residual at the present q and velocity, local array, complete on ghosts too; see `Term.evaluate`."""
        force = self._force.array
        force[:] = 0.0
        for term in self.terms:
            term.evaluate(tangent=False, stiffest=stiffest)
            term.add_force(force)
        self._force.scatter_reverse(la.InsertMode.add)
        self._force.scatter_forward()
        return np.asarray(force)

    def step(self, ts: PETSc.TS) -> None:
        """One step of `ts`'s length; never raises."""
        self._step(ts.getTimeStep(), (RESOLVING if self.extra else SHORTEST) * ts.getTimeStep())
        ts.setTime(self.time)

    def _step(self, dt: float, shortest: float) -> None:
        """A step of dt (s), in halves where terms limit it; if the shortest is too long still, all slows down."""
        motion = self.motion
        q, v, a = self.q.x.array, motion.velocity.x.array, motion.acceleration.x.array
        some = limited(self.terms)
        part = free_part(some, self._way(dt), self.comm) if some else 1.0
        if some and dt > shortest and (part < 1.0 or not self._resolves(some, dt)):
            self._step(dt / 2, shortest)
            self._step(dt / 2, shortest)
            return
        if part < 1.0:
            moving = float(np.sum(self.mass[: self.owned] * v[: self.owned] ** 2)) / 2
            beside = self.extra.kinetic() if self.extra and self.comm.rank == 0 else 0.0
            self._lag -= (1.0 - part**2) * (moving + beside)
            v *= part
            a *= part
            if self.extra:
                self.extra.slow(part)
        for term in self.terms:
            term.prepare(dt)
        before = self._square()
        v += 0.5 * dt * a
        drift(q, v, self._drifting, self._turning, dt)
        for body in self.bodies:
            body.drift(q, v, self.mass, dt)
        if self.extra:
            self.extra.drift(dt)
        self.time += dt
        self._move_supports(dt)
        self._led = all([term.follow() for term in self.terms])
        force = self.evaluate()
        np.divide(force, self.mass, out=a)
        a *= -1.0
        a[motion.given] = self._given_a
        self.lay(a, q)
        v += 0.5 * dt * a
        v[motion.given] = self._given_v
        if self.extra:
            self.extra.kick(extra_force(self.terms, self.extra.count), dt)
        self._lag += dt**2 / 8 * (self._square() - before)
        if self.ledger is not None and self._weighs:
            self.ledger.weigh()
        for term in self.terms:
            term.commit()
        if self.ledger is not None and self._weighs:
            self.ledger.accept()

    _led, _lag = True, 0.0

    def _way(self, dt: float) -> Array:
        """Of q in a step of dt, local array."""
        way, motion = np.zeros_like(self.q.x.array), self.motion
        moved = self._displacements
        way[moved] = dt * (motion.velocity.x.array[moved] + 0.5 * dt * motion.acceleration.x.array[moved])
        if self.extra:
            self.extra.aim(dt)
        return way

    def _resolves(self, some: Sequence[Term], dt: float) -> bool:
        """Whether terms that limit steps are soft enough for one of dt, and bodies with mass have a part of it left."""
        fastest = self.comm.allreduce(max(term.fastest(self.mass) for term in some), MPI.MAX)
        if dt**2 * fastest > (SLOW if self.extra else STIFF) ** 2:
            return False
        if not self.extra:
            return True
        way = RESOLVED * self._way(dt)
        self.extra.change = RESOLVED * self.extra.change
        return free_part(some, way, self.comm) == 1.0

    def _square(self) -> float:
        """Of inertia over mass, on this rank, N m/s2."""
        a = self.motion.acceleration.x.array[: self.owned]
        beside = self.extra.lag() if self.extra and self.comm.rank == 0 else 0.0
        return float(np.sum(self.mass[: self.owned] * a * a)) + beside

    def forces(self) -> Array:
        """M a + residual in N at the owned unknowns: at supports, the reactions."""
        total = self._force.array + self.mass * self.motion.acceleration.x.array
        return np.asarray(total[: self.owned])

    def lag(self) -> float:
        """Energy in J, on this rank, by which the kinetic one at a step is ahead of what the scheme keeps.

        Over a step the kinetic energy and the work of inertia, by the trapezoidal rule, differ by its change.
        What is lost by slowing down is taken off.
        """
        return self._lag

    def _move_supports(self, dt: float) -> None:
        """Given values at the present time, and their velocity and acceleration."""
        now, self._given_v, self._given_a = self.given_motion(self.time, dt)
        self.q.x.array[self.motion.given] = now

    def begin(self, dt: float) -> None:
        """Find the acceleration with which the motion starts, its supports led over a step of dt (s)."""
        motion = self.motion
        self._move_supports(dt)
        motion.velocity.x.array[motion.given] = self._given_v
        for body in self.bodies:
            body.project(motion.velocity.x.array, self.q.x.array, self.mass)
        a = motion.acceleration.x.array
        a[:] = -self.evaluate() / self.mass
        a[motion.given] = self._given_a
        self.lay(a, self.q.x.array)
        if self.extra:
            self.extra.start(extra_force(self.terms, self.extra.count))
        if self.ledger is not None:
            self.ledger.start()
        self._began = True

    def march(self, end: float, every: float, dt: float | None = None, progress: str | None = None) -> Iterator[Step]:
        """Go on to the time `end`; yields a `Step` each `every` seconds, its load being the time.

        dt: the step in s, by default `SAFETY` of the stable one, or a little less to meet `every`. Raises
        InputError for a step that is not stable; StepFailed, on every rank and with q at the last `every`
        that was good, once the motion is not finite or gains energy out of nothing.
        """
        if dt is not None and not 0.0 < dt <= self.stable:
            raise InputError(f"A step of {dt!r} s is not stable: the largest is {self.stable:.3g} s.")
        steps = max(1, round((end - self.time) / every))
        parts = math.ceil(every / (dt or SAFETY * self.stable) * (1 - 1e-12))
        self.ts.setTimeStep(every / parts)
        if not self._began:
            self.begin(every / parts)
        with progress_bar(steps, progress, self.comm) as bar:
            for _ in range(steps):
                clock, begun = time.perf_counter(), self.time
                check(self._bcs, self.V)
                good = [array.copy() for array in self._arrays()], self.extra.numbers() if self.extra else {}
                for part in range(1, parts + 1):
                    self._weighs = part % self.weigh == 0 or part == parts
                    self.ts.step()
                self._weighs = True
                self.time = begun + every
                self._judge(good, begun)
                self.number += 1
                bar.set_postfix_str(f"t={self.time:.4g} s{self._balance()}", refresh=False)
                bar.update()
                yield Step(self.number, self.time, parts, 0, time.perf_counter() - clock)
                self.pause()

    def _arrays(self) -> list[Array]:
        return [array for _, _, array in self.fields()]

    def _judge(self, good: tuple[list[Array], dict[str, float]], begun: float) -> None:
        """Raise StepFailed if the motion is no longer one, with the last good state in place."""
        kinetic = self.motion.kinetic()
        said = None if self._led else HELD
        if not math.isfinite(kinetic):
            said = "the motion is not finite"
        elif self.ledger is not None and abs(self.ledger.totals["imbalance"]) > 0.2 * max(self.ledger.most, 1e-300):
            said = f"energy came from nowhere: {-self.ledger.totals['imbalance']:.3g} of {self.ledger.most:.3g} J"
        if said is None:
            return
        for array, before in zip(self._arrays(), good[0], strict=True):
            array[:] = before
        if self.extra:
            self.extra.set_numbers(good[1])
        reached, self.time = self.time, begun
        raise StepFailed(
            f"Explicit motion failed between {begun:.6g} and {reached:.6g} s: {said}. The step, "
            f"{self.ts.getTimeStep():.3g} s, is too large for what the sheet has become; take a smaller one."
        )
