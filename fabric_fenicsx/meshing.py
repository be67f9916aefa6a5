"""From a gmsh file or model to a DOLFINx mesh whose parts are found by name."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np
from mpi4py import MPI
from dolfinx import mesh as dmesh
from dolfinx.io import gmsh as gmshio

from .errors import InputError


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


def read(path: str | Path, comm: MPI.Comm = MPI.COMM_WORLD, gdim: int = 3, **numbers: float) -> Domain:
    """Read a gmsh `.geo` or `.msh` file; a `.geo` is meshed with `numbers` set beforehand.

    `gdim` 2 drops the z coordinate, for plane scenes. Raises InputError, on every rank, for a file
    that is not there or no mesh of physical surfaces, and for a number that the `.geo` does not define.
    """

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
            raise InputError(f"{name!r} is neither a .geo nor a .msh file of gmsh.")
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

    return from_gmsh(build, comm, gdim)


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


def from_gmsh(build: Callable[[], None], comm: MPI.Comm = MPI.COMM_WORLD, gdim: int = 3) -> Domain:
    """The mesh that `build()` leaves in the current gmsh model; it runs on rank 0 only.

    Every cell must be in exactly one physical surface, and all must be triangles, or all quadrilaterals.
    Raises InputError, on every rank, if it is not so or if `build` raised anything.
    """
    fault = cause = None
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        if comm.rank == 0:
            gmsh.clear()
            gmsh.parser.clear()
            try:
                build()
                _check()
            except InputError as error:
                fault = error
            except Exception as error:
                fault, cause = InputError(f"gmsh could not build the mesh: {error}."), error
        # one rank's fault is everyone's, else the others would wait for ever
        fault = comm.bcast(fault, root=0)
        if fault is not None:
            raise fault from cause
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


def _check() -> None:
    """Make sure that DOLFINx can take over the current gmsh model."""
    if max((dim for dim, _ in gmsh.model.getPhysicalGroups()), default=0) != 2:
        raise InputError("The mesh must be one of surfaces, all in physical groups, and no volumes.")
    if len(gmsh.model.mesh.getElements(2)[0]) != 1:
        raise InputError("The mesh mixes triangles and quadrilaterals; recombine all of it or nothing.")
    # DOLFINx takes the numbers of nodes for places in an array
    gmsh.model.mesh.renumberNodes()
