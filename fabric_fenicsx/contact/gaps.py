"""Contact of the points of a sheet with bodies in closed form; see `shapes`.

A point with the area A is pressed by A p(g), g being its distance less the offset, with the barrier of Huang et al.
(2024) over the reach r, y = g/r:

    p = k B(y),    B = -b'(y)/1.173..., which is 1 at y = 1/2,    b = (y - 1)^2 ln(y)^2.

It begins more smoothly than that of Li et al. (2020), -(y - 1)^2 ln y, and lets soft contact come less near.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse
from scipy.spatial import cKDTree

from ..laws import Array
from . import kernels
from .bodies import Body, Plane
from .coefficients import Coefficients, coulomb, stored
from .points import Grid
from .shapes import Pose, Shape

HALF = np.log(2.0) * (1.0 + np.log(2.0))


def response(y: Any) -> tuple[Any, Any, Any]:
    """Of a gap as a part y of the reach: energy over k r, p/k, and its derivative by y."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log, z = np.log(y), y - 1.0
        energy, force = (z * log) ** 2, -2 * z * log * (log + z / y)
        return energy / HALF, force / HALF, -2 * (log**2 + 4 * z * log / y + (z / y) ** 2 * (1.0 - log)) / HALF


@dataclass
class Near:
    """What a body presses on, (k,) points of a grid: see `Gaps`."""

    shape: Shape
    pose: Pose
    grid: Grid
    points: np.ndarray
    x: Array
    gaps: Array
    normals: Array
    reach: float
    stiffness: float

    def at(self, x: Array) -> Array:
        """What values x (nodes, 3) are at these points (k, 3)."""
        return np.asarray(kernels.between(self.grid.nodes, self.grid.shares, self.points, x))

    def spread(self, forces: Array, total: Array) -> None:
        """Add forces on these points (k, 3) to those on nodes."""
        kernels.spread(forces, self.grid.nodes, self.grid.shares, self.points, total)

    @cached_property
    def curvature(self) -> Array:
        """Second derivatives of the gaps (k, 3, 3)."""
        return np.asarray(self.shape.distances(self.x, self.pose, True)[2])

    @cached_property
    def _responses(self) -> tuple[Array, Array, Array]:
        energy, force, slope = response(self.gaps / self.reach)
        scale = self.stiffness * self.grid.areas[self.points]
        return scale * self.reach * energy, scale * force, scale / self.reach * slope

    def energy(self) -> float:
        """J."""
        return float(self._responses[0].sum())

    @property
    def force(self) -> Array:
        """Of each point, N, and none below zero."""
        return self._responses[1]

    @property
    def slope(self) -> Array:
        """Its derivative by the gap, N/m."""
        return self._responses[2]

    def hessian(self) -> Array:
        """Of the energy by each point (k, 3, 3), N/m."""
        n = self.normals
        along = -self.slope[:, None, None] * n[:, :, None] * n[:, None, :]
        return np.asarray(along - self.force[:, None, None] * self.curvature)

    def blocks(self, values: Array, size: int) -> scipy.sparse.coo_array:
        """Derivatives (k, 3, 3) of forces by points, as those by nodes, of all corners (size, size)."""
        nodes, shares = self.grid.nodes[self.points], self.grid.shares[self.points]
        p, i, j = np.nonzero(shares[:, :, None] * shares[:, None, :])
        entries = (shares[p, i] * shares[p, j])[:, None, None] * values[p]
        axis = np.arange(3)
        rows = np.broadcast_to(3 * nodes[p, i][:, None, None] + axis[:, None], entries.shape)
        columns = np.broadcast_to(3 * nodes[p, j][:, None, None] + axis, entries.shape)
        return scipy.sparse.coo_array((entries.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))

    def friction(
        self, x0: Array, way: Array | None, length: float, coefficients: Coefficients, x: Array, tangent: bool
    ) -> tuple[Array, Array]:
        """On points (k, 3), as of a residual, and their derivatives (k, 3, 3), none without `tangent`.

        x0: the nodes at the last commit; way: of the body's corners since then, or None; length: see `coulomb`; x:
        the nodes.
        """
        force, (grid, pose) = self.force, (self.grid, self.pose)
        mean, by_x = self.shape.led(pose, way)
        own = grid.nodes, grid.shares, self.points, self.x, self.normals, x0, pose[0], mean, by_x
        if coefficients.uniform and not tangent:
            most, least = coefficients.static[0], coefficients.kinetic[0]
            return kernels.rubbed(force, most, least, length, *own), np.empty((0, 3, 3))
        slid, along = kernels.slid(*own)
        size, main = np.sqrt(np.einsum("ki,ki->k", along, along)), grid.nodes[self.points, 0]
        mu, rise = coefficients.along(main, along, x)
        h, bend = coulomb(size, length, *mu)
        if not tangent:
            return (force * h)[:, None] * along, np.empty((0, 3, 3))
        change = kernels.rub(force, self.slope, h, bend, self.normals, self.curvature, slid, along, by_x)
        if not coefficients.uniform:
            each = np.stack([coulomb(size, length, 1.0, 0.0)[0], coulomb(size, length, 0.0, 1.0)[0]])
            flat = np.eye(3) - self.normals[:, :, None] * self.normals[:, None, :]
            turned = np.einsum("sk,skc,kcd->kd", force * each, rise, flat)
            change += along[:, :, None] * turned[:, None, :]
        return (force * h)[:, None] * along, change

    def lagged(self, x: Array, way: Array, length: float, mu: Sequence[float]) -> tuple[float, Array, Array]:
        """Friction at the present pressure along the present surface, once nodes are at x and corners went their way.

        mu: static, kinetic. Its potential (J), forces on points (k, 3), and their derivatives (k, 3, 3).
        """
        flat = np.eye(3) - self.normals[:, :, None] * self.normals[:, None, :]
        slid = np.einsum("kij,kj->ki", flat, self.at(x) - self.x - self.shape.carried(self.x, self.pose, way))
        size = np.linalg.norm(slid, axis=1)
        h, bend = coulomb(size, length, *mu)
        change = h[:, None, None] * flat + bend[:, None, None] * slid[:, :, None] * slid[:, None, :]
        force = self.force
        return float(force @ stored(size, length, *mu)), (force * h)[:, None] * slid, force[:, None, None] * change


