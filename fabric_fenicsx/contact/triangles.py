"""Triangles: of simple bodies, their areas and edges."""

import numpy as np

from ..laws import Array


def areas(x: Array, faces: np.ndarray) -> Array:
    """Of triangles (m, 3) of corners (n, 3) in m: (m,), m2."""
    a, b, c = x[faces].transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def areas_of_corners(x: Array, faces: np.ndarray) -> Array:
    """Area that belongs to each corner, m2: a third of the triangles around it."""
    return np.bincount(faces.ravel(), np.repeat(areas(x, faces) / 3, 3), minlength=len(x))


def edges(x: Array, faces: np.ndarray) -> Array:
    """Lengths of the edges of triangles, (m, 3) in m."""
    return np.asarray(np.linalg.norm(x[faces] - x[np.roll(faces, 1, axis=1)], axis=2))


def cube(cells: int) -> tuple[Array, np.ndarray]:
    """Corners of the cube from -1 to 1 whose sides are of cells x cells squares, and its triangles, outward."""
    n = cells + 1
    s, t = (a.ravel() for a in np.meshgrid(*[np.linspace(-1, 1, n)] * 2, indexing="ij"))
    sides = [np.roll(np.stack([np.full(n * n, side), s, t * side], axis=1), k, axis=1) for side in (-1.0, 1.0)
             for k in range(3)]  # fmt: skip
    faces = np.concatenate([squares(n, n) + k * n * n for k in range(6)])
    return joined(np.concatenate(sides), faces)


def turned(profile: Array, count: int) -> tuple[Array, np.ndarray]:
    """A surface about z of a profile of radii and heights (n, 2), upwards, whose ends are on the axis."""
    angle = 2 * np.pi * np.arange(count + 1) / count
    angle[-1] = 0.0
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    x = np.concatenate([np.column_stack([r * around, np.full(count + 1, z)]) for r, z in profile])
    return joined(x, squares(len(profile), count + 1)[:, ::-1])


def squares(n: int, m: int) -> np.ndarray:
    """Two triangles for each square of a grid of n x m points, numbered row by row: corners (2 (n - 1) (m - 1), 3)."""
    i = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    return np.concatenate([np.stack([i, i + m, i + m + 1], axis=1), np.stack([i, i + m + 1, i + 1], axis=1)])


def joined(x: Array, faces: np.ndarray) -> tuple[Array, np.ndarray]:
    """The same with points that coincide as one, and without the triangles that this makes lines of."""
    size = np.abs(x).max()
    _, first, which = np.unique(np.round(x / size, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    faces = which.ravel()[faces]
    a, b, c = faces.T
    return x[first], faces[(a != b) & (b != c) & (c != a)]
