"""Rigid edges and sheets: their turn, exact tangents, closed forms at rest and in motion, checkpoints, refusals."""

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.scenes import building, reading, running
from fabric_fenicsx.shell import bodies
from fabric_fenicsx.solvers import checkpoint, linear, statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

COMM = MPI.COMM_WORLD
LENGTH, WIDTH, H, E, MASS = 0.2, 0.05, 1e-3, 1e6, 0.3
ELEMENTS = pytest.mark.parametrize("element", ["mitc4", "regge", "p2cr1"])


def strip(element="mitc4", comm=COMM, nu=0.0, group="pulled_end", **size):
    """A strip along x with a rigid end, or another rigid group, and this body."""
    size = {"length": LENGTH, "width": WIDTH, "nx": 8, "ny": 2, "triangles": int(element != "mitc4")} | size
    domain = meshing.read(meshing.MESHES / "strip.geo", comm, **size)
    law = StVenantKirchhoff.isotropic(E, nu)
    cloth = sheet.Sheet(domain, law, H, (E / 2 / (1 + nu),) * 2, element=element)
    return cloth, supports.rigid(domain, cloth.space, group)


class Loads:
    """A dead force (N) and a dead moment (N m) on the rigid end, and their virtual work."""

    def __init__(self, cloth):
        mesh = cloth.domain.mesh
        self.force, self.moment = (fem.Constant(mesh, np.zeros(3)) for _ in range(2))
        end, points = (supports.over(cloth.domain, "pulled_end", degree) for degree in (2, 1))
        f, m = self.force / WIDTH, self.moment / WIDTH
        self.work = weakform.traction(f, cloth.v, end) + weakform.edge_moment(m, cloth.director, cloth.delta, points)
        self.work += weakform.drilling_moment(m, cloth.u, cloth.v, cloth.director, cloth.delta, points)


def middle(cloth, body):
    """The middle of a body at rest and now, and its turn; on every rank."""
    q, size = cloth.q.x.array, cloth.q.function_space.dofmap.index_map.size_local
    own = body.nodes[:, 0] < size
    x, d = supports.places(cloth.space)[body.nodes[own, 0]], q[body.directors[body.directors[:, 0] < size]]
    parts = cloth.domain.mesh.comm.allgather((x, x + q[body.nodes[own]], d))
    before, now, d = (np.concatenate([part[k] for part in parts]) for k in range(3))
    assert np.abs(d - d[0]).max() < 1e-12, "directors stay parallel"
    arms, turned = before - before.mean(axis=0), now - now.mean(axis=0)
    turn, _ = Rotation.align_vectors([*turned, LENGTH * d[0]], [*arms, (0, 0, LENGTH)])
    assert np.abs(turn.apply(arms) - turned).max() < 1e-12, "distances stay"
    return before.mean(axis=0), now.mean(axis=0), turn


vectors = st.tuples(*[st.floats(-1.7, 1.7)] * 3).map(np.array)


@given(vectors, vectors, vectors)
def test_a_turn_and_its_derivatives(w, v, r):
    """The turn is SciPy's; its two derivatives are those of differences."""
    here, slope = bodies.turned(w, v[None])
    assert np.abs(here[0] - Rotation.from_rotvec(w).apply(v)).max() < 1e-14
    bend = bodies.second(w, v[None], r[None])
    for k, e in enumerate(1e-5 * np.eye(3)):
        (more, up), (less, down) = (bodies.turned(w + sign * e, v[None]) for sign in (1, -1))
        assert np.abs((more - less)[0] / 2e-5 - slope[0, :, k]).max() < 1e-8
        assert np.abs(r @ (up - down)[0] / 2e-5 - bend[k]).max() < 1e-8


@pytest.mark.parallel(first=1)
@ELEMENTS
def test_the_tangent_is_exact_at_any_turn(element):
    """Taylor remainders of order 2, in all unknowns, under forces and moments, far from rest."""
    cloth, _ = strip(element, nx=4)
    loads = Loads(cloth)
    loads.force.value[:], loads.moment.value[:] = (1.0, -0.5, 0.3), (0.05, 0.02, -0.04)
    held = supports.clamp(cloth.domain, cloth.space, "fixed_end")
    solver = cloth.equilibrium(held, loads.work)
    x, rng = solver.begin().copy(), np.random.default_rng(COMM.rank)
    free = np.setdiff1d(np.arange(x.local_size), solver._given)
    x.array_w[free] += 0.5 * rng.standard_normal(len(free)) * np.where(np.isin(free, solver.displacements), 0.01, 1.0)
    way = x.duplicate()
    way.array_w[free] = 0.01 * rng.standard_normal(len(free))
    start, change = solver.residual(x).copy(), x.duplicate()
    solver.factorised().getOperators()[0].mult(way, change)
    left = []
    for step in 0.1 * 0.5 ** np.arange(4):
        rest = (solver.residual(x + way * float(step)) - start - change * float(step)).array_r[free]
        left.append(np.sqrt(COMM.allreduce(float(rest @ rest))))
    orders = np.log2(np.array(left[:-1]) / left[1:])
    assert 1.9 < orders.min() and orders.max() < 2.1


