"""Runs that are killed at random moments, and gone on with: the history of one that nothing disturbed.

A small motion and a small march run on one or two ranks and get SIGINT, SIGTERM or SIGKILL (every rank at once) at a
random moment, which may be in the import, the set-up, a step or a file. `fabric-fenicsx run --resume` then goes on, on
one to three ranks, and is killed again half of the time. In the end history.csv has each step once: the same text as
that of the run that nothing disturbed where all were on as many ranks, and the same numbers to 1e-6 of the largest
else.

    demos/studies/kills.py --kills 100
"""

import argparse
import contextlib
import csv
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from fabric_fenicsx import system
from fabric_fenicsx.app import command

MESH = Path(__file__).parents[2] / "fabric_fenicsx" / "meshes" / "strip.geo"
SHEET = f"""
[mesh]
file = "{MESH}"
numbers = {{ length = 0.2, width = 0.1, nx = 4, ny = 2 }}
[sheet]
fabric = "blend"
[[support]]
at = "fixed_end"
kind = "clamp"
[output]
checkpoint_s = 0
"""
MOTION = f"""{SHEET}
[[load]]
kind = "gravity"
acceleration_m_per_s2 = [0, 0, -9.81]
[dynamics]
end_s = 0.1
[[probe]]
name = "end"
at = "pulled_end"
axis = "z"
"""
MARCH = f"""{SHEET}
[[support]]
at = "pulled_end"
kind = "grip"
shift_m = [0.01, 0, 0]
[statics]
steps = 10
turns = [1, 0.9]
"""
SCENES = {"motion": MOTION, "march": MARCH}
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
ENTRY = "import sys; sys.argv[0] = 'fabric-fenicsx'; from fabric_fenicsx.app import cli; cli.main()"


def start(scene, out, ranks, *words):
    """The command in processes of its own."""
    line = [sys.executable, "-c", ENTRY, "run", str(scene), "--quiet", "--out", str(out), *words]
    line = line if ranks == 1 else [system.mpirun(), "-n", str(ranks), *line]
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def children(pid):
    """Processes that a process has started, and theirs, those without children last."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            number, rest = stat.read_text().split(" (", 1)
        except OSError:  # it has just ended
            continue
        parents.setdefault(int(rest.rsplit(") ", 1)[1].split()[1]), []).append(int(number))
    return [p for child in parents.get(pid, []) for p in (child, *children(child))]


def kill(process, ranks, number):
    """Send a signal to every rank."""
    below = children(process.pid) if ranks > 1 else []
    known = [pid for pid in below if not any(parent == pid for parent in map(parent_of, below))]
    for pid in known or [process.pid]:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


def parent_of(pid):
    """The parent of a process; 0 if it has ended."""
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rsplit(") ", 1)[1].split()[1])
    except OSError:
        return 0


def history(out):
    """Rows of history.csv without what the clock says, as text."""
    with open(out / "history.csv", newline="") as file:
        return [{name: text for name, text in row.items() if name != "wall_s"} for row in csv.DictReader(file)]


def apart(rows, expected):
    """What is not the same but for round-off, iterations apart; nothing, if all is."""
    for name in expected[0]:
        if name in ("newton_iterations", "step_cuts"):
            continue
        a, b = ([float(row[name]) for row in table] for table in (rows, expected))
        most = max(abs(x - y) for x, y in zip(a, b, strict=True))
        if most > 1e-6 * max(map(abs, b)) + 1e-9:
            return f"{name} is {most:.2g} apart, of {max(map(abs, b)):.2g}"
    return ""


def trial(chance, folder, kind, whole, seconds, first, later):
    """Kill a run at random and go on until it ends: how often it was killed. Raises AssertionError."""
    scene, out, ranks, kills = folder / f"{kind}.toml", folder / "killed", [first, later], 0
    shutil.rmtree(out, ignore_errors=True)
    words, used = [], []
    while True:
        number = ranks[min(len(used), 1)]
        process = start(scene, out, number, *words)
        used.append(number)
        if kills == 0 or (kills < 4 and chance.random() < 0.5):
            try:
                process.wait(chance.uniform(0.0, seconds[number]))
            except subprocess.TimeoutExpired:
                kill(process, number, chance.choice(SIGNALS))
                kills += 1
        said = process.communicate(timeout=300)[0]
        if process.returncode == 0:
            break
        assert process.returncode in (-2, -9, -15, 130, 137, 143) or kills, said
        saved = (out / "checkpoint.npz").exists() or (out / "checkpoint.before.npz").exists()
        words = ["--resume"] if saved else []
    rows = history(out)
    assert len(rows) == len(whole[first]), f"{len(rows)} rows instead of {len(whole[first])}: {said}"
    if len(set(used)) == 1:
        assert rows == whole[first], "not the same text"
    fault = apart(rows, whole[first])
    assert not fault, fault
    return kills


def study(kills, folder, seed=0, pairs=((1, 1), (1, 2), (2, 2), (2, 1), (2, 3), (1, 3)), kinds=tuple(SCENES)):
    """So many kills at least; prints a line for each trial, and returns how many went wrong."""
    chance, done, wrong, trials = random.Random(seed), 0, 0, 0
    folder.mkdir(parents=True, exist_ok=True)
    known = {}
    for kind in kinds:
        (folder / f"{kind}.toml").write_text(SCENES[kind])
        whole, seconds = {}, {}
        for ranks in sorted({r for pair in pairs for r in pair}):
            said = "compiling"
            while "compiling" in said:  # then once more, for the time
                clock = time.monotonic()
                process = start(folder / f"{kind}.toml", folder / f"whole_{kind}_{ranks}", ranks)
                said = process.communicate(timeout=600)[0]
                assert process.returncode == 0, said
            whole[ranks], seconds[ranks] = history(folder / f"whole_{kind}_{ranks}"), time.monotonic() - clock
        known[kind] = whole, seconds
    while done < kills:
        kind, (first, later) = kinds[trials % len(kinds)], pairs[trials // len(kinds) % len(pairs)]
        try:
            times = trial(chance, folder, kind, *known[kind], first, later)
            result = "the same"
        except AssertionError as fault:
            times, wrong, result = 1, wrong + 1, f"WRONG: {fault}"
        done, trials = done + times, trials + 1
        command.say(f"{kind}, {first} to {later} ranks, killed {times} times: {result}")
    command.say(f"check: {done} kills in {trials} runs, {wrong} with another history: {'NO' if wrong else 'yes'};")
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--kills", type=command.positive, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/kills"))
    args = command.parse(parser)
    return 1 if study(args.kills, args.out, args.seed) else 0


if __name__ == "__main__":
    command.run(main)
