"""A woven law with a potential: both measured curves, both Poisson's ratios, and no energy out of nothing.

Ratios that are not reciprocal, nu12 D2 != nu21 D1, exclude a potential that is smooth at zero strain, but not one
whose Hessian differs from one sector of strains to the next. Here it is the sum of one-dimensional dissipative
elements, each with a direction d in the plane of E = (E11, E22) and a stress that depends on e = d . E alone,

    S = sum_m d_m sigma_m(e_m),    C = sum_m D_m d_m d_m',

                 d           sigma on first loading
    warp         (1, nu21)   wA f1(e/q),                 wA = b1/(nu21 + b1),  q = 1 - nu12 nu21
    warp tension (1, -b1)    wC f1(e/(1 + b1 nu12)),     wC = nu21/(nu21 + b1),  carries tension only
    weft, weft tension: 1 and 2 exchanged; shear: the element of `woven`, of gamma = 2 E12, or that of `play` where
    the fabric tells of friction

with f1, f2 the measured curves. On the ray of uniaxial warp stress, E = E1 (1, -nu12), both warp elements follow f1,
S = (f1(E1), 0), while weft has e = 0 and weft tension is slack: curve and ratio are exact for any b1, b2 > 0. What
b1 sets is how stiff the stretched fabric is across: tension of the warp adds

    k1(E1) = D1(E1) nu21 wA (nu21/q + b1/(1 + b1 nu12))

to the stiffness across it. Its mean over the measured range, as a part of D2(0)/q, is the fabric's `transverse`.

The modulus of a tension element starts at zero (it has none when slack) and joins its curve at e/(1 + b1 nu12) =
1e-3; until there the uniaxial stress lies below the measured one, by at most wC 0.15e-3 D1(0).

Below its peak an element unloads along a curve that depends on the peak alone (`elements`). That makes energy of
nothing only if a rise of the peak could raise what is given back by more than the work done; it cannot where

    D <= U on first loading,  |D'| <= r, the rate at which the modulus changes after a reversal,  D(0) = slack modulus.

The first is asked of the fabric, the second of the ramp, which is narrowed for a curve that is too steep, the third
is built in. The tangent is symmetric and positive definite, since warp and weft alone have independent directions and
positive moduli. Splitting a straight increment changes nothing, as an element remembers its peak only.

State of a point: peak strain, stress and modulus there of warp, warp tension, weft, weft tension; then gamma* and the
signed peak of gamma - gamma*, or p and m of `play` (absent without shear hysteresis).
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial

from ..errors import InputError
from . import Array, Poisson, elements, empty, play
from .svk import StVenantKirchhoff
from .woven import RAMP, beyond_calibration, ratios

if TYPE_CHECKING:
    from ..fabrics import Curve, Fabric

START = 1e-3
"""Uniaxial strain at which the tension elements have joined their curves."""
NONE = 1e-9
"""A Poisson's ratio below this counts as none."""
SHEAR = 12
"""Column of the state from which shear begins."""
ALONE = np.ones((1, 1))
"""Of a law that has no layers."""
LARGEST = 5.0
"""Largest b of a direction (1, -b): from there on more of it changes little."""


