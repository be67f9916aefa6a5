"""Strains that do not lock: what an element assumes instead of the strain of its displacement.

All is written in covariant components on the reference cell. With x(xi) the placement and d the
director, E_ab = (x_,a . x_,b - X_,a . X_,b) / 2, K_ab = x_,a . d_,b - X_,a . N_,b (symmetric part) and
2 E_a3 = x_,a . d - X_,a . N. An assumed strain samples these at tying points and interpolates; but x and
d are polynomials in a cell, so what it takes away is a polynomial too: plain UFL, no tying point to visit.

Membrane strain on triangles ("regge"): the strain of a quadratic displacement is quadratic, and a thin shell
cannot bend without stretching in it. Instead the linear field is taken that has the same tangential
strain at two Gauss points of each edge and the same mean (Regge interpolation: Neunteufel and Schoeberl,
2021, doi 10.1016/j.cma.2020.113524). The quadratic part of E holds only products of the second
derivatives x_,ab, which are constant in a cell: E less its interpolation is a sum of those six products,
each times a number that depends on cell and point alone.

Quadrilaterals ("mitc4"), bilinear x = x0 + a r + b s + c r s, with r and s from -1/2 to 1/2. Transverse shear
is tied at the middles of the edges (Dvorkin and Bathe 1984, doi 10.1108/eb023562). So is the membrane
strain, E_11 on the edges along r and E_22 on those along s, and E_12 in the middle: five numbers (the
tying of MITC4+: Ko, Lee and Bathe 2017, doi 10.1016/j.compstruc.2016.11.004). The sixth that x could
give is c . c, and it is this that locks: a cell that warps stretches by it. With C = alpha A + beta B + (what is
out of the plane of A and B) and e = c - alpha a - beta b, it follows from the five in a flat cell,
linearised, and the strain that depends on them alone is E_11, E_22, 2 E_12 less

    t (s^2 - 1/4) / 2,    t (r^2 - 1/4) / 2,    t r s,    t = (e.e - E.E) / (1 - (alpha^2 + beta^2) / 4).

As e vanishes in a homogeneous deformation, so may r (a.e - alpha t/4) + s (b.e - beta t/4), another sum of the
five, be taken from 2 E_12: the shear of a cell that bends in its plane. It is taken in the frame of the
middle of the cell and by its area there, so that its mean is zero and the patch test is passed (as
Taylor, Beresford and Wilson 1976, doi 10.1002/nme.1620100602).
"""

from collections.abc import Sequence

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, mesh
from ufl.core.expr import Expr

from ..laws import Array
from ..surfaces import placing, yarns
from . import kinematics
from .directors import DEGREE, ShellSpace

