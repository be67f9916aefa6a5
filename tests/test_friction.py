"""Friction against closed forms, sheets on sheets, explicit motion."""

import numpy as np
import pytest
import ufl
from test_contact import G, H, M, square

from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.coefficients import coulomb, start_of_slip, stored
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError

MU, SLIP = 0.3, 1e-3


def slide(slope, method="newmark", end=0.2, creep=1e-9):
    """Acceleration and speed at the end of a sheet on a plane of this slope, and its ledger and friction force."""
    cloth = square("mitc4", 2, side=0.1)
    angle = np.arctan(slope)
    # in balance with its weight from the start
    law = {"stiffness": M * G * np.cos(angle), "reach": 2e-3, "slip": SLIP, "creep": creep}
    touch = Contact(cloth, [bodies.Plane(point=(0, 0, -H - 1e-3))], friction=MU, itself=False, **law)
    down = cloth.weight(M, ufl.as_vector((G * np.sin(angle), 0.0, -G * np.cos(angle))))
    run, ledger = getattr(cloth, method)(M, [], [down, *touch.terms])
    along = np.array(cloth.q.function_space.sub(0).sub(0).collapse()[1])
    speeds = []
    for _ in run.march(end, 5e-3):
        assert touch.least_gap() > 0.0
        speeds.append(run.motion.velocity.x.array[along].mean())
    half = len(speeds) // 2
    return (speeds[-1] - speeds[half]) / (5e-3 * (len(speeds) - 1 - half)), speeds[-1], ledger, touch


def test_a_sheet_slides_down_a_slope_as_coulomb_says():
    rate, _, ledger, touch = slide(0.4)
    angle = np.arctan(0.4)
    assert rate == pytest.approx(G * (np.sin(angle) - MU * np.cos(angle)), rel=2e-3)
    assert ledger.totals["by_friction"] > 0.0
    assert abs(ledger.totals["imbalance"]) < 1e-3 * ledger.most
    push = touch.force(touch.bodies[0])
    assert push[0] == pytest.approx(-MU * push[2], rel=1e-6)
    assert touch.forces().sum(axis=0) == pytest.approx(-push, rel=1e-9, abs=1e-12)


def test_where_friction_could_hold_it_creeps_with_the_smoothed_laws_speed():
    _, speed, _, _ = slide(0.2)
    assert speed == pytest.approx(SLIP * (1 - np.sqrt(1 - 0.2 / MU)), rel=0.01)


@pytest.mark.parametrize("slope", [0.2, 0.4])
def test_friction_of_explicit_motion_does_not_hang_on_the_way_of_statics(slope):
    """Its steps are shorter than that way by far."""
    rate, speed, ledger, _ = slide(slope, "explicit", 0.1, creep=1e-4)
    angle = np.arctan(slope)
    if slope > MU:
        assert rate == pytest.approx(G * (np.sin(angle) - MU * np.cos(angle)), rel=2e-3)
    else:
        assert SLIP * (1 - np.sqrt(1 - slope / MU)) < speed < 2.5 * SLIP
    assert ledger.totals["by_friction"] > 0.0 and ledger.worst < 1e-3 * ledger.most


@pytest.mark.parametrize("body", ["plane", "box"])
@pytest.mark.parametrize("way", [0.0, np.pi / 2, 0.6])
def test_friction_differs_along_warp_and_weft(body, way):
    """It is against the way, by an ellipse; the same on an exact plane and between triangles."""
    cloth, (mu1, mu2) = square("mitc4", 2, side=0.1), (0.3, 0.1)
    under = bodies.Plane(point=(0, 0, -H - 1e-3)) if body == "plane" else bodies.Box((1, 1, 1), (0.12, 0, -H - 0.501))
    touch = Contact(cloth, [under], friction=(mu1, mu2), itself=False, reach=2e-3, slip=1e-3)
    touch.terms[0].prepare(0.1)
    along = np.array([np.cos(way), np.sin(way), 0.0])
    cloth.q.x.array[touch._around.skin.local] += 0.01 * along
    push = touch.force(under)
    mu = np.hypot(mu1 * along[0], mu2 * along[1])
    assert push[:2] == pytest.approx(-mu * push[2] * along[:2], rel=1e-6, abs=1e-9)


def test_the_tangent_of_friction_that_differs_is_exact_on_planes():
    cloth, rng = square("mitc4", 2, side=0.1), np.random.default_rng(1)
    touch = Contact(cloth, [bodies.Plane(point=(0, 0, -H - 1e-3))], friction=(0.3, 0.1), static=(0.4, 0.15), reach=2e-3)
    term, q, local = touch.terms[0], cloth.q.x.array, touch._around.skin.local
    term.prepare(0.5)
    place, way = 2e-4 * rng.standard_normal(local.shape), rng.standard_normal(local.shape)
    # directions are those of the sheet before it moves: nothing of it strains or turns
    place[:], way[:] = place[:1], way[:1]
    start, forces = q[local].copy(), []
    for e in (1e-9, -1e-9):
        q[local] = start + place + e * way
        total = np.zeros_like(q)
        term.evaluate()
        term.add_force(total)
        forces.append(total[local])
    q[local] = start + place
    term.evaluate()
    near = touch._around.collisions
    ((_, change),) = near.gaps.friction(near.x, touch._around.x0, term._length, term._coefficients, True)
    assert len(change) == len(touch.rest)
    assert np.einsum("ijk,ik->ij", change, way) == pytest.approx((forces[0] - forces[1]) / 2e-9, rel=1e-5, abs=1e-6)


