"""Five sheets of cloth fall on each other and on a table, and come to rest as a stack.

Each has a mesh of its own, which does not fit that of its neighbours. At rest each bears the weight of those above it.

    python demos/stack.py --sheets 5

The checked numbers: nothing passes through anything, at most 1 % of the external work is not accounted for, and between
any two sheets, and on the table, there is the weight of all that lies above to 1 %.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import moving
import numpy as np
import touching
import ufl

from fabric_fenicsx.app import command
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing

SIDE = 0.2  # m


def stack(path, args):
    """Write an .obj file of square sheets above each other, each turned a little and with a mesh of its own."""
    x, faces = [], []
    for k in range(args.sheets):
        n, angle, first = args.cells + k % 3, np.radians(args.turn * k), len(x)
        s = np.linspace(-SIDE / 2, SIDE / 2, n + 1)
        c, d = np.cos(angle), np.sin(angle)
        x += [(c * a - d * b, d * a + c * b, 1e-3 * args.apart * k) for b in s for a in s]
        faces += [[first + j * (n + 1) + i + e for e in (0, 1, n + 2, n + 1)] for j in range(n) for i in range(n)]
    touching.obj(path, x, faces)


def scene(args, out, comm=MPI.COMM_WORLD):
    """The sheets above the table, ready to fall."""
    results.on_root(comm, lambda: stack(out / "stack.obj", args))
    domain = meshing.read(out / "stack.obj", comm)
    cloth = touching.elastic(domain)
    table = bodies.Plane(point=(0, 0, -1e-3 * args.apart), size=1.4 * SIDE, name="table")
    touch = Contact(
        cloth, [table], friction=args.friction, reach=2 * touching.THICKNESS, stiffness=args.stiffness, creep=1e-4
    )
    weight = cloth.weight(touching.MASS, ufl.as_vector((0.0, 0.0, -touching.G)))
    run, ledger = cloth.newmark(
        touching.MASS, [], [weight, *touch.terms], rho=args.rho, damping=args.damping, rtol=args.rtol
    )
    heights = touch.rest[:, 2]
    above = [heights > 1e-3 * args.apart * (k - 0.5) for k in range(1, args.sheets)]

    def borne(part):
        return lambda: float(touch.forces()[part, 2].sum())

    probes = {f"on_{k}_N": borne(part) for k, part in enumerate(above, 1)} | {"crossed": touch.crossed}
    made_with = touching.marks(args)
    return moving.Scene(f"stack of {args.sheets} sheets", cloth, run, ledger, probes, made_with, touch)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--sheets", type=command.positive, default=5, help="how many")
    parser.add_argument("--cells", type=command.positive, default=6, help="along a side of the lowest one")
    parser.add_argument("--turn", type=command.number, default=7.0, help="of each from the one below, degrees")
    parser.add_argument("--apart", type=command.above_zero, default=3.0, help="at the start, mm")
    parser.add_argument("--friction", type=command.number, default=0.3, help="coefficient")
    parser.add_argument("--stiffness", type=command.above_zero, default=10.0, help="of contact, Pa")
    parser.add_argument("--step", type=command.above_zero, default=5.0, help="ms")
    parser.add_argument("--end", type=command.above_zero, default=0.4, help="s")
    parser.add_argument("--damping", type=command.number, default=10.0, help="a of Rayleigh's a M, 1/s")
    moving.add_common(parser, 0.5, 1e-4)
    parser.add_argument("--out", type=Path, default=Path("out/stack"))
    parser.set_defaults(resume=None)
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    played = scene(args, out)
    table = moving.play(played, args, out, progress=True)
    imbalance = moving.summary(table, played.run)
    tail, W = table.column("time_s") > 0.9 * args.end, touching.MASS * touching.G * SIDE**2
    columns = ["table_z_N", *(f"on_{k}_N" for k in range(1, args.sheets))]
    borne = [abs(table.column(name)[tail].mean()) / W for name in columns]
    command.say("borne, in weights of a sheet: " + ", ".join(f"{b:.4f}" for b in borne))
    errors = [b / (args.sheets - k) - 1 for k, b in enumerate(borne)]
    good = touching.passed(table) and imbalance <= 1.0 and max(map(abs, errors)) <= 0.01
    command.say(f"check: nothing passes, imbalance at most 1 %, weights to 1 %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
