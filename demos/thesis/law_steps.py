"""What the printed law's update costs: where it stops, and how its answer depends on the size of the step.

The 24 tensile tests of tensile.py (four fabrics, warp at 0, 90 and 45 degrees, clamped and free ends) are
run with both laws. The first table tells how far a law gets, and where the sheet is no longer elliptic: where
the determinant of the acoustic tensor is not positive in some direction, strain can localise in a band. The
second one gives the printed law's error in peak stress for ever smaller steps, against the continuous law on
the same mesh. Checked: the continuous law completes every cycle and, where a yarn is pulled with free ends,
is on the fitted curve with few steps; there the printed law's error falls with the first power of the step.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import csv
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import numpy as np
import tensile
from tensile import Case, run, strip

from fabric_fenicsx import fabrics, plots
from fabric_fenicsx.app import command
from fabric_fenicsx.laws import named
from fabric_fenicsx.laws.stability import acoustic
from fabric_fenicsx.output import results

STEPS = [10, 20, 40, 80, 160]


class Watch:
    """Keeps the material's answer at every solved step, for its stability."""

    def __init__(self):
        self.rows = []

    def __call__(self, step, fabric):
        strain = fabric.strain.reshape(-1, 3).copy()
        # after a commit, `trial` still holds the state that the last increment began with
        stress, tangent, _ = fabric.law.respond(strain, fabric.history.trial)
        self.rows.append((step.load, strain, stress, tangent))

    def stability(self, comm):
        """Displacements (m); at each the smallest acoustic eigenvalue (Pa) and determinant (Pa^2) in the sheet."""
        loads, *points = zip(*self.rows, strict=True)
        smallest = acoustic(*map(np.concatenate, points))
        both = np.reshape([smallest.eigenvalue, smallest.determinant], (2, len(loads), len(points[0][0])))
        both = both.min(axis=2, initial=np.inf)
        return loads, *np.min(comm.allgather(both), axis=0)


def fresh(scene):
    """A scene as it was before its first step."""
    u, solver, fabric, *_ = scene
    u.x.array[:] = 0.0
    fabric.begin(fabric.law)
    solver.commit()
    return scene


def place(loads, step, peak):
    """Displacement of a step (from 0) as text, and whether it is on the way up or down."""
    return f"{loads[step] * 1e3:.2f} {'up' if step < peak else 'down'}"


def cycle(case, scene, comm):
    """Run a cycle; what came of it."""
    watch, clock = Watch(), time.perf_counter()
    table, peak, stopped = run(case, comm=comm, watch=watch, scene=fresh(scene))
    clock = time.perf_counter() - clock
    iterations = table.column("newton_iterations")
    loads, eigenvalue, determinant = watch.stability(comm)
    lost = np.flatnonzero(determinant <= 0.0)
    return {
        "fabric": case.fabric.name,
        "angle_deg": case.angle,
        "ends": case.ends,
        "law": case.law,
        "peak_stress_MPa": table.column("axial_stress_MPa")[:peak].max(),
        "newton_iterations_up": iterations[:peak].mean(),
        "newton_iterations_down": iterations[peak:].mean() if len(iterations) > peak else np.nan,
        "step_cuts": table.column("step_cuts").sum(),
        "wall_s": clock,
        "acoustic_eigenvalue_last_MPa": eigenvalue[-1] / 1e6,
        "acoustic_eigenvalue_least_MPa": eigenvalue.min() / 1e6,
        "acoustic_determinant_last_MPa2": determinant[-1] / 1e12,
        "not_elliptic_from_mm": place(loads, lost[0], peak) if lost.size else "",
        "stopped_at_mm": place(loads, len(loads) - 1, peak) if stopped else "",
    }


def study(case, scene, counts, comm):
    """Peak stress (MPa) with so many steps up, and how it is shown if the law stops on the way."""
    peaks, shown = [], []
    for n in counts:
        table, _, stopped = run(
            replace(case, steps=n), comm=comm, watch=lambda step, _, n=n: step.number == n, scene=fresh(scene)
        )
        peaks.append(np.nan if stopped else table.rows[-1]["axial_stress_MPa"])
        shown.append(f"at {table.rows[-1]['displacement_mm'] if table.rows else 0.0:.2f} mm")
    return np.array(peaks), shown


