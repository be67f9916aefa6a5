"""From displacement to strain, in UFL."""

import ufl
from dolfinx import mesh
from ufl.core.expr import Expr


def membrane_strain(u: Expr, axes: tuple[Expr, Expr]) -> Expr:
    """Green-Lagrange strain (E11, E22, 2 E12) in warp/weft axes of a plane displacement, (6.3), (6.6).

    Written with the displacement gradient, E = sym(G) + G^T G / 2, which has no cancellation at
    small strain as (F^T F - I) / 2 has.
    """
    a, b = axes
    ga, gb = ufl.dot(ufl.grad(u), a), ufl.dot(ufl.grad(u), b)
    return ufl.as_vector(
        [
            ufl.dot(a, ga) + ufl.dot(ga, ga) / 2,
            ufl.dot(b, gb) + ufl.dot(gb, gb) / 2,
            ufl.dot(a, gb) + ufl.dot(b, ga) + ufl.dot(ga, gb),
        ]
    )


def bending_strain(u: Expr, d: Expr, normal: Expr, axes: tuple[Expr, Expr]) -> Expr:
    """Change of curvature (K11, K22, 2 K12), 1/m, of the mid-surface X + u with director d.

    The part of the strain of x + z d that is linear in z, (5.20) with the reference director `normal`.
    """
    (xa, xb), (da, db), (na, nb) = _moved(u, axes), _along(d, axes), _along(normal, axes)
    a, b = axes
    return ufl.as_vector(
        [
            ufl.dot(xa, da) - ufl.dot(a, na),
            ufl.dot(xb, db) - ufl.dot(b, nb),
            ufl.dot(xa, db) + ufl.dot(xb, da) - ufl.dot(a, nb) - ufl.dot(b, na),
        ]
    )


def quadratic_strain(d: Expr, normal: Expr, axes: tuple[Expr, Expr]) -> Expr:
    """The part (.11, .22, 2 .12), 1/m2, of the strain of x + z d that goes with z^2."""
    (da, db), (na, nb) = _along(d, axes), _along(normal, axes)
    return ufl.as_vector(
        [
            (ufl.dot(da, da) - ufl.dot(na, na)) / 2,
            (ufl.dot(db, db) - ufl.dot(nb, nb)) / 2,
            ufl.dot(da, db) - ufl.dot(na, nb),
        ]
    )


def shear_strain(u: Expr, d: Expr, normal: Expr, axes: tuple[Expr, Expr]) -> Expr:
    """Transverse shear (2 E13, 2 E23) of the mid-surface X + u with director d."""
    (xa, xb), (a, b) = _moved(u, axes), axes
    return ufl.as_vector([ufl.dot(xa, d) - ufl.dot(a, normal), ufl.dot(xb, d) - ufl.dot(b, normal)])


def _along(f: Expr, axes: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    """Derivatives of a field along the two axes."""
    gradient = ufl.grad(f)
    return ufl.dot(gradient, axes[0]), ufl.dot(gradient, axes[1])


def _moved(u: Expr, axes: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    """Where the two axes go: derivatives of the placement X + u."""
    ga, gb = _along(u, axes)
    return axes[0] + ga, axes[1] + gb


def area_vector(u: Expr, domain: mesh.Mesh) -> Expr:
    """Normal of the moved sheet X + u, as long as its area per reference area: n da = area_vector dA.

    x,1 x x,2 / (area of the cell), with the tangents x,a of the moved sheet: a polynomial in u. It points where
    `ufl.CellNormal` does, about which the corners of a cell run counter-clockwise.
    """
    J = ufl.Jacobian(domain)
    x1, x2 = (J[:, i] + ufl.dot(ufl.grad(u), J[:, i]) for i in (0, 1))
    return ufl.cross(x1, x2) / ufl.JacobianDeterminant(domain)
