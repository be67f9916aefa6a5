"""What a Newton iteration of a sheet in motion costs, part by part: the drape over patches with the whole law.

Processor time in us per unknown and Newton iteration, of all that is done in the steps: what is done once a step or
once a search counts too. `rest` is what no part names: vectors, line searches, the loop itself.

    python demos/studies/iteration.py --cells 20 40 80
    python demos/studies/iteration.py --cells 20 -- --bending layers    # more words for the drape

The checked number: the parts are not more than the whole. The bars of 3 us on 20 x 20 cells and 4 on 80 x 80 are for
the reader to judge, on a machine that does nothing else.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import drape
import moving
import numpy as np
import studies

from fabric_fenicsx.app import command
from fabric_fenicsx.output import results
from fabric_fenicsx.terms.work import InternalWork

BARS = {20: 3.0, 80: 4.0}  # us


def parts(run):
    """Part -> methods whose time it is, less that of those called by them. PETSc calls the others from `_balance`."""
    solver, ledger = run.solver, type(run.ledger)
    work = next(term for term in run.terms if isinstance(term, InternalWork))
    matrix, solves, law = type(solver.tangent), type(solver), type(work.points[0])
    sheet, own = type(solver._shell), type(solver._unknowns)
    return {
        "law": [(law, "_respond")],
        "strains, forces": [(InternalWork, "evaluate"), (own, "add_up")],
        "element stiffness": [(InternalWork, "add_stiffness"), (InternalWork, "add_turned")],
        "sum of the matrix": [(matrix, "assemble"), (matrix, "eliminate"), (matrix, "sound")],
        "directors": [(sheet, "turn"), (sheet, "add_curvature"), (sheet, "commit")],
        "factors": [(solves, "_balance")],
        "residual, search": [(solves, "_residual")],
        "ledger": [(ledger, "weigh"), (ledger, "accept")],
    }


class Clock:
    """Processor time of methods of classes while this is entered, in s, each less that of those it calls."""

    def __init__(self, parts):
        self._parts, self._stack, self.seconds = parts, [], dict.fromkeys(parts, 0.0)

    def __enter__(self):
        self._before = []
        for part, methods in self._parts.items():
            for owner, name in methods:
                method = getattr(owner, name)
                self._before.append((owner, name, method))
                setattr(owner, name, self._timed(part, method))
        return self

    def __exit__(self, *_):
        for owner, name, method in self._before:
            setattr(owner, name, method)

    def _timed(self, part, method):
        def timed(*arguments, **options):
            began, inside = time.process_time(), len(self._stack)
            self._stack.append(0.0)
            try:
                return method(*arguments, **options)
            finally:
                took = time.process_time() - began
                self.seconds[part] += took - self._stack.pop()
                if inside:
                    self._stack[-1] += took

        return timed


def measured(cells, args):
    """A row: us per unknown and iteration of each part."""
    parser = argparse.ArgumentParser()
    moving.add_arguments(parser, end=args.end, rho=0.8)
    own = parser.parse_args(["--bending", "own", "--cells", str(cells), "--end", str(args.end), *args.also])
    own.patch = 0.2
    run = studies.scene_of(drape, own, MPI.COMM_SELF).run
    first, step = 2 * own.step * 1e-3, own.step * 1e-3
    for _ in run.march(first, step):  # what is compiled, or made once
        pass
    with Clock(parts(run)) as clock:
        began, iterations, made = time.process_time(), 0, run.matrices
        for done in run.march(own.end, step):
            iterations += done.newton_iterations
        whole = time.process_time() - began
    unknowns = run.q.function_space.dofmap.index_map.size_global
    each = 1e6 / (iterations * unknowns)
    row = {"cells": cells, "unknowns": unknowns, "iterations": iterations, "matrices": run.matrices - made}
    row |= {part: seconds * each for part, seconds in clock.seconds.items()}
    return row | {"rest": (whole - sum(clock.seconds.values())) * each, "us_each": whole * each}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=command.positive, nargs="+", default=[20, 40, 80], help="along a side")
    parser.add_argument("--end", type=command.number, default=0.05, help="s")
    parser.add_argument("--out", type=Path, default=Path("out/iteration"))
    parser.add_argument("also", nargs="*", help="after --: more words for the drape")
    args = command.parse(parser)
    command.say(studies.machine())
    rows = [measured(cells, args) for cells in args.cells]
    names = [name for name in rows[0] if name not in ("cells", "unknowns", "iterations", "matrices")]
    command.say("processor time, us per unknown and Newton iteration")
    command.say(f"{'cells':20s}" + "".join(f"{row['cells']:9d}" for row in rows))
    command.say(f"{'iterations':20s}" + "".join(f"{row['iterations']:9d}" for row in rows))
    command.say(f"{'matrices':20s}" + "".join(f"{row['matrices']:9d}" for row in rows))
    for name in names:
        command.say(f"{name:20s}" + "".join(f"{row[name]:9.2f}" for row in rows))
    studies.write(results.folder(args.out) / "iteration.csv", rows)
    good = all(np.isfinite(row["us_each"]) and row["rest"] >= -0.01 * row["us_each"] for row in rows)
    for row in rows:
        if bar := BARS.get(row["cells"]):
            command.say(f"{row['us_each']:.2f} us on {row['cells']} x {row['cells']} cells; the bar is {bar:g}")
    command.say(f"check: the parts are not more than the whole: {'yes' if good else 'NO'}; see {args.out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
