"""A sheet of many ranks, put together on rank 0: alike on any number of them."""

from typing import Any

import numpy as np
from dolfinx import fem, plot

from ..laws import Array
from ..surfaces import placing

KINDS = {69: {3: 5, 6: 22}, 70: {4: 9, 9: 28}}
"""VTK's Lagrange cells -> nodes of a cell -> the same cell in the name that every program knows."""


class Whole:
    """Cells and nodes of a space of displacements, on rank 0; elsewhere they are empty.

    Cells are in the order of the mesh's own file, nodes in that in which the cells name them first. To be made, and
    asked, on every rank.
    """

    def __init__(self, space: fem.FunctionSpace) -> None:
        mesh, nodes = space.mesh, space.dofmap.index_map
        self.comm, self.dim = mesh.comm, mesh.geometry.dim
        self._owned, self._nodes = mesh.topology.index_map(mesh.topology.dim).size_local, nodes.size_local
        flat, kinds, x = plot.vtk_mesh(space, np.arange(self._owned, dtype=np.int32))
        if placing.of(mesh) is not None:
            x = placing.places(space)
        table = np.asarray(flat).reshape(self._owned, -1)[:, 1:] if self._owned else np.empty((0, 0), dtype=np.int64)
        numbers = nodes.local_to_global(np.arange(len(x), dtype=np.int32))
        own = (numbers[table], np.array(mesh.topology.original_cell_index[: self._owned]), numbers[: self._nodes])
        ranks = self.comm.gather((*own, x[: self._nodes], kinds[:1]), root=0)
        self.cells: np.ndarray = np.empty((0, 0), dtype=np.int64)
        self.points: Array = np.empty((0, 3))
        """Nodes of each cell (cells, nodes of a cell); where the nodes were (nodes, 3), m."""
        self.kind = 0
        """Of all cells, as VTK numbers it."""
        if ranks is not None:
            tables, orders, known, places, found = zip(*ranks, strict=True)
            table = np.concatenate([part for part in tables if len(part)])
            self._cell_order = np.argsort(np.concatenate(orders))
            table = table[self._cell_order]
            used, first, inverse = np.unique(table, return_index=True, return_inverse=True)
            place, order = np.empty_like(used), np.argsort(first)
            place[order] = np.arange(len(used))
            self.cells = place[inverse].reshape(table.shape)
            of_all = np.concatenate(known)
            sorter = np.argsort(of_all)
            self._node_order = sorter[np.searchsorted(of_all, used[order], sorter=sorter)]
            self.points = np.concatenate(places)[self._node_order]
            kind = int(np.concatenate(found)[0])
            self.kind = KINDS.get(kind, {}).get(table.shape[1], kind)

    def __call__(self, u: fem.Function, cell_values: dict[str, Array]) -> tuple[Array, dict[str, Array]] | None:
        """Displacement of the nodes (nodes, 3), and arrays with one row for each local cell (ghosts may follow).

        None elsewhere than on rank 0.
        """
        moved = np.zeros((self._nodes, 3))
        moved[:, : self.dim] = u.x.array.reshape(-1, self.dim)[: self._nodes]
        own = (moved, {name: values[: self._owned] for name, values in cell_values.items()})
        ranks: Any = self.comm.gather(own, root=0)
        if ranks is None:
            return None
        cells = {name: np.concatenate([part[name] for _, part in ranks])[self._cell_order] for name in cell_values}
        return np.concatenate([part for part, _ in ranks])[self._node_order], cells

    def in_order(self, values: Array) -> Array:
        """On rank 0: values of all nodes as the ranks number them, one after the other, in the order of `points`."""
        return values[self._node_order]

    def at_nodes(self, values: Array) -> Array:
        """Mean at each node of the values of the cells around it; on rank 0."""
        total = np.zeros((len(self.points), *values.shape[1:]))
        count = np.bincount(self.cells.ravel(), minlength=len(total))
        np.add.at(total, self.cells, values[:, None])
        return total / count.reshape(-1, *[1] * (values.ndim - 1))
