"""Terms on edges between cells and of a user's own: closed forms, tangents, patterns that change, symmetry."""

import itertools

import numpy as np
import pytest
import scenes
import ufl
from mpi4py import MPI
from dolfinx import fem
from scipy.special import ellipk

from fabric_fenicsx import sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.shell import kinematics
from fabric_fenicsx.solvers import continuation, linear, statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import form, supports, weakform
from fabric_fenicsx.terms.term import Term

COMM = MPI.COMM_WORLD
LENGTH, WIDTH, H = 0.2, 0.1, 1e-3
SOFT = StVenantKirchhoff.isotropic(1e6, 0.0)


def panels(comm, law=SOFT, kinematics="shell", ghosts=True, shear=(1e5, 1e5), **numbers):
    """Two panels that share an edge, at x = 0.1 m."""
    domain = meshing.read(meshing.MESHES / "panels.geo", comm, ghosts=ghosts, **{"nx": 3, "mx": 3, "ny": 2, **numbers})
    return sheet.Sheet(domain, law, H, shear, kinematics=kinematics, reach=0.0)


def crease(cloth, stiffness):
    """Energy of a crease that is flat at rest, k (1 - cos) of the angle between its sides per length; k in N."""
    normal = kinematics.area_vector(cloth.u, cloth.domain.mesh)
    normal /= ufl.sqrt(ufl.dot(normal, normal))
    bend = normal("+") - normal("-")
    return fem.Constant(cloth.domain.mesh, stiffness) / 2 * ufl.dot(bend, bend) * edges(cloth)


def thread(cloth, stiffness):
    """Energy of an elastic thread along a seam; its stiffness in N."""
    y = ufl.as_vector([0.0, 1.0, 0.0])
    moved = y + ufl.dot(ufl.avg(ufl.grad(cloth.u)), y)
    strain = (ufl.dot(moved, moved) - 1) / 2
    return fem.Constant(cloth.domain.mesh, stiffness) / 2 * strain**2 * edges(cloth)


def edges(cloth):
    return supports.interior(cloth.domain, "seam", 4)


def remainders(solver, scale=0.02):
    """Orders of the Taylor remainders of a solver's residual in the unknowns that it solves for."""
    x, rng = solver.begin().copy(), np.random.default_rng(COMM.rank)
    x.array_w[:] += scale * rng.standard_normal(x.local_size)
    way = x.duplicate()
    way.array_w[:] = scale * rng.standard_normal(x.local_size)
    start = solver.residual(x).copy()
    slope = solver.factorised().getOperators()[0] * way
    left = []
    for step in 1e-3 * 0.5 ** np.arange(4):
        there = x.copy()
        there.axpy(step, way)
        rest = solver.residual(there).copy()
        rest.axpy(-1.0, start)
        rest.axpy(-step, slope)
        left.append(rest.norm())
    return np.log2(np.array(left[:-1]) / left[1:])


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("make", [crease, thread])
@pytest.mark.parametrize(("kinematics", "triangles"), [("shell", 0), ("membrane", 1)])
def test_the_tangent_of_a_term_between_cells_is_exact(make, kinematics, triangles):
    """Its entries couple the cells on both sides; without those the order is 1."""
    cloth = panels(COMM, kinematics=kinematics, triangles=triangles)
    cloth.terms.append(form.from_energy(make(cloth, 50.0), cloth.q))
    solver = cloth.equilibrium([])
    assert solver.symmetric
    assert remainders(solver).min() > 1.9
    K = solver.tangent.A
    v, w = (K.createVecRight() for _ in range(2))
    for k, vector in enumerate((v, w)):
        vector.array_w[:] = np.random.default_rng([k, COMM.rank]).standard_normal(v.local_size)
    one, other = v.dot(K * w), w.dot(K * v)
    assert abs(one - other) < 1e-12 * (K * v).norm() * w.norm()


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("stiffness", [0.0, 5e-3])
def test_a_crease_stiffens_the_two_cells_that_it_joins(stiffness):
    """A strip is bent by a moment: flat cells turn by sin(angle) = M h/EI, those at the crease have EI + k h/2."""
    n, h, B = 3, 0.1 / 3, 1e6 * H**3 / 12
    cloth = panels(COMM, shear=(1e8, 1e8))
    cloth.terms.append(form.from_energy(crease(cloth, stiffness), cloth.q))
    moment = fem.Constant(cloth.domain.mesh, np.zeros(3))
    ends = supports.over(cloth.domain, "pulled_end", 1)
    load = weakform.edge_moment(moment, cloth.director, cloth.delta, ends)
    solver = cloth.equilibrium(supports.clamp(cloth.domain, cloth.space, "fixed_end"), load, rtol=1e-10)

    def bend(M):
        moment.value[1] = -M

    M = 1e-3
    list(statics.march(solver, bend, [M / 2, M]))
    angle = 2 * (n - 1) * np.arcsin(M * h / B) + 2 * np.arcsin(M * h / (B + stiffness * h / 2))
    assert turned(cloth) == pytest.approx(angle, rel=1e-4)


