"""Bodies with mass: their flight, exact tangents, momentum and energy of a drop, checkpoints, ranks, refusals."""

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from test_contact import G, M, square

from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.solvers import checkpoint
from fabric_fenicsx.terms import supports

SIDES = ("left", "right", "bottom", "top")
DOWN = (0.0, 0.0, -G)
METHODS = pytest.mark.parametrize("method", ["newmark", "explicit"])


def meeting(around, method="newmark", comm=MPI.COMM_SELF, cells=4, weight=True, settings=None, **options):
    """A clamped elastic sheet under its weight, and bodies: sheet, contact, run, ledger."""
    cloth = square("mitc4", cells, comm)
    touch = Contact(cloth, around, gravity=DOWN, **options)
    loads = [cloth.weight(M, ufl.as_vector(DOWN))] if weight else []
    held = [bc for side in SIDES for bc in supports.hinge(cloth.domain, cloth.space, side)]
    run, ledger = getattr(cloth, method)(M, held, [*loads, *touch.terms], **settings or {})
    return cloth, touch, run, ledger


@pytest.mark.parametrize(
    ("body", "moments"),
    [
        (bodies.Box((1, 2, 3), (1, 1, 1), cells=2), np.array([13, 10, 5]) / 12),
        (bodies.Sphere(1.0, (1, 2, 3), cells=24), np.full(3, 0.4)),
        (bodies.Cylinder(1.0, 2.0, (0, 0, 1), cells=48), np.array([7 / 12, 7 / 12, 0.5])),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_a_filled_body_has_its_inertia(body, moments):
    body.free(2.0, inertia="solid")
    assert body.inertia == pytest.approx(2.0 * np.diag(moments), rel=5e-3, abs=1e-9)
    assert body.middle == pytest.approx(body.rest.mean(axis=0), abs=1e-9)


@METHODS
def test_a_thrown_body_flies_along_a_parabola_and_turns_as_euler_says(method):
    size, speed, spin, end = np.array([0.02, 0.03, 0.05]), (0.3, 0.1, 1.0), np.array([10.0, 20.0, 30.0]), 0.1
    box = bodies.Box(tuple(size), (0.3, 0.3, 0.5)).free(0.1, inertia="solid", velocity=speed, spin=spin)
    inertia = 0.1 / 12 * (size @ size - size**2)

    def rate(t, state):
        w, R = state[:3], state[3:].reshape(3, 3)
        return np.concatenate([np.cross(inertia * w, w) / inertia, (R @ np.cross(np.eye(3), w)).ravel()])

    start = np.concatenate([spin, np.eye(3).ravel()])
    R = solve_ivp(rate, (0, end), start, rtol=1e-11, atol=1e-12).y[3:, -1].reshape(3, 3)
    settings = {"accuracy": np.inf} if method == "newmark" else {}
    _, touch, run, ledger = meeting([box], method, cells=2, weight=False, settings=settings)
    energy = touch.free.kinetic()
    for _ in run.march(end, 2e-3 if method == "newmark" else 0.05):
        pass
    moved = box.target.mean(axis=0) - box.rest.mean(axis=0)
    assert moved == pytest.approx(np.multiply(speed, end) + [0, 0, -G * end**2 / 2], rel=1e-9)
    found = Rotation.align_vectors(box.target - box.target.mean(axis=0), box.rest - box.rest.mean(axis=0))[0]
    assert (found * Rotation.from_matrix(R).inv()).magnitude() < 5e-3
    assert touch.free.kinetic() - energy == pytest.approx(-0.1 * G * moved[2], rel=1e-3)
    assert abs(ledger.totals["imbalance"]) < 1e-3 * ledger.most
    assert ledger.totals["external"] - energy == pytest.approx(-0.1 * G * moved[2], rel=1e-6)


@pytest.mark.parametrize("turns", [False, True])
def test_the_tangent_is_exact_with_bodies_that_touch(turns):
    box = bodies.Box((0.2, 0.25, 0.1), (0.3, 0.3, 0.0515), (0.0, 0.0, 0.3)).free(
        0.1, inertia="solid" if turns else None
    )
    ball = bodies.Sphere(0.1, (0.3, 0.3, -0.1015)).free(0.2, velocity=(0.1, 0, 0.2))
    _, _, run, _ = meeting([box, ball], friction=0.3, reach=2e-3, slip=5e-2)
    run.ts.setTimeStep(2e-3)
    run.begin()
    run.motion.prepare(2e-3, (np.zeros(len(run.motion.given)),) * 2)
    solver, rng = run.solver, np.random.default_rng(1)
    for term in solver.terms:
        term.prepare(2e-3)
    x = solver.begin().copy()
    n, m = solver._unknowns.owned, solver._unknowns.count
    assert m == (9 if turns else 6) and x.local_size == n + m
    way = x.duplicate()
    free = np.setdiff1d(np.arange(n + m), solver._given)
    moved = np.intersect1d(free, solver.displacements)
    way.array_w[free] = 1e-4 * rng.standard_normal(len(free))
    x.array_w[moved] += 1e-4 * rng.standard_normal(len(moved))
    x.array_w[n:] += 1e-4 * rng.standard_normal(m)
    start, change = solver.residual(x).copy(), x.duplicate()
    solver.factorised().getOperators()[0].mult(way, change)
    left = []
    for step in 0.05 * 0.5 ** np.arange(4):
        rest = (solver.residual(x + way * float(step)) - start - change * float(step)).array_r
        left.append([np.linalg.norm(rest[free]), np.linalg.norm(rest[n:])])
    orders = np.log2(np.array(left[:-1]) / left[1:])
    assert 1.9 < orders.min() and orders.max() < 2.1


def test_a_ball_on_an_elastic_sheet_keeps_momentum_and_energy_and_flies_off_with_g():
    mass, dt = 0.2, 1e-3
    ball = bodies.Sphere(0.1, (0.3, 0.3, 0.103), cells=5).free(mass, velocity=(0, 0, -2.0))
    settings = {"rho": 1.0, "rtol": 1e-7}
    cloth, touch, run, ledger = meeting([ball], cells=4, itself=False, stiffness=3e4, settings=settings)
    rim = np.unique(np.concatenate([supports.unknowns(cloth.domain, cloth.space, side, 2) for side in SIDES]))
    heights = np.array(cloth.q.function_space.sub(0).sub(2).collapse()[1])
    impulse, before, rows = 0.0, None, []
    for step in run.march(0.095, dt):
        now, speed = run.reaction(rim), touch.free.rates()[2]
        if before is not None:
            impulse += dt * (now + before) / 2
        before = now
        sheet = run.motion.by_mass(run.motion.velocity).array_r[heights].sum()
        impulse -= G * dt * (mass + M * 0.36) if len(rows) else 0.0
        rows.append([step.load, sheet + mass * speed, impulse, speed, touch.least_gap()])
    t, momentum, impulse, speed, gap = np.array(rows).T
    change = momentum - momentum[0]
    assert change.max() > 0.8
    assert change[-1] == pytest.approx(impulse[-1], rel=1e-6)
    assert np.abs(change - impulse).max() < 5e-3 * np.abs(change).max(), "steps that were cut are told by their ends"
    flying = np.flatnonzero(np.isfinite(gap))[-1] + 1
    assert t[-1] - t[flying] > 2e-3 and speed[-1] > 0
    assert np.diff(speed[flying + 1 :]) / dt == pytest.approx(-G, rel=0.01)
    assert ledger.worst < 0.01 * ledger.most and gap.min() > 0.0


def test_a_run_goes_on_from_a_checkpoint_with_its_bodies_to_the_last_bit(tmp_path):
    def drop():
        box = bodies.Box((0.1, 0.1, 0.05), (0.3, 0.3, 0.034), (0.1, 0.0, 0.2), cells=2)
        box.free(0.1, inertia="solid", velocity=(0.1, 0, -1.0), spin=(1.0, 2.0, 0.0))
        return *meeting([box], cells=3, friction=0.3, itself=False), box

    ends = []
    for stop in (False, True):
        cloth, _, run, ledger, box = drop()
        for step in run.march(0.02, 2e-3):
            if stop and step.number == 5:
                checkpoint.save(tmp_path / "state.npz", run)
                cloth, _, run, ledger, box = drop()
                checkpoint.load(tmp_path / "state.npz", run)
                for _ in run.march(0.02, 2e-3):
                    pass
                break
        ends.append(np.concatenate([cloth.q.x.array, box.target.ravel(), [ledger.totals["external"]]]))
    assert np.array_equal(*ends)


def test_a_led_body_that_is_held_back_stops_explicit_motion_and_passes_nothing():
    cloth = square("mitc4", 2, side=0.3)
    table, press = bodies.Plane(point=(0, 0, -2e-3)), bodies.Box((0.5, 0.5, 0.1), (0.15, 0.15, 0.052), cells=2)
    touch = Contact(cloth, [table, press], itself=False)
    run, _ = cloth.explicit(M, [], touch.terms, set_load=lambda t: press.move((0, 0, -t)))
    with pytest.raises(StepFailed, match=r"held back|nowhere"):
        for _ in run.march(0.01, 1e-3):
            assert touch.least_gap() > 0.0 and not touch.crossed()
    assert touch.least_gap() > 0.0 and not touch.crossed()


def test_a_hard_explicit_drop_keeps_energy():
    box = bodies.Box((0.1, 0.12, 0.05), (0.3, 0.3, 0.0275), (0.0, 0.0, 0.2), cells=2)
    box.free(0.2, inertia="solid", velocity=(0, 0, -2.0))
    _, touch, run, ledger = meeting([box], "explicit", itself=False)
    for _ in run.march(5e-3, 2.5e-3):
        assert touch.least_gap() > 0.0 and not touch.crossed()
    t = ledger.totals
    assert ledger.worst < 0.01 * ledger.most and touch.free.rates()[2] > -1.99
    assert t["kinetic"] + t["recoverable"] == pytest.approx(t["external"], rel=0.01)


@pytest.mark.parallel
def test_ranks_do_not_change_the_answer():
    results = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        box = bodies.Box((0.1, 0.1, 0.05), (0.3, 0.25, 0.034), (0.1, 0.0, 0.2), cells=2)
        box.free(0.1, inertia="solid", velocity=(0.1, 0, -1.0))
        ball = bodies.Sphere(0.05, (0.2, 0.3, -0.052), cells=4).free(0.05, velocity=(0, 0, 1.0))
        settings = {"accuracy": np.inf, "rtol": 1e-10}
        _, touch, run, ledger = meeting([box, ball], comm=comm, friction=0.3, itself=False, settings=settings)
        for _ in run.march(0.016, 2e-3):
            pass
        results.append([*touch.free.rates(), *touch.force(box), *ledger.totals.values(), touch.least_gap()])
    assert np.isfinite(results[0]).all() and results[0][8] < 1.0, "the ball has been slowed down"
    assert results[0] == pytest.approx(results[1], rel=1e-8, abs=1e-11)


def test_what_cannot_move_freely_is_refused():
    ball = bodies.Sphere(0.1, (0.3, 0.3, 0.11))
    with pytest.raises(InputError, match="mass = -1"):
        ball.free(-1)
    with pytest.raises(InputError, match=r"inertia = \(1, 1, 3\), which is no body's"):
        ball.free(1, inertia=(1, 1, 3))
    with pytest.raises(InputError, match="an inertia to what spins"):
        bodies.Sphere(0.1).free(1, spin=(1, 0, 0))
    with pytest.raises(InputError, match="plane 'plane' cannot have mass"):
        bodies.Plane().free(1)
    with pytest.raises(InputError, match="leave the mass out to lead it"):
        bodies.Sphere(0.1).free(1).move((0, 0, 1))
    cloth = square()
    touch = Contact(cloth, [bodies.Sphere(0.1, (0.3, 0.3, 0.11)).free(1)])
    with pytest.raises(InputError, match="needs a motion"):
        cloth.equilibrium([], touch.terms)
