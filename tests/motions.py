"""Small sheets in motion that several test files share."""

from pathlib import Path

import numpy as np
from dolfinx import fem

from fabric_fenicsx import sheet
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers import energy, motion, newmark
from fabric_fenicsx.surfaces import meshing

SQUARE = Path(__file__).parent.parent / "meshes" / "square.geo"
SIDE, THICKNESS, AREAL_MASS = 0.3, 0.02, 8.0
SOFT = StVenantKirchhoff.isotropic(3e4, 0.3)
"""A foam whose waves a step of 2 ms still resolves on cells of 0.15 m."""


def cloth(comm, law=SOFT, kinematics="shell", cells=2):
    """A square sheet that lies in the plane z = 0."""
    domain = meshing.read(SQUARE, comm, side=SIDE, n=cells)
    return sheet.Sheet(domain, law, THICKNESS, (300.0, 300.0), kinematics=kinematics, layers=2)


def spin(field, omega, centre=(0, 0, 0), drift=(0, 0, 0)):
    """Set a velocity to that of a rigid body that is in its place at rest: omega about a centre, and a drift."""

    def turn(x):
        return np.cross(omega, x.T).T

    parts = [field] if field.function_space.num_sub_spaces != 2 else [field.sub(0), field.sub(1)]
    parts[0].interpolate(lambda x: turn(x - np.array(centre)[:, None]) + np.array(drift, dtype=float)[:, None])
    for part in parts[1:]:
        part.interpolate(lambda x: turn(np.array([0, 0, 1.0])[:, None] + 0 * x))
    field.x.scatter_forward()


def moving(cloth, bcs=(), gravity=(0, 0, 0), extra=0.0, ledger=False, rtol=1e-11, **options):
    """A `newmark.Newmark` of a sheet that has a weight; options are those of `Motion` and `Newmark`.

    extra: more terms of the residual, a function of the motion.
    """
    g = fem.Constant(cloth.domain.mesh, np.array(gravity, dtype=float))
    weight = cloth.weight(AREAL_MASS, g)
    rule = {name: options.pop(name) for name in ("rho", "newmark", "damping", "lumped") if name in options}
    moved = motion.Motion(cloth.q, cloth.mass(AREAL_MASS), cloth.shell, **rule)
    more = [extra(moved)] if extra else []
    run = newmark.Newmark(moved, [*cloth.terms, -weight, *more], list(bcs), rtol=rtol, **options)
    if ledger:
        energy.Ledger(run)
    return run


def nodes(function):
    """Owned values of each displacement's component (n, 3) and their places, over all ranks, in an order of places."""
    part = function
    if function.function_space.num_sub_spaces == 2:
        part = function.sub(0).collapse()
    V = part.function_space
    n = V.dofmap.index_map.size_local
    x, value = V.tabulate_dof_coordinates()[:n], part.x.array.reshape(-1, 3)[:n]
    x, value = (np.concatenate(V.mesh.comm.allgather(a)) for a in (x, value))
    order = np.lexsort(np.round(x, 9).T)
    return value[order], x[order]


def order(errors):
    """Observed orders of convergence where every next error is of half the step."""
    return np.log2(np.array(errors[:-1]) / errors[1:])
