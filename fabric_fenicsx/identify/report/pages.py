"""The whole report, from one list of figures: report.pdf, a page each, and report.html, one file with all of them.

After the page of `page` come the tests as they were recorded, force over displacement in N and mm with the cycle of
the identified fabric over them; the tests beside the law, where there is one fit of all; and where the file of a test
names its photographs, as `fabric-fenicsx markers` writes it, the one at the highest load, with the simulated strip
beside it.
"""

import base64
import html
import io
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ... import files, plots
from ...fabrics import Fabric
from ...fabrics.per_width import PerWidth
from ...laws import Array
from ...laws.potential import Potential
from ..files import records, tables
from ..files.records import Record
from ..identified import Identified
from ..tensile import curves, point
from . import comparison
from . import page as report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ANGLES = {"warp": 0.0, "weft": 90.0, "bias": 45.0}
COLUMNS, SHOWN = 3, 400
PHOTOGRAPH = "photograph"
STYLE = """body { font: 15px/1.5 system-ui, sans-serif; max-width: 68rem; margin: 0 auto; padding: 1rem; color: #222; }
img { max-width: 100%; height: auto; border: 1px solid #ddd; } h1, h2 { line-height: 1.25; }
pre { background: #f6f6f4; padding: 0.7rem; overflow-x: auto; font-size: 0.8rem; line-height: 1.4; }"""
type Simulated = Callable[[float, float], Array]
"""Picture (rows, columns, 3) of the strip with the warp at an angle (degrees), pulled by so many m."""


def write(found: Identified, fabric: Fabric | None, out: Path, simulated: Simulated | None = None, *,
          per_width: PerWidth | None = None) -> None:  # fmt: skip
    """Write report.pdf and report.html into `out`; without a fabric, what was found of it. Raises OSError."""
    from matplotlib.backends.backend_pdf import PdfPages

    figures = [("What the tests tell", report.draw(found, per_width=per_width)), *_recorded(found, fabric)]
    if found.compared:
        figures.append(("Tests beside the law", comparison.draw(found, per_width=per_width)))
    figures += _photographs(found, simulated)
    with files.whole(out / "report.pdf") as rough, PdfPages(rough) as pages:
        for _, figure in figures:
            pages.savefig(figure)
    name = html.escape(found.tests.texts["name"])
    body = f"<h1>{name}</h1>"
    for title, figure in figures:
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=130)
        inlined = base64.b64encode(picture.getvalue()).decode()
        body += f'<h2>{html.escape(title)}</h2><img alt="{html.escape(title)}" src="data:image/png;base64,{inlined}">'
    body += f"<h2>In words</h2><pre>{html.escape(report.words(found, per_width))}</pre>"
    files.replace(
        out / "report.html",
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{name}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n'
        f"<body>{body}</body></html>\n",
    )


def _files(found: Identified) -> list[tuple[str, Path, list[Record]]]:
    """Each file of a test along warp, weft or bias, with its records; several files may have one name."""
    out, left = [], list(found.tested)  # in the order of the list
    for way in ANGLES:
        for path in found.tests.records.get(way, []):
            own: list[Record] = []
            while left and left[0].file.split(" (")[0] == path.name and left[0].file not in [r.file for r in own]:
                own.append(left.pop(0))
            out.append((way, path, own))
    return out


def _recorded(found: Identified, fabric: Fabric | None) -> list[tuple[str, "Figure"]]:
    """Force over displacement of every record of warp, weft and bias, and what the fabric does on the same way."""
    panels = [(way, record) for way, _, own in _files(found) for record in own]
    if not panels:
        return []
    figure, axes = plots.panels(COLUMNS, -(-len(panels) // COLUMNS), width=2.75, height=2.3)
    for one, (way, record) in zip(axes, panels, strict=False):
        some = slice(None, None, max(1, len(record.force) // SHOWN))
        one.plot(1e3 * record.displacement[some], record.force[some], ".", ms=2.5, color="0.55", label="reading")
        if fabric:
            d = record.displacement[some]
            one.plot(1e3 * d, _force(found, fabric, way, d), label="fabric", **plots.FITTED)
        plots.label(one, "", "displacement (mm)", "force (N)")
        one.set_title(f"{way}: {record.file}", size=8, parse_math=False)
    for one in axes[len(panels) :]:
        one.axis("off")
    plots.legend(figure)
    return [("Tests as they were recorded", figure)]


def _force(found: Identified, fabric: Fabric, way: str, d: Array) -> Array:
    """Force (N) of a strip of the fabric that is strained evenly by displacements d (m), and does not push."""
    strip = found.tests.strip
    E = curves.green_lagrange(d, strip.gauge_length)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*is beyond the measured")
        S = point.cycles(Potential(fabric), np.maximum(E, 0.0), np.radians(ANGLES[way]))
    return np.asarray(np.maximum(S, 0.0) * strip.area * (1 + d / strip.gauge_length))


def _photographs(found: Identified, simulated: Simulated | None) -> list[tuple[str, "Figure"]]:
    """The photograph of each test at the highest load, beside the simulated strip."""
    shown: dict[str, tuple[Path, float]] = {}
    for way, path, own in _files(found):
        photograph = _at_the_top(path, found.tests.columns) if len(own) == 1 and way not in shown else None
        if photograph:
            shown[way] = photograph, float(own[0].displacement.max())
    if not shown:
        return []
    figure, axes = plots.panels(2 if simulated else 1, len(shown), width=4.1 if simulated else 8.2, height=2.6)
    across = len(axes) // len(shown)
    for k, (way, (photograph, reach)) in enumerate(shown.items()):
        row = axes[k * across : (k + 1) * across]
        from PIL import Image

        with Image.open(photograph) as opened:
            row[0].imshow(opened.convert("L"), cmap="gray")
        row[0].set_title(f"{way}: {photograph.name}, at the highest load", size=8, parse_math=False)
        if simulated:
            row[1].imshow(simulated(ANGLES[way], reach))
            row[1].set_title(f"simulated strip at {1e3 * reach:.4g} mm", size=8)
        for one in row:
            one.axis("off")
    return [("Photographs", figure)]


def _at_the_top(path: Path, columns: Sequence[str]) -> Path | None:
    """The photograph at the largest force that a file names, if it is there."""
    table = tables.read_table(path, ("|".join(records.WORDS["force"]),), "force_N", columns)
    named = [i for i, (name, _) in enumerate(table.columns) if name == PHOTOGRAPH]
    if not named:
        return None
    force = next(i for i, (name, _) in enumerate(table.columns) if records.names("force", name))
    cells, values = table.column(named[0]), table.numbers(force)
    rows = [k for k, cell in enumerate(cells) if cell and np.isfinite(values[k])]
    if not rows:
        return None
    photograph = path.parent / cells[max(rows, key=lambda k: abs(values[k]))]
    return photograph if photograph.is_file() else None
