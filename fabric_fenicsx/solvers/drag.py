"""Drag on a sheet at rest, which takes it downhill in small steps: pseudo-transient continuation.

A step of statics with a drag c M (q - q0) from the last commit is one of backward Euler down the energy (Kelley and
Keyes 1998, doi 10.1137/S0036142996304796). It keeps in place what nothing else holds, such as a garment that does not
touch its wearer yet, and it is gone where nothing moves any more.
"""

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fempetsc
from ufl.form import Form

from ..laws import Array
from ..terms.term import Indices, Term
from .turned import compact


class Drag(Term):
    """A force c M (q - q0), q0 being that of the last commit.

    Public: `coefficient`, c in 1/s2, which may change; `taken`, the work that it has taken so far, J on this rank.

    Args:
        q: the unknown.
        mass: bilinear form of a mass M, see `sheet.Sheet.mass`.
    """

    symmetric = True

    def __init__(self, q: fem.Function, mass: Form, coefficient: float) -> None:
        self.q, self.coefficient, self.taken = q, coefficient, 0.0
        self._mass = compact(fempetsc.assemble_matrix(fem.form(mass)))
        self._force, self._way = fempetsc.create_vector(q.function_space), fem.Function(q.function_space)
        self._start = q.x.array.copy()

    def add_force(self, total: Array) -> None:
        """See `Term.add_force`."""
        force = self._pull()
        total[: len(force)] += force

    def pattern(self) -> tuple[Indices, Indices]:
        """See `Term.pattern`."""
        indptr, columns, self._values = self._mass.getValuesCSR()
        return np.repeat(np.arange(*self._mass.getOwnershipRange()), np.diff(indptr)), columns

    def add_stiffness(self, values: Array) -> None:
        """See `Term.add_stiffness`."""
        values += self.coefficient * self._values

    def work(self) -> float:
        """Of the drag in the step to the present q, J on this rank."""
        return float(np.sum(self._pull() * self._way.x.petsc_vec.array_r))

    def potential(self) -> float:
        """See `Term.potential`."""
        return self.work() / 2

    def energy(self) -> float:
        """None is stored."""
        return 0.0

    def commit(self) -> None:
        """See `Term.commit`."""
        self.taken += self.work()
        self._start = self.q.x.array.copy()

    def renew(self) -> None:
        """See `Term.renew`."""
        self._start = self.q.x.array.copy()

    def _pull(self) -> Array:
        self._way.x.array[:] = self.q.x.array - self._start
        self._mass.mult(self._way.x.petsc_vec, self._force)
        return np.asarray(self.coefficient * self._force.array_r)
