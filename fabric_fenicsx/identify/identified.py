"""What the tests of a fabric tell: its curves, ratios and friction, each with its data, and how sure they are."""

from dataclasses import dataclass, field

import numpy as np

from .. import fabrics
from ..fabrics import ShearFriction
from ..laws import Array
from ..laws.potential import least_unloading
from . import listing
from .bending import fit as bending_fit
from .files import records
from .shear import cycles
from .tensile import markers
from .tensile.curves import Estimate, Loading, Readings
from .tensile.strips import BiaxialTest, StripTest

WAYS = ("warp", "weft", "shear")
POOR = 0.1  # root mean square of a fit over the peak stress from which on a curve is none of a fabric
UNSURE = (
    0.3  # standard error over the value of an unloading modulus, and scatter of a ratio from patch to patch, likewise
)
NOT_TESTED = "compression, bending, tension in both directions at once, the rate, and strains beyond the ranges"


@dataclass(frozen=True)
class Curve:
    """One curve with its data; of the shear, strain is E12 and stress S12."""

    loading: Loading
    unloading: Estimate | None  # Pa; None where no record comes back
    readings: list[Readings]
    ways_back: list[tuple[Array, Array]]  # strain and stress (Pa) from each peak on
    how: str = "measured"
    simulated: tuple[Array, Array] | None = None  # axial strain and stress (Pa) of the strip that was fitted
    friction: float = 0.0  # Pa, on top of the loading


