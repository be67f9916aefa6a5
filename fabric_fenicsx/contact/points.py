"""Points of a sheet that touch bodies in closed form: its nodes, and some between them.

There are so many that a triangle does not dip into a curved body by more than three quarters of the offset. Between
them triangles dip into sharp edges, by half their distance at most.
"""

import numpy as np

from ..laws import Array
from .bodies import Body, Box, Capsule, Cylinder, Plane, Sphere
from .triangles import areas, edges

MOST, SHARP = 16, 8
"""Parts of an edge between points: at most, and where a body has sharp edges."""


def parts(body: Body, edge: float, offset: float) -> int:
    """Of the longest edge (m) of a sheet, between its points; 0 if a body has no closed form, or needs too many."""
    if body.mass is not None or not isinstance(body, Plane | Sphere | Cylinder | Box):
        return 0
    if isinstance(body, Plane):
        return 1
    if not isinstance(body, Sphere | Capsule):
        return SHARP
    count = int(np.ceil(edge / np.sqrt(6 * offset * body.radius)))
    return count if count <= MOST else 0


class Grid:
    """The points of a sheet, n to an edge of its triangles.

    Public: `nodes` (k, 3) and their `shares` (k, 3) of each point, the largest first; `areas` (k,), m2; `apart`,
    the most between two of them at rest, m.
    """

    def __init__(self, rest: Array, faces: np.ndarray, n: int) -> None:
        i, j = (part.ravel() for part in np.meshgrid(range(n + 1), range(n + 1), indexing="ij"))
        i, j = i[i + j <= n], j[i + j <= n]
        inner = np.stack([n - i - j, i, j], axis=1)
        number = {tuple(point): k for k, point in enumerate(inner)}
        small = [[(a, b, c), (a - 1, b + 1, c), (a - 1, b, c + 1)] for a, b, c in inner if a > 0]
        small += [[(a, b, c), (a - 1, b + 1, c), (a, b + 1, c - 1)] for a, b, c in inner if a > 0 and c > 0]
        weights = np.bincount([number[point] for triangle in small for point in triangle], minlength=len(inner))
        third = areas(rest, faces) / 3 / n**2
        # the same point of two triangles is one: nodes and shares tell, none of a node without a share
        shares = np.tile(inner, (len(faces), 1))
        nodes = np.where(shares > 0, np.repeat(faces, len(inner), axis=0), -1)
        order = np.lexsort((nodes, -shares), axis=1)
        nodes, shares = (np.take_along_axis(part, order, axis=1) for part in (nodes, shares))
        keys, which = np.unique(np.column_stack([nodes, shares]), axis=0, return_inverse=True)
        self.nodes, self.shares = np.maximum(keys[:, :3], 0), keys[:, 3:] / n
        self.areas = np.bincount(which.ravel(), np.outer(third, weights).ravel(), minlength=len(keys))
        self.apart = float(edges(rest, faces).max()) / n
        self.edge = n * self.apart
