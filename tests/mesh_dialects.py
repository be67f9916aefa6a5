"""Good meshes as many programs and people write them, by a seed, and whether they are read right.

    python tests/mesh_dialects.py 500          # that many seeds: read right, refused, or wrong (status 1)

Each mesh is one or two parallelograms in space, cut into triangles, quadrilaterals, both, or polygons, with groups of
cells that overlap, of edges and of nodes. A writer puts it down in one dialect; a fault may then be added, which must
be refused or do no harm.
"""

import sys
import tempfile
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import gmsh
import meshio
import numpy as np
import pyvista
from mpi4py import MPI
from scipy.spatial import cKDTree

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.surfaces import meshing

QUADRATIC = ("triangle6", "quad8", "quad9")
SIDES = {3: "triangle", 4: "quad"}


@dataclass
class Made:
    """A mesh: points, shape (n, 3) in m; cells, corners going round and then what is between; groups."""

    points: np.ndarray
    cells: list[list[int]]
    kind: str
    area: float
    pieces: int
    piece: np.ndarray
    """Of each cell."""
    cell_groups: dict[str, set[int]] = field(default_factory=dict)
    edge_groups: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    node_groups: dict[str, set[int]] = field(default_factory=dict)
    how: dict = field(default_factory=dict)
    """Arguments of `meshing.read`."""
    told: str = ""
    """What was done to it."""

    def corners(self, cell):
        return cell[: 3 if self.kind == "triangle6" else 4 if self.kind in QUADRATIC else len(cell)]


def made(rng, kinds, pieces=2, groups=True):
    """A mesh of one of these kinds."""
    kind = str(rng.choice(kinds))
    pieces = int(rng.integers(1, pieces + 1))
    points, cells, piece, area = [], [], [], 0.0
    step = 2 if kind in QUADRATIC else 1
    for p in range(pieces):
        nx, ny = (int(k) for k in rng.integers(2, 5, 2))
        n, m = step * nx + 1, step * ny + 1
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        u, v = frame[0] * rng.uniform(0.3, 2), frame[1] * rng.uniform(0.3, 2) + frame[0] * rng.uniform(-0.2, 0.2)
        area += np.linalg.norm(np.cross(u, v))
        s, t = (a.ravel()[:, None] for a in np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, m)))
        start = sum(len(x) for x in points)
        points.append(rng.uniform(-1, 1, 3) + [0, 0, 9.0 * p] + s * u + t * v)
        for j in range(ny):
            for i in range(nx):
                a = start + step * (i + n * j)
                quad = [a, a + step, a + step * (n + 1), a + step * n]
                middle = [a + 1, a + n + 2, a + 2 * n + 1, a + n]
                one = {"mixed": rng.random() < 0.5, "polygon": False}.get(kind, kind.startswith("quad"))
                if kind == "quad8":
                    new = [quad + middle]
                elif kind == "quad9":
                    new = [quad + middle + [a + n + 1]]
                elif kind == "triangle6":
                    c = a + n + 1
                    new = [[*quad[:3], *middle[:2], c], [quad[0], *quad[2:], c, *middle[2:]]]
                elif kind == "polygon" and j == 0 and i < nx - 1 and i % 2 == 0:
                    new = [[quad[0], quad[1], quad[1] + 1, quad[2] + 1, quad[2], quad[3]]]
                elif kind == "polygon" and j == 0 and i % 2 == 1:
                    new = []
                else:
                    new = [quad] if one or kind == "polygon" else [quad[:3], [quad[0], *quad[2:]]]
                cells += new
                piece += [p] * len(new)
    x = np.concatenate(points)
    used = np.unique(np.concatenate([np.array(c) for c in cells]))
    place = np.full(len(x), -1)
    place[used] = np.arange(len(used))
    cells = [[int(place[k]) for k in c] for c in cells]
    mesh = Made(x[used], cells, kind, float(area), pieces, np.array(piece))
    if kind in ("mixed", "polygon"):
        mesh.how["triangulate"] = True
    if groups:
        every = np.arange(len(cells))
        for name in rng.choice(["body", "My Cloth", "Sleeve_left", "set-7"], int(rng.integers(0, 4)), replace=False):
            mesh.cell_groups[str(name)] = {
                int(k) for k in rng.choice(every, int(rng.integers(1, len(every) + 1)), False)
            }
        corners = sorted({k for c in cells for k in mesh.corners(c)})
        for name in rng.choice(["held", "pulled end", "N1"], int(rng.integers(0, 3)), replace=False):
            mesh.node_groups[str(name)] = {int(k) for k in rng.choice(corners, int(rng.integers(1, 6)), False)}
        free = _free(mesh)
        for name in rng.choice(["rim", "E 2"], int(rng.integers(0, 2)), replace=False):
            some = rng.choice(len(free), int(rng.integers(1, len(free) + 1)), replace=False)
            mesh.edge_groups[str(name)] = [free[k] for k in some]
    return mesh


