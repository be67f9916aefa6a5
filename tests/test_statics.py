"""Kinematics, Newton, step cutting and commits on sheets with a known answer."""

import gc
import weakref

import numpy as np
import pytest
import scenes
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.shell import kinematics
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import yarns
from fabric_fenicsx.terms import hook

COMM = MPI.COMM_WORLD
BLEND = fabrics.load("blend")
ELASTIC = StVenantKirchhoff([[9e6, 2e6, 0.4e6], [2e6, 5e6, -0.6e6], [0.4e6, -0.6e6, 2e6]])
LAWS = {"elastic": ELASTIC, "woven": Woven(BLEND)}
STRETCH = np.array([[0.11, 0.04], [-0.02, 0.07]])


def strain_of(F, warp):
    """(E11, E22, 2 E12) of a deformation gradient, in axes turned by `warp`."""
    E = scenes.turned(warp).T @ (F.T @ F - np.eye(2)) / 2 @ scenes.turned(warp)
    return np.array([E[0, 0], E[1, 1], 2 * E[0, 1]])


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize("angle", [1e-3, 1.0, np.pi, -2.5])
def test_a_rotation_strains_nothing_and_adds_nothing_to_a_strain(cell, angle):
    domain = scenes.grid(MPI.COMM_SELF, cell, skew=0.3)
    u = fem.Function(scenes.space(domain))
    strain = kinematics.membrane_strain(u, yarns.plane_axes(domain, 0.7))
    fabric = hook.LawHook(ELASTIC, strain, domain, 2)
    for gradient in (np.zeros((2, 2)), STRETCH):
        F = np.eye(2) + gradient
        u.interpolate(lambda x, F=F: (scenes.turned(angle) @ F - np.eye(2)) @ x[:2] + [[0.3], [-2.0]])
        assert fabric.evaluate()
        assert np.abs(fabric.points.strain - strain_of(F, 0.7)).max() < 1e-14


@pytest.mark.parametrize("warp", [np.nan, np.inf])
def test_a_warp_angle_that_is_no_number_is_refused(warp):
    domain = scenes.grid(COMM)
    field = fem.Function(fem.functionspace(domain, ("DG", 0)))
    if COMM.rank == COMM.size - 1:
        field.x.array[-1:] = warp
    for given in (warp, fem.Constant(domain, warp), field):
        with pytest.raises(InputError, match="finite"):
            yarns.plane_axes(domain, given)


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("turn", [0.0, 2.0])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_patch(cell, law, turn):
    """A homogeneous strain, there and half-way back, on a skewed mesh: stress and reaction of the point."""
    law, warp, loads = LAWS[law], 0.7, [0.5, 1.0, 0.5]
    scene = scenes.rim(scenes.grid(COMM, cell, skew=0.3), law, STRETCH, warp, turn=turn)
    point = driver.run(law, [strain_of(scene.F(load), warp) for load in loads])
    for step, expected in zip(statics.march(scene.solver, scene.pull, loads), point.stress, strict=True):
        largest, F = np.abs(expected).max(), scene.F(step.load)
        stress = scene.fabric.stress.reshape(-1, 3)
        assert np.abs(stress - expected).max() < 1e-10 * largest
        x, u = scenes.points(scene.u)
        assert np.abs(u - x @ (F - np.eye(2)).T).max() < 1e-10
        # F S on the right edge, 0.3 m long; what the rest of the rim adds at its corners cancels
        S = scenes.turned(warp) @ expected[[[0, 2], [2, 1]]] @ scenes.turned(warp).T
        force = F @ S @ [1, 0] * 0.3 * scenes.THICKNESS
        right = [scene.solver.reaction(scenes.side(scene.u, k, lambda x: x[0] > 0.4 - 1e-9)) for k in (0, 1)]
        assert np.abs(right - force).max() < 1e-10 * largest * 0.3 * scenes.THICKNESS


def pulled(law, **options):
    """A sheet to be pulled along x, on all ranks."""
    return scenes.rim(scenes.grid(COMM, skew=0.2), law, [[1, 0], [0, 0]], **options)


def uneven(law, **options):
    """The same with a warp that turns from place to place, so that a step takes several iterations."""
    domain = scenes.grid(COMM, skew=0.2)
    warp = fem.Function(fem.functionspace(domain, ("DG", 0)))
    warp.interpolate(lambda x: 5 * x[0] - 3 * x[1])
    return scenes.rim(domain, law, [[1, 0], [0, 0]], warp, **options)


