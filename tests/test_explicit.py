"""Explicit dynamics: lumped mass, stable step, order, energy, agreement with the implicit scheme, failure."""

from itertools import pairwise

import motions
import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.solvers import checkpoint, energy, explicit, motion
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

COMM = MPI.COMM_WORLD


def run_of(cloth, bcs=(), gravity=(0, 0, 0), **settings):
    """Explicit motion of a sheet that has a weight."""
    weight = cloth.weight(motions.AREAL_MASS, fem.Constant(cloth.domain.mesh, np.array(gravity, dtype=float)))
    moved = motion.Motion(cloth.q, cloth.mass(motions.AREAL_MASS), cloth.shell)
    return explicit.CentralDifference(moved, [*cloth.terms, -weight], list(bcs), **settings)


def plate(comm=MPI.COMM_SELF, **settings):
    """A sheet hinged on its left edge that falls, and its run."""
    cloth = motions.cloth(comm)
    bcs = supports.hinge(cloth.domain, cloth.space, "left")
    return cloth, run_of(cloth, bcs, (0, 0, -9.81), **settings)


@pytest.mark.parametrize("triangles", [0, 1])
def test_lumped_mass_is_positive_and_whole(triangles):
    domain = meshing.read(motions.SQUARE, MPI.COMM_SELF, side=motions.SIDE, n=2, triangles=triangles)
    cloth = sheet.Sheet(domain, motions.SOFT, motions.THICKNESS, (2e3, 2e3), layers=2)
    m = motion.Motion(cloth.q, cloth.mass(motions.AREAL_MASS), cloth.shell).lump()
    assert (m > 0).all()
    whole = motions.AREAL_MASS * motions.SIDE**2
    for part, expected in ((0, whole), (1, whole * motions.THICKNESS**2 / 12)):
        for component in range(3):
            unknowns = cloth.space.V.sub(part).sub(component).collapse()[1]
            assert abs(m[unknowns].sum() / expected - 1) < 1e-12
    still = motion.Motion(cloth.q, cloth.mass(motions.AREAL_MASS, rotary="none"), cloth.shell)
    with pytest.raises(InputError, match="directors with inertia"):
        explicit.CentralDifference(still, cloth.terms, [])


def test_free_fall_is_exact():
    cloth = motions.cloth(MPI.COMM_SELF)
    run = run_of(cloth, gravity=(0, 0, -9.81))
    *_, step = run.march(0.01, 0.01)
    u = cloth.q.sub(0).collapse().x.array.reshape(-1, 3)
    assert step.load == 0.01 and np.abs(u - [0, 0, -9.81 * 0.01**2 / 2]).max() < 1e-12


def test_a_step_over_the_largest_stable_one_is_refused_and_does_explode():
    _, run = plate()
    with pytest.raises(InputError, match="not stable: the largest is"):
        next(run.march(0.01, 0.01, dt=1.01 * run.stable))
    grown = []
    for factor, steps in ((0.98, 500), (1.1, 16)):
        cloth = motions.cloth(MPI.COMM_SELF)
        run = run_of(cloth)
        # a motion too small to change what is stable
        cloth.q.x.array[run.directors[:, 0]] += 1e-9
        run.stable *= factor / explicit.SAFETY
        for _ in run.march(steps * run.stable, steps * run.stable):
            pass
        grown.append(np.abs(cloth.q.sub(0).collapse().x.array).max())
    assert grown[0] < 1e-8 and grown[1] > 1e3 * grown[0], grown


def test_second_order():
    answers = []
    base = 0.8 * plate()[1].stable
    for n in (2, 4, 8, 16):
        cloth, run = plate()
        motions.spin(run.motion.velocity, (0, -10.0, 0))
        for _ in run.march(32 * base, 32 * base, dt=base / n):
            pass
        answers.append(cloth.q.x.array.copy())
    errors = [np.abs(a - b).max() for a, b in pairwise(answers)]
    assert 1.9 < motions.order(errors)[-1] < 2.2