@pytest.mark.parallel(first=1)
@ELEMENTS
def test_a_moment_on_a_rigid_end_bends_a_strip_to_an_arc(element):
    """Half a circle: x = sin(a)/K, z = (1 - cos a)/K with K = M/(E h^3/12 b) and a = K L."""
    cloth, body = strip(element, nx=16)
    loads = Loads(cloth)
    solver = cloth.equilibrium(supports.clamp(cloth.domain, cloth.space, "fixed_end"), loads.work, rtol=1e-9)

    def bend(angle):
        loads.moment.value[1] = -angle / LENGTH * E * H**3 / 12 * WIDTH

    for step in statics.march(solver, bend, np.linspace(0, np.pi, 7)[1:]):
        a = step.load
        _, (x, y, z), turn = middle(cloth, body)
        assert np.hypot(x - LENGTH * np.sin(a) / a, z - LENGTH * (1 - np.cos(a)) / a) < 1e-2 * LENGTH
        assert abs(y - WIDTH / 2) < 1e-9
    assert turn.magnitude() == pytest.approx(np.pi, rel=0.01)


@pytest.mark.parallel(first=3)
@pytest.mark.parametrize("options", [{}, linear.ITERATIVE | {"ksp_rtol": 1e-10}], ids=["direct", "iterative"])
@ELEMENTS
def test_a_grip_that_moves_so_needs_the_same_force_and_moment(element, options):
    """All six of them at once, as reactions of the motion that they have led to."""
    cloth, body = strip(element, nu=0.3)
    loads = Loads(cloth)
    clamp = supports.clamp(cloth.domain, cloth.space, "fixed_end")
    solver = cloth.equilibrium(clamp, loads.work, rtol=1e-10, options=options)
    force, moment = np.array([2e-2, 5e-3, 3e-4]), np.array([1e-5, -2e-5, 3e-5])

    def load(part):
        loads.force.value[:], loads.moment.value[:] = part * force, part * moment

    list(statics.march(solver, load, [0.25, 0.5, 0.75, 1.0]))
    before, now, turn = middle(cloth, body)
    assert turn.magnitude() > 0.2

    other = sheet.Sheet(cloth.domain, cloth.law, H, (E / 2.6,) * 2, element=element)
    held, move = supports.grip(other.domain, other.space, "pulled_end")
    held += supports.clamp(other.domain, other.space, "fixed_end")
    solver = other.equilibrium(held, rtol=1e-10)

    def lead(part):
        move(part * (now - before), part * turn.as_rotvec(), before)

    list(statics.march(solver, lead, np.linspace(0, 1, 7)[1:]))
    assert np.abs(other.q.x.array - cloth.q.x.array).max() < 1e-6
    found = [solver.reaction(supports.unknowns(other.domain, other.space, "pulled_end", k)) for k in range(3)]
    about = solver.reaction_moment(supports.unknowns(other.domain, other.space, "pulled_end"), now)
    np.testing.assert_allclose(found, force, atol=1e-5 * np.abs(force).max())
    np.testing.assert_allclose(about, moment, atol=1e-4 * np.abs(moment).max())


@pytest.mark.parallel
def test_only_sum_and_moment_of_forces_count():
    """Forces along the end, even or with more at its ends, of the same sum and moment: the same strip."""
    found = []
    for uneven in (0.0, 40.0):
        cloth, _ = strip(ny=4)
        y = ufl.SpatialCoordinate(cloth.domain.mesh)[1] / WIDTH
        f, end = fem.Constant(cloth.domain.mesh, np.zeros(3)), supports.over(cloth.domain, "pulled_end", 5)
        work = weakform.traction(f * (1 + 2 * y + uneven * (6 * y**2 - 6 * y + 1)), cloth.v, end)
        solver = cloth.equilibrium(supports.clamp(cloth.domain, cloth.space, "fixed_end"), work, rtol=1e-11)

        def pull(part, f=f):
            f.value[:] = part * np.array([0.5, 0.1, 0.002])

        list(statics.march(solver, pull, [0.25, 0.5, 1.0]))
        found.append(cloth.q.x.array.copy())
    assert np.abs(found[0] - found[1]).max() < 1e-8 * np.abs(found[0]).max()


