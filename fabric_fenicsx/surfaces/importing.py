"""Surfaces from the files of other programs: .obj, .stl, .ply, .vtk, .vtu and .inp."""

import contextlib
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx.io.utils import cell_perm_vtk
from dolfinx.mesh import CellType
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..errors import InputError
from .checking import Array

SUFFIXES = {".obj", ".stl", ".ply", ".vtk", ".vtu", ".inp"}
_KINDS = {
    "triangle": CellType.triangle,
    "triangle6": CellType.triangle,
    "quad": CellType.quadrilateral,
    "quad9": CellType.quadrilateral,
}
SAME = 1e-7
"""Corners of .stl triangles nearer to each other than this part of the surface's extent are one point."""


@dataclass
class Sheet:
    """A surface as it was read: see `checking` for points, cells and kind."""

    points: Array
    cells: Array
    kind: str
    cell_tags: Array
    """One for each cell, shape (cells,)."""
    edges: Array
    """Nodes of the edges that are in a group, shape (edges, nodes of an edge)."""
    edge_tags: Array
    names: dict[str, tuple[int, int]]
    """Name of a group -> (dimension, tag)."""


def load(path: Path) -> Sheet:
    """Read a file of one of the `SUFFIXES`, in metres, as it stands.

    Points that no cell uses are dropped, and those at the same place are merged in an .stl file, which has
    each several times. Groups of cells and edges: `g` or `o` of .obj, ELSET of .inp, `gmsh:physical` of .vtk and
    .vtu. Cells in none are the group "sheet"; a group of all cells is left out if there are others.

    Raises InputError for a file that meshio cannot read, no surface, mixed cells or cells of another kind, a point
    that is missing or not finite, and a cell in two groups.
    """
    import meshio  # here, as what else takes long to load: most scenes are made by gmsh

    name, said = str(path), io.StringIO()
    try:
        # meshio prints what is wrong, and exits; it tries the text of an .stl file as numbers
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), np.errstate(over="ignore"):
            data = _obj(path) if path.suffix.lower() == ".obj" else meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = " ".join((said.getvalue().strip() or str(error) or type(error).__name__).split("\n")[0].split())
        raise InputError(f"{name!r} is not a mesh that can be read: {reason.rstrip('.')}.") from error

    blocks = [k for k, block in enumerate(data.cells) if block.dim == 2 and len(block)]
    kinds = sorted({data.cells[k].type for k in blocks})
    if any(block.dim == 3 for block in data.cells):
        raise InputError(f"{name!r} holds a mesh of volumes: save its surface alone.")
    if not kinds:
        raise InputError(f"{name!r} holds no surface mesh: there are no triangles or quadrilaterals.")
    if len(kinds) > 1 or kinds[0] not in _KINDS:
        raise InputError(
            f"{name!r} has cells of the kinds {', '.join(kinds)}, which must be one of {', '.join(_KINDS)}: "
            "triangulate the surface where it was made."
        )
    kind = _KINDS[kinds[0]]
    cells = np.concatenate([data.cells[k].data for k in blocks]).astype(np.int64)
    width = cells.shape[1]
    cells = cells[:, cell_perm_vtk(kind, width)]
    degree = "line3" if kinds[0] in ("triangle6", "quad9") else "line"
    lines = [k for k, block in enumerate(data.cells) if block.type == degree and len(block)]
    edges = np.concatenate([np.zeros((0, 2 + (degree == "line3")), dtype=int), *(data.cells[k].data for k in lines)])

    points = np.asarray(data.points, dtype=float).reshape(len(data.points), -1)
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    if cells.min() < 0 or cells.max() >= len(points):
        raise InputError(f"A cell of {name!r} has a corner at a point that is not in the file.")
    if path.suffix.lower() == ".stl":
        cells = _merged(points)[cells]
    used, cells = np.unique(cells, return_inverse=True)
    cells = cells.reshape(-1, width)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    points, edges = points[used], number[edges]
    if not np.isfinite(points).all():
        raise InputError(f"{name!r} has a point whose coordinates are not finite numbers.")

    sets = dict(_sets(data)) | _elsets(path, data)
    names: dict[str, tuple[int, int]] = {}
    cell_tags = _tags(data, sets, blocks, 2, names)
    edge_tags = _tags(data, sets, lines, 1, names)
    if (cell_tags == 0).any():
        cell_tags[cell_tags == 0] = len(names) + 1
        names.setdefault("sheet", (2, len(names) + 1))
    named = (edge_tags > 0) & (edges >= 0).all(axis=1)
    return Sheet(points, cells, kind.name, cell_tags, edges[named], edge_tags[named], names)


