"""Arc length: paths with a known answer, through limit points, with cuts, histories and directors."""

import itertools

import numpy as np
import pytest
import scenes
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.shell import directors
from fabric_fenicsx.solvers import continuation, statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

COMM = MPI.COMM_WORLD
BLEND = fabrics.load("blend")
MODULUS = 3e6


def bar(**options):
    """A strip of SVK without contraction, on a triangle mesh; its stretch is that of the load's direction."""
    law = StVenantKirchhoff(np.diag([MODULUS, MODULUS, MODULUS / 2]))
    u, sheet, solver, draw = scenes.drawn(COMM, BLEND, law, cell="triangle", **options)

    def stretch():
        F = np.sqrt(1 + 2 * sheet.strain[..., 0]).ravel()
        low, high = COMM.allreduce(F.min(initial=9.0), MPI.MIN), COMM.allreduce(F.max(initial=0.0), MPI.MAX)
        assert high - low < 1e-9
        return high

    return u, sheet, solver, draw, stretch


@pytest.mark.parallel
def test_a_path_goes_through_the_limit_point_of_a_compressed_bar():
    """P = E (F^2 - 1) F / 2 is lowest at F = 1 / sqrt(3); no load beyond it has an answer."""
    *_, solver, draw, stretch = bar()
    loads = []
    for step in continuation.arc_length(solver, draw, -0.05 * MODULUS):
        F = stretch()
        assert step.load == pytest.approx(MODULUS * (F**2 - 1) * F / 2, abs=1e-6 * MODULUS)
        assert step.step_cuts == 0
        loads.append(step.load)
        if F < 0.35:
            break
    lowest = -MODULUS / np.sqrt(27)
    assert min(loads) == pytest.approx(lowest, rel=0.02)
    assert loads[-1] > 0.9 * lowest
    assert np.sign(np.diff(loads)).tolist() == sorted(np.sign(np.diff(loads)))


@pytest.mark.parallel
def test_steps_grow_while_newton_is_quick_and_are_no_longer_than_told():
    lengths = {}
    for longest in (np.inf, 1e-3):
        u, _, solver, draw, _ = bar()
        path = continuation.arc_length(solver, draw, 0.01 * MODULUS, longest=longest)
        before, lengths[longest] = scenes.points(u)[1], []
        for _ in itertools.islice(path, 6):
            now = scenes.points(u)[1]
            lengths[longest].append(np.sqrt(((now - before) ** 2).sum(axis=1).mean()))
            before = now
    assert lengths[np.inf][-1] > 5 * lengths[np.inf][0]
    assert lengths[1e-3][-1] == pytest.approx(1e-3, rel=1e-3)
    assert max(lengths[1e-3]) < 1.001e-3


@pytest.mark.parallel
def test_the_load_may_be_a_displacement():
    """Of the rim, with forces that are nowhere given: the homogeneous answer, in as many steps as one likes."""
    scene = scenes.rim(scenes.grid(COMM, "triangle", skew=0.3), scenes.Toy(), [[0.3, 0.1], [0.0, 0.2]])
    for step in itertools.islice(continuation.arc_length(scene.solver, scene.pull, 0.1), 4):
        x, u = scenes.points(scene.u)
        assert np.abs(u - x @ (scene.F(step.load) - np.eye(2)).T).max() < 1e-9
    assert step.load > 0.4


@pytest.mark.parallel
def test_a_path_and_a_march_through_its_loads_leave_the_same_history():
    path = scenes.drawn(COMM, BLEND, Woven(BLEND))
    march = scenes.drawn(COMM, BLEND, Woven(BLEND))
    path[2].rtol = march[2].rtol = 1e-12
    loads = [step.load for step in itertools.islice(continuation.arc_length(path[2], path[3], 1e5), 6)]
    list(statics.march(march[2], march[3], loads))
    assert loads[-1] > 1e6
    assert np.abs(path[0].x.array - march[0].x.array).max() < 1e-9 * BLEND.gauge_length
    np.testing.assert_allclose(path[1].history.committed, march[1].history.committed, rtol=1e-6, atol=1e-9)


@pytest.mark.parallel
def test_a_failed_step_is_halved_and_only_accepted_ones_are_committed():
    stride = 0.02
    _, sheet, solver, draw = scenes.drawn(COMM, BLEND, scenes.Impatient(stride))
    before, cuts, iterations = np.zeros_like(sheet.strain), 0, []
    for step in itertools.islice(continuation.arc_length(solver, draw, 2e4), 12):
        assert np.abs(sheet.strain - before).max(initial=0.0) <= stride
        np.testing.assert_array_equal(sheet.history.committed, sheet.strain.reshape(-1, 3))
        before, cuts = sheet.strain.copy(), cuts + step.step_cuts
        iterations.append(step.newton_iterations)
    assert cuts > 0
    assert max(iterations) > min(iterations)
    assert COMM.allreduce(np.abs(before).max(initial=0.0), MPI.MAX) > 3 * stride