def _free(mesh):
    """Ends of the free edges."""
    count: dict[tuple[int, int], int] = {}
    for cell in mesh.cells:
        c = mesh.corners(cell)
        for a, b in zip(c, c[1:] + c[:1], strict=True):
            count[min(a, b), max(a, b)] = count.get((min(a, b), max(a, b)), 0) + 1
    return [edge for edge, k in count.items() if k == 1]


def _polygon_area(x):
    return np.linalg.norm(np.cross(x - x[0], np.roll(x, -1, axis=0) - x[0]).sum(axis=0)) / 2


def faults(mesh, domain):
    """What is not as it was made; "" if all is."""
    m = domain.mesh
    count = 3 if m.basix_cell().name == "triangle" else 4
    corner = m.geometry.dofmaps[0][:, [0, 1, 2] if count == 3 else [0, 1, 3, 2]]
    areas = np.array([_polygon_area(x) for x in m.geometry.x[corner]])
    size = np.ptp(mesh.points, axis=0).max()
    expected = sum(len(mesh.corners(c)) - 2 for c in mesh.cells) if mesh.how.get("triangulate") else len(mesh.cells)
    if len(corner) != expected:
        return f"{len(corner)} cells for {expected}"
    if abs(areas.sum() - mesh.area) > 1e-4 * mesh.area:
        return f"area {areas.sum():g} for {mesh.area:g}"
    if domain.pieces != mesh.pieces:
        return f"{domain.pieces} pieces for {mesh.pieces}"
    centre = mesh.kind == "quad8"
    spelled = {name.lower(): name for name in domain.names}  # .inp does not tell capitals from others
    x = m.geometry.x
    if len(x) != len(mesh.points) + centre * len(mesh.cells):
        return f"{len(x)} points for {len(mesh.points)}"
    if cKDTree(x).query(mesh.points)[0].max() > 3e-5 * size:
        return "points at other places"
    for name, cells in mesh.cell_groups.items():
        wanted = sum(_polygon_area(mesh.points[mesh.corners(mesh.cells[k])]) for k in cells)
        if name.lower() not in spelled:
            return f"no group {name!r} in {sorted(domain.names)}"
        found = domain.entities(spelled[name.lower()], 2)[1]
        if abs(areas[found].sum() - wanted) > 1e-4 * mesh.area:
            return f"group {name!r} has {areas[found].sum():g} m2 for {wanted:g}"
        middles = np.array([mesh.points[mesh.corners(mesh.cells[k])].mean(axis=0) for k in sorted(cells)])
        if not mesh.how.get("triangulate"):
            own = x[corner[found]].mean(axis=1)
            if len(own) != len(middles) or cKDTree(own).query(middles)[0].max() > 3e-5 * size:
                return f"group {name!r} has other cells"
    for dim, groups in ((1, mesh.edge_groups), (0, mesh.node_groups)):
        for name, members in groups.items():
            if name.lower() not in spelled:
                return f"no group {name!r} in {sorted(domain.names)}"
            found = domain.entities(spelled[name.lower()], dim)[1]
            m.topology.create_connectivity(dim, 0)
            m.topology.create_connectivity(dim, 2)
            ends = meshing.dmesh.entities_to_geometry(m, dim, found).reshape(len(found), -1)[:, : dim + 1]
            own = x[ends].mean(axis=1)
            wanted = np.array([mesh.points[list(np.atleast_1d(k))].mean(axis=0) for k in members])
            if len(own) != len(wanted) or cKDTree(own).query(wanted)[0].max() > 3e-5 * size:
                return f"group {name!r} of dimension {dim} has {len(own)} others for {len(wanted)}"
    return ""


