"""From readings to the curves of section 7.1: stress and strain, loading polynomials, unloading slopes.

A loading curve is S = c0 E + c1 E^2/2 (+ c2 E^3/3 + c3 E^4/4), (6.14), whose derivative is the modulus
D = c0 + c1 E (+ c2 E^2 + c3 E^3), (6.16), held above a small positive value over the whole range by the fit itself. The
constant of (6.14) is a specimen's own, a pre-load or an offset of the load cell: `offset` takes it off the force.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import LinearConstraint, minimize

from ...laws import Array

LEAST = 0.01  # smallest modulus that a fit may have, over the mean one
RAMP = 1e-3  # strain after a reversal in which the slope still changes (6.3.1), so that it is no part of the slope
DOWN = (0.3, 0.5, 0.7)  # parts of the peak stress down to which an unloading may be straight


def green_lagrange(displacement: Array, gauge_length: float) -> Array:
    """Axial Green-Lagrange strain, (3.2), (A6); any shape, m."""
    d = np.asarray(displacement) / gauge_length
    return d + d * d / 2


def piola_kirchhoff(force: Array, displacement: Array, gauge_length: float, area: float) -> Array:
    """Axial 2nd Piola-Kirchhoff stress (Pa), (3.1), of forces in N; area A0 in m2."""
    return np.asarray(force) / (area * (1 + np.asarray(displacement) / gauge_length))


@dataclass(frozen=True)
class Estimate:
    """A number, its standard error, and from how many specimens: the error is from their scatter, or from one fit."""

    value: float
    error: float
    specimens: int

    @classmethod
    def of(cls, values: ArrayLike, alone: float) -> Self:
        """The mean of one value a specimen; alone: the error of a single one."""
        known = np.asarray(values, dtype=np.float64)
        n = len(known)
        return cls(float(known.mean()), float(known.std(ddof=1) / np.sqrt(n)) if n > 1 else float(alone), n)

    def __str__(self) -> str:
        return f"{self.value:.4g} ± {self.error:.2g}"


@dataclass(frozen=True)
class Readings:
    """Virgin loading of one specimen: strain (n,), stress (n,) in Pa."""

    file: str
    strain: Array
    stress: Array


@dataclass(frozen=True)
class Loading:
    """A fitted loading curve over strains from 0 to `limit`."""

    modulus: tuple[float, ...]  # Pa, ascending powers of the strain
    errors: tuple[float, ...]  # standard errors of them
    limit: float
    residual: float  # root mean square over the largest fitted stress
    spread: float  # largest standard error of the curve, from the scatter of the specimens, over the same
    held: bool  # whether the modulus would have been too small without the constraint

    def stress(self, strain: Array) -> Array:
        """Stress (Pa)."""
        return powers(np.asarray(strain), len(self.modulus)) @ np.array(self.modulus)

    def tangent(self, strain: Array) -> Array:
        """Modulus (Pa)."""
        return np.asarray(np.polynomial.polynomial.polyval(strain, self.modulus))


def loading(specimens: Sequence[Readings]) -> Loading:
    """The quadratic or quartic stress that fits best under a positive modulus.

    Best is by Schwarz's criterion: a quartic must earn its two further coefficients. Every specimen counts alike,
    however densely it was recorded. The range ends where half of the specimens end.
    """
    limit = float(np.median([s.strain.max() for s in specimens]))
    used = [Readings(s.file, s.strain[s.strain <= limit], s.stress[s.strain <= limit]) for s in specimens]
    scale = max(float(s.stress.max()) for s in used)
    parts = [(s.strain / limit, s.stress / scale) for s in used]
    x, y = (np.concatenate(both) for both in zip(*parts, strict=True))
    n = len(x)
    weight = np.concatenate([np.full(len(x), n / len(parts) / len(x)) for x, _ in parts])
    fits = [_constrained(x, y, weight, terms) for terms in (2, 4)]
    scores = [n * np.log(max(rss, 1e-300) / n) + len(c) * np.log(n) for c, rss, _ in fits]
    c, rss, held = fits[int(np.argmin(scores))]
    terms = len(c)
    if len(parts) > 1:
        alone = np.array([_constrained(x, y, np.ones(len(x)), terms)[0] for x, y in parts])
        covariance = np.cov(alone.T) / len(parts)
    else:
        A = powers(x, terms)
        covariance = np.linalg.inv(A.T @ A) * rss / max(n - terms, 1)
    to_pa, top = scale / limit ** np.arange(1, terms + 1), float(powers(np.array(1.0), terms) @ c)
    return Loading(
        modulus=tuple(map(float, c * to_pa)),
        errors=tuple(map(float, np.sqrt(np.diag(covariance)) * to_pa)),
        limit=limit,
        residual=float(np.sqrt(rss / n)) / top,
        spread=spread(c, covariance, 1.0),
        held=held,
    )


def powers(x: Array, terms: int) -> Array:
    """Columns x, x^2/2, ... that the coefficients of the modulus multiply."""
    k = np.arange(1, terms + 1)
    return x[..., None] ** k / k


def spread(c: Array, covariance: Array, limit: float) -> float:
    """Largest standard error of the stress up to a strain, over the stress there; c (n,): coefficients of a modulus."""
    P = powers(np.linspace(0, limit, 51), len(c))
    return float(np.sqrt(np.einsum("ij,jk,ik->i", P, covariance, P).max())) / float(P[-1] @ c)


def from_nodes(count: int, limit: float) -> Array:
    """Takes moduli at so many strains, evenly from 0 to the limit, to the coefficients of ascending powers, (n, n)."""
    inverse = np.linalg.inv(np.vander(np.linspace(0, 1, count), increasing=True))
    return np.asarray(inverse / limit ** np.arange(count)[:, None])


def offset(strain: Array, force: Array) -> float:
    """Where a free quartic through the loading of one specimen begins; zero if within three standard errors of zero."""
    A = np.hstack([np.ones((len(strain), 1)), powers(strain / strain.max(), 4)])
    c, *_ = np.linalg.lstsq(A, force)
    variance = float(((A @ c - force) ** 2).sum()) / max(len(force) - 5, 1)
    error = float(np.sqrt(np.linalg.pinv(A.T @ A)[0, 0] * variance))
    return float(c[0]) if abs(c[0]) > 3 * error else 0.0


def _constrained(x: Array, y: Array, weight: Array, terms: int) -> tuple[Array, float, bool]:
    """Coefficients (terms,), weighted sum of squares, and whether the constraint was at work; x in [0, 1]."""
    root = np.sqrt(weight)
    A, b = powers(x, terms) * root[:, None], y * root
    c, *_ = np.linalg.lstsq(A, b)
    # the modulus c . (1, x, x^2, ...) at so many points that between them it cannot fall noticeably below
    wall, floor = np.linspace(0, 1, 101)[:, None] ** np.arange(terms), LEAST * max(float(y.max()), 1e-12)
    held = bool((wall @ c < floor).any())
    if held:
        H, g = A.T @ A / len(x), A.T @ b / len(x)
        c = minimize(
            lambda z: 0.5 * z @ H @ z - g @ z,
            np.eye(terms)[0] * max(float(y.max()), 10 * floor),
            jac=lambda z: H @ z - g,
            method="SLSQP",
            constraints=LinearConstraint(wall, lb=1.001 * floor),
            options={"maxiter": 500, "ftol": 1e-14},
        ).x
    return c, float(((A @ c - b) ** 2).sum()), held


@dataclass(frozen=True)
class _Line:
    """A straight line through values (n,) over t (n,), and whether a parabola would not fit noticeably better."""

    slope: float
    error: float
    straight: bool

    @classmethod
    def of(cls, t: Array, values: Array) -> "_Line":
        basis = np.linalg.qr(np.vander(t, min(3, len(t)), increasing=True))[0]
        part = basis.T @ values
        rest = values - basis[:, :2] @ part[:2]
        noise = float(np.sqrt(rest @ rest / max(len(t) - 2, 1)))
        width = float(np.sqrt(((t - t.mean()) ** 2).sum()))
        slope = float((t - t.mean()) @ values) / width**2
        # a handful of points cannot tell
        return cls(slope, noise / width, len(t) < 6 or bool(abs(part[2]) < 3 * noise))


def unloading(axial: Array, strain: Array, stress: Array) -> tuple[float, float, int] | None:
    """Slope (Pa) of an unloading from its first points, its standard error, and how many points; None if too few.

    Arrays (n,) from the peak on: `axial` is the strain of the machine, `strain` and `stress` (Pa) the pair whose slope
    is sought. Both are regressed on `axial`, which has hardly any noise, and the slope is the quotient: noise in the
    strain of a photograph would flatten a direct regression. The points lie beyond the ramp of the reversal and above
    30, 50 or 70 % of the peak stress, the lowest of these to which the stress is straight; at least three (7.1.1).
    The strain is followed further down, for as long as it is straight too.
    """
    way = np.abs(axial - axial[0])
    first, peak, found = int(np.argmax(way > RAMP)), float(np.median(stress[:3])), None
    for part in DOWN:
        low = np.flatnonzero(stress < part * peak)
        end = int(low[0]) if len(low) else len(stress)
        if end - first < 3 or way[end - 1] <= way[first]:
            continue
        fall, rate = _Line.of(way[first:end], stress[first:end]), _Line.of(way[first:], strain[first:])
        if not rate.straight:
            rate = _Line.of(way[first:end], strain[first:end])
        slope = fall.slope / rate.slope
        found = slope, abs(slope) * float(np.hypot(fall.error / fall.slope, rate.error / rate.slope)), end - first
        if fall.straight:
            break
    return found
