"""The elements of the shell: rigid motions, patch tests, tangents, zero-energy modes."""

import functools

import basix
import numpy as np
import pytest
import scipy.sparse
import ufl
from mpi4py import MPI
from dolfinx import fem, mesh
from motions import SQUARE
from shells import STIFFNESS, H, Shell, surface

from fabric_fenicsx import sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.shell import assumed_strain, directors
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import hook, weakform
from fabric_fenicsx.terms.work import InternalWork

every_element = pytest.mark.parametrize("element", directors.ELEMENTS)
defaults = pytest.mark.parametrize("element", ["regge", "mitc4"])


@functools.cache
def patch(element, shape="flat"):
    """A Shell on skewed cells, made once: no test commits anything in it."""
    return Shell(surface(element, shape).mesh, element)


def rotation(axis, degrees):
    """Rodrigues' matrix."""
    axis = np.array(axis) / np.linalg.norm(axis)
    K, a = np.cross(np.eye(3), -axis), np.radians(degrees)
    return np.eye(3) + np.sin(a) * K + (1 - np.cos(a)) * K @ K


AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -2, 0.5))
CASES = [(element, "flat") for element in directors.ELEMENTS] + [("regge", "cylinder"), ("mitc4", "cylinder")]


@pytest.mark.parametrize(("element", "shape"), CASES)
def test_rigid_motions_of_any_size_stress_nothing(element, shape):
    """Strain, and stress over the stiffness, at every point; forces over those of a small strain."""
    shell = patch(element, shape)
    scale = np.abs(shell.force(shell.place(lambda x: 1e-3 * x, lambda x, n: n))).max() / 1e-3
    stiff = np.abs(shell.fabric.law.elastic(STIFFNESS)).max(axis=1)
    for axis in AXES:
        for degrees in (0, 10, 90, 170):
            R = rotation(axis, degrees)
            values = shell.place(lambda x, R=R: R @ x - x + [[0.3], [-2.0], [0.7]], lambda x, n, R=R: R @ n)
            force = shell.force(values)
            assert np.abs(force).max() < 1e-10 * scale
            strain, shear = shell.strains(values)
            assert max(np.abs(strain * [1, 1, 1, H, H, H]).max(), np.abs(shear).max()) < 1e-12
            assert np.abs(shell.stress / stiff).max() < 1e-10


def test_what_varies_of_the_shear_of_a_curved_triangle_counts_more_and_a_rigid_motion_costs_nothing():
    """By up to 3 where cells are as wide as the sheet is thick, and not at all where it is flat or thin."""
    shell = Shell(surface("regge", "cylinder").mesh, "regge", thickness=0.1)
    points, _ = basix.make_quadrature(basix.CellType.triangle, directors.DEGREE)

    def factor_of(shell):
        cells = np.arange(shell.space.mesh.topology.index_map(2).size_local, dtype=np.int32)
        return fem.Expression(shell.variation, points).eval(shell.space.mesh, cells)

    factor, thin = factor_of(shell), factor_of(patch("regge", "cylinder"))
    assert 1.5 < factor.min() and factor.max() < np.sqrt(10)
    assert patch("regge").variation == 1.0
    assert 1.0 < thin.min() and thin.max() < 1.01
    R = rotation((1, -2, 0.5), 140)
    _, shear = shell.strains(shell.place(lambda x: R @ x - x, lambda x, n: R @ n))
    assert np.abs(shear).max() < 1e-13
    # on flat cells, small: the mean is the same, and what varies is three times as much
    shell = patch("regge")
    shell.q.x.array[:] += 1e-7 * np.random.default_rng(4).standard_normal(len(shell.q.x.array))
    cells = np.arange(len(shell.fabric.strain), dtype=np.int32)
    once, thrice = (
        fem.Expression(assumed_strain.shell_strains(shell.space, shell.q, (1, 0.3, 0.2), factor)[1], points)
        .eval(shell.space.mesh, cells)
        .reshape(len(cells), -1, 2)
        for factor in (1.0, 3.0)
    )
    mean = once.mean(axis=1, keepdims=True)
    assert np.abs(thrice - mean - 3 * (once - mean)).max() < 1e-6 * np.abs(once).max()


