"""What goes with the mass of a motion, as a term of its residual."""

import numpy as np
from petsc4py import PETSc

from ..laws import Array
from ..terms.term import Indices, Term
from .motion import Motion
from .turned import Turned


class Mass(Term):
    """What goes with the mass of a motion: its inertia M a, with that of impulses, or its damping a M v.

    `size` is the largest of its nodal forces at the last `add_force`, N.
    """

    symmetric = True

    def __init__(self, motion: Motion, *, damps: bool = False) -> None:
        self.motion, self._damps, self.size = motion, damps, 0.0
        if damps:
            self.account = "damping"

    def add_force(self, total: Array) -> None:
        """See `Term.add_force`."""
        force = self.motion.by_mass(self.motion.velocity if self._damps else self.motion.acceleration)
        if self._damps:
            force.scale(self.motion.damping)
        total[: force.local_size] += force.array_r
        self.size = force.norm(PETSc.NormType.NORM_INFINITY)
        if self.motion.jump is not None and not self._damps:
            force = self.motion.by_mass(self.motion.jump)
            total[: force.local_size] += force.array_r

    def pattern(self) -> tuple[Indices, Indices]:
        """See `Term.pattern`."""
        indptr, columns, self._values = self.motion.mass.getValuesCSR()
        return np.repeat(np.arange(*self.motion.mass.getOwnershipRange()), np.diff(indptr)), columns

    def add_stiffness(self, values: Array) -> None:
        """See `Term.add_stiffness`."""
        values += self._factor() * self._values

    def _factor(self) -> float:
        return self.motion.damping * float(self.motion.rate.value) if self._damps else self.motion.shift

    def turned_pattern(self) -> tuple[Indices, Indices] | None:
        """See `Term.turned_pattern`."""
        if self.motion.space is None:
            return None
        self._turned = Turned(self.motion.space, self.motion.entries)
        return self._turned.pattern

    def add_turned(self, values: Array) -> None:
        """See `Term.add_turned`."""
        self._turned.add(self._factor(), values)