# -- .inp -------------------------------------------------------------------------------------------------------

TYPES = {
    "triangle": ["S3", "S3R", "M3D3", "SFM3D3", "CPS3", "STRI3", "R3D3", "CPE3", "s3r"],
    "quad": ["S4", "S4R", "M3D4", "M3D4R", "SFM3D4R", "S4R5", "CPS4", "CAX4P", "s4r"],
    "triangle6": ["S6", "STRI65", "M3D6", "SFM3D6", "CPS6"],
    "quad8": ["S8R", "S8R5", "S8", "M3D8", "M3D8R", "SFM3D8", "CPS8"],
    "quad9": ["S9R5", "M3D9", "M3D9R"],
}


class Inp:
    """A writer of .inp files in a dialect of its own."""

    def __init__(self, rng, folder):
        self.rng, self.folder = rng, folder
        self.upper = rng.random() < 0.5
        self.trail = rng.random() < 0.4
        self.comments = rng.random() < 0.6
        self.blank = "" if rng.random() < 0.5 else "  "
        self.fortran = rng.random() < 0.2
        self.continued = rng.random() < 0.3

    def keyword(self, name, flags=(), /, **parameters):
        word = name.upper() if self.upper else name.title() if self.rng.random() < 0.5 else name.lower()
        parts = ["*" + word]
        for key, value in parameters.items():
            key = key.upper() if self.upper else key
            value = f'"{value}"' if " " in value or self.rng.random() < 0.1 else value
            parts.append(f"{key}{self.blank}={self.blank}{value}")
        parts += [flag.upper() if self.upper else flag for flag in flags]
        if self.continued and len(parts) > 2:
            return ", ".join(parts[:2]) + ",\n" + ", ".join(parts[2:])
        return ("," + self.blank).join(parts)

    def row(self, words):
        return (", " if self.blank else ",").join(map(str, words)) + ("," if self.trail else "")

    def number(self, value):
        return f"{value:.12E}".replace("E", "D") if self.fortran else f"{value:.12g}"

    def data(self, rows):
        out = []
        for row in rows:
            if self.comments and self.rng.random() < 0.2:
                out.append(str(self.rng.choice(["** a comment, 1, 2", "**", "***** E L E M E N T S"])))
            out.append(row)
        return out

    def body(self, mesh, cells, nodes):
        """Lines for some of the cells and nodes of a mesh, numbered anew; and the numbers."""
        shift = int(self.rng.integers(0, 50))
        number = dict(zip(self.rng.permutation(nodes).tolist(), range(shift + 1, shift + 1 + len(nodes)), strict=True))
        first = int(self.rng.integers(1, 100))
        element = {cell: first + k for k, cell in enumerate(cells)}
        lines = []
        for some in np.array_split(np.array(nodes), int(self.rng.integers(1, 4))):
            rows = [self.row([number[k], *map(self.number, mesh.points[k])]) for k in some.tolist()]
            if len(some) and self.rng.random() < 0.15:
                sub = self.folder / f"nodes {self.rng.integers(1 << 30)}.txt"
                sub.write_text("\n".join(self.data(rows)) + "\n")
                if self.rng.random() < 0.5:
                    lines += [self.keyword("node", input=sub.name)]
                else:
                    lines += [self.keyword("node"), self.keyword("include", input=sub.name)]
            elif len(some):
                lines += [self.keyword("node"), *self.data(rows)]
        blocks = []
        for some in np.array_split(np.array(cells), int(self.rng.integers(1, 4))):
            by: dict[str, list[int]] = {}
            for cell in some.tolist():
                by.setdefault(mesh.kind if mesh.kind in QUADRATIC else SIDES[len(mesh.cells[cell])], []).append(cell)
            for kind, own in by.items():
                blocks.append([self.keyword("element", type=str(self.rng.choice(TYPES[kind])))])
                rows = []
                for cell in own:
                    words = [element[cell], *(number[k] for k in mesh.cells[cell])]
                    if len(words) > 7 and self.rng.random() < 0.5:
                        rows += [", ".join(map(str, words[:6])) + ",", self.row(words[6:])]
                    else:
                        rows.append(self.row(words))
                blocks[-1] += self.data(rows)
        elements = [line for block in blocks for line in block]
        lines = [*elements, *lines] if self.rng.random() < 0.2 else [*lines, *elements]
        return lines, number, element

    def sets(self, kind, groups, number, **extra):
        lines, key = [], "elset" if kind == "E" else "nset"
        for name, members in groups.items():
            own = sorted(number[k] for k in members if k in number)
            if not own:
                continue
            spelled = name if " " in name or self.rng.random() < 0.7 else name.upper()
            if own == list(range(own[0], own[-1] + 1)) and self.rng.random() < 0.7:
                row = [own[0], own[-1]] if self.rng.random() < 0.3 else [own[0], own[-1], 1]
                lines += [self.keyword(key, ["generate"], **{key: spelled}, **extra), self.row(row)]
                continue
            if len(own) > 2 and self.rng.random() < 0.3:
                lines += [self.keyword(key, **{key: f"part of {name}"}, **extra), *self.data([self.row(own[:2])])]
                rows = [f'"part of {name}"', self.row(own[2:])]
                lines += [self.keyword(key, **{key: name}, **extra), *self.data(rows)]
                continue
            rows = [self.row(own[k : k + 8]) for k in range(0, len(own), 8)]
            lines += [self.keyword(key, **{key: name}, **extra), *self.data(rows)]
        return lines

    def head(self):
        lines = ["*Heading", " a sheet, by hand; 1, 2, 3"] if self.rng.random() < 0.5 else []
        return [*lines, "*Preprint, echo=NO, model=NO"] if self.rng.random() < 0.3 else lines

    def tail(self):
        text = """*Material, name=Cloth
*Elastic
 1000., 0.3
*Step, name=Step-1, nlgeom=YES
*Static
 0.1, 1., 1e-5, 0.1
*Boundary
held, 1, 3
*End Step"""
        return text.split("\n") if self.rng.random() < 0.5 else []

    def save(self, name, lines):
        path = self.folder / (name + str(self.rng.choice([".inp", ".INP", ".Inp"])))
        text = "\n".join(lines) + "\n"
        end = str(self.rng.choice(["\n", "\r\n"]))
        mark = self.rng.random()
        encoding = "utf-8-sig" if mark < 0.1 else "latin-1" if mark < 0.3 else "utf-8"
        if encoding == "latin-1":
            text = "** Vorderstück, Ärmel\n" + text
        path.write_bytes(text.replace("\n", end).encode(encoding))
        return path


