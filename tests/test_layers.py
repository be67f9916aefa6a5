"""The rooms of the package import only rooms above them, stay small, and are light to enter."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import fabric_fenicsx

PACKAGE = Path(fabric_fenicsx.__file__).parent
# From the top down: floors, and the rooms of each folder in the order in which they may import. What stands in one set
# may not import each other; a folder's rooms see all floors above it. `errors` is for everybody.
FLOORS = [
    {"errors", "system", "files"},
    {"plots", "compiling"},
    {"entries"},
    {"fabrics"},
    {"laws"},
    {
        "surfaces": [
            {"checking"},
            {"placing"},
            {"grouping"},
            {"preparing"},
            {"abaqus_lines", "geo_programs", "polygon_files"},
            {"abaqus_parts"},
            {"abaqus", "gmsh_models"},
            {"importing", "outlines"},
            {"meshing"},
            {"yarns"},
        ]
    },
    {"shell": [{"rotation", "dirichlet", "bodies"}, {"kinematics"}, {"directors"}, {"assumed_strain"}]},
    {
        "terms": [
            {"supports", "term", "points", "weakform", "kernels"},
            {"hook", "extra", "pairing", "stitches"},
            {"work", "form"},
        ]
    },
    {
        "solvers": [
            {"held", "redundant"},
            {"pivots", "substructures"},
            {"zero_energy"},
            {"linear", "continuation", "checkpoint", "reactions", "tangent", "turned", "failures"},
            {"marching", "motion", "leading"},
            {"unknowns", "drag", "inertia"},
            {"statics", "foreseen"},
            {"descent", "search"},
            {"step", "stable_step", "stepper", "drifting"},
            {"newmark", "parts"},
            {"explicit"},
            {"energy"},
        ]
    },
    {
        "output": [
            {"results", "gathering", "showing"},
            {"solids"},
            {"fields", "pictures"},
            {"series"},
            {"recording", "moving"},
        ]
    },
    {"material"},
    {"sheet"},
    {
        "contact": [
            {"triangles", "skin", "kernels", "scattering"},
            {"bodies"},
            {"coefficients", "free_body", "shapes", "points"},
            {"gaps", "facing", "deforming", "free_bodies"},
            {"collisions"},
            {"surroundings", "pressure"},
            {"pairs"},
            {"barrier", "friction"},
            {"contact"},
        ]
    },
    {
        "garments": [
            {"limb", "outlines", "implicit", "human"},
            {"panels", "torso"},
            {"sewing", "limbs", "dxf", "measures"},
            {"dressing", "garmentcode", "hips"},
            {"patterns"},
        ]
    },
    {"specimen"},
    {"identify", "scenes"},
    {
        "photographs": [
            {"reading", "corrections"},
            {"marks"},
            {"tracking", "plane", "marker_file"},
            {"contact_sheet", "speckle"},
            {"making"},
        ]
    },
    {"app": [{"command", "doctor", "options"}, {"photographs"}, {"cli"}]},
]
LEVEL = {
    (f"{floor}.{room}" if inside else floor): (level, depth)
    for level, floors in enumerate(FLOORS)
    for floor in floors
    for inside in [floors[floor] if isinstance(floors, dict) else []]
    for depth, rooms in enumerate(inside or [{floor}])
    for room in rooms
}
FENICS = {"dolfinx", "ufl", "basix", "ffcx", "dolfinx_external_operator", "petsc4py", "mpi4py", "gmsh", "meshio"}
# directors hand the solver a matrix
PETSC = {"shell.directors"}
FILES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.parent != PACKAGE or path.name != "__init__.py"]
FOLDERS = {room.split(".")[0] for room in LEVEL if "." in room}
every_file = pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))


def room_of(path):
    """Name of the room that a file belongs to: `fabrics`, `solvers.statics`, or `solvers` for what its folder says."""
    return placed(list(path.relative_to(PACKAGE).with_suffix("").parts))


def placed(parts):
    """The room that a dotted name belongs to."""
    folder = parts[0] in FOLDERS and len(parts) > 1 and parts[1] != "__init__"
    return ".".join(parts[: 2 if folder else 1])


def imports(path):
    """Full names of all modules that a file imports, wherever in it: `fabric_fenicsx.laws.woven`, `dolfinx.fem`."""
    package = ("fabric_fenicsx", *path.relative_to(PACKAGE).parent.parts)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{base}.{alias.name}" for alias in node.names)


@every_file
def test_a_room_imports_only_rooms_above_it(path):
    here = room_of(path)
    if here in FOLDERS:  # of a folder itself: what it hands on from its own rooms
        assert all(name.startswith(f"fabric_fenicsx.{here}") for name in imports(path))
        return
    assert here in LEVEL, f"{here} has no place in the order of rooms"
    inside = [name.split(".")[1:] for name in imports(path) if name.split(".")[0] == "fabric_fenicsx"]
    rooms = {placed(parts) for parts in inside if parts} - {here}
    below = {room for room in rooms if LEVEL.get(room, (len(FLOORS), 0)) >= LEVEL[here]}
    assert not below, f"{here} imports {below}"


@every_file
def test_only_those_who_need_them_know_of_fenics_petsc_and_gmsh(path):
    here, outside = room_of(path), set(imports(path))
    light = ("errors", "system", "app.doctor", "plots", "entries", "fabrics", "laws", "identify")
    simulates = path.name in ("inverse.py", "simulated.py")
    if (here in light or here.startswith("photographs.")) and not simulates:
        assert not {name.split(".")[0] for name in outside} & FENICS
    if here not in PETSC and not here.startswith("solvers."):
        assert not any(name.startswith(("petsc4py", "dolfinx.fem.petsc")) for name in outside)
    if here not in ("surfaces.meshing", "surfaces.gmsh_models", "surfaces.outlines", "surfaces.importing"):
        assert not any(name.split(".")[0] in ("gmsh", "meshio") for name in outside)


@every_file
def test_only_simulated_strips_of_identify_need_a_scene(path):
    scenes = "inverse", "simulated"
    if room_of(path) == "identify" and path.stem not in scenes:
        rooms = {name.split(".")[1] for name in imports(path) if name.startswith("fabric_fenicsx.")}
        assert rooms <= {"errors", "files", "plots", "fabrics", "laws", "identify"}
        if path.name != "making.py":  # where it is asked for
            assert not any(
                name.startswith(f"fabric_fenicsx.identify.tensile.{room}") for name in imports(path) for room in scenes
            )


@every_file
def test_options_are_given_by_their_names(path):
    """But for two at most, and vectors that tell a place or a motion; names that begin with _ are nobody's business."""
    places = {"shift", "turn", "centre", "axis", "point", "normal"}
    for cls in [None, *(node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ClassDef))]:
        body = ast.parse(path.read_text()).body if cls is None else cls.body
        for node in body:
            if isinstance(node, ast.FunctionDef) and (node.name[0] != "_" or node.name == "__init__"):
                optional = [
                    argument.arg for argument in node.args.args[len(node.args.args) - len(node.args.defaults) :]
                ]
                by_place = [name for name in optional if name not in places]
                assert len(by_place) <= 2, f"line {node.lineno}: {node.name} takes {', '.join(by_place)} by place"


