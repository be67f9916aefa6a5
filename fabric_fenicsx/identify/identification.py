"""From the records of a fabric's tests to its curves and Poisson's ratios."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..laws import Array
from . import listing
from .bending import fit as bending_fit
from .files import records
from .identified import NOT_TESTED, WAYS, Compared, Curve, Identified
from .shear import cycles, picture_frame
from .sheets import kes_and_fast as sheets
from .tensile import branches, curves, markers, origin, strips
from .tensile.curves import Estimate, Readings

__all__ = ["NOT_TESTED", "WAYS", "Compared", "Curve", "Identified", "identify"]


def identify(tests: listing.Tests) -> Identified:
    """All that the records of a fabric tell; raises InputError for a record that cannot be used."""
    if tests.sheet:
        return _of_sheet(tests, tests.sheet)
    found: dict[str, Curve] = {}
    notes: list[str] = []
    displacement: dict[str, float] = {}
    bias, bias_records, stretch, cycled = None, [], None, None
    tested: list[records.Record] = []
    thickness = tests.strip.thickness
    if tests.frames:
        seen = picture_frame.shear(tests.frames, tests.strip.thickness, tests.columns, tests.preload)
        how = "measured in picture frames"
        found["shear"] = Curve(curves.loading(seen.readings), _slope(seen.slopes), seen.readings, seen.back, how)
        found["shear"], cycled, said = _cycles(found["shear"], seen)
        notes += said
        notes, tested = notes + seen.notes, tested + seen.records
    slanted = [
        strips.load(one, tests.columns, tests.preload, cycled is not None)
        for one in tests.strips
        if one.off_yarns or one.held_out
    ]
    for way in ("warp", "weft", "bias"):
        specimens = _specimens(tests, way)
        if not specimens:
            continue
        sizes = [strip for _, strip in specimens]
        read = [record for record, _ in specimens]
        parts = [branches.split(record) for record in read]
        begun = [
            origin.find(record, part, strip.gauge_length, tests.preload, friction=way == "bias" and bool(cycled))
            for record, part, strip in zip(read, parts, sizes, strict=True)
        ]
        read, parts = [record for record, _ in begun], [part for _, part in begun]
        tested += read
        axial = _curve(sizes, read, parts)
        notes += [note for r, p in zip(read, parts, strict=True) for note in (*r.notes, *p.notes)]
        displacement[way] = tests.strip.gauge_length * (np.sqrt(1 + 2 * axial.loading.limit) - 1)
        if way != "bias":
            found[way] = axial
            continue
        bias, bias_records = axial, read
        marked = [k for k, record in enumerate(read) if record.yarns]
        if marked and not tests.frames:
            found["shear"], said = _shear(tests.strip, [read[k] for k in marked], [parts[k] for k in marked])
            notes += said
        if marked:
            stretch = max(float(np.nanmax(read[k].yarns[f"{w}_stretch"])) for k in marked for w in ("warp", "weft"))
    if tests.frames:
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
    tested += [record for _, several in slanted for record in several]
    notes += [note for _, several in slanted for record in several for note in record.notes]
    answer = Identified(
        tests, found, poisson, contractions, bias, bias_records, displacement, stretch, notes, tested, bent,
        tuple(one for one, _ in slanted), tuple(strips.load_biaxial(one, thickness) for one in tests.biaxial),
        friction=cycled.friction if cycled else None, cycled=cycled,
    )  # fmt: skip
    return replace(answer, notes=notes + _remarks(answer))


def _cycles(shear: Curve, seen: picture_frame.Sheared) -> tuple[Curve, cycles.Cycles | None, list[str]]:
    """Shear from whole records of several cycles, with friction where they show it, and what they do not tell of it."""
    if not seen.whole:
        return shear, None, []
    slope = shear.unloading.value if shear.unloading else 0.0
    least = float(shear.loading.tangent(np.linspace(0, shear.loading.limit, 101)).max())
    told = cycles.fit(seen.whole, shear.loading, max(slope, least))
    if told is None:
        return shear, None, []
    value, error = told.unloading
    new = replace(
        shear, loading=told.loading, unloading=Estimate(value, error, len(seen.whole)),
        how=f"{shear.how}, with friction", friction=told.friction.friction,
    )  # fmt: skip
    words = [
        f"shear in cycles: misfit (rms) {100 * told.residual:.2g} % of the peak stress with friction and softening, "
        f"{100 * told.without:.2g} % without"
    ]
    names = ", ".join(told.untold)
    return (
        new,
        told,
        words + ([f"shear in cycles does not tell {names}, which are near what is assumed"] if names else []),
    )


def _of_sheet(tests: listing.Tests, sheet: sheets.Sheet) -> Identified:
    """What the sheet of a laboratory tells: no contraction, and of FAST no way back."""
    strip, found = tests.strip, {}
    sheared = sheets.shear(sheet, strip.thickness)
    for way in WAYS:
        both = (sheared.readings, sheared.unloading) if way == "shear" else sheets.tension(sheet, way, strip.thickness)
        found[way] = Curve(curves.loading(both[0]), both[1], both[0], [], f"from a sheet of {sheet.kind.upper()}")
    displacement = {
        way: strip.gauge_length * (np.sqrt(1 + 2 * found[curve].loading.limit) - 1)
        for way, curve in (("warp", "warp"), ("weft", "weft"), ("bias", "shear"))
    }
    bent = bending_fit.fit(sheet.bending, tests.areal_mass)
    notes, friction = [*bent.notes, *sheared.notes], sheared.friction
    answer = Identified(tests, found, {}, {}, None, [], displacement, None, notes, [], bent, friction=friction)
    return replace(answer, notes=notes + _remarks(answer))


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


def _specimens(tests: listing.Tests, way: str) -> list[tuple[records.Record, records.Strip]]:
    """The records along one direction, each with the size of its strip: of [records], and of [[strip]] at 0 and 90."""
    listed = [(path, tests.strip) for path in tests.records.get(way, [])]
    for one in tests.strips:
        if way != "bias" and not one.off_yarns and not one.held_out and (way == "weft") == (one.angle > 1):
            listed += [(path, one.strip) for path in one.files]
    return [(record, strip) for path, strip in listed for record in records.read_all(path, strip, tests.columns)]


def _curve(sizes: Sequence[records.Strip], read: Sequence[records.Record], parts: Sequence[branches.Branches]) -> Curve:
    """The axial curve of tests along one direction."""
    readings, back, slopes = [], [], []
    for strip, record, part in zip(sizes, read, parts, strict=True):
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
