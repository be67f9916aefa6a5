"""What a run has recorded, as a moving scene of triangles, for programs that go on with it.

glTF 2.0 (one .glb file), OBJ (a file for each step), PC2 point caches (with an OBJ of the first step), and USD. Units
are m and s; colours are those of pictures, at corners.
"""

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import files
from ..errors import InputError
from ..laws import Array
from . import pictures
from .series import Colour, Series
from .solids import TRIANGLES

GREY = (0.79, 0.8, 0.82)


@dataclass
class Thing:
    """A surface that moves."""

    name: str
    faces: np.ndarray
    """Triangles (m, 3)."""
    places: Array
    """Of its corners at each step (steps, n, 3), m."""
    colours: Array | None = None
    """Of its corners (steps, n, 3), from 0 to 1, as a screen has them."""


@dataclass
class Moving:
    """A sheet, and the bodies that it may touch, at the steps of a run."""

    times: Array
    things: list[Thing]


def load(series: Series, colour: Colour = "yarn") -> tuple[Moving, list[int]]:
    """All steps that can be read, and the numbers of those that cannot; colour: of `series.LABELS`."""
    import matplotlib

    shapes, times, broken = [], [], []
    for number, time in enumerate(series.times):
        try:
            shapes.append(series.shape(number, colour))
        except InputError:
            if number in series.broken():
                broken.append(number)
                continue
            raise
        times.append(time)
    if not shapes:
        raise InputError(f"None of the {len(series.files)} steps in {str(series.files[0].parent)!r} can be read.")
    first = shapes[0]
    if int(first.kinds[0]) not in TRIANGLES:
        raise InputError(f"A sheet of cells of VTK's kind {int(first.kinds[0])} cannot be written as triangles.")
    nodes = first.cells.reshape(len(first.kinds), -1)[:, 1:]
    low, high, name = pictures.scale(min(s.values.min() for s in shapes), max(s.values.max() for s in shapes))
    table, count = matplotlib.colormaps[name], np.bincount(nodes.ravel(), minlength=len(first.points))
    coloured = []
    for shape in shapes:
        whole = np.bincount(nodes.ravel(), np.repeat(shape.values, nodes.shape[1]), minlength=len(count))
        coloured.append(table((whole / np.maximum(count, 1) - low) / max(high - low, 1e-300))[:, :3])
    places = np.array([shape.points + shape.moved for shape in shapes])
    faces = nodes[:, np.array(TRIANGLES[int(first.kinds[0])])].reshape(-1, 3)
    things = [Thing("sheet", faces, places, np.array(coloured))]
    for k, (_, triangles) in enumerate(first.bodies):
        name = "bodies" if len(first.bodies) == 1 else f"body_{k}"
        things.append(Thing(name, triangles, np.array([shape.bodies[k][0] for shape in shapes])))
    return Moving(np.array(times), things), broken


def gltf(scene: Moving, path: Path) -> None:
    """One .glb file, y upwards: each step is a morph target of corners and colours, of weight one at its time."""
    out = _Buffer()
    meshes: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    times = out.add(scene.times - scene.times[0], "SCALAR", bounds=True) if len(scene.times) > 1 else 0
    for k, thing in enumerate(scene.things):
        colours = None if thing.colours is None else _linear(thing.colours)
        base = {"POSITION": out.add(thing.places[0], "VEC3", bounds=True, target=34962)}
        if colours is not None:
            base["COLOR_0"] = out.add(colours[0], "VEC3", target=34962)
        part: dict[str, Any] = {"attributes": base, "indices": out.add(thing.faces.ravel(), "SCALAR", target=34963)}
        part |= {"material": int(colours is None), "targets": []}
        for step in range(1, len(scene.times)):
            moved = {"POSITION": out.add(thing.places[step] - thing.places[0], "VEC3", bounds=True, target=34962)}
            if colours is not None:
                moved["COLOR_0"] = out.add(colours[step] - colours[0], "VEC3", target=34962)
            part["targets"].append(moved)
        meshes.append({"name": thing.name, "primitives": [part]})
        if part["targets"]:
            meshes[-1]["weights"] = [0.0] * len(part["targets"])
            weights = out.add(np.eye(len(scene.times))[:, 1:].ravel(), "SCALAR")
            samplers.append({"input": times, "output": weights, "interpolation": "LINEAR"})
            channels.append({"sampler": len(samplers) - 1, "target": {"node": k + 1, "path": "weights"}})
        else:
            del part["targets"]
    half, count = float(np.sqrt(0.5)), len(scene.things)
    root = {"name": "scene", "rotation": [-half, 0.0, 0.0, half], "children": [*range(1, count + 1)]}
    plain = {"metallicFactor": 0.0, "roughnessFactor": 0.8}
    said = {
        "asset": {"version": "2.0", "generator": "fabric_fenicsx"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [root, *({"name": thing.name, "mesh": k} for k, thing in enumerate(scene.things))],
        "meshes": meshes,
        "materials": [
            {"name": "cloth", "doubleSided": True, "pbrMetallicRoughness": plain},
            {"name": "body", "doubleSided": True,
             "pbrMetallicRoughness": plain | {"baseColorFactor": [*map(float, _linear(np.array(GREY))), 1.0]}},
        ],
        "accessors": out.accessors,
        "bufferViews": out.views,
        "buffers": [{"byteLength": len(out.content)}],
    }  # fmt: skip
    if samplers:
        said["animations"] = [{"name": "steps", "channels": channels, "samplers": samplers}]
    text = json.dumps(said, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(out.content))
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(out.content), 0x004E4942)
    files.replace(path, head + chunks + bytes(out.content))