def test_energy_closes_and_the_implicit_scheme_agrees():
    cloth = motions.cloth(MPI.COMM_SELF)
    run = run_of(cloth, supports.hinge(cloth.domain, cloth.space, "left"), (0, 0, -9.81))
    ledger = energy.Ledger(run)
    motions.spin(run.motion.velocity, (0, -10.0, 0))
    for _ in run.march(0.02, 0.01, dt=0.2 * run.stable):
        pass
    assert ledger.worst < 1e-3 * ledger.most
    other = motions.cloth(MPI.COMM_SELF)
    implicit = motions.moving(other, supports.hinge(other.domain, other.space, "left"), (0, 0, -9.81), lumped=True)
    motions.spin(implicit.motion.velocity, (0, -10.0, 0))
    for _ in implicit.march(0.02, 2e-4):
        pass
    moved = [sheet.q.sub(0).collapse().x.array for sheet in (cloth, other)]
    assert np.abs(moved[0] - moved[1]).max() < 1e-3 * np.abs(moved[1]).max()


def woven(comm=MPI.COMM_SELF):
    """A sheet of the measured law hinged on its left edge, which is thrown to the right, and its run."""
    cloth = motions.cloth(comm, Potential(fabrics.load("blend")))
    run = run_of(cloth, supports.hinge(cloth.domain, cloth.space, "left"), (0, 0, -9.81))
    run.motion.velocity.sub(0).interpolate(lambda x: np.array([3.0, 0.0, 0.0])[:, None] * x[0] / motions.SIDE)
    run.motion.velocity.x.scatter_forward()
    return cloth, run


def test_the_step_shortens_with_what_a_fabric_has_been_through():
    """And no more: it stays above that of full unloading, and loses what short steps do."""
    _, run = woven()
    ledger, steps, stable = energy.Ledger(run), [], [run.stable]
    run.weigh = 1
    for step in run.march(0.02, 0.001):
        steps.append(step.newton_iterations)
        stable.append(run.stable)
    full = 2 / np.sqrt(run._limit._ever)
    assert stable[0] > 5 * full and (np.diff(stable) <= 0.3 * full).all() and full <= stable[-1] < 0.5 * stable[0]
    assert sum(steps) < 0.02 / full and ledger.worst < 0.01 * ledger.most
    _, fine = woven()
    account, fine.weigh = energy.Ledger(fine), 1
    for step in fine.march(0.02, 0.001, dt=0.2 * full):
        assert step.newton_iterations == np.ceil(0.001 / (0.2 * full))
    assert abs(ledger.totals["by_law"] / account.totals["by_law"] - 1) < 5e-3


def hit(whole=2e-5, refuses=False):
    """A fabric that falls onto a fixed ball while a free one hits it, for 2 ms: fabric, ball, run, ledger, steps.

    whole: half of the step in s, none for the stable one; refuses: whether halves come of whole steps, taken back.
    """
    cloth = motions.cloth(MPI.COMM_SELF, Potential(fabrics.load("blend")), cells=4)
    fixed = bodies.Sphere(0.3, (0.1, 0.1, -0.308), cells=24)
    ball = bodies.Sphere(0.1, (0.2, 0.2, 0.108), cells=8).free(0.2, velocity=(0, 0, -1.0))
    touch = Contact(cloth, [fixed, ball], friction=0.3, itself=False, offset=2e-3, reach=1e-2)
    run, ledger = cloth.explicit(motions.AREAL_MASS, [], touch.terms)
    run.motion.velocity.sub(0).interpolate(lambda x: np.array([0.5, 0.0, -1.0])[:, None] + 0 * x)
    run.motion.velocity.x.scatter_forward()
    run.weigh, allows, asked = 1, run._limit.allows, []

    def refusing(dt):
        asked.append(dt)
        return dt < 0.75 * whole and allows(dt)

    if refuses:
        run._limit.allows = refusing
    dt, steps = whole if refuses or whole is None else whole / 2, 0
    for step in run.march(2e-3, 1e-3, dt=dt):
        steps += step.newton_iterations
        assert touch.least_gap() > 0.0 and not touch.crossed()
    return cloth.q.x.array, touch.places(ball), run, ledger, len(asked) or steps


def test_a_step_in_contact_that_is_taken_back_leaves_no_trace():
    (q, ball, _, ledger, asked), (other, at, _, account, _) = hit(refuses=True), hit()
    assert asked == 300 and np.abs(q - other).max() < 1e-12 and np.abs(ball - at).max() < 1e-12
    assert ledger.totals == pytest.approx(account.totals, rel=1e-9, abs=1e-12)
    assert ledger.totals["by_friction"] > 0.0 and ledger.totals["by_law"] > 0.0


