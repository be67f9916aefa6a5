"""The drape of an elastic sheet and its fall onto a sphere beside other programs, in processor time, in one run.

The sheet is 2 m x 2 m and 0.38 mm thick, of 8 MPa and a Poisson's ratio of 0.25, 590 kg/m3. In the drape it is held
over squares of 0.2 m in its corners for 0.5 s; in the other scene it falls onto a sphere of 0.3 m, with friction 0.3,
for 0.35 s. Each peer computes them where it is installed, else the table says that it is not:

- CalculiX (`ccx`, on the path): S4 shells, implicit steps of 5 ms; the drape alone
- MuJoCo (the extra `peers`): membrane triangles, with its explicit integrator, and with `discrete`, which is implicit,
  in steps of 5 ms

An explicit program takes the largest of the steps 0.1 ms x 2^k whose sag is within 1 % of that of half the step, for
a step that is smaller than needed would only make it look slow. Processor time is that of the steps, without compiling;
of CalculiX that of the whole process. The last column is the largest sag of the drape's centre against that of an
implicit drape here of the same cells and steps of 1.25 ms, with the same law.

    python demos/studies/peers.py --cells 20
    python demos/studies/peers.py --cells 20 40 --scenes drape

Here the same sheet goes with the elastic law, and with the whole law of the blend for what its history costs.

The checked number: every peer that is installed has computed the scene, and the drapes here are within 3 % of the sag.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import moving
import numpy as np
import studies

from fabric_fenicsx.app import command
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.output import results

E, NU, THICK, DENSITY, G = 8e6, 0.25, 0.38e-3, 590.0, 9.81
PATCH, RADIUS, ABOVE, FRICTION = 0.2, 0.3, 5e-3, 0.3
END = {"drape": 0.5, "sphere": 0.35}
STEP = 5e-3  # s
OURS = {
    "elastic, implicit": ["--isotropic", f"{E},{NU}"],
    "elastic, explicit": ["--isotropic", f"{E},{NU}", "--method", "explicit"],
    "whole law, implicit": [],
    "whole law, explicit": ["--method", "explicit"],
}


def ours(scene, cells, name, *words):
    """A run of the demo of that name: a row."""
    with tempfile.TemporaryDirectory() as folder:
        held = ["--patch", PATCH] if scene == "drape" else ["--friction", FRICTION, "--radius", RADIUS]
        script = Path(__file__).parents[1] / f"{scene}.py"
        words = ["--cells", cells, *held, *OURS[name], *words, "--out", folder]
        for end in (2 * STEP, END[scene]):  # the first is for what is compiled and kept
            done = studies.on_ranks(1, script, *words, "--end", end)
        if done.returncode == 2 or not Path(folder, "history.csv").exists():
            raise StepFailed(f"{script.name} has not run: {' '.join(done.stderr.strip().splitlines()[-1:])}")
        table = np.genfromtxt(Path(folder, "history.csv"), delimiter=",", names=True)
    solves = table["newton_iterations"].sum() if "implicit" in name else table["steps_taken"].sum()
    cpu, unknowns = table["cpu_s"].sum(), table["unknowns"][-1]
    return row("fabric_fenicsx", name, cells, unknowns, solves, cpu, table["centre_z_m"].min())


def row(program, method, cells, unknowns, solves, cpu, z):
    """A line of the table; solves: Newton iterations, or explicit steps; us_each: processor time of one, an unknown."""
    each = 1e6 * cpu / (unknowns * solves) if solves else np.nan
    return {
        "program": program, "method": method, "cells": cells, "unknowns": int(unknowns), "solves": int(solves),
        "cpu_s": float(cpu), "us_each": float(each), "lowest_z_m": float(z),
    }  # fmt: skip


# CalculiX


def held(cells):
    """Nodes in the corner squares, numbered along y first, from 0."""
    x = np.linspace(0.0, moving.SIDE, cells + 1)
    inner = np.minimum(x, moving.SIDE - x) <= PATCH * (1 + 1e-9)
    return np.flatnonzero(np.logical_and.outer(inner, inner))


def calculix_input(cells, step=STEP, end=END["drape"]):
    """The drape as an input of CalculiX: text."""
    x, n = np.linspace(0.0, moving.SIDE, cells + 1), cells + 1
    number = 1 + np.arange(n * n).reshape(n, n)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    nodes = "\n".join(f"{number[i, j]},{x[i]:.9g},{x[j]:.9g},0" for i in range(n) for j in range(n))
    elements = "\n".join(
        ",".join(map(str, (k, *face))) for k, face in enumerate(zip(*map(np.ravel, corners), strict=True), start=1)
    )
    fixed = "\n".join(f"{k + 1},1,3" for k in held(cells))
    middle = number[cells // 2, cells // 2]
    return f"""*NODE, NSET=ALL
{nodes}
*ELEMENT, TYPE=S4, ELSET=SHEET
{elements}
*NSET, NSET=MIDDLE
{middle}
*MATERIAL, NAME=CLOTH
*ELASTIC
{E},{NU}
*DENSITY
{DENSITY}
*SHELL SECTION, ELSET=SHEET, MATERIAL=CLOTH
{THICK}
*BOUNDARY
{fixed}
*STEP, NLGEOM, INC=100000
*DYNAMIC
{step},{end},1e-9,{step}
*DLOAD
SHEET,GRAV,{G},0,0,-1
*NODE PRINT, NSET=MIDDLE, FREQUENCY=1
U
*END STEP
"""


def calculix(cells):
    """A row, or nothing where CalculiX is not installed."""
    program = shutil.which("ccx")
    if program is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "drape.inp").write_text(calculix_input(cells))
        before = os.times()
        done = subprocess.run(
            [program, "drape"], cwd=folder, env=os.environ | {"OMP_NUM_THREADS": "1"}, capture_output=True, text=True
        )
        cpu = sum(os.times()[2:4]) - sum(before[2:4])
        printed = Path(folder, "drape.dat").read_text() if Path(folder, "drape.dat").exists() else ""
    times = [float(text) for text in re.findall(r"and time\s+(\S+)", printed)]
    heights = [float(line.split()[3]) for line in printed.splitlines() if re.fullmatch(r"\s*\d+(\s+\S+){3}", line)]
    if done.returncode or not times or times[-1] < END["drape"] - 1e-9:
        raise StepFailed(f"CalculiX stopped at {times[-1] if times else 0:g} s of {END['drape']:g}.")
    version = re.search(r"Version ([\d.]+)", done.stdout)
    solves = len(re.findall(r"^ iteration\s+\d+", done.stdout, re.MULTILINE))
    name = f"CalculiX {version[1]}" if version else "CalculiX"
    return row(name, "S4, implicit", cells, 6 * (cells + 1) ** 2, solves, cpu, min(heights))


# MuJoCo

MUJOCO = """
import json, sys, time, mujoco
xml, step, end, middle = json.load(sys.stdin)
model = mujoco.MjModel.from_xml_string(xml)
data = mujoco.MjData(model)
z = [0.0]
clock = time.process_time()
for k in range(round(end / step)):
    mujoco.mj_step(model, data)
    z.append(float(data.flexvert_xpos[middle][2]))
