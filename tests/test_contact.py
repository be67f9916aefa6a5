"""Contact with bodies: forces from an energy, nothing passes, energy and momentum, closed forms, one and two ranks."""

import subprocess
import sys

import numpy as np
import pytest
import solids
import ufl
from mpi4py import MPI
from dolfinx import fem
from hypothesis import given, settings
from hypothesis import strategies as some
from scipy.spatial.transform import Rotation

from fabric_fenicsx import sheet
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.collisions import Collisions
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.contact.triangles import areas_of_corners, squares
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

H, M, G = 4e-4, 0.224, 9.81
SIDE = 0.6


def square(element="mitc4", cells=6, comm=MPI.COMM_SELF, side=SIDE, E=8e6):
    """An elastic square at z = 0, a corner of which is the origin; "membrane" too."""
    triangles = int(element == "regge")
    domain = meshing.read(meshing.MESHES / "square.geo", comm, side=side, n=cells, triangles=triangles)
    law = StVenantKirchhoff.isotropic(E, 0.25)
    if element == "membrane":
        return sheet.Sheet(domain, law, H, kinematics="membrane")
    return sheet.Sheet(domain, law, H, (E / 2.5, E / 2.5), element=element)


def falling(cloth, touch, speed=0.0, **options):
    """A sheet that moves down at this speed, under its weight, and its ledger."""
    weight = cloth.weight(M, ufl.as_vector((0.0, 0.0, -G)))
    run, ledger = cloth.newmark(M, [], [weight, *touch.terms], **options)
    heights = np.array(cloth.q.function_space.sub(0).sub(2).collapse()[1])
    run.motion.velocity.x.array[heights] = -speed
    return run, ledger


