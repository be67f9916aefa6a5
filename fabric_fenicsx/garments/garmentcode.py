"""Panels and seams from GarmentCode's JSON (Korosteleva and Sorkine-Hornung 2023, doi:10.1145/3618351).

Edges are called by their numbers from 0, as the file's stitches do. A panel that goes round clockwise shows its other
side: it is drawn from there, and turned over in its place. The file has no grain line: the warp is along y.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..laws import Array
from .outlines import area
from .panels import Edge, Flat, Panel
from .sewing import Seam


def read(path: Path) -> tuple[tuple[Panel, ...], tuple[Seam, ...]]:
    """The panels of a file, each where it is placed, and its seams. Raises InputError for what is not understood."""
    try:
        file = json.loads(path.read_text(encoding="utf-8"))
        pattern, about = file["pattern"], file["properties"]
        unit = 1.0 / float(about["units_in_meter"])
        if about.get("curvature_coords", "relative") != "relative":
            raise InputError("its curves are not told relative to their edges")
        panels = {name: _panel(name, said, unit) for name, said in pattern["panels"].items()}
        seams = tuple(_seam(stitch, panels) for stitch in pattern.get("stitches", []))
    except InputError as error:
        raise InputError(f"{str(path)!r} cannot be used: {str(error).rstrip('.')}.") from None
    except OSError as error:
        raise InputError(
            f"{str(path)!r} cannot be read ({error.strerror}); give a JSON file of GarmentCode."
        ) from error
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, ZeroDivisionError) as error:
        reason = f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"
        raise InputError(f"{str(path)!r} is not a pattern of GarmentCode ({reason}).") from error
    if not panels:
        raise InputError(f"{str(path)!r} has no panels.")
    return tuple(panels.values()), seams


def _panel(name: str, said: dict[str, Any], unit: float) -> Panel:
    points = unit * np.array(said["vertices"], dtype=float)
    edges = [(str(k), *map(int, edge["endpoints"]), edge.get("curvature")) for k, edge in enumerate(said["edges"])]
    for (_, _, end, _), (_, start, _, _) in zip(edges, [*edges[1:], edges[0]], strict=True):
        if end != start:
            raise InputError(f"the edges of the panel {name!r} do not go round")
    place = Rotation.from_euler("xyz", said["rotation"], degrees=True)
    shapes = {edge: _shape(points[a], points[b], unit, bend) for edge, a, b, bend in edges}
    outline = {edge: Edge(tuple(points[a].tolist()), *shapes[edge]) for edge, a, _, _ in edges}
    if area([points[[a, b]] for _, a, b, _ in edges]) < 0.0:
        place = place * Rotation.from_rotvec([0.0, np.pi, 0.0])
        outline = {name: Edge(_over(e.start), tuple(map(_over, e.through)), e.shape) for name, e in outline.items()}
    shift = unit * np.array(said["translation"], dtype=float)
    return Panel(name, outline, placed=Flat(shift.tolist(), place.as_rotvec().tolist()), regular=False)


def _over(point: Any) -> tuple[float, float]:
    """A point of a panel that is turned over."""
    return float(-point[0]), float(point[1])


def _shape(a: Array, b: Array, unit: float, bend: Any) -> tuple[tuple[Any, ...], Any]:
    """Points through which an edge goes from a to b, and its shape, see `Edge`."""
    if bend is None:
        return (), "line"
    kind = "quadratic" if isinstance(bend, list) else bend["type"]
    told: Any = [bend] if isinstance(bend, list) else bend["params"]
    ahead = b - a
    left = np.array([-ahead[1], ahead[0]])
    if kind in ("quadratic", "cubic"):
        controls = [a + along * ahead + across * left for along, across in told]
        if len(controls) != (1 if kind == "quadratic" else 2):
            raise InputError(f"a {kind} curve has {len(controls)} control points")
        return tuple(tuple(point.tolist()) for point in controls), "bezier"
    if kind != "circle":
        raise InputError(f"a curve is of the kind {kind!r}, and line, quadratic, cubic and circle are known")
    size, large, right = told
    radius = unit * float(size)
    half = float(np.linalg.norm(ahead)) / 2
    if radius < half * (1 - 1e-9):
        raise InputError(f"an arc has a radius of {radius:g} m and ends that are {2 * half:g} m apart")
    rise = np.sqrt(max(radius**2 - half**2, 0.0))
    height = radius + rise if large else radius - rise
    top = (a + b) / 2 + (-height if right else height) * left / (2 * half)
    return (tuple(top.tolist()),), "arc"


def _seam(stitch: list[Any], panels: dict[str, Panel]) -> Seam:
    if len(stitch) != 2:
        raise InputError("a stitch is of other than two edges, or joins a right side with a wrong side")
    ends = [(str(end["panel"]), str(end["edge"])) for end in stitch]
    for panel, edge in ends:
        if panel not in panels or edge not in panels[panel].outline:
            raise InputError(f"a stitch is at the edge {edge} of {panel!r}, which there is not")
    return Seam(*ends)
