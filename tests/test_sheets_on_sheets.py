"""Sheets that lie on each other: pressure goes through, and the pattern of the matrix follows."""

from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem
from test_contact import G, H, M

from fabric_fenicsx import sheet
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

SIDE, APART = 0.2, 2e-3


def stack(cells=(3, 4)):
    """An .obj file of square pieces above each other, with these numbers of cells along a side."""
    x, faces = [], []
    for k, n in enumerate(cells):
        s = np.linspace(0, SIDE, n + 1)
        first = sum((m + 1) ** 2 for m in cells[:k])
        x += [(a, b, k * APART) for b in s for a in s]
        faces += [[first + j * (n + 1) + i + d for d in (0, 1, n + 2, n + 1)] for j in range(n) for i in range(n)]
    lines = [f"v {a:.12g} {b:.12g} {c:.12g}" for a, b, c in x]
    return "\n".join(lines + [" ".join(map(str, ["f", *(1 + np.array(face))])) for face in faces]) + "\n"


@pytest.mark.parallel
def test_a_stack_carries_its_weight_from_sheet_to_sheet(tmp_path_factory):
    comm = MPI.COMM_WORLD
    path = comm.bcast(str(tmp_path_factory.mktemp("stack") / "stack.obj") if comm.rank == 0 else None)
    if comm.rank == 0:
        Path(path).write_text(stack())
    comm.Barrier()
    domain = meshing.read(path, comm)
    assert domain.pieces == 2
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(8e6, 0.25), H, (3e6, 3e6))
    table = bodies.Plane(point=(0, 0, -APART))
    touch = Contact(cloth, [table], friction=0.3, reach=1e-3, stiffness=10.0)
    weight = cloth.weight(M, ufl.as_vector((0.0, 0.0, -G)))
    run, ledger = cloth.newmark(M, [], [weight, *touch.terms], accuracy=np.inf)
    for _ in run.march(0.2, 5e-3):
        assert touch.least_gap() > 0.0 and not touch.crossed()
    W = M * G * SIDE**2
    upper = touch._around.skin.rest[:, 2] > APART / 2
    assert touch.force(table)[2] == pytest.approx(-2 * W, rel=0.01)
    assert touch.forces()[upper, 2].sum() == pytest.approx(W, rel=0.01)
    assert abs(ledger.totals["imbalance"]) < 0.01 * ledger.most


def test_pressure_goes_through_two_sheets_whose_meshes_do_not_match(tmp_path):
    """At each node: its share of the load on the upper sheet, nothing on the lower one between that and the table."""
    (tmp_path / "stack.obj").write_text(stack((5, 7)))
    domain = meshing.read(tmp_path / "stack.obj", MPI.COMM_SELF)
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(8e6, 0.25), H, (3e6, 3e6))
    table = bodies.Plane(point=(0, 0, -APART))
    touch = Contact(cloth, [table], offset=APART - 5e-4, reach=1e-3, stiffness=10.0)
    held = [bc for axis in (0, 1) for bc in supports.lead(domain, cloth.space, "sheet", axis, 0.0)]
    pressure = fem.Constant(domain.mesh, 0.0)
    upper = ufl.conditional(ufl.gt(ufl.SpatialCoordinate(domain.mesh)[2], APART / 2), pressure, 0.0)
    load = cloth.weight(1.0, ufl.as_vector((0.0, 0.0, -upper)))
    solver = cloth.equilibrium(held, [load, *touch.terms], rtol=1e-8)

    def press(value):
        pressure.value = value

    for _ in statics.march(solver, press, [1.0, 10.0, 100.0]):
        pass
    skin = touch._around.skin
    share = np.abs(fem.assemble_vector(fem.form(load)).array[skin.local[:, 2]])
    above, force = skin.rest[:, 2] > APART / 2, touch.forces()[:, 2]
    assert share[above].sum() == pytest.approx(100 * SIDE**2) and share[~above].sum() == 0.0
    assert force[above] == pytest.approx(share[above], rel=0.01)
    assert np.abs(force[~above]).max() < 0.01 * share[above].max()
    assert touch.force(table)[2] == pytest.approx(-100 * SIDE**2, rel=1e-6)
