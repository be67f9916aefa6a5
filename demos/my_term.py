"""My own term in the weak form: a sheet on an elastic foundation, and a spring along a seam.

The residual is a sum of virtual works. What pushes back is one more term in UFL, over cells, over an edge, over the
edges between cells or at points.

The checked number: a long strip on a foundation, whose end is lifted, is Hetenyi's beam on an elastic foundation.
"""

# %% [markdown]
# ## The terms
# A force $-k\,u$ per area does the virtual work
#
# $$ -\int_A k\,u_3\,\delta u_3\,\mathrm{d}A . $$
#
# Here the foundation resists across the sheet, and along one edge a seam spring resists per length. What resists is
# negative among the loads.

# %%
from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import numpy as np
from dolfinx import fem

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

LENGTH, WIDTH, THICKNESS = 0.4, 0.05, 1e-3  # m
E, FOUNDATION, SEAM, PULL = 50e6, 2e3, 20.0, 0.02  # Pa, N/m3, N/m2, N/m

args = command.script(__doc__, "out/my_term", cells=60)
domain = meshing.read(meshing.MESHES / "strip.geo", length=LENGTH, width=WIDTH, nx=args.cells, ny=2)
strip = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, 0.0), THICKNESS, shear=(E / 2, E / 2))
k, s = fem.Constant(domain.mesh, FOUNDATION), fem.Constant(domain.mesh, SEAM)
edge = supports.over(domain, "fixed_end", degree=2)
foundation = -k * strip.u[2] * strip.v[2] * strip.dx
seam = -s * strip.u[2] * strip.v[2] * edge

# %% [markdown]
# ## The strip
# Its end edge is lifted by a force per length; it must not slide away in its plane.

# %%
pull = fem.Constant(domain.mesh, np.zeros(3))
loads = foundation + seam + weakform.traction(pull, strip.v, edge)
held = supports.lead(domain, strip.space, "pulled_end", 0, 0.0) + supports.lead(domain, strip.space, "sheet", 1, 0.0)
solver = strip.equilibrium(held, loads)


def set_load(force):
    """Lift by a force in N/m."""
    pull.value = (0.0, 0.0, force)


# what pushes back is in the energy too
stored = fem.form(k / 2 * strip.u[2] ** 2 * strip.dx + s / 2 * strip.u[2] ** 2 * edge)
bent = fem.form(strip.stored)
with results.Table(args.out / "history.csv") as table:
    for step in statics.march(solver, set_load, [PULL], progress="strip"):
        rise = supports.mean(domain, strip.space, strip.q, "fixed_end", 2)
        springs, sheet_energy = (domain.mesh.comm.allreduce(fem.assemble_scalar(form)) for form in (stored, bent))
        table.row(pull_N_per_m=step.load, rise_m=rise, springs_J=springs, sheet_J=sheet_energy)
u = strip.displacement()
dip = domain.mesh.comm.allreduce(u.x.array[2::3].min(initial=0.0), MPI.MIN)
bend, yarns = strip.cell_strain()[:, 3], strip.yarns()
pictures.picture(args.out / "deformed.png", u, bend, "curvature K11 (1/m)", "lifted edge", yarns=yarns)

# %% [markdown]
# ![The lifted end](deformed.png)
#
# ## The check
# With $P$ the force per width and $D = Eh^3/12$, the end rises by (Hetenyi 1946)
#
# $$ w = \frac{P}{k/(2b) + s}, \qquad b = \left(\frac{k}{4D}\right)^{1/4}, $$
#
# and further on the strip dips, by $e^{-3\pi/4}\,w/\sqrt{2}$ at most. The work $\tfrac12 P w$ is all stored.

# %%
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
command.check(max(map(abs, misses)) <= 0.01, "rise, dip and energy to 1 %", args.out)
