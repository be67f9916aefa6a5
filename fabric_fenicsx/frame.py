"""Warp and weft axes of the reference sheet, as UFL vectors (5.2, 6.2)."""

from collections.abc import Sequence

import basix.ufl
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
        values = np.zeros(0)
        if isinstance(warp, fem.Function):
            values = warp.x.array
        elif isinstance(warp, fem.Constant):
            values = warp.value
        if domain.comm.allreduce(not np.isfinite(values).all()):
            raise InputError("The warp angle is not a finite number in every cell.")
    else:
        if not np.isfinite(warp):
            raise InputError(f"The warp angle must be a finite number of radians, not {warp!r}.")
        angle = fem.Constant(domain, float(warp))
    cos, sin = ufl.cos(angle), ufl.sin(angle)
    return ufl.as_vector([cos, sin]), ufl.as_vector([-sin, cos])


def surface_axes(domain: mesh.Mesh, warp: Sequence[float] | Expr, degree: int) -> tuple[fem.Function, fem.Function]:
    """Unit vectors along warp and weft in a surface in space, at the points of a quadrature rule.

    warp: a direction in space, three numbers or a UFL vector; its projection into the surface is the
    warp, and the weft lies a quarter turn to the left of it, seen against the normal. degree: of the
    only rule on which the axes may be used. Raises InputError, on every rank, where the direction
    is along the normal, naming a cell.
    """
    w = warp if isinstance(warp, Expr) else ufl.as_vector([float(c) for c in warp])
    n = ufl.CellNormal(domain)
    a = w - ufl.dot(w, n) * n
    element = basix.ufl.quadrature_element(domain.basix_cell(), degree=degree, value_shape=(3,))
    space = fem.functionspace(domain, element)
    points = space.element.interpolation_points
    cells = domain.topology.index_map(2)
    everywhere = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    length = fem.Expression(ufl.sqrt(ufl.dot(a, a) / ufl.dot(w, w)), points).eval(domain, everywhere).min(axis=1)
    bad = np.flatnonzero(~(length > 1e-6))
    numbers = domain.comm.allgather(None if not bad.size else int(domain.topology.original_cell_index[bad[0]]))
    first = next((number for number in numbers if number is not None), None)
    if first is not None:
        raise InputError(
            f"At cell {first} the warp direction is along the normal, and has no part in the surface."
        )
    a = a / ufl.sqrt(ufl.dot(a, a))
    axes = fem.Function(space, name="warp"), fem.Function(space, name="weft")
    for axis, expression in zip(axes, (a, ufl.cross(n, a)), strict=True):
        axis.x.array[:] = fem.Expression(expression, points).eval(domain, everywhere).ravel()
    return axes
