"""Unit vectors that turn by two angles each: d = cos|t| d0 + sin|t|/|t| t, t = theta_1 e1 + theta_2 e2 (5.43)-(5.46).

frame: (n, 3, 3), rows e1, e2, d0 orthonormal; theta: (n, 2), less than half a turn.
"""

import numba
import numpy as np

from ..laws import Array


def unit(vectors: Array) -> Array:
    """Vectors (n, 3) of length 1."""
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def frames(d: Array) -> Array:
    """An orthonormal (e1, e2, d) for each unit vector, e1 across the axis that d is farthest from."""
    e1 = unit(np.cross(np.eye(3)[np.abs(d).argmin(axis=1)], d))
    return np.stack([e1, np.cross(d, e1), d], axis=1)


@numba.njit(forceinline=True, error_model="numpy")
def _series(theta):
    """cos, sin(x)/x, k = (cos - sin/x)/x^2 and (dk/dx)/x of x = |theta|, by series where x is small."""
    square = theta[0] * theta[0] + theta[1] * theta[1]
    x = np.sqrt(square)
    if x < 1e-2:
        s = 1 - square / 6 + square**2 / 120 - square**3 / 5040
        return np.cos(x), s, -1 / 3 + square / 30 - square**2 / 840, 1 / 15 - square / 210
    c, s = np.cos(x), np.sin(x) / x
    k = (c - s) / square
    return c, s, k, (-s - 3 * k) / square


@numba.njit(cache=True, error_model="numpy")
def turned(frame, theta):
    """Directors (n, 3) and their derivatives by the two angles (n, 2, 3)."""
    d, derivative = np.empty((len(theta), 3)), np.empty((len(theta), 2, 3))
    for n in range(len(theta)):
        c, s, k, _ = _series(theta[n])
        for j in range(3):
            t = theta[n, 0] * frame[n, 0, j] + theta[n, 1] * frame[n, 1, j]
            d[n, j] = c * frame[n, 2, j] + s * t
            along = -s * frame[n, 2, j] + k * t
            for a in range(2):
                derivative[n, a, j] = s * frame[n, a, j] + theta[n, a] * along
    return d, derivative


@numba.njit(cache=True, error_model="numpy")
def second(frame, theta, r):
    """r . d2d/dtheta_a dtheta_b, shape (n, 2, 2)."""
    result, on = np.empty((len(theta), 2, 2)), np.empty(3)
    for n in range(len(theta)):
        _, s, k, slope = _series(theta[n])
        for j in range(3):
            on[j] = frame[n, j, 0] * r[n, 0] + frame[n, j, 1] * r[n, 1] + frame[n, j, 2] * r[n, 2]
        on_t = theta[n, 0] * on[0] + theta[n, 1] * on[1]
        for a in range(2):
            for b in range(2):
                mixed = k * (theta[n, a] * on[b] + on[a] * theta[n, b])
                result[n, a, b] = (slope * on_t - k * on[2]) * theta[n, a] * theta[n, b] + mixed
            result[n, a, a] += k * on_t - s * on[2]
    return result


def carried(frame: Array, d: Array) -> Array:
    """Frames carried along the shortest turn from their d0 to d."""
    e1, d0, d = frame[:, 0], frame[:, 2], unit(d)
    # e1 - (e1.d) / (1 + d0.d) (d0 + d) is the image of e1 under that turn
    part = (e1 * d).sum(axis=1) / np.maximum(1 + (d0 * d).sum(axis=1), 1e-14)  # half a turn has no shortest way
    e1 = e1 - part[:, None] * (d0 + d)
    e1 = unit(e1 - (e1 * d).sum(axis=1)[:, None] * d)
    return np.stack([e1, np.cross(d, e1), d], axis=1)