_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Products of the second derivatives x_,11, x_,22, x_,12."""


def shell_strains(
    space: ShellSpace, q: fem.Function, warp: Sequence[float] | Expr, variation: Expr | float = 1.0
) -> tuple[Expr, Expr]:
    """The strains of (u, d) = q as the element of `space` assumes them, in warp/weft axes.

    First strain and curvature (E11, E22, 2 E12, K11, K22, 2 K12), the operand of a `laws.section`, to be
    integrated with `space.dx`; then the transverse shear (2 E13, 2 E23), with `space.dx_shear`.
    warp: see `yarns.surface_axes`. variation: of "regge", a factor of the shear's part that varies in a cell.
    """
    u, d = ufl.split(q)
    w, axes = placing.from_rest(u), yarns.surface_axes(space.mesh, warp, DEGREE)
    if space.element == "mitc4":
        return _quadrilateral_strains(space, w, d, axes)
    membrane = kinematics.membrane_strain(u, axes)
    if space.element == "regge":
        membrane -= _regge_remainder(space.mesh, w, axes)
    strain = ufl.as_vector([*membrane, *kinematics.bending_strain(u, d, space.normal, axes)])
    if space.shear_degree != DEGREE:
        axes = yarns.surface_axes(space.mesh, warp, space.shear_degree)
    shear = kinematics.shear_strain(u, d, space.normal, axes)
    if space.element == "regge" and variation != 1.0:
        middle = _middle_shear(space, w, d, axes)
        shear = middle + variation * (shear - middle)
    return strain, shear


# -- triangles -------------------------------------------------------------------------------------------------


def _monomials(x: float, y: float) -> Array:
    return np.array([1.0, x, y, x * x, x * y, y * y])


def regge_remainder(points: Array) -> Array:
    """Quadratic strain less its Regge interpolation, at points (n, 2) of the reference triangle: (n, 3, 6).

    Covariant components (E_11, E_22, 2 E_12); six products as in `_PAIRS`.
    """
    corner, gauss = np.array([[0, 0], [1, 0], [0, 1]], float), 0.5 / np.sqrt(3.0)
    inside = np.array([[1, 1], [4, 1], [1, 4]]) / 6.0

    def conditions(field: Array) -> Array:
        """Nine numbers that a strain field (3 components, 6 monomials) shares with its interpolation."""
        numbers = []
        for i, j in ((1, 2), (0, 2), (0, 1)):
            t = corner[j] - corner[i]
            for s in (0.5 - gauss, 0.5 + gauss):
                E = field @ _monomials(*(corner[i] + s * t))
                numbers.append(t[0] ** 2 * E[0] + t[1] ** 2 * E[1] + t[0] * t[1] * E[2])
        return np.array([*numbers, *np.mean([field @ _monomials(*p) for p in inside], axis=0)])

    # (x_,11 x + x_,12 y)^2 / 2 and so on: the quadratic part of E_11, E_22, 2 E_12
    quadratic = np.zeros((6, 3, 6))
    quadratic[0, 0, 3] = quadratic[1, 1, 5] = quadratic[2, 0, 5] = quadratic[2, 1, 3] = 0.5
    quadratic[2, 2, 4] = quadratic[3, 2, 4] = quadratic[4, 2, 3] = quadratic[5, 2, 5] = 1.0
    quadratic[4, 0, 4] = quadratic[5, 1, 4] = 1.0
    linear = [np.eye(3)[:, [c]] * np.eye(6)[k] for c in range(3) for k in range(3)]
    basis = np.array([conditions(field) for field in linear]).T
    for field in quadratic:
        field[:, :3] -= np.linalg.solve(basis, conditions(field)).reshape(3, 3)
    return np.einsum("kcm,nm->nck", quadratic, np.array([_monomials(*p) for p in points]))


def _second(domain: mesh.Mesh, u: Expr) -> tuple[list[Expr], list[Expr]]:
    """Second derivatives by the reference coordinates, 11, 22 and 12, of X + u and of X on triangles."""
    J, gradient = ufl.Jacobian(domain), ufl.grad(u)
    pairs = ((0, 0), (1, 1), (0, 1))
    moved = [ufl.dot(ufl.dot(ufl.grad(gradient), J[:, j]), J[:, i]) for i, j in pairs]
    if domain.geometry.cmaps[0].degree == 1:
        return moved, [ufl.as_vector([0.0, 0.0, 0.0])] * 3
    start = [ufl.dot(ufl.grad(J[:, i]), J[:, j]) for i, j in pairs]
    return [X + m + ufl.dot(gradient, X) for X, m in zip(start, moved, strict=True)], start


def _middle_shear(space: ShellSpace, u: Expr, d: Expr, axes: tuple[fem.Function, fem.Function]) -> Expr:
    """Transverse shear (2 E13, 2 E23) in the axes, of the covariant components in the middle of each triangle."""
    domain, J = space.mesh, ufl.Jacobian(space.mesh)
    along, points = _components(domain, axes)
    away = _on_points(domain, np.tile(points - 1 / 3, (len(along), 1)), (2,))
    moved, start = _second(domain, u)

    def in_the_middle(x: list[Expr], second: list[Expr], d: Expr) -> Expr:
        (x11, x22, x12), gradient = second, ufl.grad(d)
        middle = d - sum(away[i] * ufl.dot(gradient, J[:, i]) for i in (0, 1))
        x1, x2 = x[0] - away[0] * x11 - away[1] * x12, x[1] - away[0] * x12 - away[1] * x22
        return ufl.as_vector([ufl.dot(x1, middle), ufl.dot(x2, middle)])

    now = in_the_middle([J[:, i] + ufl.dot(ufl.grad(u), J[:, i]) for i in (0, 1)], moved, d)
    rest = in_the_middle([J[:, i] for i in (0, 1)], start, space.normal)
    return ufl.dot(_on_points(domain, along, (2, 2)), now - rest)


def _regge_remainder(domain: mesh.Mesh, u: Expr, axes: tuple[fem.Function, fem.Function]) -> Expr:
    """What to subtract from the membrane strain (E11, E22, 2 E12) of a quadratic u on triangles."""
    second, start = _second(domain, u)
    change = [ufl.dot(second[i], second[j]) - ufl.dot(start[i], start[j]) for i, j in _PAIRS]
    along, points = _components(domain, axes)
    factors = np.einsum("npac,pck->npak", _to_axes(along), regge_remainder(points))
    factor = _on_points(domain, factors, (3, 6))
    return ufl.as_vector([sum(factor[a, k] * change[k] for k in range(6)) for a in range(3)])


# -- quadrilaterals --------------------------------------------------------------------------------------------


def _quadrilateral_strains(
    space: ShellSpace, u: Expr, d: Expr, axes: tuple[fem.Function, fem.Function]
) -> tuple[Expr, Expr]:
    """As `shell_strains`, for a bilinear u and d on cells with straight edges."""
    domain, J = space.mesh, ufl.Jacobian(space.mesh)
    along, points = _components(domain, axes)
    r, s = _on_points(domain, np.tile(points - 0.5, (len(along), 1)), (2,))
    C, (alpha, beta), inverse, bent = _warping(domain, axes, points)

    def derivatives(f: Expr) -> tuple[Expr, Expr, Expr]:
        """f_,1 and f_,2 at the point, and f_,12."""
        gradient = ufl.grad(f)
        mixed = ufl.dot(ufl.dot(ufl.grad(gradient), J[:, 1]), J[:, 0]) + ufl.dot(gradient, C)
        return ufl.dot(gradient, J[:, 0]), ufl.dot(gradient, J[:, 1]), mixed

    def products(x1: Expr, x2: Expr, c: Expr, d: Expr) -> list[Expr]:
        """E_11, E_22, 2 E_12, K_11, K_22, 2 K_12, 2 E_13, 2 E_23 and bending in the plane, reference not taken off."""
        d1, d2, d12 = derivatives(d)
        a, b = x1 - s * c, x2 - r * c
        e = c - alpha * a - beta * b
        t = inverse * ufl.dot(e, e)
        return [
            (ufl.dot(x1, x1) - (s * s - 0.25) * t) / 2,
            (ufl.dot(x2, x2) - (r * r - 0.25) * t) / 2,
            ufl.dot(x1, x2) - r * s * t,
            ufl.dot(x1, d1),
            ufl.dot(x2, d2),
            ufl.dot(x1, d2) + ufl.dot(x2, d1),
            # those at the middles of the edges, linear between
            ufl.dot(x1, d - r * d1) - (s * s - 0.25) * ufl.dot(c, d2 - r * d12),
            ufl.dot(x2, d - s * d2) - (r * r - 0.25) * ufl.dot(c, d1 - s * d12),
            ufl.dot(r * a + s * b, e) - (alpha * r + beta * s) * t / 4,
        ]

    u1, u2, u12 = derivatives(u)
    moved = products(J[:, 0] + u1, J[:, 1] + u2, C + u12, d)
    start = products(J[:, 0], J[:, 1], C, space.normal)
    change = [after - before for after, before in zip(moved, start, strict=True)]
    T, p = _on_points(domain, _to_axes(along), (3, 3)), _on_points(domain, along, (2, 2))
    membrane = ufl.dot(T, ufl.as_vector(change[:3])) - change[8] * bent
    bending = ufl.dot(T, ufl.as_vector(change[3:6]))
    return ufl.as_vector([*membrane, *bending]), ufl.dot(p, ufl.as_vector(change[6:8]))


def _warping(
    domain: mesh.Mesh, axes: tuple[fem.Function, fem.Function], points: Array
) -> tuple[Expr, tuple[Expr, Expr], Expr, Expr]:
    """C = X_,12 of each bilinear cell, (alpha, beta), 1 / (1 - (alpha^2 + beta^2) / 4), and a 2 E_12 in the axes.

    The last one is that in the frame of the middle, and by the area there.
    """
    X = domain.geometry.x[domain.geometry.dofmaps[0]]
    A, B = ((X[:, 3] - X[:, 0] + sign * (X[:, 1] - X[:, 2])) / 2 for sign in (1, -1))
    C = X[:, 0] - X[:, 1] - X[:, 2] + X[:, 3]
    K = np.linalg.pinv(np.stack([A, B], axis=2))
    skew = np.einsum("nij,nj->ni", K, C)
    inverse = 1 / (1 - (skew**2).sum(axis=1, keepdims=True) / 4)
    cell = fem.Function(fem.functionspace(domain, ("DG", 0, (6,))), name="warping")
    cell.x.array[:] = np.concatenate([C, skew, inverse], axis=1).ravel()
    r, s = (points.T - 0.5)[:, None, :, None]
    there = np.cross(A[:, None] + s * C[:, None], B[:, None] + r * C[:, None])
    area = np.linalg.norm(np.cross(A, B), axis=1)[:, None] / np.linalg.norm(there, axis=2)
    in_space = np.stack([axis.x.array.reshape(*area.shape, 3) for axis in axes], axis=2)
    along = np.einsum("nij,npaj->npai", K, in_space)
    bent = _on_points(domain, _to_axes(along)[..., 2] * area[..., None], (3,))
    return ufl.as_vector([cell[0], cell[1], cell[2]]), (cell[3], cell[4]), cell[5], bent


# -- at the points of the rule of degree `DEGREE` ------------------------------------------------------------------


def _on_points(domain: mesh.Mesh, values: Array, shape: tuple[int, ...]) -> fem.Function:
    """Numbers at every point of every local cell, as a coefficient."""
    element = basix.ufl.quadrature_element(domain.basix_cell(), degree=DEGREE, value_shape=shape)
    result = fem.Function(fem.functionspace(domain, element))
    result.x.array[:] = values.ravel()
    return result


def _components(domain: mesh.Mesh, axes: tuple[fem.Function, fem.Function]) -> tuple[Array, Array]:
    """Contravariant components of the axes, (cells, points, 2 axes, 2), and the points (points, 2)."""
    K, points = ufl.JacobianInverse(domain), axes[0].function_space.element.interpolation_points
    expression = fem.Expression(ufl.as_matrix([[ufl.dot(K[i, :], a) for i in (0, 1)] for a in axes]), points)
    cells = domain.topology.index_map(2)
    everywhere = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    return expression.eval(domain, everywhere).reshape(-1, len(points), 2, 2), points


def _to_axes(along: Array) -> Array:
    """Matrices from covariant (E_11, E_22, 2 E_12) to (E11, E22, 2 E12) in axes of these components."""
    (a1, a2), (b1, b2) = np.moveaxis(along, (2, 3), (0, 1))
    rows = [[a1 * a1, a2 * a2, a1 * a2], [b1 * b1, b2 * b2, b1 * b2], [2 * a1 * b1, 2 * a2 * b2, a1 * b2 + a2 * b1]]
    return np.moveaxis(np.array(rows), (0, 1), (2, 3))
