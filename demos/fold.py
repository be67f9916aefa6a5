"""A strip of cloth on a table is folded onto itself: one end is led over the other, laid down there, and let go.

A hand holds the edge as fingers do, by a stiff spring that lets it turn, and leads it along half an ellipse, so low
that the strip stays slack. Then it opens, and a loop is left at the fold. A heavy elastica that lies on itself has such
a loop, too, which depends on its bending stiffness B and weight w per area alone: it is 0.907 l high and 4.68 l long,
l = (B/w)^(1/3), and friction does not change it. (Compare Lloyd, Shanahan and Konopasek 1978, The folding of heavy
fabric sheets.)

    python demos/fold.py

Cells that are longer than about 0.2 l give way at the fold, which then collapses to a crease. The checked numbers:
nothing passes through anything, at most 1 % of the largest external work is not accounted for; and once it is folded,
at most 8 Newton iterations a step taken, no step cut below 1/8, and a loop as high as that of the elastica to 5 %.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import bent
import moving
import numpy as np
import touching
import ufl
from dolfinx import fem
from scipy.integrate import cumulative_trapezoid, solve_bvp

from fabric_fenicsx.app import command
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.output import results
from fabric_fenicsx.terms import supports

SPRING = 1e4  # of the hand, N/m along 1 m of the edge
SHORT = 0.1  # of the strip, by which its end is laid down behind the other one


def scene(args, comm=MPI.COMM_WORLD):
    """The strip on the table, and what leads its end."""
    material, length, width = bent.Cloth(args), 1e-3 * args.length, 1e-3 * args.width
    material.say()
    cloth, h = material.strip(length, width, args.cells, across=args.across), material.fabric.thickness
    table = bodies.Plane(point=(length / 2, width / 2, -2 * h), size=1.2 * length, name="table")
    touch = Contact(cloth, [table], friction=args.friction, reach=2 * h, stiffness=args.stiffness, creep=args.creep)
    bcs = supports.clamp(cloth.domain, cloth.space, "fixed_end")
    place, grip = (fem.Constant(cloth.domain.mesh, value) for value in ((0.0, 0.0, 0.0), 0.0))
    over = (1 - SHORT) * length

    def set_load(t):
        part = min(max(t / args.move, 0.0), 1.0)
        angle = np.pi * part**2 * (3 - 2 * part)
        height = args.arc * over * np.sin(angle) + 3 * h * angle / np.pi
        place.value = (-over * (1 - np.cos(angle)) / 2, 0.0, height)
        grip.value = SPRING * min(max(1 - (t - args.move) / args.open, 0.0), 1.0)

    weight = cloth.weight(material.mass, ufl.as_vector((0.0, 0.0, -bent.GRAVITY)))
    hand = grip * ufl.inner(place - cloth.u, cloth.v) * supports.over(cloth.domain, "pulled_end", 2)
    run, ledger = cloth.newmark(
        material.mass, bcs, [weight, hand, *touch.terms], rho=args.rho, damping=args.damping, set_load=set_load,
        rtol=args.rtol,
    )  # fmt: skip
    probes = {
        "loop_m": lambda: float(touch.nodes()[:, 2].max() - touch.nodes()[:, 2].min()),
        "end_z_m": moving.value_at(cloth, 2, "pulled_end"),
        "crossed": touch.crossed,
    }
    made_with = touching.marks(args)
    played = moving.Scene(f"{material.name} folded", cloth, run, ledger, probes, made_with, touch)
    return played, material.strip_curve("warp").B / (material.mass * bent.GRAVITY)


def loop():
    """Height and length of the loop of a heavy elastica that is folded onto itself, over (B/w)^(1/3); it is thin.

    Unknown are angle, curvature, force across and place. Where it leaves the table, and where it comes down again, it
    is straight. A moment at the end needs no condition: B K^2/2 + V sin t - w y is the same all along, and so it
    vanishes there, too.
    """

    def rate(s, y, p):
        across = y[2] * np.cos(y[0])
        return p[0] * np.array([y[1], across, -np.ones_like(s), np.sin(y[0]), np.cos(y[0])])

    def ends(a, b, p):
        return np.array([a[0], a[1], a[3], a[4], b[0] - np.pi, b[3]])

    s = np.linspace(0.0, 1.0, 101)
    angle, long = np.interp(s, [0, 0.15, 0.4, 0.6, 1], [0, 0.3, 2.6, 3.7, np.pi]), 4.7
    x, y = (long * cumulative_trapezoid(along(angle), s, initial=0.0) for along in (np.cos, np.sin))
    start = np.array([angle, np.gradient(angle, s) / long, long * (0.8 - s), y, x])
    found = solve_bvp(rate, ends, s, start, p=[long], tol=1e-6)
    return found.y[3].max(), found.p[0]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    bent.add_arguments(parser)
    parser.add_argument("--length", type=command.above_zero, default=240.0, help="of the strip, mm")
    parser.add_argument("--width", type=command.above_zero, default=40.0, help="mm")
    parser.add_argument("--cells", type=command.positive, default=60, help="along it")
    parser.add_argument("--across", type=command.positive, default=3, help="cells across it")
    parser.add_argument("--friction", type=command.number, default=0.3, help="coefficient")
    parser.add_argument("--creep", type=command.number, default=1e-4, help="m")
    parser.add_argument("--stiffness", type=command.above_zero, default=None, help="of contact, Pa")
    parser.add_argument("--move", type=command.above_zero, default=1.0, help="how long the end is led, s")
    parser.add_argument("--open", type=command.above_zero, default=0.05, help="how long the hand takes to open, s")
    parser.add_argument("--arc", type=command.above_zero, default=0.45, help="height of its way, in its length")
    touching.add_arguments(parser, step=5.0, damping=10.0)
    parser.add_argument("--end", type=command.above_zero, default=1.6, help="s")
    parser.add_argument("--resume", nargs="?", const=True, metavar="FILE", help="go on from a checkpoint")
    parser.add_argument("--out", type=Path, default=Path("out/fold"))
    parser.set_defaults(law="potential")
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    played, cube = scene(args)
    table = moving.play(played, args, out, progress=True, every=4)
    imbalance, run = moving.summary(table, played.run), played.run
    touching.draw(played, out / "deformed.png")
    high, expected = 1e3 * table.rows[-1]["loop_m"], 1e3 * np.cbrt(cube) * loop()[0]
    command.say(f"loop {high:.2f} mm high, that of an elastica {expected:.2f} mm")
    each = table.column("newton_iterations").sum() / table.column("steps_taken").sum()
    good, said = touching.passed(table) and imbalance <= 1.0, "nothing passes, imbalance at most 1 %"
    if args.end >= args.move + 3 * args.open:  # it is folded
        good &= each <= 8.0 and run.finest >= 1 / 8 and abs(high / expected - 1) <= 0.05
        said += ", at most 8 iterations a step, no cut below 1/8, the elastica's loop"
    command.say(f"check: {said}: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
