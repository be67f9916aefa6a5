"""The largest stable step of explicit motion: 2/omega of the fastest oscillation, by power iteration.

A fabric unloads far more stiffly than it loads, but no more so than its peaks allow: a sheet at rest may take several
times the step of one that has been stretched. So omega^2 is that of the stiffest tangents that are possible after the
history so far (`laws.HasHardened`). As these are at most K + r K_ever, r being by how much they have risen since, as a
part of the stiffest ever, it is at most omega^2 + r omega_ever^2; it is looked for again where that is much.
"""

import math
from typing import Protocol

import numpy as np
from mpi4py import MPI
from dolfinx import fem

from ..laws import Array, Stiffest
from .motion import Motion

RISE = 1.3
"""By how much the square of the frequency may rise before it is looked for again."""


class Run(Protocol):
    """What is asked of `explicit.CentralDifference`; `mass` is a local array."""

    comm: MPI.Comm
    q: fem.Function
    V: fem.FunctionSpace
    motion: Motion
    mass: Array
    directors: np.ndarray

    @property
    def owned(self) -> int: ...
    def evaluate(self, stiffest: Stiffest = False) -> Array: ...
    def hardening(self) -> list[float]: ...
    def lay(self, values: Array, q: Array) -> None: ...


class Limit:
    """The largest stable `step` of a run in s, at present. Public: `moves`, whether it becomes smaller in time; `mode`,
    the fastest oscillation, a local array."""

    def __init__(self, run: Run) -> None:
        self._run, self.mode = run, _noise(run).x.array
        run.evaluate()
        self.moves = run.comm.allreduce(bool(run.hardening()), MPI.LOR)
        self._ever = self._square = fastest(run, self._free(), True, self.mode)
        self.step = 2.0 / math.sqrt(self._ever)
        self._risen = 0.0
        if self.moves:
            self._find()
        run.evaluate()

    def _free(self) -> Array:
        free = np.ones(len(self._run.mass))
        free[self._run.motion.given] = 0.0
        return free

    def _find(self) -> None:
        self._square = fastest(self._run, self._free(), "so far", self.mode)
        self.step = 2.0 / math.sqrt(min(self._square, self._ever))
        self._risen = 0.0

    def allows(self, dt: float) -> bool:
        """After the evaluation that ends a step of dt (s): whether it was stable to its end; hardening then counts."""
        risen, comm = max(self._run.hardening(), default=0.0), self._run.comm
        risen = self._risen + (risen if comm.size == 1 else comm.allreduce(risen, MPI.MAX))
        if dt**2 * min(self._square + risen * self._ever, self._ever) > 4.0:
            return False
        self._risen = risen
        return True

    def look(self) -> bool:
        """After a step and its commit: whether the next one has to be shorter."""
        if not self._risen:
            return False
        square = self._square + self._risen * self._ever
        if square > RISE * self._square and self._square < self._ever:
            self._find()
            self._run.evaluate()
        else:
            self.step = min(self.step, 2.0 / math.sqrt(min(square, self._ever)))
        return True

    def numbers(self) -> dict[str, float]:
        """For a checkpoint."""
        return {"step_square": self._square, "step_risen": self._risen, "step": self.step}

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them."""
        if self.moves:
            self._square, self._risen, self.step = (numbers[name] for name in ("step_square", "step_risen", "step"))


def fastest(run: Run, free: Array, stiffest: Stiffest, mode: Array, iterations: int = 300) -> float:
    """Largest eigenvalue of M^-1 K (1/s2) among motions of the unknowns where `free` is 1, by power iteration.

    K x is a difference of the residual at two states close by; directors move in their tangent plane. The iteration
    goes on from the motion `mode`, and leaves there what it has come to.
    """
    size, comm = run.owned, run.comm
    start, x = run.q.x.array.copy(), mode
    force, root, value = run.evaluate(stiffest).copy(), np.sqrt(run.mass), 0.0
    y = x * free * root
    for _ in range(iterations):
        norm = math.sqrt(comm.allreduce(float(y[:size] @ y[:size])))
        move = free * y / root / norm
        run.lay(move, start)
        scale = 1e-7 * _length(run) / max(comm.allreduce(np.abs(move).max(initial=0.0), MPI.MAX), 1e-300)
        run.q.x.array[:] = start + scale * move
        x[:] = (run.evaluate(stiffest) - force) / scale / run.mass
        run.lay(x, start)
        y = free * x * root
        before, value = value, math.sqrt(comm.allreduce(float(y[:size] @ y[:size])))
        if abs(value - before) < 1e-4 * value:
            break
    run.q.x.array[:] = start
    mode /= max(comm.allreduce(np.abs(mode).max(initial=0.0), MPI.MAX), 1e-300)
    # the iteration comes from below
    return 1.02 * value


def _noise(run: Run) -> fem.Function:
    """The same on any number of ranks."""

    def noise(at: Array) -> Array:
        return np.asarray(np.sin(1e4 * (at[0] + 2 * at[1] + 3 * at[2])) * np.array([[1.0], [0.7], [-0.9]]))

    x = fem.Function(run.V)
    if run.motion.space is None:
        x.interpolate(noise)
        return x
    for part in (0, 1):
        space, dofs = run.V.sub(part).collapse()
        values = fem.Function(space)
        values.interpolate(noise)
        x.x.array[dofs] = values.x.array
    return x


def _length(run: Run) -> float:
    """Size of a cell, m."""
    mesh = run.V.mesh
    x = mesh.geometry.x[mesh.geometry.dofmaps[0]]
    size = float(np.ptp(x, axis=1).max(axis=1).min(initial=np.inf)) if len(x) else np.inf
    return float(run.comm.allreduce(size, MPI.MIN))
