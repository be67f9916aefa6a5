"""Jacobians that are singular, infinite or not a number in statics: the step is cut, and ends in one sentence."""

import re
from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem
from test_faulty_laws import Good

from fabric_fenicsx import sheet
from fabric_fenicsx.errors import LawFailed, StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers import checkpoint, statics, zero_energy
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

COMM = MPI.COMM_WORLD
STRIP = Path(meshing.__file__).parents[1] / "meshes" / "strip.geo"


class Late(Good):
    """Goes wrong beyond a strain of 1 %, on the last rank."""

    def __init__(self, fault):
        self.fault = fault

    def answer(self, strain, state):
        """As of `Good`."""
        S, C, new = Good.answer(self, strain, state)
        if self.fault and COMM.rank == COMM.size - 1 and np.abs(strain).max(initial=0.0) > 0.01:
            if self.fault == "raises":
                raise ZeroDivisionError("my law divides by zero")
            array = {"stress": S, "tangent": C, "infinite": C, "state": new}[self.fault]
            array[:] = np.inf if self.fault == "infinite" else np.nan
        return S, C, new


def pulled(law, kinematics, extra=None):
    """A strip that is pulled by 5 %, in what a scene does: solver and what puts the load."""
    domain = meshing.read(STRIP, COMM, length=0.1, width=0.03, nx=6, ny=2)
    cloth = sheet.Sheet(domain, law, 5e-4, (5e5, 5e5), kinematics=kinematics)
    shift = fem.Constant(domain.mesh, 0.0)
    bcs = supports.clamp(domain, cloth.space, "fixed_end")
    bcs += [bc for k in (1, 2) for bc in supports.lead(domain, cloth.space, "pulled_end", k, 0.0)]
    if kinematics == "membrane":
        bcs += supports.lead(domain, cloth.space, "sheet", 2, 0.0)
    bcs += supports.lead(domain, cloth.space, "pulled_end", 0, shift)

    def put(t):
        shift.value = 0.005 * t

    return cloth.equilibrium(bcs, extra(cloth) if extra else 0), put


def sentence(solver, put, kind=StepFailed):
    """What the march ends with; the sheet is then at its last good load, and no number is not finite."""
    seen = []
    with pytest.raises(kind) as error:
        for step in statics.march(solver, put, [0.1, 0.15, 0.6, 1.0]):
            seen.append(step.load)
    assert "\n" not in str(error.value) and "PETSc" not in str(error.value)
    assert np.isfinite(solver.u.x.array).all()
    return str(error.value), seen


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
@pytest.mark.parametrize("fault", ["stress", "tangent", "infinite", "state"])
def test_a_law_that_goes_wrong_cuts_the_step(fault, kinematics):
    law = Late(fault)
    solver, put = pulled(law, kinematics)
    text, seen = sentence(solver, put)
    assert seen[:2] == pytest.approx([0.1, 0.15]) and len(seen) < 4 and "cuts of the step" in text
    assert "Newton's method failed" in text
    # and the solver is not dead
    law.fault = ""
    put(0.1)
    assert solver.solve() >= 1 and np.isfinite(solver.u.x.array).all()


@pytest.mark.parallel
def test_a_slack_flat_membrane_that_is_pressed_is_told_so():
    cloth, bcs, _ = membrane("strip.geo", ["fixed_end", "pulled_end"], nx=6, ny=2)
    p = fem.Constant(cloth.domain.mesh, 0.0)
    solver = cloth.equilibrium(bcs, weakform.pressure(p, cloth.u, cloth.v, cloth.dx), search="newton")

    def put(t):
        p.value = t

    text, seen = sentence(solver, put)
    assert seen == [] and "Newton's method failed" in text and "nothing resists 15 motions" in text


