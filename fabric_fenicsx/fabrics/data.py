"""What a measured fabric is: three stress-strain curves, two pairs of Poisson's ratios, thickness, density, test."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Curve:
    """One measured curve of second Piola-Kirchhoff stress (Pa) against the Voigt strain E11, E22 or gamma = 2 E12.

    modulus:    four coefficients (Pa), ascending powers: dS/dstrain = sum c_k strain^k for 0 <= strain <= limit
    unloading:  modulus of unloading and reloading (Pa)
    limit:      largest calibrated strain; from there the stress goes on along its tangent
    """

    modulus: tuple[float, ...]
    unloading: float
    limit: float

    def stress(self, strain: ArrayLike) -> NDArray[np.float64]:
        """Virgin-loading stress (Pa) at strains of any shape: the modulus integrated from zero."""
        strain = np.asarray(strain, dtype=float)
        inside = np.clip(strain, 0.0, self.limit)
        return polynomial.polyval(inside, polynomial.polyint(self.modulus)) + self.tangent(strain) * (
            strain - inside
        )

    def tangent(self, strain: ArrayLike) -> NDArray[np.float64]:
        """Virgin-loading modulus (Pa) at strains of any shape; beyond the limit that of the limit, below 0 that of 0."""
        return polynomial.polyval(np.clip(np.asarray(strain, dtype=float), 0.0, self.limit), self.modulus)


@dataclass(frozen=True)
class Fabric:
    """One woven fabric, SI units; stresses are over the measured thickness.

    poisson:       (nu12, nu21) under "measured" and "lowered" (the same where the source lowers none); nu12 is the
                   contraction along weft per stretch along warp
    displacement:  how far the test of "warp", "weft" and "bias" went (m), on a strip of gauge_length x width (m)
    sources:       where the numbers come from, per entry of the file
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

    def plot(self, path: str | PathLike[str] | None = None) -> Figure:
        """Draw loading, its continuation by the tangent, and unloading of warp, weft and shear; save it if asked.

        Returns the figure. A path that cannot be written raises OSError, an unknown picture format ValueError.
        """
        from matplotlib.figure import Figure

        figure = Figure(figsize=(10.5, 3.6), layout="constrained")
        panels = (("warp", self.warp, "E_{11}", "S_{11}"), ("weft", self.weft, "E_{22}", "S_{22}"))
        panels += (("shear", self.shear, r"\gamma = 2 E_{12}", "S_{12}"),)
        for axes, (title, curve, strain, stress) in zip(figure.subplots(1, 3), panels, strict=True):
            measured = np.linspace(0.0, curve.limit, 200)
            beyond = np.array([1.0, 1.25]) * curve.limit
            peak = float(curve.stress(curve.limit)) / 1e6
            slack = curve.limit - peak * 1e6 / curve.unloading
            axes.plot(measured, curve.stress(measured) / 1e6, "k-", label="loading, measured range")
            axes.plot(beyond, curve.stress(beyond) / 1e6, "k:", label="continued by its tangent")
            axes.plot([curve.limit, slack], [peak, 0.0], "--", color="0.35", label="unloading")
            axes.plot(curve.limit, peak, "ko", markersize=4)
            axes.set(title=title, xlabel=f"strain ${strain}$", ylabel=f"stress ${stress}$ (MPa)")
            axes.set(xlim=(0.0, None), ylim=(0.0, None))
            axes.grid(color="0.9")
            axes.spines[["top", "right"]].set_visible(False)
        figure.axes[0].legend(frameon=False, fontsize="small", loc="upper left")
        figure.suptitle(f"{self.name} ({self.label}): {self.material.lower()}, {self.weave.lower()} weave")
        if path is not None:
            figure.savefig(path, dpi=150)
        return figure
