"""What `stability.py` tries: each trial is a call, and what is to come of it.

A call says in a few words what it found, and whether that was right. It raises InputError or StepFailed where the
package refuses or stops; after StepFailed the last good state must be in place, which is looked at before.
"""

import itertools
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shell_cases
import shell_model
from mpi4py import MPI

from fabric_fenicsx import fabrics, sheet, specimen
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.printed import Printed
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

COMM = MPI.COMM_SELF
BLEND = fabrics.load("blend")
G = BLEND.shear.modulus[0]
ANY, WORKS, REFUSED = "any", "works", "refused"
TOLD = "told"  # beyond a limit: as ANY, or inaccurate by what the account of energies tells


@dataclass(frozen=True)
class Trial:
    """What is tried, the call that does it, and what must come of it: WORKS, REFUSED, or ANY but a fault."""

    tried: str
    call: Callable[[], tuple[str, bool]]
    wanted: str = WORKS


class NotRestored(Exception):
    """A step failed, and the state that it left behind is not the last good one."""


def scaled(curve, factor):
    """A curve of stress, times a factor."""
    return fabrics.Curve(tuple(factor * c for c in curve.modulus), factor * curve.unloading, curve.limit)


def pulled(path, fabric=BLEND, law=Woven, angle=0.0, ends="free", cells=(9, 3), skew=0.0):
    """Pull a strip along a path of displacements, m: the strip, Newton iterations and cuts."""
    numbers = dict(zip(("nx", "ny"), cells, strict=True), length=fabric.gauge_length, width=fabric.width)
    domain = meshing.read(meshing.MESHES / "strip.geo", COMM, gdim=2, **numbers)
    if skew:
        shell_model.move_nodes(domain.mesh, skew, 1.0, numbers)
    strip = specimen.strip(domain, fabric, law(fabric), np.radians(angle), ends=ends)
    iterations = cuts = 0
    try:
        for step in statics.march(strip.solver, strip.pull, path):
            iterations, cuts = iterations + step.newton_iterations, cuts + step.step_cuts
    except StepFailed:
        try:
            again = strip.solver.solve()  # from the last good state, at its load
        except StepFailed as error:
            raise NotRestored(str(error)) from None
        if again > 2 or not np.isfinite(strip.u.x.array).all():
            raise NotRestored(f"{again} iterations are needed at the last good load") from None
        raise
    return strip, iterations, cuts


def yarn_test(tolerance=0.005, **settings):
    """Pull a strip with free ends along the warp, and hold its force against the fitted curve."""
    steps, reach = settings.pop("steps", 10), settings.pop("reach", None)
    fabric = settings.get("fabric", BLEND)
    end = reach * fabric.gauge_length if reach else fabric.displacement["warp"]
    strip, iterations, cuts = pulled(np.linspace(0, end, steps + 1)[1:], **settings)
    d = end / fabric.gauge_length
    stress = strip.solver.reaction(strip.ends[1]) / (fabric.width * fabric.thickness * (1 + d))
    error = stress / float(fabric.warp.stress(d + d * d / 2)) - 1
    return f"{100 * error:+.3f} % off the fitted curve, {iterations} iterations, {cuts} cuts", abs(error) <= tolerance


def cycle(turns=(1.0, 0.0), steps=8, way="warp", **settings):
    """Pull a strip out and back, in this many steps a turn."""
    fabric, path = settings.get("fabric", BLEND), [0.0]
    for turn in turns:
        path += [*np.linspace(path[-1], turn * fabric.displacement[way], steps + 1)[1:]]
    strip, iterations, cuts = pulled(path[1:], **settings)
    finite = bool(np.isfinite(strip.points.stress).all())
    return f"{iterations / (len(path) - 1):.1f} iterations a step, {cuts} cuts", finite


# -- the subjects ------------------------------------------------------------------------------------------------------


