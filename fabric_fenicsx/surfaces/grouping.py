"""A surface as a file holds it, and its named groups on the mesh that is made of it."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError
from . import checking
from .checking import Array

type Tagged = dict[int, tuple[Array, Array]]
type Names = dict[str, dict[int, tuple[int, ...]]]


@dataclass
class Raw:
    """A surface as it was read, on one rank."""

    path: Path
    points: Array
    """Shape (points, 3)."""
    faces: list[tuple[str, Array, Array]]
    """"triangle", "quadrilateral" or "polygon"; nodes, in the order of DOLFINx or going round; numbers of the cells."""
    groups: dict[str, dict[int, Array]] = field(default_factory=dict)
    """Name -> dimension -> numbers of cells, points at the ends of edges, shape (edges, 2), or points."""
    node_sets: set[str] = field(default_factory=set)
    """Groups of points that stand for the edges between them as well."""
    instances: set[str] = field(default_factory=set)
    """Groups that the file does not name: cells in no other are still "sheet"."""
    loose: Array = field(default_factory=lambda: np.zeros((0, 2), dtype=int))
    """Ends of lines, each of which must be an edge of a cell."""
    joints: Array = field(default_factory=lambda: np.zeros((0, 2), dtype=int))
    """Ends of edges at which more than two cells meet, as they are meant to."""
    foreign: bool = True
    """Free edges in no group are the group "boundary", cells in none "sheet"."""
    merge: float = 0.0
    """Points nearer than this part of the extent are one."""

    def add(self, name: str, dim: int, members: Array) -> None:
        """Put cells, edges or points into a group."""
        if len(members):
            group = self.groups.setdefault(name, {})
            group[dim] = np.concatenate([group[dim], members]) if dim in group else members


def require_groups(cells: int, named: int) -> None:
    """Make sure that all cells of a mesh of gmsh are in groups: where some have none, they may have been forgotten."""
    if not named:
        raise InputError(
            'The mesh has no physical group of surfaces: name them, as in Physical Surface("sheet") = {1};.'
        )
    if named < cells:
        raise InputError(
            f"Every cell of the mesh must be in a physical surface, and {cells - named} of {cells} are in none: "
            "name their surfaces too."
        )


def grouped(
    raw: Raw, number: Array, origin: Array, cells: Array, kind: str, edges: Array, count: Array
) -> tuple[Tagged, Names, dict[str, str]]:
    """The groups of a surface on its mesh; see `preparing.Sheet` for what is returned.

    number: of the points of the file, -1 for those on no cell; origin: of the cells, their number in the file;
    edges, count: see `checking.edges`.
    """
    members, refused = _members(raw, number, origin, cells, kind, edges)
    if raw.foreign:
        _rest(raw, members, len(cells), np.flatnonzero(count == 1))
    tagged: Tagged = {}
    names: Names = {}
    for dim, groups in members.items():
        found, tags, of = _combined(groups)
        vertices = {2: cells, 1: edges, 0: np.arange(cells.max() + 1)[:, None]}
        tagged[dim] = vertices[dim][found], tags
        for group, own in of.items():
            names.setdefault(group, {})[dim] = own
    return tagged, names, refused


def _members(
    raw: Raw, number: Array, origin: Array, cells: Array, kind: str, edges: Array
) -> tuple[dict[int, dict[str, Array]], dict[str, str]]:
    """Dimension -> name -> entities of the mesh; and names of groups that are not wholly on it, and why."""
    members: dict[int, dict[str, Array]] = {2: {}, 1: {}, 0: {}}
    refused: dict[str, str] = {}
    total = len(number) + 1
    keys = edges[:, 0] * total + edges[:, 1]

    def on(ends: Array) -> tuple[Array, Array]:
        ends = np.sort(number[ends], axis=1)
        key = ends[:, 0] * total + ends[:, 1]
        k = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        return k, (ends[:, 0] >= 0) & (keys[k] == key)

    for ends in raw.loose[~on(raw.loose)[1]][:1]:
        where = " and ".join(checking.place(x) for x in raw.points[ends])
        raise InputError(f"{str(raw.path)!r} has a truss from {where} that is no edge of a cell: take it out.")
    for name, dims in raw.groups.items():
        for dim, given in dims.items():
            if dim == 2:
                members[2][name] = np.flatnonzero(np.isin(origin, given))
            elif dim == 1:
                found, good = on(given)
                members[1][name] = np.unique(found[good])
                if not good.all():
                    refused[name] = f"{(~good).sum()} of its edges are on no cell: make them edges of cells"
            else:
                found = np.unique(number[given])
                corner, lost = _corners(found[found >= 0], cells, kind, name in raw.node_sets)
                members[0][name] = corner
                if found[0] < 0:
                    refused[name] = "it has a point that is on no cell: embed it, as by Point{9} In Surface{1}; of gmsh"
                elif len(lost):
                    refused[name] = "it has a point in the middle of an edge without the ends: name corners of cells"
    return members, refused


def _corners(points: Array, cells: Array, kind: str, middles: bool) -> tuple[Array, Array]:
    """Those of some points that are corners of cells, and the others; middles: but not those between two corners."""
    count = 3 if kind == "triangle" else 4
    corner = np.intersect1d(points, cells[:, :count])
    rest = np.setdiff1d(points, corner)
    if middles and len(rest):
        chosen = np.zeros(cells.max() + 1, dtype=bool)
        chosen[corner] = True
        for k, ends in checking.between(kind, cells.shape[1]).items():
            rest = np.setdiff1d(rest, cells[chosen[cells[:, ends]].all(axis=1), k])
    return corner, rest


def _rest(raw: Raw, members: dict[int, dict[str, Array]], cells: int, free: Array) -> None:
    """Give a name to the cells and to the free edges that are in no group."""
    named = [own for name, own in members[2].items() if name not in raw.instances]
    others = np.setdiff1d(np.arange(cells), np.concatenate([free[:0], *named]))
    free = np.setdiff1d(free, np.concatenate([free[:0], *members[1].values()]))
    if len(others) and not any("sheet" in groups for groups in members.values()):
        members[2]["sheet"] = others
    if len(free) and not any("boundary" in groups for groups in members.values()):
        members[1]["boundary"] = free


def _combined(groups: dict[str, Array]) -> tuple[Array, Array, dict[str, tuple[int, ...]]]:
    """Entities in any of the groups, a tag for each combination of groups, and which tags a group has."""
    found = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *groups.values()]))
    belongs = np.zeros((len(found), len(groups)), dtype=bool)
    for k, own in enumerate(groups.values()):
        belongs[np.searchsorted(found, own), k] = True
    kinds, tags = np.unique(belongs, axis=0, return_inverse=True)
    of = {name: tuple((np.flatnonzero(kinds[:, k]) + 1).tolist()) for k, name in enumerate(groups)}
    return found, tags.reshape(-1).astype(np.int32) + 1, of
