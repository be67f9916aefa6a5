"""Digital image correlation: facets of a pattern of speckles, sprayed or the cloth's own, through photographs.

A facet is a square of pixels of the first photograph. In another one it is where its light correlates best with that of
the first under an affine map (OpenCV's `findTransformECC`; even changes of light are none), from where it was in the
photograph before, moved by the optical flow between the two (`DISOpticalFlow`). No error adds up, as every photograph
is compared with the first. Strains are those of the affine map that fits a facet and its neighbours best.
"""

import csv
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from .. import files, plots
from ..errors import InputError
from ..laws import Array
from .reading import toolkit
from .tracking import BY_HAND, FOUND, LOST, Tracks, carried

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIDE = 31  # pixels of a facet
LEAST_SIDE = 11
CONTRAST = 0.01  # standard deviation of the light of a facet below which nothing can be followed
ALIKE = 0.8  # coefficient of correlation
APART = 0.5  # of the side: how far a facet may be from where the flow takes it
MARGIN = 8  # pixels around a facet
BLUR, ITERATIONS, SMALL = 5, 60, 1e-5  # of the correlation
NEIGHBOURS = 9  # with the facet itself


def facets(light: Array, region: tuple[int, int, int, int], side: int) -> Array:
    """Middles (n, 2) of the facets that a region (x0, y0, x1, y1) of the first photograph holds, side by side.

    Raises InputError where fewer than three show anything.
    """
    half, (x0, y0, x1, y1) = side // 2, region
    columns, rows = np.arange(x0 + half, x1 - half, side), np.arange(y0 + half, y1 - half, side)
    x = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    shown = np.array([light[_square(place, half)].std() > CONTRAST for place in x], dtype=bool)
    if shown.sum() < 3:
        raise InputError(
            f"shows fewer than three facets of {side} x {side} pixels with speckles; spray more of them, or give "
            "--size, the side of a facet in pixels, or --region"
        )
    return x[shown].astype(float)


def follow(photographs: Sequence[Callable[[], Array]], x0: Array, hand: Array, side: int) -> Tracks:
    """Follow facets from their middles `x0` (n, 2); `hand` as in `tracking.follow`, photographs: opened one by one."""
    cv2 = toolkit()
    (m, n), half = hand.shape[:2], side // 2
    x, state = np.zeros((m, n, 2)), np.full((m, n), FOUND)
    x[0], maps = x0, np.tile(np.eye(2), (n, 1, 1))
    first = before = photographs[0]()
    squares = [np.ascontiguousarray(first[_square(np.round(place).astype(int), half)]) for place in x0]
    flows = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    for k in range(1, m):
        light = photographs[k]()
        flow = flows.calc(_bytes(before), _bytes(light), None)
        for j in range(n):
            guess, turned = _moved(flow, x[k - 1, j], half)
            x[k, j], maps[j], state[k, j] = _found(squares[j], light, guess, turned @ maps[j])
        seen = state[k] == FOUND
        # the flow of what covers a facet tells nothing of it
        for j in np.flatnonzero(~seen & seen.any()).tolist():
            guess = carried(x0[j : j + 1], x0[seen], x[k, seen])[0]
            next_to = np.flatnonzero(seen)[np.linalg.norm(x0[seen] - x0[j], axis=1).argmin()]
            x[k, j], maps[j], state[k, j] = _found(squares[j], light, guess, maps[next_to])
        given = np.isfinite(hand[k]).all(axis=-1)
        x[k, given], state[k, given] = hand[k, given], BY_HAND
        state[k, np.isinf(hand[k]).any(axis=-1)] = LOST
        before = light
    return Tracks(x, state)


def strains(x: Array, X: Array) -> Array:
    """Green-Lagrange strains xx, yy, xy (m, n, 3) of facets at x (m, n, 2), NaN where lost, from X (n, 2) at first."""
    near = cKDTree(X).query(X, k=min(NEIGHBOURS, len(X)))[1]
    E = np.full((*x.shape[:2], 3), np.nan)
    for k, one in enumerate(x):
        seen = np.isfinite(one).all(axis=-1)
        for j, some in enumerate(near):
            some = some[seen[some]]
            A = np.column_stack([np.ones(len(some)), X[some] - X[j]])
            if not seen[j] or len(some) < 4 or np.linalg.matrix_rank(A, tol=1e-3 * np.ptp(X)) < 3:
                continue
            F = np.linalg.lstsq(A, one[some])[0][1:].T
            C = (F.T @ F - np.eye(2)) / 2
            E[k, j] = C[0, 0], C[1, 1], C[0, 1]
    return E


