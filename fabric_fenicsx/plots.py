"""Plots of one look: a colour for each fabric, a line for each direction, labels with units, one legend below.

What differs in colour differs in its line or its marker, too, so that a print in grey can be read.
"""

from copy import copy
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import files

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FABRICS = {
    "blend": {"color": "#0072b2", "linestyle": "-", "marker": "o"},
    "duck": {"color": "#d55e00", "linestyle": "--", "marker": "s"},
    "muslin": {"color": "#56b4e9", "linestyle": "-.", "marker": "^"},
    "denim": {"color": "#1a1a1a", "linestyle": ":", "marker": "D"},
}
"""How each fabric of the package is drawn in every plot: colours that the colour-blind tell apart (Okabe and Ito)."""
YARNS = {"warp": "-", "weft": "--", "bias": ":"}
"""Lines of the directions of a test, where the colour is that of the fabric."""
FITTED: dict[str, Any] = {"color": "#b0006d", "lw": 1.0, "ls": (0, (4, 3)), "zorder": 0}
"""How a fitted curve is drawn everywhere."""
SYMBOLS = {"warp": ("E_{11}", "S_{11}"), "weft": ("E_{22}", "S_{22}"), "shear": (r"\gamma = 2E_{12}", "S_{12}")}
"""Strain and stress of the three measured curves."""
_OTHERS = ("#009e73", "#cc79a7", "#e69f00", "#7f7f7f")


def style(name: str, way: str | None = None) -> dict[str, Any]:
    """Keywords of matplotlib's `plot` for a fabric, by its name; one of your own has always the same, too.

    way: direction of a test, of `YARNS` (or another): in the colour of the fabric, its line, and a dot at every point.
    """
    other = {"color": _OTHERS[sum(name.encode()) % len(_OTHERS)], "linestyle": "-", "marker": "v"}
    found = FABRICS.get(name, other)
    return dict(found) if way is None else found | {"linestyle": YARNS.get(way, "-."), "marker": "."}


def series(number: int) -> dict[str, Any]:
    """Keywords of `plot` for a curve that is of no fabric, numbered from 0; none has a fabric's colour."""
    k = number % len(_OTHERS)
    return {"color": _OTHERS[k], "linestyle": ("-", "--", "-.", ":")[k], "marker": "os^vDPX"[number % 7]}


def shades(count: int) -> list[Any]:
    """Colours for areas that lie on each other, from light to dark: those of the pictures."""
    import matplotlib

    return [matplotlib.colormaps["viridis"](1.0 - 0.9 * k / max(count - 1, 1)) for k in range(count)]


def panels(
    across: int, down: int = 1, *, width: float = 4.2, height: float = 3.3, sharex: bool = False, sharey: bool = False
) -> tuple["Figure", list["Axes"]]:
    """A figure and its panels in reading order, each of this width and height (inches)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width * across, height * down), layout="constrained")
    axes = list(figure.subplots(down, across, sharex=sharex, sharey=sharey, squeeze=False).flat)
    for one in axes:
        one.grid(color="0.9")
        one.set_axisbelow(True)
        one.tick_params(labelsize=8)
    return figure, axes


def label(axes: "Axes", title: str, x: str, y: str, **limits: Any) -> None:
    """Title and labels, a unit in brackets; limits: of `Axes.set`, such as ylim."""
    axes.set_title(title, size=10)
    axes.set_xlabel(x, size=9)
    axes.set_ylabel(y, size=9)
    axes.set(**limits)


def plain(*axes: Any) -> None:
    """Plain numbers 1, 2, 5, 10 ... on logarithmic axes, such as `Axes.xaxis`."""
    from matplotlib.ticker import LogLocator, NullFormatter

    for axis in axes:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())


def legend(figure: "Figure", columns: int = 3) -> None:
    """One legend below all panels, each label once; grey where panels give it different colours.

    columns: at most, and no more than the figure has room for.
    """
    from matplotlib.lines import Line2D

    entries: dict[str, Any] = {}
    handle: Any
    for axes in figure.axes:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            first = entries.setdefault(name, handle)
            if isinstance(first, Line2D) and first.get_color() != handle.get_color():
                entries[name] = _grey(first)
    entry = 0.55 + 0.075 * max(map(len, entries), default=0)  # inches, at 8 points
    columns = max(1, min(columns, int(figure.get_figwidth() / entry)))
    figure.legend(entries.values(), entries, loc="outside lower center", ncols=columns, fontsize=8, frameon=False)


def save(figure: "Figure", path: str | PathLike[str], dpi: int = 150) -> None:
    """Write a figure, in whole or not at all. Raises OSError, which names the path."""
    with files.whole(Path(path)) as rough:
        figure.savefig(rough, dpi=dpi)


def _grey(line: Any) -> Any:
    """The same line without the colour of a fabric."""
    grey = copy(line)
    grey.set(color="0.35", markeredgecolor="0.35")
    return grey
