"""Surfaces of polygons: .obj, .stl and .ply, which other readers take in part."""

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .checking import Array
from .grouping import Raw
from .preparing import SAME, completed, decoded, of_vtk


def face(points: Array, kind: str, nodes: Array) -> tuple[Array, Array]:
    """Cells in the order of DOLFINx; 8 nodes become 9."""
    if kind == "quadrilateral" and nodes.shape[1] == 8:
        points, nodes = completed(points, nodes)
    return points, nodes if kind == "polygon" else of_vtk(kind, nodes)


def polygons(path: Path, points: Array, rows: list[Any]) -> Raw:
    """Cells of straight edges, each with its corners going round."""
    widths = np.array([len(row) for row in rows], dtype=int)
    raw = Raw(path, points.reshape(-1, 3), [])
    for width in np.unique(widths):
        numbers = np.flatnonzero(widths == width)
        nodes = np.array([rows[k] for k in numbers], dtype=np.int64)
        kind = {3: "triangle", 4: "quadrilateral"}.get(int(width), "polygon")
        if width < 3:
            raise InputError(f"Cell {numbers[0]} of {str(path)!r} has {width} corners.")
        raw.faces.append((kind, face(raw.points, kind, nodes)[1], numbers))
    return raw


def stl(path: Path) -> Raw:
    """Triangles in words or in bytes; words are read in any case, and a file that ends early is not."""
    raw = path.read_bytes()
    count = int.from_bytes(raw[80:84], "little")
    if len(raw) >= 84 and len(raw) == 84 + 50 * count:
        facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        points = np.frombuffer(raw, facet, offset=84)["corners"].reshape(-1, 3).astype(float)
    else:
        words = decoded(path).lower()
        found = re.findall(r"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", words)
        points = np.array(found, dtype=float).reshape(-1, 3)
        facets = len(re.findall(r"\bfacet\s+normal\b", words))
        if len(points) != 3 * facets or len(re.findall(r"\bendfacet\b", words)) != facets:
            raise InputError(f"{str(path)!r} is cut off: of its {facets} facets not all have three corners and an end.")
        if not facets:
            raise InputError(f"{str(path)!r} is not a mesh that can be read: it holds no facets, or is cut off.")
    raw_mesh = Raw(path, points, [("triangle", np.arange(len(points)).reshape(-1, 3), np.arange(len(points) // 3))])
    raw_mesh.merge = SAME
    return raw_mesh


_PLY = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip


def ply(path: Path) -> Raw:
    """Vertices and faces, whatever else an element has."""
    raw = path.read_bytes()
    head = re.match(rb"\s*ply\s.*?^\s*end_header[ \t]*\r?\n", raw, re.DOTALL | re.MULTILINE)
    if not head:
        raise InputError(f"{str(path)!r} is not a mesh that can be read: it has no head as PLY files have.")
    lines = [line.split() for line in head[0].decode("latin-1").splitlines()]
    form = next(words[1] for words in lines if words[:1] == ["format"])
    elements: list[tuple[str, int, list[list[str]]]] = []
    for words in lines:
        if words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    words_left, at = iter(raw[head.end() :].split() if form == "ascii" else []), head.end()

    def take(kind: str) -> Any:
        nonlocal at
        if form == "ascii":
            return float(next(words_left))
        dtype = np.dtype(order + _PLY[kind])
        at += dtype.itemsize
        return np.frombuffer(raw, dtype, 1, at - dtype.itemsize)[0]

    points, rows = np.zeros((0, 3)), []
    try:
        for name, count, properties in elements:
            found = []
            for _ in range(count):
                row: dict[str, Any] = {}
                for words in properties:
                    if words[0] == "list":
                        row[words[3]] = [take(words[2]) for _ in range(int(take(words[1])))]
                    else:
                        row[words[1]] = take(words[0])
                found.append(row)
            if name == "vertex":
                points = np.array([[float(row[axis]) for axis in "xyz"] for row in found])
            elif name == "face":
                rows = [next(row[key] for key in ("vertex_indices", "vertex_index") if key in row) for row in found]
            elif name == "tristrips" and count:
                raise InputError(f"{str(path)!r} holds strips of triangles: save it with faces.")
    except (StopIteration, ValueError) as error:
        raise InputError(
            f"{str(path)!r} is not a mesh that can be read: it is cut off or has words for numbers."
        ) from error
    return polygons(path, points, rows)


_OBJ_PASSED = {"vt", "vn", "vp", "s", "usemtl", "mtllib", "usemap", "maplib", "mg", "lod", "shadow_obj", "trace_obj",
               "bevel", "c_interp", "d_interp"}  # fmt: skip


def obj(path: Path) -> Raw:
    """An .obj file with its groups of faces, lines and points; texture, normals and materials are left out."""
    points: list[list[float]] = []
    rows: list[list[int]] = []
    groups: dict[str, dict[int, list[Any]]] = {}
    group, head = "", ""

    def place(word: str) -> int:
        # counted from 1, or from the last point backwards
        n = int(word.split("/")[0])
        return n - 1 if n > 0 else n + len(points) if n < 0 else -1

    def add(dim: int, members: list[Any]) -> None:
        if group:
            groups.setdefault(group, {}).setdefault(dim, []).extend(members)

    for number, line in enumerate(decoded(path).splitlines(), 1):
        line = head + line.split("#")[0].rstrip()
        if line.endswith("\\"):
            head = line[:-1] + " "
            continue
        head = ""
        key, *words = line.split() or ["s"]
        try:
            if key == "v":
                points.append([float(word) for word in words[:3]])
                if len(words) < 3:
                    raise ValueError("a point needs three numbers")
            elif key in ("g", "o"):
                group = " ".join(words)
            elif key == "f":
                add(2, [len(rows)])
                rows.append([place(word) for word in words])
            elif key == "l":
                ends = [place(word) for word in words]
                add(1, [*pairwise(ends)])
            elif key == "p":
                add(0, [place(word) for word in words])
            elif key not in _OBJ_PASSED:
                raise ValueError(f"{key!r} is no word of a mesh of points and faces")
        except ValueError as error:
            raise InputError(f"{str(path)!r} is not a mesh that can be read: {error} (line {number}).") from error
    raw = polygons(path, np.array(points, dtype=float).reshape(-1, 3), rows)
    for name, dims in groups.items():
        for dim, members in dims.items():
            raw.add(name, dim, np.array(members))
    return raw
