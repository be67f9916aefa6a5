"""Meshes as programs and people write them: the right mesh, or a refusal in one sentence."""

import subprocess
import sys
import warnings
from pathlib import Path

import mesh_dialects
import meshio
import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem
from test_surface_meshes import area, count, folder, obj, refused, write

from fabric_fenicsx import scenes, sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.surfaces import meshing, yarns
from fabric_fenicsx.terms import supports

COMM = MPI.COMM_WORLD
DATA = Path(__file__).parent / "data" / "meshes"
SQUARE = Path(meshing.__file__).parent.parent / "meshes" / "square.geo"


def groups(domain):
    """Name -> dimension -> number of entities, over all ranks."""
    sizes = {}
    for name in domain.names:
        for dim in domain.names[name]:
            owned = domain.entities(name, dim)[1] < domain.mesh.topology.index_map(dim).size_local
            sizes.setdefault(name, {})[dim] = COMM.allreduce(int(owned.sum()))
    return sizes


def extent(domain):
    """Least and greatest coordinates over all ranks."""
    x = domain.mesh.geometry.x
    low = np.min(COMM.allgather(x.min(axis=0, initial=np.inf)), axis=0)
    return np.round([low, np.max(COMM.allgather(x.max(axis=0, initial=-np.inf)), axis=0)], 9).tolist()


@pytest.mark.parametrize("seed", range(0, 65))
def test_a_good_mesh_in_any_dialect_is_read_right_and_a_spoilt_one_refused(seed):
    result, what = mesh_dialects.trial(seed)
    assert result.startswith("refused" if "spoilt" in what else "right"), f"{what}: {result}"


# file -> cells, points, pieces, greatest z, groups without those that every file has
READ = {
    "com_el.inp": (16, 25, 1, 0, {"Cloth": {2: 16}}),
    "com_mid.inp": (16, 25, 1, 0, {"Cloth": {2: 16}}),
    "com_node.inp": (16, 25, 1, 0, {"Cloth": {2: 16}}),
    "asm_diff.inp": (41, 61, 2, 3, {"F-1": {2: 16}, "B-1": {2: 25}, "sheet": {2: 41}}),
    "asm_one2.inp": (32, 50, 2, 2, {"F-1": {2: 16}, "F-2": {2: 16}, "sheet": {2: 32}}),
    "assembly1.inp": (16, 25, 1, 5, {"Front_all": {2: 16}, "top": {2: 4}, "held": {0: 2}}),
    "assembly2.inp": (32, 50, 2, 1, {"Front-1": {2: 16}, "Back-1": {2: 16}, "sheet": {2: 32}}),
    "multinode.inp": (16, 25, 1, 0, {"Cloth": {2: 16}, "A": {0: 10}, "B": {0: 15}}),
    "trail.inp": (16, 25, 1, 0, {"Cloth": {2: 16}}),
    "include.inp": (16, 25, 1, 0, {"Cloth": {2: 16}}),
    "quoted.inp": (16, 25, 1, 0, {"My Cloth Front": {2: 8}, "My Cloth Back": {2: 8}}),
}


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("name", READ)
def test_an_inp_file_is_read_whole(name):
    cells, points, pieces, z, named = READ[name]
    domain = meshing.read(DATA / name, COMM)
    assert (count(domain), domain.mesh.geometry.index_map().size_global, domain.pieces) == (cells, points, pieces)
    found = groups(domain)
    found.pop("boundary")
    assert found == named
    assert extent(domain)[1] == [1, 1, z]
    assert abs(area(domain) - pieces) < 1e-12


