"""Strains as unknowns of their own in Newton's method, so that a step that bends a sheet may stretch it.

A straight step of displacements stretches a slender sheet that turns, and the stress of that, which nothing balances,
rules the next step, which it makes short. With strains e the system is linear about (u, e),

    (K_C(u, e) + K_S(u, e)) du = loads - B(u)' (S(e) + C(e) (E(u) - e)),    e = E(u) + B(u) du of the step before,

with the material stiffness K_C of C(e) and the geometric one K_S of S(e). It has the same size and, in balance, where
e = E, the same answer (Magisano, Leonetti, Garcea 2017, Comput. Methods Appl. Mech. Eng. 313, for elastic sheets).

A cantilever of muslin in 12 steps takes 68 iterations instead of 310, strips that buckle 125 to 140 instead of 240 to
300 (`demos/studies/stable_statics.py`).
"""

from collections.abc import Sequence

import numpy as np
from petsc4py import PETSc

from ..terms.term import Term
from .unknowns import Unknowns


class Foreseen:
    """The strains e of those of some terms that `Term.foresee`.

    Public: `used`, whether there are such terms and they are to be asked; `known`, whether e is.
    """

    def __init__(self, terms: Sequence[Term], unknowns: Unknowns) -> None:
        self._terms = [term for term in terms if type(term).foresee is not Term.foresee]
        self._unknowns = unknowns
        self.used = self.known = False

    def begin(self) -> None:
        """From e = E(u) on."""
        self.used = bool(self._terms)
        self.forget()

    def forget(self, end: bool = False) -> None:
        """Back to e = E(u), at the next evaluation; end: for good."""
        self.known, self.used = False, self.used and not end

    def keep(self, p: PETSc.Vec) -> None:
        """e after a correction, which PETSc subtracts, from where terms were last evaluated at."""
        if self.used:
            change = self._unknowns.change(-p)
            for term in self._terms:
                term.foresee(change)
            self.known = True

    def linearise(self, reach: float = 1.0) -> None:
        """See `Term.linearise`; may raise what a law does."""
        for term in self._terms:
            term.linearise(reach)

    def right(self, b: PETSc.Vec, given: np.ndarray) -> PETSc.Vec:
        """Right-hand side at residual b, once linearised, and terms made ready for its matrix; of what is given, b."""
        right = b.duplicate()
        self._unknowns.residual(right)
        right.array_w[given] = b.array_r[given]
        self.linearise(0.0)
        self._unknowns.add_up()
        return right
