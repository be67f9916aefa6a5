"""Finds marks in a photograph: dots, crosses, or the crossings of a printed or drawn grid.

All three look the same when they are turned by half a turn, and still do on cloth that is stretched and sheared. So
candidates come from what is darker than the cloth around, relative to its light, and the place of a mark is that about
which the picture differs least from itself turned by half a turn; a linear change of light across the mark is fitted
along with it. Lengths here are in pixels, places (x, y) with the middle of the first pixel at 0, 0 and y downward.
"""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ..errors import InputError
from ..laws import Array
from .reading import toolkit

type Kind = Literal["dots", "crosses", "grid"]
KINDS: tuple[str, ...] = get_args(Kind.__value__)
BLUR = 0.8  # standard deviation of the smoothing against noise
LEVELS = np.linspace(0.15, 0.6, 10)  # of the darkest contrast, at which families of marks are looked for
NOISE = 9.0  # median deviations of the contrast: six standard deviations
MIDDLE = 0.45  # of the contrast of a mark: its edge
ALIKE = 1.7  # areas of the marks of one family differ by this factor at most
OTHER = 3.0  # by this factor at most when the cloth is strained
MOST = 20000  # pieces: more are no marks
SOLID = 0.8  # area over that of the hull: a dot has more, a cross less
LEAST_AREA = 8.0
MARGIN = 4.0  # around a mark, for its blurred edge
FIXED = 0.05  # least over largest sharpness of a place in two directions: along a line it is not fixed
SYMMETRIC = 0.6  # of a mark's picture that is alike after half a turn; 1: all of it
FAINT = 0.35  # of its contrast at first: a mark that is fainter is covered
STEPS = 4  # of Gauss and Newton's
GRID = 0.3  # of all that is dark, in one piece that is no mark: a grid


@dataclass(frozen=True)
class Look:
    """How the marks of a series look."""

    kind: str
    dark: bool
    """Darker than the cloth."""
    widest: int
    """Of what is taken for a mark or a line."""
    level: float
    """Contrast from which on a pixel belongs to a mark."""
    radius: float = 0.0
    """Of the picture of a mark."""
    area: float = 0.0
    """Of a dot or cross above that level."""


