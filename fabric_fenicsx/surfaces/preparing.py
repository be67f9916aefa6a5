"""From a surface as a file holds it to one that a shell can stand on: scaled, cut, merged, checked, in groups."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dolfinx.io.utils import cell_perm_vtk
from dolfinx.mesh import CellType
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..errors import InputError
from . import checking, grouping
from .checking import Array
from .grouping import Raw

SAME = 1e-7
"""Corners of .stl triangles nearer to each other than this part of the surface's extent are one point."""
WIDE = 20.0
"""m, of a sheet that may have been meant in mm."""
NEAR = 1e-3
"""Free edges nearer to each other than this part of their length lie on one another."""


@dataclass
class Sheet:
    """A surface, ready to be distributed; cells, points and kind as `checking` has them."""

    points: Array
    cells: Array
    kind: str
    tagged: dict[int, tuple[Array, Array]]
    """Dimension -> vertices of the entities that are in groups, shape (entities, vertices), and their tags."""
    names: dict[str, dict[int, tuple[int, ...]]]
    """Name of a group -> dimension -> tags of its entities: a tag for each combination of groups."""
    refused: dict[str, str]
    """Name of a group that cannot be used, and why."""
    node_sets: set[str]
    pieces: int


def decoded(path: Path) -> str:
    """The text of a file: UTF-8 or -16 with or without its mark, or else Latin-1."""
    raw = path.read_bytes()
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return raw.decode("utf-16")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def of_vtk(kind: str, cells: Array) -> Array:
    """Cells with their nodes in the order of DOLFINx, from that of VTK, Abaqus, meshio."""
    return cells[:, cell_perm_vtk(CellType[kind], cells.shape[1])]


def completed(points: Array, cells: Array) -> tuple[Array, Array]:
    """Quadrilaterals of 8 nodes, corners and then sides, with the node in their middle that changes no shape."""
    x = points[cells]
    middle = x[:, 4:].sum(axis=1) / 2 - x[:, :4].sum(axis=1) / 4
    numbers = len(points) + np.arange(len(cells))
    return np.concatenate([points, middle]), np.column_stack([cells, numbers])


def prepare(raw: Raw, *, gdim: int, orient: bool, scale: float, merge: float | None, triangulate: bool) -> Sheet:
    """The surface in metres, checked; see `meshing.read` for what is asked. Warns of what may not be meant.

    Raises InputError for no surface, mixed cells, a point that is missing or not finite, and as `checking.check`.
    """
    name = repr(str(raw.path)) if raw.path.name else "The mesh"
    kind, cells, origin = _one_kind(raw, triangulate, name)
    points = raw.points * scale
    if cells.min() < 0 or cells.max() >= len(points):
        raise InputError(f"A cell of {name} has a corner at a point that is not in the file.")
    used = np.unique(cells)
    if not np.isfinite(points[used]).all():
        raise InputError(f"{name} has a point whose coordinates are not finite numbers.")
    points[:, gdim:] = 0.0
    extent = np.ptp(points[used], axis=0).max()
    place = np.arange(len(points))
    if merge is not None or raw.merge:
        place = _merged(points, cells, kind, raw.merge * extent if merge is None else merge, merge is not None)
        cells = place[cells]
    used = np.unique(cells)
    cells = np.searchsorted(used, cells)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    number, points = number[place], points[used]

    turned = checking.check(points, cells, kind, orient or gdim == 2, number[raw.joints])
    cells[turned] = cells[turned][:, checking.turned(kind, cells.shape[1])]
    edges, sides, count = checking.edges(cells, kind)
    pieces = checking.pieces(sides, count)
    _warn(name, points, edges[count == 1], pieces, extent)
    tagged, names, refused = grouping.grouped(raw, number, origin, cells, kind, edges, count)
    return Sheet(points, cells, kind, tagged, names, refused, raw.node_sets, pieces)


def _one_kind(raw: Raw, triangulate: bool, name: str) -> tuple[str, Array, Array]:
    """Kind and nodes of the cells, in the order of the file, and the number of the cell that each is of."""
    faces = [face for face in raw.faces if len(face[1])]
    if not faces:
        raise InputError(f"{name} holds no surface mesh: there are no triangles or quadrilaterals.")
    if triangulate:
        faces = [_triangles(raw.points, *face, name) for face in faces]
    kinds = sorted({(kind, nodes.shape[1]) for kind, nodes, _ in faces})
    if len(kinds) > 1 or kinds[0][0] == "polygon":
        has = " and ".join(f"{kind}s of {width} nodes" for kind, width in kinds)
        raise InputError(
            f"{name} has {has}, and the cells of a sheet are of one kind, triangles or quadrilaterals: read it with "
            "triangulate = true, or mesh all of it alike."
        )
    cells, origin = (np.concatenate([face[k] for face in faces]) for k in (1, 2))
    order = np.argsort(origin, kind="stable")
    return kinds[0][0], cells[order].astype(np.int64), origin[order]


