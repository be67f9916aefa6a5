"""A sheet of all photographs in which a person sees which marks were found, and which were lost."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import plots
from ..laws import Array
from .tracking import BY_HAND, FOUND, LOST, Tracks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 24  # photographs: the first, the last, those that lost most, and others evenly between
NAMED = 100  # marks: of more no name could be read
WIDE, TITLE = 9.0, 0.3  # inches
LOOKS: dict[int, tuple[str, dict[str, Any]]] = {
    FOUND: ("found", {"marker": "+", "color": "#009e73"}),
    BY_HAND: ("by hand", {"marker": "s", "color": "#0072b2", "mfc": "none"}),
    LOST: ("lost, looked for here", {"marker": "x", "color": "#d55e00"}),
}


def chosen(tracks: Tracks) -> list[int]:
    """Numbers of the photographs that are shown."""
    m = len(tracks.x)
    lost = (tracks.state == LOST).sum(axis=1)
    worst = [int(k) for k in np.argsort(-lost, kind="stable")[: SHOWN // 3] if lost[k]]
    even = np.linspace(0, m - 1, SHOWN - len(worst)).round().astype(int).tolist() if m > SHOWN else range(m)
    return sorted({0, m - 1, *worst, *even})


def write(
    path: Path, photographs: Sequence[str], names: Sequence[str], tracks: Tracks, light: Callable[[int], Array]
) -> None:
    """Draw it; light: (rows, columns) of the photograph of a number. Raises OSError."""
    from matplotlib.figure import Figure

    shown = chosen(tracks)
    low, high = tracks.x[shown].min(axis=(0, 1)), tracks.x[shown].max(axis=(0, 1))
    margin = 0.06 * float((high - low).max()) + 10
    low, high = low - margin, high + margin
    ratio = float((high - low)[1] / (high - low)[0])
    across = min(len(shown), max(2, round(np.sqrt(1.3 * len(shown) * ratio))))
    down = -(-len(shown) // across)
    head, small = min(0.8 * WIDE, 0.9 * WIDE * ratio), (WIDE / across, WIDE / across * ratio)  # inches
    height = head + TITLE + down * (small[1] + TITLE)
    figure = Figure(figsize=(WIDE, height))

    def axes(left: float, top: float, width: float, tall: float) -> "Axes":
        return figure.add_axes((left / WIDE, 1 - (top + TITLE + tall) / height, width / WIDE, tall / height))

    first = axes((WIDE - head / ratio) / 2, 0.0, head / ratio, head)
    _photograph(first, light(0), tracks, 0, low, high, 7)
    for name, (x, y) in zip(names, tracks.x[0], strict=True) if len(names) <= NAMED else ():
        first.annotate(name, (x, y), (6, 6), textcoords="offset points", size=8, color="#b0006d")
    share = 100 * (tracks.state != LOST).mean()
    first.set_title(f"{photographs[0]}: {len(names)} marks; in all {len(photographs)} photographs {share:.1f} % of "
                    "them are found", size=10, parse_math=False)  # fmt: skip
    first.legend(fontsize=8, loc="upper right")
    for i, k in enumerate(shown):
        below = head + TITLE + (i // across) * (small[1] + TITLE)
        one = axes(i % across * small[0] + 0.03, below, small[0] - 0.06, small[1])
        _photograph(one, light(k), tracks, k, low, high, 4)
        lost = [name for name, state in zip(names, tracks.state[k], strict=True) if state == LOST]
        said = f"lost {' '.join(lost[:4])}{' ...' if len(lost) > 4 else ''}" if lost else "all found"
        one.set_title(f"{photographs[k]}: {said}", size=7, color="#d55e00" if lost else "black", parse_math=False)
    plots.save(figure, path)


def _photograph(axes: "Axes", light: Array, tracks: Tracks, k: int, low: Array, high: Array, size: float) -> None:
    """A photograph with its marks, cut to where marks are."""
    axes.axis("off")
    step = max(1, round(float((high - low).max()) / (1600 if size > 5 else 500)))
    rows, columns = light.shape
    extent = (-0.5, columns - 0.5, rows - 0.5, -0.5)
    axes.imshow(light[::step, ::step], cmap="gray", extent=extent, vmin=0, interpolation="antialiased")
    for state, (label, style) in LOOKS.items():
        x = tracks.x[k, tracks.state[k] == state]
        if len(x) or (k == 0 and size > 5 and (tracks.state == state).any()):
            axes.plot(*x.T, ls="none", ms=size, mew=0.8, label=label, **style)
    axes.set(xlim=(low[0], high[0]), ylim=(high[1], low[1]), aspect="equal")