def contrast(light: Array, widest: int, dark: bool = True) -> Array:
    """By which part a pixel is darker (lighter) than the cloth around, for what is narrower than `widest`."""
    cv2 = toolkit()
    smooth = cv2.GaussianBlur(light, (0, 0), BLUR)
    around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * (widest // 2) + 1,) * 2)
    cloth = cv2.morphologyEx(smooth, cv2.MORPH_CLOSE if dark else cv2.MORPH_OPEN, around)
    found = np.abs(cloth - smooth) / np.maximum(cloth if dark else smooth, 1e-3)
    found[[0, -1], :] = found[:, [0, -1]] = 0.0
    return np.asarray(found, dtype=np.float32)


def look(light: Array, *, kind: str | None = None, dark: bool | None = None, widest: int | None = None) -> Look:
    """How the marks of the first photograph look; what is not given is found. Raises InputError where there are none.

    The marks are the largest family of pieces of about the same area, over all levels of contrast.
    """
    widest = widest or max(15, round(0.05 * min(light.shape)))
    shades = {shade: contrast(light, widest, shade) for shade in ((True, False) if dark is None else (dark,))}
    floors = {shade: _floor(seen) for shade, seen in shades.items()}
    # between dark marks there are light gaps, but less of them
    order = sorted(shades, key=lambda shade: -float(np.maximum(shades[shade] - floors[shade], 0).sum()))
    for shade in order:
        seen, floor = shades[shade], floors[shade]
        levels = LEVELS * float(np.percentile(seen, 99.9))
        families = [_family(seen, Look(kind or "", shade, widest, float(level))) for level in levels[levels > floor]]
        number, best = max(families, key=lambda one: one[0], default=(0, None))
        if best is not None and number > 2:
            if best.kind == "grid":
                return _by_spacing(best, Picture(light, best).marks())  # without ends of lines
            tops = ndimage.maximum_filter(seen, size=round(best.radius))
            x = np.round(candidates(seen, best)).astype(int)
            level = MIDDLE * float(np.median(tops[x[:, 1], x[:, 0]]))
            number, again = _family(seen, replace(best, kind=kind or "", level=level))
            return again if number > 2 else best
    raise InputError(
        "shows fewer than three marks alike, so nothing can be followed; give --kind, --size (the width of a mark "
        "in pixels) or --region, or photograph the marks larger"
    )


def _floor(seen: Array) -> float:
    """Contrast below which are the weave and the noise."""
    usual = float(np.median(seen))
    return max(0.03, usual + NOISE * float(np.median(np.abs(seen - usual))))


def _family(seen: Array, guess: Look) -> tuple[int, Look]:
    """How many marks there are at the level of `guess`, and their look."""
    cv2 = toolkit()
    count, labels, stats, _ = cv2.connectedComponentsWithStats((seen > guess.level).astype(np.uint8))
    area = stats[1:, cv2.CC_STAT_AREA].astype(float)
    if not count > 1:
        return 0, guess
    largest = int(area.argmax())
    if guess.kind == "grid" or (not guess.kind and area[largest] > GRID * area.sum() and area[largest] > 2e3):
        x, y, w, h = stats[1 + largest, :4]
        lines = (labels[y : y + h, x : x + w] == largest + 1).astype(np.uint8)
        width = 2 * float(np.percentile(cv2.distanceTransform(lines, cv2.DIST_L2, 5)[lines > 0], 90))
        one = replace(guess, kind="grid", radius=1.5 * width + 2)
        spots = _crossings(seen, one)
        if len(spots) < 3:
            return 0, guess
        return len(spots), _by_spacing(one, spots)
    family = _alike(labels, stats[1:], guess.kind)
    if len(family) < 3:
        return 0, guess
    solid, reach = np.median([_form(labels, stats[1 + i, :4], i + 1) for i in family[:100].tolist()], axis=0)
    kind = guess.kind or ("dots" if solid > SOLID else "crosses")
    return len(family), replace(guess, kind=kind, radius=float(reach) + MARGIN, area=float(np.median(area[family])))


def _by_spacing(look: Look, x: Array) -> Look:
    """The same with pictures of crossings that reach a third of the way to the next."""
    spacing = float(np.median(cKDTree(x).query(x, k=2)[0][:, 1])) if len(x) > 1 else 3 * look.radius
    return replace(look, radius=float(np.clip(spacing / 3, 4, 25)))


def _alike(labels: np.ndarray, stats: np.ndarray, kind: str) -> np.ndarray:
    """Numbers, from 0, of the pieces that are of the largest family of one area."""
    boxes, area = stats[:, :4], stats[:, 4].astype(float)
    end = np.array(labels.shape[::-1]) - 1
    inside = (boxes[:, :2] > 1).all(axis=1) & (boxes[:, :2] + boxes[:, 2:] < end).all(axis=1)
    fit = np.flatnonzero(inside & (area >= LEAST_AREA) & (boxes[:, 2:].max(axis=1) <= 4 * boxes[:, 2:].min(axis=1)))
    if not 3 <= len(fit) <= MOST:
        return fit[:0]
    if kind in ("dots", "crosses"):
        solid = np.array([_form(labels, boxes[i], i + 1)[0] for i in fit.tolist()]) > SOLID
        fit = fit[solid if kind == "dots" else ~solid]
    size = np.log(area[fit])
    order, reach = np.sort(size), 2 * np.log(ALIKE)
    members = np.searchsorted(order, order + reach, "right") - np.arange(len(order))
    start = order[int(members.argmax())] if len(order) else 0.0
    return fit[(size >= start - 1e-9) & (size <= start + reach + 1e-9)]


def _form(labels: np.ndarray, box: np.ndarray, label: int) -> tuple[float, float]:
    """Area of a piece over that of its convex hull, and the radius of the circle around it, of corners of pixels."""
    cv2 = toolkit()
    x, y, w, h = box
    piece = (labels[y : y + h, x : x + w] == label).astype(np.uint8)
    points = np.argwhere(piece)[:, ::-1]
    corners = (points[:, None] + np.array([[0, 0], [1, 0], [0, 1], [1, 1]])).reshape(-1, 2).astype(np.float32)
    return float(piece.sum() / cv2.contourArea(cv2.convexHull(corners))), float(cv2.minEnclosingCircle(corners)[1])


def candidates(seen: Array, look: Look) -> Array:
    """Places (n, 2), to about a pixel, of what may be a mark."""
    if look.kind == "grid":
        return _crossings(seen, look)
    cv2 = toolkit()
    _, _, stats, middles = cv2.connectedComponentsWithStats((seen > look.level).astype(np.uint8))
    part = stats[1:, cv2.CC_STAT_AREA] / look.area
    wide = stats[1:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    return np.asarray(middles[1:][(part > 1 / OTHER) & (part < OTHER) & (wide < 4 * look.radius)])


def _crossings(seen: Array, look: Look) -> Array:
    """Where the contrast changes in two directions: crossings, and ends and corners of lines."""
    cv2 = toolkit()
    block = 2 * max(2, round(look.radius / 2)) + 1
    two_ways = cv2.GaussianBlur(cv2.cornerMinEigenVal(seen, block, 3), (0, 0), look.radius / 4)
    near = ndimage.maximum_filter(two_ways, size=2 * max(3, round(look.radius)) + 1)
    high = float(np.percentile(two_ways[two_ways == near], 98)) if two_ways.any() else 0.0
    peaks = np.argwhere((two_ways == near) & (two_ways > 0.25 * high) & (seen > 0.5 * look.level))
    return peaks[:, ::-1].astype(float)


class Picture:
    """One photograph, in which marks are placed to a few hundredths of a pixel."""

    def __init__(self, light: Array, look: Look) -> None:
        """Light (rows, columns) from 0 to 1."""
        cv2 = toolkit()
        self.look, self.contrast = look, contrast(light, look.widest, look.dark)
        smooth = cv2.GaussianBlur(light, (0, 0), BLUR).astype(np.float64)
        self._spline, self._slopes = ndimage.spline_filter(smooth, order=3), np.gradient(smooth)
        reach = int(np.ceil(look.radius))
        grid = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1.0)] * 2), axis=-1).reshape(-1, 2)
        far = np.hypot(*grid.T) / look.radius
        self._offsets, self._weight = grid[far < 1], (1 - far[far < 1] ** 2) ** 2

    def place(self, guesses: Array) -> tuple[Array, Array]:
        """Places (n, 2) of marks near guesses (n, 2), and how symmetric each is (n,), at most 1; 0 along a line."""
        x = np.array(guesses, dtype=np.float64).reshape(-1, 2)
        if not len(x):
            return x, np.zeros(0)
        p, w = self._offsets, self._weight
        for _ in range(STEPS):
            one, other = x[:, None] + p, x[:, None] - p
            here, there = self._at(one), self._at(other)
            slopes = [self._at(one, slope) - self._at(other, slope) for slope in self._slopes[::-1]]
            J = np.stack([*slopes, *np.moveaxis(p * (here + there)[..., None], -1, 0)], axis=-1)
            A = np.einsum("nki,k,nkj->nij", J, w, J) + 1e-12 * np.eye(4)
            found = np.linalg.solve(A, np.einsum("nki,k,nk->ni", J, w, here - there)[..., None])[..., 0]
            x -= np.clip(found[:, :2], -1.5, 1.5)
        even, odd = (here + there) / 2, (here - there - np.einsum("nki,ni->nk", J, found)) / 2
        e, o = (even - (even @ w / w.sum())[:, None]) ** 2 @ w, odd**2 @ w
        sharp = np.linalg.eigvalsh(A[:, :2, :2])
        return x, np.where(sharp[:, 0] > FIXED * sharp[:, 1], (e - o) / (e + o + 1e-12), 0.0)

    def whole(self, x: Array) -> np.ndarray:
        """Which marks at places (n, 2) are not cut by the edge of the photograph."""
        rows, columns = self.contrast.shape
        radius = self.look.radius
        return np.asarray(((x > radius) & (x < np.array([columns, rows]) - 1 - radius)).all(axis=1))

    def depth(self, x: Array) -> Array:
        """Contrast (n,) at places, the largest of the pixels around."""
        i = np.clip(np.round(x).astype(int), 1, np.array(self.contrast.shape[::-1]) - 2)
        shift = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
        return np.max([self.contrast[i[:, 1] + b, i[:, 0] + a] for a, b in shift], axis=0)

    def _at(self, x: Array, values: Array | None = None) -> Array:
        """Values at places (..., 2): of the light by cubic splines, of others linearly."""
        at = np.moveaxis(x[..., ::-1], -1, 0)
        if values is None:
            return np.asarray(ndimage.map_coordinates(self._spline, at, order=3, mode="nearest", prefilter=False))
        return np.asarray(ndimage.map_coordinates(values, at, order=1, mode="nearest"))

    def marks(self) -> Array:
        """All marks (n, 2) in the photograph."""
        x, symmetric = self.place(candidates(self.contrast, self.look))
        x = x[self.whole(x) & (symmetric > SYMMETRIC)]
        if len(x) < 2:
            return x
        pairs = cKDTree(x).query_pairs(self.look.radius, output_type="ndarray")  # one mark found twice
        return np.delete(x, np.unique(pairs[:, 1]) if len(pairs) else [], axis=0)