HEAD = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n"
CELL = "*ELEMENT, TYPE=S4, ELSET=all\n1, 1, 2, 3, 4\n"
PART = f"*PART, NAME=P\n{HEAD}{CELL}*END PART\n*ASSEMBLY, NAME=A\n"
REFUSED = {
    "ngen": (HEAD + "*NGEN\n1, 3, 1\n" + CELL, "line 6: \\*NGEN makes, moves or joins"),
    "tie": (HEAD + CELL + "*TIE, NAME=t\na, b\n", "line 8: \\*TIE"),
    "beam": (HEAD + CELL + "*ELEMENT, TYPE=B31\n2, 1, 2\n", "line 8: elements B31 are no surface"),
    "solid": ("*NODE\n1, 0, 0\n*ELEMENT, TYPE=C3D4\n1, 1, 1, 1, 1\n", "line 3: elements C3D4 are no surface"),
    "too few": (HEAD + "*ELEMENT, TYPE=S4\n1, 1, 2, 3\n", "line 7: an element S4 has 4 nodes, and not 3"),
    "too many": (HEAD + "*ELEMENT, TYPE=S3\n1, 1, 2, 3, 4\n", "line 7: an element S3 has 3 nodes, and not 4"),
    "no node": (HEAD + "*ELEMENT, TYPE=S4\n1, 1, 2, 3, 9\n", "line 7: there is no node '9'"),
    "twice a node": (HEAD + "1, 2, 0\n" + CELL, "line 6: node 1 is at two places"),
    "twice a cell": (HEAD + CELL + "1, 1, 2, 3, 4\n", "line 8: element 1 is there already, in line 7"),
    "letters": (HEAD + "5, 1, x\n" + CELL, "line 6: 'x' is not a number"),
    "parameter": ("*NODE\n1, <a>, 0\n" + CELL, "line 2: '<a>' is not a number"),
    "cylinder": ("*NODE, SYSTEM=C\n1, 0, 0\n" + CELL, "line 1: nodes in cylindrical or spherical"),
    "no type": (HEAD + "*ELEMENT\n1, 1, 2, 3, 4\n", "line 6: \\*ELEMENT needs TYPE"),
    "unknown": (HEAD + "*ELEMENT, TYPE=S4, OFFSET=SPOS\n1, 1, 2, 3, 4\n", "line 6: \\*ELEMENT with OFFSET is not read"),
    "steps": (HEAD + CELL + "*ELSET, ELSET=a, GENERATE\n1, 4, 2\n", "line 9: from 1 one does not come to 4"),
    "no member": (HEAD + CELL + "*ELSET, ELSET=a\n1, 7\n", "line 8: there is no element '7'"),
    "no set": (HEAD + CELL + "*NSET, NSET=a\nb\n", "line 8: there is no node set 'B'"),
    "in itself": (HEAD + CELL + "*NSET, NSET=a\na\n", "line 8: the set 'A' is in itself"),
    "no file": ("*INCLUDE, INPUT=none.inp\n", "line 1: there is no file"),
    "itself": ("*INCLUDE, INPUT=bad.inp\n", "line 1: 'bad.inp' takes in itself"),
    "no part": (
        PART + "*INSTANCE, NAME=I, PART=Q\n*END INSTANCE\n*END ASSEMBLY\n",
        "line 11: the instance 'I' is of no",
    ),
    "axis": (
        PART + "*INSTANCE, NAME=I, PART=P\n0, 0, 0\n1, 1, 1, 1, 1, 1, 90\n*END INSTANCE\n",
        "line 13: the two points",
    ),
    "open part": (f"*PART, NAME=P\n{HEAD}{CELL}", "is not ended by"),
    "truss": (HEAD + CELL + "*ELEMENT, TYPE=T3D2, ELSET=e\n5, 1, 3\n", "has a truss from .* that is no edge of a cell"),
}


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("fault", REFUSED)
def test_what_is_not_understood_of_an_inp_file_is_refused_by_its_line(tmp_path, fault):
    text, match = REFUSED[fault]
    path = write(folder(tmp_path) / "bad.inp", text)
    assert "bad.inp" in refused(match, lambda: meshing.read(path, COMM))


@pytest.mark.parallel
def test_an_instance_is_shifted_and_then_turned(tmp_path):
    # to (2, 0, 0), then a quarter turn about the line through (0, 0, 0) and (0, 0, 1)
    move = "*INSTANCE, NAME=I, PART=P\n2, 0, 0\n0, 0, 0, 0, 0, 1, 90\n*END INSTANCE\n"
    domain = meshing.read(write(folder(tmp_path) / "a.inp", PART + move + "*END ASSEMBLY\n"), COMM)
    assert extent(domain) == [[-1, 2, 0], [0, 3, 0]]


