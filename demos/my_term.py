"""My own term in the weak form: a sheet on an elastic foundation, and a spring along a seam.

The residual is a sum of virtual works. What pushes back is one more term: a force -k u per area does the virtual work
-k u . v dA. Here the foundation resists across the sheet, and along one edge a seam spring resists per length.

A long strip lies on the foundation, and its end edge is lifted by P per width. The checked number: Hetenyi's beam on
an elastic foundation (1946) rises there by w = P / (k/(2 b) + s), b = (k / 4 D)^(1/4), where D = E h^3/12 is its
bending stiffness and s the seam's stiffness per width; further on it dips, by exp(-3 pi/4) w / sqrt(2) at most.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import numpy as np
from dolfinx import fem

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

STRIP = meshing.MESHES / "strip.geo"
LENGTH, WIDTH, THICKNESS = 0.4, 0.05, 1e-3  # m
E, FOUNDATION, SEAM, PULL = 50e6, 2e3, 20.0, 0.02  # Pa, N/m3, N/m2, N/m


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/my_term"))
    parser.add_argument("--cells", type=command.positive, default=60, help="along the strip")
    args = command.parse(parser)
    out = results.folder(args.out)
    domain = meshing.read(STRIP, length=LENGTH, width=WIDTH, nx=args.cells, ny=2)
    strip = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, 0.0), THICKNESS, shear=(E / 2, E / 2))

    # the terms: force times virtual displacement, over cells and over an edge
    k, s = fem.Constant(domain.mesh, FOUNDATION), fem.Constant(domain.mesh, SEAM)
    edge = supports.over(domain, "fixed_end", degree=2)
    foundation = -k * strip.u[2] * strip.v[2] * strip.dx
    seam = -s * strip.u[2] * strip.v[2] * edge
    pull = fem.Constant(domain.mesh, np.zeros(3))
    loads = foundation + seam + weakform.traction(pull, strip.v, edge)

    # it must not slide away in its plane
    held = supports.lead(domain, strip.space, "pulled_end", 0, 0.0) + supports.lead(
        domain, strip.space, "sheet", 1, 0.0
    )
    solver = strip.equilibrium(held, loads)

    def set_load(force):
        pull.value = (0.0, 0.0, force)

    # what pushes back is in the energy too
    stored = fem.form(k / 2 * strip.u[2] ** 2 * strip.dx + s / 2 * strip.u[2] ** 2 * edge)
    bent = fem.form(strip.stored)
    with results.Table(out / "history.csv") as table:
        for step in statics.march(solver, set_load, [PULL], progress="strip"):
            rise = supports.mean(domain, strip.space, strip.q, "fixed_end", 2)
            springs, sheet_energy = (domain.mesh.comm.allreduce(fem.assemble_scalar(form)) for form in (stored, bent))
            table.row(pull_N_per_m=step.load, rise_m=rise, springs_J=springs, sheet_J=sheet_energy)
    u = strip.displacement()
    dip = domain.mesh.comm.allreduce(u.x.array[2::3].min(initial=0.0), MPI.MIN)
    bend, yarns = strip.cell_strain()[:, 3], strip.yarns()
    pictures.picture(out / "deformed.png", u, bend, "curvature K11 (1/m)", "lifted edge", yarns=yarns)

    b = (FOUNDATION / (E * THICKNESS**3 / 3)) ** 0.25
    expected = PULL / (FOUNDATION / (2 * b) + SEAM)
    work = PULL * WIDTH * rise / 2
    misses = (
        rise / expected - 1,
        -dip / (expected * np.exp(-0.75 * np.pi) / np.sqrt(2)) - 1,
        (springs + sheet_energy) / work - 1,
    )
    command.say(f"rise {1e3 * rise:.5f} mm, beam {1e3 * expected:.5f} mm; dip {1e3 * dip:.5f} mm")
    command.say("misses: rise {:.2g} %, dip {:.2g} %, energy {:.2g} %".format(*(100 * miss for miss in misses)))
    good = max(map(abs, misses)) <= 0.01
    command.say(f"check: rise, dip and energy to 1 %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
