"""The cases of the report with their settings; each runs in a process of its own, and once only.

The result of a case is kept as JSON under a name made of its settings, of the package and of the demos that it uses:
what has not changed is not run again.
"""

import ast
import hashlib
import importlib
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tqdm import tqdm

import fabric_fenicsx
from fabric_fenicsx.app import command

HERE = Path(__file__).parent
DEMOS = HERE.parents[1]
NAMES = ("blend", "denim", "duck", "muslin")
LOWERED = ("duck", "muslin")
TIMES = {"drape": (0.0, 0.1, 0.2, 0.3, 0.4, 0.5), "poke": (0.0, 0.15, 0.25, 0.35, 0.5)}
"""Of the pictures of Figures 7-31, 7-33 and 7-34, s."""

VARIANTS = [
    ("poke", "continuous", {"no_shear_hysteresis": True, "most": 1500}),
    ("drape", "printed", {"no_shear_hysteresis": True}),
    ("drape", "printed", {}),
    ("drape", "continuous", {"no_shear_hysteresis": True}),
]
"""Of the scenes in motion: as the thesis ran them, and by the law as printed."""


@dataclass
class Case:
    """What to run: a function of a room of this folder, "statics.cycles" say, and its arguments."""

    name: str
    function: str
    settings: dict = field(default_factory=dict)

    @property
    def key(self):
        """Changes with the settings, and with every line of code or data that the case may use."""
        told = json.dumps([self.function, self.settings, code(self.function.split(".")[0])], sort_keys=True)
        return hashlib.sha256(told.encode()).hexdigest()[:16]


@dataclass
class Done:
    """A case that has run: its answer, or the sentence that says why there is none."""

    case: Case
    answer: dict | None
    failure: str | None
    seconds: float  # of one core
    reused: bool


def listed(quick=False):
    """All cases, the longest first, so that no core waits long for the other; or few and coarse ones."""
    cases = []

    def add(name, function, **settings):
        cases.append(Case(name, function, settings))

    if quick:
        fall = {"fabric": "blend", "times": (0.0, 0.02), "most": 100, "cells": 4, "end": 0.02}
        add("drape continuous blend", "motion.drape", law="continuous", **fall)
        add("loops blend", "points.loops", fabric="blend", trials=50, generations=1, parts=50)
        add("laws blend", "points.laws", fabric="blend", steps=20, trials=50, generations=1, parts=50)
        add("clamped blend", "statics.clamped", fabric="blend", steps=4, cells=(9, 3))
        add("cycles blend", "statics.cycles", fabric="blend", steps=6, cells=(9, 3), shots=("bias",))
        add("material blend", "points.material", fabric="blend", steps=20)
        add("shear sign blend", "statics.shear", fabric="blend", cycle="sign", steps=6)
        return cases

    most = {"drape": 3000, "poke": 6000}  # muslin wrinkles much on its way back
    scenes = {name: {"times": times, "most": most[name], "cells": 20} for name, times in TIMES.items()}
    for name, law, more in VARIANTS:
        words = " no shear hysteresis" * bool(more)
        add(f"{name} {law} blend{words}", f"motion.{name}", fabric="blend", law=law, **{**scenes[name], **more})
    for fabric in NAMES:
        for law in "continuous", "potential":
            add(f"poke {law} {fabric}", "motion.poke", fabric=fabric, law=law, **scenes["poke"])
    add("poke svk blend", "motion.poke", fabric="blend", law="svk", **scenes["poke"])
    for fabric in NAMES:
        for law in "continuous", "potential":
            add(f"drape {law} {fabric}", "motion.drape", fabric=fabric, law=law, **scenes["drape"])
        add(f"clamped {fabric}", "statics.clamped", fabric=fabric, steps=20, cells=(36, 12))
        mesh = {"cells": (24, 8), "element": "regge", "laws": ("continuous",)}
        add(f"refined {fabric}", "statics.cycles", fabric=fabric, steps=20, **mesh)
        add(f"loops {fabric}", "points.loops", fabric=fabric, trials=1000, generations=25, parts=300)
        add(f"laws {fabric}", "points.laws", fabric=fabric, steps=200, trials=1000, generations=25, parts=300)
    add("buckled blend", "statics.buckled", fabric="blend", steps=20, cells=(24, 8), height_mm=0.1)
    counts = (10, 20, 40, 80, 160)
    for fabric in NAMES:
        kinds = ("measured", "lowered") if fabric in LOWERED else ("measured",)
        shots = ("bias",) if fabric == "blend" else ()
        add(f"increments {fabric}", "statics.increments", fabric=fabric, counts=counts)
        add(f"cycles {fabric}", "statics.cycles", fabric=fabric, steps=20, cells=(9, 3), kinds=kinds, shots=shots)
        add(f"material {fabric}", "points.material", fabric=fabric, steps=20)
        add(f"steps {fabric}", "points.steps_at_a_point", fabric=fabric, counts=counts)
    for fabric in LOWERED:
        lowered = {"poisson": "lowered", "law": "continuous", **scenes["poke"]}
        add(f"poke continuous {fabric} lowered ratios", "motion.poke", fabric=fabric, **lowered)
        add(f"ratios {fabric}", "statics.ratios", fabric=fabric, steps=20, values=(0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8))
    for fabric in "blend", "denim":
        mesh = {"meshes": ((9, 3), (36, 12)), "shots": fabric == "blend"}
        add(f"off axis {fabric}", "statics.off_axis", fabric=fabric, steps=20, angles=(30, 60), **mesh)
        add(f"stretch {fabric}", "statics.stretch", fabric=fabric, steps=20, displacement_mm=30.0)
    add("reload blend", "statics.reload", fabric="blend", steps=20)
    for cycle in "sign", "reload":
        add(f"shear {cycle} blend", "statics.shear", fabric="blend", cycle=cycle, steps=20)
    return cases


