"""Sheets that start elsewhere than they are at rest: tubes sewn from a flat panel, or turned at rest."""

import functools
from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem
from scipy.spatial.transform import Rotation

from fabric_fenicsx.contact.skin import Skin
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments.panels import Edge, Panel, Rolled
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.material import Material
from fabric_fenicsx.output.gathering import Whole
from fabric_fenicsx.sheet import Sheet
from fabric_fenicsx.solvers import checkpoint, statics
from fabric_fenicsx.surfaces import meshing, placing, preparing
from fabric_fenicsx.surfaces.grouping import Raw
from fabric_fenicsx.terms import form, supports, weakform

COMM = MPI.COMM_WORLD
R, LENGTH, H, E, PRESSURE = 0.06, 0.04, 1e-3, 8e6, 4e3
CLOTH = Material(law=StVenantKirchhoff.isotropic(E, 0.0), thickness=H, shear=(E / 2, E / 2), areal_mass=0.2)
AROUND = 20
CHORDS = 2 * AROUND * R * np.sin(np.pi / AROUND)
TURN = Rotation.from_rotvec((0.7, -1.1, 0.4))
kinds = pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])


def sewn(kind, start=R, comm=COMM, around=AROUND):
    """From a flat panel whose cells are the chords of a tube; rolled up to another radius."""
    width = CHORDS * around / AROUND
    outline = {"cuff": Edge((0, 0)), "right": Edge((width, 0)), "top": Edge((width, LENGTH)), "left": Edge((0, LENGTH))}
    panel = Panel("tube", outline, placed=Rolled(start, span=(CHORDS, 2 * np.pi)))
    seams = [Seam(("tube", "left"), ("tube", "right"))] if around == AROUND else []
    return sew([panel], seams, cell=CHORDS / AROUND, comm=comm, kind=kind).domain


@functools.cache
def tube(kind):
    """A tube where it starts, of the same cells: surface, and places of the nodes of each cell."""
    made = sewn(kind, comm=MPI.COMM_SELF).mesh
    order, nodes = np.argsort(made.topology.original_cell_index), made.geometry.input_global_indices
    x, cells = placing.cells(made)[order], nodes[made.geometry.dofmaps[0][order]]
    points = np.zeros((cells.max() + 1, 3))
    points[cells] = x
    raw = Raw(Path(), points, [(kind, cells, np.arange(len(cells)))], foreign=False)
    raw.add("tube", 2, np.arange(len(cells)))
    made.topology.create_connectivity(1, 0)
    for name, z in (("cuff", 0.0), ("top", LENGTH)):
        at = np.flatnonzero(np.abs(points[:, 2] - z) < 1e-9)
        at = at[np.argsort(np.arctan2(*points[at, :2].T))]
        raw.add(f"tube.{name}", 1, np.stack([at, np.roll(at, 1)], axis=1))
    return raw, x


def seamless(kind):
    """The mesh in space."""
    make = functools.partial(preparing.prepare, gdim=3, orient=False, scale=1.0, merge=None, triangulate=False)
    return meshing._distribute(meshing._on_root(COMM, lambda: make(tube(kind)[0])), COMM, 3, False)


def turned(kind):
    """At rest it lies turned and shifted elsewhere."""

    def make():
        raw, x = tube(kind)
        return raw, TURN.apply(x.reshape(-1, 3)).reshape(x.shape) + 0.5

    return meshing.sewn(lambda: (*make(), None), COMM)


UP, PANEL, LYING = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), tuple(TURN.apply((0.0, 0.0, 1.0)))
"""Warp of a tube in space, of a panel, and of a tube that lies turned."""


def cloth(domain, kinematics="shell", warp=PANEL):
    own = {"shear": CLOTH.shear} if kinematics == "shell" else {"element": "p1"}
    return Sheet(domain, CLOTH.law, H, warp=warp, kinematics=kinematics, **own)


def held(sheet):
    """A cuff in its plane, and the tube's planes of symmetry."""
    space = sheet.space if sheet.shell is None else sheet.shell.V.sub(0)
    bcs = supports.lead(sheet.domain, sheet.space, "tube.cuff", 2, 0.0)
    for axis in (0, 1):
        component, back = space.sub(axis).collapse()
        on = np.flatnonzero(np.abs(placing.places(component)[:, axis]) < 1e-9 * R)
        zero = fem.Constant(sheet.domain.mesh, 0.0)
        bcs.append(fem.dirichletbc(zero, back[0][on], space.sub(axis)))
    return bcs


def places(sheet):
    """Where the nodes are now, m; on every rank, in an order that does not depend on it."""
    u = sheet.displacement()
    whole = Whole(u.function_space)
    moved = whole(u, {})
    return COMM.bcast(None if moved is None else whole.points + moved[0])


def inflated(sheet):
    """Places under pressure."""
    p = fem.Constant(sheet.domain.mesh, 0.0)
    load = weakform.pressure(p, sheet.u, sheet.v, sheet.dx)
    solver = sheet.equilibrium(held(sheet), load, rtol=1e-11, search="newton")

    def set_load(value):
        p.value = value

    list(statics.march(solver, set_load, [PRESSURE]))
    return places(sheet)


def radii(x):
    return np.hypot(x[:, 0], x[:, 1])