def turned(cloth):
    """Angle by which the directors at the pulled end have turned about y."""
    part = cloth.space.V.sub(1)
    dofs = fem.locate_dofs_topological((part, part.collapse()[0]), *cloth.domain.entities("pulled_end"))[0]
    d = cloth.q.x.array[dofs].reshape(-1, 3)
    return max(COMM.allgather(float(np.arctan2(np.abs(d[:, 0]), d[:, 2]).max(initial=-9))))


@pytest.mark.parallel
def test_a_thread_along_a_seam_pulls_beside_the_cloth():
    """A shell and its thread in parallel: F = (C h W + EA) E (1 + d), uniform."""
    EA = 20.0
    cloth = panels(COMM)
    cloth.terms.append(form.from_energy(thread(cloth, EA), cloth.q))
    domain, space, end = cloth.domain, cloth.space, fem.Constant(cloth.domain.mesh, 0.0)
    bcs = supports.lead(domain, space, "bottom", 1, 0.0) + supports.lead(domain, space, "top", 1, end)
    for group in ("left", "right"):  # it stays flat
        bcs += supports.lead(domain, space, group, 2, 0.0) + supports.hold(domain, space, group)
    bcs += supports.lead(domain, space, "seam", 0, 0.0)
    solver = cloth.equilibrium(bcs, rtol=1e-10)
    top = supports.unknowns(domain, space, "top", 1)

    def pull(d):
        end.value = d * WIDTH

    for step in statics.march(solver, pull, [0.02, 0.05]):
        strain = step.load + step.load**2 / 2
        expected = (1e6 * H * LENGTH + EA) * strain * (1 + step.load)
        assert solver.reaction(top) == pytest.approx(expected, rel=1e-9)
    stored = (1e6 * H * LENGTH + EA) * strain**2 / 2 * WIDTH
    assert COMM.allreduce(sum(term.energy() for term in cloth.terms)) == pytest.approx(stored, rel=1e-9)


STIFF, HINGE = StVenantKirchhoff.isotropic(1e9, 0.0), 0.05  # N


def flap(comm):
    """The left panel lies still, the right one, of one row of cells and without bending, turns about the crease."""
    cloth = panels(comm, STIFF, "membrane", mx=1)
    cloth.terms.append(form.from_energy(crease(cloth, HINGE), cloth.q))
    return cloth, supports.hinge(cloth.domain, cloth.space, "left")


@pytest.mark.parallel
def test_a_flap_is_held_by_its_crease():
    """P L cos = k sin of the angle, of a dead force P per width at its end."""
    cloth, bcs = flap(COMM)
    force = fem.Constant(cloth.domain.mesh, np.zeros(3))
    ends = supports.over(cloth.domain, "pulled_end", 2)
    solver = cloth.equilibrium(bcs, weakform.traction(force, cloth.v, ends), rtol=1e-9)

    def push(P):
        force.value[2] = P

    for step in statics.march(solver, push, [0.1, 0.5]):
        x, z = (supports.mean(cloth.domain, cloth.space, cloth.q, "pulled_end", k) for k in (0, 2))
        assert z / (0.1 + x) == pytest.approx(step.load * 0.1 / HINGE, rel=1e-3)


