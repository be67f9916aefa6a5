"""The terms of the weak form: small functions that return UFL. A new effect is one more `+`.

Each is a virtual work in J, linear in a test function. The residual is `internal` less the work of the
loads: `internal(...) - gravity(...) - pressure(...)`. For a shell, with q and test in the space (u, d),
loads take the displacement's part of the test function, v, of `v, delta = ufl.split(test)`; an edge moment
takes the director's. Give every measure its quadrature degree (`supports.over` does): an estimated one
is far too high.
"""

import numpy as np
import ufl
from dolfinx import fem, mesh
from ufl.core.expr import Expr
from ufl.form import Form
from ufl.geometry import FacetJacobian

from ..shell import kinematics
from ..surfaces import placing


def elastic_stress(domain: mesh.Mesh, stiffness: np.ndarray, strain: Expr) -> Expr:
    """Stress of a linear law, stiffness (m, m) in Pa, in plain UFL: no hook, no history."""
    return ufl.dot(fem.Constant(domain, stiffness), strain)


def internal(stress: Expr, strain: Expr, u: fem.Function, v: Expr, thickness: Expr | float, dx: ufl.Measure) -> Form:
    """Virtual work of the stress, int S . dE h dA in J (5.17); `thickness` h in m.

    v: test function of the space of `u`.
    """
    return thickness * ufl.inner(stress, ufl.derivative(strain, u, v)) * dx


def stored(stress: Expr, strain: Expr, thickness: Expr | float, dx: ufl.Measure) -> Form:
    """Energy of a linear symmetric law, int S . E h / 2 dA in J: a number, not a virtual work."""
    return thickness / 2 * ufl.inner(stress, strain) * dx


def inertia(areal_mass: Expr | float, acceleration: Expr, v: Expr, dx: ufl.Measure) -> Form:
    """Virtual work of the inertia of the mid-surface (5.75); areal mass in kg/m2.

    With a trial function for the acceleration it is the mass matrix that `motion.Motion` takes. Degree 4 of
    `dx` is exact on flat triangles with a quadratic displacement.
    """
    return areal_mass * ufl.inner(acceleration, v) * dx


def rotary_inertia(
    areal_mass: Expr | float, thickness: Expr | float, d: Expr, delta: Expr, dx: ufl.Measure, reach: float = 0.0
) -> Form:
    """Virtual work of the inertia of directors, rho h^3/12 in kg (5.75); d and delta as in `inertia`.

    With h^2 + `reach` times the area of the cell in place of h^2. A cell much wider than the sheet is thick has
    directors that turn a thousand times faster than its nodes move: no time step follows them, and in a sheet that
    wrinkles from cell to cell they turn over. With a reach of 3 their radius of gyration is half a cell; explicit codes
    do so too (Hughes, Cohen, Haroun 1978, doi 10.1016/0029-5493(78)90184-X). It vanishes with the square of the mesh.
    """
    return areal_mass * (thickness**2 + reach * _cell_area(dx.ufl_domain())) / 12 * ufl.inner(d, delta) * dx


def stiffness_damping(
    b: Expr | float, stiffness: np.ndarray, strain: Expr, u: fem.Function, velocity: fem.Function, v: Expr,
    dx: ufl.Measure,
) -> Form:  # fmt: skip
    """Virtual work of b K_M velocity, the stiffness part of Rayleigh's damping (Box 5-2); b in s.

    K_M is the material stiffness in the present shape, with the stiffness (m, m) of the law at rest,
    integrated over the thickness: it resists strain, never a turn of the whole, and always dissipates.
    """
    rate = ufl.derivative(strain, u, velocity)
    C = fem.Constant(u.function_space.mesh, stiffness)
    return b * ufl.inner(ufl.dot(C, rate), ufl.derivative(strain, u, v)) * dx


def drag(c: Expr | float, velocity: Expr, v: Expr, dx: ufl.Measure) -> Form:
    """Virtual work of what resists a velocity, c times it per area, as air does a slow sheet; c in N s/m3.

    One more term of the loads of a moving sheet: `weight - drag(c, cloth.velocity, cloth.v, cloth.dx)`.
    """
    return c * ufl.inner(velocity, v) * dx


def body_force(force: Expr, v: Expr, thickness: Expr | float, dx: ufl.Measure) -> Form:
    """Virtual work of a dead force per reference volume, in N/m3, on the displacement v; subtract it."""
    return thickness * ufl.inner(force, v) * dx


