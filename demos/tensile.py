"""Cyclic tensile test of a fabric strip (thesis 7.2.1, 7.2.2): load, unload until the force is gone.

The warp lies at --angle to the load: 0 is the warp test, 90 the weft test, 45 the bias test. Where the
ends may contract, a warp or weft test must give the fabric's fitted curve (Table 7.1): that is the checked number.
Between clamps its middle third should contract by the fabric's Poisson's ratio.

As a shell that is not quite flat (--imperfection) and goes back to zero displacement (--whole) the strip buckles, as in
Figure 7-9 (c).
"""

import argparse
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics, plots, specimen
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws import named
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.output.showing import Plain
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing, yarns

STRIP = meshing.MESHES / "strip.geo"
THESIS = {"cells": (9, 3), "degree": 1}
"""The thesis's mesh, 27 bilinear elements: in bias between clamps its force is 30 % too high."""
WAYS = {0.0: "warp", 90.0: "weft", 45.0: "bias"}
GENTLE = 1e-5 * 2.0 ** np.arange(10)
"""Axial strains beyond that of the slack strip where a strip that is to buckle stops on its way back."""


@dataclass
class Case:
    """Settings of one test; angle in degrees."""

    fabric: fabrics.Fabric
    angle: float = 0.0
    law: str = named.DEFAULT
    poisson: str = "measured"
    cells: tuple[int, int] = (36, 12)
    degree: int = 2
    steps: int = 20
    ends: str = "clamped"
    reload: bool = False
    mesh: Path = STRIP
    kinematics: str = "plane"
    imperfection: float = 0.0
    whole: bool = False
    triangles: bool = False
    ramp: float | None = None
    search: str | None = None

    @property
    def displacement(self):
        """How far the end is pulled, m: Table 3.4, and 20 mm off the yarns."""
        return self.fabric.displacement[WAYS.get(self.angle, "bias")]

    def fitted(self, strain):
        """Stress (Pa) of the fabric's curve at an axial strain, for a test along a yarn; else None."""
        curve = {0.0: self.fabric.warp, 90.0: self.fabric.weft}.get(self.angle)
        return None if curve is None else curve.stress(strain)

    def poisson_ratio(self):
        """Contraction per stretch that was measured, for a test along a yarn; else None."""
        ratios = self.fabric.poisson[self.poisson]
        return {0.0: ratios[0], 90.0: ratios[1]}.get(self.angle)

    def trellis(self, strain):
        """Stress (Pa) of a bias test by Table 7.3 if the yarns turned but kept their length; else None.

        Where E11 + E22 = 0 the axial strain is E12; where the transverse stress is zero the axial one is 2 S12.
        """
        return 2 * self.fabric.shear.stress(2 * strain) if self.angle == 45.0 else None

    def path(self):
        """Displacements (m) to go through, and the number of the step at the highest."""
        path, last = [], 0.0
        for turn in [0.75, 0.70, 1.0, 0.0] if self.reload else [1.0, 0.0]:
            path += [*np.linspace(last, turn, self.steps + 1)[1:]]
            last = turn
        return np.array(path) * self.displacement, len(path) - self.steps


def strip(case, comm=MPI.COMM_WORLD):
    """The strip in its grips: unknown, solver, the law's points, a function that pulls the end, the ends' unknowns."""
    size = dict(zip(("nx", "ny"), case.cells, strict=True), length=case.fabric.gauge_length, width=case.fabric.width)
    size["triangles"] = int(case.triangles)
    gdim = 2 if case.kinematics == "plane" else 3
    domain = meshing.read(case.mesh, comm, gdim=gdim, **(size if case.mesh == STRIP else {}))
    law, angle = named.law(case.law, case.fabric, case.poisson, ramp=case.ramp), np.radians(case.angle)
    return specimen.strip(
        domain,
        case.fabric,
        law,
        angle,
        ends=case.ends,
        degree=case.degree,
        level=case.kinematics,
        imperfection=case.imperfection,
        search=case.search,
    )


