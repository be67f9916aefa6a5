"""What a surface must be before a shell can stand on it, checked for all its cells at once.

A surface is points, shape (nodes, 3) in metres; cells, shape (cells, nodes of a cell), places in
points in the order of DOLFINx; and the kind of the cells, "triangle" or "quadrilateral".
"""

from typing import Any

import basix
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..errors import InputError

Array = NDArray[Any]

ASPECT = 1e6
"""How many times longer than wide a cell may be."""

DEGREE = {3: 1, 4: 1, 6: 2, 9: 2, 10: 3, 16: 3}
"""Nodes of a triangle or quadrilateral -> degree of its geometry."""
_CORNERS = {"triangle": (0, 1, 2), "quadrilateral": (0, 1, 3, 2)}
"""The corners of a cell, going round."""


def turned(kind: str, width: int) -> Array:
    """The order of the nodes in which a cell faces the other side: its axes trade places."""
    x = np.asarray(_element(kind, width).points)
    return np.array([np.abs(x - x[k, ::-1]).sum(axis=1).argmin() for k in range(width)])


def between(kind: str, width: int) -> dict[int, list[int]]:
    """Node of a cell that is no corner -> the corners that it is between: of an edge, or all."""
    element = _element(kind, width)
    corners = basix.topology(basix.CellType[kind])
    return {node: corners[dim][k] for dim in (1, 2) for k, own in enumerate(element.entity_dofs[dim]) for node in own}


