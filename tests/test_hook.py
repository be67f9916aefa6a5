"""The external operator against plain UFL, against differences, and its history."""

import warnings

import numpy as np
import pytest
import scenes
import ufl
from mpi4py import MPI
from dolfinx import fem, mesh

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.shell import kinematics
from fabric_fenicsx.surfaces import yarns
from fabric_fenicsx.terms import hook, weakform

COMM = MPI.COMM_WORLD
FIRST = StVenantKirchhoff.orthotropic(9e6, 28e6, 0.2, 1.5e6)
SECOND = StVenantKirchhoff([[5e6, 2e6, 0.4e6], [-1e6, 3e6, 0.2e6], [0.1e6, 0.7e6, 2e6]])


def vector(form):
    """An assembled residual."""
    return fem.assemble_vector(fem.form(form)).array


def matrix(form):
    """An assembled Jacobian, dense."""
    return fem.assemble_matrix(fem.form(form)).to_scipy().toarray()


def compare(u, ours, plain, hooks):
    """Assert that both residuals and their Jacobians are the same, without boundary conditions."""
    ours, jacobian, found = hook.derive(ours, u)
    assert set(found) == set(hooks)
    assert all([fabric.evaluate() for fabric in hooks])
    for mine, other, assemble in ((ours, plain, vector), (jacobian, ufl.derivative(plain, u), matrix)):
        mine, other = assemble(mine), assemble(other)
        assert np.abs(mine - other).max() <= 1e-12 * np.abs(other).max()


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_the_hook_is_plain_ufl_for_an_elastic_law(cell, degree):
    domain = scenes.grid(MPI.COMM_SELF, cell, (3, 2), skew=0.2)
    V = scenes.space(domain, degree)
    u, v = scenes.random(fem.Function(V), 0.02), ufl.TestFunction(V)
    strain = kinematics.membrane_strain(u, yarns.plane_axes(domain, 0.4))
    h = fem.Constant(domain, 1e-3)
    for law in (FIRST, SECOND):
        fabric = hook.LawHook(law, strain, domain, 2 * degree)
        elastic = weakform.elastic_stress(domain, law.stiffness, strain)
        compare(u, *(weakform.internal(s, strain, u, v, h, fabric.dx) for s in (fabric.stress, elastic)), [fabric])


def test_two_hooks_one_of_them_in_two_terms_are_plain_ufl():
    """Two laws on rules and axes of their own, beside a term without a hook."""
    domain = scenes.grid(MPI.COMM_SELF, "triangle", (3, 2), skew=0.2)
    V = scenes.space(domain)
    u, v = scenes.random(fem.Function(V), 0.02), ufl.TestFunction(V)
    halves = mesh.meshtags(domain, 2, np.arange(12, dtype=np.int32), np.array([1, 2] * 6, dtype=np.int32))
    hooks, ours, plain = [], 0, 0
    for law, warp, rule in ((FIRST, 0.4, 2), (SECOND, -1.1, 3)):
        strain = kinematics.membrane_strain(u, yarns.plane_axes(domain, warp))
        hooks.append(fabric := hook.LawHook(law, strain, domain, rule))
        elastic = weakform.elastic_stress(domain, law.stiffness, strain)
        terms = [(1e-3, fabric.dx(1, subdomain_data=halves)), (4e-3, fabric.dx(2, subdomain_data=halves))]
        for h, dx in terms if law is FIRST else [(2e-3, fabric.dx)]:
            ours += weakform.internal(fabric.stress, strain, u, v, h, dx)
            plain += weakform.internal(elastic, strain, u, v, h, dx)
    force = weakform.body_force(ufl.as_vector([1e4, -2e4]), v, 1e-3, hooks[0].dx)
    compare(u, ours - force, plain - force, hooks)


def test_the_terms_of_the_weak_form_are_forces():
    domain = scenes.grid(MPI.COMM_SELF, size=(0.4, 0.3), skew=0.2)
    V = scenes.space(domain)
    v, f = ufl.TestFunction(V), ufl.as_vector([3.0, -2.0])
    body = fem.assemble_vector(fem.form(weakform.body_force(f, v, 0.5, ufl.dx(domain)))).array
    edge = fem.assemble_vector(fem.form(weakform.traction(f, v, ufl.ds(domain)))).array
    assert body.reshape(-1, 2).sum(0) == pytest.approx(np.array([3.0, -2.0]) * 0.5 * 0.4 * 0.3)
    assert edge.reshape(-1, 2).sum(0) == pytest.approx(np.array([3.0, -2.0]) * 2 * (0.4 + 0.3))


