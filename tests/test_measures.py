"""Measures of wear: moments at joints and their work, pressure, strain of skin and cloth, slip."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem
from scipy.spatial.transform import Rotation

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments import limbs, measures
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers.marching import march
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

ARM = limbs.arm(size=20e-3)
RNG = np.random.default_rng(0)


@pytest.mark.parametrize("name", ["elbow", "shoulder"])
def test_the_moment_of_forces_beyond_a_joint_is_that_about_its_axis(name):
    x, pose = ARM.pose(elbow=70.0, shoulder=20.0), {"elbow": 70.0, "shoulder": 20.0}
    joint, straight = ARM.joint(name, **pose), -ARM.pose()[:, 2]
    limit = ARM.joints["elbow"].place + ARM._reach(ARM.joints["elbow"]) if name == "elbow" else -1.0
    forces = RNG.standard_normal(x.shape) * (straight > limit)[:, None]
    expected = np.cross(x - joint.centre, forces).sum(axis=0) @ joint.axis
    assert measures.joint_moment(forces, ARM.rates(name, **pose)) == pytest.approx(expected, rel=1e-6)


def test_the_work_of_the_moment_is_that_of_all_forces_over_the_way_of_the_skin():
    forces, angles = RNG.standard_normal((len(ARM.pose()), 3)), np.linspace(0.0, 120.0, 25)
    moments = [measures.joint_moment(forces, ARM.rates("elbow", elbow=angle)) for angle in angles]
    done = measures.work(angles, moments)
    for k in (10, 24):
        assert done[k] == pytest.approx(np.sum(forces * (ARM.pose(elbow=angles[k]) - ARM.pose())), rel=2e-3)
    assert measures.work([0, 90, 0], [1.0, 3.0, 2.0])[-1] == pytest.approx(-np.pi / 4)
    with pytest.raises(InputError, match="2 angles for 3 moments"):
        measures.work([0, 1], [1, 2, 3])


def test_a_skin_is_pressed_by_the_force_on_it():
    ball = bodies.Sphere(0.1, cells=10)
    pressure = np.where(ball.rest[:, 2] > 0.0, 500.0, 0.0)
    found = measures.pressed(pressure, ball.rest, ball.faces)
    assert (found.mean, found.peak) == pytest.approx((500.0, 500.0))
    assert found.area == pytest.approx(2 * np.pi * 0.01, rel=0.1) and found.force == pytest.approx(500 * found.area)
    assert measures.pressed(np.zeros(len(ball.rest)), ball.rest, ball.faces) == measures.Pressed(0.0, 0.0, 0.0, 0.0)


def test_strains_of_skin_and_cloth_are_principal_ones():
    ball = bodies.Box((1, 1, 1), cells=3)
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    stretched = ball.rest @ np.diag([1.2, 0.9, 1.0]) @ turn.T
    found = measures.skin_strain(ball.rest, stretched, ball.faces)
    x = ball.rest[ball.faces]
    top = np.abs(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])[:, 2]) > 1e-6
    assert found[top] == pytest.approx(np.tile([0.22, -0.095], (top.sum(), 1)))
    t = np.radians(25.0)
    axes = np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])
    E = axes.T @ np.diag([0.3, -0.1]) @ axes
    assert measures.cloth_strain(np.array([[E[0, 0], E[1, 1], 2 * E[0, 1]]])) == pytest.approx(np.array([[0.3, -0.1]]))
    # bent, the skin at the elbow's outside is stretched by about half, as Kirk and Ibrahim say
    elbow = ARM.joint("elbow")
    bent = ARM.pose(elbow=90.0)
    outside = measures.near(bent[ARM.faces].mean(axis=1), elbow, 0.08)
    assert 0.3 < measures.skin_strain(ARM.pose(), bent, ARM.faces)[outside, 0].max() < 3.0


def test_yarns_beyond_the_measured_range_are_told():
    muslin = fabrics.load("muslin")
    a, b, c = muslin.warp.limit, muslin.weft.limit, muslin.shear.limit
    strain = np.array([[0.9 * a, 0.9 * b, 0.9 * c], [1.1 * a, 0, 0], [0, 1.1 * b, 0], [-2 * a, -2 * b, -1.1 * c]])
    expected = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    found = measures.beyond(strain, muslin)
    assert (found == expected).all()
    assert measures.share(found.any(axis=1), np.array([1.0, 2.0, 3.0, 4.0]), MPI.COMM_SELF) == pytest.approx(0.9)


def test_what_goes_with_a_body_does_not_slip_on_it_and_what_is_held_slips_by_its_way():
    ball = bodies.Sphere(0.1, cells=6)
    touch = SimpleNamespace(touching=lambda body: np.array([True, False, True]))
    held = np.array([[0, 0, 0.102], [0.3, 0, 0], [0.102, 0, 0]])
    touch.nodes, touch.places = lambda: held, lambda body: body.target
    still = measures.Slip(touch, ball)
    for k in range(1, 11):
        ball.move(turn=(0, 0, 0.01 * k))
        still.step()
    # at the pole the body turns about the node, on the equator it passes by
    assert still.way == pytest.approx([0.0, 0.0, 0.102 * 0.1], abs=1.5e-4)
    ball.move()
    touch.nodes = lambda: Rotation.from_rotvec([0.2, 0.1, 0.3] * np.array(touch.part)).apply(held) + [0, 0, touch.part]
    touch.part = 0.0
    along = measures.Slip(touch, ball)
    for touch.part in np.linspace(0, 0.1, 11)[1:]:
        ball.move((0, 0, touch.part), touch.part * np.array([0.2, 0.1, 0.3]))
        along.step()
    assert along.way == pytest.approx(0.0, abs=1e-9)


def square():
    domain = meshing.read(meshing.MESHES / "square.geo", MPI.COMM_SELF, side=0.3, n=4, triangles=0)
    return sheet.Sheet(domain, StVenantKirchhoff.isotropic(8e6, 0.25), 4e-4, (3.2e6, 3.2e6), element="mitc4")


def test_forces_on_a_body_are_those_of_its_energy():
    cloth = square()
    ball = bodies.Sphere(0.1, (0.15, 0.15, -0.102), cells=8)
    ball = bodies.Body(ball.rest, ball.faces, "ball")
    touch = Contact(cloth, [ball], reach=3e-3)
    forces = touch.forces(ball)
    assert forces.sum(axis=0) == pytest.approx(touch.force(ball)) and forces[:, 2].sum() < -1e-4
    assert forces.sum(axis=0) == pytest.approx(-touch.forces().sum(axis=0))
    assert touch.nodes() == pytest.approx(touch.rest)
    pressed = touch.pressure() > 0.0
    assert (touch.touching(ball) == pressed).all() and 0 < pressed.sum() < len(pressed)
    way, near = RNG.standard_normal(ball.rest.shape), touch._around.collisions
    energies = []
    for step in (1e-8, -1e-8):
        near.place(np.concatenate([touch.rest, ball.rest + step * way]))
        energies.append(near.energy())
    assert np.sum(forces * way) == pytest.approx(-(energies[0] - energies[1]) / 2e-8, rel=1e-5)
    assert measures.middles(cloth).mean(axis=0) == pytest.approx([0.15, 0.15, 0.0])


def test_work_of_all_bodies_is_what_the_ledger_takes_in_and_what_a_sheet_at_rest_stores():
    """A ball rises into a sheet between two hinges, another one slides under it."""
    cloth = square()
    balls = [bodies.Sphere(0.1, (0.15, 0.15, -0.103), cells=8), bodies.Sphere(0.05, (0.05, 0.05, -0.053), cells=8)]
    touch = Contact(cloth, balls, reach=3e-3, itself=False)
    ends = "bottom", "top"
    held = [bc for end in ends for bc in supports.hinge(cloth.domain, cloth.space, end)]

    def lead(t):
        balls[0].move((0, 0, 0.02 * t))
        balls[1].move((0.03 * t, 0.01 * t, 0.01 * t))

    solver = cloth.equilibrium(held, touch.terms)
    effort, moments = measures.Effort(touch, solver), []
    for _ in march(solver, lead, np.linspace(0, 1, 21)):
        effort.step()
        moments.append(-touch.force(balls[0])[2])
    assert solver.descends and effort.work == pytest.approx(effort.stored, rel=1e-2) and effort.stored > 1e-3
    assert effort.work_on[0] == pytest.approx(np.trapezoid(moments, dx=1e-3), rel=1e-6) and effort.work_on[1] > 0.0

    cloth = square()
    for ball in balls:
        ball.move()
    touch = Contact(cloth, balls, reach=3e-3, itself=False)
    held = [bc for end in ends for bc in supports.hinge(cloth.domain, cloth.space, end)]
    run, ledger = cloth.newmark(0.2, held, touch.terms, set_load=lambda t: lead(2 * t**2), accuracy=np.inf)
    before, taken, work = [touch.places(ball) for ball in balls], [], []
    for step in run.march(0.1, 0.02):
        work.append(sum(on(touch, ball, x) for ball, x in zip(balls, before, strict=True)))
        before = [touch.places(ball) for ball in balls]
        taken.append(ledger.totals["external"])
        assert step.step_cuts == 0
    assert np.diff(taken) == pytest.approx(work[1:], rel=1e-9) and min(work) > 0.0


def test_what_a_snap_gives_up_is_told_apart_from_the_error_of_steps():
    """A sheet that is bowed up between two hinges is pushed through by a ball, elastic and without friction."""
    cloth, ball = square(), bodies.Sphere(0.05, (0.15, 0.15, 0.08), cells=8)
    touch = Contact(cloth, [ball], reach=3e-3, itself=False)
    closing = fem.Constant(cloth.domain.mesh, 0.0)
    held = supports.hinge(cloth.domain, cloth.space, "bottom")
    held += supports.lead(cloth.domain, cloth.space, "top", 1, closing)
    held += [bc for k in (0, 2) for bc in supports.lead(cloth.domain, cloth.space, "top", k, 0.0)]
    solver = cloth.equilibrium(held, touch.terms)
    solver.u.x.array[supports.unknowns(cloth.domain, cloth.space, "sheet", 2)] += 1e-4
    effort, rows = measures.Effort(touch, solver), []

    def lead(t):
        closing.value = -3e-3 * min(t, 1.0)
        ball.move((0.0, 0.0, -0.05 * max(t - 1.0, 0.0)))

    for step in march(solver, lead, [*np.linspace(0, 1, 6)[1:], *np.linspace(1, 2, 51)[1:]]):
        if step.load >= 1.0:
            effort.step()
            rows.append((effort.work, effort.released, effort.snapped, touch.force(ball)[2]))
    work, released, snapped, pushed = np.array(rows).T
    last, at = work[-1], int(np.diff(released).argmax())
    assert np.abs(released[: at + 1]).max() < 0.02 * last  # all is stored up to there
    assert snapped[-1] > 0.1 * last and snapped[-1] == pytest.approx(released[-1], abs=0.04 * last)
    assert pushed[at] > 0.0 and abs(pushed[at + 1]) < 0.1 * pushed[at]


def on(touch, ball, before):
    """Work of who leads a ball in a step, by the force at its end."""
    return -np.sum(touch.forces(ball) * (touch.places(ball) - before))
