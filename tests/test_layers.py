"""The rooms of the package import only rooms above them, stay small, and are light to enter."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import fabric_fenicsx

PACKAGE = Path(fabric_fenicsx.__file__).parent
# from the top down; what stands in one line may not import each other. `errors` is for everybody.
ROOMS = [
    {"errors", "system", "plots"},
    {"doctor"},
    {"entries"},
    {"fabrics"},
    {"laws"},
    {"surface"},
    {"importing"},
    {"meshing"},
    {"frame"},
    {"kinematics"},
    {"rotation"},
    {"directors"},
    {"assumed_strain"},
    {"supports"},
    {"hook"},
    {"weakform"},
    {"batches"},
    {"stiffness"},
    {"linear"},
    {"continuation"},
    {"statics"},
    {"motion"},
    {"moving_solver"},
    {"stable_step", "stepper"},
    {"dynamics", "explicit"},
    {"energy"},
    {"checkpoint"},
    {"sheet"},
    {"specimen"},
    {"pictures"},
    {"frames"},
    {"results"},
    {"identify", "scenes"},
    {"command"},
    {"cli"},
]
LEVEL = {room: level for level, rooms in enumerate(ROOMS) for room in rooms}
FENICS = {"dolfinx", "ufl", "basix", "ffcx", "dolfinx_external_operator", "petsc4py", "mpi4py", "gmsh", "meshio"}
# directors and stiffness hand the solver a matrix
PETSC = {
    "directors",
    "stiffness",
    "linear",
    "statics",
    "motion",
    "moving_solver",
    "stepper",
    "dynamics",
    "explicit",
    "energy",
}
FILES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.parent != PACKAGE or path.name != "__init__.py"]
every_file = pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))


def room_of(path):
    """Name of the room that a file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


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
    assert here in LEVEL, f"{here} has no place in the order of rooms"
    inside = [name.split(".") for name in imports(path) if name.split(".")[0] == "fabric_fenicsx"]
    rooms = {parts[1] for parts in inside if len(parts) > 1} - {here}
    below = {room for room in rooms if LEVEL.get(room, len(ROOMS)) >= LEVEL[here]}
    assert not below, f"{here} imports {below}"


@every_file
def test_only_those_who_need_them_know_of_fenics_petsc_and_gmsh(path):
    here, outside = room_of(path), set(imports(path))
    if here in ("errors", "system", "doctor", "entries", "fabrics", "laws", "identify") and path.name != "inverse.py":
        assert not {name.split(".")[0] for name in outside} & FENICS
    if here not in PETSC:
        assert not any(name.startswith(("petsc4py", "dolfinx.fem.petsc")) for name in outside)
    if here not in ("meshing", "importing"):
        assert not any(name.split(".")[0] in ("gmsh", "meshio") for name in outside)


@every_file
def test_only_the_inverse_simulation_of_identify_needs_a_scene(path):
    if room_of(path) == "identify" and path.name != "inverse.py":
        rooms = {name.split(".")[1] for name in imports(path) if name.startswith("fabric_fenicsx.")}
        assert rooms <= {"errors", "fabrics", "laws", "identify"}
        if path.name != "making.py":  # where it is asked for
            assert not any(name.startswith("fabric_fenicsx.identify.inverse") for name in imports(path))


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
    modules = "fabric_fenicsx.results, fabric_fenicsx.laws.driver, fabric_fenicsx.fabrics, fabric_fenicsx.statics"
    modules += ", fabric_fenicsx.identify.report"
    assert not loaded(modules) & {"gmsh", "pyvista", "vtkmodules", "matplotlib"}
