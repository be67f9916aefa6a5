"""Stress per width of cloth beside stress over its thickness, which is a convention: N/m, N/cm, or N per 5 cm strip."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics.data import Fabric

if TYPE_CHECKING:
    from matplotlib.axes import Axes

type PerWidth = Literal["N/m", "N/cm", "N/5cm"]
UNITS: tuple[str, ...] = get_args(PerWidth.__value__)
WIDTHS = {"N/m": 1.0, "N/cm": 0.01, "N/5cm": 0.05}
"""Widths in m."""


def factor(unit: str, thickness: float) -> float:
    """What turns Pa over a thickness (m) into a unit of `UNITS`; InputError for another."""
    if unit not in WIDTHS:
        raise InputError(f"{unit!r} is no force per width; give one of {', '.join(UNITS)}.")
    return thickness * WIDTHS[unit]


def beside(axes: Axes, thickness: float, unit: str, size: float | None = None) -> None:
    """A second axis on the right of a panel of stress in MPa, per width; thickness in m, size of its letters."""
    scale = 1e6 * factor(unit, thickness)
    there, back = (lambda stress: np.asarray(stress) * scale), (lambda force: np.asarray(force, dtype=float) / scale)
    right = axes.secondary_yaxis("right", functions=(there, back))
    right.set_ylabel(f"per width ({unit})", size=size)
    right.tick_params(labelsize=size)


def describe(fabric: Fabric, unit: str) -> list[str]:
    """A line for warp, weft and shear: modulus at rest and unloading, and stress at the end of the curve, per width."""
    scale, out = factor(unit, fabric.thickness), []
    for way in ("warp", "weft", "shear"):
        curve = getattr(fabric, way)
        ends = curve.modulus[0] * scale, float(curve.stress(curve.limit)) * scale, curve.unloading * scale
        modulus, stress, unloading = (f"{value:.4g}" for value in ends)
        out.append(
            f"{way} per width: modulus at rest {modulus} {unit}, unloading {unloading} {unit}, "
            f"stress {stress} {unit} at the end of the curve"
        )
    return out
