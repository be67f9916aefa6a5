"""Bias strips that shear with friction, pulled, let back and pulled again, of each fabric: who gets through.

    demos/studies/bias_cycles.py
    demos/studies/bias_cycles.py --fabric duck --steps 200

A strip of the thesis's size between clamps goes 0-10-5-10-5 mm (muslin 8 and 4) with the law that has a potential. Its
shear has no friction, or that of `laws.play` in four variants: a little or much of it, with softening or without.
The table gives Newton iterations a step, cuts, the force at both peaks and after the first way back, in N.

The checked numbers: every run is complete, none has given back more work than it took, and no second peak is above
the first.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from fabric_fenicsx import fabrics, specimen
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.fabrics import ShearFriction
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.output import results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing

PLAIN = {"friction": 0.0, "kept": 1.0, "strain": 0.05}
VARIANTS = {
    "none": None,
    "little": PLAIN | {"set_in": 0.05, "returned": 0.05, "softening": 0.0, "rejoining": 3.0},
    "more": PLAIN | {"set_in": 0.2, "returned": 0.2, "softening": 0.0, "rejoining": 3.0},
    "softening": PLAIN | {"set_in": 0.1, "returned": 0.1, "softening": 0.5, "rejoining": 3.0},
    "start": PLAIN | {"friction": 0.05, "set_in": 0.1, "returned": 0.3, "softening": 0.5, "rejoining": 3.0},
}
"""Friction of shear; that at the start is a part of the largest stress of the curve."""
TOP = {"muslin": 8e-3}


def rubbing(name, variant):
    """The fabric with such friction; its shear as stiff in unloading as that asks."""
    fabric, numbers = fabrics.load(name), VARIANTS[variant]
    if numbers is None:
        return fabric
    peak = float(fabric.shear.stress(fabric.shear.limit))
    return replace(fabric, shear_friction=ShearFriction(**numbers | {"friction": numbers["friction"] * peak}))


def run(name, variant, steps, cells, poisson="measured"):
    """Displacements (n,) in m, forces (n,) in N, iterations a step, cuts, and where it stopped in m, or None."""
    fabric = rubbing(name, variant)
    nx, ny = cells
    domain = meshing.read(
        meshing.MESHES / "strip.geo",
        MPI.COMM_SELF,
        gdim=2,
        nx=nx,
        ny=ny,
        length=fabric.gauge_length,
        width=fabric.width,
    )
    scene = specimen.strip(domain, fabric, Potential(fabric, poisson), np.pi / 4)
    top, n = TOP.get(Path(name).stem, 10e-3), steps // 5
    there, half = np.linspace(0, top, 2 * n + 1)[1:], np.linspace(top, top / 2, n + 1)[1:]
    path = [*there, *half, *(np.linspace(top / 2, top, n + 1)[1:]), *half]
    d, force, iterations, cuts, stop = [0.0], [0.0], 0, 0, None
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*is beyond the measured")
        try:
            for step in statics.march(scene.solver, scene.pull, path):
                d.append(step.load)
                force.append(scene.solver.reaction(scene.ends[1]))
                iterations += step.newton_iterations
                cuts += step.step_cuts
        except StepFailed:
            stop = path[len(d) - 1]
    return np.array(d), np.array(force), iterations / max(len(d) - 1, 1), cuts, stop


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--fabric", nargs="+", default=list(fabrics.names()))
    parser.add_argument("--friction", nargs="+", choices=VARIANTS, default=list(VARIANTS))
    parser.add_argument("--steps", type=command.positive, nargs="+", default=[50, 100])
    parser.add_argument("--cells", type=command.grid, default=(18, 6))
    parser.add_argument("--out", type=Path, default=Path("out/bias_cycles"))
    args = command.parse(parser)
    if MPI.COMM_WORLD.rank > 0:  # a strip is too small to share
        return 0
    out, right = results.folder(args.out, MPI.COMM_SELF), True
    command.say(
        f"{'fabric':8s}{'friction':>11s}{'steps':>7s}{'iterations':>12s}{'cuts':>6s}{'peak':>9s}{'back':>9s}{'again':>9s}"
    )
    for name in args.fabric:
        for variant in args.friction:
            for steps in args.steps:
                d, F, iterations, cuts, stop = run(name, variant, steps, args.cells)
                np.savetxt(
                    out / f"{Path(name).stem}_{variant}_{steps}.csv", np.column_stack([1e3 * d, F]), "%.9g", ",",
                    header="displacement_mm,force_N", comments="",
                )  # fmt: skip
                told = f"{name:8s}{variant:>11s}{steps:7d}{iterations:12.1f}{cuts:6d}"
                if stop is not None:
                    command.say(f"{told}   stopped before {1e3 * stop:.3g} mm, step {len(d)}")
                    right = False
                    continue
                n = steps // 5
                first, back, again = F[2 * n], F[3 * n], F[4 * n]
                work = np.cumsum((F[1:] + F[:-1]) / 2 * np.diff(d))
                command.say(f"{told}{first:9.3f}{back:9.3f}{again:9.3f}")
                right &= work.min() > -1e-9 and again <= first * (1 + 1e-3)
    command.say(f"check: all complete, and no energy made: {'yes' if right else 'NO'}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
