"""A square tablecloth is lowered onto a round table, and hangs over its edge in folds.

The cloth, 1 m x 1 m, bends as measured (see `demos/cusick.py` for cloths by numbers of a laboratory). It lies on the
table, flat but for waves of random height and phase; then its weight comes over 0.5 s, as if it was lowered, and
damping brings it to rest. Where the folds come is not unique, as at home.

    python demos/tablecloth.py --cells 16
    fabric-fenicsx run tablecloth --out out/tablecloth                  # a scene by data: it falls onto the table

The checked numbers: nothing passes through anything, at most 1 % of the largest external work is not accounted for, and
in the end the table bears the weight to 2 %. (With a resting contact, damping a M in steps of dt bears the part
(1 - gamma/(2 beta)) a dt of it: 0.6 % here, 2.5 % with --rho 0.)
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import bent
import moving
import numpy as np
import touching
from dolfinx import fem

from fabric_fenicsx.app import command
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing

SIDE, LOWERED = 1.0, 0.5  # m, s


def scene(args, comm=MPI.COMM_WORLD):
    """The cloth on the table, without weight, and what lowers it."""
    material = bent.Cloth(args)
    material.say()
    mesh = meshing.MESHES / "drape.geo"
    domain = moving.read(mesh, args.element, comm, side=SIDE, n=args.cells, a=SIDE / args.cells)
    domain.mesh.geometry.x[:, :2] -= SIDE / 2
    touching.wave(domain, args.radius, SIDE / np.sqrt(2), 1e-3 * args.imperfection, args.seed)
    cloth = material.sheet(domain)
    thickness = material.fabric.thickness
    top = -1.5 * thickness
    table = bodies.Cylinder(args.radius, 0.04, (0, 0, top - 0.02), cells=args.around, name="table")
    g = fem.Constant(domain.mesh, (0.0, 0.0, 0.0))
    stiffness = material.mass * bent.GRAVITY * SIDE**2 / (np.pi * args.radius**2)
    touch = Contact(cloth, [table], friction=args.friction, reach=thickness, stiffness=10 * stiffness, creep=1e-4)
    weight = cloth.weight(material.mass, g)
    run, ledger = cloth.newmark(
        material.mass,
        [],
        [weight, *touch.terms],
        rho=args.rho,
        damping=args.damping,
        set_load=bent.lowering(g, LOWERED),
        rtol=args.rtol,
    )
    probes = {"corners_z_m": moving.value_at(cloth, 2, "corners"), "crossed": touch.crossed}
    made_with = touching.marks(args)
    name = f"tablecloth of {material.name}"
    played = moving.Scene(name, cloth, run, ledger, probes, made_with, touch)
    return played, material.mass * bent.GRAVITY * SIDE**2


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    bent.add_arguments(parser)
    parser.add_argument("--cells", type=command.positive, default=16, help="along a side, even")
    parser.add_argument("--radius", type=command.above_zero, default=0.3, help="of the table, m")
    parser.add_argument("--around", type=command.positive, default=24, help="cells along a quarter of the table")
    parser.add_argument("--friction", type=command.number, default=0.3, help="coefficient")
    parser.add_argument("--seed", type=int, default=0, help="of the waves")
    parser.add_argument("--imperfection", type=command.above_zero, default=3.0, help="height of the waves, mm")
    touching.add_arguments(parser, step=10.0, damping=10.0)
    parser.add_argument("--end", type=command.above_zero, default=1.5, help="s")
    parser.add_argument("--resume", nargs="?", const=True, metavar="FILE", help="go on from a checkpoint")
    parser.add_argument("--out", type=Path, default=Path("out/tablecloth"))
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    played, weight = scene(args)
    table = moving.play(played, args, out, progress=True, every=4)
    imbalance = moving.summary(table, played.run)
    touching.draw(played, out / "deformed.png")
    tail = table.column("time_s") > 0.9 * args.end
    borne = -table.column("table_z_N")[tail].mean() / weight
    good = touching.passed(table) and imbalance <= 1.0
    command.say(
        f"corners at {1e3 * table.rows[-1]['corners_z_m']:.1f} mm; the table bears {100 * borne:.2f} % of the weight"
    )
    if args.end > 1.9 * LOWERED:
        good &= abs(borne - 1.0) <= 0.02
    command.say(
        f"check: nothing passes, imbalance at most 1 %, the table bears it: {'yes' if good else 'NO'}; see {out}"
    )
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