@pytest.mark.parallel
def test_sets_of_several_instances_go_by_the_names_of_both(tmp_path):
    text = PART.replace("*END PART", "*NSET, NSET=left\n1, 4\n*END PART")
    for name, z in (("I", 0), ("J", 1)):
        text += f"*INSTANCE, NAME={name}, PART=P\n0, 0, {z}\n*END INSTANCE\n"
    text += "*NSET, NSET=both\nI.left, J.1\n*ELSET, ELSET=second\nJ.1\n*END ASSEMBLY\n"
    domain = meshing.read(write(folder(tmp_path) / "a.inp", text), COMM)
    found = groups(domain)
    assert found["I.left"] == found["J.left"] == {0: 2} and "left" not in found
    assert found["both"] == {0: 3} and found["second"] == {2: 1} and found["I"] == found["J"] == {2: 1}


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("degree", [1, 2])
def test_a_set_of_nodes_stands_for_the_edges_between_them(tmp_path, degree):
    text = HEAD + "5, 2, 0\n6, 2, 1\n*ELEMENT, TYPE=S4\n1, 1, 2, 3, 4\n2, 2, 5, 6, 3\n*NSET, NSET=left\n1, 4\n"
    domain = meshing.read(write(folder(tmp_path) / "a.inp", text + "*NSET, NSET=apart\n1, 3\n"), COMM)
    space = fem.functionspace(domain.mesh, ("Lagrange", degree, (3,)))
    for name, expected in (("left", 1 + degree), ("apart", 2)):
        dofs = supports.unknowns(domain, space, name, 0)
        owned = dofs[dofs < space.dofmap.index_map.size_local * 3]
        assert COMM.allreduce(len(owned)) == expected
    assert domain.entities("left")[0] == 0


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("element", ["mitc4", "regge"])
def test_a_shell_is_clamped_at_a_set_of_nodes(tmp_path, element):
    text, quads = HEAD + "5, 2, 0\n6, 2, 1\n", element == "mitc4"
    text += (
        "*ELEMENT, TYPE=S4\n1, 1, 2, 3, 4\n2, 2, 5, 6, 3\n" if quads else "*ELEMENT, TYPE=S3\n1, 1, 2, 3\n2, 1, 3, 4\n"
    )
    domain = meshing.read(write(folder(tmp_path) / "a.inp", text + "*NSET, NSET=left\n1, 4\n"), COMM)
    own = sheet.Sheet(domain, StVenantKirchhoff.isotropic(1e6, 0.3), 1e-3, (1e5, 1e5), element=element)
    every = supports.unknowns(domain, own.space, "left")
    clamped = np.concatenate([bc.dof_indices()[0] for bc in supports.clamp(domain, own.space, "left")])
    assert np.array_equal(np.sort(clamped), np.sort(every)) and COMM.allreduce(len(clamped)) > 0
    turning = np.concatenate([bc.dof_indices()[0] for bc in supports.hold(domain, own.space, "left")])
    assert np.isin(turning, clamped).all() and COMM.allreduce(len(turning)) > 0


def test_a_set_of_nodes_of_quadratic_cells_needs_the_corners(tmp_path):
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]])
    text = "*NODE\n" + "".join(f"{k}, {x}, {y}\n" for k, (x, y) in enumerate(points, 1))
    text += "*ELEMENT, TYPE=S8R\n1, 1, 2, 3, 4, 5, 6,\n7, 8\n*NSET, NSET=edge\n1, 5, 2\n*NSET, NSET=middle\n1, 5\n"
    domain = meshing.read(write(tmp_path / "a.inp", text), MPI.COMM_SELF)
    assert domain.mesh.geometry.cmaps[0].degree == 2
    assert domain.entities("edge")[0] == 0 and len(domain.entities("edge")[1]) == 2
    with pytest.raises(InputError, match="'middle' cannot be used: it has a point in the middle of an edge"):
        domain.entities("middle")


def test_eight_nodes_and_nine_are_the_same_surface(tmp_path):
    x = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0.3], [0, 1, 0], [0.5, 0.1, 0], [1, 0.5, 0.2], [0.5, 1, 0], [0, 0.5, 0.1]]
    )
    middle = x[4:].sum(axis=0) / 2 - x[:4].sum(axis=0) / 4
    for name, kind, points in (("8", "quad8", x), ("9", "quad9", [*x, middle])):
        meshio.Mesh(points, [(kind, [range(len(points))])]).write(tmp_path / f"{name}.vtu")
    eight, nine = (meshing.read(tmp_path / f"{n}.vtu", MPI.COMM_SELF).mesh.geometry.x for n in "89")
    assert np.abs(np.sort(eight, axis=0) - np.sort(nine, axis=0)).max() < 1e-15


