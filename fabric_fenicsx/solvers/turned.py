"""A constant matrix of a shell, such as its mass, by displacements and angles: that of directors turns."""

import numba
import numpy as np
from petsc4py import PETSc

from ..laws import Array
from ..shell.directors import ShellSpace
from ..terms.term import Indices


class Turned:
    """A matrix in V that does not couple displacements with directors, seen from W.

    Public: `pattern`, global rows and columns in W of the entries that `add` adds; None where it does couple them.

    Args:
        entries: local rows, columns and values in V; their sum over the ranks is the matrix.
    """

    def __init__(self, space: ShellSpace, entries: tuple[Indices, Indices, Array]) -> None:
        self._space, (rows, columns, values) = space, entries
        size = space.V.dofmap.index_map.size_local + space.V.dofmap.index_map.num_ghosts
        node, axis = np.full(size, -1), np.full(size, -1)
        node[space.nodes], axis[space.nodes] = np.arange(len(space.nodes))[:, None], np.arange(3)
        turns = node[rows] >= 0
        self.pattern: tuple[Indices, Indices] | None = None
        if (turns != (node[columns] >= 0)).any():
            return
        straight, places = ~turns, np.full(size, -1)
        places[space.displaced[:, 0]] = space.displaced[:, 1]
        self._straight = values[straight]
        pairs = np.column_stack([node[rows[turns]], node[columns[turns]]])
        self._pairs, slot = np.unique(pairs, axis=0, return_inverse=True)
        self._turning = values[turns], slot.ravel(), axis[rows[turns]], axis[columns[turns]]
        of, to = (space.angles[self._pairs[:, k]] for k in (0, 1))
        told = space.W.dofmap.index_map.local_to_global
        self.pattern = (
            told(np.concatenate([places[rows[straight]], np.repeat(of, 2, axis=1).ravel()]).astype(np.int32)),
            told(np.concatenate([places[columns[straight]], np.tile(to, (1, 2)).ravel()]).astype(np.int32)),
        )

    def add(self, factor: float, values: Array) -> None:
        """Add the matrix times a factor, directors as they are."""
        n = len(self._straight)
        values[:n] += factor * self._straight
        _add(self._turning, self._pairs, self._space.slopes, factor, values[n:].reshape(-1, 2, 2))


@numba.njit(cache=True, error_model="numpy")
def _add(turning, pairs, slopes, factor, out):
    values, slot, one, other = turning
    for e in range(len(values)):
        s = slot[e]
        of, to = slopes[pairs[s, 0]], slopes[pairs[s, 1]]
        for a in range(2):
            for b in range(2):
                out[s, a, b] += factor * values[e] * of[a, one[e]] * to[b, other[e]]


def compact(mass: PETSc.Mat) -> PETSc.Mat:
    """The same without zeros: most of the form's pattern couples what does not move together."""
    mass.assemble()
    indptr, columns, values = mass.getValuesCSR()
    rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
    there = (values != 0.0) | (columns == rows + mass.getOwnershipRange()[0])
    ends = np.concatenate([[0], np.cumsum(np.bincount(rows[there], minlength=len(indptr) - 1))]).astype(PETSc.IntType)
    return PETSc.Mat().createAIJ(mass.getSizes(), csr=(ends, columns[there], values[there]), comm=mass.comm)
