"""What one more digit costs: error against run time of every method on offer.

A material point and a tensile strip, by the law of Chapter 6 and by the one with a potential, end shear of a shell at
h/L = 1e-2 and 1e-4, a strip lifted off a plane that it touches, the drape held over patches, with layers and with
bending of its own, and the poke, each with one setting after another changed: law, element, cells, steps, what cuts
them, tolerance of Newton's method, layers, implicit or explicit, ranks. The error is the largest deviation of what is
asked for from a reference with finer cells and steps, as a part of its largest value; the reference's own error is at
most about its difference from one a step coarser: errors below that tell little. Times are processor time and wall time
of the way through the loads, medians of three where they are short; set-up, with what it compiles, is apart.

    python demos/studies/error_vs_runtime.py                    # all of it, some 25 minutes
    python demos/studies/error_vs_runtime.py --quick            # few settings, each once, coarse references
    python demos/studies/error_vs_runtime.py --case strip

The checked number: every setting comes to an end but those of `STOPS`, and the cheapest one of every case within 10 %
is found.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import json
import time
import warnings
from pathlib import Path

import error_cases
import numpy as np
import studies

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.output import results

LEVELS = (0.1, 0.01, 0.001)
STOPS = "printed", "stiffness 0.22"
"""What may: the law as printed, and contact ten times softer than the weight that rests on it."""
LONG = 0.5  # s, of which one run tells enough


def once(name, setting, comm=MPI.COMM_SELF):
    """Numbers, processor time of set-up and of the way in s, of all ranks, and wall time of the way."""
    if "way" in setting:
        plain = {key: value for key, value in setting.items() if key != "way"}
        runs = [once(name, plain | {"cells": setting["cells"] // part}, comm) for part in (4, 2, 1)]
        return extrapolated(*(run[0] for run in runs)).tolist(), *np.sum([run[1:] for run in runs], axis=0)
    clock = studies.processor()
    scene = error_cases.build(name, setting, comm)
    setup = studies.processor() - clock
    comm.Barrier()
    clock, wall = time.process_time(), time.perf_counter()
    values = error_cases.go(name, setting, scene)
    times = time.perf_counter() - wall, comm.allreduce(time.process_time() - clock), comm.allreduce(setup)
    return values.tolist(), *times[::-1]


def extrapolated(coarse, middle, fine):
    """Where numbers go whose changes shrink by the same factor each time (Aitken)."""
    coarse, middle, fine = (np.asarray(values) for values in (coarse, middle, fine))
    before, last = middle - coarse, fine - middle
    return fine + last**2 / (before - last)


def on_ranks(name, setting):
    """As `once`, on as many ranks as the setting says."""
    if setting.get("ranks", 1) == 1:
        return once(name, setting)
    done = studies.on_ranks(setting["ranks"], __file__, "--one", name, json.dumps(setting))
    said = [line for line in done.stdout.splitlines() if line.startswith("[")]
    if done.returncode or not said:
        raise StepFailed(f"{name} on {setting['ranks']} ranks has not run: {done.stderr.strip()[-300:]}")
    return json.loads(said[-1])


def measured(name, setting, repeats):
    """Numbers, and medians of the times of several runs; numbers are None if a step failed."""
    try:
        runs = [on_ranks(name, setting)]
        runs += [on_ranks(name, setting) for _ in range(repeats - 1 if runs[0][2] < LONG else 0)]
    except StepFailed as error:
        command.say(f"  {error_cases.label(setting)}: {str(error)[:90]} ...")
        return None, np.nan, np.nan, np.nan
    return np.array(runs[0][0]), *np.median([run[1:] for run in runs], axis=0)


def apart(values, reference):
    """Largest deviation as a part of the largest value."""
    return np.inf if values is None else float(np.abs(values - reference).max() / np.abs(reference).max())


def study(name, quick):
    """Rows of a case, its reference's error, and the case."""
    case = error_cases.CASES[name][0](quick)
    finest = np.array(once(name, case.reference)[0])
    coarser = np.array(once(name, case.coarser)[0])
    own = apart(coarser, finest)
    command.say(f"\n{case.title}: {case.asked}")
    command.say(
        f"reference {error_cases.label(case.reference)}; {100 * own:.2g} % from {error_cases.label(case.coarser)}"
    )
    rows = []
    for setting in case.settings:
        values, setup, cpu, wall = measured(name, setting, 1 if quick else 3)
        rows.append({"case": name, "setting": error_cases.label(setting), "error": apart(values, finest), "cpu_s": cpu,
                     "wall_s": wall, "setup_cpu_s": setup, "base": setting == case.base,
                     "group": group(setting)})  # fmt: skip
    cost = np.array([row["cpu_s"] for row in rows])
    error = np.array([row["error"] for row in rows])
    for row, here in zip(rows, front(cost, error), strict=True):
        row["pareto"] = bool(here)
        command.say(f"  {row['setting']:66s}{100 * row['error']:9.3g} %{row['cpu_s']:8.3f} s{row['wall_s']:8.3f} s wall"
                    f"{row['setup_cpu_s']:7.2f} s set-up{'  *' if here else ''}")  # fmt: skip
    return rows, own, case