# -- gmsh's groups -------------------------------------------------------------------------------------------------

FLAT = """Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0, 1, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1}; Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
Transfinite Curve{:} = 3; Transfinite Surface{1};
"""


@pytest.mark.parallel
@pytest.mark.parametrize("name, cells", [("arc.geo", 160), ("unused.geo", 42)])
def test_a_named_point_of_no_cell_is_refused_where_it_is_asked_for(name, cells):
    domain = meshing.read(DATA / name, COMM)
    assert count(domain) == cells
    refused(r"group 'centre' cannot be used: .*on no cell: embed it", lambda: domain.entities("centre"))


@pytest.mark.parallel
def test_groups_by_number_and_one_name_in_several_dimensions(tmp_path):
    text = (
        FLAT
        + 'Physical Surface(7) = {1}; Physical Surface("a") = {1}; Physical Curve("a") = {4}; Physical Point(9) = {1};'
    )
    domain = meshing.read(write(folder(tmp_path) / "a.geo", text), COMM)
    assert groups(domain) == {"7": {2: 8}, "a": {1: 2, 2: 8}, "9": {0: 1}}
    refused("'a' is that of a group of edges and of cells", lambda: domain.entities("a"))
    space = fem.functionspace(domain.mesh, ("Lagrange", 1, (3,)))
    dofs = supports.unknowns(domain, space, "a", 2)  # a support takes all that is called so
    assert COMM.allreduce(int((dofs < 3 * space.dofmap.index_map.size_local).sum())) == 9
    measure = supports.over(domain, "a", 2, dim=1)
    length = fem.assemble_scalar(fem.form(fem.Constant(domain.mesh, 1.0) * measure))
    assert abs(COMM.allreduce(length) - 1) < 1e-12


