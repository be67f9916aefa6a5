"""Implicit dynamics: Newmark's method as a PETSc TS, with steps that are cut where Newton's method fails.

TS's own TSALPHA2 is the same rule, but it begins with two half steps of backward Euler in place of the true
acceleration, and keeps the acceleration where nobody can turn it along with a shell's directors. So the rule
is in `motion`, the time step in a TS of Python type, `Newmark`; options (-ts_monitor), monitors and time are TS's.
"""

import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from ..errors import InputError, StepFailed
from ..laws import Array
from ..terms.term import Residual
from .checkpoint import Field
from .continuation import Step, progress_bar
from .motion import Motion
from .step import MovingSolver
from .stepper import Stepper

# mass leaves no pivot null
OPTIONS: dict[str, object] = {"snes_max_it": 30, "mat_mumps_icntl_24": None, "mat_mumps_icntl_13": None}
"""PETSc options over those of `statics`."""


class Newmark(Stepper):
    """M a + residual(q, velocity) = 0 at the end of every step; a Python type of PETSc's TS, which is `ts`.

    The history of a law moves when a step is accepted, and then only. At supports: `reaction`, `reaction_moment`.

    Args:
        motion: the unknown and its rule.
        residual: without inertia; what holds `motion.velocity` damps. See `statics.StaticSolver`, which `solver` is.
        bcs, options: as for `statics.StaticSolver`; rtol: by default, see `step.MovingSolver`.
        set_load: set_load(t) puts loads and Dirichlet values at time t (s) into the scene; it is also asked a step
            beyond the end, since velocity and acceleration of what is moved come from differences.
        start: time, s.
        accuracy: with an `energy.Ledger`, a step that adds more to the imbalance of energy, as a part of the largest
            external work so far, is cut like one that failed, once the sum is 5 times that; math.inf to take what
            comes.
    """

    def __init__(
        self,
        motion: Motion,
        residual: Residual,
        bcs: Sequence[fem.DirichletBC],
        *,
        set_load: Callable[[float], None] = lambda t: None,
        rtol: float | None = None,
        options: dict[str, object] | None = None,
        start: float = 0.0,
        accuracy: float = 8e-4,
    ) -> None:
        super().__init__(motion, residual, bcs, set_load, start)
        self.accuracy = accuracy
        self.solver = MovingSolver(motion, self.terms, bcs, rtol=rtol, options=OPTIONS | (options or {}))
        self.fault: Exception | None = None
        self.iterations = self.cuts = 0
        self._part = 1.0

    def begin(self) -> None:
        """Find the acceleration with which the motion starts, M a = forces; called by `march`.

        At supports it is that of the first two steps, and so is the velocity.
        """
        motion, solver, dt = self.motion, self.solver, self.ts.getTimeStep()
        before, after, later = (self.given(self.time + k * dt) for k in (0, 1, 2))
        self.set_load(self.time)
        motion.velocity.x.array[motion.given] = (4 * after - 3 * before - later) / (2 * dt)
        motion.acceleration.x.array[motion.given] = (later - 2 * after + before) / dt**2
        motion.lay_on_sphere(motion.velocity.x.array, motion.acceleration.x.array)
        motion.restart(solver.accelerate())
        if self.ledger is not None:
            self.ledger.start()
        self._began = True

    def forces(self) -> Array:
        """M a + residual in N at the owned unknowns: at supports, the reactions."""
        return self.solver.forces()

    # -- what a checkpoint asks for -------------------------------------------------------------------------------

    def numbers(self) -> dict[str, float]:
        """Time, sizes and energies of the last accepted step."""
        return super().numbers() | {"part": self._part, "scale": self.solver.scale}

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them."""
        super().set_numbers(numbers)
        self._part, self.solver.scale = numbers["part"], numbers["scale"]

    def fields(self) -> list[Field]:
        """The arrays of the last accepted step; see `checkpoint`."""
        return self.motion.fields() + super().fields()

    def renew(self) -> None:
        """Go on from what has been put into `fields` and `numbers`."""
        self.motion.renew()
        self.set_load(self.time)
        self.solver.renew()
        self._go_on()

    # -- what TS asks for -------------------------------------------------------------------------------------

    def step(self, ts: PETSc.TS) -> None:
        """One accepted step; never raises."""
        try:
            self._step(ts)
        except Exception as error:
            self.fault = error
            ts.setConvergedReason(PETSc.TS.ConvergedReason.DIVERGED_STEP_REJECTED)

    def _step(self, ts: PETSc.TS) -> None:
        while True:
            dt = ts.getTimeStep()
            t = self.time + dt
            _, velocity, acceleration = self.given_motion(t, dt)
            self.motion.prepare(dt, (velocity, acceleration))
            try:
                self.iterations += self.solver.solve()
                self.motion.settle()
                if not self._too_rough():
                    break
                self.solver.restore()
            except StepFailed as error:
                self.iterations += self.solver.iterations
                if self._part / 2 < self._smallest:
                    self.set_load(self.time)
                    raise StepFailed(
                        f"The motion stopped at t = {self.time:.6g} s, after {self.cuts} cuts, in a step of "
                        f"{dt:.3g} s: {error}. A smaller step, rho below 1, or damping may help; "
                        "is the load in its unit?"
                    ) from None
            self.cuts += 1
            self._part /= 2
            ts.setTimeStep(dt / 2)
        self.linear_iterations, self.matrices = self.solver.linear_iterations, self.solver.matrices
        self.solver.commit()
        if self.ledger is not None:
            self.ledger.accept()
        self.time = t
        ts.setTime(t)

    def _too_rough(self) -> bool:
        """Whether the step that was solved adds too much to the imbalance of energy, and can be cut."""
        self._may_grow = True
        if self.ledger is None:
            return False
        added = self.ledger.weigh()
        total = abs(self.ledger.totals["imbalance"] + added)
        allowed = self.accuracy * max(self.ledger.most, self.ledger.size)
        # the error of a step goes with its third power
        self._may_grow = 8 * abs(added) <= allowed or total <= 2 * allowed
        return abs(added) > allowed > 0.0 and total > 5 * allowed and self._part > self._roughest

    def _advance(self) -> None:
        """One step of TS; raises what stopped it."""
        try:
            self.ts.step()
        except PETSc.Error:
            if self.fault is None:
                raise
            self.ts.setConvergedReason(PETSc.TS.ConvergedReason.ITERATING)
            fault, self.fault = self.fault, None
            raise fault from None

    _smallest, _roughest, _may_grow = 1 / 64, 1 / 8, True

    def march(self, end: float, dt: float, smallest: float = 1 / 64, progress: str | None = None) -> Iterator[Step]:
        """Go on to the time `end` in steps of dt, both in s; yields a `Step` after each, its load being the time.

        A step that fails is restored and halved, and grows again once it works, always to meet the end of
        the whole step; parts below `smallest` of it raise StepFailed, on every rank, with the last good
        state in place. `progress` names the bar that rank 0 shows.
        """
        if not (np.isfinite(dt) and dt > 0.0):
            raise InputError(f"A time step of {dt!r} s is not a positive number.")
        if not (np.isfinite(end) and end > self.time):
            raise InputError(f"The end at {end!r} s is not after the present time, {self.time:g} s.")
        times = self.times(end, dt)
        self._smallest = smallest
        if not self._began:
            self.ts.setTimeStep(dt)
            self.begin()
        with progress_bar(len(times), progress, self.comm) as bar:
            for target in times:
                clock, self.iterations, self.cuts, begun, done = time.perf_counter(), 0, 0, self.time, 0.0
                while done < 1.0:
                    part = min(self._part, 1.0 - done)
                    self._part = part
                    # the last part ends on the time itself, whatever the rounding of the parts before
                    whole = target - begun
                    self.ts.setTimeStep(target - self.time if part == 1.0 - done else part * whole)
                    self._advance()
                    done += self._part
                    self.finest = min(self.finest, self._part)
                    if self._may_grow:
                        self._part = min(1.0, 2 * self._part)
                self.time = float(target)
                self.ts.setTime(self.time)
                self.number += 1
                said = f"t={self.time:.4g} s, newton={self.iterations}, cuts={self.cuts}{self._balance()}"
                bar.set_postfix_str(said, refresh=False)
                bar.update()
                yield Step(self.number, self.time, self.iterations, self.cuts, time.perf_counter() - clock)
                self.pause()
