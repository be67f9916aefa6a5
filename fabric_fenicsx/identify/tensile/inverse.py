"""Shear from a bias test without photographs: the curve with which the simulated strip pulls like the measured one.

The only part of the identification that needs FEniCSx.

Bilinear quadrilaterals lock: the yarns at 45 degrees can hardly stretch, and between grips 9 x 3 of them pull by 20 to
166 % too much at the end of the test. Biquadratic ones integrated at 2 x 2 points do not: 18 x 6 of them pull by 1 to
2 % too little (`tests/test_records.py` compares them). They have modes without energy that the grips hold; where the
ends may contract nothing would, but there the strip is homogeneous, and any element solves it exactly.
"""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.optimize import least_squares, minimize_scalar

from ... import fabrics, specimen
from ...errors import InputError, StepFailed
from ...laws import Array
from ...laws.woven import Woven
from ...solvers import statics
from ...surfaces import meshing
from ..identified import Curve, Identified
from . import curves
from .curves import Estimate, Readings
from .strips import Ends

ELEMENTS = {"clamped": ((18, 6), 2, 2), "free": ((9, 3), 1, 2)}
"""Ends -> cells along and across, degree of the displacements, and of what is integrated exactly."""
STEP = 1e-3  # of the logarithms, for a derivative
SHIFTS = (0.0, -1.0, 1.0, -2.0, 2.0)  # of the logarithm of the first guess, until a strip of it can be pulled
FAR = 100.0  # misfit of a trial whose strip cannot be pulled, over the peak stress
NODES = 4  # as many moduli as a quartic stress has coefficients
SMOOTH = 0.01  # weight on second differences of the logarithms of the moduli: what the test does not tell stays even
DOWN = 0.3  # part of the peak stress down to which the way back is followed


def shear(
    found: Identified, mesh: str | Path, cells: tuple[int, int] | None = None, *, ends: Ends = "clamped", steps: int = 8
) -> Identified:
    """The same, with the shear curve found on the strip of `meshes/strip.geo`, or of one with its numbers and groups.

    The unknowns are dS12/dE12 at four strains, and then the unloading modulus; the data the fitted force of the bias
    test at `steps` displacements, and its readings on the way back. The curve ends at the largest strain in the strip.
    A trial whose strip cannot be pulled is a bad one, and no error. Raises InputError where there is no bias test, warp
    or weft curve, or Poisson's ratio; StepFailed where no strip can be pulled to the end of the test.
    """
    missing = [way for way in ("warp", "weft") if way not in found.curves]
    missing += [key for key in ("nu12", "nu21") if key not in found.poisson and key not in found.tests.assumed]
    if found.bias is None or missing:
        what = ", ".join(missing) or "the bias test"
        raise InputError(f"{found.tests.file}: an inverse simulation of the bias test needs {what} too; add the tests.")
    return _Search(found, Path(mesh), cells, ends, steps).solve()


