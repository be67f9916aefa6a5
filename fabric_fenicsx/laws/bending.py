"""Bending of its own: moments from curvatures, with friction, whatever the plane law and the thickness.

Curvatures K = (K11, K22, 2 K12) in 1/m, as `kinematics` has them, moments M = (M11, M22, M12) in N (N m per m of
width), conjugate to them. For a = warp, weft, twist

    M_a = m_a(K_a) + [B12 K_b where a and b are warp and weft] + sum_j f_aj,
    m_a = B K + B2 K|K|, along its tangent once that has changed by 90 %; B and B2 may differ for K < 0 (the back),
    f_aj = b_aj (K_a - s_aj), |f_aj| <= y_aj

The f are elastic-ideally plastic elements in parallel (Prandtl, Ishlinskii), whose yields sum up to HB, half the
width 2HB of the loop of Figure 2-9; s, the curvature at which an element is slack, moves to K -+ y/b where f would pass
y. Their first loading follows HB (1 - exp(-K/spread)) by three chords. Rate does not matter. With

    stored     = sum_a int m_a dK + B12 K11 K22 + sum f^2/(2 b),   dissipated = sum y |ds| >= 0

no path of curvatures makes energy, whatever the parameters. From one committed state M is the gradient of
W = stored + dissipated, so that the tangent is symmetric; it is positive definite if B12^2 < min m1' min m2'.

State of a point: the three s of warp, of weft and of twist; none without friction.
"""

from typing import TYPE_CHECKING, Self

import numba
import numpy as np

from ..fabrics import BendingCurves
from . import Array, empty
from .svk import StVenantKirchhoff

if TYPE_CHECKING:
    from ..fabrics import Fabric

CHORDS = ((0.6, 0.47), (1.6, 0.83), (10 / 3, 1.0))
"""First loading of the friction: curvature over the spread, and the part of HB that is reached there.

Within 0.04 of 1 - exp(-x). All of it is reached after 3.3 spreads, so that with a spread of 15 1/m a loop between
-+250 1/m, as KES drives it, has turned round before the stretch from 150 to 50 1/m on which B is read.
"""