OLD = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
2 10 "a"
1 10 "rim"
$EndPhysicalNames
$Nodes
6
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 2 0 0
6 2 1 0
$EndNodes
$Elements
6
1 3 2 10 1 1 2 3 4
2 3 2 20 1 2 5 6 3
3 3 2 30 1 2 5 6 3
4 1 2 10 1 1 2
5 1 2 6 1 4 1
6 15 2 4 1 5
$EndElements
"""


@pytest.mark.parallel
def test_an_old_msh_file_has_groups_of_elements_not_of_surfaces(tmp_path):
    domain = meshing.read(write(folder(tmp_path) / "a.msh", OLD), COMM)
    assert count(domain) == 2
    expected = {"a": {2: 1}, "20": {2: 1}, "30": {2: 1}, "rim": {1: 1}, "6": {1: 1}, "4": {0: 1}}
    assert groups(domain) == expected
    other = write(folder(tmp_path) / "c.geo", 'Merge "a.msh";\n')
    refused("a.msh' is of version 2, in which gmsh", lambda: meshing.read(other, COMM))
    bad = write(folder(tmp_path) / "b.msh", OLD.replace("1 3 2 10 1", "1 3 2 0 1"))
    refused("must be in a physical surface, and 1 of 2 are in none", lambda: meshing.read(bad, COMM))


@pytest.mark.parallel
def test_loads_on_groups_that_overlap_and_warps_that_do(tmp_path):
    text = HEAD + "5, 2, 0\n6, 2, 1\n*ELEMENT, TYPE=S4, ELSET=one\n1, 1, 2, 3, 4\n*ELEMENT, TYPE=S4\n2, 2, 5, 6, 3\n"
    text += "*ELSET, ELSET=both\none, 2\n"
    domain = meshing.read(write(folder(tmp_path) / "a.inp", text), COMM)
    one = fem.Constant(domain.mesh, 1.0)
    form = one * supports.over(domain, "one", 2) + 10 * one * supports.over(domain, "both", 2)
    assert abs(COMM.allreduce(fem.assemble_scalar(fem.form(form))) - 21) < 1e-12
    refused(
        "cell 0 at .* two warps are given: the groups both, one",
        lambda: yarns.patches(domain, {"one": (1, 0, 0), "both": (0, 1, 0)}),
    )


# -- torn, in millimetres, of several kinds ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name, cells, free, pieces, merge",
    [("seam.obj", 16, 8, 2, 1e-6), ("round.stl", 32, 80, 32, 5e-5), ("two.geo", 84, 8, 2, 1e-6)],
)
def test_a_torn_sheet_is_said_to_be_torn_and_is_mended(name, cells, free, pieces, merge):
    with pytest.warns(UserWarning, match=rf"{free} free edges lie on one another .* of {pieces} pieces: .* merge = "):
        domain = meshing.read(DATA / name, MPI.COMM_SELF)
    assert (count_alone(domain), domain.pieces) == (cells, pieces)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        whole = meshing.read(DATA / name, MPI.COMM_SELF, merge=merge)
    assert (count_alone(whole), whole.pieces) == (cells, 1)
    if name != "two.geo":
        assert len(whole.entities("boundary")[1]) == 16


def count_alone(domain):
    return domain.mesh.topology.index_map(2).size_local


def test_too_much_is_not_merged():
    with pytest.raises(InputError, match=r"merge = 0.3 m is too much at .*: give less"):
        meshing.read(DATA / "seam.obj", MPI.COMM_SELF, merge=0.3)


def test_a_sheet_in_millimetres():
    with pytest.warns(UserWarning, match="is 1000 m wide: .* scale = 0.001"):
        meshing.read(DATA / "mm.obj", MPI.COMM_SELF)
    domain = meshing.read(DATA / "mm.obj", MPI.COMM_SELF, scale=0.001)
    assert domain.mesh.geometry.x.max() == 1.0


POLYGONS = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 0.2, 0], [0, 1, 0], [0, 2, 0], [2, 2, 0]], dtype=float)


def test_tables_of_strips_and_grids_of_points(tmp_path):
    head = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET "
    strip = "POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 1 1 0\nTRIANGLE_STRIPS 1 5\n4 0 1 2 3\n"
    grid = "STRUCTURED_GRID\nDIMENSIONS 3 2 1\nPOINTS 6 float\n0 0 0 1 0 0 2 0 0 0 1 0 1 1 0 2 1 0\n"
    regular = "STRUCTURED_POINTS\nDIMENSIONS 3 2 1\nORIGIN 0 0 0\nSPACING 1 1 1\n"
    solid = regular.replace("3 2 1\n", "3 2 2\n", 1)
    for text, cells, size in ((strip, 2, 1), (grid, 2, 2), (regular, 2, 2)):
        (tmp_path / "a.vtk").write_text(head + text)
        domain = meshing.read(tmp_path / "a.vtk", MPI.COMM_SELF)
        assert count_alone(domain) == cells and abs(area(domain) - size) < 1e-12
    (tmp_path / "a.vtk").write_text(head + solid)
    with pytest.raises(InputError, match="a grid of volumes or lines"):
        meshing.read(tmp_path / "a.vtk", MPI.COMM_SELF)


@pytest.mark.parallel
def test_polygons_that_are_not_convex_are_cut(tmp_path):
    path = write(folder(tmp_path) / "a.obj", obj(POLYGONS, [[0, 1, 2, 3, 4], [4, 3, 2, 6, 5]]))
    refused("polygons of 5 nodes.*triangulate = true", lambda: meshing.read(path, COMM))
    domain = meshing.read(path, COMM, triangulate=True)
    assert count(domain) == 6 and abs(area(domain) - 4) < 1e-12 and domain.pieces == 1


@pytest.mark.parallel
def test_a_polygon_that_crosses_itself_is_refused(tmp_path):
    path = write(folder(tmp_path) / "a.obj", obj(POLYGONS, [[0, 1, 2], [0, 2, 4, 1, 5]]))
    refused("Cell|share the edge|crosses itself", lambda: meshing.read(path, COMM, triangulate=True))


def test_quadratic_quadrilaterals_are_cut_through_their_middle(tmp_path):
    x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, -0.1, 0], [1, 0.5, 0], [0.5, 1, 0], [0, 0.5, 0]])
    meshio.Mesh(x, [("quad8", [range(8)])]).write(tmp_path / "a.vtu")
    whole = meshing.read(tmp_path / "a.vtu", MPI.COMM_SELF)
    cut = meshing.read(tmp_path / "a.vtu", MPI.COMM_SELF, triangulate=True)
    assert (cut.mesh.basix_cell().name, cut.mesh.geometry.cmaps[0].degree) == ("triangle", 2)
    assert abs(area(cut) - area(whole)) < 1e-12


# -- what gmsh passes over -------------------------------------------------------------------------------------------

BDF = "BEGIN BULK\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\n"
NASTRAN = {
    "good": (BDF + "CTRIA3,1,5,1,2,3\nCTRIA3,2,6,1,3,4\n", None),
    "small letters": (BDF + "CTRIA3,1,5,1,2,3\nctria3,2,6,1,3,4\n", "2 cells, of which gmsh reads 1"),
    "system": (BDF.replace("GRID,2,,", "GRID,2,7,") + "CTRIA3,1,5,1,2,3\n", "line 3: a point in the system 7"),
    "unknown": (BDF + "CTRIA3,1,5,1,2,3\nCQUADR,2,6,1,2,3,4\n", "line 7: CQUADR is not read"),
    "include": (BDF + "CTRIA3,1,5,1,2,3\nINCLUDE 'b.bdf'\n", "line 7: INCLUDE is not read"),
}


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("case", NASTRAN)
def test_a_nastran_file_is_read_whole_or_not_at_all(tmp_path, case):
    text, match = NASTRAN[case]
    path = write(folder(tmp_path) / "a.BDF", text)
    if match:
        refused(match, lambda: meshing.read(path, COMM))
        return
    domain = meshing.read(path, COMM)
    assert count(domain) == 2 and groups(domain) == {"5": {2: 1}, "6": {2: 1}, "boundary": {1: 4}}


def test_groups_of_an_ideas_file_have_whole_names(tmp_path):
    nodes = "".join(f"{k:10d}{1:10d}{1:10d}{11:10d}\n{x:25.16E}{y:25.16E}{0:25.16E}\n" for k, (x, y) in
                    enumerate([(0, 0), (1, 0), (1, 1), (0, 1)], 1))  # fmt: skip
    cells = "".join(f"{k:10d}{91:10d}{1:10d}{1:10d}{7:10d}{3:10d}\n" + "".join(f"{n:10d}" for n in own) + "\n"
                    for k, own in ((1, (1, 2, 3)), (2, (1, 3, 4))))  # fmt: skip
    sets = "".join(f"{k:10d}{0:10d}{0:10d}{0:10d}{0:10d}{0:10d}{0:10d}{1:10d}\n{name}\n{8:10d}{k:10d}{0:10d}{0:10d}\n"
                   for k, name in ((1, "My front"), (2, "My back")))  # fmt: skip
    parts = [f"    -1\n  {key}\n{text}    -1\n" for key, text in ((2411, nodes), (2412, cells), (2467, sets))]
    domain = meshing.read(write(tmp_path / "a.unv", "".join(parts)), MPI.COMM_SELF)
    assert {name: len(domain.entities(name)[1]) for name in domain.names} == {
        "My front": 1,
        "My back": 1,
        "boundary": 4,
    }


# -- a .geo is a program -----------------------------------------------------------------------------------------------

HARMFUL = {
    "plain": 'SystemCall "touch HERE";',
    "other names": 'NonBlockingSystemCall "touch HERE";',
    "a word made of text": 'S2N["SystemCall"] "touch HERE";',
    "after a number": 'a = 1e5SystemCall "touch HERE";',
    "in a macro": 'Macro foo SystemCall "touch HERE";\nReturn\nCall foo;',
    "behind a quotation mark that gmsh passes over": 'If (0)\n E" EndIf SystemCall "touch HERE"; //"\nEndIf',
    "behind a comment that gmsh passes over": 'If(0) If(a)//EndIf EndIf SystemCall "touch HERE";\nEndIf',
    "behind a text that is too long": f"a = \"{'x' * 1020}; SystemCall 'touch HERE';\"",
    "a field": 'Field[1] = ExternalProcess; Field[1].CommandLine = "touch HERE"; Background Field = 1;',
    "onelab": 'OnelabRun("x", "touch HERE");',
    "a file": 'Printf("a") > "HERE";',
    "the end of a list": 'Printf("a %g", 1) >> "HERE";',
    "the mesh": 'Save "HERE";',
    "a folder": 'CreateDir "HERE";',
    "an option": 'General.TmpFileName = "HERE";',
    "included": 'Include "other.txt";',
    "merged": 'Merge\n /* a */ "other.txt"\n;',
    "merged by a name that is made": 'Merge StrCat("other", ".txt");',
    "options beside it": "",
}


@pytest.mark.parametrize("how", HARMFUL)
def test_a_geo_file_runs_no_program_and_writes_no_file(tmp_path, how):
    path, here = tmp_path / "a.geo", tmp_path / "HERE"
    path.write_text("// one\n" + HARMFUL[how].replace("HERE", str(here)) + "\n" + SQUARE.read_text())
    (tmp_path / "other.txt").write_text(f'SystemCall "touch {here}";\n')
    if how.startswith("options"):
        (tmp_path / "a.geo.opt").write_text(f'SystemCall "touch {here}";\n')
    with pytest.raises(InputError, match=r"line \d+: .*; take it out, or, if you trust the file, run it with --trust"):
        meshing.read(path, MPI.COMM_SELF)
    assert not here.exists()


def test_what_only_looks_like_a_program_is_read(tmp_path):
    text = """// SystemCall "x"; Save the mesh; Exit