def orders(law, past=None):
    """Orders of the Taylor remainder of the assembled residual, over halved steps."""
    domain = scenes.grid(MPI.COMM_SELF, "quadrilateral", (3, 2), skew=0.2)
    warp = fem.Function(fem.functionspace(domain, ("DG", 0)))
    warp.x.array[:] = np.linspace(-1.5, 1.5, len(warp.x.array))
    V = scenes.space(domain)
    u, v, way = fem.Function(V), ufl.TestFunction(V), scenes.random(fem.Function(V), 1e-2, seed=3)
    strain = kinematics.membrane_strain(u, yarns.plane_axes(domain, warp))
    fabric = hook.LawHook(law, strain, domain, 2)
    residual = weakform.internal(fabric.stress, strain, u, v, fem.Constant(domain, 1.0), fabric.dx)
    residual, jacobian = (fem.form(f) for f in hook.derive(residual, u)[:2])

    def stretched(by):
        scenes.random(u, 2e-4)
        at = fem.Function(V)
        at.interpolate(lambda x: by * x[:2])
        u.x.array[:] += at.x.array

    if past is not None:
        stretched(past)
        fabric.evaluate()
        fabric.points.commit()
    stretched(0.05)
    start = u.x.array.copy()
    fabric.evaluate()
    at = fem.assemble_vector(residual).array.copy()
    slope = fem.assemble_matrix(jacobian).to_scipy() @ way.x.array
    remainders = []
    for step in 1e-4 * 0.5 ** np.arange(5):
        u.x.array[:] = start + step * way.x.array
        fabric.evaluate()
        remainders.append(np.linalg.norm(fem.assemble_vector(residual).array - at - step * slope))
    return np.log2(np.array(remainders[:-1]) / remainders[1:])


@pytest.mark.parametrize("past", [None, 0.03, 0.0504, 0.06], ids=["virgin", "loading", "ramp", "slack"])
@pytest.mark.parametrize("name", ["duck", "blend"])
def test_the_jacobian_is_the_derivative_of_the_residual_woven(name, past):
    assert orders(Woven(fabrics.load(name)), past).min() > 1.9


def test_the_jacobian_is_the_derivative_of_the_residual_and_not_its_transpose():
    assert orders(scenes.Toy()).min() > 1.9
    for law in (scenes.Toy(), Woven(fabrics.load("duck"))):
        assert orders(scenes.Transposed(law)).max() < 1.1


def parts(law, degree=2):
    """A displaced sheet: u, hook, residual."""
    domain = scenes.grid(COMM)
    V = scenes.space(domain)
    u, v = scenes.random(fem.Function(V), 1e-3), ufl.TestFunction(V)
    strain = kinematics.membrane_strain(u, yarns.plane_axes(domain, 0.3))
    fabric = hook.LawHook(law, strain, domain, degree)
    return u, fabric, weakform.internal(fabric.stress, strain, u, v, fem.Constant(domain, 1.0), fabric.dx)


def test_a_tangent_that_ufl_loses_is_noticed(monkeypatch):
    u, _, residual = parts(FIRST)
    monkeypatch.setattr(hook, "expand_derivatives", lambda form: form)
    with pytest.raises(RuntimeError, match="does not hold the tangent"):
        hook.derive(residual, u)


def test_the_rule_must_not_be_empty_and_one_point_is_enough():
    with pytest.raises(InputError, match="at least 1, not 0"):
        parts(FIRST, degree=0)
    u, fabric, residual = parts(FIRST, degree=1)
    residual, jacobian, _ = hook.derive(residual, u)
    assert fabric.points.strain.shape[1] == 1
    assert fabric.evaluate()
    tangent = next(c for c in jacobian.coefficients() if c.x.array.size == 9 * len(fabric.points.strain))
    assert np.array_equal(tangent.x.array.reshape(-1, 3, 3)[0], FIRST.stiffness)


def test_the_same_hook_serves_two_solvers():
    u, fabric, residual = parts(FIRST)
    jacobians = [hook.derive(residual, u)[1] for _ in range(2)]
    fabric.evaluate()
    first, second = (matrix(j) for j in jacobians)
    assert np.abs(first).max() > 0
    assert np.array_equal(first, second)


