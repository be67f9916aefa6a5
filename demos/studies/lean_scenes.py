"""What a feature costs, and that it costs nothing where it is not used.

One table, a row a feature, of small scenes with and without it: unknowns, kernels compiled (integrals of forms and
expressions), batches of cells (`work.InternalWork`), processor time of compiling them into an empty cache, bytes
of history (of laws and of motion, committed and trial), and processor time of a Newton iteration (residual, stiffness,
factorisation, solution; the fastest of several, for which the scenes take turns) or of an explicit step, to which the
energy ledger adds what it does once a step.

Then the elastic plane scene is held against the same problem in twenty lines of plain DOLFINx, in this run; and on one
rank a drape of 6 x 6 cells is started in a process of its own, its forms in the cache, until its first step is done.

    python demos/studies/lean_scenes.py            # some minutes: every form is compiled anew
    python demos/studies/lean_scenes.py --quick    # with the forms in the cache, on fewer cells

The checked numbers: no scene has fewer unknowns, kernels, batches or bytes with a feature than without; the elastic
plane scene has no history and no kernel more than that in plain DOLFINx, and takes at most 1.1 of its time; and at most
4 s are gone when the first step is done.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import time
from pathlib import Path

import numpy as np
import studies
from lean_model import FEATURES, PLANE, QUICK, STEPS, Built, by_hand, pulled

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.output import results
from fabric_fenicsx.solvers import continuation

ALLOWED, START = 1.1, 4.0  # of the time by hand; s
TURNS = 4
STARTED = """
import sys, time
began = float(sys.argv.pop())
import drape
imported = time.time()
args = drape.arguments()
scene = drape.scene(args)
built = time.time()
for _ in scene.run.march(args.end, args.step * 1e-3):
    pass
print(imported - began, built - imported, time.time() - built)
"""


def build(scenes, cells, cold):
    """Scene -> what it is, built, and what it costs but for its iterations."""
    found, bar = {}, continuation.progress_bar(len(scenes), "scenes", MPI.COMM_WORLD)
    for scene in scenes:
        with studies.compiled(cold) as made:
            built = Built(scene, cells, MPI.COMM_WORLD)
        cost = {
            "unknowns": built.unknowns,
            "kernels": made.integrals + made.expressions,
            "batches": built.batches,
            "history_bytes": built.history,
            "compile_s": made.cpu_s,
            "ms": np.inf,
        }
        found[scene] = built, cost
        bar.update()
    bar.close()
    return found


def measure(scenes, cells, cold):
    """Scene -> what it costs. The scenes take turns, so that a clock that changes its pace is the same to all."""
    found = build(scenes, cells, cold)
    for _ in range(TURNS):
        for built, cost in found.values():
            cost["ms"] = min(cost["ms"], 1e3 * built.iteration(STEPS // TURNS))
    return {scene: cost for scene, (_, cost) in found.items()}


def against_hand(cells, rounds):
    """Processor time of a Newton iteration, ms, in the package and in plain DOLFINx, and kernels of both."""
    best, kernels = np.full(2, np.inf), []
    with studies.compiled(False) as made:
        u, end, problem = by_hand(cells, MPI.COMM_WORLD)
    kernels = [0, made.integrals + made.expressions]
    for _ in range(rounds):
        with studies.compiled(False) as made:
            built = Built(PLANE, cells, MPI.COMM_WORLD)
        kernels[0] = made.integrals + made.expressions
        best[0] = min(best[0], built.iteration(STEPS))
        u.x.array[:] = 0.0
        for k in range(1, STEPS + 1):
            end.value = pulled(k)
            clock = time.process_time()
            problem.solve()
            best[1] = min(best[1], (time.process_time() - clock) / problem.solver.getIterationNumber())
    # the same answer, else it would be no comparison
    moved = [np.sqrt(MPI.COMM_WORLD.allreduce(np.sum(q.x.array[: q.x.index_map.size_local * q.x.block_size] ** 2)))
             for q in (built.solver.u, u)]  # fmt: skip
    if not np.isclose(*moved, rtol=1e-6):
        raise RuntimeError(f"The scene by hand is another one: {moved[1]:.6g} in place of {moved[0]:.6g}.")
    # the slowest rank counts
    return 1e3 * np.array([MPI.COMM_WORLD.allreduce(float(t), MPI.MAX) for t in best]), kernels


def start(repeats=3):
    """Wall time of a small drape's imports, of building it, and of its first step, s; the fastest of several."""
    times = []
    for _ in range(repeats + 1):  # the first one may have something to compile
        words = ["--cells", 6, "--step", 5, "--end", 0.005, time.time()]
        done = studies.on_ranks(1, "-c", STARTED, *words, cwd=Path(__file__).parents[1])
        if done.returncode:
            raise StepFailed(f"The small drape has not run: {done.stderr.strip()[-300:]}")
        times.append([float(word) for word in done.stdout.split()[-3:]])
    return min(times[1:], key=sum)