cpu = time.process_time() - clock
finite = all(abs(value) < 10 for value in z)
json.dump([mujoco.__version__, int(model.nv), cpu, z if finite else None], sys.stdout)
"""


def mujoco_model(scene, cells, step, integrator):
    """The scene as a model of MuJoCo: text."""
    n, h = cells + 1, moving.SIDE / cells
    mass = DENSITY * THICK * moving.SIDE**2
    pins = f"<pin id='{' '.join(map(str, held(cells)))}'/>" if scene == "drape" else ""
    ball = f'<geom type="sphere" size="{RADIUS}" pos="0 0 {-RADIUS - ABOVE - THICK / 2}"/>' if scene == "sphere" else ""
    flag = '<flag contact="disable"/>' if scene == "drape" else ""
    return f"""<mujoco><size memory="1G"/>
<option timestep="{step}" integrator="{integrator}" gravity="0 0 {-G}">{flag}</option>
<worldbody>{ball}
<flexcomp name="sheet" type="grid" dim="2" count="{n} {n} 1" spacing="{h} {h} {h}" mass="{mass}" radius="{THICK / 2}">
<elasticity young="{E}" poisson="{NU}" thickness="{THICK}" elastic2d="stretch"/>
<contact selfcollide="none" friction="{FRICTION}"/>{pins}</flexcomp></worldbody></mujoco>"""


def stepped(scene, cells, step, integrator):
    """Version, unknowns, processor time in s and heights of the centre, None if they are lost."""
    model = mujoco_model(scene, cells, step, integrator)
    middle = (cells + 1) * (cells // 2) + cells // 2
    asked = json.dumps([model, step, END[scene], middle])
    done = subprocess.run([sys.executable, "-c", MUJOCO], input=asked, capture_output=True, text=True)
    if done.returncode:
        raise StepFailed(f"MuJoCo has not run: {' '.join(done.stderr.strip().splitlines()[-1:])}")
    return json.loads(done.stdout[done.stdout.index("[") :])


def mujoco(scene, cells, method):
    """A row."""
    if method == "implicit":
        step = STEP
        run = stepped(scene, cells, step, "discrete")
    else:
        step, run = largest_step(lambda step: stepped(scene, cells, step, "Euler"))
    version, unknowns, cpu, z = run
    if z is None:
        raise StepFailed(f"MuJoCo's {method} motion is lost at steps of {1e3 * step:g} ms.")
    name = f"membrane, {method} {1e3 * step:.3g} ms"
    return row(f"MuJoCo {version}", name, cells, unknowns, len(z) - 1, cpu, min(z))


def largest_step(run, step=1e-4, near=0.01):
    """The largest step, by factors of 2, in s, whose lowest point is near that of half the step, and its run."""
    fine = run(step)
    while fine[3] is None and step > 1e-7:
        step /= 2
        fine = run(step)
    while fine[3] is not None:
        coarse = run(2 * step)
        if coarse[3] is None or abs(min(coarse[3]) / min(fine[3]) - 1) > near:
            break
        step, fine = 2 * step, coarse
    return step, fine


def peers(scene, cells):
    """Rows of one scene, ours first; and the peers that are not here."""
    rows, missing = [ours(scene, cells, name) for name in OURS], []
    if scene == "drape":
        if found := calculix(cells):
            rows.append(found)
        else:
            missing.append("CalculiX (ccx)")
    if find_spec("mujoco"):
        rows += [mujoco(scene, cells, method) for method in ("explicit", "implicit")]
    else:
        missing.append("MuJoCo (pip install mujoco-core)")
    for line in rows:  # of those that compute the same
        line["cpu_ratio"] = line["cpu_s"] / rows[0]["cpu_s"]
    return rows, missing


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--cells", type=command.positive, nargs="+", default=[20], help="along a side, even")
    parser.add_argument("--scenes", choices=END, nargs="+", default=list(END))
    parser.add_argument("--out", type=Path, default=Path("out/peers"))
    return command.parse(parser)


def main():
    args = arguments()
    out, good = results.folder(args.out), True
    command.say(studies.machine())
    for scene in args.scenes:
        for cells in args.cells:
            command.say(f"\n{scene}, {cells} x {cells} cells, {END[scene]:g} s")
            rows, missing = peers(scene, cells)
            if scene == "drape":
                fine = {name: ours(scene, cells, name, "--step", 1.25) for name in OURS if "implicit" in name}
                for line in rows:
                    law = "whole law, implicit" if "whole" in line["method"] else "elastic, implicit"
                    line["sag_error_percent"] = 100 * (line["lowest_z_m"] / fine[law]["lowest_z_m"] - 1)
                good &= all(abs(line["sag_error_percent"]) <= 3 for line in rows[: len(OURS)])
            studies.show(rows)
            studies.write(out / f"{scene}_{cells}.csv", rows)
            for name in missing:
                command.say(f"{name} is not installed: not computed")
    command.say(
        f"check: every peer that is here has computed it, sag here within 3 %: {'yes' if good else 'NO'}; see {out}"
    )
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
