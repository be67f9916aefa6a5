"""What implicit and explicit motion share: a PETSc TS of Python type, supports that move, a checkpoint's numbers."""

import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from ..laws import Array
from ..terms.extra import extra_of
from ..terms.form import terms_of
from ..terms.hook import forget_traversals
from ..terms.term import Residual, Term
from .checkpoint import Field
from .inertia import Mass
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

    Public: `terms`, all but inertia. set_load(t): puts loads and Dirichlet values at time t (s) into the scene.
    start: time, s.
    """

    def __init__(
        self,
        motion: Motion,
        residual: Residual,
        bcs: Sequence[fem.DirichletBC],
        set_load: Callable[[float], None],
        start: float,
    ) -> None:
        self.motion, self.q, self.set_load, self._bcs = motion, motion.q, set_load, list(bcs)
        self.terms: list[Term] = terms_of(residual, motion.q, (motion.velocity, motion.rate))
        if motion.damping > 0.0:
            self.terms.append(Mass(motion, damps=True))
        self.extra = extra_of(self.terms)
        """The term that brings unknowns of its own, if there is one."""
        if self.extra:
            self.extra.join(motion)
        self.comm, self.time, self.number = motion.q.function_space.mesh.comm, start, 0
        motion.given = np.unique(np.concatenate([np.empty(0, np.int32), *(bc.dof_indices()[0] for bc in bcs)]))
        self._values = np.zeros_like(motion.q.x.array)
        self.ledger: Any = None
        """An `energy.Ledger`, if one is kept."""
        self.finest = 1.0
        """The smallest step taken, as a part of the nominal one."""
        self._began = self._resumed = False
        self._origin = start, 0
        self.pause: Callable[[], None] = lambda: None
        """What is done between two steps; see `checkpoint.guard`."""
        self.linear_iterations, self.matrices = 0, 0
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

    def times(self, end: float, dt: float) -> Array:
        """The ends of the steps to go, of about dt; those of the march that a checkpoint was made in, to the bit."""
        if not self._resumed:
            self._origin = self.time, self.number
        self._resumed = False
        start, number = self._origin
        times = np.linspace(start, end, max(1, round((end - start) / dt)) + 1)[self.number - number :]
        if not len(times) or times[0] != self.time:  # to another end, or in other steps
            self._origin = self.time, self.number
            times = np.linspace(self.time, end, max(1, round((end - self.time) / dt)) + 1)
        return np.asarray(times[1:])

    def _unknown(self) -> fem.Function:
        return self.motion.q

    # -- what a checkpoint asks for -------------------------------------------------------------------------------

    def numbers(self) -> dict[str, float]:
        """Time and energies of the last accepted step."""
        own = {"time": self.time, "number": self.number, "from_time": self._origin[0], "from_number": self._origin[1]}
        own |= self.extra.numbers() if self.extra else {}
        return own | (self.ledger.numbers() if self.ledger else {})

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them."""
        self.time, self.number = numbers["time"], int(numbers["number"])
        self._origin, self._resumed = (numbers["from_time"], int(numbers["from_number"])), True
        if self.extra:
            self.extra.set_numbers(numbers)
        if self.ledger:
            self.ledger.set_numbers(numbers)

    def fields(self) -> list[Field]:
        """What the terms remember; see `checkpoint`."""
        every = [field for term in self.terms for field in term.fields()]
        return [(f"{name}{k}", cells, array) for k, (name, cells, array) in enumerate(every)]

    def _go_on(self) -> None:
        """The last of `renew`: the state is in place."""
        self.ts.setTime(self.time)
        if self.ledger:
            self.ledger.renew()
        self._began = True
