"""Surfaces from `.inp` files of Abaqus and CalculiX: nodes, elements, sets, parts and their instances.

Materials, sections, loads and steps are passed over. What would move, make or join nodes in a way that is not
known here is refused, by file and line: nothing of the mesh is left out in silence.
"""

import re
from pathlib import Path

import numpy as np

from .abaqus_lines import Line, keyword_lines
from .abaqus_parts import Part, Whole
from .grouping import Raw
from .preparing import completed, of_vtk

_SHELL = re.compile(r"(S|DS|STRI|M3D|SFM3D|R3D|CP[SE]|CPEG|CAX)(65|\d)[A-Z]*\d*$")
"""Types of elements that are surfaces, of that many nodes: shells, membranes, and those of plane meshes."""
_TRUSS = re.compile(r"T[23]D([23])[A-Z]*$")
"""Trusses, by which gmsh and meshio name edges of a surface."""
_REFUSED = {
    "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "IMPERFECTION", "IMPORT", "PARAMETER", "TIE", "MPC",
    "EQUATION", "SYMMETRICMODELGENERATION", "SUBSTRUCTUREPATH", "REBAR",
}  # fmt: skip
"""What changes the mesh, or joins its nodes, and is not understood."""
_KNOWN = {
    "NODE": {"NSET", "SYSTEM", "INPUT"},
    "ELEMENT": {"TYPE", "ELSET", "INPUT"},
    "NSET": {"NSET", "ELSET", "GENERATE", "INTERNAL", "UNSORTED", "INSTANCE", "INPUT"},
    "ELSET": {"ELSET", "GENERATE", "INTERNAL", "UNSORTED", "INSTANCE", "INPUT"},
    "PART": {"NAME"},
    "ASSEMBLY": {"NAME"},
    "INSTANCE": {"NAME", "PART"},
}
"""Parameters of what is read."""
_KINDS = {3: "triangle", 6: "triangle", 4: "quadrilateral", 8: "quadrilateral", 9: "quadrilateral"}


def read(path: Path) -> Raw:
    """The surface of an `.inp` file. Groups: ELSETs of cells, and of edges where they are trusses on them, NSETs, and
    the instances where there are several; a set that several instances have is called `instance.set`.

    Raises InputError, with file and line, for what is not understood.
    """
    flat = Part()
    parts: dict[str, Part] = {}
    instances: dict[str, Part] = {}
    spelling: dict[str, str] = {}
    here, inside, keyword = flat, "", None
    lines = list(keyword_lines(path))
    k = 0
    while k < len(lines):
        line = lines[k]
        k += 1
        if not line.keyword:
            if keyword is None:
                line.refuse(f"{','.join(line.words)!r} stands before the first keyword, as *NODE")
            continue
        keyword = line.keyword
        for end, of in (("ENDPART", "PART"), ("ENDINSTANCE", "INSTANCE"), ("ENDASSEMBLY", "ASSEMBLY")):
            if keyword == end and inside != of:
                line.refuse(f"*{end} ends no *{of}")
        data: list[Line] = []
        while k < len(lines) and not lines[k].keyword:
            data.append(lines[k])
            k += 1
        if keyword in _REFUSED:
            line.refuse(f"*{keyword} makes, moves or joins nodes in a way that is not read: write them out, one by one")
        for unknown in sorted(line.parameters.keys() - _KNOWN.get(keyword, line.parameters.keys())):
            line.refuse(f"*{keyword} with {unknown} is not read: leave it out, or write out what it stands for")
        if keyword == "PART":
            here, inside = parts.setdefault(line.parameter("NAME").upper(), Part()), "PART"
        elif keyword == "ASSEMBLY":
            here, inside = flat, "ASSEMBLY"
        elif keyword == "INSTANCE":
            name = line.parameter("NAME")
            if name.upper() in instances:
                line.refuse(f"the instance {name!r} is there already")
            if "PART" not in line.parameters or line.parameter("PART").upper() not in parts:
                line.refuse(f"the instance {name!r} is of no part that stands before it")
            here = instances[name.upper()] = Part(name, of=parts[line.parameter("PART").upper()])
            here.moves = _moves(data[:2])
            if len(data) > 2:
                data[2].refuse("an instance has a line for its shift and one for its turn")
            inside = "INSTANCE"
        elif keyword in ("ENDPART", "ENDASSEMBLY"):
            here, inside = flat, ""
        elif keyword == "ENDINSTANCE":
            here, inside = flat, "ASSEMBLY"
        elif keyword == "NODE":
            if here.moves:
                line.refuse("nodes of an instance that is moved are not read: give them to its part")
            _nodes(here, line, data, spelling)
        elif keyword == "ELEMENT":
            _elements(here, line, data, spelling)
        elif keyword in ("NSET", "ELSET"):
            _set(here, line, data, spelling)
    if inside == "PART":
        lines[-1].refuse("a *PART is not ended by *END PART")
    if parts and not instances:
        # CalculiX and some writers give parts without an assembly; they stand where they are
        instances = {name: Part(name, of=part) for name, part in parts.items()}
    return _put_together(path, flat, instances, spelling)


def _moves(data: list[Line]) -> list[tuple[float, ...]]:
    """A shift, (3,), and a turn: two points of its axis and an angle in degrees, (7,)."""
    moves = []
    for line, count in zip(data, (3, 7), strict=False):
        if len(line.words) > count:
            line.refuse(f"has {len(line.words)} numbers, and the move of an instance {count} in this line")
        move = tuple(line.real(k) for k in range(count))
        if count == 7 and move[:3] == move[3:6]:
            line.refuse("the two points of the axis are one")
        moves.append(move)
    return moves


