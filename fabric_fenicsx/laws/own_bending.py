"""A plane law at the mid-surface of a shell and a bending law of its own: resultants from strain and curvature.

    N = h S(E),    M = M(K)

with h the thickness, S the plane law's stress, one evaluation, and M the moments of `bending.Bending`. What a sheet
does when it is bent then no longer hangs on its thickness, which scales stresses. The other way is `section.Section`,
the plane law in layers.
"""

from collections.abc import Callable
from functools import partial

import numba
import numpy as np

from ..errors import InputError
from . import Array, HasCalibration, HasHardened, HasPotential, HasRecoverable, HasStiffest, HasStiffness, Law, empty

type Energy = Callable[[Array, Array], Array]


class OwnBending:
    """A plane law for N and a bending law for M, itself a law of (E11, E22, 2 E12, K11, K22, 2 K12), as `Section` is.

    Its stress is (N, M), in N/m and N. Its state is the plane law's, followed by the bending law's. Where both laws
    are linear it has `stiffness` (6, 6).

    thickness in m; bending: a `Bending`, or another law of three curvatures. Raises InputError.
    """

    def __init__(self, law: Law, thickness: float, bending: Law) -> None:
        if not (np.isfinite(thickness) and thickness > 0):
            raise InputError(f"A thickness of {thickness!r} m is not a positive number.")
        self.law, self.thickness, self.bending = law, float(thickness), bending
        self.initial_state = np.concatenate([law.initial_state, bending.initial_state])
        self.symmetric = law.symmetric and bending.symmetric
        self._own = law.initial_state.size
        if isinstance(law, HasRecoverable) and isinstance(bending, HasRecoverable):
            self.recoverable = partial(self._both, law.recoverable, bending.recoverable)
        if isinstance(law, HasPotential) and isinstance(bending, HasPotential):
            self.potential = partial(self._both, law.potential, bending.potential)
        if isinstance(law, HasStiffness) and isinstance(bending, HasStiffness):
            self.stiffness = np.zeros((6, 6))
            self.stiffness[:3, :3], self.stiffness[3:, 3:] = thickness * law.stiffness, bending.stiffness
            self.stiffest = self
        elif all(isinstance(part, HasStiffness | HasStiffest) for part in (law, bending)):
            stiffest = (part.stiffest if isinstance(part, HasStiffest) else part for part in (law, bending))
            self.stiffest = OwnBending(next(stiffest), thickness, next(stiffest))
        if isinstance(law, HasHardened) and isinstance(bending, HasStiffness | HasStiffest):
            self.advance = self._advance
            linear = bending.stiffest if isinstance(bending, HasStiffest) else bending
            self.hardened = OwnBending(law.hardened, thickness, linear)

    def _advance(self, strain: Array, state: Array, stress: Array, new: Array) -> float:
        """See `laws.HasAdvance`."""
        own, scratch = self._own, np.empty((len(strain), 3, 3))
        risen = self.law.advance(strain[:, :3], state[:, :own], stress[:, :3], new[:, :own])  # type: ignore[attr-defined]
        self.bending.respond(strain[:, 3:], state[:, own:], (stress[:, 3:], scratch, new[:, own:]))
        stress[:, :3] *= self.thickness
        return float(risen)

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Resultants (n, 6), tangent (n, 6, 6) and new state; see `laws.Law.respond`."""
        own = self._own
        out = out or empty(strain, state)
        resultants, moduli, new = out
        self.law.respond(strain[:, :3], state[:, :own], (resultants[:, :3], moduli[:, :3, :3], new[:, :own]))
        self.bending.respond(strain[:, 3:], state[:, own:], (resultants[:, 3:], moduli[:, 3:, 3:], new[:, own:]))
        _join(resultants, moduli, self.thickness)
        return out

    def _both(self, plane: Energy, bent: Energy, strain: Array, state: Array) -> Array:
        """J/m2 (n,) of both laws."""
        own = self._own
        return np.asarray(self.thickness * plane(strain[:, :3], state[:, :own]) + bent(strain[:, 3:], state[:, own:]))

    def shear_limit(self, least: float) -> float:
        """What limits the transverse shear of a thin shell, Pa: 6 B/h^3, B being the stiffest of warp and weft.

        As isotropic layers of that B have it; the modulus `least` of layers does not matter here.
        """
        law: object = self.bending.stiffest if isinstance(self.bending, HasStiffest) else self.bending
        if isinstance(law, HasStiffness):
            D = law.stiffness
        else:  # as it is at rest
            D = self.bending.respond(np.zeros((1, 3)), self.bending.initial_state[None])[1][0]
        return float(6 * D.diagonal()[:2].max() / self.thickness**3)

    def beyond_calibration(self, strain: Array) -> str | None:
        """One sentence if a strain or a curvature is beyond the range of its law, else None."""
        for law, part in ((self.law, strain[:, :3]), (self.bending, strain[:, 3:])) if len(strain) else ():
            if isinstance(law, HasCalibration) and (said := law.beyond_calibration(part)):
                return said
        return None


_jit = numba.njit(cache=True, error_model="numpy")


@_jit
def _join(resultants, moduli, thickness):
    """Stress and moduli of the plane law over the thickness; no moment by strain, no force by curvature."""
    for i in range(resultants.shape[0]):
        if not np.isfinite(resultants[i].sum()):
            resultants[i] = np.nan  # one bad component spoils the whole point, so that it cannot pass unseen
        for a in range(3):
            resultants[i, a] *= thickness
            for b in range(3):
                moduli[i, a, b] *= thickness
                moduli[i, a, 3 + b] = moduli[i, 3 + a, b] = 0.0
