"""The whole way from photographs to the file of the marks and the contact sheet."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import plots
from ..errors import InputError
from ..laws import Array
from . import contact_sheet, corrections, marker_file, marks, plane, reading, speckle, tracking

type Follow = Callable[[Array, Array], tracking.Tracks]
UNEVEN = 0.01  # of the size of the grid: marks that miss one deformation gradient by more are strained unevenly


@dataclass(frozen=True)
class Settings:
    """How photographs are read; what is None is found."""

    kind: str | None = None
    """Of `marks.KINDS`, or "speckle": facets of a pattern, which are never found by themselves."""
    dark: bool | None = None
    """Marks darker than the cloth."""
    widest: int | None = None
    """Width of a mark or a line, or the side of a facet, pixels."""
    region: tuple[float, float, float, float] | None = None
    """x0, y0, x1, y1 in pixels of the first photograph, where marks are looked for."""
    checkerboard: Path | None = None
    """A photograph of one in the plane of the specimen."""
    corners: tuple[int, int] = (9, 6)
    """Its inner corners, across and down."""
    square: float = 10.0
    """Of the checkerboard, mm."""
    bar: float | None = None
    """Length of a bar in the first photograph, mm."""
    ends: tuple[float, float, float, float] | None = None
    """Of the bar: x1, y1, x2, y2 in pixels."""
    warp: float | None = None
    """Degrees from x (right in the picture, or along the board) to the warp, anticlockwise, before the test."""
    record: Path | None = None
    """Of the testing machine, with a column "photograph"."""


def make(paths: Sequence[str | Path], out: Path, settings: Settings | None = None,
         say: Callable[[str], object] = print) -> Path:  # fmt: skip
    """Find and follow the marks of a series of photographs; the path of their file.

    Writes markers.csv, contact_sheet.png and, if it is not there, an empty corrections.csv into `out`; of speckles
    strains.csv and strains.png, too. Raises InputError for what cannot be read, and where no three marks are found.
    """
    s = settings or Settings()
    photographs = reading.series(paths)
    table = marker_file.record(s.record) if s.record else None
    if table:
        rows = marker_file.rows_of(table, photographs)
        photographs = [photographs[k] for k in np.argsort(rows)]
    names = [photo.name for photo in photographs]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise InputError(f"Two photographs are named {twice}; give each a name of its own.")
    first = reading.light(photographs[0])
    to_plane = _plane(s, photographs[0], first)

    corrected = corrections.read(out / "corrections.csv")
    found, x0, follow = _begin(s, photographs, first)
    titles, x0, hand = corrected.apply(names, [f"m{k:02d}" for k in range(1, len(x0) + 1)], x0)
    if len(x0) < 3:
        raise InputError(f"{photographs[0]}: {len(x0)} marks are left, and a strain needs 3; see {corrected.file}.")
    tracks = follow(x0, hand)

    x = to_plane(tracks.places)
    F, miss = marker_file.gradient(x, x[0])
    more = marker_file.yarns(F, np.radians(s.warp)) if s.warp is not None else None
    path = out / "markers.csv"
    marker_file.write(path, photographs, titles, x, to_plane.unit, table=table, more=more)
    corrections.begin(out / "corrections.csv")
    contact_sheet.write(out / "contact_sheet.png", names, titles, tracks, lambda k: reading.light(photographs[k]))
    if s.kind == "speckle":
        _field(out, names, titles, tracks, x, to_plane.unit, reading.light(photographs[-1]))
    _tell(say, found, tracks, titles, names, to_plane.said, 0.0 if s.kind == "speckle" else miss)
    return path


def _field(out: Path, names: Sequence[str], titles: Sequence[str], tracks: tracking.Tracks, x: Array, unit: str,
           last: Array) -> None:  # fmt: skip
    """The strains of the facets, and a picture of them in the last photograph."""
    there = np.isfinite(x[0]).all(axis=-1)
    titles, x = [title for title, seen in zip(titles, there, strict=True) if seen], x[:, there]
    E = speckle.strains(x, x[0])
    speckle.write(out / "strains.csv", names, titles, x[0], E, unit)
    shown = speckle.draw(last, tracks.x[-1, there], E[-1], f"{names[-1]}: Green-Lagrange strains")
    plots.save(shown, out / "strains.png")


def _plane(s: Settings, photo: Path, first: Array) -> plane.Plane:
    if s.checkerboard and s.bar:
        raise InputError("A checkerboard and a bar are given; one of them tells the scale, so leave out --bar.")
    if s.checkerboard:
        shown = reading.light(s.checkerboard, first.shape)
        return plane.board(shown, s.corners, s.square, str(s.checkerboard))
    if s.ends and not s.bar:
        raise InputError("The ends of a bar tell no scale without its length; add --bar, in mm.")
    if not s.bar:
        return plane.Plane()
    try:
        return plane.bar(s.ends or plane.find_bar(first), s.bar)
    except InputError as error:
        raise InputError(f"{photo}: {error}".rstrip(".") + ".") from error


def _begin(s: Settings, photographs: Sequence[Path], first: Array) -> tuple[str, Array, Follow]:
    """What is followed, in words, where it is in the first photograph, in reading order, and what follows it."""
    x, y, end, below = (int(v) for v in s.region or (0, 0, first.shape[1], first.shape[0]))
    x, y, end, below = max(x, 0), max(y, 0), min(end, first.shape[1]), min(below, first.shape[0])
    if min(end - x, below - y) < 20:
        raise InputError(
            f"The region {x},{y},{end},{below} holds nothing of {photographs[0]}; give x0,y0,x1,y1 in pixels."
        )
    size = first.shape[0], first.shape[1]
    lights = [_light(photo, size) for photo in photographs]
    try:
        if s.kind == "speckle":
            side = max(speckle.LEAST_SIDE, s.widest or speckle.SIDE) // 2 * 2 + 1
            places = speckle.facets(first, (x, y, end, below), side)
            said = f"facets of {side} x {side} pixels"
            return said, places, lambda x0, hand: speckle.follow(lights, x0, hand, side)
        cut = first[y:below, x:end]
        look = marks.look(cut, kind=s.kind, dark=s.dark, widest=s.widest)
    except InputError as error:
        raise InputError(f"{photographs[0]}: {error}.") from error
    found = marks.Picture(cut, look).marks() + [x, y]
    what = "crossings of a grid" if look.kind == "grid" else look.kind
    pictures = [_open(one, look) for one in lights]
    return (
        f"{'dark' if look.dark else 'light'} {what}",
        _in_reading_order(found, look.radius),
        lambda x0, hand: tracking.follow(pictures, x0, hand),
    )


def _light(photo: Path, size: tuple[int, int]) -> Callable[[], Array]:
    return lambda: reading.light(photo, size)


def _open(light: Callable[[], Array], look: marks.Look) -> Callable[[], marks.Picture]:
    return lambda: marks.Picture(light(), look)


def _in_reading_order(x: Array, radius: float) -> Array:
    """The same line by line, from above; what lies within a radius of each other in height is a line."""
    if not len(x):
        return x
    by_height = np.argsort(x[:, 1])
    line = np.empty(len(x))
    line[by_height] = np.concatenate([[0], np.cumsum(np.diff(x[by_height, 1]) > radius)])
    return x[np.lexsort((x[:, 0], line))]


def _tell(say: Callable[[str], object], found: str, tracks: tracking.Tracks, titles: Sequence[str],
          names: Sequence[str], scale: str, miss: float) -> None:  # fmt: skip
    lost = tracks.state == tracking.LOST
    say(f"  {len(titles)} {found} in {len(names)} photographs; {scale}")
    for j in np.flatnonzero(lost.any(axis=0)).tolist():
        k = np.flatnonzero(lost[:, j]).tolist()
        say(f"  {titles[j]} is lost in {len(k)} of them, from {names[k[0]]} on" if len(k) > 1 else
            f"  {titles[j]} is lost in {names[k[0]]}")  # fmt: skip
    by_hand = int((tracks.state == tracking.BY_HAND).sum())
    if by_hand:
        say(f"  {by_hand} places are by hand")
    if miss > UNEVEN:
        say(f"  the marks miss one deformation gradient by {100 * miss:.2g} % of the size of their grid: they are "
            "strained unevenly, so take those of the middle (--region)")  # fmt: skip
