"""Surfaces from the files of other programs: .obj, .stl, .ply, .vtk, .vtp, .vtu and .inp."""

import contextlib
import io
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from . import abaqus, polygon_files
from .checking import Array
from .grouping import Raw, require_groups

_MESHIO = {
    "triangle": "triangle",
    "triangle6": "triangle",
    "quad": "quadrilateral",
    "quad8": "quadrilateral",
    "quad9": "quadrilateral",
    "polygon": "polygon",
}


def load(path: Path) -> Raw:
    """Read a file of one of the `SUFFIXES`, as it stands.

    Groups of cells, edges and points: `g` or `o` of .obj, those of `abaqus.read`, and `gmsh:physical` of VTK's files.
    Corners at the same place are merged in an .stl file, which has each several times.

    Raises InputError for what is not such a file, or holds no surface.
    """
    with _refused(path):
        return SUFFIXES[path.suffix.lower()](path)


@contextlib.contextmanager
def _refused(path: Path) -> Iterator[None]:
    """Raise as one sentence what is wrong; meshio prints it, and exits."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join((said.getvalue().strip() or str(error) or type(error).__name__).split("\n")[0].split())
        raise InputError(f"{str(path)!r} is not a mesh that can be read: {reason.rstrip('.')}.") from error


def _vtk(path: Path) -> Raw:
    """What meshio reads right; tables of polygons and grids, which it does not, by VTK."""
    if path.suffix.lower() == ".vtp" or (path.suffix.lower() == ".vtk" and _dataset(path) != "UNSTRUCTURED_GRID"):
        return _by_vtk(path)
    return _by_meshio(path, path.suffix.lower()[1:])


def old_msh(path: Path) -> Raw | None:
    """The surface of a `.msh` file of version 2; None for other versions.

    gmsh gives all cells of one elementary surface the groups of each, and has a cell of several groups several times.
    """
    found = re.search(rb"^\$MeshFormat\s+(\d)", path.read_bytes()[:4000], re.MULTILINE)
    if not found or found[1] != b"2":
        return None
    with _refused(path):
        raw = _by_meshio(path, "gmsh")
    raw.foreign = False
    once: dict[int, int] = {}
    for k, (kind, nodes, numbers) in enumerate(raw.faces):
        corners = np.sort(nodes[:, : 3 if kind == "triangle" else 4], axis=1)
        _, first, same = np.unique(corners, axis=0, return_index=True, return_inverse=True)
        once |= dict(zip(numbers.tolist(), numbers[first[same.reshape(-1)]].tolist(), strict=True))
        raw.faces[k] = kind, nodes[np.sort(first)], numbers[np.sort(first)]
    for group in raw.groups.values():
        if 2 in group:
            group[2] = np.array([once[number] for number in group[2].tolist()])
    total = sum(len(numbers) for _, _, numbers in raw.faces)
    named = [group[2] for group in raw.groups.values() if 2 in group]
    require_groups(total, len(np.unique(np.concatenate(named))) if named else 0)
    return raw


def _by_meshio(path: Path, form: str) -> Raw:
    """What meshio reads, with gmsh's groups."""
    import meshio  # here, as what else takes long to load: most scenes are made by gmsh

    data = meshio.read(path, file_format=form)
    points = np.asarray(data.points, dtype=float).reshape(len(data.points), -1)
    raw = Raw(path, np.pad(points, ((0, 0), (0, 3 - points.shape[1]))), [])
    known = {tuple(map(int, value)): name for name, value in data.field_data.items() if np.size(value) == 2}
    faces: dict[tuple[str, int], list[tuple[Array, Array]]] = {}
    total = 0
    for k, block in enumerate(data.cells):
        kind = block.type if not block.type.startswith("polygon") else "polygon"
        nodes = np.asarray(block.data, dtype=np.int64)
        members = {2: total + np.arange(len(nodes)), 1: nodes[:, :2], 0: nodes[:, 0]}.get(block.dim, nodes)
        if kind in _MESHIO:
            raw.points, face = polygon_files.face(raw.points, _MESHIO[kind], nodes)
            faces.setdefault((_MESHIO[kind], face.shape[1]), []).append((face, members))
            total += len(nodes)
        elif block.dim >= 2 and len(nodes):
            what = (
                "a mesh of volumes: save its surface alone" if block.dim == 3 else f"cells {kind}, which are not read"
            )
            raise InputError(f"{str(path)!r} holds {what}.")
        physical = np.asarray(
            data.cell_data["gmsh:physical"][k] if "gmsh:physical" in data.cell_data else [], dtype=int
        )
        for tag in np.unique(physical[physical > 0]):
            raw.add(known.get((int(tag), block.dim), str(tag)), block.dim, members[physical == tag])
    for (kind, _), tables in faces.items():
        nodes, numbers = (np.concatenate(column) for column in zip(*tables, strict=True))
        raw.faces.append((kind, nodes, numbers))
    return raw


