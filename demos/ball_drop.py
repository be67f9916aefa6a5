"""A ball is dropped onto the middle of a clamped square, which stops it and throws it back (thesis 8.2).

0.5 m x 0.5 m, all of the rim clamped; the ball starts just out of reach, at the speed of its drop. Rebound: the
largest speed upwards as a part of that of the drop. --study: rebound and lowest point against mass, height and fabric
instead, each in a folder of its own, with the figure `study.png`.

    python demos/ball_drop.py --mass 0.5 --height 0.2

The checked numbers: nothing goes through, the ball comes back up, momentum of sheet and ball is the impulse of supports
and weight to 0.5 % of its change, thrown off it flies with g to 1 %, and at most 1 % of the external work is not
accounted for.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from copy import copy
from pathlib import Path

import moving
import numpy as np
import touching
import ufl

from fabric_fenicsx import fabrics, plots
from fabric_fenicsx.app import command
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

G, ABOVE, SIDE = 9.81, 1e-3, 0.5
MASSES, HEIGHTS, FABRICS = (0.25, 0.5, 1.0), (0.1, 0.2, 0.4), ("blend", "muslin", "duck", "denim")


def scene(args, comm=MPI.COMM_WORLD):
    """The clamped square, and the ball above its middle."""
    cloth, areal_mass = moving.square(meshing.MESHES / "drape.geo", args, 0.2 * SIDE, comm, side=SIDE)
    speed, down = np.sqrt(2 * G * args.height), (0.0, 0.0, -G)
    above = args.radius + ABOVE + 6 * fabrics.load(args.fabric).thickness  # beyond offset and reach
    ball = bodies.Sphere(args.radius, (SIDE / 2, SIDE / 2, above), cells=args.ball_cells, name="ball")
    ball.free(args.mass, velocity=(0, 0, -speed))
    touch = Contact(cloth, [ball], friction=args.friction, stiffness=args.stiffness, itself=False, gravity=down)
    command.say(f"contact: {touch.describe()}")
    weight = cloth.weight(areal_mass, ufl.as_vector(down))
    rim = supports.clamp(cloth.domain, cloth.space, "rim")
    run, _ = moving.runner(args, cloth, areal_mass, rim, [weight, *touch.terms])
    unknowns = supports.unknowns(cloth.domain, cloth.space, "rim", 2)
    heights = np.array(cloth.q.function_space.sub(0).sub(2).collapse()[1])
    heights = heights[heights < len(run.forces())]

    def momentum():
        sheet = run.motion.by_mass(run.motion.velocity).array_r[heights].sum()
        return comm.allreduce(sheet) + args.mass * touch.free.rates()[2]

    probes = {
        "ball_z_m": lambda: ball.target[:, 2].mean() - args.radius,
        "ball_speed_m_per_s": lambda: touch.free.rates()[2],
        "centre_z_m": moving.value_at(cloth, 2, "centre"),
        "rim_z_N": lambda: run.reaction(unknowns),
        "momentum_Ns": momentum,
        "crossed": touch.crossed,
    }
    made_with = moving.settings("ball drop", args, mass=args.mass, height=args.height, radius=args.radius)
    weighs = G * (args.mass + comm.allreduce(run.motion.mass.getRowSum().array_r[heights].sum()))
    name = f"ball of {args.mass:g} kg, {args.height:g} m, on {Path(args.fabric).stem}"
    return moving.Scene(name, cloth, run, run.ledger, probes, made_with, touch), weighs


def judge(table, run, weighs, args):
    """Rebound, lowest point (m) and imbalance (%), whether the numbers are good."""
    t, speed = table.column("time_s"), table.column("ball_speed_m_per_s")
    push, held = table.column("momentum_Ns"), table.column("rim_z_N")
    impulse = np.concatenate([[0.0], np.cumsum(np.diff(t) * (held[1:] + held[:-1]) / 2)]) - weighs * (t - t[0])
    miss = np.abs(push - push[0] - impulse).max() / np.ptp(push)
    rebound, lowest = speed.max() / np.sqrt(2 * G * args.height), table.column("ball_z_m").min()
    imbalance, gap = moving.summary(table, run), table.column("least_gap_m").min()
    command.say(f"lowest point {1e3 * lowest:.1f} mm, rebound {rebound:.3f}, least gap {1e3 * gap:.3f} mm")
    command.say(f"momentum differs from the impulse of supports and weight by {100 * miss:.3f} % of its change at most")
    command.say(f"of {run.ledger.most:.3g} J of external work the law has taken {run.ledger.totals['by_law']:.3g} J")
    good = touching.clear(table) and speed[-1] > 0.0 and miss < 5e-3 and imbalance <= 1.0
    flies = (table.column("ball_z_N") == 0.0) & (speed > 0.0)
    flies = flies[1:] & flies[:-1]
    if flies.sum() >= 3:
        rate = float((np.diff(speed) / np.diff(t))[flies].mean())
        command.say(f"thrown off, it flies freely for {1e3 * np.diff(t)[flies].sum():.1f} ms, with {rate:.4f} m/s2")
        good &= abs(rate / G + 1) < 0.01
    return rebound, lowest, imbalance, good


def play(args, out):
    """One drop."""
    played, weighs = scene(args)
    table = moving.play(played, args, out, progress=True)
    return judge(table, played.run, weighs, args)


def study(args, out):
    """Drops of other masses, from other heights, and of other fabrics; whether all are good."""
    rows, curves = [], {}
    for key, values in (("mass", MASSES), ("height", HEIGHTS), ("fabric", FABRICS)):
        for value in values:
            one = copy(args)
            setattr(one, key, value)
            found = play(one, results.folder(out / f"{key}_{value}"))
            rows.append({"mass_kg": one.mass, "height_m": one.height, "fabric": one.fabric, "rebound": found[0]})
            rows[-1] |= {"lowest_m": found[1], "imbalance_percent": found[2], "good": found[3]}
            curves.setdefault(key, []).append((value, 1e3 * found[1], found[0]))
            command.say("; ".join(f"{name} {said}" for name, said in rows[-1].items()))
    results.on_root(MPI.COMM_WORLD, lambda: plot(out / "study.png", curves))
    return all(row["good"] for row in rows)


def plot(path, curves):
    """Lowest point and rebound against mass, height and fabric."""
    figure, panels = plots.panels(3, width=4.0, height=3.6)
    said = {"mass": "mass (kg)", "height": "drop height (m)", "fabric": ""}
    for axes, (key, points) in zip(panels, curves.items(), strict=True):
        value, lowest, rebound = zip(*points, strict=True)
        axes.plot(value, lowest, "ko-")
        plots.label(axes, "", said[key], "lowest point (mm)")
        other = axes.twinx()
        other.plot(value, rebound, "s--", color="0.5")
        other.set_ylabel("rebound, dashed (-)")
    plots.save(figure, path)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    moving.add_arguments(parser, end=0.08, rho=0.8)
    parser.set_defaults(step=1.0, cells=20)
    parser.add_argument("--mass", type=command.number, default=0.5, help="of the ball, kg")
    parser.add_argument("--height", type=command.number, default=0.2, help="of the drop, m")
    parser.add_argument("--radius", type=command.number, default=0.05, help="of the ball, m")
    parser.add_argument("--ball-cells", type=command.positive, default=6, help="along a quarter of the ball")
    parser.add_argument("--friction", type=command.number, default=0.0, help="coefficient")
    parser.add_argument("--stiffness", type=command.number, help="of contact, Pa; by default what stops the ball")
    parser.add_argument("--study", action="store_true", help="against mass, height and fabric")
    parser.add_argument("--out", type=Path, default=Path("out/ball_drop"))
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    good = study(args, out) if args.study else play(args, out)[3]
    command.say(f"check: stopped and thrown back, in balance: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
