"""Bodies in closed form: exact distances and tangents, no toolkit, nothing passes, the same as bodies of triangles."""

import sys

import numpy as np
import pytest
import solids
from scipy.spatial.transform import Rotation
from test_contact import SIDE, falling, square

from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.contact.points import Grid
from fabric_fenicsx.contact.shapes import Shape
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.terms import supports

SIDES = ("left", "right", "bottom", "top")
KINDS = [
    bodies.Plane((1, 2, 3), (0.1, 0, 0)),
    bodies.Sphere(0.3, (1, 2, 3)),
    bodies.Capsule(0.2, 0.5, (0, 0, 1), (1, 1, 0)),
    bodies.Cylinder(0.2, 0.5, (0, 0, 1), (1, 1, 0)),
    bodies.Box((0.2, 0.3, 0.5), (1, 1, 1), (0.1, 0.2, 0.3)),
]
every_kind = pytest.mark.parametrize("body", KINDS, ids=lambda body: body.name)


@every_kind
def test_distances_are_exact_and_so_are_their_derivatives(body):
    rng, shape, turn = np.random.default_rng(0), Shape(body), Rotation.from_rotvec([0.3, -0.2, 0.5])
    if isinstance(body, bodies.Plane):
        turn = Rotation.identity()
    corners = turn.apply(body.rest - body.rest.mean(axis=0)) + [0.5, 0, 1]
    pose = shape.pose(corners)
    size, _, _ = shape.distances(corners, pose)
    assert size == pytest.approx(0.0, abs=1e-12), "corners are on it"
    middle, out = corners[body.faces].mean(axis=1), np.linalg.norm(corners - corners.mean(axis=0), axis=1).max()
    x = np.concatenate([middle + rng.normal(size=middle.shape) * out, corners.mean(axis=0) + 2 * out * np.eye(3)])
    size, normals, bend = shape.distances(x, pose, True)
    x, normals, bend = x[size > 1e-3], normals[size > 1e-3], bend[size > 1e-3]
    way, e = rng.normal(size=x.shape), 1e-6
    (after, turned, _), (before, back, _) = (shape.distances(x + s * e * way, pose) for s in (1, -1))
    assert np.einsum("ki,ki->k", normals, way) == pytest.approx((after - before) / (2 * e), abs=1e-7)
    rate, found = (turned - back) / (2 * e), np.einsum("kij,kj->ki", bend, way)
    assert np.median(np.abs(rate - found)) < 1e-7 and np.mean(np.abs(rate - found) < 1e-5) > 0.98, "but at a few kinks"


@pytest.mark.parametrize("n", [1, 2, 5])
def test_points_of_a_sheet_have_its_area_and_each_comes_once(n):
    cloth = square(cells=3)
    touch = Contact(cloth, [bodies.Plane(point=(0, 0, -1))], itself=False)
    grid = Grid(touch.rest, touch._around.skin.faces, n)
    x = np.einsum("ka,kai->ki", grid.shares, touch.rest[grid.nodes])
    assert len(x) == len(np.unique(np.round(x, 9), axis=0)) == (3 * n + 1) ** 2
    assert grid.areas.sum() == pytest.approx(SIDE**2) and grid.areas.min() > 0.0
    assert grid.areas @ x[:, 0] == pytest.approx(SIDE**3 / 2)


def around():
    """Bodies of each kind just below a square of 0.6 m at z = 0."""
    return [
        bodies.Sphere(0.15, (0.1, 0.1, -0.1508)),
        bodies.Capsule(0.1, 0.2, (0.4, 0.1, -0.1008), (1, 0.2, 0)),
        bodies.Cylinder(0.1, 0.2, (0.1, 0.45, -0.1008), (1, 0.5, 0)),
        bodies.Box((0.2, 0.2, 0.1), (0.45, 0.45, -0.0508), (0, 0, 0.3)),
        bodies.Plane(point=(0, 0, -1e-3)),
    ]