def test_the_coefficient_is_that_of_the_toolkit():
    ipctk = pytest.importorskip("ipctk")
    slid = np.array([1e-6, 2e-5, 5e-5, 9.9e-5, 2e-4])
    h, bend = coulomb(slid, 1e-4, 0.5, 0.3)
    expected = [ipctk.smooth_mu(s, 0.5, 0.3, 1e-4) * ipctk.smooth_friction_f1(s, 1e-4) for s in slid]
    assert h * slid == pytest.approx(expected)
    many = np.linspace(0, slid, 4001)
    work = np.trapezoid(coulomb(many, 1e-4, 0.5, 0.3)[0] * many, many, axis=0)
    assert stored(slid, 1e-4, 0.5, 0.3) == pytest.approx(work, rel=1e-6)
    after, before = (coulomb(slid * (1 + e), 1e-4, 0.5, 0.3)[0] for e in (1e-6, -1e-6))
    assert bend == pytest.approx((after - before) / (2e-6 * slid**2), rel=1e-6)


@pytest.mark.parametrize("static", [0.3, 0.301, 0.33, 0.36, 0.5, 2.0])
def test_friction_peaks_at_the_static_coefficient(static):
    y = np.linspace(1e-3, 1.5, 5000)
    mu = coulomb(y, 1.0, start_of_slip(static, 0.3), 0.3)[0] * y
    assert mu.max() == pytest.approx(static, rel=1e-5) and mu[-1] == pytest.approx(0.3)


def test_explicit_motion_touches_keeps_energy_and_bounces():
    cloth = square("mitc4", 3, side=0.3)
    touch = Contact(cloth, [bodies.Plane(point=(0, 0, -5e-3))], itself=False)
    weight = cloth.weight(M, ufl.as_vector((0.0, 0.0, -G)))
    run, ledger = cloth.explicit(M, [], [weight, *touch.terms])
    gaps = [touch.least_gap() for _ in run.march(0.06, 2e-3)]
    assert min(gaps) < touch.reach
    assert abs(ledger.totals["imbalance"]) < 0.01 * ledger.most
    assert ledger.totals["by_impact"] == 0.0


@pytest.mark.parametrize("method", ["newmark", "explicit"])
def test_a_fast_sheet_does_not_pass_a_small_ball_in_any_motion(method):
    cloth = square("mitc4", 6, side=0.3)
    ball = bodies.Sphere(0.01, (0.1, 0.12, -0.015), cells=3)
    touch = Contact(cloth, [ball], itself=False, stiffness=1e4)
    weight = cloth.weight(M, ufl.as_vector((0.0, 0.0, -G)))
    run, _ = getattr(cloth, method)(M, [], [weight, *touch.terms])
    run.motion.velocity.x.array[np.array(cloth.q.function_space.sub(0).sub(2).collapse()[1])] = -5.0
    dt = {"dt": 2e-5} if method == "explicit" else {}
    for _ in run.march(4e-3, 1e-3, **dt):
        assert touch.least_gap() > 0.0 and not touch.crossed()


@pytest.mark.parametrize("static", [MU, 0.45])
@pytest.mark.parametrize("triangles", [False, True])
def test_lagged_friction_is_the_slope_of_its_potential(triangles, static):
    cloth = square("mitc4", 4)
    around = [bodies.Sphere(0.1, (0.1, 0.1, -0.1 - 3 * H), cells=8), bodies.Plane(point=(0, 0, -4 * H))]
    if triangles:
        around = [bodies.Body(body.rest, body.faces, body.name) for body in around]
    touch = Contact(cloth, around, friction=MU, static=static, reach=4e-3, creep=1e-4, lagged=True)
    term, near, rng = touch.terms[0], touch._around.collisions, np.random.default_rng(0)
    sheet = slice(None)
    x0, way = near.x.copy(), rng.standard_normal(near.x.shape)

    def at(part):
        near.place(x0 + 1e-4 * part * way)
        return term.potential(), term._forces()

    (low, f0), (high, f1), (_, f) = at(1 - 1e-4), at(1 + 1e-4), at(1.0)
    assert np.sum(f * way) * 2e-8 == pytest.approx(high - low, rel=1e-4) and high > 0.0
    if not triangles:  # those have entries between nodes of the sheet
        way[near.count :], sheet = 0.0, slice(0, 3 * near.count)
        (_, f0), (_, f1), (_, f) = at(1 - 1e-4), at(1 + 1e-4), at(1.0)
    parts = [*term._matrices(), *(near.blocks(block, way.size) for near, block in term._blocks())]
    expected = (sum(parts) @ way.ravel())[sheet]
    assert (f1 - f0).ravel()[sheet] / 2e-8 == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())
    assert term.symmetric and term.dissipated() == pytest.approx(1e-4 * np.sum(f * way))
    with pytest.raises(InputError, match="one coefficient for all directions"):
        Contact(cloth, around, friction=(0.3, 0.2), reach=4e-3, lagged=True)


def test_explicit_steps_shorten_where_a_sheet_is_pressed_hard():
    """A soft barrier is stiff close to a body; with the sheet's own stable step the motion blows up there."""
    cloth = square("mitc4", 3, side=0.3)
    touch = Contact(cloth, [bodies.Plane(point=(0, 0, -5e-3))], itself=False, stiffness=50.0)
    run, ledger = cloth.explicit(M, [], touch.terms)
    run.motion.velocity.x.array[np.array(cloth.q.function_space.sub(0).sub(2).collapse()[1])] = -2.0
    gaps = [touch.least_gap() for _ in run.march(4e-3, 2.5e-4)]
    assert 0.0 < min(gaps) < 0.1 * touch.reach
    assert ledger.totals["kinetic"] == pytest.approx(ledger.most, rel=0.1)
    assert abs(ledger.totals["imbalance"]) < 0.1 * ledger.most
