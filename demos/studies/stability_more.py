"""The trials of `stability.py` in motion, and inputs that are no good."""

from dataclasses import replace

import numpy as np
import stability_trials
import ufl
from dolfinx import fem
from stability_trials import ANY, BLEND, COMM, REFUSED, WORKS, G, NotRestored, Trial, scaled

from fabric_fenicsx import sheet
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.fabrics.bending import BendingCurve, BendingCurves
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.bending import Bending
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import energy, explicit, motion, statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform


def falling(law=None, bending=None):
    """A sheet of 2 m, held over patches in its corners, with its areal mass and its weight."""
    domain = meshing.read(meshing.MESHES / "drape.geo", COMM, side=2.0, n=10, a=0.2)
    cloth = sheet.Sheet(domain, law or Woven(BLEND), BLEND.thickness, (G, G), bending=bending)
    areal_mass = BLEND.density * BLEND.thickness
    weight = cloth.weight(areal_mass, ufl.as_vector((0.0, 0.0, -9.81)))
    return cloth, areal_mass, weight, supports.hinge(domain, cloth.space, "corner_patches")


def judged(cloth, end, ledger):
    """Whether the centre falls freely, for the waves are not there yet, and energy is accounted for."""
    z = supports.mean(cloth.domain, cloth.space, cloth.q, "centre", 2)
    missed, lost = abs(z / (-9.81 * end**2 / 2) - 1), ledger.worst / max(ledger.most, 1e-300)
    return f"fall missed by {100 * missed:.2f} %, imbalance {100 * lost:.2f} %", missed <= 0.01 and lost <= 0.01


def time_steps(quick):
    """Implicit steps of the drape's fall."""

    def fall(dt):
        cloth, areal_mass, weight, bcs = falling()
        run, ledger = cloth.newmark(areal_mass, bcs, weight)
        end = min(0.1, 20 * dt)
        *_, last = run.march(end, dt)
        return judged(cloth, last.load, ledger)

    for dt in (1e-5, 5e-2) if quick else (1e-5, 1e-4, 1e-3, 5e-3, 2e-2, 5e-2):
        yield Trial(f"dt = {dt:g} s", lambda dt=dt: fall(dt))


def explicit_steps(quick):
    """Explicit steps as a part of the largest stable one; those above it are made in spite of the check, too."""

    def fall(factor, forced=False):
        cloth, areal_mass, weight, bcs = falling(StVenantKirchhoff.from_fabric(BLEND))
        moved = motion.Motion(cloth.q, cloth.mass(areal_mass, "cell"), cloth.shell)
        run = explicit.CentralDifference(moved, [*cloth.terms, -weight], bcs)
        ledger = energy.Ledger(run)
        stable, every = run.stable, 0.01
        if forced:
            run.stable = np.inf
        try:
            for step in run.march(0.05, every, dt=factor * stable):
                reached = step.load
        except StepFailed:
            if not np.isfinite(cloth.q.x.array).all():
                raise NotRestored("the displacement is not finite") from None
            raise
        said, good = judged(cloth, reached, ledger)
        return f"step {1e6 * factor * stable:.1f} us: {said}", good

    for factor in (0.9, 1.1) if quick else (0.5, 0.9, 1.0, 1.1):
        yield Trial(f"{factor:g} of the stable step", lambda f=factor: fall(f), WORKS if factor <= 1 else REFUSED)
    if not quick:
        yield Trial("1.1, made all the same", lambda: fall(1.1, True), ANY)


def bending(quick):
    """Bending stiffness and friction of its own, times a factor, in a drape until it rebounds; law with a potential."""
    curves, friction = BLEND.bending_or_estimate(), 1e-3  # N

    def fall(factor, rubs):
        def times(curve):
            return BendingCurve(factor * curve.B, hysteresis=factor * friction if rubs else 0.0)

        own = BendingCurves(*(times(curve) for curve in (curves.warp, curves.weft, curves.twist)))
        cloth, areal_mass, weight, bcs = falling(Potential(BLEND), Bending(own))
        run, ledger = cloth.newmark(areal_mass, bcs, weight, rho=0.8)
        iterations = cuts = 0
        for step in run.march(0.05 if quick else 0.3, 5e-3):
            iterations, cuts = iterations + step.newton_iterations, cuts + step.step_cuts
        lost = ledger.worst / max(ledger.most, 1e-300)
        return (
            f"{iterations / step.number:.1f} iterations a step, {cuts} cuts, imbalance {100 * lost:.2f} %",
            lost <= 0.03,
        )

    for factor in (1e-3, 1e3) if quick else (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3):
        for rubs in (True,) if quick else (False, True):
            yield Trial(f"B x {factor:g}{', with friction' if rubs else ''}", lambda f=factor, r=rubs: fall(f, r))


