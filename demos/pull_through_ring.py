"""A handkerchief lies on a ring and is pulled down through it by its middle: a laboratory's test of the hand of cloth.

The cloth gathers to folds that rub on the ring and on each other; the pull against the way of the hand tells how stiff
in bending and shear, how thick and how rough it is. The hand holds a patch of 2 x 2 cells by a stiff spring.

Cells should not be longer than 0.2 (B/w)^(1/3), with bending stiffness B and weight w per area, else they give way at
folds. By default the cloth is small and stiff in bending, and so are cells coarse. It snaps when it buckles.

    python demos/pull_through_ring.py
    python demos/pull_through_ring.py --law potential                      # the whole law: three times as long
    python demos/pull_through_ring.py --law potential --own --cells 16     # muslin as soft as it is

The checked numbers: nothing passes through anything, at most 1 % of the largest external work is not accounted for; and
if the way is long enough, all of the cloth is through in the end.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from functools import partial
from pathlib import Path

import bent
import moving
import numpy as np
import touching
import ufl
from dolfinx import fem

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

SPRING = 2e3  # of the hand, N/m
START = 0.1  # of the time in which it gets up to its speed


def scene(args, comm=MPI.COMM_WORLD):
    """The handkerchief on the ring, and what pulls its middle."""
    material, side, n = bent.Cloth(args), 1e-3 * args.side, args.cells
    material.say()
    domain = moving.read(meshing.MESHES / "drape.geo", args.element, comm, side=side, n=n, a=side / 2 - side / n)
    domain.mesh.geometry.x[:, :2] -= side / 2
    touching.wave(domain, 1e-3 * args.radius, side / np.sqrt(2), 1e-3 * args.imperfection, args.seed)
    cloth, h = material.sheet(domain), material.fabric.thickness
    wire, reach = 1e-3 * args.wire, 5 * h
    top = -2 * h - reach
    ring = bodies.Ring(1e-3 * args.radius, wire, (0, 0, top - wire), cells=args.around)
    touch = Contact(
        cloth, [ring], friction=args.friction, reach=reach, stiffness=args.stiffness, creep=args.creep
    )  # fmt: skip
    command.say(f"contact: {touch.describe()}")
    place = fem.Constant(domain.mesh, (0.0, 0.0, 0.0))
    start = START * args.end
    speed = 1e-3 * args.way / (args.end - start / 2)

    def set_load(t):
        place.value[2] = -speed * (t**2 / 2 / start if t < start else t - start / 2)

    patch = supports.over(domain, "middle", 2)
    held = place - cloth.u
    spring = SPRING / (2 * side / n) ** 2
    weight = cloth.weight(material.mass, ufl.as_vector((0.0, 0.0, -bent.GRAVITY)))
    pull = fem.form(-spring * held[2] * patch)
    loads = [weight, spring * ufl.inner(held, cloth.v) * patch, *touch.terms]
    move = partial(cloth.newmark, rho=args.rho, rtol=args.rtol) if args.method == "implicit" else cloth.explicit
    run, ledger = move(material.mass, [], loads, damping=args.damping, set_load=set_load)
    if args.method == "explicit":
        run.stable *= args.part
        run.weigh = 4  # it snaps
    probes = {
        "pull_N": lambda: comm.allreduce(fem.assemble_scalar(pull)),
        "way_m": lambda: -float(place.value[2]),
        "highest_m": lambda: float(touch.nodes()[:, 2].max()) - top + 2 * wire,
        "crossed": touch.crossed,
    }
    name = f"{material.name} through a ring"
    return moving.Scene(name, cloth, run, ledger, probes, touching.marks(args), touch)


def plot(path, table, name):
    """The pull against the way of the hand."""
    figure, (axes,) = plots.panels(1, width=6.0, height=4.5)
    axes.plot(1e3 * table.column("way_m"), table.column("pull_N"), "k-")
    plots.label(axes, name, "way of the hand (mm)", "pull (N)")
    plots.save(figure, path)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    bent.add_arguments(parser)
    parser.add_argument("--own", action="store_true", help="bending of the fabric, and not --B")
    parser.add_argument("--side", type=command.above_zero, default=60.0, help="of the handkerchief, mm")
    parser.add_argument("--cells", type=command.positive, default=10, help="along a side, even")
    parser.add_argument("--radius", type=command.above_zero, default=20.0, help="of the ring's middle line, mm")
    parser.add_argument("--wire", type=command.above_zero, default=4.0, help="its radius, mm")
    parser.add_argument("--around", type=command.positive, default=12, help="cells along a quarter of the ring")
    parser.add_argument("--friction", type=command.number, default=0.2, help="coefficient")
    parser.add_argument("--creep", type=command.above_zero, default=1e-4, help="m")
    parser.add_argument("--stiffness", type=command.above_zero, default=5e3, help="of contact, Pa")
    parser.add_argument("--way", type=command.above_zero, default=60.0, help="of the hand, mm")
    parser.add_argument("--method", choices=["implicit", "explicit"], default="explicit", help="of time steps")
    parser.add_argument("--part", type=command.above_zero, default=0.75, help="of the stable step, which folds shorten")
    parser.add_argument("--seed", type=int, default=0, help="of the waves")
    parser.add_argument("--imperfection", type=command.number, default=0.5, help="height of the waves, mm")
    touching.add_arguments(parser, step=1.0, damping=100.0)
    parser.add_argument("--end", type=command.above_zero, default=0.08, help="s")
    parser.add_argument("--resume", nargs="?", const=True, metavar="FILE", help="go on from a checkpoint")
    parser.add_argument("--out", type=Path, default=Path("out/pull_through_ring"))
    parser.set_defaults(fabric="muslin", B=40.0)
    args = command.parse(parser)
    args.B = None if args.own else args.B
    return args


def main():
    args = arguments()
    out = results.folder(args.out)
    played = scene(args)
    table = moving.play(played, args, out, progress=True, every=4)
    imbalance = moving.summary(table, played.run)
    touching.draw(played, out / "deformed.png", view=(1.0, -1.6, 0.2))
    results.on_root(played.run.comm, lambda: plot(out / "pull.png", table, played.name))
    pull, way = table.column("pull_N"), 1e3 * table.column("way_m")
    command.say(f"largest pull {pull.max():.3f} N at {way[pull.argmax()]:.1f} mm")
    good, said = touching.passed(table) and imbalance <= 1.0, "nothing passes, imbalance at most 1 %"
    if args.way > 1.2 * args.side / np.sqrt(2):
        good &= table.rows[-1]["highest_m"] < 0.0
        said += ", all of it is through"
    command.say(f"check: {said}: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
