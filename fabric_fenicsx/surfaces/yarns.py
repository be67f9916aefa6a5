"""Warp and weft axes of the reference sheet, as UFL vectors (5.2, 6.2)."""

from collections.abc import Mapping, Sequence

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, mesh
from ufl.core.expr import Expr

from ..errors import InputError
from . import placing
from .meshing import Domain, name_cell

ALONG = 1e-6
"""Sine of the angle to the normal below which a direction has no part in the surface."""


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


def surface_axes(
    domain: mesh.Mesh | Domain, warp: Sequence[float] | Expr | Mapping[str, Sequence[float]], degree: int
) -> tuple[fem.Function, fem.Function]:
    """Unit vectors along warp and weft in a surface in space, at the points of a quadrature rule.

    warp: a direction in space, three numbers or a UFL vector such as a Function, or one for each group of cells
    of a Domain (`patches`); its projection into the surface is the warp, and the weft lies a quarter turn to
    the left of it, seen against the normal. degree: of the only rule on which the axes may be used.

    Raises InputError, on every rank, where the direction is along the normal, zero or not finite,
    naming a cell.
    """
    m = domain.mesh if isinstance(domain, Domain) else domain
    if isinstance(warp, Mapping):
        if not isinstance(domain, Domain):
            raise InputError("Patches are groups of cells: give the Domain that was read, not its mesh.")
        w = patches(domain, warp)
    else:
        w = warp if isinstance(warp, Expr) else fem.Constant(m, _direction(warp))
    element = basix.ufl.quadrature_element(m.basix_cell(), degree=degree, value_shape=(3,))
    space = fem.functionspace(m, element)
    cells = m.topology.index_map(2)
    everywhere = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    both = fem.Expression(ufl.as_vector([*ufl.CellNormal(m), *w]), space.element.interpolation_points)
    at_points = both.eval(m, everywhere).reshape(len(everywhere), len(space.element.interpolation_points), 6)
    n, w = at_points[..., :3], at_points[..., 3:]
    with np.errstate(invalid="ignore"):
        a = w - (w * n).sum(axis=-1, keepdims=True) * n
    length = np.linalg.norm(a, axis=-1, keepdims=True)
    bad = ~(length > ALONG * np.linalg.norm(w, axis=-1, keepdims=True)) | ~np.isfinite(length)
    where = name_cell(m, np.flatnonzero(bad.any(axis=(1, 2))))
    if where is not None:
        raise InputError(
            f"In {where} the warp direction is along the normal, zero or not finite, and has no part in the surface: "
            "give another one there."
        )
    a /= length
    axes = fem.Function(space, name="warp"), fem.Function(space, name="weft")
    for axis, values in zip(axes, (a, np.cross(n, a)), strict=True):
        axis.x.array.reshape(-1, 3)[space.dofmap.list] = values
    return axes


class Yarns:
    """Warp and weft of each local cell as they are now: unit vectors, moved and stretched with the sheet.

    u: displacement (m), in the plane or in space; axes: `plane_axes`, or `surface_axes` of degree 1.
    """

    def __init__(self, domain: mesh.Mesh, u: Expr, axes: tuple[Expr, Expr]) -> None:
        w = placing.from_rest(u)
        rows = ufl.as_vector([c for a in axes for c in a + ufl.dot(ufl.grad(w), a)])
        points, _ = basix.make_quadrature(domain.basix_cell(), 1)
        self._mesh, self._rows = domain, fem.Expression(rows, points)

    def __call__(self) -> np.ndarray:
        """At present, shape (cells, 2, 3), ghosts included; in the plane the third component is 0."""
        cells = self._mesh.topology.index_map(2)
        everywhere = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
        rows = self._rows.eval(self._mesh, everywhere).reshape(len(everywhere), 2, self._mesh.geometry.dim)
        return np.pad(rows, ((0, 0), (0, 0), (0, 3 - rows.shape[2])))


def patches(domain: Domain, warps: Mapping[str, float | Sequence[float]]) -> fem.Function:
    """The warp of each group of cells, as a Function that is constant in each cell.

    warps: name of a group -> direction, three numbers for `surface_axes`, or angle in radians for `plane_axes`,
    as in `{"sleeve": (0, 0, 1), "body": (1, 0, 0)}`. Raises InputError, on every rank, for a name that is
    not one of a group of cells, and for a cell in none or in two of them, which is named.
    """
    values = {name: np.asarray(warp, dtype=float) for name, warp in warps.items()}
    shapes = {value.shape for value in values.values()}
    if len(shapes) != 1 or not shapes <= {(), (3,)}:
        raise InputError("The warp of every patch must be a direction of three numbers, or of every one an angle.")
    shape = shapes.pop()
    field = fem.Function(fem.functionspace(domain.mesh, ("DG", 0, shape)), name="warp")
    cells = domain.mesh.topology.index_map(2)
    missing = np.ones(cells.size_local + cells.num_ghosts, dtype=bool)
    of_cells = field.x.array.reshape(-1, *shape)
    for name, value in values.items():
        if 2 not in domain.dims(name):
            raise InputError(f"The group {name!r} is not one of cells, and cannot have a warp direction.")
        _, members = domain.entities(name, 2)
        where = name_cell(domain.mesh, members[~missing[members]])
        if where is not None:
            raise InputError(f"In {where} two warps are given: the groups {', '.join(sorted(values))} overlap there.")
        of_cells[field.function_space.dofmap.list[members, 0]] = value
        missing[members] = False
    where = name_cell(domain.mesh, np.flatnonzero(missing[: cells.size_local]))
    if where is not None:
        raise InputError(f"In {where} no warp is given: it is in none of the groups {', '.join(sorted(values))}.")
    field.x.scatter_forward()
    return field


def _direction(warp: Sequence[float]) -> np.ndarray:
    """Three numbers as an array."""
    w = np.asarray(warp, dtype=float)
    if w.shape != (3,) or not np.isfinite(w).all() or not w.any():
        raise InputError(f"The warp direction must be three numbers, finite and not all zero, and not {warp!r}.")
    return w