@pytest.mark.parallel
def test_a_flap_swings_on_its_crease_as_a_pendulum():
    """I theta'' = -k sin theta, from flat: the largest angle is reached after a quarter of the period."""
    mass, most = 0.2, 1.0
    cloth, bcs = flap(COMM)
    pace = np.sqrt(3 * HINGE / (mass * 0.1**3))
    quarter = ellipk(np.sin(most / 2) ** 2) / pace
    run, ledger = cloth.newmark(mass, bcs, rho=1.0, rtol=1e-6, accuracy=np.inf)
    run.motion.velocity.interpolate(
        lambda x: [0 * x[0], 0 * x[0], 2 * pace * np.sin(most / 2) * np.maximum(x[0] - 0.1, 0)]
    )
    heights = []
    for _ in run.march(2 * quarter, quarter / 40):
        heights.append(supports.mean(cloth.domain, cloth.space, cloth.q, "pulled_end", 2))
    assert heights[39] == pytest.approx(0.1 * np.sin(most), rel=2e-3)
    assert abs(heights[79]) < 5e-3 * heights[39]
    assert ledger.totals["recoverable"] < 0.01 * ledger.most
    assert ledger.worst < 5e-3 * ledger.most and ledger.most > 0


@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
@pytest.mark.parametrize("group", ["left", "top"])
def test_a_rule_of_one_point_does_not_spoil_another(group, kinematics):
    """As FFCx 0.11 does where both are in one kernel: what both need is taken from the one point."""
    cloth = panels(MPI.COMM_SELF, kinematics=kinematics)
    cloth.q.x.array[:] += 0.01 * np.random.default_rng(0).standard_normal(len(cloth.q.x.array))
    one, two = (supports.over(cloth.domain, group, degree) for degree in (1, 2))
    first, second = cloth.u[0] * cloth.v[0] * one, cloth.u[0] ** 3 * cloth.v[0] * two

    def force(*forms):
        total = np.zeros(len(cloth.q.x.array))
        for part in forms:
            for term in form.terms_of(part, cloth.q):
                term.evaluate()
                term.add_force(total)
        return total

    apart = force(first) + force(second)
    for together in (first + second, second + first):
        assert np.abs(force(together) - apart).max() < 1e-12 * np.abs(force(second)).max()


@pytest.mark.parallel
def test_a_term_between_cells_is_refused_where_it_would_miss_some():
    cloth = panels(COMM, ghosts=False)
    energy = crease(cloth, 1.0)
    if COMM.size == 1:
        form.from_energy(energy, cloth.q)
        return
    with pytest.raises(InputError, match="ghosts=True"):
        form.from_energy(energy, cloth.q)


def test_edges_of_the_rim_are_not_between_cells():
    cloth = panels(MPI.COMM_SELF)
    with pytest.raises(InputError, match="edges on the rim"):
        supports.interior(cloth.domain, "pulled_end", 2)


class Cable(Term):
    """A cable between two far nodes, slack up to a length, then k (distance - length) in N.

    always: its entries are in the matrix from the start; else they come and go. stride: by which its ends may part in a
    correction, m.
    """

    symmetric = True

    def __init__(self, cloth, ends, length, k, always, stride):
        self.q, self.length, self.k, self.stride, self.always = cloth.q, length, k, stride, always
        V, part = cloth.q.function_space, cloth.space.V.sub(0)
        self._map, owned = V.dofmap.index_map, V.dofmap.index_map.size_local
        space, dofs = part.collapse()
        dofs, x = np.array(dofs).reshape(-1, 3), space.tabulate_dof_coordinates()
        self.ends = []
        for end in ends:
            here = np.flatnonzero((np.linalg.norm(x - end, axis=1) < 1e-9) & (dofs[:, 0] < owned))
            self.ends.append((np.array(end), dofs[here].ravel()))
        self.patterns = self.shortened = 0
        self.active, self.seen = always, []
        self.evaluate()

    def evaluate(self, tangent=True, stiffest=False):
        first, last = (end + COMM.allreduce(self._at(self.q.x.array, dofs)) for end, dofs in self.ends)
        self.apart = last - first
        self.distance = np.linalg.norm(self.apart)
        self.seen.append(self.distance)
        if not self.always and (self.distance > self.length) != self.active:
            self.active, self.pattern_changed = not self.active, True
        return bool(np.isfinite(self.distance))

    @staticmethod
    def _at(values, dofs):
        return values[dofs] if len(dofs) else np.zeros(3)

    @property
    def tension(self):
        return self.k * max(self.distance - self.length, 0.0)

    def add_force(self, total):
        for sign, (_, dofs) in zip((-1, 1), self.ends, strict=True):
            total[dofs] += sign * self.tension * self.apart[: len(dofs)] / self.distance

    def pattern(self):
        self.patterns += 1
        self.pattern_changed = False
        if not self.active:
            return super().pattern()
        numbers = self._map.local_to_global(np.arange(len(self.q.x.array), dtype=np.int32))
        every = np.concatenate([COMM.allreduce(self._at(numbers, dofs)) for _, dofs in self.ends]).astype(np.int32)
        self._own = np.flatnonzero(np.repeat([len(dofs) > 0 for _, dofs in self.ends], 3))
        return np.repeat(every[self._own], 6), np.tile(every, len(self._own))

    def add_stiffness(self, values):
        if self.active and self.tension > 0.0:
            along = np.outer(self.apart, self.apart) / self.distance**2
            block = self.k * along + self.tension / self.distance * (np.eye(3) - along)
            values += np.kron([[1, -1], [-1, 1]], block)[self._own].ravel()

    def longest_step(self, change):
        first, last = (COMM.allreduce(self._at(change, dofs)) for _, dofs in self.ends)
        far = np.linalg.norm(last - first)
        self.shortened += far > self.stride
        return min(1.0, self.stride / max(far, 1e-300))

    def energy(self):
        return self.tension**2 / (2 * self.k) if COMM.rank == 0 else 0.0


