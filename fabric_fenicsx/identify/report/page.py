"""One page on an identified fabric: every curve over its data, errors and confidence, and what the data do not tell."""

import textwrap
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import plots
from ...fabrics.per_width import PerWidth, beside, factor
from ...laws import Array
from ..bending import panels as bending_panels
from ..identified import WAYS, Curve, Identified

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 400  # readings drawn of one specimen
WIDTH, LINES = 122, 46  # of the table
SOURCE = 115  # characters of a line on where the records come from
SYMBOLS = {"warp": ("E_{11}", "S_{11}"), "weft": ("E_{22}", "S_{22}"), "shear": ("E_{12}", "S_{12}")}


def draw(found: Identified, *, per_width: PerWidth | None = None) -> "Figure":
    """The page, A4; per_width: a unit of `fabrics.per_width` for second axes and lines of the table."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.27, 11.69))
    apart = 0.8 if per_width else 0.36
    grid = figure.add_gridspec(4, 3, height_ratios=[1.0, 0.32, 0.85, 1.5], hspace=0.36, wspace=apart,
                               left=0.085, right=0.975, top=0.91, bottom=0.02)  # fmt: skip
    texts, strip = found.tests.texts, found.tests.strip
    title = f"{texts['name']} ({texts['label']}): {texts['material']}, {texts['weave']}"
    figure.text(0.05, 0.965, title, size=14, weight="bold", parse_math=False)
    size = " x ".join(f"{1e3 * side:g}" for side in (strip.gauge_length, strip.width, strip.thickness))
    said = "\n".join(textwrap.wrap(f"strip {size} mm; records: {found.tests.source}", SOURCE, max_lines=2))
    figure.text(0.05, 0.957, said, size=8, va="top", parse_math=False)
    for i, way in enumerate(WAYS):
        axes = figure.add_subplot(grid[0, i])
        _curve(axes, found, way)
        if per_width and way in found.curves:
            beside(axes, strip.thickness, per_width, 6)
        _misfit(figure.add_subplot(grid[1, i]), found, way)
    panels = bending_panels.of(found.bending) if found.bending else []
    row = grid[2, :].subgridspec(1, 3 + len(panels), wspace=0.36 + 0.2 * len(panels))
    for i, (key, test) in enumerate((("nu12", "warp test"), ("nu21", "weft test"))):
        _ratio(figure.add_subplot(row[i]), found, key, test)
    _bias(figure.add_subplot(row[2]), found)
    for i, (title, x, y, panel) in enumerate(panels, 3):
        axes = figure.add_subplot(row[i])
        _frame(axes, title, x, y, True)
        panel(axes)
    axes = figure.add_subplot(grid[3, :])
    axes.axis("off")
    axes.text(
        -0.05, 0.97, _table(found, per_width), family="monospace", size=7, va="top", linespacing=1.35, parse_math=False
    )
    return figure


def write(found: Identified, path: str | PathLike[str], *, per_width: PerWidth | None = None) -> None:
    """Save the page; the ending says the format (pdf, png, svg). Raises OSError."""
    plots.save(draw(found, per_width=per_width), path, 130)


def _frame(axes: "Axes", title: str, x: str, y: str, known: bool, word: str = "not determined") -> bool:
    """Title and labels; where nothing is known, that is said in the panel. Returns `known`."""
    axes.set_title(title, size=9)
    axes.set_xlabel(x, size=8)
    axes.set_ylabel(y, size=8)
    axes.tick_params(labelsize=7)
    if known:
        axes.grid(alpha=0.3)
    else:
        axes.set(xticks=[], yticks=[])
        axes.text(0.5, 0.5, word, ha="center", va="center", transform=axes.transAxes, size=8)
    return known


def _dots(axes: "Axes", x: Array, y: Array, **style: Any) -> None:
    some = slice(None, None, max(1, len(x) // SHOWN))
    axes.plot(x[some], y[some], ".", ms=1.5 if len(x) > 100 else 4.0, **style)


def _data(axes: "Axes", curve: Curve) -> None:
    """Readings and the fitted curve, MPa."""
    fit = curve.loading
    for k, readings in enumerate(curve.readings):
        _dots(axes, readings.strain, readings.stress / 1e6, color=f"C{k}", alpha=0.5)
    for E, S in curve.ways_back:
        _dots(axes, E, S / 1e6, color="0.7", zorder=0)
    E = np.linspace(0, fit.limit, 200)
    axes.plot(E, (curve.friction + fit.stress(E)) / 1e6, "k-", lw=1.2)
    top = float(fit.stress(np.array(fit.limit))) / 1e6
    axes.set_ylim(-0.05 * top, 1.1 * top)


def _curve(axes: "Axes", found: Identified, way: str) -> None:
    stress = SYMBOLS[way][1]
    if not _frame(axes, way, "", f"${stress}$ (MPa)", way in found.curves):
        return
    curve = found.curves[way]
    _data(axes, curve)
    limit, top = curve.loading.limit, float(curve.loading.stress(np.array(curve.loading.limit)))
    slack = limit - top / found.unloading(way)
    axes.plot([limit, slack], [top / 1e6, 0], "k--" if curve.unloading else "k:", lw=1.0)
    axes.set_xlim(min(0.0, slack) - 0.02 * limit, 1.08 * limit)


def _misfit(axes: "Axes", found: Identified, way: str) -> None:
    known = way in found.curves and bool(found.curves[way].readings)
    word = "fitted to the force of the bias test" if way in found.curves else "not determined"
    if not _frame(axes, "", f"${SYMBOLS[way][0]}$ (-)", "misfit (%)", known, word):
        return
    fit = found.curves[way].loading
    top = float(fit.stress(np.array(fit.limit)))
    for k, readings in enumerate(found.curves[way].readings):
        miss = 100 * (readings.stress - found.curves[way].friction - fit.stress(readings.strain)) / top
        _dots(axes, readings.strain, miss, color=f"C{k}", alpha=0.5)
    axes.axhline(0.0, color="k", lw=1.0)
    axes.set_xlim(-0.02 * fit.limit, 1.08 * fit.limit)


def _ratio(axes: "Axes", found: Identified, key: str, test: str) -> None:
    title = rf"$\nu_{{{key[2:]}}}$, {test}"
    word = f"no dots; assumed {found.tests.assumed[key]:g}" if key in found.tests.assumed else "not determined"
    if not _frame(axes, title, "strain along the load (-)", "strain across (-)", key in found.poisson, word):
        return
    for k, one in enumerate(found.contractions[key]):
        axes.plot(one.along, one.across, ".", ms=2.5, color=f"C{k}", alpha=0.6)
    furthest = max(float(one.along.max()) for one in found.contractions[key])
    axes.plot([0, furthest], [0, -found.poisson[key].value * furthest], "k-", lw=1.2)


def _bias(axes: "Axes", found: Identified) -> None:
    known = found.bias is not None
    if _frame(axes, "bias test as it was pulled", "axial strain (-)", "axial stress $S$ (MPa)", known) and found.bias:
        _data(axes, found.bias)
        shear = found.curves.get("shear")
        if shear and shear.simulated:
            E, S = shear.simulated
            axes.plot(E, S / 1e6, "kx", ms=5, label="simulated strip")
            axes.legend(fontsize=7)


def words(found: Identified, per_width: PerWidth | None = None) -> str:
    """Parameters with standard errors, errors of the fits, what is not determined, remarks."""
    lines = [
        "dots: readings, one colour a specimen, unloading grey; line: fit; dashed: unloading (dotted: not measured);",
        "misfit: reading less fit, in percent of the largest stress of the fit",
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
        if per_width:
            scale = factor(per_width, found.tests.strip.thickness)
            per = ", ".join(f"{c * scale:.4g}" for c in fit.modulus)
            top = float(fit.stress(np.array(fit.limit))) * scale
            lines.append(f"      per width, {per_width}: coefficients {per}; {top:.4g} at the end of the curve")
    for key, several in found.contractions.items():
        number, patches = found.poisson[key], np.mean([one.patches for one in several])
        lines.append(f"{key}  {number}, n = {number.specimens}; from patch to patch of a strip ± {patches:.2g}")
    if found.bias is not None:
        kilby = f"{found.kilby / 1e6:.3g}" if found.kilby else "not determined"
        line = f"bias  initial modulus {found.bias.loading.modulus[0] / 1e6:.3g}; G12 by Kilby (3.4) {kilby}"
        if "shear" in found.curves:
            line += f"; initial G12 of the shear curve {found.curves['shear'].loading.modulus[0] / 2e6:.3g}"
        if found.yarn_stretch is not None:
            line += f"; largest yarn stretch {found.yarn_stretch:.3f}"
        lines.append(line)
    lines += found.bending.fits if found.bending else []
    lines += ["", "not determined", *(f"- {word}" for word in found.undetermined)]
    if found.notes:
        lines += ["", "remarks", *(f"- {note}" for note in found.notes)]
    return "\n".join(
        part for line in lines for part in (textwrap.wrap(line, WIDTH, subsequent_indent="      ") or [""])
    )


def _table(found: Identified, per_width: PerWidth | None) -> str:
    """What of the words goes on the page."""
    wrapped = words(found, per_width).splitlines()
    more = len(wrapped) - LINES
    return "\n".join(wrapped[:LINES] + ([f"... and {more} more lines"] if more > 0 else []))
