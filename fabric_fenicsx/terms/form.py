"""A UFL form as a term, on any measure: cells (dx), the rim (ds), edges between cells (dS), points (dP)."""

from typing import Any

import numpy as np
import ufl
from dolfinx import fem, la, mesh
from ufl.algorithms import expand_derivatives
from ufl.form import Form

from ..errors import InputError
from ..laws import Array, Stiffest
from .hook import derive, plain
from .term import NOWHERE, Indices, Residual, Term

type Rate = tuple[fem.Function, fem.Constant]
"""A velocity, and its derivative by the unknown in 1/s."""


class FormTerm(Term):
    """A virtual work in UFL, linear in a test function; the stress of a `LawHook` may be in it.

    Public: the compiled `residual`, and `jacobian`, which is compiled when it is first asked for (None for a dead
    load); `hooks`.

    Args:
        form: virtual work in J, on any measure; what loads a sheet is negative.
        q: the unknown.
        rate: of a motion, whose velocity may be in the form.
        energy: form of what it stores in J, a number, if it stores anything; laws with a hook tell theirs themselves.
        symmetric: whether the derivative by q is so in every state; by default, only where UFL can see it. True of a
            form with hooks says also that it is the internal work of these hooks, with their `factor`, and no more.
    """

    def __init__(
        self,
        form: Form,
        q: fem.Function,
        *,
        rate: Rate | None = None,
        energy: Form | None = None,
        symmetric: bool | None = None,
    ) -> None:
        self.form, self.q, self._rate, self._energy_form, self._declared = form, q, rate, energy, symmetric
        residual, self.hooks = plain(form)
        _look_across(residual, q.function_space.mesh)
        self.residual = fem.form(residual)
        inputs = [*residual.constants(), *residual.coefficients()]
        moving: set[Any] = {q, *(hook.stress.ref_coefficient for hook in self.hooks)}
        if rate is not None:
            moving.add(rate[0])
            if rate[0] in inputs:
                self.account = "damping"
        # forces that depend on nothing but loads are assembled anew only where those have changed
        self._dead = None if moving.intersection(inputs) else inputs
        self._known: list[Array] | None = None
        self._force = np.zeros(0)
        self._of_q, self._since, self._gentle = q.x.array, q.x.array.copy(), rate is None or rate[0] not in inputs
        self.has_kinks = bool(self.hooks)

    def _derive(self) -> None:
        jacobian = derive(self.form, self.q, self._rate)[1] if self._dead is None else Form([])
        self._jacobian = fem.form(jacobian) if jacobian.integrals() else None
        self._turning = _by_directors(jacobian, self.q)
        self._symmetric = self._declared
        if self._declared is None:
            self._symmetric = self._jacobian is None or (not self.hooks and _is_symmetric(jacobian))

    @property
    def jacobian(self) -> fem.Form | None:
        """Derivative of the form by q, compiled."""
        if not hasattr(self, "_jacobian"):
            self._derive()
        return self._jacobian

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        """See `Term.symmetric`."""
        return self.jacobian is None or bool(self._symmetric)

    def evaluate(self, tangent: bool = True, stiffest: Stiffest = False) -> bool:
        """See `Term.evaluate`."""
        return all([hook.evaluate(tangent, stiffest) for hook in self.hooks])

    def hardening(self) -> float | None:
        """See `Term.hardening`."""
        return max((hook.points.risen for hook in self.hooks if hook.points.hardens), default=None)

    def add_force(self, total: Array) -> None:
        """See `Term.add_force`."""
        if self._dead is None:
            fem.assemble_vector(total, self.residual)
            return
        now = [c.value if isinstance(c, fem.Constant) else c.x.array for c in self._dead]
        if self._known is None or not all(map(np.array_equal, now, self._known)):
            self._known, self._force = [np.array(values) for values in now], np.zeros_like(total)
            fem.assemble_vector(self._force, self.residual)
        total += self._force

    def pattern(self) -> tuple[Indices, Indices]:
        """See `Term.pattern`."""
        if self.jacobian is None:
            return NOWHERE
        self._matrix = A = fem.create_matrix(self.jacobian, la.BlockMode.compact)
        blocks = A.index_map(0).size_local + A.index_map(0).num_ghosts
        rows = np.repeat(np.arange(blocks, dtype=np.int32), np.diff(A.indptr))
        found = []
        for axis, local in enumerate((rows, A.indices)):
            bs = A.block_size[axis]
            inside = np.arange(bs).reshape((-1, 1) if axis == 0 else (1, -1))
            every = A.index_map(axis).local_to_global(local).reshape(-1, 1, 1) * bs + inside
            found.append(np.broadcast_to(every, (len(local), *A.block_size)).ravel())
        return found[0], found[1]

    def add_stiffness(self, values: Array) -> None:
        """See `Term.add_stiffness`."""
        if self.jacobian is not None:
            self._matrix.data[:] = 0.0
            fem.assemble_matrix(self._matrix, self.jacobian)
            values += self._matrix.data

    def energy(self) -> float | None:
        """See `Term.energy`."""
        parts = [hook.points.energy() for hook in self.hooks]
        if self._energy_form is not None:
            parts.append(self._scalar())
        return sum(parts) if parts else None

    def _scalar(self) -> float:
        if not hasattr(self, "_energy"):
            self._energy = fem.form(self._energy_form)
        return float(fem.assemble_scalar(self._energy))

    def potential(self) -> float | None:
        """See `Term.potential`; of loads less their work along the straight way from the last commit.

        Simpson's rule is exact for forces up to cubic in q, as a pressure's are. It is a potential only where the
        derivative of the force is symmetric at the unknowns that are free, which is for a solver to see. Loads that
        depend on directors have none: these turn on the way, and the work of a moment is another than the straight one.
        """
        if not self._gentle:
            return None
        if self.hooks and (self._declared is not True or any(law is None for law in self._of_laws())):
            return None
        if self.hooks or self._energy_form is not None:
            outside = 0.0 if self._energy_form is None else self._scalar()
            return outside + sum(energy for energy in self._of_laws() if energy is not None)
        if self.jacobian is not None and self._turning:
            return None
        now = self.q.x.array.copy()
        way, forces = now - self._since, []
        for part in (1.0,) if self._dead is not None else (0.0, 0.5, 1.0):
            self.q.x.array[:] = now if part == 1.0 else self._since + part * way
            forces.append(np.zeros_like(now))
            self.add_force(forces[-1])
        # forces of ghosts are not yet with their owners, so that each rank's sum is its own cells' part
        mean = forces[0] if len(forces) == 1 else (forces[0] + 4.0 * forces[1] + forces[2]) / 6.0
        return float(mean @ way)

    def _of_laws(self) -> list[float | None]:
        return [hook.points.potential() for hook in self.hooks]

    def dissipated(self) -> float:
        """See `Term.dissipated`."""
        return sum(hook.points.dissipated() for hook in self.hooks)

    def watch(self) -> None:
        """See `Term.watch`."""
        for hook in self.hooks:
            hook.points.watch()

    def commit(self) -> None:
        """See `Term.commit`."""
        self._since[:] = self._of_q
        for hook in self.hooks:
            hook.points.commit()

    def renew(self) -> None:
        """See `Term.renew`."""
        self._since[:] = self._of_q
        for hook in self.hooks:
            hook.renew()

    def fields(self) -> list[tuple[str, np.ndarray, Array]]:
        """See `Term.fields`."""
        return [field for hook in self.hooks for field in hook.points.fields()]

    def worst(self) -> tuple[float, str]:
        """See `Term.worst`."""
        return max((hook.points.worst() for hook in self.hooks), default=(0.0, ""))


