"""Pieces of a pattern from DXF files of the kind AAMA/ASTM (ASTM D6673), which other programs of the trade write.

Read are: the outline (layer 1) or the sew line (14), turn points (2), notches (4), the mirror line (6), the grain line
(7), internal lines (8), cutouts (11) and drill holes (13), of one size. The standard has no seams.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..laws import Array
from . import outlines

UNITS = {"METRIC": 1e-3, "ENGLISH": 0.0254}
IGNORED = {"0", "3", "5", "9", "10", "12", "15", "16", "17", "18", "19", "20", *map(str, range(80, 88))}
"""Layers of curve points, grading, stripes, plaids, texts, other notches and drafts: known, and not used."""
MISSING = "DXF files need ezdxf: pip install 'fabric_fenicsx[patterns]', or pip install ezdxf."


@dataclass
class Piece:
    """A piece of one size; points in m."""

    name: str
    edges: dict[str, Array]
    """Numbered from 1 in the order of the outline, anticlockwise."""
    sewn: bool
    """Whether the edges are those of the sew line, or of the cut."""
    grain: float | None
    """Direction of the warp from x, rad."""
    fold: str | None
    """The edge at which half a piece is mirrored."""
    material: str = ""
    marks: dict[str, list[Array]] = field(default_factory=dict)
    """"notch" and "hole": points (1, 2); "line" and "cutout": lines (n, 2)."""


def read(path: Path, size: str | None = None, unit: float | None = None) -> dict[str, Piece]:
    """All pieces of a size, by default the sample size, by their names; unit: in m, for a file that tells none.

    Raises InputError for what is no such file, or is not understood.
    """
    try:
        import ezdxf.filemanagement
        import ezdxf.lldxf.const as known
    except ImportError as error:
        raise InputError(MISSING) from error
    try:
        file = ezdxf.filemanagement.readfile(path)
    except OSError as error:
        reason = error.strerror or "it is no DXF file"
        raise InputError(f"{str(path)!r} cannot be read ({reason}); give a DXF file of the kind AAMA/ASTM.") from error
    except known.DXFError as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise InputError(f"{str(path)!r} is not a DXF file that can be read ({reason}).") from error
    about = _told(file.modelspace())
    if unit is None and about.get("UNITS", "").upper() not in UNITS:
        raise InputError(f"{str(path)!r} does not say 'UNITS: METRIC' or 'UNITS: ENGLISH': tell its unit.")
    scale = UNITS[about["UNITS"].upper()] if unit is None else unit
    blocks = [(block, _told(block)) for block in file.blocks if not block.name.startswith("*")]
    blocks = [(block, told) for block, told in blocks if any(entity.dxf.layer in ("1", "14") for entity in block)]
    sizes = list(dict.fromkeys(told["SIZE"] for _, told in blocks if "SIZE" in told))
    wanted = size or about.get("SAMPLE SIZE") or (sizes[0] if len(sizes) == 1 else None)
    if sizes and wanted not in sizes:
        raise InputError(f"{str(path)!r} has no size {wanted!r}; it has {', '.join(sizes)}.")
    if size and not sizes:
        raise InputError(f"{str(path)!r} tells no sizes, and cannot give {size!r}.")
    found: dict[str, Piece] = {}
    for block, told in blocks:
        if told.get("SIZE", wanted) != wanted:
            continue
        name = told.get("PIECE NAME") or block.name
        if name in found:
            raise InputError(f"{str(path)!r} has two pieces {name!r} of the size {wanted!r}.")
        try:
            found[name] = _piece(block, name, told.get("MATERIAL", ""), scale)
        except InputError as error:
            raise InputError(f"{str(path)!r}: the piece {name!r} {str(error).rstrip('.')}.") from None
    if not found:
        raise InputError(f"{str(path)!r} has no pieces: blocks with an outline on layer 1.")
    return found


def _told(entities: Any) -> dict[str, str]:
    """What texts say, as "SIZE: 36"."""
    texts = [entity.dxf.text for entity in entities if entity.dxftype() == "TEXT"]
    pairs = [text.partition(":")[::2] for text in texts]
    return {key.strip().upper(): value.strip() for key, value in reversed(pairs) if value.strip()}


def _piece(block: Any, name: str, material: str, scale: float) -> Piece:
    """A piece from its block. Raises InputError with the end of a sentence."""
    lines: dict[str, list[Array]] = {}
    points: dict[str, list[Array]] = {}
    for entity in block:
        layer, kind = entity.dxf.layer, entity.dxftype()
        if layer in IGNORED or kind in ("TEXT", "ATTDEF", "ATTRIB"):
            continue
        if layer not in ("1", "2", "4", "6", "7", "8", "11", "13", "14"):
            raise InputError(f"has a layer {layer!r}, which is none of the standard's")
        if kind == "POINT":
            points.setdefault(layer, []).append(scale * np.array([[*entity.dxf.location]], dtype=float)[:, :2])
        else:
            lines.setdefault(layer, []).append(scale * _line(entity, layer))
    sewn = "14" in lines
    loop = outlines.chained(_closed(lines["14"], lines.get("6", [])) if sewn else lines.get("1", []))
    turns = np.concatenate([np.empty((0, 2)), *points.get("2", [])])
    edges = {str(k): edge for k, edge in enumerate(outlines.split(loop, turns), 1)}
    grains = lines.get("7", [])
    if len(grains) > 1:
        raise InputError(f"has {len(grains)} grain lines")
    marks = {"notch": points.get("4", []), "hole": points.get("13", [])}
    marks |= {"line": lines.get("8", []), "cutout": lines.get("11", [])}
    grain = float(np.arctan2(*(grains[0][-1] - grains[0][0])[::-1])) if grains else None
    return Piece(name, edges, sewn, grain, _fold(edges, lines.get("6", [])), material, marks)


def _closed(sewn: list[Array], mirrors: list[Array]) -> list[Array]:
    """Sew lines, and the mirror line between them where it has been left out."""
    if len(mirrors) == 1:
        ends = [x[k] for x in sewn for k in (0, -1) if outlines.on_line({"": x[k][None]}, mirrors[0])]
        if len(ends) == 2:
            return [*sewn, np.array(ends)]
    return sewn


def _fold(edges: dict[str, Array], mirrors: list[Array]) -> str | None:
    """The edge on the mirror line; None where a piece is drawn whole."""
    if not mirrors:
        return None
    if len(mirrors) > 1:
        raise InputError(f"has {len(mirrors)} mirror lines")
    names = outlines.on_line(edges, mirrors[0])
    if len(names) == 1:
        return names[0]
    if names:
        raise InputError(f"has {len(names)} edges on its mirror line")
    x = np.concatenate([*edges.values()])
    image = outlines.mirrored(x, *mirrors[0][[0, -1]])
    off = np.linalg.norm(image[:, None] - x[None], axis=2).min(axis=1).max()
    if off > 5e-3:
        raise InputError("has a mirror line that is no edge of it, and is not the same on both sides")
    return None


def _line(entity: Any, layer: str) -> Array:
    """Points of a line (n, 2), in the file's unit."""
    kind = entity.dxftype()
    if kind == "LINE":
        return np.array([[*entity.dxf.start], [*entity.dxf.end]], dtype=float)[:, :2]
    if kind == "POLYLINE":
        corners = [
            (vertex.dxf.location.x, vertex.dxf.location.y, vertex.dxf.get("bulge", 0.0)) for vertex in entity.vertices
        ]
        closed = entity.is_closed
    elif kind == "LWPOLYLINE":
        corners, closed = [(x, y, bulge) for x, y, _, _, bulge in entity.get_points()], entity.closed
    else:
        raise InputError(f"has a {kind} on layer {layer}, where the standard has polylines: save curves as points")
    if any(bulge for *_, bulge in corners):
        raise InputError(f"has an arc in a polyline of layer {layer}: save curves as points")
    x = np.array(corners, dtype=float).reshape(-1, 3)[:, :2]
    return np.concatenate([x, x[:1]]) if closed and len(x) and (x[0] != x[-1]).any() else x