def test_without_the_toolkit_forces_and_tangents_are_those_of_the_energy(without_toolkit):
    cloth, some = square(), around()
    touch = Contact(cloth, some, friction=0.3, static=0.4, reach=2e-3, slip=5e-3, itself=False)
    assert touch._around.collisions.kit is None
    near, rng = touch._around.collisions, np.random.default_rng(0)
    for body in some[:-1]:  # led, and turned about their middles
        body.move((1e-4, 2e-4, 0), (0.0, 0.0, 1e-3), tuple(body.rest.mean(axis=0)))
    touch._around.lead()
    shape = touch._around.skin.local.shape
    z, way = 2e-4 * rng.standard_normal(shape) + [3e-4, 1e-4, 0.0], rng.standard_normal(shape)
    for term, now, change, found, expected, slope in solids.derivatives(touch, cloth.q, z, way):
        assert np.linalg.norm(found - expected) < 1e-5 * np.linalg.norm(expected)
        if term.loses == "law":
            assert now @ change == pytest.approx(slope, rel=1e-6)
    # a force on each body is the derivative of the energy by its motion, and all of them those on the sheet
    barrier = touch.terms[-1]
    for body in some:
        part, x, e = touch._part(body), near.x.copy(), 1e-8
        turn = np.zeros(3) if isinstance(body, bodies.Plane) else np.array([0.1, 0.2, 0.3])
        moves = np.cross(turn, x[part] - x[part].mean(axis=0)) + [0.2, 0.1, 1.0]
        found, energies = barrier._forces()[part], []
        assert np.abs(found.sum(axis=0)[2]) > 1e-6
        for step in (e, -e):
            near.place(np.concatenate([x[: part.start], x[part] + step * moves, x[part.stop :]]))
            energies.append(near.energy())
        near.place(x)
        assert np.sum(found * moves) == pytest.approx((energies[0] - energies[1]) / (2 * e), rel=1e-5, abs=1e-8)
    every = touch._all()
    assert every.sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-9)
    assert "ipctk" not in sys.modules or near.kit is None


@pytest.mark.parametrize("speed, dt", [(3.0, 5e-3), (8.0, 1e-2)])
def test_without_the_toolkit_nothing_passes(without_toolkit, speed, dt):
    cloth = square("mitc4", 4)
    touch = Contact(cloth, around()[:-1], friction=0.2, stiffness=1e3, itself=False)
    run, _ = falling(cloth, touch, speed, accuracy=np.inf)
    fine, shapes = Grid(touch.rest, touch._around.skin.faces, 24), [Shape(body) for body in touch.bodies]
    try:
        for _ in run.march(3 * dt, dt):
            assert touch.least_gap() > 0.0 and not touch.crossed()
            x = np.einsum("ka,kai->ki", fine.shares, touch.nodes()[fine.nodes])
            for body, shape in zip(touch.bodies, shapes, strict=True):
                deep = shape.distances(x, shape.pose(body.rest))[0].min()
                if shape.curved > 0.0:
                    assert deep > 0.0, "nor does it between points"
    except StepFailed as error:
        assert touch.least_gap() > 0.0 and "\n" not in str(error)


def test_a_sphere_pushes_as_its_triangles_do():
    found = []
    for triangles in (False, True):
        cloth, ball = square("mitc4", 6), bodies.Sphere(0.15, (0.3, 0.3, -0.155), cells=24)
        if triangles:
            ball = bodies.Body(ball.rest, ball.faces, "ball")
        touch = Contact(cloth, [ball], itself=False, reach=1e-3, stiffness=2e3)
        assert (touch._around.collisions.kit is None) != triangles
        rim = [bc for side in SIDES for bc in supports.hinge(cloth.domain, cloth.space, side)]
        solver = cloth.equilibrium(rim, touch.terms)
        for _ in statics.march(solver, lambda part, ball=ball: ball.move((0, 0, 0.03 * part)), [0.5, 1.0]):
            assert touch.least_gap() > 0.0 and not touch.crossed()
        found.append(touch.force(ball)[2])
        pressed = touch.pressure(ball)
        assert pressed.shape == (len(ball.rest),) and pressed.max() > 0.0 == pressed[ball.rest[:, 2] < -0.2].max()
    assert found[0] == pytest.approx(found[1], rel=0.003) and found[0] < -0.5


def test_what_is_small_against_cells_or_sharp_asks_for_the_toolkit_and_what_keeps_its_shape_does_not_deform(
    without_toolkit,
):
    with pytest.raises(InputError, match="large against its cells"):
        Contact(square(), [bodies.Sphere(0.005, (0.3, 0.3, -0.01))], itself=False)
    with pytest.raises(InputError, match=r"fabric_fenicsx\[contact\]"):
        Contact(square(), [bodies.Ring(0.1, 0.01, (0.3, 0.3, -0.1))], itself=False)
    with pytest.raises(InputError, match="they have no mass"):
        Contact(square(), [bodies.Sphere(0.3, (0.3, 0.3, -0.4)).free(1.0)], itself=False)
    ball = bodies.Sphere(0.1)
    with pytest.raises(InputError, match="keeps its shape"):
        ball.deform(ball.rest)
