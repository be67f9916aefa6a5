"""Statics that used to stop: downhill along the energy (`solvers.descent`) and by Newton's method alone, side by side.

Sheets that start flat with nothing to hold them out of their plane, a square airbag in one load, a cantilever of muslin
under its weight and strips that buckle, of a law with a potential; a tube that is pinched until it snaps; strips in
the plane between clamps, pulled and let go until the force is nearly gone. For both ways the table gives Newton
iterations, those of failed tries included, cuts, the largest height on the way (of strips in the plane, how far they
move across) and, of the end, the lowest eigenvalue of K v = lambda M v (M: see `solvers.pivots`), which is positive
where it is stable.

    python demos/studies/stable_statics.py
    python demos/studies/stable_statics.py --only buckled --search energy --kicks 5

With --kicks every case runs again from starts that are moved at random, by 1e-12 m or --size: where heights differ by
more than 1e-6 of them, there are several stable states, which are named, and a run ends in one of them.

The checked numbers: downhill every case is complete, and ends where no eigenvalue is negative.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import fem

from fabric_fenicsx import fabrics, sheet, specimen
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import results
from fabric_fenicsx.shell import directors
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.solvers.descent import StableSolver
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

SQUARE, STRIP = meshing.MESHES / "square.geo", meshing.MESHES / "strip.geo"
RIM = ("left", "right", "bottom", "top")


class Case(NamedTuple):
    """What is solved, what loads it, loads, and what tells how far the sheet is out of its plane (m)."""

    solver: statics.StaticSolver
    put: object
    loads: object
    height: object


def elastic(side, n, E, nu, h, kinematics="shell"):
    """A square sheet of triangles."""
    domain = meshing.read(SQUARE, MPI.COMM_WORLD, side=side, n=n, triangles=1)
    law, G = StVenantKirchhoff.isotropic(E, nu), E / 2 / (1 + nu)
    return sheet.Sheet(domain, law, h, (G, G), kinematics=kinematics, element=None)


def case(cloth, bcs, loads, load, steps, search, rtol=1e-6):
    """A case of a sheet; `load` is a Constant."""
    solver = cloth.equilibrium(bcs, loads, rtol=rtol, search=search)
    return Case(solver, lambda value: setattr(load, "value", value), steps, lambda: highest(cloth))


def highest(cloth):
    """Largest displacement across, m."""
    z = np.abs(cloth.displacement().x.array[2::3]).max(initial=0.0)
    return cloth.domain.mesh.comm.allreduce(float(z), MPI.MAX)


def flat(search, kinematics, follows=False, n=8):
    """A square of 1 m, clamped or hinged all around, under 100 Pa at once."""
    cloth = elastic(1.0, n, 1e8, 0.3, 1e-3, kinematics)
    p = fem.Constant(cloth.domain.mesh, 0.0)
    work = weakform.pressure(p, cloth.u, cloth.v, cloth.dx) if follows else p * cloth.v[2] * cloth.dx
    bcs = [bc for edge in RIM for bc in supports.clamp(cloth.domain, cloth.space, edge)]
    return case(cloth, bcs, work, p, [100.0], search)


def airbag(search, n=8, loads=(5e3,)):
    """A quarter of one sheet of a square airbag, 0.84 m a side, flat at first; its edges stay in their plane."""
    cloth = elastic(0.42, n, 588e6, 0.4, 0.6e-3)
    domain, space = cloth.domain, cloth.space
    p = fem.Constant(domain.mesh, 0.0)
    bcs = supports.symmetry(domain, space, "left", 0) + supports.symmetry(domain, space, "bottom", 1)
    bcs += [bc for edge in ("right", "top") for bc in supports.lead(domain, space, edge, 2, 0.0)]
    return case(cloth, bcs, weakform.pressure(p, cloth.u, cloth.v, cloth.dx), p, list(loads), search)


def cantilever(search, fabric="muslin", steps=12, nx=20):
    """A strip of 100 mm x 25 mm, clamped at one end, under its weight: it hangs down."""
    cloth_of = fabrics.load(fabric)
    domain = meshing.read(STRIP, MPI.COMM_WORLD, gdim=3, length=0.1, width=0.025, nx=nx, ny=2, triangles=0)
    G = cloth_of.shear.modulus[0]
    cloth = sheet.Sheet(domain, Potential(cloth_of), cloth_of.thickness, (G, G), element="mitc4")
    g = fem.Constant(domain.mesh, 0.0)
    weight = cloth.weight(cloth_of.density * cloth_of.thickness, ufl.as_vector((0.0, 0.0, -9.81 * g)))
    bcs = supports.clamp(domain, cloth.space, "fixed_end")
    return case(cloth, bcs, weight, g, list(np.arange(1, steps + 1) / steps), search)


def buckled(search, fabric="blend", way=18e-3, steps=12):
    """A strip of 254 mm x 76.2 mm, 0.1 mm out of its plane, is pushed together and pulled back."""
    cloth_of = fabrics.load(fabric)
    domain = meshing.read(STRIP, MPI.COMM_WORLD, gdim=3, length=0.254, width=0.0762, nx=24, ny=8, triangles=0)
    strip = specimen.strip(domain, cloth_of, Potential(cloth_of), level="shell", imperfection=1e-4, search=search)
    there = -way * np.arange(1, steps + 1) / steps
    space = strip.u.function_space
    dofs = np.array(space.sub(0).collapse()[1]).ravel()

    def height():
        return domain.mesh.comm.allreduce(float(np.abs(strip.u.x.array[dofs][2::3]).max(initial=0.0)), MPI.MAX)

    return Case(strip.solver, strip.pull, [*there, *there[-2::-1], 0.0], height)


def clamped(search, fabric, poisson=None, back=0.88, cells=(36, 12), steps=5):
    """A strip in the plane, of quadratic cells, is pulled along its warp and comes back to a part of the way.

    poisson: both ratios, in place of those of the fabric.
    """
    cloth = fabrics.load(fabric)
    if poisson:
        cloth = replace(cloth, poisson={"measured": (poisson, poisson)})
    size = dict(zip(("nx", "ny"), cells, strict=True), length=cloth.gauge_length, width=cloth.width, triangles=0)
    domain = meshing.read(STRIP, MPI.COMM_WORLD, gdim=2, **size)
    strip = specimen.strip(domain, cloth, Potential(cloth), degree=2, search=search)
    path = np.r_[np.linspace(0.0, 1.0, steps + 1)[1:], np.linspace(1.0, back, steps + 1)[1:]]

    def across():
        return domain.mesh.comm.allreduce(float(np.abs(strip.u.x.array[1::2]).max(initial=0.0)), MPI.MAX)

    return Case(strip.solver, strip.pull, list(cloth.displacement["warp"] * path), across)


def pinched(search, element="regge", n=16):
    """A tube on rigid diaphragms, pinched at two points in the published load steps (Sze 2004, 3.6): an octant."""
    cell, (_, degree), *_ = directors.ELEMENTS[element]
    domain = meshing.read(meshing.MESHES / "cylinder.geo", MPI.COMM_WORLD, gdim=3, triangles=int(cell == "triangle"),
                          radius=100.0, length=100.0, angle=90, nx=n, ny=n, order=degree)  # fmt: skip
    E, nu = 30e3, 0.3
    G = E / 2 / (1 + nu)
    law = StVenantKirchhoff.isotropic(E, nu)
    cloth = sheet.Sheet(domain, law, 1.0, (G, G), warp=(0, 1, 0), element=element)
    space = cloth.space
    bcs = [bc for k, line in enumerate(("top", "middle", "side")) for bc in supports.symmetry(domain, space, line, k)]
    bcs += [bc for k in (0, 2) for bc in supports.lead(domain, space, "end", k, 0.0)]
    P = fem.Constant(domain.mesh, 0.0)
    push = weakform.point_force(P * ufl.as_vector((0.0, 0.0, -1.0)), cloth.v, supports.over(domain, "A", 0))
    loads = 3000.0 * np.r_[0.05:0.176:0.025, 0.2:1.01:0.05]
    return case(cloth, bcs, push, P, list(loads), search)


CASES = {
    "shell, dead load": lambda search: flat(search, "shell"),
    "shell, pressure": lambda search: flat(search, "shell", True),
    "membrane, dead load": lambda search: flat(search, "membrane"),
    "membrane, pressure": lambda search: flat(search, "membrane", True),
    "airbag": airbag,
    "cantilever of muslin": cantilever,
    "buckled strip of blend": buckled,
    "buckled strip of denim": lambda search: buckled(search, "denim"),
    "buckled strip of duck": lambda search: buckled(search, "duck"),
    "buckled strip of muslin": lambda search: buckled(search, "muslin"),
    "clamped, nu nu = 0.99": lambda search: clamped(search, "blend", np.sqrt(0.99)),
    "clamped muslin, fine": lambda search: clamped(search, "muslin", back=0.81, cells=(54, 18)),
    "pinched tube, regge": pinched,
    "pinched tube, mitc4": lambda search: pinched(search, "mitc4", 32),
}


def run(name, search, kick=None, size=1e-12, **more):
    """A row of the table; kick: seed of a random move of the start by a size (m); more: for the case."""
    scene = CASES[name](search, **more)
    solver = scene.solver
    if kick is not None:
        start = np.random.default_rng(kick).standard_normal(len(solver.u.x.array))
        free = np.setdiff1d(solver.displacements, solver._given)
        solver.u.x.array[free] += size * start[free]
    taken, failed, top = [], "", 0.0
    try:
        for step in statics.march(solver, scene.put, scene.loads):
            taken.append(step)
            top = max(top, scene.height())
    except StepFailed as error:
        failed = str(error).split(":")[0]
    lowest = solver.lowest()[0] if isinstance(solver, StableSolver) and not failed and solver.descends else np.nan
    return {
        "steps": len(taken),
        "of": len(scene.loads),
        "iterations": sum(step.newton_iterations for step in taken),
        "cuts": sum(step.step_cuts for step in taken),
        "height_m": top,
        "lowest": lowest,
        "negative": solver.negative if isinstance(solver, StableSolver) else -1,
    } | ({"failed": failed} if failed else {})


def states(rows):
    """The heights of some runs, each told once."""
    groups = []
    for row in sorted(rows, key=lambda row: row["height_m"]):
        if not groups or row["height_m"] > groups[-1][-1]["height_m"] * (1 + 1e-6):
            groups.append([])
        groups[-1].append(row)
    told = "; ".join("{height_m:.8g} m, lowest eigenvalue {lowest:.3g}".format(**g[0]) + f" ({len(g)})" for g in groups)
    return f"one state, {told}" if len(groups) == 1 else f"{len(groups)} stable states: {told}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", help="cases whose names hold this word")
    parser.add_argument("--search", choices=["energy", "newton"], nargs="+", default=["energy", "newton"])
    parser.add_argument("--kicks", type=command.positive, help="more runs of each, from a start moved a little")
    parser.add_argument("--size", type=command.number, default=1e-12, help="of these moves, m")
    parser.add_argument("--out", type=Path, default=Path("out/stable_statics"))
    args = command.parse(parser)
    good = True
    with results.Table(results.folder(args.out) / "cases.csv", MPI.COMM_WORLD) as table:
        for number, name in enumerate(CASES):
            if args.only and args.only not in name:
                continue
            for search in args.search:
                row = run(name, search)
                failed = row.pop("failed", "")
                table.row(case=number, energy=int(search == "energy"), **row)
                said = "{steps:2d} of {of:2d} steps, {iterations:4d} iterations, {cuts:2d} cuts".format(**row)
                end = failed or "height {height_m:.6g} m, lowest eigenvalue {lowest:.3g}".format(**row)
                command.say(f"{name:24s} {search:6s} {said}; {end}")
                good &= search == "newton" or (not failed and row["negative"] == 0)
            if args.kicks:
                kicked = [run(name, "energy", seed, args.size) for seed in range(args.kicks)]
                command.say(f"{name:24s} from {args.kicks} starts: {states(kicked)}")
    command.say(f"check: downhill all cases end in a stable state: {'yes' if good else 'NO'}; see {args.out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
