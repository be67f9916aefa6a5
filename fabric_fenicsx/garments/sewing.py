"""Panels sewn together: one sheet whose nodes coincide at the seams, and which is at rest as the flat panels.

Partner edges have as many nodes, evenly spread, and are joined node by node: an edge that is longer than its partner is
eased or gathered into it evenly. All panels face up as they are drawn, and their outlines go round anticlockwise, so
that two edges are joined end to start. What is sewn does not depend on the order of the seams.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..errors import InputError
from ..laws import Array
from ..material import Material
from ..sheet import Sheet
from ..surfaces import meshing, outlines
from ..surfaces.grouping import Raw
from ..surfaces.meshing import Domain
from .panels import Panel, spread

type End = tuple[str, str]
"""Name of a panel and of one of its edges."""


@dataclass(frozen=True, init=False)
class Seam:
    """Edges that are sewn together, each a panel and one of its edges: `Seam(("front", "side"), ("back", "side"))`.

    The second edge runs against the first, and so does a third one, of a panel that is sewn onto the others' seam.

    Args:
        name: of the group of its edges, if it is to have one.
        lean: by which angle (rad) the director of the seam leans out over each edge from the panel's face, at rest. By
            default it does not: the cloth goes on flat. Half the angle of a fold, away from the faces, for both. The
            sheets are tied to each other: their directors there are one, and turn together, each as long as it
            goes through that sheet's thickness.
        joined: whether nodes of the edges are one. If not, tie them by `terms.stitches.Stitches`, which can open.
    """

    edges: tuple[End, ...]
    name: str
    lean: tuple[float, ...]
    joined: bool

    def __init__(self, *edges: End, name: str = "", lean: Sequence[float] = (), joined: bool = True) -> None:
        object.__setattr__(self, "edges", tuple((str(panel), str(edge)) for panel, edge in edges))
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "joined", joined)
        object.__setattr__(self, "lean", tuple(map(float, lean)) or (0.0,) * len(edges))
        if len(self.edges) < 2 or len(set(self.edges)) < len(self.edges):
            raise InputError(f"A seam joins two edges, and not {', '.join('.'.join(e) for e in self.edges) or 'none'}.")
        if len(self.lean) != len(self.edges) or not (np.abs(self.lean) < np.pi / 2 - 0.01).all():
            raise InputError(f"A seam of {len(self.edges)} edges leans by as many angles below 90 degrees, in rad.")


@dataclass(frozen=True)
class Garment:
    """What has been sewn: `domain`, with groups of cells "panel", of edges "panel.edge", and of named seams."""

    domain: Domain
    panels: tuple[Panel, ...]
    seams: tuple[Seam, ...]

    def materials(self, of: Material | Mapping[str, Material]) -> dict[str, Material]:
        """For `sheet.Sheet`: of each panel, with the warp along its grain line; one for all, or by their names.

        Raises InputError for a panel without one.
        """
        found = {}
        for panel in self.panels:
            name = panel.material or panel.name
            if not isinstance(of, Material) and name not in of:
                known = ", ".join(sorted(of)) or "none"
                raise InputError(f"The panel {panel.name!r} is of {name!r}, and the materials are: {known}.")
            found[panel.name] = replace(of if isinstance(of, Material) else of[name], warp=panel.warp)
        return found

    def sheet(self, of: Material | Mapping[str, Material], **options: Any) -> Sheet:
        """The sheet, see `sheet.Sheet`, of these `materials`."""
        return Sheet(self.domain, self.materials(of), **options)


def sew(
    panels: Sequence[Panel],
    seams: Sequence[Seam] = (),
    *,
    cell: float,
    comm: MPI.Comm = MPI.COMM_WORLD,
    kind: outlines.Kind = "quadrilateral",
    ghosts: bool = False,
) -> Garment:
    """Mesh panels and sew them together; to be called on every rank.

    Args:
        cell: size of cells, m; along a seam, of the longest partner.
        kind: of cells: "quadrilateral", of the element mitc4, or "triangle", of regge.
        ghosts: see `meshing.read`.

    Raises InputError, on every rank, for names that are none or come twice, an edge in two seams, and an outline that
    cannot be filled.
    """
    if not (np.isfinite(cell) and cell > 0.0):
        raise InputError(f"A cell size of {cell!r} m is not a positive number.")
    names = [panel.name for panel in panels]
    for name in names:
        if names.count(name) > 1 or not name:
            raise InputError(f"Panels need names of their own, and {names.count(name)} are called {name!r}.")
    known = {(panel.name, edge) for panel in panels for edge in panel.outline}
    sewn = [edge for seam in seams for edge in seam.edges]
    for edge in sewn:
        if edge not in known:
            raise InputError(f"No panel has the edge {'.'.join(edge)!r} of a seam.")
        if sewn.count(edge) > 1:
            raise InputError(f"The edge {'.'.join(edge)!r} is in two seams: split it where one ends.")

    def make() -> tuple[Raw, Array, Array | None]:
        return _made(panels, seams, _counts(panels, seams, cell), kind)

    return Garment(meshing.sewn(make, comm, ghosts=ghosts), tuple(panels), tuple(seams))


def _counts(panels: Sequence[Panel], seams: Sequence[Seam], cell: float) -> dict[End, int]:
    """Even numbers of parts of the edges, the same for partners and for opposite edges of regular panels."""
    lengths = {(panel.name, edge): size for panel in panels for edge, size in panel.lengths().items()}
    place = {edge: k for k, edge in enumerate(lengths)}
    pairs = [(place[seam.edges[0]], place[other]) for seam in seams for other in seam.edges[1:]]
    for panel in panels:
        if panel.is_regular:
            own = [place[panel.name, edge] for edge in panel.outline]
            pairs += [(own[0], own[2]), (own[1], own[3])]
    together = _together(len(place), pairs)
    parts = 2 * np.maximum(1, np.ceil(np.array(list(lengths.values())) / (2 * cell) - 1e-9)).astype(int)
    most = np.zeros(together.max() + 1, dtype=int)
    np.maximum.at(most, together, parts)
    return {edge: int(most[together[k]]) for edge, k in place.items()}


def _together(count: int, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
    """Numbers of what pairs connect."""
    i, j = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _made(
    panels: Sequence[Panel], seams: Sequence[Seam], parts: dict[End, int], kind: outlines.Kind
) -> tuple[Raw, Array, Array | None]:
    """The surface where it starts, and where the nodes of its cells and their directors are at rest."""
    edges: dict[End, np.ndarray] = {}
    flat, start, cells, owner, first = [], [], [], [], 0
    for panel in panels:
        try:
            outline = [spread(curve, parts[panel.name, name]) for name, curve in panel.curves().items()]
            points, own, on = outlines.fill(outline, kind, panel.is_regular)
        except InputError as error:
            raise InputError(f"The panel {panel.name!r}: {error}") from None
        flat.append(points)
        start.append(np.asarray(panel.placed(points), dtype=float))
        cells.append(own + first)
        owner.append(np.full(len(own), len(flat) - 1))
        edges |= {(panel.name, name): nodes + first for name, nodes in zip(panel.outline, on, strict=True)}
        first += len(points)
    joined = [seam for seam in seams if seam.joined]
    pairs = [(int(i), int(j)) for seam in joined for other in seam.edges[1:] for i, j in
             zip(edges[seam.edges[0]], edges[other][::-1], strict=True)]  # fmt: skip
    weld, table, panel_of = _together(first, pairs), np.concatenate(cells), np.concatenate(owner)
    rest = np.pad(np.concatenate(flat)[table], ((0, 0), (0, 0), (0, 1)))
    # nodes that are one start in the middle of where they were placed
    places = np.zeros((weld.max() + 1, 3))
    np.add.at(places, weld, np.concatenate(start))
    places /= np.bincount(weld)[:, None]
    raw = Raw(Path(), places, [(kind, weld[table], np.arange(len(table)))], foreign=False)
    for k, panel in enumerate(panels):
        raw.add(panel.name, 2, np.flatnonzero(panel_of == k))
    for name, nodes in edges.items():
        raw.add(".".join(name), 1, weld[np.stack([nodes[:-1], nodes[1:]], axis=1)])
    for seam in seams:
        if seam.name:
            nodes = edges[seam.edges[0]]
            raw.add(seam.name, 1, weld[np.stack([nodes[:-1], nodes[1:]], axis=1)])
    several = [edges[seam.edges[0]] for seam in joined if len(seam.edges) > 2]
    raw.joints = np.concatenate([raw.joints, *(weld[np.stack([n[:-1], n[1:]], axis=1)] for n in several)])
    return raw, rest, _directors(np.concatenate(flat), table, edges, seams)


def _directors(flat: Array, table: np.ndarray, edges: dict[End, np.ndarray], seams: Sequence[Seam]) -> Array | None:
    """Along which directors are at rest at the corners of cells, (cells, corners, 3); None where none leans."""
    if not any(any(seam.lean) for seam in seams):
        return None
    normals = np.zeros((len(flat), 3))
    normals[:, 2] = 1.0
    for seam in seams:
        for edge, angle in zip(seam.edges, seam.lean, strict=True):
            nodes = edges[edge]
            along = np.gradient(flat[nodes], axis=0)
            along /= np.linalg.norm(along, axis=1, keepdims=True)
            out = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(nodes))])  # the panel is on the left
            normals[nodes] = np.cos(angle) * np.array([0.0, 0.0, 1.0]) + np.sin(angle) * out
    return normals[table]
