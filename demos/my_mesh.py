"""My own mesh: a sleeve that gmsh makes from a few lines of Python, and a bag from a file of another program.

`meshing.from_gmsh(build)` takes whatever `build` leaves in gmsh; `meshing.read` takes gmsh's own files and those of
other programs. Both refuse what no shell can stand on, and say which cell and why.

The checked numbers: the sleeve and the bag, inflated, widen as closed forms say.
"""

# %% [markdown]
# ## A mesh from gmsh's Python
# Supports and loads find the parts of a mesh by the *names* of gmsh's physical groups.

# %%
from mpi4py import MPI  # noqa: F401, isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import gmsh
import numpy as np
from dolfinx import fem
from scipy.optimize import brentq

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import pictures
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

RADIUS, LENGTH, PRESSURE = 0.06, 0.3, 40e3  # m, Pa
BAG_RADIUS, SKIN, E, NU, BAG_PRESSURE = 0.2, 4e-3, 10e6, 0.3, 100.0  # m, Pa


def sleeve(around=48, along=12):
    """A cylinder about the y axis, of quadrilaterals, in the current gmsh model."""
    geo = gmsh.model.geo
    centre = geo.addPoint(0, 0, 0)
    corners = [geo.addPoint(RADIUS * np.sin(a), 0, RADIUS * np.cos(a)) for a in np.arange(4) * np.pi / 2]
    arcs = [geo.addCircleArc(corners[k], centre, corners[k - 3]) for k in range(4)]
    for arc in arcs:
        geo.mesh.setTransfiniteCurve(arc, around // 4 + 1)
    made = geo.extrude([(1, arc) for arc in arcs], 0, LENGTH, 0, numElements=[along], recombine=True)
    geo.synchronize()
    gmsh.model.addPhysicalGroup(2, [tag for dim, tag in made if dim == 2], name="sleeve")
    gmsh.model.addPhysicalGroup(1, arcs, name="cuff")
    gmsh.model.addPhysicalGroup(0, corners[:1], name="front")
    gmsh.model.addPhysicalGroup(0, corners[1:2], name="side")
    gmsh.model.mesh.generate(2)


# %% [markdown]
# ## Pressure inside
# `weakform.pressure` follows the moved surface: it is what is subtracted from the internal work.


# %%
def inflate(cloth, held, pressure, steps, picture, label):
    """Blow up a sheet; its displacement."""
    p = fem.Constant(cloth.domain.mesh, 0.0)
    solver = cloth.equilibrium(held, weakform.pressure(p, cloth.u, cloth.v, cloth.dx))

    def set_load(value):
        p.value = value

    for _ in statics.march(solver, set_load, np.linspace(0, pressure, steps + 1)[1:], progress=label):
        pass
    u, strain = cloth.displacement(), cloth.cell_strain()[:, 1]
    pictures.picture(picture, u, strain, "weft strain E22 (-)", label, yarns=cloth.yarns())
    return u


# %% [markdown]
# ## The sleeve
# Warp along it, free to become shorter, of a measured fabric. It is under uniaxial stress of its weft,
#
# $$ S_{22} = \frac{p R\,\lambda}{h}, \qquad E_{11} = -\nu_{21}E_{22}, \qquad \lambda = \sqrt{1 + 2E_{11}}, $$
#
# with $S_{22}(E_{22})$ the measured curve of the weft.

# %%
args = command.script(__doc__, "out/my_mesh")
domain, fabric = meshing.from_gmsh(sleeve), fabrics.load("blend")
h, G = fabric.thickness, fabric.shear.modulus[0]
cloth = sheet.Sheet(domain, Potential(fabric), h, shear=(G, G), warp=(0, 1, 0))
held = supports.lead(domain, cloth.space, "cuff", 1, 0.0)
held += supports.lead(domain, cloth.space, "front", 0, 0.0) + supports.lead(domain, cloth.space, "side", 2, 0.0)
inflate(cloth, held, PRESSURE, 5, args.out / "sleeve.png", "sleeve")
wider = supports.mean(domain, cloth.space, cloth.q, "side", 0) / RADIUS
nu21 = fabric.poisson["measured"][1]
E22 = brentq(lambda E: fabric.weft.stress(E) - PRESSURE * RADIUS / h * np.sqrt(1 - 2 * nu21 * E), 0, 0.2)
expected_wider = np.sqrt(1 + 2 * E22) - 1
command.say(f"sleeve: {100 * wider:.3f} % wider, expected {100 * expected_wider:.3f} %")

# %% [markdown]
# ![The sleeve under pressure](sleeve.png)
#
# ## The bag
# An `.obj` file of another program; its free edges are the group "boundary". A linear elastic skin widens by
# $w = pR^2(1-\nu)/(2Eh)$. Where it is clamped at its rim, the rest of it rises by
#
# $$ \frac{1+\nu}{bR}\,w, \qquad b^4 = \frac{3(1-\nu^2)}{(Rh)^2}, $$
#
# on top of that (Geckeler's edge of a thin shell).

# %%
domain = meshing.read(meshing.MESHES / "bag.obj")
skin = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, NU), SKIN, shear=(E / 2, E / 2), warp=(1, 0.1, 0.2))
u = inflate(skin, supports.clamp(domain, skin.space, "boundary"), BAG_PRESSURE, 1, args.out / "bag.png", "bag")
x = u.function_space.tabulate_dof_coordinates()
top = x[:, 2] > 0.98 * BAG_RADIUS
top[u.function_space.dofmap.index_map.size_local :] = False  # each node once, on the rank that owns it
total, count = domain.mesh.comm.allreduce(np.array([u.x.array[2::3][top].sum(), top.sum()]))
bR = (3 * (1 - NU**2)) ** 0.25 * np.sqrt(BAG_RADIUS / SKIN)
expected_rise = BAG_PRESSURE * BAG_RADIUS**2 * (1 - NU) / (2 * E * SKIN) * (1 + (1 + NU) / bR)
command.say(f"bag: rises by {1e3 * total / count:.4f} mm, expected {1e3 * expected_rise:.4f} mm")

# %% [markdown]
# ![The bag under pressure](bag.png)

# %%
misses = wider / expected_wider - 1, total / count / expected_rise - 1
command.check(max(map(abs, misses)) <= 0.01, "sleeve and bag to 1 %", args.out)