def sheet(case, u, points):
    """The strip as it is recorded and drawn: its displacement, its law and its yarns."""
    mesh, angle = u.function_space.mesh, np.radians(case.angle)
    moved, dofs = u, None
    if case.kinematics == "shell":
        space, dofs = u.function_space.sub(0).collapse()
        moved = fem.Function(space)
    if case.kinematics == "plane":
        axes = yarns.plane_axes(mesh, angle)
    else:
        axes = yarns.surface_axes(mesh, (np.cos(angle), np.sin(angle), 0.0), 1)

    def displacement():
        if dofs is not None:
            moved.x.array[:] = u.x.array[dofs]
        return moved

    thickness = case.fabric.thickness if case.kinematics == "shell" else 1.0
    return Plain(displacement, points, yarns.Yarns(mesh, moved, axes), thickness)


def picture(path, case, strip, title, **more):
    """Draw a strip, coloured by its strain along the load; more: of `pictures.picture`."""
    strain, u = axial_strain(case, strip.points), strip.displacement()
    pictures.picture(path, u, strain, "axial strain (-)", title, yarns=strip.yarns(), **more)


def gentle(case, comm):
    """As `Case.path`, with small steps from where the flat strip's force is gone.

    A strip that is shortened beyond that by one long step finds the flat state or a short wave, and no way out.
    """
    path, peak = case.path()
    flat = replace(case, imperfection=0.0, steps=max(case.steps, 20))
    _, top = flat.path()
    table, _, _ = run(flat, comm=comm)
    d, force = table.column("displacement_mm")[top:] * 1e-3, table.column("force_N")[top:]
    below = np.flatnonzero(force < 0)[:2]
    if len(below) < 2:
        return path, peak  # it is slack at the very end only
    # slack yarns have one modulus: the force is linear there
    slack = d[below[0]] - force[below[0]] * np.diff(d[below])[0] / np.diff(force[below])[0]
    down, fine = path[peak:], slack - case.fabric.gauge_length * GENTLE
    fine = fine[fine > 0]
    return np.concatenate([path[:peak], down[down > slack], fine, down[down < fine.min(initial=slack)]]), peak


def run(case, out=None, comm=MPI.COMM_WORLD, progress=None, watch=None, scene=None):
    """Run a test: its table, the step at the highest load, and what stopped it (None, or a sentence).

    `watch(step, fabric)` is called after every step with the law's points; the test ends where it returns true.
    `scene` is what `strip` made for the same specimen and law, unloaded, if it is to be used again.
    """
    u, solver, fabric, pull, (fixed, pulled) = scene or strip(case, comm)
    mesh = u.function_space.mesh
    length, area = case.fabric.gauge_length, case.fabric.width * case.fabric.thickness
    middle = ufl.conditional(abs(ufl.SpatialCoordinate(mesh)[0] - length / 2) < length / 6, 1.0, 0.0)
    across = ufl.grad(ufl.split(u)[0] if case.kinematics == "shell" else u)[:, 1]
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 2 * case.degree})
    across = results.Average(across[1] + ufl.dot(across, across) / 2, middle, dx, comm)

    path, peak = gentle(case, comm) if case.imperfection and case.whole else case.path()
    shown, stopped = sheet(case, u, fabric), None

    def probes(step):
        force, d = solver.reaction(pulled), step.load / length
        return {
            "step": step.number,
            "displacement_mm": step.load * 1e3,
            "force_N": force,
            "axial_strain": d + d * d / 2,
            "axial_stress_MPa": force / area / (1 + d) / 1e6,
            "transverse_strain": across.value(),
            "imbalance_N": force + solver.reaction(fixed),
        }

    title = f"{case.fabric.name}, warp at {case.angle:g} degrees"
    with Recorder(
        shown, out, probes, title=title, when=lambda step: f"{step.load * 1e3:.4g} mm", picture=None
    ) as record:
        try:
            for step in statics.march(solver, pull, path, progress=progress):
                row = record(step)
                if out and step.number == peak:
                    picture(out / "deformed.png", case, shown, f"{title}, {step.load * 1e3:g} mm")
                if (watch and watch(step, fabric)) or (step.number > peak and row["force_N"] <= 0.0 and not case.whole):
                    break
        except StepFailed as error:
            stopped = str(error)
    if out and case.kinematics == "shell":
        height = comm.allreduce(np.abs(shown.displacement().x.array[2::3]).max(initial=0.0), MPI.MAX)
        command.say(f"  out of its plane by {height * 1e3:.3g} mm at the end")
        picture(out / "unloaded.png", case, shown, f"{case.fabric.name}, after unloading")
    return record.table, peak, stopped


