"""Bodies without triangles: how far places are from planes, spheres, capsules, cylinders and boxes, in closed form.

Each is what is within a `radius` of a convex core: the middle of a sphere, the axis of a capsule, all of a cylinder or
a box. With y the nearest place of the core, the distance of x is |x - y| less the radius, its gradient the unit vector
n along x - y, and its second derivative (I - dy/dx - n n)/|x - y|.
"""

from typing import Any

import numpy as np

from ..laws import Array
from .bodies import Body, Box, Capsule, Cylinder, Plane, Sphere

type Pose = tuple[Array, Array, Array]
"""Middle, how it has turned since it was made, a matrix, and the axes of its shape, rows, which do not spin with it."""


class Shape:
    """How far places are from a body, which moves as its corners (n, 3) do.

    Public: `body`; `curved`, its least radius of curvature, m: infinite of a plane, 0 of what has sharp edges.
    """

    def __init__(self, body: Body) -> None:
        self.body, self._frame, self.radius = body, np.eye(3), 0.0
        self._arms = body.rest - body.rest.mean(axis=0)
        self._inverse = np.linalg.pinv(self._arms)
        self._last: tuple[Array, Pose] | None = None
        match body:
            case Plane():
                self.curved, self._size = np.inf, np.zeros(3)
            case Sphere():
                self.curved = self.radius = body.radius
            case Cylinder():
                self._frame, self._size = body.frame, np.array([body.radius, 0.0, body.length / 2])
                self.curved = self.radius = body.radius if isinstance(body, Capsule) else 0.0
            case Box():
                self._frame, self._size, self.curved = body.frame, np.array(body.size) / 2, 0.0

    def pose(self, corners: Array) -> Pose:
        """Of its corners; of a rigid motion on the way between two poses, the nearest one."""
        if self._last is None or not np.array_equal(corners, self._last[0]):
            self._last = corners.copy(), self._found(corners)
        return self._last[1]

    def _found(self, corners: Array) -> Pose:
        middle = corners.mean(axis=0)
        if isinstance(self.body, Plane):
            return middle, np.eye(3), self._frame
        u, _, v = np.linalg.svd((self._inverse @ (corners - middle)).T)
        turn = u @ v
        if isinstance(self.body, Sphere):
            return middle, turn, self._frame
        if isinstance(self.body, Cylinder):
            a = self._frame[2]
            b = turn @ a
            cross = np.cross(np.eye(3), np.cross(a, b))
            bent = np.eye(3) + cross + cross @ cross / max(1.0 + a @ b, 1e-12)
            return middle, turn, np.asarray(self._frame @ bent.T)
        return middle, turn, np.asarray(self._frame @ turn.T)

    def own(self, x: Array, pose: Pose) -> Array:
        """Places in the body's own frame."""
        return np.asarray((x - pose[0]) @ pose[2].T)

    def distances(self, x: Array, pose: Pose, curvature: bool = False) -> tuple[Array, Array, Any]:
        """Of places (k, 3): distances, their gradients (k, 3), and their second derivatives (k, 3, 3) if asked for.

        Within the core the distance is 0, and within a radius of it negative.
        """
        away, bend = self.away(self.own(x, pose), curvature)
        frame, size = pose[2], away[:, 3]
        if curvature:
            bend = frame.T @ bend @ frame
        return size, away[:, :3] @ frame, bend

    def away(self, y: Array, curvature: bool = False) -> tuple[Array, Any]:
        """As `distances` of places in the own frame: gradient and distance (k, 4), second derivative."""
        if isinstance(self.body, Plane):
            n = self.body.normal
            return np.column_stack([np.tile(n, (len(y), 1)), y @ n]), np.zeros((len(y), 3, 3)) if curvature else None
        core, free = self._core(y, curvature)
        n = y - core
        size = np.sqrt(np.einsum("ki,ki->k", n, n))
        n /= np.maximum(size, 1e-300)[:, None]
        bend = None
        if curvature:
            bend = (free - n[:, :, None] * n[:, None, :]) / np.maximum(size, 1e-300)[:, None, None]
        return np.column_stack([n, size - self.radius]), bend

    def _core(self, y: Array, curvature: bool) -> tuple[Array, Any]:
        """The nearest places of the core in the body's own frame, and I - dy/dx."""
        free = np.zeros((len(y), 3, 3)) if curvature else None
        if isinstance(self.body, Sphere):
            return np.zeros_like(y), np.eye(3)
        core = np.clip(y, -self._size, self._size)
        if isinstance(self.body, Cylinder):
            across = np.sqrt(y[:, 0] ** 2 + y[:, 1] ** 2)
            left = np.zeros(len(y)) if self.radius else np.minimum(1.0, self._size[0] / np.maximum(across, 1e-300))
            core[:, :2] = left[:, None] * y[:, :2]
            if free is not None:
                r = np.where(left < 1.0, 1.0, 0.0)[:, None] * y[:, :2] / np.maximum(across, 1e-300)[:, None]
                free[:, :2, :2] = (1 - left)[:, None, None] * np.eye(2)
                free[:, :2, :2] += left[:, None, None] * r[:, :, None] * r[:, None, :]
                free[:, 2, 2] = np.abs(y[:, 2]) > self._size[2]
        elif free is not None:
            free[:, range(3), range(3)] = np.abs(y) > self._size
        return core, free

    def spread(self, x: Array, forces: Array, pose: Pose) -> Array:
        """Forces (k, 3) at places (k, 3) that move with the body, on its corners (n, 3): with the same moment."""
        even = forces.sum(axis=0) / len(self._arms)
        return np.asarray(even + (pose[1] @ self._inverse).T @ ((x - pose[0]).T @ forces))

    def carried(self, x: Array, pose: Pose, way: Array) -> tuple[Array, Array]:
        """How far places (k, 3) go that move with its corners on their way (n, 3), and the derivative by a place."""
        mean = way.mean(axis=0)
        by_x = pose[1] @ self._inverse @ (way - mean)
        return mean + (x - pose[0]) @ by_x, by_x.T