def gravity(areal_mass: Expr | float, acceleration: Expr, v: Expr, dx: ufl.Measure) -> Form:
    """Virtual work of the weight: areal_mass in kg/m2, acceleration a vector in m/s2; subtract it."""
    return areal_mass * ufl.inner(acceleration, v) * dx


def surface_traction(force: Expr, v: Expr, dx: ufl.Measure) -> Form:
    """Virtual work of a dead force per reference area, in N/m2, on the displacement v; subtract it."""
    return ufl.inner(force, v) * dx


def traction(force: Expr, v: Expr, ds: ufl.Measure) -> Form:
    """Virtual work of a dead force per reference length of edge, in N/m, on the displacement v; subtract it."""
    return ufl.inner(force, v) * ds


def point_force(force: Expr, v: Expr, dP: ufl.Measure) -> Form:
    """Virtual work of a dead force in N at each point of dP, a measure over vertices; subtract it."""
    return ufl.inner(force, v) * dP


def pressure(p: Expr | float, u: Expr, v: Expr, dx: ufl.Measure) -> Form:
    """Virtual work of a pressure in Pa that stays normal to the moved sheet; subtract it.

    It pushes along the normal, that of `kinematics.area_vector`, which makes the force p n da a polynomial in u with
    an exact derivative; p itself may depend on u. It is not symmetric where the sheet has a free edge. Degree 4
    is exact on flat triangles with a quadratic u and a constant p; less of `dx` would spoil symmetry, and is raised.
    """
    known = dx.metadata()
    if "quadrature_degree" in known:
        dx = dx(metadata={**known, "quadrature_degree": max(4, known["quadrature_degree"])})
    return p * ufl.inner(kinematics.area_vector(u, dx.ufl_domain()), v) * dx


def edge_moment(moment: Expr, d: Expr, delta: Expr, ds: ufl.Measure) -> Form:
    """Virtual work of a dead moment per length of edge, a vector in N m/m, on the director d; subtract it.

    The moment turns by the right-hand rule, and keeps its axis while the edge turns. When d turns by w it
    does the work m . w: delta = w x d is the director's test function, and d x delta is w less its part
    along d. The sum of moments is exact with one point an edge (degree 1) where the directors are at
    the middles of edges.
    """
    return ufl.inner(moment, ufl.cross(d, delta)) * ds


def drilling_moment(moment: Expr, u: Expr, v: Expr, d: Expr, delta: Expr, ds: ufl.Measure) -> Form:
    """What `edge_moment` leaves out, on an edge that turns in the surface as a rigid one does; subtract it.

    The edge goes along t, of which b is the part across d. When both turn by w, delta is w x d, the test function's
    part of b w x b, and d x b . w x b is b^2 d . w: with `edge_moment` the whole work of a dead moment is m . w.
    """
    along = FacetJacobian(ds.ufl_domain())[:, 0]
    moved = ufl.grad(placing.from_rest(u))
    t, change, square = along + ufl.dot(moved, along), ufl.dot(ufl.grad(v), along), ufl.dot(d, d)
    part = ufl.dot(t, d) / square
    b, change = t - part * d, change - part * delta
    return ufl.inner(moment, d) / square * ufl.dot(ufl.cross(d, b), change) / ufl.dot(b, b) * ds


SHEAR_REACH = 0.1
"""How far below its cells a shell may be thin before its shear stiffness is limited (`shear_stiffness`).

Measured for 1e-4 ... 3, regular and skewed. End shear, h/L = 1e-2 ... 1e-6, triangles: worst error of the tip at 8, 16
cells -12.5, -0.5 % for 1e-4; -4.9, -0.05 % for 1e-3; -0.23, 0.06 % for 1e-2; 0.18, 0.07 % for 0.1. Clamped
square under load, h/L = 1e-4, regular, at 8, 16, 32 cells: -15.5, -4.1, -1.0 % for 1e-3; -4.5, -1.3, -0.3 % for
0.1 (bilinear quadrilaterals 1.9, 0.5, 0.1 % for 0.1, and -1.2, -0.3, -0.1 % without it: they do not need it).
At h/L = 0.1, where shear is a sixth of the deflection, 0.1 adds 1.3, 0.3, 0.1 %.
"""


