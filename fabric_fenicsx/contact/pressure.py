"""How hard surfaces press on each other, as a pressure at their corners."""

import numpy as np

from ..laws import Array
from .collisions import Collisions


def pressures(near: Collisions) -> Array:
    """Of all corners of a sheet and of bodies, in the order of `Collisions.x`, Pa; without friction.

    It is the size of the forces on a corner, of all pairs, over the area that belongs to it now. What presses from both
    sides, as in a stack, counts once: by the side that is pressed harder. That of a body with triangles much larger
    than what touches them is a mean over these triangles; of one in closed form, that of the nearest point of the
    sheet. Planes have none.
    """
    x, faces = near.met, near.surface
    across = np.cross(x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]])
    normals = np.zeros_like(x)
    np.add.at(normals, faces, across[:, None])
    area = np.bincount(faces.ravel(), np.repeat(np.linalg.norm(across, axis=1) / 6, 3), minlength=len(x))
    sides = np.zeros((2, len(x)))
    for nodes, force, sign in [*near.pushes(), *_of_gaps(near)]:
        side = (np.einsum("ij,ij->i", sign * force, normals[nodes]) > 0.0).astype(int)
        np.add.at(sides, (side, nodes), sign * np.linalg.norm(force, axis=1))
    bodies = near.corners[len(near.corners) - near.shaped :]
    return np.concatenate(
        [sides.max(axis=0) / area, *(near.gaps.pressure(k, near.x[part]) for k, part in enumerate(bodies))]
    )


def _of_gaps(near: Collisions) -> list[tuple[np.ndarray, Array, float]]:
    every = zip(near.gaps.near, near.gaps.forces(), strict=True)
    found = []
    for one, force in every:
        if len(force):
            found.append((np.arange(near.count), np.zeros((near.count, 3)), 1.0))
            one.spread(force, found[-1][1])
    return found
