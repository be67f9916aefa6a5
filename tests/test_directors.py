"""Directors: exact derivatives at any angle, turns without limit, supports; on any number of ranks."""

import basix.ufl
import numpy as np
import pytest
import scenes
from mpi4py import MPI
from dolfinx import fem, mesh

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.shell import directors
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

COMM = MPI.COMM_WORLD
every_cell = pytest.mark.parametrize("triangles", [0, 1], ids=["mitc4", "regge"])


def cylinder(comm=COMM, triangles=1, cells=3):
    """A quarter of a cylinder of radius 1 about the y axis, whose normals point along x and z at its ends."""
    numbers = {"nx": cells, "ny": 2, "triangles": triangles, "order": 1 + triangles}
    return meshing.read(scenes.MESHES / "cylinder.geo", comm, **numbers)


def at_nodes(space, q):
    """Points and directors of the owned nodes over all ranks, in an order that depends on neither."""
    part, dofs = space.V.sub(1).collapse()
    n = part.dofmap.index_map.size_local
    x, d = part.tabulate_dof_coordinates()[:n], q.x.array[dofs[0]].reshape(-1, 3)[:n]
    x, d = (np.concatenate(space.mesh.comm.allgather(a)) for a in (x, d))
    order = np.lexsort(np.round(x, 9).T)
    return x[order], d[order]


def angles(space, size, seed=0):
    """Unknowns (u, theta) of noise, whose angles have a norm of `size` at every node."""
    y = fem.Function(space.W)
    rng = np.random.default_rng(seed)
    y.x.array[:] = 0.1 * rng.standard_normal(len(y.x.array))
    theta = rng.standard_normal(space.angles.shape)
    y.x.array[space.angles] = size * theta / np.linalg.norm(theta, axis=1, keepdims=True)
    return y


@pytest.mark.parametrize("size", [0.0, 1e-5, 1e-2, 1.0, 3.0])
@every_cell
def test_both_derivatives_are_exact_at_any_angle(triangles, size):
    space = directors.ShellSpace(cylinder(MPI.COMM_SELF, triangles).mesh)
    q, y = space.function(), angles(space, size)
    rng = np.random.default_rng(1)
    step, r = rng.standard_normal((2, len(y.x.array)))[0], rng.standard_normal(len(q.x.array))
    moved = fem.Function(space.W)

    def at(t):
        """q, and the force T^T r in W."""
        moved.x.array[:] = y.x.array + t * step
        matrix = space.turn(moved, q)
        force, given = matrix.createVecRight(), matrix.createVecLeft()
        given.array[:] = r
        matrix.multTranspose(given, force)
        return q.x.array.copy(), force.array.copy(), matrix, given

    h = 1e-4
    # differences of fourth order
    first, second = ((8 * (at(h)[i] - at(-h)[i]) - at(2 * h)[i] + at(-2 * h)[i]) / (12 * h) for i in (0, 1))
    _, _, matrix, given = at(0.0)
    x, result = matrix.createVecRight(), matrix.createVecLeft()
    x.array[:] = step
    matrix.mult(x, result)
    assert np.abs(result.array - first).max() < 1e-10 * np.abs(first).max()
    curvature = matrix.transposeMatMult(matrix)  # a matrix with the pattern of a Jacobian
    curvature.zeroEntries()
    space.add_curvature(curvature, given)
    assert np.abs((curvature @ x).array - second).max() < 1e-10 * np.abs(second).max()
    assert np.abs(np.linalg.norm(q.x.array[space.nodes], axis=1) - 1).max() < 1e-15 * 4


@pytest.mark.parallel(first=1)
@every_cell
def test_three_turns_bring_every_director_back(triangles):
    """About the y axis, by 0.9 of half a turn at a time: Rodrigues' formula says where each stands."""
    space = directors.ShellSpace(cylinder(triangles=triangles).mesh)
    q, y = space.function(), fem.Function(space.W)
    start, step = q.x.array[space.nodes], 0.9 * np.pi
    turns = np.arange(1, 21)
    for k in turns:
        c, s = np.cos(k * step), np.sin(k * step)
        goal = start @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
        # the axis y in each frame: t = y x d0, by the angle of the step
        t = step * np.cross([0.0, 1.0, 0.0], space.frame[:, 2])
        y.x.array[space.angles] = np.einsum("nj,naj->na", t, space.frame[:, :2])
        space.turn(y, q)
        space.commit(y)
        assert np.abs(q.x.array[space.nodes] - goal).max() < 1e-13 * k
        assert not y.x.array[space.angles].any()
    assert turns[-1] * step == pytest.approx(9 * 2 * np.pi)


@every_cell
def test_carried_frames_stay_orthonormal(triangles):
    space = directors.ShellSpace(cylinder(MPI.COMM_SELF, triangles).mesh)
    q = space.function()
    for k in range(200):
        y = angles(space, 3.1 * k / 200, seed=k)
        space.turn(y, q)
        space.commit(y)
        products = np.einsum("nij,nkj->nik", space.frame, space.frame)
        assert np.abs(products - np.eye(3)).max() < 1e-14
        assert np.linalg.det(space.frame) == pytest.approx(1, abs=1e-14)
        assert np.abs(space.frame[:, 2] - q.x.array[space.nodes]).max() < 1e-14