@pytest.mark.parallel
def test_evaluation_is_pure_and_only_a_commit_moves_the_past():
    u, fabric, residual = parts(Woven(fabrics.load("muslin")))
    hook.derive(residual, u)
    stress = fabric.stress.ref_coefficient.x.array
    for _ in range(2):
        before = fabric.points.history.committed.copy()
        fabric.evaluate()
        first = stress.copy(), fabric.points.history.trial.copy()
        u.x.array[:] *= -2
        fabric.evaluate()
        assert not np.array_equal(stress, first[0])
        assert not np.array_equal(fabric.points.history.trial, first[1])
        u.x.array[:] /= -2
        fabric.evaluate()
        assert np.array_equal(stress, first[0])
        assert np.array_equal(fabric.points.history.trial, first[1])
        assert np.array_equal(fabric.points.history.committed, before)
        fabric.points.commit()
        assert np.array_equal(fabric.points.history.committed, first[1])
        u.x.array[:] *= 1.5


@pytest.mark.parallel
def test_strain_beyond_calibration_is_said_once_per_hook_and_not_before_it_is_accepted(recwarn):
    domain = scenes.grid(COMM, cells=(2, 2))
    V = scenes.space(domain)
    for _ in range(2):
        u = fem.Function(V)
        strain = kinematics.membrane_strain(u, yarns.plane_axes(domain, 0.0))
        fabric = hook.LawHook(Woven(fabrics.load("duck")), strain, domain, 2)
        for by, commit, expected in [(0.05, 1, 0), (0.5, 0, 0), (0.05, 1, 0), (0.2, 1, 1), (0.3, 1, 0)]:
            u.interpolate(lambda x, by=by: by * x[:2])
            recwarn.clear()
            warnings.simplefilter("always")
            fabric.evaluate()
            if commit:
                fabric.points.commit()
            assert len(recwarn) == (expected if COMM.rank == 0 else 0)
            if len(recwarn):
                assert "duck: warp strain E11 = 0.220 is beyond" in str(recwarn[0].message)


@pytest.mark.parallel
def test_a_rank_without_cells_takes_part():
    """One cell on all ranks: the others have ghosts of it, or nothing."""
    scene = scenes.rim(scenes.grid(COMM, cells=(1, 1)), Woven(fabrics.load("duck")), [[1, 0], [0, 0]])
    scene.pull(0.1)
    scene.solver.solve()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene.solver.commit()
    right = scene.solver.reaction(scenes.side(scene.u, 0, lambda x: x[0] > 0.39))
    stress = Woven(fabrics.load("duck")).respond(np.array([[0.105, 0, 0]]), scene.fabric.law.initial_state[None])[0]
    assert right == pytest.approx(1.1 * stress[0, 0] * 0.3 * scenes.THICKNESS, rel=1e-10)
    assert np.isfinite(max(COMM.allgather(scene.fabric.worst()))[0])


@pytest.mark.parallel
@pytest.mark.parametrize("bad", ["stress", "strain"])
def test_the_worst_point_is_the_one_that_is_not_finite_or_the_most_strained(bad):
    _, fabric, _ = parts(FIRST)
    fabric.evaluate()
    size, where = max(COMM.allgather(fabric.points.worst()))
    owned = fabric.points.mesh.topology.index_map(2).size_local
    assert size == pytest.approx(COMM.allreduce(np.abs(fabric.points.strain[:owned]).max(), MPI.MAX))
    # cell 7 of the input is somebody's; the smallest strain there is as bad as can be if it is not a number
    number = fabric.points.mesh.topology.original_cell_index[:owned]
    middle = np.zeros(3)
    for cell in np.flatnonzero(number == 7):
        if bad == "strain":
            fabric.points.strain[cell, 2, 1] = np.nan
        else:
            fabric.stress.ref_coefficient.x.array.reshape(-1, 4, 3)[cell, 2, 1] = np.inf
        middle = mesh.compute_midpoints(fabric.points.mesh, 2, np.array([cell], dtype=np.int32))[0]
    middle = COMM.allreduce(middle)
    size, where = max(COMM.allgather(fabric.points.worst()))
    assert size == np.inf
    assert where.startswith(f"cell 7 at ({middle[0]:.4g}, {middle[1]:.4g}) m, point 2: strain (")