class Gaps:
    """Between the points of a sheet and some bodies, whose corners are parts of all places x.

    Public: `near`, for each body, what it presses on where `place` has put all.

    Args:
        bodies, corners: and their part of x; counts: see `parts`.
        rest, faces: of the sheet.
        offset, reach: m; stiffness: Pa.
    """

    def __init__(
        self, bodies: Sequence[Body], corners: Sequence[slice], counts: Sequence[int], rest: Array, faces: np.ndarray,
        offset: float, reach: float, stiffness: float,
    ) -> None:  # fmt: skip
        self._shapes, self._corners, self._count = [Shape(body) for body in bodies], list(corners), len(rest)
        grids = {n: Grid(rest, faces, n) for n in set(counts)}
        self._grids = [grids[n] for n in counts]
        self._offset, self._reach, self._stiffness = offset, reach, stiffness
        self._about: list[tuple[Array, Array, np.ndarray] | None] = [None] * len(counts)
        self.near: list[Near] = []

    def _slack(self, k: int) -> float:
        """How far points may go before those are looked for again that may be within reach, m."""
        return max(2 * self._reach, 0.1 * self._grids[k].edge)

    def _candidates(self, k: int, x: Array, pose: Pose) -> np.ndarray:
        """Points that may be within reach, or get there on a way as long as the slack."""
        about, slack, nodes, corners = self._about[k], self._slack(k), x[: self._count], x[self._corners[k]]
        if about is None or kernels.most(nodes - about[0]) + kernels.most(corners - about[1]) > slack:
            grid = self._grids[k]
            every = np.arange(len(grid.areas))
            points = self._looked(k, nodes, pose, every, self._offset + self._reach + 2 * slack)[0]
            about = self._about[k] = nodes, corners, points
        return about[2]

    def place(self, x: Array) -> None:
        """Take all places x for the present ones."""
        self.near = self.look(x)

    def look(self, x: Array) -> list[Near]:
        """For each body, what it presses on at all places x."""
        return [self._near(k, x) for k in range(len(self._shapes))]

    def _looked(self, k: int, nodes: Array, pose: Pose, points: np.ndarray, least: float) -> tuple[Array, ...]:
        shape, grid = self._shapes[k], self._grids[k]
        return tuple(kernels.look(shape.key, pose[0], pose[2], grid.nodes, grid.shares, points, nodes, least))

    def _near(self, k: int, x: Array) -> Near:
        pose = self._shapes[k].pose(x[self._corners[k]])
        points = self._candidates(k, x, pose)
        found, places, far, normals = self._looked(k, x[: self._count], pose, points, self._offset + self._reach)
        own = found, places, far - self._offset, normals
        return Near(self._shapes[k], pose, self._grids[k], *own, self._reach, self._stiffness)

    def least(self) -> float:
        """Least gap, m; infinite where nothing is within reach."""
        return float(min((near.gaps.min(initial=np.inf) for near in self.near), default=np.inf))

    def energy(self) -> float:
        """J."""
        return float(sum(near.energy() for near in self.near))

    def add(self, forces: Sequence[Array], total: Array, at: Sequence[Near] | None = None) -> None:
        """Add forces on the points of each body (k, 3), now or `at` another time, to those of all corners."""
        for near, corners, force in zip(self.near if at is None else at, self._corners, forces, strict=True):
            if len(force):
                near.spread(force, total)
                total[corners] -= near.shape.spread(near.x, force, near.pose)

    def forces(self) -> list[Array]:
        """Derivative of the energy by the points of each body, N."""
        return [-near.force[:, None] * near.normals for near in self.near]

    def fastest(self, masses: Array) -> float:
        """The largest stiffness over the mass of a node, 1/s2."""
        fastest = 0.0
        for near in self.near:
            if len(near.points):
                own = near.grid.nodes, near.grid.shares, near.points, masses
                fastest = max(fastest, float(kernels.fastest(-near.slope, *own)))
        return fastest

    def friction(
        self, x: Array, x0: Array, length: float, coefficients: Coefficients, tangent: bool, still: bool = False
    ) -> list[tuple[Array, Array]]:
        """Of each body, see `Near.friction`; x, x0: all places now and at the last commit; still: of all bodies."""
        n = self._count
        return [
            near.friction(x0[:n], None if still else x[part] - x0[part], length, coefficients, x[:n], tangent)
            for near, part in zip(self.near, self._corners, strict=True)
        ]

    def lagged(
        self, start: Sequence[Near], x: Array, x0: Array, length: float, mu: Sequence[float]
    ) -> list[tuple[float, Array, Array]]:
        """Of each body, see `Near.lagged`; start: what was near at x0."""
        n, every = self._count, zip(start, self._corners, strict=True)
        return [near.lagged(x[:n], x[part] - x0[part], length, mu) for near, part in every]

    def free_part(self, x0: Array, x1: Array) -> float:
        """The part of the straight way from x0 to x1, up to 1, at whose end no gap is less than a tenth of its start.

        A distance from what is convex is a convex function along a straight way: Newton's method comes from below.
        """
        part = 1.0
        for k, (shape, corners) in enumerate(zip(self._shapes, self._corners, strict=True)):
            a, b = x0[: self._count], x1[: self._count]
            poses, grid = (shape.pose(x0[corners]), shape.pose(x1[corners])), self._grids[k]
            moved = kernels.most(b - a) + kernels.most(x1[corners] - x0[corners])
            points = self._candidates(k, x0, poses[0])
            if moved > self._reach + self._slack(k):
                points = np.arange(len(grid.areas))
            frames = [(pose[0], pose[2]) for pose in poses]
            own = grid.nodes, grid.shares, points
            free, gap, size = kernels.free_part(shape.key, frames[0], frames[1], *own, a, b, self._offset, moved)
            turn = float(np.linalg.norm(poses[1][2] - poses[0][2]))
            if turn > 1e-12 and gap < moved:  # ways are not straight in the frame of what turns
                free = min(free, 0.5 * np.sqrt(max(gap, 0.0) / size) / turn)
            part = min(part, free)
        return float(part)

    def crossed(self) -> bool:
        """Whether any point is in a body."""
        return any(bool((near.gaps <= -self._offset).any()) for near in self.near)

    def pressure(self, k: int, corners: Array) -> Array:
        """Of a body at its corners (n, 3), that of the nearest point of the sheet, Pa."""
        near, found = self.near[k], np.zeros(len(corners))
        if isinstance(near.shape.body, Plane):
            return np.full(len(corners), np.nan)
        if len(near.points):
            far, which = cKDTree(near.x).query(
                corners, distance_upper_bound=near.grid.apart + self._reach + self._offset
            )
            here = np.isfinite(far)
            found[here] = (near.force / near.grid.areas[near.points])[which[here]]
        return found