class Bending:
    """The law of the three curvatures of a sheet, see `laws.Law`; in it stress is moment (N), tangent in N m.

    curves: see `fabrics.BendingCurves`.
    """

    symmetric = True

    def __init__(self, curves: BendingCurves) -> None:
        self.curves = curves
        faces = (curves.warp, curves.weft, curves.twist)
        backs = (*(curves.back or faces[:2]), curves.twist)
        pairs = list(zip(faces, backs, strict=True))
        self._elastic = np.array([[(c.B, c.softening, c.limit) for c in pair] for pair in pairs])
        self._steepest = np.array([max(c.range[1] for c in pair) for pair in pairs])
        self._limits = self._elastic[:, :, 2]
        self._friction = np.array([_elements(c.hysteresis / 2, curves.friction_per_m) for c in faces])
        if not self._friction.any():
            self._friction = np.empty((3, 0, 2))
        self.initial_state = np.zeros(self._friction[:, :, 0].size)
        if not self.initial_state.size and all(face == back and not face.softening for face, back in pairs):
            self.stiffness = _coupled(self._elastic[:, 0, 0], curves.coupling)

    @classmethod
    def from_fabric(cls, fabric: "Fabric") -> Self:
        """As measured, or where it was not, as assumed by `fabrics.estimated_bending`."""
        return cls(fabric.bending_or_estimate())

    def __repr__(self) -> str:
        return f"Bending({self.curves})"

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Moments (n, 3) in N, tangent (n, 3, 3) in N m and the new state; see `laws.Law.respond`."""
        out = out or empty(strain, state)
        bend(strain, state, *out, self._elastic, self.curves.coupling, self._friction)
        return out

    def recoverable(self, strain: Array, state: Array) -> Array:
        """Stored energy in J/m2 (n,) of curvatures and the state after them: no element is beyond its yield then."""
        return self.potential(strain, state)

    def potential(self, strain: Array, state: Array) -> Array:
        """W in J/m2 (n,), whose gradient by the curvatures, the strain here, is the moment; see `laws.HasPotential`."""
        energy = np.empty(len(strain))
        bending_potential(strain, state, energy, self._elastic, self.curves.coupling, self._friction)
        return energy

    @property
    def stiffest(self) -> StVenantKirchhoff:
        """A linear law as stiff as this one can be: the steepest part of each curve, and all of its friction."""
        sticking = self._friction[:, :, 0].sum(axis=1) if self.initial_state.size else np.zeros(3)
        return StVenantKirchhoff(_coupled(self._steepest + sticking, self.curves.coupling))

    def beyond_calibration(self, strain: Array) -> str | None:
        """One sentence if a curvature (n, 3) is beyond the one from which its curve goes on along its tangent."""
        for name, K, limits in zip(("warp K11", "weft K22", "twist 2 K12"), strain.T, self._limits, strict=True):
            for side, size, limit in zip(
                ("", " of the back"), (K.max(initial=0.0), -K.min(initial=0.0)), limits, strict=True
            ):
                if size > limit * (1 + 1e-9):
                    return (
                        f"the curvature of {name}{side} is {size:.3g} 1/m, beyond the {limit:.3g} 1/m where its B has "
                        "changed by 90 %; from there on the moment is continued by its tangent."
                    )
        return None


def _elements(yield_moment: float, spread: float) -> list[tuple[float, float]]:
    """Stiffness (N m) and yield (N) of the three elements whose first loading has the corners of `CHORDS`."""
    K, M = (np.array(column) for column in zip((0.0, 0.0), *CHORDS, strict=True))
    slopes = np.append(np.diff(M) / np.diff(K), 0.0) * yield_moment / spread
    stiffness = -np.diff(slopes)
    return list(zip(stiffness, stiffness * K[1:] * spread, strict=True))


def _coupled(B: Array, coupling: float) -> Array:
    C = np.diag(np.array(B, dtype=np.float64))
    C[0, 1] = C[1, 0] = coupling
    return C


_jit = numba.njit(cache=True, error_model="numpy")
_inlined = numba.njit(forceinline=True, error_model="numpy")


@_inlined
def _curve(elastic, a, K):
    """Moment without friction in direction a, and its tangent."""
    side = 0 if K >= 0.0 else 1
    B, B2 = elastic[a, side, 0], elastic[a, side, 1]
    size = abs(K)
    x = min(size, elastic[a, side, 2])
    slope = B + 2.0 * B2 * x
    m = x * (B + B2 * x) + slope * (size - x)
    return (m if K >= 0.0 else -m), slope


@_jit
def bend(curvature, state, moment, tangent, new, elastic, coupling, friction):
    """The law of `Bending`; arrays as in `Law.respond`, elastic (3, face and back, 3), friction (3, elements, 2)."""
    elements = friction.shape[1]
    for i in range(curvature.shape[0]):
        for a in range(3):
            K = curvature[i, a]
            M, slope = _curve(elastic, a, K)
            for j in range(elements):
                b, y, at = friction[a, j, 0], friction[a, j, 1], a * elements + j
                slack = state[i, at]
                f = b * (K - slack)
                if f > y:
                    f, slack = y, K - y / b
                elif f < -y:
                    f, slack = -y, K + y / b
                else:
                    slope += b
                M += f
                new[i, at] = slack
            moment[i, a] = M
            tangent[i, a, 0] = tangent[i, a, 1] = tangent[i, a, 2] = 0.0
            tangent[i, a, a] = slope
        K1, K2 = curvature[i, 0], curvature[i, 1]
        moment[i, 0] += coupling * K2
        moment[i, 1] += coupling * K1
        tangent[i, 0, 1] = tangent[i, 1, 0] = coupling
        if not np.isfinite(K1 + K2 + curvature[i, 2]):
            moment[i, 0] = moment[i, 1] = moment[i, 2] = np.nan


@_jit
def bending_potential(curvature, state, energy, elastic, coupling, friction):
    """Of `Bending.potential`."""
    elements = friction.shape[1]
    for i in range(curvature.shape[0]):
        total = coupling * curvature[i, 0] * curvature[i, 1]
        for a in range(3):
            K = curvature[i, a]
            side = 0 if K >= 0.0 else 1
            B, B2 = elastic[a, side, 0], elastic[a, side, 1]
            x = min(abs(K), elastic[a, side, 2])
            over = abs(K) - x
            total += x * x * (0.5 * B + B2 * x / 3.0)
            total += over * (x * (B + B2 * x) + 0.5 * over * (B + 2.0 * B2 * x))
            for j in range(elements):
                b, y = friction[a, j, 0], friction[a, j, 1]
                bent = abs(K - state[i, a * elements + j])
                if b * bent <= y:
                    total += 0.5 * b * bent * bent
                else:
                    total += y * bent - 0.5 * y * y / b
        energy[i] = total
