"""Seams between sheets at an angle, and of three: no stress at rest, bending and tension by closed forms."""

import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments.panels import Edge, Flat, Panel
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.material import Material
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.terms import supports, weakform

COMM = MPI.COMM_WORLD
A, B, WIDTH, E, H = 0.1, 0.08, 0.01, 1e7, 1e-3
kinds = pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])


def cloth(E=E):
    return Material(law=StVenantKirchhoff.isotropic(E, 0.0), thickness=H, shear=(E / 2, E / 2), areal_mass=0.2)


def strip(name, length, placed):
    corners = ((0, 0), (length, 0), (length, WIDTH), (0, WIDTH))
    return Panel(name, dict(zip(("low", "right", "up", "left"), map(Edge, corners), strict=True)), placed=placed)


def upright(points):
    """At the end of the first strip, in the plane across it; its face to the first one's."""
    x, y = points.T
    return np.column_stack([np.full(len(x), A), y, x])


def onward(points):
    """Where the first strip ends, in its plane."""
    return np.column_stack([A + points[:, 0], points[:, 1], 0.0 * points[:, 0]])


def angle(kind, lean=(-np.pi / 4, -np.pi / 4), cell=20e-3):
    strips = [strip("flat", A, Flat()), strip("up", B, upright)]
    return sew(strips, [Seam(("flat", "right"), ("up", "left"), lean=lean)], cell=cell, kind=kind)


def loaded(sheet, force):
    """By a force per width along x at the free end of the upright strip."""
    load = fem.Constant(sheet.domain.mesh, np.zeros(3))
    ds = supports.over(sheet.domain, "up.right", 2)
    solver = sheet.equilibrium(
        supports.clamp(sheet.domain, sheet.space, "flat.left"), weakform.traction(load, sheet.v, ds), rtol=1e-10,
        search="newton",
    )  # fmt: skip

    def set_load(part):
        load.value[0] = part * force

    list(statics.march(solver, set_load, [1.0]))
    return supports.mean(sheet.domain, sheet.space, sheet.q, "up.right", 0)


@pytest.mark.parallel(first=1)
@kinds
@pytest.mark.parametrize("third", [False, True])
def test_two_panels_at_an_angle_bend_as_a_folded_plate(kind, third):
    """Without stress at rest; then by F b^3/3EI + F b^2 a/EI. With a third panel in the first one's plane, too."""
    sheet = angle(kind).sheet(cloth())
    if third:
        strips, a = [strip("flat", A, Flat()), strip("on", B, onward), strip("up", B, upright)], np.arctan(0.5)
        seam = Seam(("flat", "right"), ("on", "left"), ("up", "left"), lean=(-a, a, a - np.pi / 2))
        sheet = sew(strips, [seam], cell=20e-3, kind=kind).sheet(cloth())
    force = np.zeros_like(sheet.q.x.array)
    assert all([term.evaluate() for term in sheet.terms])
    for term in sheet.terms:
        term.add_force(force)
    assert np.abs(force).max(initial=0.0) < 1e-9 * E * H * WIDTH
    EI, F = E * H**3 / 12, 1e-3
    exact = F * B**3 / 3 / EI + F * B**2 * A / EI
    assert exact < 2e-3
    assert loaded(sheet, F) == pytest.approx(exact, rel=0.01)


@kinds
def test_what_is_sewn_flat_and_starts_at_an_angle_is_bent(kind):
    sheet = angle(kind, lean=(), cell=5e-3).sheet(cloth())
    assert all([term.evaluate() for term in sheet.terms])
    assert sum(term.energy() for term in sheet.terms) > 1e-4


@pytest.mark.parallel(first=1)
@kinds
def test_a_joint_of_three_panels_splits_its_force_by_stiffness(kind):
    """One strip is pulled by two that lie on each other, one of them thrice as stiff."""
    strips = [strip("one", A, Flat()), strip("two", B, Flat((A, 0, 0))), strip("three", B, Flat((A, 0, 0)))]
    seam = Seam(("one", "right"), ("two", "left"), ("three", "left"), name="joint")
    garment = sew(strips, [seam], cell=5e-3, kind=kind)
    domain = garment.domain
    sheet = garment.sheet({"one": cloth(), "two": cloth(), "three": cloth(3 * E)})
    pull = fem.Constant(domain.mesh, 0.0)
    bcs = supports.clamp(domain, sheet.space, "one.left")
    for name in ("two.right", "three.right"):
        bcs += supports.lead(domain, sheet.space, name, 0, pull)
        bcs += supports.hinge(domain, sheet.space, name)[1:] + supports.hold(domain, sheet.space, name)
    solver = sheet.equilibrium(bcs, rtol=1e-10, search="newton")

    def set_load(part):
        pull.value = 1e-3 * part

    list(statics.march(solver, set_load, [1.0]))
    own = domain.mesh.topology.index_map(2).size_local
    along = {}
    for panel in garment.panels:
        cells = domain.entities(panel.name, 2)[1]
        cells = cells[cells < own]
        force = sheet.cell_stress()[cells, 1] * np.sqrt(1 + 2 * sheet.cell_strain()[cells, 1])
        along[panel.name] = np.concatenate(COMM.allgather(force)).mean()
    assert along["three"] == pytest.approx(3 * along["two"], rel=1e-6)
    assert along["one"] == pytest.approx(along["two"] + along["three"], rel=1e-6)
    assert along["one"] > 0.3 * E * 1e-3 / (A + B)


def test_a_joint_that_cannot_be_is_refused():
    with pytest.raises(InputError, match="leans by as many angles below 90 degrees"):
        Seam(("a", "b"), ("c", "d"), lean=(2.0, 0.0))
