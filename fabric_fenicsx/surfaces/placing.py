"""Where a sheet starts, if it is not where its mesh lies: a garment that is sewn together from flat panels.

The topology of its mesh is that of what has been sewn, its geometry that of the panels, stress-free: every cell has
nodes of its own, so that places jump at a seam. The displacement is measured from a start placement, a Function. The
Jacobian, areas, axes, masses are then those of the panels, and strains need one change,

    x = R0 + u,    x_,a = a + grad(w) a,    w = R0 + u - X,

with w, from where the panels lie, in place of u (`from_rest`). A mesh without a placement starts where it lies.
"""

from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import cpp, fem, mesh
from ufl.core.expr import Expr
from ufl.domain import extract_unique_domain

from .checking import DEGREE, Array


def of(domain: mesh.Mesh | ufl.Mesh) -> fem.Function | None:
    """The start placement of a mesh, m; None where the sheet starts."""
    return getattr(domain.ufl_domain() if isinstance(domain, mesh.Mesh) else domain, "_placement", None)


def leaning(domain: mesh.Mesh) -> Array | None:
    """Unit vectors along which directors are at rest at the corners of local cells, (cells, corners, 3); None: normal.

    At a fold, where sheets meet at an angle, their director leans out of each.
    """
    return getattr(domain.ufl_domain(), "_leaning", None)


def placed(start: mesh.Mesh, rest: Array, directors: Array | None = None) -> mesh.Mesh:
    """A mesh with the topology of `start`, whose cells lie elsewhere, and which starts where `start` lies.

    rest: places (m) of the nodes of each local cell, ghosts included, in the order of `start`: (cells, nodes, 3).
    directors: see `leaning`.
    """
    count, width = start.geometry.dofmaps[0].shape
    if np.shape(rest) != (count, width, 3):
        raise ValueError(f"Places of nodes are {np.shape(rest)}, and {(count, width, 3)} are needed.")
    cells = start.topology.index_map(2)
    ghosts = (cells.ghosts[:, None] * width + np.arange(width)).ravel()
    owners = np.repeat(cells.owners, width).astype(np.int32)
    nodes = cpp.common.IndexMap(start.comm, width * cells.size_local, ghosts, owners, 1)
    element = start.ufl_domain().ufl_coordinate_element()
    geometry = mesh.create_geometry(
        nodes, np.arange(width * count, dtype=np.int32).reshape(count, width),
        fem.coordinate_element(element.basix_element), np.ascontiguousarray(rest, dtype=float).reshape(-1, 3),
        start.geometry.input_global_indices[start.geometry.dofmaps[0].ravel()],
    )  # fmt: skip
    both = cpp.mesh.Mesh_float64(start.comm, start.topology._cpp_object, geometry._cpp_object)
    result = mesh.Mesh(both, ufl.Mesh(element))
    place(result, start.geometry.x[start.geometry.dofmaps[0]])
    result.ufl_domain()._leaning = directors
    return result


def place(domain: mesh.Mesh, start: Array) -> None:
    """Let a sheet start where the nodes of its local cells are told to be, (cells, nodes, 3) in m.

    To be told before anything is made on the mesh. Nodes are those of its cells, or of quadratic ones.
    """
    element = basix.ufl.element("P", domain.basix_cell(), DEGREE[start.shape[1]], shape=(3,))
    placement = fem.Function(fem.functionspace(domain, element), name="placement")
    domain.ufl_domain()._placement = placement
    placement.x.array.reshape(-1, 3)[placement.function_space.dofmap.list] = start


def from_rest(u: Expr) -> Expr:
    """A displacement as measured from rest, w, of one from the start: for derivatives, as in a cell only they count."""
    domain = extract_unique_domain(u)
    start = of(domain)
    return u if start is None else start + u - ufl.SpatialCoordinate(domain)


def cells(domain: mesh.Mesh) -> Array:
    """Where the nodes of each local cell start, (cells, nodes, 3), m."""
    start = of(domain)
    if start is None:
        return np.asarray(domain.geometry.x[domain.geometry.dofmaps[0]])
    return np.asarray(start.x.array.reshape(-1, 3)[start.function_space.dofmap.list])


def both(domain: mesh.Mesh) -> Array:
    """Where the nodes of each local cell are at rest, (cells, nodes, 3), and where they start, if that is elsewhere."""
    rest = domain.geometry.x[domain.geometry.dofmaps[0]]
    return np.asarray(rest if of(domain) is None else np.concatenate([rest, cells(domain)], axis=1))


def places(space: fem.FunctionSpace) -> Array:
    """Where the nodes of a space start, (nodes, 3), m; as `tabulate_dof_coordinates`, of where its mesh lies."""
    start = of(space.mesh)
    if start is None:
        return np.asarray(space.tabulate_dof_coordinates())
    result = np.empty((space.dofmap.index_map.size_local + space.dofmap.index_map.num_ghosts, 3))
    result[space.dofmap.list] = _at_nodes(space, start.function_space.element.basix_element, cells(space.mesh))
    return result


def at_rest(space: fem.FunctionSpace, of_cells: np.ndarray) -> Array:
    """Where the nodes of a space lie, seen from each of these local cells, (cells, nodes, 3), m."""
    element = space.mesh.ufl_domain().ufl_coordinate_element().basix_element
    return _at_nodes(space, element, space.mesh.geometry.x[space.mesh.geometry.dofmaps[0][of_cells]])


def _at_nodes(space: fem.FunctionSpace, element: Any, x: Array) -> Array:
    """From the nodes of an element, (cells, nodes, 3), to those of a space."""
    values = element.tabulate(0, np.asarray(space.element.interpolation_points))[0, :, :, 0]
    return np.asarray(np.einsum("pn,cni->cpi", values, x))
