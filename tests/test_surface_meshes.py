"""Surfaces in space from the files of other programs, and what no shell can stand on."""

import basix.ufl
import meshio
import numpy as np
import pytest
import scenes
import ufl
from mpi4py import MPI
from dolfinx import fem, mesh

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.surfaces import meshing

COMM = MPI.COMM_WORLD
ROUND = {3: (0, 1, 2), 6: (0, 1, 2), 4: (0, 1, 2, 3), 9: (0, 1, 2, 3)}
REVERSED = {3: [0, 2, 1], 6: [0, 2, 1, 5, 4, 3], 4: [0, 3, 2, 1], 9: [0, 3, 2, 1, 7, 6, 5, 4, 8]}


def tube(kind, nx=6, ny=4):
    """A quarter of a cylinder of radius 2 m and length 1 m: points and cells in meshio's order."""
    step = 1 + (kind[-1] in "69")
    n, m = step * nx + 1, step * ny + 1
    angle, y = (a.ravel() for a in np.meshgrid(np.linspace(0, np.pi / 2, n), np.linspace(0, 1, m)))
    points = np.column_stack([2 * np.cos(angle), y, 2 * np.sin(angle)])
    corner = (np.arange(0, n - 1, step) + n * np.arange(0, m - 1, step)[:, None]).ravel()[:, None]
    # quad: four corners going round, the middles of its sides, its centre
    quad = corner + step * np.array([0, 1, n + 1, n])
    middle = corner + [1, n + 2, 2 * n + 1, n] if step == 2 else quad[:, :0]
    centre = corner + n + 1 if step == 2 else quad[:, :0]
    if kind.startswith("quad"):
        return points, np.hstack([quad, middle, centre])
    lower = np.hstack([quad[:, [0, 1, 2]], middle[:, [0, 1]], centre] if step == 2 else [quad[:, [0, 1, 2]]])
    upper = np.hstack([quad[:, [0, 2, 3]], centre, middle[:, [2, 3]]] if step == 2 else [quad[:, [0, 2, 3]]])
    return points, np.stack([lower, upper], axis=1).reshape(-1, lower.shape[1])


def folder(tmp_path):
    """The same folder on all ranks."""
    return COMM.bcast(tmp_path, root=0)


def write(path, content):
    """A file that all ranks see: a meshio.Mesh or text."""
    if COMM.rank == 0 and isinstance(content, str):
        path.write_text(content)
    elif COMM.rank == 0:
        content.write(path)
    COMM.barrier()
    return path


def obj(points, cells):
    """The text of an .obj file."""
    rows = [("v", x) for x in points] + [("f", np.add(cell, 1)) for cell in cells]
    return "\n".join(f"{key} {' '.join(str(c) for c in row)}" for key, row in rows) + "\n"


def area(domain):
    """Area in m2 over all ranks."""
    form = fem.form(fem.Constant(domain.mesh, 1.0) * ufl.dx(domain=domain.mesh, degree=4))
    return COMM.allreduce(fem.assemble_scalar(form))


def count(domain, name=None):
    """Number of cells, or of entities of a group, over all ranks."""
    if name is None:
        return domain.mesh.topology.index_map(2).size_global
    dim, entities = domain.entities(name)
    return COMM.allreduce(int((entities < domain.mesh.topology.index_map(dim).size_local).sum()))


def normals(domain):
    """Normal times area at the corners of the cells of this rank."""
    x = domain.mesh.geometry.x[domain.mesh.geometry.dofmaps[0]]
    return np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])


