"""What a measured fabric is: three stress-strain curves, Poisson's ratios, thickness, density, its tests."""

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


@dataclass(frozen=True)
class Fabric:
    """One woven fabric in SI units; stresses are over the measured thickness.

    poisson:       (nu12, nu21) under "measured" and "lowered" (as measured, where the source lowers none);
                   nu12 is the contraction along weft per stretch along warp
    displacement:  how far the tests along "warp", "weft", "bias" went (m), on strips of gauge_length x width (m)
    sources:       where the numbers come from, by the entries of the file
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
        """Draw loading, its continuation by the tangent, and unloading, for warp, weft, shear; save if asked.

        Raises OSError where the path cannot be written, ValueError where its ending is no picture format.
        """
        from matplotlib.figure import Figure

        figure = Figure(figsize=(10.5, 3.8), layout="constrained")
        curves = {"warp": self.warp, "weft": self.weft, "shear": self.shear}
        symbols = (("E_{11}", "S_{11}"), ("E_{22}", "S_{22}"), (r"\gamma = 2E_{12}", "S_{12}"))
        for axes, (title, curve), (strain, stress) in zip(figure.subplots(1, 3), curves.items(), symbols, strict=True):
            measured = np.linspace(0.0, curve.limit, 200)
            beyond = np.array([1.0, 1.25]) * curve.limit
            peak = float(curve.stress(curve.limit))
            slack = curve.limit - peak / curve.unloading
            axes.plot(measured, curve.stress(measured) / 1e6, "k-", label="loading, measured range")
            axes.plot(beyond, curve.stress(beyond) / 1e6, "k:", label="continued along its tangent")
            axes.plot([curve.limit, slack], [peak / 1e6, 0.0], "--", color="0.4", label="unloading")
            axes.plot(curve.limit, peak / 1e6, "ko", markersize=4, label="calibrated limit")
            axes.set(title=title, xlabel=f"strain ${strain}$ (-)", ylabel=f"stress ${stress}$ (MPa)")
            axes.set(xlim=(0.0, None), ylim=(0.0, None))
            axes.locator_params(nbins=6)
            axes.grid(color="0.9")
            axes.spines[["top", "right"]].set_visible(False)
        figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
        figure.suptitle(f"{self.name} ({self.label}): {self.material.lower()}, {self.weave.lower()} weave")
        if path is not None:
            figure.savefig(path, dpi=150)
        return figure