def thickness(quick):
    """End shear of a strip of L = 10, against the elastica."""

    def bend(element, slender):
        settings = shell_model.Settings(element, 16, 10 * slender)
        case = shell_cases.end_shear(settings, COMM)
        table, stopped = case.run()
        if stopped:
            raise StepFailed(stopped)
        error = table.rows[-1]["W_tip"] / case.reference["W_tip"][-1] - 1
        cuts = sum(row["step_cuts"] for row in table.rows)
        return f"tip {100 * error:+.2f} % off the elastica, {cuts} cuts", abs(error) <= 0.01

    # that of blend on the 2 m of the drape
    cloth = BLEND.thickness / 2.0
    for slender in (1e-2, 1e-4) if quick else (1e-1, 1e-2, 1e-3, cloth, 1e-4, 1e-5, 1e-6):
        for element in ("regge", "mitc4"):
            yield Trial(f"{element}, h/L = {slender:.2g}", lambda e=element, s=slender: bend(e, s))


def yarns(quick):
    """Stiffness of the warp alone, times a factor."""
    for factor in (1e-2, 1e4) if quick else (1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4):
        fabric = replace(BLEND, warp=scaled(BLEND.warp, factor))
        yield Trial(f"warp x {factor:g}, free", lambda f=fabric: yarn_test(fabric=f))
        if not quick:
            yield Trial(f"warp x {factor:g}, bias", lambda f=fabric: cycle(fabric=f, angle=45.0, way="bias"), ANY)


def poisson(quick):
    """Both of Poisson's ratios, up to a product of 1."""
    for product in (0.99, 1.0) if quick else (0.5, 0.9, 0.99, 0.999, 1.0):
        nu = float(np.sqrt(product))
        fabric, wanted = replace(BLEND, poisson={"measured": (nu, nu)}), WORKS if product < 1 else REFUSED
        yield Trial(f"nu12 nu21 = {product:g}, free", lambda f=fabric: yarn_test(fabric=f), wanted)
        for law in (Woven, Potential) if not quick and product < 1 else ():
            name = f"nu12 nu21 = {product:g}, clamped, {law.__name__}"
            yield Trial(name, lambda f=fabric, n=law: cycle(fabric=f, law=n, ends="clamped"), ANY)


def slack(quick):
    """One family of yarns unloads while the other is slack, at a point."""

    def unload(law, warp_first):
        legs = [(0.0, -0.05), (0.1, -0.05), (-0.02, -0.05), (-0.02, 0.1), (-0.02, -0.04), (0.08, 0.06), (0.0, 0.0)]
        corners = np.array([(0.0, 0.0), *legs])[:, :: 1 if warp_first else -1]
        path = np.concatenate([np.linspace(a, b, 41)[1:] for a, b in itertools.pairwise(corners)])
        result = driver.run(law(BLEND), np.column_stack([path, np.zeros(len(path))]))
        return f"largest stress {np.abs(result.stress).max() / 1e6:.1f} MPa", bool(np.isfinite(result.tangent).all())

    for law in (Woven, Printed):
        for first in (True, False):
            name = "warp unloads, weft slack" if first else "weft unloads, warp slack"
            yield Trial(f"{law.__name__}: {name}, then reverse", lambda n=law, f=first: unload(n, f))


def far(quick):
    """Strains beyond the calibrated range (blend: 0.22 along the warp)."""
    for reach in (0.5,) if quick else (0.2, 0.3, 0.4, 0.5, 1.0):
        yield Trial(f"warp, to {100 * reach:g} % and the curve's tangent", lambda r=reach: yarn_test(reach=r, steps=20))
    if not quick:
        turns = 0.5 * BLEND.gauge_length / BLEND.displacement["bias"]
        yield Trial("bias, to 50 % and back", lambda: cycle((turns, 0.0), 40, "bias", angle=45.0), ANY)