@pytest.mark.parametrize(
    "body, volume",
    [
        (bodies.Sphere(1.0, (1, 2, 3), cells=24), 4 / 3 * np.pi),
        (bodies.Box((1, 2, 3), (1, 1, 1), (0.1, 0.2, 0.3), cells=3), 6.0),
        (bodies.Cylinder(1.0, 2.0, (0, 0, 1), (1, 1, 0), cells=24), 2 * np.pi),
        (bodies.Capsule(1.0, 2.0, (0, 0, 1), (1, 1, 0), cells=24), (2 + 4 / 3) * np.pi),
        (bodies.Ring(1.0, 0.2, (0, 0, 1), (1, 1, 0), cells=48), 2 * np.pi**2 * 0.04),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_a_body_is_closed_faces_outward_and_has_its_volume(body, volume):
    x = body.rest[body.faces]
    assert np.einsum("ij,ij", x[:, 0], np.cross(x[:, 1], x[:, 2])) / 6 == pytest.approx(volume, rel=5e-3)
    sides = np.sort(body.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(sides, axis=0, return_counts=True)
    assert (counts == 2).all()
    assert len(body.rest) - len(counts) + len(body.faces) == (0 if isinstance(body, bodies.Ring) else 2)
    turned = body.rest.copy()
    body.move((1, 0, 0), (0, 0, np.pi / 2), (1, 0, 0))
    assert body.target == pytest.approx(np.column_stack([2 - turned[:, 1], turned[:, 0] - 1, turned[:, 2]]))
    body.move()


@pytest.mark.parametrize("element", ["mitc4", "regge", "membrane"])
def test_forces_are_derivatives_of_the_energy_and_have_their_stiffness(element):
    cloth = square(element)
    around = [
        bodies.Sphere(0.15, (0.3, 0.3, -0.151)),
        bodies.Plane(point=(0, 0, -1.4e-3)),
        bodies.Plane((0, 0, -1), (0, 0, 1.2e-3)),
    ]
    touch = Contact(cloth, around, friction=0.3, static=0.4, reach=2e-3, slip=5e-3)
    local, rng = touch._around.skin.local, np.random.default_rng(0)
    z, way = 2e-4 * rng.standard_normal(local.shape) + [3e-4, 1e-4, 0.0], rng.standard_normal(local.shape)
    for term, now, change, found, expected, slope in solids.derivatives(touch, cloth.q, z, way):
        assert np.linalg.norm(found - expected) < 1e-6 * np.linalg.norm(expected)
        assert not term.pattern_changed
        if term.loses == "law":
            assert now @ change == pytest.approx(slope, rel=1e-6)
        else:
            assert now[local].ravel() @ z.ravel() == pytest.approx(term.dissipated(), rel=1e-12)
            assert term.dissipated() > 0.0
    # action and reaction
    assert sum(touch.force(body) for body in around) == pytest.approx(-touch.forces().sum(axis=0), rel=1e-9)


@pytest.mark.parametrize("element, cells", [("mitc4", 4), ("regge", 3), ("mitc4", 9)])
def test_a_plane_presses_by_its_stiffness_at_half_the_reach(element, cells):
    cloth = square(element, cells)
    touch = Contact(cloth, [bodies.Plane(point=(0, 0, -H - 0.5e-3))], reach=1e-3, stiffness=1e3)
    assert touch.least_gap() == pytest.approx(0.5e-3)
    assert touch.force(touch.bodies[0]) == pytest.approx([0, 0, -1e3 * SIDE**2])
    assert touch.moment(touch.bodies[0], (SIDE / 2, SIDE / 2, 0)) == pytest.approx([0, 0, 0], abs=1e-9)
    assert touch.pressure() == pytest.approx(1e3)
    assert np.isnan(touch.pressure(touch.bodies[0])).all()


@pytest.mark.parametrize("below", [True, False])
def test_the_pressure_times_the_area_is_the_force_on_sheet_and_body(below):
    cloth, gap = square(cells=6), 0.4e-3
    sign = 1 if below else -1
    box = bodies.Box((0.9, 0.9, 0.1), (0.3, 0.3, -sign * (H + gap + 0.05)), cells=8)
    around = [box, bodies.Plane((0, 0, -sign), (0, 0, sign * (H + 0.7e-3)))]
    touch = Contact(cloth, around, reach=1e-3, stiffness=1e3, itself=False)
    x, force = touch.rest, np.abs([touch.force(body)[2] for body in around])
    area = np.full(len(x), (SIDE / 6) ** 2)
    area /= np.where(np.isclose(np.abs(x[:, 0] - 0.3), 0.3), 2, 1) * np.where(
        np.isclose(np.abs(x[:, 1] - 0.3), 0.3), 2, 1
    )
    assert force[0] > force[1] > 0.0
    # what presses from both sides counts once; triangles of two around a corner are not a quarter of four squares
    assert touch.pressure() @ area == pytest.approx(force.max(), rel=0.1)
    pressed = touch.pressure(box)
    assert (
        pressed.shape == (len(box.rest),)
        and (pressed[np.isclose(sign * box.rest[:, 2], box.rest[:, 2].min())] == 0).all()
    )
    assert touch.places(box) == pytest.approx(box.rest)
    assert [*touch.row()][:3] == ["least_gap_m", "box_x_N", "box_y_N"]


@pytest.mark.parametrize("element", ["mitc4", "regge"])
@pytest.mark.parametrize("rho", [1.0, 0.6])
def test_a_flat_drop_makes_no_energy_and_comes_to_rest_with_its_weight_on_the_plane(element, rho):
    cloth = square(element, 3)
    touch = Contact(cloth, [bodies.Plane(point=(0, 0, -5e-3))], itself=False, reach=1e-3)
    run, ledger = falling(cloth, touch, rho=rho, rtol=1e-9)
    totals = []
    for _ in run.march(0.15, 5e-3):
        assert touch.least_gap() > 0.0
        totals.append(ledger.totals)
    impact = np.array([t["by_impact"] for t in totals])
    assert (np.diff(impact) > -1e-12).all()
    assert impact[-1] > 0.9 * M * SIDE**2 * G * 5e-3 * 0.5
    assert abs(ledger.totals["imbalance"]) < 1e-6 * ledger.most
    assert ledger.totals["kinetic"] < 1e-3 * ledger.most
    assert touch.force(touch.bodies[0])[2] == pytest.approx(-M * SIDE**2 * G, rel=0.05)


@pytest.fixture
def gaps(monkeypatch):
    """Least gaps of all states in which anything is evaluated, m."""
    found, place = [], Collisions.place

    def placed(self, x):
        result = place(self, x)
        found.append(min(self.gaps.least(), self._apart()))
        return result

    monkeypatch.setattr(Collisions, "place", placed)
    return found


def above_a_ball(triangles):
    """A sheet, held at its rim, which `height` moves, and a ball 2 mm below it."""
    cloth, ball = square("mitc4", 4), bodies.Sphere(0.15, (0.3, 0.3, -0.152), cells=24)
    if triangles:
        pytest.importorskip("ipctk")
        ball = bodies.Body(ball.rest, ball.faces, "ball")
    height, rim = fem.Constant(cloth.domain.mesh, 0.0), []
    for side in ("left", "right", "bottom", "top"):
        rim += supports.hinge(cloth.domain, cloth.space, side)[:2]
        rim += supports.lead(cloth.domain, cloth.space, side, 2, height)
    return cloth, ball, Contact(cloth, [ball], itself=False, reach=1e-3, stiffness=1e4), rim, height


@pytest.mark.parametrize("triangles", [False, True])
def test_a_body_is_led_from_where_the_sheet_is_also_where_its_velocity_is_no_guide(triangles, gaps):
    """Where the velocity leads strains too much: the sheet does not go there, and a ball does not follow it."""
    cloth, ball, touch, rim, _ = above_a_ball(triangles)
    run, _ = cloth.newmark(M, rim, touch.terms, set_load=lambda t: ball.move((0.0, 0.0, 1.2 * t)), accuracy=np.inf)
    velocity = run.motion.velocity.x.array
    for k, most in enumerate((5.0, 5.0, 0.0)):
        own = np.array(cloth.q.function_space.sub(0).sub(k).collapse()[1])
        velocity[own] = np.random.default_rng(k).uniform(-most, most, len(own)) if most else 3.0
    velocity[run.solver._given] = 0.0
    for _ in run.march(0.012, 4e-3):
        assert not touch.crossed()
    assert min(gaps) > 0.0 and len(gaps) > 10


@pytest.mark.parametrize("triangles", [False, True])
def test_supports_and_a_body_meet_half_way_without_passing(triangles, gaps):
    cloth, ball, touch, rim, height = above_a_ball(triangles)

    def set_load(t):
        height.value = -0.25 * t
        ball.move((0.0, 0.0, 0.25 * t))

    run, _ = cloth.newmark(M, rim, touch.terms, set_load=set_load, accuracy=np.inf)
    for _ in run.march(0.024, 6e-3):
        assert not touch.crossed()
    assert min(gaps) > 0.0 and np.isfinite(gaps[-1])


@settings(max_examples=3)
@given(
    speed=some.floats(0.5, 10.0),
    step=some.floats(1e-3, 2e-2),
    radius=some.floats(0.01, 0.2),
    at=some.tuples(some.floats(0.1, 0.5), some.floats(0.1, 0.5)),
    cells=some.integers(2, 6),
)
def test_a_sheet_never_passes_through_a_ball_or_a_corner(speed, step, radius, at, cells):
    cloth = square("mitc4", cells)
    ball, box = bodies.Sphere(radius, (*at, -radius - 2e-3), cells=4), bodies.Box((1, 1, 0.1), (0.55, 0, -0.06))
    touch = Contact(cloth, [ball, box], friction=0.2, stiffness=1e3)
    run, _ = falling(cloth, touch, speed, accuracy=np.inf)
    try:
        for _ in run.march(6 * step, step):
            assert touch.least_gap() > 0.0 and not touch.crossed()
    except StepFailed:
        assert touch.least_gap() > 0.0 and not touch.crossed()


@pytest.mark.parametrize("rho, a, dt", [(0.0, 10.0, 2e-2), (0.5, 60.0, 1e-2)])
def test_damping_bears_nothing_of_a_sheet_at_rest(rho, a, dt):
    cloth = square(cells=2)
    touch = Contact(cloth, [bodies.Plane(point=(0, 0, -H - 1e-3))], itself=False, reach=2e-3, stiffness=M * G)
    weight = cloth.weight(M, ufl.as_vector((0.0, 0.0, -G)))
    drag = fem.Constant(cloth.domain.mesh, -0.5 * a * M) * ufl.inner(cloth.velocity, cloth.v) * cloth.dx
    run, ledger = cloth.newmark(M, [], [weight, drag, *touch.terms], rho=rho, damping=0.5 * a, rtol=1e-9)
    found = [touch.force(touch.bodies[0])[2] for _ in run.march(40 * dt, dt)]
    assert found[-1] == pytest.approx(-M * SIDE**2 * G, rel=1e-6)
    assert abs(ledger.totals["imbalance"]) < 1e-3 * ledger.most


def test_a_strip_lifted_off_a_plane_weighs_as_in_theory():
    """l = (24 D d/q)^(1/4), and half the weight of this length lifts, for small slopes and a hard plane."""
    length, width, E = 1.0, 0.05, 4e9
    domain = meshing.read(meshing.MESHES / "strip.geo", MPI.COMM_SELF, length=length, width=width, nx=80, ny=1)
    strip = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, 0.0), H, (E / 2, E / 2))
    plane = bodies.Plane(point=(0, 0, -1.5 * H))
    touch = Contact(strip, [plane], itself=False, reach=H, stiffness=M * G)
    weight, lift = strip.weight(M, ufl.as_vector((0, 0, -G))), fem.Constant(domain.mesh, 0.0)
    held = supports.lead(domain, strip.space, "sheet", 1, 0.0) + supports.lead(domain, strip.space, "fixed_end", 0, 0.0)
    solver = strip.equilibrium(held + supports.lead(domain, strip.space, "pulled_end", 2, lift), [weight, *touch.terms])

    def set_load(height):
        lift.value = height

    end = supports.unknowns(domain, strip.space, "pulled_end", 2)
    for step in statics.march(solver, set_load, [0.0, 1e-3, 5e-3, 1e-2]):
        force, q, D = solver.reaction(end), M * G * width, E * H**3 / 12 * width
        assert force - touch.force(plane)[2] == pytest.approx(q * length, rel=1e-6)
        if step.load >= 5e-3:
            free = (24 * D * step.load / q) ** 0.25
            assert force == pytest.approx(q * free / 2, rel=0.01)


def test_a_led_body_takes_the_sheet_along_and_its_work_is_the_ledgers():
    cloth = square("mitc4", 6)
    ball = bodies.Sphere(0.1, (0.3, 0.3, -0.105))
    touch = Contact(cloth, [ball], friction=0.3)
    rim = supports.hinge(cloth.domain, cloth.space, "left") + supports.hinge(cloth.domain, cloth.space, "right")

    def set_load(t):
        ball.move((0.0, 0.0, 0.02 * (1 - np.cos(np.pi * t / 0.1))))

    run, ledger = cloth.newmark(M, rim, touch.terms, set_load=set_load, accuracy=np.inf)
    work = before = 0.0
    for step in run.march(0.05, 2.5e-3):
        assert touch.least_gap() > 0.0 and not touch.crossed() and step.step_cuts == 0
        height = 0.02 * (1 - np.cos(np.pi * step.load / 0.1))
        work -= touch.force(ball)[2] * (height - before)
        before = height
    assert touch.force(ball)[2] < -0.3
    assert ledger.totals["external"] == pytest.approx(work, rel=0.02)
    assert abs(ledger.totals["imbalance"]) < 0.015 * ledger.most, "which goes with the square of the step"


def test_a_body_that_the_sheet_holds_back_fails_the_step_and_goes_nowhere():
    cloth = square("mitc4", 4)
    table, press = bodies.Plane(point=(0, 0, -2e-3)), bodies.Box((0.2, 0.2, 0.1), (0.3, 0.3, 0.052), cells=2)
    touch = Contact(cloth, [table, press], itself=False)
    solver = cloth.equilibrium(supports.hinge(cloth.domain, cloth.space, "left"), touch.terms)

    def set_load(part):
        press.move((0, 0, -part * 0.01))

    with pytest.raises(StepFailed, match=r"held back|Newton"):
        for _ in statics.march(solver, set_load, [1.0], smallest=1 / 8):
            pass
    assert touch.least_gap() > 0.0 and not touch.crossed()
    assert press.target[:, 2].min() > -2e-3


def test_a_start_across_a_body_or_within_the_offset_is_refused():
    for height in (0.0, -0.5 * H):
        with pytest.raises(InputError, match=r"starts across a body or itself, or nearer than the offset of 0\.0004 m"):
            Contact(square(), [bodies.Sphere(0.1, (0.3, 0.3, height - 0.1))])
    with pytest.raises(InputError, match="take larger cells"):
        Contact(square(), [], reach=0.2)
    with pytest.raises(InputError, match="reach = -1"):
        Contact(square(), [], reach=-1.0)
    with pytest.raises(InputError, match="0 <= friction <= static"):
        Contact(square(), [], friction=0.3, static=0.2)
    with pytest.raises(InputError, match="cannot be turned"):
        bodies.Plane().move((0, 0, 1), (1, 0, 0))


def test_without_the_toolkit_a_sentence_says_what_to_install(without_toolkit):
    with pytest.raises(InputError, match=r"fabric_fenicsx\[contact\]"):
        Contact(square(), [bodies.Plane(point=(0, 0, -1))])


def test_a_scene_without_contact_does_not_load_the_toolkit_nor_any_of_this():
    code = "import sys, fabric_fenicsx.scenes, fabric_fenicsx.sheet; print(*sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "ipctk" not in said and "fabric_fenicsx.contact.collisions" not in said


@pytest.mark.parallel
@pytest.mark.parametrize("element", ["mitc4", "regge"])
def test_ranks_do_not_change_the_answer(element):
    results = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        cloth = square(element, 4, comm)
        ball = bodies.Sphere(0.15, (0.3, 0.3, -0.155))
        touch = Contact(cloth, [ball, bodies.Plane(point=(0, 0, -0.02))], friction=0.3)
        run, ledger = falling(cloth, touch, 1.0, accuracy=np.inf, rtol=1e-10)
        least = min(touch.least_gap() for _ in run.march(0.03, 2.5e-3))
        assert least > 0.0
        results.append([*touch.force(ball)[2:], *touch.forces().sum(axis=0), *ledger.totals.values(), least])
    assert results[0] == pytest.approx(results[1], rel=1e-8, abs=1e-11)


def test_edges_on_one_line_do_not_meet():
    """The toolkit takes these two, 1e-8 of their length off one line, for crossing, and pushes without end."""
    pytest.importorskip("ipctk")
    x = np.zeros((8, 3))
    x[:4, 0] = 7.191241783703964e-11, -7.886284282291086e-12, -4.35671576547813e-11, -2.9981732422289675e-12
    x[:4, 1] = -0.02000000000664046, -0.013333333328250511, -0.0066666666567194565, 4.102691968635036e-13
    x[4:] = x[:4] + [0.01, 0.0, 0.0]
    faces = np.array([[0, 1, 4], [1, 5, 4], [1, 2, 5], [2, 6, 5], [2, 3, 6], [3, 7, 6]])
    near = Collisions(np.round(x, 4), faces, [], True, 2.8e-4, 1.4e-3, 1.0)
    near.place(x)
    assert near.least_gap() == np.inf and not near.gradient().any()
    assert near.free_part(x, x + 1e-5 * np.arange(24).reshape(8, 3)) == 1.0


def flat(cells, size, turn=0.0, middle=(0.0, 0.0, 0.0)):
    """Corners and triangles of a square of this size, turned about z."""
    s = np.linspace(-size / 2, size / 2, cells + 1)
    x = np.stack([*np.meshgrid(s, s, indexing="ij"), np.zeros((cells + 1, cells + 1))], axis=-1).reshape(-1, 3)
    return x @ Rotation.from_rotvec([0, 0, turn]).as_matrix().T + middle, squares(cells + 1, cells + 1)


def pressed(body, gap, slope=0.0):
    """Pressure of a flat sheet of 20 mm cells at a gap, as a part of the reach, over the stiffness; all is inclined."""
    rest, faces = flat(10, 0.2)
    reach, frame = 2e-3, Rotation.from_rotvec([slope, 0.5 * slope, 0]).as_matrix()
    body = bodies.Body(body.rest @ frame.T, body.faces, "body")
    near = Collisions(rest, faces, [body], False, 4e-4, reach, 1.0)
    near.place(np.concatenate([(rest + [0, 0, 4e-4 + gap * reach]) @ frame.T, body.rest]))
    return -(near.gradient()[: len(rest)] @ frame)[:, 2].sum() / 0.2**2


@pytest.mark.parametrize("slope", [0.0, 0.7])
@pytest.mark.parametrize("turn", [0.0, 0.9])
@pytest.mark.parametrize("ratio", [8, 2, 1, 0.5, 0.25, 0.125])
def test_pressure_does_not_hang_on_the_cells_of_a_flat_body(ratio, turn, slope):
    """At half the reach it is the stiffness; nearer it is that of the same barrier."""
    pytest.importorskip("ipctk")
    cells = int(np.ceil(0.5 / 0.02 / ratio))
    table = bodies.Body(*flat(cells, cells * 0.02 * ratio, turn, (0.003, 0.001, 0.0)), "table")
    assert pressed(table, 0.5, slope) == pytest.approx(1.0, abs=0.05)
    assert pressed(table, 0.1, slope) == pytest.approx(16.7, rel=0.05)


@pytest.mark.parametrize("cells", [1, 3, 8, 24])
@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_pressure_on_a_box_does_not_hang_on_its_cells_and_ends_at_its_edges(cells, turn):
    pytest.importorskip("ipctk")
    large = bodies.Box((0.5, 0.5, 0.1), (0.01, 0.02, -0.05), (0, 0, turn), cells=cells)
    small = bodies.Box((0.1, 0.1, 0.1), (0.003, 0.002, -0.05), (0, 0, turn), cells=cells)
    half = bodies.Box((0.5, 0.5, 0.1), (0.25, 0.0, -0.05), cells=cells)
    assert pressed(large, 0.5) == pytest.approx(1.0, abs=0.05)
    assert 1.0 < 4 * pressed(small, 0.5) < 1.5, "within a cell of its edges it is more, since they press too"
    assert 1.0 < 2 * pressed(half, 0.5) < 1.3


@pytest.mark.parametrize("cells", [24, 48])
@pytest.mark.parametrize("fine", [10, 40])
def test_pressure_on_a_round_body_stays_below_twice_the_stiffness(cells, fine):
    """A cap of sheet, at half the reach all over; the triangles of a ball are somewhat inside it."""
    pytest.importorskip("ipctk")
    radius, ball = 0.15, bodies.Sphere(0.15, (0, 0, -0.15), cells=cells)
    x, faces = flat(fine, 0.06, 0.2)
    x[:, 2] = np.sqrt((radius + 1.4e-3) ** 2 - np.sum(x**2, axis=1)) - radius
    near = Collisions(x, faces, [bodies.Body(ball.rest, ball.faces, "ball")], False, 4e-4, 2e-3, 1.0)
    near.place(np.concatenate([x, ball.rest]))
    outward = (x + [0, 0, radius]) / (radius + 1.4e-3)
    assert 0.9 < -np.sum(near.gradient()[: len(x)] * outward) / areas_of_corners(x, faces).sum() < 2.0


@pytest.mark.parametrize("turn", [0.0, 0.4])
@pytest.mark.parametrize("cells", [10, 13, 23])
def test_pressure_of_two_layers_stays_below_twice_the_stiffness(cells, turn):
    pytest.importorskip("ipctk")
    (a, below), (b, above) = flat(10, 0.2), flat(cells, 0.2, turn, (0, 0, 1.4e-3))
    rest, faces = np.concatenate([a, b]), np.concatenate([below, above + len(a)])
    near = Collisions(rest, faces, [], True, 4e-4, 2e-3, 1.0)
    near.place(rest.copy())
    assert 1.0 < -near.gradient()[len(a) :, 2].sum() / 0.2**2 < 1.7