def _nodes(part: Part, line: Line, data: list[Line], spelling: dict[str, str]) -> None:
    if line.parameters.get("SYSTEM", "R").upper() != "R":
        line.refuse("nodes in cylindrical or spherical coordinates are not read: give x, y, z")
    found = []
    for row in data:
        number, x = row.whole(0), (row.real(1), row.real(2), row.real(3))
        if part.nodes.setdefault(number, x) != x:
            row.refuse(f"node {number} is at two places")
        found.append(row.words[0])
    _add(part, "N", line.parameters.get("NSET", ""), ("", found, line), spelling)


def _elements(part: Part, line: Line, data: list[Line], spelling: dict[str, str]) -> None:
    kind = line.parameter("TYPE").upper()
    count = _count(kind, line)
    found, k = [], 0
    while k < len(data):
        row, words, more = data[k], list(data[k].words), data[k].more
        k += 1
        while len(words) < count + 1 and more and k < len(data):
            words += data[k].words
            more = data[k].more
            k += 1
        if len(words) != count + 1:
            row.refuse(f"an element {kind} has {count} nodes, and not {len(words) - 1}")
        number = row.whole(0)
        if number in part.elements:
            row.refuse(f"element {number} is there already, in line {part.elements[number][2].number}")
        part.elements[number] = kind, tuple(words[1:]), row
        found.append(words[0])
    _add(part, "E", line.parameters.get("ELSET", ""), ("", found, line), spelling)


def _count(kind: str, line: Line) -> int:
    """Number of nodes of an element."""
    if match := _SHELL.match(kind):
        count = 6 if match[2] == "65" else int(match[2])
        if count in _KINDS:
            return count
    if match := _TRUSS.match(kind):
        return int(match[1])
    line.refuse(f"elements {kind} are no surface: shells (S3, S4R, S8R ...) and membranes (M3D4 ...) are read")


def _set(part: Part, line: Line, data: list[Line], spelling: dict[str, str]) -> None:
    kind = line.keyword[0]
    name, instance = line.parameter(line.keyword), line.parameters.get("INSTANCE", "").upper()
    members: list[str] = []
    if "GENERATE" in line.parameters:
        for row in data:
            first, last = row.whole(0), row.whole(1)
            step = row.whole(2) if len(row.words) > 2 and row.words[2] else 1
            if step == 0 or (last - first) % step or (last - first) * step < 0:
                row.refuse(f"from {first} one does not come to {last} by steps of {step}")
            members += map(str, range(first, last + (1 if step > 0 else -1), step))
    else:
        members = [word for row in data for word in row.words if word]
    if kind == "N" and "ELSET" in line.parameters:
        part.sets.setdefault((kind, name.upper()), []).append((instance, ["E:" + line.parameter("ELSET")], line))
        spelling.setdefault(name.upper(), name)
    _add(part, kind, name, (instance, members, line), spelling)


def _add(part: Part, kind: str, name: str, members: tuple[str, list[str], Line], spelling: dict[str, str]) -> None:
    if name:
        spelling.setdefault(name.upper(), name)
        part.sets.setdefault((kind, name.upper()), []).append(members)


def _put_together(path: Path, flat: Part, instances: dict[str, Part], spelling: dict[str, str]) -> Raw:
    """All instances where they belong, as one surface."""
    whole = Whole(flat, instances)
    points = whole.points
    faces: dict[int, tuple[list[list[int]], list[int]]] = {}
    place: dict[tuple[str, int], int] = {}
    edges: dict[tuple[str, int], list[int]] = {}
    for (owner, number), (kind, words, line) in whole.element.items():
        nodes = whole.nodes(owner, words, line)
        if _TRUSS.match(kind):
            edges[owner, number] = nodes[:2]
        else:
            cells, numbers = faces.setdefault(len(nodes), ([], []))
            numbers.append(len(place))
            cells.append(nodes)
            place[owner, number] = len(place)
    made = []
    for width, (cells, numbers) in faces.items():
        table = np.array(cells)
        if width == 8:
            points, table = completed(points, table)
        made.append((_KINDS[width], of_vtk(_KINDS[width], table), np.array(numbers)))

    owners: dict[tuple[str, str], list[str]] = {}
    for owner, both in whole.parts.items():
        for part in both:
            for kind, name in part.sets:
                if owner not in owners.setdefault((kind, name), []):
                    owners[kind, name].append(owner)
    raw = Raw(path, points, made)
    for (kind, name), own in owners.items():
        for owner in own:
            first = next(e for part in whole.parts[owner] for e in part.sets.get((kind, name), []))
            members = whole.members(kind, owner, name, first[2])
            called = f"{instances[owner].name}.{spelling[name]}" if owner and len(own) > 1 else spelling[name]
            if kind == "N":
                raw.add(called, 0, np.array([whole.node[m] for m in members]))
                raw.node_sets.add(called)
            else:
                raw.add(called, 2, np.array([place[m] for m in members if m in place]))
                raw.add(called, 1, np.array([edges[m] for m in members if m in edges], dtype=int).reshape(-1, 2))
    raw.loose = np.array(list(edges.values()), dtype=int).reshape(-1, 2)
    if len(instances) > 1:
        for owner, part in instances.items():
            if part.name not in raw.groups:
                raw.add(part.name, 2, np.array([k for (own, _), k in place.items() if own == owner]))
                raw.instances.add(part.name)
    return raw