class _Buffer:
    """The numbers of a .glb file, and what tells them."""

    def __init__(self) -> None:
        self.content, self.views, self.accessors = bytearray(), list[dict[str, Any]](), list[dict[str, Any]]()

    def add(self, values: Array, kind: str, *, bounds: bool = False, target: int | None = None) -> int:
        """Append an array; its number."""
        whole = np.issubdtype(values.dtype, np.integer)
        content = np.ascontiguousarray(values, dtype="<u4" if whole else "<f4")
        flat = content.reshape(-1, 1 if kind == "SCALAR" else content.shape[-1])
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.content), "byteLength": content.nbytes}
        self.views.append(view if target is None else view | {"target": target})
        self.accessors.append({"bufferView": len(self.views) - 1, "componentType": 5125 if whole else 5126,
                               "count": len(flat), "type": kind})  # fmt: skip
        if bounds:
            ends = {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
            self.accessors[-1] |= ends
        self.content += content.tobytes()
        return len(self.accessors) - 1


def _linear(colours: Array) -> Array:
    """Of a screen's colours (IEC 61966-2-1)."""
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)


def obj(scene: Moving, path: Path) -> None:
    """A folder with a file for each step: an object for the sheet, with the colours of its corners, and for bodies."""
    path.mkdir(parents=True, exist_ok=True)
    for step in range(len(scene.times)):
        files.replace(path / f"step_{step:06d}.obj", _obj(scene.things, step))


def _obj(things: list[Thing], step: int) -> str:
    lines, first = list[str](), 1
    for thing in things:
        rows = thing.places[step] if thing.colours is None else np.hstack([thing.places[step], thing.colours[step]])
        lines += [f"o {thing.name}", *("v " + " ".join(f"{x:.9g}" for x in row) for row in rows.tolist())]
        lines += ["f {} {} {}".format(*face) for face in (thing.faces + first).tolist()]
        first += len(thing.places[step])
    return "\n".join([*lines, ""])


def pc2(scene: Moving, path: Path) -> None:
    """A folder with NAME.obj, the first step, and NAME.pc2, a point cache of evenly spaced steps, of each surface."""
    path.mkdir(parents=True, exist_ok=True)
    count = len(scene.times)
    even = np.linspace(scene.times[0], scene.times[-1], count)
    after = np.clip(np.searchsorted(scene.times, even), min(1, count - 1), count - 1)
    before = np.maximum(after - 1, 0)
    gap = scene.times[after] - scene.times[before]
    part = np.where(gap > 0.0, (even - scene.times[before]) / np.where(gap > 0.0, gap, 1.0), 0.0)[:, None, None]
    for thing in scene.things:
        places = (1 - part) * thing.places[before] + part * thing.places[after]
        head = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, places.shape[1], 0.0, 1.0, count)
        files.replace(path / f"{thing.name}.pc2", head + np.ascontiguousarray(places, dtype="<f4").tobytes())
        files.replace(path / f"{thing.name}.obj", _obj([Thing(thing.name, thing.faces, thing.places[:1])], 0))


def _pxr() -> tuple[Any, ...]:
    """Gf, Usd, UsdGeom and Vt of usd-core."""
    try:
        from pxr import Gf, Usd, UsdGeom, Vt
    except ImportError as error:
        raise InputError("USD needs usd-core: pip install 'fabric_fenicsx[usd]', or pip install usd-core.") from error
    return Gf, Usd, UsdGeom, Vt


def usd(scene: Moving, path: Path) -> None:
    """One .usdc file, with time samples of points and colours; its time codes are milliseconds."""
    Gf, Usd, UsdGeom, Vt = _pxr()
    with files.whole(path) as rough:
        stage = Usd.Stage.CreateNew(str(rough))
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(1000.0)
        stage.SetStartTimeCode(1e3 * scene.times[0])
        stage.SetEndTimeCode(1e3 * scene.times[-1])
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/scene").GetPrim())
        for thing in scene.things:
            mesh = UsdGeom.Mesh.Define(stage, f"/scene/{thing.name}")
            mesh.CreateSubdivisionSchemeAttr("none")
            mesh.CreateDoubleSidedAttr(True)
            mesh.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(thing.faces)))
            mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(thing.faces.ravel(), "i4")))
            points, shown = (
                mesh.CreatePointsAttr(),
                mesh.CreateDisplayColorPrimvar(
                    UsdGeom.Tokens.constant if thing.colours is None else UsdGeom.Tokens.vertex
                ),
            )
            if thing.colours is None:
                shown.Set([Gf.Vec3f(*map(float, _linear(np.array(GREY))))])
            for step, time in enumerate(scene.times):
                points.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(thing.places[step], "f4")), 1e3 * time)
                if thing.colours is not None:
                    tint = np.ascontiguousarray(_linear(thing.colours[step]), "f4")
                    shown.Set(Vt.Vec3fArray.FromNumpy(tint), 1e3 * time)
        stage.Save()


KINDS: dict[str, tuple[str, Callable[[Moving, Path], None]]] = {
    "gltf": ("scene.glb", gltf), "obj": ("obj", obj), "pc2": ("pc2", pc2), "usd": ("scene.usdc", usd)
}  # fmt: skip
"""Name -> where in the folder of a run it goes by default, and what writes it."""


def export(series: Series, kind: str, path: Path, colour: Colour = "yarn") -> list[int]:
    """Write all steps of a run, see `KINDS`; the numbers of those that cannot be read, which are left out."""
    if kind == "usd":
        _pxr()  # before all steps are read
    scene, broken = load(series, colour)
    KINDS[kind][1](scene, path)
    return broken
