"""Standard problems of large rotations and of thin curved shells, each against its reference.

Every case ends in a number: the largest error over its load steps, as a part of what it may be. The cases are in
`shell_cases.py`. "all" runs them one after the other, unless told otherwise with both default elements, and sums
up. "locking" compares elements and thicknesses, "cost" times the parts of a Newton iteration (both are in
`shell_studies.py`).
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import dataclasses
import time
from pathlib import Path

import numpy as np
import shell_cases
import shell_model
import shell_studies

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.output import results
from fabric_fenicsx.shell import directors


def plot(path, case, table):
    """Load against displacements: computed lines, reference as rings."""
    figure, (axes,) = plots.panels(1, width=6.0, height=4.6)
    loads = table.column(case.load_name)
    curves = {name: column for name, column in case.reference.items() if np.isfinite(column).sum() > 1}
    for i, (name, column) in enumerate(curves.items()):
        look = plots.series(i)
        axes.plot(table.column(name), loads, label=f"{name}, computed", **look | {"marker": None})
        axes.plot(column, case.loads, label=f"{name}, reference", **look | {"linestyle": "", "mfc": "none"})
    if case.loads[-1] > 1e3 * case.loads[0]:
        axes.set_yscale("log")
    plots.label(axes, case.title, "displacement (consistent units)", f"{case.load_name.replace('_', ' ')} (-)")
    plots.legend(figure, len(curves))
    figure.savefig(path, dpi=150)


def report(case, table, stopped, wall):
    """A row for the summary, at the worst step, and whether every one is within the tolerance of the case."""
    parts = {name: part for name, part in case.errors(table).items() if np.isfinite(part).any()}
    share, worst, step = max(((np.nanmax(part), name, np.nanargmax(part)) for name, part in parts.items()),
                             default=(np.nan, None, None))  # fmt: skip
    right = stopped is None and bool(share <= 1.0)
    row = {
        "case": case.name,
        "element": case.shell.space.element,
        "cells": case.shell.mesh.topology.index_map(2).size_global,
        "unknowns": case.shell.space.W.dofmap.index_map.size_global,
        "worst": worst or "-",
        "at_load": f"{case.loads[step]:.6g}" if worst else "-",
        "computed": f"{table.rows[step][worst]:.6g}" if worst else "-",
        "reference": f"{case.reference[worst][step]:.6g}" if worst else "-",
        "error_of_allowed": f"{share:.0%}",
        "steps": len(table.rows),
        "newton": int(sum(row["newton_iterations"] for row in table.rows)),
        "cuts": int(sum(row["step_cuts"] for row in table.rows)),
        "wall_s": f"{wall:.1f}",
        "verdict": "within" if right else "MISSED",
    }
    return row, right


def one(name, settings, out):
    """Run a case into its folder; the row of the summary and its verdict."""
    clock = time.perf_counter()
    case = shell_cases.CASES[name](settings)
    folder = results.folder(out / case.name)
    table, stopped = case.run(folder, progress=case.name)
    row, right = report(case, table, stopped, time.perf_counter() - clock)
    if stopped:
        command.say(stopped)
    if table.rows:
        if MPI.COMM_WORLD.rank == 0 and len(case.loads) > 1:
            plot(folder / "curves.png", case, table)
        title = case.title + (f", displacement drawn x {case.drawn:g}" if case.drawn != 1 else "")
        case.shell.picture(folder / "deformed.png", title, case.full, case.drawn)
    return row, right


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--case", choices=[*shell_cases.CASES, "locking", "cost", "all"], default="end_shear")
    parser.add_argument(
        "--element", choices=directors.ELEMENTS, help="default: that of triangles; in all: both default ones"
    )
    parser.add_argument("--cells", type=command.positive, help="along the strip, or a side of the sheet")
    parser.add_argument("--thickness", type=command.number, help="in the units of the case")
    parser.add_argument(
        "--skew", type=command.number, default=0.0, help="strips: inner nodes move by this part of a cell"
    )
    parser.add_argument("--steps", type=command.positive, help="load steps; default: those of the reference")
    parser.add_argument("--turns", type=int, choices=[1, 3], help="of roll_up; default: 1, in all: both")
    parser.add_argument("--out", type=Path, default=Path("out/shell_benchmarks"))
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    settings = shell_model.Settings(args.element, args.cells, args.thickness, args.skew, args.steps, args.turns or 1)
    if args.case in ("locking", "cost"):
        return getattr(shell_studies, args.case)(settings, out)
    runs = [(args.case, settings, out)]
    if args.case == "all":
        runs = []
        for element in [args.element] if args.element else shell_studies.DEFAULTS:
            own, folder = dataclasses.replace(settings, element=element), out / element
            runs += [(name, own, folder) for name in shell_cases.CASES]
            if args.turns is None:
                runs.append(("roll_up", dataclasses.replace(own, turns=3), folder))
    rows, right = [], True
    for name, chosen, folder in runs:
        row, good = one(name, chosen, folder)
        rows.append(row)
        right = right and good
        shell_studies.show(rows[-1:], head=len(rows) == 1)
    shell_studies.write(out / "summary.csv", rows)
    command.say(f"check: every step within the tolerance of its case: {'yes' if right else 'NO'}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
