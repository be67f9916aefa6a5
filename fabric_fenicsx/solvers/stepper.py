"""What implicit and explicit motion share: a PETSc TS of Python type, supports that move, a checkpoint's numbers."""

import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from ..laws import Array
from ..terms.hook import forget_traversals
from .motion import Motion
from .reactions import Reactions


class _Context:
    """What the TS holds on to: not its owner, for PETSc's reference would close a cycle that Python cannot see."""

    def __init__(self, owner: "Stepper") -> None:
        self._owner = weakref.ref(owner)

    def step(self, ts: PETSc.TS) -> None:
        self._owner().step(ts)  # type: ignore[union-attr]


class Stepper(Reactions):
    """A motion that goes on step by step; `ts` is the TS that calls `step` of the class derived from this.

    set_load(t): puts loads and Dirichlet values at time t (s) into the scene. start: time, s.
    """

    def __init__(
        self, motion: Motion, bcs: Sequence[fem.DirichletBC], set_load: Callable[[float], None], start: float
    ) -> None:
        self.motion, self.set_load, self._bcs = motion, set_load, list(bcs)
        self.comm, self.time, self.number = motion.q.function_space.mesh.comm, start, 0
        motion.given = np.unique(np.concatenate([np.empty(0, np.int32), *(bc.dof_indices()[0] for bc in bcs)]))
        self._values = np.zeros_like(motion.q.x.array)
        self.ledger: Any = None
        """An `energy.Ledger`, if one is kept."""
        self.finest = 1.0
        """The smallest step taken, as a part of the nominal one."""
        self.interrupted = self._began = False
        self.linear_iterations = 0
        """So far; without linear systems, none."""
        self.ts = PETSc.TS().createPython(_Context(self), comm=self.comm)
        self.ts.setSolution(motion.q.x.petsc_vec)
        self.ts.setTime(start)
        self.ts.setMaxTime(1e300)
        self.ts.setMaxSteps(2**31 - 1)
        self.ts.setFromOptions()
        forget_traversals()

    def given(self, t: float) -> Array:
        """Put the loads of a time into the scene; its values of the given unknowns."""
        self.set_load(t)
        for bc in self._bcs:
            bc.set(self._values)
        return np.asarray(self._values[self.motion.given])

    def given_motion(self, t: float, dt: float) -> tuple[Array, Array, Array]:
        """As `given`, with velocity and acceleration by differences over dt; the loads are left at t."""
        # the conditions are the same on every rank, their unknowns are not
        if not self._bcs:
            now = self.given(t)
            return now, now, now
        before, after = (self.given(t + k * dt) for k in (-1, 1))
        now = self.given(t)
        return now, (after - before) / (2 * dt), (after - 2 * now + before) / dt**2

    def _balance(self) -> str:
        """What the progress bar adds where a ledger is kept."""
        ledger = self.ledger
        return f", imbalance={100 * ledger.totals['imbalance'] / max(ledger.most, 1e-30):.2g} %" if ledger else ""

    def stop_if_interrupted(self) -> None:
        """Raise KeyboardInterrupt, on every rank, if `checkpoint.guard` has seen one."""
        if self.comm.allreduce(self.interrupted):
            self.interrupted = False
            raise KeyboardInterrupt

    def _unknown(self) -> fem.Function:
        return self.motion.q

    # -- what a checkpoint asks for -------------------------------------------------------------------------------

    def numbers(self) -> dict[str, float]:
        """Time and energies of the last accepted step."""
        return {"time": self.time, "number": self.number} | (self.ledger.numbers() if self.ledger else {})

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them."""
        self.time, self.number = numbers["time"], int(numbers["number"])
        if self.ledger:
            self.ledger.set_numbers(numbers)

    def _go_on(self) -> None:
        """The last of `renew`: the state is in place."""
        self.ts.setTime(self.time)
        if self.ledger:
            self.ledger.renew()
        self._began = True
