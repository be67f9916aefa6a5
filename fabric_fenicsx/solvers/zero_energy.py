"""Zero-energy modes that are no rigid motions: what a step of statics that fails from the start may have met."""

from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ..surfaces import placing
from .pivots import uneven
from .redundant import own

AXES = ("x", "y", "z")


def named(solver: Any) -> str:
    """A sentence on what nothing resists in a `StaticSolver`'s sheet as it is, and a space; "" if all is resisted.

    To be called on every rank, after the supports have been found to hold the sheet, between two solves. Null pivots of
    MUMPS tell how many motions there are; what a force without symmetry moves most is one of them.
    """
    solver.residual(solver.begin())
    ksp, x, y = solver.factorised(), solver._x.duplicate(), solver._y
    A, force = ksp.getOperators()[0], uneven(y, solver._x)
    force.array_w[np.setdiff1d(np.arange(x.local_size), solver.displacements)] = 1.0
    force.array_w[solver._given] = 0.0
    try:
        ksp.setUp()
        count = own(ksp).getPC().getFactorMatrix().getMumpsInfog(28) if ksp.getType() == "preonly" else 0
        if count == 0:
            return ""
        diagonal = A.getDiagonal()
        A.setDiagonal(diagonal + 1e-12 * diagonal.norm(PETSc.NormType.NORM_INFINITY))
        ksp.setOperators(A)
        ksp.solve(force, x)
    except PETSc.Error:
        return ""
    n, owned, W = y.function_space.mesh.geometry.dim, x.local_size, y.function_space
    space, dofs = (W, np.arange(len(y.x.array))) if solver._shell is None else W.sub(0).collapse()
    dofs = np.array(dofs).reshape(-1, n)
    here = dofs[:, 0] < owned
    moved, places = np.abs(x.array_r[dofs[here]]), placing.places(space)[here, :n]
    k = int(moved.max(axis=1).argmax()) if len(moved) else -1
    mine = (float(moved[k].max()), int(moved[k].argmax()), places[k].tolist()) if k >= 0 else (0.0, 0, [])
    most, axis, place = max(solver.comm.allgather(mine))
    turned = np.abs(np.delete(x.array_r, dofs[here].ravel())).max(initial=0.0)
    what = "turns directors"
    if most > 1e-6 * solver.comm.allreduce(float(turned), MPI.MAX):
        what = f"moves it along {AXES[axis]}, most at ({', '.join(f'{c:.4g}' for c in place)}) m"
    return (
        f"At first nothing resists {count} motion{'s' * (count > 1)} that would deform the sheet: one {what}; a "
        "flat membrane has no stiffness across itself before it is pulled, nor has a joint without a spring. "
    )