def from_energy(energy: Form, q: fem.Function) -> FormTerm:
    """What resists with the derivative of an energy in J (a number) by the unknown, on any measure.

    A spring of the stiffness k in N/m3 under a sheet: `from_energy(k / 2 * u[2] ** 2 * dx, q)`.
    """
    force = ufl.derivative(energy, q, ufl.TestFunction(q.function_space))
    return FormTerm(expand_derivatives(force), q, energy=energy, symmetric=True)


def terms_of(residual: Residual, q: fem.Function, rate: Rate | None = None) -> list[Term]:
    """The terms of a residual. Parts of a form with one point a cell and with more are told apart, as they have to be.

    In a motion, parts with a law, with a velocity and without are, too.

    rate: of the motion.
    """
    found: list[Term] = []
    for part in residual if isinstance(residual, list | tuple) else [residual]:
        if isinstance(part, Term):
            found.append(part)
        elif isinstance(part, Form):
            found += [FormTerm(form, q, rate=rate) for form in _split(part, rate)]
    return found


def _split(form: Form, rate: Rate | None) -> list[Form]:
    kinds: dict[Any, list[Any]] = {}
    for integral in (form if rate is None else expand_derivatives(form)).integrals():
        # in a kernel of several rules, FFCx 0.11 takes what it computes for a single point as constant in the cell, and
        # uses it at the points of the others too
        kind = [integral.metadata().get("quadrature_degree") in (0, 1)]
        if rate is not None:
            alone = Form([integral])
            kind += [bool(plain(alone)[1]), rate[0] in alone.coefficients()]
        kinds.setdefault(tuple(kind), []).append(integral)
    return [Form(integrals) for integrals in kinds.values()]


def _look_across(residual: Form, domain: mesh.Mesh) -> None:
    """Raise InputError, on every rank, for a form on edges of which a rank knows one side only: it would miss them."""
    if domain.comm.size == 1 or not any(part.integral_type() == "interior_facet" for part in residual.integrals()):
        return
    domain.topology.create_connectivity(1, 2)
    sides = np.diff(domain.topology.connectivity(1, 2).offsets)
    if domain.comm.allreduce(bool((sides[domain.topology.interprocess_facets()] == 1).any())):
        raise InputError(
            "A term on edges between cells (dS) needs the cells beyond the borders of each rank: read the mesh with "
            "ghosts=True."
        )


def _by_directors(jacobian: Form, q: fem.Function) -> bool:
    """Whether a derivative by q is, in a shell, also one by its directors."""
    if q.ufl_shape != (6,) or not jacobian.integrals():
        return False
    change = jacobian.arguments()[1]
    of_directors = ufl.as_vector([0.0, 0.0, 0.0, *(change[k] for k in range(3, 6))])
    return bool(expand_derivatives(ufl.replace(jacobian, {change: of_directors})).integrals())


def _is_symmetric(jacobian: Form) -> bool:
    """Whether a form is the same with its arguments exchanged, as far as UFL can see."""
    return bool(expand_derivatives(ufl.adjoint(jacobian)).signature() == jacobian.signature())
