"""What is sewn, against closed forms: a tube of flat panels, sheets that meet at an angle, gathers.

    python demos/studies/seams.py

A tube under pressure is sqrt(1 + 2 p R / (E h)) wider. A strip that stands at the end of another one, of which a third
may go on, bends as a folded plate, by F b^2 (b / 3 + a) / (E I). A strip that is pulled by two that lie on each other
shares its force by their stiffness. A band is gathered into a cuff: at rest, with waves. The checked numbers: the tube
to 0.1 %, folds to 2 %, shares to 1e-6, and gathers at rest.
"""

from mpi4py import MPI  # noqa: F401  isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse

import numpy as np
from dolfinx import fem

from fabric_fenicsx.app import command
from fabric_fenicsx.garments import dressing
from fabric_fenicsx.garments.panels import Edge, Flat, Panel, Rolled
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.material import Material
from fabric_fenicsx.solvers.marching import march
from fabric_fenicsx.terms import supports, weakform

KINDS = {"quadrilateral": "mitc4", "triangle": "regge"}
H = 1e-3  # m, thickness
A, B, WIDTH = 0.1, 0.08, 0.01  # m, of strips
FORCE, E = 1e-3, 1e7  # N/m, Pa
R, LENGTH, SOFT, PRESSURE = 0.06, 0.04, 8e6, 4e3  # of the tube
GATHERED = 1.5


def cloth(E):
    """Isotropic, without contraction."""
    return Material(law=StVenantKirchhoff.isotropic(E, 0.0), thickness=H, shear=(E / 2, E / 2), areal_mass=0.2)


def rectangle(name, width, height, placed):
    """A panel with the edges low, right, up and left."""
    corners = ((0, 0), (width, 0), (width, height), (0, height))
    return Panel(name, dict(zip(("low", "right", "up", "left"), map(Edge, corners), strict=True)), placed=placed)


def tube(kind, start):
    """How much wider a tube of four panels is than the closed form says; rolled to a radius at the start."""
    width, panels, seams = np.pi * R / 2, [], []
    for k, facing in enumerate(((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))):
        panels.append(rectangle(f"{k}", width, LENGTH, Rolled(start, facing=facing, span=(width, np.pi / 2))))
        seams.append(Seam((f"{k}", "right"), (f"{(k + 1) % 4}", "left")))
    sheet = sew(panels, seams, cell=width / 12, kind=kind).sheet(cloth(SOFT))
    p, held = fem.Constant(sheet.domain.mesh, 0.0), []
    for k in range(4):
        for edge, axis in (("low", 2), ("up", 2), ("left", (k + 1) % 2)):
            held += supports.lead(sheet.domain, sheet.space, f"{k}.{edge}", axis, 0.0)
    load = weakform.pressure(p, sheet.u, sheet.v, sheet.dx)
    solver = sheet.equilibrium(held, load, rtol=1e-8, search="newton")

    def set_load(value):
        p.value = value

    list(march(solver, set_load, [PRESSURE]))
    radius = start + supports.mean(sheet.domain, sheet.space, sheet.q, "0.left", 0)
    chords = 1.0 if kind == "triangle" else np.pi / 48 / np.sin(np.pi / 48)  # quadratic cells are round
    return radius / chords / R / np.sqrt(1 + 2 * PRESSURE * R / (SOFT * H)) - 1


def upright(points):
    """At the end of the first strip, across it."""
    return np.column_stack([np.full(len(points), A), points[:, 1], points[:, 0]])


def fold(kind, cell, third):
    """How much further the end of an upright strip goes than the closed form says, of the part."""
    strips = [rectangle("flat", A, WIDTH, Flat()), rectangle("up", B, WIDTH, upright)]
    edges, lean = [("flat", "right"), ("up", "left")], (-np.pi / 4, -np.pi / 4)
    if third:
        strips.append(rectangle("on", B, WIDTH, Flat((A, 0, 0))))
        edges, a = [edges[0], ("on", "left"), edges[1]], np.arctan(0.5)
        lean = (-a, a, a - np.pi / 2)
    sheet = sew(strips, [Seam(*edges, lean=lean)], cell=cell, kind=kind).sheet(cloth(E))
    load = fem.Constant(sheet.domain.mesh, np.zeros(3))
    pull = weakform.traction(load, sheet.v, supports.over(sheet.domain, "up.right", 2))
    solver = sheet.equilibrium(
        supports.clamp(sheet.domain, sheet.space, "flat.left"), pull, rtol=1e-10, search="newton"
    )

    def set_load(part):
        load.value[0] = part * FORCE

    list(march(solver, set_load, [1.0]))
    moved = supports.mean(sheet.domain, sheet.space, sheet.q, "up.right", 0)
    return moved / (FORCE * B**2 * (B / 3 + A) / (E * H**3 / 12)) - 1