def membrane(mesh, groups, nu=0.3, **numbers):
    """An elastic membrane, conditions that hold groups, and a force, so far 0."""
    domain = meshing.read(STRIP.with_name(mesh), COMM, length=0.2, width=0.1, **numbers)
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(1e6, nu), 1e-3, kinematics="membrane")
    bcs = [bc for name in groups for bc in supports.hinge(domain, cloth.space, name)]
    return cloth, bcs, fem.Constant(domain.mesh, np.zeros(3))


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("mesh", "bcs", "numbers", "count", "place"),
    [
        ("strip.geo", ["fixed_end", "pulled_end"], {"nx": 4, "ny": 2}, 9, ""),  # all nodes between the ends
        ("panels.geo", ["left"], {"nx": 3, "mx": 1, "ny": 2}, 3, r"\(0.2, "),  # a flap of one row of cells
    ],
)
def test_what_nothing_resists_at_first_is_counted_and_named(mesh, bcs, numbers, count, place):
    cloth, bcs, force = membrane(mesh, bcs, **numbers)
    solver = cloth.equilibrium(bcs, ufl.inner(force, cloth.v) * cloth.dx, search="newton")
    said = zero_energy.named(solver)
    assert said.startswith(f"At first nothing resists {count} motions that")
    assert re.search(rf"one moves it along z, most at {place}", said)
    if mesh == "panels.geo":  # Newton's method does not find how the flap stands, and says why

        def put(t):
            force.value[2] = t

        text, seen = sentence(solver, put)
        assert seen == [] and "At first nothing resists 3 motions" in text


@pytest.mark.parallel
def test_directors_that_nothing_holds_are_named():
    domain = meshing.read(STRIP, COMM, length=0.2, width=0.1, nx=2, ny=1)
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(1e6, 0.3), 1e-3, (1e5, 1e5))
    solver = statics.StaticSolver(ufl.inner(cloth.u, cloth.v) * cloth.dx, cloth.q, [], space=cloth.shell)
    said = zero_energy.named(solver)
    assert "nothing resists 12 motions" in said and "one turns directors" in said


@pytest.mark.parallel
def test_a_membrane_is_pulled_in_its_plane_by_newtons_method():
    """Nothing resists it across its plane, and nothing moves it there: F = E h b e (1 + e), e = u' + u'^2/2."""
    cloth, bcs, force = membrane("strip.geo", ["fixed_end"], 0.0, nx=4, ny=2)
    load = weakform.traction(force, cloth.v, supports.over(cloth.domain, "pulled_end", 2))
    solver = cloth.equilibrium(bcs, load, rtol=1e-10, search="newton")

    def put(t):
        force.value[0] = t

    slope = 0.02
    e = slope + slope**2 / 2
    list(statics.march(solver, put, [0.5, 1e6 * 1e-3 * e * (1 + slope)]))
    assert supports.mean(cloth.domain, cloth.space, cloth.q, "pulled_end", 0) == pytest.approx(0.2 * slope, rel=1e-9)
    assert np.abs(cloth.q.x.array.reshape(-1, 3)[:, 2]).max(initial=0.0) == 0.0


@pytest.mark.parallel
def test_a_term_with_an_infinite_derivative_at_rest_is_told_so():
    law = StVenantKirchhoff.isotropic(1e6, 0.3)
    solver, put = pulled(law, "shell", lambda own: -ufl.sqrt(own.u[2]) * own.v[2] * own.dx)
    text, seen = sentence(solver, put)
    assert seen == [] and "Newton's method failed" in text


@pytest.mark.parallel
def test_a_law_that_raises_ends_the_march_in_a_sentence():
    """Also on one rank only."""
    text, seen = sentence(*pulled(Late("raises"), "shell"), LawFailed)
    assert seen == pytest.approx([0.1, 0.15]) and "ZeroDivisionError('my law divides by zero')" in text


@pytest.mark.parallel
@pytest.mark.parametrize(("fault", "kind"), [("raises", LawFailed), ("state", StepFailed)])
def test_a_motion_whose_law_fails_leaves_its_last_good_state(tmp_path, fault, kind):
    """A state that is not finite is none; f11's law whose history is NaN ended with status 0."""
    path = COMM.bcast(tmp_path) / "state.npz"

    def start(law):
        domain = meshing.read(STRIP, COMM, length=0.1, width=0.03, nx=4, ny=2)
        cloth = sheet.Sheet(domain, law, 5e-4, (5e5, 5e5))
        end = fem.Constant(domain.mesh, 0.0)
        bcs = supports.clamp(domain, cloth.space, "fixed_end") + supports.lead(
            domain, cloth.space, "pulled_end", 0, end
        )

        def put(t):
            end.value = 0.4 * t

        return cloth.newmark(0.2, bcs, set_load=put)[0]

    run, seen = start(Late(fault)), 0.0
    with pytest.raises(kind), checkpoint.guard(path, run, every=0.0):
        for step in run.march(0.02, 1e-3):
            seen = step.load
    assert 0.0 < seen < 0.02
    again = start(Late(""))
    checkpoint.load(path, again)
    assert seen <= again.time < seen + 1e-3 and all(np.isfinite(array).all() for *_, array in again.fields())
