"""Warp and weft in surfaces, and the normals of the shell, against the exact ones of cylinder and sphere."""

import numpy as np
import pytest
import scenes
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.shell import directors
from fabric_fenicsx.surfaces import meshing, yarns

COMM = MPI.COMM_WORLD
DEGREE = directors.DEGREE
CELLS = {"triangle": 1, "quadrilateral": 0}
FOLDED = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
g body
f 1 2 3
f 1 3 4
g sleeve
f 1 5 6
f 1 6 2
"""


def surface(name, cells=4, cell="triangle", order=2, comm=COMM, **numbers):
    """A quarter of a cylinder about y, or of a hemisphere about z, of radius 1 m."""
    path = scenes.MESHES / f"{name}.geo"
    return meshing.read(path, comm, nx=cells, ny=cells, triangles=CELLS[cell], order=order, radius=1, **numbers)


def folded(tmp_path):
    """A square in the x-y plane and one in the x-z plane, with a common edge."""
    path = COMM.bcast(tmp_path, root=0) / "folded.obj"
    if COMM.rank == 0:
        path.write_text(FOLDED)
    COMM.barrier()
    return meshing.read(path, COMM)


def exact_normal(name, x):
    """Outward unit normals (n, 3) at points (n, 3) of the surface."""
    out = x * ([1, 0, 1] if name == "cylinder" else [1, 1, 1])
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def at_points(m, *fields):
    """Values (n, 3) of vector fields at the points of the rule, in the cells of this rank."""
    points = yarns.basix.make_quadrature(m.basix_cell(), DEGREE)[0]
    cells = np.arange(m.topology.index_map(2).size_local, dtype=np.int32)
    return [fem.Expression(field, points).eval(m, cells).reshape(-1, 3) for field in fields]


def axes_at_points(domain, warp):
    """Places, discrete normals, warp and weft, each (n, 3)."""
    axes = yarns.surface_axes(domain, warp, DEGREE)
    m = domain.mesh
    x, n = at_points(m, ufl.SpatialCoordinate(m), ufl.CellNormal(m))
    return x, n, *(axis.x.array.reshape(-1, 3)[: len(x)] for axis in axes)


def largest(array):
    """Over all ranks."""
    return COMM.allreduce(float(np.abs(array).max(initial=0)), MPI.MAX)


def order_of(errors):
    """Of convergence, from one mesh to the next of half the size."""
    return np.log2(np.array(errors[:-1]) / errors[1:])


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("name", ["cylinder", "hemisphere"])
def test_axes_are_orthonormal_in_the_surface_and_right_handed(name, cell, order):
    domain = surface(name, cell=cell, order=order)
    direction = np.array([0.3, -0.5, 0.7])
    _, n, a, b = axes_at_points(domain, direction)
    for left, right, product in ((a, a, 1), (b, b, 1), (a, b, 0), (a, n, 0), (b, n, 0), (np.cross(a, b), n, 1)):
        assert largest((left * right).sum(axis=1) - product) < 1e-14
    # the projection, not another direction in the surface
    assert largest(b @ direction) < 1e-14
    assert ((a @ direction) > 0).all()


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("cell", CELLS)
def test_along_and_around_a_cylinder(cell):
    domain = surface("cylinder", cell=cell, order=1)
    m, y = domain.mesh, np.array([0, 1, 0])
    X = ufl.SpatialCoordinate(m)
    around = ufl.as_vector([X[2], 0, -X[0]])
    # facets with edges along y hold it: exact, also where the facets are not the cylinder
    _, n, a, b = axes_at_points(domain, y)
    assert largest(a - y) < 1e-14
    assert largest(b - np.cross(n, y)) < 1e-14
    x, n, a, b = axes_at_points(domain, around)
    assert largest(b - np.sign((n * exact_normal("cylinder", x)).sum(axis=1))[:, None] * y) < 1e-14
    assert largest(a - np.cross(b, n)) < 1e-14
    # a Function says the same as the expression
    V = fem.functionspace(m, ("Lagrange", 1, (3,)))
    field = fem.Function(V)
    field.interpolate(lambda x: np.array([x[2], 0 * x[0], -x[0]]))
    for axis, other in zip(yarns.surface_axes(m, field, DEGREE), (a, b), strict=True):
        assert largest(axis.x.array.reshape(-1, 3)[: len(other)] - other) < 1e-14


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("name", ["cylinder", "hemisphere"])
def test_axes_of_quadratic_cells_converge_to_the_exact_ones(name):
    """Around the axis of the cylinder; towards the pole of the sphere."""
    errors = []
    for cells in (4, 8, 16):
        domain = surface(name, cells)
        if name == "cylinder":
            X = ufl.SpatialCoordinate(domain.mesh)
            x, n, a, b = axes_at_points(domain, ufl.as_vector([X[2], 0, -X[0]]))
            exact = np.column_stack([x[:, 2], 0 * x[:, 0], -x[:, 0]])
        else:
            x, n, a, b = axes_at_points(domain, (0, 0, 1))
            exact = [0, 0, 1] - x[:, [2]] * x / (x**2).sum(axis=1, keepdims=True)
        exact /= np.linalg.norm(exact, axis=1, keepdims=True)
        outward = exact_normal(name, x)
        outward *= np.sign((outward * n).sum(axis=1, keepdims=True))
        errors.append(max(largest(a - exact), largest(b - np.cross(outward, exact))))
    assert order_of(errors)[-1] > 1.9


@pytest.mark.parallel
def test_axes_do_not_depend_on_the_number_of_ranks():
    moments = []
    for comm in (COMM, MPI.COMM_SELF):
        domain = surface("hemisphere", comm=comm)
        x, _, *axes = axes_at_points(domain, (1, 2, 3))
        moments.append([comm.allreduce(np.einsum("ni,nj->ij", x**2, axis)) for axis in axes])
    assert np.abs(np.subtract(*moments)).max() < 1e-11


@pytest.mark.parallel
def test_a_direction_for_each_patch(tmp_path):
    domain = folded(tmp_path)
    _, _, a, b = axes_at_points(domain, {"sleeve": (1, 1, 2), "body": (1, 0, 5)})
    number = np.repeat(domain.mesh.topology.original_cell_index[: len(a) // 3], 3)
    sleeve = (number > 1)[:, None]
    assert largest(a - np.where(sleeve, np.array([1, 0, 2]) / np.sqrt(5), [1, 0, 0])) < 1e-14
    assert largest(b - np.where(sleeve, np.array([2, 0, -1]) / np.sqrt(5), [0, 1, 0])) < 1e-14
    # in the plane, angles
    angle = yarns.patches(domain, {"sleeve": 0.5, "body": -1.0})
    assert largest(angle.x.array - np.where(domain.mesh.topology.original_cell_index > 1, 0.5, -1.0)) == 0


def refused(match, call):
    """Refused with the same one sentence on every rank."""
    with pytest.raises(InputError, match=match) as caught:
        call()
    said = str(caught.value)
    assert said.endswith(".") and "\n" not in said
    assert len(set(COMM.allgather(said))) == 1


@pytest.mark.parallel
def test_a_warp_that_cannot_be_is_refused_naming_the_cell(tmp_path):
    domain = folded(tmp_path)
    field = fem.Function(fem.functionspace(domain.mesh, ("DG", 0, (3,))))
    field.x.array[:] = 1.0
    number = domain.mesh.topology.original_cell_index
    said = r"^In cell 3 at \(0.6667, 0, 0.3333\) the warp direction is along the normal, zero or not finite"
    for bad in ((0, 0, 0), (np.nan, 1, 0), (0, np.inf, 0), (0, -3, 1e-7)):
        field.x.array.reshape(-1, 3)[number == 3] = bad
        refused(said, lambda: yarns.surface_axes(domain, field, DEGREE))
    field.x.array.reshape(-1, 3)[number == 3] = (0, -3, 1e-4)
    yarns.surface_axes(domain, field, DEGREE)
    patches = {"body": (1, 0, 0), "sleeve": (0, -2, 1e-9)}
    refused(r"^In cell 2 at \(0.3333, 0, 0.6667\) the warp", lambda: yarns.surface_axes(domain, patches, DEGREE))
    refused(r"^In cell 0 at .* the warp", lambda: yarns.surface_axes(domain.mesh, (0, 0, 1), DEGREE))
    refused(
        r"^In cell 2 at \(0.3333, 0, 0.6667\) no warp is given: it is in none of the groups body\.$",
        lambda: yarns.patches(domain, {"body": (1, 0, 0)}),
    )
    refused("no physical group 'cuff'", lambda: yarns.patches(domain, {"cuff": (1, 0, 0)}))
    refused("'boundary' is not one of cells", lambda: yarns.patches(domain, {"boundary": (1, 0, 0)}))
    refused("of every patch must be", lambda: yarns.patches(domain, {"body": (1, 0, 0), "sleeve": 1.0}))
    refused("of every patch must be", lambda: yarns.patches(domain, {}))
    refused("give the Domain", lambda: yarns.surface_axes(domain.mesh, patches, DEGREE))
    for warp in ((0, 0, 0), (1, 0), (1, 0, np.nan)):
        refused("must be three numbers", lambda warp=warp: yarns.surface_axes(domain, warp, DEGREE))


# -- geometry ------------------------------------------------------------------------------------------------


def normal_error(name, domain):
    """Largest distance of the directors of a shell from the exact normals, over all nodes."""
    normal = directors.ShellSpace(domain.mesh).normal
    V = normal.function_space
    n = normal.x.array.reshape(-1, 3)
    x = V.tabulate_dof_coordinates()[: len(n)]
    exact = exact_normal(name, x)
    assert largest(np.linalg.norm(n, axis=1) - 1) < 1e-14
    return largest(np.minimum(np.abs(n - exact).max(axis=1), np.abs(n + exact).max(axis=1)))


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("name", ["cylinder", "hemisphere"])
@pytest.mark.parametrize("cell, order, rate", [("triangle", 1, 1), ("triangle", 2, 2), ("quadrilateral", 1, 1)])
def test_order_of_the_directors(name, cell, order, rate):
    errors = [normal_error(name, surface(name, cells, cell, order)) for cells in (4, 8, 16)]
    assert order_of(errors)[-1] > rate - 0.1


@pytest.mark.parametrize("name, exact", [("cylinder", np.pi / 2), ("hemisphere", np.pi / 2 * np.cos(np.pi / 10))])
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("order, rate", [(1, 2), (2, 4)])
def test_order_of_the_area(name, exact, cell, order, rate):
    errors = []
    for cells in (4, 8, 16):
        m = surface(name, cells, cell, order, MPI.COMM_SELF).mesh
        form = fem.form(fem.Constant(m, 1.0) * ufl.dx(domain=m, degree=8))
        errors.append(abs(fem.assemble_scalar(form) - exact))
    assert order_of(errors)[-1] > rate - 0.1
