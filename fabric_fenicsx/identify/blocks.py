"""Tests as blocks of a least-squares fit: means of readings of each specimen, their scatter, the law as the model."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..fabrics import Fabric
from ..laws import Array, play
from ..laws.potential import Potential
from .identified import Compared
from .shear.cycles import Cycles
from .tensile import point
from .tensile.curves import Readings
from .tensile.markers import Contraction
from .tensile.strips import BiaxialTest, StripTest

BINS = 40  # of the readings of a specimen
SMOOTH = 6  # degree of the curve about which readings scatter
LEAST = 0.005  # scatter, of the peak of a test, below which no law describes cloth


@dataclass(frozen=True)
class Trial:
    """A fabric, its law with a potential, and its ratios."""

    fabric: Fabric
    law: Potential
    nu: dict[str, float]


type Model = Callable[[Trial, Array], Array]


@dataclass
class Block:
    """Of one test, for each specimen: places x (n, ...), means of readings y (m,), their model, and their scatter."""

    name: str
    x: list[Array]
    y: list[Array]
    model: Model
    sigma: list[Array]
    test: StripTest | BiaxialTest | None = None

    def miss(self, trial: Trial) -> list[Array]:
        """Model less reading over the scatter, of each specimen."""
        model = self.model(trial, np.concatenate(self.x))
        parts = np.split(model, np.cumsum([len(y) for y in self.y])[:-1])
        return [(part - y) / s for part, y, s in zip(parts, self.y, self.sigma, strict=True)]


class CycleBlock(Block):
    """Records of shear in cycles, each followed from rest."""

    def miss(self, trial: Trial) -> list[Array]:
        fabric = trial.fabric
        assert fabric.shear_friction is not None
        packed = play.pack(fabric.name, fabric.shear, fabric.shear_friction)
        return [
            np.where(np.isfinite(S), play.follow(gamma, packed) - S, 0.0) / sigma
            for gamma, S, sigma in zip(self.x, self.y, self.sigma, strict=True)
        ]


def of_cycles(told: Cycles) -> CycleBlock:
    """S12 over 2 E12 in the order of the test; a reading counts by what their own fit has left."""
    gamma, stress = [x for x, _ in told.records], [S for _, S in told.records]
    sigma = max(told.residual, LEAST) * told.peak
    return CycleBlock("shear", gamma, stress, lambda trial, x: x, [np.full(len(S), sigma) for S in stress])


def of_curve(way: str, readings: list[Readings], friction: float) -> Block:
    """Stress of a curve over its strain; of the shear that is E12, and friction (Pa) comes on top."""
    scale = 2.0 if way == "shear" else 1.0

    def model(trial: Trial, strain: Array) -> Array:
        return np.asarray(getattr(trial.fabric, way).stress(scale * strain) + friction)

    return _binned(way, [one.strain for one in readings], [one.stress for one in readings], model)


def of_dots(key: str, several: list[Contraction]) -> Block:
    """Strain across over strain along."""

    def model(trial: Trial, along: Array) -> Array:
        return -trial.nu[key] * along

    return _binned(key, [one.along for one in several], [one.across for one in several], model)


def of_strips(test: StripTest) -> Block:
    """Axial stress over axial strain, as strips have it that pull evenly."""

    def model(trial: Trial, strain: Array) -> Array:
        return point.strip(trial.law, strain, test.angle)[0]

    block = _binned(test.name, [r.strain for r in test.readings], [r.stress for r in test.readings], model)
    block.test = test
    return block


def of_biaxial(test: BiaxialTest) -> Block:
    """Both stresses, as far as they were read, over both strains: those of the warp first, with 0 in a third column."""
    x, y, sigma = [], [], []
    for i in range(2):
        told = [(E, pair[i]) for E, pair in zip(test.strains, test.readings, strict=True)]
        kept = [(E, r) for E, r in told if r is not None]
        if not kept:
            continue
        lead = [E[:, 0 if test.drawn == "warp" else 1 if test.drawn == "weft" else i] for E, _ in kept]
        bins = [_bins(along) for along in lead]
        means = [_means(along, parts) for along, parts in zip(lead, bins, strict=True)]
        forces = [_means(r.stress, parts) for (_, r), parts in zip(kept, bins, strict=True)]
        scatter = _scatter(means, forces)
        for (E, _), parts in zip(kept, bins, strict=True):
            x.append(np.array([[*E[some].mean(axis=0), i] for some in parts]))
            sigma.append(np.full(len(parts), scatter))
        y += forces

    def model(trial: Trial, strain: Array) -> Array:
        S = point.biaxial(trial.law, strain[:, :2])
        return np.where(strain[:, 2] == 0, S[:, 0], S[:, 1])

    return Block(test.name, x, y, model, sigma, test)


def compare_biaxial(trial: Trial, test: BiaxialTest) -> list[Compared]:
    """Each stress of a biaxial test over the strain of a yarn that is drawn, beside the law."""
    out = []
    for i, way in enumerate(("warp", "weft")):
        lead = 0 if test.drawn == "warp" else 1 if test.drawn == "weft" else i
        told = [(E, pair[i]) for E, pair in zip(test.strains, test.readings, strict=True)]
        shown = [Readings(r.file, E[:, lead], r.stress) for E, r in told if r is not None]
        if shown:
            furthest = max(test.strains, key=lambda E: float(E.max()))[-1]
            line = np.linspace(0, 1, 61)[1:, None] * furthest
            model = line[:, lead], point.biaxial(trial.law, line)[:, i]
            out.append(Compared(f"{test.name}: {way} stress", shown, model, not test.held_out, "drawn evenly"))
    return out


def _binned(name: str, x: list[Array], y: list[Array], model: Model) -> Block:
    bins = [_bins(one) for one in x]
    x, y = ([_means(values, parts) for values, parts in zip(several, bins, strict=True)] for several in (x, y))
    return Block(name, x, y, model, [np.full(len(one), scatter) for scatter in [_scatter(x, y)] for one in y])


def _bins(x: Array) -> list[np.ndarray]:
    """Indices of readings that follow each other, as many in each; the mean of a smooth curve over one is on it."""
    order = np.argsort(x, kind="stable")
    return np.array_split(order, min(BINS, len(x)))


def _means(values: Array, parts: list[np.ndarray]) -> Array:
    return np.array([values[some].mean() for some in parts])


def _scatter(x: list[Array], y: list[Array]) -> float:
    """Standard deviation of means about one smooth curve through all specimens, where all reach.

    Noise of a load cell falls with the number of readings in a mean, the difference between specimens does not.
    """
    reach = min(float(np.abs(one).max()) for one in x)
    near = [np.abs(one) <= reach for one in x]
    t = np.concatenate([one[some] for one, some in zip(x, near, strict=True)]) / reach
    values = np.concatenate([one[some] for one, some in zip(y, near, strict=True)])
    A = t[:, None] ** np.arange(1, min(SMOOTH, max(1, len(t) // 4)) + 1)
    c, *_ = np.linalg.lstsq(A, values)
    scatter = float(np.sqrt(((A @ c - values) ** 2).sum() / max(len(t) - len(c), 1)))
    return max(scatter, LEAST * float(np.abs(values).max()))


def bootstrap(blocks: list[Block], trial: Trial, J: Array, rest: Array, draws: int, seed: int) -> Array:
    """Covariance of the unknowns from specimens that are drawn again, each fit one step of Gauss and Newton.

    J (rows, unknowns) of the residuals of the blocks, and of the `rest` (n,) after them. Few specimens draw the same
    ones again, and a single one always: no error is less than that of the fit.
    """
    misses = [[*block.miss(trial)] for block in blocks]
    r = np.concatenate([*(part for parts in misses for part in parts), rest])
    rng, steps = np.random.default_rng(seed), []
    normal = J.T @ J
    sizes = [len(part) for parts in misses for part in parts]
    for _ in range(draws):
        drawn = [np.bincount(rng.integers(len(parts), size=len(parts)), minlength=len(parts)) for parts in misses]
        weight = np.append(np.repeat(np.concatenate(drawn), sizes), np.ones(len(rest)))
        A = J * weight[:, None]
        steps.append(-np.linalg.lstsq(J.T @ A + 1e-9 * np.diag(np.diag(normal)), A.T @ r)[0])
    spread, alone = np.cov(np.array(steps).T), np.diag(np.linalg.pinv(normal))
    own = np.diag(spread)
    least = np.maximum(alone - own, 0.0)
    silent = own < 1e-12 * alone  # what no specimen tells is as vague as it is assumed
    scale = np.where(silent, 0.0, np.sqrt(1 + least / np.where(silent, 1.0, own)))
    return np.asarray(spread * scale[:, None] * scale + np.diag(np.where(silent, alone, 0.0)))
