"""From displacement to strain, in UFL (Chapter 5; sections 6.1 and 6.2).

A point of the sheet at height z over its mid-surface X goes from X + z N to x + z d, with x = X + u, the unit
director d and the reference normal N (5.22), (5.26). With the derivatives along the unit vectors a and b of warp and
weft, x_,a = a + grad(u) a, the Green-Lagrange strain of that point (6.3), in their axes (6.6), is a polynomial in z,

    E_ab + z K_ab + z^2 Q_ab,    E_ab = (x_,a . x_,b - a . b) / 2,
    2 K_ab = x_,a . d_,b + x_,b . d_,a - (the same at rest),    Q_ab = (d_,a . d_,b - N_,a . N_,b) / 2,

and 2 E_a3 = x_,a . d - a . N across it. Q is left out unless asked for: it is h/R times smaller than K. Strains do
not change when the sheet turns as a whole, however far. They are packed as (E11, E22, 2 E12), so that stress times
strain is work.
"""

import basix.ufl
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem, la, mesh
from ufl.core.expr import Expr

from ..errors import InputError
from ..laws import Array
from ..surfaces import placing
from .rotation import unit


def membrane_strain(u: Expr, axes: tuple[Expr, Expr]) -> Expr:
    """Green-Lagrange strain (E11, E22, 2 E12) in warp/weft axes of a plane displacement, (6.3), (6.6).

    Written with the displacement gradient, E = sym(G) + G^T G / 2, which has no cancellation at
    small strain as (F^T F - I) / 2 has.
    """
    a, b = axes
    ga, gb = _along(placing.from_rest(u), axes)
    return ufl.as_vector(
        [
            ufl.dot(a, ga) + ufl.dot(ga, ga) / 2,
            ufl.dot(b, gb) + ufl.dot(gb, gb) / 2,
            ufl.dot(a, gb) + ufl.dot(b, ga) + ufl.dot(ga, gb),
        ]
    )


def bending_strain(u: Expr, d: Expr, normal: Expr, axes: tuple[Expr, Expr]) -> Expr:
    """Change of curvature (K11, K22, 2 K12), 1/m, of the mid-surface X + u with director d.

    The part of the strain of x + z d that is linear in z, (5.22) in (6.3), with the reference director `normal`.
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
    ga, gb = _along(placing.from_rest(u), axes)
    return axes[0] + ga, axes[1] + gb


def area_vector(u: Expr, domain: mesh.Mesh) -> Expr:
    """Normal of the moved sheet X + u, as long as its area per reference area: n da = area_vector dA.

    x,1 x x,2 / (area of the cell), with the tangents x,a of the moved sheet: a polynomial in u. It points where
    `ufl.CellNormal` does, about which the corners of a cell run counter-clockwise.
    """
    J, w = ufl.Jacobian(domain), placing.from_rest(u)
    x1, x2 = (J[:, i] + ufl.dot(ufl.grad(w), J[:, i]) for i in (0, 1))
    return ufl.cross(x1, x2) / ufl.JacobianDeterminant(domain)


def reference(space: fem.FunctionSpace) -> tuple[fem.Function, fem.Function]:
    """Directors at rest and where they start, of a space of them: the same Function, but see `placing`."""
    if placing.leaning(space.mesh) is None:
        normal = fem.Function(space, name="normal")
        normal.x.array[:] = normals(space).ravel()
    else:
        normal = _leaning(space)
    if placing.of(space.mesh) is None:
        return normal, normal
    start = fem.Function(space, name="start")
    start.x.array[:] = normals(space, normal).ravel()
    return normal, start


def _leaning(space: fem.FunctionSpace) -> fem.Function:
    """Directors at rest that each cell has of its own, see `placing.leaning`."""
    domain, triangles = space.mesh, space.mesh.basix_cell().name == "triangle"
    family, lean = ("CR" if triangles else "Lagrange"), placing.leaning(domain)
    assert lean is not None
    own = basix.ufl.element(family, domain.basix_cell(), 1, shape=(3,), discontinuous=True)
    normal = fem.Function(fem.functionspace(domain, own), name="normal")
    if triangles:  # at the middles of edges; one that only ends at a fold does not lean
        a, b = lean[:, [1, 0, 0]], lean[:, [2, 2, 1]]
        flat = fem.Expression(ufl.CellNormal(domain), np.array([[1 / 3, 1 / 3]]))
        n = flat.eval(domain, np.arange(len(lean), dtype=np.int32)).reshape(-1, 1, 3)
        both = ((a * n).sum(axis=2) < 1 - 1e-9) & ((b * n).sum(axis=2) < 1 - 1e-9)
        lean = np.where(both[..., None], a + b, n)
        lean = lean / np.linalg.norm(lean, axis=2, keepdims=True)
    normal.x.array.reshape(-1, 3)[normal.function_space.dofmap.list] = lean
    return normal


def normals(space: fem.FunctionSpace, at_rest: fem.Function | None = None) -> Array:
    """Unit normals at the nodes (nodes, 3) of a space of vectors at rest, the mean over the cells that share one.

    at_rest: directors at rest, for those where the sheet starts, which are turned as the cells are from one to the
    other.

    Raises InputError, on every rank, for neighbouring cells of opposite orientation.
    """
    domain, points = space.mesh, space.element.interpolation_points
    rule = {"quadrature_rule": "custom", "quadrature_points": points, "quadrature_weights": np.ones(len(points))}
    # at its own node a basis function is 1, and at the others 0
    n = ufl.CellNormal(domain)
    if at_rest is not None and (start := placing.of(domain)) is not None:
        J = ufl.Jacobian(domain)
        moved = ufl.cross(*(ufl.dot(ufl.grad(start), J[:, i]) for i in (0, 1)))
        moved /= ufl.sqrt(ufl.dot(moved, moved))
        if placing.leaning(domain) is not None:
            moved = ufl.dot(ufl.grad(start), at_rest) + ufl.dot(at_rest, n) * moved
            moved /= ufl.sqrt(ufl.dot(moved, moved))
        n = moved
    n = ufl.inner(n, ufl.TestFunction(space)) / ufl.JacobianDeterminant(domain)
    sums = fem.assemble_vector(fem.form(n * ufl.dx(metadata=rule | {"quadrature_degree": 1})))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    found = sums.array.reshape(-1, 3)
    # two cells of opposite orientation cancel out
    if domain.comm.allreduce(bool((~(np.linalg.norm(found, axis=1) >= 1e-3)).any()), MPI.LOR):
        raise InputError("The normals of neighbouring cells are opposite: orient all cells of the sheet alike.")
    return unit(found)
