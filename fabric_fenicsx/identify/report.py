"""One page on an identified fabric: every curve over its data, errors and confidence, and what the data do not tell."""

import textwrap
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from .identification import WAYS, Identified

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 400  # readings drawn of one specimen
WIDTH, LINES = 122, 46  # of the table
SYMBOLS = {"warp": ("E_{11}", "S_{11}"), "weft": ("E_{22}", "S_{22}"), "shear": ("E_{12}", "S_{12}")}


def draw(found: Identified) -> "Figure":
    """The page, A4."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.27, 11.69))
    grid = figure.add_gridspec(3, 3, height_ratios=[1.0, 0.85, 1.9], hspace=0.3, wspace=0.36,
                               left=0.085, right=0.975, top=0.91, bottom=0.03)  # fmt: skip
    texts = found.tests.texts
    figure.text(
        0.05,
        0.965,
        f"{texts['name']} ({texts['label']}): {texts['material']}, {texts['weave']}",
        size=14,
        weight="bold",
    )
    strip = found.tests.strip
    figure.text(
        0.05,
        0.945,
        f"strip {1e3 * strip.gauge_length:g} x {1e3 * strip.width:g} x {1e3 * strip.thickness:g} mm; "
        f"records: {found.tests.source}",
        size=8,
    )
    for i, way in enumerate(WAYS):
        _curve(figure.add_subplot(grid[0, i]), found, way)
    for i, (key, title) in enumerate((("nu12", "warp test"), ("nu21", "weft test"))):
        _ratio(figure.add_subplot(grid[1, i]), found, key, title)
    _bias(figure.add_subplot(grid[1, 2]), found)
    axes = figure.add_subplot(grid[2, :])
    axes.axis("off")
    axes.text(-0.03, 0.97, _table(found), family="monospace", size=7, va="top", linespacing=1.35)
    return figure


def write(found: Identified, path: str | PathLike[str]) -> None:
    """Save the page; the ending says the format (pdf, png, svg)."""
    draw(found).savefig(path, dpi=130)


def _curve(axes: "Axes", found: Identified, way: str) -> None:
    strain, stress = SYMBOLS[way]
    axes.set_title(f"{way}", size=9)
    axes.set_xlabel(f"${strain}$", size=8)
    axes.set_ylabel(f"${stress}$, MPa", size=8)
    axes.tick_params(labelsize=7)
    if way not in found.curves:
        axes.text(0.5, 0.5, "not determined", ha="center", transform=axes.transAxes, size=8)
        return
    curve = found.curves[way]
    fit = curve.loading
    for k, (readings, offset) in enumerate(zip(curve.readings, fit.offsets, strict=False)):
        some = slice(None, None, max(1, len(readings.strain) // SHOWN))
        axes.plot(readings.strain[some], (readings.stress[some] - offset) / 1e6, ".", ms=1.5, color=f"C{k}", alpha=0.5)
    for E, S in curve.ways_back:
        some = slice(None, None, max(1, len(E) // SHOWN))
        axes.plot(E[some], S[some] / 1e6, ".", ms=1.5, color="0.7", zorder=0)
    E = np.linspace(0, fit.limit, 200)
    axes.plot(E, fit.stress(E) / 1e6, "k-", lw=1.2)
    top = float(fit.stress(np.array(fit.limit)))
    down = np.array([0.0, top / found.unloading(way)])
    axes.plot(fit.limit - down, [top / 1e6, 0], "k--" if curve.unloading else "k:", lw=1.0)
    axes.set_ylim(-0.05 * top / 1e6, 1.1 * top / 1e6)
    axes.set_xlim(left=min(0.0, fit.limit - down[1]))
    axes.grid(alpha=0.3)


def _ratio(axes: "Axes", found: Identified, key: str, title: str) -> None:
    name = rf"$\nu_{{{key[2:]}}}$"
    axes.set_title(f"{name}, {title}", size=9)
    axes.set_xlabel("strain along the load", size=8)
    axes.set_ylabel("strain across", size=8)
    axes.tick_params(labelsize=7)
    if key not in found.poisson:
        axes.text(0.5, 0.5, "not determined", ha="center", transform=axes.transAxes, size=8)
        return
    for k, one in enumerate(found.contractions[key]):
        axes.plot(one.along, one.across, ".", ms=2.5, color=f"C{k}", alpha=0.6)
    furthest = max(float(one.along.max()) for one in found.contractions[key])
    axes.plot([0, furthest], [0, -found.poisson[key].value * furthest], "k-", lw=1.2)
    axes.grid(alpha=0.3)


def _bias(axes: "Axes", found: Identified) -> None:
    axes.set_title("bias test as it was pulled", size=9)
    axes.set_xlabel("axial strain", size=8)
    axes.set_ylabel("axial stress $S$, MPa", size=8)
    axes.tick_params(labelsize=7)
    if found.bias is None:
        axes.text(0.5, 0.5, "no test", ha="center", transform=axes.transAxes, size=8)
        return
    for k, (readings, offset) in enumerate(zip(found.bias.readings, found.bias.loading.offsets, strict=False)):
        some = slice(None, None, max(1, len(readings.strain) // SHOWN))
        axes.plot(readings.strain[some], (readings.stress[some] - offset) / 1e6, ".", ms=1.5, color=f"C{k}", alpha=0.5)
    E = np.linspace(0, found.bias.loading.limit, 200)
    axes.plot(E, found.bias.loading.stress(E) / 1e6, "k-", lw=1.2)
    axes.grid(alpha=0.3)


def _table(found: Identified) -> str:
    """Parameters with standard errors, errors of the fits, what is not determined, remarks."""
    lines = [
        "dots: readings, one colour a specimen, unloading grey; line: fit; dashed: unloading (dotted: not measured)",
        "moduli in MPa over the measured thickness; ± is a standard error, from the scatter of n specimens if n > 1",
        "",
    ]
    for way in WAYS:
        if way not in found.curves:
            continue
        curve, (E, S) = found.curves[way], (symbol.replace("_{", "").replace("}", "") for symbol in SYMBOLS[way])
        fit, terms = curve.loading, []
        for k, (c, error) in enumerate(zip(fit.modulus, fit.errors, strict=True)):
            power = "" if k == 0 else f" {E}" + (f"^{k}" if k > 1 else "")
            terms.append(f"({c / 1e6:.4g} ± {error / 1e6:.2g}){power}")
        back = curve.unloading
        slope = f"{back.value / 1e6:.4g} ± {back.error / 1e6:.2g}" if back else "not measured"
        how = f"n = {len(curve.readings)}" if curve.readings else curve.how
        lines += [
            f"{way:6s}d{S}/d{E} = " + " + ".join(terms) + f" to {E} = {fit.limit:.4g}",
            f"      unloading {slope}; {how}; fit error (rms) {100 * fit.residual:.2g} % of the peak stress; "
            f"standard error of the curve {100 * fit.spread:.2g} %",
        ]
    for key, several in found.contractions.items():
        number, patches = found.poisson[key], np.mean([one.patches for one in several])
        lines.append(f"{key}  {number}, n = {number.specimens}; from patch to patch of a strip ± {patches:.2g}")
    if found.bias is not None:
        kilby = f"{found.kilby / 1e6:.3g}" if found.kilby else "not to be had"
        line = f"bias  initial modulus {found.bias.loading.modulus[0] / 1e6:.3g}; G12 by Kilby (3.4) {kilby}"
        if "shear" in found.curves:
            line += f"; initial G12 of the shear curve {found.curves['shear'].loading.modulus[0] / 2e6:.3g}"
        if found.yarn_stretch is not None:
            line += f"; largest yarn stretch {found.yarn_stretch:.3f}"
        lines.append(line)
    lines += ["", "not determined", *(f"- {word}" for word in found.undetermined)]
    if found.notes:
        lines += ["", "remarks", *(f"- {note}" for note in found.notes)]
    wrapped = [part for line in lines for part in (textwrap.wrap(line, WIDTH, subsequent_indent="      ") or [""])]
    more = len(wrapped) - LINES
    return "\n".join(wrapped[:LINES] + ([f"... and {more} more lines"] if more > 0 else []))