def write(path, rows):
    """Rows, all with the same names, as CSV."""
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows({k: f"{v:.8g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)


def plot(path, names, steps, errors):
    """Error of the printed law against the number of steps, a panel a fabric; errors: (case, % for each step)."""
    across = min(len(names), 2)
    figure, panels = plots.panels(across, -(-len(names) // across), width=4.8, height=3.8, sharex=True, sharey=True)
    for case, error in errors:
        look = plots.style(case.fabric.name, tensile.WAYS[case.angle]) | {"ms": 4}
        look |= {"marker": "o"} if case.ends == "clamped" else {"marker": "s", "mfc": "white"}
        if np.isfinite(error).any():
            label = f"warp at {case.angle:g}°, {case.ends} ends"
            panels[names.index(case.fabric.name)].loglog(steps, np.abs(error), label=label, **look)
    for name, axes in zip(names, panels, strict=False):
        axes.loglog(steps, 50.0 / np.array(steps), label="first order", **plots.FITTED)
        plots.label(axes, name, "steps up to full load (-)", "error of the peak stress (%)")
        axes.set_xticks(steps, map(str, steps))
        axes.set_yticks([0.1, 1, 10], ["0.1", "1", "10"])
        axes.minorticks_off()
        axes.label_outer()
    figure.suptitle("Error of the printed law against the continuous law", size=11)
    plots.legend(figure, across + 1)
    figure.savefig(path, dpi=150)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--fabric", nargs="+", default=list(fabrics.names()), help="names or TOML files")
    parser.add_argument("--poisson", choices=["measured", "lowered"], default="measured")
    parser.add_argument("--cells", type=command.grid, default="9x3", help="cells along and across the strip")
    parser.add_argument("--steps", type=command.positive, default=20, help="steps up in the first table")
    parser.add_argument("--quick", action="store_true", help="muslin with free ends only, 10 and 20 steps")
    parser.add_argument("--out", type=Path, default=Path("out/law_steps"))
    return command.parse(parser)


def main():
    args, comm = arguments(), MPI.COMM_WORLD
    out, clock = results.folder(args.out), time.perf_counter()
    names, held, steps = args.fabric, ("clamped", "free"), STEPS
    if args.quick:
        names, held, steps = ["muslin"], ("free",), STEPS[:2]
    cases = [
        Case(fabric, angle, poisson=args.poisson, cells=args.cells, degree=1, steps=args.steps, ends=ends)
        for fabric in map(fabrics.load, names)
        for angle in (0.0, 90.0, 45.0)
        for ends in held
    ]
    # said by tensile.py; here it would tear the tables apart
    warnings.filterwarnings("ignore", message=".*beyond the measured")

    command.say("Cycles; smallest eigenvalue of the acoustic tensor in the sheet at the last step and at any")
    command.say(f"{'fabric':12s}{'angle':>5s} {'ends':8s}{'law':11s}{'S MPa':>8s}{'Newton up':>10s}{'down':>6s}"
                f"{'cuts':>5s}{'s':>6s}{'last MPa':>10s}{'least':>9s}  {'not elliptic':13s}  end, mm")  # fmt: skip
    cycles, studies, right = [], [], True
    for case in cases:
        peaks = {}
        for law in named.THESIS:
            case = replace(case, law=law)
            scene = strip(case, comm)
            row = cycle(case, scene, comm)
            counts = steps if law == "printed" else [steps[0], steps[-1]]
            peaks[law] = study(case, scene, counts, comm)
            cycles.append(row)
            stopped = f"stopped at {row['stopped_at_mm']}" if row["stopped_at_mm"] else "complete"
            right = right and not (stopped != "complete" and law == "continuous")
            command.say(
                f"{row['fabric']:12s}{case.angle:5g} {case.ends:8s}{law:11s}{row['peak_stress_MPa']:8.3f}"
                f"{row['newton_iterations_up']:10.1f}{row['newton_iterations_down']:6.1f}{row['step_cuts']:5d}"
                f"{row['wall_s']:6.2f}{row['acoustic_eigenvalue_last_MPa']:10.3f}"
                f"{row['acoustic_eigenvalue_least_MPa']:9.3f}  {row['not_elliptic_from_mm']:13s}  {stopped}"
            )
        studies.append((case, peaks))

    command.say("\nError of the peak stress, %, against the continuous law with the smallest steps, or where it stops")
    heads = ["S MPa", "off fit, %", f"cont. {steps[0]}", *(f"printed {n}" for n in steps), "order"]
    command.say(f"{'fabric':12s}{'angle':>5s} {'ends':8s}" + "".join(f"{head:>12s}" for head in heads))
    rows, lines = [], []
    for case, peaks in studies:
        (first, finest), (printed, stops) = peaks["continuous"][0], peaks["printed"]
        d = case.displacement / case.fabric.gauge_length
        fitted = case.fitted(d + d * d / 2)
        fitted = np.nan if fitted is None else fitted / 1e6
        error = 100 * (printed / finest - 1)
        order = np.log2(abs(error[-2] / error[-1]))
        lines.append((case, error))
        for law, n, peak in [("continuous", steps[0], first), ("continuous", steps[-1], finest)] + [
            ("printed", n, peak) for n, peak in zip(steps, printed, strict=True)
        ]:
            row = {"fabric": case.fabric.name, "angle_deg": case.angle, "ends": case.ends, "law": law, "steps": n}
            row |= {"peak_stress_MPa": peak, "error_percent": 100 * (peak / finest - 1)}
            rows.append(row | {"error_to_fitted_percent": 100 * (peak / fitted - 1)})
        shown = [f"{finest:.3f}", f"{100 * (finest / fitted - 1):.4f}", f"{100 * (first / finest - 1):.4f}"]
        shown += [f"{e:.3f}" if np.isfinite(e) else stop for e, stop in zip(error, stops, strict=True)]
        command.say(
            f"{case.fabric.name:12s}{case.angle:5g} {case.ends:8s}"
            + "".join(f"{text.replace('nan', '-'):>12s}" for text in [*shown, f"{order:.2f}"])
        )
        if case.ends == "free" and np.isfinite(fitted):
            right = right and abs(first / fitted - 1) <= 0.005 and abs(order - 1) <= 0.1
    if comm.rank == 0:
        write(out / "cycles.csv", cycles)
        write(out / "errors.csv", rows)
        plot(out / "error.png", list(dict.fromkeys(case.fabric.name for case in cases)), steps, lines)
    command.say(
        f"check: continuous law completes all, on the fitted curve with {steps[0]} steps in free yarn tests, printed "
        f"law of first order there: {'yes' if right else 'NO'}; {time.perf_counter() - clock:.0f} s; see {out}"
    )
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