def _smoothed(readings: Sequence[Readings]) -> np.polynomial.Polynomial:
    """Axial stress over axial strain, a polynomial of higher degree than the fit where there are many readings."""
    E, S = (np.concatenate(parts) for parts in zip(*((one.strain, one.stress) for one in readings), strict=True))
    degree = int(np.clip(len(E) // 10, 2, 8))
    c, *_ = np.linalg.lstsq((E / E.max())[:, None] ** np.arange(1, degree + 1), S)
    return np.polynomial.Polynomial([0.0, *(c / E.max() ** np.arange(1, degree + 1))])


class _Search:
    def __init__(self, found: Identified, mesh: Path, cells: tuple[int, int] | None, ends: Ends, steps: int) -> None:
        assert found.bias is not None
        self.found, self.bias, self.ends = found, found.bias, ends
        self.t = found.tests
        strip = self.t.strip
        (nx, ny), self.degree, self.quadrature = ELEMENTS[ends]
        nx, ny = cells or (nx, ny)
        self.domain = meshing.read(
            mesh, MPI.COMM_SELF, gdim=2, orient=False, nx=nx, ny=ny, length=strip.gauge_length, width=strip.width
        )
        self.d = np.linspace(0, found.displacement["bias"], steps + 1)[1:]
        self.E = curves.green_lagrange(self.d, strip.gauge_length)
        self.target = _smoothed(self.bias.readings)(self.E)
        # nets of inextensible yarns shear in the middle only, over a length shorter by the width
        free = max(strip.gauge_length - strip.width, strip.width) if ends == "clamped" else strip.gauge_length
        self.limit = float(curves.green_lagrange(self.d[-1], free))
        self.largest = 0.0
        self.scene: specimen.Strip | None = None

    def solve(self) -> Identified:
        guess = np.full(NODES, np.log(self.target[-1] / 2 / self.E[-1]))
        for _ in range(2):  # the second time over the range that the first one has found in the strip
            answer = least_squares(
                self._misfit, self._start(guess), self._slopes, xtol=1e-4, ftol=1e-5, max_nfev=20, x_scale=1.0
            )
            nodes, was = answer.x, self.limit
            self._misfit(nodes)  # for the largest strain; the last trial may have been another
            if abs(self.largest - was) < 0.02 * was:
                break
            self.limit = self.largest
            inside = np.linspace(0, min(self.limit / was, 1.0), NODES)
            guess = np.log(np.maximum(self._cubic(nodes)(inside), 1e-3 * np.exp(nodes.max())))
        E12 = np.linspace(0, self.limit, 201)
        readings = Readings("inverse simulation", E12, self._cubic(nodes).integ()(E12 / self.limit) * self.limit)
        fit = curves.loading([readings])
        # what the scatter of the measured curve, and the misfit that is left, mean for the moduli
        misfit = answer.fun[: len(self.d)]
        rms = float(np.sqrt(np.mean(misfit**2)))
        spread = float(np.hypot(rms, self.bias.loading.spread))
        logs = np.linalg.pinv(answer.jac.T @ answer.jac) * spread**2
        M = self._to_coefficients() * np.exp(nodes) / self.limit ** np.arange(NODES)[:, None]
        errors = np.sqrt(np.diag(M @ logs @ M.T))[: len(fit.modulus)]
        fit = replace(fit, errors=tuple(errors), residual=rms, spread=spread)
        unloading = self._unloading(fit.modulus) if self.bias.unloading else None
        pulled = self.E, self.target + misfit * self.target[-1]
        curve = Curve(fit, unloading, [], [], "inverse simulation of the bias test", pulled)
        return replace(self.found, curves={**self.found.curves, "shear": curve})

    def _to_coefficients(self) -> Array:
        """From the moduli at the nodes to the coefficients over strain / limit."""
        return np.asarray(np.linalg.inv(np.vander(np.linspace(0, 1, NODES), increasing=True)))

    def _cubic(self, logs: Array) -> np.polynomial.Polynomial:
        """dS12/dE12 (Pa) over E12 / limit."""
        return np.polynomial.Polynomial(self._to_coefficients() @ np.exp(logs))

    def _start(self, guess: Array) -> Array:
        """A guess, or one near it, whose strip can be pulled."""
        for shift in SHIFTS:
            if self._try(guess + shift) is not None:
                return guess + shift
        raise StepFailed(
            f"{self.t.file}: no strip can be pulled to the end of the bias test; check width, thickness and units, or "
            "photograph the yarns instead."
        )

    def _try(self, logs: Array) -> Array | None:
        """Misfit (steps + NODES - 2,) over the peak stress, or None where the strip of a trial cannot be pulled."""
        modulus = self._to_coefficients() @ np.exp(logs) / self.limit ** np.arange(NODES)
        try:
            stress = self._pull(self._fabric(modulus, 0.0), self.d)
        except (InputError, StepFailed):  # of the trial curve, not of the user
            return None
        miss = np.concatenate([(stress - self.target) / self.target[-1], SMOOTH * np.diff(logs, 2)])
        return miss if np.isfinite(miss).all() else None

    def _misfit(self, logs: Array) -> Array:
        miss = self._try(logs)
        return np.full(len(self.d) + NODES - 2, FAR) if miss is None else miss

    def _slopes(self, logs: Array) -> Array:
        """Derivative of the misfit by differences to the side on which the strip can be pulled."""
        here, out = self._misfit(logs), np.zeros((len(self.d) + NODES - 2, NODES))
        for k, step in enumerate(STEP * np.eye(NODES)):
            for sign in (1, -1):
                there = self._try(logs + sign * step)
                if there is not None:
                    out[:, k] = sign * (there - here) / STEP
                    break
        return out

    def _fabric(self, modulus: Array | tuple[float, ...], unloading: float) -> fabrics.Fabric:
        """The fabric with dS12/dE12 (Pa) as powers of E12 over the present range, and an unloading modulus like it."""
        found, strip = self.found, self.t.strip
        warp, weft = (
            fabrics.Curve(found.curves[w].loading.modulus, found.unloading(w), found.curves[w].loading.limit)
            for w in ("warp", "weft")
        )
        shear = fabrics.Curve(
            tuple(c / 2 ** (k + 1) for k, c in enumerate(modulus)),
            max(unloading, float(modulus[0])) / 2,
            2 * self.limit,
        )
        ratios, texts = (found.ratio("nu12"), found.ratio("nu21")), self.t.texts
        return fabrics.Fabric(
            name=texts["name"],
            label=texts["label"],
            material=texts["material"],
            weave=texts["weave"],
            thickness=strip.thickness,
            density=self.t.density,
            warp=warp,
            weft=weft,
            shear=shear,
            poisson={"measured": ratios},
            gauge_length=strip.gauge_length,
            width=strip.width,
            displacement=found.displacement,
            sources={},
            bending=None,
        )

    def _pull(self, fabric: fabrics.Fabric, path: Array) -> Array:
        """Axial stress (Pa), (3.1), of the strip at the displacements of a path; leaves its largest E12."""
        strip = self.t.strip
        scene, forces = self.scene, []
        if scene is None:
            scene = self.scene = specimen.strip(
                self.domain,
                fabric,
                Woven(fabric),
                np.pi / 4,
                ends=self.ends,
                degree=self.degree,
                quadrature=self.quadrature,
            )
        else:
            scene.renew(Woven(fabric))
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*is beyond the measured")
            self.largest = 0.0
            for _ in statics.march(scene.solver, scene.pull, list(path)):
                forces.append(scene.solver.reaction(scene.ends[1]))
                self.largest = max(self.largest, float(np.abs(scene.points.strain[..., 2]).max()) / 2)
        return curves.piola_kirchhoff(np.array(forces), path, strip.gauge_length, strip.area)

    def _unloading(self, modulus: tuple[float, ...]) -> Estimate | None:
        """The modulus (Pa, of E12) with which the strip comes back like the specimens; None if it is out of reach."""
        measured, top = self.bias.unloading, float(self.target[-1])
        assert measured is not None
        low = self.E[-1] - (1 - DOWN) * top / measured.value
        E, S = (np.concatenate(parts) for parts in zip(*self.bias.ways_back, strict=True))
        used = (low < E) & (self.E[-1] > E)
        there, back = self.d[:: max(1, len(self.d) // 2)], np.linspace(self.E[-1], low, 13)
        back = self.t.strip.gauge_length * (np.sqrt(1 + 2 * back) - 1)
        path = np.concatenate([there[there < self.d[-1]], back])

        def miss(log: float) -> float:
            try:
                stress = self._pull(self._fabric(modulus, float(np.exp(log))), path)[-13:]
            except (InputError, StepFailed):
                return FAR
            strain = curves.green_lagrange(back, self.t.strip.gauge_length)
            return float(np.mean((np.interp(E[used], strain[::-1], stress[::-1]) - S[used]) ** 2)) / top**2

        least = np.polynomial.polynomial.polyval(self.limit * np.linspace(0, 1, 101), modulus).max()
        bounds = np.log(least), np.log(100 * least)
        answer = minimize_scalar(miss, bounds=bounds, method="bounded", options={"xatol": 1e-3})
        if answer.fun >= FAR or min(answer.x - bounds[0], bounds[1] - answer.x) < 2e-3:
            return None
        value = float(np.exp(answer.x))
        return Estimate(value, value * measured.error / measured.value, measured.specimens)
