"""The numbers of `work`: by which products of two vectors of a cell a strain in UFL is told."""

from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from scipy.sparse.csgraph import connected_components
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr

from ..errors import InputError
from ..laws import Array
from ..shell.directors import ShellSpace
from ..surfaces import placing
from .kernels import LANES

CHUNK = 1000  # cells


def quadratic(shell: Any, strain: Expr, points: Array) -> tuple[Array, list[tuple[int, int]]]:
    """M of each cell (cells, points, strains, pairs), and the pairs."""
    trial, mesh = ufl.TrialFunction(shell.space.V), shell.space.mesh
    derivative = fem.Expression(expand_derivatives(ufl.derivative(strain, shell.q, trial)), points)
    kept, cells, nodes = shell.q.x.array.copy(), len(shell.cells), shell.start.shape[1]
    n = nodes + shell.directors.shape[1]
    # each probe tells three columns, one for every component in space; some more make it well posed
    states = [np.random.default_rng(seed).uniform(-1, 1, len(kept)) for seed in range(n // 3 + 2)]
    # pairs of nodes, of a node and a director, and of directors; those that no strain has are left out
    pairs = [(i, j) for i in range(n) for j in range(i, n)]
    pairs.sort(key=lambda pair: (pair[0] >= nodes) + (pair[1] >= nodes))
    i, j = np.array(pairs, dtype=np.int64).T
    pieces, misfit, shape = [], False, (len(points) * strain.ufl_shape[0], n + 1, 3)
    # so many cells at a time that their probes take little memory
    for part in np.split(np.arange(cells), range(CHUNK, cells, CHUNK)):
        probes, changes = [], []
        for state in states:
            shell.q.x.array[:] = state
            q = state[shell.dofs[part]].reshape(len(part), 1, n + 1, 3)
            change = derivative.eval(mesh, shell.cells[part]).reshape(len(part), *shape)
            probes.append(q[:, :, 1:] - np.where(np.arange(n)[:, None] < nodes, q[:, :, :1], 0.0))
            probes[-1][:, 0, :nodes] += shell.start[part]
            changes.append(change[:, :, 1:])
        probe, change = np.concatenate(probes, axis=3), np.concatenate(changes, axis=3)
        inverse = np.linalg.pinv(probe)
        S = change @ inverse
        S += (change - S @ probe) @ inverse
        misfit |= bool(np.abs(S @ probe - change).max(initial=0.0) > 1e-8 * np.abs(change).max(initial=0.0))
        # exact zeros: a thin sheet would feel a membrane strain of round-off when it bends
        S[np.abs(S) < 1e-11 * np.abs(S).max(axis=(2, 3), keepdims=True, initial=0.0)] = 0.0
        S *= (shell.sizes[part, :, None] * shell.sizes[part, None, :])[:, None]
        pieces.append(np.where(i == j, 0.5, 1.0) * (S[..., i, j] + S[..., j, i]) / 2)
    shell.q.x.array[:] = kept
    if mesh.comm.allreduce(misfit):
        raise InputError("A strain is not quadratic in displacement and director, or changes with a rotation.")
    return np.concatenate(pieces).reshape(cells, len(points), strain.ufl_shape[0], len(pairs)), pairs


def squares(comm: MPI.Comm, M: Array, stiffness: Array) -> Array:
    """What a linear law stores is half the sum of the squares of a few numbers: their M, with a single point.

    stiffness (cells, points, strains, strains), that of the law times the weights of the points: symmetric, and not
    negative. A cell has no more such numbers than its strains have degrees of freedom, and often more strains: four
    against eight in the transverse shear of a bilinear cell. Raises InputError, on every rank.
    """
    cells, points, _, pairs = M.shape
    least, most = np.linalg.eigvalsh(stiffness).min(initial=0.0), np.abs(stiffness).max(initial=0.0)
    skew = np.abs(stiffness - np.swapaxes(stiffness, 2, 3)).max(initial=0.0)
    if comm.allreduce(bool(max(-least, skew) > 1e-12 * most)):
        raise InputError("The stiffness of a linear strain is not symmetric, or negative; give a law in its place.")
    coupled = connected_components(np.abs(stiffness).max(axis=(0, 1), initial=0.0), directed=False)[1]
    found = [np.empty((cells, 0, pairs))]
    for group in range(coupled.max() + 1):  # what bends a sheet does not stretch it, not even by round-off
        own = np.flatnonzero(coupled == group)
        values, vectors = np.linalg.eigh(stiffness[:, :, own[:, None], own])
        root = np.swapaxes(vectors, 2, 3) * np.sqrt(np.maximum(values, 0.0))[..., None]
        every = (root @ M[:, :, own]).reshape(cells, points * len(own), pairs)
        _, sizes, rows = np.linalg.svd(every, full_matrices=False)
        rank = int((sizes > 1e-13 * sizes[:, :1]).sum(axis=1).max(initial=1))  # a rank without cells has one, too
        rows[:, :, ~M[:, :, own].any(axis=(0, 1, 2))] = 0.0
        found.append(sizes[:, :rank, None] * rows[:, :rank])
    return np.concatenate(found, axis=1)[:, None]


def packed(M: Array, pairs: list[tuple[int, int]]) -> tuple[Any, Any, Any]:
    """M (blocks, points, terms, LANES), of each strain the first and last pair that it has, and the pairs."""
    cells, spans = len(M), []
    for there in M.any(axis=(0, 1)):
        found = np.flatnonzero(there)
        spans.append((found[0], found[-1] + 1) if len(found) else (0, 0))
    M = np.concatenate([M[:, :, a, first:last] for a, (first, last) in enumerate(spans)], axis=2)
    low, high = min(first for first, _ in spans), max(last for _, last in spans)
    # cells by `LANES`, side by side: what processors are good at
    count = -(-cells // LANES)
    blocks = np.zeros((count * LANES, *M.shape[1:]))
    blocks[:cells] = M
    blocks = np.moveaxis(blocks.reshape(count, LANES, *M.shape[1:]), 1, 3).copy()
    return blocks, np.array(spans) - low, np.array(pairs[low:high], dtype=np.int64).reshape(-1, 2)


def every(V: fem.FunctionSpace, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Global rows and columns of all pairs of a cell's unknowns, cell by cell."""
    local = V.dofmap.list[cells]
    dofs = V.dofmap.index_map.local_to_global(local.ravel()).reshape(local.shape)
    return np.repeat(dofs, dofs.shape[1], axis=1).ravel(), np.tile(dofs, (1, dofs.shape[1])).ravel()


class Cells:
    """Some cells of a shell, as `kernels` want them."""

    def __init__(
        self, space: ShellSpace, q: fem.Function, cells: np.ndarray, dofs: np.ndarray, directors: np.ndarray
    ) -> None:
        self.space, self.q, self.cells, self.dofs, self.directors = space, q, cells, dofs, directors
        part, where = space.V.sub(0).collapse()
        x = np.empty((len(q.x.array), 3))
        x[np.array(where).reshape(-1, 3)[:, 0]] = placing.places(part)
        nodes = dofs[:, : dofs.shape[1] - 3 * directors.shape[1] : 3]
        self.start = np.ascontiguousarray(x[nodes[:, 1:]] - x[nodes[:, :1]])
        """Places of the other nodes of each cell, as seen from the first one, at the start: (cells, nodes - 1, 3)."""
        self.rest = self.start
        if placing.of(space.mesh) is not None:
            there = placing.at_rest(part, cells)
            self.rest = np.ascontiguousarray(there[:, 1:] - there[:, :1])
        """The same at rest."""
        self.sizes = np.ones((len(cells), self.rest.shape[1] + directors.shape[1]))
        """Of the vectors of each cell: places as they are, directors that lean at rest so long that they go through
        the thickness, as the cut of a mitre."""
        if placing.leaning(space.mesh) is not None:
            n = np.cross(self.rest[:, 0], self.rest[:, 1])
            n /= np.linalg.norm(n, axis=1, keepdims=True)
            along = np.einsum("cni,ci->cn", space.normal.x.array.reshape(-1, 3)[directors], n)
            self.sizes[:, self.rest.shape[1] :] = 1 / along
