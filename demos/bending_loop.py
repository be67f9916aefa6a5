"""A specimen between two grips is bent to an arc and back, as KES does it, and B and 2HB are read off its loop.

10 mm of cloth between grips 100 mm long; along the yarns, where it bends alike everywhere, a tenth of it will do. The
moving grip is led along the arc of a specimen that does not stretch, to a curvature of +250, -250 and +250 1/m. B is
the mean slope between 50 and 150 1/m, 2HB the width of the loop at 100 1/m, both sides taken together. A bias specimen
cannot twist in its grips and reads (Bw + Bf + 2 B12 + 4 B66)/4.

The checked number: B and 2HB within 0.5 % of what the bending law gives at a point that is bent likewise, 2 % on the
bias.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import bent
import numpy as np

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.identify.bending import loops
from fabric_fenicsx.identify.bending.found import KES_2HB, KES_B
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.bending import Bending
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.terms import supports

LENGTH = 0.01  # m
WIDTHS = {"warp": 0.01, "weft": 0.01, "bias": 0.1}
HIGHEST = 250.0  # 1/m
VIEW = (0.6, -2.0, 0.7)


def path(step):
    """Curvatures (1/m) of the test, so far apart."""
    n = round(HIGHEST / step)
    return HIGHEST * np.concatenate([np.arange(1, n + 1), np.arange(n - 1, -n - 1, -1), np.arange(1 - n, n + 1)]) / n


def arc(curvature):
    """Shift (m) and rotation vector of the moving grip; the face is outside where the curvature is positive."""
    turn = curvature * LENGTH
    along, down = (np.sin(turn) / turn, (1 - np.cos(turn)) / turn) if turn else (1.0, 0.0)
    return (LENGTH * (along - 1), 0.0, -LENGTH * down), (0.0, turn, 0.0)


def at_a_point(cloth, way, curvatures):
    """Moments (N) of the bending law along the path, in the axes of the specimen: no twist, none across."""
    K = np.zeros((len(curvatures), 3))
    K[:, 0] = curvatures
    return driver.run(Bending(cloth.curves), K, -bent.WAYS[way]).stress[:, 0]


def plot(file, name, runs):
    """Moment over curvature of some runs, as laboratories draw it."""
    figure, (axes,) = plots.panels(1, width=6.0, height=4.5)
    for label, K, M, look in runs:
        axes.plot(K / 100, 1e3 * M, look, label=label, ms=3)
    axes.axhline(0.0, color="black", lw=0.8)
    axes.axvline(0.0, color="black", lw=0.8)
    plots.label(axes, name, "curvature (1/cm)", "moment per width (mN)")
    plots.legend(figure, 2)
    figure.savefig(file, dpi=150)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    bent.add_arguments(parser)
    parser.add_argument("--way", choices=bent.WAYS, default="warp", help="along which the specimen is bent")
    parser.add_argument(
        "--cells", type=command.positive, default=24, help="along the 10 mm; with fewer the grips press them"
    )
    parser.add_argument("--step", type=command.above_zero, default=12.5, help="of the curvature, 1/m")
    parser.add_argument("--out", type=Path, default=Path("out/bending_loop"))
    return command.parse(parser)


def main():
    args = arguments()
    out, cloth = results.folder(args.out), bent.Cloth(args)
    cloth.say()
    width = WIDTHS[args.way]
    specimen = cloth.strip(LENGTH, width, args.cells, args.way, across=10 if args.way == "bias" else 2)
    held, move = supports.grip(specimen.domain, specimen.space, "pulled_end")
    held += supports.clamp(specimen.domain, specimen.space, "fixed_end")
    solver, title = specimen.equilibrium(held), f"{cloth.name}, {args.way}"
    ends, curvatures = supports.unknowns(specimen.domain, specimen.space, "pulled_end"), path(args.step)

    def probes(step):
        shift, _ = arc(step.load)
        moment = solver.reaction_moment(ends, (LENGTH + shift[0], 0.0, shift[2]))[1]
        return {"curvature_per_m": step.load, "moment_N": moment / width}

    with Recorder(
        specimen, out, probes, title=title, when=lambda step: f"{step.load:g} 1/m", picture=None, view=VIEW
    ) as record:
        for step in statics.march(
            solver, lambda K: move(*arc(K), (LENGTH, 0.0, 0.0)), list(curvatures), progress=title
        ):
            record(step)
            if step.load == HIGHEST and len(record.table.rows) < len(curvatures):
                value = bent.height(specimen)
                pictures.picture(out / "deformed.png", specimen.displacement(), value, "height (mm)", title, view=VIEW)
    table = record.table
    K, M, exact = table.column("curvature_per_m"), table.column("moment_N"), at_a_point(cloth, args.way, curvatures)
    (B, HB2), (B0, HB20) = loops.read_loop(K, M), loops.read_loop(curvatures, exact)
    iterations, cuts = (table.column(name).sum() for name in ("newton_iterations", "step_cuts"))
    command.say(f"{len(K)} steps, {iterations / len(K):.1f} Newton iterations each, {cuts:g} cuts")
    command.say(
        f"B {1e6 * B:.4g} uN m = {B / KES_B:.4g} gf cm2/cm, at a point {1e6 * B0:.4g}, {100 * (B / B0 - 1):+.2f} %"
    )
    command.say(f"2HB {1e3 * HB2:.4g} mN = {HB2 / KES_2HB:.4g} gf cm/cm, at a point {1e3 * HB20:.4g}")
    if MPI.COMM_WORLD.rank == 0:
        plot(out / "loop.png", title, [("at a point", curvatures, exact, "-"), ("shell", K, M, ".")])
    part = 0.02 if args.way == "bias" else 0.005
    good = abs(B / B0 - 1) <= part and abs(HB2 - HB20) <= part * max(HB20, 1e-3 * np.abs(M).max())
    command.say(f"check: B and 2HB within {100 * part:g} %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
