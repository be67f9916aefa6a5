"""My own rigid bar: a strip whose end sits in a stiff bar is rolled into a circle by a moment on that bar.

A support that is given moves as it is told. What is rigid and not given, such as the bar at the end of a strip, a
batten or the jaw of a loose clamp, has six unknowns and moves as its loads ask.

The checked number: how far the bar is from the arc that the moment asks for, in percent of the length.
"""

# %% [markdown]
# ## A strip and its bar
# The other end is clamped. Without contraction ($\nu = 0$) a bent strip is a beam, and is exactly one.

# %%
from mpi4py import MPI  # noqa: F401, isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import numpy as np
from dolfinx import fem

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import pictures
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

LENGTH, WIDTH, H, E = 0.2, 0.05, 1e-3, 1e6  # m, Pa
ACCEPTED = 0.5  # %

args = command.script(__doc__, "out/my_bar", cells=40)
domain = meshing.read(meshing.MESHES / "strip.geo", length=LENGTH, width=WIDTH, nx=args.cells, ny=2)
cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, 0.0), H, (E / 2, E / 2))
space = cloth.space
held = supports.clamp(domain, space, "fixed_end")
supports.rigid(domain, space, "pulled_end")

# %% [markdown]
# ## A moment on the bar
# A moment $\mathbf{m}$ per length of the edge does the work $\mathbf{m}\cdot(\mathbf{d}\times\delta\mathbf{d})$ on the
# directors $\mathbf{d}$ of the edge, which turn with the bar. With the bending stiffness $B = E h^3/12$ per width,
#
# $$ m = B\,\frac{\alpha}{L} $$
#
# bends the strip to an arc of the angle $\alpha$, whose end is at
#
# $$ x = L\,\frac{\sin\alpha}{\alpha}, \qquad z = L\,\frac{1 - \cos\alpha}{\alpha} . $$

# %%
moment = fem.Constant(domain.mesh, np.zeros(3))
edge = supports.over(domain, "pulled_end", 1)
solver = cloth.equilibrium(held, weakform.edge_moment(moment, cloth.director, cloth.delta, edge))


def roll(part):
    """Bend to this part of a circle."""
    moment.value[1] = -E * H**3 / 12 * 2 * np.pi * part / LENGTH


# %% [markdown]
# ## From flat to a circle
# The strip is led by nothing but its load: after sixteen steps the bar lies on the clamp.

# %%
misses = []


def probes(step):
    """Where the bar is."""
    x, z = (supports.mean(domain, space, cloth.q, "pulled_end", k) for k in (0, 2))
    angle = 2 * np.pi * step.load
    there = LENGTH * np.sin(angle) / angle, LENGTH * (1 - np.cos(angle)) / angle
    misses.append(100 * np.hypot(LENGTH + x - there[0], z - there[1]) / LENGTH)
    return {"part_of_circle": step.load, "end_x_m": LENGTH + x, "end_z_m": z, "miss_percent": misses[-1]}


with Recorder(cloth, args.out, probes, when=lambda step: "", picture=None) as record:
    for step in statics.march(solver, roll, np.linspace(0, 1, 17)[1:], progress="roll"):
        record(step)
        if step.number == 12:
            warp = cloth.yarns()[:, 0]
            turned = np.degrees(np.arctan2(warp[:, 2], warp[:, 0])) % 360
            title, view = "three quarters of a circle", (0.3, -2.0, 0.5)
            pictures.picture(
                args.out / "deformed.png", cloth.displacement(), turned, "turned (degrees)", title, view=view
            )

# %% [markdown]
# ![The strip, three quarters of a circle](deformed.png)
#
# ## The check
# A polygon of so many cells stands for the circle.

# %%
command.say(f"the bar at the end: {record.table.rows[-1]['end_x_m']:.2e} m, {record.table.rows[-1]['end_z_m']:.2e} m")
command.check(max(misses) <= ACCEPTED, f"within {ACCEPTED:g} % of the arc, at most {max(misses):.2g} %", args.out)
