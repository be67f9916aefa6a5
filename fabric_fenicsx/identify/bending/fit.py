"""From all bending tests of a fabric to its bending: one curve for each direction, with what each kind of test says.

Friction (2HB), the curvature over which it builds up, and the shape of the curve (B2 over B, face against back) come
from the test that tells them: a loop, else KES's numbers and the angles of overhangs. B under that shape is found from
every test, and is their mean, weighted by the errors, to which each kind of test adds `FLOOR`. How sure the curve is
tell specimens that are drawn again (`bootstrap`).
"""

from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...fabrics import BendingCurve, BendingCurves
from ...fabrics.bending import FRICTION_PER_M, least_hysteresis, moment
from ...laws import Array
from ..tensile.curves import Estimate
from . import bootstrap, hanging, loops
from . import found as bending
from .found import ASSUMED_SPREAD, NO_FRICTION, NO_SOFTENING, Found
from .hanging import Shape
from .tests import BendingTests, Loop, StripTests, read_loop

FLOOR = 0.02  # of B: what two kinds of test of one strip differ by
ALONE = 0.10  # of B: standard error of a single specimen, of which nothing else is known
APART = 3.0  # standard errors between two kinds of test that are worth a remark
STEP = 1e-4  # m: change of B2 over B whose effect is looked at
KES_SLOPE = 50.0, 150.0  # 1/m, between which KES reads B


@dataclass(frozen=True)
class Direction:
    """The curve of one direction and its data; `kinds`: B (N m) under this curve's shape by kind of test."""

    found: Found
    kinds: dict[str, Estimate]
    tests: StripTests
    loops: tuple[Loop, ...] = ()
    notes: tuple[str, ...] = ()
    unsure: float = 0.0  # of the moment, over that at 250 1/m: standard error, from specimens that are drawn again

    @property
    def spread(self) -> float:
        """Curvature over which friction builds up, 1/m."""
        return self.found.friction_per_m or FRICTION_PER_M


@dataclass(frozen=True)
class IdentifiedBending:
    """Bending of a fabric, and what it was found from."""

    curves: BendingCurves
    ways: dict[str, Direction]
    areal_mass: float  # kg/m2

    @property
    def undetermined(self) -> list[str]:
        """What the tests do not tell, in words."""
        out = [f"bending, {way}: {word}" for way, one in self.ways.items() for word in one.found.untold]
        return out + [f"bending, {what} assumed: {why}" for what, why in self.curves.assumed.items()]

    @property
    def fits(self) -> list[str]:
        """Each direction with its errors and with what each kind of test says, in words."""
        return [
            f"bending, {way}: {one.found.curve}"
            + "".join(f", {name} ± {error:.2g}" for name, error in one.found.errors.items())
            + "; B by "
            + ", ".join(
                f"{kind} {1e6 * e.value:.4g} ± {1e6 * e.error:.2g} (n = {e.specimens})" for kind, e in one.kinds.items()
            )
            + f"; moment ± {100 * one.unsure:.2g} %"
            for way, one in self.ways.items()
        ]

    @property
    def notes(self) -> list[str]:
        """Remarks of all directions."""
        return [note for one in self.ways.values() for note in one.notes]


def fit(tests: BendingTests, areal_mass: float) -> IdentifiedBending:
    """The bending of a fabric of that mass (kg/m2); raises InputError for tests that contradict each other."""
    ways = {way: _direction(way, tests.ways[way], areal_mass) for way in ("warp", "weft")}
    warp, weft = (ways[way].found for way in ("warp", "weft"))
    assumed = {}
    if "bias" in tests.ways:
        wide, ways["bias"] = tests.strip == "wide", _direction("bias", tests.ways["bias"], areal_mass)
        if not ways["bias"].found.curve.hysteresis and (warp.curve.hysteresis or weft.curve.hysteresis):
            spread = float(np.mean([one.friction_per_m or FRICTION_PER_M for one in (warp, weft)]))
            friction = _friction(warp, weft, ways["bias"].found, wide)
            ways["bias"] = _direction("bias", tests.ways["bias"], areal_mass, friction, spread)
            assumed["friction of twist"] = "no loop in bias; to that of warp and weft as their B are"
        curves = bending.together(warp, weft, ways["bias"].found, wide=wide)
    else:
        curves = bending.together(warp, weft)
    return IdentifiedBending(replace(curves, assumed=curves.assumed | assumed), ways, areal_mass)