def row(feature, without, with_it):
    """A row of the table."""
    result = {"feature": feature}
    for name in without:
        result |= {name: without[name], f"{name}_with": with_it[name]}
    return result


def plot(path, rows):
    """Newton iteration and compile time of every feature, with and without."""
    figure, panels = plots.panels(2, width=5.0, height=0.35 * len(rows) + 1.6, sharey=True)
    y = np.arange(len(rows))
    for axes, name, label in zip(panels, ("ms", "compile_s"), ("Newton iteration (ms)", "compiling (s)"), strict=True):
        axes.barh(y - 0.2, [r[name] for r in rows], 0.4, label="without", color="0.75")
        axes.barh(y + 0.2, [r[f"{name}_with"] for r in rows], 0.4, label="with", color="0.25")
        plots.label(axes, "", f"{label}, processor time", "", yticks=y, yticklabels=[r["feature"] for r in rows])
    axes.invert_yaxis()
    plots.legend(figure)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a few features on few cells, forms from the cache")
    parser.add_argument("--out", type=Path, default=Path("out/lean_scenes"))
    args = command.parse(parser)
    out, cells = results.folder(args.out), (18, 12) if args.quick else (48, 32)
    features = {name: pair for name, pair in FEATURES.items() if not args.quick or name in QUICK}
    scenes = dict.fromkeys([scene for pair in features.values() for scene in pair])
    rows, lean = [], True
    command.say(studies.machine())
    command.say(f"{cells[0]} x {cells[1]} cells; each pair is without -> with")
    command.say(f"{'feature':24s}{'unknowns':>17s}{'kernels':>10s}{'batches':>10s}{'history, kB':>18s}"
                f"{'compiling, s':>16s}{'iteration, ms':>18s}")  # fmt: skip
    costs = measure(scenes, cells, not args.quick)
    for feature, pair in features.items():
        without, with_it = (costs[scene] for scene in pair)
        rows.append(row(feature, without, with_it))
        lean &= all(without[name] <= with_it[name] for name in ("unknowns", "kernels", "batches", "history_bytes"))
        command.say(
            f"{feature:24s}{without['unknowns']:8d} ->{with_it['unknowns']:6d}{without['kernels']:5d} ->"
            f"{with_it['kernels']:2d}{without['batches']:5d} ->{with_it['batches']:2d}"
            f"{without['history_bytes'] / 1e3:9.1f} ->{with_it['history_bytes'] / 1e3:6.0f}"
            f"{without['compile_s']:8.2f} ->{with_it['compile_s']:5.2f}{without['ms']:9.2f} ->{with_it['ms']:6.2f}"
        )
    studies.write(out / "lean_scenes.csv", rows)
    if MPI.COMM_WORLD.rank == 0:
        plot(out / "lean_scenes.png", rows)
    (own, hand), kernels = against_hand((60, 40) if args.quick else (120, 80), 3)
    ratio, plain = own / hand, costs[PLANE]
    command.say(
        f"elastic plane scene: {own:.2f} ms an iteration, {kernels[0]} kernels, {plain['history_bytes']} bytes of "
        f"history; by hand {hand:.2f} ms, {kernels[1]} kernels; ratio {ratio:.2f}"
    )
    lean &= kernels[0] <= kernels[1] and plain["history_bytes"] == 0
    checks = {"nothing is paid for that is not used": lean, f"ratio at most {ALLOWED:g}": ratio <= ALLOWED}
    if MPI.COMM_WORLD.size == 1:
        began = start()
        command.say("start of a small drape: imports {:.2f} s, scene {:.2f} s, first step {:.2f} s".format(*began))
        checks[f"started within {START:g} s"] = sum(began) <= START
    said = "; ".join(f"{name}: {'yes' if met else 'NO'}" for name, met in checks.items())
    command.say(f"check: {said}; see {out}")
    return 0 if all(checks.values()) else 1


if __name__ == "__main__":
    command.run(main)