def held_by_a_cable(always, stride=np.inf):
    """A sheet is stretched until a cable between two of its nodes is taut, and let go."""
    cloth = panels(COMM, nx=4, mx=4, ny=2, ghosts=False)
    cable = Cable(cloth, [(0.025, 0.0, 0.0), (LENGTH, 0.0, 0.0)], 0.18, 2e3, always, stride)
    cloth.terms.append(cable)
    force = fem.Constant(cloth.domain.mesh, np.zeros(3))
    load = weakform.traction(force, cloth.v, supports.over(cloth.domain, "pulled_end", 2))
    solver = cloth.equilibrium(supports.clamp(cloth.domain, cloth.space, "fixed_end"), load, rtol=1e-9)

    def pull(f):
        force.value[0] = f

    states, tensions = [], []
    for _ in statics.march(solver, pull, [20.0, 60.0, 90.0, 40.0, 0.0]):
        states.append(cloth.q.x.array.copy())
        tensions.append(cable.tension)
    return np.array(states), tensions, cable, solver


@pytest.mark.parallel
def test_entries_of_the_matrix_come_and_go_with_a_term():
    expected, tensions, still, _ = held_by_a_cable(always=True)
    assert tensions[0] == tensions[-1] == 0.0 and min(tensions[1:3]) > 0.5
    assert still.patterns == 1
    states, _, cable, solver = held_by_a_cable(always=False)
    assert cable.patterns >= 3
    assert np.abs(states - expected).max() < 1e-8 * np.abs(expected).max()
    if COMM.size == 1:  # MUMPS still has what it was told
        assert [solver.snes.ksp.getPC().getFactorMatrix().getMumpsIcntl(k) for k in (6, 7, 8)] == [0, 2, 1]


@pytest.mark.parallel
def test_a_term_shortens_corrections_and_is_not_taken_for_balance():
    expected, *_ = held_by_a_cable(always=True)
    stride = 5e-4
    states, _, cable, _ = held_by_a_cable(always=True, stride=stride)
    assert cable.shortened > 10
    assert np.abs(np.diff(cable.seen)).max() <= 1.001 * stride
    assert np.abs(states - expected).max() < 1e-8 * np.abs(expected).max()


def gripped(options=None):
    """An elastic sheet between a clamp and a grip, under its weight: sheet, solver, the grip's move."""
    cloth = panels(COMM, StVenantKirchhoff.isotropic(1e6, 0.3), ghosts=False)
    held, move = supports.grip(cloth.domain, cloth.shell, "pulled_end")
    weight = cloth.weight(0.01, ufl.as_vector([0.0, 0.0, -9.81]))
    held += supports.clamp(cloth.domain, cloth.space, "fixed_end")
    return cloth, cloth.equilibrium(held, weight, rtol=1e-9, options=options), move


