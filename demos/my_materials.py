"""My own materials: two fabrics, sewn edge to edge, in one sheet.

A sheet takes a dictionary of materials, each on a named group of cells, with its own law, thickness, warp, mass and
bending. A scene has them as tables `[[sheet.material]]`, see `fabric-fenicsx run --keys`.

The checked numbers: pulled across the seam the fabrics are springs in series, along it springs in parallel, each with
the curve that was fitted to its tests.
"""

# %% [markdown]
# ## The fabrics
# The warp of the one lies along x, that of the other across. A spring does not become narrower: to have a closed form,
# both are without Poisson's ratio here.

# %%
from mpi4py import MPI  # noqa: F401, isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

from dataclasses import replace

import numpy as np
from dolfinx import fem
from scipy.optimize import brentq

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.material import Material
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

LENGTH, SPLIT, WIDTH = 0.2, 0.08, 0.1  # m; the seam is at x = SPLIT
ALONG_X, ALONG_Y = 0.006, 0.003  # m, largest pull

blend, muslin = (replace(fabrics.load(name), poisson={"measured": (0.0, 0.0)}) for name in ("blend", "muslin"))
args = command.script(__doc__, "out/my_materials")

# %% [markdown]
# ## The sheet
# `Material.of` takes what it needs from a measured fabric; `Material(law=..., thickness=...)` is one from its parts,
# `Material(section=...)` a lay-up of several plies, or a stiffness of my own. The seam is where groups meet: there the
# sheet is continuous, and a seam that is stiff or hinged is one more term, as in `my_seam.py`.


# %%
def pulled(axis):
    """A flat sheet between two opposite edges: the sheet, its solver, what pulls it along x or y, unknowns pulled."""
    domain = meshing.read(meshing.MESHES / "panels.geo", length=LENGTH, split=SPLIT, width=WIDTH)
    cloth = sheet.Sheet(domain, {"left": Material.of(blend), "right": Material.of(muslin, warp=(0, 1, 0))})
    still, moved, side = (("fixed_end", "pulled_end", "bottom"), ("bottom", "top", "fixed_end"))[axis]
    space, end = cloth.space, fem.Constant(domain.mesh, 0.0)
    held = supports.lead(domain, space, still, axis, 0.0) + supports.lead(domain, space, moved, axis, end)
    held += supports.lead(domain, space, side, 1 - axis, 0.0)
    for panel in cloth.materials:  # it stays flat
        held += supports.lead(domain, space, panel, 2, 0.0) + supports.hold(domain, space, panel)

    def pull(distance):
        """Move the edge, m."""
        end.value = distance

    return cloth, cloth.equilibrium(held, rtol=1e-9), pull, supports.unknowns(domain, space, moved, axis)


def tension(fabric, yarns, stretch):
    """Force per width of a fabric along its warp or weft, N/m, by the fitted curve."""
    return getattr(fabric, yarns).stress(stretch + stretch**2 / 2) * fabric.thickness * (1 + stretch)


# %% [markdown]
# ## In series
# Across the seam there is one force, and the displacements add up:
#
# $$ F = b\,T_\mathrm{blend}(e) = b\,T_\mathrm{muslin}(e'), \qquad a\,e + a'e' = d, \qquad
#    T(e) = h\,S(e + \tfrac12 e^2)\,(1 + e), $$
#
# with $S$ the fitted curve, $h$ the thickness, $a$, $a'$ the lengths of the panels and $b$ their width.

# %%
misses = []
cloth, solver, pull, edge = pulled(0)
with results.Table(args.out / "series.csv") as table:
    for step in statics.march(solver, pull, ALONG_X * np.array([0.25, 0.5, 1.0]), progress="series"):
        d = step.load
        e = brentq(
            lambda e, d=d: tension(blend, "warp", e) - tension(muslin, "weft", (d - e * SPLIT) / (LENGTH - SPLIT)),
            0.0, d / SPLIT, xtol=1e-14,
        )  # fmt: skip
        force, expected = solver.reaction(edge), WIDTH * tension(blend, "warp", e)
        misses.append(force / expected - 1)
        table.row(pull_m=d, force_N=force, springs_N=expected)
command.say(f"in series: {force:.5f} N, springs {expected:.5f} N")
pictures.picture(
    args.out / "deformed.png", cloth.displacement(), 100 * np.abs(cloth.cell_strain()[:, :2]).max(axis=1),
    "strain along the pull (%)", "blend, warp along the pull; muslin, weft", yarns=cloth.yarns(),
)  # fmt: skip

# %% [markdown]
# ![Two fabrics in series](deformed.png)
#
# ## In parallel
# Along the seam there is one stretch, and the forces add up: $F = a\,T_\mathrm{blend} + a'\,T_\mathrm{muslin}$.

# %%
_, solver, pull, edge = pulled(1)
with results.Table(args.out / "parallel.csv") as table:
    for step in statics.march(solver, pull, ALONG_Y * np.array([0.25, 0.5, 1.0]), progress="parallel"):
        e = step.load / WIDTH
        expected = SPLIT * tension(blend, "weft", e) + (LENGTH - SPLIT) * tension(muslin, "warp", e)
        force = solver.reaction(edge)
        misses.append(force / expected - 1)
        table.row(pull_m=step.load, force_N=force, springs_N=expected)
command.say(f"in parallel: {force:.5f} N, springs {expected:.5f} N")

# %% [markdown]
# ## The check

# %%
worst = max(map(abs, misses))
command.say(f"largest miss {100 * worst:.2g} %")
command.check(worst <= 1e-3, "forces to 0.1 %", args.out)