/* Include, Print */ Printf("Save Exit > System"); Printf("%g", 3 > 2); Print.Text = 1;
R = 2; E = 3; If (R > 3) // a comment
  x = R/E;
EndIf
Include "more.txt"; SavedAngle = 3;
"""
    (tmp_path / "more.txt").write_text("b = 2;\n")
    (tmp_path / "a.geo").write_text(text + SQUARE.read_text())
    assert count_alone(meshing.read(tmp_path / "a.geo", MPI.COMM_SELF)) == 9


def test_a_trusted_geo_file_runs_but_does_not_end_the_run(tmp_path):
    (tmp_path / "a.geo").write_text(f'SystemCall "touch {tmp_path / "HERE"}";\n' + SQUARE.read_text())
    meshing.read(tmp_path / "a.geo", MPI.COMM_SELF, trust=True)
    assert (tmp_path / "HERE").exists()
    (tmp_path / "b.geo").write_text("Exit;\n" + SQUARE.read_text())
    with pytest.raises(InputError, match="line 1: Exit ends the run without a word; take it out"):
        meshing.read(tmp_path / "b.geo", MPI.COMM_SELF, trust=True)


SCENE = """[mesh]
file = "a.geo"
MORE
[sheet]
fabric = "blend"
kinematics = "membrane"
[[support]]
at = "left"
kind = "hinge"
[dynamics]
end_s = 0.005
"""


def run(folder, scene, *words):
    """Status and what is said of a scene."""
    (folder / "scene.toml").write_text(scene)
    command = [sys.executable, "-c", "from fabric_fenicsx.app.cli import main; main()", "run", "scene.toml", "--quiet"]
    done = subprocess.run([*command, "--out", "out", *words], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_a_scene_runs_programs_only_with_trust_and_tells_its_pieces(tmp_path):
    text = (DATA / "two.geo").read_text()
    (tmp_path / "a.geo").write_text('SystemCall "touch HERE";\n' + text)
    status, said = run(tmp_path, SCENE.replace("MORE", ""))
    assert status == 2 and "line 1: SystemCall runs a program" in said and not (tmp_path / "HERE").exists()
    status, said = run(tmp_path, SCENE.replace("MORE", "scale = 12"), "--trust")
    assert (tmp_path / "HERE").exists()
    assert "24 m wide" in said and "is of 2 pieces" in said and "merge = " in said
    (tmp_path / "scene.toml").write_text(SCENE.replace("MORE", "merge = 1e-6\ntriangulate = true"))
    scene = scenes.read(tmp_path / "scene.toml")
    assert (scene.scale, scene.merge, scene.triangulate, scene.trust) == (1.0, 1e-6, True, False)
