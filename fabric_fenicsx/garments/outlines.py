"""Outlines of pieces as pattern makers handle them: edges chained, split, moved inwards by an allowance, unfolded.

An edge is an array of points (n, 2) in m from one turn point to the next; an outline goes round anticlockwise.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import InputError
from ..laws import Array

NEAR = 2e-4
"""m; points that are nearer to each other are one, as the pieces of some programs do not quite meet."""
MISSING = "Seam allowances need Shapely: pip install 'fabric_fenicsx[patterns]', or pip install shapely."


def area(edges: Sequence[Array]) -> float:
    """That a closed outline goes round, m2; negative where it goes round clockwise."""
    x, y = np.concatenate([edge[:-1] for edge in edges]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def chained(lines: Sequence[Array]) -> list[Array]:
    """Open lines, in any order and direction, or one closed one, as a closed loop, anticlockwise, from the first on.

    Raises InputError where they are no loop.
    """
    left = [line for line in lines if len(line) > 1]
    loop: list[Array] = []
    if not left:
        raise InputError("has no outline")
    while left:
        end = loop[-1][-1] if loop else left[0][0]
        off = [[np.linalg.norm(line[k] - end) for k in (0, -1)] for line in left]
        k, back = np.unravel_index(np.argmin(off), (len(left), 2))
        if off[k][back] > NEAR:
            raise InputError(f"has an outline with a gap of {1e3 * off[k][back]:.3g} mm")
        line = left.pop(int(k))
        loop.append(line[::-1].copy() if back else line.copy())
    for before, after in pairwise([*loop, loop[0]]):
        if np.linalg.norm(before[-1] - after[0]) > NEAR:
            raise InputError(f"has an outline with a gap of {1e3 * np.linalg.norm(before[-1] - after[0]):.3g} mm")
        before[-1] = after[0]
    if area(loop) < 0.0:
        loop = [line[::-1] for line in loop[::-1]]
    return loop


def split(loop: Sequence[Array], turns: Array) -> list[Array]:
    """The edges of a loop between turn points (n, 2): those given, and the ends of its lines if it is of several."""
    x = np.concatenate([line[:-1] for line in loop])
    keep = np.linalg.norm(x - np.roll(x, 1, axis=0), axis=1) > 0.0
    corner = np.zeros(len(x), dtype=bool)
    if len(loop) > 1:
        corner[np.cumsum([0, *(len(line) - 1 for line in loop[:-1])])] = True
    for point in turns:
        off = np.linalg.norm(x - point, axis=1)
        corner[off.argmin()] |= off.min() < NEAR
    x, corner = x[keep], corner[keep]
    at = np.flatnonzero(corner)
    if len(at) < 2:
        raise InputError("has no turn points to split its outline at")
    x, at = np.roll(x, -at[0], axis=0), at - at[0]
    closed = np.concatenate([x, x[:1]])
    return [closed[a : b + 1] for a, b in pairwise([*at, len(x)])]


def inwards(edges: Sequence[Array], allowances: Sequence[float]) -> list[Array]:
    """The sewn edges of a piece, from those of its cut and their seam allowances in m. Raises InputError."""
    if not any(allowances):
        return list(edges)
    if min(allowances) < 0.0:
        raise InputError("has a negative seam allowance")
    shapely = _shapely()
    far, moved = 4 * max(allowances), []
    for edge, width in zip(edges, allowances, strict=True):
        line = shapely.LineString(edge)
        line = shapely.offset_curve(line, width, join_style="mitre", mitre_limit=5.0) if width else line
        if line.geom_type != "LineString" or line.is_empty:
            raise InputError(f"has an edge that its seam allowance of {1e3 * width:g} mm leaves nothing of")
        moved.append(np.asarray(line.coords))
    corners = []
    for k, edge in enumerate(edges):
        before, after = moved[k - 1], moved[k]
        if np.linalg.norm(before[-1] - after[0]) < 0.1 * NEAR:
            corners.append((before[-1] + after[0]) / 2)
            continue
        met = shapely.intersection(shapely.LineString(_longer(before, far)), shapely.LineString(_longer(after, far)))
        points = np.array([p.coords[0] for p in getattr(met, "geoms", [met]) if not p.is_empty]).reshape(-1, 2)
        if not len(points):
            raise InputError("has two edges whose seam lines do not meet: give edges that go on smoothly one allowance")
        corners.append(points[np.linalg.norm(points - edge[0], axis=1).argmin()])
    found = []
    for line, start, end in zip(moved, corners, [*corners[1:], corners[0]], strict=True):
        whole = shapely.LineString(_longer(line, far))
        a, b = (whole.project(shapely.Point(point)) for point in (start, end))
        if not a < b:
            raise InputError("is too small for its seam allowance")
        found.append(np.asarray(shapely.ops.substring(whole, a, b).coords))
    if not shapely.Polygon(np.concatenate([edge[:-1] for edge in found])).is_valid or area(found) <= 0.0:
        raise InputError("is too small for its seam allowance")
    return found


def unfolded(edges: dict[str, Array], fold: str) -> dict[str, Array]:
    """The whole of a piece that is drawn as half, with a straight edge as the line that it is mirrored at.

    Edges that end at the fold go on across it; the others' images are called "name-mirrored". Raises InputError.
    """
    names = list(edges)
    k = names.index(fold)
    names = names[k + 1 :] + names[:k]
    a, b = edges[fold][0], edges[fold][-1]
    if np.abs(_off(edges[fold], a, b)).max() > NEAR:
        raise InputError(f"has the edge {fold!r} as its mirror line, which is not straight")
    if len(names) < 2:
        raise InputError("has one edge besides its mirror line: split it at a turn point")

    def image(x: Array) -> Array:
        return mirrored(x, a, b)[::-1]

    first, last = names[0], names[-1]
    whole = {first: np.concatenate([image(edges[first])[:-1], edges[first]])}
    whole |= {name: edges[name] for name in names[1:-1]}
    whole[last] = np.concatenate([edges[last], image(edges[last])[1:]])
    return whole | {f"{name}-mirrored": image(edges[name]) for name in names[-2:0:-1]}


def mirrored(x: Array, a: Array, b: Array) -> Array:
    """Points (n, 2) on the other side of the line through a and b."""
    ahead = (b - a) / np.linalg.norm(b - a)
    return np.asarray(2 * (a + np.outer((x - a) @ ahead, ahead)) - x)


def on_line(edges: dict[str, Array], line: Array) -> list[str]:
    """Edges that lie on a straight line through two points."""
    return [name for name, x in edges.items() if np.abs(_off(x, line[0], line[-1])).max() < NEAR]


def _off(x: Array, a: Array, b: Array) -> Array:
    """Distances from the line through a and b, to the left of it."""
    ahead = (b - a) / np.linalg.norm(b - a)
    return np.asarray((x - a) @ np.array([-ahead[1], ahead[0]]))


def _longer(line: Array, by: float) -> Array:
    start, end = line[0] - line[1], line[-1] - line[-2]
    ends = line[0] + by * start / np.linalg.norm(start), line[-1] + by * end / np.linalg.norm(end)
    return np.concatenate([ends[0][None], line, ends[1][None]])


def _shapely() -> Any:
    try:
        import shapely
        import shapely.ops
    except ImportError as error:
        raise InputError(MISSING) from error
    return shapely