def write(path: Path, photographs: Sequence[str], names: Sequence[str], X: Array, E: Array, unit: str) -> None:
    """Write the field: a line a facet and photograph."""
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(["photograph", "facet", f"x_{unit}", f"y_{unit}", "E_xx (-)", "E_yy (-)", "E_xy (-)"])
    for photo, field in zip(photographs, E, strict=True):
        for name, place, strain in zip(names, X, field, strict=True):
            if np.isfinite(strain).all():
                out.writerow([photo, name, *(f"{v:.4f}" for v in place), *(f"{v:.6f}" for v in strain)])
    files.replace(path, text.getvalue())


def draw(light: Array, places: Array, E: Array, title: str) -> "Figure":
    """The three strains (n, 3) of facets at places (n, 2) over their photograph."""
    figure, panels = plots.panels(3, width=3.6, height=4.2)
    for axes, values, name in zip(panels, E.T, ("xx", "yy", "xy"), strict=True):
        axes.imshow(light, cmap="gray", vmin=0, alpha=0.6)
        shown = axes.scatter(places[:, 0], places[:, 1], c=values, s=14, cmap="viridis")
        figure.colorbar(shown, ax=axes, shrink=0.7, label=f"$E_{{{name}}}$ (-)")
        axes.axis("off")
    figure.suptitle(title, size=10, parse_math=False)
    return figure


def _square(place: np.ndarray, half: int) -> tuple[slice, slice]:
    return slice(place[1] - half, place[1] + half + 1), slice(place[0] - half, place[0] + half + 1)


def _bytes(light: Array) -> np.ndarray:
    return np.round(255 * np.clip(light, 0, 1)).astype(np.uint8)


def _moved(flow: Array, place: Array, half: int) -> tuple[Array, Array]:
    """Where a place (2,) goes with the flow (rows, columns, 2) around it, and the gradient (2, 2) of that motion."""
    rows, columns = flow.shape[:2]
    j, i = np.clip(np.round(place).astype(int), half, [columns - 1 - half, rows - 1 - half])
    window = flow[i - half : i + half + 1 : 3, j - half : j + half + 1 : 3].reshape(-1, 2).astype(float)
    y, x = np.mgrid[i - half : i + half + 1 : 3, j - half : j + half + 1 : 3].reshape(2, -1)
    A = np.column_stack([np.ones(len(x)), x - place[0], y - place[1]])
    c = np.linalg.lstsq(A, window)[0]
    return place + c[0], np.eye(2) + c[1:].T


def _found(square: Array, light: Array, guess: Array, turned: Array) -> tuple[Array, Array, int]:
    """Place and map of a facet, and whether they are found: else they are those of the guess."""
    place, new, alike = _correlated(square, light, guess, turned)
    good = alike > ALIKE and np.linalg.norm(place - guess) < APART * len(square)
    return (place, new, FOUND) if good else (guess, turned, LOST)


def _correlated(square: Array, light: Array, guess: Array, turned: Array) -> tuple[Array, Array, float]:
    """Place (2,) and map (2, 2) under which a square correlates best with a photograph, and the coefficient."""
    cv2, half = toolkit(), len(square) // 2
    reach = int(np.ceil(half * np.abs(turned).sum(axis=1).max())) + MARGIN
    middle = np.clip(np.round(np.nan_to_num(guess)), 0, [light.shape[1] - 1, light.shape[0] - 1]).astype(int)
    low = np.maximum(middle - reach, 0)
    cut = np.ascontiguousarray(light[low[1] : middle[1] + reach + 1, low[0] : middle[0] + reach + 1])
    start = np.column_stack([turned, guess - low - turned @ [half, half]]).astype(np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, ITERATIONS, SMALL)
    try:
        alike, found = cv2.findTransformECC(square, cut, start, cv2.MOTION_AFFINE, criteria, None, BLUR)
    except cv2.error:  # it has left the picture, or nothing in it is alike
        return guess, turned, 0.0
    found = np.asarray(found, dtype=float)
    return found[:, :2] @ [half, half] + found[:, 2] + low, found[:, :2], float(alike)
