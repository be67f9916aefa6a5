"""Implicit dynamics: orders in time, exact motions, damping, the account of energy, steps that fail."""

import gc
import weakref
from itertools import pairwise

import motions
import numpy as np
import pytest
import scenes
from mpi4py import MPI
from dolfinx import fem
from dolfinx.fem import petsc as fempetsc
from petsc4py import PETSc

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import motion
from fabric_fenicsx.terms import supports, weakform

COMM = MPI.COMM_WORLD
BLEND = fabrics.load("blend")
RULES = {"rho 1": {"rho": 1.0}, "rho 0.8": {"rho": 0.8}, "Newmark": {"newmark": (0.25, 0.5)}}


def last(run, end, dt):
    """March to the end."""
    for _ in run.march(end, dt):
        pass
    return run


def orders(make, end, steps):
    """Orders of displacements and of directors, from the answers with each number of steps."""
    answers = []
    for n in steps:
        run = last(make(), end, end / n)
        directors = run.motion.space.nodes
        answers.append((np.delete(run.motion.q.x.array, directors), run.motion.q.x.array[directors]))
    parts = zip(*answers, strict=True)
    return np.array([motions.order([np.abs(a - b).max() for a, b in pairwise(p)]) for p in parts])


# --- the scheme


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_second_order_where_directors_turn(rule):
    """A hinged plate that swings through a radian, and bends."""

    def make():
        cloth = motions.cloth(MPI.COMM_SELF)
        run = motions.moving(cloth, supports.hinge(cloth.domain, cloth.space, "left"), (0, 0, -9.81), **rule)
        motions.spin(run.motion.velocity, (0, -10.0, 0))
        return run

    found = orders(make, 0.04, (32, 64, 128))
    assert (found > 1.9).all() and (found < 2.3).all()


def test_a_step_is_solved_as_well_as_the_time_rule_is_good():
    """A hinged plate that swings and bends: fewer iterations, and a part of the error that the steps make anyway."""

    def swung(rtol, n):
        cloth = motions.cloth(MPI.COMM_SELF)
        left = supports.hinge(cloth.domain, cloth.space, "left")
        run = motions.moving(cloth, left, (0, 0, -9.81), rho=0.8, rtol=rtol)
        motions.spin(run.motion.velocity, (0, -10.0, 0))
        iterations = 0
        for _ in run.march(0.04, 0.04 / n):
            iterations += run.iterations
        return run.motion.q.x.array.copy(), iterations, run.matrices

    (exact, many, made), (loose, few, fewer), (fine, _, _) = swung(1e-11, 16), swung(None, 16), swung(1e-11, 32)
    assert few < 0.8 * many and 16 <= fewer <= few and 16 <= made < 0.8 * many
    assert 0 < np.abs(loose - exact).max() < 0.1 * np.abs(fine - exact).max()


@pytest.mark.parametrize("rho", [1.0, 0.8])
def test_second_order_where_supports_move(rho):
    """A plate that is clamped to a rod which starts to turn and to shift."""

    def make():
        cloth = motions.cloth(MPI.COMM_SELF)
        bcs, move = supports.grip(cloth.domain, cloth.space, "left")

        def set_load(t):
            move((0.0, 0.0, 0.1 * np.sin(10 * t)), (0.0, 1.0 - np.cos(10 * t), 0.0))

        run = motions.moving(cloth, bcs, set_load=set_load, rho=rho)
        motions.spin(run.motion.velocity, (0, 0, 0), drift=(0, 0, 1.0))
        return run

    found = orders(make, 0.04, (32, 64, 128))
    assert (found > 1.9).all() and (found < 2.3).all()


