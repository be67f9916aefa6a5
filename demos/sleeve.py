"""A sleeve is bent at the elbow and twisted at the wrist (thesis, Figure 6-1), with the whole fabric law.

A cylinder of cloth, warp along it, is a shell with directors and three layers. The shoulder is clamped; the wrist is
gripped, and moves as one rigid body: it bends the sleeve by --bend along a circle, which lies between the middle line
and the outer side, and turns by --twist about itself. The inner side is pushed together and wrinkles. Statics has no
way through a hundred small bucklings, so the sleeve moves in time, with some damping, and then rests.

The checked numbers: at most 2 % of the largest external work is not accounted for, and what the law and the damping
took is not negative (to 0.01 % of that work; the scheme's part to 0.1 %). There is no contact: folds may touch and
cross.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.output.series import LABELS
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

MESH = meshing.MESHES / "sleeve.geo"
RADIUS, LENGTH = 0.05, 0.3  # m


def wrist(part, bend, twist):
    """Shift (m) and rotation vector of the wrist about its middle, when `part` of bend and twist (radians) is done."""
    b = part * bend
    along, up = (np.sin(b) / b, (1 - np.cos(b)) / b) if b else (1.0, 0.0)
    middle = LENGTH - RADIUS * b / 2
    turn = Rotation.from_euler("y", -b) * Rotation.from_euler("x", part * twist)
    return (middle * along - LENGTH, 0.0, middle * up), turn.as_rotvec()


def depth(u, bend):
    """How far the cloth lies inside of a tube that is bent so without folds at most, m; of all ranks."""
    x = u.function_space.tabulate_dof_coordinates() + u.x.array.reshape(-1, 3)
    r = LENGTH / max(bend, 1e-6) - RADIUS / 2  # of a straight one it is large
    inside = RADIUS - np.hypot(x[:, 1], np.hypot(x[:, 0], x[:, 2] - r) - r)
    return u.function_space.mesh.comm.allreduce(inside.max(initial=0.0), MPI.MAX)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fabric", default="blend", help="name, or a TOML file")
    parser.add_argument("--bend", type=command.number, default=45.0, help="degrees")
    parser.add_argument("--twist", type=command.number, default=20.0, help="degrees")
    parser.add_argument("--around", type=command.positive, default=32, help="cells around the sleeve, a multiple of 4")
    parser.add_argument("--along", type=command.positive, default=24, help="cells along it")
    parser.add_argument("--move", type=command.above_zero, default=0.5, help="how long the wrist moves, s")
    parser.add_argument("--end", type=command.number, default=0.6, help="s")
    parser.add_argument("--step", type=command.number, default=5.0, help="nominal time step, ms")
    parser.add_argument("--damping", type=command.number, default=20.0, help="a of Rayleigh's a M, 1/s")
    parser.add_argument("--rho", type=command.number, default=0.5, help="left of the fastest oscillation after a step")
    parser.add_argument("--out", type=Path, default=Path("out/sleeve"))
    args = command.parse(parser)
    if not 0 <= args.bend <= 180:
        raise InputError(f"--bend {args.bend:g}: bend the sleeve by 0 to 180 degrees.")
    return args


def main():
    args = arguments()
    out = results.folder(args.out)
    fabric, bend, twist = fabrics.load(args.fabric), np.radians(args.bend), np.radians(args.twist)
    domain = meshing.read(MESH, radius=RADIUS, length=LENGTH, around=args.around, along=args.along)
    G = fabric.shear.modulus[0]
    cloth = sheet.Sheet(domain, Potential(fabric), fabric.thickness, shear=(G, G), warp=(1, 0, 0))
    command.say(f"{cloth.q.function_space.dofmap.index_map.size_global} unknowns")

    held, move = supports.grip(domain, cloth.space, "wrist")
    held += supports.clamp(domain, cloth.space, "shoulder")

    def part(t):
        return 0.5 - 0.5 * np.cos(np.pi * min(max(t / args.move, 0.0), 1.0))

    def set_time(t):
        move(*wrist(part(t), bend, twist), (LENGTH, 0.0, 0.0))

    run, ledger = cloth.newmark(
        fabric.density * fabric.thickness, held, rho=args.rho, damping=args.damping, set_load=set_time
    )
    wrist_forces = {
        f"wrist_{axis}_N": supports.unknowns(domain, cloth.space, "wrist", k) for k, axis in enumerate("xyz")
    }

    def probes(step):
        forces = {name: run.solver.reaction(unknowns) for name, unknowns in wrist_forces.items()}
        fold = depth(cloth.displacement(), part(step.load) * bend)
        return {"time_s": step.load, **forces, "fold_mm": 1e3 * fold}

    title = f"{fabric.name}, to be bent {args.bend:g}°, twisted {args.twist:g}°"
    with Recorder(cloth, out, probes, title=title, colour="warp", view=(-1.0, -1.6, 2.0), run=run) as record:
        for step in run.march(args.end, args.step * 1e-3, progress="sleeve"):
            record(step)
    strain, inside, table = cloth.cell_strain()[:, 0], (0.2, -0.9, 1.6), record.table
    pictures.picture(
        out / "inner_side.png", cloth.displacement(), strain, LABELS["warp"], title, view=inside, yarns=cloth.yarns()
    )

    t, last = ledger.totals, table.rows[-1]
    seconds, iterations, cuts = (table.column(name).sum() for name in ("wall_s", "newton_iterations", "step_cuts"))
    command.say(f"{len(table.rows)} steps, {cuts:g} cuts, {iterations:g} Newton iterations, {seconds:.1f} s")
    command.say(f"deepest fold {last['fold_mm']:.1f} mm; warp strain {cloth_range(cloth)}")
    command.say(
        f"work of the wrist {t['external']:.4g} J: recoverable {t['recoverable']:.3g}, dissipated by the law "
        f"{t['by_law']:.3g}, by damping {t['by_damping']:.3g}, by the scheme {t['by_scheme']:.3g}, kinetic "
        f"{t['kinetic']:.3g} J; largest imbalance {100 * ledger.worst / ledger.most:.2f} %"
    )
    lost = min(t["by_law"], t["by_damping"])
    # the scheme's part has a sign in linear problems only
    good = ledger.worst <= 0.02 * ledger.most and lost >= -1e-4 * ledger.most and t["by_scheme"] >= -1e-3 * ledger.most
    command.say(f"check: imbalance at most 2 %, losses are losses: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


def cloth_range(cloth):
    """Least and largest warp strain of all cells, as text."""
    own = cloth.cell_strain()[:, 0]
    comm = cloth.domain.mesh.comm
    return f"{comm.allreduce(own.min(), MPI.MIN):.3f} to {comm.allreduce(own.max(), MPI.MAX):.3f}"


if __name__ == "__main__":
    command.run(main)