@pytest.mark.parallel
@every_cell
def test_reference_directors_are_the_normals_on_any_number_of_ranks(triangles):
    found = [
        at_nodes(space, space.function())
        for space in (directors.ShellSpace(cylinder(comm, triangles, cells=6).mesh) for comm in (COMM, MPI.COMM_SELF))
    ]
    (x, d), (x_alone, alone) = found
    assert np.abs(x - x_alone).max() < 1e-14 and np.abs(d - alone).max() < 1e-14
    exact = x * [1, 0, 1] / np.linalg.norm(x * [1, 0, 1], axis=1, keepdims=True)
    off = np.abs(d - exact).max(axis=1)
    inside = (x[:, 0] > 1e-6) & (x[:, 2] > 1e-6)
    # half of a cell's turn at the rim of flat cells, and less inside; quadratic cells are better
    assert off[inside].max() < (1e-2 if triangles else 1e-9)
    assert off.max() < (1e-2 if triangles else np.pi / 24 + 1e-3)


@pytest.mark.parallel(first=1)
@every_cell
def test_a_director_given_whole_is_led_there(triangles):
    """Whatever way it goes from the last commit, up to half a turn."""
    domain = cylinder(triangles=triangles)
    space = directors.ShellSpace(domain.mesh)
    conditions, move = supports.grip(domain, space, "top")
    fixed = space.supports(conditions)
    q, y = space.function(), fem.Function(space.W)
    space.turn(y, q)
    nodes = supports._at(domain, "top", (space.V.sub(1), space.normal.function_space))[0]
    for angle in (2.5, 5.0, -0.5, -0.5 + 0.999 * np.pi):
        move((0.0, 0.0, 0.0), (0.0, angle, 0.0))
        values = space.targets(conditions, y)
        y.x.array[space.angles] = values[space.angles]
        space.turn(y, q)
        space.commit(y)
        # normals at the top are those of the first cell alone, and turn with the grip
        start = space.function().x.array[nodes].reshape(-1, 3)
        c, s = np.cos(angle), np.sin(angle)
        goal = start @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
        assert np.abs(q.x.array[nodes].reshape(-1, 3) - goal).max(initial=0) < 1e-14 * 10
    # both angles and all displacements of its nodes
    owned = COMM.allreduce(len(fixed))
    assert owned == (5 * 3 if not triangles else 3 * 5 + 2 * 2)


@pytest.mark.parallel(first=1)
@every_cell
def test_a_director_in_a_plane_of_symmetry_turns_in_it_alone(triangles):
    domain = cylinder(triangles=triangles)
    space = directors.ShellSpace(domain.mesh)
    conditions = supports.symmetry(domain, space, "top", 0)
    fixed = space.supports(conditions)
    nodes = supports._at(domain, "top", space.V.sub(1).sub(0))
    q = space.function()
    # the mean of the normals on one side has been moved into the plane, reference and all
    assert np.abs(q.x.array[nodes]).max(initial=0) < 1e-16
    _, dofs = space.V.sub(1).collapse()
    assert np.abs(q.x.array[dofs[0]] - space.normal.x.array).max() == 0
    y = angles(space, 2.0)
    y.x.array[fixed] = 0.0
    y.x.scatter_forward()
    space.turn(y, q)
    assert np.abs(q.x.array[nodes]).max(initial=0) < 1e-15
    assert np.abs(np.linalg.norm(q.x.array[space.nodes], axis=1) - 1).max() < 1e-14
    assert COMM.allreduce(len(fixed)) == (3 + 3 if not triangles else 5 + 2)


def test_a_director_in_two_planes_of_symmetry_is_fixed():
    domain = cylinder(MPI.COMM_SELF, triangles=0)
    space = directors.ShellSpace(domain.mesh)
    conditions = supports.symmetry(domain, space, "top", 0) + supports.symmetry(domain, space, "middle", 1)
    fixed = space.supports(conditions)
    corner = np.flatnonzero((space.frame[:, 2] == [0, 0, 1]).all(axis=1))
    assert np.isin(space.angles[corner], fixed).all(axis=1).sum() == 1
    q, y = space.function(), fem.Function(space.W)
    assert not space.targets(conditions, y)[space.angles].any()
    space.turn(y, q)
    assert np.abs(q.x.array[space.nodes] - space.frame[:, 2]).max() == 0


@pytest.mark.parallel
def test_what_cannot_be_a_shell_is_named_on_every_rank():
    with pytest.raises(InputError, match="surface mesh in space"):
        directors.ShellSpace(scenes.grid(COMM))
    domain = cylinder(triangles=0)
    with pytest.raises(InputError, match="'regge' is not one for quadrilaterals, which are: mitc4, q1"):
        directors.ShellSpace(domain.mesh, "regge")
    curved = meshing.read(scenes.MESHES / "cylinder.geo", COMM, nx=2, ny=2, triangles=0, order=2)
    with pytest.raises(InputError, match="order 1 at most"):
        directors.ShellSpace(curved.mesh)
    # the directors of this edge lie in the plane across x, not in that across z
    space = directors.ShellSpace(domain.mesh)
    with pytest.raises(InputError, match="plane"):
        space.supports(supports.symmetry(domain, space, "top", 2))


def test_cells_of_opposite_orientation_are_refused():
    flat = mesh.create_rectangle(MPI.COMM_SELF, [(0, 0), (1, 1)], (3, 3))  # DOLFINx's triangles are of both
    x = np.column_stack([flat.geometry.x[:, :2], np.zeros(len(flat.geometry.x))])
    cells = flat.geometry.dofmaps[0].astype(np.int64)
    domain = mesh.create_mesh(MPI.COMM_SELF, cells, basix.ufl.element("Lagrange", "triangle", 1, shape=(3,)), x)
    with pytest.raises(InputError, match="opposite"):
        directors.ShellSpace(domain)