@pytest.mark.parallel
def test_a_failed_step_leaves_no_trace_and_its_halves_agree_with_a_clean_run():
    law = Woven(BLEND)
    scene, clean = uneven(law), uneven(law)
    for each in (scene, clean):
        each.pull(0.02)
        each.solver.solve()
        each.solver.commit()
    history, u = scene.fabric.history.committed.copy(), scene.u.x.array.copy()
    support = scenes.side(scene.u, 0, lambda x: x[0] > 0.4 - 1e-9)
    force = scene.solver.reaction(support)
    scene.solver.snes.setTolerances(max_it=1)
    scene.pull(0.06)
    with pytest.raises(StepFailed, match=r"diverged_max_it\); residuals in N: .*, .*; largest strain in cell"):
        scene.solver.solve()
    assert np.array_equal(scene.fabric.history.committed, history)
    assert np.array_equal(scene.u.x.array, u)
    assert scene.solver.reaction(support) == pytest.approx(force, rel=1e-12)
    scene.solver.snes.setTolerances(max_it=25)
    for load in (0.04, 0.06):
        for each in (scene, clean):
            each.pull(load)
            each.solver.solve()
            each.solver.commit()
    assert np.array_equal(scene.fabric.history.committed, clean.fabric.history.committed)
    assert np.array_equal(scene.u.x.array, clean.u.x.array)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("search", ["basic", "bt"])
def test_a_march_cuts_what_fails_grows_again_and_meets_every_load(search):
    # at most 0.03 of strain an increment, and the third step needs less
    scene, seen = pulled(scenes.Impatient(0.03), snes_linesearch_type=search, snes_max_it=4), []

    def pull(load):
        seen.append(load)
        scene.pull(load)

    loads = [0.1, 0.17, 0.18, 0.05]
    steps = list(statics.march(scene.solver, pull, loads))
    assert [step.number for step in steps] == [1, 2, 3, 4]
    assert [step.load for step in steps] == loads
    assert steps[2].step_cuts == 0
    assert all(steps[k].step_cuts > 0 for k in (0, 1, 3))
    assert all(step.newton_iterations >= 1 for step in steps)
    assert [load for load in seen if load in loads][-1] == 0.05
    # the first step in full: halves and quarters fit where they leave less than 0.03 to be strained
    assert np.allclose(seen[:9], [0.1, 0.05, 0.025, 0.075, 0.05, 0.1, 0.075, 0.1, 0.17], rtol=1e-14)
    x, u = scenes.points(scene.u)
    rim = np.abs(x[:, 0] - 0.4) < 1e-9
    assert np.allclose(u[rim, 0], 0.05 * 0.4, rtol=1e-15, atol=0)


@pytest.mark.parallel
def test_a_step_that_cannot_be_done_says_where_it_stopped_and_leaves_the_last_good_state():
    law, given = scenes.Impatient(0.05), []
    scene = pulled(law)
    march = statics.march(scene.solver, lambda load: (given.append(load), scene.pull(load)), [0.03, 0.06, 0.2])
    next(march), next(march)
    good, history = scene.u.x.array.copy(), scene.fabric.history.committed.copy()
    law.stride = 0.001
    with pytest.raises(StepFailed) as caught:
        next(march)
    # 0.06 + 0.14/64 strains by 0.0023 > 0.001, and nothing smaller is tried
    assert given[-2] == pytest.approx(0.06 + 0.14 / 64)
    assert given[-1] == 0.06
    assert np.array_equal(scene.u.x.array, good)
    assert np.array_equal(scene.fabric.history.committed, history)
    said = str(caught.value)
    assert said.startswith("Step 3 stopped at load 0.06 on its way to 0.2, after 7 cuts of the step: ")
    assert "(diverged_function_nanorinf); residuals in N: " in said
    assert ", nan; largest strain in cell " in said
    assert " m, point " in said
    assert "strain (0.064" in said  # 0.06 + 0.14/64 + half its square
    # and it can go on from there
    assert [step.load for step in statics.march(scene.solver, scene.pull, [0.0605], start=0.06)] == [0.0605]


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("loads", [[], [np.nan], [0.1, np.inf]])
def test_a_march_without_finite_loads_is_refused(loads):
    scene = pulled(ELASTIC)
    with pytest.raises(InputError, match="load"):
        list(statics.march(scene.solver, scene.pull, loads))
    assert not scene.u.x.array.any()


