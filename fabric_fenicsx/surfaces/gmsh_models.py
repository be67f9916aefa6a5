"""Surfaces from gmsh: its own `.geo` and `.msh` files, those of others that it reads, and models of its API."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import gmsh
import numpy as np
from dolfinx.io.gmsh import cell_perm_array
from dolfinx.mesh import CellType

from ..errors import InputError
from . import checking, geo_programs
from .checking import Array
from .grouping import Raw, require_groups
from .preparing import completed, decoded

SUFFIXES = {".med", ".unv", ".bdf", ".nas"}
"""Of files of other programs that gmsh reads."""


@contextmanager
def session() -> Iterator[None]:
    """gmsh, silent, with nothing in it; what is made in it ends with it."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield
    finally:
        gmsh.finalize()


def opened(path: Path, numbers: dict[str, float], trust: bool) -> None:
    """Put a file into gmsh, meshed with `numbers` if it is a `.geo`."""
    name, suffix = str(path), path.suffix.lower()
    try:
        start = path.read_bytes()[:1000]
    except OSError as error:
        raise InputError(f"The mesh file {name!r} cannot be read: {error.strerror}.") from error
    # gmsh would take all else for its language, and be left unable to read anything after bytes that are no text
    if not (suffix in SUFFIXES or (b"\0" not in start if suffix == ".geo" else suffix == ".msh" and _is_msh(start))):
        raise InputError(
            f"{name!r} is neither a .geo nor a .msh file of gmsh, nor one of those that are read otherwise."
        )
    geo_programs.check(path, trust)
    for key, value in numbers.items():
        if not np.isfinite(value):  # in coordinates it ends gmsh without a word
            raise InputError(f"{name!r} cannot be meshed with {key} = {value}: give a finite number.")
    known: list[str] = []
    cells = None
    try:
        gmsh.option.setNumber("Mesh.ReadGroupsOfElements", 1)
        if suffix == ".unv":
            cells = _open_unv(path)
        elif suffix == ".geo":
            with TemporaryDirectory() as folder:
                program = str(_ended(path, folder))
                gmsh.open(program)
                known = gmsh.parser.getNames()
                _mesh(program, numbers)
        else:
            gmsh.open(name)
    except InputError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise InputError(f"{name!r} is not a mesh that gmsh can read: {reason}.") from error
    for key, value in numbers.items():
        if key not in known or gmsh.parser.getNumber(key).tolist() != [value]:
            raise InputError(
                f"{name!r} does not let {key} be set to {value} (by DefineConstant in a .geo file); "
                f"its numbers are: {', '.join(sorted(known)) or 'none'}."
            )
    if not gmsh.model.mesh.getElements(2)[0].size:
        raise InputError(f"{name!r} holds no surface mesh: there are no triangles or quadrilaterals.")
    if suffix in (".bdf", ".nas"):
        cells = _cells_of_bdf(path)
    found = sum(len(tags) for tags in gmsh.model.mesh.getElements(2)[1])
    if cells is not None and found != cells:
        raise InputError(f"{name!r} has {cells} cells, of which gmsh reads {found}: save it in another format.")


def _is_msh(start: bytes) -> bool:
    return start.startswith((b"$MeshFormat", b"$Comments"))


def _mesh(name: str, numbers: dict[str, float]) -> None:
    """Mesh the open `.geo` file, with these numbers in place of its own."""
    if numbers:
        # opening clears the parser; merging does not, and DefineConstant keeps what it finds
        gmsh.clear()
        gmsh.parser.clear()
        for key, value in numbers.items():
            gmsh.parser.setNumber(key, [value])
        gmsh.merge(name)
    gmsh.model.mesh.generate(2)


def model(path: Path = Path(), foreign: bool = False) -> Raw:
    """The surface of the current gmsh model; foreign: its cells need not be in physical groups.

    Groups are the physical ones, by name or, without one, by number. Raises InputError for groups of volumes, cells of
    a kind that DOLFINx has not, and cells that are in no physical surface.
    """
    groups = gmsh.model.getPhysicalGroups()
    dims = {dim for dim, _ in groups}
    solid = gmsh.model.mesh.getElements(3)[0].size > 0
    if 3 in dims or (foreign and solid):
        raise InputError(
            f"The mesh {'has a physical group of volumes' if 3 in dims else 'holds volumes'}: name its surfaces, and "
            'no volumes, as in Physical Surface("sheet") = {1};.'
        )
    tags, x, _ = gmsh.model.mesh.getNodes()
    place = np.full(int(tags.max(initial=0)) + 1, -1)
    place[tags.astype(int)] = np.arange(len(tags))
    raw = Raw(path, x.reshape(-1, 3).copy(), [], foreign=foreign)
    own: dict[int, Array] = {}
    total = 0
    for _, entity in gmsh.model.getEntities(2):
        numbers = []
        for kind, nodes in _elements(2, entity):
            family, nodes = _cells(raw, kind, place[nodes])
            numbers.append(total + np.arange(len(nodes)))
            raw.faces.append((family, nodes, numbers[-1]))
            total += len(nodes)
        own[entity] = np.concatenate([np.zeros(0, dtype=int), *numbers])
    _group(raw, place, own, total)
    return raw


def _elements(dim: int, entity: int) -> list[tuple[int, Array]]:
    """Kinds and nodes of the elements of an entity, shape (elements, nodes)."""
    kinds, _, nodes = gmsh.model.mesh.getElements(dim, entity)
    widths = [gmsh.model.mesh.getElementProperties(kind)[3] for kind in kinds]
    return [(int(k), n.reshape(-1, w).astype(int)) for k, n, w in zip(kinds, nodes, widths, strict=True)]


