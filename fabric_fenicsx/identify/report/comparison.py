"""A page of tests beside the fabric that was found: what was used for the fit, and what it predicts of the rest."""

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from ... import plots
from ...fabrics.per_width import PerWidth, beside
from ..identified import Compared, Identified

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 3
SHOWN = 300  # readings of one specimen


def draw(found: Identified, *, per_width: PerWidth | None = None) -> "Figure":
    """A panel for each test: readings, one colour a specimen, and the law; per_width as in `report.draw`."""
    from matplotlib.figure import Figure

    rows = -(-len(found.compared) // COLUMNS)
    figure = Figure(figsize=(8.27, 0.9 + 2.6 * rows), layout="constrained")
    figure.suptitle(f"{found.tests.texts['name']}: tests beside the law", size=11, parse_math=False)
    for axes, one in zip(figure.subplots(rows, COLUMNS, squeeze=False).ravel(), found.compared, strict=False):
        _panel(axes, one)
        if per_width:
            beside(axes, found.tests.strip.thickness, per_width, 6)
    for axes in figure.axes[len(found.compared) :]:
        axes.axis("off")
    return figure


def write(found: Identified, path: str | PathLike[str], *, per_width: PerWidth | None = None) -> None:
    """Save the page; the ending says the format (pdf, png, svg). Raises OSError."""
    plots.save(draw(found, per_width=per_width), path, 130)


def _panel(axes: "Axes", one: Compared) -> None:
    for k, readings in enumerate(one.readings):
        some = slice(None, None, max(1, len(readings.strain) // SHOWN))
        axes.plot(readings.strain[some], readings.stress[some] / 1e6, ".", ms=2, color=f"C{k}", alpha=0.5)
    strain, stress = one.law
    axes.plot(np.append(0, strain), np.append(0, stress / 1e6), "k-" if one.used else "k--", lw=1.2)
    rms, end = (100 * miss for miss in one.misses)
    said = f"{'used' if one.used else 'held out'}, {one.how}; rms {rms:.2g} %, end {end:+.2g} %"
    axes.set_title(f"{one.name}\n{said}", size=7, parse_math=False)
    axes.set_xlabel("strain (-)", size=7)
    axes.set_ylabel("stress (MPa)", size=7)
    axes.tick_params(labelsize=6)
    axes.grid(alpha=0.3)
