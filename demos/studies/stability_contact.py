"""The trials of `stability.py` with contact: speeds, gaps, stiffness, friction, and losses of an impact by the step."""

import numpy as np
import ufl
from stability_trials import ANY, COMM, TOLD, WORKS, Trial

from fabric_fenicsx import sheet
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.surfaces import meshing

SIDE, H, MASS, E = 0.3, 4e-4, 0.224, 8e6


def fallen(speed=1.0, dt=2e-3, steps=15, under=None, **touching):
    """A sheet that falls onto a ball, or on what else is under it: its gap, its ledger, and what the impact takes."""
    domain = meshing.read(meshing.MESHES / "square.geo", COMM, side=SIDE, n=4)
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, 0.25), H, (E / 2.5, E / 2.5))
    under = under or bodies.Sphere(0.06, (0.14, 0.16, -0.062), cells=6)
    touch = Contact(cloth, [under], **touching)
    weight = cloth.weight(MASS, ufl.as_vector((0.0, 0.0, -9.81)))
    run, ledger = cloth.newmark(MASS, [], [weight, *touch.terms])
    heights = np.array(cloth.q.function_space.sub(0).sub(2).collapse()[1])
    run.motion.velocity.x.array[heights] = -speed
    moving, gap, cuts = MASS * SIDE**2 * speed**2 / 2, np.inf, 0
    for step in run.march(steps * dt, dt):
        gap, cuts = min(gap, touch.least_gap()), cuts + step.step_cuts
        if gap <= 0.0 or touch.crossed():
            raise RuntimeError("the sheet has passed through")  # a fault, whatever is asked
    lost, off = ledger.totals["by_impact"] / max(moving, 1e-300), ledger.worst / max(ledger.most, moving, 1e-300)
    said = f"least gap {1e3 * gap:.3g} mm, {cuts} cuts, imbalance {100 * off:.2f} %"
    return said + (f", impact takes {100 * lost:.1f} %" if speed else ""), off <= 0.03


def contact_speeds(quick):
    """Speed at which a sheet meets a ball."""
    for speed in (10.0,) if quick else (0.0, 0.1, 1.0, 3.0, 10.0, 30.0):
        yield Trial(f"{speed:g} m/s", lambda v=speed: fallen(v), WORKS if speed <= 3.0 else TOLD)


def contact_gaps(quick):
    """Reach and stiffness of what keeps surfaces apart."""
    for reach in (1e-5,) if quick else (1e-5, 1e-4, 1e-3, 5e-3):
        yield Trial(f"reach {1e3 * reach:g} mm", lambda r=reach: fallen(reach=r), ANY)
    for stiffness in (1e6,) if quick else (1.0, 1e2, 1e4, 1e6):
        yield Trial(f"stiffness {stiffness:g} Pa", lambda k=stiffness: fallen(stiffness=k), ANY)


def contact_friction(quick):
    """Coefficients of friction, and slip speeds."""
    for mu in (1.0,) if quick else (0.1, 0.3, 1.0, 3.0):
        yield Trial(f"mu = {mu:g}", lambda m=mu: fallen(friction=m), ANY if mu > 1 else WORKS)
    for slip in () if quick else (1e-5, 1e-4, 1e-2, 1e-1):
        yield Trial(f"mu = 0.3, slip {slip:g} m/s", lambda s=slip: fallen(friction=0.3, slip=s), ANY)


def contact_steps(quick):
    """Time step of a sheet that falls flat onto a plane, and what of its energy the impact takes."""

    def flat(dt):
        plane = bodies.Plane(point=(0, 0, -2e-3))
        return fallen(1.0, dt, max(4, round(6e-3 / dt)), plane, itself=False)

    for dt in (5e-3,) if quick else (1e-5, 5e-5, 2e-4, 1e-3, 5e-3, 2e-2, 5e-2):
        yield Trial(f"flat, dt = {1e3 * dt:g} ms", lambda dt=dt: flat(dt))


SUBJECTS = (contact_speeds, contact_gaps, contact_friction, contact_steps)
