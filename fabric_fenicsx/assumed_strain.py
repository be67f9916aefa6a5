"""Strains that do not lock: what is subtracted from the strain of the displacement at the points.

Membrane strain on triangles: the strain of a quadratic displacement is quadratic, and a thin shell cannot
bend without stretching in it. Instead the linear field is taken that has the same tangential
strain at two Gauss points of each edge and the same mean (Regge interpolation: Neunteufel and Schoeberl,
2021, doi 10.1016/j.cma.2020.113524). In covariant components on the reference triangle, with x(xi) the
placement, E_ab = (x_,a . x_,b - X_,a . X_,b) / 2, and its quadratic part holds only products of the
second derivatives x_,ab, which are constant in a cell. So E less its interpolation is a sum of those
six products, each times a fixed polynomial in xi: plain UFL, no tying point to visit.
"""

from collections.abc import Sequence

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, mesh
from ufl.core.expr import Expr

from . import frame, kinematics
from .directors import DEGREE, ShellSpace

_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Products of the second derivatives x_,11, x_,22, x_,12."""


def _monomials(x: float, y: float) -> np.ndarray:
    return np.array([1.0, x, y, x * x, x * y, y * y])


def regge_remainder() -> np.ndarray:
    """Quadratic strain less its Regge interpolation, as polynomials: shape (3 components, 6 products, 6 monomials).

    Components 11, 22, 12, covariant; products as `_PAIRS`; monomials 1, x, y, x^2, xy, y^2.
    """
    corner, gauss = np.array([[0, 0], [1, 0], [0, 1]], float), 0.5 / np.sqrt(3.0)
    inside = np.array([[1, 1], [4, 1], [1, 4]]) / 6.0

    def conditions(field: np.ndarray) -> np.ndarray:
        """Nine numbers that a strain field (3 components, 6 monomials) shares with its interpolation."""
        numbers = []
        for i, j in ((1, 2), (0, 2), (0, 1)):
            t = corner[j] - corner[i]
            for s in (0.5 - gauss, 0.5 + gauss):
                E = field @ _monomials(*(corner[i] + s * t))
                numbers.append(t[0] ** 2 * E[0] + t[1] ** 2 * E[1] + 2 * t[0] * t[1] * E[2])
        return np.array([*numbers, *np.mean([field @ _monomials(*p) for p in inside], axis=0)])

    # (x_,11 x + x_,12 y)^2 / 2 and so on: the quadratic part of E_11, E_22, E_12
    quadratic = np.zeros((6, 3, 6))
    quadratic[0, 0, 3] = quadratic[1, 1, 5] = quadratic[2, 0, 5] = quadratic[2, 1, 3] = 0.5
    quadratic[2, 2, 4] = quadratic[3, 2, 4] = quadratic[4, 2, 3] = quadratic[5, 2, 5] = 0.5
    quadratic[4, 0, 4] = quadratic[5, 1, 4] = 1.0
    linear = [np.eye(3)[:, [c]] * np.eye(6)[k] for c in range(3) for k in range(3)]
    basis = np.array([conditions(field) for field in linear]).T
    for field in quadratic:
        field[:, :3] -= np.linalg.solve(basis, conditions(field)).reshape(3, 3)
    return quadratic.transpose(1, 0, 2)


def membrane_remainder(domain: mesh.Mesh, u: Expr, axes: tuple[Expr, Expr]) -> Expr:
    """What to subtract from the membrane strain (E11, E22, 2 E12) of a quadratic u on triangles.

    axes: warp and weft, UFL unit vectors in the surface. To be used on the rule of `directors.DEGREE` only.
    """
    J, K = ufl.Jacobian(domain), ufl.JacobianInverse(domain)

    def second(f: Expr, i: int, j: int) -> Expr:
        return ufl.dot(ufl.grad(ufl.dot(ufl.grad(f), J[:, i])), J[:, j])

    def products(p: list[Expr]) -> list[Expr]:
        return [ufl.dot(p[i], p[j]) for i, j in _PAIRS]

    moved = [second(u, 0, 0), second(u, 1, 1), second(u, 0, 1)]
    if domain.geometry.cmaps[0].degree == 1:
        change = products(moved)
    else:
        start = [ufl.dot(ufl.grad(J[:, i]), J[:, j]) for i, j in ((0, 0), (1, 1), (0, 1))]
        change = [
            after - before
            for after, before in zip(
                products([s + m for s, m in zip(start, moved, strict=True)]), products(start), strict=True
            )
        ]

    element = basix.ufl.quadrature_element(domain.basix_cell(), degree=DEGREE, value_shape=(2,))
    xi = fem.Function(fem.functionspace(domain, element), name="xi")
    points = xi.function_space.element.interpolation_points
    xi.x.array[:] = np.tile(points.ravel(), len(xi.x.array) // points.size)
    monomial = [1.0, xi[0], xi[1], xi[0] * xi[0], xi[0] * xi[1], xi[1] * xi[1]]

    def polynomial(coefficients: np.ndarray) -> Expr:
        return sum((float(c) * m for c, m in zip(coefficients, monomial, strict=True) if abs(c) > 1e-12), ufl.as_ufl(0))

    r11, r22, r12 = (
        sum((polynomial(row) * q for row, q in zip(component, change, strict=True) if np.abs(row).max() > 1e-12))
        for component in regge_remainder()
    )
    (a1, a2), (b1, b2) = ((ufl.dot(K[0, :], axis), ufl.dot(K[1, :], axis)) for axis in axes)
    return ufl.as_vector(
        [
            r11 * a1 * a1 + r22 * a2 * a2 + 2 * r12 * a1 * a2,
            r11 * b1 * b1 + r22 * b2 * b2 + 2 * r12 * b1 * b2,
            2 * (r11 * a1 * b1 + r22 * a2 * b2 + r12 * (a1 * b2 + a2 * b1)),
        ]
    )


def quadrilateral_strains(space: ShellSpace, u: Expr, d: Expr, axes: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    """As `shell_strains`, assumed strains of a bilinear u and d on quadrilaterals with straight edges.

    Membrane strain from its tangential components at the middles of the edges and E_12 in the middle;
    shear from its tangential components at the middles of the edges. To be used on the rule of
    `directors.DEGREE` only.
    """
    domain, n = space.mesh, space.normal
    J, K = ufl.Jacobian(domain), ufl.JacobianInverse(domain)
    r, s = _reference_points(domain) - ufl.as_vector([0.5, 0.5])
    C, alpha, beta = _warping(domain)

    def atoms(f: Expr) -> tuple[Expr, Expr, Expr]:
        """f,1 and f,2 at the point, and f,12."""
        gradient = ufl.grad(f)
        mixed = ufl.dot(ufl.dot(ufl.grad(gradient), J[:, 1]), J[:, 0]) + ufl.dot(gradient, C)
        return ufl.dot(gradient, J[:, 0]), ufl.dot(gradient, J[:, 1]), mixed

    def strains(x1: Expr, x2: Expr, c: Expr, d: Expr, derivatives: tuple[Expr, Expr, Expr]) -> list[Expr]:
        """E11, E22, 2 E12, K11, K22, 2 K12, 2 E13, 2 E23, covariant, but for a constant."""
        d1, d2, d12 = derivatives
        a, b = x1 - s * c, x2 - r * c
        e = c - alpha * a - beta * b
        ce = ufl.dot(c, e)
        return [
            (ufl.dot(x1, x1) - (s * s - 0.25) * ce) / 2,
            (ufl.dot(x2, x2) - (r * r - 0.25) * ce) / 2,
            ufl.dot(x1, x2)
            - (r * (ufl.dot(a, e) - alpha * ce / 4) + s * (ufl.dot(b, e) - beta * ce / 4) if REDUCED else 0)
            - r * s * ce,
            ufl.dot(x1, d1),
            ufl.dot(x2, d2),
            ufl.dot(x1, d2) + ufl.dot(x2, d1),
            ufl.dot(x1, d - r * d1) - (s * s - 0.25) * ufl.dot(c, d2 - r * d12),
            ufl.dot(x2, d - s * d2) - (r * r - 0.25) * ufl.dot(c, d1 - s * d12),
        ]

    X1, X2 = J[:, 0], J[:, 1]
    u1, u2, u12 = atoms(u)
    moved = strains(X1 + u1, X2 + u2, C + u12, d, atoms(d))
    start = strains(X1, X2, C, n, atoms(n))
    E11, E22, E12, K11, K22, K12, G1, G2 = (a - b for a, b in zip(moved, start, strict=True))
    p, q = ((ufl.dot(K[0, :], axis), ufl.dot(K[1, :], axis)) for axis in axes)

    def along(e11: Expr, e22: Expr, e12: Expr) -> list[Expr]:
        return [
            e11 * p[0] * p[0] + e22 * p[1] * p[1] + e12 * p[0] * p[1],
            e11 * q[0] * q[0] + e22 * q[1] * q[1] + e12 * q[0] * q[1],
            2 * e11 * p[0] * q[0] + 2 * e22 * p[1] * q[1] + e12 * (p[0] * q[1] + p[1] * q[0]),
        ]

    shear = ufl.as_vector([G1 * p[0] + G2 * p[1], G1 * q[0] + G2 * q[1]])
    return ufl.as_vector([*along(E11, E22, E12), *along(K11, K22, K12)]), shear


REDUCED = True


def _reference_points(domain: mesh.Mesh) -> fem.Function:
    element = basix.ufl.quadrature_element(domain.basix_cell(), degree=DEGREE, value_shape=(2,))
    xi = fem.Function(fem.functionspace(domain, element), name="xi")
    points = xi.function_space.element.interpolation_points
    xi.x.array[:] = np.tile(points.ravel(), len(xi.x.array) // points.size)
    return xi


def _warping(domain: mesh.Mesh) -> tuple[Expr, Expr, Expr]:
    """X,12 of each bilinear cell, and its contravariant components at the middle."""
    X = domain.geometry.x[domain.geometry.dofmaps[0]]
    A, B = ((X[:, 3] - X[:, 0] + sign * (X[:, 1] - X[:, 2])) / 2 for sign in (1, -1))
    C = X[:, 0] - X[:, 1] - X[:, 2] + X[:, 3]
    frame = np.stack([A, B], axis=2)
    parts = np.linalg.pinv(frame) @ C[:, :, None]
    data = fem.Function(fem.functionspace(domain, ("DG", 0, (5,))), name="warping")
    data.x.array[:] = np.concatenate([C, parts[:, :, 0]], axis=1).ravel()
    return ufl.as_vector([data[0], data[1], data[2]]), data[3], data[4]


def shell_strains(space: ShellSpace, q: fem.Function, warp: Sequence[float] | Expr) -> tuple[Expr, Expr]:
    """The strains of (u, d) = q as the element of `space` assumes them, in warp/weft axes.

    First strain and curvature (E11, E22, 2 E12, K11, K22, 2 K12), the operand of a `laws.section`, to be
    integrated with `space.dx`; then the transverse shear (2 E13, 2 E23), with `space.dx_shear`.
    warp: see `frame.surface_axes`.
    """
    u, d = ufl.split(q)
    axes = frame.surface_axes(space.mesh, warp, DEGREE)
    if space.element == "mitc4":
        return quadrilateral_strains(space, u, d, axes)
    membrane = kinematics.membrane_strain(u, axes)
    if space.element == "regge":
        membrane -= membrane_remainder(space.mesh, u, axes)
    bending = kinematics.bending_strain(u, d, space.normal, axes)
    if space.shear_degree != DEGREE:
        axes = frame.surface_axes(space.mesh, warp, space.shear_degree)
    return ufl.as_vector([*membrane, *bending]), kinematics.shear_strain(u, d, space.normal, axes)
