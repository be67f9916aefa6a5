"""Random scenes of contact: does anything ever pass through anything?

Sheets of 0.1 to 2 m, 0.1 to 2 mm thick, flat, stacked or folded, fly with up to 10 m/s at planes, balls smaller than a
cell, boxes with sharp edges and cylinders, in steps of up to 20 ms. Each scene is drawn by its number, and is run for a
few steps.

    python demos/studies/random_contact.py --scenes 200
    python demos/studies/random_contact.py --scenes 1 --first 17      # one of them, again

The checked numbers: in every committed state the least gap is above zero and no triangles cross; and each scene ends,
or stops with a sentence and a checkpoint.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import sys
import tempfile
import time
import traceback
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import numpy as np
import touching
import ufl

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import results
from fabric_fenicsx.solvers import checkpoint
from fabric_fenicsx.surfaces import meshing

COMM = MPI.COMM_SELF
KINDS = ("flat", "stack", "folded")


def pieces(kind, side, cells, apart):
    """Places (n, 3) and squares of a sheet: flat, a stack of two or three, or folded in two."""
    s = np.linspace(0, side, cells + 1)
    if kind == "folded":
        # in the plane (x, z): out, around half a circle, and back above
        r = max(apart / 2, 0.04 * side)
        arc, half = np.pi * r, side / 2
        t = np.linspace(0, 2 * half + arc, 2 * cells + 1)
        turn = np.clip((t - half) / r, 0.0, np.pi)
        x = np.where(t < half + arc, np.minimum(t, half) + r * np.sin(turn), half - (t - half - arc))
        grid = np.column_stack(
            [np.repeat(x, cells + 1), np.tile(s, len(t)), np.repeat(r * (1 - np.cos(turn)), cells + 1)]
        )
        return grid, squares(len(t), cells + 1)
    count = 1 if kind == "flat" else 3
    x, y = (a.ravel() for a in np.meshgrid(s, s, indexing="ij"))
    grid = np.concatenate([np.column_stack([x, y, np.full(len(x), k * apart)]) for k in range(count)])
    one = squares(cells + 1, cells + 1)
    return grid, np.concatenate([one + k * len(x) for k in range(count)])


def squares(n, m):
    """Cells of a grid of n x m points."""
    i = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    return np.stack([i, i + m, i + m + 1, i + 1], axis=1)


def around(rng, grid, clear):
    """Bodies below a sheet, which all end `clear` below its lowest place."""
    found, (x, y, low), (across, side, _) = [], grid.min(axis=0), np.ptp(grid, axis=0)
    middle = np.array([x + across / 2, y + side / 2, 0.0])
    for _ in range(rng.integers(1, 4)):
        at = middle + np.array([*rng.uniform(-0.4, 0.4, 2) * (across, side), 0.0])
        size = side * 10 ** rng.uniform(-2.0, -0.3)
        kind = rng.choice(["ball", "box", "edge", "cylinder", "plane"])
        if kind == "plane":
            normal = np.array([*rng.uniform(-0.3, 0.3, 2), 1.0])
            corner = np.where(normal[:2] > 0, (x, y), (x + across, y + side))
            foot = np.array([*corner, low - clear])
            found.append(bodies.Plane(tuple(normal), tuple(foot), size=2 * side, name=f"plane_{len(found)}"))
            continue
        centre = at + [0, 0, low - clear - size]
        name = f"{kind}_{len(found)}"
        if kind == "ball":
            found.append(bodies.Sphere(size, tuple(centre), cells=int(rng.integers(2, 7)), name=name))
        elif kind == "box":
            found.append(
                bodies.Box((2 * size, size, 2 * size), tuple(centre), cells=int(rng.integers(1, 4)), name=name)
            )
        elif kind == "edge":  # up, a cube on its edge
            half = size / np.sqrt(2)
            turn = (np.pi / 4, 0, 0)
            found.append(bodies.Box((3 * size, 2 * half, 2 * half), tuple(centre), turn, name=name))
        else:
            axis = (*rng.normal(size=2), 0.0)
            found.append(bodies.Cylinder(size, side, tuple(centre), axis, cells=int(rng.integers(3, 9)), name=name))
    return found


class Scene:
    """What a number draws: `run`, `touch`, `dt`, and words that tell it."""

    def __init__(self, number, folder):
        rng = np.random.default_rng(number)
        side, cells = 10 ** rng.uniform(-1.0, np.log10(2.0)), int(rng.integers(2, 6))
        edge, kind = side / cells, str(rng.choice(KINDS, p=[0.5, 0.25, 0.25]))
        h = min(10 ** rng.uniform(-4.0, np.log10(2e-3)), edge / 15)
        speed, self.dt = rng.uniform(0.0, 10.0), 10 ** rng.uniform(-3.5, np.log10(2e-2))
        friction = float(rng.choice([0.0, 0.2, 0.5]))
        grid, quads = pieces(kind, side, cells, 2.5 * h)
        triangles = rng.random() < 0.25
        faces = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]) if triangles else quads
        touching.obj(folder / "sheet.obj", grid, faces)
        E = 10 ** rng.uniform(6.0, 8.0)
        domain, shear = meshing.read(folder / "sheet.obj", COMM), (E / 2.5, E / 2.5)
        law = StVenantKirchhoff.isotropic(E, 0.25)
        cloth = sheet.Sheet(domain, law, h, shear, element="regge" if triangles else "mitc4")
        mass, found = 500 * h, around(rng, grid, 3 * h)
        self.touch = Contact(cloth, found, friction=friction, stiffness=10 ** rng.uniform(1.0, 4.0))
        weight = cloth.weight(mass, ufl.as_vector((0.0, 0.0, -touching.G)))
        self.run, _ = cloth.newmark(mass, [], [weight, *self.touch.terms])
        velocity = cloth.q.function_space.sub(0)
        way = np.array([*rng.uniform(-0.3, 0.3, 2), -1.0]) * speed
        for k in range(3):
            self.run.motion.velocity.x.array[np.array(velocity.sub(k).collapse()[1])] = way[k]
        self.told = (
            f"{kind}, {side:.2f} m in {cells}, {'triangles, ' if triangles else ''}{1e3 * h:.2f} mm, {speed:.1f} m/s, "
            f"{1e3 * self.dt:.2g} ms, mu {friction:g}: {', '.join(body.name for body in found)}"
        )


def go(number, steps, folder):
    """Run a scene: its row, and whether it is right."""
    row = {"scene": number, "steps": 0, "newton_iterations": 0, "step_cuts": 0, "least_gap_m": np.inf}
    clock, sentence, right = time.process_time(), "", True
    try:
        made = Scene(number, folder)
        told = made.told
    except InputError as error:
        return row | {"cpu_s": 0.0, "ended": 0}, f"refused: {error}", True
    state = folder / "checkpoint.npz"
    state.unlink(missing_ok=True)
    try:
        with checkpoint.guard(state, made.run, {}, 0.0):
            for step in made.run.march(steps * made.dt, made.dt):
                right &= here(made, row)
                row["steps"] += 1
                row["newton_iterations"] += step.newton_iterations
                row["step_cuts"] += step.step_cuts
    except StepFailed as error:
        sentence = str(error)
        right &= here(made, row) and state.exists() and "\n" not in sentence
    except Exception:
        sentence, right = traceback.format_exc(), False
    row |= {"cpu_s": time.process_time() - clock, "ended": int(not sentence)}
    return row, f"{told}{'; stopped: ' + sentence if sentence else ''}", right


def here(made, row):
    """Whether nothing has passed in the committed state."""
    gap = made.touch.least_gap()
    row["least_gap_m"] = min(row["least_gap_m"], gap)
    return gap > 0.0 and not made.touch.crossed()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--scenes", type=command.positive, default=20, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the number of the first")
    parser.add_argument("--steps", type=command.positive, default=5, help="of each")
    parser.add_argument("--out", type=Path, default=Path("out/random_contact"))
    args = command.parse(parser)
    if MPI.COMM_WORLD.size > 1:
        raise InputError("random_contact.py runs one scene after the other: call it on one rank.")
    out, wrong, stopped, refused = results.folder(args.out), [], 0, 0
    with results.Table(out / "history.csv") as table, tempfile.TemporaryDirectory() as folder:
        for number in range(args.first, args.first + args.scenes):
            row, told, right = go(number, args.steps, Path(folder))
            table.row(**row)
            refused += told.startswith("refused")
            stopped += not row["ended"] and not told.startswith("refused")
            wrong += [] if right else [number]
            command.say(f"{number}: {'' if right else 'WRONG: '}{told}; {row['steps']} steps, "
                        f"{row['newton_iterations']} iterations, {row['step_cuts']} cuts, least gap "
                        f"{1e3 * row['least_gap_m']:.3g} mm, {row['cpu_s']:.1f} s")  # fmt: skip
    gap = table.column("least_gap_m").min()
    command.say(f"{args.scenes} scenes: {args.scenes - stopped - refused} ended, {stopped} stopped, {refused} refused; "
                f"least gap of all {1e3 * gap:.5f} mm; wrong: {wrong or 'none'}")  # fmt: skip
    good = not wrong and gap > 0.0
    command.say(f"check: nothing passes, each ends or says why not: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
