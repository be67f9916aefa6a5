"""What one material point tells, without a mesh: tables of 7.1, the linear law of 7.4, and closed loops of strain."""

import closed_loops
import numpy as np

from fabric_fenicsx import fabrics
from fabric_fenicsx.laws import driver, named
from fabric_fenicsx.laws.printed import Printed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven

YARNS = {"warp": 0, "weft": 1}


def _down(curve, steps):
    """Strains of first loading, and down until just past where the stress is gone."""
    down = float(curve.stress(curve.limit)) / curve.unloading * 1.1
    return np.linspace(0, curve.limit, steps + 1), np.linspace(curve.limit, curve.limit - down, steps + 1)


def _fitted(strain, stress, terms):
    """Coefficients (MPa) of the modulus whose integral is the stress: what Table 7.1 lists, found again."""
    powers = np.arange(1, terms + 1)
    scaled = (strain / strain.max())[:, None] ** powers
    found = np.linalg.lstsq(scaled, stress, rcond=None)[0]
    return (found * powers / strain.max() ** powers / 1e6).tolist()


def _slope(strain, stress):
    """Steepest slope (MPa) of the way down, while there is stress."""
    pulled = stress[:-1] > 0.05 * stress[0]
    return float((np.diff(stress) / np.diff(strain))[pulled].max() / 1e6)


def material(fabric, steps):
    """Every curve of Tables 7.1 and 7.3 and Poisson's ratios, as the continuous law answers; other laws beside it."""
    given = fabrics.load(fabric)
    law, printed, linear, found = Woven(given), Printed(given), StVenantKirchhoff.from_fabric(given), {}
    for way, yarn in YARNS.items():
        curve = getattr(given, way)
        up, down = _down(curve, steps)
        path = driver.uniaxial(law, np.concatenate([up[1:], down[1:]]), direction=yarn)
        E, S, across = path.strain[:, yarn], path.stress[:, yarn], path.strain[:, 1 - yarn]
        stiff, printed_up = (driver.uniaxial(other, up[1:], direction=yarn) for other in (linear, printed))
        found[way] = {
            "strain": E.tolist(),
            "stress_MPa": (S / 1e6).tolist(),
            "fitted_MPa": (curve.stress(up[1:]) / 1e6).tolist(),
            "transverse": across.tolist(),
            "printed_MPa": (printed_up.stress[:, yarn] / 1e6).tolist(),
            "linear_MPa": (stiff.stress[:, yarn] / 1e6).tolist(),
            "loading_MPa": _fitted(E[:steps], S[:steps], np.count_nonzero(np.trim_zeros(curve.modulus, "b")) or 1),
            "unloading_MPa": _slope(E[steps - 1 :], S[steps - 1 :]),
            "poisson": float(-across[steps - 1] / E[steps - 1]),
        }
    up, down = _down(given.shear, steps)
    gamma = np.concatenate([up[1:], down[1:]])
    S12 = driver.run(law, np.column_stack([0 * gamma, 0 * gamma, gamma])).stress[:, 2]
    terms = np.count_nonzero(np.trim_zeros(given.shear.modulus, "b"))
    found["shear"] = {
        "strain": (gamma / 2).tolist(),
        "stress_MPa": (S12 / 1e6).tolist(),
        "fitted_MPa": (given.shear.stress(up[1:]) / 1e6).tolist(),
        "loading_MPa": _fitted(gamma[:steps] / 2, S12[:steps], terms),
        "unloading_MPa": 2 * _slope(gamma[steps - 1 :], S12[steps - 1 :]),
    }
    little = driver.uniaxial(law, np.array([1e-6]), angle=np.pi / 4)
    found["poisson"] = given.poisson
    found["density_kg_per_m3"], found["thickness_mm"] = given.density, given.thickness * 1e3
    found["initial_MPa"] = {
        "warp": float(given.warp.modulus[0] / 1e6),
        "weft": float(given.weft.modulus[0] / 1e6),
        "bias": float(little.stress[0, 0] / 1e-6 / 1e6),
        "shear": float(given.shear.modulus[0] / 1e6),
    }
    return found


def laws(fabric, steps, trials, generations, parts):
    """Every law that was fitted to a fabric: curves, contractions, equal strain along both yarns, the worst loop."""
    given, found = fabrics.load(fabric), {}
    for name, kind in named.MEASURED.items():
        law = kind(given)
        found[name] = {"biaxial": {}, "loop": closed_loops.worst(law, trials, generations, parts)}
        half = np.linspace(0, min(given.warp.limit, given.weft.limit) / 2, steps + 1)[1:]
        both = driver.run(law, np.column_stack([half, half, 0 * half])).stress
        for (way, yarn), nu in zip(YARNS.items(), given.poisson["measured"], strict=True):
            curve = getattr(given, way)
            path = driver.uniaxial(law, np.linspace(0, curve.limit, steps + 1)[1:], direction=yarn)
            E, S, across = path.strain[:, yarn], path.stress[:, yarn], path.strain[:, 1 - yarn]
            miss = 100 * (S - curve.stress(E)) / curve.stress(curve.limit)
            found[name][way] = {
                "misfit_percent": float(miss[np.abs(miss).argmax()]),
                "poisson": float(-across[-1] / E[-1]),
                "nu": nu,
            }
            found[name]["biaxial"][way] = float(both[-1, yarn] / curve.stress(half[-1]))
    return found


def steps_at_a_point(fabric, counts):
    """Error (%) of the stress at the end of a uniaxial test by the printed law, for so many increments."""
    given, found = fabrics.load(fabric), {}
    for way, yarn in YARNS.items():
        curve = getattr(given, way)
        errors = []
        for law in Printed(given), Woven(given):
            ends = [driver.uniaxial(law, np.linspace(0, curve.limit, n + 1)[1:], yarn).stress[-1, yarn] for n in counts]
            errors.append((100 * (np.array(ends) / curve.stress(curve.limit) - 1)).tolist())
        found[way] = {"steps": list(counts), "error_percent": errors[0], "continuous_error_percent": errors[1]}
    return found


def loops(fabric, trials, generations, parts):
    """The worst closed loop of the strains E11 and E22 that a search finds, for every coupling of the law."""
    given, found = fabrics.load(fabric), {}
    kinds = [("measured", "measured"), ("measured", "reciprocal")]
    if given.poisson["lowered"] != given.poisson["measured"]:
        kinds.append(("lowered", "measured"))
    for poisson, coupling in kinds:
        law = Woven(given, poisson, coupling=coupling)
        found[f"{poisson} {coupling}"] = closed_loops.worst(law, trials, generations, parts)
    warp = given.warp
    E = np.linspace(0, warp.limit, 401)
    found["warp_test_kJ_per_m3"] = float(np.trapezoid(warp.stress(E), E) / 1e3)
    return found
