"""Unit vectors that turn by two angles each: d = cos|t| d0 + sin|t|/|t| t, t = theta_1 e1 + theta_2 e2 (5.43)-(5.46).

frame: (n, 3, 3), rows e1, e2, d0 orthonormal; theta: (n, 2), less than half a turn.
"""

import numpy as np

from ..laws import Array


def unit(vectors: Array) -> Array:
    """Vectors (n, 3) of length 1."""
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def frames(d: Array) -> Array:
    """An orthonormal (e1, e2, d) for each unit vector, e1 across the axis that d is farthest from."""
    e1 = unit(np.cross(np.eye(3)[np.abs(d).argmin(axis=1)], d))
    return np.stack([e1, np.cross(d, e1), d], axis=1)


def _series(angle: Array) -> tuple[Array, Array, Array, Array]:
    """cos, sin(x)/x, k = (cos - sin/x)/x^2 and (dk/dx)/x, by series where x is small."""
    c, s = np.cos(angle), np.sinc(angle / np.pi)
    square = angle * angle
    small = angle < 1e-2
    safe = np.where(small, 1.0, square)
    k = np.where(small, -1 / 3 + square / 30 - square**2 / 840, (c - s) / safe)
    slope = np.where(small, 1 / 15 - square / 210, (-s - 3 * k) / safe)
    return c, s, k, slope


def turned(frame: Array, theta: Array) -> tuple[Array, Array]:
    """Directors (n, 3) and their derivatives by the two angles (n, 2, 3)."""
    c, s, k, _ = _series(np.linalg.norm(theta, axis=1))
    e, d0 = frame[:, :2], frame[:, 2]
    t = np.einsum("na,naj->nj", theta, e)
    d = c[:, None] * d0 + s[:, None] * t
    along = -s[:, None] * d0 + k[:, None] * t
    return d, s[:, None, None] * e + theta[:, :, None] * along[:, None, :]


def second(frame: Array, theta: Array, r: Array) -> Array:
    """r . d2d/dtheta_a dtheta_b, shape (n, 2, 2)."""
    _, s, k, slope = _series(np.linalg.norm(theta, axis=1))
    on_e, on_d = np.einsum("naj,nj->na", frame[:, :2], r), np.einsum("nj,nj->n", frame[:, 2], r)
    on_t = (theta * on_e).sum(axis=1)
    square = theta[:, :, None] * theta[:, None, :]
    mixed = theta[:, :, None] * on_e[:, None, :]
    result = (k * on_t - s * on_d)[:, None, None] * np.eye(2)
    result += (slope * on_t - k * on_d)[:, None, None] * square
    return result + k[:, None, None] * (mixed + mixed.transpose(0, 2, 1))


def carried(frame: Array, d: Array) -> Array:
    """Frames carried along the shortest turn from their d0 to d."""
    e1, d0, d = frame[:, 0], frame[:, 2], unit(d)
    # e1 - (e1.d) / (1 + d0.d) (d0 + d) is the image of e1 under that turn
    part = (e1 * d).sum(axis=1) / np.maximum(1 + (d0 * d).sum(axis=1), 1e-14)  # half a turn has no shortest way
    e1 = e1 - part[:, None] * (d0 + d)
    e1 = unit(e1 - (e1 * d).sum(axis=1)[:, None] * d)
    return np.stack([e1, np.cross(d, e1), d], axis=1)
