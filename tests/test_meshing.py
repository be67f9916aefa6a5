"""From gmsh's files and models to meshes with names, and what is said where that cannot be."""

import gmsh
import numpy as np
import pytest
import scenes
from mpi4py import MPI
from dolfinx import mesh

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.surfaces import meshing

COMM = MPI.COMM_WORLD
STRIP, SQUARE = scenes.MESHES / "strip.geo", scenes.MESHES / "square.geo"
TWO_SQUARES = """
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0, 1, 0};
Point(5) = {2, 0, 0}; Point(6) = {2, 1, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Line(5) = {2, 5}; Line(6) = {5, 6}; Line(7) = {6, 3};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Curve Loop(2) = {5, 6, 7, -2}; Plane Surface(2) = {2};
Transfinite Surface{1}; Transfinite Surface{2}; Mesh.MeshSizeMax = 0.5;
"""


def folder(tmp_path):
    """The same folder on all ranks."""
    return COMM.bcast(tmp_path, root=0)


def write(path, content):
    """A file that all ranks see."""
    if COMM.rank == 0:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    COMM.barrier()
    return path


def facts(domain):
    """Number of cells, extent, number of entities of each group, kind of cell."""
    m, sizes = domain.mesh, {}
    for name in domain.names:
        dim, entities = domain.entities(name)
        m.topology.create_entities(dim)
        owned = m.topology.index_map(dim).size_local
        sizes[name] = (dim, m.comm.allreduce(int((entities < owned).sum())))
    x = m.geometry.x
    extent = [m.comm.allreduce(value, op) for value, op in zip((x.min(0), x.max(0)), (minimum, maximum), strict=True)]
    cells = m.topology.index_map(m.topology.dim).size_global
    return cells, np.round(extent, 12).tolist(), sizes, m.basix_cell().name


def minimum(a, b):
    return np.minimum(a, b)


def maximum(a, b):
    return np.maximum(a, b)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("gdim", [2, 3])
def test_a_geo_file_with_numbers_of_its_own_and_from_outside(gdim):
    domain = meshing.read(STRIP, COMM, gdim=gdim)
    assert domain.mesh.geometry.dim == gdim
    cells, extent, sizes, kind = facts(domain)
    assert (cells, extent[1], kind) == (27, [0.0762, 0.0254, 0], "quadrilateral")
    assert sizes == {"sheet": (2, 27), "fixed_end": (1, 3), "pulled_end": (1, 3), "pin": (0, 1)}
    cells, extent, sizes, kind = facts(meshing.read(STRIP, COMM, gdim, nx=5, ny=2, length=0.5, triangles=1))
    assert (cells, extent[1], kind) == (20, [0.5, 0.0254, 0], "triangle")
    assert sizes["fixed_end"] == (1, 2)
    # and nothing of it is remembered
    assert facts(meshing.read(STRIP, COMM, gdim))[:2] == (27, [[0, 0, 0], [0.0762, 0.0254, 0]])


@pytest.mark.parallel
def test_the_groups_are_where_their_names_say():
    domain = meshing.read(SQUARE, COMM, gdim=2, side=2.0, n=4)
    assert set(domain.names) == {"sheet", "bottom", "right", "top", "left"}
    for name, axis, value in (("left", 0, 0), ("right", 0, 2), ("bottom", 1, 0), ("top", 1, 2)):
        dim, edges = domain.entities(name)
        assert dim == 1
        middle = mesh.compute_midpoints(domain.mesh, 1, edges)
        assert np.allclose(middle[:, axis], value)


@pytest.mark.parallel
def test_an_unknown_group_is_answered_with_the_known_ones():
    domain = meshing.read(STRIP, COMM, gdim=2)
    with pytest.raises(InputError, match=r"no physical group 'end'.*: fixed_end, pin, pulled_end, sheet"):
        domain.entities("end")


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("binary", [0, 1])
def test_a_msh_file_gives_the_mesh_back(tmp_path, binary):
    path = folder(tmp_path) / "strip.msh"

    def save():
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.open(str(STRIP))
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))

    made = facts(meshing.from_gmsh(save, COMM, 2))
    assert facts(meshing.read(path, COMM, 2)) == made
    assert made[0] == 27
    with pytest.raises(InputError, match=r"does not let nx be set to 5.*numbers are: none"):
        meshing.read(path, COMM, 2, nx=5)


@pytest.mark.parallel
def test_a_msh_file_with_gaps_in_the_numbers_of_its_nodes(tmp_path):
    text = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
