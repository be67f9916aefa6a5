"""Cost against size, and against the number of ranks, of the drape held over patches (0.2 m), whole law.

Each run is a process of its own, `demos/drape.py --patch 0.2 --rtol 1e-6`, timed without set-up and compile. The table
gives seconds, Newton iterations and peak memory, and the exponents with which time and memory grow with the unknowns;
with more than one number of ranks, the speed-up, and how far the heights of the centre are apart until 0.25 s, before
buckling multiplies round-off, and after it.

    python demos/scaling.py --cells 10 20 40 80 --end 0.05
    python demos/scaling.py --cells 20 --ranks 1 2 --end 0.5

The checked number: heights on any number of ranks differ by at most 1e-6 of the sag until 0.25 s.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from fabric_fenicsx import command, plots, results, system
from fabric_fenicsx.errors import InputError, StepFailed

DRAPE = Path(__file__).with_name("drape.py")
REBOUND = 0.25  # s
SAID = (
    "{cells:3d} cells, {ranks} ranks, {unknowns:6.0f} unknowns: {seconds:.1f} s, {iterations_a_step:.1f} iterations a "
    "step taken, {ms_an_iteration:.1f} ms an iteration, {memory_MB:.0f} MB"
)


def run(cells, ranks, args):
    """The history of one drape, a structured array."""
    out = results.folder(args.out / f"{cells}_cells_{ranks}_ranks")
    # a looser tolerance would show in the heights, for sums on two ranks round otherwise
    words = [sys.executable, DRAPE, "--patch", "0.2", "--cells", cells, "--end", args.end, "--rtol", 1e-6, "--out", out]
    words += args.also
    if ranks > 1:
        mpirun = system.mpirun()
        if mpirun is None:
            raise InputError(f"--ranks {ranks} needs mpirun, and there is none on the path.")
        words = [mpirun, "-n", ranks, *words]
    # a rank has one core
    done = subprocess.run([str(word) for word in words], env=os.environ | {"OMP_NUM_THREADS": "1"}, capture_output=True)
    if done.returncode == 2 or not (out / "history.csv").exists():
        last = done.stderr.decode().strip().splitlines()[-1:]
        raise StepFailed(f"The drape of {cells} cells on {ranks} ranks has not run: {' '.join(last)}")
    return np.genfromtxt(out / "history.csv", delimiter=",", names=True)


def row(cells, ranks, table):
    """What one run cost."""
    its = table["newton_iterations"].sum()
    return {
        "cells": cells,
        "ranks": ranks,
        "unknowns": table["unknowns"][-1],
        "seconds": table["wall_s"].sum(),
        "steps_taken": table["steps_taken"].sum(),
        "iterations_a_step": its / table["steps_taken"].sum(),
        "ms_an_iteration": 1e3 * table["wall_s"].sum() / its,
        "memory_MB": table["memory_MB"][-1],
    }


def exponent(rows, name):
    """p of a cost that grows as unknowns^p, by least squares."""
    return np.polyfit(*(np.log([r[key] for r in rows]) for key in ("unknowns", name)), 1)[0]


def apart(one, other):
    """Largest difference of heights as a part of the sag: until the rebound, and after it (nan if not reached)."""
    z, w = one["center_z_m"], other["center_z_m"]
    difference = np.abs(z - w) / np.abs(z).max()
    early = one["time_s"] <= REBOUND + 1e-9
    return difference[early].max(), difference[~early].max(initial=0.0) if (~early).any() else np.nan


def plot(path, rows):
    """Seconds an iteration and memory over unknowns."""
    figure, panels = plots.panels(2, width=4.5, height=3.8)
    for axes, name, label in zip(
        panels, ("ms_an_iteration", "memory_MB"), ("time of an iteration (ms)", "peak memory (MB)"), strict=True
    ):
        for k, ranks in enumerate(dict.fromkeys(r["ranks"] for r in rows)):
            own = [r for r in rows if r["ranks"] == ranks]
            said = f"{ranks} rank{'s' if ranks > 1 else ''}"
            axes.loglog([r["unknowns"] for r in own], [r[name] for r in own], label=said, **plots.series(k))
        plots.label(axes, "", "unknowns (-)", label)
        plots.plain(axes.xaxis, axes.yaxis)
    plots.legend(figure, 4)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=command.positive, nargs="+", default=[10, 20, 40], help="along a side")
    parser.add_argument("--ranks", type=command.positive, nargs="+", default=[1])
    parser.add_argument("--end", type=command.number, default=0.05, help="s")
    parser.add_argument("--out", type=Path, default=Path("out/scaling"))
    parser.add_argument("also", nargs="*", help="after --: more words for the drape")
    args = command.parse(parser)
    if MPI.COMM_WORLD.size > 1:
        raise InputError("scaling.py starts mpirun itself: call it on one rank, with --ranks.")
    if bad := [n for n in args.cells if n % 10]:
        raise InputError(f"--cells {bad[0]}: take multiples of 10, so that the patches are made of whole cells.")
    rows, worst = [], 0.0
    with results.Table(results.folder(args.out) / "scaling.csv") as table:
        for cells in args.cells:
            first = None
            for ranks in args.ranks:
                history = run(cells, ranks, args)
                rows.append(row(cells, ranks, history))
                table.row(**rows[-1])
                command.say(SAID.format(**rows[-1]))
                if first is None:
                    first = history, rows[-1]
                    continue
                early, late = apart(first[0], history)
                worst = max(worst, early)
                speed = first[1]["ms_an_iteration"] / rows[-1]["ms_an_iteration"]
                command.say(
                    f"  speed-up of an iteration {speed:.2f}; heights apart {early:.1e} of the sag, later {late:.1e}"
                )
    for ranks in args.ranks if len(args.cells) > 1 else []:
        own = [r for r in rows if r["ranks"] == ranks]
        time, memory = exponent(own, "ms_an_iteration"), exponent(own, "memory_MB")
        command.say(f"{ranks} ranks: an iteration costs unknowns^{time:.2f}, memory unknowns^{memory:.2f}")
    plot(args.out / "scaling.png", rows)
    command.say(
        f"check: ranks agree to 1e-6 of the sag until {REBOUND} s: {'yes' if worst <= 1e-6 else 'NO'}; see {args.out}"
    )
    return 0 if worst <= 1e-6 else 1


if __name__ == "__main__":
    command.run(main)
