"""A strip over a fixed cylinder: the capstan with friction, and without it a pulley from which a catenary hangs.

With friction a load T0 hangs from one end, and the other end is pulled down slowly until the strip slides all around
the angle phi. Then the pull is T1 = T0 exp(mu phi) (Euler, Eytelwein).

    python demos/capstan.py --friction 0.3 --angle 180

With --catenary nothing rubs, and the strip, heavy and free at one end, hangs from an anchor over the cylinder; it moves
there, damped, from a shape without strain, and comes to rest. Along
whatever has no friction the tension is its weight times the height above the free end, so that the anchor bears
w (z_anchor - z_end); and the free end is where a catenary through anchor and cylinder leaves it.

    python demos/capstan.py --catenary

The checked numbers: T1/T0 to 2 %; the anchor's force and the height of the free end, as part of its depth, to 1 %.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import moving
import numpy as np
import touching
import ufl
from dolfinx import fem
from scipy.optimize import fsolve

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.output import results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.shell import directors
from fabric_fenicsx.solvers.marching import March
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

WIDTH, RADIUS, ARM, GAP = 0.02, 0.05, 0.06, 0.5e-3  # m
LOAD, PULL = 50.0, 0.015  # N/m, m
DAMPING, STEP = 10.0, 10e-3  # 1/s, s; of the catenary, on its way to rest
PULLEY, HANGS, TURN, SAG = 0.04, 0.36, 0.75, 0.44  # the strip at rest, to be a catenary: m, m, rad, m


def path(s, turns):
    """Places (n, 2) at lengths s along a line in the plane (x, z) of pieces, each with its length and curvature.

    It begins at the origin, upwards; a positive curvature bends it to the right.
    """
    lengths, curvatures = np.array(turns).T
    ends, bends = np.cumsum([0, *lengths]), np.cumsum([0, *lengths * curvatures])
    fine = np.linspace(0, ends[-1], 20001)
    angle = np.pi / 2 - np.interp((fine[1:] + fine[:-1]) / 2, ends, bends)
    return np.column_stack([
        np.interp(s, fine, np.concatenate([[0], np.cumsum(along(angle)) * fine[1]])) for along in (np.cos, np.sin)
    ])  # fmt: skip


class Strip:
    """A strip along a path over a cylinder, in the plane y = 0 to its width, and what holds it there."""

    def __init__(self, args, turns, radius, gap, friction, stiffness):
        length = sum(length for length, _ in turns)
        self.domain = domain = moving.read(
            meshing.MESHES / "strip.geo", args.element, MPI.COMM_WORLD, length=length, width=WIDTH, nx=args.cells, ny=1
        )
        x, self.length = domain.mesh.geometry.x, length
        flat = path(x[:, 0], turns)
        x[:] = np.column_stack([flat[:, 0], x[:, 1], flat[:, 1]])
        self.ends = path(np.array([0.0, length]), turns)
        self.centre = np.array([radius + args.thickness + gap, turns[0][0]])
        self.cloth = cloth = touching.elastic(domain, (0.0, 1.0, 0.0), args.element, args.thickness)
        middle = (self.centre[0], WIDTH / 2, self.centre[1])
        self.body = bodies.Cylinder(radius, 2 * WIDTH, middle, (0, 1, 0), cells=args.around, name="cylinder")
        self.touch = Contact(cloth, [self.body], friction=friction, itself=False, reach=2 * gap, stiffness=stiffness)
        self.bcs = supports.lead(domain, cloth.space, "sheet", 1, 0.0)

    def record(self, args, run, steps, probes, name, out):
        """Go through the steps of a march or a motion: the table."""

        def row(step):
            place = {"time_s": step.load} if hasattr(run, "time") else {"step": step.number, "part": step.load}
            return place | {"crossed": self.touch.crossed()} | probes()

        title, view = name, (0.5, -2.0, 0.6)
        with Recorder(
            self.cloth, out, row, title=title, when=lambda step: "", colour=args.colour, view=view, run=run,
            touch=self.touch, film=args.animation,
        ) as record:  # fmt: skip
            for step in steps:
                record(step)
        return record.table


def capstan(args, out):
    """Pull until all of it slides: T1/T0 and how far it is from the closed form."""
    phi, gap = np.radians(args.angle), GAP
    r = RADIUS + args.thickness + gap
    made = Strip(args, [(ARM, 0.0), (phi * r, 1 / r), (ARM, 0.0)], RADIUS, gap, args.friction, LOAD / r)
    domain, cloth = made.domain, made.cloth
    load, shift = fem.Constant(domain.mesh, np.zeros(3)), fem.Constant(domain.mesh, 0.0)
    along = np.array([np.cos(np.pi / 2 - phi), 0.0, np.sin(np.pi / 2 - phi)])
    work = weakform.traction(load, cloth.v, supports.over(domain, "pulled_end", degree=2))
    bcs = supports.lead(domain, cloth.space, "fixed_end", 0, 0.0)
    bcs += supports.lead(domain, cloth.space, "fixed_end", 2, shift)
    end = supports.unknowns(domain, cloth.space, "fixed_end", 2)

    def set_load(part):
        load.value[:], shift.value = min(part, 1.0) * LOAD * along, -max(part - 1.0, 0.0) * PULL

    solver = cloth.equilibrium([*made.bcs, *bcs], [work, *made.touch.terms], rtol=args.rtol)
    loads = [*np.linspace(0, 1, 5)[1:], *np.linspace(1, 2, args.steps + 1)[1:]]
    march = March(solver, set_load, loads, progress="capstan")

    def probes():
        return {"pull_mm": -1e3 * float(shift.value), "pull_N": -solver.reaction(end), "load_N": LOAD * WIDTH}

    table = made.record(args, march, march.steps(), probes, f"capstan, {args.angle:g}°", out)
    pulled = table.column("pull_mm") > 0.0
    ratio, exact = table.column("pull_N")[pulled] / (LOAD * WIDTH), np.exp(args.friction * phi)
    found = ratio[len(ratio) // 2 :].mean()  # over edges of the cylinder, which take turns
    error = found / exact - 1
    command.say(f"T1/T0 = {found:.4f}, exp(mu phi) = {exact:.4f}, {100 * error:+.2f} %")
    if MPI.COMM_WORLD.rank == 0:
        figure, (axes,) = plots.panels(1, width=6.0, height=4.5)
        axes.plot(table.column("pull_mm")[pulled], ratio, "o-", label="shell")
        axes.axhline(exact, **plots.FITTED, label="exp(mu phi)")
        plots.label(axes, f"mu = {args.friction:g}, phi = {args.angle:g}°", "pulled by (mm)", "T1/T0 (-)")
        plots.legend(figure, 2)
        plots.save(figure, out / "pull.png")
    return table, abs(error) <= 0.02, "T1/T0 to 2 %"


def hanging(anchor, length, r):
    """Catenary from a cylinder about the origin, of radius r, to an anchor (x, z) on the right; the end hangs left.

    Its parameter, and its directrix, at which the free end is, m.
    """

    def misses(unknowns):
        a, x0, z0, b = unknowns
        x, z = r * np.sin(b), r * np.cos(b)  # where it begins
        reach = a * (np.sinh((anchor[0] - x0) / a) - np.sinh((x - x0) / a))
        return (
            z0 + a * np.cosh((anchor[0] - x0) / a) - anchor[1],
            z0 + a * np.cosh((x - x0) / a) - z,
            np.sinh((x - x0) / a) + np.tan(b),
            reach + r * (b + np.pi / 2) - z0 - length,
        )

    half = anchor[0] / 2
    found, _, good, _ = fsolve(misses, (0.66 * anchor[0], half, anchor[1] - 0.9 * anchor[0], 0.7), full_output=True)
    if good != 1:
        raise InputError("There is no catenary of this length.")
    return found[0], found[2]


def catenary(args, out):
    """Hang it over a pulley without friction: the anchor's force and the free end's height."""
    args.thickness, gap = args.thickness / 2, args.thickness / 2
    r = PULLEY + args.thickness + gap
    turns = [(HANGS, 0.0), ((np.pi / 2 + TURN) * r, 1 / r), (SAG, -2 * TURN / SAG)]
    w = touching.MASS * touching.G
    made = Strip(args, turns, PULLEY, gap, 0.0, w * HANGS / r)
    domain, cloth = made.domain, made.cloth
    weight = cloth.weight(touching.MASS, ufl.as_vector((0.0, 0.0, -touching.G)))
    bcs = [*made.bcs, *supports.hinge(domain, cloth.space, "pulled_end")]
    run, _ = cloth.newmark(touching.MASS, bcs, [weight, *made.touch.terms], rho=0.0, damping=DAMPING, rtol=1e-4)
    held = [supports.unknowns(domain, cloth.space, "pulled_end", k) for k in (0, 2)]

    def probes():
        fallen = supports.mean(domain, cloth.space, cloth.q, "fixed_end", 2)
        return {"end_z_m": fallen, "anchor_x_N": run.solver.reaction(held[0]),
                "anchor_z_N": run.solver.reaction(held[1])}  # fmt: skip

    table = made.record(args, run, run.march(args.end, STEP, progress="catenary"), probes, "catenary", out)
    anchor = made.ends[1] - made.centre
    a, z0 = hanging(anchor, made.length, r)
    row = table.rows[-1]
    end = made.ends[0][1] + row["end_z_m"] - made.centre[1]
    force, exact = np.hypot(row["anchor_x_N"], row["anchor_z_N"]), w * WIDTH * (anchor[1] - end)
    sideways = abs(row["anchor_x_N"]) / (w * WIDTH * a) - 1
    errors = force / exact - 1, end / z0 - 1
    command.say(f"anchor bears {force:.5f} N, w (z_anchor - z_end) = {exact:.5f} N, {100 * errors[0]:+.2f} %")
    command.say(f"free end {1e3 * end:.2f} mm above the axis, the catenary has {1e3 * z0:.2f} mm, "
                f"{100 * errors[1]:+.2f} %; sideways {100 * sideways:+.2f} % off")  # fmt: skip
    return table, max(map(abs, errors)) <= 0.01, "tension and height of the end to 1 %"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--friction", type=command.above_zero, default=0.3, help="coefficient")
    parser.add_argument("--angle", type=command.above_zero, default=180.0, help="around the cylinder, degrees")
    parser.add_argument("--catenary", action="store_true", help="a heavy strip without friction instead")
    parser.add_argument("--cells", type=command.positive, help="along the strip; 60, of the catenary 160")
    parser.add_argument("--around", type=command.positive, default=24, help="cells along a quarter of the cylinder")
    parser.add_argument("--end", type=command.above_zero, default=1.5, help="of the catenary's way to rest, s")
    parser.add_argument("--steps", type=command.positive, default=20, help="of the pull")
    parser.add_argument("--element", choices=directors.ELEMENTS, default="mitc4")
    parser.add_argument("--rtol", type=command.above_zero, default=1e-5, help="of Newton's method")
    parser.add_argument("--animation", action="store_true", help="a gif")
    parser.add_argument("--out", type=Path, default=Path("out/capstan"))
    args = command.parse(parser)
    if args.angle > 270.0:
        raise InputError(f"--angle {args.angle:g}: the strip would cross itself; take at most 270 degrees.")
    args.cells = args.cells or (160 if args.catenary else 60)
    args.thickness, args.colour = touching.THICKNESS, "weft"
    return args


def main():
    args = arguments()
    out = results.folder(args.out)
    table, right, said = (catenary if args.catenary else capstan)(args, out)
    iterations, cuts = (table.column(name).sum() for name in ("newton_iterations", "step_cuts"))
    command.say(f"{len(table.rows)} steps of {iterations / len(table.rows):.1f} Newton iterations, {cuts:g} cuts")
    good = touching.passed(table) and right
    command.say(f"check: nothing passes, {said}: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