def inp_flat(rng, folder):
    mesh = made(rng, ["triangle", "quad", "mixed", *QUADRATIC])
    w = Inp(rng, folder)
    lines, number, element = w.body(mesh, list(range(len(mesh.cells))), list(range(len(mesh.points))))
    lines += w.sets("E", mesh.cell_groups, element) + w.sets("N", mesh.node_groups, number)
    if mesh.edge_groups and mesh.kind not in QUADRATIC:
        k = max(element.values()) + 7
        for name, ends in mesh.edge_groups.items():
            lines.append(w.keyword("element", type="T3D2", elset=name))
            lines += [w.row([k + j, number[a], number[b]]) for j, (a, b) in enumerate(ends)]
            k += len(ends)
    else:
        mesh.edge_groups = {}
    return mesh, w.save("flat", [*w.head(), *lines, *w.tail()])


def inp_parts(rng, folder):
    """A part for each piece, moved to its place by its instance; both are numbered from anywhere."""
    mesh = made(rng, ["triangle", "quad", "triangle6", "quad8"], pieces=3)
    mesh.edge_groups = {}
    w = Inp(rng, folder)
    parts, instances, after = [], [], []
    points = mesh.points.copy()
    plain: set[str] = set()
    for p in range(mesh.pieces):
        cells = np.flatnonzero(mesh.piece == p).tolist()
        nodes = sorted({k for c in cells for k in mesh.cells[c]})
        moves = []
        if rng.random() < 0.8:
            t, a, b, angle = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3), float(rng.uniform(-180, 180))
            turned = rng.random() < 0.7
            moves = [t, *([(*a, *b, angle)] if turned else [])]
            back = points[nodes]
            if turned:
                axis = pyvista.transformations.axis_angle_rotation(b - a, -angle, point=a)
                back = back @ axis[:3, :3].T + axis[:3, 3]
            mesh.points[nodes] = back - t
        lines, number, element = w.body(mesh, cells, nodes)
        inside = rng.random() < 0.5
        named = w.sets("E", mesh.cell_groups, element) + w.sets("N", mesh.node_groups, number) if inside else []
        parts += [w.keyword("part", name=f"P{p}"), *lines, *named, w.keyword("end part")]
        instances += [w.keyword("instance", name=f"P{p}-1", part=f"P{p}")]
        instances += [w.row(map(w.number, move)) for move in moves] + [w.keyword("end instance")]
        if inside:
            for groups, numbers in ((mesh.cell_groups, element), (mesh.node_groups, number)):
                plain.update({name for name, members in groups.items() if members & numbers.keys()})
        else:
            extra = {"instance": f"P{p}-1"}
            after += w.sets("E", mesh.cell_groups, element, **extra) + w.sets("N", mesh.node_groups, number, **extra)
    mesh.points = points
    # a set of several parts goes by the names of its instances: not looked for here
    for name in plain if mesh.pieces > 1 else ():
        mesh.cell_groups.pop(name, None)
        mesh.node_groups.pop(name, None)
    lines = [*parts, w.keyword("assembly", name="A"), *instances, *after, w.keyword("end assembly")]
    return mesh, w.save("parts", [*w.head(), *lines, *w.tail()])


