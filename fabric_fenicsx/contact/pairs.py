"""What terms of contact share: forces on all corners, and where their stiffness goes in the matrix of a sheet."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..laws import Array
from ..terms.term import Indices, Term
from .free_bodies import FreeBodies
from .skin import Skin
from .surroundings import Surroundings

type Entries = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Pairs of corners as one number each, places in a pair's 3 x 3 entries, values."""


class Scatter:
    """From matrices of all corners to entries between unknowns of the sheet.

    There is room for those within its triangles, for all that bodies do, and for pairs that have touched of late.
    Unknowns of free bodies count as corners after the sheet's, three in each.
    """

    def __init__(self, skin: Skin, free: FreeBodies | None = None) -> None:
        extra = np.empty((0, 3), dtype=np.int64) if free is None else free.unknowns
        self._skin, n = skin, len(skin.rest)
        self._unknowns, self._n = np.concatenate([skin.unknowns, extra]), n + len(extra)
        i, j = np.meshgrid(range(3), range(3), indexing="ij")
        every, beyond = np.arange(self._n), np.arange(n, self._n)
        first, second = (part.ravel() for part in np.meshgrid(every, beyond, indexing="ij"))
        pairs = (skin.faces[:, i.ravel()].ravel(), first, second), (skin.faces[:, j.ravel()].ravel(), second, first)
        self._within = self.keys = self._own(*(np.concatenate(part) for part in pairs))
        self._before, self._whole = self.keys[:0], skin.mine == slice(0, n)

    def _here(self, i: np.ndarray) -> np.ndarray:
        """Whether this rank has their rows."""
        mine = self._skin.mine
        return ((i >= mine.start) & (i < mine.stop)) | (self._skin.last & (i >= len(self._skin.rest)))

    def _own(self, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Pairs of corners, the first of this rank, as one sorted number each."""
        own = self._here(i)
        return np.unique(i[own].astype(np.int64) * self._n + j[own])

    def entries(self, matrices: Sequence[Any]) -> Entries | None:
        """Pairs, places in a pair's 3 x 3 entries, and values of sparse matrices of all corners; some come again."""
        parts = [matrix.tocoo() for matrix in matrices if matrix.nnz]
        if not parts:
            return None
        row, column, values = (np.concatenate([getattr(p, name) for p in parts]) for name in ("row", "col", "data"))
        inside = (row < 3 * self._n) & (column < 3 * self._n)
        row, column, values = row[inside], column[inside], values[inside]
        i, j = row // 3, column // 3
        own = slice(None) if self._whole else self._here(i)
        pair, within = i.astype(np.int64) * self._n + j, 3 * (row - 3 * i) + column - 3 * j
        return pair[own], within[own], values[own]

    def covers(self, found: Entries | None) -> bool:
        """Whether all pairs are among those of `pattern`."""
        if found is None or not len(found[0]):
            return True
        at = np.minimum(np.searchsorted(self.keys, found[0]), len(self.keys) - 1)
        return bool((self.keys[at] == found[0]).all())

    def pattern(self, found: Entries | None) -> tuple[Indices, Indices]:
        """Global rows and columns of all entries, with room for these."""
        now = np.unique(found[0]) if found is not None else self._before[:0]
        if not self.covers(found):
            self.keys = np.unique(np.concatenate([self._within, self._before, now]))
            self._before = now
        i, j = np.divmod(self.keys, self._n)
        rows, columns = self._unknowns[i], self._unknowns[j]
        return np.repeat(rows, 3, axis=1).ravel(), np.tile(columns, (1, 3)).ravel()

    def add(self, found: Entries | None, values: Array) -> None:
        """Add to the entries of `pattern`."""
        if found is not None and len(found[0]):
            at = 9 * np.searchsorted(self.keys, found[0]) + found[1]
            values += np.bincount(at, found[2], minlength=len(values))


class PairTerm(Term):
    """A force between corners, edges and triangles that are near each other.

    A class derived from this one gives `_forces`, of all corners (n, 3) in N, and `_matrices`, whose sum is their
    derivative by all places, sparse ones of SciPy.
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

    def _entries(self) -> Entries | None:
        if self._found is None:
            found, free = self._matrices(), self._around.free
            if free is not None and found:
                found = [free.reduced(found, self._forces())]
            self._found = self._scatter.entries(found)
        return self._found

    def evaluate(self, tangent: bool = True, stiffest: bool = False) -> bool:
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
        return not self._scatter.covers(self._entries())

    def pattern(self) -> tuple[Indices, Indices]:
        """See `Term.pattern`."""
        return self._scatter.pattern(self._entries())

    def add_stiffness(self, values: Array) -> None:
        """See `Term.add_stiffness`."""
        self._scatter.add(self._entries(), values)

    def _step_work(self) -> float:
        """Of what leads the bodies, since the last commit, J on this rank."""
        if not self._first:
            return 0.0
        around, count = self._around, self._around.collisions.count
        return float(np.sum((self._forces() * (around.collisions.x - around.x0))[count:][around.driven]))

    def supplied(self) -> float:
        """See `Term.supplied`."""
        return self._supplied + self._step_work()

    def watch(self) -> None:
        """See `Term.watch`."""
        self._supplied = 0.0

    def commit(self) -> None:
        """See `Term.commit`."""
        self._supplied += self._step_work()

    def renew(self) -> None:
        """See `Term.renew`."""
        self.evaluate()
