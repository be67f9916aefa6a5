"""Friction, softening and return of shear as data, and what of them cloth cannot have."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial

from fabric_fenicsx.errors import InputError

if TYPE_CHECKING:
    from fabric_fenicsx.fabrics.data import Curve

BELOW = 0.999
"""Largest slope of a limit of the shear stress, as a part of the unloading modulus."""
GF_CM = 0.980665
"""N/m per gf/cm."""
KES_REACH = float(np.radians(8.0))
"""To which KES-F shears."""


@dataclass(frozen=True)
class ShearFriction:
    """How shear comes back and is repeated, see `laws.play`; numbers without a unit are parts.

    friction:    stress (Pa) that fresh cloth bears before it shears, on top of its curve
    kept:        part of it that is left after a large shear; the rest is half gone at 2 E12 = `strain`
    set_in:      friction that shear adds, as a part of the largest loading stress so far
    returned:    part of the curve that is elastic, and given back
    softening:   what a small shear lacks of the first one when repeated; `rejoining` is the slope, over the mean one,
                 with which it comes back to the first

    Raises InputError for numbers outside their ranges, and for more that is returned than softening leaves.
    """

    friction: float = 0.0
    kept: float = 1.0
    strain: float = 0.1
    set_in: float = 0.1
    returned: float = 0.1
    softening: float = 0.0
    rejoining: float = 3.0

    def __post_init__(self) -> None:
        for name, (low, high, remedy) in RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"{name} = {value!r} of shear is not from {low:g} to {high:g}; {remedy}.")
        if self.returned > (1.0 - self.softening) * (1.0 + 1e-12):
            raise InputError(
                f"returned = {self.returned:.6g} of shear is more than softening = {self.softening:g} leaves; give at "
                f"most {1.0 - self.softening:.6g}."
            )

    def describe(self) -> str:
        """One line."""
        return (
            f"friction {self.friction / 1e6:.4g} MPa, of which {self.kept:.3g} is kept (half of the rest at 2 E12 = "
            f"{self.strain:.3g}), set in {self.set_in:.3g}, returned {self.returned:.3g}, softening "
            f"{self.softening:.3g}, rejoining {self.rejoining:.3g}"
        )

    def steepest(self, curve: Curve) -> float:
        """Largest slope (Pa) of T + f(0) - f up to the end of the curve, and so beyond; exact."""
        modulus, fading, m0 = Polynomial(curve.modulus), self.friction * (1.0 - self.kept), self.strain
        # at an end, or where (m0 + g)^3 modulus'(g) = 2 fading m0
        turning = (Polynomial([m0, 1.0]) ** 3 * modulus.deriv() - 2.0 * fading * m0).roots()
        inside = turning.real[(np.abs(turning.imag) < 1e-9) & (turning.real > 0.0) & (turning.real < curve.limit)]
        g = np.array([0.0, curve.limit, *inside])
        return float((modulus(g) + fading * m0 / (m0 + g) ** 2).max())

    def secant(self, curve: Curve) -> float:
        """Largest B(g)/g (Pa); sampled so densely that what is missed is less than `BELOW` leaves."""
        g, fading = np.linspace(0.0, curve.limit, 2001)[1:], self.friction * (1.0 - self.kept)
        inside = (1.0 - self.set_in) * curve.stress(g) / g + fading / (self.strain + g)
        ends = (1.0 - self.set_in) * curve.tangent([0.0, curve.limit]) + [fading / self.strain, 0.0]
        return float(max(*inside, *ends))

    def contradiction(self, curve: Curve) -> str | None:
        """Why no such cloth can be, with the remedy, or None; see `laws.play` for the bounds."""
        top, steepest, secant = curve.unloading, self.steepest(curve), self.secant(curve)
        wanted = steepest + self.softening * secant
        raised = f"raise unloading_MPa by a factor of {1.0001 * wanted / BELOW / top:.5g} or more"
        if steepest > BELOW * top:
            return (
                f"shear with friction loads with a modulus of up to {steepest / 1e6:.6g} MPa (S12 over 2 E12), and "
                f"from {BELOW} of the unloading one, {top / 1e6:.6g} MPa, on a cycle would make energy; {raised}"
            )
        if wanted > BELOW * top:
            return (
                f"shear with softening = {self.softening:g} comes back to its first loading more steeply than it "
                f"unloads, with {top / 1e6:.6g} MPa (S12 over 2 E12), and a cycle would make energy; give softening "
                f"of at most {0.9999 * (BELOW * top - steepest) / secant:.4g}, or {raised}"
            )
        return None


RANGES = {
    "friction": (0.0, 1e12, "give a stress, zero or more"),
    "kept": (0.0, 1.0, "give the part of the friction that is left after a large shear"),
    "strain": (1e-6, 1e3, "give the shear at which half of the friction that goes is gone"),
    "set_in": (0.0, 0.999, "give friction as a part of the largest stress, below 1"),
    "returned": (1e-3, 1.0, "give the part of the curve that is given back, above zero for the cloth to be stable"),
    "softening": (0.0, 0.999, "give what a repeated shear lacks of the first one, below 1"),
    "rejoining": (1.0, 1e3, "give 1, where the loss falls evenly, or more"),
}
NAMES = tuple(field.name for field in fields(ShearFriction))


def of_kes(G: float, hysteresis: float, hysteresis5: float) -> tuple[float, float]:
    """Friction (N/m) and the part returned of a cloth that gives KES-F's G (N/m per degree), 2HG and 2HG5 (N/m).

    The loop is 2HG wide at 0.5 and 2HG5 at 5 degrees. Raises InputError for a sheet that no such cloth has.
    """
    most = 4.5 * G
    if not hysteresis <= hysteresis5 < hysteresis + most:
        said = f"2HG5 = {hysteresis5 / GF_CM:.4g} gf/cm with 2HG = {hysteresis / GF_CM:.4g} and G = {G / GF_CM:.4g}"
        reach = f"from 2HG, {hysteresis / GF_CM:.4g}, to less than 2HG + 4.5 deg G, {(hysteresis + most) / GF_CM:.4g}"
        raise InputError(f"{said} gf/cm/deg is no loop of friction over a straight line, which has one {reach}.")
    friction = (hysteresis - (hysteresis5 - hysteresis) / 9.0) / 2.0
    if friction < 0.0:
        least = hysteresis5 / 10.0 / GF_CM
        raise InputError(
            f"2HG = {hysteresis / GF_CM:.4g} gf/cm is less than a tenth of 2HG5 = {hysteresis5 / GF_CM:.4g}, which a "
            f"loop that widens evenly from no friction on has; give at least {least:.4g}, or a smaller 2HG5."
        )
    return friction, 1.0 - (hysteresis5 - hysteresis) / most


def kes_unloading(G: float, friction: float, returned: float) -> float:
    """Least unloading modulus (N/m per degree) of such a cloth: its loop is open by 0.5, and closed by 5 degrees."""
    return float(max(2.0 * friction + G, (2.0 * friction + (8.0 - 5.0 * returned) * G) / 3.0))
