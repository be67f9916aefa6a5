"""Closed skins as zeros of a depth, a function of the place that is positive above the skin; smooth unions of parts.

A depth is about the distance near the skin, m; places are rows of three numbers, m.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..laws import Array

type Depth = Callable[[Array], Array]


def cone(x: Array, ends: tuple[Sequence[float], Sequence[float]], radii: tuple[float, float]) -> Array:
    """Depth of places x (n, 3) above a cone between two points with round ends."""
    a, b = (np.array(end, dtype=float) for end in ends)
    part = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(x - a - part[:, None] * (b - a), axis=1) - radii[0] - (radii[1] - radii[0]) * part


def column(x: Array, heights: Sequence[float], halves: Sequence[tuple[float, float]]) -> Array:
    """Depth of places x (n, 3) above a column along z with elliptic sections, its ends round.

    halves: of width and depth at each of the heights; between them they have no steps and at them no slope.
    """
    z = np.clip(x[:, 2], heights[0], heights[-1])
    still = [0.0] * len(heights)
    across = [CubicHermiteSpline(heights, sizes, still)(z) for sizes in zip(*halves, strict=True)]
    own = np.stack([x[:, 0], x[:, 1], x[:, 2] - z], axis=1)
    by = np.stack([across[0], across[1], across[1]], axis=1)
    size, steep = np.linalg.norm(own / by, axis=1), np.linalg.norm(own / by**2, axis=1)
    return np.asarray(size * (size - 1) / np.maximum(steep, 1e-9))


def union(depths: Sequence[Array], fillet: float) -> Array:
    """Smooth union of parts, rounded over so many m where two of them meet."""
    first, *others = depths
    for other in others:
        share = np.maximum(fillet - np.abs(first - other), 0.0) / fillet
        first = np.minimum(first, other) - fillet / 6 * share**3
    return np.asarray(first)


def onto(depth: Depth, x: Array, most: float) -> Array:
    """The same places (n, 3), moved onto the skin along its gradient, in steps of so many m at most."""
    step = 1e-5 * np.eye(3)
    for _ in range(12):
        slope = np.stack([depth(x + e) - depth(x - e) for e in step], axis=1) / 2e-5
        away = depth(x)[:, None] * slope / np.maximum(np.sum(slope**2, axis=1, keepdims=True), 0.1)
        x = x - np.clip(away, -most, most)
    return x


def surface(depth: Depth, low: Sequence[float], high: Sequence[float], size: float) -> tuple[Array, np.ndarray]:
    """Corners (n, 3) and triangles (m, 3), each about as large as `size`, of the skin in a box from low to high."""
    import pyvista

    counts = [int(np.ceil((b - a) / size)) + 1 for a, b in zip(low, high, strict=True)]
    grid = pyvista.ImageData(dimensions=counts, spacing=[size] * 3, origin=tuple(low))
    skin = grid.contour([0.0], scalars=depth(np.asarray(grid.points))).clean()
    skin = skin.smooth(n_iter=60, relaxation_factor=0.1)
    faces = skin.regular_faces.astype(np.int32)
    x = onto(depth, np.asarray(skin.points, dtype=float), size)
    a, b, c = x[faces].transpose(1, 0, 2)
    return x, faces if np.sum(a * np.cross(b, c)) > 0.0 else faces[:, ::-1]
