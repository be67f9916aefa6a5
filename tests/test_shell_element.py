"""The elements of the shell: rigid motions, patch tests, tangents, zero-energy modes, orders of convergence."""

from dataclasses import dataclass

import basix
import numpy as np
import pytest
import scenes
import ufl
from mpi4py import MPI
from dolfinx import fem, mesh

from fabric_fenicsx import assumed_strain, directors, fabrics, hook, meshing, statics, weakform
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven

COMM = MPI.COMM_WORLD
H = 0.05
LAW = StVenantKirchhoff(np.array([[1.0, 0.3, 0.05], [0.3, 0.7, -0.02], [0.05, -0.02, 0.4]]))
every_element = pytest.mark.parametrize("element", directors.ELEMENTS)
defaults = pytest.mark.parametrize("element", ["regge", "mitc4"])


def surface(element, shape, cells=(4, 3), skew=0.25, comm=MPI.COMM_SELF):
    """A strip 1.2 x 0.9 ("flat"), or a quarter of a cylinder of radius 1, 0.9 wide; nodes moved within it."""
    triangles = int(directors.ELEMENTS[element][0] == "triangle")
    numbers = {"nx": cells[0], "ny": cells[1], "triangles": triangles, "length": 0.9}
    if shape == "flat":
        domain = meshing.read(scenes.MESHES / "strip.geo", comm, **numbers | {"length": 1.2, "width": 0.9})
    else:
        domain = meshing.read(scenes.MESHES / "cylinder.geo", comm, **numbers, order=1 + triangles)
    x = domain.mesh.geometry.x
    s = x[:, 0] / 1.2 if shape == "flat" else np.arctan2(x[:, 0], x[:, 2]) / (np.pi / 2)
    t = x[:, 1] / 0.9
    # a quarter of a cell at most, and nothing on the rim
    wave = np.sin(7 * s + 11 * t) * s * (1 - s) * t * (1 - t) * 16
    s, t = s + skew / cells[0] * wave, t - skew / cells[1] * wave * np.cos(5 * t - 6 * s)
    if shape == "flat":
        x[:, 0], x[:, 1] = 1.2 * s, 0.9 * t
    else:
        x[:, 0], x[:, 1], x[:, 2] = np.sin(np.pi / 2 * s), 0.9 * t, np.cos(np.pi / 2 * s)
    return domain


@dataclass
class Shell:
    """An element's strains with a law, on a mesh."""

    space: directors.ShellSpace
    q: fem.Function
    operands: tuple
    fabric: hook.LawHook
    residual: ufl.Form

    def __init__(self, domain, element, law=LAW, thickness=H, warp=(1.0, 0.3, 0.2)):
        self.space = space = directors.ShellSpace(domain, element)
        self.q, test = space.function(), ufl.TestFunction(space.V)
        self.operands = strain, shear = assumed_strain.shell_strains(space, self.q, warp)
        self.fabric = hook.LawHook(Section(law, thickness, 3), strain, domain, directors.DEGREE)
        stiffness = weakform.shear_stiffness(domain, (0.4, 0.3), fem.Constant(domain, thickness))
        self.residual = weakform.internal(self.fabric.stress, strain, self.q, test, 1.0, space.dx)
        self.residual += weakform.internal(ufl.dot(stiffness, shear), shear, self.q, test, 1.0, space.dx_shear)

    def solver(self, bcs=()):
        return statics.StaticSolver(self.residual, self.q, bcs, [self.fabric], space=self.space)

    def place(self, displacement, director):
        """Set u from x, and d from x and the reference directors; both (3, n)."""
        for i, value in enumerate((displacement, director)):
            part, dofs = self.space.V.sub(i).collapse()
            f = fem.Function(part)
            if i == 0:
                f.interpolate(value)
            else:
                x = part.tabulate_dof_coordinates()
                f.x.array[:] = value(x.T, self.space.normal.x.array.reshape(-1, 3).T).T.ravel()
            self.q.x.array[dofs[0]] = f.x.array

    def strains(self, direction=None):
        """Strain and curvature (cells, points, 6), shear (cells, points, 2), or their derivatives by q."""
        cell, space = self.space.mesh.basix_cell(), self.space
        n = space.mesh.topology.index_map(2).size_local
        result = []
        for operand, degree in zip(self.operands, (directors.DEGREE, space.shear_degree), strict=True):
            points, _ = basix.make_quadrature(cell, degree)
            value = operand if direction is None else ufl.derivative(operand, self.q, direction)
            expression = fem.Expression(ufl.algorithms.expand_derivatives(value), points)
            values = expression.eval(space.mesh, np.arange(n, dtype=np.int32))
            result.append(values.reshape(n, len(points), -1))
        return result