FORMATS = {
    "triangle": [".obj", ".stl", ".ply", ".vtk", ".vtu", ".inp"],
    "quad": [".obj", ".ply", ".vtk", ".vtu", ".inp"],
    "triangle6": [".vtk", ".vtu", ".inp"],
    "quad9": [".vtk", ".vtu", ".inp"],
}


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("kind, suffix", [(k, s) for k, some in FORMATS.items() for s in some])
def test_a_surface_comes_back_from_each_format(tmp_path, kind, suffix):
    points, cells = tube(kind)
    # points that no cell uses; .stl cannot have them
    spare = np.array([[9.0, 9.0, 9.0]])
    file = meshio.Mesh(np.concatenate([spare, points, spare]), [(kind, cells + 1)])
    domain = meshing.read(write(folder(tmp_path) / f"tube{suffix}", file), COMM)
    m = domain.mesh
    assert m.geometry.cmaps[0].degree == 1 + (kind[-1] in "69")
    assert count(domain) == count(domain, "sheet") == len(cells)
    assert m.geometry.index_map().size_global == len(points)
    assert count(domain, "boundary") == 2 * (6 + 4)
    # a chord of 15 degrees for its arc; and with quadratic cells the arc to fourth order
    flat = 6 * 2 * 2 * np.sin(np.pi / 24)
    expected, tolerance = (np.pi, 3e-5) if kind[-1] in "69" else (flat, 1e-6 if suffix == ".stl" else 1e-12)
    assert abs(area(domain) - expected) < tolerance
    assert set(domain.names) == {"sheet", "boundary"}
    # the cells are numbered as in the file
    corners = points[cells[m.topology.original_cell_index][:, ROUND[cells.shape[1]]]]
    vertices = m.geometry.dofmaps[0][:, [0, 1, 2] if kind.startswith("tri") else [0, 1, 3, 2]]
    assert np.abs(m.geometry.x[vertices] - corners).max(initial=0) < 1e-6
    meshing.check_surface(domain)


@pytest.mark.parallel
def test_groups_of_an_inp_file(tmp_path):
    # the two blocks of elements, and the sets of triangles named afterwards, which overlap
    text = """*HEADING
*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 2., 0., 1.
*ELEMENT, TYPE=S3
10, 1, 2, 3
11, 1, 3, 4
*ELEMENT, TYPE=S3, ELSET=sleeve
12, 2, 5, 3
*ELSET, ELSET=body
10,
*ELSET, ELSET=all, GENERATE
10, 12, 1
"""
    domain = meshing.read(write(folder(tmp_path) / "groups.INP".lower(), text), COMM)
    assert {name: count(domain, name) for name in domain.names} == {"body": 1, "sleeve": 1, "all": 3, "boundary": 5}
    for name, numbers in (("body", {0}), ("all", {0, 1, 2}), ("sleeve", {2})):
        assert set(domain.mesh.topology.original_cell_index[domain.entities(name)[1]]) <= numbers


@pytest.mark.parallel
def test_groups_of_an_obj_file_with_texture_and_relative_numbers(tmp_path):
    text = """# a comment
v 0 0 0
v 1 0 0 # with a colour, or a comment
v 1 1 0 0.5 0.5 0.5
v 0 1 0
vt 0 0
vn 0 0 1
g body
f 1/1/1 2/1/1 3//1
f 1 3 4
v 2 0 1
g sleeve left
f 2 -1 3
"""
    domain = meshing.read(write(folder(tmp_path) / "groups.obj", text), COMM)
    assert {name: count(domain, name) for name in domain.names} == {"body": 2, "sleeve left": 1, "boundary": 5}
    assert abs(area(domain) - (1 + np.sqrt(2) / 2)) < 1e-12


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kind", ["triangle", "triangle6"])
def test_gmsh_s_groups_of_cells_and_edges_through_meshio(tmp_path, kind):
    points, cells = tube(kind)
    # the edges along y = 0
    n = 6 * (2 if kind[-1] == "6" else 1) + 1
    ends = [np.arange(n - 1), np.arange(1, n)] if n == 7 else [np.arange(0, n - 2, 2), np.arange(2, n, 2)]
    lines = np.column_stack([*ends, ends[0] + 1] if n == 13 else ends)
    part = np.where(np.arange(len(cells)) < 10, 3, 7)
    file = meshio.Mesh(
        points,
        [("line" if n == 7 else "line3", lines), (kind, cells)],
        cell_data={"gmsh:physical": [np.full(6, 5), part]},
    )
    domain = meshing.read(write(folder(tmp_path) / "parts.vtu", file), COMM)
    sizes = {name: count(domain, name) for name in domain.names}
    assert sizes == {"3": 10, "7": len(cells) - 10, "5": 6, "boundary": 14}
    edges = domain.entities("5")[1]
    assert np.abs(mesh.compute_midpoints(domain.mesh, 1, edges)[:, 1]).max(initial=0) < 1e-12


