"""Sewing patterns from files: own ones in TOML, GarmentCode's JSON, and DXF of the kind AAMA/ASTM.

A scene takes the first two as its mesh, see `scenes.reading`; a script reads all three.

A file of its own, with every key; lengths are in its `unit`, angles in degrees, places in space in m:

    unit = "mm"                              # of what is drawn: m, cm, mm or inch
    file = "shirt.dxf"                       # or a .json of GarmentCode: panels without an outline here are its pieces
    size = "M"                               # of a .dxf; by default its sample size

    [[panel]]
    name = "front"
    piece = "FR"                             # of the file; by default the name
    edges = ["hem", "side", "armhole"]       # names of the piece's edges in place of its numbers, anticlockwise
    outline = [                              # or the outline itself, anticlockwise
        { name = "hem", from = [0, 0] },
        { name = "side", from = [500, 0], allowance = 15 },
        { name = "top", from = [500, 400], through = [[250, 430]], shape = "arc" },  # spline, bezier, points
    ]
    allowance = 10                           # seam allowance inside of the outline; a cut piece of a DXF needs it
    fold = "middle"                          # edge that half a panel is mirrored at
    grain_deg = 90                           # direction of the warp from x; that of the piece
    material = "blend"
    regular = false                          # see `panels.Panel`
    notches = [[250, 0]]                     # more than the piece has
    place = { shift_m = [0, 0, 0.2], turn_deg = [0, 0, 0] }
    roll = { radius_m = 0.1, origin_m = [0, 0, 0], axis = [0, 0, 1], facing = [1, 0, 0], level = 0, middle = 0,
             around_deg = 180 }              # instead of `place`: around a limb; around_deg: that its width takes

    [[seam]]
    join = ["front.side", "back.side"]
    name = "side"
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import entries
from ..entries import Table
from ..errors import InputError
from ..laws import Array
from . import dxf, garmentcode, outlines
from .panels import Edge, Flat, Panel, Placed, Rolled
from .sewing import Seam

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "inch": 0.0254}
ROLL = "origin_m axis facing level middle around_deg"


@dataclass(frozen=True)
class Pattern:
    """What a file has: for `sewing.sew`, its panels and seams; points of notches and drill holes of a panel, m."""

    panels: tuple[Panel, ...]
    seams: tuple[Seam, ...] = ()
    notches: Mapping[str, Array] = field(default_factory=dict)
    holes: Mapping[str, Array] = field(default_factory=dict)


def read(
    path: str | Path,
    *,
    size: str | None = None,
    allowance: float | None = None,
    grain: float | None = None,
    unit: float | None = None,
) -> Pattern:
    """Read a pattern from a .toml, .json or .dxf file.

    Args:
        size: of a .dxf file; by default its sample size.
        allowance: of a .dxf file, m: what lies between the cut line and the sew line, where a piece has only the first;
            0 where that is what is sewn.
        grain: of pieces of a .dxf file without a grain line, rad.
        unit: in m, of a .dxf file that does not tell it.

    Raises InputError.
    """
    path = Path(path)
    suffix, told = path.suffix.lower(), {"size": size, "allowance": allowance, "grain": grain, "unit": unit}
    if suffix == ".dxf":
        made = [_finished(piece, allowance, {}, grain, None, path) for piece in dxf.read(path, size, unit).values()]
        return _pattern([panel for panel, _, _ in made], [], made)
    for key, value in told.items():
        if value is not None:
            raise InputError(f"{str(path)!r} has no {key} to be set to {value!r}: only a .dxf file needs one.")
    if suffix == ".json":
        return Pattern(*garmentcode.read(path))
    if suffix == ".toml":
        return _own(entries.read(path, "a pattern", "fabric_fenicsx.garments.patterns"), path)
    raise InputError(f"A pattern is a .toml, .json or .dxf file, and not {path.name!r}.")


type _Made = tuple[Panel, Array, Array]


def _pattern(panels: list[Panel], seams: list[Seam], made: list[_Made]) -> Pattern:
    marks = [{panel.name: points for panel, *both in made if len(points := both[k])} for k in (0, 1)]
    return Pattern(tuple(panels), tuple(seams), *marks)


def _finished(
    piece: dxf.Piece,
    allowance: float | None,
    edgewise: Mapping[str, float],
    grain: float | None,
    fold: str | None,
    path: Path,
) -> _Made:
    """A panel from a piece, with its notches and drill holes; InputError names both."""
    if not piece.sewn and allowance is None:
        raise InputError(
            f"{str(path)!r}: the piece {piece.name!r} has a cut line and no sew line (layer 14): tell its seam "
            "allowance, 0 if it is sewn there."
        )
    if piece.sewn and (allowance or any(edgewise.values())):
        raise InputError(f"{str(path)!r}: the piece {piece.name!r} has a sew line, and needs no seam allowance.")
    grain = piece.grain if grain is None else grain
    if grain is None:
        raise InputError(f"{str(path)!r}: the piece {piece.name!r} has no grain line (layer 7): tell its grain.")
    fold, edges = fold or piece.fold, piece.edges
    notches, holes = (np.concatenate([np.empty((0, 2)), *piece.marks.get(key, [])]) for key in ("notch", "hole"))
    try:
        if not piece.sewn:
            widths = [0.0 if name == fold else edgewise.get(name, allowance or 0.0) for name in edges]
            edges = dict(zip(edges, outlines.inwards([*edges.values()], widths), strict=True))
        if fold is not None:
            edges = outlines.unfolded(edges, fold)
    except InputError as error:
        raise InputError(f"{str(path)!r}: the piece {piece.name!r} {str(error).rstrip('.')}.") from None
    outline = {name: _edge(points) for name, points in edges.items()}
    return Panel(piece.name, outline, grain=grain, material=piece.material), notches, holes


def _edge(points: Array) -> Edge:
    (start, *inner, _) = points.tolist()
    return Edge(tuple(start), tuple(map(tuple, inner)), "points" if inner else "line")


def _own(file: Table, path: Path) -> Pattern:
    """A pattern of our own kind."""
    file.expect("panel", "unit file size seam")
    unit = UNITS[file.choice("unit", tuple(UNITS))] if "unit" in file.entries else None
    pieces: dict[str, dxf.Piece] = {}
    known: dict[str, Panel] = {}
    seams: tuple[Seam, ...] = ()
    if "file" in file.entries:
        other = path.parent / file.text("file")
        if other.suffix.lower() == ".dxf":
            pieces = dxf.read(other, file.text("size") if "size" in file.entries else None, unit)
        elif other.suffix.lower() == ".json":
            panels, seams = garmentcode.read(other)
            known = {panel.name: panel for panel in panels}
        else:
            file.refuse("file", "is neither a .dxf nor a .json file", "name one of these")
    if "size" in file.entries and not pieces:
        file.refuse("size", "is of a .dxf file, and there is none", "leave it out")
    made = [_panel(table, unit, pieces, known, path) for table in file.tables("panel")]
    if not made:
        file.refuse("panel", "is empty", "write each under [[panel]]")
    own = []
    for table in file.tables("seam"):
        table.expect("join", "name")
        ends = table.entries["join"]
        if not (isinstance(ends, list) and len(ends) == 2 and all(isinstance(e, str) and "." in e for e in ends)):
            table.refuse("join", "is not a pair of edges", 'write it as ["front.side", "back.side"]')
        pairs = [tuple(end.rsplit(".", 1)) for end in ends]
        own.append(Seam(*pairs, name=table.text("name") if "name" in table.entries else ""))
    used = {panel.name for panel, *_ in made}
    seams = tuple(seam for seam in seams if {panel for panel, _ in seam.edges} <= used)
    return _pattern([panel for panel, *_ in made], [*seams, *own], made)


def _panel(
    table: Table, unit: float | None, pieces: Mapping[str, dxf.Piece], known: Mapping[str, Panel], path: Path
) -> _Made:
    """A panel as its table tells."""
    table.expect("name", "piece edges outline allowance fold grain_deg material regular notches place roll")
    name, of = table.text("name"), table.text("piece") if "piece" in table.entries else table.text("name")
    scale = unit or 1e-3
    if "outline" not in table.entries and of in known:
        for key in ("edges", "allowance", "fold", "grain_deg", "notches"):
            if key in table.entries:
                table.refuse(key, "is not for a panel of GarmentCode", "leave it out")
        return _dressed(table, replace(known[of], name=name)), np.empty((0, 2)), np.empty((0, 2))
    if "outline" in table.entries:
        if unit is None:
            table.refuse("outline", "has no unit", 'write unit = "mm" at the top of the file')
        outline, edgewise = _outline(table, scale)
        piece = dxf.Piece(name, outline, False, np.pi / 2, None)
        allowance: float | None = scale * table.real("allowance", 0.0)
    elif of in pieces:
        piece, edgewise = replace(pieces[of], name=name), {}
        if "edges" in table.entries:
            names = table.entries["edges"]
            if not isinstance(names, list) or len(names) != len(piece.edges) or len(set(map(str, names))) < len(names):
                table.refuse("edges", f"are not {len(piece.edges)} different names", "the piece has so many edges")
            fold = dict(zip(piece.edges, names, strict=True)).get(piece.fold or "")
            piece = replace(piece, edges=dict(zip(map(str, names), piece.edges.values(), strict=True)), fold=fold)
        allowance = scale * table.real("allowance", 0.0) if "allowance" in table.entries else None
    else:
        have = f"; the file has {', '.join([*pieces, *known])}" if pieces or known else ""
        table.refuse("outline", "is missing", f"draw it, or name a piece of a file{have}")
    fold = table.text("fold") if "fold" in table.entries else None
    if fold is not None and fold not in piece.edges:
        table.refuse("fold", "is no edge of the panel", f"its edges are {', '.join(piece.edges)}")
    grain = np.radians(table.real("grain_deg", 90.0)) if "grain_deg" in table.entries else None
    panel, notches, holes = _finished(piece, allowance, edgewise, grain, fold, path)
    if "notches" in table.entries:
        own = table.entries["notches"]
        if not isinstance(own, list) or not all(isinstance(point, list) and len(point) == 2 for point in own):
            table.refuse("notches", "are not a list of points", "write them as [[0, 10]]")
        notches = np.concatenate([notches, scale * np.array([[table.number("notches", x) for x in p] for p in own])])
    return _dressed(table, panel), notches, holes


def _dressed(table: Table, panel: Panel) -> Panel:
    """With material, kind of cells and place of the table."""
    if "material" in table.entries:
        panel = replace(panel, material=table.text("material"))
    if "regular" in table.entries:
        panel = replace(panel, regular=table.yes("regular"))
    if "place" in table.entries and "roll" in table.entries:
        table.refuse("roll", "and place: a panel starts in one of these ways", "leave one out")
    return replace(panel, placed=_placed(table, panel)) if {"place", "roll"} & table.entries.keys() else panel


def _placed(table: Table, panel: Panel) -> Placed:
    if "place" in table.entries:
        own = table.table("place")
        own.expect("", "shift_m turn_deg")
        shift, turn = (own.numbers(key, 3) if key in own.entries else (0.0,) * 3 for key in ("shift_m", "turn_deg"))
        return Flat(shift, tuple(np.radians(turn).tolist()))
    own = table.table("roll")
    own.expect("radius_m", ROLL)
    x = np.concatenate([*panel.curves().values()])[:, 0]
    middle = own.real("middle", float(x.min() + x.max()) / 2)
    span = (float(np.ptp(x)), np.radians(own.real("around_deg", 0.0))) if "around_deg" in own.entries else None
    keys = ("origin_m", "axis", "facing")
    more: dict[str, Any] = {key.removesuffix("_m"): own.numbers(key, 3) for key in keys if key in own.entries}
    return Rolled(own.positive("radius_m"), level=own.real("level", 0.0), middle=middle, span=span, **more)


def _outline(table: Table, scale: float) -> tuple[dict[str, Array], dict[str, float]]:
    """Edges drawn in the table, m, and allowances of their own."""
    edges, own = {}, {}
    for entry in table.tables("outline"):
        entry.expect("name from", "through shape allowance")
        through = entry.entries.get("through", [])
        if not isinstance(through, list) or not all(isinstance(p, list) and len(p) == 2 for p in through):
            entry.refuse("through", "is not a list of points", "write it as [[0, 10]]")
        points = [tuple(scale * entry.number("through", x) for x in point) for point in through]
        shape = entry.choice("shape", ("line", "arc", "spline", "bezier", "points"), "spline" if points else "line")
        start = tuple(scale * x for x in entry.numbers("from", 2))
        name = entry.text("name")
        if name in edges:
            entry.refuse("name", "is that of two edges", "give each its own")
        edges[name] = Edge(start, tuple(points), shape)  # type: ignore[arg-type]
        if "allowance" in entry.entries:
            own[name] = scale * entry.real("allowance", 0.0)
    return Panel(table.text("name"), edges).curves(), own