def _triangles(points: Array, kind: str, nodes: Array, numbers: Array, name: str) -> tuple[str, Array, Array]:
    """Cells cut into triangles: two for each quadrilateral, one less than two to each corner of others."""
    width = nodes.shape[1]
    if kind == "triangle":
        return kind, nodes, numbers
    if kind == "quadrilateral" and width == 9:
        cut = nodes[:, [[0, 1, 3, 6, 8, 4], [0, 3, 2, 7, 5, 8]]]
        return "triangle", cut.reshape(-1, 6), np.repeat(numbers, 2)
    if kind == "quadrilateral" and width != 4:
        raise InputError(f"{name} has quadrilaterals of {width} nodes, which are not cut into triangles.")
    import pyvista  # here, as it takes long to load

    if nodes.min() < 0 or nodes.max() >= len(points):
        raise InputError(f"A cell of {name} has a corner at a point that is not in the file.")
    if kind == "quadrilateral":
        nodes = nodes[:, [0, 1, 3, 2]]
    # unlike vertices at one place, which VTK keeps apart
    surface = pyvista.PolyData(points.astype(float), faces=np.insert(nodes, 0, width, axis=1).ravel())
    surface.cell_data["number"] = numbers
    cut = surface.triangulate()
    if cut.n_cells != (width - 2) * len(nodes):
        whole = np.bincount(np.searchsorted(numbers, cut.cell_data["number"]), minlength=len(numbers))
        raise InputError(
            f"Cell {numbers[np.argmax(whole != width - 2)]} of {name} cannot be cut into triangles: "
            "it crosses itself or has no area."
        )
    return "triangle", cut.regular_faces.astype(np.int64), np.asarray(cut.cell_data["number"])


def _merged(points: Array, cells: Array, kind: str, tolerance: float, asked: bool) -> Array:
    """For each point the first of those on free edges that are nearer to it than `tolerance`, in m."""
    _, sides, count = checking.edges(cells, kind)
    rim = np.unique(cells[(count[sides] == 1).any(axis=1)])
    pairs = cKDTree(points[rim]).query_pairs(tolerance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(rim), len(rim)))
    _, first, same = np.unique(connected_components(graph, directed=False)[1], return_index=True, return_inverse=True)
    place = np.arange(len(points))
    place[rim] = rim[first[same]]
    if asked:
        moved = np.linalg.norm(points[place[rim]] - points[rim], axis=1)
        lost = np.flatnonzero((np.diff(np.sort(place[cells], axis=1), axis=1) == 0).any(axis=1))
        if lost.size or moved.max(initial=0) > 2 * tolerance:
            where = points[cells[lost[0]]].mean(axis=0) if lost.size else points[rim[moved.argmax()]]
            raise InputError(
                f"merge = {tolerance:g} m is too much at {checking.place(where)}, where it would make points of one "
                "cell, or a whole row of points, one: give less."
            )
    return place


def _warn(name: str, points: Array, free: Array, pieces: int, extent: float) -> None:
    """Say what may not be meant: a sheet as large as a house, and free edges that lie on one another."""
    if extent > WIDE:
        warnings.warn(
            f"{name} is {extent:.4g} m wide: if its numbers are millimetres, read it with scale = 0.001.", stacklevel=2
        )
    x = points[free]
    length = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    pairs = cKDTree(x.mean(axis=1)).query_pairs(NEAR * length.max(), output_type="ndarray") if len(free) else free
    a, b = x[pairs.T]
    gap = np.minimum(*(np.linalg.norm(a - other, axis=2).max(axis=1) for other in (b, b[:, ::-1])))
    near = gap <= NEAR * length[pairs].min(axis=1)
    if near.any():
        enough = max(2 * gap[near].max(), SAME * extent)
        warnings.warn(
            f"{name}: {len(np.unique(pairs[near]))} free edges lie on one another and are not joined, and the sheet is "
            f"of {pieces} {'piece' if pieces == 1 else 'pieces'}: if it is torn there, read it with "
            f"merge = {float(f'{enough:.1e}'):g}.",
            stacklevel=2,
        )