@every_file
def test_a_room_has_one_subject(path):
    # kernels: Numba's cache looks at one file only
    assert len(path.read_text().splitlines()) <= (350 if path.name == "kernels.py" else 300)


def test_the_reader_of_imports_sees_them_all(tmp_path):
    text = "import a.b\nfrom ..errors import E\nfrom . import Array\ndef f():\n    from dolfinx.fem import petsc\n"
    monk = PACKAGE / "laws" / "nobody.py"
    path = type("P", (), {"read_text": lambda self: text, "relative_to": lambda self, other: monk.relative_to(other)})()
    found = {"a.b", "fabric_fenicsx.errors.E", "fabric_fenicsx.laws.Array", "dolfinx.fem.petsc"}
    assert set(imports(path)) == found


def loaded(module):
    """Top-level modules in a fresh interpreter that has imported `module`."""
    code = f"import sys, {module}; print(*{{name.split('.')[0] for name in sys.modules}})"
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())


def test_the_package_is_light_to_import():
    heavy = {"gmsh", "pyvista", "vtkmodules", "matplotlib", "dolfinx_external_operator"}
    assert not loaded("fabric_fenicsx") & heavy


def test_drawing_is_loaded_by_those_who_draw():
    rooms = ("output.results", "laws.driver", "fabrics", "solvers.statics", "identify.report.page")
    modules = ", ".join(f"fabric_fenicsx.{room}" for room in rooms)
    assert not loaded(modules) & {"gmsh", "pyvista", "vtkmodules", "matplotlib"}
