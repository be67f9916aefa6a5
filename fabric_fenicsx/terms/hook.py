"""The external operator: a law at every quadrature point of a form, and its history.

In a form, `LawHook.stress` stands for the stress of the law at the hook's strain. UFL differentiates
through it, and the tangent becomes a coefficient of the Jacobian; one call of the law fills both:

    residual   int S(E(u)) . dE[v] h dA                                    (5.17), (5.64)
    Jacobian   int (dE[v] . C dE[w] + S . d2E[v, w]) h dA,    C = dS/dE    (5.63), (5.67), (5.70)

C, with a row for each stress and a column for each strain, need not be symmetric, and is not for a measured
fabric. The operator is that of dolfinx-external-operator (Latyshev, Bleyer, Maurini and Hale, 2024). History
has a committed and a trial state: every evaluation starts from the committed one, so that a line search or a
step that fails leaves nothing behind, and only `commit` moves the past.
"""

import warnings
from collections.abc import Callable
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
from ..laws import Array, Law
from ..laws.section import Section

COMPILE = {"cffi_extra_compile_args": ["-O3", "-g0"]}
"""Compiler options of the strain at the points: a quarter faster on bilinear cells than with -O2."""


class History:
    """Committed and trial state of every point, shape (number of points, state variables)."""

    def __init__(self, initial: Array, points: int) -> None:
        self.committed = np.tile(initial, (points, 1))
        self.trial = self.committed.copy()

    def commit(self) -> None:
        """What was tried has happened."""
        self.committed, self.trial = self.trial, self.committed


