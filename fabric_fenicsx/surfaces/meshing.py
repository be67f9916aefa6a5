"""From a file or a gmsh model to a DOLFINx mesh whose parts are found by name."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import basix.ufl
import gmsh
import numpy as np
from mpi4py import MPI
from dolfinx import mesh as dmesh
from dolfinx.graph import adjacencylist
from dolfinx.io import gmsh as gmshio
from dolfinx.io.utils import distribute_entity_data

from ..errors import InputError
from . import checking, importing

MESHES = Path(__file__).parents[1] / "meshes"
"""The meshes that come with the package: `strip.geo`, `square.geo`, `drape.geo` ..."""


@dataclass(frozen=True)
class Domain:
    """A mesh and the physical groups that gmsh named in it."""

    mesh: dmesh.Mesh
    tags: dict[int, dmesh.MeshTags]
    """Physical tags of the entities of each dimension."""
    names: dict[str, tuple[int, int]]
    """Name of a physical group -> (dimension, tag)."""

    def entities(self, name: str) -> tuple[int, np.ndarray]:
        """Dimension and local indices of the entities of a physical group.

        Raises InputError on every rank if the mesh has no group of that name.
        """
        if name not in self.names:
            known = ", ".join(sorted(self.names)) or "none"
            raise InputError(f"The mesh has no physical group {name!r}; its groups are: {known}.")
        dim, tag = self.names[name]
        return dim, self.tags[dim].find(tag)


def read(
    path: str | Path, comm: MPI.Comm = MPI.COMM_WORLD, gdim: int = 3, orient: bool = False, **numbers: float
) -> Domain:
    """Read a surface, in metres, from gmsh's `.geo` or `.msh` or from `.obj`, `.stl`, `.ply`, `.vtk`, `.vtu`, `.inp`.

    A `.geo` is meshed with `numbers` set beforehand; quadratic cells stay quadratic. `gdim` 2 drops the z
    coordinate, for plane scenes. The surface is checked as by `check_surface`; `orient`, as always in
    the plane, turns cells so that neighbours face the same side, that of most of their piece.

    The groups are gmsh's physical ones. Files of other programs: those that `importing.load` finds, "sheet" for all
    other cells, and "boundary" for free edges in no group. Cells are numbered from 0 as in the file.

    Raises InputError, on every rank, for a file that is not there or no mesh of surfaces, for a number that the
    `.geo` does not define, and for a surface that no shell can stand on.
    """
    if Path(path).suffix.lower() in importing.SUFFIXES:
        return _distribute(_on_root(comm, lambda: _load(Path(path), gdim, orient, numbers)), comm, gdim)

    def build() -> None:
        name, suffix = str(path), Path(path).suffix
        if not Path(path).is_file():
            raise InputError(f"There is no mesh file {name!r}.")
        try:
            start = Path(path).read_bytes()[:1000]
        except OSError as error:
            raise InputError(f"The mesh file {name!r} cannot be read: {error.strerror}.") from error
        # gmsh would take both for its language, and be left unable to read anything after bytes that are no text
        if not (b"\0" not in start if suffix == ".geo" else suffix == ".msh" and start.startswith(b"$")):
            others = ", ".join(sorted(importing.SUFFIXES))
            raise InputError(f"{name!r} is neither a .geo nor a .msh file of gmsh, nor one of {others}.")
        known: list[str] = []
        try:
            gmsh.open(name)
            if suffix == ".geo":
                known = gmsh.parser.getNames()
                _reopen(name, numbers)
        except Exception as error:
            reason = " ".join(str(error).split()).rstrip(".")
            raise InputError(f"{name!r} is not a mesh that gmsh can read: {reason}.") from error
        for key, value in numbers.items():
            if key not in known or gmsh.parser.getNumber(key).tolist() != [value]:
                raise InputError(
                    f"{name!r} does not let {key} be set to {value} (by DefineConstant in a .geo file); "
                    f"its numbers are: {', '.join(sorted(known)) or 'none'}."
                )
        if not gmsh.model.mesh.getElements(2)[0].size:
            raise InputError(f"{name!r} holds no surface mesh: there are no triangles or quadrilaterals.")

    return from_gmsh(build, comm, gdim, orient)


def _reopen(name: str, numbers: dict[str, float]) -> None:
    """Mesh the open `.geo` file, with these numbers in place of its own."""
    if numbers:
        # opening clears the parser; merging does not, and DefineConstant keeps what it finds
        gmsh.clear()
        gmsh.parser.clear()
        for key, value in numbers.items():
            gmsh.parser.setNumber(key, [value])
        gmsh.merge(name)
    gmsh.model.mesh.generate(2)


def from_gmsh(
    build: Callable[[], None], comm: MPI.Comm = MPI.COMM_WORLD, gdim: int = 3, orient: bool = False
) -> Domain:
    """The mesh that `build()` leaves in the current gmsh model; it runs on rank 0 only.

    Every cell must be in exactly one physical surface, and all must be triangles, or all quadrilaterals.
    `gdim`, `orient`: see `read`. Raises InputError, on every rank, if it is not so, if the surface is none
    for a shell, or if `build` raised anything.
    """

    def make() -> None:
        gmsh.clear()
        gmsh.parser.clear()
        try:
            build()
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"gmsh could not build the mesh: {error}.") from error
        _check_model(gdim, orient)

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        _on_root(comm, make)
        try:
            data = gmshio.model_to_mesh(gmsh.model if comm.rank == 0 else None, comm, 0, gdim=gdim)
        except RuntimeError as error:
            raise InputError(
                f"Every cell of the mesh must be in exactly one physical surface, but DOLFINx says: {error}."
            ) from error
    finally:
        gmsh.finalize()
    dim = data.mesh.topology.dim
    tags = {dim: data.cell_tags, dim - 1: data.facet_tags, dim - 2: data.ridge_tags}
    names = {name: (int(group.dim), int(group.tag)) for name, group in data.physical_groups.items()}
    return Domain(data.mesh, {d: t for d, t in tags.items() if t is not None}, names)


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


def _check_model(gdim: int, orient: bool) -> None:
    """Make sure that DOLFINx can take over the current gmsh model, and a shell stand on it."""
    dims = {dim for dim, _ in gmsh.model.getPhysicalGroups()}
    if 3 in dims or 2 not in dims:
        fault = "has a physical group of volumes" if 3 in dims else "has no physical group of surfaces"
        raise InputError(
            f'The mesh {fault}: name its surfaces, and no volumes, as in Physical Surface("sheet") = {{1}};.'
        )
    kinds, numbers, _ = gmsh.model.mesh.getElements(2)
    if len(kinds) != 1:
        raise InputError("The mesh mixes triangles and quadrilaterals; recombine all of it or nothing.")
    name, _, _, width, _, corners = gmsh.model.mesh.getElementProperties(kinds[0])
    if width not in checking.DEGREE:
        raise InputError(f"The mesh has cells {name!r}: set Mesh.ElementOrder 1 or 2, Mesh.SecondOrderIncomplete 0.")
    # DOLFINx takes the numbers of nodes for places in an array
    gmsh.model.mesh.renumberNodes()
    topology = gmshio.extract_topology_and_markers(gmsh.model)[0].get(kinds[0])
    # the others are refused later
    if topology is not None and np.unique(topology["entity_tags"]).size == len(numbers[0]) == len(topology["topology"]):
        kind = dmesh.CellType.triangle if corners == 3 else dmesh.CellType.quadrilateral
        cells = topology["topology"][:, gmshio.cell_perm_array(kind, width)].astype(np.int64)
        x = gmshio.extract_geometry(gmsh.model)
        x[:, gdim:] = 0.0
        turned = checking.check(x, cells, kind.name, orient or gdim == 2)
        gmsh.model.mesh.reverseElements(topology["entity_tags"][turned])


def _load(path: Path, gdim: int, orient: bool, numbers: dict[str, float]) -> importing.Sheet:
    """A file of another program, checked; on one rank."""
    if not path.is_file():
        raise InputError(f"There is no mesh file {str(path)!r}.")
    for key, value in numbers.items():
        raise InputError(f"{str(path)!r} does not let {key} be set to {value}: only a .geo file has numbers.")
    sheet = importing.load(path)
    sheet.points[:, gdim:] = 0.0
    turned = checking.check(sheet.points, sheet.cells, sheet.kind, orient or gdim == 2)
    sheet.cells[turned] = sheet.cells[turned][:, checking.TURNED[sheet.cells.shape[1]]]
    return sheet


def _distribute(sheet: importing.Sheet | None, comm: MPI.Comm, gdim: int) -> Domain:
    """The mesh of a surface that rank 0 has."""
    about = None if sheet is None else (sheet.kind, sheet.cells.shape[1], sheet.edges.shape[1], sheet.names)
    kind, width, edge_width, names = comm.bcast(about, root=0)
    if sheet is None:
        none = np.zeros(0, dtype=np.int32)
        empty = [np.zeros((0, n), dtype=np.int64) for n in (width, edge_width)]
        sheet = importing.Sheet(np.zeros((0, 3)), empty[0], kind, none, empty[1], none, names)
    element = basix.ufl.element("P", kind, checking.DEGREE[width], shape=(gdim,))
    domain = dmesh.create_mesh(comm, sheet.cells, element, sheet.points[:, :gdim])
    topology = domain.topology
    tags = {}
    for dim, entities, values in ((2, sheet.cells, sheet.cell_tags), (1, sheet.edges, sheet.edge_tags)):
        topology.create_entities(dim)
        topology.create_connectivity(dim, 2)
        found, values = distribute_entity_data(domain, dim, entities, values)
        tags[dim] = dmesh.meshtags_from_entities(domain, dim, adjacencylist(found), values)
    free = np.setdiff1d(dmesh.exterior_facet_indices(topology), tags[1].indices)
    if "boundary" not in names and comm.allreduce(len(free)):
        names["boundary"] = (1, len(names) + 1)
        edges = np.concatenate([tags[1].indices, free]).astype(np.int32)
        values = np.concatenate([tags[1].values, np.full(len(free), len(names))]).astype(np.int32)
        order = edges.argsort()
        tags[1] = dmesh.meshtags(domain, 1, edges[order], values[order])
    return Domain(domain, tags, names)


def check_surface(domain: Domain | dmesh.Mesh) -> None:
    """Check a surface in space, where its nodes are now, as `read` has done before it built the mesh.

    Raises InputError, on every rank, naming cell and place: for a cell with a repeated vertex, of no area,
    a million times longer than wide, or given twice; for an edge of three cells or more; for
    neighbours that face opposite sides.
    """
    m = domain.mesh if isinstance(domain, Domain) else domain
    nodes = m.geometry.dofmaps[0][: m.topology.index_map(2).size_local]
    own = m.topology.original_cell_index[: len(nodes)], m.geometry.input_global_indices[nodes], m.geometry.x[nodes]
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
