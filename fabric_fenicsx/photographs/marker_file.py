"""The file of the marks: a line a photograph, as `identify` reads it.

    photograph,displacement_mm,force_N,m01_x_mm,m01_y_mm,m02_x_mm, ...

With the record of the testing machine, which names its photographs in a column "photograph", its columns come along,
and its lines without a photograph; the file of a bias test is then a record of force with the marked yarns, too: of the
deformation gradient that fits the marks best, warp_stretch, weft_stretch and the angle between them.
"""

import csv
import io
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .. import files
from ..errors import InputError
from ..identify.files import tables
from ..laws import Array

PHOTOGRAPH = "photo|picture|image|foto|bild|写真"


def record(path: str | Path) -> tables.Table:
    """The record of the machine, whose column of photographs is named in `PHOTOGRAPH`."""
    return tables.read_table(path, (PHOTOGRAPH,), "photograph,displacement_mm,force_N")


def rows_of(table: tables.Table, photographs: Sequence[Path]) -> list[int]:
    """The line of the record at which each photograph was taken; raises InputError where one is missing."""
    column = _column(table)
    cells = [Path(cell).name for cell in table.column(column)]
    out = []
    for photo in photographs:
        at = [i for i, cell in enumerate(cells) if cell and cell in (photo.name, photo.stem)]
        if len(at) != 1:
            raise InputError(
                f"{table.file}: its column {table.headers[column]!r} names {photo.name} {len(at)} times; "
                "name each photograph once, in the line of its moment."
            )
        out.append(at[0])
    return out


def _column(table: tables.Table) -> int:
    return next(i for i, (name, _) in enumerate(table.columns) if re.search(PHOTOGRAPH, name))


def gradient(x: Array, X: Array) -> tuple[Array, float]:
    """Deformation gradients (m, 2, 2) that fit marks x (m, n, 2) best, from X (n, 2), NaN without three marks.

    And by how much of the size of the grid the marks miss them (root mean square), over all photographs.
    """
    F, miss = np.full((len(x), 2, 2), np.nan), []
    for k, one in enumerate(x):
        seen = np.isfinite(one).all(axis=-1)
        if seen.sum() < 3:
            continue
        A, b = X[seen] - X[seen].mean(axis=0), one[seen] - one[seen].mean(axis=0)
        if np.linalg.svd(A, compute_uv=False)[-1] < 1e-3 * np.ptp(X):
            continue
        F[k] = np.linalg.lstsq(A, b)[0].T
        miss.append(((A @ F[k].T - b) ** 2).sum(axis=1).mean())
    return F, float(np.sqrt(np.mean(miss)) / np.ptp(X)) if miss else float("nan")


def yarns(F: Array, warp: float) -> dict[str, Array]:
    """Stretches of warp and weft and their angle in degrees, each (m,); warp in radians from x to y at first."""
    ways = np.array([[np.cos(warp), np.sin(warp)], [-np.sin(warp), np.cos(warp)]])
    now = np.einsum("mij,aj->mai", F, ways)
    length = np.linalg.norm(now, axis=-1)
    angle = np.degrees(np.arccos((now[:, 0] * now[:, 1]).sum(axis=-1) / length.prod(axis=1)))
    return {"warp_stretch (-)": length[:, 0], "weft_stretch (-)": length[:, 1], "angle (deg)": angle}


def write(path: Path, photographs: Sequence[Path], names: Sequence[str], x: Array, unit: str, *,
          table: tables.Table | None = None, more: dict[str, Array] | None = None) -> None:  # fmt: skip
    """Write marks x (m, n, 2), NaN where lost, beside the columns `more` (m,) and those of a record.

    Photographs are named as they lie from the folder of the file.
    """
    heads = [f"{name}_{axis}_{unit}" for name in names for axis in "xy"]
    columns = np.array([*(more or {}).values(), *x.reshape(len(x), -1).T])
    cells = [["" if np.isnan(v) else f"{v:.5f}" for v in line] for line in columns.T]
    heads = [*(more or {}), *heads]
    there = [os.path.relpath(photo, path.parent) for photo in photographs]
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    if table is None:
        out.writerow(["photograph", *heads])
        out.writerows([[one, *line] for one, line in zip(there, cells, strict=True)])
    else:
        at, column = {row: k for k, row in enumerate(rows_of(table, photographs))}, _column(table)
        named = [name if unit is None else f"{name} ({unit})" for name, unit in table.columns]
        out.writerow([*named[:column], "photograph", *named[column + 1 :], *heads])
        for row, line in enumerate(table.cells):
            k = at.get(row)
            own = [*line[:column], "" if k is None else there[k], *line[column + 1 :]]
            out.writerow([*own, *([""] * len(heads) if k is None else cells[k])])
    files.replace(path, text.getvalue())