class LawHook:
    """A law at the points of a quadrature rule, as an operand of UFL forms.

    law: see `laws.Law`. strain: UFL vector with as many components as the law takes. degree: of the
    quadrature rule, at least 1; always given, since an estimated one is far too high.

    Public: `stress`, the operand, to be integrated with the measure `dx` and no other; `history`.
    Points are those of all local cells, ghosts included: a law needs no communication.
    """

    def __init__(self, law: Law, strain: Expr, domain: mesh.Mesh, degree: int) -> None:
        if degree < 1:
            raise InputError(f"The quadrature degree of a law must be at least 1, not {degree}.")
        self.law, self.mesh = law, domain
        element = basix.ufl.quadrature_element(
            domain.basix_cell(), degree=degree, value_shape=strain.ufl_shape, scheme="default"
        )
        space = fem.functionspace(domain, element)
        metadata = {"quadrature_degree": degree, "quadrature_scheme": "default"}
        self.dx = ufl.Measure("dx", domain=domain, metadata=metadata)
        self.stress = FEMExternalOperator(strain, function_space=space, external_function=self, name="stress")
        self._operand = strain, space.element.interpolation_points
        self.measure: Callable[[Array], None] = self._measure
        """What fills an array with the strains, (cells, points of a cell, components)."""
        cells = domain.topology.index_map(domain.topology.dim)
        self._cells = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
        self._owned = cells.size_local
        per_cell = len(space.element.interpolation_points)
        self.owned_points = self._owned * per_cell
        """Points of this rank's own cells, which come first."""
        shape = (len(self._cells), per_cell)
        self.strain = np.zeros((*shape, *strain.ufl_shape))
        """Strain at the last evaluation, shape (cells, points of a cell, components)."""
        self.history = History(law.initial_state, shape[0] * shape[1])
        self._tangents: list[fem.Function] = []
        self._spare: Array | None = None
        self._beyond: Callable[[Array], str | None] | None = getattr(law, "beyond_calibration", None)

    def adopt(self, operators: list[Any]) -> None:
        """Take over the coefficients of those operators of a Jacobian that are this hook's tangent."""
        found = [op for op in operators if op.external_function is self and sum(op.derivatives) == 1]
        if not found:
            # ufl drops the material tangent without a word where a derivative was left unexpanded
            raise RuntimeError(
                "The Jacobian does not hold the tangent of a law: its stress is not in the residual, or UFL lost it."
            )
        self._tangents += [op.ref_coefficient for op in found]

    @property
    def resultants(self) -> Array:
        """Stress at the last evaluation, shape (cells, points of a cell, components)."""
        return self.stress.ref_coefficient.x.array.reshape(self.strain.shape)

    @property
    def tangent(self) -> Array:
        """Tangent at the last evaluation, shape (cells, points of a cell, components, components)."""
        shape = (*self.strain.shape, self.strain.shape[-1])
        if self._tangents:
            return self._tangents[0].x.array.reshape(shape)
        if self._spare is None:
            self._spare = np.empty(shape)
        return self._spare

    @cached_property
    def _compiled(self) -> fem.Expression:
        return fem.Expression(*self._operand, jit_options=COMPILE)

    def _measure(self, out: Array) -> None:
        self._compiled.eval(self.mesh, self._cells, out)

    def evaluate(self, tangent: bool = True) -> bool:
        """Strain, then stress, tangent and trial state from the committed one; False if one is not finite.

        tangent: whether it is wanted; a law that cannot leave it out gives it.
        """
        n = self.strain.shape[-1]
        self.measure(self.strain)
        stress, history = self.resultants.reshape(-1, n), self.history
        out = stress, self.tangent.reshape(-1, n, n), history.trial
        if tangent or not isinstance(self.law, Section):
            self.law.respond(self.strain.reshape(-1, n), history.committed, out)
        else:
            self.law.respond(self.strain.reshape(-1, n), history.committed, out, tangent=False)
        for copy in self._tangents[1:]:
            copy.x.array[:] = self._tangents[0].x.array
        return bool(np.isfinite(stress.sum()))

    def commit(self) -> None:
        """Move the past: the trial state of the last evaluation becomes the committed one."""
        self.history.commit()
        if self._beyond is not None:
            said = self._beyond(self.strain.reshape(-1, self.strain.shape[-1])) if self.strain.size else None
            said = next((s for s in self.mesh.comm.allgather(said) if s), None)
            if said is not None:
                self._beyond = None
                if self.mesh.comm.rank == 0:
                    warnings.warn(said, stacklevel=2)

    def worst(self) -> tuple[float, str]:
        """Largest strain on this rank (infinite where it or its stress is not finite), and where it is."""
        size = np.abs(self.strain[: self._owned]).max(axis=2)
        if not size.size:
            return -1.0, ""
        stress = self.resultants[: self._owned]
        size[~(np.isfinite(size) & np.isfinite(stress).all(axis=2))] = np.inf
        cell, point = np.unravel_index(np.argmax(size), size.shape)
        number = self.mesh.topology.original_cell_index[cell]
        middle = mesh.compute_midpoints(self.mesh, self.mesh.topology.dim, np.array([cell], dtype=np.int32))[0]
        strain = ", ".join(f"{value:.3g}" for value in self.strain[cell, point])
        where = ", ".join(f"{x:.4g}" for x in middle[: self.mesh.geometry.dim])
        return float(size[cell, point]), f"cell {number} at ({where}) m, point {point}: strain ({strain})"


def plain(residual: Form, hooks: tuple[LawHook, ...]) -> Form:
    """A residual with hooks in plain coefficients that the hooks fill. InputError for a law without its hook."""
    residual, operators = replace_external_operators(expand_derivatives(residual))
    if any(op.external_function not in hooks for op in operators):
        raise InputError("The residual holds the stress of a law whose hook the solver was not given.")
    return residual


def derive(
    residual: Form, u: fem.Function, hooks: tuple[LawHook, ...], rate: tuple[fem.Function, fem.Constant] | None = None
) -> tuple[Form, Form]:
    """Residual and Jacobian of a residual with hooks, in plain coefficients that the hooks fill.

    rate: a velocity, and the factor with which the derivative by it is added to the Jacobian.
    """
    # expanded first: the second derivative of an unexpanded one loses the material tangent (ufl#449)
    residual = expand_derivatives(residual)
    jacobian = ufl.derivative(residual, u)
    if rate and rate[0] in residual.coefficients():
        jacobian += rate[1] * ufl.derivative(residual, rate[0])
    residual = plain(residual, hooks)
    jacobian, operators = replace_external_operators(jacobian)
    for hook in hooks:
        hook.adopt(operators)
    return residual, expand_derivatives(jacobian)


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
