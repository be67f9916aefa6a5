"""The table [bending] of a fabric file, SI by the names of its keys; every entry checked, a contradiction refused.

    [bending]                       # may be left out; then bending is not measured
    warp = { B_uNm = 13.8, softening_nNm2 = -35.6, hysteresis_mN = 0.5 }    # B, B2, 2HB; the last two where measured
    weft = { B_uNm = 8.8 }
    bias = { B_uNm = 11.5 }         # a strip at 45 degrees, and which; or twist = { ... }; neither: assumed, as it says
    bias_strip = "narrow"           # may twist, as a cantilever | "wide": held between long grips, as KES
    back = { warp = { B_uNm = 12 }, weft = { B_uNm = 8 } }    # where bent the other way; friction is that of the face
    coupling_uNm = 0.5              # B12: moment along one yarn by curvature along the other
    friction_per_m = 15             # curvature over which the friction of a loop builds up

B alone is the slope of a KES loop, which goes with its 2HB; B = mass g c^3 of a bending length c holds friction and
softening already, so that neither is to be added to it.
"""

from __future__ import annotations

from fabric_fenicsx.entries import Table
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics.bending import (
    FRICTION_PER_M,
    BendingCurve,
    BendingCurves,
    assumed_twist,
    bias_bound,
    least_hysteresis,
    twist_of_bias,
)

SOFTEST_PER_M = 10.0
"""Curvature of the largest moment, B/(2|B2|), below which a softening is no cloth's: the least of 618 has 29."""


def read_bending(table: Table) -> BendingCurves:
    """The curves of the table [bending]. Raises InputError."""
    table.expect("warp weft", "bias twist bias_strip back coupling_uNm friction_per_m")
    warp, weft = _curve(table.table("warp")), _curve(table.table("weft"))
    coupling = 1e-6 * table.real("coupling_uNm", 0.0)
    back = _back(table.table("back"), warp, weft) if "back" in table.entries else None
    bound = BendingCurves(warp, weft, warp, back).largest_coupling  # whatever the twist is
    if not abs(coupling) < bound:
        reason = f"is not below {1e6 * bound:.4g}, the geometric mean of the least stiffness of warp and weft"
        table.refuse("coupling_uNm", f"{reason}, so that some curvature would give work back", "give a smaller one")
    twist, assumed = _twist(table, warp, weft, coupling)
    spread = table.positive("friction_per_m", FRICTION_PER_M)
    rubs = any(curve.hysteresis for curve in (warp, weft, twist))
    if "friction_per_m" in table.entries and not rubs:
        table.refuse("friction_per_m", "has no hysteresis to build up", "give hysteresis_mN, or leave it out")
    if rubs and "friction_per_m" not in table.entries:
        assumed["friction"] = f"builds up over {FRICTION_PER_M:g} 1/m, since friction_per_m is left out"
    return BendingCurves(warp, weft, twist, back, coupling, spread, assumed)


def _curve(table: Table, friction: str = "hysteresis_mN") -> BendingCurve:
    """One direction, SI; `friction` names its key, or is empty where none may be given."""
    table.expect("B_uNm", f"softening_nNm2 {friction}")
    B, softening = 1e-6 * table.positive("B_uNm"), 1e-9 * table.real("softening_nNm2", 0.0)
    hysteresis = 1e-3 * table.real("hysteresis_mN", 0.0)
    if hysteresis < 0:
        table.refuse("hysteresis_mN", "is negative, so that a loop would create energy", "give 2HB, zero or more")
    if abs(softening) * 2 * SOFTEST_PER_M > B:
        peak = B / (2 * abs(softening))
        reason = f"changes B_uNm = {1e6 * B:g} by all of it at a curvature of {peak:.3g} 1/m"
        remedy = f"of 618 fabrics none does so below 29 1/m; give B2 in nN m2, of a size below {B * 1e9 / 20:.4g}"
        table.refuse("softening_nNm2", reason, remedy)
    return BendingCurve(B, softening, hysteresis)


def _back(table: Table, warp: BendingCurve, weft: BendingCurve) -> tuple[BendingCurve, BendingCurve]:
    """Warp and weft where K < 0; one that is left out is as on the face."""
    table.expect("", "warp weft")
    if not table.entries:
        table.refuse(
            "warp", "and weft are both missing", "give what differs from the face, or leave [bending] back out"
        )
    faces = {"warp": warp, "weft": weft}
    both = [_curve(table.table(way), "") if way in table.entries else face for way, face in faces.items()]
    return both[0], both[1]


def _twist(
    table: Table, warp: BendingCurve, weft: BendingCurve, coupling: float
) -> tuple[BendingCurve, dict[str, str]]:
    """The curve of twist, and what of it is assumed."""
    given = [key for key in ("bias", "twist") if key in table.entries]
    if len(given) == 2:
        table.refuse("twist", "and bias both tell the twist", "keep the one that was measured")
    if "bias_strip" in table.entries and given != ["bias"]:
        table.refuse("bias_strip", "goes with a bias strip, and there is none", "add bias, or leave it out")
    if given == ["twist"]:
        return _curve(table.table("twist")), {}
    if not given:
        try:
            twist, said = assumed_twist(warp, weft)
        except InputError as error:
            table.refuse("bias", f"is missing, and warp and weft are too far apart to assume one ({error})", "add it")
        return twist, {"twist": said}
    if "bias_strip" not in table.entries:
        remedy = 'write "narrow" (free to twist, a cantilever) or "wide" (held between long grips, KES)'
        table.refuse("bias_strip", "is missing, and a strip that may twist reads another rigidity", remedy)
    wide = table.choice("bias_strip", ("narrow", "wide")) == "wide"
    own = table.table("bias")
    bias = _curve(own)
    bound, kind = bias_bound(warp, weft, wide, coupling), "wide" if wide else "narrow"
    if not (bias.B > bound if wide else bias.B < bound):
        reason = (
            f"is not {'above' if wide else 'below'} {1e6 * bound:.4g}, which warp and weft alone give a {kind} strip"
        )
        other = "narrow" if wide else "wide"
        own.refuse("B_uNm", reason, f'measure it again, write bias_strip = "{other}" if it was, or add coupling_uNm')
    least = least_hysteresis(warp, weft, bias.B, wide, coupling)
    if bias.hysteresis < least * (1 - 1e-9):
        reason = f"is below {1e3 * least:.4g}, which warp and weft alone give a {kind} strip"
        remedy = "give 2HB of the bias strip" + ("" if "hysteresis_mN" in own.entries else ", which is left out")
        own.refuse("hysteresis_mN", reason, f"{remedy}, or twist itself")
    return twist_of_bias(warp, weft, bias, wide, coupling), {}