def inner(shell):
    """Unknowns of V of nodes that are not on the rim."""
    domain, V = shell.space.mesh, shell.space.V
    domain.topology.create_connectivity(1, 2)
    rim = mesh.exterior_facet_indices(domain.topology)
    dofs = [fem.locate_dofs_topological(V.sub(i).sub(k), 1, rim) for i in (0, 1) for k in range(3)]
    return np.setdiff1d(np.arange(len(shell.q.x.array)), np.concatenate(dofs))


def in_axes(E):
    """Strain (E11, E22, 2 E12) in the axes of the fabric, the warp along (1, 0.3)."""
    a = np.array([1.0, 0.3]) / np.hypot(1.0, 0.3)
    b = np.array([-a[1], a[0]])
    return np.array([a @ E @ a, b @ E @ b, 2 * a @ E @ b])


@pytest.mark.parametrize("degrees", [0, 90, 170])
@every_element
def test_a_homogeneous_strain_is_exact_on_skewed_cells(element, degrees):
    """Finite stretch and shear in the plane, then any turn: strain and stress at every point, balance at every node."""
    shell, R = patch(element), rotation((1, -2, 0.5), degrees)
    U = np.array([[1.02, 0.015, 0], [-0.01, 1.01, 0], [0, 0, 1]])
    values = shell.place(lambda x: R @ U @ x - x, lambda x, n: R @ n)
    exact = np.zeros((1, 6))
    exact[0, :3] = in_axes(((U.T @ U - np.eye(3)) / 2)[:2, :2])
    law = shell.fabric.law
    resultants = law.respond(exact, law.initial_state[None])[0]
    force = shell.force(values)
    strain, shear = shell.strains(values)
    assert np.abs(strain - exact).max() < 1e-12 / H and np.abs(strain - exact)[..., :3].max() < 1e-13
    assert np.abs(shear).max() < 1e-13
    assert np.abs(shell.stress - resultants)[..., :3].max() < 1e-10 * np.abs(resultants).max()
    assert np.abs(force[inner(shell)]).max() < 1e-10 * np.abs(force).max()


@every_element
def test_a_homogeneous_curvature_is_exact_on_skewed_cells(element):
    """A small bending and twist is exact at every point and balanced at every node inside.

    Not balanced in "q1": on a cell that is no parallelogram, the gradient of its deflection in the middle is not
    the mean of its directors, and it shears.
    """
    shell, space = patch(element), patch(element).space
    K = np.array([[-1.0, -0.3], [-0.3, 0.4]])
    step = shell.place(
        lambda x: np.array([0 * x[0], 0 * x[0], -np.einsum("in,ij,jn->n", x[:2], K, x[:2]) / 2]),
        lambda x, n: np.concatenate([K @ x[:2], 0 * x[:1]]),
    )
    start = space.function().x.array
    # strains are quadratic in (u, d): a central difference is their derivative, whatever the step
    (strain, shear), back = shell.strains(start + step), shell.strains(start - step)
    strain, shear = (strain - back[0]) / 2, (shear - back[1]) / 2
    assert np.abs(strain - np.concatenate([np.zeros(3), in_axes(K)])).max() < 1e-12
    force = shell.stiffness() @ step
    balanced = np.abs(force[inner(shell)]).max() < 1e-10 * np.abs(force).max()
    sheared = np.abs(shear).max() > 1e-12
    assert (balanced, sheared) == ((False, True) if element == "q1" else (True, False))