# -- other texts -------------------------------------------------------------------------------------------------


def obj(rng, folder):
    mesh = made(rng, ["triangle", "quad", "mixed", "polygon"])
    mesh.node_groups = {}
    # a cell is in one group at most, in the order of the file
    owner = {k: name for name, cells in mesh.cell_groups.items() for k in cells}
    mesh.cell_groups = {n: {k for k, o in owner.items() if o == n} for n in set(owner.values())}
    lines = ["# made by hand", "mtllib none.mtl"]
    cut = rng.random() < 0.3
    lines += [
        f"v {x:.12g} {y:.12g} {z:.12g}" + (" 0.5 0.5 0.5" if rng.random() < 0.1 else "") for x, y, z in mesh.points
    ]
    lines += ["vt 0 0", "vn 0 0 1", "s off", "usemtl weave"]
    n, relative, style = len(mesh.points), rng.random() < 0.3, int(rng.integers(0, 4))
    now = ""
    for k, cell in enumerate(mesh.cells):
        if owner.get(k, "") != now:
            now = owner.get(k, "")
            lines.append(f"{rng.choice(['g', 'o'])} {now}")
        words = [str(c - n if relative else c + 1) + ["", "/1", "/1/1", "//1"][style] for c in cell]
        if cut and len(words) > 3:
            lines += ["f " + " ".join(words[:2]) + " \\", " ".join(words[2:])]
        else:
            lines.append("f " + " ".join(words))
    for name, ends in mesh.edge_groups.items():
        lines += [f"g {name}", *(f"l {a + 1} {b + 1}" for a, b in ends)]
    path = folder / str(rng.choice(["a.obj", "a.OBJ"]))
    mark = str(rng.choice(["utf-8", "utf-8-sig", "latin-1"]))
    if mark == "latin-1":
        lines[0] += " für Müller"
    path.write_bytes(("\n".join(lines) + "\n").replace("\n", str(rng.choice(["\n", "\r\n"]))).encode(mark))
    return mesh, path


def stl(rng, folder):
    mesh = made(rng, ["triangle"], groups=False)
    path = folder / str(rng.choice(["a.stl", "a.STL"]))
    x = mesh.points[np.array(mesh.cells)]
    if rng.random() < 0.5:
        rows = np.zeros(len(x), dtype=[("n", "<f4", 3), ("x", "<f4", (3, 3)), ("a", "<u2")])
        rows["x"] = x
        head = b"solid looks like text" if rng.random() < 0.5 else b"made by hand"
        path.write_bytes(head.ljust(80) + np.uint32(len(x)).tobytes() + rows.tobytes())
        return mesh, path
    lines = ["solid Stück"]
    for triangle in x:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["  vertex " + " ".join(f"{c:.9e}" for c in corner) for corner in triangle]
        lines += ["endloop", "endfacet"]
    text = "\n".join([*lines, "endsolid Stück"]) + "\n"
    text = text.upper() if rng.random() < 0.3 else text
    path.write_bytes(text.encode(str(rng.choice(["utf-8", "latin-1"]))))
    return mesh, path