STEADY = 27.0, 10.0
"""On curved triangles: area of a cell, in squares of the thickness, below which the limit fades; largest
`shear_variation`, squared.

Without, triangles are dented too far by a point force. Semi-cylinder, 16 cells a side, pinched (Sze 2004, 3.7; fine
meshes are 2.6, 0.8, 0.2 % above its own), first three loads: 8.4, 0.2, -0.8 % without; 5.7, -1.3, -1.7 % if the limit
fades alone; 3.1, -3.0, -2.7 % with both. Pinched tube on diaphragms (3.6; fine meshes 0.7, 2.1, 2.7, 3.1 % above), four
loads before it snaps: -0.1, -0.1, 4.8, 6.0 % without, -1.0, -1.5, 3.9, 5.8 % with both. Where the parts of the shear
that are tied to edges kept all stiffness, and the rest alone were limited: 5.4, -1.3, -1.7 and -0.5, -0.6, 4.3, 5.9 %.
The price, 6 and 16 cells of the Scordelis-Lo roof: -0.5, -0.1 % without, -0.6, -0.4 % with both.
"""


def shear_stiffness(
    domain: mesh.Mesh,
    moduli: tuple[Expr | float, Expr | float],
    thickness: Expr | float,
    reach: float = SHEAR_REACH,
    *,
    bending: Expr | float | None = None,
    curvature: Expr | None = None,
) -> Expr:
    """Transverse shear stiffness (2, 2) in N/m, 5/6 h (G13, G23) of (6.30), limited on thin shells.

    With h^3 / (h^2 + c A G/B) in place of h, A the area of the cell, c = `reach`: on cells much wider than
    the shell is thick, shear stiffness beyond bending stiffness would lock the element and adds
    nothing (Lyly, Stenberg, Vihinen 1993, doi 10.1016/0045-7825(93)90018-Q, and common practice).
    bending: B in Pa, E/2/(1 + nu) of the modulus E with which the shell bends; by default it is G, as if isotropic.
    curvature: see `shear_variation`.
    """
    first, second, h = (_number(domain, value) for value in (*moduli, thickness))
    limited = [5 / 6 * G * h / (1.0 + _limit(domain, G, h, reach, bending, curvature)[0]) for G in (first, second)]
    return ufl.as_matrix([[limited[0], 0.0], [0.0, limited[1]]])


def shear_variation(
    domain: mesh.Mesh,
    modulus: Expr | float,
    thickness: Expr | float,
    reach: float = SHEAR_REACH,
    *,
    bending: Expr | float | None = None,
    curvature: Expr | None = None,
) -> Expr | float:
    """By what the part of the shear strain that varies within a triangle counts more than its mean; 1 if flat.

    A point force on a curved sheet dents it over a length of sqrt(R h). Where cells are as wide as that, and not much
    wider than the sheet is thick, directors in the middles of edges give way to the dent in a cell alone. So the limit
    of `shear_stiffness` fades there, and the variation, which is none on a fine mesh, keeps its stiffness.
    curvature: of the sheet at rest, 1/m (`ShellSpace.curvature`); None where nothing of this is needed.
    """
    if curvature is None or reach == 0.0:
        return 1.0
    limit, part = _limit(domain, modulus, thickness, reach, bending, curvature)
    return ufl.sqrt((1.0 + limit) / (1.0 + limit - (1.0 - 1.0 / STEADY[1]) * part))


def _limit(
    domain: mesh.Mesh,
    modulus: Expr | float,
    h: Expr | float,
    reach: float,
    bending: Expr | float | None,
    curvature: Expr | None,
) -> tuple[Expr, Expr | float]:
    """c A G/(B h^2) of a cell, less where it is curved and not wide, and how much less, from 0 to 1."""
    area, h = _cell_area(domain.ufl_domain()), _number(domain, h)
    wide = area * (1.0 if bending is None else _number(domain, modulus) / _number(domain, bending)) / h**2
    if curvature is None:
        return reach * wide, 0.0
    bent = area * curvature / h
    part = bent / (bent + 0.01) / (1.0 + (wide / STEADY[0]) ** 2)
    return reach * wide * (1.0 - part), part


def _number(domain: mesh.Mesh, value: Expr | float) -> Expr:
    """A constant, not a digit of the kernel: that of another fabric is not compiled anew."""
    return value if isinstance(value, Expr) else fem.Constant(domain, float(value))


def _cell_area(domain: ufl.Mesh) -> Expr:
    # UFL's CellVolume is for flat triangles only
    return ufl.JacobianDeterminant(domain) * (0.5 if domain.ufl_cell() == ufl.triangle else 1.0)
