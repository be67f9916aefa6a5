"""A sheet as contact sees it: triangles between the nodes of its displacement, the same on every rank."""

import numpy as np

from ..errors import InputError
from ..laws import Array
from ..sheet import Sheet
from ..surfaces import placing

TRIANGLES = {
    ("triangle", 3): ((0, 1, 2),),
    ("triangle", 6): ((0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)),
    ("quadrilateral", 4): ((0, 1, 3), (0, 3, 2)),
}
"""Cell and number of its nodes -> triangles between them; of a quadratic cell, those of its corners and middles."""


class Skin:
    """The nodes of a sheet's displacement, in the order of the ranks that own them, and the triangles between them.

    Public: `rest` (n, 3), places at the start in m, and `faces` (m, 3); `mine`, the slice of this rank's own nodes;
    `local` (own, 3), their unknowns in the local array of q, and `unknowns` (n, 3), the global numbers of all;
    `beyond`, the number after the last unknown of q, and `last`, whether this rank is the last one.
    """

    def __init__(self, sheet: Sheet) -> None:
        self._q, self.comm = sheet.q, sheet.domain.mesh.comm
        V = sheet.q.function_space
        if sheet.shell is None:
            space, where = V, np.arange(len(sheet.q.x.array))
        else:
            space, where = V.sub(0).collapse()
        dofmap, name = space.dofmap, sheet.domain.mesh.basix_cell().name
        own = dofmap.index_map.size_local
        self.local = np.array(where).reshape(-1, 3)[:own]
        first, _ = dofmap.index_map.local_range
        self.mine = slice(first, first + own)
        cells = dofmap.list[: sheet.domain.mesh.topology.index_map(2).size_local]
        try:
            corners = np.array(TRIANGLES[name, cells.shape[1]])
        except KeyError:
            raise InputError(f"Contact does not know the surface of a {name} with {cells.shape[1]} nodes.") from None
        triangles = dofmap.index_map.local_to_global(cells[:, corners].ravel().astype(np.int32)).reshape(-1, 3)
        self.beyond = V.dofmap.index_map.size_global * V.dofmap.index_map_bs
        self.last = self.comm.rank == self.comm.size - 1
        blocks, components = np.divmod(self.local, V.dofmap.index_map_bs)
        rows = V.dofmap.index_map.local_to_global(blocks.ravel().astype(np.int32)).reshape(-1, 3)
        self._counts = 3 * np.array(self.comm.allgather(own))
        self.rest = self._gathered(placing.places(space)[:own])
        self.faces = np.concatenate(self.comm.allgather(triangles)).astype(np.int32)
        self.unknowns = np.concatenate(self.comm.allgather(rows * V.dofmap.index_map_bs + components))

    def _gathered(self, own: Array) -> Array:
        if len(self._counts) == 1:
            return own
        result = np.empty((self._counts.sum() // 3, 3))
        self.comm.Allgatherv(np.ascontiguousarray(own), [result, self._counts])
        return result

    def moved(self, values: Array) -> Array:
        """What a local array of the space of q holds at the nodes, (n, 3); to be called on every rank."""
        return self._gathered(values[self.local])

    def change(self, moved: Array) -> Array:
        """The local array of the space of q that has these values (n, 3) at this rank's own nodes, and 0 else."""
        values = np.zeros_like(self._q.x.array)
        values[self.local] = moved[self.mine]
        return values

    def places(self) -> Array:
        """Where the nodes are now, m."""
        return self.rest + self.moved(self._q.x.array)
