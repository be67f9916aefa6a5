"""Statics along the energy: potentials against forces, sheets that start flat, what has no energy."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import descent, linear
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform
from fabric_fenicsx.terms.form import FormTerm
from fabric_fenicsx.terms.term import Term

STUDY = runpy.run_path(str(Path(__file__).resolve().parent.parent / "demos" / "studies" / "stable_statics.py"))
COMM = MPI.COMM_WORLD
BLEND = fabrics.load("blend")


def cloth(law, kinematics="shell", n=3):
    domain = meshing.read(STUDY["SQUARE"], COMM, side=0.3, n=n, triangles=1)
    G = BLEND.shear.modulus[0]
    return sheet.Sheet(domain, law, BLEND.thickness, (G, G), kinematics=kinematics)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_forces_are_the_gradient_of_the_potential(kinematics):
    """From a committed state with a history: law, linear parts, pressure, dead load and spring together."""
    own = cloth(Potential(BLEND), kinematics)
    spring = -fem.Constant(own.domain.mesh, 50.0) * ufl.inner(own.u, own.v) * own.dx
    p = fem.Constant(own.domain.mesh, 30.0)
    loads = weakform.pressure(p, own.u, own.v, own.dx) + 20.0 * own.v[1] * own.dx + spring
    bcs = [bc for edge in STUDY["RIM"] for bc in supports.hinge(own.domain, own.space, edge)]
    solver = own.equilibrium(bcs, loads)
    solver.solve()
    assert solver.descends and solver.symmetric and solver.negative == 0
    solver.commit()
    x, way = solver.begin().copy(), solver._random[0].copy()
    way.scale(1e-4)
    for size in (1.0, -0.7):  # on, and back
        x.axpy(size, way)
        slope = solver.residual(x).dot(way)
        energies = []
        for part in (-2e-4, 2e-4, -1e-4, 1e-4):
            energies.append(solver._at(x + part * way)[1])
        coarse, fine = (energies[1] - energies[0]) / 4e-4, (energies[3] - energies[2]) / 2e-4
        assert (4 * fine - coarse) / 3 == pytest.approx(slope, rel=1e-9)


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("name", ["shell, dead load", "shell, pressure", "membrane, dead load", "membrane, pressure"])
def test_a_flat_sheet_takes_its_load_in_one_step(name):
    """A membrane has no stiffness across itself at first. Both ways of loading are nearly the same in a flat sheet."""
    row = STUDY["run"](name, "energy")
    assert row["steps"] == 1 and row["cuts"] == 0 and row["iterations"] <= 15
    assert row["negative"] == 0 and row["lowest"] > 0.0
    assert row["height_m"] == pytest.approx(0.02867, abs=2e-5)


@pytest.mark.parallel
def test_a_flat_airbag_is_blown_up_at_once():
    row = STUDY["run"]("airbag", "energy")
    assert row["cuts"] == 0 and row["negative"] == 0 and row["lowest"] > -1e-9
    assert 0.17 < row["height_m"] < 0.23


@pytest.mark.parallel
def test_a_strip_buckles_and_comes_back():
    """Factors that fail on the way are thrown away; on several ranks it is the same strip, and comes to the same."""
    row = STUDY["run"]("buckled strip of blend", "energy", steps=3)
    assert row["steps"] == 6 and row["cuts"] == 0 and row["negative"] == 0 and row["lowest"] > 0.0
    assert row["height_m"] == pytest.approx(0.0421525425, rel=1e-6)


@pytest.mark.parallel
def test_a_slender_strip_that_hangs_down_takes_few_iterations():
    """310 without strains of their own."""
    row = STUDY["run"]("cantilever of muslin", "energy")
    assert row["cuts"] == 0 and row["iterations"] <= 90 and row["negative"] == 0 and row["lowest"] > 0.0
    assert row["height_m"] == pytest.approx(0.0919, abs=1e-5)


@pytest.mark.parallel
def test_strains_are_foreseen_to_first_order():
    """Against differences; and a law that is linear has the same forces about any strain."""
    own = cloth(StVenantKirchhoff.isotropic(1e8, 0.3))
    term, q = own.terms[0], own.q.x.array
    change = 1e-2 * np.sin(np.arange(len(q)))
    q += 0.3 * change[::-1]
    term.evaluate()
    part, force, foreseen = term._parts[0], np.zeros((2, len(q))), []
    term.add_force(force[0])
    here = part.strain.copy()
    for size in (1e-4, -1e-4):
        q += size * change
        term.evaluate()
        foreseen.append(part.strain.copy())
        q -= size * change
    term.evaluate()
    term.foresee(change)
    slope = (foreseen[0] - foreseen[1]) / 2e-4
    assert np.abs(part._foreseen - here - slope).max() < 1e-10 * np.abs(slope).max()
    term.linearise(1.0)
    term.add_force(force[1])
    assert np.abs(force[1] - force[0]).max() < 1e-13 * np.abs(force[0]).max()
    term.linearise(0.0)
    assert np.abs(part.stress - part._foreseen).max() < 1e-13 * np.abs(part.stress).max()  # of unit stiffness


def test_what_has_no_energy_is_left_to_newton():
    """A law without potential, a follower pressure on a free edge, and options that ask for another linear solver."""
    woven = cloth(Woven(BLEND)).equilibrium([])
    assert isinstance(woven, descent.StableSolver) and woven.descends is None
    bent = {}
    for search in ("energy", "newton"):
        own = cloth(Potential(BLEND))
        p = fem.Constant(own.domain.mesh, 0.0)
        load = weakform.pressure(p, own.u, own.v, own.dx)
        clamp = supports.clamp(own.domain, own.space, "left")
        solver = own.equilibrium(clamp, load, options={"snes_max_it": 60}, search=search)
        for value in (1e-3, 2e-3):
            p.value = value
            solver.solve()
            solver.commit()
        bent[search] = own.q.x.array.copy()
        if search == "energy":
            assert solver.descends is False and not solver.symmetric and linear.method(solver.snes) == "LU by MUMPS"
    assert np.abs(bent["energy"] - bent["newton"]).max() < 1e-3 * np.abs(bent["newton"]).max()
    assert own.equilibrium(clamp, load, options=linear.ITERATIVE).descends is False
    with pytest.raises(InputError, match="search='best'"):
        own.equilibrium(clamp, load, search="best")


def test_a_form_with_a_law_has_a_potential_only_where_it_is_said_to_be_its_work():
    own = cloth(Potential(BLEND), "membrane")
    term = own.terms[0]
    term.evaluate()
    assert term.potential() == 0.0
    assert FormTerm(term.form, own.q).potential() is None


def test_a_moment_on_directors_has_no_potential():
    """It does work as they turn, which a straight way does not tell; other loads of a shell have one."""
    own = cloth(Potential(BLEND))
    moment = fem.Constant(own.domain.mesh, (0.0, 1.0, 0.0))
    ds = supports.over(own.domain, "left", 2)
    assert FormTerm(weakform.edge_moment(moment, own.director, own.delta, ds), own.q).potential() is None
    p = fem.Constant(own.domain.mesh, 1.0)
    assert FormTerm(weakform.pressure(p, own.u, own.v, own.dx), own.q).potential() == 0.0
    assert FormTerm(weakform.traction(moment, own.v, ds), own.q).potential() == 0.0


class Spring(Term):
    """Holds the middle of a sheet across, by a law of its own: displacement to energy, force and stiffness."""

    symmetric = True

    def __init__(self, own, law):
        self.q, self.law = own.q, law
        space, (back,) = own.q.function_space.sub(0).collapse()
        node = int(np.linalg.norm(space.tabulate_dof_coordinates() - [0.15, 0.15, 0.0], axis=1).argmin())
        self.dof = np.array(back[3 * node + 2 : 3 * node + 3], dtype=np.int32)

    def evaluate(self, tangent=True, stiffest=False):
        self.now = self.law(float(self.q.x.array[self.dof[0]]))
        return True

    def add_force(self, total):
        total[self.dof] += self.now[1]

    def pattern(self):
        return self.dof, self.dof

    def add_stiffness(self, values):
        values += self.now[2]

    def energy(self):
        return self.now[0]

    potential = energy


def sprung(law):
    """A soft sheet with a spring at its middle, pulled in its own plane: displacement of the middle, and the solver."""
    own = cloth(StVenantKirchhoff.isotropic(1e6, 0.3), n=4)
    spring = Spring(own, law)
    bcs = [bc for edge in STUDY["RIM"] for bc in supports.clamp(own.domain, own.space, edge)]
    solver = own.equilibrium(bcs, [1e-3 * own.v[1] * own.dx, spring])
    solver.solve()
    return own.q.x.array[spring.dof[0]], solver


def test_a_balance_at_a_kink_is_taken_though_its_pivot_is_negative():
    """Two parts that soften, one on each side of the kink, where the stiffness counts both; energy rises both ways."""
    z, solver = sprung(lambda x: (x**2 / 2, x, -0.6 if abs(x) < 1e-12 else 1.0))
    assert solver.descends and solver.negative == 1 and abs(z) < 1e-12


@pytest.mark.parametrize("side", [1, -1])
def test_a_sheet_falls_to_the_side_where_energy_does(side):
    """Which is one alone, on the other side the spring holds; one of both cases is not that of the mode's sign."""

    def law(x):
        k = -0.5 if side * x >= 0.0 else 1.0
        return k * x**2 / 2 + 1e5 * x**4 / 4, k * x + 1e5 * x**3, k + 3e5 * x**2

    z, solver = sprung(law)
    assert solver.negative == 0 and side * z > 1e-3
