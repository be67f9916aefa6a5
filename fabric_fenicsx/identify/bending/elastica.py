"""Strips that bend under their own weight: the heavy cantilever and the heart loop, as beams without stretch.

In both M = M(K) on first loading, so that friction counts as what it adds there. With w the mass per area, r the way
from the free end, t the angle below the horizontal,

    dt/dr = -K(M),    dM/dr = w g r cos t,    M = 0 and t = t_tip at r = 0,

and where t = 0 is the edge from which the strip overhangs: one pass from the tip gives its length, drop and reach.
Checked against the linear curve of Romero et al. 2021 in the tests.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicSpline

from ...errors import InputError
from ...fabrics import BendingCurve, BendingCurves
from ...fabrics.bending import FRICTION_PER_M, GRAVITY
from ...laws import Array
from ...laws.bending import CHORDS, Bending

STEPS = 60
"""Steps of a cantilever that bends little; others take up to some times more."""
STEEPEST = np.radians(89.9)


@dataclass(frozen=True)
class Beam:
    """A strip: its bending curve, the curvature over which friction builds up (1/m), its mass per area (kg/m2)."""

    curve: BendingCurve
    areal_mass: float
    friction_per_m: float = FRICTION_PER_M

    @property
    def weight(self) -> float:
        """N/m2."""
        return self.areal_mass * GRAVITY

    def table(self, moment: float) -> tuple[Array, Array]:
        """Curvatures (1/m) and moments (N) of first loading, up to that moment at least."""
        curve = self.curve
        corners = [curve.limit, *(self.friction_per_m * x for x, _ in CHORDS)]
        last = moment / curve.range[0]
        K = np.concatenate([[0.0], np.geomspace(1e-6 * last, last, 2000), [c for c in corners if c < last]])
        K.sort()
        law = Bending(BendingCurves(curve, curve, curve, friction_per_m=self.friction_per_m))
        M = law.respond(np.repeat(K[:, None], 3, axis=1), np.tile(law.initial_state, (len(K), 1)))[0]
        return K, M[:, 0]


def cantilever(beam: Beam, tips: Array) -> tuple[Array, Array, Array]:
    """Length, drop and reach (m) of overhangs whose free end hangs at the angles `tips` (radians, below 90 degrees)."""
    tips = np.asarray(tips, dtype=np.float64)
    if not ((tips > 0) & (tips <= STEEPEST)).all():
        raise InputError("The angles of the free end must lie between 0 and 89.9 degrees.")
    w = beam.weight
    # friction adds at most its yield to what a straight curve needs
    scale = (6 * beam.curve.B * tips / w) ** (1 / 3)
    longest = 6 * scale.max() + np.sqrt(2 * beam.curve.hysteresis / w)
    K, M = beam.table(w * longest**2 / 2)

    def rate(r: Array, y: Array) -> Array:
        cos = np.cos(y[0])
        return np.array([-np.interp(y[1], M, K), w * r * cos, cos, np.sin(y[0])])

    def step(r: Array, y: Array, dr: Array) -> Array:
        a = rate(r, y)
        b = rate(r + dr / 2, y + dr / 2 * a)
        c = rate(r + dr / 2, y + dr / 2 * b)
        return np.asarray(y + dr / 6 * (a + 2 * b + 2 * c + rate(r + dr, y + dr * c)))

    r, dr = np.zeros(len(tips)), scale / STEPS
    y = np.zeros((4, len(tips)))
    y[0] = tips
    out = np.empty((3, len(tips)))
    left = np.arange(len(tips))
    while left.size:
        after = step(r, y, dr)
        over = after[0] <= 0
        if over.any():  # the edge lies within this step
            at, start, part = r[over], y[:, over], dr[over] * y[0, over] / (y[0, over] - after[0, over])
            for _ in range(3):
                end = step(at, start, part)
                part = part - end[0] / rate(at + part, end)[0]
            end = step(at, start, part)
            out[:, left[over]] = at + part, end[3], end[2]
        keep = ~over
        r, y, dr, left = (r + dr)[keep], after[:, keep], dr[keep], left[keep]
        if left.size and (r > longest).any():
            raise InputError(
                "A strip of these numbers does not overhang: its friction carries its weight at any length."
            )
    return out[0], out[1], out[2]


def overhang_angle(beam: Beam, lengths: Array) -> Array:
    """Angle (radians) of the line from the edge to the free end, below the horizontal, by length (m)."""
    lengths = np.asarray(lengths, dtype=np.float64)
    tips = np.radians(
        np.concatenate([np.geomspace(0.2, 20, 20), np.linspace(23, 80, 20), 90 - np.geomspace(8, 0.1, 12)])
    )
    length, drop, reach = cantilever(beam, tips)
    angle = np.arctan2(drop, reach)
    between = CubicSpline(np.log(length), np.log(angle))(np.log(np.clip(lengths, length[0], length[-1])))
    # of short ones the angle goes with the cube of the length; far longer ones hang straight down
    inside = np.exp(between) * np.minimum(lengths / length[0], 1.0) ** 3
    return np.where(lengths > length[-1], np.pi / 2, inside)


@cache
def _straight() -> tuple[Array, Array]:
    """Angle, radians, and group w L^3/B of overhangs of a strip whose curve is a straight line."""
    tips = np.radians(
        np.concatenate([np.geomspace(0.2, 20, 40), np.linspace(21, 80, 60), 90 - np.geomspace(9, 0.1, 40)])
    )
    length, drop, reach = cantilever(Beam(BendingCurve(1.0), 1 / GRAVITY), tips)
    return np.arctan2(drop, reach), length**3


def group(angle: Array) -> Array:
    """w L^3/B of an overhang of length L at these angles (radians), of a strip whose curve is a straight line."""
    known, value = _straight()
    inside = np.clip(angle, known[0], known[-1])
    between = np.exp(CubicSpline(np.log(known), np.log(value))(np.log(inside)))
    return np.asarray(between * np.minimum(angle / known[0], 1.0))


def heart_loop(beam: Beam, length: float) -> float:
    """Height (m) from the grip to the lowest point of a heart loop: a strip of `length` (m), its ends gripped face to
    face and pointing up, hangs down on both sides.

    Without weight it is 0.1339 times the length. InputError where no equilibrium is found.
    """
    half, w = length / 2, beam.weight
    K, M = beam.table(1.5 * (w * half**2 + beam.curve.range[1] * 8 / half + beam.curve.hysteresis))
    # a weight that grows from nothing: the solver starts each from the last
    s, guess, force = np.linspace(0, 1, 41), None, np.array([0.0])
    for part in (0.0, 0.1, 0.3, 0.6, 1.0):

        def rate(s: Array, y: Array, p: Array, part: float = part) -> Array:
            curvature = np.sign(y[1]) * np.interp(np.abs(y[1]), M, K)
            cos, sin = np.cos(y[0]), np.sin(y[0])
            return half * np.array([curvature, part * w * half * (1 - s) * cos + p[0] * sin, cos, sin])

        def ends(a: Array, b: Array, p: Array) -> Array:
            return np.array([a[0] - np.pi / 2, a[2], a[3], b[0] + np.pi, b[2]])

        if guess is None:
            turn = np.pi / 2 - 1.5 * np.pi * s
            moment = np.full_like(s, -np.interp(1.5 * np.pi / half, K, M))
            guess = np.array([turn, moment, half * np.sin(np.pi * s) / 4, -0.13 * length * s])
        found = solve_bvp(rate, ends, s, guess, p=force, tol=1e-4, max_nodes=20000)
        if not found.success:
            raise InputError(
                f"No shape of a heart loop of {1e3 * length:.4g} mm was found for {beam.curve}: it hangs too slack."
            )
        s, guess, force = found.x, found.y, found.p
    return float(-found.y[3, -1])
