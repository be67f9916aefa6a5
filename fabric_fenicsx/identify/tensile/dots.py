"""Dots on a strip as a tracker wrote them: their columns, and which readings of them are wrong.

A dot that is lost (0, 0), mistaken for another, or wild for one photograph leaves its own path, or the place that the
other dots give it under one deformation gradient.
"""

import re

import numpy as np

from ...errors import InputError
from ...laws import Array
from ..files.cleaning import SIGMAS, wild
from ..files.tables import Table

APART = 0.01  # part of the size of the grid: a dot further from where the others put it is wrong, if noise cannot do it
LOST = 0.1  # part of the size of the grid: a dot that moves so far to 0, 0 is lost
GRID = 5  # dots from which on one that is wrong can be told from the others


def columns(table: Table) -> dict[str, tuple[int, int]]:
    """Columns of x and y of every dot; raises InputError for less than three dots."""
    found: dict[str, dict[str, int]] = {}
    for i, (name, _) in enumerate(table.columns):
        match = re.fullmatch(r"(.*?) ?([xy])", name) or re.fullmatch(r"()([xy]) ?(.+)", name)
        if match and table.columns[i][1] is not None:
            found.setdefault((match.groups() + ("",))[0] or (match.groups() + ("",))[2], {})[match[2]] = i
    for dot, pair in found.items():
        if len(pair) < 2:
            raise InputError(
                f"{table.file}: dot {dot!r} has one coordinate only; give columns {dot}_x_mm and {dot}_y_mm."
            )
    if len(found) < 3:
        raise InputError(
            f"{table.file}: has {len(found)} dots, and a strain needs 3; give columns such as a_x_mm, a_y_mm."
        )
    return {dot: (pair["x"], pair["y"]) for dot, pair in found.items()}


def read(table: Table, pairs: dict[str, tuple[int, int]]) -> Array:
    """Coordinates (photographs, dots, 2); any unit, the same for all."""
    read = [[table.si(i, ("length", "pixels")) for i in pair] for pair in pairs.values()]
    if len({kind for pair in read for kind, _ in pair}) > 1:
        raise InputError(f"{table.file}: some dots are in pixels and some in a length; give all in one unit.")
    return np.array([[values for _, values in pair] for pair in read]).transpose(2, 0, 1)


def clean(table: Table, names: list[str], x: Array) -> tuple[Array, list[str]]:
    """Coordinates (photographs, dots, 2) with NaN for those that are wrong, and notes on them."""
    x = np.where(np.isfinite(x).all(axis=-1, keepdims=True), x, np.nan)
    if not np.isfinite(x).any():
        return x, []
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(x).all(axis=(1, 2))
        whole = x[seen] if seen.any() else x
        size = float(np.median(np.nanmax(np.nanmax(whole, axis=1) - np.nanmin(whole, axis=1), axis=-1)))
    notes: list[str] = []
    for bad, word in ((_lost(x, size), "is at 0, 0 and taken for lost"), (_off_path(x, size), "is far off its path")):
        x, said = _without(table, names, x, bad, word)
        notes += said
    x, said = _without(table, names, x, _off_grid(x, size), "is not where the other dots put it")
    return x, notes + said


def _without(table: Table, names: list[str], x: Array, bad: np.ndarray, word: str) -> tuple[Array, list[str]]:
    """NaN for the readings `bad` (photographs, dots), and a note for each dot."""
    bad = bad & np.isfinite(x).all(axis=-1)
    notes = []
    for j in np.flatnonzero(bad.any(axis=0)):
        rows = np.flatnonzero(bad[:, j])
        first = table.lines[rows[0]]
        where = f"line {first}" if len(rows) == 1 else f"{len(rows)} lines from {first} on"
        notes.append(f"{table.file}: dot {names[j]!r} {word} in {where}; left out there.")
    return np.where(bad[..., None], np.nan, x), notes


def _lost(x: Array, size: float) -> np.ndarray:
    """Which dots (photographs, dots) are at 0, 0 and far from there in the photograph before or after."""
    zero = (x == 0).all(axis=-1)
    out = np.zeros_like(zero)
    for j in np.flatnonzero(zero.any(axis=0)):
        known = np.flatnonzero(~zero[:, j] & np.isfinite(x[:, j]).all(axis=-1))
        if len(known):
            nearest = known[np.abs(known[None] - np.arange(len(x))[:, None]).argmin(axis=1)]
            out[:, j] = zero[:, j] & (np.linalg.norm(x[nearest, j], axis=-1) > LOST * size)
    return out


def _off_path(x: Array, size: float) -> np.ndarray:
    """Which dots leave their paths for a photograph or two; where half of them do, the camera has moved."""
    out = np.zeros(x.shape[:2], dtype=bool)
    seen = np.isfinite(x).all(axis=-1)
    for j in range(x.shape[1]):
        known = np.flatnonzero(seen[:, j])
        for axis in range(2):
            out[known, j] |= wild(x[known, j, axis], APART * size)
    out[2 * out.sum(axis=1) >= seen.sum(axis=1)] = False
    return out


def _off_grid(x: Array, size: float) -> np.ndarray:
    """Which dots are not where the others put them, by the affine map from their mean places that fits most of them."""
    out = np.zeros(x.shape[:2], dtype=bool)
    seen = np.isfinite(x).all(axis=-1)
    full = np.flatnonzero(seen.sum(axis=1) >= GRID)
    if not len(full):
        return out
    first = x[full[0]]  # any photograph is as good as another for an affine map
    miss = np.full(x.shape[:2], np.nan)
    for k in full:
        both = np.flatnonzero(seen[k] & seen[full[0]])
        if len(both) >= GRID:
            miss[k, both] = _residuals(first[both], x[k, both])
    sigma = np.nanmedian(miss[full]) if np.isfinite(miss[full]).any() else 0.0
    with np.errstate(invalid="ignore"):
        return miss > max(APART * size, SIGMAS * sigma)


def _residuals(X: Array, x: Array) -> Array:
    """Distances (dots,) from the affine map of X to x, both (dots, 2), whose sum of distances is about the least."""
    A = np.linalg.qr(np.column_stack([np.ones(len(X)), X - X.mean(axis=0)]))[0]
    weight, size = np.ones(len(X)), float(np.ptp(X))
    for _ in range(30):
        weighted = A * weight[:, None]
        miss = np.linalg.norm(A @ np.linalg.solve(weighted.T @ A, weighted.T @ x) - x, axis=1)
        weight = size / np.maximum(miss, 1e-6 * size)
    return miss
