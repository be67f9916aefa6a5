"""From the records of a fabric's tests to its curves and Poisson's ratios."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError
from ..laws import Array
from . import bending_fit, branches, curves, listing, markers, origin, picture_frame, records, sheets
from .curves import Estimate, Loading, Readings

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
    simulated: tuple[Array, Array] | None = (
        None  # axial strain and stress (Pa) of the strip that was fitted to the test
    )


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
                instead = "assumed" if given else "the least possible, its largest loading modulus, is taken"
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
        out += self.bending.undetermined if self.bending else []
        return [*out, f"not tested: {NOT_TESTED.replace('bending, ', '') if self.bending else NOT_TESTED}"]

    @property
    def fits(self) -> list[str]:
        """How well each curve meets its data, in words."""
        known = self.curves | ({"bias": self.bias} if self.bias else {})
        out = [
            f"{way} curve: {curve.how}, to a strain of {curve.loading.limit:.3g}; "
            f"fit error (rms) {100 * curve.loading.residual:.2g} % of the peak stress"
            for way, curve in known.items()
        ]
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
        """Unloading modulus (Pa) for the fabric: measured, else assumed, but nowhere less than the loading modulus."""
        curve = self.curves[way]
        least = float(curve.loading.tangent(np.linspace(0, curve.loading.limit, 1001)).max())
        known = curve.unloading.value if curve.unloading else 1e6 * self.tests.assumed.get(f"{way}_unloading_MPa", 0.0)
        return max(known, least)

    def ratio(self, key: str) -> float:
        """Poisson's ratio for the fabric: measured, else assumed; a negative one within two errors of zero is zero."""
        if key not in self.poisson:
            return self.tests.assumed[key]
        value, error = self.poisson[key].value, self.poisson[key].error
        return 0.0 if -2 * error < value < 0 else value


def identify(tests: listing.Tests) -> Identified:
    """All that the records of a fabric tell; raises InputError for a record that cannot be used."""
    if tests.sheet:
        return _of_sheet(tests, tests.sheet)
    found: dict[str, Curve] = {}
    notes: list[str] = []
    displacement: dict[str, float] = {}
    bias, bias_records, stretch = None, [], None
    tested: list[records.Record] = []
    for way in ("warp", "weft", "bias"):
        if way not in tests.records:
            continue
        read = [one for path in tests.records[way] for one in records.read_all(path, tests.strip, tests.columns)]
        parts = [branches.split(record) for record in read]
        begun = [origin.find(*both, tests.strip.gauge_length, tests.preload) for both in zip(read, parts, strict=True)]
        read, parts = [record for record, _ in begun], [part for _, part in begun]
        tested += read
        axial = _curve(tests.strip, read, parts)
        notes += [note for r, p in zip(read, parts, strict=True) for note in (*r.notes, *p.notes)]
        displacement[way] = tests.strip.gauge_length * (np.sqrt(1 + 2 * axial.loading.limit) - 1)
        if way != "bias":
            found[way] = axial
            continue
        bias, bias_records = axial, read
        marked = [k for k, record in enumerate(read) if record.yarns]
        if marked:
            found["shear"], said = _shear(tests.strip, [read[k] for k in marked], [parts[k] for k in marked])
            notes += said
            stretch = max(float(np.nanmax(read[k].yarns[f"{w}_stretch"])) for k in marked for w in ("warp", "weft"))
    if tests.frames:
        seen = picture_frame.shear(tests.frames, tests.strip.thickness, tests.columns, tests.preload)
        how = "measured in picture frames"
        found["shear"] = Curve(curves.loading(seen.readings), _slope(seen.slopes), seen.readings, seen.back, how)
        notes, tested = notes + seen.notes, tested + seen.records
        reach = np.sqrt(1 + 2 * found["shear"].loading.limit) - 1
        displacement.setdefault("bias", tests.strip.gauge_length * float(reach))
    contractions = {
        key: [markers.contraction(path) for path in tests.records[f"{way}_dots"]]
        for key, way in (("nu12", "warp"), ("nu21", "weft"))
        if f"{way}_dots" in tests.records
    }
    notes += [note for several in contractions.values() for one in several for note in one.notes]
    poisson = {
        key: Estimate.of([c.ratio for c in several], several[0].patches) for key, several in contractions.items()
    }
    bent = bending_fit.fit(tests.bending, tests.areal_mass) if tests.bending else None
    notes += bent.notes if bent else []
    answer = Identified(
        tests, found, poisson, contractions, bias, bias_records, displacement, stretch, notes, tested, bent
    )
    return replace(answer, notes=notes + _remarks(answer))


