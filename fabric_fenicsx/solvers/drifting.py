"""Displacements and directors over an explicit step."""

import math

import numba


@numba.njit(cache=True, error_model="numpy")
def drift(q, v, displacements, directors, dt):
    """Move q by a step of v, directors on their sphere; their velocity is carried along."""
    for i in displacements:
        q[i] += dt * v[i]
    for node in directors:
        square = 0.0
        for i in node:
            square += (dt * v[i]) ** 2
        if square < 1e-4:  # to the last digit
            c = 1.0 - square / 2 * (1.0 - square / 12 * (1.0 - square / 30))
            s = 1.0 - square / 6 * (1.0 - square / 20 * (1.0 - square / 42))
        else:
            angle = math.sqrt(square)
            c, s = math.cos(angle), math.sin(angle) / angle
        for i in node:
            d, turn = q[i], dt * v[i]
            q[i] = c * d + s * turn
            v[i] = (c * turn - square * s * d) / dt


@numba.njit(cache=True, error_model="numpy")
def weighed(mass, values):
    """Sum of mass times the squares of the first values."""
    total = 0.0
    for i in range(len(values)):
        total += mass[i] * values[i] * values[i]
    return total


@numba.njit(cache=True, error_model="numpy")
def lay(values, q, directors):
    """Take from values what is along the directors of q."""
    for node in directors:
        along = size = 0.0
        for i in node:
            along += values[i] * q[i]
            size += q[i] * q[i]
        for i in node:
            values[i] -= along / size * q[i]


@numba.njit(cache=True, error_model="numpy")
def accelerate(force, mass, given, values, q, directors, a):
    """Take the acceleration by a residual for a; of what is given its values, of directors what is across them."""
    for i in range(len(a)):
        a[i] = -force[i] / mass[i]
    for i in range(len(given)):
        a[given[i]] = values[i]
    lay(a, q, directors)


@numba.njit(cache=True, error_model="numpy")
def kick(v, a, dt):
    """Add to a velocity what an acceleration makes of it in dt."""
    for i in range(len(v)):
        v[i] += dt * a[i]