@pytest.mark.parametrize(("element", "shape"), CASES)
def test_batches_of_cells_are_the_forms(element, shape):
    """Strains at the points and forces, far from rest, against FFCx's kernels of the same UFL."""
    shell = patch(element, shape)
    rng = np.random.default_rng(1)
    start = shell.space.function().x.array
    values = start + rng.uniform(-0.02, 0.02, len(start))
    force = shell.force(values)
    form, (law,) = hook.plain(shell.work.form)
    assert law.evaluate()
    strain = law.points.strain
    assert np.abs(strain - shell.fabric.strain).max() < 1e-12 * np.abs(strain).max()
    expected = fem.assemble_vector(fem.form(form)).array
    assert np.abs(force - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("degrees", [0, 90, 170])
@defaults
def test_the_tangent_is_exact_with_the_woven_law_at_any_turn(element, degrees):
    """r(y + t z) - r(y) - t J z falls with t^2, in the unknowns (u, theta) of the solver, under a pressure."""
    shell = patch(element)
    space = shell.space
    u, v = ufl.split(shell.q)[0], ufl.split(ufl.TestFunction(space.V))[0]
    # stiffness of the sheet in batches, of its load from UFL
    load = weakform.pressure(fem.Constant(space.mesh, 1e5), u, v, space.dx)
    solver = statics.StaticSolver([shell.work, -load], shell.q, [], space=space)
    x = solver.begin()
    R, rng = rotation((1, -2, 0.5), degrees), np.random.default_rng(degrees)
    # drawn enough that no layer of no point comes upon a kink of the law
    U = np.array([[1.02, 0.03, 0], [0, 1.02, 0], [0, 0, 1]])
    # the directors of a rigid turn by two angles, then noise
    y = fem.Function(space.W)
    frame, d = space.frame, space.frame[:, 2] @ R.T
    along = np.einsum("nij,nj->ni", frame, d)
    sine = np.linalg.norm(along[:, :2], axis=1)
    y.x.array[space.angles] = along[:, :2] * (np.arctan2(sine, along[:, 2]) / np.maximum(sine, 1e-12))[:, None]
    part, dofs = space.W.sub(0).collapse()
    u = fem.Function(part)
    u.interpolate(lambda x: R @ U @ x - x)
    y.x.array[dofs[0]] = u.x.array
    start = y.x.array + 2e-4 * rng.standard_normal(len(y.x.array))
    z = 1e-5 * rng.standard_normal(len(start))

    def residual(t):
        x.array[:] = start + t * z
        return solver.residual(x).array.copy()

    r = residual(0.0)
    A, _ = solver.factorised().getOperators()
    change, step = A.createVecLeft(), A.createVecRight()
    step.array[:] = z
    A.mult(step, change)
    sizes = 2.0 ** -np.arange(5)
    errors = [np.linalg.norm(residual(t) - r - t * change.array) for t in sizes]
    orders = np.diff(np.log(errors)) / np.diff(np.log(sizes))
    assert np.median(orders) == pytest.approx(2, abs=0.1)
    assert errors[-1] < 1e-3 * np.linalg.norm(sizes[-1] * change.array)


def test_a_strain_that_is_not_quadratic_has_no_batches():
    shell = patch("q1")
    u, _ = ufl.split(shell.q)
    cubic = ufl.as_vector([ufl.dot(u, u) * u[2], u[0]])
    part = cubic, fem.Constant(shell.space.mesh, np.eye(2)), shell.space.dx
    with pytest.raises(InputError, match="not quadratic"):
        InternalWork(shell.space, shell.q, [part])


@pytest.mark.parametrize("stiffness", [[[1.0, 0.1], [0.0, 1.0]], [[1.0, 0.0], [0.0, -1.0]]])
def test_a_linear_stiffness_that_makes_energy_has_no_batches(stiffness):
    shell = patch("mitc4")
    across, _, dx = shell.work.parts[1]
    with pytest.raises(InputError, match="not symmetric, or negative"):
        InternalWork(shell.space, shell.q, [(across, fem.Constant(shell.space.mesh, np.array(stiffness)), dx)])


def one_cell(element):
    """A Shell of one triangle or quadrilateral of no symmetry, about as large as those of `patch`."""
    kind = directors.ELEMENTS[element][0]
    x = 0.3 * np.array([[0, 0, 0], [1, 0.1, 0], [0.2, 0.9, 0], [1.3, 1.1, 0]])[: 3 if kind == "triangle" else 4]
    shape = basix.ufl.element("Lagrange", kind, 1, shape=(3,))
    return Shell(mesh.create_mesh(MPI.COMM_SELF, np.arange(len(x))[None], shape, x), element)


def modes(shell, pinned=False):
    """Eigenvalues of the energy at rest in (u, H theta), ascending.

    They are those of a plate whose nodes have equal masses, 1 per area, and whose bending stiffness is 1 along the
    weft: squares of frequencies.
    """
    solver, space = shell.free, shell.space
    solver.restore()
    solver.residual(solver.begin())
    A, _ = solver.factorised().getOperators()
    indptr, indices, entries = A.getValuesCSR()
    K = scipy.sparse.csr_array((entries, indices, indptr)).toarray()
    K = (K + K.T) / 2  # the law's tangent is not symmetric
    scale = np.ones(len(K))
    scale[space.angles] = 1 / H
    part, dofs = space.W.sub(0).collapse()
    x, free = part.tabulate_dof_coordinates(), np.arange(len(K))
    if pinned:
        corner = np.flatnonzero((np.abs(x[:, 0] / 1.2 - 0.5) > 0.499) & (np.abs(x[:, 1] / 0.9 - 0.5) > 0.499))
        assert len(corner) == 4
        free = np.setdiff1d(free, np.array(dofs[0]).reshape(-1, 3)[corner])
    area = fem.assemble_scalar(fem.form(fem.Constant(space.mesh, 1.0) * space.dx))
    values = np.linalg.eigvalsh((K * scale * scale[:, None])[np.ix_(free, free)])
    return values * len(x) / area / (STIFFNESS[1, 1] * H**3 / 12)


@pytest.mark.parametrize("scene", ["one", "sheet", "pinned"])
@every_element
def test_only_rigid_motions_cost_no_energy(element, scene):
    """One free cell, a free sheet of skewed cells, and the same held at its four corners.

    The softest mode of the last is the first of a plate on four points: 6.8 with triangles, 8.5 with
    quadrilaterals. "q1" has two more modes of no energy in one cell, of which one is left in a sheet: nodes go up
    and down by turns. Pins at the corners do not stop it where a rigid motion brings them back.
    """
    values = modes(one_cell(element) if scene == "one" else patch(element), scene == "pinned")
    free = np.count_nonzero(np.abs(values) < 1e-12 * values[-1])
    assert free == (0 if scene == "pinned" else 6) + (element == "q1") * (2 if scene == "one" else 1)
    assert values[free] > 5
    if scene == "pinned" and element in ("regge", "mitc4"):
        assert values[0] < 9


def test_a_cell_of_mitc4_bends_in_its_plane_without_shear():
    """u = (x y, -x^2 / 2) at the nodes of rectangles: E11 is y and E12 nothing, which bilinear strains miss."""
    for element in ("mitc4", "q1"):
        shell = Shell(surface(element, "flat", skew=0.0).mesh, element, warp=(1, 0, 0))
        start = shell.space.function().x.array
        step = shell.place(lambda x: 1e-3 * np.array([x[0] * x[1], -(x[0] ** 2) / 2, 0 * x[0]]), lambda x, n: 0 * n)
        strain = (shell.strains(start + step)[0] - shell.strains(start - step)[0]) / 2e-3
        points, _ = basix.make_quadrature(shell.space.mesh.basix_cell(), directors.DEGREE)
        y = fem.Expression(ufl.SpatialCoordinate(shell.space.mesh)[1], points)
        y = y.eval(shell.space.mesh, np.arange(len(strain), dtype=np.int32))
        assert np.abs(strain[:, :, 0] - y).max() < 1e-10
        sheared = np.abs(strain[:, :, 2]).max()
        assert sheared < 1e-10 if element == "mitc4" else sheared > 0.08


def test_shear_is_limited_by_the_modulus_with_which_a_sheet_bends():
    """Cells of 0.1 m, 1 mm thick: 5/6 h^3 G / (h^2 + 0.1 A G/B), with B = E/2/(1 + nu) of the stiffest yarn."""
    domain = meshing.read(SQUARE, MPI.COMM_SELF, gdim=3, side=0.2, n=2)
    E, nu, G, h = 4e8, 0.2, 1e6, 1e-3
    law = StVenantKirchhoff(E / (1 - nu**2 / 4) * np.array([[1.0, nu / 4, 0], [nu / 4, 0.25, 0], [0, 0, 0.01]]))
    cloth = sheet.Sheet(domain, law, h, (G, G / 2))
    B = E / (1 - nu**2 / 4) * (1 - nu / 2) / 2
    for k, own in enumerate((G, G / 2)):
        tilted = np.eye(3)[2] + 1e-3 * np.eye(3)[k]
        cloth.q.sub(1).interpolate(lambda x, d=tilted: d[:, None] + 0 * x)
        stiffness = 2 * fem.assemble_scalar(fem.form(cloth.stored)) / (1e-6 * 0.04)
        assert stiffness == pytest.approx(5 / 6 * h**3 * own / (h**2 + 0.1 * 0.01 * own / B), rel=1e-9)