@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_true_initial_acceleration(kinematics):
    """M a0 = forces, in a sheet that is bent, turns and falls; directors keep their length."""
    cloth = motions.cloth(MPI.COMM_SELF, kinematics=kinematics)
    run = motions.moving(cloth, supports.hinge(cloth.domain, cloth.space, "left"), (0, 0, -9.81), damping=3.0)
    motions.spin(run.motion.velocity, (0, -10.0, 0))
    u = cloth.q.sub(0) if cloth.shell else cloth.q
    u.interpolate(lambda x: [0.02 * x[0], 0 * x[0], 0.3 * x[0] ** 2])
    run.solver.renew()
    run.ts.setTimeStep(1e-3)
    run.begin()
    # with no step under way, `forces` are the residual less M a at this moment
    run.solver.residual(run.solver.begin())
    left = run.solver.forces()
    inner = np.abs(run.motion.by_mass(run.motion.acceleration).array_r).max()
    left[run.motion.given] = 0.0
    if cloth.shell:
        nodes = cloth.shell.nodes
        d, w = cloth.q.x.array[nodes], run.motion.velocity.x.array[nodes]
        left[nodes] -= (left[nodes] * d).sum(axis=1, keepdims=True) * d
        along = (run.motion.acceleration.x.array[nodes] * d).sum(axis=1)
        assert np.allclose(along, -(w**2).sum(axis=1), rtol=1e-12) and (along < -99).any()
    assert np.abs(left).max() < 1e-11 * inner


@pytest.mark.parametrize("rho", [1.0, 0.5])
def test_free_fall_is_exact(rho):
    cloth = motions.cloth(MPI.COMM_SELF)
    g = np.array([0.3, -0.2, -9.81])
    run = motions.moving(cloth, gravity=g, rho=rho)
    rest = cloth.q.x.array.copy()
    for step in run.march(0.5, 0.05):
        u, _ = motions.nodes(cloth.q)
        assert np.abs(u - g * step.load**2 / 2).max() < 1e-13
        assert np.abs(motions.nodes(run.motion.velocity)[0] - g * step.load).max() < 1e-12
    assert np.abs((cloth.q.x.array - rest)[cloth.shell.nodes]).max() < 1e-13


