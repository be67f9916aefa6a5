"""Contact of nodes with planes, in closed form.

Between flat things the node of a sheet that is nearest tells all. A node with the area A is pressed by A p(g), g being
its distance less the offset, with the barrier of Li et al. (2020) over the reach r, y = g/r:

    p = k B(y),    B = -b'(y)/1.193..., which is 1 at y = 1/2,    b = -(y - 1)^2 ln y.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse
from scipy.optimize import brentq

from ..laws import Array
from .bodies import Plane
from .coefficients import Coefficients

HALF = np.log(2.0) + 0.5


def coulomb(slid: Array, length: float, static: Array | float, kinetic: Array | float) -> tuple[Array, Array]:
    """Coefficient of friction over the way that was slid, and its derivative by half the square of that way.

    It grows as 2 y - y^2 over the `length`, the coefficient itself going smoothly from static to kinetic.
    """
    y = slid / length
    sliding = y >= 1.0
    step = np.where(y < 0.5, 2 * y**2, 1 - 2 * (1 - y) ** 2)
    mu, rise = (
        static + (kinetic - static) * step,
        (kinetic - static) * np.where(y < 0.5, 4.0, 4 / np.maximum(y, 0.5) - 4),
    )
    h = np.where(sliding, kinetic / np.where(sliding, slid, 1.0), mu * (2 - y) / length)
    bend = (rise * (2 - y) - mu / np.where(sliding, 1.0, np.maximum(y, 1e-12))) / length**3
    return h, np.where(sliding, -kinetic / np.where(sliding, slid, 1.0) ** 3, bend)


def start_of_slip(static: float, kinetic: float) -> float:
    """The coefficient from which `coulomb` starts so that its peak is the static one.

    Growing and falling overlap, so that a start at the static coefficient itself would peak below it, or not at all.
    Raises ValueError for a static coefficient below the kinetic one.
    """
    if static == kinetic:
        return kinetic
    y = np.linspace(1e-3, 1.0, 2000)

    def peak(start: float) -> float:
        return float(np.max(coulomb(y, 1.0, start, kinetic)[0] * y))

    return float(brentq(lambda start: peak(start) - static, kinetic, 4 * static, xtol=1e-12))


class Planes:
    """What planes do to nodes (n, 3); places of planes are told by their shifts (m, 3), m.

    areas: of the nodes, m2; offset, reach: m; stiffness: Pa.
    """

    def __init__(self, planes: Sequence[Plane], areas: Array, offset: float, reach: float, stiffness: float) -> None:
        self._planes, self._areas = list(planes), areas
        self._offset, self._reach, self._stiffness = offset, reach, stiffness

    def gaps(self, x: Array, shifts: Array) -> Array:
        """Of all nodes from all planes, (m, n)."""
        gaps = [(x - plane.point - shift) @ plane.normal for plane, shift in zip(self._planes, shifts, strict=True)]
        return np.reshape(gaps, (-1, len(x))) - self._offset

    def _near(self, k: int, x: Array, shift: Array) -> tuple[np.ndarray, Array, Array, Array]:
        """Nodes within reach of a plane; their energies, normal forces, and the derivatives of these by the gap."""
        plane = self._planes[k]
        gap = (x - plane.point - shift) @ plane.normal - self._offset
        near = np.flatnonzero(gap < self._reach)
        y, scale = gap[near] / self._reach, self._stiffness * self._areas[near] / HALF
        with np.errstate(invalid="ignore", divide="ignore"):
            log, z = np.log(y), y - 1.0
            energy = -scale * self._reach * z**2 * log
            force = scale * (2 * z * log + z**2 / y)
            slope = scale / self._reach * (2 * log + 4 * z / y - (z / y) ** 2)
        return near, energy, force, slope

    def energy(self, x: Array, shifts: Array) -> float:
        """J."""
        return float(sum(self._near(k, x, shift)[1].sum() for k, shift in enumerate(shifts)))

    def forces(self, k: int, x: Array, shift: Array) -> Array:
        """Derivative of the energy with one plane by all nodes (n, 3), N."""
        near, _, force, _ = self._near(k, x, shift)
        result = np.zeros_like(x)
        result[near] = -force[:, None] * self._planes[k].normal
        return result

    def matrix(self, x: Array, shifts: Array, size: int) -> scipy.sparse.csr_array:
        """Second derivative of the energy (size, size), N/m; it begins with the nodes."""
        found = []
        for k, shift in enumerate(shifts):
            near, _, _, slope = self._near(k, x, shift)
            n = self._planes[k].normal
            found.append((near, -slope[:, None, None] * np.outer(n, n)))
        return blocks(found, size)

    def friction(
        self, k: int, x: Array, x0: Array, shifts: tuple[Array, Array], length: float, coefficients: Coefficients
    ) -> tuple[np.ndarray, Array, Array]:
        """Of one plane: nodes, forces (i, 3) that count as those of a residual, and their derivatives (i, 3, 3).

        shifts: now, and at the last commit. length: see `coulomb`.
        """
        n = self._planes[k].normal
        near, _, force, slope = self._near(k, x, shifts[0])
        slid = x[near] - x0[near] - (shifts[0] - shifts[1])
        slid -= np.outer(slid @ n, n)
        way, (mu, rise) = np.linalg.norm(slid, axis=1), coefficients.along(near, slid, x)
        h, bend = coulomb(way, length, *mu)
        flat = np.eye(3) - np.outer(n, n)
        change = (slope * h)[:, None, None] * slid[:, :, None] * n
        change += force[:, None, None] * (
            h[:, None, None] * flat + bend[:, None, None] * slid[:, :, None] * slid[:, None, :]
        )
        if not coefficients.uniform:
            each = np.stack([coulomb(way, length, 1.0, 0.0)[0], coulomb(way, length, 0.0, 1.0)[0]])
            turned = np.einsum("si,sic->ic", force * each, rise) @ flat
            change += slid[:, :, None] * turned[:, None, :]
        return near, (force * h)[:, None] * slid, change

    def free_part(self, x0: Array, x1: Array, shifts: Array, way: Array) -> float:
        """As `Collisions.free_part`."""
        gap = self.gaps(x0, shifts)
        closing = gap - self.gaps(x1, shifts + way)
        near = closing > 0.9 * gap
        return float((0.9 * gap[near] / closing[near]).min(initial=1.0))


def blocks(found: Sequence[tuple[np.ndarray, Array]], size: int) -> scipy.sparse.csr_array:
    """A matrix of the 3 x 3 blocks of nodes, which may come several times."""
    nodes = np.concatenate([np.empty(0, dtype=np.int64), *(nodes for nodes, _ in found)])
    values = np.concatenate([np.empty((0, 3, 3)), *(block for _, block in found)])
    rows, columns = (np.arange(3)[None, :, None], np.arange(3)[None, None, :])
    rows, columns = (np.broadcast_to(3 * nodes[:, None, None] + part, values.shape) for part in (rows, columns))
    return scipy.sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
