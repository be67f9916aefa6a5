"""One fit of all that was tested: curves, Poisson's ratios, shear and what links warp and weft, by least squares.

The unknowns are the moduli of each curve at its nodes (their logarithms, for no modulus is negative; between nodes a
penalty keeps them so), the ratios that were photographed, the logarithms of `transverse` of the law with a potential,
and where shear was tested in cycles its friction, softening and unloading (`cycles`). The model of a test is the law
itself: strips of any angle that pull evenly, and biaxial specimens, at a point (`point`); strips between grips, which
do not, by that times what a simulated strip pulls over it, which is found anew until it stays. Readings that
follow each other count by the scatter of their means (`blocks`), which denser records lessen, but for the difference
between specimens. Bending shares no unknown with all this: the least squares of `bending.fit` are a block of their own.

Confidence is by the bootstrap over specimens. What the tests do not tell stays where it is assumed, and is said.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from .. import fabrics
from ..errors import InputError, StepFailed
from ..fabrics import Fabric
from ..laws import Array
from ..laws.potential import Potential
from ..laws.stability import rotate_strain
from . import blocks
from .blocks import Block, Trial
from .files.records import Strip
from .identified import WAYS, Compared, Curve, Identified
from .shear import cycles
from .tensile import curves, point
from .tensile.curves import Estimate, Readings
from .tensile.strips import StripTest, slanted

PRIOR = 1.5  # standard deviation of the logarithm of `transverse` where no test tells it
DRAWS, SEED = 300, 2010  # of the bootstrap
FAR = 1e3  # residual of a trial that has no balance
ROUNDS, SETTLED = 6, 0.005  # of simulations, and the change of their ratio that is none
FREE = 1.5  # unloading modulus of a trial over its largest loading one: no test of loading sees it
WIDER = 0.02  # change of the range of shear that is none
PLACES = 41  # of a curve, at which its modulus is kept positive
SIMULATED = 8  # displacements of a simulated strip

type Simulate = Callable[[Fabric, Strip, float, Array], Array]
"""Axial stress (Pa) of a strip between grips: fabric, strip, angle (radians), displacements (m)."""


def fit(found: Identified, simulate: Simulate | None = None) -> Identified:
    """The same with everything that couples fitted together, and with strips and biaxial tests beside their model.

    Without `simulate`, strips between grips count as if they pulled evenly, which is said. Raises InputError where
    warp, weft, a ratio or any test of shear is missing.
    """
    missing = [f"the {way} curve" for way in ("warp", "weft") if way not in found.curves]
    missing += [key for key in ("nu12", "nu21") if key not in found.poisson and key not in found.tests.assumed]
    if "shear" not in found.curves and found.bias is None and not any(slanted(one) for one in found.strips):
        missing.append("a test of shear")
    if missing:
        raise InputError(
            f"{found.tests.file}: one fit of all tests needs {', '.join(missing)} too; add the tests, or for a ratio "
            "a value under [assumed]."
        )
    return _Fit(found, simulate).solve()


class _Fit:
    def __init__(self, found: Identified, simulate: Simulate | None) -> None:
        self.simulate, self.notes = simulate, list(found.notes)
        self.strips = list(found.strips)
        self.ratios: dict[str, Callable[[Array], Array]] = {}
        if found.bias is not None:  # photographs of the yarns have told its shear already
            held = "shear" in found.curves
            bias = StripTest([], np.pi / 4, found.tests.strip, found.tests.ends, held, found.bias.readings)
            self.strips.append(bias)
        self.found = found if "shear" in found.curves else self._with_shear(found)
        self.terms = {way: len(self.found.curves[way].loading.modulus) for way in WAYS}
        self.limits = {way: self.found.curves[way].loading.limit for way in WAYS}
        self.photographed = list(self.found.poisson)
        known = self.found.curves.items()
        self.cycled = found.cycled
        self.blocks = [
            blocks.of_curve(way, one.readings, one.friction)
            for way, one in known
            if one.readings and not (self.cycled and way == "shear")
        ]
        self.blocks += [blocks.of_cycles(self.cycled)] if self.cycled else []
        self.blocks += [blocks.of_dots(key, self.found.contractions[key]) for key in self.photographed]
        self.blocks += [self._scaled(blocks.of_strips(one)) for one in self.strips if slanted(one)]
        self.blocks += [blocks.of_biaxial(one) for one in found.biaxial if not one.held_out]

    # -- unknowns -----------------------------------------------------------------------------------------------------

    def _with_shear(self, found: Identified) -> Identified:
        """A first guess of shear from the strip that is nearest to the bias, as if its yarns kept their length."""
        near = min(filter(slanted, self.strips), key=lambda one: abs(one.angle - np.pi / 4))
        slant = float(np.sin(2 * near.angle))
        loading = curves.loading([Readings(r.file, r.strain / slant, r.stress * slant / 2) for r in near.readings])
        reach = found.tests.strip.gauge_length * (np.sqrt(1 + 2 * loading.limit) - 1)
        shear = Curve(loading, None, [], [], "from strips off the yarns")
        moved = {"bias": float(reach)} | found.displacement
        return replace(found, curves={**found.curves, "shear": shear}, displacement=moved)

    def _start(self) -> Array:
        logs = []
        for way in WAYS:
            D = self.found.curves[way].loading.tangent(np.linspace(0, self.limits[way], self.terms[way]))
            logs.append(np.log(np.maximum(D, 0.02 * np.abs(D).mean())))
        nu = [self.found.ratio(key) for key in self.photographed]
        return np.concatenate(
            [*logs, nu, np.log([fabrics.data.TRANSVERSE] * 2), self.cycled.theta if self.cycled else []]
        )

    def _bounds(self) -> tuple[Array, Array]:
        low, high = self._split(np.full(self.unknowns, -np.inf)), self._split(np.full(self.unknowns, np.inf))
        if self.cycled:
            low["cycles"][1:], high["cycles"][1:] = cycles.bounds()
        return np.concatenate([*low.values()]), np.concatenate([*high.values()])

    def _split(self, theta: Array) -> dict[str, Array]:
        ends = np.cumsum([*(self.terms[way] for way in WAYS), len(self.photographed), 2])
        return dict(zip((*WAYS, "nu", "transverse", "cycles"), np.split(theta, ends), strict=True))

    def _moduli(self, way: str, parts: dict[str, Array]) -> tuple[Array, Array]:
        """Coefficients of a curve, and its modulus at `PLACES`."""
        c = curves.from_nodes(self.terms[way], self.limits[way]) @ np.exp(parts[way])
        return c, np.asarray(np.vander(np.linspace(0, self.limits[way], PLACES), len(c), increasing=True) @ c)

    def _trial(self, theta: Array) -> Trial:
        """Raises InputError for one that is no fabric."""
        parts, found = self._split(theta), self.found
        made: dict[str, Any] = dict(found.tests.texts)
        for way in WAYS:
            (c, D), k = self._moduli(way, parts), 2 if way == "shear" else 1
            modulus = tuple(float(x) / k ** (i + 1) for i, x in enumerate(c))
            made[way] = fabrics.Curve(modulus, FREE * float(np.abs(D).max()) / k, k * self.limits[way])
        friction = found.friction
        if self.cycled:
            friction = cycles.numbers(parts["cycles"][1:], self.cycled.peak)
            made["shear"] = replace(made["shear"], unloading=float(np.exp(parts["cycles"][0])))
            made["shear"], _ = cycles.stiffened(made["shear"], friction)
        nu = {key: found.ratio(key) for key in ("nu12", "nu21")}
        nu |= {key: max(float(value), 0.0) for key, value in zip(self.photographed, parts["nu"], strict=True)}
        first, second = np.exp(np.clip(parts["transverse"], -12, 8))
        strip = found.tests.strip
        fabric = Fabric(
            **made, thickness=strip.thickness, density=found.tests.density,
            poisson={"measured": (nu["nu12"], nu["nu21"])}, gauge_length=strip.gauge_length, width=strip.width,
            displacement=found.displacement, sources={}, transverse=(float(first), float(second)),
            shear_friction=friction,
        )  # fmt: skip
        return Trial(fabric, Potential(fabric), nu)

    # -- the fit ------------------------------------------------------------------------------------------------------

    def _residual(self, theta: Array) -> Array:
        try:
            trial = self._trial(theta)
        except InputError:
            return np.full(self.size, FAR)
        miss = np.concatenate([*(part for block in self.blocks for part in block.miss(trial)), self._rest(theta)])
        return np.where(np.isfinite(miss), np.clip(miss, -FAR, FAR), FAR)

    def _rest(self, theta: Array) -> Array:
        """What is assumed of `transverse`, and moduli that must be positive."""
        parts = self._split(theta)
        rows = [(parts["transverse"] - np.log(fabrics.data.TRANSVERSE)) / PRIOR]
        rows += [cycles.assumed(parts["cycles"][1:])] if self.cycled else []
        for way in WAYS:
            D = self._moduli(way, parts)[1]
            rows.append(1e3 * np.minimum(D / np.abs(D).mean() - 2 * curves.LEAST, 0.0))
        return np.concatenate(rows)

    def solve(self) -> Identified:
        theta = self._start()
        self.unknowns = len(theta)
        self.size = sum(len(y) for block in self.blocks for y in block.y) + len(self._rest(theta))
        for _ in range(ROUNDS):
            answer = least_squares(
                self._residual, theta, bounds=self._bounds(), x_scale="jac", xtol=1e-8, ftol=1e-8, max_nfev=60
            )
            theta = answer.x
            wider = self._widened(theta)
            if not self._simulated(theta) and wider is None:
                break
            theta = theta if wider is None else wider
        else:
            self.notes.append("the simulated strips still changed at the end of the fit; look at their panels.")
        trial = self._trial(theta)
        spread = blocks.bootstrap(self.blocks, trial, answer.jac, self._rest(theta), DRAWS, SEED)
        return self._answer(theta, trial, spread)

    def _widened(self, theta: Array) -> Array | None:
        """The same over the range of shear that strips had, if they alone tell it; None if that is the present one."""
        used, old = [one for one in self.strips if slanted(one)], self.limits["shear"]
        if self.found.curves["shear"].readings or not used:
            return None
        law, most = self._trial(theta).law, 0.0
        for one in used:
            strain = point.strip(law, np.array([np.median([r.strain.max() for r in one.readings])]), one.angle)[1]
            most = max(most, abs(float(rotate_strain(strain, -one.angle)[0, 2])) / 2)
        if not np.isfinite(most) or abs(most / old - 1) < WIDER:
            return None
        c, _ = self._moduli("shear", self._split(theta))
        D = np.polynomial.polynomial.polyval(np.linspace(0, most, self.terms["shear"]), c)
        self.limits["shear"] = most
        parts = self._split(theta) | {"shear": np.log(np.maximum(D, 0.05 * np.abs(D).max()))}
        return np.concatenate([*parts.values()])

    def _scaled(self, block: Block) -> Block:
        """The same with a model that is scaled as simulated strips have it, once they have been."""
        even, name = block.model, block.name
        block.model = lambda trial, E: even(trial, E) * (self.ratios[name](E) if name in self.ratios else 1.0)
        return block

    def _simulated(self, theta: Array) -> bool:
        """Simulate the strips between grips; whether any changed its ratio to one that pulls evenly."""
        clamped = [one for one in self.strips if slanted(one) and one.ends == "clamped"]
        if clamped and self.simulate is None:
            note = "strips between grips count as if they pulled evenly, as nothing simulates them."
            self.notes += [] if note in self.notes else [note]
            return False
        changed = False
        for one in clamped:
            E, ratio = self._ratio(self._trial(theta), one)
            old = self.ratios[one.name](E) if one.name in self.ratios else np.ones(len(E))
            changed |= bool(np.abs(ratio / old - 1).max() > SETTLED)
            self.ratios[one.name] = _through(E, ratio)
        return changed

    def _ratio(self, trial: Trial, one: StripTest) -> tuple[Array, Array]:
        """Axial strains, and what a simulated strip pulls there over one that pulls evenly."""
        assert self.simulate is not None
        E = np.linspace(0, max(float(r.strain.max()) for r in one.readings), SIMULATED + 1)[1:]
        d = one.strip.gauge_length * (np.sqrt(1 + 2 * E) - 1)
        try:
            return E, self.simulate(trial.fabric, one.strip, one.angle, d) / point.strip(trial.law, E, one.angle)[0]
        except StepFailed as error:
            raise StepFailed(f"{one.name}: the strip that the fit simulates stops: {error}") from error

    # -- the answer ---------------------------------------------------------------------------------------------------

    def _answer(self, theta: Array, trial: Trial, spread: Array) -> Identified:
        found, parts, places = self.found, self._split(theta), self._split(np.arange(len(theta)))  # type: ignore[arg-type]
        new = {}
        for way in WAYS:
            old, index = found.curves[way], places[way]
            M = curves.from_nodes(self.terms[way], self.limits[way]) * np.exp(parts[way])
            C, c = M @ spread[np.ix_(index, index)] @ M.T, M.sum(axis=1)
            top = float(curves.powers(np.array(self.limits[way]), len(c)) @ c)
            fitted = replace(
                old.loading, limit=self.limits[way], modulus=tuple(map(float, c)),
                errors=tuple(map(float, np.sqrt(np.diag(C)))),
                spread=curves.spread(c, C, self.limits[way]),
            )  # fmt: skip
            misses = [r.stress - old.friction - fitted.stress(r.strain) for r in old.readings]
            miss = float(np.sqrt(np.mean([np.mean(m**2) for m in misses]))) / top if misses else 0.0
            fitted = replace(fitted, residual=miss or old.loading.residual)
            new[way] = replace(old, loading=fitted, how=f"{old.how}, in one fit of all tests")
        if self.cycled and trial.fabric.shear_friction:
            value, i = 2 * trial.fabric.shear.unloading, places["cycles"][0]
            back = Estimate(value, value * float(np.sqrt(spread[i, i])), len(self.cycled.records))
            new["shear"] = replace(new["shear"], unloading=back, friction=trial.fabric.shear_friction.friction)
        poisson = {
            key: Estimate(trial.nu[key], float(np.sqrt(spread[i, i])), found.poisson[key].specimens)
            for key, i in zip(self.photographed, places["nu"], strict=True)
        }
        count = sum(len(block.y) for block in self.blocks if block.test)
        across = {}
        for way, log, i, most in zip(
            ("warp", "weft"), parts["transverse"], places["transverse"], trial.law.most_transverse, strict=True
        ):
            value = min(float(np.exp(log)), 0.999 * most)
            across[way] = Estimate(value, value * float(np.sqrt(spread[i, i])), count)
        compared = [one for test in self.strips if test.off_yarns or test.held_out for one in self._strip(trial, test)]
        compared += [one for test in found.biaxial for one in blocks.compare_biaxial(trial, test)]
        return replace(
            found, curves=new, poisson=poisson, transverse=across, compared=tuple(compared), notes=self.notes,
            friction=trial.fabric.shear_friction,
        )  # fmt: skip

    def _strip(self, trial: Trial, test: StripTest) -> list[Compared]:
        """A test of strips beside the law."""
        E = np.linspace(0, max(float(r.strain.max()) for r in test.readings), 61)[1:]
        S, how = point.strip(trial.law, E, test.angle)[0], "pulls evenly"
        if test.off_yarns and test.ends == "clamped" and self.simulate is not None:
            S, how = S * _through(*self._ratio(trial, test))(E), "simulated"
        return [Compared(test.name, test.readings, (E, S), not test.held_out, how)]


def _through(E: Array, ratio: Array) -> Callable[[Array], Array]:
    """A ratio at any strain; constant before the first and after the last."""
    curve = PchipInterpolator(E, ratio)
    return lambda x: np.asarray(curve(np.clip(x, E[0], E[-1])))
