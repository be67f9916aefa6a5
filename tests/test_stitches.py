"""Seams that open: springs in series, any motion as a whole, exact tangents, and threads that tear."""

import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from test_terms import remainders

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments.panels import Edge, Flat, Panel
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.material import Material
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import placing
from fabric_fenicsx.terms import supports
from fabric_fenicsx.terms.stitches import Stitches

COMM = MPI.COMM_WORLD
L, W, H, E = 0.1, 0.06, 1e-3, 1e6
ACROSS, ALONG = 4e5, 1e5  # N/m2
CLOTH = Material(law=StVenantKirchhoff.isotropic(E, 0.0), thickness=H, shear=(E / 2, E / 2))
OUTLINE = {"hem": Edge((0, 0)), "right": Edge((L, 0)), "top": Edge((L, W)), "left": Edge((0, W))}


def panels(kind="quadrilateral", kinematics="membrane", **thread):
    """Two panels side by side along x, tied by a thread."""
    both = [Panel("one", OUTLINE), Panel("two", OUTLINE, placed=Flat((L, 0, 0)))]
    seam = Seam(("one", "right"), ("two", "left"), name="seam", joined=False)
    garment = sew(both, [seam], cell=0.03, kind=kind)
    cloth = garment.sheet(CLOTH, kinematics=kinematics)
    edges = (cloth.domain, cloth.space, cloth.q, "one.right", "two.left")
    stitches = Stitches(*edges, **({"across": ACROSS, "along": ALONG} | thread))
    cloth.terms.append(stitches)
    return cloth, stitches


def held(cloth, end):
    """In its plane, and pulled along x."""
    given = [("one.left", 0, 0.0), ("two.right", 0, end), ("one.left", 1, 0.0), ("two.right", 1, 0.0)]
    given += [("one", 2, 0.0), ("two", 2, 0.0)]
    return [bc for name, axis, value in given for bc in supports.lead(cloth.domain, cloth.space, name, axis, value)]


def series(d):
    """Force of panel, thread and panel that are drawn out by d together, and the opening of the seam."""

    def force(s):
        return E * H * W * (s + s**2 / 2) * (1 + s)

    s = brentq(lambda s: 2 * L * s + force(s) / (ACROSS * W) - d, 0, d / L, xtol=1e-15)
    return force(s), force(s) / (ACROSS * W)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])
def test_panels_and_their_seam_are_springs_in_series(kind):
    cloth, stitches = panels(kind)
    end = fem.Constant(cloth.domain.mesh, 0.0)
    solver = cloth.equilibrium(held(cloth, end), rtol=1e-10)
    pulled = supports.unknowns(cloth.domain, cloth.space, "two.right", 0)

    def pull(d):
        end.value = d

    for step in statics.march(solver, pull, [0.005, 0.01]):
        force, opening = series(step.load)
        assert solver.reaction(pulled) == pytest.approx(force, rel=1e-8)
        assert stitches.opening == pytest.approx(np.broadcast_to([opening, 0, 0], stitches.opening.shape), abs=1e-10)
    assert COMM.allreduce(stitches.energy()) == pytest.approx(ACROSS * W * opening**2 / 2, rel=1e-8)
    assert not stitches.torn.any() and COMM.allreduce(stitches.dissipated()) == 0.0


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kinematics", ["membrane", "shell"])
def test_forces_are_those_of_the_gap_and_turn_with_the_sheet(kinematics):
    """Panels that move as wholes: a W g across the seam, b W s along it, in whatever direction that is."""
    cloth, stitches = panels(kinematics=kinematics)
    turn, gap = Rotation.from_rotvec([0.3, -1.1, 2.0]), np.array([0.02, 0.01, -0.015])
    part, target = cloth.space, np.arange(len(cloth.q.x.array))
    if cloth.shell is not None:
        part, target = cloth.shell.V.sub(0).collapse()
    target, start = np.array(target).reshape(-1, 3), placing.places(part)
    second = np.unique(part.dofmap.list[cloth.domain.entities("two", 2)[1]])
    moved = start.copy()
    moved[second] += gap
    cloth.q.x.array[target] = turn.apply(moved) - start
    assert stitches.evaluate()
    assert stitches.opening == pytest.approx(np.broadcast_to(turn.apply(gap), stitches.opening.shape), abs=1e-12)
    stored = W * (ACROSS * (gap[0] ** 2 + gap[2] ** 2) + ALONG * gap[1] ** 2) / 2
    assert COMM.allreduce(stitches.energy()) == pytest.approx(stored, rel=1e-10)
    total = np.zeros(len(cloth.q.x.array))
    stitches.add_force(total)
    own = second[second < part.dofmap.index_map.size_local]
    force = COMM.allreduce(total[target[own]].sum(axis=0))
    line = np.array([ACROSS, ALONG, ACROSS]) * gap
    assert force == pytest.approx(W * turn.apply(line), rel=1e-9, abs=1e-9)


