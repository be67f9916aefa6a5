"""The largest stable step of explicit motion."""

import math
from typing import Protocol

import numpy as np
from mpi4py import MPI
from dolfinx import fem

from ..laws import Array
from .motion import Motion


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
    def evaluate(self, stiffest: bool = False) -> Array: ...
    def lay(self, values: Array, q: Array) -> None: ...


def find(run: Run) -> float:
    """Largest stable step in s."""
    free = np.ones(len(run.mass))
    free[run.motion.given] = 0.0
    step = 2.0 / math.sqrt(fastest(run, free))
    run.evaluate()
    return step


def fastest(run: Run, free: Array, iterations: int = 300) -> float:
    """Largest eigenvalue of M^-1 K (1/s2) among motions of the unknowns where `free` is 1, by power iteration.

    K x is a difference of the residual at two states close by; directors move in their tangent plane.
    """
    size, comm = run.owned, run.comm
    start, x = run.q.x.array.copy(), _noise(run)
    force, root, value = run.evaluate(stiffest=True).copy(), np.sqrt(run.mass), 0.0
    y = x.x.array * free * root
    for _ in range(iterations):
        norm = math.sqrt(comm.allreduce(float(y[:size] @ y[:size])))
        move = free * y / root / norm
        run.lay(move, start)
        scale = 1e-7 * _length(run) / max(comm.allreduce(np.abs(move).max(initial=0.0), MPI.MAX), 1e-300)
        run.q.x.array[:] = start + scale * move
        x.x.array[:] = (run.evaluate(stiffest=True) - force) / scale / run.mass
        run.lay(x.x.array, start)
        y = free * x.x.array * root
        before, value = value, math.sqrt(comm.allreduce(float(y[:size] @ y[:size])))
        if abs(value - before) < 1e-4 * value:
            break
    run.q.x.array[:] = start
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