def _direction(
    way: str, tests: StripTests, mass: float, friction: float = 0.0, spread: float | None = None
) -> Direction:
    """The curve of one direction; 2HB over B (1/m) and spread (1/m) count where no test tells friction."""
    numbers = tests.numbers
    read = [read_loop(path) for path in tests.loops]
    whole = [_of_loop(one) for one in read]
    if whole:
        told = _mean(whole)
    else:
        told = Found(BendingCurve(1.0, 0.0, float(np.mean(numbers.get("2HB", 0.0)))), {}, spread)
        told = replace(told, errors=_scatter("hysteresis_mN", 1e3, numbers.get("2HB")))
        if "overhang" in numbers and not friction:
            fitted = hanging.fit_cantilever(
                numbers["overhang"], numbers["angle"], mass, hysteresis=told.curve.hysteresis, friction_per_m=spread
            )
            told = replace(fitted, errors=told.errors | fitted.errors)
    ratio = told.curve.softening / told.curve.B
    shape = Shape(ratio, told.curve.hysteresis, friction, told.friction_per_m or FRICTION_PER_M)

    kinds: dict[str, Estimate] = {}
    apart: dict[str, tuple[Array, tuple[float, float]]] = {}  # as of `bootstrap.Kind`
    if whole:
        B = np.array([one.curve.B for one in whole])
        kinds["loops"], apart["loops"] = _estimate(B, whole[0].errors["B_uNm"] / 1e6), (_logs(B), (0.0, 0.0))
    if "B" in numbers:  # a mean slope, face and back
        by_ratio = float(np.log(_slope(ratio - STEP) / _slope(ratio + STEP)) / (2 * STEP))
        kinds["KES"], apart["KES"] = _estimate(numbers["B"] / _slope(ratio)), (_logs(numbers["B"]), (by_ratio, 0.0))
    hung = {"overhangs": (numbers.get("overhang"), numbers.get("angle"))}
    c = numbers.get("bending_length")
    hung["bending lengths"] = (None, None) if c is None else (2 * c, np.full(len(c), hanging.ASTM_ANGLE))
    for kind, (L, angle) in hung.items():
        if L is not None and angle is not None:
            hung_so = hanging.overhangs(L, angle, mass, shape)
            error = ALONE * hung_so.B if hung_so.error is None else hung_so.error
            kinds[kind], apart[kind] = Estimate(hung_so.B, error, len(L)), (hung_so.apart, hung_so.by_shape)
    if "heart_length" in numbers:
        pairs = zip(numbers["heart_length"], numbers["heart_height"], strict=True)
        B = np.array([hanging.heart_loop(*pair, mass, shape=shape).curve.B for pair in pairs])
        kinds["heart loops"], apart["heart loops"] = _estimate(B), (_logs(B), (0.0, 0.0))
    mean, least = _weighted(kinds)
    curve = shape.curve(mean)
    softening = [one.curve.softening / one.curve.B for one in whole] or [ratio]
    widths = [one.curve.hysteresis for one in whole] or numbers.get("2HB", [curve.hysteresis])
    draws = bootstrap.bootstrap(
        [bootstrap.Kind(name, one.value, _weight(one), *apart[name]) for name, one in kinds.items()],
        "loops" if whole else "KES",
        np.array(softening), np.array(widths),
    )  # fmt: skip
    back = told.back and replace(told.back, B=told.back.B * mean / told.curve.B, softening=ratio * mean)
    errors = told.errors | {"B_uNm": 1e6 * max(least, float(draws[:, 0].std()))}
    found = Found(curve, errors, told.friction_per_m, back, _untold(tests, told, friction), told.residual)
    notes = (*(n for one in read for n in one.notes), *_apart(way, kinds))
    unsure = max(bootstrap.of_curve(draws, curve), least / mean)
    return Direction(found, kinds, tests, tuple(read), notes, unsure)


def _logs(B: Array) -> Array:
    """Of each of (n,) over their mean."""
    return np.asarray(np.log(B / B.mean()))