def flying(spin, force, explicit):
    """A whole sheet as one rigid body, that turns and is pushed: sheet, body, run, ledger."""
    cloth, body = strip(group="sheet", nx=3, ny=2)
    f = fem.Constant(cloth.domain.mesh, np.array(force) / (LENGTH * WIDTH))
    work = weakform.surface_traction(f, cloth.v, cloth.dx)
    if explicit:
        run, ledger = cloth.explicit(MASS, [], work, rotary="thickness")
    else:
        run, ledger = cloth.newmark(MASS, [], work, rho=1.0, rotary="thickness", rtol=1e-11, accuracy=np.inf)
    v, q = run.motion.velocity.x.array, cloth.q.x.array
    arms = supports.places(cloth.space)[body.nodes[:, 0]] - (LENGTH / 2, WIDTH / 2, 0.0)
    v[body.nodes], v[body.directors] = np.cross(spin, arms), np.cross(spin, q[body.directors])
    return cloth, body, run, ledger


def lumped_inertia(cloth, body, run):
    """Of a flat sheet about x, y and z, of its nodes' masses."""
    own = body.nodes[:, 0] < run.owned
    x, m = supports.places(cloth.space)[body.nodes[own, 0]], run.mass[body.nodes[own, 0]]
    x = x - (LENGTH / 2, WIDTH / 2, 0.0)
    turning = run.mass[body.directors[body.directors[:, 0] < run.owned, 0]].sum()
    (xx, yy), J = COMM.allreduce(np.array([m @ x[:, 0] ** 2, m @ x[:, 1] ** 2])), COMM.allreduce(turning)
    return np.array([yy + J, xx + J, xx + yy])


@pytest.mark.parallel
@pytest.mark.parametrize("explicit", [False, True], ids=["implicit", "explicit"])
def test_a_rigid_sheet_flies_and_tumbles_as_a_rigid_body(explicit):
    """Euler's equations of a free body that turns about no axis of its own, and a force on it."""
    spin, force, end = np.array([10.0, 20.0, 30.0]), np.array([0.01, 0.02, -0.03]), 0.1
    mass = MASS * LENGTH * WIDTH
    inertia = mass / 12 * np.array([WIDTH**2 + H**2, LENGTH**2 + H**2, LENGTH**2 + WIDTH**2])
    if explicit:
        inertia = lumped_inertia(*flying(spin, force, True)[:3])

    def rate(t, state):
        w, R = state[:3], state[3:].reshape(3, 3)
        return np.concatenate([np.cross(inertia * w, w) / inertia, (R @ np.cross(np.eye(3), w)).ravel()])

    start = np.concatenate([spin, np.eye(3).ravel()])
    R = solve_ivp(rate, (0, end), start, rtol=1e-11, atol=1e-12).y[3:, -1].reshape(3, 3)
    misses = []
    for steps in (25, 50):
        cloth, body, run, ledger = flying(spin, force, explicit)
        energy = run.motion.kinetic()
        for _ in run.march(end, end / steps):
            pass
        before, now, turn = middle(cloth, body)
        np.testing.assert_allclose(now - before, force * end**2 / (2 * mass), rtol=1e-6)
        misses.append((turn * Rotation.from_matrix(R).inv()).magnitude())
        gain = force @ (now - before)
        assert run.motion.kinetic() - gain == pytest.approx(energy, rel=1e-3)
        assert ledger.worst < 1e-3 * ledger.most
    assert misses[1] < 0.01 and 3.5 < misses[0] / misses[1] < 4.5
    assert Rotation.from_matrix(R).magnitude() > 0.5


@pytest.mark.parallel
def test_explicit_and_implicit_motion_of_a_rigid_end_agree():
    """A strip with a bar at its end is twisted and falls; with lumped mass both tend to one answer."""
    ends = []

    def spin(x):
        return 10.0 * x[0] / LENGTH

    for explicit in (True, False):
        cloth, body = strip(nu=0.3)
        weight = cloth.weight(MASS, ufl.as_vector([0.0, 3.0, -9.81]))
        held = supports.clamp(cloth.domain, cloth.space, "fixed_end")
        if explicit:
            run, ledger = cloth.explicit(MASS, held, weight)
            steps = run.march(0.03, 0.01)
        else:
            run, ledger = cloth.newmark(MASS, held, weight, rho=1.0, lumped=True, rtol=1e-8)
            steps = run.march(0.03, 1e-3)
        run.motion.velocity.sub(0).interpolate(lambda x: [0 * x[0], 0 * x[0], spin(x) * (x[1] - WIDTH / 2)])
        run.motion.velocity.sub(1).interpolate(lambda x: [0 * x[0], -spin(x), 0 * x[0]])
        for _ in steps:
            pass
        assert ledger.worst < 1e-3 * ledger.most
        ends.append(middle(cloth, body))
    (_, one, turn), (before, other, again) = ends
    assert np.linalg.norm(one - other) < 2e-3 * np.linalg.norm(other - before)
    assert (turn * again.inv()).magnitude() < 5e-3 * turn.magnitude() and turn.magnitude() > 0.1


