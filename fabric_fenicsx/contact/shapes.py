"""Bodies without triangles: how far places are from planes, spheres, capsules, cylinders and boxes, in closed form.

Each is what is within a `radius` of a convex core: the middle of a sphere, the axis of a capsule, all of a cylinder or
a box. With y the nearest place of the core, the distance of x is |x - y| less the radius, its gradient the unit vector
n along x - y, and its second derivative (I - dy/dx - n n)/|x - y|.
"""

from typing import Any

import numpy as np

from ..laws import Array
from . import kernels
from .bodies import Body, Box, Capsule, Cylinder, Plane, Sphere

type Pose = tuple[Array, Array, Array]
"""Middle, how it has turned since it was made, a matrix, and the axes of its shape, rows, which do not spin with it."""


class Shape:
    """How far places are from a body, which moves as its corners (n, 3) do.

    Public: `body`; `curved`, its least radius of curvature, m: infinite of a plane, 0 of what has sharp edges; `key`,
    as `kernels` take it.
    """

    def __init__(self, body: Body) -> None:
        self.body, self._frame, self.radius = body, np.eye(3), 0.0
        self._arms = body.rest - body.rest.mean(axis=0)
        self._inverse = np.ascontiguousarray(np.linalg.pinv(self._arms))
        self._last: tuple[Array, Pose] | None = None
        kind, size = kernels.BALL, np.zeros(3)
        match body:
            case Plane():
                kind, self.curved, size = kernels.PLANE, np.inf, body.normal
            case Sphere():
                self.curved = self.radius = body.radius
            case Cylinder():
                kind, self._frame, size = kernels.ROUND, body.frame, np.array([body.radius, 0.0, body.length / 2])
                self.curved = self.radius = body.radius if isinstance(body, Capsule) else 0.0
            case Box():
                kind, self._frame, size, self.curved = kernels.BOX, body.frame, np.array(body.size) / 2, 0.0
        self.key = kind, size, float(self.radius)

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

    def distances(self, x: Array, pose: Pose, curvature: bool = False) -> tuple[Array, Array, Any]:
        """Of places (k, 3): distances, their gradients (k, 3), and their second derivatives (k, 3, 3) if asked for.

        Within the core the distance is 0, and within a radius of it negative.
        """
        x, frame = np.ascontiguousarray(x), (pose[0], pose[2])
        size, normals = kernels.distances(self.key, *frame, x)
        return size, normals, kernels.curvatures(self.key, *frame, x) if curvature else None

    def spread(self, x: Array, forces: Array, pose: Pose) -> Array:
        """Forces (k, 3) at places (k, 3) that move with the body, on its corners (n, 3): with the same moment."""
        return np.asarray(kernels.shared_out(x, forces, pose[0], pose[1], self._inverse))

    def led(self, pose: Pose, way: Array | None) -> tuple[Array, Array]:
        """How its corners' way (n, 3), or none, leads all that moves with it: by mean + (place - middle) @ a matrix."""
        if way is None:
            return np.zeros(3), np.zeros((3, 3))
        mean = way.mean(axis=0)
        return mean, pose[1] @ self._inverse @ (way - mean)

    def carried(self, x: Array, pose: Pose, way: Array) -> Array:
        """How far places (k, 3) go that move with its corners on their way (n, 3)."""
        mean, by_x = self.led(pose, way)
        return np.asarray(mean + (x - pose[0]) @ by_x)