def _of_sheet(tests: listing.Tests, sheet: sheets.Sheet) -> Identified:
    """What the sheet of a laboratory tells: no contraction, and of FAST no way back."""
    strip, found = tests.strip, {}
    for way in WAYS:
        both = sheets.shear(sheet, strip.thickness) if way == "shear" else sheets.tension(sheet, way, strip.thickness)
        found[way] = Curve(curves.loading(both[0]), both[1], both[0], [], f"from a sheet of {sheet.kind.upper()}")
    displacement = {
        way: strip.gauge_length * (np.sqrt(1 + 2 * found[curve].loading.limit) - 1)
        for way, curve in (("warp", "warp"), ("weft", "weft"), ("bias", "shear"))
    }
    bent = bending_fit.fit(sheet.bending, tests.areal_mass)
    answer = Identified(tests, found, {}, {}, None, [], displacement, None, bent.notes, [], bent)
    return replace(answer, notes=bent.notes + _remarks(answer))


def _remarks(answer: Identified) -> list[str]:
    """What was changed so that the fabric makes sense."""
    out = []
    for way, curve in answer.curves.items():
        if curve.unloading and answer.unloading(way) > curve.unloading.value:
            out.append(f"{way}: the unloading slope is below the largest loading modulus, which is used in its place.")
    for key, estimate in answer.poisson.items():
        if estimate.value < 0 == answer.ratio(key):
            out.append(f"{key} = {estimate} is zero within two errors, and is used as zero.")
    return out


def _curve(strip: records.Strip, read: Sequence[records.Record], parts: Sequence[branches.Branches]) -> Curve:
    """The axial curve of tests along one direction."""
    readings, back, slopes = [], [], []
    for record, part in zip(read, parts, strict=True):
        E = curves.green_lagrange(record.displacement, strip.gauge_length)
        S = curves.piola_kirchhoff(record.force, record.displacement, strip.gauge_length, strip.area)
        readings.append(Readings(record.file, E[part.virgin], S[part.virgin]))
        back += [(E[run], S[run]) for run in part.unloading]
        slopes.append([curves.unloading(E[run], E[run], S[run]) for run in part.unloading])
    return Curve(curves.loading(readings), _slope(slopes), readings, back)


def _shear(
    strip: records.Strip, read: Sequence[records.Record], parts: Sequence[branches.Branches]
) -> tuple[Curve, list[str]]:
    """S12 of (3.15) over E12 of (3.16), the latter smoothed over the axial strain; and what was noticed."""
    readings, back, slopes, notes = [], [], [], []
    for record, part in zip(read, parts, strict=True):
        E = curves.green_lagrange(record.displacement, strip.gauge_length)
        S12 = curves.piola_kirchhoff(record.force, record.displacement, strip.gauge_length, strip.area) / 2
        E12, way = markers.shear_strain(record), part.virgin
        seen = way[np.isfinite(E12[way])]
        smooth, rest = _smooth(E[seen], E12[seen])
        if rest:
            notes.append(
                f"{record.file}: at rest the yarns are {np.degrees(2 * abs(rest)):.2g} degrees off the square, "
                "which is subtracted, (3.9)."
            )
        covered = way[E[way] <= E[seen].max()]
        strain = smooth(E[covered])
        if not strain.max() > 1e-6:
            raise InputError(f"{record.file}: the marked yarns do not shear; check the columns of stretches and angle.")
        readings.append(Readings(record.file, strain, S12[covered]))
        runs = [run[np.isfinite(E12[run])] for run in part.unloading]
        back += [(E12[run] - rest, S12[run]) for run in runs]
        slopes.append([curves.unloading(E[run], E12[run], S12[run]) for run in runs if len(run) > 3])
    return Curve(curves.loading(readings), _slope(slopes), readings, back), notes


def _smooth(x: Array, y: Array) -> tuple[np.polynomial.Polynomial, float]:
    """A quartic through the origin, and the value at rest that was taken off: zero unless it is beyond three errors."""
    scale = x.max()
    A = np.vander(x / scale, min(5, max(2, len(x) // 4)), increasing=True)
    c, *_ = np.linalg.lstsq(A, y)
    error = np.sqrt(np.linalg.inv(A.T @ A)[0, 0] * ((A @ c - y) ** 2).sum() / max(len(y) - len(c), 1))
    rest = float(c[0]) if abs(c[0]) > 3 * error else 0.0
    c[1:], *_ = np.linalg.lstsq(A[:, 1:], y - rest)
    c[0] = 0.0
    return np.polynomial.Polynomial(c / scale ** np.arange(len(c))), rest


def _slope(specimens: Sequence[Sequence[tuple[float, float, int] | None]]) -> Estimate | None:
    """Mean unloading slope over the specimens, of each the mean over its unloadings."""
    means = [
        np.mean([s[:2] for s in slopes if s and s[0] > 0], axis=0)
        for slopes in specimens
        if any(s and s[0] > 0 for s in slopes)
    ]
    return Estimate.of([m[0] for m in means], means[0][1]) if means else None
