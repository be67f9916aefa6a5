"""The woven law as the thesis prints it: Box 6-1 and Box 6-2, misprints mended.

For reproducing the thesis. Moduli are taken at the end of the increment, so stress is first order in
the size of the increment, and it jumps with strain where a modulus is switched (on reloading past
the peak, at the reversal of a yarn, at lambda = 1): see `woven` for the law to use otherwise.

Mended: (6.31), (6.32) read S^(n+1) = S^n + C dE; compression is lambda < 1; the derivative of a
modulus is added on virgin loading (lambda >= lambda_max), stands with (dE1 + nu21 dE2) in C11 alone
(C22 likewise), and is also added where the modulus is interpolated (lambda >= 0.999 lambda_max), so
that the tangent is the derivative of the stress. S5 dE5 = 0 counts as loading: else the first
increment of every test would take the unloading modulus.

State of a point: E (3), S (3), the largest E11 and E22 (for lambda_max), E5*, SV peak.
"""

from typing import TYPE_CHECKING

import numpy as np

from . import Array, Poisson, empty, kernels
from .woven import beyond_calibration, ratios

if TYPE_CHECKING:
    from ..fabrics import Fabric


class Printed:
    """Box 6-1 for a fabric, on strains (E11, E22, 2 E12) in warp/weft axes.

    `poisson` and `shear_hysteresis` as in `woven.Woven`. Raises InputError for an unknown choice.
    """

    def __init__(self, fabric: "Fabric", poisson: Poisson = "measured", shear_hysteresis: bool = True) -> None:
        self.fabric = fabric
        self.symmetric = False
        self._nu = ratios(fabric, poisson)
        self._curves = tuple(
            kernels.pack(c.modulus, c.unloading, c.limit, 1.0) for c in (fabric.warp, fabric.weft, fabric.shear)
        )
        self._hysteretic = shear_hysteresis
        self.initial_state = np.zeros(10)

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Stress (n, 3) and tangent (n, 3, 3) in Pa and the new state; see `laws.Law.respond`."""
        out = out or empty(strain, state)
        kernels.printed(strain, state, *out, self._curves, *self._nu, self._hysteretic)
        return out

    def recoverable(self, strain: Array, state: Array) -> Array:
        """Work in J/m3 (n,) that a point of this strain, and the state after it, gives back.

        Each stress is taken off by itself along the unloading modulus.
        """
        half = np.array([0.5 / curve[kernels.UNLOAD] for curve in self._curves])
        return np.asarray(state[:, 3:6] ** 2 @ half)

    def beyond_calibration(self, strain: Array) -> str | None:
        """One sentence if a strain (n, 3) lies beyond the measured range, else None."""
        return beyond_calibration(self.fabric, strain)