@pytest.mark.parallel
@pytest.mark.parametrize("comm", [COMM, MPI.COMM_SELF], ids=["all", "each"])
def test_a_run_with_a_rigid_end_goes_on_from_a_checkpoint(comm, tmp_path):
    """A strip swings under its weight, with a bar at its end; to the last digit, and the same on any ranks."""
    path = (comm.bcast(tmp_path) if comm.size > 1 else tmp_path) / "state.npz"

    def swing():
        cloth, _ = strip(comm=comm)
        weight = cloth.weight(MASS, ufl.as_vector([0.0, 0.3, -9.81]))
        held = supports.clamp(cloth.domain, cloth.space, "fixed_end")
        return cloth, *cloth.newmark(MASS, held, weight, rtol=1e-9)

    ends = []
    for stop in (False, True):
        cloth, run, ledger = swing()
        for step in run.march(0.05, 5e-3):
            if stop and step.number == 5:
                checkpoint.save(path, run)
                cloth, run, ledger = swing()
                checkpoint.load(path, run)
                for _ in run.march(0.05, 5e-3):
                    pass
                break
        ends.append(cloth.q.x.array.copy())
        assert ledger.worst < 1e-2 * ledger.most
    assert np.array_equal(*ends)
    z = supports.mean(cloth.domain, cloth.space, cloth.q, "pulled_end", 2)
    assert z < -0.005
    told = COMM.allgather(z)
    assert max(told) - min(told) < 1e-9


def test_what_cannot_be_a_rigid_body_is_refused():
    cloth, _ = strip(comm=MPI.COMM_SELF)
    domain, space = cloth.domain, cloth.space
    with pytest.raises(InputError, match="'pulled_end' is rigid and free"):
        cloth.equilibrium(supports.clamp(domain, space, "fixed_end") + supports.lead(domain, space, "sheet", 1, 0.0))
    cloth.equilibrium(supports.clamp(domain, space, "fixed_end"))
    with pytest.raises(InputError, match="'fixed_end' becomes rigid too late"):
        supports.rigid(domain, space, "fixed_end")
    cloth, _ = strip(comm=MPI.COMM_SELF)
    with pytest.raises(InputError, match="'sheet' has nodes of another rigid body"):
        supports.rigid(cloth.domain, cloth.space, "sheet")
    with pytest.raises(InputError, match="less than two nodes with directors"):
        strip("p2cr1", MPI.COMM_SELF, ny=1)


SCENE = """
[mesh]
file = "{mesh}"
numbers = {{ length = 0.2, width = 0.05, nx = 16, ny = 2 }}
[sheet]
fabric = "blend"
law = "svk"
layers = 3
kinematics = "{kind}"
[[support]]
at = "fixed_end"
kind = "clamp"
[[support]]
at = "pulled_end"
kind = "rigid"
[[load]]
kind = "moment"
at = "pulled_end"
moment_N_m_per_m = [0, {moment}, 0]
[statics]
steps = 4
[[probe]]
name = "end"
at = "pulled_end"
axis = "z"
"""


@pytest.mark.filterwarnings("ignore:.* is assumed")
def test_a_scene_with_a_moment_on_a_rigid_end(tmp_path):
    """An arc whose curvature is between M/D of a plate, D = E h^3/12 (1 - nu12 nu21), and that of a narrow strip."""
    fabric = fabrics.load("blend")
    (nu12, nu21), h = fabric.poisson["measured"], fabric.thickness
    stiffness = fabric.warp.modulus[0] * h**3 / 12 / (1 - nu12 * nu21)
    angle = 1.0
    text = SCENE.format(mesh=meshing.MESHES / "strip.geo", kind="shell", moment=-angle / LENGTH * stiffness)
    (tmp_path / "arc.toml").write_text(text)
    (tmp_path / "out").mkdir()
    table = running.run(reading.read(tmp_path / "arc.toml"), tmp_path / "out", progress=False)
    # free to curve across, a strip is softer than that, a wide one is not
    low, high = (LENGTH * (1 - np.cos(a)) / a for a in (angle, angle / (1 - nu12 * nu21)))
    rise = table.column("end_z_m")[-1]
    assert 0.999 * low < rise < 1.001 * high
    assert np.abs(table.column("fixed_end_y_Nm")[-1]) == pytest.approx(angle / LENGTH * stiffness * WIDTH, rel=1e-4)
    assert "pulled_end_z_N" not in (tmp_path / "out" / "history.csv").read_text()

    (tmp_path / "arc.toml").write_text(text.replace('"shell"', '"membrane"').replace("layers = 3", ""))
    with pytest.raises(InputError, match="'pulled_end' is rigid, which needs kinematics = 'shell'"):
        building.build(reading.read(tmp_path / "arc.toml"), MPI.COMM_SELF)
