"""Chapter 7 of the thesis as one page: every figure and table of it beside what this code gives, and why they differ.

Runs every case (tensile cycles, shear, biaxial strain, drape, poke, and what the thesis left open) in a process of its
own, two at a time, and writes thesis.html, which needs no other file, to read in a browser or to print. A case that
has run before, with the same settings and the same code, is not run again. One that fails is told on the page.

The checked numbers: all cases have an answer, and all figures of the chapter a counterpart (but in --quick).
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

from chapter7 import cases, left_open, page, parameters, sections, shearing, sheets, strips, three_laws

from fabric_fenicsx import __version__
from fabric_fenicsx.app import command
from fabric_fenicsx.output import results

ROOMS = (parameters, strips, shearing, sheets, left_open, three_laws)
FIGURES = [f"7-{number}" for number in range(1, 38)]
TITLE = "Chapter 7, run again"


def index(body):
    """Where on the page the counterpart of each figure is; and the figures that have none there."""
    missing = [number for number in FIGURES if f'id="fig-{number}"' not in body]
    links = " ".join(f'<a href="#fig-{number}">{number}</a>' for number in FIGURES if number not in missing)
    told = f"Without a counterpart in this run: {', '.join(missing)}."
    nav = f"<nav>Counterparts of the thesis's figures: {links}</nav>"
    return nav + (page.settings(told) if missing else ""), missing


def list_of(done):
    """What was run, how long it took, and what came of it."""
    rows = [
        (
            name, result.case.function, f"{result.seconds:.1f} s" + " (kept)" * result.reused,
            f"failed: {result.failure}" if result.failure else "done",
        )
        for name, result in done.items()
    ]  # fmt: skip
    total = sum(result.seconds for result in done.values())
    return page.table(
        f"{len(rows)} cases, {total:.0f} s of one core; kept: run before, with these settings and this code",
        ("case", "function", "time", "end"),
        rows,
    )


def write(done, path, quick):
    """The page; the figures of the thesis that have no counterpart on it."""
    body = sections.written(sections.Answers(done), ROOMS)
    contents, missing = index(body)
    failed = [f"“{name}” failed: {result.failure}" for name, result in done.items() if result.failure]
    parts = [
        f"<h1>{TITLE}</h1>",
        page.p(
            "R. W. Williams, Measuring and modeling the anisotropic, nonlinear and hysteretic behavior of woven "
            f"fabrics, PhD thesis, The University of Iowa, 2010, beside fabric_fenicsx {__version__}. What the thesis "
            "measured exists there as pictures only: curves are held against its fitted curves (Tables 7.1 and 7.3), "
            "and its percentages, which compare its own model with its experiment, are quoted as its own. Every other "
            "number comes from the run."
        ),
        page.p(
            "“Continuous” is the thesis's law as a continuous function of strain; “printed” is its update, Box 6-1, "
            "with its misprints mended; “potential” is the default of this code, and has the last section. Stress is "
            "second Piola-Kirchhoff over the measured thickness, strain is Green-Lagrange. A fabric has one colour "
            "throughout; where panels differ in it, the legend is grey."
        ),
        page.p("This is the quick variant: few cases, coarse.", kind="settings") if quick else "",
        "".join(page.p(f"The case {line}", kind="failed") for line in failed),
        contents,
        body,
        f"<h2>What was run</h2>{list_of(done)}",
    ]
    path.write_text(
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{TITLE}</title>'
        f"<style>{page.STYLE}</style></head>\n<body>{''.join(parts)}</body></html>\n"
    )
    return missing


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few cases, coarse")
    parser.add_argument("--jobs", type=command.positive, default=2, help="cases at a time (default: 2)")
    parser.add_argument("--out", type=Path, default=Path("out/thesis"))
    return command.parse(parser)


def main():
    args = arguments()
    if MPI.COMM_WORLD.rank > 0:  # the cases are processes of their own
        return 0
    out, clock = results.folder(args.out, MPI.COMM_SELF), time.perf_counter()
    done = cases.run(cases.listed(args.quick), out / "cache", args.jobs)
    missing = write(done, out / "thesis.html", args.quick)
    answered = sum(result.failure is None for result in done.values())
    kept = sum(result.reused for result in done.values())
    right = answered == len(done) and (args.quick or not missing)
    command.say(
        f"check: {answered} of {len(done)} cases have an answer ({kept} kept), {len(FIGURES) - len(missing)} of "
        f"{len(FIGURES)} figures a counterpart, {time.perf_counter() - clock:.0f} s: {'yes' if right else 'NO'}; see "
        f"{out / 'thesis.html'}"
    )
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