@pytest.mark.parallel
def test_the_tangent_is_exact():
    cloth, _ = panels()
    solver = cloth.equilibrium([])
    assert solver.symmetric
    assert remainders(solver, 0.004).min() > 1.9


@pytest.mark.parallel
def test_a_thread_tears_and_what_it_stored_is_lost():
    """Between two steps; a checkpoint knows, and the loose panel follows its end."""
    strength = 0.9 * ACROSS * series(0.01)[1]
    cloth, stitches = panels(strength=strength)
    end = fem.Constant(cloth.domain.mesh, 0.0)
    solver = cloth.equilibrium(held(cloth, end), rtol=1e-10)
    pulled = supports.unknowns(cloth.domain, cloth.space, "two.right", 0)
    forces = []

    def pull(d):
        end.value = d

    for _ in statics.march(solver, pull, [0.005, 0.01, 0.015]):
        forces.append(solver.reaction(pulled))
    assert forces == pytest.approx([series(0.005)[0], series(0.01)[0], 0.0], rel=1e-6, abs=1e-6)
    assert stitches.torn.all()
    assert COMM.allreduce(stitches.energy()) == 0.0
    assert COMM.allreduce(stitches.dissipated()) == pytest.approx(ACROSS * W * series(0.01)[1] ** 2 / 2, rel=1e-6)
    again = Stitches(cloth.domain, cloth.space, cloth.q, "one.right", "two.left", across=ACROSS, strength=strength)
    for (name, cells, kept), (other, same, told) in zip(stitches.fields(), again.fields(), strict=True):
        assert name == other and (cells == same).all()
        told[:] = kept
    again.renew()
    assert again.torn.all() and COMM.allreduce(again.energy()) == 0.0


def test_a_seam_that_tears_is_in_the_account_of_a_motion():
    strength = 0.3 * ACROSS * series(0.01)[1]
    cloth, stitches = panels(strength=strength)
    end = fem.Constant(cloth.domain.mesh, 0.0)
    time = 0.02

    def pull(t):
        end.value = 0.01 * t / time

    run, ledger = cloth.newmark(0.2, held(cloth, end), rho=1.0, set_load=pull, rtol=1e-8)
    torn = [stitches.torn.mean() for _ in run.march(time, time / 100)]
    assert torn[0] == 0.0 and torn[-1] == 1.0
    lost = W * strength**2 / (2 * ACROSS)
    assert lost <= ledger.totals["by_law"] < 1.3 * lost
    assert ledger.worst < 5e-3 * ledger.most


def test_what_cannot_be_stitched_is_refused():
    cloth, _ = panels()
    edges = (cloth.domain, cloth.space, cloth.q)
    with pytest.raises(InputError, match=r"has across=0\.0; make it positive"):
        Stitches(*edges, "one.right", "two.left", across=0.0)
    with pytest.raises(InputError, match=r"'one\.right' has 2 cells and 'two\.top' 4"):
        Stitches(*edges, "one.right", "two.top", across=1.0)