@pytest.mark.parallel
def test_corners_of_an_stl_file_that_differ_by_rounding_are_one(tmp_path):
    points, cells = tube("triangle")
    facets = []
    for k, triangle in enumerate(points[cells]):
        rows = [f"vertex {' '.join(str(c * (1 + (-1) ** k * 2e-8)) for c in x)}" for x in triangle]
        facets += ["facet normal 0 0 0", "outer loop", *rows, "endloop", "endfacet"]
    domain = meshing.read(write(folder(tmp_path) / "t.stl", "\n".join(["solid t", *facets, "endsolid t\n"])), COMM)
    assert domain.mesh.geometry.index_map().size_global == len(points)
    assert count(domain, "boundary") == 20


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kind", FORMATS)
def test_orientation_is_mended_to_that_of_most_cells(tmp_path, kind):
    points, cells = tube(kind)
    turned = np.isin(np.arange(len(cells)), [0, 3, 7, 8])
    cells[turned] = cells[turned][:, REVERSED[cells.shape[1]]]
    path = write(folder(tmp_path) / "turned.vtu", meshio.Mesh(points, [(kind, cells)]))
    with pytest.raises(InputError, match=r"^Cells 0 and \d+ on the edge at .*: read the mesh with orient=True"):
        meshing.read(path, COMM)
    domain = meshing.read(path, COMM, orient=True)
    middles = mesh.compute_midpoints(domain.mesh, 2, np.arange(len(normals(domain)), dtype=np.int32)) * [1, 0, 1]
    assert ((normals(domain) * middles).sum(axis=1) < 0).all()
    assert abs(area(domain) - np.pi) < (3e-5 if kind[-1] in "69" else 0.02)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("order", [1, 2])
def test_orientation_of_gmsh_s_patches_is_mended(tmp_path, order):
    text = """
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0, 1, 0};
Point(5) = {3, 0, 1}; Point(6) = {3, 1, 1};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Line(5) = {2, 5}; Line(6) = {5, 6}; Line(7) = {6, 3};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Curve Loop(2) = {-5, 2, -7, -6}; Plane Surface(2) = {2};
Mesh.MeshSizeMax = 0.4; Mesh.ElementOrder = ORDER;
Physical Surface("small") = {1}; Physical Surface("large") = {2};
"""
    path = write(folder(tmp_path) / "patches.geo", text.replace("ORDER", str(order)))
    with pytest.raises(InputError, match="face opposite sides: read the mesh with orient=True"):
        meshing.read(path, COMM)
    domain = meshing.read(path, COMM, orient=True)
    assert (normals(domain)[:, 2] < 0).all()
    assert abs(area(domain) - 1 - np.sqrt(5)) < 1e-12


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("triangles, name", [(1, "triangle"), (0, "quadrilateral")])
def test_quadratic_cells_of_gmsh_stay_quadratic(triangles, name):
    domain = meshing.read(scenes.MESHES / "cylinder.geo", COMM, triangles=triangles, order=2)
    cmap = domain.mesh.geometry.cmaps[0]
    assert (domain.mesh.basix_cell().name, cmap.degree) == (name, 2)
    radius = np.linalg.norm(domain.mesh.geometry.x[:, [0, 2]], axis=1)
    assert np.abs(radius - 1).max() < 1e-12
    assert count(domain, "end") == count(domain, "side") == 8
    meshing.check_surface(domain)


# -- refused -------------------------------------------------------------------------------------------------

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
BACK = np.array([[0, 0, 1], [1, 0, 1], [0.5, 0, 0.0]])
TWO = [[0, 1, 2], [0, 2, 3]]


def moebius(n=12):
    """A strip of quadrilaterals with half a turn in it."""
    angle = 2 * np.pi * np.arange(n) / n
    side = np.array([-0.3, 0.3])[:, None, None] * np.array(
        [np.cos(angle / 2) * np.cos(angle), np.cos(angle / 2) * np.sin(angle), np.sin(angle / 2)]
    )
    points = (side + np.array([np.cos(angle), np.sin(angle), 0 * angle])).transpose(2, 0, 1).reshape(-1, 3)
    cells = [[2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2] for k in range(n - 1)] + [[2 * n - 2, 2 * n - 1, 0, 1]]
    return points, cells