def group(setting):
    """The method of a setting, without its numbers."""
    words = [str(setting[name]) for name in ("law", "element", "method", "solver", "way") if name in setting]
    words = [word for word in words if word != "direct"]
    words += [f"degree {setting['degree']}"] if "degree" in setting else []
    words += [f"{setting['ranks']} ranks"] if setting.get("ranks", 1) > 1 else []
    return ", ".join(words)


def front(cost, error):
    """Which are on the Pareto front: nothing is as cheap and better."""
    return np.array([
        bool(np.isfinite(e)) and not ((cost <= c) & (error <= e) & ((cost < c) | (error < e))).any()
        for c, e in zip(cost, error, strict=True)
    ])  # fmt: skip


def cheapest(rows, own):
    """Level -> the cheapest row within it, None if there is none, or if the reference cannot tell."""
    found = {}
    for level in LEVELS:
        good = [row for row in rows if row["error"] <= level]
        found[level] = min(good, key=lambda row: row["cpu_s"]) if good and own <= level else None
    return found


def plot(path, studied):
    """Error against seconds, a panel a case."""
    columns = min(3, len(studied))
    figure, panels = plots.panels(columns, -(-len(studied) // columns), width=5.2, height=4.4)
    for axes in panels[len(studied) :]:
        axes.set_axis_off()
    for axes, (rows, own, case) in zip(panels, studied, strict=False):
        rows = [row for row in rows if np.isfinite(row["error"])]
        for i, kind in enumerate(dict.fromkeys(row["group"] for row in rows)):
            part = [row for row in rows if row["group"] == kind]
            look = plots.series(i) | {"linestyle": ""}
            axes.loglog([r["cpu_s"] for r in part], [100 * r["error"] for r in part], label=kind, alpha=0.8, **look)
        base = [row for row in rows if row["base"]]
        axes.loglog([r["cpu_s"] for r in base], [100 * r["error"] for r in base], "k*", ms=11, mfc="none", label="base")
        best = sorted((r["cpu_s"], 100 * r["error"]) for r in rows if r["pareto"])
        axes.loglog(*zip(*best, strict=True), "k-", lw=1, drawstyle="steps-post", zorder=0, label="Pareto front")
        axes.axhspan(1e-9, 100 * own, color="0.9", zorder=-1)
        smallest = min([100 * own, *(100 * r["error"] for r in rows if r["error"] > 0)])
        plots.label(axes, case.title, "processor time (s)", "error (%)", ylim=(0.5 * smallest, None))
        plots.plain(axes.xaxis)
        axes.legend(fontsize=7)  # the groups are those of the case
    figure.suptitle("Error against run time; grey: below the error of the reference", size=11)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few settings, coarse references")
    parser.add_argument("--case", choices=error_cases.CASES, nargs="+", default=list(error_cases.CASES))
    parser.add_argument("--out", type=Path, default=Path("out/error_vs_runtime"))
    parser.add_argument("--one", nargs=2, metavar=("CASE", "JSON"), help="one run; its numbers and times")
    args = command.parse(parser)
    warnings.filterwarnings("ignore", message=".*is beyond the measured")
    if args.one:
        name, setting = args.one[0], json.loads(args.one[1])
        once(name, setting, MPI.COMM_WORLD)  # what is loaded once is not of the way
        command.say(json.dumps(once(name, setting, MPI.COMM_WORLD)))
        return 0
    if MPI.COMM_WORLD.size > 1:
        raise InputError("error_vs_runtime.py starts mpirun itself: call it on one rank.")
    out, studied = results.folder(args.out), []
    command.say(studies.machine())
    for name in args.case:
        studied.append(study(name, args.quick))
        studies.write(out / "error_vs_runtime.csv", [row for rows, *_ in studied for row in rows])
        plot(out / "error_vs_runtime.png", studied)
    command.say(f"\n{'case':18s}{'within':>8s}  cheapest setting")
    right = True
    for rows, own, case in studied:
        right &= all(np.isfinite(row["error"]) or any(name in row["setting"] for name in STOPS) for row in rows)
        for level, row in cheapest(rows, own).items():
            said = "none" if row is None else f"{row['setting']}: {100 * row['error']:.2g} %, {row['cpu_s']:.3g} s"
            command.say(f"{case.name:18s}{100 * level:6g} %  {said}")
            right &= row is not None or level < LEVELS[0]
    command.say(f"check: all settings end, and one within 10 % in every case: {'yes' if right else 'NO'}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