def ply(rng, folder):
    mesh = made(rng, ["triangle", "quad", "mixed", "polygon"], groups=False)
    form = str(rng.choice(["ascii", "binary_little_endian", "binary_big_endian"]))
    name, real = str(rng.choice(["vertex_index", "vertex_indices"])), str(rng.choice(["double", "float64"]))
    more, first = rng.random() < 0.4, rng.random() < 0.3
    head = ["ply", f"format {form} 1.0", "comment by hand", f"element vertex {len(mesh.points)}"]
    head += [f"property {real} {axis}" for axis in "xyz"] + (["property uchar red"] if more else [])
    head += [f"element face {len(mesh.cells)}"] + (["property uchar flags"] if first else [])
    head += [f"property list uchar int {name}"] + (["property list uchar float texcoord"] if more else [])
    if more:
        head += ["element edge 1", "property int vertex1", "property int vertex2"]
    text = ("\n".join([*head, "end_header"]) + "\n").encode()
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(form, "")

    def put(value, kind):
        return f"{value:.12g} ".encode() if form == "ascii" else np.array(value, dtype=order + kind).tobytes()

    end = b"\n" if form == "ascii" else b""
    for x in mesh.points:
        text += b"".join(put(c, "f8") for c in x) + (put(200, "u1") if more else b"") + end
    for cell in mesh.cells:
        text += (put(7, "u1") if first else b"") + put(len(cell), "u1") + b"".join(put(k, "i4") for k in cell)
        text += (put(2, "u1") + put(0.5, "f4") + put(0.25, "f4") if more else b"") + end
    if more:
        text += put(0, "i4") + put(1, "i4") + end
    path = folder / str(rng.choice(["a.ply", "a.PLY"]))
    path.write_bytes(text)
    return mesh, path


def vtk_poly(rng, folder):
    mesh = made(rng, ["triangle", "quad", "mixed", "polygon"], groups=False)
    faces = np.concatenate([[len(c), *c] for c in mesh.cells])
    data = pyvista.PolyData(mesh.points, faces=faces)
    path = folder / str(rng.choice(["a.vtk", "a.vtp"]))
    data.save(path, binary=bool(rng.random() < 0.5))
    if path.suffix == ".vtk" and rng.random() < 0.4:
        rows = [" ".join(map(str, [len(c), *c])) for c in mesh.cells]
        lines = [
            "# vtk DataFile Version 3.0",
            "by hand",
            "ASCII",
            "DATASET POLYDATA",
            f"POINTS {len(mesh.points)} double",
        ]
        lines += [" ".join(f"{c:.12g}" for c in x) for x in mesh.points]
        path.write_text("\n".join([*lines, f"POLYGONS {len(rows)} {len(faces)}", *rows]) + "\n")
    return mesh, _capital(rng, path)


def _capital(rng, path):
    """The same file with another spelling of its ending."""
    return path.rename(path.with_suffix(path.suffix.upper())) if rng.random() < 0.2 else path


def vtk_grid(rng, folder):
    """By meshio or VTK, in words or bytes."""
    mesh = made(rng, ["triangle", "quad", "mixed", *QUADRATIC])
    mesh.node_groups, mesh.edge_groups = {}, {}
    mesh.cell_groups = {}
    data = _meshio(mesh)
    path = folder / str(rng.choice(["a.vtk", "a.vtu"]))
    if rng.random() < 0.5:
        data.write(path, binary=bool(rng.random() < 0.5))
    else:
        pyvista.from_meshio(data).save(path, binary=bool(rng.random() < 0.5))
    return mesh, _capital(rng, path)


def _meshio(mesh):
    blocks: list[tuple[str, list]] = []
    for cell in mesh.cells:
        kind = mesh.kind if mesh.kind in QUADRATIC else SIDES[len(cell)]
        if not blocks or blocks[-1][0] != kind:
            blocks.append((kind, []))
        blocks[-1][1].append(cell)
    return meshio.Mesh(mesh.points, blocks)


# -- gmsh ---------------------------------------------------------------------------------------------------------