def edges(cells: Array, kind: str) -> tuple[Array, Array, Array]:
    """Ends of all edges, the smaller first, shape (edges, 2), in order; the edge of each side of each cell, going
    round, shape (cells, sides); and how many cells each edge has."""
    corners = cells[:, _CORNERS[kind]].astype(np.int64)
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    total = ends.max(initial=0) + 1
    key, side, count = np.unique(ends[:, 0] * total + ends[:, 1], return_inverse=True, return_counts=True)
    return np.column_stack([key // total, key % total]), side.reshape(corners.shape), count


def pieces(sides: Array, count: Array) -> int:
    """How many pieces no edge joins; sides, count: see `edges`."""
    owner = np.repeat(np.arange(len(sides)), sides.shape[1])
    graph = coo_array(
        (np.ones(len(owner)), (owner, len(sides) + sides.ravel())), shape=(n := len(sides) + len(count), n)
    )
    return int(connected_components(graph, directed=False)[0])


def check(points: Array, cells: Array, kind: str, orient: bool = False, joints: Array | None = None) -> Array:
    """Make sure that the cells are sound, no edge has more than two, and neighbours face the same side.

    joints: ends of edges (n, 2) that may have more, where sheets are sewn onto each other.
    orient: where they do not, choose the cells to be turned, the fewest in each connected piece.
    Returns which cells these are, shape (cells,). Raises InputError, naming cell and place, for a cell with a
    repeated vertex, of no area, more than `ASPECT` times longer than wide, or given twice; for
    an edge of three cells or more; for neighbours that face opposite sides, and if `orient` cannot mend it.
    """
    corners = cells[:, _CORNERS[kind]]

    def at(cell: int) -> str:
        return place(points[corners[cell]].mean(axis=0))

    ordered = np.sort(corners, axis=1)
    for cell in np.flatnonzero((np.diff(ordered, axis=1) == 0).any(axis=1))[:1]:
        raise InputError(f"Cell {cell} at {at(cell)} uses a vertex twice: remove the cell, or mesh the surface anew.")
    aspect = _aspect(points, cells, kind)
    for cell in np.flatnonzero(~(aspect <= ASPECT))[:1]:
        raise InputError(
            f"Cell {cell} at {at(cell)} is degenerate, {aspect[cell]:.3g} times longer than wide: "
            "remove the cell, or mesh the surface anew."
        )
    row = np.lexsort(ordered.T)
    for k in np.flatnonzero((ordered[row[1:]] == ordered[row[:-1]]).all(axis=1))[:1]:
        raise InputError(f"Cell {row[k + 1]} at {at(row[k + 1])} is the same as cell {row[k]}: remove one of them.")

    # sides of the cells, in the order of their edges
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    known, edge, count = edges(cells, kind)
    joined = np.zeros(len(count), dtype=bool)
    if joints is not None and len(joints):
        total = known.max() + 1
        joined = np.isin(known @ [total, 1], np.sort(joints, axis=1) @ [total, 1])
    sides = np.argsort(edge.ravel(), kind="stable")
    start = np.cumsum(count) - count
    owner, forward = np.repeat(np.arange(len(cells)), corners.shape[1]), ends[:, 0] < ends[:, 1]
    for e in np.flatnonzero((count > 2) & ~joined)[:1]:
        some = sides[start[e] : start[e] + count[e]]
        raise InputError(
            f"Cells {', '.join(str(owner[s]) for s in some)} share the edge at "
            f"{place(points[ends[some[0]]].mean(axis=0))}, where the surface branches: take one part away, or "
            "sew it on by a seam of panels."
        )
    left, right = sides[start[count == 2]], sides[start[count == 2] + 1]
    opposed = forward[left] == forward[right]
    if orient:
        turned, lost = _to_be_turned(len(cells), owner[left], owner[right], opposed)
        if lost.any():
            cell = int(lost.argmax())
            raise InputError(
                f"The surface with cell {cell} at {at(cell)} has one side only, as a Moebius strip has: "
                "cut it along an edge."
            )
        return turned
    for k in np.flatnonzero(opposed)[:1]:
        raise InputError(
            f"Cells {owner[left[k]]} and {owner[right[k]]} on the edge at {place(points[ends[left[k]]].mean(axis=0))} "
            "face opposite sides: read the mesh with orient=True, or turn one of them in the mesher."
        )
    return np.zeros(len(cells), dtype=bool)


def place(x: Array) -> str:
    """A point, (3,) in m, as it is named in a message."""
    return f"({', '.join(f'{float(c):.4g}' for c in x)})"


def _element(kind: str, width: int) -> basix.finite_element.FiniteElement:
    """Of the geometry of a cell of so many nodes."""
    equispaced = basix.LagrangeVariant.equispaced
    return basix.create_element(basix.ElementFamily.P, basix.CellType[kind], DEGREE[width], equispaced)


def _aspect(points: Array, cells: Array, kind: str) -> Array:
    """Longest side against least width of each cell, by the surface's metric at its nodes; infinite for no area."""
    element = _element(kind, cells.shape[1])
    slopes = np.asarray(element.tabulate(1, np.asarray(element.points)))[1:, :, :, 0]
    x = points[cells]
    tangent = np.einsum("apb,cbi->acpi", slopes, x)
    normal = np.cross(tangent[0], tangent[1])
    mean = normal.mean(axis=1, keepdims=True)
    corners = x[:, _CORNERS[kind]]
    longest = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=-1).max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        least = (normal * mean).sum(axis=-1).min(axis=1) / np.sqrt((mean**2).sum(axis=-1))[:, 0]
        return np.where(least > 0, longest / least, np.inf)


def _to_be_turned(count: int, left: Array, right: Array, opposed: Array) -> tuple[Array, Array]:
    """Which of `count` cells to turn, and which cannot be set right; neighbours left, right may be opposed."""
    # each cell as it is (c) and turned (c + count): what must go together is connected
    other = right + count * opposed
    rows, columns = np.concatenate([left, left + count]), np.concatenate([other, (other + count) % (2 * count)])
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * count, 2 * count))
    together = connected_components(graph, directed=False)[1].reshape(2, count)
    # a piece of the surface is a pair of such sets, known by the smaller; and it turns its smaller half
    piece = together.min(axis=0)
    turned = together[0] != piece
    many = 2 * np.bincount(piece, turned) > np.bincount(piece)
    return turned ^ many[piece], together[0] == together[1]
