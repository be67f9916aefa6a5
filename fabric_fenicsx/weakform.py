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