def reversals(quick):
    """40 reversals of random amplitude."""

    def point(law, seed):
        ends = np.random.default_rng(seed).uniform(-0.02, 0.2, 41) * np.resize([1, 0.3], 41)
        path = np.concatenate([np.linspace(a, b, 6)[1:] for a, b in zip([0, *ends[:-1]], ends, strict=True)])
        driver.uniaxial(law(BLEND), path, angle=np.radians(30.0))
        return f"{len(path)} steps, uniaxial at 30 degrees", True

    for law in (Woven,) if quick else (Woven, Potential, Printed):
        yield Trial(f"{law.__name__} at a point", lambda n=law: point(n, 1), ANY if law is Printed else WORKS)
    turns = np.random.default_rng(2).uniform(0.0, 1.0, 10 if quick else 40)
    for way, angle in (("warp", 0.0),) if quick else (("warp", 0.0), ("bias", 45.0)):
        yield Trial(f"{len(turns)} on a strip, {way}", lambda w=way, a=angle: cycle(turns, 4, w, angle=a))


def rotation(quick):
    """A sheet of fabric is carried three times round by one of its ends."""

    def carry(steps):
        domain = meshing.read(meshing.MESHES / "strip.geo", COMM, gdim=3, nx=4, ny=2, length=0.2, width=0.1)
        cloth = sheet.Sheet(domain, Woven(BLEND), BLEND.thickness, (G, G))
        held, move = supports.grip(domain, cloth.space, "fixed_end")
        led, also = supports.grip(domain, cloth.space, "pulled_end")
        solver, axis = cloth.equilibrium(held + led), np.array([0.0, 0.6, 0.8])

        def turn(angle):
            move((0, 0, 0), angle * axis)
            also((0, 0, 0), angle * axis)

        angles = 6 * np.pi * np.arange(1, steps + 1) / steps
        cuts = sum(step.step_cuts for step in statics.march(solver, turn, angles))
        strain = np.abs(cloth.points[0].strain[..., :3]).max()
        return f"largest strain left {strain:.1e}, {cuts} cuts", bool(strain < 1e-9)

    for steps in (18,) if quick else (72, 36, 18, 12, 8, 6):
        yield Trial(
            f"three turns by {1080 / steps:g} degrees a step", lambda s=steps: carry(s), ANY if steps < 18 else WORKS
        )


def cells(quick):
    """Cells that are long, wide or skewed."""
    for nx, ny in ((1, 33),) if quick else ((9, 3), (1, 3), (1, 33), (100, 1), (300, 1)):
        aspect = BLEND.gauge_length / nx / (BLEND.width / ny)
        yield Trial(
            f"strip of {nx} x {ny}, aspect {max(aspect, 1 / aspect):.0f}", lambda c=(nx, ny): yarn_test(cells=c)
        )
    for skew in (0.45,) if quick else (0.25, 0.45, 0.49):
        yield Trial(f"strip, nodes moved by {skew:g} of a cell", lambda s=skew: yarn_test(skew=s))

    def bend(element, skew):
        case = shell_cases.end_shear(shell_model.Settings(element, 16, 0.1, skew), COMM)
        table, stopped = case.run()
        if stopped:
            raise StepFailed(stopped)
        error = table.rows[-1]["W_tip"] / case.reference["W_tip"][-1] - 1
        return f"tip {100 * error:+.2f} % off the elastica", abs(error) <= 0.02

    for element in () if quick else ("regge", "mitc4"):
        yield Trial(f"{element}, skew 0.45, h/L = 1e-2", lambda e=element: bend(e, 0.45))


def loads(quick):
    """Number of load steps for the same test."""
    for steps in (1, 100) if quick else (1, 10, 100, 1000, 10000):
        yield Trial(f"{steps} steps, strip of 3 x 1", lambda s=steps: yarn_test(steps=s, cells=(3, 1)))
    for steps in () if quick else (1, 2, 5, 20, 200):
        yield Trial(f"{steps} steps out and back, bias", lambda s=steps: cycle(steps=s, angle=45.0, way="bias"), ANY)


def attempt(trial):
    """What came of a trial, in one word and in a few: works, inaccurate, refused, stopped or FAULT."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*is beyond the measured")
        try:
            said, right = trial.call()
            return ("works" if right else "inaccurate"), said
        except InputError as error:
            return "refused", str(error)
        except StepFailed as error:
            return "stopped", str(error)
        except Exception as error:
            return "FAULT", f"{type(error).__name__}: {error}"
