"""Plies on each other, as one section of a shell: each with its own law, thickness and angle.

With z the height of a ply's middle and T what turns strains (E11, E22, 2 E12) into the ply's axes, the ply sees the
strain B e of its own section, and answers with resultants that are B' n in the whole:

    B = [[T, z T], [0, T]],    N, M = sum B' (N, M)_ply,    C = sum B' C_ply B    (classical lamination theory).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from . import Array, HasPotential, HasRecoverable, HasStiffest, HasStiffness, Law, empty
from .section import Section


class Ply(NamedTuple):
    """A plane law, its thickness in m, the angle of its warp to that of the lay-up in radians, and layers in it."""

    law: Law
    thickness: float
    angle: float = 0.0
    layers: int = 2


class LayUp:
    """Plies from the side against the normal on, bonded; a law of (E11, E22, 2 E12, K11, K22, 2 K12) as `Section` is.

    Its state is that of the plies, one after the other. Where all their laws are linear it has `stiffness` (6, 6).
    Raises InputError.
    """

    def __init__(self, plies: Sequence[Ply]) -> None:
        if not plies:
            raise InputError("A lay-up has no plies: give one at least.")
        if not np.isfinite([ply.angle for ply in plies]).all():
            raise InputError("A ply has an angle that is not finite: give it in radians.")
        self.plies = tuple(plies)
        self._sections = [Section(ply.law, ply.thickness, ply.layers) for ply in plies]
        thickness = np.array([ply.thickness for ply in plies])
        self.thickness = float(thickness.sum())
        middles = np.cumsum(thickness) - (thickness + self.thickness) / 2
        self._maps = [np.kron([[1.0, z], [0.0, 1.0]], _turn(ply.angle)) for z, ply in zip(middles, plies, strict=True)]
        self.initial_state = np.concatenate([section.initial_state for section in self._sections])
        self._ends = np.cumsum([section.initial_state.size for section in self._sections])[:-1]
        self.symmetric = all(ply.law.symmetric for ply in plies)
        if all(isinstance(ply.law, HasRecoverable) for ply in plies):
            self.recoverable = self._recoverable
        if all(isinstance(ply.law, HasPotential) for ply in plies):
            self.potential = self._potential
        if all(isinstance(ply.law, HasStiffness) for ply in plies):
            parts = zip(self._sections, plies, self._maps, strict=True)
            own = [B.T @ section.elastic(ply.law.stiffness) @ B for section, ply, B in parts]  # type: ignore[attr-defined]
            self.stiffness = np.sum(own, axis=0)
            self.stiffest = self
        elif all(isinstance(ply.law, HasStiffness | HasStiffest) for ply in plies):
            linear = (ply.law.stiffest if isinstance(ply.law, HasStiffest) else ply.law for ply in plies)
            self.stiffest = LayUp([ply._replace(law=law) for ply, law in zip(plies, linear, strict=True)])

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Resultants (n, 6), tangent (n, 6, 6) and new state; see `laws.Law.respond`."""
        n = len(strain)
        out = out or empty(strain, state)
        resultants, moduli, new = out
        total, stiffness = np.zeros((n, 6)), np.zeros((n, 6, 6))
        states, changed = (np.split(array, self._ends, axis=1) for array in (state, new))
        for section, B, old, after in zip(self._sections, self._maps, states, changed, strict=True):
            own, C, later = section.respond(strain @ B.T, np.ascontiguousarray(old))
            after[:] = later
            total += own @ B
            stiffness += B.T @ C @ B
        resultants[:], moduli[:] = total, stiffness
        return out

    def _sum(self, name: str, strain: Array, state: Array) -> Array:
        states = np.split(state, self._ends, axis=1)
        parts = zip(self._sections, self._maps, states, strict=True)
        return np.sum([getattr(part, name)(strain @ B.T, np.ascontiguousarray(s)) for part, B, s in parts], axis=0)

    def _recoverable(self, strain: Array, state: Array) -> Array:
        """See `laws.HasRecoverable`; J/m2."""
        return self._sum("recoverable", strain, state)

    def _potential(self, strain: Array, state: Array) -> Array:
        """See `laws.HasPotential`; J/m2."""
        return self._sum("potential", strain, state)


def _turn(angle: float) -> Array:
    """(E11, E22, 2 E12) in axes that are turned by an angle (radians): a matrix (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