@dataclass(frozen=True)
class Compared:
    """A test beside what the fabric does in it: stress (Pa) over strain of each specimen, and of the law."""

    name: str
    readings: list[Readings]
    law: tuple[Array, Array]
    used: bool  # False: held out, so that it was predicted
    how: str  # the law was asked

    @property
    def misses(self) -> tuple[float, float]:
        """Root mean square of law less reading, and mean of that over the last tenth, over the largest stress."""
        parts = [np.interp(one.strain, *self.law) - one.stress for one in self.readings]
        last = [
            miss[one.strain > 0.9 * one.strain.max()].mean() for miss, one in zip(parts, self.readings, strict=True)
        ]
        top = float(np.mean([np.sort(one.stress)[-max(1, len(one.stress) // 20) :].mean() for one in self.readings]))
        return float(np.sqrt(np.mean([np.mean(miss**2) for miss in parts]))) / top, float(np.mean(last)) / top

    def __str__(self) -> str:
        rms, end = (100 * miss for miss in self.misses)
        how = f"{'used' if self.used else 'held out, predicted'}, {self.how}"
        return f"{self.name} ({how}): misfit (rms) {rms:.2g} %, at the end {end:+.2g} % of the peak stress"


@dataclass(frozen=True)
class Identified:
    """What the tests of a fabric tell."""

    tests: listing.Tests
    curves: dict[str, Curve]  # "warp", "weft", "shear", as far as known
    poisson: dict[str, Estimate]  # "nu12", "nu21", as far as measured
    contractions: dict[str, list[markers.Contraction]]
    bias: Curve | None  # axial stress over axial strain of the bias test
    bias_records: list[records.Record]
    displacement: dict[str, float]  # m
    yarn_stretch: float | None  # largest, of the marked yarns
    notes: list[str] = field(default_factory=list)
    tested: list[records.Record] = field(default_factory=list)  # all records of force
    bending: bending_fit.IdentifiedBending | None = None
    strips: tuple[StripTest, ...] = ()
    biaxial: tuple[BiaxialTest, ...] = ()
    transverse: dict[str, Estimate] | None = None  # "warp", "weft"; None: not fitted
    friction: ShearFriction | None = None
    cycled: cycles.Cycles | None = None  # what it was found from, if from cycles
    compared: tuple[Compared, ...] = ()

    @property
    def kilby(self) -> float | None:
        """Shear modulus (Pa) by (3.4), with nu12/E1 + nu21/E2, from initial moduli; None if one is not known."""
        if (
            self.bias is None
            or not {"warp", "weft"} <= self.curves.keys()
            or not {"nu12", "nu21"} <= self.poisson.keys()
        ):
            return None
        E1, E2, E45 = (
            fit.modulus[0] for fit in (self.curves["warp"].loading, self.curves["weft"].loading, self.bias.loading)
        )
        nu12, nu21 = (self.poisson[key].value for key in ("nu12", "nu21"))
        compliance = 4 / E45 - 1 / E1 - 1 / E2 + nu12 / E1 + nu21 / E2
        return 1 / compliance if compliance > 0 else None

    @property
    def undetermined(self) -> list[str]:
        """What the data do not tell, in words."""
        out = []
        for way in WAYS:
            if way not in self.curves:
                out.append(
                    f"{way} curve: " + ("no photographs of the yarns" if way == "shear" and self.bias else "no test")
                )
                continue
            curve = self.curves[way]
            if curve.unloading is None:
                given = f"{way}_unloading_MPa" in self.tests.assumed
                instead = "assumed" if given else "the least possible is taken"
                out.append(f"{way} unloading: no record comes back; {instead}")
            c0, error = curve.loading.modulus[0], curve.loading.errors[0]
            if error > 0.5 * c0 or curve.loading.held:
                out.append(
                    f"{way} initial modulus: {c0 / 1e6:.3g} ± {error / 1e6:.2g} MPa"
                    + (", held positive" * curve.loading.held)
                )
        for key in ("nu12", "nu21"):
            if key not in self.poisson:
                out.append(f"{key}: no dots" + (", assumed" if key in self.tests.assumed else ""))
        for way, number in (self.transverse or {}).items():
            if not number.error < UNSURE * number.value:
                out.append(f"transverse along {way}: {number}, hardly told by these tests; a biaxial record would tell")
        out += self.bending.undetermined if self.bending else []
        not_tested = NOT_TESTED.replace("bending, ", "") if self.bending else NOT_TESTED
        not_tested = not_tested.replace("tension in both directions at once, ", "") if self.biaxial else not_tested
        return [*out, f"not tested: {not_tested}"]

    @property
    def fits(self) -> list[str]:
        """How well each curve meets its data, in words."""
        known = self.curves | ({"bias": self.bias} if self.bias else {})
        out = [
            f"{way} curve: {curve.how}, to a strain of {curve.loading.limit:.3g}; "
            f"fit error (rms) {100 * curve.loading.residual:.2g} % of the peak stress"
            for way, curve in known.items()
        ]
        for way, number in (self.transverse or {}).items():
            out.append(f"transverse along {way}: {number}, of the stiffness at rest")
        out += [f"shear: {self.friction.describe()}"] if self.friction else []
        out += [str(one) for one in self.compared]
        return out + (self.bending.fits if self.bending else [])

    @property
    def doubts(self) -> list[str]:
        """What the records tell so badly that a fabric of it would be wrong, in words."""
        known = self.curves | ({"bias": self.bias} if self.bias else {})
        out = [
            f"{way} curve: fit error (rms) {100 * curve.loading.residual:.2g} % of the peak stress"
            for way, curve in known.items()
            if not curve.loading.residual < POOR
        ]
        out += [word for record in self.tested for word in record.doubts]
        for way, curve in self.curves.items():
            if curve.unloading and not abs(curve.unloading.error) < UNSURE * abs(curve.unloading.value):
                value, error = curve.unloading.value / 1e6, curve.unloading.error / 1e6
                out.append(f"{way} unloading: {value:.4g} ± {error:.2g} MPa")
        for key, several in self.contractions.items():
            worst = max(several, key=lambda one: np.nan_to_num(one.patches))
            if worst.patches > UNSURE * max(abs(worst.ratio), 1.0):
                out.append(f"{key}: {worst.ratio:.4g}, from patch to patch of a strip ± {worst.patches:.2g}")
        return out

    def unloading(self, way: str) -> float:
        """Unloading modulus (Pa) for the fabric: measured, else assumed, but nowhere less than the loading modulus.

        Where it is neither, the least of which both laws can be made.
        """
        loading, measured = self.curves[way].loading, self.curves[way].unloading
        known = measured.value if measured else 1e6 * self.tests.assumed.get(f"{way}_unloading_MPa", 0.0)
        if not known and way != "shear":
            return least_unloading(fabrics.Curve(loading.modulus, 0.0, loading.limit))
        return max(known, float(loading.tangent(np.linspace(0, loading.limit, 1001)).max()))

    def ratio(self, key: str) -> float:
        """Poisson's ratio for the fabric: measured, else assumed; a negative one within two errors of zero is zero."""
        if key not in self.poisson:
            return self.tests.assumed[key]
        value, error = self.poisson[key].value, self.poisson[key].error
        return 0.0 if -2 * error < value < 0 else value