def shares(kind):
    """Of a strip's force those of two that pull it, one thrice as stiff as the other."""
    strips = [rectangle(name, B, WIDTH, Flat((x, 0, 0))) for name, x in (("one", 0.0), ("two", B), ("three", B))]
    seam = Seam(("one", "right"), ("two", "left"), ("three", "left"))
    sheet = sew(strips, [seam], cell=5e-3, kind=kind).sheet({"one": cloth(E), "two": cloth(E), "three": cloth(3 * E)})
    pull, bcs = fem.Constant(sheet.domain.mesh, 0.0), supports.clamp(sheet.domain, sheet.space, "one.left")
    for name in ("two.right", "three.right"):
        bcs += supports.lead(sheet.domain, sheet.space, name, 0, pull)
        bcs += supports.hinge(sheet.domain, sheet.space, name)[1:] + supports.hold(sheet.domain, sheet.space, name)
    solver = sheet.equilibrium(bcs, rtol=1e-10, search="newton")

    def set_load(part):
        pull.value = 1e-3 * part

    list(march(solver, set_load, [1.0]))
    cells = [sheet.domain.entities(name, 2)[1] for name in ("one", "two", "three")]
    force = sheet.cell_stress()[:, 1] * np.sqrt(1 + 2 * sheet.cell_strain()[:, 1])
    one, two, three = (float(force[own].mean()) for own in cells)
    return two / one, three / one


def gathers(kind):
    """A band sewn into a cuff that is so much shorter, which is held at its edge: the dressing, when it is at rest."""
    width = 2 * np.pi * R
    panels = [
        rectangle("cuff", width, LENGTH, Rolled(R, span=(width, 2 * np.pi))),
        rectangle("band", GATHERED * width, LENGTH, Waves(GATHERED * width)),
    ]
    seams = [Seam(("cuff", "low"), ("band", "up"))] + [Seam((p, "left"), (p, "right")) for p in ("cuff", "band")]
    sheet = sew(panels, seams, cell=GATHERED * width / 48, kind=kind).sheet(cloth(SOFT / 10))
    put_on = dressing.Dressing(sheet, [], supports.clamp(sheet.domain, sheet.space, "cuff.up"))
    steps = list(put_on.march())
    return put_on, steps, sheet


class Waves:
    """Below the cuff, rolled onto its cylinder, with small waves towards the hem."""

    def __init__(self, width):
        self.width = width

    def __call__(self, points):
        angle = 2 * np.pi * points[:, 0] / self.width
        down = LENGTH - points[:, 1]
        radius = R + 0.02 * down * (np.cos(7 * angle) + 0.5 * np.sin(5 * angle))
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), -down])


def main():
    command.parse(argparse.ArgumentParser(description=__doc__, formatter_class=command.Help))
    good = True
    for kind, element in KINDS.items():
        off = [tube(kind, start) for start in (0.8 * R, R, 1.3 * R)]
        good &= max(np.abs(off)) < 1e-3
        command.say(
            f"{element}: a tube of four flat panels, rolled to 0.8, 1 and 1.3 of its radius at the start, is off its "
            f"closed form by {', '.join(f'{100 * x:.3f}' for x in off)} %"
        )
        for third, what in ((False, "two"), (True, "three")):
            off = [fold(kind, cell, third) for cell in (20e-3, 10e-3, 5e-3)]
            good &= max(np.abs(off)) < 0.02
            command.say(
                f"{element}: across a joint of {what} sheets at 90 degrees, cells of 20, 10 and 5 mm, a strip bends "
                f"{', '.join(f'{100 * x:+.2f}' for x in off)} % further than a folded plate"
            )
        two, three = shares(kind)
        good &= abs(two - 0.25) < 1e-6 > abs(three - 0.75)
        command.say(f"{element}: of a strip's force two others, stiff as 1 : 3, take {two:.7f} and {three:.7f}")
        put_on, steps, sheet = gathers(kind)
        strain, count = (
            sheet.cell_strain()[sheet.domain.entities("band", 2)[1]],
            sum(s.newton_iterations for s in steps),
        )
        good &= bool(put_on.stir < dressing.AT_REST and np.isfinite(strain).all())
        command.say(
            f"{element}: gathered {GATHERED:g} : 1 in {len(steps)} steps and {count} iterations, at rest with a "
            f"kinetic energy of {put_on.stir:.1e} of the work; mean weft strain of the band "
            f"{100 * strain[:, 1].mean():.2f} %, and not {50 * (1 / GATHERED**2 - 1):.1f} %, since it waves"
        )
    command.say(f"check: tubes to 0.1 %, folds to 2 %, shares to 1e-6, gathers at rest: {'yes' if good else 'NO'}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
