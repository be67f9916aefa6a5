"""Synthetic bending records of a known fabric, with seeded noise: KES loops and numbers, overhangs, bending lengths."""

from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from ...fabrics import BendingCurve, Fabric
from ...fabrics.bending import bias_of_twist
from ...laws import Array
from ..bending import elastica
from ..bending.elastica import Beam
from ..bending.found import KES_2HB, KES_B
from ..bending.hanging import ASTM_ANGLE
from ..bending.loops import moments

LOOP = 2.5 * np.concatenate([np.arange(0, 100), np.arange(100, -100, -1), np.arange(-100, 101)])
"""Curvatures of a KES loop, 1/m."""
ANGLES = np.radians([15.0, 25.0, 35.0, 45.0, 55.0])


def write(fabric: Fabric, folder: Path, specimens: int, noise: float, rng: np.random.Generator, word: str) -> str:
    """KES loops along warp and weft, overhangs of narrow strips along warp, weft and bias; the table [bending] of them.

    `noise` is the standard deviation over the largest value of each: of the moment, and of the angles.
    """
    curves = fabric.bending_or_estimate()
    bias = bias_of_twist(curves.warp, curves.weft, curves.twist, False, curves.coupling)
    text = ['[bending]\nbias_strip = "narrow"']
    for side, (way, curve) in enumerate((("warp", curves.warp), ("weft", curves.weft), ("bias", bias))):
        text.append(f"\n[bending.{way}]")
        if way != "bias":
            back = curves.back[side] if curves.back else curve
            M = moments(LOOP, curve, back, curves.friction_per_m, True)
            files = [f"{way}_loop_{k}.csv" for k in range(1, specimens + 1)]
            for file in files:
                noisy = M + noise * np.abs(M).max() * rng.standard_normal(len(M))
                table = np.column_stack([LOOP / 100, noisy / KES_2HB])
                head = word + "curvature (1/cm),moment (gf cm/cm)"
                np.savetxt(folder / file, table, "%.6g", ",", header=head, comments="", encoding="utf-8")
            text.append(f"loops = {files}".replace("'", '"'))
        L = overhangs(curve, fabric.areal_mass, curves.friction_per_m)
        angles = ANGLES + noise * ANGLES.max() * rng.standard_normal((specimens, len(L)))
        text.append(f"overhang_mm = {[float(f'{1e3 * x:.6g}') for x in np.tile(L, specimens)]}")
        text.append(f"angle_deg = {[float(f'{x:.5g}') for x in np.degrees(angles.ravel())]}")
    return "\n".join([*text, ""])


def overhangs(curve: BendingCurve, areal_mass: float, spread: float, angles: Array = ANGLES) -> Array:
    """Lengths (m) over which a strip of that mass (kg/m2) hangs at those angles (radians)."""
    beam = Beam(curve, areal_mass, spread)
    longest = (200 * curve.range[1] / beam.weight) ** (1 / 3) + np.sqrt(2 * curve.hysteresis / beam.weight)

    def miss(length: float, angle: float) -> float:
        return float(elastica.overhang_angle(beam, np.array([length]))[0]) - angle

    return np.array([brentq(miss, 1e-3, longest, args=(angle,), xtol=1e-7) for angle in angles])


def numbers(
    curve: BendingCurve, areal_mass: float, spread: float, specimens: int, noise: float, rng: np.random.Generator
) -> dict[str, list[float]]:
    """KES's B and 2HB and bending lengths of one direction, by the keys of the list of tests."""
    c = overhangs(curve, areal_mass, spread, np.array([ASTM_ANGLE]))[0] / 2

    def several(value: float) -> list[float]:
        return [float(f"{x:.6g}") for x in value * (1 + noise * rng.standard_normal(specimens))]

    return {
        "B_gf_cm2_per_cm": several(curve.B / KES_B),
        "2HB_gf_cm_per_cm": several(curve.hysteresis / KES_2HB),
        "bending_length_mm": several(1e3 * c),
    }
