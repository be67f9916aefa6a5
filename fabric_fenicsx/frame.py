"""Warp and weft axes of the reference sheet, as UFL vectors (5.2, 6.2)."""

import numpy as np
import ufl
from dolfinx import fem, mesh
from ufl.core.expr import Expr

from .errors import InputError


def plane_axes(domain: mesh.Mesh, warp: float | Expr) -> tuple[Expr, Expr]:
    """Unit vectors along warp and weft in a plane mesh (gdim 2).

    `warp` is the angle of the warp against the x axis in radians: a number, or a UFL scalar that
    varies in space, such as a Function of one value per cell. The weft is a quarter turn to the left.
    Raises InputError for an angle that is not finite.
    """
    if isinstance(warp, Expr):
        angle = warp
        bad = isinstance(warp, fem.Function) and not np.isfinite(warp.x.array).all()
        bad = bool(domain.comm.allreduce(bad))
        if bad:
            raise InputError("The warp angle is not a finite number in every cell.")
    else:
        if not np.isfinite(warp):
            raise InputError(f"The warp angle must be a finite number of radians, not {warp!r}.")
        angle = fem.Constant(domain, float(warp))
    cos, sin = ufl.cos(angle), ufl.sin(angle)
    return ufl.as_vector([cos, sin]), ufl.as_vector([-sin, cos])