GMSH = {"triangle": 2, "quad": 3, "triangle6": 9, "quad8": 16, "quad9": 10}


def _to_gmsh(rng, mesh, names=True):
    """The mesh as a model of gmsh: discrete surfaces, one for each combination of groups; physical groups."""
    gmsh.clear()
    kinds: dict[tuple, list[int]] = {}
    for k, cell in enumerate(mesh.cells):
        kind = mesh.kind if mesh.kind in QUADRATIC else SIDES[len(cell)]
        kinds.setdefault((kind, tuple(sorted(n for n, own in mesh.cell_groups.items() if k in own))), []).append(k)
    points = gmsh.model.addDiscreteEntity(2)
    gmsh.model.mesh.addNodes(2, points, np.arange(1, len(mesh.points) + 1), mesh.points.ravel())
    surfaces: dict[str, list[int]] = {}
    element = 1
    for (kind, groups), cells in kinds.items():
        surface = points if not surfaces else gmsh.model.addDiscreteEntity(2)
        for name in groups or ["rest"]:
            surfaces.setdefault(name, []).append(surface)
        nodes = np.array([mesh.cells[k] for k in cells]) + 1
        gmsh.model.mesh.addElementsByType(surface, GMSH[kind], np.arange(element, element + len(cells)), nodes.ravel())
        element += len(cells)
    for name, own in surfaces.items():
        gmsh.model.addPhysicalGroup(2, own, name=name if names else "")
    for name, ends in mesh.edge_groups.items():
        curve = gmsh.model.addDiscreteEntity(1)
        nodes = np.array(ends).ravel() + 1
        gmsh.model.mesh.addElementsByType(curve, 1, np.arange(element, element + len(ends)), nodes)
        element += len(ends)
        gmsh.model.addPhysicalGroup(1, [curve], name=name if names else "")
    for name, nodes in mesh.node_groups.items():
        own = []
        for k in nodes:
            own.append(gmsh.model.addDiscreteEntity(0))
            gmsh.model.mesh.addElementsByType(own[-1], 15, [element], [k + 1])
            element += 1
        gmsh.model.addPhysicalGroup(0, own, name=name if names else "")


def by_gmsh(rng, folder):
    """Files that gmsh writes: its own of four versions, and those of others."""
    suffix = str(rng.choice([".msh", ".msh", ".med", ".unv", ".bdf", ".inp"]))
    kinds = (
        ["triangle", "quad", "mixed", *QUADRATIC]
        if suffix != ".bdf"
        else ["triangle", "quad", "mixed", "triangle6", "quad8"]
    )
    kinds = kinds if suffix != ".unv" else kinds[:-1]
    mesh = made(rng, kinds)
    names = rng.random() < 0.7
    if mesh.kind in QUADRATIC:
        mesh.edge_groups = {}
    if suffix in (".bdf", ".inp", ".unv", ".med"):
        mesh.edge_groups, mesh.node_groups = {}, {}
    path = folder / f"a{suffix}"
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        _to_gmsh(rng, mesh, names)
        binary = float(rng.random() < 0.5)
        gmsh.option.setNumber("Mesh.MshFileVersion", float(rng.choice([2.2, 4.0, 4.1])))
        gmsh.option.setNumber("Mesh.BdfFieldFormat", float(rng.integers(0, 3)))
        gmsh.option.setNumber("Mesh.SaveGroupsOfElements", 1)
        old = gmsh.option.getNumber("Mesh.MshFileVersion") == 4.0
        gmsh.option.setNumber("Mesh.Binary", 0.0 if old else binary)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    if not names or suffix in (".bdf", ".unv", ".inp"):
        # by number, or by names of the program's own
        mesh.cell_groups, mesh.edge_groups, mesh.node_groups = {}, {}, {}
    if suffix == ".bdf":
        mesh.told = "bdf"
    return mesh, _capital(rng, path) if suffix not in (".msh",) else path


