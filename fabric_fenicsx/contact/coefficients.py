"""Coefficients of friction, which may differ along warp and weft.

Where a sheet slides at an angle to its yarns, with the parts c and s along warp and weft of its way, they are
sqrt(((mu1 c)^2 + (mu2 s)^2) / (c^2 + s^2)), an ellipse (Erleben, Macklin, Andrews, Kry 2020), and friction is against
the way. Of two sheets that touch each other it is the mean of both.
"""

import numpy as np
import scipy.sparse
from scipy.optimize import brentq

from ..laws import Array
from ..sheet import Sheet
from . import kernels
from .skin import Skin


def coulomb(slid: Array, length: float, static: Array | float, kinetic: Array | float) -> tuple[Array, Array]:
    """Coefficient of friction over the way that was slid, and its derivative by half the square of that way.

    It grows as 2 y - y^2 over the `length`, the coefficient itself going smoothly from static to kinetic.
    """
    way, most, least = np.broadcast_arrays(slid, static, kinetic)
    own = [np.array(part, dtype=float).ravel() for part in (way, most, least)]
    h, bend = kernels.coulomb(own[0], own[1], own[2], length)
    return h.reshape(way.shape), bend.reshape(way.shape)


def stored(slid: Array, length: float, static: float, kinetic: float) -> Array:
    """Work over the way that was slid, over the normal force, m: the integral of `coulomb` times that way."""
    y = slid / length
    at, left = np.minimum(y, 1.0), 1 - np.clip(y, 0.5, 1.0)
    early = np.minimum(y, 0.5)
    step = early**4 - 0.4 * early**5 + (0.3875 - left + left**3 - 0.4 * left**5)
    return np.asarray(length * (static * (at**2 - at**3 / 3) + (kinetic - static) * step + kinetic * (y - at)))


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


class Directions:
    """Warp and weft at the nodes of a sheet, carried along by its triangles."""

    def __init__(self, sheet: Sheet, skin: Skin) -> None:
        cells = sheet.domain.mesh.topology.index_map(2)
        each = len(skin.faces) // cells.size_global
        yarns = np.repeat(sheet.yarns()[: cells.size_local], each, axis=0)
        yarns = np.concatenate(skin.comm.allgather(yarns))
        corners, (m, n) = skin.places()[skin.faces], (len(skin.faces), len(skin.rest))
        parts = yarns @ np.linalg.pinv(corners[:, 1:] - corners[:, :1])  # of two sides of each triangle
        parts = np.concatenate([-parts.sum(axis=2, keepdims=True), parts], axis=2)
        triangles, each_corner = np.repeat(np.arange(m), 3), skin.faces.ravel()
        around = scipy.sparse.csr_array((np.ones(3 * m), (each_corner, triangles)), shape=(n, m))
        self._parts = [
            around @ scipy.sparse.csr_array((parts[:, k].ravel(), (triangles, each_corner)), shape=(m, n))
            for k in (0, 1)
        ]

    def __call__(self, x: Array) -> Array:
        """At places x of the nodes: unit vectors (n, 2, 3)."""
        yarns = np.stack([part @ x for part in self._parts], axis=1)
        return np.asarray(yarns / np.linalg.norm(yarns, axis=2, keepdims=True))


class Coefficients:
    """Static and kinetic coefficients, each along warp and weft; directions: None where these are alike."""

    def __init__(self, static: Array, kinetic: Array, directions: Directions | None) -> None:
        self.static, self.kinetic, self._directions = static, kinetic, directions

    @property
    def uniform(self) -> bool:
        """Whether they are the same along all directions."""
        return self._directions is None

    def along(self, nodes: np.ndarray, slid: Array, x: Array) -> tuple[Array, Array]:
        """Both (2, i) at nodes (i,) of a sheet at the places x, that slid (i, 3), and their derivatives (2, i, 3)."""
        both = np.stack([self.static, self.kinetic])
        if self._directions is None:
            return np.repeat(both[:, :1], len(nodes), axis=1), np.zeros((2, len(nodes), 3))
        yarns = self._directions(x)[nodes]
        way = np.einsum("ikc,ic->ik", yarns, slid)
        size = np.sum(way**2, axis=1)
        still = size < 1e-30
        size[still], way[still] = 1.0, np.sqrt(0.5)
        square = both[:, None, :] ** 2
        mu = np.sqrt(np.sum(square * way**2, axis=2) / size)
        rise = (square - mu[:, :, None] ** 2) * way / (np.maximum(mu, 1e-300) * size)[:, :, None]
        rise[:, still] = 0.0
        return mu, np.einsum("sik,ikc->sic", rise, yarns)