@pytest.mark.parallel
def test_a_path_that_cannot_go_on_says_so_and_leaves_the_last_good_state():
    class Wall(scenes.Toy):
        """No stress beyond a strain of 5 %."""

        def respond(self, strain, state, out=None):
            stress, tangent, new = super().respond(strain, state, out)
            stress[strain[:, 0] > 0.05] = np.nan
            return stress, tangent, new

    u, sheet, solver, draw = scenes.drawn(COMM, BLEND, Wall())
    last = []
    with pytest.raises(StepFailed, match=r"Step \d+ of the path stopped at load .*, after \d+ cuts .* residuals in N"):
        for step in continuation.arc_length(solver, draw, 2e4):
            last[:] = [step.load, u.x.array.copy()]
    np.testing.assert_array_equal(u.x.array, last[1])
    # the load is that of the last good state, too: it is in equilibrium
    assert solver.solve() <= 1
    assert np.abs(u.x.array - last[1]).max(initial=0.0) < 1e-9 * BLEND.gauge_length
    assert 0.049 < COMM.allreduce(sheet.strain[..., 0].max(initial=0.0), MPI.MAX) <= 0.05


@pytest.mark.parametrize("first", [0.0, np.nan, np.inf])
def test_a_first_load_that_is_none_is_refused(first):
    _, _, solver, draw = scenes.drawn(COMM, BLEND, scenes.Toy())
    with pytest.raises(InputError, match="first load"):
        next(continuation.arc_length(solver, draw, first))


def test_a_load_that_moves_nothing_is_refused():
    _, _, solver, _ = scenes.drawn(COMM, BLEND, scenes.Toy())
    with pytest.raises(InputError, match="moves nothing"):
        next(continuation.arc_length(solver, lambda load: None, 1.0))


def roof(comm, cells=4):
    """A quarter of the hinged roof of Sze, Liu and Lo (2004), 6.35 mm thick: solver, load (N) and deflection (m)."""
    numbers = {"radius": 2.54, "length": 0.254, "angle": np.degrees(0.1), "nx": cells, "ny": cells}
    domain = meshing.read(scenes.MESHES / "cylinder.geo", comm, **numbers)
    space = directors.ShellSpace(domain.mesh)
    q, (v, _) = space.function(), ufl.TestFunctions(space.V)
    h, E, nu, force = 6.35e-3, 3102.75e6, 0.3, fem.Constant(domain.mesh, (0.0, 0.0, 0.0))
    at = supports.over(domain, "A", 1)
    bcs = supports.hinge(domain, space, "side")
    bcs += supports.symmetry(domain, space, "top", 0) + supports.symmetry(domain, space, "middle", 1)
    residual = [scenes.shell(space, q, h, E, nu), -weakform.point_force(force, v, at)]
    solver = statics.StaticSolver(residual, q, bcs, rtol=1e-10, space=space)
    under, held = (supports.unknowns(domain, space, name, 2) for name in ("A", "side"))
    owned = under[under < space.V.dofmap.index_map.size_local]

    def load(value):
        force.value[2] = -value / 4

    return solver, load, lambda: -comm.allreduce(q.x.array[owned].sum()), lambda: 4 * solver.reaction(held)


@pytest.mark.parallel
def test_the_hinged_roof_snaps_back_the_same_on_any_number_of_ranks():
    paths = []
    for comm in (COMM, MPI.COMM_SELF):
        solver, load, deflection, support = roof(comm)
        path = []
        for step in continuation.arc_length(solver, load, 50.0, longest=1e-3):
            path.append((step.load, deflection()))
            assert support() == pytest.approx(step.load, abs=1e-5)
            if step.load > 1000.0 or step.number == 60:
                break
        paths.append(np.array(path))
    np.testing.assert_allclose(paths[0], paths[1], rtol=1e-8, atol=1e-9)
    load, deflection = paths[0].T
    top, low = load[np.argmax(np.diff(load) < 0)], load.min()
    # 585.9 N and -386.4 N in the table, here on 4 x 4 cells and between steps
    assert top == pytest.approx(586, rel=0.03)
    assert low == pytest.approx(-386, rel=0.06)
    assert (np.diff(deflection) < 0).any()
    assert load[-1] > 1000.0


@pytest.mark.parallel
def test_directors_are_committed_on_the_way_round_a_full_turn():
    """A strip that its end moment rolls up: M L / EI is the angle, whatever steps are taken."""
    domain = meshing.read(scenes.MESHES / "strip.geo", COMM, length=10.0, width=1.0, nx=30, ny=2, triangles=1)
    space = directors.ShellSpace(domain.mesh)
    q = space.function()
    (_, d), (_, delta) = ufl.split(q), ufl.TestFunctions(space.V)
    h, E = 0.1, 12e3  # EI = 1
    moment = fem.Constant(domain.mesh, (0.0, 0.0, 0.0))
    work = weakform.edge_moment(moment, d, delta, supports.over(domain, "pulled_end", 1))
    bcs = supports.clamp(domain, space, "fixed_end")
    solver = statics.StaticSolver([scenes.shell(space, q, h, E, 0.0), -work], q, bcs, space=space)

    def load(turns):
        moment.value[1] = -2 * np.pi * turns / 10.0

    tip = supports.unknowns(domain, space, "pulled_end", 0)
    tip = tip[tip < space.V.dofmap.index_map.size_local]
    count = COMM.allreduce(len(tip))
    for step in continuation.arc_length(solver, load, 0.05):
        angle = 2 * np.pi * step.load
        u = COMM.allreduce(q.x.array[tip].sum()) / count
        assert u == pytest.approx(10.0 * (np.sin(angle) / angle - 1), abs=0.01 * 10.0)
        if step.load > 1.0:
            break
    assert step.number < 60
