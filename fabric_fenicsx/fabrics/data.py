"""What a measured fabric is: three stress-strain curves, Poisson's ratios, thickness, density, its tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from fabric_fenicsx.fabrics.bending import BendingCurves, estimated_bending
from fabric_fenicsx.fabrics.friction import ShearFriction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fabric_fenicsx.fabrics.per_width import PerWidth


@dataclass(frozen=True)
class Curve:
    """A measured curve of 2nd Piola-Kirchhoff stress (Pa) against the Voigt strain E11, E22 or gamma = 2 E12.

    modulus:    four coefficients (Pa), ascending powers: dS/dstrain = sum c_k strain^k from 0 to the limit
    unloading:  modulus of unloading and reloading (Pa)
    limit:      largest calibrated strain; from there the stress goes on along its tangent
    """

    modulus: tuple[float, ...]
    unloading: float
    limit: float

    def stress(self, strain: ArrayLike) -> NDArray[np.float64]:
        """Stress (Pa) of first loading at strains of any shape: the modulus integrated from zero strain."""
        strain = np.asarray(strain, dtype=float)
        inside = np.clip(strain, 0.0, self.limit)
        fitted = polynomial.polyval(inside, polynomial.polyint(self.modulus))
        return np.asarray(fitted + self.tangent(strain) * (strain - inside))

    def tangent(self, strain: ArrayLike) -> NDArray[np.float64]:
        """Modulus (Pa) of first loading at strains of any shape; constant below zero and beyond the limit."""
        inside = np.clip(np.asarray(strain, dtype=float), 0.0, self.limit)
        return np.asarray(polynomial.polyval(inside, self.modulus))


type TransverseSource = Literal["assumed", "biaxial record", "contraction of clamped strips", "strips off the yarns"]
TRANSVERSE_SOURCES: tuple[str, ...] = get_args(TransverseSource.__value__)
TRANSVERSE = 0.3
"""Where nothing was measured: with 0.1 to 0.3 clamped strips give back their curves and their contraction."""


@dataclass(frozen=True)
class Fabric:
    """One woven fabric in SI units; stresses are over the measured thickness.

    poisson:       (nu12, nu21) under "measured" and "lowered" (as measured, where the source lowers none);
                   nu12 is the contraction along weft per stretch along warp
    displacement:  how far the tests along "warp", "weft", "bias" went (m), on strips of gauge_length x width (m)
    sources:       where the numbers come from, by the entries of the file
    transverse:    stiffness that tension of the warp (of the weft) adds across it, mean over its measured range, as a
                   part of D2(0) (of D1(0)) / (1 - nu12 nu21): how stiff the fabric is in biaxial tension
    """

    name: str
    label: str
    material: str
    weave: str
    thickness: float  # m
    density: float  # kg/m3
    warp: Curve
    weft: Curve
    shear: Curve  # S12 against gamma = 2 E12
    poisson: dict[str, tuple[float, float]]
    gauge_length: float
    width: float
    displacement: dict[str, float]
    sources: dict[str, str]
    transverse: tuple[float, float] = (TRANSVERSE, TRANSVERSE)
    transverse_source: TransverseSource = "assumed"
    bending: BendingCurves | None = None  # None: not measured
    shear_friction: ShearFriction | None = None  # None: not told, the thesis's way

    @property
    def areal_mass(self) -> float:
        """kg/m2."""
        return self.density * self.thickness

    def bending_or_estimate(self) -> BendingCurves:
        """Bending as measured, else assumed for this mass, which its text says; see `estimated_bending`."""
        return self.bending or estimated_bending(self.areal_mass)

    def plot(self, path: str | PathLike[str] | None = None, *, per_width: PerWidth | None = None) -> Figure:
        """Draw loading, its continuation by the tangent, and unloading, for warp, weft, shear; save if asked.

        per_width: a unit of `per_width.UNITS` for a second axis.
        Raises OSError where the path cannot be written, ValueError where its ending is no picture format.
        """
        from .. import plots
        from . import per_width as width

        figure, panels = plots.panels(3, width=3.5 + 0.6 * bool(per_width), height=3.8)
        for axes, (way, (strain, stress)) in zip(panels, plots.SYMBOLS.items(), strict=True):
            curve, look = getattr(self, way), {"color": plots.style(self.name)["color"]}
            measured = np.linspace(0.0, curve.limit, 200)
            beyond = np.array([1.0, 1.25]) * curve.limit
            peak = float(curve.stress(curve.limit))
            slack = curve.limit - peak / curve.unloading
            axes.plot(measured, curve.stress(measured) / 1e6, "-", label="loading, measured range", **look)
            axes.plot(beyond, curve.stress(beyond) / 1e6, ":", label="continued along its tangent", **look)
            axes.plot([curve.limit, slack], [peak / 1e6, 0.0], "--", label="unloading", **look)
            axes.plot(curve.limit, peak / 1e6, "o", markersize=4, label="calibrated limit", **look)
            plots.label(axes, way, f"strain ${strain}$ (-)", f"stress ${stress}$ (MPa)", xlim=(0, None), ylim=(0, None))
            axes.locator_params(nbins=6)
            if per_width:
                width.beside(axes, self.thickness, per_width)
        plots.legend(figure, 4)
        figure.suptitle(f"{self.name} ({self.label}): {self.material.lower()}, {self.weave.lower()} weave", size=11)
        if path is not None:
            plots.save(figure, path)
        return figure


def compare(fabrics: Sequence[Fabric], path: str | PathLike[str], *, per_width: PerWidth | None = None) -> None:
    """Draw stress of first loading against strain of several fabrics: a panel each for warp, weft and shear.

    per_width: a unit of `per_width.UNITS` in place of MPa, which says more where thicknesses differ.
    """
    from .. import plots
    from .per_width import factor

    figure, panels = plots.panels(3, width=3.5, height=4.0)
    for axes, (way, (strain, stress)) in zip(panels, plots.SYMBOLS.items(), strict=True):
        for fabric in fabrics:
            curve = getattr(fabric, way)
            E = np.linspace(0.0, curve.limit, 101)
            scale = factor(per_width, fabric.thickness) if per_width else 1e-6
            axes.plot(E, scale * curve.stress(E), label=fabric.name, markevery=20, ms=4, **plots.style(fabric.name))
        label = f"stress ${stress}$ ({per_width or 'MPa'})"
        plots.label(axes, way, f"strain ${strain}$ (-)", label, xlim=(0, None), ylim=(0, None))
    plots.legend(figure, 4)
    plots.save(figure, path)