@pytest.mark.parallel(first=1)
@kinds
def test_a_tube_sewn_from_a_flat_panel_is_the_seamless_one(kind):
    """A membrane: wherever it starts from, to all digits."""
    exact = radii(inflated(cloth(seamless(kind), "membrane", UP)))
    assert exact.min() > 1.02 * R
    for start in (0.8 * R, 1.3 * R):
        assert radii(inflated(cloth(sewn(kind, start), "membrane"))) == pytest.approx(exact, rel=1e-10)


@pytest.mark.parallel(first=1)
@kinds
def test_a_shell_sewn_from_a_flat_panel_is_bent_and_does_not_know_its_start(kind):
    """Its weft is as curved as the tube; that hardly makes it narrower."""
    known = inflated(cloth(seamless(kind), warp=UP))
    first, second = (cloth(sewn(kind, start)) for start in (R, 1.2 * R))
    x = inflated(first)
    assert x == pytest.approx(inflated(second), rel=1e-9, abs=1e-11)
    # between the nodes of quadratic cells it is round, and no polygon
    rounder = np.sinc(1 / AROUND) if kind == "triangle" else 1.0
    assert radii(x).max() == pytest.approx(rounder * radii(known).max(), rel=2e-3)
    assert np.abs(first.cell_strain()[:, 4]).mean() == pytest.approx(1 / R, rel=0.1)


@pytest.mark.parallel(first=1)
@kinds
def test_a_shell_that_lies_turned_at_rest_is_the_one_that_does_not(kind):
    """Twisted, in motion, and by its rigid motions, mass and checkpoints."""
    both = cloth(seamless(kind), warp=UP), cloth(turned(kind), warp=LYING)
    twisted = []
    for sheet in both:
        bcs, move = supports.grip(sheet.domain, sheet.shell, "tube.top")
        bcs += supports.clamp(sheet.domain, sheet.space, "tube.cuff")
        solver = sheet.equilibrium(bcs, rtol=1e-11, search="newton")
        list(statics.march(solver, lambda part, move=move: move((0, 0, 0), (0, 0, 0.05 * part)), [1.0]))
        twisted.append(places(sheet))
    assert twisted[1] == pytest.approx(twisted[0], rel=1e-9, abs=1e-11)
    assert both[1].yarns() == pytest.approx(both[0].yarns(), abs=1e-9)
    assert both[1].cell_strain() == pytest.approx(both[0].cell_strain(), rel=1e-6, abs=1e-9)
    assert Skin(both[1]).places() == pytest.approx(Skin(both[0]).places(), abs=1e-11)
    moved = []
    for domain, direction in ((seamless(kind), UP), (turned(kind), LYING)):
        sheet = cloth(domain, warp=direction)
        weight = sheet.weight(0.2, ufl.as_vector((9.81, 0.0, 0.0)))
        bcs = supports.clamp(sheet.domain, sheet.space, "tube.cuff")
        run, ledger = sheet.newmark(0.2, bcs, weight)
        list(run.march(end=4e-3, dt=2e-3))
        moved.append((places(sheet), ledger.row()))
    assert moved[1][0] == pytest.approx(moved[0][0], rel=1e-8, abs=1e-11)
    assert moved[1][1] == pytest.approx(moved[0][1], rel=1e-6, abs=1e-12)


@pytest.mark.parallel(first=1)
@kinds
def test_work_without_a_form_is_that_of_its_form(kind):
    sheet = cloth(sewn(kind, 1.1 * R))
    work = sheet.terms[0]
    x = placing.places(sheet.displacement().function_space)
    _, back = sheet.q.function_space.sub(0).collapse()
    sheet.q.x.array[np.array(back)] += (0.01 * np.sin(50 * x + [[1, 2, 3]])).ravel()
    other = form.FormTerm(work.form, sheet.q)
    forces = []
    for term in (work, other):
        assert term.evaluate()
        forces.append(np.zeros_like(sheet.q.x.array))
        term.add_force(forces[-1])
    assert forces[0] == pytest.approx(forces[1], rel=1e-8, abs=1e-8 * np.abs(forces[1]).max())


@pytest.mark.parallel(first=1)
@kinds
def test_masses_and_areas_are_those_of_the_panel(kind):
    domain = sewn(kind, 2 * R)
    sheet = cloth(domain)
    one = fem.Function(sheet.q.function_space)
    for k in range(3):
        back = sheet.q.function_space.sub(0).sub(k).collapse()[1]
        one.x.array[:] = 0.0
        one.x.array[back] = 1.0
        mass = ufl.action(ufl.action(sheet.mass(0.2, "none"), one), one)
        total = COMM.allreduce(fem.assemble_scalar(fem.form(mass)))
        assert total == pytest.approx(0.2 * CHORDS * LENGTH, rel=1e-12)
    assert checkpoint.identity(domain.mesh) != checkpoint.identity(sewn(kind, R).mesh)
    assert domain.pieces == 1
    meshing.check_surface(domain)


@pytest.mark.parallel
def test_a_start_where_neighbours_face_opposite_sides_is_refused():
    domain = sewn("quadrilateral")
    x = placing.cells(domain.mesh).copy()
    x[..., 0] = 0.0  # folded flat, both halves of the tube on one another
    placing.place(domain.mesh, x)
    with pytest.raises(InputError, match="opposite"):
        cloth(domain)