def axial_strain(case, fabric):
    """Mean over each cell of the Green-Lagrange strain along the load."""
    E1, E2, gamma = fabric.strain[..., :3].mean(axis=1).T
    c, s = np.cos(np.radians(case.angle)), np.sin(np.radians(case.angle))
    return c * c * E1 + s * s * E2 - c * s * gamma


def plot(path, runs):
    """Stress against strain of some (case, table), a panel a fabric, with the fitted curves."""
    names = list(dict.fromkeys(case.fabric.name for case, _ in runs))
    columns = min(len(names), 2)
    figure, panels = plots.panels(columns, -(-len(names) // columns), width=5.0, height=3.8)
    several = len({case.law for case, _ in runs}) > 1
    for name, axes in zip(names, panels, strict=False):
        thesis = name in fabrics.names()
        for case, table in (run for run in runs if run[0].fabric.name == name):
            strain, stress = table.column("axial_strain"), table.column("axial_stress_MPa")
            strain, stress = np.insert(strain, 0, 0.0), np.insert(stress, 0, 0.0)
            look = plots.style(name, WAYS.get(case.angle, "another"))
            if several:
                look |= {"linestyle": "-" if case.law == named.DEFAULT else "--"}
            which = f", {case.law}" * several
            axes.plot(strain, stress, label=f"warp at {case.angle:g}°, {case.ends} ends{which}", **look)
            smooth = np.linspace(0.0, strain.max(), 100)
            for curve, label in (
                (case.fitted(smooth), "fitted curve" + ", Table 7.1" * thesis),
                (case.trellis(smooth), "Table 7.3, " * thesis + "yarns of constant length"),
            ):
                if curve is not None:
                    axes.plot(smooth, curve / 1e6, label=label, **plots.FITTED)
        plots.label(axes, name, "axial Green-Lagrange strain (-)", "axial stress S (MPa)", ylim=(0, None))
    plots.legend(figure, columns + 1)
    plots.save(figure, path)


def report(case, table, peak, stopped):
    """One line of the table, and whether what can be checked is right."""
    rows, force = table.rows, table.column("force_N")
    top = rows[min(peak, len(rows)) - 1]
    iterations = table.column("newton_iterations")
    up, down = iterations[:peak].mean(), iterations[peak:].mean() if len(rows) > peak else 0.0
    fitted = case.fitted(top["axial_strain"])
    difference = "" if fitted is None else f"{top['axial_stress_MPa'] / fitted * 1e8 - 100:+9.3f}"
    contraction, ratio = -top["transverse_strain"] / top["axial_strain"], case.poisson_ratio()
    narrower = f"{100 * (contraction / ratio - 1):+9.1f}" if ratio else ""
    balanced = np.abs(table.column("imbalance_N")).max() <= 1e-5 * np.abs(force).max()
    exact = case.law != "printed" and case.ends == "free" and fitted is not None
    right = balanced and not (exact and abs(top["axial_stress_MPa"] / fitted * 1e6 - 1) > 0.005)
    line = (
        f"{case.fabric.name:24s}{case.law:11s}{case.angle:6g} {case.ends:8s}{top['displacement_mm']:9.2f}"
        f"{top['axial_stress_MPa']:10.3f}{difference:>11s}{contraction:8.3f}{narrower:>10s}{up:10.1f}{down:6.1f}"
        f"{int(table.column('step_cuts').sum()):5d}{table.column('wall_s').sum():8.2f}  "
    )
    if stopped:
        return line + f"stopped at {rows[-1]['displacement_mm']:.2f} mm", right
    return line + ("force gone" if force[-1] <= 0 and not case.whole else "back at zero") + (
        "" if right else ", CHECK FAILED"
    ), right


def angles(text):
    """Angles in degrees from the command line."""
    return list(WAYS) if text == "all" else [command.number(text)]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--fabric", default="blend", help=f"{', '.join(fabrics.names())}, a TOML file, or all")
    parser.add_argument(
        "--angle", type=angles, default="0", help="degrees from the load to the warp, or all: 0, 90 and 45"
    )
    parser.add_argument("--law", nargs="+", choices=named.MEASURED, default=[named.DEFAULT], help="one or more")
    parser.add_argument("--poisson", choices=["measured", "lowered"], default="measured", help="Poisson's ratios")
    parser.add_argument("--ramp", type=command.number, help="strain over which a modulus changes after a reversal")
    parser.add_argument("--cells", type=command.grid, default="36x12", help="cells along and across the strip")
    parser.add_argument(
        "--mesh",
        type=Path,
        default=STRIP,
        help="another mesh of the strip: .geo, .msh; edges fixed_end, pulled_end, point pin",
    )
    parser.add_argument("--triangles", action="store_true", help="cells cut in two; a shell then has element regge")
    parser.add_argument("--degree", type=int, choices=[1, 2], default=2, help="degree of the displacement")
    parser.add_argument("--steps", type=command.positive, default=20, help="steps up, and as many down")
    parser.add_argument(
        "--ends",
        choices=["clamped", "free"],
        help="may the ends contract? (if left out, as the thesis: only in bias)",
    )
    parser.add_argument("--reload", action="store_true", help="go to 75, back to 70, and on to 100 %% of the way")
    parser.add_argument("--kinematics", choices=["plane", "membrane", "shell"], default="plane")
    parser.add_argument(
        "--imperfection", type=command.number, default=0.0, help="height in mm of a half wave along a shell strip"
    )
    parser.add_argument(
        "--search", choices=["energy", "newton"], help="(if left out, along the energy, if there is one)"
    )
    parser.add_argument("--whole", action="store_true", help="go back to zero displacement, past zero force")
    parser.add_argument("--out", type=Path, default=Path("out/tensile"))
    return command.parse(parser)


def main():
    args = arguments()
    names = fabrics.names() if args.fabric == "all" else [args.fabric]
    comm, right, runs = MPI.COMM_WORLD, True, []
    if args.imperfection and args.kinematics != "shell":
        raise InputError("Only a shell has a height: --imperfection goes with --kinematics shell.")
    out = results.folder(args.out)
    command.say(f"{'fabric':24s}{'law':11s}{'angle':>6s} {'ends':8s}{'up to mm':>9s}{'S MPa':>10s}{'off fit, %':>11s}"
                f"{'nu':>8s}{'off nu, %':>10s}{'Newton up':>10s}{'down':>6s}{'cuts':>5s}{'s':>8s}  end")  # fmt: skip
    for name in names:
        fabric = fabrics.load(name)
        for angle, law in product(args.angle, args.law):
            ends = args.ends or ("clamped" if angle in (0.0, 90.0) else "free")
            case = Case(
                fabric, angle, law, args.poisson, args.cells, args.degree, args.steps, ends, args.reload,
                args.mesh, args.kinematics, args.imperfection * 1e-3, args.whole, args.triangles, args.ramp,
                args.search,
            )  # fmt: skip
            tail = "" if len(args.law) == 1 else f"_{law}"
            folder = results.folder(out / f"{Path(name).stem}_{angle:g}{tail}")
            table, peak, stopped = run(case, folder, comm, progress=f"{fabric.name} {angle:g}")
            line, good = report(case, table, peak, stopped)
            command.say(line)
            if stopped and len(names) * len(args.angle) * len(args.law) == 1:
                command.say(stopped)
            # of several laws that are compared the others may stop
            must = law == named.DEFAULT or (len(args.law) == 1 and law != "printed")
            right = right and good and (stopped is None or not must)
            runs.append((case, table))
            results.on_root(comm, lambda folder=folder: plot(folder / "stress_strain.png", runs[-1:]))
    if len(runs) > 1:
        results.on_root(comm, lambda: plot(out / "stress_strain.png", runs))
    verdict = "yes" if right else "NO"
    command.say(f"check: grips in balance, cycles complete, free yarn tests on the fitted curve: {verdict}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