@cache
def code(room, demos=DEMOS):
    """Hash of what a room of this folder imports, one file by another: demos and package; and of fabrics and meshes."""
    package = Path(fabric_fenicsx.__file__).parent
    thesis = demos / HERE.parent.name
    wanted, found = [thesis / HERE.name / f"{room}.py"], set()
    while wanted:
        file = wanted.pop()
        if file not in found and file.exists():
            found.add(file)
            wanted += _imported(file, (thesis, demos, package.parent))
    data = [*(package / "fabrics").glob("*.toml"), *(demos.parent / "meshes").glob("*.geo")]
    told = hashlib.sha256()
    for file in sorted({*found, *data}, key=lambda file: (file.name, file.parent.name)):
        told.update(file.name.encode() + file.read_bytes())
    return told.hexdigest()


def _imported(file, roots):
    """Where the modules would be that a file imports, wherever in it."""
    for level, names in _imports(file.read_text()):
        for name in names:
            parts = name.split(".")
            for folder in (file.parents[level - 1],) if level else roots:
                # a package is entered through each of its own
                yield from (folder.joinpath(*parts[:k], "__init__.py") for k in range(1, len(parts) + 1))
                yield folder.joinpath(*parts).with_suffix(".py")


@cache
def _imports(text):
    """Level and names of every import in a text."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found.append((0, [alias.name for alias in node.names]))
        elif isinstance(node, ast.ImportFrom):
            base = [node.module] if node.module else []
            found.append((node.level, base + [".".join([*base, alias.name]) for alias in node.names]))
    return found


def run(cases, folder, jobs=2):
    """Run what has not been run before, `jobs` at a time: name -> Done. One that fails keeps no other from running."""
    folder.mkdir(parents=True, exist_ok=True)
    done = {}
    with ThreadPoolExecutor(jobs) as pool, tqdm(total=len(cases), unit="case", leave=False) as bar:
        for task in as_completed([pool.submit(_one, case, folder) for case in cases]):
            result = task.result()
            done[result.case.name] = result
            how = "kept" if result.reused else f"{result.seconds:.1f} s"
            bar.write(f"  {result.case.name}: {result.failure or how}", file=sys.stdout)
            sys.stdout.flush()
            bar.update()
    return {case.name: done[case.name] for case in cases}


def _one(case, folder):
    path = folder / f"{case.name.replace(' ', '_')}-{case.key}.json"
    if path.exists():
        kept = json.loads(path.read_text())
        return Done(case, kept["answer"], None, kept["seconds"], True)
    # one thread a process; and not a rank of the run that this one may be part of
    world = ("PMI", "PMIX", "OMPI", "MPI_", "MPIR", "HYDRA", "HYDI")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(world)}
    environment |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    folders = [str(HERE.parent), str(DEMOS), str(DEMOS.parent)]
    environment["PYTHONPATH"] = os.pathsep.join([*folders, environment.get("PYTHONPATH", "")])
    words = [case.function, json.dumps(case.settings), str(path)]
    answer = subprocess.run(
        [sys.executable, "-m", f"{__package__}.cases", *words], env=environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if answer.returncode or not path.exists():
        path.unlink(missing_ok=True)
        said = [line for line in answer.stderr.splitlines() if line.strip()]
        reason = said[-1] if said else f"ended with status {answer.returncode}"
        return Done(case, None, reason.removeprefix("error: "), 0.0, False)
    kept = json.loads(path.read_text())
    return Done(case, kept["answer"], None, kept["seconds"], False)


def main():
    """In the case's own process: the function, its settings and where to put the answer."""
    function, settings, path = sys.argv[1:]
    room, name = function.split(".")
    # the first import of DOLFINx's world loads the MPI library that it is to use
    answer = getattr(importlib.import_module(f"{__package__}.{room}"), name)(**json.loads(settings))
    told = {"function": function, "settings": json.loads(settings), "seconds": time.process_time(), "answer": answer}
    unfinished = Path(path).with_suffix(".part")
    unfinished.write_text(json.dumps(told))
    unfinished.rename(path)


if __name__ == "__main__":
    command.run(main)
