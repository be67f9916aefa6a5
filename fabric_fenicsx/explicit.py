"""Explicit dynamics: Newmark with beta = 0, gamma = 1/2 (central differences) as a PETSc TS, with lumped mass.

Nothing is solved for, and no tangent is compiled. Mass is lumped in proportion to the diagonal of the mass matrix, the
total kept (Hinton, Rock and Zienkiewicz 1976, doi 10.1002/eqe.4290040305): positive for quadratic triangles too, whose
row sums vanish at corners. Directors turn on their sphere by the angle of a step.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from dolfinx import fem, la
from petsc4py import PETSc
from ufl.form import Form

from . import stable_step
from .continuation import Step, progress_bar
from .errors import InputError, StepFailed
from .hook import LawHook, plain
from .laws import Array
from .motion import Motion
from .stepper import Stepper

SAFETY = 0.9
"""Step as a part of the largest stable one."""


class CentralDifference(Stepper):
    """M a + residual(q, velocity) = 0 at the start of every step; a Python type of PETSc's TS, which is `ts`.

    motion, residual, bcs, hooks, set_load, start: as for `dynamics.Newmark`. rotary: factor on the inertia of
    directors; None takes the smallest, at least 1, with which they do not make the step shorter than the displacements
    do, said in `rotary`. A scaled one slows the turn of directors, not the motion of the sheet.

    `stable` is the largest stable step in s, 2/omega of the fastest oscillation with the stiffest tangent that the law
    tells (`stiffest`, else the one at rest) on the present shape, by power iteration.
    """

    def __init__(
        self,
        motion: Motion,
        residual: Form,
        bcs: Sequence[fem.DirichletBC],
        hooks: Sequence[LawHook] = (),
        set_load: Callable[[float], None] = lambda t: None,
        rotary: float | None = None,
        start: float = 0.0,
    ) -> None:
        super().__init__(motion, bcs, set_load, start)
        self.hooks, self.q, self.V = tuple(hooks), motion.q, motion.q.function_space
        self._form = fem.form(plain(residual, self.hooks))
        self._force = la.vector(self.V.dofmap.index_map, self.V.dofmap.index_map_bs)
        self._given_v = self._given_a = np.zeros(len(motion.given))
        self.directors = np.empty((0, 3), dtype=np.int32) if motion.space is None else motion.space.nodes
        self.mass = stable_step.lumped(motion)
        self.stable, self.rotary = stable_step.find(self, rotary)
        lumped = fem.Function(self.V)
        lumped.x.array[:] = self.mass
        motion.mass = PETSc.Mat().createDiagonal(lumped.x.petsc_vec.copy())

    def lay(self, values: Array, q: Array) -> None:
        """Take from directors' values what is along the directors of q."""
        d = q[self.directors]
        d = d / np.linalg.norm(d, axis=1, keepdims=True)
        w = values[self.directors]
        values[self.directors] = w - (w * d).sum(axis=1, keepdims=True) * d

    # -- what a checkpoint asks for -------------------------------------------------------------------------------

    def fields(self) -> tuple[fem.FunctionSpace, list[tuple[str, str, Array]]]:
        """The arrays of the last step; see `checkpoint`."""
        motion = self.motion
        moved = zip(("q", "v", "a"), (self.q, motion.velocity, motion.acceleration), strict=True)
        result = [(name, "unknowns", function.x.array) for name, function in moved]
        for k, hook in enumerate(self.hooks):
            result.append((f"history{k}", "cells", hook.history.committed.reshape(-1)))
        return self.V, result

    def renew(self) -> None:
        """Go on from what has been put into `fields` and `numbers`."""
        self.set_load(self.time)
        self.evaluate()
        self._go_on()

    # -- a step ---------------------------------------------------------------------------------------------------

    @property
    def owned(self) -> int:
        """Number of the unknowns that are this rank's own; they come first."""
        return int(self.V.dofmap.index_map.size_local * self.V.dofmap.index_map_bs)

    def evaluate(self) -> Array:
        """Residual at the present q and velocity, local array, complete on ghosts too."""
        for hook in self.hooks:
            hook.evaluate()
        self._force.array[:] = 0.0
        fem.assemble_vector(self._force.array, self._form)
        self._force.scatter_reverse(la.InsertMode.add)
        self._force.scatter_forward()
        return self._force.array

    def step(self, ts: PETSc.TS) -> None:
        """One step of `ts`'s length; never raises."""
        motion, dt, directors = self.motion, ts.getTimeStep(), self.directors
        q, v, a = self.q.x.array, motion.velocity.x.array, motion.acceleration.x.array
        v += 0.5 * dt * a
        turn = dt * v[directors]
        d = q[directors]
        q += dt * v
        if len(directors):
            angle = np.linalg.norm(turn, axis=1, keepdims=True)
            c, s = np.cos(angle), np.sinc(angle / np.pi)
            q[directors] = c * d + s * turn
            # carried along the same turn
            v[directors] = (c * turn - angle**2 * s * d) / dt
        self.time += dt
        self._move_supports(dt)
        force = self.evaluate()
        np.divide(force, self.mass, out=a)
        a *= -1.0
        if motion.damping > 0.0:
            a -= motion.damping * v
        a[motion.given] = self._given_a
        self.lay(a, q)
        v += 0.5 * dt * a
        v[motion.given] = self._given_v
        if self.ledger is not None:
            self.ledger.weigh()
            self.ledger.accept()
        for hook in self.hooks:
            hook.commit()
        ts.setTime(self.time)

    def forces(self) -> Array:
        """M a + residual in N at the owned unknowns: at supports, the reactions."""
        total = self._force.array + self.mass * (
            self.motion.acceleration.x.array + self.motion.damping * self.motion.velocity.x.array
        )
        return np.asarray(total[: self.owned])

    def _move_supports(self, dt: float) -> None:
        """Given values at the present time, and their velocity and acceleration."""
        now, self._given_v, self._given_a = self.given_motion(self.time, dt)
        self.q.x.array[self.motion.given] = now

    def begin(self, dt: float) -> None:
        """Find the acceleration with which the motion starts."""
        motion = self.motion
        self._move_supports(dt)
        motion.velocity.x.array[motion.given] = self._given_v
        a = motion.acceleration.x.array
        a[:] = -self.evaluate() / self.mass - motion.damping * motion.velocity.x.array
        a[motion.given] = self._given_a
        self.lay(a, self.q.x.array)
        if self.ledger is not None:
            self.ledger.start()
        self._began = True

    def march(self, end: float, every: float, dt: float | None = None, progress: str | None = None,
              note: Callable[[], str] = lambda: "") -> Iterator[Step]:  # fmt: skip
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
                good = [array.copy() for array in self._arrays()]
                for _ in range(parts):
                    self.ts.step()
                self.time = begun + every
                self._judge(good, begun)
                self.number += 1
                bar.set_postfix_str(f"t={self.time:.4g} s{note()}", refresh=False)
                bar.update()
                self.stop_if_interrupted()
                yield Step(self.number, self.time, parts, 0, time.perf_counter() - clock)

    def _arrays(self) -> list[Array]:
        motion = self.motion
        return [f.x.array for f in (self.q, motion.velocity, motion.acceleration)] + [
            hook.history.committed for hook in self.hooks
        ]

    def _judge(self, good: list[Array], begun: float) -> None:
        """Raise StepFailed if the motion is no longer one, with the last good state in place."""
        kinetic = self.motion.kinetic()
        said = None
        if not math.isfinite(kinetic):
            said = "the motion is not finite"
        elif self.ledger is not None and abs(self.ledger.totals["imbalance"]) > 0.2 * max(self.ledger.most, 1e-300):
            said = f"energy came from nowhere: {-self.ledger.totals['imbalance']:.3g} of {self.ledger.most:.3g} J"
        if said is None:
            return
        for array, before in zip(self._arrays(), good, strict=True):
            array[:] = before
        reached, self.time = self.time, begun
        raise StepFailed(
            f"Explicit motion failed between {begun:.6g} and {reached:.6g} s: {said}. The step, "
            f"{self.ts.getTimeStep():.3g} s, is too large for what the sheet has become; take a smaller one."
        )