def torn(rng, folder):
    """Every cell, or every piece, has corners of its own, off by a little: merged."""
    mesh = made(rng, ["triangle", "quad", "mixed"], groups=False)
    points, cells = [], []
    for cell in mesh.cells:
        cells.append([len(points) + k for k in range(len(cell))])
        points += [mesh.points[k] + rng.uniform(-1e-6, 1e-6, 3) for k in cell]
    text = [f"v {x} {y} {z}" for x, y, z in points] + ["f " + " ".join(str(k + 1) for k in c) for c in cells]
    path = folder / "torn.obj"
    path.write_text("\n".join(text) + "\n")
    mesh.how["merge"] = 2e-5
    return mesh, path


def millimetres(rng, folder):
    """Another dialect, in mm."""
    mesh, path = [inp_flat, obj, ply][int(rng.integers(0, 3))](_Scaled(rng), folder)
    mesh.points = mesh.points / 1000
    mesh.area /= 1e6
    mesh.how["scale"] = 0.001
    return mesh, path


class _Scaled:
    """A generator of random numbers for lengths a thousand times as large."""

    def __init__(self, rng):
        self._rng = rng

    def __getattr__(self, name):
        return getattr(self._rng, name)

    def uniform(self, low, high, *size):
        return 1000 * self._rng.uniform(low, high, *size)


WRITERS = [
    inp_flat,
    inp_flat,
    inp_parts,
    inp_parts,
    obj,
    stl,
    ply,
    vtk_poly,
    vtk_grid,
    by_gmsh,
    by_gmsh,
    torn,
    millimetres,
]


def spoilt(rng, path):
    """Do something to the file that must be noticed; what it was, "" for nothing."""
    raw, suffix = path.read_bytes(), path.suffix.lower()
    if suffix == ".inp":
        lines = raw.decode("latin-1").splitlines()
        add = [
            "*NGEN\n1, 9, 1",
            "*ELGEN\n1, 2, 1",
            "*ELEMENT, TYPE=B31\n99999, 1, 2",
            "*ELEMENT, TYPE=SC8R\n99999, 1, 2",
            "*NODE, SYSTEM=C\n1, 0, 0",
            "*TIE, NAME=t\na, b",
            "*INCLUDE, INPUT=none.inp",
            "*NODE\n99999, 1, 2, x",
        ]
        what = str(rng.choice(add))
        at = next(
            (k for k, line in enumerate(lines) if line.strip().lower().startswith(("*end part", "*step"))), len(lines)
        )
        path.write_bytes("\n".join([*lines[:at], what, *lines[at:]]).encode("latin-1"))
        return what.split("\n")[0]
    if suffix in (".stl", ".ply", ".vtk", ".vtu", ".vtp", ".msh"):
        cut = int(len(raw) * rng.uniform(0.1, 0.85))
        path.write_bytes(raw[:cut])
        return f"cut to {cut} of {len(raw)} bytes"
    if suffix == ".obj":
        path.write_bytes(raw + b"f 1 2 999999\n")
        return "no such point"
    return ""


def trial(seed):
    """A mesh by its seed: "right", "refused: ..." or "wrong: ..."; and what it was."""
    rng = np.random.default_rng(seed)
    writer = WRITERS[seed % len(WRITERS)]
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh, path = writer(rng, Path(name))
        fault = spoilt(rng, path) if rng.random() < 0.2 else ""
        what = f"{writer.__name__} {path.suffix} {mesh.kind}" + (f", spoilt: {fault}" if fault else "")
        try:
            domain = meshing.read(path, MPI.COMM_SELF, **mesh.how)
        except InputError as error:
            said = str(error)
            if "\n" in said or not said.endswith("."):
                return f"wrong: not one sentence: {said}", what
            return f"refused: {said.replace(name, '')}", what
        except Exception as error:
            return f"wrong: {type(error).__name__}: {error}", what
        said = faults(mesh, domain)
        return (f"wrong: {said}" if said else "right"), what


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    told: dict[str, int] = {}
    for seed in range(count):
        result, what = trial(seed)
        good, spoiled = result.split(":")[0], "spoilt" in what
        told[f"{good}{', spoilt' if spoiled else ''}"] = told.get(f"{good}{', spoilt' if spoiled else ''}", 0) + 1
        if good == "wrong" or (good == "refused") != spoiled or "-v" in sys.argv:
            print(f"{seed}: {what}: {result}", flush=True)
    print(", ".join(f"{n} {key}" for key, n in sorted(told.items())), f"of {count}")
    sys.exit(any(key.startswith("wrong") for key in told))
