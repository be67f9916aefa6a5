"""Bending loops, as KES drives them: B, softening and friction of one direction, face and back.

`read_loop` reads B and 2HB as KES does, `fit_loop` fits the law to the whole loop.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from ...errors import InputError
from ...fabrics import BendingCurve, BendingCurves
from ...fabrics.bending import FRICTION_PER_M
from ...laws import Array
from ...laws.bending import CHORDS, Bending
from .found import Found


def read_loop(curvature: ArrayLike, moment: ArrayLike) -> tuple[float, float]:
    """B (N m) and 2HB (N) as KES reads them off a loop, which `fit_loop` does better.

    B is the mean slope between 50 and 150 1/m of both branches on both sides, 2HB the mean width at 100 1/m.
    """
    K, M = _loop(curvature, moment)
    turn = np.flatnonzero(np.diff(np.sign(np.diff(K)))) + 1
    if len(turn) < 2 or not (K.max() >= 150 and K.min() <= -150):
        raise InputError("The loop must turn round twice and reach 150 1/m on both sides, as a KES loop does.")
    runs = [slice(a, b + 1) for a, b in zip(turn, [*turn[1:], len(K) - 1], strict=True)]
    slopes, widths = [], []
    for side in (1, -1):
        at = {}
        for run in runs[:2]:
            k, m = side * K[run], side * M[run]
            inside = (k >= 50) & (k <= 150)
            if inside.sum() < 2:
                raise InputError("A branch of the loop has fewer than two readings between 50 and 150 1/m.")
            slope, height = np.polyfit(k[inside] - 100, m[inside], 1)
            slopes.append(slope)
            at[k[-1] > k[0]] = height
        widths.append(at[True] - at[False])
    return float(np.mean(slopes)), float(np.mean(widths))


def fit_loop(curvature: ArrayLike, moment: ArrayLike) -> Found:
    """The law fitted to a bending loop, curvatures in 1/m and moments per width in N, in the order of the test.

    B of face and back, B2, 2HB, the curvature over which friction builds up, and an offset of the instrument, by least
    squares. A difference of face and back, or a softening, within two standard errors of zero is left out.
    Raises InputError for what is no loop.
    """
    K, M = _loop(curvature, moment)
    top, reach = float(np.abs(M).max()), float(np.abs(K).max())
    virgin = abs(K[0]) < 0.02 * reach
    slope = float(np.polyfit(K, M, 1)[0])
    if not slope > 0:
        raise InputError("The moment of the loop falls as it is bent; check the signs of its columns.")
    friction = float(np.mean(np.abs(M - slope * K))) / top

    def unpack(p: Array) -> tuple[BendingCurve, BendingCurve, float]:
        B, difference, softening, HB, spread, _ = p
        B, softening, width = B * slope, softening * slope / reach, 2 * HB * top
        return (
            BendingCurve(B * (1 + difference), softening, width),
            BendingCurve(B * (1 - difference), softening),
            spread,
        )

    def miss(p: Array) -> Array:
        face, back, spread = unpack(p)
        return (moments(K, face, back, spread, virgin) - M) / top + p[5]

    # B, face against back, B2, HB, spread (1/m), offset
    p = np.array([1.0, 0.0, 0.0, max(friction, 1e-3), FRICTION_PER_M, 0.0])
    low, high = np.array([0.05, -0.8, -5.0, 0.0, 1.0, -0.5]), np.array([20.0, 0.8, 5.0, 1.0, 150.0, 0.5])
    used = np.ones(6, dtype=bool)
    errors = np.zeros(6)
    while True:

        def some(x: Array) -> Array:
            return miss(np.where(used, _spread_out(x, used), p))

        fit = least_squares(
            some, p[used], bounds=(low[used], high[used]), x_scale=np.array([1, 0.1, 1, 0.1, 15, 0.1])[used]
        )
        p[used] = fit.x
        covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * 2 * fit.cost / max(len(M) - int(used.sum()), 1)
        errors[:] = 0.0
        errors[used] = np.sqrt(np.diag(covariance))
        small = [k for k in (1, 2) if used[k] and abs(p[k]) < max(2 * errors[k], 1e-4)]
        if used[3] and p[3] < max(2 * errors[3], 1e-4):
            small += [3, 4]
        if not small:
            break
        used[small], p[small] = False, [FRICTION_PER_M if k == 4 else 0.0 for k in small]
    face, back, spread = unpack(p)
    names = ("B_uNm", "face_over_back", "softening_nNm2", "hysteresis_mN", "friction_per_m", "offset_mN")
    units = (1e6 * slope, 1.0, 1e9 * slope / reach, 2e3 * top, 1.0, 1e3 * top)
    told = {name: float(e * unit) for name, e, unit, there in zip(names, errors, units, used, strict=True) if there}
    untold = [] if used[3] else ["friction: the loop has no width beyond its noise"]
    if used[3] and 2 * CHORDS[-1][0] * spread > reach:
        untold.append("whether friction had turned round at the ends of the loop: drive it further")
    if used[3] and errors[4] > 0.5 * spread:
        untold.append(f"friction_per_m: {spread:.3g} ± {errors[4]:.2g}")
    return Found(
        face,
        told,
        spread if used[3] else None,
        replace(back, hysteresis=0.0) if used[1] else None,
        tuple(untold),
        float(np.sqrt(np.mean(miss(p) ** 2)) * top),
    )


def _spread_out(x: Array, used: Array) -> Array:
    whole = np.zeros(len(used))
    whole[used] = x
    return whole


def moments(K: Array, face: BendingCurve, back: BendingCurve, spread: float, virgin: bool) -> Array:
    """Moments along a path of curvatures; one that does not begin flat has been gone through before."""
    law = Bending(BendingCurves(face, face, face, (back, back), friction_per_m=spread))
    state, point = law.initial_state[None].copy(), np.zeros((1, 3))
    M, out = np.empty(len(K)), (np.empty((1, 3)), np.empty((1, 3, 3)), state)
    for _ in range(1 if virgin else 2):
        for i, curvature in enumerate(K):
            point[0, 0] = curvature
            law.respond(point, state, out)  # the new state over the old one: it is a single point
            M[i] = out[0][0, 0]
    return M


def _loop(curvature: ArrayLike, moment: ArrayLike) -> tuple[Array, Array]:
    K, M = np.asarray(curvature, dtype=np.float64), np.asarray(moment, dtype=np.float64)
    if K.ndim != 1 or K.shape != M.shape or len(K) < 10 or not np.isfinite(K.sum() + M.sum()):
        raise InputError("A loop needs at least 10 finite readings of curvature and of moment, as many of both.")
    return K, M
