"""Write the pages of measured numbers, .readme/*.md, anew: run each page's commands and keep what they print.

    python .setup/measured.py                # names and commands of all pages
    python .setup/measured.py shell lean     # run those of two pages; --all: of every page, an hour and more

The commands stand in .readme/measured.toml. A page says what it was run with; a command that ends with a status other
than 0 is kept with its status, and so does this script. Of a page with `readme`, these columns are README's table.
"""

import argparse
import os
import re
import subprocess
import sys
import time
import tomllib
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / ".readme"
PAGES = tomllib.loads((README / "measured.toml").read_text())
QUIET = "progress bars and warnings are left out"


def run(command, out):
    """What a command prints, its status, and how long it took in s."""
    clock = time.perf_counter()
    script, *words = command.split()
    to = ["--out", str(out)] if '"--out"' in (ROOT / script).read_text() else []  # before what comes after --
    answer = subprocess.run(
        [sys.executable, script, *to, *words], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False
    )
    said = answer.stdout.replace(f"{out}", "its folder").replace(f"{ROOT}/", "").strip("\n")
    return said, answer.returncode, time.perf_counter() - clock


def write(name):
    """Run a page's commands and write it; the largest status."""
    page, worst = PAGES[name], 0
    git = partial(subprocess.run, cwd=ROOT, capture_output=True, text=True, check=False)
    commit = git(["git", "describe", "--always"]).stdout.strip()
    if git(["git", "diff", "--quiet", "HEAD", "--", ".", ":!*.md"]).returncode:  # the pages are no code
        commit += "-dirty"
    text = f"# {page['title']}\n\n{page['text'].strip()}\n\n"
    text += f"Written by `python .setup/measured.py {name}` at {commit} on {os.cpu_count()} cores; {QUIET}.\n"
    for number, command in enumerate(page["commands"]):
        print(f"{name}: python {command}", flush=True)
        said, status, seconds = run(command, ROOT / "out" / "measured" / name / str(number))
        worst = max(worst, abs(status))
        ended = f", status {status}" if status else ""
        text += f"\n## `python {command}`\n\n```\n{said}\n```\n\n{seconds:.0f} s{ended}\n"
        (README / f"{name}.md").write_text(text)
    if "readme" in page:
        readme = ROOT / "README.md"
        readme.write_text(re.sub(r"\| program .*?\n\n", table(name) + "\n\n", readme.read_text(), flags=re.S))
    return worst


def table(name):
    """README's table: columns of the first one that a page's commands print."""
    printed = re.search(r"^ *program .*?(?=^check|^```|^$)", (README / f"{name}.md").read_text(), re.M | re.S)
    head, *rows = (re.split(r" {2,}", line.strip()) for line in printed[0].splitlines())
    keep = [head.index(column) for column in PAGES[name]["readme"]]
    lines = [PAGES[name]["readme"].values(), ["---"] * len(keep), *([row[k] for k in keep] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main():
    """List or write the pages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"pages to write: {', '.join(PAGES)}")
    parser.add_argument("--all", action="store_true", help="write them all")
    args = parser.parse_args()
    names = list(PAGES) if args.all else args.names
    if unknown := set(names) - set(PAGES):
        parser.error(f"{', '.join(sorted(unknown))} is no page; pages are {', '.join(PAGES)}")
    for name, page in PAGES.items() if not names else ():
        print(f"{name}: {page['title']}", *(f"    python {command}" for command in page["commands"]), sep="\n")
    return max((write(name) for name in names), default=0)


if __name__ == "__main__":
    sys.exit(min(main(), 1))
