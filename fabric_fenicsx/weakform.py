"""The terms of the weak form: small functions that return UFL. A new effect is one more `+`."""

import numpy as np
import ufl
from dolfinx import fem, mesh
from ufl.core.expr import Expr
from ufl.form import Form


def elastic_stress(domain: mesh.Mesh, stiffness: np.ndarray, strain: Expr) -> Expr:
    """Stress of a linear law, stiffness (m, m) in Pa, in plain UFL: no hook, no history."""
    return ufl.dot(fem.Constant(domain, stiffness), strain)


def internal(
    stress: Expr, strain: Expr, u: fem.Function, v: Expr, thickness: Expr | float, dx: ufl.Measure
) -> Form:
    """Virtual work of the stress, int S . dE h dA in J (5.60); `thickness` h in m.

    v: test function of the space of `u`.
    """
    return thickness * ufl.inner(stress, ufl.derivative(strain, u, v)) * dx


def body_force(force: Expr, v: Expr, thickness: Expr | float, dx: ufl.Measure) -> Form:
    """Virtual work of a dead force per volume, in N/m3, on the displacement v; subtract it."""
    return thickness * ufl.inner(force, v) * dx


def traction(force: Expr, v: Expr, ds: ufl.Measure) -> Form:
    """Virtual work of a dead force per length of edge, in N/m, on the displacement v; subtract it."""
    return ufl.inner(force, v) * ds


SHEAR_REACH = 1e-3
"""How far below its cells a shell may be thin before its shear stiffness is limited (`shear_stiffness`)."""


def shear_stiffness(domain: mesh.Mesh, moduli: tuple[float, float], thickness: Expr | float) -> Expr:
    """Transverse shear stiffness (2, 2) in N/m, 5/6 h (G13, G23) of (6.30), limited on thin shells.

    With h^3 / (h^2 + c A) in place of h, A the area of the cell, c = `SHEAR_REACH`: on cells much wider than
    the shell is thick, shear stiffness beyond bending stiffness would lock the element and adds
    nothing (Lyly, Stenberg, Vihinen 1993, doi 10.1016/0045-7825(93)90018-Q, and common practice).
    """
    h = thickness
    limited = h**3 / (h**2 + SHEAR_REACH * ufl.CellVolume(domain))
    return 5 / 6 * limited * fem.Constant(domain, np.diag(np.array(moduli, dtype=float)))
