"""My own load: wind on a sail, as one term in UFL that follows the moved surface.

A load is its virtual work: a form linear in the test function v of the displacement. It may hold the unknown u; UFL
differentiates it, so that Newton's method sees how the load turns and stretches with the sheet.

The checked number: a strip held taut by two opposite edges takes the shape of a catenary (James Bernoulli's velaria).
"""

# %% [markdown]
# ## The term
# Wind of the speed $w$ presses by $\tfrac12\rho\,(w\cdot n)^2$ along the unit normal $n$ (Newton's sine-square law).
# With the normal as long as its area, `kinematics.area_vector`, the virtual work is
#
# $$ \delta W = \int_A \frac{\rho}{2}\,\frac{(w\cdot n)^2}{n\cdot n}\; n\cdot\delta u\;\mathrm{d}A . $$

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from scipy.optimize import brentq

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.shell import kinematics
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

LENGTH, WIDTH, THICKNESS, TAUT = 1.0, 0.1, 0.3e-3, 0.01  # m; TAUT: how far the edges are pulled apart
E, AIR, STORM = 20e6, 1.2, 30.0  # Pa, kg/m3, m/s


def wind(cloth, speed):
    """Virtual work of a wind (vector, m/s) on a sheet: the term."""
    n = kinematics.area_vector(cloth.u, cloth.domain.mesh)  # normal times area, per reference area
    pressure = AIR / 2 * ufl.dot(speed, n) ** 2 / ufl.dot(n, n)
    return pressure * ufl.inner(n, cloth.v) * cloth.dx


# %% [markdown]
# ## The sail
# First it is pulled taut, then the wind blows: slack cloth has too many ways to go. It may not move across, as if it
# were cut out of a broad sail.

# %%
args = command.script(__doc__, "out/my_load", cells=32)
domain = meshing.read(meshing.MESHES / "strip.geo", length=LENGTH, width=WIDTH, nx=args.cells, ny=2)
law = StVenantKirchhoff.isotropic(E, 0.0)
sail = sheet.Sheet(domain, law, THICKNESS, shear=(E / 2, E / 2))
pull, blowing = fem.Constant(domain.mesh, 0.0), fem.Constant(domain.mesh, np.zeros(3))
held = supports.hinge(domain, sail.space, "fixed_end")
held += [bc for k, by in enumerate((pull, 0, 0)) for bc in supports.lead(domain, sail.space, "pulled_end", k, by)]
held += supports.lead(domain, sail.space, "sheet", 1, 0.0)
solver = sail.equilibrium(held, wind(sail, blowing))


def set_load(part):
    """Taut at 1, the whole storm at 2."""
    pull.value = TAUT * min(part, 1.0)
    blowing.value = (0.0, 0.0, STORM * max(part - 1.0, 0.0))


with results.Table(args.out / "history.csv") as table:
    for step in statics.march(solver, set_load, np.linspace(1, 2, 9), progress="wind"):
        sag = domain.mesh.comm.allreduce(sail.displacement().x.array[2::3].max(initial=0.0), MPI.MAX)
        wind_speed = STORM * (step.load - 1)
        table.row(wind_m_per_s=wind_speed, sag_m=sag, newton_iterations=step.newton_iterations)
u, strain, yarns = sail.displacement(), sail.cell_strain()[:, 0], sail.yarns()
pictures.picture(args.out / "deformed.png", u, strain, "warp strain E11 (-)", f"wind {STORM:g} m/s", yarns=yarns)

# %% [markdown]
# ![The sail in the storm](deformed.png)
#
# ## The check
# Under this law of pressure the tension is $\tfrac12\rho w^2 a$ everywhere, with $a$ the parameter of the catenary,
# and the sag is
#
# $$ a\left(\cosh\frac{D}{2a} - 1\right) $$
#
# between edges a distance $D$ apart. How long the catenary is, the stretch of the cloth tells: with $b = D/2a$ its
# tension must meet the cloth's.

# %%
D = LENGTH + TAUT


def excess(b):
    """Tension of the cloth, by its first Piola-Kirchhoff stress, less that of the catenary; N/m."""
    stretch = np.sinh(b) / b * D / LENGTH
    return THICKNESS * E * stretch * (stretch**2 - 1) / 2 - AIR / 2 * STORM**2 * D / (2 * b)


b = brentq(excess, 1e-3, 3.0)
expected = D / (2 * b) * (np.cosh(b) - 1)
command.say(f"sag {sag:.5f} m, catenary {expected:.5f} m")
command.check(abs(sag / expected - 1) <= 2e-3, "the sail is a catenary to 0.2 %", args.out)
