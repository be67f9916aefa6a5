"""Explicit dynamics: Newmark with beta = 0, gamma = 1/2 (central differences) as a PETSc TS, with lumped mass.

Nothing is solved for, and no tangent is compiled. Mass is lumped, see `motion.Motion.lump`. Directors turn on their
sphere by the angle of a step, rigid bodies freely between two pushes (`bodies.Body.drift`).

A step is as long as the sheet allows; impulsive forces act in parts of it, see `parts`.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from ..errors import InputError, StepFailed
from ..laws import Array
from ..shell.dirichlet import check
from ..terms.extra import extra_force
from ..terms.term import Residual
from . import stable_step
from .checkpoint import Field
from .continuation import Step, progress_bar
from .drifting import lay
from .leading import HELD
from .motion import Motion
from .parts import RESOLVING, SHORTEST, InParts

SAFETY = 0.9
"""Step as a part of the largest stable one."""
WEIGH = 20
"""Steps from one entry of the ledger to the next, if it is not told."""


class CentralDifference(InParts):
    """M a + residual(q, velocity) = 0 at the ends of every step; a Python type of PETSc's TS, which is `ts`.

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
        self._split()
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
        moved = {"q": self.q.x.array, "v": self.motion.velocity.x.array, "a": self.pull}
        moved |= {"push": self.push} if self._sudden else {}
        return [(name, None, array) for name, array in moved.items()] + super().fields()

    def renew(self) -> None:
        """Go on from what has been put into `fields` and `numbers`."""
        self.set_load(self.time)
        for term in self.terms:
            term.renew()
        self.evaluate()
        self._strike()
        self._add_up()
        self._go_on()

    _weighs = True

    # -- a step ---------------------------------------------------------------------------------------------------

    def evaluate(self, stiffest: bool = False) -> Array:
        """Steady forces at the present q and velocity, local array, complete on ghosts too; see `Term.evaluate`."""
        return self._summed(self._steady, self._force, stiffest)

    def _add_up(self) -> None:
        if self._sudden:
            np.add(self.pull, self.push, out=self.motion.acceleration.x.array)

    def step(self, ts: PETSc.TS) -> None:
        """One step of `ts`'s length; never raises."""
        dt, v, weighs = ts.getTimeStep(), self.motion.velocity.x.array, self.ledger is not None and self._weighs
        for term in self._steady:
            term.prepare(dt)
        before = self._square(self.pull)
        v += 0.5 * dt * self.pull
        self._part(dt, (RESOLVING if self.extra else SHORTEST) * dt)
        self._accelerate(self.evaluate(), self.pull, self._given_a)
        v += 0.5 * dt * self.pull
        v[self.motion.given] = self._given_v
        self._lag += dt**2 / 8 * (self._square(self.pull) - before)
        self._add_up()
        if weighs:
            self.ledger.weigh()
        for term in self._steady:
            term.commit()
        if weighs:
            self.ledger.accept()
        ts.setTime(self.time)

    def forces(self) -> Array:
        """M a + residual in N at the owned unknowns: at supports, the reactions."""
        total = self._force.array + self._blow.array + self.mass * self.motion.acceleration.x.array
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
        self._accelerate(self.evaluate(), self.pull, self._given_a)
        if self._sudden:
            self._accelerate(self._strike(), self.push, 0.0)
        self._add_up()
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
        self.set_load(begun)  # what is led is back, too
        for term in self.terms:
            term.renew()
        raise StepFailed(
            f"Explicit motion failed between {begun:.6g} and {reached:.6g} s: {said}. The step, "
            f"{self.ts.getTimeStep():.3g} s, is too large for what the sheet has become; take a smaller one."
        )
