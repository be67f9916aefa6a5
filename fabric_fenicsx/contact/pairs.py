"""What terms of contact share: forces on all corners, and where their stiffness goes in the matrix of a sheet."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse

from ..laws import Array, Stiffest
from ..terms.term import Indices, Term
from . import scattering
from .free_bodies import FreeBodies
from .gaps import Near
from .points import Grid
from .skin import Skin
from .surroundings import Surroundings

type Blocks = list[tuple[Near, Array]]
"""Points that are near a body, and derivatives (k, 3, 3) of forces on them by their places."""
ROOM = 2.0
"""How much larger than needed a pattern may get before what has not touched of late leaves it."""


@dataclass
class Entries:
    """Of a stiffness: blocks, and matrices of all corners with the entries that their values are added to.

    whole: whether there is room for all of them.
    """

    blocks: Blocks
    matrices: Sequence[scipy.sparse.csc_array]
    where: Sequence[np.ndarray]
    whole: bool


class Scatter:
    """From matrices of all corners to entries between unknowns of the sheet.

    There is room for those within its triangles, for all that bodies do, and for pairs that have touched of late.
    Unknowns of free bodies count as corners after the sheet's, three in each.
    """

    def __init__(self, skin: Skin, free: FreeBodies | None = None) -> None:
        extra = np.empty((0, 3), dtype=np.int64) if free is None else free.unknowns
        self._unknowns, n = np.concatenate([skin.unknowns, extra]), len(skin.rest)
        self._n = n + len(extra)
        self._here = np.zeros(self._n, dtype=bool)
        """Corners whose rows are this rank's."""
        self._here[skin.mine], self._here[n:] = True, skin.last
        i, j = np.meshgrid(range(3), range(3), indexing="ij")
        every, beyond = np.arange(self._n), np.arange(n, self._n)
        first, second = (part.ravel() for part in np.meshgrid(every, beyond, indexing="ij"))
        pairs = (skin.faces[:, i.ravel()].ravel(), first, second), (skin.faces[:, j.ravel()].ravel(), second, first)
        self._within = self._own(*(np.concatenate(part) for part in pairs))
        self._keep(self._within)

    def _own(self, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Pairs of corners, the first of this rank, as one sorted number each."""
        own = (i < self._n) & (j < self._n)
        i, j = i[own], j[own]
        return np.unique((i.astype(np.int64) * self._n + j)[self._here[i]])

    def _keep(self, keys: np.ndarray) -> None:
        """Have room for these pairs."""
        self._keys, self._columns = keys, keys % self._n
        self._starts = np.searchsorted(keys, np.arange(self._n + 1) * self._n)
        self._slots: dict[int, tuple[Grid, np.ndarray]] = {}

    def entries(self, matrices: Sequence[Any], blocks: Blocks) -> Entries:
        """Of a sum of sparse matrices of all corners, and of blocks."""
        columns, where, whole = [scipy.sparse.csc_array(matrix) for matrix in matrices if matrix.nnz], [], True
        for matrix in columns:
            where.append(np.empty(matrix.nnz, dtype=np.int64))
            within = matrix.indptr, matrix.indices, self._starts, self._columns, self._here
            whole &= scattering.located(*within, where[-1])
        return Entries([(near, block) for near, block in blocks if len(block)], columns, where, whole)

    def room_for(self, found: Entries) -> None:
        """Have room for more: for these entries."""
        every = [matrix.tocoo() for matrix in found.matrices]
        now = [self._own(part.row // 3, part.col // 3) for part in every]
        needed = np.unique(np.concatenate([self._within, *now]))
        keys = np.union1d(self._keys, needed)
        self._keep(keys if len(keys) < ROOM * len(needed) else needed)

    def pattern(self) -> tuple[Indices, Indices]:
        """Global rows and columns of all entries."""
        i, j = np.divmod(self._keys, self._n)
        rows, columns = self._unknowns[i], self._unknowns[j]
        return np.repeat(rows, 3, axis=1).ravel(), np.tile(columns, (1, 3)).ravel()

    def add(self, found: Entries, values: Array) -> None:
        """Add to the entries of `pattern`."""
        for matrix, where in zip(found.matrices, found.where, strict=True):
            scattering.add_entries(where, matrix.data, values)
        for near, block in found.blocks:
            scattering.add_blocks(block, near.grid.shares, self._of(near.grid), near.points, values)

    def _of(self, grid: Grid) -> np.ndarray:
        """Where pairs of nodes of each point are, -1 if elsewhere: (points, 3, 3)."""
        if id(grid) not in self._slots:
            i, j = (part.ravel() for part in np.broadcast_arrays(grid.nodes[:, :, None], grid.nodes[:, None, :]))
            keys = i.astype(np.int64) * self._n + j
            at = np.minimum(np.searchsorted(self._keys, keys), max(len(self._keys) - 1, 0))
            slots = np.where(self._keys[at] == keys, at, -1) if len(self._keys) else np.full(len(keys), -1)
            self._slots[id(grid)] = grid, slots.reshape(-1, 3, 3)
        return self._slots[id(grid)][1]


class PairTerm(Term):
    """A force between corners, edges and triangles that are near each other.

    A class derived from this one gives `_forces`, of all corners (n, 3) in N, and what their derivative is the sum of:
    `_matrices`, by all places, sparse ones of SciPy, and `_blocks`, of points near bodies in closed form.
    """

    impulsive = True

    def __init__(self, around: Surroundings) -> None:
        self._around, self._skin, self._scatter = around, around.skin, Scatter(around.skin, around.free)
        self._first = self._skin.mine.start == 0 and self._skin.mine.stop > 0
        self._found: Entries | None = None
        self._supplied = 0.0

    def _forces(self) -> Array:
        raise NotImplementedError

    def _matrices(self) -> list[Any]:
        raise NotImplementedError

    def _blocks(self) -> Blocks:
        raise NotImplementedError

    def _summands(self) -> tuple[list[Any], Blocks]:
        matrices, blocks, free = self._matrices(), self._blocks(), self._around.free
        if free is not None:
            size = self._around.collisions.x.size
            matrices += [near.blocks(block, size) for near, block in blocks if len(block)]
            return [free.reduced(matrices, self._forces())] if matrices else [], []
        return matrices, blocks

    def _entries(self) -> Entries:
        if self._found is None:
            self._found = self._scatter.entries(*self._summands())
        return self._found

    def evaluate(self, tangent: bool = True, stiffest: Stiffest = False) -> bool:
        """See `Term.evaluate`."""
        self._found = None
        return self._around.place()

    def add_force(self, total: Array) -> None:
        """See `Term.add_force`."""
        total[self._skin.local] += self._forces()[self._skin.mine]

    def add_extra_force(self, total: Array) -> None:
        """See `Term.add_extra_force`."""
        if self._around.free is not None:
            total += self._around.free.pulled(self._forces()[self._around.collisions.count :])

    @property
    def pattern_changed(self) -> bool:  # type: ignore[override]
        """See `Term.pattern_changed`."""
        return not self._entries().whole

    def pattern(self) -> tuple[Indices, Indices]:
        """See `Term.pattern`."""
        found = self._entries()
        if not found.whole:
            self._scatter.room_for(found)
            self._found = self._scatter.entries(found.matrices, found.blocks)
        return self._scatter.pattern()

    def add_stiffness(self, values: Array) -> None:
        """See `Term.add_stiffness`."""
        self._scatter.add(self._entries(), values)

    def _step_work(self) -> float:
        """Of what leads the bodies, since the last commit, J on this rank."""
        if not self._first or self._around.still:
            return 0.0
        around, count = self._around, self._around.collisions.count
        way = (around.collisions.x[count:] - around.x0[count:])[around.driven]
        return float(np.sum(self._forces()[count:][around.driven] * way)) if way.any() else 0.0

    def supplied(self) -> float:
        """See `Term.supplied`."""
        return self._supplied + self._step_work()

    def watch(self) -> None:
        """See `Term.watch`."""
        self._supplied = 0.0

    def commit(self) -> None:
        """See `Term.commit`."""
        self._supplied += self._step_work()

    def past(self) -> Any:
        """See `Term.past`."""
        return self._supplied, self._around.past()

    def take_back(self, past: Any) -> None:
        """See `Term.take_back`."""
        self._supplied, around = past
        self._around.take_back(around)

    def renew(self) -> None:
        """See `Term.renew`."""
        self.evaluate()
