"""Bending of strips that hang under their own weight: bending lengths, overhangs and angles, heart loops.

Each is fitted by the elastica of its own curve (`elastica`), since the usual formulas hold at one angle: Peirce's,
w L^3 cos(t/2)/(8 tan t), is 6 % too large at 41.5 degrees and 34 % at 75. All take 2HB from elsewhere, such as a KES
loop.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, least_squares

from ...errors import InputError
from ...fabrics import BendingCurve
from ...fabrics.bending import FRICTION_PER_M, GRAVITY
from ...laws import Array
from . import elastica
from .elastica import Beam
from .found import ASSUMED_SPREAD, NO_FRICTION, NO_SOFTENING, Found, positive

REACH = 100.0  # 1/m, to which strips that hang are bent
ASTM_ANGLE = np.radians(41.5)


@dataclass(frozen=True)
class Shape:
    """A bending curve but for its B, as other tests tell it: B2 over B (m), 2HB (N) and a part of it that goes with B
    (1/m), and the curvature over which friction builds up (1/m)."""

    softening: float = 0.0
    hysteresis: float = 0.0
    friction: float = 0.0
    spread: float = FRICTION_PER_M

    def curve(self, B: float) -> BendingCurve:
        """The curve of that rigidity (N m)."""
        return BendingCurve(B, self.softening * B, self.hysteresis + self.friction * B)


@dataclass(frozen=True)
class Overhangs:
    """B (N m) of a known shape, its standard error, log of each strip's own B over it (n,), and the change of log B by
    softening over B (1/m) and by 2HB (N)."""

    B: float
    error: float | None
    apart: Array
    by_shape: tuple[float, float]


def overhangs(lengths: Array, angles: Array, areal_mass: float, shape: Shape) -> Overhangs:
    """By least squares on the angles (radians) of overhangs (m)."""
    w = areal_mass * GRAVITY
    first = float(np.median(w * lengths**3 / elastica.group(angles)))
    least = float(np.min(w * lengths**2))
    if shape.hysteresis >= least:
        raise InputError(
            f"A 2HB of {1e3 * shape.hysteresis:.4g} mN alone would carry {1e3 * lengths.min():.4g} mm of this strip; "
            "check its unit."
        )

    def miss(x: Array, shape: Shape = shape) -> Array:
        beam = Beam(shape.curve(float(first * np.exp(x[0] - 1))), areal_mass, shape.spread)
        return elastica.overhang_angle(beam, lengths) - angles

    # of the logarithm, around 1: a difference quotient steps by a part of what it starts from
    fit = least_squares(miss, [1.0], bounds=([-5.0], [3.0]), diff_step=1e-4)
    B, n, J = float(first * np.exp(fit.x[0] - 1)), len(lengths), fit.jac[:, 0]
    error = B * float(np.sqrt(2 * fit.cost / (n - 1) / (J @ J))) if n > 1 else None
    steps = 0.02 / REACH, 0.02 * shape.curve(B).hysteresis
    others = (
        replace(shape, softening=shape.softening + steps[0]),
        replace(shape, hysteresis=shape.hysteresis + steps[1]),
    )
    softer, wider = (
        -float(J @ (miss(fit.x, other) - fit.fun) / (J @ J)) / step if step else 0.0
        for other, step in zip(others, steps, strict=True)
    )
    return Overhangs(B, error, -fit.fun / J, (softer, wider))


def bending_length(
    lengths: ArrayLike,
    areal_mass: float,
    *,
    hysteresis: float = 0.0,
    friction_per_m: float | None = None,
) -> Found:
    """From bending lengths c (m) of strips, half the overhang at 41.5 degrees, as ASTM D1388 and FAST-2 give them.

    B = mass g c^3. With 2HB (N) known, as from KES, B is that of the curve under it, by the elastica.
    """
    c = np.atleast_1d(np.asarray(lengths, dtype=np.float64))
    if c.ndim != 1 or not (np.isfinite(c) & (c > 0)).all():
        raise InputError("Bending lengths must be positive numbers, in m.")
    if c.max() > 0.2:
        raise InputError(f"A bending length of {c.max():.4g} m is no cloth's; give metres, and half of the overhang.")
    positive("areal_mass", areal_mass, "kg/m2")
    values = [_rigidity(2 * one, ASTM_ANGLE, areal_mass, hysteresis, friction_per_m or FRICTION_PER_M) for one in c]
    errors = {"B_uNm": 1e6 * float(np.std(values, ddof=1) / np.sqrt(len(values)))} if len(values) > 1 else {}
    untold = [NO_SOFTENING] if hysteresis else [NO_SOFTENING, NO_FRICTION]
    untold += [] if errors else ["its error: one strip"]
    untold += [ASSUMED_SPREAD] if hysteresis and friction_per_m is None else []
    return Found(BendingCurve(float(np.mean(values)), 0.0, hysteresis), errors, friction_per_m, untold=tuple(untold))


def fit_cantilever(
    overhangs: ArrayLike,
    angles: ArrayLike,
    areal_mass: float,
    *,
    hysteresis: float = 0.0,
    friction_per_m: float | None = None,
) -> Found:
    """From pairs of overhang (m) and angle (radians) below the horizontal of the line from the edge to the free end.

    B, and with angles that differ by 15 degrees or more also B2, by least squares on the angles of the elastica; 2HB
    (N), where a loop told it, is kept. Raises InputError for pairs that no strip has.
    """
    L, angle = (np.atleast_1d(np.asarray(values, dtype=np.float64)) for values in (overhangs, angles))
    if L.ndim != 1 or L.shape != angle.shape or not (np.isfinite(L) & (L > 0)).all():
        raise InputError("Overhangs must be positive lengths in m, and as many as there are angles.")
    if not ((angle > 0) & (angle < np.pi / 2)).all():
        raise InputError("The angles must lie between 0 and 90 degrees, given in radians.")
    positive("areal_mass", areal_mass, "kg/m2")
    spread = friction_per_m or FRICTION_PER_M
    first = np.median([_rigidity(*pair, areal_mass, 0.0, spread) for pair in zip(L, angle, strict=True)])
    both = len(L) >= 3 and np.ptp(angle) >= np.radians(15)
    scale = first / 100

    def curve(p: Array) -> BendingCurve:
        # from 1 on: a difference quotient steps by a part of what it starts from
        softening = scale * (p[1] - 1) if both else 0.0
        return BendingCurve(float(first * np.exp(p[0] - 1)), float(softening), hysteresis)

    def miss(p: Array) -> Array:
        return elastica.overhang_angle(Beam(curve(p), areal_mass, spread), L) - angle

    bounds = ([-5.0, -20.0], [4.0, 20.0]) if both else ([-5.0], [4.0])
    fit = least_squares(miss, np.ones(1 + both), bounds=bounds, diff_step=1e-4)
    best, free = curve(fit.x), len(L) - 1 - both
    errors: dict[str, float] = {}
    if free > 0:
        covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * 2 * fit.cost / free
        error = np.sqrt(np.diag(covariance))
        errors = {"B_uNm": 1e6 * best.B * error[0]} | ({"softening_nNm2": 1e9 * scale * error[1]} if both else {})
    untold = [] if both else [NO_SOFTENING]
    untold += [] if hysteresis else [NO_FRICTION]
    untold += [] if errors else ["its error: no more readings than numbers"]
    untold += [ASSUMED_SPREAD] if hysteresis and friction_per_m is None else []
    residual = float(np.sqrt(np.mean(fit.fun**2)))
    return Found(best, errors, friction_per_m, untold=tuple(untold), residual=residual)


def heart_loop(
    length: float,
    height: float,
    areal_mass: float,
    *,
    hysteresis: float = 0.0,
    friction_per_m: float | None = None,
    shape: Shape | None = None,
) -> Found:
    """From a heart loop: length (m) of strip between the gripped ends, height (m) from the grip to the lowest point.

    `shape` stands for the other numbers where other tests told more than friction.
    """
    positive("length", length, "m")
    positive("areal_mass", areal_mass, "kg/m2")
    known = shape or Shape(hysteresis=hysteresis, spread=friction_per_m or FRICTION_PER_M)
    if not 0.14 * length < height < 0.45 * length:
        raise InputError(
            f"A heart loop of {1e3 * length:.4g} mm is between {140 * length:.4g} (stiff) and {450 * length:.4g} mm "
            f"(slack) high; {1e3 * height:.4g} mm tells no rigidity."
        )

    def miss(logarithm: float) -> float:
        beam = Beam(known.curve(float(np.exp(logarithm))), areal_mass, known.spread)
        try:
            return elastica.heart_loop(beam, length) - height
        except InputError:
            return length  # slack

    middle = np.log(areal_mass * GRAVITY * (length / 8) ** 3)
    B = np.exp(_root(miss, middle, "heart loop"))
    curve = known.curve(float(B))
    untold = [NO_SOFTENING, "its error: one loop"] + ([] if curve.hysteresis else [NO_FRICTION])
    return Found(curve, friction_per_m=friction_per_m, untold=tuple(untold))


def _rigidity(length: float, angle: float, areal_mass: float, hysteresis: float, spread: float) -> float:
    """B (N m) of a strip that hangs at one angle (radians) over one length (m); straight but for friction."""
    first = areal_mass * GRAVITY * length**3 / float(elastica.group(np.array([angle]))[0])
    if not hysteresis:
        return first

    # friction alone would carry this strip, and no rigidity was left
    if hysteresis / 2 >= areal_mass * GRAVITY * length**2 / 2:
        raise InputError(
            f"A 2HB of {1e3 * hysteresis:.4g} mN alone would carry {1e3 * length:.4g} mm of this strip; check its unit."
        )

    def miss(x: float) -> float:
        beam = Beam(BendingCurve(float(first * np.exp(x)), 0.0, hysteresis), areal_mass, spread)
        return float(elastica.overhang_angle(beam, np.array([length]))[0]) - angle

    return first * float(np.exp(_root(miss, -0.3, f"2HB of {1e3 * hysteresis:.4g} mN")))


def _root(miss: Callable[[float], float], middle: float, what: str) -> float:
    """Where a falling or rising function of a logarithm is zero, looked for around `middle`."""
    for reach in (0.5, 1.5, 3.0, 5.0):
        ends = middle - reach, middle + reach
        if miss(ends[0]) * miss(ends[1]) <= 0:
            return float(brentq(miss, *ends, xtol=1e-7))
    raise InputError(f"No rigidity agrees with the {what} of the test; check its units.")
