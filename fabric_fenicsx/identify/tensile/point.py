"""The law as the model of a test: many readings of a strip, or of a biaxial specimen, in a few calls of the law.

All readings of a leg, from one reversal to the next, are solved at once, each by a single increment from the state at
its beginning. A law whose straight increments can be split without a difference answers as in many steps, but for the
bend of the way between: readings of one test, where each element of the law goes one way within a leg, lose nothing.
"""

import numpy as np

from ...laws import Array, Law
from ...laws.stability import rotate_strain, rotate_stress, rotate_tangent

CLOSE = 1e-9
"""Stress across and shear stress that are none, over the largest stress."""
MOST = 60


def strip(law: Law, axial: Array, angle: float, state: Array | None = None) -> tuple[Array, Array, Array]:
    """Axial stress (n,), strains (n, 3) in the axes of the strip, and states (n, s) of a strip that pulls evenly.

    Axial strains (n,), each from `state` (s,) or from rest; `angle` (radians) of the strip to the warp. NaN where no
    balance is found.
    """
    n = len(axial)
    states = np.tile(law.initial_state if state is None else state, (n, 1))
    E = np.zeros((n, 3))
    E[:, 0] = axial
    S, C, new = _turned(law, E, states, angle)
    size = _size(S)
    for _ in range(MOST):
        bad = size > CLOSE * (np.abs(S[:, 0]) + 1e-12 * np.abs(C).max((1, 2)))
        if not bad.any():
            break
        step = np.zeros((n, 2))
        step[bad] = -np.linalg.solve(C[bad, 1:, 1:], S[bad, 1:, None])[..., 0]
        for _ in range(12):  # shorter where the stress does not fall
            tried = E.copy()
            tried[:, 1:] += step
            trial = _turned(law, tried, states, angle)
            better = _size(trial[0]) <= size * (1 - 1e-4) + 1e-300
            if (better | ~bad).all():
                break
            step[~better] /= 2
        E, (S, C, new) = tried, trial
        size = _size(S)
    lost = size > 1e3 * CLOSE * (np.abs(S[:, 0]) + 1e-9 * np.abs(C).max((1, 2)))
    return np.where(lost, np.nan, S[:, 0]), E, new


def cycles(law: Law, axial: Array, angle: float) -> Array:
    """Axial stress (n,) of a strip along axial strains (n,) in the order of the test."""
    out, state = np.empty(len(axial)), None
    for leg in legs(axial):
        out[leg], _, states = strip(law, axial[leg], angle, state)
        state = states[-1]
    return out


def legs(values: Array) -> list[slice]:
    """Runs of readings that go one way."""
    way = np.sign(np.diff(values, prepend=0.0))
    turns = [k for k in range(1, len(values)) if way[k] * way[k - 1] < 0]
    return [slice(a, b) for a, b in zip([0, *turns], [*turns, len(values)], strict=True)]


def biaxial(law: Law, strain: Array) -> Array:
    """Stresses S11, S22 (n, 2) at E11, E22 (n, 2) of a specimen that is drawn along both yarns from rest."""
    E = np.column_stack([strain, np.zeros(len(strain))])
    return np.asarray(law.respond(E, np.tile(law.initial_state, (len(E), 1)))[0][:, :2])


def _turned(law: Law, E: Array, states: Array, angle: float) -> tuple[Array, Array, Array]:
    S, C, new = law.respond(np.ascontiguousarray(rotate_strain(E, -angle)), states)
    return rotate_stress(S, angle), rotate_tangent(C, angle), new


def _size(S: Array) -> Array:
    return np.asarray(np.hypot(S[:, 1], S[:, 2]))
