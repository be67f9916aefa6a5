"""From displacement to strain, in UFL."""

import ufl
from ufl.core.expr import Expr


def plane_strain_vector(u: Expr, axes: tuple[Expr, Expr]) -> Expr:
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
