"""My own mesh: a sleeve that gmsh makes from a few lines of Python, and a bag from a file of another program.

`meshing.from_gmsh(build)` takes whatever `build` leaves in gmsh; supports and loads find its parts by the names of
the physical groups. `meshing.read` takes .geo and .msh files, and .obj, .stl, .ply, .vtk, .vtu, .inp, whose free edges
are the group "boundary". Both refuse what no shell can stand on, and say which cell and why.

The checked numbers, under a pressure p inside:
- the sleeve, warp along it, is under uniaxial stress of its weft, S22 = p R l / h, with the stretch l of the warp from
  E11 = -nu21 E22, and S22(E22) the measured curve of the weft;
- a bag of a linear elastic skin widens by w = p R^2 (1 - nu) / (2 E h), and where it is clamped at its rim, the rest of
  it rises by (1 + nu) w / (b R), b^4 = 3 (1 - nu^2) / (R h)^2, on top of that (Geckeler's edge of a thin shell).
"""

from mpi4py import MPI  # noqa: F401, isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import gmsh
import numpy as np
from dolfinx import fem
from scipy.optimize import brentq

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

BAG = meshing.MESHES / "bag.obj"
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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/my_mesh"))
    out = results.folder(command.parse(parser).out)

    domain, fabric = meshing.from_gmsh(sleeve), fabrics.load("blend")
    h, G = fabric.thickness, fabric.shear.modulus[0]
    cloth = sheet.Sheet(domain, Woven(fabric), h, shear=(G, G), warp=(0, 1, 0))
    held = supports.lead(domain, cloth.space, "cuff", 1, 0.0)
    held += supports.lead(domain, cloth.space, "front", 0, 0.0) + supports.lead(domain, cloth.space, "side", 2, 0.0)
    inflate(cloth, held, PRESSURE, 5, out / "sleeve.png", "sleeve")
    wider = supports.mean(domain, cloth.space, cloth.q, "side", 0) / RADIUS
    nu21 = fabric.poisson["measured"][1]
    E22 = brentq(lambda E: fabric.weft.stress(E) - PRESSURE * RADIUS / h * np.sqrt(1 - 2 * nu21 * E), 0, 0.2)
    command.say(f"sleeve: {100 * wider:.3f} % wider, expected {100 * (np.sqrt(1 + 2 * E22) - 1):.3f} %")
    sleeve_miss = abs(wider / (np.sqrt(1 + 2 * E22) - 1) - 1)

    domain = meshing.read(BAG)
    skin = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, NU), SKIN, shear=(E / 2, E / 2), warp=(1, 0.1, 0.2))
    u = inflate(skin, supports.clamp(domain, skin.space, "boundary"), BAG_PRESSURE, 1, out / "bag.png", "bag")
    x = u.function_space.tabulate_dof_coordinates()
    top = x[:, 2] > 0.98 * BAG_RADIUS
    top[u.function_space.dofmap.index_map.size_local :] = False  # each node once, on the rank that owns it
    total, count = domain.mesh.comm.allreduce(np.array([u.x.array[2::3][top].sum(), top.sum()]))
    bR = (3 * (1 - NU**2)) ** 0.25 * np.sqrt(BAG_RADIUS / SKIN)
    expected = BAG_PRESSURE * BAG_RADIUS**2 * (1 - NU) / (2 * E * SKIN) * (1 + (1 + NU) / bR)
    command.say(f"bag: rises by {1e3 * total / count:.4f} mm, expected {1e3 * expected:.4f} mm")
    bag_miss = abs(total / count / expected - 1)

    good = sleeve_miss <= 0.01 and bag_miss <= 0.01
    command.say(f"check: sleeve and bag to 1 %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
