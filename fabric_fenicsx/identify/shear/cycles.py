"""Friction, softening and return of shear from records of several cycles, by least squares with `laws.play`.

All readings count, in the order of the test, and all numbers are found together: the curve, by its moduli at nodes, the
unloading modulus, and those of `fabrics.ShearFriction`. What a record does not tell (a test that is never brought back
says nothing of what is returned) stays where it is assumed, `ASSUMED`, and is said. The law of shear without friction
stands unless friction describes the record better than it by more than chance.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from ...errors import InputError
from ...fabrics import Curve, ShearFriction
from ...fabrics.friction import BELOW, NAMES
from ...laws import Array, play
from ...laws.elements import follow_shear, pack
from ..files.cleaning import noise
from ..tensile import curves
from ..tensile.branches import turning_points
from ..tensile.curves import Loading

NODES = 4
LEG = 40  # readings of a leg, at most: means of those that follow each other
STARTS = ((0.02, 0.3, 1.0), (0.1, 0.1, 1.0), (0.05, 0.5, 4.0))
"""Friction over the peak, softening, and how much stiffer than without friction it unloads: where the fit begins."""
SIGMA, GOOD = 0.02, 0.006  # of the peak: scatter of a reading, and a misfit with which the last start is needless
BETTER = 0.9  # misfit over that without friction, from which on friction is needless
PART = 0.02  # of the range: a way back that is shorter is none
ASSUMED = {  # middle and standard deviation where no reading tells
    "friction": (0.02, 0.1),  # of the peak stress
    "kept": (0.5, 0.5),
    "strain": (np.log(0.1), 0.7),
    "set_in": (0.1, 0.2),
    "returned": (0.2, 0.3),  # of what softening leaves
    "softening": (0.3, 0.4),
    "rejoining": (np.log(3.0), 0.7),
}
LOW = {"friction": 0.0, "kept": 0.0, "strain": np.log(0.01), "set_in": 0.0, "returned": 0.01, "softening": 0.0}
LOW |= {"rejoining": 0.0}
HIGH = {"friction": 0.5, "kept": 1.0, "strain": np.log(1.0), "set_in": 0.9, "returned": 1.0, "softening": 0.95}
HIGH |= {"rejoining": np.log(30.0)}
UNTOLD = 0.5  # of the standard deviation that is assumed


@dataclass(frozen=True)
class Cycles:
    """A curve (dS12/dE12), the unloading modulus (Pa, of E12) and its error, friction, errors by name, misfit."""

    loading: Loading
    unloading: tuple[float, float]
    friction: ShearFriction
    errors: dict[str, float]
    residual: float  # root mean square over the peak stress, and that of the law without friction
    without: float
    untold: list[str]
    records: list[tuple[Array, Array]]  # 2 E12 and S12 (Pa), thinned
    theta: Array  # logarithm of the unloading modulus (Pa, of 2 E12), and the numbers as `numbers` takes them
    peak: float  # Pa


def numbers(theta: Array, peak: float) -> ShearFriction:
    """Of unknowns: friction over the peak stress (Pa), logarithms of strain and rejoining, and what is returned of what
    softening leaves."""
    one = dict(zip(NAMES, map(float, theta), strict=True))
    one["strain"], one["rejoining"] = float(np.exp(one["strain"])), float(np.exp(one["rejoining"]))
    returned = max(one["returned"] * (1 - one["softening"]), 1e-3)
    return ShearFriction(**one | {"friction": one["friction"] * peak, "returned": returned})


def bounds() -> tuple[list[float], list[float]]:
    """Lowest and highest numbers."""
    return [LOW[name] for name in NAMES], [HIGH[name] for name in NAMES]


def assumed(theta: Array) -> Array:
    """Residuals (7,) of numbers to what is assumed of them."""
    middle, spread = np.array([ASSUMED[name] for name in NAMES]).T
    return np.asarray((theta - middle) / spread)


def stiffened(curve: Curve, friction: ShearFriction) -> tuple[Curve, float]:
    """The curve with an unloading modulus that such friction allows, and by how much (logarithm) it is higher."""
    need = 1.001 * (friction.steepest(curve) + friction.softening * friction.secant(curve)) / BELOW
    return replace(curve, unloading=max(curve.unloading, need)), max(0.0, float(np.log(need / curve.unloading)))


def several(strain: Array) -> bool:
    """Whether a record is loaded again after a way back."""
    turns = turning_points(strain, max(PART * float(np.ptp(strain)), 8 * noise(strain)))
    rises = sum(strain[b] > strain[a] for a, b in pairwise(turns))
    return rises > 1


def fit(records: list[tuple[Array, Array]], start: Loading, unloading: float) -> Cycles | None:
    """Of whole records, E12 (n,) and S12 (n,) in Pa in the order of the test, NaN where only the way is known; None
    where friction is needless.

    `start` (of E12) and the unloading modulus (Pa, of E12) as one finds them without friction.
    """
    thin = [_thinned(2 * E, S) for E, S in records]
    return _Fit(thin, start, unloading).solve()


def _thinned(gamma: Array, S: Array) -> tuple[Array, Array]:
    """Means of readings that follow each other, leg by leg, with the corners kept."""
    turns = turning_points(gamma, max(PART * float(np.ptp(gamma)), 8 * noise(gamma)))
    x, y = [], []
    for a, b in pairwise(turns):
        inner = np.arange(a + 1, b)
        for part in np.array_split(inner, min(LEG, len(inner))) if len(inner) else []:
            x.append(gamma[part].mean())
            y.append(S[part].mean())
        x.append(gamma[b])
        y.append(S[b])
    return np.array(x), np.array(y)


def _known(values: Array) -> Array:
    """Those that are finite, where a force was read."""
    return np.asarray(values[np.isfinite(values)])


class _Fit:
    def __init__(self, records: list[tuple[Array, Array]], start: Loading, unloading: float) -> None:
        self.records, self.unloading = records, unloading / 2
        self.limit = 2 * start.limit
        self.peak = max(float(np.nanmax(S)) for _, S in records)
        D = start.tangent(np.linspace(0, start.limit, NODES)) / 2
        self.start = start
        self.logs = np.log(np.maximum(D, 0.05 * np.abs(D).mean()))
        self.to_modulus = curves.from_nodes(NODES, self.limit)

    def curve(self, theta: Array) -> Curve:
        c = self.to_modulus @ np.exp(theta[:NODES])
        return Curve(tuple(map(float, c)), float(np.exp(theta[NODES])), self.limit)

    def packed(self, theta: Array) -> tuple[tuple[float, ...], float]:
        """The play, as stiff in unloading as it must be, and by how much (logarithm) that is beyond the trial."""
        friction = numbers(theta[NODES + 1 :], self.peak)
        curve, more = stiffened(self.curve(theta), friction)
        return play.pack("the trial", curve, friction), more

    def residual(self, theta: Array) -> Array:
        sigma = SIGMA * self.peak
        try:
            c, more = self.packed(theta)
            rows = [_known(play.follow(gamma, c) - S) / sigma for gamma, S in self.records]
        except InputError:
            rows, more = [np.full(len(_known(S)), 1e3) for _, S in self.records], 0.0
        curve = self.curve(theta)
        D = curve.tangent(np.linspace(0, self.limit, 41))
        return np.concatenate([
            *rows, assumed(theta[NODES + 1 :]), [10 * more],
            1e3 * np.minimum(D / np.abs(D).mean() - 2 * curves.LEAST, 0.0),
        ])  # fmt: skip

    def solve(self) -> Cycles | None:
        ends = bounds()
        low = np.array([*self.logs - 4, np.log(self.unloading) - 1.5, *ends[0]])
        high = np.array([*self.logs + 4, np.log(self.unloading) + 4, *ends[1]])
        best = None
        for friction, softening, stiffer in STARTS:
            theta = [*self.logs, np.log(stiffer * self.unloading), *(ASSUMED[name][0] for name in NAMES)]
            theta[NODES + 1], theta[NODES + 1 + NAMES.index("softening")] = friction, softening
            start = np.clip(theta, low + 1e-6, high - 1e-6)
            answer = least_squares(self.residual, start, bounds=(low, high), x_scale="jac", max_nfev=150)
            best = answer if best is None or answer.cost < best.cost else best
            if friction == STARTS[1][0] and 2 * best.cost < len(best.fun) * (GOOD / SIGMA) ** 2:
                break
        assert best is not None
        return self.answer(best.x, best.jac)

    def answer(self, theta: Array, J: Array) -> Cycles | None:
        misses = np.concatenate([_known(play.follow(gamma, self.packed(theta)[0]) - S) for gamma, S in self.records])
        rms, without = float(np.sqrt(np.mean(misses**2))) / self.peak, self.without()
        if rms > BETTER * without:
            return None
        scale = rms / SIGMA  # of the residuals to their scatter
        C = np.linalg.pinv(J.T @ J) * max(scale, 0.05) ** 2
        errors = np.sqrt(np.maximum(np.diag(C), 0.0))
        friction = numbers(theta[NODES + 1 :], self.peak)
        curve, _ = stiffened(self.curve(theta), friction)
        K = curve.unloading
        c = 2.0 ** np.arange(1, NODES + 1) * np.array(curve.modulus)
        M = self.to_modulus * np.exp(theta[:NODES]) * 2.0 ** np.arange(1, NODES + 1)[:, None]
        covariance = M @ C[:NODES, :NODES] @ M.T
        loading = Loading(
            tuple(map(float, c)), tuple(map(float, np.sqrt(np.diag(covariance)))), self.limit / 2, rms,
            curves.spread(c, covariance, self.limit / 2), False,
        )  # fmt: skip
        named = dict(zip(NAMES, map(float, errors[NODES + 1 :]), strict=True))
        untold = [name for name in NAMES if named[name] > UNTOLD * ASSUMED[name][1]]
        unloading = 2 * K, 2 * K * float(errors[NODES])
        return Cycles(loading, unloading, friction, named, rms, without, untold, self.records, theta[NODES:], self.peak)

    def without(self) -> float:
        """Misfit of the law of shear without friction, of the curve and the unloading that one finds first."""
        curve = Curve(
            tuple(x / 2 ** (k + 1) for k, x in enumerate(self.start.modulus)), self.unloading, self.limit
        )  # fmt: skip
        misses = np.concatenate([_known(follow_shear(gamma, thesis(curve)) - S) for gamma, S in self.records])
        return float(np.sqrt(np.mean(misses**2))) / self.peak


def thesis(curve: Curve) -> tuple[float, ...]:
    """The element of shear without friction, of the law with a potential."""
    top = max(curve.unloading, float(curve.tangent(np.linspace(0, curve.limit, 101)).max()))
    rate = max((top - curve.modulus[0]) / 1e-3, 1e-6 * curve.modulus[0] / 1e-3)
    return pack((*curve.modulus, 0.0, 0.0, 0.0)[:4], top, curve.limit, rate, curve.modulus[0], 0.0)
