"""Where a scene is held and loaded: Dirichlet conditions and measures on named groups of the mesh.

Each condition is a list, so that a scene adds them up: `clamp(...) + symmetry(...)`. `space` is the space of
the displacement, or of a shell, whose directors are held along with it. At a support the residual is
the reaction (`solvers.reactions`).
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, mesh

from ..errors import InputError
from ..shell import dirichlet
from ..shell.bodies import Body
from ..shell.directors import ShellSpace
from ..surfaces import placing
from ..surfaces.meshing import Domain

type Space = ShellSpace | fem.FunctionSpace
type Conditions = list[fem.DirichletBC]
type Vector = Sequence[float]
type Move = Callable[..., None]


def over(domain: Domain, name: str, degree: int, dim: int | None = None) -> ufl.Measure:
    """Measure over a group: cells (dx), edges of the rim (ds), or points (dP, for `weakform.point_force`).

    dim: of which group, 2, 1 or 0, where the name has several. Raises InputError, on every rank, if an edge of the
    group is not on the rim.
    """
    dim, entities = domain.entities(name, dim)
    if dim == 1:
        topology = domain.mesh.topology
        topology.create_connectivity(1, 2)
        owned = entities[entities < topology.index_map(1).size_local]
        if domain.mesh.comm.allreduce(not np.isin(owned, mesh.exterior_facet_indices(topology)).all()):
            raise InputError(f"The group {name!r} has edges inside the sheet; a load on edges needs those of its rim.")
    kind, metadata = ("dP", "ds", "dx")[dim], {"quadrature_degree": degree} if dim else {}
    return ufl.Measure(
        kind, domain.mesh, subdomain_data=domain.tags[dim], subdomain_id=domain.names[name][dim], metadata=metadata
    )


def interior(domain: Domain, name: str, degree: int) -> ufl.Measure:
    """Measure over a group of edges between cells (dS), where what belongs to a cell has two sides, ("+") and ("-").

    Raises InputError, on every rank, if an edge of the group is on the rim.
    """
    _, entities = domain.entities(name, 1)
    topology = domain.mesh.topology
    topology.create_connectivity(1, 2)
    if domain.mesh.comm.allreduce(np.isin(entities, mesh.exterior_facet_indices(topology)).any()):
        raise InputError(f"The group {name!r} has edges on the rim of the sheet; take edges between cells.")
    marked, ids = domain.tags[1], domain.names[name][1]
    return ufl.Measure(
        "dS", domain.mesh, subdomain_data=marked, subdomain_id=ids, metadata={"quadrature_degree": degree}
    )


def unknowns(domain: Domain, space: Space, name: str, component: int | None = None) -> np.ndarray:
    """Local unknowns of one component of the displacement at a group, or all that the group has, directors too."""
    if component is not None:
        return _at(domain, name, _displacement(space).sub(component))
    parts = [_displacement(space).sub(i) for i in range(domain.mesh.geometry.dim)]
    if isinstance(space, ShellSpace):
        parts += [space.V.sub(1).sub(i) for i in range(3)]
    return np.concatenate([_at(domain, name, part) for part in parts])


def places(space: Space) -> np.ndarray:
    """Places at the start of the local unknowns, directors too: m, shape (unknowns, 3). To be called on every rank."""
    return dirichlet.places(space.V if isinstance(space, ShellSpace) else space)


def mean(domain: Domain, space: Space, q: fem.Function, name: str, component: int) -> float:
    """Mean displacement along one axis of the nodes of a group, m; to be called on every rank. q: of the space."""
    dofs = unknowns(domain, space, name, component)
    dofmap = q.function_space.dofmap
    owned = dofs[dofs < dofmap.index_map.size_local * dofmap.index_map_bs]
    total, count = domain.mesh.comm.allreduce(np.array([q.x.array[owned].sum(), len(owned)]))
    return float(total / count)


def hinge(domain: Domain, space: Space, name: str) -> Conditions:
    """No displacement; a shell may turn."""
    return [bc for i in range(domain.mesh.geometry.dim) for bc in lead(domain, space, name, i, 0.0)]


def clamp(domain: Domain, space: Space, name: str) -> Conditions:
    """No displacement, and no rotation of a shell."""
    return grip(domain, space, name)[0] if isinstance(space, ShellSpace) else hinge(domain, space, name)


def hold(domain: Domain, space: ShellSpace, name: str) -> Conditions:
    """No rotation of a shell; its displacement is free."""
    part = space.V.sub(1)
    return [fem.dirichletbc(space.start, _at(domain, name, (part, space.start.function_space)), part)]


def symmetry(domain: Domain, space: Space, name: str, axis: int) -> Conditions:
    """A plane of symmetry across the axis 0, 1 or 2: no displacement along it, and the director stays in the plane."""
    conditions = lead(domain, space, name, axis, 0.0)
    if isinstance(space, ShellSpace):
        part = space.V.sub(1).sub(axis)
        conditions.append(fem.dirichletbc(fem.Constant(domain.mesh, 0.0), _at(domain, name, part), part))
    return conditions


def lead(domain: Domain, space: Space, name: str, component: int, value: float | fem.Constant) -> Conditions:
    """One component of the displacement given: its `value` in m, a number, or a Constant that may change."""
    part = _displacement(space).sub(component)
    value = value if isinstance(value, fem.Constant) else fem.Constant(domain.mesh, float(value))
    return [fem.dirichletbc(value, _at(domain, name, part), part)]


def grip(domain: Domain, space: ShellSpace, name: str) -> tuple[Conditions, Move]:
    """Displacement and directors of a group move as one rigid body: the conditions, and what moves it.

    `move(shift, turn, centre)`, each three numbers: a shift in m, after a turn about `centre` by the
    right-hand rule, a vector as long as its angle in radians; both are from the start, not from the last step.
    One step may turn by less than half a turn.
    """
    u, d = (fem.Function(space.V.sub(i).collapse()[0]) for i in (0, 1))
    R, x = np.eye(3), placing.places(u.function_space).T

    def lead_directors() -> None:
        d.x.array[:] = (space.start.x.array.reshape(-1, 3) @ R.T).ravel()

    def move(shift: Vector, rotation: Vector = (0, 0, 0), centre: Vector = (0, 0, 0)) -> None:
        R[:], c = _rotation(np.array(rotation, dtype=float)), np.array(centre, dtype=float)[:, None]
        u.x.array[:] = (R @ (x - c) + c - x + np.array(shift, dtype=float)[:, None]).T.ravel()
        lead_directors()

    lead_directors()
    space.moves.append(lead_directors)
    parts = [(part, _at(domain, name, (part, value.function_space)), value) for part, value in
             ((space.V.sub(0), u), (space.V.sub(1), d))]  # fmt: skip
    return [fem.dirichletbc(value, dofs, part) for part, dofs, value in parts], move


def rigid(domain: Domain, space: ShellSpace, name: str) -> Body:
    """Displacements and directors of a group move as one rigid body, with six unknowns, under whatever loads it.

    Loads of the group act on the body by their sum and their moment, such as `weakform.traction` and
    `weakform.edge_moment`. To be called on every rank before a solver is made; nothing else may hold the group. Raises
    InputError.
    """
    part, dofs = space.V.sub(0).collapse()
    nodes = np.array(dofs, dtype=np.int64).reshape(-1, 3)
    mine = np.isin(nodes[:, 0], _at(domain, name, space.V.sub(0).sub(0)))
    rows = np.flatnonzero(np.isin(space.nodes[:, 0], _at(domain, name, space.V.sub(1).sub(0))))
    return space.join(name, nodes[mine], placing.places(part)[mine], rows)


def _displacement(space: Space) -> fem.FunctionSpace:
    return space.V.sub(0) if isinstance(space, ShellSpace) else space


def _at(domain: Domain, name: str, space: fem.FunctionSpace | tuple[fem.FunctionSpace, fem.FunctionSpace]) -> Any:
    """Local unknowns of a space, or of a subspace and its own, at all groups of a name."""
    topology, found = domain.mesh.topology, []
    for dim in domain.dims(name):
        _, entities = domain.entities(name, dim)
        topology.create_connectivity(dim, topology.dim)
        found.append(fem.locate_dofs_topological(space, dim, entities))
        if dim == 0 and name in domain.node_sets:
            # a set of nodes stands for the edges between them, on which there may be unknowns too
            topology.create_connectivity(1, topology.dim)
            topology.create_connectivity(1, 0)
            ends = topology.connectivity(1, 0).array.reshape(-1, 2)
            between = np.flatnonzero(np.isin(ends, entities).all(axis=1)).astype(np.int32)
            found.append(fem.locate_dofs_topological(space, 1, between))
    if len(found) == 1:
        return found[0]
    every = np.unique(np.concatenate(found, axis=-1), axis=-1)
    # of two spaces, two arrays, as DOLFINx gives and takes them
    return every if every.ndim == 1 else [np.ascontiguousarray(row) for row in every]


def _rotation(w: np.ndarray) -> np.ndarray:
    """Matrix of the rotation about w by the angle |w| (Rodrigues)."""
    angle = np.linalg.norm(w)
    K = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * K @ K
