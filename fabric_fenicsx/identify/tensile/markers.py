"""What photographs tell: Poisson's ratios from dots on the strip (3.3.3), shear strain from marked yarns (3.3.4)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

from ...errors import InputError
from ...laws import Array
from ..files import cleaning, readings, records
from ..files.records import Record
from ..files.tables import read_table
from . import dots

STILL = 1e-3  # photographs whose displacement is below this part of the largest one show the strip at rest
RESOLVED = 1e-6  # no photograph tells smaller strains
START = 0.02  # a first photograph below this part of it is taken for rest


@dataclass(frozen=True)
class Contraction:
    """Strains of the dots of one specimen at m photographs, while it was loaded, and the slope between them."""

    file: str
    along: Array  # (m,), Green-Lagrange strain along the load
    across: Array  # (m,)
    ratio: float  # -across/along, through the origin, (3.3)
    patches: float  # standard deviation of the ratio from patch to patch of the strip
    notes: tuple[str, ...]


def contraction(path: str | Path) -> Contraction:
    """Poisson's ratio of one warp or weft specimen from the coordinates of at least three dots.

    A line is a photograph; a dot is a pair of columns such as "a_x_mm,a_y_mm" or "x1 (px),y1 (px)". With a column of
    the displacement, all photographs at rest make the reference, else the first one does; those after the largest
    stretch are not used. The strain is that of the deformation gradient that fits all dots best, so the camera may
    be turned and a dot be missing; the scatter is from the triangles between neighbouring dots. Readings of
    dots and photographs that are far off the others are left out. The load is along the direction, x or y, in which
    the dots spread.
    """
    table = read_table(path, ("x", "y"), "displacement_mm,a_x_mm,a_y_mm,b_x_mm,b_y_mm,c_x_mm,c_y_mm")
    pairs = dots.columns(table)
    moved = [i for i, (name, _) in enumerate(table.columns) if records.names("displacement", name)]
    table = table.readings([i for pair in pairs.values() for i in pair] + moved[:1])
    file = table.file
    if not table.cells:
        raise InputError(f"{file}: has no photographs, and a ratio needs 3 and one at rest; take some.")
    if len(readings.groups(table, [])) > 1 or len(set(table.blocks)) > 1:
        raise InputError(
            f"{file}: holds several specimens, or its head twice; put each specimen into a file of its own."
        )
    x, notes = dots.clean(table, list(pairs), dots.read(table, pairs))
    notes = [*table.notes, *notes]
    rest = np.zeros(len(x), dtype=bool)
    rest[0] = True
    if moved:
        d = table.si(moved[0], ("length",))[1]
        reach = float(np.nanmax(np.abs(d), initial=0.0))
        if abs(d[0]) > START * reach:
            raise InputError(
                f"{file}: the first photograph, in line {table.lines[0]}, is at a displacement of {1e3 * d[0]:.4g} mm, "
                "not at rest; add the one at rest, or count the displacement from it."
            )
        rest |= np.abs(d) < STILL * reach
    else:
        notes.append(f"{file}: has no column of the displacement; its first line is taken for rest.")
    if np.isfinite(x[rest]).all(axis=-1).sum() < 3:
        raise InputError(
            f"{file}: line {table.lines[0]}, the photograph at rest, shows fewer than three dots; find its dots again."
        )
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(x[rest]).any(axis=0).all(axis=-1)
        X = np.nanmedian(x[rest][:, seen], axis=0)
    x = x[:, seen]
    if len(X) < 3 or np.linalg.matrix_rank(X - X.mean(axis=0), tol=1e-3 * np.ptp(X)) < 2:
        raise InputError(f"{file}: fewer than three dots, not in line, are seen at rest; mark a grid of dots.")
    E = _strains(x, X)
    whole = np.flatnonzero(np.isfinite(E).all(axis=1))
    off = whole[np.any([cleaning.wild(E[whole, i], RESOLVED) for i in range(2)], axis=0)]
    notes += [f"{file}: the photograph in line {table.lines[k]} is far off the others and is left out." for k in off]
    x[off] = np.nan
    if np.isfinite(x[rest]).any(axis=0).all():
        X = np.nanmean(x[rest], axis=0)
    E = _strains(x, X)
    if not np.isfinite(E).any():
        raise InputError(f"{file}: no photograph shows three dots that are seen at rest; find the dots again.")
    last = int(np.nanargmax(np.abs(E[:, [0, 1]]).max(axis=1) * (E[:, [0, 1]].max(axis=1) > 0)))
    axis = int(np.argmax(E[last, :2]))
    if abs(E[last, 2]) > 0.5 * abs(E[last, axis]):
        raise InputError(
            f"{file}: the dots spread along neither x nor y; turn the coordinates so that one is along the load."
        )
    upto = int(np.nanargmax(E[:, axis]))
    used = np.flatnonzero(np.isfinite(E[: upto + 1, axis]) & ~rest[: upto + 1])
    if len(used) < 3:
        raise InputError(f"{file}: has {len(used)} photographs of the loading, and a ratio needs 3; take more.")
    along, across = E[used, axis], E[used, 1 - axis]
    ratios, triangles = [], Delaunay(X).simplices
    area = np.abs(np.linalg.det(X[triangles[:, 1:]] - X[triangles[:, :1]]))
    for corners in triangles[area > 0.1 * np.median(area)]:  # the rim of a grid has slivers
        patch = _strains(x[used][:, corners], X[corners])
        good = np.isfinite(patch).all(axis=1)
        if good.sum() >= 3:
            ratios.append(_through_origin(patch[good, axis], patch[good, 1 - axis]))
    spread = float(np.std(ratios, ddof=1)) if len(ratios) > 1 else float("nan")
    return Contraction(file, along, across, _through_origin(along, across), spread, tuple(notes))


def shear_strain(record: Record) -> Array:
    """E12 (n,) of the marked yarns, (3.16): half the product of their stretches and the cosine of their angle.

    NaN where there was no photograph; positive in the sense of the load. An angle that opens is the other one of
    the two between the yarns, and its cosine is taken with the other sign.
    """
    y = record.yarns
    for name in ("warp_stretch", "weft_stretch"):
        bad = np.flatnonzero((y[name] < 0.5) | (y[name] > 2))
        if len(bad):
            raise InputError(
                f"{record.file}: column {name} holds {y[name][bad[0]]:.4g}; give current length over first length."
            )
    bad = np.flatnonzero((y["angle"] <= 0) | (y["angle"] >= np.pi))
    if len(bad):
        degrees = np.degrees(y["angle"][bad[0]])
        raise InputError(f"{record.file}: column angle holds {degrees:.4g} degrees; give 0 to 180, and the right unit.")
    E12 = 0.5 * y["warp_stretch"] * y["weft_stretch"] * np.cos(y["angle"])
    seen = np.flatnonzero(np.isfinite(E12))
    if len(seen) < 6:
        raise InputError(f"{record.file}: has {len(seen)} photographs of the yarns, and a curve needs 6; take more.")
    furthest = seen[np.argmax(record.displacement[seen])]
    return E12 if E12[furthest] > 0 else -E12


def _through_origin(along: Array, across: Array) -> float:
    return float(-(along @ across) / (along @ along))


def _strains(x: Array, X: Array) -> Array:
    """(E_xx, E_yy, 2 E_xy) of the best-fitting deformation gradient, (m, 3); NaN without three dots.

    x (m, dots, 2) at m photographs, X (dots, 2) at rest.
    """
    seen = np.isfinite(x).all(axis=-1)
    count = np.maximum(seen.sum(axis=1), 1)[:, None, None]
    A = np.where(seen[..., None], X, 0.0)
    A = np.where(seen[..., None], A - A.sum(axis=1, keepdims=True) / count, 0.0)
    spread = np.einsum("kni,knj->kij", A, A)
    bad = np.linalg.det(spread) < 1e-6 * np.ptp(X) ** 4  # too few, or in line
    F = np.einsum("kni,knj->kij", np.where(seen[..., None], x, 0.0), A) @ np.linalg.pinv(spread)
    C = np.swapaxes(F, 1, 2) @ F
    E = np.column_stack([(C[:, 0, 0] - 1) / 2, (C[:, 1, 1] - 1) / 2, C[:, 0, 1]])
    E[bad] = np.nan
    return E
