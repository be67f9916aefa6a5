"""What was tried at the edges of the package, what came of it, and where the limit is.

Thickness, yarn stiffness, Poisson's ratios, slack yarns, large strains, reversals, rotation, cells, load steps, time
steps implicit and explicit, inputs that are no good, and contact. A trial works (and is as accurate as it says), is
refused with an InputError before anything is solved, or stops with a StepFailed that leaves the last good state behind.

    python demos/studies/stability.py              # all of it
    python demos/studies/stability.py --quick      # the edges alone, in half a minute
    python demos/studies/stability.py --only far

The checked number: no trial ends otherwise, and every one that must work, or be refused, does so.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import time
from pathlib import Path

import stability_contact
import stability_more
import stability_trials
import studies

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.output import results

COLOURS = {"works": "#a6dcc6", "refused": "#56b4e9", "stopped": "#e69f00", "inaccurate": "#cc79a7", "FAULT": "#1a1a1a"}


def as_wanted(wanted, verdict):
    """Whether what came of a trial may be."""
    may = {stability_trials.ANY: ("works", "stopped", "refused")}
    may[stability_trials.TOLD] = (*may[stability_trials.ANY], "inaccurate")
    return verdict == wanted or verdict in may.get(wanted, ())


def limit(rows):
    """Of the trials of one subject: how many work, and those that do not."""
    broken = [row["tried"] for row in rows if row["verdict"] not in ("works", "refused", row["wanted"])]
    working = sum(row["verdict"] == "works" for row in rows)
    refused = sum(row["verdict"] == "refused" for row in rows)
    return f"{working} work, {refused} refused" + (f"; not: {'; '.join(broken)}" if broken else "; no limit found")


def plot(path, rows):
    """A tile for every trial, a line for every subject."""
    subjects = list(dict.fromkeys(row["subject"] for row in rows))
    most = max(sum(row["subject"] == name for row in rows) for name in subjects)
    figure, (axes,) = plots.panels(1, width=0.28 * most + 3.5, height=0.4 * len(subjects) + 1.4)
    for y, name in enumerate(subjects):
        for x, row in enumerate(row for row in rows if row["subject"] == name):
            axes.barh(y, 0.9, left=x, height=0.7, color=COLOURS[row["verdict"]])
    for verdict in dict.fromkeys(row["verdict"] for row in rows):
        axes.barh(0, 0, color=COLOURS[verdict], label=verdict)
    axes.set(yticks=range(len(subjects)), yticklabels=[name.replace("_", " ") for name in subjects], xlabel="trial")
    axes.invert_yaxis()
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=5, frameon=False)
    figure.savefig(path, dpi=150)


def main():
    subjects = {subject.__name__: subject for subject in (*stability_more.SUBJECTS, *stability_contact.SUBJECTS)}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the edges alone")
    parser.add_argument("--only", choices=subjects, nargs="+", default=list(subjects), help="some of the subjects")
    parser.add_argument("--out", type=Path, default=Path("out/stability"))
    args = command.parse(parser)
    out, rows, right = results.folder(args.out), [], True
    command.say(studies.machine())
    for name in args.only:
        command.say(f"\n{name.replace('_', ' ')}: {subjects[name].__doc__}")
        for trial in subjects[name](args.quick):
            clock = time.process_time()
            verdict, said = stability_trials.attempt(trial)
            good = as_wanted(trial.wanted, verdict)
            right &= good
            seconds = time.process_time() - clock
            rows.append({"subject": name, "tried": trial.tried, "verdict": verdict, "wanted": trial.wanted,
                         "cpu_s": f"{seconds:.2f}", "said": said})  # fmt: skip
            short = said if len(said) < 110 or not good else said[:107] + "..."
            command.say(
                f"  {trial.tried:44s}{verdict:11s}{seconds:6.1f} s  {short}{'' if good else '  <-- NOT AS WANTED'}"
            )
    studies.write(out / "stability.csv", rows)
    command.say(f"\n{'subject':18s}limit")
    for name in args.only:
        command.say(f"{name.replace('_', ' '):18s}{limit([row for row in rows if row['subject'] == name])}")
    if MPI.COMM_WORLD.rank == 0:
        plot(out / "stability.png", rows)
    command.say(f"check: every trial ends as it must: {'yes' if right else 'NO'}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
