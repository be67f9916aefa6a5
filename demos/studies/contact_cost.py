"""What contact costs: time, iterations and its share of them, in processor time on one core.

A sheet of 2 m falls onto a sphere of 0.3 m, with friction 0.3, and drapes over it, by implicit steps of 5 ms and by
explicit ones; the same sheet drapes from its corners, without contact, in as many steps. Two sheets lie on each other
and on a table, each node in touch. A share is of the time of all steps what the terms of contact take: pairs, gaps,
forces, stiffness, and how far a step may go; the solver's part of their entries is not in it.

    python demos/studies/contact_cost.py --cells 20 --stack 30

With --search it times instead how the pairs of two sheets that lie on each other are found, from nothing, for as many
cells along a side.

    python demos/studies/contact_cost.py --search 12 36 108 216

The checked numbers: nothing passes through anything, and at most 2 % of the work is not accounted for; of the search,
that its time grows as the pairs to the power of at most 1.15, as pairs times their logarithm does.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import drape
import numpy as np
import sphere
import stack
import studies

from fabric_fenicsx.app import command
from fabric_fenicsx.contact import collisions
from fabric_fenicsx.contact.triangles import squares
from fabric_fenicsx.output import results
from fabric_fenicsx.terms.term import Term

LAWS = {"elastic": ["--isotropic", "8e6,0.25"], "whole law": []}


class Clock:
    """Processor time in s that is spent in some terms."""

    def __init__(self, terms):
        self.spent, self._inside = 0.0, False
        for term in terms:
            for name in dir(Term):
                if not name.startswith("_") and callable(getattr(term, name)):
                    setattr(term, name, self._timed(getattr(term, name)))

    def _timed(self, method):
        def timed(*args, **options):
            if self._inside:
                return method(*args, **options)
            self._inside, start = True, time.process_time()
            try:
                return method(*args, **options)
            finally:
                self._inside, self.spent = False, self.spent + time.process_time() - start

        return timed


def played(name, played, args):
    """Run a scene to its end: a row."""
    run, touch = played.run, played.touch
    clock, spent, crossed, gap = Clock(touch.terms if touch else []), 0.0, False, float("inf")
    newton = cuts = 0
    march = run.march(args.end, 1e-3 * args.step, progress=name)
    next(march)  # what is compiled, is
    clock.spent, steps, start = 0.0, run.ts.getStepNumber(), time.process_time()
    for step in march:
        spent += time.process_time() - start
        newton, cuts = newton + step.newton_iterations, cuts + step.step_cuts
        if touch:
            inside, clock._inside = clock._inside, True
            gap, crossed = min(gap, touch.least_gap()), crossed or touch.crossed()
            clock._inside = inside
        start = time.process_time()
    steps = run.ts.getStepNumber() - steps
    implicit = hasattr(run, "solver")
    unknowns = played.sheet.q.function_space.dofmap.index_map.size_global
    return {
        "scene": name, "unknowns": unknowns, "steps": steps, "cuts": cuts,
        "newton_a_step": newton / steps if implicit else 0.0, "cpu_s": spent,
        "ms_each": 1e3 * spent / (newton if implicit else steps), "contact_percent": 100 * clock.spent / spent,
        "least_gap_mm": 1e3 * gap, "imbalance_percent": 100 * run.ledger.worst / run.ledger.most,
        "crossed": int(crossed),
    }  # fmt: skip


def of(demo, words):
    """Arguments of a demo, as of its command line."""
    before, sys.argv = sys.argv, [demo.__name__, *map(str, words)]
    try:
        return demo.arguments()
    finally:
        sys.argv = before


def rows(args):
    """All scenes that are asked for, one after the other."""
    with tempfile.TemporaryDirectory() as folder:
        for law in args.laws:
            for method in args.methods:
                words = ["--cells", args.cells, "--method", method, "--end", args.end, *LAWS[law], "--out", folder]
                for demo in (sphere, drape):
                    more = ["--patch", 0.2] if demo is drape else []
                    asked = of(demo, words + more)
                    yield played(f"{demo.__name__}, {law}, {method}", demo.scene(asked), asked)
        if args.stack:
            words = ["--sheets", 2, "--cells", args.stack, "--end", args.lying, "--out", folder]
            asked = of(stack, words)
            yield played(f"two sheets, {args.stack} cells", stack.scene(asked, Path(folder)), asked)


def found(cells, cell=10e-3, reach=2e-3):
    """A row: how long it takes to find all pairs of two sheets half a reach apart, one turned by 7 degrees."""
    n, c, s = cells + 1, np.cos(0.12), np.sin(0.12)
    x, y = (grid.ravel() for grid in np.meshgrid(*2 * [cell * np.arange(n)]))
    lower, upper = np.stack([x, y, 0 * x], axis=1), np.stack([c * x - s * y, s * x + c * y, 0 * x + reach / 2], axis=1)
    rest = np.concatenate([lower, upper])
    sheet = squares(n, n)
    pairs = collisions.Collisions(rest, np.concatenate([sheet, sheet + n * n]), [], True, 0.0, reach, 1.0)
    clock = time.process_time()
    pairs.place(rest)
    clock = time.process_time() - clock
    count = sum(len(found) for facing in pairs.facings for found in facing.sets)
    return {"cells": cells, "triangles": 4 * cells**2, "pairs": count, "cpu_s": clock}


def searched(args, out):
    """The table of the search; 0 if it grows as it should."""
    found(2)  # what is compiled, is
    rows = [found(cells) for cells in args.search]
    studies.show(rows)
    studies.write(out / "search.csv", rows)
    power = np.polyfit(*(np.log([row[name] for row in rows]) for name in ("pairs", "cpu_s")), 1)[0]
    good = power <= 1.15
    command.say(f"check: time grows as pairs^{power:.2f}, at most 1.15: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--cells", type=command.positive, default=20, help="along a side, even")
    parser.add_argument("--end", type=command.above_zero, default=0.35, help="s")
    parser.add_argument("--laws", choices=LAWS, nargs="+", default=list(LAWS))
    parser.add_argument("--methods", choices=["implicit", "explicit"], nargs="+", default=["implicit", "explicit"])
    parser.add_argument("--stack", type=int, default=30, help="cells along a side of sheets on each other; 0: none")
    parser.add_argument("--lying", type=command.above_zero, default=0.08, help="end of those, s")
    parser.add_argument("--search", type=command.positive, nargs="+", help="cells along a side; times the search alone")
    parser.add_argument("--out", type=Path, default=Path("out/contact_cost"))
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    command.say(studies.machine())
    if args.search:
        return searched(args, out)
    table = list(rows(args))
    studies.show(table)
    studies.write(out / "contact_cost.csv", table)
    for law in args.laws:
        both = [row["newton_a_step"] for row in table if law in row["scene"] and "implicit" in row["scene"]]
        if len(both) == 2:
            command.say(f"{law}: {both[0] / both[1]:.2f} times the Newton iterations a step of the drape")
    good = not any(row["crossed"] or row["least_gap_mm"] <= 0.0 or row["imbalance_percent"] > 2.0 for row in table)
    command.say(f"check: nothing passes, imbalance at most 2 %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
