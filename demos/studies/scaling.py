"""Cost against size, number of ranks and solver of linear systems, of the drape held over patches (0.2 m), whole law.

Each run is a process of its own, `demos/drape.py --patch 0.2`, timed without set-up and compile; with a tolerance of
1e-6 where runs are compared. The table gives seconds, Newton iterations and how many of them made a matrix, linear
iterations and peak memory, and the exponents with which time and memory grow with the unknowns. With more than one
number of ranks it gives the speed-up, or with --weak, where r ranks get r times the cells, the efficiency; and how far
the heights of the centre are apart until 0.25 s, before buckling multiplies round-off, and after it.

    python demos/studies/scaling.py --cells 10 20 40 80 160 --solver direct iterative --end 0.05
    python demos/studies/scaling.py --cells 10 20 40 80 --solver lu direct --end 0.02
    python demos/studies/scaling.py --cells 40 80 --ranks 1 2 --end 0.05
    python demos/studies/scaling.py --cells 50 --ranks 1 2 --weak --end 0.05
    python demos/studies/scaling.py --cells 500 --solver iterative --end 0.1 -- --bending own    # 10 GB

With --sphere the sheet falls onto a sphere instead, with friction (`demos/sphere.py`):

    python demos/studies/scaling.py --sphere --cells 60 --ranks 1 2 --end 0.06

With --thickness it solves one linear system of an elastic sheet at rest instead, under its weight, gripped at two
edges: flat, so that it must bend, and stretched by 0.5 %; for every thickness over side, size and element.

    python demos/studies/scaling.py --thickness 1e-2 1e-3 1e-4 --cells 20 40 80 --element mitc4

With --model it counts work and messages of an iteration, and predicts what 8, 64 and 512 ranks gain: `rank_model`.

    python demos/studies/scaling.py --model

The checked number: heights until 0.25 s on any number of ranks differ by at most 1e-6 of the sag, on a sphere by 1e-8,
and those by another solver than LU, of a tolerance of its own, by at most 1e-4. With --thickness: the linear solvers
differ by at most 1e-3.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import sys
import time
from itertools import product
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import moving
import numpy as np
import rank_model
import studies
from dolfinx import fem

from fabric_fenicsx import plots, sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import results
from fabric_fenicsx.shell import directors
from fabric_fenicsx.solvers import linear
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

SQUARE = meshing.MESHES / "square.geo"
DEMOS = Path(__file__).parents[1]
ELEMENTS = ("mitc4", "regge")
REBOUND = 0.25  # s
SAID = (
    "{cells:3d} cells, {ranks} ranks, {solver:9s} {unknowns:7.0f} unknowns: {seconds:6.1f} s, {iterations_a_step:.1f} "
    "iterations and {matrices_a_step:.1f} matrices a step taken, {linear_iterations:4.1f} linear in each, "
    "{ms_an_iteration:6.1f} ms ({cpu_ms:.1f} of the processor), {memory_MB:5.0f} MB"
)
RESTS = (
    "h/L {ratio:g}, {element}, {state:9s} {cells:3d} cells, {unknowns:6d} unknowns: LU {lu_s:.2f} s, "
    "{iterations:3d} iterations {seconds:.2f} s"
)


def run(cells, ranks, solver, args):
    """The history of one run, a structured array."""
    out = results.folder(args.out / f"{cells}_cells_{ranks}_ranks_{solver}")
    demo, own = ("sphere.py", []) if args.sphere else ("drape.py", ["--patch", "0.2"])
    # a looser tolerance would show in the heights, for sums on two ranks round otherwise
    own += ["--rtol", 1e-6] if len(args.ranks) * len(args.solver) > 1 else []
    words = [*own, "--out", out, "--solver", solver, *args.also]
    for size, end in ((10, 0.01), (cells, args.end)):  # the first is for what is compiled and kept
        done = studies.on_ranks(ranks, DEMOS / demo, "--cells", size, "--end", end, *words)
    if done.returncode == 2 or not (out / "history.csv").exists():
        last = done.stderr.strip().splitlines()[-1:]
        raise StepFailed(f"The sheet of {cells} cells on {ranks} ranks has not run: {' '.join(last)}")
    return np.genfromtxt(out / "history.csv", delimiter=",", names=True)


def row(cells, ranks, solver, table):
    """What one run cost."""
    its = table["newton_iterations"].sum()
    return {
        "cells": cells,
        "ranks": ranks,
        "solver": solver,
        "unknowns": table["unknowns"][-1],
        "seconds": table["wall_s"].sum(),
        "steps_taken": table["steps_taken"].sum(),
        "iterations_a_step": its / table["steps_taken"].sum(),
        "matrices_a_step": table["matrices"].sum() / table["steps_taken"].sum(),
        "linear_iterations": table["linear_iterations"].sum() / its,
        "ms_an_iteration": 1e3 * table["wall_s"].sum() / its,
        "cpu_ms": 1e3 * table["cpu_s"].sum() / its,
        "memory_MB": table["memory_MB"][-1],
    }


def exponent(rows, name):
    """p of a cost that grows as unknowns^p, by least squares."""
    return np.polyfit(*(np.log([r[key] for r in rows]) for key in ("unknowns", name)), 1)[0]


def apart(one, other):
    """Largest difference of heights as a part of the sag: until the rebound, and after it (nan if not reached)."""
    z, w = one["centre_z_m"], other["centre_z_m"]
    difference = np.abs(z - w) / np.abs(z).max()
    early = one["time_s"] <= REBOUND + 1e-9
    return difference[early].max(), difference[~early].max(initial=0.0) if (~early).any() else np.nan


def at_rest(cells, ratio, element, part):
    """One linear system by LU and by GMRES: seconds and iterations. part: by which the sheet is stretched first."""
    quads = directors.ELEMENTS[element][0] == "quadrilateral"
    domain = meshing.read(SQUARE, MPI.COMM_SELF, side=moving.SIDE, n=cells, triangles=int(not quads))
    h, E, nu = ratio * moving.SIDE, 8e6, 0.25
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, nu), h, (E / 2 / (1 + nu),) * 2, element=element)
    bcs, g = supports.clamp(domain, cloth.space, "left"), fem.Constant(domain.mesh, np.zeros(3))
    for axis, shift in enumerate((part * moving.SIDE, 0.0, 0.0)):
        bcs += supports.lead(domain, cloth.space, "right", axis, shift)
    answers, times = [], []
    for options in (linear.DIRECT, linear.ITERATIVE):
        solver = cloth.equilibrium(bcs, cloth.weight(500.0 * h, g), options=options)
        g.value[2] = 0.0
        solver.solve()
        g.value[2] = -9.81
        load = solver.residual(solver.begin()).copy()
        ksp, answer = solver.factorised(), load.duplicate()
        clock = time.perf_counter()
        ksp.solve(load, answer)
        times.append(time.perf_counter() - clock)
        answers.append(answer.array_r.copy())
    unknowns, apart = len(answers[0]), np.abs(answers[1] - answers[0]).max() / np.abs(answers[0]).max()
    return {"ratio": ratio, "stretch": part, "cells": cells, "unknowns": unknowns, "lu_s": times[0],
            "iterations": ksp.getIterationNumber(), "seconds": times[1], "apart": apart}  # fmt: skip


def thicknesses(args):
    """The table of iterations against thickness and size; 0 if the solvers agree."""
    rows = []
    with results.Table(results.folder(args.out) / "thickness.csv") as table:
        for element, part, ratio, cells in product(args.element, (0.0, 0.005), args.thickness, args.cells):
            rows.append(at_rest(cells, ratio, element, part))
            table.row(regge=int(element == "regge"), **rows[-1])
            state = "stretched" if part else "flat"
            command.say(RESTS.format(element=element, state=state, **rows[-1]))
    worst = max(row["apart"] for row in rows)
    command.say(
        f"check: solvers agree to 1e-3 (they do to {worst:.1e}): {'yes' if worst <= 1e-3 else 'NO'}; see {args.out}"
    )
    return 0 if worst <= 1e-3 else 1


def plot(path, rows):
    """Seconds an iteration and memory over unknowns."""
    figure, panels = plots.panels(2, width=4.5, height=3.8)
    for axes, name, label in zip(
        panels, ("ms_an_iteration", "memory_MB"), ("time of a Newton iteration (ms)", "peak memory (MB)"), strict=True
    ):
        for k, (ranks, solver) in enumerate(dict.fromkeys((r["ranks"], r["solver"]) for r in rows)):
            own = [r for r in rows if (r["ranks"], r["solver"]) == (ranks, solver)]
            said = f"{solver}, {ranks} rank{'s' if ranks > 1 else ''}"
            axes.loglog([r["unknowns"] for r in own], [r[name] for r in own], label=said, **plots.series(k))
        plots.label(axes, "", "unknowns (-)", label)
        plots.plain(axes.xaxis, axes.yaxis)
    plots.legend(figure, 4)
    figure.savefig(path, dpi=150)


def compared(first, last, args):
    """A line on two runs, as dictionaries and histories; how far apart they may be, and are."""
    (one, history), (other, another) = first, last
    early, late = apart(history, another)
    said = f"heights apart {early:.1e} of the sag" + ("" if np.isnan(late) else f", later {late:.1e}")
    speed = one["ms_an_iteration"] / other["ms_an_iteration"]
    share = other["unknowns"] / other["ranks"] / one["unknowns"] * one["ranks"]
    if args.weak:
        return f"weak efficiency {speed * share:.2f}", 0.0
    return f"{speed:.2f} times as fast as {one['solver']} on {one['ranks']}; {said}", early / (
        (1e-8 if args.sphere else 1e-6) if other["solver"] == one["solver"] == "direct" else 1e-4
    )


def drapes(args):
    """The table of the drape; 0 if heights agree."""
    rows, worst = [], 0.0
    with results.Table(results.folder(args.out) / "scaling.csv") as table:
        for cells in args.cells:
            first = None
            for solver, ranks in product(args.solver, args.ranks):
                # whole blocks of ten, so that the patches are made of whole cells
                size = 10 * round(cells * ranks**0.5 / 10) if args.weak else cells
                history = run(size, ranks, solver, args)
                rows.append(row(size, ranks, solver, history))
                table.row(**rows[-1] | {"solver": list(moving.SOLVERS).index(solver)})
                command.say(SAID.format(**rows[-1]))
                if first is None or (args.weak and ranks == args.ranks[0]):
                    first = rows[-1], history
                    continue
                said, missed = compared(first, (rows[-1], history), args)
                worst = max(worst, missed)
                command.say(f"  {said}")
    for ranks, solver in product(args.ranks, args.solver) if len(args.cells) > 1 else []:
        own = [r for r in rows if (r["ranks"], r["solver"]) == (ranks, solver)]
        cost, memory = exponent(own, "cpu_ms"), exponent(own, "memory_MB")
        grows = f"processor time of an iteration unknowns^{cost:.2f}, memory unknowns^{memory:.2f}"
        command.say(f"{solver}, {ranks} ranks: {grows}")
    plot(args.out / "scaling.png", rows)
    close = "1e-8" if args.sphere else "1e-6"
    said = f"check: heights agree, ranks to {close} of the sag and solvers to 1e-4, until {REBOUND} s"
    command.say(f"{said}: {'yes' if worst <= 1.0 else 'NO'}; see {args.out}")
    return 0 if worst <= 1.0 else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=command.positive, nargs="+", default=[10, 20, 40], help="along a side")
    parser.add_argument("--ranks", type=command.positive, nargs="+", default=[1])
    parser.add_argument("--solver", choices=moving.SOLVERS, nargs="+", default=["direct"])
    parser.add_argument("--sphere", action="store_true", help="the sheet falls onto a sphere")
    parser.add_argument("--weak", action="store_true", help="r ranks get r times the cells")
    parser.add_argument("--thickness", type=command.number, nargs="+", help="over side; sheets at rest instead")
    parser.add_argument("--element", choices=ELEMENTS, nargs="+", default=ELEMENTS, help="of sheets at rest")
    parser.add_argument("--model", action="store_true", help="what many ranks would gain instead")
    parser.add_argument("--end", type=command.number, default=0.05, help="s")
    parser.add_argument("--out", type=Path, default=Path("out/scaling"))
    parser.add_argument("also", nargs="*", help="after --: more words for the drape")
    args = command.parse(parser)
    if MPI.COMM_WORLD.size > 1:
        raise InputError("scaling.py starts mpirun itself: call it on one rank, with --ranks.")
    if args.model:
        for line in rank_model.table(args.end):
            command.say(line)
        return 0
    if args.thickness:
        return thicknesses(args)
    if bad := [n for n in args.cells if n % 10]:
        raise InputError(f"--cells {bad[0]}: take multiples of 10, so that the patches are made of whole cells.")
    return drapes(args)


if __name__ == "__main__":
    command.run(main)
