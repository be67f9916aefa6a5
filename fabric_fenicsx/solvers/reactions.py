"""Forces and moments that the supports exert, for whatever solver tells the residual at its unknowns."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from mpi4py import MPI
from dolfinx import fem

from ..laws import Array
from ..shell.dirichlet import places


class Reactions:
    """Gives a solver `reaction` and `reaction_moment`, to be called on every rank at a solved state."""

    comm: MPI.Comm

    def forces(self) -> Array:
        """Residual at the owned unknowns, in N (in N m at directors); at supports, the reactions."""
        raise NotImplementedError

    def _unknown(self) -> fem.Function:
        """The displacement, or displacement and director (u, d), that the forces belong to."""
        raise NotImplementedError

    def reaction(self, dofs: np.ndarray) -> float:
        """Sum of the forces (N) that the supports exert on these local unknowns, over all ranks.

        dofs: of one component, as `supports.unknowns` gives them.
        """
        forces = self.forces()
        return float(self.comm.allreduce(forces[dofs[dofs < len(forces)]].sum()))

    def reaction_moment(self, dofs: np.ndarray, about: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """Moment (3 numbers, N m) about a point of what the supports exert on these local unknowns, over all ranks.

        dofs: all those of a group, as `supports.unknowns` gives them without a component. Forces act where the
        nodes are now; a shell's directors take moments too, d x force. about: x, y, z of the point, m.
        """
        forces, q = self.forces(), self._unknown().x.array
        owned, force = dofs[dofs < len(forces)], np.zeros(len(q))
        force[owned] = forces[owned]
        nodes, x, directors = self._arms
        arms = x - np.asarray(about, dtype=float)
        arms[:, : nodes.shape[1]] += q[nodes]
        moved = np.zeros_like(arms)
        moved[:, : nodes.shape[1]] = force[nodes]
        moment = np.cross(arms, moved).sum(axis=0) + np.cross(q[directors], force[directors]).sum(axis=0)
        return np.asarray(self.comm.allreduce(moment))

    @cached_property
    def _arms(self) -> tuple[np.ndarray, Array, np.ndarray]:
        """Displacement's unknowns of each node (nodes, 2 or 3), its place at rest (nodes, 3), unknowns of directors."""
        space = self._unknown().function_space
        u, d = np.arange(len(self._unknown().x.array)), np.empty((0, 3), dtype=np.int64)
        size = space.dofmap.index_map_bs
        if space.num_sub_spaces == 2 and size == 1:
            u, d = (np.array(space.sub(i).collapse()[1], dtype=np.int64) for i in (0, 1))
            size = 3
        nodes = u.reshape(-1, size)
        return nodes, places(space)[nodes[:, 0]], d.reshape(-1, 3)