def inputs(quick):
    """Zero, negative and NaN inputs; each is to be refused in one sentence, before anything is solved."""
    nan, svk = float("nan"), StVenantKirchhoff.isotropic(1e7, 0.3)
    domain = meshing.read(meshing.MESHES / "strip.geo", COMM, gdim=3, nx=2, ny=1)
    cloth = sheet.Sheet(domain, svk, 1e-3, (1e6, 1e6))
    clamp = supports.clamp(domain, cloth.space, "fixed_end")

    def law_of(**changes):
        return lambda: Woven(replace(BLEND, **changes))

    calls = {}
    for x in (0.0, -1.0, nan):
        calls |= {
            f"thickness {x:g} m": lambda x=x: sheet.Sheet(domain, svk, x, (1e6, 1e6)),
            f"shear moduli {x:g} Pa": lambda x=x: sheet.Sheet(domain, svk, 1e-3, (x, 1e6)),
            f"areal mass {x:g} kg/m2": lambda x=x: cloth.mass(x),
            f"modulus {x:g} Pa": lambda x=x: StVenantKirchhoff.isotropic(x, 0.3),
            f"warp x {x:g}": law_of(warp=scaled(BLEND.warp, x)),
            f"time step {x:g} s": lambda x=x: next(cloth.newmark(0.1, clamp)[0].march(0.1, x)),
            f"end of the motion {x:g} s": lambda x=x: next(cloth.newmark(0.1, clamp)[0].march(x, 1e-3)),
            f"smallest ramp {x:g}": lambda x=x: Woven(BLEND, ramp=x),
            f"{x:g} layers": lambda x=x: sheet.Sheet(domain, Woven(BLEND), 1e-3, (1e6, 1e6), layers=x),
        }
    calls |= {
        "load NaN": lambda: next(statics.march(cloth.equilibrium(clamp), lambda load: None, [nan])),
        "no load at all": lambda: next(statics.march(cloth.equilibrium(clamp), lambda load: None, [])),
        "warp direction 0": lambda: sheet.Sheet(domain, svk, 1e-3, (1e6, 1e6), warp=(0, 0, 0)),
        "warp along the normal": lambda: sheet.Sheet(domain, svk, 1e-3, (1e6, 1e6), warp=(0, 0, 1)),
        "warp direction NaN": lambda: sheet.Sheet(domain, svk, 1e-3, (1e6, 1e6), warp=(nan, 0, 0)),
        "Poisson's ratio 1": lambda: StVenantKirchhoff.isotropic(1e7, 1.0),
        "Poisson's ratios NaN": law_of(poisson={"measured": (nan, nan)}),
        "damping -1 1/s": lambda: cloth.newmark(0.1, clamp, damping=-1.0),
        "damping NaN": lambda: cloth.newmark(0.1, clamp, damping=nan),
        "rho 1.1": lambda: cloth.newmark(0.1, clamp, rho=1.1),
        "rho NaN": lambda: cloth.newmark(0.1, clamp, rho=nan),
        "tolerance NaN": lambda: cloth.equilibrium(clamp, rtol=nan),
        "tolerance 0": lambda: cloth.equilibrium(clamp, rtol=0.0),
        "path of NaN": lambda: driver.run(Woven(BLEND), [[nan, 0.0, 0.0]]),
        "cells NaN": lambda: meshing.read(meshing.MESHES / "strip.geo", COMM, nx=nan),
    }
    for tried, call in calls.items():
        yield Trial(tried, lambda call=call: (f"made {type(call()).__name__}", True), REFUSED)

    def unsolvable():
        p = fem.Constant(domain.mesh, 0.0)
        solver = cloth.equilibrium(clamp, weakform.pressure(p, cloth.u, cloth.v, cloth.dx))
        kept = cloth.q.x.array.copy()
        p.value = nan
        try:
            solver.solve()
        except StepFailed:
            if not np.array_equal(kept, cloth.q.x.array):
                raise NotRestored("the displacement has changed") from None
            raise
        return "solved", False

    yield Trial("pressure NaN", unsolvable, "stopped")


SUBJECTS = (
    stability_trials.thickness,
    stability_trials.yarns,
    stability_trials.poisson,
    stability_trials.slack,
    stability_trials.far,
    stability_trials.reversals,
    stability_trials.rotation,
    stability_trials.cells,
    stability_trials.loads,
    time_steps,
    explicit_steps,
    bending,
    inputs,
)
