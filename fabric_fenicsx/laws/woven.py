"""The woven law of Chapter 6 as a continuous function of strain (the default law).

Each yarn family is driven by the strain that uniaxial stress would need,

    e1 = (E11 + nu21 E22) / (1 - nu12 nu21),    e2 = (E22 + nu12 E11) / (1 - nu12 nu21),

so that (6.11) reads dS11 = D1 de1, dS22 = D2 de2. While e1 is at its peak, D1 is the loading modulus
at E11, integrated exactly along the straight increment; below the peak, stress follows the unloading
curve (`kernels.unloading`) down and up again. It is the limit of the thesis's update (Box 6-1, law
`printed`) for small increments wherever both yarns keep loading, and differs from it where that
one jumps: on reloading past the peak, at the reversal of a yarn, and in a slack yarn.

Shear is a curve of one variable, gamma = 2 E12: a virgin branch g(|gamma - gamma*|) leaves every
zero of the stress (6.28), its unloading follows the same kind of curve as a yarn's, and where that
reaches zero, gamma* moves there and the branch of the other sign begins.

State of a point: E11, E22, then peak driving strain, stress and modulus of warp and of weft, then
gamma* and the signed peak of gamma - gamma* (absent without shear hysteresis).
"""

from math import sqrt
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..errors import InputError
from . import Array, Poisson, empty, kernels
from .svk import StVenantKirchhoff

if TYPE_CHECKING:
    from ..fabrics import Fabric

RAMP = 1e-3
"""Strain over which a modulus changes after a reversal: the thesis's 0.999 lambda_max (6.3.1)."""


class Woven:
    """The continuous woven law of a fabric, on strains (E11, E22, 2 E12) in warp/weft axes.

    `poisson` names the pair of Poisson's ratios ("measured" or "lowered", Table 7.4);
    `shear_hysteresis=False` makes shear nonlinear elastic, without any history;
    `ramp` is the strain over which the modulus changes after a reversal.

    `coupling="reciprocal"` replaces nu21 D1 and nu12 D2 by one off-diagonal modulus
    nu sqrt(D1 D2), nu^2 = nu12 nu21, with D1 and D2 taken at the committed state: symmetric and
    positive definite at the start of every increment, first order in the size of the increment.

    Raises InputError for a choice that does not exist.
    """

    def __init__(
        self,
        fabric: "Fabric",
        poisson: Poisson = "measured",
        *,
        shear_hysteresis: bool = True,
        coupling: Literal["measured", "reciprocal"] = "measured",
        ramp: float = RAMP,
    ) -> None:
        nu12, nu21 = ratios(fabric, poisson)
        if coupling not in ("measured", "reciprocal"):
            raise InputError(f"coupling={coupling!r} is neither 'measured' nor 'reciprocal'.")
        if not (0.0 < ramp < np.inf):
            raise InputError(f"ramp={ramp!r} must be a positive strain such as {RAMP}.")
        self.fabric = fabric
        self.symmetric = False
        self.shear_hysteresis = shear_hysteresis
        self.reciprocal = coupling == "reciprocal"
        self._nu, self._measured = (nu12, nu21), (fabric.warp, fabric.weft, fabric.shear)
        self._curves = tuple(
            kernels.pack(c.modulus, c.unloading, c.limit, ramp) for c in (fabric.warp, fabric.weft, fabric.shear)
        )
        d1, d2 = fabric.warp.modulus[0], fabric.weft.modulus[0]
        state = [0.0, 0.0, 0.0, 0.0, d1, 0.0, 0.0, d2]
        state += [0.0, 0.0] if shear_hysteresis or self.reciprocal else []
        state += [0.0, 0.0, sqrt(d2 / d1)] if self.reciprocal else []
        self.initial_state = np.array(state)

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Stress (n, 3) and tangent (n, 3, 3) in Pa and the new state; see `laws.Law.respond`."""
        out = out or empty(strain, state)
        kernels.woven(strain, state, *out, self._curves, *self._nu, self.shear_hysteresis, self.reciprocal)
        return out

    @property
    def stiffest(self) -> StVenantKirchhoff:
        """A linear law as stiff as this one can be within the measured range, while yarns and shear unload."""
        d1, d2, g = (max(c.unloading, *c.tangent(np.linspace(0, c.limit, 50))) for c in self._measured)
        product = self._nu[0] * self._nu[1]
        b = sqrt(product * d1 * d2)
        return StVenantKirchhoff(
            np.array([[d1, b, 0.0], [b, d2, 0.0], [0.0, 0.0, (1.0 - product) * g]]) / (1.0 - product)
        )

    def recoverable(self, strain: Array, state: Array) -> Array:
        """Work in J/m3 (n,) that a point of this strain, and the state after it, gives back.

        Each yarn family is unloaded by itself, under uniaxial stress, and so is shear, until the stress is gone.
        """
        energy = np.empty(len(strain))
        kernels.woven_recoverable(
            strain, state, energy, self._curves, *self._nu, self.shear_hysteresis, self.reciprocal
        )
        return energy

    def beyond_calibration(self, strain: Array) -> str | None:
        """One sentence if a strain (n, 3) lies beyond the measured range, else None."""
        return beyond_calibration(self.fabric, strain)


def ratios(fabric: "Fabric", poisson: Poisson) -> tuple[float, float]:
    """Poisson's ratios of that name, of a fabric that a law can be made of; InputError if it cannot.

    What comes from a file has been checked; a fabric that was made or changed in Python has not.
    """
    if poisson not in fabric.poisson:
        raise InputError(f"poisson={poisson!r} is not one of {', '.join(fabric.poisson)} for {fabric.name}.")
    nu12, nu21 = fabric.poisson[poisson]
    if not (np.isfinite(nu12 + nu21) and nu12 * nu21 < 1.0):
        raise InputError(f"{fabric.name}: Poisson's ratios {nu12!r} and {nu21!r} must have a product below 1.")
    for name, curve in (("warp", fabric.warp), ("weft", fabric.weft), ("shear", fabric.shear)):
        moduli = np.array([*np.atleast_1d(curve.tangent(np.linspace(0, curve.limit, 50))), curve.unloading])
        if not (np.isfinite(moduli).all() and (moduli > 0.0).all() and 0.0 < curve.limit < np.inf):
            raise InputError(
                f"{fabric.name}: the {name} curve has moduli of {moduli.min():.4g} to {moduli.max():.4g} Pa up to a "
                f"strain of {curve.limit:.4g}; all of them must be positive numbers."
            )
    return nu12, nu21


def beyond_calibration(fabric: "Fabric", strain: Array) -> str | None:
    """One sentence that names the largest strain outside a fabric's calibrated range, else None."""
    largest = np.array([strain[:, 0].max(), strain[:, 1].max(), np.abs(strain[:, 2]).max()])
    for name, value, curve in zip(
        ("warp strain E11", "weft strain E22", "shear strain 2 E12"),
        largest,
        (fabric.warp, fabric.weft, fabric.shear),
        strict=True,
    ):
        # what a test reaches in exact arithmetic is not beyond it
        if value > curve.limit * (1 + 1e-9):
            return (
                f"{fabric.name}: {name} = {value:.3f} is beyond the measured {curve.limit:.3f}; "
                "from there on the curve is continued by its tangent."
            )
    return None