def rotation(axis, degrees):
    """Rodrigues' matrix."""
    axis = np.array(axis) / np.linalg.norm(axis)
    K, a = np.cross(np.eye(3), -axis), np.radians(degrees)
    return np.eye(3) + np.sin(a) * K + (1 - np.cos(a)) * K @ K


AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -2, 0.5))


@pytest.mark.parametrize("shape", ["flat", "cylinder"])
@every_element
def test_rigid_motions_of_any_size_strain_nothing(element, shape):
    shell = Shell(surface(element, shape).mesh, element)
    form = fem.form(hook.derive(shell.residual, shell.q, (shell.fabric,))[0])
    for axis in AXES:
        for degrees in (0, 90, 170):
            R = rotation(axis, degrees)
            shell.place(lambda x, R=R: R @ x - x + [[0.3], [-2.0], [0.7]], lambda x, n, R=R: R @ n)
            assert max(np.abs(values).max() for values in shell.strains()) < 1e-12
            assert shell.fabric.evaluate()
            assert np.abs(fem.assemble_vector(form).array).max() < 1e-13


def inner(shell):
    """Unknowns of V of nodes that are not on the rim."""
    domain, V = shell.space.mesh, shell.space.V
    domain.topology.create_connectivity(1, 2)
    rim = mesh.exterior_facet_indices(domain.topology)
    dofs = [fem.locate_dofs_topological(V.sub(i).sub(k), 1, rim) for i in (0, 1) for k in range(3)]
    return np.setdiff1d(np.arange(len(shell.q.x.array)), np.concatenate(dofs))


@pytest.mark.parametrize("mode", ["membrane", "bending"])
@every_element
def test_homogeneous_states_on_skewed_cells(element, mode):
    """The patch test: a homogeneous small strain is exact at every point, and balanced at every node inside.

    Not so the curvature of "q1": on a cell that is no parallelogram, the gradient of its deflection in the
    middle is not the mean of its directors.
    """
    shell = Shell(surface(element, "flat").mesh, element)
    space, direction = shell.space, fem.Function(shell.space.V)
    if mode == "membrane":
        shell.place(lambda x: np.array([x[0] + 0.3 * x[1], 0.2 * x[0] - 0.5 * x[1], 0 * x[0]]), lambda x, n: 0 * n)
        exact = np.array([1.0, -0.5, 0.5])
    else:
        shell.place(
            lambda x: np.array([0 * x[0], 0 * x[0], x[0] ** 2 / 2 + 0.3 * x[0] * x[1] - 0.2 * x[1] ** 2]),
            lambda x, n: -np.array([x[0] + 0.3 * x[1], 0.3 * x[0] - 0.4 * x[1], 0 * x[0]]),
        )
        exact = np.array([-1.0, 0.4, -0.6])
    direction.x.array[:] = shell.q.x.array
    shell.q.x.array[:] = space.function().x.array
    strain, shear = shell.strains(direction)
    a = np.array([1.0, 0.3]) / np.hypot(1.0, 0.3)
    b, E = np.array([-a[1], a[0]]), np.array([[exact[0], exact[2] / 2], [exact[2] / 2, exact[1]]])
    expected = np.zeros(6)
    expected[:3] = a @ E @ a, b @ E @ b, 2 * a @ E @ b
    expected = expected if mode == "membrane" else np.roll(expected, 3)
    assert np.abs(strain - expected).max() < 1e-12

    _residual, jacobian = hook.derive(shell.residual, shell.q, (shell.fabric,))
    shell.fabric.evaluate()
    force = fem.assemble_vector(fem.form(ufl.action(jacobian, direction))).array
    balanced = np.abs(force[inner(shell)]).max() < 1e-10 * np.abs(force).max()
    sheared = np.abs(shear).max() > 1e-12
    assert (balanced, sheared) == ((False, True) if (element, mode) == ("q1", "bending") else (True, False))


