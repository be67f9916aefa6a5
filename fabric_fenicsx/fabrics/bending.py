"""Bending of a fabric as data: moment against curvature along warp, weft and in twist, and what a bias strip tells.

In each direction M = B K + B2 K|K|, B2 < 0 for a cloth that softens, plus friction, which makes a loop 2HB wide.
Numbers per metre of width: B in N m, B2 in N m2, 2HB in N; curvatures K11, K22 and 2 K12 in 1/m. KES and FAST give
them (Tables 3.1, 3.2); the thesis measured none.

A strip cut at 45 degrees reads one of two rigidities, with B66 that of twist and B12 that of coupling:

    narrow, free to twist (cantilever):       4/B45 = (Bw + Bf - 2 B12)/(Bw Bf - B12^2) + 1/B66
    wide, held between long grips (KES):      4 B45 = Bw + Bf + 2 B12 + 4 B66
"""

import json
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from fabric_fenicsx.errors import InputError

LIMIT = 0.9
"""Part of its stiffness by which a direction may change before its curve goes on along its tangent."""
FRICTION_PER_M = 15.0
"""Curvature over which friction builds up, where no loop was looked at; assumed."""
GRAVITY = 9.80665


@dataclass(frozen=True)
class BendingCurve:
    """One direction: B in N m, softening B2 in N m2 (negative where the cloth softens), hysteresis 2HB in N.

    Raises InputError where that is no moment curve.
    """

    B: float
    softening: float = 0.0
    hysteresis: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.B < np.inf:
            raise InputError(f"A bending rigidity of {self.B!r} N m is not a positive number.")
        if not np.isfinite(self.softening):
            raise InputError(f"A softening of {self.softening!r} N m2 is not a number.")
        if not 0 <= self.hysteresis < np.inf:
            raise InputError(f"A hysteresis 2HB of {self.hysteresis!r} N is not zero or a positive number.")

    @property
    def limit(self) -> float:
        """Curvature, 1/m, from which the moment goes on along its tangent; infinite for a straight line."""
        return LIMIT * self.B / (2 * abs(self.softening)) if self.softening else np.inf

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest stiffness dM/dK without friction, N m."""
        end = self.B * (1 + LIMIT * np.sign(self.softening))
        return float(min(self.B, end)), float(max(self.B, end))

    def __str__(self) -> str:
        text = f"B {1e6 * self.B:.4g} uN m"
        if self.softening:
            text += f", B2 {1e9 * self.softening:.4g} nN m2"
        return text + (f", 2HB {1e3 * self.hysteresis:.4g} mN" if self.hysteresis else "")


def moment(K: np.ndarray, B: np.ndarray | float, softening: np.ndarray | float, limit: float) -> np.ndarray:
    """Moments (N) at curvatures K (1/m, not negative) without friction; B, softening, limit: see `BendingCurve`."""
    k = np.minimum(K, limit)
    return np.asarray(B * K + softening * (k**2 + 2 * k * (K - k)))


@dataclass(frozen=True)
class BendingCurves:
    """Bending of a fabric: warp and weft (of the face, K > 0), twist over 2 K12, and how they go together.

    back:              warp and weft where K < 0; their friction is that of the face. None: as the face
    coupling:          B12, N m: moment along one yarn by curvature along the other
    friction_per_m:    curvature over which friction builds up, 1/m
    assumed:           what of it was not measured ("bending": all), and why it is what it is; told wherever the
                       fabric is described

    Raises InputError where bending would give work back.
    """

    warp: BendingCurve
    weft: BendingCurve
    twist: BendingCurve
    back: tuple[BendingCurve, BendingCurve] | None = None
    coupling: float = 0.0
    friction_per_m: float = FRICTION_PER_M
    assumed: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0 < self.friction_per_m < np.inf:
            raise InputError(f"Friction that builds up over {self.friction_per_m!r} 1/m: give a positive number.")
        bound = self.largest_coupling
        if not abs(self.coupling) < bound:
            raise InputError(
                f"A coupling B12 of {1e6 * self.coupling:.4g} uN m is not below {1e6 * bound:.4g} uN m, the geometric "
                "mean of the least stiffness of warp and weft: some curvature would give work back."
            )

    @property
    def largest_coupling(self) -> float:
        """Bound of |B12|, N m: the geometric mean of the least stiffness along warp and weft."""
        warp, weft = zip((self.warp, self.weft), self.back or (self.warp, self.weft), strict=True)
        return float(np.sqrt(min(c.range[0] for c in warp) * min(c.range[0] for c in weft)))

    def describe(self) -> str:
        """A line for each direction, and one for each thing that is assumed."""
        rows = [("warp", self.warp), ("weft", self.weft), ("twist", self.twist)]
        rows += [("warp, back", self.back[0]), ("weft, back", self.back[1])] if self.back else []
        lines = [
            f"{name}: {curve}" + " (assumed)" * bool({name, "bending"} & self.assumed.keys()) for name, curve in rows
        ]
        lines += [f"coupling: B12 {1e6 * self.coupling:.4g} uN m"] if self.coupling else []
        return "\n".join([*lines, *(f"assumed {what}: {why}" for what, why in self.assumed.items())])

    def __str__(self) -> str:
        return "bending (" + self.describe().replace("\n", "; ") + ")"


# -- strips cut at 45 degrees ------------------------------------------------------------------------------------------


def bias_bound(warp: BendingCurve, weft: BendingCurve, wide: bool, coupling: float = 0.0) -> float:
    """The bias rigidity B45 (N m) of a sheet whose twist is infinitely stiff (narrow strip: B45 must be below it) or
    not stiff at all (wide strip: above it)."""
    if wide:
        return (warp.B + weft.B + 2 * coupling) / 4
    return 4 / sum(_compliances(warp, weft, coupling))


def least_hysteresis(warp: BendingCurve, weft: BendingCurve, B: float, wide: bool, coupling: float = 0.0) -> float:
    """2HB (N) of a bias strip of rigidity B (N m) by the friction of warp and weft alone."""
    if wide:
        return (warp.hysteresis + weft.hysteresis) / 2
    cw, cf = _compliances(warp, weft, coupling)
    return B / 2 * (warp.hysteresis * cw + weft.hysteresis * cf)


def twist_of_bias(
    warp: BendingCurve, weft: BendingCurve, bias: BendingCurve, wide: bool, coupling: float = 0.0
) -> BendingCurve:
    """The curve of twist from that of a strip at 45 degrees, narrow or wide.

    Softening to second order in the curvature (exact for the wide strip), friction where all of it has built up.
    InputError where no twist agrees with them, see `bias_bound` and `least_hysteresis`.
    """
    bound, least = bias_bound(warp, weft, wide, coupling), least_hysteresis(warp, weft, bias.B, wide, coupling)
    if not (bias.B > bound if wide else bias.B < bound):
        raise InputError(
            f"A {'wide' if wide else 'narrow'} bias strip must have a B {'above' if wide else 'below'} "
            f"{1e6 * bound:.4g} uN m, which warp and weft alone give it; {1e6 * bias.B:.4g} agrees with no twist."
        )
    rest = bias.hysteresis - least
    if rest < -1e-9 * least:
        raise InputError(
            f"Warp and weft alone give a bias strip a 2HB of {1e3 * least:.4g} mN; {1e3 * bias.hysteresis:.4g} is less."
        )
    if wide:
        B, softening = bias.B - bound, bias.softening - (warp.softening + weft.softening) / 8
    else:
        B = 1 / (4 / bias.B - 4 / bound)
        yarns = sum(y.softening * c**3 for y, c in zip((warp, weft), _compliances(warp, weft, coupling), strict=True))
        softening, rest = B**3 * (8 * bias.softening / bias.B**3 - yarns), rest * 2 * B / bias.B
    return BendingCurve(B, softening, max(rest, 0.0))


def bias_of_twist(
    warp: BendingCurve, weft: BendingCurve, twist: BendingCurve, wide: bool, coupling: float = 0.0
) -> BendingCurve:
    """What a strip at 45 degrees reads: the inverse of `twist_of_bias`."""
    cw, cf = _compliances(warp, weft, coupling)
    B = twist.B + bias_bound(warp, weft, wide, coupling) if wide else 4 / (cw + cf + 1 / twist.B)
    least = least_hysteresis(warp, weft, B, wide, coupling)
    if wide:
        return BendingCurve(B, twist.softening + (warp.softening + weft.softening) / 8, twist.hysteresis + least)
    softening = warp.softening * cw**3 + weft.softening * cf**3 + twist.softening / twist.B**3
    return BendingCurve(B, B**3 / 8 * softening, least + B / 2 * twist.hysteresis / twist.B)


def _compliances(warp: BendingCurve, weft: BendingCurve, coupling: float) -> tuple[float, float]:
    """Curvatures along warp and weft per moment on both. InputError where they would give work back."""
    if not abs(coupling) < np.sqrt(warp.B) * np.sqrt(weft.B):
        raise InputError(f"A coupling B12 of {1e6 * coupling:.4g} uN m is too large for its warp and weft.")
    c = np.linalg.solve([[warp.B, coupling], [coupling, weft.B]], [1.0, 1.0])
    return float(c[0]), float(c[1])


# -- what may stand in where nothing was measured ----------------------------------------------------------------------


@cache
def published() -> dict[str, list[float]]:
    """Percentiles of 618 fabrics by the name of a quantity, and the "percentiles" themselves."""
    text = (Path(__file__).parent / "bending_618.json").read_text(encoding="utf-8")
    return {key: value for key, value in json.loads(text).items() if not key.startswith("_")}


def quantile(quantity: str, percent: float) -> float:
    """One percentile, 0 to 100, of a quantity of the 618 fabrics, in the unit of its name."""
    table = published()
    return float(np.interp(percent, table["percentiles"], table[quantity]))


def estimated_bending(areal_mass: float, percent: float = 50.0) -> BendingCurves:
    """Bending of a fabric whose bending nobody measured, from its mass (kg/m2): B = areal mass g c^3.

    The bending lengths c of warp, weft and bias are percentiles of 618 real fabrics (Feng et al. 2022, doi
    10.1145/3550454.3555464), the medians unless asked otherwise. A cantilever's c holds its friction and softening, so
    none is added.
    """
    warp, weft, bias = (
        BendingCurve(areal_mass * GRAVITY * (1e-3 * quantile(f"bending_length_{way}_mm", percent)) ** 3)
        for way in ("warp", "weft", "diag")
    )
    low, high = (quantile("bending_length_warp_mm", p) for p in (5, 95))
    which = "median" if percent == 50 else f"{percent:g} % quantile"
    said = (
        f"not measured; B = mass x g x c^3 with the {which} bending lengths c of 618 published fabrics "
        f"(90 % of them: warp {low:.0f} to {high:.0f} mm)"
    )
    return BendingCurves(warp, weft, twist_of_bias(warp, weft, bias, wide=False), assumed={"bending": said})


def assumed_twist(warp: BendingCurve, weft: BendingCurve) -> tuple[BendingCurve, str]:
    """Twist where only warp and weft were measured, and the sentence that says so.

    A narrow bias strip of the median of 618 fabrics, 0.97 times the geometric mean of warp and weft; softening and
    friction of twist are to those of warp and weft as their B are. InputError where these are too far apart.
    """
    ratio, mean = quantile("ratio_B1_diag_over_geomean_warp_weft", 50), np.sqrt(warp.B * weft.B)
    B = twist_of_bias(BendingCurve(warp.B), BendingCurve(weft.B), BendingCurve(ratio * mean), wide=False).B
    softening = np.sqrt(warp.softening * weft.softening) if warp.softening * weft.softening > 0 else 0.0
    twist = BendingCurve(
        B,
        B / mean * float(np.copysign(softening, warp.softening)),
        B / mean * float(np.sqrt(warp.hysteresis * weft.hysteresis)),
    )
    return twist, (
        "no bias strip; from warp and weft, by the median of 618 published fabrics, whose bias strips have "
        f"{ratio:.2f} times the geometric mean of both"
    )