2 1 "sheet"
$EndPhysicalNames
$Nodes
4
10 0 0 0
20 1 0 0
40 1 1 0
70 0 1 0
$EndNodes
$Elements
2
5 2 2 1 1 10 20 40
9 2 2 1 1 10 40 70
$EndElements
"""
    domain = meshing.read(write(folder(tmp_path) / "gaps.msh", text), COMM, 2)
    assert facts(domain) == (2, [[0, 0, 0], [1, 1, 0]], {"sheet": (2, 2)}, "triangle")


@pytest.mark.parallel
def test_a_model_of_the_gmsh_api():
    def disk():
        assert COMM.rank == 0
        gmsh.model.occ.addDisk(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="sheet")
        gmsh.model.addPhysicalGroup(1, [1], name="rim")
        gmsh.model.mesh.setSize(gmsh.model.getEntities(0), 0.3)
        gmsh.model.mesh.generate(2)

    domain = meshing.from_gmsh(disk, COMM, 3)
    edges = domain.entities("rim")[1]
    radius = np.linalg.norm(mesh.compute_midpoints(domain.mesh, 1, edges), axis=1)
    assert COMM.allreduce(len(edges)) > 10
    assert ((radius > 0.95) & (radius < 1)).all()


square = SQUARE.read_text()
REFUSED = {
    "absent.msh": (None, "There is no mesh file"),
    "words.msh": ("these are words\n", "neither a .geo nor a .msh file"),
    "bytes.msh": (bytes(range(256)) * 9, "neither a .geo nor a .msh file"),
    "bytes.geo": (bytes(range(256)) * 9, "neither a .geo nor a .msh file"),
    "picture.png": (b"\x89PNG\r\n\x1a\n\0\0\0", "neither a .geo nor a .msh file"),
    "cut.msh": ("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 9 1", "holds no surface mesh|cannot|not a mesh"),
    "wrong.geo": ("Point(1) = {0, 0;\n", "not a mesh that gmsh can read.*line 1.*syntax error"),
    "words.geo": ("these are words\n", "not a mesh that gmsh can read"),
    "empty.geo": ("", "holds no surface mesh"),
    "curve.geo": ("Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Line(1) = {1, 2};\n", "holds no surface mesh"),
    "nothing_named.geo": (square.split("Physical")[0], "no physical group of surfaces"),
    "curves_named.geo": (square.replace('Physical Surface("sheet") = {1};', ""), "no physical group of surfaces"),
    "solid.geo": (
        'SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 1}; Mesh 3; Physical Volume("solid") = {1};\n',
        "and no volumes",
    ),
    "half_named.geo": (
        TWO_SQUARES + 'Physical Surface("sheet") = {1};\n',
        "must be in a physical surface, and 50 of 100 are in none",
    ),
    "mixed.geo": (
        TWO_SQUARES + 'Recombine Surface{1}; Physical Surface("sheet") = {1, 2};\n',
        "of 4 nodes and triangles of 3 nodes.*triangulate = true",
    ),
}


@pytest.mark.parallel(first=3)
@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_mesh_of_surfaces_is_refused_in_one_sentence_on_every_rank(tmp_path, name):
    content, reason = REFUSED[name]
    path = folder(tmp_path) / name
    if content is not None:
        write(path, content)
    with pytest.raises(InputError, match=reason) as caught:
        meshing.read(path, COMM, 2)
    said = str(caught.value)
    assert said.endswith(".") and "\n" not in said
    assert len(set(COMM.allgather(said))) == 1
    # gmsh is as good as new
    assert facts(meshing.read(STRIP, COMM, 2))[0] == 27


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("numbers", [{"nn": 3}, {"nx": 5, "lenght": 1.0}])
def test_a_number_that_the_file_does_not_take_is_refused(numbers):
    with pytest.raises(InputError, match=r"does not let .* its numbers are: length, nx, ny, triangles, width"):
        meshing.read(STRIP, COMM, 2, **numbers)


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_a_number_that_is_none_is_refused(number):
    with pytest.raises(InputError, match=f"cannot be meshed with length = {number}: give a finite number"):
        meshing.read(STRIP, COMM, 2, length=number)


@pytest.mark.parallel
def test_a_number_that_the_file_overwrites_is_refused(tmp_path):
    path = write(folder(tmp_path) / "fixed.geo", "nx = 2;\n" + STRIP.read_text())
    with pytest.raises(InputError, match="does not let nx be set"):
        meshing.read(path, COMM, 2, nx=5)


@pytest.mark.parallel
def test_a_builder_that_fails_fails_on_every_rank():
    def build():
        raise KeyError("my mistake")

    with pytest.raises(InputError, match=r"could not build the mesh.*my mistake"):
        meshing.from_gmsh(build, COMM)
    assert not gmsh.isInitialized()
