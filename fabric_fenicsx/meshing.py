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
    that is not there, is no mesh, or has no physical groups.
    """

    def build() -> None:
        if not Path(path).is_file():
            raise InputError(f"There is no mesh file {str(path)!r}.")
        for name, value in numbers.items():
            gmsh.parser.setNumber(name, [value])
        try:
            gmsh.open(str(path))
            if Path(path).suffix == ".geo":
                gmsh.model.mesh.generate(2)
        except Exception as error:
            reason = (gmsh.logger.getLastError() or str(error)).strip()
            raise InputError(f"{str(path)!r} is not a mesh that gmsh can read: {reason}.") from error
        if not gmsh.model.mesh.getElements(2)[0].size:
            raise InputError(
                f"{str(path)!r} holds no surface mesh: gmsh found no triangles or quadrilaterals in it."
            )

    return from_gmsh(build, comm, gdim)


def from_gmsh(build: Callable[[], None], comm: MPI.Comm = MPI.COMM_WORLD, gdim: int = 3) -> Domain:
    """The mesh that `build()` leaves in the current gmsh model; it runs on rank 0 only.

    Every cell must be in exactly one physical surface. Raises InputError, on every rank, if it is not,
    or with what `build` raised as InputError.
    """
    fault = None
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        if comm.rank == 0:
            gmsh.clear()
            gmsh.parser.clear()
            try:
                build()
            except InputError as error:
                fault = error
        # one rank's fault is everyone's, else the others would wait for ever
        fault = comm.bcast(fault, root=0)
        if fault is not None:
            raise fault
        try:
            data = gmshio.model_to_mesh(gmsh.model if comm.rank == 0 else None, comm, 0, gdim=gdim)
        except RuntimeError as error:
            raise InputError(
                f"Every cell of the mesh must be in exactly one physical surface; gmsh's model is not so: {error}"
            ) from error
    finally:
        gmsh.finalize()
    dim = data.mesh.topology.dim
    tags = {dim: data.cell_tags, dim - 1: data.facet_tags, dim - 2: data.ridge_tags}
    names = {name: (int(group.dim), int(group.tag)) for name, group in data.physical_groups.items()}
    return Domain(data.mesh, {d: t for d, t in tags.items() if t is not None}, names)