class Potential:
    """The woven law with a potential of a fabric, on strains (E11, E22, 2 E12) in warp/weft axes.

    `poisson` names the pair of Poisson's ratios ("measured" or "lowered", Table 7.4);
    `shear_hysteresis=False` makes shear nonlinear elastic, without any history or friction;
    `ramp` is the uniaxial strain over which the modulus changes after a reversal, at most;
    `transverse` (warp, weft) is in place of the fabric's; `most_transverse` is what it may be.

    Raises InputError for a choice that does not exist, and for a fabric of which no such law can be made.
    """

    def __init__(
        self,
        fabric: "Fabric",
        poisson: Poisson = "measured",
        shear_hysteresis: bool = True,
        *,
        ramp: float = RAMP,
        transverse: tuple[float, float] | None = None,
    ) -> None:
        nu12, nu21 = ratios(fabric, poisson)
        if min(nu12, nu21) < 0.0:
            raise InputError(
                f"{fabric.name}: Poisson's ratios {nu12:g} and {nu21:g} must not be negative; tension elements need "
                "yarns that contract as the others stretch."
            )
        if not (0.0 < ramp < np.inf):
            raise InputError(f"ramp={ramp!r} must be a positive strain such as {RAMP}.")
        self.fabric = fabric
        self.symmetric = True
        self.shear_hysteresis = shear_hysteresis
        self.transverse = fabric.transverse if transverse is None else transverse
        assumed = transverse is None and fabric.transverse_source == "assumed"
        q = 1.0 - nu12 * nu21
        warp, weft, moduli = fabric.warp, fabric.weft, (fabric.warp.modulus[0], fabric.weft.modulus[0])
        self.most_transverse = _most(warp, nu12, nu21) * q / moduli[1], _most(weft, nu21, nu12) * q / moduli[0]
        b1 = self._direction("warp", warp, nu12, nu21, self.transverse[0] * moduli[1] / q, assumed)
        b2 = self._direction("weft", weft, nu21, nu12, self.transverse[1] * moduli[0] / q, assumed)
        self._directions = nu12, nu21, b1, b2
        self._elements = (
            self._element("warp", warp, b1 / (nu21 + b1), q, ramp),
            self._element("warp tension", warp, nu21 / (nu21 + b1), 1.0 + b1 * nu12, ramp, tension=True),
            self._element("weft", weft, b2 / (nu12 + b2), q, ramp),
            self._element("weft tension", weft, nu12 / (nu12 + b2), 1.0 + b2 * nu21, ramp, tension=True),
            self._element("shear", fabric.shear, 1.0, 1.0, ramp),
        )
        friction = fabric.shear_friction if shear_hysteresis else None
        self._play = None if friction is None else play.pack(fabric.name, fabric.shear, friction)
        self._shearing = elements.ELSEWHERE if self._play else int(shear_hysteresis)
        state = [x for element in self._elements[:4] for x in (0.0, 0.0, element[elements.SLACK])]
        self.initial_state = np.array(state + [0.0, 0.0] * shear_hysteresis)

    def _direction(self, name: str, curve: "Curve", nu: float, nu_back: float, wanted: float, assumed: bool) -> float:
        """The b of a family that contracts by nu, and by nu_back as the other stretches: mean k as wanted, Pa."""
        if not 0.0 < wanted < np.inf:
            raise InputError(f"{self.fabric.name}: transverse = {self.transverse!r} must be two positive numbers.")
        if nu_back < NONE:
            return 1.0  # the other yarns pull nothing in: the tension element has no weight, whatever its direction
        # b (A + b/(1 + b nu)) = T (nu_back + b) is a quadratic in b with one positive root while T < A + 1/nu
        own, A = float(curve.stress(curve.limit)) / curve.limit * nu_back, nu_back / (1.0 - nu * nu_back)
        T = wanted / own
        a, half, c = 1.0 + (A - T) * nu, 0.5 * (A - T * (1.0 + nu * nu_back)), T * nu_back
        b = (np.sqrt(half * half + a * c) - half) / a if a > 0.0 else np.inf
        if b <= LARGEST:
            return float(b)
        if assumed:
            return LARGEST
        value, most = (pair[name == "weft"] for pair in (self.transverse, self.most_transverse))
        raise InputError(
            f"{self.fabric.name}: transverse of {value:.4g} along the {name} is more than its curve and Poisson's "
            f"ratios allow; give at most {most:.4g}."
        )

    def _element(
        self, name: str, curve: "Curve", weight: float, scale: float, ramp: float, tension: bool = False
    ) -> tuple[float, ...]:
        """An element of weight x f(e/scale); InputError where it would make energy."""
        if weight < NONE:
            return elements.pack((0.0,) * 4, 0.0, curve.limit, 1.0, 0.0, 0.0)
        start, pieces = _pieces(curve, tension)
        largest = max(_largest(piece, *ends) for piece, *ends in pieces)
        steepest = max(_largest(piece.deriv(), *ends) for piece, *ends in pieces)
        if largest > curve.unloading * (1.0 + 1e-9):
            raise InputError(
                f"{self.fabric.name}: the {name} element has a loading modulus of {largest / 1e6:.6g} MPa, above that "
                f"of unloading, {curve.unloading / 1e6:.6g} MPa, so that a cycle would make energy; give unloading_MPa "
                f"of at least {largest * (1 + 1e-5) / 1e6:.6g} MPa, or take another law."
            )
        # a little more than the steepest, for round-off
        rate = max((curve.unloading - curve.modulus[0]) / ramp, 1.001 * steepest, 1e-6 * curve.modulus[0] / ramp)
        return elements.pack(
            [weight * c / scale ** (k + 1) for k, c in enumerate((*curve.modulus, 0.0, 0.0, 0.0)[:4])],
            weight * curve.unloading / scale,
            curve.limit * scale,
            weight * rate / scale**2,
            0.0 if tension else weight * curve.modulus[0] / scale,
            start * scale,
        )

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Stress (n, 3) and tangent (n, 3, 3) in Pa and the new state; see `laws.Law.respond`."""
        out = out or empty(strain, state)
        elements.respond(strain, state, *out, self._elements, *self._directions, self._shearing)
        if self._play:
            play.respond(strain, state, *out, self._play, SHEAR)
        return out

    def advance(
        self,
        strain: Array,
        state: Array,
        stress: Array,
        new: Array,
        powers: Array = ALONE,
        moments: Array = ALONE,
    ) -> float:
        """See `laws.HasAdvance`, for stress and new state; or all layers of a `section.Section` at once.

        powers (layers, parts), of z at each layer, by which parts of the strain (n, 3 parts) go; moments (parts,
        layers), what stress is multiplied by to be a part of the resultants; states (n layers, state variables).
        """
        own = strain, state, stress, new, powers, moments
        risen = elements.advance(*own, self._elements, *self._directions, self._shearing)
        if self._play:
            play.advance(*own, self._play, SHEAR)
        return float(risen)

    @property
    def hardened(self) -> "Hardened":
        """See `laws.HasHardened`: all elements unload at once, and none has seen more than its peak."""
        return Hardened(self)

    def potential(self, strain: Array, state: Array) -> Array:
        """Incremental potential in J/m3 (n,): its gradient by strain is the stress; see `laws.HasPotential`.

        It is counted from the unloaded elements.
        """
        energy = np.empty(len(strain))
        elements.potential(strain, state, energy, self._elements, *self._directions, self._shearing)
        if self._play:
            play.add_potential(strain, state, energy, self._play, SHEAR)
        return energy

    def recoverable(self, strain: Array, state: Array) -> Array:
        """Work in J/m3 (n,) that a point of this strain, and the state after it, gives back.

        Each element is unloaded by itself; shear with friction counts what is stored, of which friction that is left
        keeps a part back. No peak is passed after the step, so that the potential is just that.
        """
        return self.potential(strain, state)

    @property
    def stiffest(self) -> StVenantKirchhoff:
        """A linear law that is stiffer than any tangent of this one, with all elements unloading at once."""
        nu12, nu21, b1, b2 = self._directions
        directions = np.array([[1, nu21, 0], [1, -b1, 0], [nu12, 1, 0], [-b2, 1, 0], [0, 0, 1]])
        moduli = np.array([element[elements.UNLOAD] for element in self._elements])
        return StVenantKirchhoff(directions.T * moduli @ directions)

    def beyond_calibration(self, strain: Array) -> str | None:
        """One sentence if a strain (n, 3) lies beyond the measured range, else None."""
        return beyond_calibration(self.fabric, strain)


class Hardened:
    """A law S = C E whose C depends on the state, that of a `Potential`, and stays; see `laws.HasHardened`."""

    symmetric = True

    def __init__(self, law: Potential) -> None:
        self.initial_state, self._elements, self._directions = law.initial_state, law._elements, law._directions

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """See `laws.Law.respond`."""
        out = stress, tangent, new = out or empty(strain, state)
        elements.hardened(strain, state, stress, tangent, self._elements, *self._directions)
        new[:] = state
        return out


def least_unloading(curve: "Curve") -> float:
    """Least unloading modulus (Pa) with which warp or weft of this curve makes no energy, tension elements included."""
    return max(_largest(piece, *ends) for tension in (False, True) for piece, *ends in _pieces(curve, tension)[1])


def _pieces(curve: "Curve", tension: bool) -> tuple[float, list[tuple[Polynomial, float, float]]]:
    """Strain to which the modulus starts smoothly, and its polynomials, each from one strain to another."""
    polynomial = Polynomial(curve.modulus)
    start = min(START, 0.5 * curve.limit) if tension else 0.0
    pieces = [(polynomial, start, curve.limit)]
    if tension:  # see `elements.loading`
        joining = Polynomial([1.0, -1.0 / start]) * Polynomial([1.0, -3.0 / start])
        pieces.append((polynomial - polynomial(0.0) * joining, 0.0, start))
    return start, pieces


def _most(curve: "Curve", nu: float, nu_back: float) -> float:
    """Largest mean stiffness (Pa) that tension along a curve adds across it, which that of the largest b is."""
    if nu_back < NONE:
        return float("inf")
    A = nu_back / (1.0 - nu * nu_back) + LARGEST / (1.0 + LARGEST * nu)
    return float(curve.stress(curve.limit)) / curve.limit * nu_back * LARGEST / (nu_back + LARGEST) * A


def _largest(polynomial: Polynomial, low: float, high: float) -> float:
    """Largest absolute value from low to high, exactly: at an end or a turning point."""
    turning = polynomial.deriv().roots() if polynomial.degree() > 0 else np.empty(0)
    inside = turning.real[(np.abs(turning.imag) < 1e-9) & (turning.real > low) & (turning.real < high)]
    return float(np.abs(polynomial(np.array([low, high, *inside]))).max())
