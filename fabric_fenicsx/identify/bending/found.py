"""Bending from what laboratories measure (Tables 3.1, 3.2): one direction as `Found`, and a whole fabric.

`kes` takes the two numbers of a KES report, `loops.fit_loop` a whole loop, `hanging` bending lengths (ASTM D1388,
FAST-2), pairs of overhang and angle, heart loops. Each gives a `Found`: the curve of one direction, the standard errors
of its numbers, and what the data do not tell. `together` puts warp, weft and a bias strip into
`fabrics.BendingCurves`, `toml` into the table [bending] of a fabric file.

A bending length holds the friction of a first loading; B of a KES loop does not, and goes with its 2HB. So 2HB is
not to be added to a B from a bending length, unless that is fitted again with it (`hysteresis=`). Laboratories'
"flexural rigidities" are not read: the constants in use differ by up to 1.45; lengths do not.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import InputError
from ...fabrics import BendingCurve, BendingCurves
from ...fabrics.bending import FRICTION_PER_M, assumed_twist, twist_of_bias

KES_B = 9.80665e-5
"""N m per gf cm2/cm."""
KES_2HB = 9.80665e-3
"""N per gf cm/cm."""
NO_SOFTENING = "softening: one angle or one length cannot tell it, so that the curve is a straight line"
NO_FRICTION = (
    "friction: first loading cannot tell it from softening, so that it is held in B and B2; add no 2HB to them"
)
ASSUMED_SPREAD = f"over which curvature friction builds up; {FRICTION_PER_M:g} 1/m is assumed"


@dataclass(frozen=True)
class Found:
    """The curve of one direction; `errors` are standard errors by name of a number, in its unit."""

    curve: BendingCurve
    errors: dict[str, float] = field(default_factory=dict)
    friction_per_m: float | None = None  # where a loop tells it
    back: BendingCurve | None = None  # where K < 0 differs
    untold: tuple[str, ...] = ()
    residual: float = 0.0  # root mean square, in the unit of the data: N of a loop, radians of angles

    def __str__(self) -> str:
        errors = ", ".join(f"{name} ± {error:.2g}" for name, error in self.errors.items())
        return "; ".join([str(self.curve), *([errors] if errors else []), *(f"not told: {u}" for u in self.untold)])


def kes(B: float, hysteresis: float) -> Found:
    """From the two numbers of a KES report: B in gf cm2/cm and 2HB in gf cm/cm."""
    positive("B", B, "gf cm2/cm")
    if not 0 <= hysteresis < np.inf:
        raise InputError(f"2HB = {hysteresis!r} gf cm/cm is not zero or a positive number.")
    curve = BendingCurve(KES_B * B, 0.0, KES_2HB * hysteresis)
    return Found(curve, untold=("softening: B is one slope", ASSUMED_SPREAD))


def together(warp: Found, weft: Found, bias: Found | None = None, *, wide: bool = False) -> BendingCurves:
    """The bending of a fabric from that of its strips; `wide`: the bias strip was held between long grips, as in KES.

    Raises InputError where the bias strip contradicts warp and weft.
    """
    strips = {"warp": warp, "weft": weft} | ({"bias": bias} if bias else {})
    assumed = {}
    if bias:
        twist = twist_of_bias(warp.curve, weft.curve, bias.curve, wide)
    else:
        twist, assumed["twist"] = assumed_twist(warp.curve, weft.curve)
    spreads = [one.friction_per_m for one in (warp, weft) if one.friction_per_m and one.curve.hysteresis]
    if not spreads and any(one.curve.hysteresis for one in strips.values()):
        assumed["friction"] = f"builds up over {FRICTION_PER_M:g} 1/m, since no loop was read"
    back = (warp.back or warp.curve, weft.back or weft.curve) if warp.back or weft.back else None
    spread = float(np.mean(spreads)) if spreads else FRICTION_PER_M
    return BendingCurves(warp.curve, weft.curve, twist, back, 0.0, spread, assumed)


def toml(curves: BendingCurves) -> str:
    """The table [bending] of a fabric file."""
    lines = ["[bending]", *(f"# assumed {what}: {why}" for what, why in curves.assumed.items())]
    lines += [f"{way} = {_inline(getattr(curves, way))}" for way in ("warp", "weft", "twist")]
    if curves.back:
        sides = ", ".join(
            f"{way} = {_inline(replace(c, hysteresis=0.0))}"
            for way, c in zip(("warp", "weft"), curves.back, strict=True)
        )
        lines.append(f"back = {{ {sides} }}")
    if curves.coupling:
        lines.append(f"coupling_uNm = {1e6 * curves.coupling:.9g}")
    if any(c.hysteresis for c in (curves.warp, curves.weft, curves.twist)):
        lines.append(f"friction_per_m = {curves.friction_per_m:.6g}")
    return "\n".join([*lines, ""])


def _inline(curve: BendingCurve) -> str:
    text = f"B_uNm = {1e6 * curve.B:.9g}"
    if curve.softening:
        text += f", softening_nNm2 = {1e9 * curve.softening:.9g}"
    return "{ " + text + (f", hysteresis_mN = {1e3 * curve.hysteresis:.9g}" if curve.hysteresis else "") + " }"


def positive(name: str, value: float, unit: str) -> None:
    """Refuse a value that is not a positive number."""
    if not 0 < value < np.inf:
        raise InputError(f"{name} = {value!r} {unit} is not a positive number.")