FAULTS = {
    "branch": (
        (np.concatenate([SQUARE, BACK]), [*TWO, [0, 2, 4]]),
        r"Cells 0, 1, 2 share the edge at \(0.5, 0.5, 0\).*take one part away",
    ),
    "turned": (
        (SQUARE, [[0, 1, 2], [0, 3, 2]]),
        r"Cells 0 and 1 on the edge at \(0.5, 0.5, 0\) face opposite sides: read the mesh with orient=True",
    ),
    "one sided": (moebius(), r"Cells 0 and 11 on the edge at .* face opposite sides"),
    "twice a vertex": ((SQUARE, [*TWO, [0, 0, 3]]), r"Cell 2 at \(0, 0.3333, 0\) uses a vertex twice: remove the cell"),
    "no area": (
        (np.concatenate([SQUARE, BACK]), [*TWO, [0, 6, 1]]),
        r"Cell 2 at \(0.5, 0, 0\) is degenerate, inf times longer than wide: remove the cell",
    ),
    "needle": (
        (np.concatenate([SQUARE, [[0.4, -9e-7, 0]]]), [*TWO, [0, 4, 1]]),
        r"Cell 2 at .* is degenerate, 1.11e\+06 times longer than wide: remove the cell",
    ),
    "no size": ((SQUARE[[0, 0, 0]], [[0, 1, 2]]), r"Cell 0 at \(0, 0, 0\) is degenerate"),
    "quadrilateral with a corner inwards": (
        (np.array([[0, 0, 0], [1, 0, 0], [0.2, 0.2, 0], [0, 1, 0]]), [[0, 1, 2, 3]]),
        r"Cell 0 at \(0.3, 0.3, 0\) is degenerate",
    ),
    "the same again": ((SQUARE, [*TWO, [2, 0, 1]]), r"Cell 2 at .* is the same as cell 0: remove one of them"),
}


def refused(match, read):
    """The one sentence that `read()` is refused with on every rank."""
    with pytest.raises(InputError, match=match) as caught:
        read()
    said = str(caught.value)
    assert said.endswith(".") and "\n" not in said
    assert len(set(COMM.allgather(said))) == 1
    return said


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_surface_for_no_shell_is_refused_naming_cell_and_place(tmp_path, fault):
    (points, cells), match = FAULTS[fault]
    path = write(folder(tmp_path) / "fault.obj", obj(points, cells))
    refused(match, lambda: meshing.read(path, COMM))
    if fault == "turned":  # no matter in the plane
        assert count(meshing.read(path, COMM, gdim=2)) == 2
    else:  # DOLFINx would end the process
        refused("Cell|one side", lambda: meshing.read(path, COMM, gdim=2))


@pytest.mark.parallel
def test_a_surface_with_one_side_cannot_be_mended(tmp_path):
    path = write(folder(tmp_path) / "moebius.obj", obj(*moebius()))
    refused(r"cell 0 at .* has one side only.*: cut it", lambda: meshing.read(path, COMM, orient=True))


@pytest.mark.parallel
def test_the_check_of_a_mesh_that_is_there_names_the_cells_of_its_file(tmp_path):
    points, cells = tube("triangle")
    cells[5] = cells[5][[0, 2, 1]]
    path = write(folder(tmp_path) / "turned.obj", obj(points, cells))
    refused("Cells 2 and 5 on the edge at .* face opposite", lambda: meshing.read(path, COMM))
    domain = meshing.read(path, COMM, orient=True)
    meshing.check_surface(domain.mesh)
    # a node moved on to another's place makes its cell one without area
    x, ids = domain.mesh.geometry.x, domain.mesh.geometry.input_global_indices
    moved = cells[5][0]
    x[ids == moved] = points[cells[5][1]]
    refused(r"Cell \d+ at .* is degenerate, \S+ times longer", lambda: meshing.check_surface(domain))


