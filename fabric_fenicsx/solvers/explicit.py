"""Explicit dynamics: Newmark with beta = 0, gamma = 1/2 (central differences) as a PETSc TS, with lumped mass.

Nothing is solved for, and no tangent is compiled. Mass is lumped, see `motion.Motion.lump`. Directors turn on their
sphere by the angle of a step, rigid bodies freely between two pushes (`bodies.Body.drift`).

A step is as long as the sheet allows with the stiffness that it can have after its history, see `stable_step`;
impulsive forces act in parts of it, see `parts`.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from ..errors import InputError, StepFailed
from ..laws import Array, Stiffest
from ..shell.dirichlet import check
from ..terms.extra import extra_force
from ..terms.term import Residual
from . import stable_step
from .checkpoint import Field
from .continuation import Step, progress_bar
from .drifting import kick, lay
from .leading import HELD, unled
from .motion import Motion
from .parts import RESOLVING, SHORTEST, InParts

SAFETY = 0.9
"""Step as a part of the largest stable one."""
WEIGH = 40
"""Steps from one entry of the ledger to the next, if it is not told, and half as many more before the end."""


class CentralDifference(InParts):
    """M a + residual(q, velocity) = 0 at the ends of every step; a Python type of PETSc's TS, which is `ts`.

    `stable` is the largest stable step in s at present, see `stable_step`. `weigh`: steps from one entry of the ledger
    to the next.

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
        set_load: Callable[[float], None] = unled,
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
        self._given_q: Array | None = None  # where nothing is led, found once for each `every`
        self.directors = np.empty((0, 3), dtype=np.int32) if motion.space is None else motion.space.nodes
        self._displacements = np.setdiff1d(np.arange(len(self.q.x.array), dtype=np.int32), self.directors.ravel())
        self._drifting, self._turning = self._displacements, self.directors
        for body in self.bodies:
            self._drifting = np.setdiff1d(self._drifting, body.nodes).astype(np.int32)
            self._turning = self._turning[~np.isin(self._turning[:, 0], body.directors[:, 0])]
        self.mass = motion.lump()
        if self.comm.allreduce(bool((self.mass <= 0.0).any())):
            raise InputError("Explicit motion needs directors with inertia: leave the rotary part of the mass in.")
        self.weigh, self._still = WEIGH, set_load is unled
        self._part_of_limit = 1.0
        self._limit = stable_step.Limit(self)
        lumped = fem.Function(self.V)
        lumped.x.array[:] = self.mass
        motion.mass = PETSc.Mat().createDiagonal(lumped.x.petsc_vec.copy())

    def lay(self, values: Array, q: Array) -> None:
        """Take from values, rates, what is along directors of q or would deform bodies; they keep their momentum."""
        lay(values, q, self._turning)
        for body in self.bodies:
            body.project(values, q, self.mass)

    @property
    def stable(self) -> float:
        """Largest stable step at present, s; one that is set stands in the same ratio to those that follow."""
        return self._part_of_limit * self._limit.step

    @stable.setter
    def stable(self, step: float) -> None:
        self._part_of_limit = step / self._limit.step

    # -- what a checkpoint asks for -------------------------------------------------------------------------------

    def fields(self) -> list[Field]:
        """The arrays of the last step; see `checkpoint`."""
        moved = {"q": self.q.x.array, "v": self.motion.velocity.x.array, "a": self.pull}
        moved |= {"push": self.push} if self._sudden else {}
        moved |= {"fastest": self._limit.mode} if self._limit.moves else {}
        return [(name, None, array) for name, array in moved.items()] + super().fields()

    def numbers(self) -> dict[str, float]:
        """As of `Stepper`, with what limits the step."""
        return super().numbers() | (self._limit.numbers() if self._limit.moves else {})

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them."""
        super().set_numbers(numbers)
        self._limit.set_numbers(numbers)

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

    def evaluate(self, stiffest: Stiffest = False) -> Array:
        """Steady forces at the present q and velocity, local array, complete on ghosts too; see `Term.evaluate`."""
        return self._summed(self._steady, self._force, stiffest)

    def hardening(self) -> list[float]:
        """See `Term.hardening`: of the terms on this rank that do."""
        return [told for term in self._steady if (told := term.hardening()) is not None]

    def _add_up(self) -> None:
        if self._sudden:
            np.add(self.pull, self.push, out=self.motion.acceleration.x.array)

    def step(self, ts: PETSc.TS) -> None:
        """One step of `ts`'s length; never raises."""
        self._go(ts.getTimeStep())
        ts.setTime(self.time)

    def _go(self, dt: float) -> None:
        """One step of dt (s), or in halves where the sheet hardens by so much in it that it would not be stable."""
        v, limit, weighs = self._of_v, self._limit, self.ledger is not None and self._weighs
        past = self._past() if limit.moves else None
        for term in self._steady:
            term.prepare(dt)
        before = self._square(self.pull)
        kick(v, self.pull, 0.5 * dt)
        self._part(dt, (RESOLVING if self.extra else SHORTEST) * dt)
        self._accelerate(self.evaluate(), self.pull, self._given_a)
        if past is not None and not limit.allows(dt):
            self._take_back(past)
            self._go(dt / 2)
            self._go(dt / 2)
            return
        kick(v, self.pull, 0.5 * dt)
        v[self.motion.given] = self._given_v
        self._lag += dt**2 / 8 * (self._square(self.pull) - before)
        self._add_up()
        if weighs:
            self.ledger.weigh()
        for term in self._steady:
            term.commit()
        if weighs:
            self.ledger.accept()

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
        if not self._still or self._given_q is None:
            self._given_q, self._given_v, self._given_a = self.given_motion(self.time, dt)
        self._of_q[self.motion.given] = self._given_q

    def begin(self, dt: float) -> None:
        """Find the acceleration with which the motion starts, its supports led over a step of dt (s)."""
        motion = self.motion
        self._move_supports(dt)
        motion.velocity.x.array[motion.given] = self._given_v
        for body in self.bodies:
            body.project(motion.velocity.x.array, self.q.x.array, self.mass)
        self._accelerate(self.evaluate(), self.pull, self._given_a)
        if self._sudden:
            self._accelerate(self._strike(), self.push, self._none_given)
        self._add_up()
        if self.extra:
            self.extra.start(extra_force(self.terms, self.extra.count))
        if self.ledger is not None:
            self.ledger.start()
        self._began = True

    def march(self, end: float, every: float, dt: float | None = None, progress: str | None = None) -> Iterator[Step]:
        """Go on to the time `end`; yields a `Step` each `every` seconds, its load being the time.

        dt: the step in s, by default `SAFETY` of the stable one, or a little less to meet `every`; also where that
        becomes less than dt. Raises InputError for a step that is not stable; StepFailed, on every rank and with q at
        the last `every` that was good, once the motion is not finite or gains energy out of nothing.
        """
        if dt is not None and not 0.0 < dt <= self.stable:
            raise InputError(f"A step of {dt!r} s is not stable: the largest is {self.stable:.3g} s.")
        steps = max(1, round((end - self.time) / every))
        with progress_bar(steps, progress, self.comm) as bar:
            for _ in range(steps):
                clock, begun = time.perf_counter(), self.time
                check(self._bcs, self.V)
                self._given_q = None
                parts = self._divide(every, dt)
                if not self._began:
                    self.begin(every / parts)
                good = [array.copy() for array in self._arrays()], self.extra.numbers() if self.extra else {}
                done, left, weigh = 0, parts, 1 if self._uneven() else self.weigh
                while left:
                    done, left = done + 1, left - 1
                    self._weighs = left == 0 or (done % weigh == 0 and left > weigh / 2)
                    self.ts.step()
                    if left and self._limit.look():
                        left = self._divide(begun + every - self.time, dt)
                self._weighs = True
                self.time = begun + every
                self._judge(good, begun)
                self.number += 1
                bar.set_postfix_str(f"t={self.time:.4g} s{self._balance()}", refresh=False)
                bar.update()
                yield Step(self.number, self.time, done, 0, time.perf_counter() - clock)
                self.pause()

    def _uneven(self) -> bool:
        """Whether each step has to be weighed for now: at the start, or where the account is off by 2 %."""
        return self.ledger is not None and abs(self.ledger.totals["imbalance"]) >= 0.02 * self.ledger.most

    def _divide(self, length: float, dt: float | None) -> int:
        """In how many steps to go on over a length of time, s."""
        safe = SAFETY * self.stable
        parts = math.ceil(length / (safe if dt is None or dt > self.stable else dt) * (1 - 1e-12))
        self.ts.setTimeStep(length / parts)
        return parts

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