def _cells(raw: Raw, kind: int, nodes: Array) -> tuple[str, Array]:
    """Kind and nodes of cells as DOLFINx has them."""
    name, _, _, width, _, corners = gmsh.model.mesh.getElementProperties(kind)
    family = {3: "triangle", 4: "quadrilateral"}.get(corners)
    if family == "quadrilateral" and width == 8:
        raw.points, nodes = completed(raw.points, nodes)
        width = 9
    if family is None or width not in checking.DEGREE:
        raise InputError(f"The mesh has cells {name!r}: set Mesh.ElementOrder 1 or 2, Mesh.SecondOrderIncomplete 0.")
    return family, nodes[:, cell_perm_array(CellType[family], width)]


def _group(raw: Raw, place: Array, own: dict[int, Array], total: int) -> None:
    """Add the physical groups; place: of the nodes by number, own: cells of each surface."""
    named = np.zeros(total, dtype=bool)
    for dim, tag in gmsh.model.getPhysicalGroups():
        name = gmsh.model.getPhysicalName(dim, tag).strip() or str(tag)  # a .med fills names up with blanks
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, tag):
            if dim == 2:
                raw.add(name, 2, own[entity])
                named[own[entity]] = True
                continue
            for _, nodes in _elements(dim, entity):
                raw.add(name, dim, place[nodes[:, :2]] if dim == 1 else place[nodes[:, 0]])
    if not raw.foreign:
        require_groups(total, int(named.sum()))
    elif raw.path.suffix.lower() in (".bdf", ".nas"):
        for entity, cells in own.items():  # by number of the property
            raw.add(str(entity), 2, cells)


def _cells_of_bdf(path: Path) -> int:
    """How many cells a Nastran file has: gmsh passes over in silence what it does not know."""
    cells = 0
    for number, line in enumerate(decoded(path).splitlines(), 1):
        card = re.match(r"[A-Za-z][A-Za-z0-9]*\*?", line)
        if not card:
            continue
        what = card[0].upper()
        fields = (
            line.split(",") if "," in line else [line[:8], *re.findall(".{16}" if "*" in what else ".{8}", line[8:])]
        )
        what = what.rstrip("*")
        if what in ("CTRIA3", "CTRIA6", "CQUAD4", "CQUAD8", "CQUAD"):
            cells += 1
        elif what in ("INCLUDE", "GRDSET") or re.match("CTRI|CQUA|CSHEAR", what):
            raise InputError(f"{str(path)!r}, line {number}: {what} is not read; write it out, or save another format.")
        elif what == "GRID" and len(fields) > 2 and fields[2].strip() not in ("", "0"):
            raise InputError(
                f"{str(path)!r}, line {number}: a point in the system {fields[2].strip()} is not read: give it in the "
                "basic one."
            )
    return cells


def _open_unv(path: Path) -> int:
    """Open an I-DEAS file with its groups, of which gmsh passes over those of data set 2467, cuts names at blanks, and
    mixes numbers with those of properties. Returns how many cells it has."""
    lines = decoded(path).splitlines()
    names: dict[int, str] = {}
    cells, inside, k = 0, "", 0
    headers = []
    while k < len(lines):
        words = lines[k].split()
        if words == ["-1"]:
            inside = "" if inside else " ".join(lines[k + 1 : k + 2]).strip()
            if inside in ("15", "781"):
                raise InputError(f"{str(path)!r}, line {k + 2}: points of data set {inside} are not read; save 2411.")
            if inside == "2467":
                lines[k + 1] = "  2477"
            k += 2 if inside else 1
        elif inside in ("2435", "2452", "2467", "2477") and len(words) == 8 and k + 1 < len(lines):
            names[int(words[0])] = lines[k + 1].strip()
            lines[k + 1] = f"group_{int(words[0])}"
            k += 2 + -(-int(words[7]) // 2)
        elif inside == "2412" and len(words) == 6:
            kind, count = int(words[1]), int(words[5])
            cells += 41 <= kind <= 95
            headers.append(k)
            k += 1 + (kind in (11, 21, 22, 23, 24, 31, 32)) + -(-count // 8)
        else:
            k += 1
    for k in headers:
        number, shape, _, own, *rest = lines[k].split()
        lines[k] = "".join(
            f"{word:>10}" for word in [number, shape, "1" if names else own, "0" if names else own, *rest]
        )
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "copy.unv"
        copy.write_text("\n".join(lines) + "\n")
        gmsh.open(str(copy))
    for dim, tag in gmsh.model.getPhysicalGroups():
        called = gmsh.model.getPhysicalName(dim, tag)
        if called.startswith("group_"):
            gmsh.model.removePhysicalName(called)
            gmsh.model.setPhysicalName(dim, tag, names[int(called.removeprefix("group_"))])
    return cells


def _ended(path: Path, folder: str) -> Path:
    """The file, or a copy of it, with an end to its last line: without, gmsh passes over all but the first statement
    there."""
    raw = path.read_bytes()
    if raw.endswith(b"\n"):
        return path
    if re.search(rb"Include|Merge|FromFile|Current|RelativePath|DirName", raw):
        raise InputError(f"{str(path)!r}: gmsh does not read all of a last line without an end: add an empty line.")
    copy = Path(folder) / path.name
    copy.write_bytes(raw + b"\n")
    return copy