def test_steps_in_contact_follow_the_history_of_the_fabric():
    (q, _, run, ledger, steps), (exact, _, _, account, _) = hit(None), hit()
    full = 2 / np.sqrt(run._limit._ever)
    assert steps < 0.4 * 2e-3 / (explicit.SAFETY * full) and run.stable > 2 * full
    assert ledger.worst < 2e-3 * ledger.most and np.abs(q - exact).max() < 1e-4
    assert ledger.totals["kinetic"] == pytest.approx(account.totals["kinetic"], rel=0.01)


def test_a_part_of_the_stable_step_stays_that_part():
    counts = []
    for part in (1.0, 0.5):
        _, run = woven()
        run.stable *= part
        counts.append(sum(step.newton_iterations for step in run.march(0.01, 0.001)))
    assert 1.7 < counts[1] / counts[0] < 2.3


def with_and_without_a_stop(make, end, at, path):
    """What `make` gives and the last step, at the end of a motion, and of one that is saved at a step and goes on."""
    for stop in (False, True):
        cloth, run = make()
        for step in run.march(end, 0.001):
            if stop and step.number == at:
                checkpoint.save(path, run)
                cloth, run = make()
                checkpoint.load(path, run)
                *_, step = run.march(end, 0.001)
                break
        yield cloth, run, step


def test_a_saved_fabric_goes_on_in_the_same_steps(tmp_path):
    (cloth, run, step), (other, resumed, last) = with_and_without_a_stop(woven, 0.01, 5, tmp_path / "saved.npz")
    assert np.abs(cloth.q.x.array - other.q.x.array).max() < 1e-12
    assert (run.stable, step.newton_iterations) == (resumed.stable, last.newton_iterations)


@pytest.mark.parallel
def test_a_fabric_takes_the_same_steps_on_any_ranks():
    found = []
    for comm in (COMM, MPI.COMM_SELF):
        cloth, run = woven(comm)
        steps = [step.newton_iterations for step in run.march(0.01, 0.001)]
        found.append((motions.nodes(cloth.q)[0], steps))
    assert np.abs(found[0][0] - found[1][0]).max() < 1e-10 and found[0][1] == found[1][1]


@pytest.mark.parametrize("reach", [0.1, 0.0])
def test_thickness_does_not_limit_the_step_where_shear_stiffness_is_limited(reach):
    steps = []
    for thickness in (1e-3, 1e-5):
        domain = meshing.read(motions.SQUARE, MPI.COMM_SELF, side=motions.SIDE, n=2)
        cloth = sheet.Sheet(domain, motions.SOFT, thickness, (1e4, 1e4), layers=2, reach=reach)
        moved = motion.Motion(cloth.q, cloth.mass(motions.AREAL_MASS), cloth.shell)
        steps.append(explicit.CentralDifference(moved, cloth.terms, []).stable)
    assert (steps[1] > 0.9 * steps[0]) == (reach > 0.0)


def test_a_motion_that_is_not_finite_stops_with_the_last_good_state():
    cloth, run = plate()
    for step in run.march(0.002, 0.001):
        good, t = cloth.q.x.array.copy(), step.load
    run.motion.velocity.x.array[-1] = np.nan
    with pytest.raises(StepFailed, match="not finite"):
        next(run.march(0.004, 0.001))
    assert (cloth.q.x.array == good).all() and run.time == t


def test_a_saved_motion_goes_on_as_if_it_had_not_stopped(tmp_path):
    (cloth, run, _), (other, resumed, _) = with_and_without_a_stop(plate, 0.004, 2, tmp_path / "saved.npz")
    assert (run.time, run.number) == (resumed.time, resumed.number)
    assert (cloth.q.x.array == other.q.x.array).all()


@pytest.mark.parallel
def test_one_and_two_ranks_agree():
    found = []
    for comm in (COMM, MPI.COMM_SELF):
        cloth, run = plate(comm)
        for _ in run.march(0.005, 0.005, dt=5e-5):
            pass
        found.append(motions.nodes(cloth.q)[0])
    assert np.abs(found[0] - found[1]).max() < 1e-10
