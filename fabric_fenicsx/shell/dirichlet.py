"""Several Dirichlet conditions as one, in any order, and where the unknowns of a space are."""

from collections.abc import Sequence

import numpy as np
from dolfinx import fem

from ..errors import InputError
from ..laws import Array
from ..surfaces import placing


def places(space: fem.FunctionSpace) -> Array:
    """Coordinates (m) at the start of the local dofs of a space, shape (dofs, 3)."""
    if space.num_sub_spaces == 0 or space.dofmap.index_map_bs > 1:
        return np.repeat(placing.places(space), space.dofmap.index_map_bs, axis=0)
    result = np.empty((space.dofmap.index_map.size_local + space.dofmap.index_map.num_ghosts, 3))
    for i in range(space.num_sub_spaces):
        part, dofs = space.sub(i).collapse()
        result[np.array(dofs)] = places(part)
    return result


def put(bcs: Sequence[fem.DirichletBC], values: Array) -> None:
    """Set the given dofs of a local array of the space of the conditions."""
    for bc in bcs:
        bc.set(values)


def check(bcs: Sequence[fem.DirichletBC], space: fem.FunctionSpace) -> None:
    """Raise InputError, on every rank, where two conditions on a space give a dof different values."""
    comm, values = space.mesh.comm, fem.Function(space).x.array
    low, high = np.full_like(values, np.inf), np.full_like(values, -np.inf)
    for bc in bcs:
        dofs = bc.dof_indices()[0]
        bc.set(values)
        low[dofs], high[dofs] = np.minimum(low[dofs], values[dofs]), np.maximum(high[dofs], values[dofs])
    gaps = np.maximum(high - low, 0.0)
    # the round-off of a rigid rotation goes with the size of the mesh
    size = 1e-3 * np.abs(space.mesh.geometry.x).max(initial=0.0) + np.abs(values).max(initial=0.0)
    worst = comm.allgather(float(gaps.max(initial=0.0) - 1e-9 * size))
    if max(worst) > 0.0:
        rank, x, said = int(np.argmax(worst)), places(space), ""
        if comm.rank == rank:
            dof = gaps.argmax()
            point = ", ".join(f"{c:.4g}" for c in x[dof].round(12) + 0.0)
            said = f"at ({point}) m one gives {low[dof]:.6g} and another {high[dof]:.6g}"
        said = comm.bcast(said, rank)
        raise InputError(f"Two supports contradict each other: {said}; give each unknown one value.")