@pytest.mark.parametrize("degrees", [0, 90, 170])
@defaults
def test_the_tangent_is_exact_with_the_woven_law_at_any_turn(element, degrees):
    """r(y + t z) - r(y) - t J z falls with t^2, in the unknowns (u, theta) of the solver."""
    fabric = fabrics.load("blend")
    shell = Shell(surface(element, "flat", cells=(2, 2)).mesh, element, Woven(fabric), thickness=5e-3)
    space, solver = shell.space, shell.solver()
    x = solver.begin()
    R, rng = rotation((1, -2, 0.5), degrees), np.random.default_rng(degrees)
    # the directors of a rigid turn by two angles, then noise
    y = fem.Function(space.W)
    frame, d = space.frame, space.frame[:, 2] @ R.T
    along = np.einsum("nij,nj->ni", frame, d)
    sine = np.linalg.norm(along[:, :2], axis=1)
    y.x.array[space._theta] = along[:, :2] * (np.arctan2(sine, along[:, 2]) / np.maximum(sine, 1e-12))[:, None]
    part, dofs = space.W.sub(0).collapse()
    u = fem.Function(part)
    u.interpolate(lambda x: R @ x - x)
    y.x.array[dofs[0]] = u.x.array
    start = y.x.array + 2e-3 * rng.standard_normal(len(y.x.array))
    z = 1e-4 * rng.standard_normal(len(start))

    def residual(t):
        x.array[:] = start + t * z
        return solver.residual(x).array.copy()

    r = residual(0.0)
    A, _ = solver.factorised().getOperators()
    change, step = A.createVecLeft(), A.createVecRight()
    step.array[:] = z
    A.mult(step, change)
    sizes = 2.0 ** -np.arange(4, 9)
    errors = [np.linalg.norm(residual(t) - r - t * change.array) for t in sizes]
    orders = np.diff(np.log(errors)) / np.diff(np.log(sizes))
    assert np.median(orders) == pytest.approx(2, abs=0.1)
    assert errors[-1] < 1e-3 * np.linalg.norm(sizes[-1] * change.array)
    # a rigid motion alone is without force, as seen from the solver
    x.array[:] = y.x.array
    assert np.abs(solver.residual(x).array).max() < 1e-9 * np.abs(r).max()


def modes(element, cells, skew, pinned=False):
    """Eigenvalues of the tangent at rest over the largest, ascending, in (u, H theta)."""
    domain = surface(element, "flat", cells, skew)
    if cells == (1, 1):
        # one cell, a triangle or a quadrilateral, of no symmetry
        kind = directors.ELEMENTS[element][0]
        x = np.array([[0, 0, 0], [1, 0.1, 0], [0.2, 0.9, 0], [1.3, 1.1, 0]])[: 3 if kind == "triangle" else 4]
        shape = basix.ufl.element("Lagrange", kind, 1, shape=(3,))
        one = mesh.create_mesh(MPI.COMM_SELF, np.arange(len(x))[None], shape, x)
    else:
        one = domain.mesh
    shell = Shell(one, element)
    solver = shell.solver()
    solver.residual(solver.begin())
    A, _ = solver.factorised().getOperators()
    K = A.convert("dense").getDenseArray().copy()
    assert np.abs(K - K.T).max() < 1e-12 * np.abs(K).max()
    scale = np.ones(len(K))
    scale[shell.space._theta] = 1 / H
    free = np.arange(len(K))
    if pinned:
        part, dofs = shell.space.W.sub(0).collapse()
        x = part.tabulate_dof_coordinates()
        corner = np.flatnonzero((np.abs(x[:, 0] / 1.2 - 0.5) > 0.499) & (np.abs(x[:, 1] / 0.9 - 0.5) > 0.499))
        assert len(corner) == 4
        free = np.setdiff1d(free, np.array(dofs[0]).reshape(-1, 3)[corner])
    values = np.linalg.eigvalsh((K * scale * scale[:, None])[np.ix_(free, free)])
    return values / values[-1]


@pytest.mark.parametrize("scene", ["one", "sheet", "pinned"])
@every_element
def test_only_rigid_motions_cost_no_energy(element, scene):
    """One free cell, a free sheet of skewed cells, and the same held at its four corners.

    "q1" has two more in one cell, of which one is left in a sheet: nodes go up and down by turns. Pins stop it.
    """
    values = modes(element, (1, 1) if scene == "one" else (3, 3), 0.25, scene == "pinned")
    free = np.count_nonzero(np.abs(values) < 1e-12)
    spurious = {"one": 2, "sheet": 1, "pinned": 0}[scene] if element == "q1" else 0
    assert free == (0 if scene == "pinned" else 6) + spurious
    assert values[free] > 1e-5