def _dataset(path: Path) -> str:
    """What a .vtk file says that it holds."""
    found = re.search(rb"^\s*DATASET\s+(\w+)", path.read_bytes()[:4000], re.MULTILINE | re.IGNORECASE)
    return found[1].decode().upper() if found else "UNSTRUCTURED_GRID"


def _by_vtk(path: Path) -> Raw:
    """Tables of polygons, strips and lines, and grids of points."""
    import pyvista

    raw = path.read_bytes()
    with pyvista.vtk_verbosity("off"):
        reader = pyvista.get_reader(path, force_ext=path.suffix.lower())
        with pyvista.VtkErrorCatcher(raise_errors=True, emit_warnings=False):
            data: Any = reader.read()
    if not isinstance(data, pyvista.PolyData | pyvista.StructuredGrid | pyvista.ImageData | pyvista.RectilinearGrid):
        raise InputError(f"{str(path)!r} holds a {type(data).__name__}, which is no surface.")
    for key, count in ((b"POINTS", data.n_points), (b"POLYGONS", getattr(data, "n_faces", None))):
        said = (
            re.search(rb"^" + key + rb"\s+(\d+)\s+(\w+)", raw, re.MULTILINE) if path.suffix.lower() == ".vtk" else None
        )
        offsets = key == b"POLYGONS" and b"OFFSETS" in raw
        if said and count is not None and int(said[1]) - offsets != count:
            raise InputError(
                f"{str(path)!r} says that it has {int(said[1]) - offsets} {key.decode()}, and has {count}."
            )
    if isinstance(data, pyvista.PolyData):
        data = data.triangulate() if data.n_strips else data
        rows = [*data.regular_faces] if data.n_faces and data.is_all_triangles else [*data.irregular_faces]
    else:
        cells = data.cast_to_unstructured_grid().cells_dict
        if not cells.keys() <= {pyvista.CellType.QUAD, pyvista.CellType.PIXEL}:
            raise InputError(f"{str(path)!r} holds a grid of volumes or lines: save its surface alone.")
        rows = [*cells.get(pyvista.CellType.QUAD, [])]
        rows += [*cells[pyvista.CellType.PIXEL][:, [0, 1, 3, 2]]] if pyvista.CellType.PIXEL in cells else []
    surface = polygon_files.polygons(path, np.asarray(data.points, dtype=float), rows)
    physical = np.asarray(data.cell_data.get("gmsh:physical", []), dtype=int)
    for tag in np.unique(physical) if len(physical) == len(rows) else []:
        surface.add(str(tag), 2, np.flatnonzero(physical == tag))
    return surface


SUFFIXES: dict[str, Callable[[Path], Raw]] = {
    ".obj": polygon_files.obj,
    ".stl": polygon_files.stl,
    ".ply": polygon_files.ply,
    ".vtk": _vtk,
    ".vtp": _vtk,
    ".vtu": _vtk,
    ".inp": abaqus.read,
}
"""Ending of a file, in small letters -> what reads it."""
