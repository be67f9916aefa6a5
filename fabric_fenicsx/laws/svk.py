"""St. Venant-Kirchhoff: constant stiffness from Green-Lagrange strain to second Piola-Kirchhoff stress."""

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from . import Array, Poisson, empty


class StVenantKirchhoff:
    """S = C E, without history.

    `stiffness` is C, shape (m, m), in Pa, row = stress, column = strain, shear strain as 2 E12. It need
    not be symmetric; its symmetric part has to be positive definite, so that every strain costs work.
    Where it is symmetric, the elastic energy is there as `potential` and as `recoverable`.
    InputError where it is not square, finite and positive definite.
    """

    def __init__(self, stiffness: ArrayLike):
        try:
            C = np.array(stiffness, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError("the stiffness must be a square array of numbers in Pa.") from error
        if C.ndim != 2 or C.shape[0] != C.shape[1] or C.size == 0:
            raise InputError(f"the stiffness must be a square array, but its shape is {C.shape}.")
        if not np.isfinite(C).all():
            raise InputError("the stiffness has an entry that is not finite; give every entry in Pa.")
        # Overflow-safe: only the sign of the smallest eigenvalue matters.
        unit = C / (np.abs(C).max() or 1.0)
        if np.linalg.eigvalsh((unit + unit.T) / 2)[0] <= 0:
            raise InputError(
                "the symmetric part of the stiffness is not positive definite, so some strain would give "
                "work back; check the moduli and Poisson's ratios."
            )
        C.flags.writeable = False
        self.stiffness: Array = C
        self.symmetric: bool = bool(np.allclose(C, C.T, rtol=0, atol=1e-14 * np.abs(C).max()))
        self.initial_state: Array = np.empty(0)
        if self.symmetric:
            self.potential = self._energy
            self.recoverable = self._energy

    @classmethod
    def isotropic(cls, E: float, nu: float) -> Self:
        """Plane stress, for (E11, E22, 2 E12): Young's modulus E in Pa, Poisson's ratio nu in (-1, 1)."""
        return cls.orthotropic(E, E, nu, E / (2 * (1 + nu)) if nu != -1 else np.inf)

    @classmethod
    def orthotropic(cls, E1: float, E2: float, nu12: float, G12: float) -> Self:
        """Plane stress, for (E11, E22, 2 E12): moduli in Pa, nu12 = contraction along 2 per stretch along 1.

        The other ratio follows from reciprocity, nu21 = nu12 E2/E1. InputError where a modulus is not
        positive or nu12 nu21 >= 1.
        """
        _require_positive(E1=E1, E2=E2, G12=G12)
        return cls._coupled(E1, E2, nu12 * E2, nu12 * nu12 * E2 / E1, G12)

    @classmethod
    def from_fabric(cls, fabric: Any, poisson: Poisson = "measured") -> Self:
        """The unstrained fabric: its moduli at zero strain, coupled so that C is symmetric.

            C = 1/(1 - nu12 nu21) [[D1, b, 0], [b, D2, 0], [0, 0, (1 - nu12 nu21) G12]],
            b = sqrt(nu12 nu21 D1 D2)

        D1, D2 and G12 are `fabric.warp.modulus[0]`, `fabric.weft.modulus[0]`, `fabric.shear.modulus[0]` in Pa
        (the curves of Tables 7.1 and 7.3 at zero strain), and (nu12, nu21) is `fabric.poisson[poisson]`.
        The measured ratios are not reciprocal (nu12 D2 differs from nu21 D1), and the thesis does not state
        which stiffness its St. Venant-Kirchhoff comparisons used; the geometric mean above is this package's
        choice: it keeps the product nu12 nu21, and so the biaxial stiffening, and is positive definite
        whenever that product is below 1. InputError for an unknown key or constants that cannot be used.
        """
        if poisson not in fabric.poisson:
            raise InputError(f"unknown Poisson's ratios {poisson!r}; choose one of {', '.join(fabric.poisson)}.")
        nu12, nu21 = fabric.poisson[poisson]
        D1, D2, G12 = (float(curve.modulus[0]) for curve in (fabric.warp, fabric.weft, fabric.shear))
        _require_positive(D1=D1, D2=D2, G12=G12)
        if not nu12 * nu21 >= 0:
            raise InputError(f"nu12 = {nu12:g} and nu21 = {nu21:g} differ in sign and have no geometric mean.")
        return cls._coupled(D1, D2, np.copysign(np.sqrt(nu12 * nu21 * D1 * D2), nu12), nu12 * nu21, G12)

    @classmethod
    def _coupled(cls, D1: float, D2: float, b: float, product: float, G12: float) -> Self:
        """C from moduli, coupling term b (all in Pa) and the product nu12 nu21."""
        if not product < 1:
            raise InputError(f"nu12 nu21 = {product:g} is not below 1; the biaxial stiffness would not be positive.")
        return cls(np.array([[D1, b, 0], [b, D2, 0], [0, 0, (1 - product) * G12]]) / (1 - product))

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Stress, tangent (the stiffness) and state (empty) of n points; see `Law.respond`."""
        stress, tangent, new_state = out or empty(strain, state)
        with np.errstate(invalid="ignore", over="ignore"):  # NaN and inf come in legitimately
            np.matmul(strain, self.stiffness.T, out=stress)
        # An infinite strain would give some components a finite or infinite stress.
        stress[~np.isfinite(strain).all(axis=1)] = np.nan
        tangent[...] = self.stiffness
        new_state[...] = state
        return stress, tangent, new_state

    def _energy(self, strain: Array, state: Array) -> Array:
        """Elastic energy E . C E / 2 in J/m3 (n,); a member, as `potential` and `recoverable`, where C is symmetric."""
        return np.asarray(0.5 * np.einsum("na,ab,nb->n", strain, self.stiffness, strain))


def _require_positive(**moduli: float) -> None:
    for name, value in moduli.items():
        if not 0 < value < np.inf:
            raise InputError(f"{name} = {value:g} Pa is not a positive, finite modulus.")
