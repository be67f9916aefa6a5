"""The external operator: a law at every quadrature point of a UFL form.

In a form, `LawHook.stress` stands for the stress of the law at the hook's strain. UFL differentiates
through it, and the tangent becomes a coefficient of the Jacobian; one call of the law fills both:

    residual   int S(E(u)) . dE[v] h dA                                    (5.17), (5.64)
    Jacobian   int (dE[v] . C dE[w] + S . d2E[v, w]) h dA,    C = dS/dE    (5.63), (5.67), (5.70)

C, with a row for each stress and a column for each strain, need not be symmetric, and is not for a measured
fabric. The operator is that of dolfinx-external-operator (Latyshev, Bleyer, Maurini and Hale, 2024); law and history
are `points.LawPoints`.
"""

from functools import cached_property
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx_external_operator import FEMExternalOperator, replace_external_operators
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.corealg.dag_traverser import DAGTraverser
from ufl.form import Form

from ..errors import InputError
from ..laws import Array, Law, Stiffest
from .points import LawPoints

COMPILE = {"cffi_extra_compile_args": ["-O3", "-g0"]}
"""Compiler options of the strain at the points: a quarter faster on bilinear cells than with -O2."""


class LawHook:
    """A law at the points of a quadrature rule, as an operand of UFL forms.

    Public: `stress`, the operand, to be integrated with the measure `dx` and no other; `points`, the law's
    `LawPoints` of all local cells.

    Args:
        law: see `laws.Law`.
        strain: UFL vector with as many components as the law takes.
        domain: the mesh.
        degree: of the quadrature rule, at least 1; always given, since an estimated one is far too high.
        factor: what the stress is multiplied by in the form, the thickness in m, or 1 for resultants; for the account
            of energies only.
        cells: local cells that have this law, ascending; by default all.
        dx: measure over those cells, whose rule is that of `degree`.
    """

    def __init__(
        self,
        law: Law,
        strain: Expr,
        domain: mesh.Mesh,
        degree: int,
        *,
        factor: float = 1.0,
        cells: np.ndarray | None = None,
        dx: ufl.Measure | None = None,
    ) -> None:
        if degree < 1:
            raise InputError(f"The quadrature degree of a law must be at least 1, not {degree}.")
        element = basix.ufl.quadrature_element(
            domain.basix_cell(), degree=degree, value_shape=strain.ufl_shape, scheme="default"
        )
        space = fem.functionspace(domain, element)
        self.dx = dx or ufl.Measure(
            "dx", domain=domain, metadata={"quadrature_degree": degree, "quadrature_scheme": "default"}
        )
        self.stress = FEMExternalOperator(strain, function_space=space, external_function=self, name="stress")
        self._operand, self._mesh, self._factor = (strain, space.element.interpolation_points), domain, factor
        every = domain.topology.index_map(domain.topology.dim)
        everywhere = np.arange(every.size_local + every.num_ghosts, dtype=np.int32)
        shape = len(space.element.interpolation_points), strain.ufl_shape[0]
        self._shape, self._some = (len(everywhere), *shape), cells
        self.points = LawPoints(
            law,
            domain,
            everywhere if cells is None else cells,
            shape,
            weights=self._weights,
            stress=self.stress.ref_coefficient.x.array if cells is None else None,
        )
        self._copies: list[fem.Function] = []

    def adopt(self, operators: list[Any]) -> None:
        """Take over the coefficients of those operators of a Jacobian that are this hook's tangent."""
        found = [op for op in operators if op.external_function is self and sum(op.derivatives) == 1]
        if not found:
            # ufl drops the material tangent without a word where a derivative was left unexpanded
            raise RuntimeError(
                "The Jacobian does not hold the tangent of a law: its stress is not in the residual, or UFL lost it."
            )
        tangents = [op.ref_coefficient for op in found]
        if not self._copies and self._some is None:
            self.points.tangent = tangents[0].x.array.reshape(*self.points.strain.shape, self.points.strain.shape[-1])
        self._copies += tangents

    @cached_property
    def _compiled(self) -> fem.Expression:
        return fem.Expression(*self._operand, jit_options=COMPILE)

    def _weights(self) -> Array:
        degree = self.dx.metadata()["quadrature_degree"]
        element = basix.ufl.quadrature_element(self._mesh.basix_cell(), degree=degree, scheme="default")
        test = ufl.TestFunction(fem.functionspace(self._mesh, element))
        weights = fem.assemble_vector(fem.form(self._factor * test * self.dx)).array
        return weights.reshape(self._shape[:2])[self.points.cells[: self.points.owned]]

    def evaluate(self, tangent: bool = True, stiffest: Stiffest = False) -> bool:
        """See `LawPoints.evaluate`; fills the coefficients of the forms."""
        self._compiled.eval(self._mesh, self.points.cells, self.points.strain)
        good = self.points.evaluate(tangent, stiffest)
        if self._some is not None:
            self.stress.ref_coefficient.x.array.reshape(self._shape)[self._some] = self.points.stress
            if tangent:
                for copy in self._copies:
                    copy.x.array.reshape(*self._shape, self._shape[-1])[self._some] = self.points.tangent
            return good
        for copy in self._copies[1:]:
            copy.x.array[:] = self._copies[0].x.array
        return good

    def renew(self) -> None:
        """Evaluate at unknowns that come from a checkpoint; the stress, which came along, stays as it is."""
        stress = self.points.stress.copy()
        self.evaluate()
        self.points.stress[:] = stress


def plain(residual: Form) -> tuple[Form, tuple[LawHook, ...]]:
    """A residual in plain coefficients, and the hooks that fill them."""
    residual, operators = replace_external_operators(expand_derivatives(residual))
    return residual, tuple(dict.fromkeys(op.external_function for op in operators))


def derive(
    residual: Form, u: fem.Function, rate: tuple[fem.Function, fem.Constant] | None = None
) -> tuple[Form, Form, tuple[LawHook, ...]]:
    """Residual and Jacobian in plain coefficients, and the hooks that fill them.

    rate: a velocity, and the factor with which the derivative by it is added to the Jacobian.
    """
    # expanded first: the second derivative of an unexpanded one loses the material tangent (ufl#449)
    residual = expand_derivatives(residual)
    jacobian = ufl.derivative(residual, u)
    if rate and rate[0] in residual.coefficients():
        jacobian += rate[1] * ufl.derivative(residual, rate[0])
    residual, hooks = plain(residual)
    jacobian, operators = replace_external_operators(jacobian)
    for hook in hooks:
        hook.adopt(operators)
    return residual, expand_derivatives(jacobian), hooks


def forget_traversals() -> None:
    """Let go of the forms that UFL has worked on, and with them of their meshes.

    Python's `singledispatchmethod` keeps every traverser it was called on, so that a study of many scenes would
    run out of MPI communicators (2048 in MPICH, 9 a scene).
    """
    kinds = [DAGTraverser]
    for kind in kinds:
        kinds += kind.__subclasses__()
        cache = getattr(vars(kind).get("process"), "_method_cache", None)
        if cache is not None:
            cache.clear()