def _friction(warp: Found, weft: Found, bias: Found, wide: bool) -> float:
    """2HB over B (1/m) of a bias strip by that of the yarns and of a twist whose friction is to theirs as its B is."""
    yarns = least_hysteresis(warp.curve, weft.curve, bias.curve.B, wide) / bias.curve.B
    twist = np.sqrt(warp.curve.hysteresis * weft.curve.hysteresis / warp.curve.B / weft.curve.B)
    return float(yarns + twist / 2)


def _slope(ratio: float) -> float:
    """Mean slope of a curve of B = 1 and B2 = ratio (m) where KES reads it."""
    ends = np.array(KES_SLOPE)
    return float(np.diff(moment(ends, 1.0, ratio, BendingCurve(1.0, ratio).limit))[0] / np.diff(ends)[0])


def _mean(whole: list[Found]) -> Found:
    """One shape of several loops: means of their numbers, errors from their scatter."""
    if len(whole) == 1:
        return whole[0]
    B, softening, hysteresis = (
        np.array([getattr(one.curve, name) for one in whole]) for name in ("B", "softening", "hysteresis")
    )
    errors = _scatter("B_uNm", 1e6, B) | _scatter("hysteresis_mN", 1e3, hysteresis)
    errors |= _scatter("softening_nNm2", 1e9, softening) if softening.any() else {}
    spreads = [one.friction_per_m for one in whole if one.friction_per_m]
    curve = BendingCurve(float(B.mean()), float(softening.mean()), float(hysteresis.mean()))
    sides = [(one.back or one.curve).B / one.curve.B for one in whole]
    told = 2 * sum(one.back is not None for one in whole) > len(whole)
    back = replace(curve, B=curve.B * float(np.mean(sides)), hysteresis=0.0) if told else None
    untold = tuple(dict.fromkeys(word for one in whole for word in one.untold))
    residual = float(np.sqrt(np.mean([one.residual**2 for one in whole])))
    return Found(curve, errors, float(np.mean(spreads)) if spreads else None, back, untold, residual)


def _untold(tests: StripTests, shape: Found, friction: float) -> tuple[str, ...]:
    """What the tests of a direction do not tell."""
    if tests.loops:
        return shape.untold
    words = [] if shape.curve.softening else [NO_SOFTENING]
    words += [] if "2HB" in tests.numbers or friction else [NO_FRICTION]
    return (*words, *([ASSUMED_SPREAD] if shape.curve.hysteresis else []))


def _scatter(name: str, unit: float, values: Array | None) -> dict[str, float]:
    """Standard error of the mean by name, in its unit; none of a single value."""
    n = 0 if values is None else len(values)
    return {name: unit * float(np.std(values, ddof=1) / np.sqrt(n))} if values is not None and n > 1 else {}


def _estimate(values: Array | list[float], alone: float | None = None) -> Estimate:
    return Estimate.of(values, ALONE * values[0] if alone is None else alone)


def _weighted(kinds: dict[str, Estimate]) -> tuple[float, float]:
    """Mean of B (N m) over the kinds of test, and its standard error."""
    B = np.array([e.value for e in kinds.values()])
    weight = np.array([_weight(e) for e in kinds.values()])
    return float(weight @ B / weight.sum()), float(np.sqrt(1 / weight.sum()))


def _weight(one: Estimate) -> float:
    return 1 / (one.error**2 + (FLOOR * one.value) ** 2)


def _apart(way: str, kinds: dict[str, Estimate]) -> list[str]:
    """A remark where two kinds of test disagree."""
    (low, a), *_, (high, b) = sorted(kinds.items(), key=lambda one: one[1].value) * (1 + (len(kinds) == 1))
    apart = np.hypot(np.hypot(a.error, b.error), FLOOR * (a.value + b.value) / 2)
    if b.value - a.value < APART * apart:
        return []
    return [
        f"bending, {way}: {high} give a B of {1e6 * b.value:.4g} uN m, {low} one of {1e6 * a.value:.4g}, which differ "
        "by more than their errors; look for a wrong unit or another cloth."
    ]


def _of_loop(loop: Loop) -> Found:
    try:
        return loops.fit_loop(loop.curvature, loop.moment)
    except InputError as error:
        raise InputError(f"{loop.file}: {str(error)[0].lower()}{str(error)[1:]}") from None
