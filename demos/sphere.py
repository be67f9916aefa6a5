"""A square sheet falls onto a sphere, and drapes over it, with friction.

2 m x 2 m, horizontal at first, 5 mm above a fixed sphere, with the whole law or parts of it.

    python demos/sphere.py --cells 20 --friction 0.3

The checked numbers: nothing goes through anything, every gap stays above zero, and at most 1 % of the external work is
not accounted for; what friction and impact have lost is in the history.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import moving
import numpy as np
import ufl

from fabric_fenicsx.app import command
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing

G, ABOVE = 9.81, 5e-3


def scene(args, comm=MPI.COMM_WORLD):
    """The sheet above the sphere, ready to fall, and their contact."""
    cloth, areal_mass = moving.square(meshing.MESHES / "drape.geo", args, moving.SIDE / args.cells, comm)
    x = cloth.domain.mesh.geometry.x
    low, high = np.min(comm.allgather(x.min(axis=0)), axis=0), np.max(comm.allgather(x.max(axis=0)), axis=0)
    ball = bodies.Sphere(args.radius, (*((low + high) / 2)[:2], -args.radius - ABOVE), name="ball")
    touch = Contact(cloth, [ball], friction=args.friction, stiffness=args.stiffness)
    command.say(f"contact: {touch.describe()}")
    weight = cloth.weight(areal_mass, ufl.as_vector((0.0, 0.0, -G)))
    run, _ = moving.runner(args, cloth, areal_mass, [], [weight, *touch.terms])
    probes = {
        "centre_z_m": moving.value_at(cloth, 2, "centre"),
        "crossed": touch.crossed,
    }
    made_with = moving.settings("sphere", args, radius=args.radius, friction=args.friction)
    return moving.Scene(f"{Path(args.fabric).stem} on a sphere", cloth, run, run.ledger, probes, made_with, touch)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    moving.add_arguments(parser, end=0.3, rho=0.8)
    parser.add_argument("--radius", type=command.number, default=0.3, help="of the sphere, m")
    parser.add_argument("--friction", type=command.number, default=0.3, help="coefficient")
    parser.add_argument("--stiffness", type=command.number, help="of contact, Pa; by default enough for its fall")
    parser.add_argument("--out", type=Path, default=Path("out/sphere"))
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    table = moving.play(played := scene(args), args, out, progress=True)
    imbalance = moving.summary(table, played.run)
    gap, crossed, pressed = table.column("least_gap_m").min(), table.column("crossed").any(), table.column("ball_z_N")
    command.say(f"least gap {1e3 * gap:.3f} mm; largest force on the sphere {np.abs(pressed).max():.3f} N")
    lost = played.run.ledger.totals
    command.say(f"lost by friction {lost['by_friction']:.3g} J, by impact {lost['by_impact']:.3g} J")
    good = gap > 0.0 and not crossed and imbalance <= 1.0
    command.say(f"check: nothing passes, imbalance at most 1 %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