class Rotten(scenes.Toy):
    """Breaks at the point nearest to (0.05, 0.05) m, on whatever rank that is, beyond 0.04 of strain."""

    def __init__(self, domain, how):
        owned = domain.topology.index_map(2).size_local
        self.here, self.how = np.flatnonzero(domain.topology.original_cell_index[:owned] == 0), how

    def respond(self, strain, state, out=None):
        """As the toy law, but for one point."""
        stress, tangent, new = super().respond(strain, state, out)
        for cell in self.here:
            if strain[4 * cell, 0] > 0.04:
                if self.how == "raises":
                    raise ZeroDivisionError("so much strain")
                stress[4 * cell] = np.nan
        return stress, tangent, new


@pytest.mark.parallel
def test_one_bad_point_on_one_rank_fails_the_step_on_all():
    domain = scenes.grid(COMM)
    scene = scenes.rim(domain, Rotten(domain, "nan"), [[1, 0], [0, 0]])
    with pytest.raises(StepFailed, match=r"largest strain in cell 0 at .* point 0: strain \(0\.04") as caught:
        list(statics.march(scene.solver, scene.pull, [0.03, 0.05]))
    assert len(set(COMM.allgather(str(caught.value)))) == 1
    assert 0.036 < scene.fabric.strain[..., 0].max() < 0.04


@pytest.mark.parallel
def test_a_law_that_raises_on_one_rank_is_named_on_all():
    domain = scenes.grid(COMM)
    scene = scenes.rim(domain, Rotten(domain, "raises"), [[1, 0], [0, 0]])
    with pytest.raises(RuntimeError, match=r"A law must not raise.*ZeroDivisionError.*so much strain"):
        list(statics.march(scene.solver, scene.pull, [0.03, 0.05]))
    # the solver is still of use
    scene.pull(0.035)
    assert scene.solver.solve() > 0


@pytest.mark.parallel
def test_a_given_displacement_is_met_however_small_its_change_and_coarse_the_tolerance():
    """One cell, all given: there is no force out of balance that would tell."""
    scene = scenes.rim(scenes.grid(COMM, cells=(1, 1)), ELASTIC, [[1, 0], [0, 0]], rtol=1e-2)
    for load in (0.1, 0.1 + 1e-9):
        scene.pull(load)
        scene.solver.solve()
        scene.solver.commit()
        assert scenes.points(scene.u)[1].max() == pytest.approx(0.4 * load, rel=1e-14)


def test_newton_converges_in_the_second_order():
    scene = uneven(scenes.Toy(), rtol=1e-14)
    scene.pull(0.1)
    scene.solver.solve()
    norms = np.array(scene.solver.residuals)
    norms = norms[norms > 1e-9 * norms[0]]
    assert len(norms) >= 3
    assert (np.log(norms[2:] / norms[1:-1]) / np.log(norms[1:-1] / norms[:-2]))[-1] > 1.8


class Barrier(StVenantKirchhoff):
    """Not a number beyond 0.05 of strain."""

    def respond(self, strain, state, out=None):
        """Elastic up to there."""
        stress, tangent, new = super().respond(strain, state, out)
        stress[np.abs(strain).max(axis=1) > 0.05] = np.nan
        return stress, tangent, new


@pytest.mark.parametrize("search", ["basic", "bt"])
def test_creeping_up_to_where_the_law_ends_is_not_taken_for_convergence(search):
    """A line search may shorten every correction without end; the forces are out of balance all the same."""
    law, fabric = Barrier.isotropic(1e7, 0.3), fabrics.load("blend")
    _, sheet, solver, draw = scenes.drawn(COMM, fabric, law, snes_linesearch_type=search, snes_max_it=100)
    draw(4e5)
    solver.solve()
    solver.commit()
    assert sheet.strain.max() == pytest.approx(0.04, rel=0.05)
    draw(1e6)
    with pytest.raises(StepFailed):
        solver.solve()


def test_a_solver_that_is_dropped_frees_its_mesh():
    # 9 communicators a scene would end a study after about 200 of them
    meshes = []
    for _ in range(2):
        u, *scene = scenes.clamped(MPI.COMM_SELF, BLEND, LAWS["woven"])
        meshes.append(weakref.ref(u.function_space.mesh))
        del u, scene
    gc.collect()
    assert meshes[0]() is None