def alpha2(cloth, run, end, dt, rho):
    """Displacement at the end by PETSc's own generalised-alpha method of second order, with the forms of a run."""
    q, mass = cloth.q, run.motion.mass
    fixed = run.motion.given
    am = 2 / (1 + rho)
    store = PETSc.Options("alpha2_")
    rule = {"ts_alpha_alpha_m": am, "ts_alpha_alpha_f": 1.0, "ts_alpha_gamma": am - 0.5, "ts_alpha_beta": am**2 / 4}
    solving = {"ts_adapt_type": "none", "ksp_type": "preonly", "pc_type": "lu", "snes_rtol": 1e-12, "snes_stol": 0.0}
    for name, value in (rule | solving).items():
        store[name] = value
    v = run.motion.velocity.x.petsc_vec.copy()
    internal, weight = run.terms
    K = fempetsc.create_matrix(internal.jacobian)

    def function(ts, t, x, v, a, F):
        x.copy(q.x.petsc_vec)
        with F.localForm() as local:
            local.set(0.0)
        for term in (internal, weight):
            fempetsc.assemble_vector(F, term.residual)
        mass.multAdd(a, F, F)
        F.array_w[fixed] = x.array_r[fixed]

    def jacobian(ts, t, x, v, a, by_v, by_a, J, P):
        P.zeroEntries()
        fempetsc.assemble_matrix(P, internal.jacobian)
        P.assemble()
        P.axpy(by_a, mass, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        P.zeroRows(fixed, 1.0)

    x = q.x.petsc_vec.copy()
    ts = PETSc.TS().create(MPI.COMM_SELF)
    ts.setOptionsPrefix("alpha2_")
    ts.setType("alpha2")
    ts.setI2Function(function, x.duplicate())
    ts.setI2Jacobian(jacobian, K, K)
    ts.setSolution2(x, v)
    ts.setTimeStep(dt)
    ts.setMaxTime(end)
    ts.setExactFinalTime(PETSc.TS.ExactFinalTime.MATCHSTEP)
    ts.setFromOptions()
    ts.solve(x)
    assert ts.getTime() == pytest.approx(end)
    return ts.getSolution2()[0].array.copy()


@pytest.mark.parametrize("rho", [1.0, 0.6])
def test_the_same_equation_by_petsc(rho):
    """PETSc's TSALPHA2, which finds its first acceleration in another way, converges to the same answer."""

    def make():
        cloth = motions.cloth(MPI.COMM_SELF, kinematics="membrane")
        run = motions.moving(cloth, supports.hinge(cloth.domain, cloth.space, "left"), (20.0, 5.0, -9.81), rho=rho)
        motions.spin(run.motion.velocity, (0, -5.0, 0))
        return cloth, run

    gaps = []
    for n in (20, 40, 80):
        cloth, run = make()
        theirs = alpha2(*make(), 0.1, 0.1 / n, rho)
        last(run, 0.1, 0.1 / n)
        gaps.append(np.abs(cloth.q.x.array - theirs).max() / np.abs(theirs).max())
    assert gaps[-1] < 1e-4 and (motions.order(gaps) > 1.7).all()


@pytest.mark.parallel
def test_any_number_of_ranks():
    found = []
    for comm in (MPI.COMM_SELF, COMM):
        cloth = motions.cloth(comm, cells=4)
        run = motions.moving(
            cloth, supports.hinge(cloth.domain, cloth.space, "left"), (0, 0, -9.81), ledger=True, rho=0.8
        )
        last(run, 0.1, 5e-3)
        found.append((motions.nodes(cloth.q)[0], np.array(list(run.ledger.totals.values()))))
    (u, energies), (u2, energies2) = found
    assert np.abs(u).max() > 0.02
    assert np.abs(u - u2).max() < 1e-8 * np.abs(u).max()
    assert np.abs(energies - energies2).max() < 1e-8 * np.abs(energies).max()


@pytest.mark.parametrize(
    ("words", "options"),
    [("rho", {"rho": 1.2}), ("gamma", {"newmark": (0.25, 0.4)}), ("beta", {"newmark": (0.0, 0.5)}),
     ("damping", {"damping": -1.0})],
)  # fmt: skip
def test_rules_that_cannot_be_are_refused(words, options):
    with pytest.raises(InputError, match=words):
        motions.moving(motions.cloth(MPI.COMM_SELF, kinematics="membrane"), **options)


def test_steps_that_cannot_be_are_refused():
    run = motions.moving(motions.cloth(MPI.COMM_SELF, kinematics="membrane"))
    for end, dt in ((1.0, 0.0), (1.0, np.nan), (0.0, 0.1), (np.inf, 0.1)):
        with pytest.raises(InputError):
            next(run.march(end, dt))


# --- damping


def test_damping_by_mass_stops_a_flight():
    """v' = -a v by the trapezoidal rule, to round-off."""
    a, dt = 4.0, 0.02
    cloth = motions.cloth(MPI.COMM_SELF)
    run = motions.moving(cloth, damping=a, ledger=True)
    motions.spin(run.motion.velocity, (0, 0, 0), drift=(1.0, 2.0, 3.0))
    for step in run.march(0.2, dt):
        v, _ = motions.nodes(run.motion.velocity)
        assert np.allclose(v, np.array([1, 2, 3]) * ((1 - a * dt / 2) / (1 + a * dt / 2)) ** step.number, rtol=1e-11)
    start = motions.AREAL_MASS * motions.SIDE**2 / 2 * 14
    t = run.ledger.totals
    assert t["external"] == pytest.approx(start) and abs(t["imbalance"]) < 1e-10 * start
    assert t["by_damping"] == pytest.approx(start - t["kinetic"], rel=1e-10)


def viscous(cloth, b):
    """The part b K of Rayleigh's damping, as an `extra` of `motions.moving`."""
    C, h = motions.SOFT.stiffness, motions.THICKNESS
    stiffness = Section(motions.SOFT, h, 2).elastic(C) if cloth.shell else h * C
    b = fem.Constant(cloth.domain.mesh, b)
    return lambda motion: weakform.stiffness_damping(
        b, stiffness, cloth.strain, cloth.q, motion.velocity, cloth.test, cloth.dx
    )


def test_damping_by_stiffness_resists_strain_and_no_turn():
    cloth = motions.cloth(MPI.COMM_SELF)
    q, u = cloth.q, cloth.q.sub(0)
    moved = motion.Motion(q, cloth.mass(motions.AREAL_MASS), cloth.shell)
    form = fem.form(viscous(cloth, 1e-2)(moved))
    # bent and stretched, and turning as it is about an axis out of its plane
    u.interpolate(lambda x: [0.1 * x[0], 0 * x[0], x[0] * x[1]])
    omega, v = np.array([3.0, -1.0, 2.0]), moved.velocity
    place = fem.Function(u.collapse().function_space)
    place.interpolate(lambda x: x)
    dofs = q.function_space.sub(0).collapse()[1]
    now = (place.x.array + q.x.array[dofs]).reshape(-1, 3)
    v.x.array[dofs] = np.cross(omega, now).ravel()
    v.x.array[cloth.shell.nodes] = np.cross(omega, q.x.array[cloth.shell.nodes])
    turning = fem.assemble_vector(form).array.copy()
    v.sub(0).interpolate(lambda x: [x[0], 0 * x[0], x[1] ** 2])
    straining = fem.assemble_vector(form).array
    assert np.abs(turning).max() < 1e-12 * np.abs(straining).max()
    assert straining @ v.x.array > 0


def test_damping_by_stiffness_stills_a_plate_that_goes_on_turning():
    """It spins and is stretched to and fro: that goes, and the spin stays."""
    left = []
    for b in (0.0, 2e-3):
        cloth = motions.cloth(MPI.COMM_SELF, kinematics="membrane")
        run = motions.moving(cloth, extra=viscous(cloth, b), ledger=True, accuracy=np.inf)
        centre = np.array([0.5, 0.5, 0.0]) * motions.SIDE
        motions.spin(run.motion.velocity, (0, 0, 2.0), centre)
        extra = fem.Function(cloth.space)
        extra.interpolate(lambda x: [x[0] - 0.15, 0.5 * (x[1] - 0.15), 0 * x[0]])
        run.motion.velocity.x.array[:] += extra.x.array
        last(run, 0.4, 4e-3)
        totals = run.ledger.totals
        u, x = motions.nodes(cloth.q)
        v, _ = motions.nodes(run.motion.velocity)
        arm = x + u - centre
        turned = np.linalg.lstsq(np.stack([-arm[:, 1], arm[:, 0]], axis=1).reshape(-1, 1), v[:, :2].ravel())[0][0]
        whole = fem.Function(cloth.space)
        motions.spin(whole, (0, 0, 2.0), centre)
        run.motion.velocity.x.array[:] = whole.x.array
        left.append((totals["kinetic"] + totals["recoverable"] - run.motion.kinetic(), turned, totals["by_damping"]))
        assert abs(totals["imbalance"]) < 1e-2 * run.ledger.most
    assert left[0][2] == 0 and left[1][2] > 0
    assert left[1][0] < 0.05 * left[0][0]
    assert left[1][1] == pytest.approx(2.0, rel=1e-2)


# --- the account of energy


def test_energy_of_a_small_motion_closes():
    """Linear but for the size of the motion: what is not accounted for falls with it."""
    parts = []
    for size in (1e-3, 1e-6):
        cloth = motions.cloth(MPI.COMM_SELF, kinematics="membrane")
        run = motions.moving(
            cloth, supports.hinge(cloth.domain, cloth.space, "left"), (size, 0, 0), ledger=True, accuracy=np.inf
        )
        last(run, 0.2, 5e-3)
        t = run.ledger.totals
        assert t["kinetic"] > 0 and t["recoverable"] > 0 and t["by_law"] == 0
        assert abs(t["by_scheme"]) < 1e-9 * run.ledger.most
        # the work of the weight is that of its centre
        mean = fem.assemble_scalar(fem.form(cloth.u[0] * cloth.dx)) * motions.AREAL_MASS * size
        assert t["external"] == pytest.approx(mean, rel=1e-9)
        parts.append(run.ledger.worst / run.ledger.most)
    assert parts[1] < 1e-8 and parts[1] < 0.01 * parts[0] < 1e-4


def test_the_scheme_takes_what_it_takes():
    """rho below 1 dissipates, and all parts add up."""
    cloth = motions.cloth(MPI.COMM_SELF, kinematics="membrane")
    bcs = supports.hinge(cloth.domain, cloth.space, "left")
    run = motions.moving(cloth, bcs, (1e-6, 0, 0), ledger=True, rho=0.3, accuracy=np.inf)
    scheme = [0.0]
    for _ in run.march(0.5, 1e-2):
        t, row = run.ledger.totals, run.ledger.row()
        scheme.append(t["by_scheme"])
        assert run.motion.kinetic() == t["kinetic"]
        assert fem.assemble_scalar(fem.form(cloth.stored)) == pytest.approx(t["recoverable"])
        assert row["external_work_J"] == pytest.approx(sum(row.values()) - row["external_work_J"], abs=1e-18)
    assert scheme[-1] > 0.01 * run.ledger.most > 1e4 * run.ledger.worst


@pytest.mark.parallel
def test_a_stretching_cycle_dissipates_by_the_law():
    cloth = motions.cloth(COMM, Woven(BLEND), "membrane")
    end = fem.Constant(cloth.domain.mesh, 0.0)
    bcs = supports.hinge(cloth.domain, cloth.space, "left")
    bcs += supports.lead(cloth.domain, cloth.space, "right", 0, end)

    def set_load(t):
        end.value = 0.02 * np.sin(np.pi * t / 0.1) ** 2

    run = motions.moving(cloth, bcs, ledger=True, set_load=set_load, rtol=1e-8, rho=0.8)
    rows = []
    for _ in run.march(0.2, 4e-3):
        rows.append(run.ledger.totals)
        assert rows[-1]["by_law"] > -1e-6 * run.ledger.most
    lost = [row["by_law"] for row in rows]
    assert lost[24] > 0.2 * run.ledger.most
    # the second cycle goes along what the first one left
    assert 0 <= lost[49] - lost[24] < 0.2 * lost[24]
    assert run.ledger.worst < 5e-3 * run.ledger.most


@pytest.mark.filterwarnings("ignore:.* is beyond the measured")
@pytest.mark.parametrize("both", [True, False])
def test_the_ledger_tells_what_a_law_without_potential_makes(both):
    """Muslin, slowly, round a loop of warp and weft strain, where energy comes out of it; and in the warp alone."""
    cloth = motions.cloth(COMM, Woven(fabrics.load("muslin")), "membrane")
    ends = [fem.Constant(cloth.domain.mesh, 0.0) for _ in range(2)]
    bcs = []
    for axis, (still, moved) in enumerate((("left", "right"), ("bottom", "top"))):
        bcs += supports.lead(cloth.domain, cloth.space, still, axis, 0.0)
        bcs += supports.lead(cloth.domain, cloth.space, moved, axis, ends[axis]) if both or axis == 0 else []

    def set_load(t):
        ends[0].value = motions.SIDE * 0.03 * np.sin(2 * np.pi * t) * (1 if both else np.sin(2 * np.pi * t))
        ends[1].value = motions.SIDE * 0.06 * (1 - np.cos(2 * np.pi * t))

    run = motions.moving(cloth, bcs, ledger=True, set_load=set_load, rtol=1e-8, rho=0.8)
    lost = [0.0]
    for _ in run.march(1.0, 0.02):
        lost.append(run.ledger.totals["by_law"])
    fall = np.max(np.maximum.accumulate(lost) - lost)
    assert run.ledger.made == pytest.approx(fall, rel=1e-3, abs=1e-6 * run.ledger.most)
    made = run.ledger.made / run.ledger.most
    assert made > 0.1 if both else made < 1e-3


@pytest.mark.parametrize("method", ["newmark", "explicit"])
def test_a_motion_is_freed(method):
    """Else a study of many scenes runs out of MPI communicators; PETSc's TS holds its Python context."""
    freed = []
    for _ in range(2):
        cloth = motions.cloth(MPI.COMM_SELF, Woven(BLEND))
        run, _ = getattr(cloth, method)(motions.AREAL_MASS, supports.hinge(cloth.domain, cloth.space, "left"))
        for _ in run.march(1e-4, 1e-4):
            pass
        freed.append(weakref.ref(run))
        freed.append(weakref.ref(cloth))
        del run, cloth, _
    gc.collect()
    # UFL's caches may keep what the last one compiled
    assert [reference() is None for reference in freed[:3]] == [True] * 3


# --- steps that fail


def pulled(stride):
    """A strip of a law that bears no more than a stride of strain in a step."""
    law = scenes.Impatient(np.inf)
    cloth = motions.cloth(COMM, law, "membrane")
    law.stride = stride
    end = fem.Constant(cloth.domain.mesh, 0.0)
    bcs = supports.hinge(cloth.domain, cloth.space, "left")
    bcs += supports.lead(cloth.domain, cloth.space, "right", 0, end)

    def set_load(t):
        end.value = 0.01 * np.sin(10 * t) ** 2

    return cloth, motions.moving(cloth, bcs, set_load=set_load, rtol=1e-8, rho=0.5)


@pytest.mark.parallel
def test_a_step_that_fails_is_cut_and_leaves_no_trace():
    cloth, run = pulled(4e-3)
    points, times, cuts = cloth.points[0], [], 0
    for step in run.march(0.2, 0.02):
        times.append(step.load)
        cuts += step.step_cuts
        # the state of this law is the strain of the last accepted step
        assert np.array_equal(points.history.committed, points.strain.reshape(-1, 3))
        assert np.array_equal(run.motion.accepted["q"], cloth.q.x.array)
    assert cuts > 0 and np.array_equal(times, np.linspace(0, 0.2, 11)[1:])
    clean, fine = pulled(np.inf)
    last(fine, 0.2, 0.002)
    assert np.abs(clean.q.x.array - cloth.q.x.array).max() < 0.02 * 0.01


@pytest.mark.parallel
def test_a_step_that_cannot_be_cut_stops_with_the_last_good_state():
    cloth, run = pulled(1e-4)
    with pytest.raises(StepFailed, match=r"stopped at t = .* after \d+ cuts"):
        last(run, 0.2, 0.02)
    assert 0 <= run.time < 0.2
    assert np.array_equal(run.motion.accepted["q"], cloth.q.x.array)
    assert np.array_equal(run.motion.accepted["v"], run.motion.velocity.x.array)
    assert np.array_equal(cloth.points[0].history.committed, cloth.points[0].strain.reshape(-1, 3))
    cloth.points[0].law.stride = 1.0
    last(run, 0.2, 0.02)
    assert run.time == 0.2


@pytest.mark.parametrize(
    ("rotary", "square"), [("thickness", 0.0), ("cell", 3 * (motions.SIDE / 2) ** 2), ("none", None)]
)
def test_directors_have_the_inertia_of_the_thickness_or_of_a_cell_or_none(rotary, square):
    cloth = motions.cloth(MPI.COMM_SELF)
    V = cloth.q.function_space
    mass = fem.assemble_matrix(fem.form(cloth.mass(motions.AREAL_MASS, rotary))).to_scipy()
    along = np.zeros(mass.shape[0])
    along[V.sub(1).sub(0).collapse()[1]] = 1.0
    own = 0.0 if square is None else motions.AREAL_MASS * motions.SIDE**2 * (motions.THICKNESS**2 + square) / 12
    assert along @ mass @ along == pytest.approx(own, rel=1e-12)


def test_an_unknown_inertia_of_directors_is_named():
    with pytest.raises(InputError, match="rotary='both' is not one of thickness, cell, none"):
        motions.cloth(MPI.COMM_SELF).mass(1.0, "both")