def _tags(data: Any, sets: dict[str, list[Array]], blocks: list[int], dim: int, names: dict) -> Array:
    """A tag for each cell of these blocks, 0 for those in no set; adds the sets to `names`."""
    start = np.cumsum([0] + [len(data.cells[k]) for k in blocks])
    whole = {
        name: np.concatenate([np.asarray(parts[k], dtype=int) + s for k, s in zip(blocks, start, strict=False)])
        for name, parts in sets.items()
        if blocks and name not in names and len(parts) == len(data.cells)
    }
    whole = {name: np.unique(members) for name, members in whole.items() if len(members)}
    if len(whole) > 1:
        whole = {name: members for name, members in whole.items() if dim == 1 or len(members) < start[-1]} or whole
    tags = np.zeros(start[-1], dtype=np.int32)
    for name, members in whole.items():
        twice = members[tags[members] > 0]
        if twice.size:
            other = next(n for n, pair in names.items() if pair == (dim, tags[twice[0]]))
            raise InputError(
                f"{'Cell' if dim == 2 else 'Edge'} {twice[0]} is in both of the groups {other!r} and {name!r}: "
                "let it be in one."
            )
        names[name] = (dim, len(names) + 1)
        tags[members] = names[name][1]
    return tags


def _sets(data: Any) -> Iterator[tuple[str, list[Array]]]:
    """Names and members, block by block, of what meshio knows to be a group."""
    yield from data.cell_sets.items()
    physical = data.cell_data.get("gmsh:physical", [])
    known = {int(value[0]): name for name, value in data.field_data.items() if np.size(value) == 2}
    for tag in np.unique(np.concatenate([[], *physical])).astype(int):
        yield known.get(tag, str(tag)), [np.flatnonzero(part == tag) for part in physical]


def _elsets(path: Path, data: Any) -> dict[str, list[Array]]:
    """Element sets named in the *ELEMENT lines of an .inp file, which meshio may give to other blocks."""
    if path.suffix.lower() != ".inp":
        return {}
    lines = re.findall(r"^\*ELEMENT\b.*$", path.read_text(), re.IGNORECASE | re.MULTILINE)
    found = [re.search(r"ELSET\s*=\s*([^,\s]+)", line, re.IGNORECASE) for line in lines]
    names = [match and match[1] for match in found]
    if len(names) != len(data.cells):
        return {}
    return {
        name: [np.arange(len(block) * (name == own)) for block, own in zip(data.cells, names, strict=True)]
        for name in names
        if name
    }


def _merged(points: Array) -> Array:
    """For each point the one that stands for all at its place."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(SAME * np.ptp(points, axis=0).max(), output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    _, first, same = np.unique(connected_components(graph, directed=False)[1], return_index=True, return_inverse=True)
    return first[same]


def _obj(path: Path) -> Any:
    """An .obj file with its groups, which meshio does not name; texture and normals are left out."""
    import meshio

    points: list[list[float]] = []
    faces: dict[int, list[list[int]]] = {}
    members: dict[str, dict[int, list[int]]] = {}
    group = ""
    for line in path.read_text().splitlines():
        key, *words = line.split("#")[0].split() or [""]
        if key == "v":
            points.append([float(word) for word in words[:3]])
        elif key in ("g", "o"):
            group = " ".join(words)
        elif key == "f":
            # counted from 1, or from the last point backwards
            face = [int(word.split("/")[0]) for word in words]
            same = faces.setdefault(len(face), [])
            members.setdefault(group, {}).setdefault(len(face), []).append(len(same))
            same.append([n - 1 if n > 0 else n + len(points) if n < 0 else -1 for n in face])
    kinds = {2: "line", 3: "triangle", 4: "quad"}
    cells = [(kinds.get(n, "polygon"), same) for n, same in faces.items()]
    sets = {name: [parts.get(n, []) for n in faces] for name, parts in members.items() if name}
    return meshio.Mesh(points, cells, cell_sets=sets)