@pytest.mark.parallel
@pytest.mark.parametrize("options", [{}, linear.ITERATIVE | {"ksp_rtol": 1e-12}], ids=["direct", "iterative"])
def test_symmetric_systems_move_supports_as_others_do(options):
    """As with given rows only: one linear step of the whole sheet, and as many iterations after it."""
    ends, starts, counts = [], [], []
    for symmetric in (True, False):
        # LDL' takes no other systems
        cloth, solver, move = gripped(options if symmetric or options else linear.DIRECT)
        assert solver.symmetric
        solver.symmetric = symmetric
        solver.tangent.declare(symmetric)
        move((0.004, 0.0, 0.001), (0.01, 0.02, 0.0), (LENGTH, WIDTH / 2, 0.0))
        x = solver.begin()
        assert solver._move_supports() == 1
        starts.append(x.array_r.copy())
        counts.append([solver.solve()])
        solver.commit()
        A = solver.factorised().getOperators()[0]
        if symmetric:
            difference = A.copy().transpose()
            difference.axpy(-1.0, A)
            assert difference.norm() < 1e-12 * A.norm()
        move((0.003, 0.0, 0.0))
        counts[-1].append(solver.solve())
        ends.append(cloth.q.x.array.copy())
    assert np.abs(starts[0] - starts[1]).max(initial=0.0) < (1e-4 if options else 1e-8) * np.abs(starts[1]).max(
        initial=0.0
    )
    assert np.abs(ends[0] - ends[1]).max() < 1e-8 * np.abs(ends[1]).max()
    assert counts[0] == counts[1]


@pytest.mark.parallel
def test_arc_length_moves_supports_of_a_symmetric_system():
    found = []
    for along in (True, False):
        cloth, solver, move = gripped()

        def pull(d, move=move):
            move((d, 0.0, 0.0))

        if along:
            steps = [step.load for step in itertools.islice(continuation.arc_length(solver, pull, 1e-4), 4)]
        else:
            list(statics.march(solver, pull, steps))
        found.append(cloth.q.x.array.copy())
    assert np.abs(found[0] - found[1]).max() < 1e-7 * np.abs(found[1]).max()


@pytest.mark.parallel
@pytest.mark.parametrize("method", ["newmark", "explicit"])
def test_air_resists_a_falling_sheet(method):
    """m v' = m g - c v: the velocity of the scheme, and all work is accounted for."""
    mass, c, g = 0.2, 4.0, 9.81
    cloth = panels(COMM, ghosts=False)
    weight = cloth.weight(mass, ufl.as_vector([0.0, 0.0, -g]))
    loads = weight - weakform.drag(c, cloth.velocity, cloth.v, cloth.dx)
    settings, rel = ({"rho": 1.0, "rtol": 1e-10}, 1e-4) if method == "newmark" else ({}, 5e-3)
    run, ledger = getattr(cloth, method)(mass, [], loads, **settings)
    *_, last = run.march(0.05, 1e-3)
    fall = -supports.mean(cloth.domain, cloth.space, cloth.q, "left", 2)
    k, t = c / mass, last.load
    assert fall == pytest.approx(g / k * (t - (1 - np.exp(-k * t)) / k), rel=rel)
    lost = c * LENGTH * WIDTH * (g / k) ** 2 * (t - 2 * (1 - np.exp(-k * t)) / k + (1 - np.exp(-2 * k * t)) / (2 * k))
    assert ledger.totals["by_damping"] == pytest.approx(lost, rel=2 * rel)
    assert ledger.worst < (1e-9 if method == "newmark" else 5e-3) * ledger.most


@pytest.mark.parametrize("search", ["basic", "bt", "secant"])
def test_a_sheet_in_balance_is_in_balance(search):
    """A curved sheet of triangles, whose forces at rest are round-off, under no load and next to none."""
    domain = meshing.read(scenes.MESHES / "cylinder.geo", MPI.COMM_SELF, order=2, triangles=1)
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(1e7, 0.3), H, (1e6, 1e6), warp=(0.3, 1, 0.2))
    g = fem.Constant(domain.mesh, np.zeros(3))
    bcs = supports.clamp(domain, cloth.space, "end")
    solver = cloth.equilibrium(bcs, cloth.weight(0.2, g), options={"snes_linesearch_type": search, "snes_max_it": 50})

    def put(t):
        g.value = (9.81 * t, 0, -9.81 * t)

    loads = [0.0, 1e-20, -6e-17, 0.0] + ([1e-3, 0.0, 0.0, 6e-17] if search == "basic" else [])
    for step in statics.march(solver, put, loads):
        assert step.step_cuts == 0