def test_the_check_of_a_mesh_that_is_there_finds_a_branch():
    points, cells = FAULTS["branch"][0]
    element = basix.ufl.element("P", "triangle", 1, shape=(3,))
    made = mesh.create_mesh(MPI.COMM_SELF, np.array(cells), element, points, max_facet_to_cell_links=3)
    with pytest.raises(InputError, match="Cells 0, 1, 2 share the edge"):
        meshing.check_surface(made)


@pytest.mark.parallel
def test_a_branch_and_a_closed_surface_from_gmsh(tmp_path):
    text = """SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 1, 1}; Rectangle(2) = {0, 0, 0, 1, 1};
Rotate{{0, 1, 0}, {0.5, 0, 0}, Pi / 2}{ Surface{2}; }
BooleanFragments{ Surface{1}; Delete; }{ Surface{2}; Delete; }
Mesh.MeshSizeMax = 0.5; Physical Surface("sheet") = Surface{:};
"""
    path = write(folder(tmp_path) / "cross.geo", text)
    refused(r"Cells \d+, \d+, \d+, \d+ share the edge at \(0.5", lambda: meshing.read(path, COMM))
    ball = """SetFactory("OpenCASCADE"); Sphere(1) = {0, 0, 0, 1};
Mesh.MeshSizeMax = 0.7; Physical Surface("sheet") = Surface{:};
"""
    domain = meshing.read(write(folder(tmp_path) / "ball.geo", ball), COMM)
    assert 10 < area(domain) < 4 * np.pi


FILES = {
    "absent.obj": (None, "There is no mesh file"),
    "words.vtu": ("these are words\n", "not a mesh that can be read"),
    "words.stl": ("these are words\n", "not a mesh that can be read|no surface mesh"),
    "words.obj": ("these are words\n", "not a mesh that can be read: 'these' is no word of .*line 1"),
    "words.vtk": ("these are words\n", "not a mesh that can be read"),
    "words.ply": ("these are words\n", "not a mesh that can be read"),
    "words.inp": ("these are words\n", "words.inp., line 1: .* before the first keyword"),
    "empty.obj": ("", "no surface mesh"),
    "polygon.obj": (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 2 0\nf 1 2 3 4 5\n",
        "has polygons of 5 nodes, .*triangulate = true",
    ),
    "mixed.obj": (
        obj(SQUARE, [[0, 1, 2], [0, 1, 2, 3]]),
        "quadrilaterals of 4 nodes and triangles of 3 nodes, .*triangulate = true",
    ),
    "missing.obj": ("v 0 0 0\nv 1 0 0\nf 1 2 3\n", "a point that is not in the file"),
    "zero.obj": ("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 0 1 2\n", "a point that is not in the file"),
    "nan.obj": ("v 0 0 0\nv 1 0 nan\nv 1 1 0\nf 1 2 3\n", "not finite numbers"),
    "letters.obj": ("v 0 0 0\nv 1 0 b\nv 1 1 0\nf 1 2 3\n", "not a mesh that can be read: could not convert"),
    "tables.vtk": (
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 1 1 0\n",
        "no surface mesh",
    ),
    "solid.vtu": (meshio.Mesh(np.eye(4, 3), [("tetra", [[0, 1, 2, 3]])]), "a mesh of volumes: save its surface"),
    "tetra.vtk": (meshio.Mesh(np.eye(4, 3), [("tetra", [[0, 1, 2, 3]])]), "a mesh of volumes: save its surface"),
}


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("name", FILES)
def test_a_file_that_holds_no_surface_is_refused(tmp_path, name, capfd):
    content, match = FILES[name]
    path = folder(tmp_path) / name
    if content is not None:
        write(path, content)
    said = refused(match, lambda: meshing.read(path, COMM))
    assert name in said
    # meshio's own way to say it is not heard
    assert capfd.readouterr() == ("", "")


@pytest.mark.parallel
def test_numbers_are_for_geo_files_only(tmp_path):
    path = write(folder(tmp_path) / "two.obj", obj(SQUARE, TWO))
    refused("does not let nx be set to 5", lambda: meshing.read(path, COMM, nx=5))
