"""From a file or a gmsh model to a DOLFINx mesh whose parts are found by name."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import basix.ufl
import gmsh
import numpy as np
from mpi4py import MPI
from dolfinx import fem
from dolfinx import mesh as dmesh
from dolfinx.graph import adjacencylist
from dolfinx.io.utils import distribute_entity_data

from ..errors import InputError
from . import checking, gmsh_models, grouping, importing, placing, preparing

_KINDS = ("points", "edges", "cells")

MESHES = Path(__file__).parents[1] / "meshes"
"""The meshes that come with the package: `strip.geo`, `square.geo`, `drape.geo` ..."""


@dataclass(frozen=True)
class Domain:
    """A mesh and its named groups of cells, edges and points; they may overlap, and a name may have several."""

    mesh: dmesh.Mesh
    tags: dict[int, dmesh.MeshTags]
    """Tags of the entities of each dimension that are in groups, one for each combination of groups."""
    names: dict[str, dict[int, tuple[int, ...]]]
    """Name of a group -> dimension -> the tags of its entities."""
    refused: dict[str, str] = field(default_factory=dict)
    """Names of groups that are not wholly on the mesh, and why."""
    node_sets: frozenset[str] = frozenset()
    """Groups of points that stand for the edges between them as well."""
    pieces: int = 1
    """How many pieces no edge joins."""

    @property
    def placement(self) -> fem.Function | None:
        """Where the sheet starts, m, if that is not where the mesh lies; see `placing`."""
        return placing.of(self.mesh)

    def dims(self, name: str) -> list[int]:
        """Dimensions of the groups of a name: 2 for cells, 1 for edges, 0 for points.

        Raises InputError, on every rank, if the mesh has no group of that name, or one that is not wholly on it.
        """
        if name in self.refused:
            raise InputError(f"The physical group {name!r} cannot be used: {self.refused[name]}.")
        if name not in self.names:
            known = ", ".join(sorted(self.names)) or "none"
            raise InputError(f"The mesh has no physical group {name!r}; its groups are: {known}.")
        return sorted(self.names[name])

    def entities(self, name: str, dim: int | None = None) -> tuple[int, np.ndarray]:
        """Dimension and local indices of the entities of a group; dim: of which, where a name has several.

        Raises InputError on every rank as `dims`, and if there is no such group, or several and `dim` does not choose.
        """
        dims = self.dims(name)
        if len(dims) > 1 and dim is None:
            has = " and of ".join(_KINDS[d] for d in dims)
            raise InputError(f"The name {name!r} is that of a group of {has}: give them names of their own.")
        dim = dims[0] if dim is None else dim
        if dim not in dims:
            raise InputError(f"The group {name!r} is one of {_KINDS[dims[0]]}, and one of {_KINDS[dim]} is needed.")
        tags = self.tags[dim]
        return dim, tags.indices[np.isin(tags.values, self.names[name][dim])]


def read(
    path: str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    gdim: int = 3,
    *,
    orient: bool = False,
    scale: float = 1.0,
    merge: float | None = None,
    triangulate: bool = False,
    trust: bool = False,
    ghosts: bool = False,
    numbers: Mapping[str, float] | None = None,
    **more: float,
) -> Domain:
    """Read a surface from gmsh's `.geo` or `.msh`, or from one of `importing.SUFFIXES` and `gmsh_models.SUFFIXES`.

    Args:
        gdim: 2 drops the z coordinate, for plane scenes.
        orient: As always in the plane, turn cells so that neighbours face the same side, that of most of their piece.
        scale: Metres to a unit of the file.
        merge: Points on free edges nearer to each other than this, in m, are one. By default those of an .stl file are,
            to 1e-7 of its extent.
        triangulate: Cut all cells into triangles, where there are quadrilaterals among them, or others.
        trust: Whether a `.geo` may run programs and write files.
        ghosts: Each rank knows the cells beyond its borders too, as terms on edges between cells (dS) need it.
        numbers: Of a `.geo`, which is meshed with them; those whose names are no arguments here may be given as such.

    Quadratic cells stay quadratic. The surface is checked as by `check_surface`.

    The groups are gmsh's physical ones. Files of other programs: those that `importing.load` finds, "sheet" for all
    other cells, and "boundary" for free edges in no group. Cells are numbered from 0 as in the file.

    Raises InputError, on every rank, for a file that is not there or no mesh of surfaces, for a number that the
    `.geo` does not define, for one that runs programs, and for a surface that no shell can stand on.
    """
    path, numbers = Path(path), {**(numbers or {}), **more}
    prepare = partial(preparing.prepare, gdim=gdim, orient=orient, scale=scale, merge=merge, triangulate=triangulate)

    def make() -> preparing.Sheet:
        if not path.is_file():
            raise InputError(f"There is no mesh file {str(path)!r}.")
        suffix = path.suffix.lower()
        if suffix != ".geo" and suffix != ".msh":
            for key, value in numbers.items():
                raise InputError(f"{str(path)!r} does not let {key} be set to {value}: only a .geo file has numbers.")
        if suffix in importing.SUFFIXES:
            return prepare(importing.load(path))
        if suffix == ".msh" and not numbers and (raw := importing.old_msh(path)) is not None:
            return prepare(raw)
        return _by_gmsh(lambda: gmsh_models.opened(path, numbers, trust), path, suffix in gmsh_models.SUFFIXES, prepare)

    return _distribute(_on_root(comm, make), comm, gdim, ghosts)


def from_gmsh(
    build: Callable[[], None],
    comm: MPI.Comm = MPI.COMM_WORLD,
    gdim: int = 3,
    *,
    orient: bool = False,
    scale: float = 1.0,
    merge: float | None = None,
    triangulate: bool = False,
    ghosts: bool = False,
) -> Domain:
    """The mesh that `build()` leaves in the current gmsh model; it runs on rank 0 only.

    Every cell must be in a physical surface. scale: metres to a unit of the model; merge: in m; see `read` for them and
    the others. Raises InputError, on every rank, if it is not so, if the surface is none for a shell, or if `build`
    raised anything.
    """
    prepare = partial(preparing.prepare, gdim=gdim, orient=orient, scale=scale, merge=merge, triangulate=triangulate)
    return _distribute(_on_root(comm, lambda: _by_gmsh(build, Path(), False, prepare)), comm, gdim, ghosts)


def sewn(
    make: Callable[[], tuple[grouping.Raw, checking.Array, checking.Array | None]],
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    ghosts: bool = False,
) -> Domain:
    """The mesh of a surface that starts in one place and is at rest in another, see `placing`.

    `make()` runs on rank 0 only, and returns the surface where it starts, with cells of one kind numbered from 0, where
    the nodes of each cell are at rest, (cells, nodes, 3) in m, and their directors, see `placing.leaning`. Raises
    InputError as `from_gmsh`.
    """

    def prepare() -> tuple[preparing.Sheet, checking.Array, checking.Array | None]:
        raw, rest, directors = make()
        with warnings.catch_warnings():  # of free edges that lie on one another, as two layers do
            warnings.simplefilter("ignore")
            sheet = preparing.prepare(raw, gdim=3, orient=False, scale=1.0, merge=None, triangulate=False)
        return sheet, rest, directors

    made = _on_root(comm, prepare)
    domain = _distribute(made and made[0], comm, 3, ghosts)
    rest, directors = comm.bcast(made and made[1:], root=0)
    of = np.array(domain.mesh.topology.original_cell_index)
    return replace(domain, mesh=placing.placed(domain.mesh, rest[of], None if directors is None else directors[of]))


def _by_gmsh(
    build: Callable[[], None], path: Path, foreign: bool, prepare: Callable[[grouping.Raw], preparing.Sheet]
) -> preparing.Sheet:
    """What `build` leaves in gmsh; prepared."""
    with gmsh_models.session():
        gmsh.clear()
        gmsh.parser.clear()
        try:
            build()
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"gmsh could not build the mesh: {error}.") from error
        return prepare(gmsh_models.model(path, foreign))


def _on_root[T](comm: MPI.Comm, make: Callable[[], T]) -> T | None:
    """What `make()` returns on rank 0, None elsewhere; its InputError is raised on every rank."""
    fault = result = None
    if comm.rank == 0:
        try:
            result = make()
        except InputError as error:
            fault = error
        except Exception as error:
            fault = InputError(f"The mesh could not be made: {type(error).__name__}: {error}.")
            fault.__cause__ = error
    # one rank's fault is everyone's, else the others would wait for ever
    shared = comm.bcast(fault, root=0)
    if shared is not None:
        raise fault or shared
    return result


def _distribute(sheet: preparing.Sheet | None, comm: MPI.Comm, gdim: int, ghosts: bool) -> Domain:
    """The mesh of a surface that rank 0 has."""
    about = sheet and (sheet.kind, sheet.cells.shape[1], {dim: own[0].shape[1] for dim, own in sheet.tagged.items()},
                       sheet.names, sheet.refused, sheet.node_sets, sheet.pieces)  # fmt: skip
    kind, width, widths, names, refused, node_sets, pieces = comm.bcast(about, root=0)
    points, cells = np.zeros((0, gdim)), np.zeros((0, width), dtype=np.int64)
    tagged = {dim: (np.zeros((0, w), dtype=np.int64), np.zeros(0, dtype=np.int32)) for dim, w in widths.items()}
    if sheet is not None:
        points, cells, tagged = sheet.points[:, :gdim], sheet.cells, sheet.tagged
    element = basix.ufl.element("P", kind, checking.DEGREE[width], shape=(gdim,))
    mode = dmesh.GhostMode.shared_facet if ghosts else dmesh.GhostMode.none
    domain = dmesh.create_mesh(comm, cells, element, points, dmesh.create_cell_partitioner(mode, 3))
    tags = {}
    for dim, (entities, values) in tagged.items():
        domain.topology.create_entities(dim)
        domain.topology.create_connectivity(dim, 2)
        found, values = distribute_entity_data(domain, dim, entities, values)
        tags[dim] = dmesh.meshtags_from_entities(domain, dim, adjacencylist(found), values)
    return Domain(domain, tags, names, refused, frozenset(node_sets), pieces)


def check_surface(domain: Domain | dmesh.Mesh) -> None:
    """Check a surface in space, where its nodes are now, as `read` has done before it built the mesh; see `placing`.

    Raises InputError, on every rank, naming cell and place: for a cell with a repeated vertex, of no area,
    a million times longer than wide, or given twice; for an edge of three cells or more; for
    neighbours that face opposite sides.
    """
    m = domain.mesh if isinstance(domain, Domain) else domain
    nodes = m.geometry.dofmaps[0][: m.topology.index_map(2).size_local]
    x = placing.cells(m)[: len(nodes), : nodes.shape[1]]
    own = m.topology.original_cell_index[: len(nodes)], m.geometry.input_global_indices[nodes], x
    parts = m.comm.gather(own, root=0)

    def look() -> None:
        number, cells, x = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = number.argsort()
        _, first, cells = np.unique(cells[order], return_index=True, return_inverse=True)
        checking.check(x[order].reshape(-1, 3)[first], cells.reshape(len(order), -1), m.basix_cell().name)

    _on_root(m.comm, look)


def name_cell(domain: dmesh.Mesh, cells: np.ndarray) -> str | None:
    """The first of these local cells of all ranks, as "cell 7 at (x, y, z)", the same on every rank; None if none."""
    own = []
    for cell in cells:
        corners = domain.geometry.x[domain.geometry.dofmaps[0][cell, : domain.ufl_cell().num_vertices]]
        own.append((int(domain.topology.original_cell_index[cell]), checking.place(corners.mean(axis=0))))
    first = min((pair for pairs in domain.comm.allgather(own) for pair in pairs), default=None)
    return None if first is None else f"cell {first[0]} at {first[1]}"
