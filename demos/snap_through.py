"""Hinged roofs that snap through under a load at the middle, followed by arc length (Sze, Liu and Lo 2004, 3.8).

A shallow cylindrical panel with hinged straight edges and free curved ones. The thick roof's load falls and
rises again; the thin one's deflection goes back as well, so that neither load nor displacement could
be prescribed. A quarter is computed, with its two planes of symmetry.

The checked numbers: the largest load of the first rise within 1 % of the published one; all points of the
published table within 1 % of the path (of 3000 N and of the table's largest deflection); supports in
balance with the load.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import csv
from pathlib import Path

import numpy as np
from dolfinx import fem
from scipy.interpolate import CubicSpline

from fabric_fenicsx import plots, sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.shell import directors
from fabric_fenicsx.solvers import continuation
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports
from fabric_fenicsx.terms import weakform as wf

RADIUS, LENGTH, ANGLE = 2.54, 0.254, 0.1  # m, half length in m, half angle in radians
E, NU = 3102.75e6, 0.3
HIGHEST = 3000.0  # N, where the table ends
FIRST = {12.7: 100.0, 6.35: 50.0}  # thickness in mm -> N of the first step


def published(thickness_mm):
    """Load (N) and deflection (mm) of the published table."""
    with open(Path(__file__).parents[1] / "tests" / "data" / f"sze2004_3.8_hinged_roof_{thickness_mm:g}mm.csv") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return np.array([[HIGHEST * float(row["P_over_Pmax"]), float(row["minus_W_C"])] for row in rows])


class Roof:
    """A quarter of the roof: its unknown q = (u, d), solver, load, and what is read off."""

    def __init__(self, thickness, cells, element=None, comm=MPI.COMM_WORLD):
        kind, (_, degree), *_ = directors.ELEMENTS[element or "regge"]
        self.domain = domain = meshing.read(
            meshing.MESHES / "cylinder.geo", comm, radius=RADIUS, length=LENGTH, angle=np.degrees(ANGLE),
            nx=cells, ny=cells, order=degree, triangles=int(kind == "triangle"),
        )  # fmt: skip
        G = E / 2 / (1 + NU)
        law = StVenantKirchhoff.isotropic(E, NU)
        self.sheet = shell = sheet.Sheet(domain, law, thickness, (G, G), warp=(0, 1, 0), element=element)
        self.space, self.q = shell.space, shell.q
        self._load = fem.Constant(domain.mesh, (0.0, 0.0, 0.0))
        load = wf.point_force(self._load, shell.v, supports.over(domain, "A", degree=1))
        bcs = (
            supports.hinge(domain, shell.space, "side")
            + supports.symmetry(domain, shell.space, "top", axis=0)
            + supports.symmetry(domain, shell.space, "middle", axis=1)
        )
        self.solver = shell.equilibrium(bcs, load)
        self._held = supports.unknowns(domain, shell.space, "side", 2)

    def put(self, load):
        """Load of the whole roof in N."""
        self._load.value[2] = -load / 4

    def deflection(self):
        """Under the load, m; to be called on every rank."""
        return -supports.mean(self.domain, self.space, self.q, "A", 2)

    def support(self):
        """Upward force of the supports of the whole roof, N."""
        return 4 * self.solver.reaction(self._held)

    def picture(self, path, title):
        """Draw the quarter, coloured by its deflection."""
        u = self.q.sub(0).collapse()
        deflection = fem.Function(fem.functionspace(u.function_space.mesh, ("DG", 0)))
        deflection.interpolate(fem.Expression(-1e3 * u[2], deflection.function_space.element.interpolation_points))
        pictures.picture(path, u, deflection.x.array, "deflection (mm)", title)


def run(roof, first, out=None, longest=4e-4, steps=500):
    """Follow the path until the load is beyond the table; its table, and what stopped it (None, or a sentence)."""

    def probes(step):
        state = {"load_N": step.load, "deflection_mm": 1e3 * roof.deflection(), "support_N": roof.support()}
        return {"step": step.number} | state

    with Recorder(
        roof.sheet, out, probes, title="hinged roof", when=lambda s: f"{s.load:.0f} N", picture=None
    ) as record:
        try:
            for step in continuation.arc_length(roof.solver, roof.put, first, longest=longest):
                record(step)
                if step.load >= HIGHEST or step.number == steps:
                    break
        except StepFailed as error:
            return record.table, str(error)
    if out:
        roof.picture(out / "deformed.png", f"snapped through, {step.load:.0f} N")
    return record.table, None if step.load >= HIGHEST else f"{steps} steps were not enough"


def limit(load):
    """Largest load of the first rise."""
    falls = np.flatnonzero(np.diff(load) < 0)
    return load[falls[0]] if len(falls) else load[-1]


def smooth(path):
    """The path between its steps, too: rows of load (N) and deflection (mm) on a cubic spline."""
    scaled = path / np.ptp(path, axis=0)
    along = np.insert(np.cumsum(np.linalg.norm(np.diff(scaled, axis=0), axis=1)), 0, 0.0)
    return CubicSpline(along, path)(np.linspace(0.0, along[-1], 100 * len(path)))


def farthest(path, reference):
    """Largest distance of the points of the reference from the path, as far as it goes.

    Both are rows of load and deflection; in fractions of `HIGHEST` and of the largest deflection of the reference.
    """
    scale = np.array([HIGHEST, reference[:, 1].max()])
    points = reference[reference[:, 0] <= path[-1, 0]]
    return max(np.linalg.norm((path - point) / scale, axis=1).min() for point in points)


def plot(path, runs):
    """Load against deflection of some (thickness, rows), with the published tables."""
    figure, (axes,) = plots.panels(1, width=6.5, height=5.0)
    for k, (thickness, rows) in enumerate(runs):
        look = plots.series(k)
        axes.plot(rows[:, 1], rows[:, 0], label=f"{thickness:g} mm, arc length", **look | {"marker": None})
        reference = published(thickness)
        name = f"{thickness:g} mm, Sze, Liu and Lo 2004"
        axes.plot(reference[:, 1], reference[:, 0], label=name, **look | {"linestyle": "", "mfc": "none"})
    axes.axhline(0.0, color="black", lw=0.8)
    plots.label(axes, "Hinged roof under a load at its middle", "deflection under the load (mm)", "load (N)")
    plots.legend(figure, 2)
    plots.save(figure, path)


def thicknesses(text):
    """One of the published thicknesses in mm, or all of them."""
    chosen = [h for h in FIRST if text in ("all", f"{h:g}")]
    if not chosen:
        raise argparse.ArgumentTypeError(f"{text} is none of {', '.join(map(str, FIRST))} and not all")
    return chosen


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--thickness", type=thicknesses, default="all", help="mm: 12.7, 6.35 or all")
    parser.add_argument("--cells", type=command.positive, default=16, help="along each side of the quarter")
    parser.add_argument("--element", choices=directors.ELEMENTS, help="the default is that of triangles")
    parser.add_argument(
        "--longest", type=command.above_zero, default=0.4, help="longest step in mm; the check needs short ones"
    )
    parser.add_argument("--out", type=Path, default=Path("out/snap_through"))
    return command.parse(parser)


def main():
    args, comm, runs, right = arguments(), MPI.COMM_WORLD, [], True
    out = results.folder(args.out)
    command.say(f"{'mm':>6s}{'limit N':>9s}{'published':>10s}{'%':>7s}{'lowest N':>9s}{'table %':>8s}{'steps':>6s}"
                f"{'its':>5s}{'cuts':>5s}{'s':>8s}")  # fmt: skip
    for thickness in args.thickness:
        folder = results.folder(out / f"{thickness:g}mm")
        roof = Roof(thickness * 1e-3, args.cells, args.element, comm)
        table, stopped = run(roof, FIRST[thickness], folder, args.longest * 1e-3)
        load, deflection, its, cuts, wall = (
            table.column(name) for name in ("load_N", "deflection_mm", "newton_iterations", "step_cuts", "wall_s")
        )
        rows, known = np.vstack([[0.0, 0.0], np.column_stack([load, deflection])]), published(thickness)
        curve = smooth(rows)
        top, expected, distance = limit(curve[:, 0]), limit(known[:, 0]), farthest(curve, known)
        lowest, error = curve[np.argmax(np.diff(curve[:, 0]) < 0) :, 0].min(), top / expected - 1
        balanced = np.abs(table.column("support_N") - load).max() <= 1e-5 * HIGHEST
        command.say(f"{thickness:6g}{top:9.1f}{expected:10.1f}{error * 100:7.2f}{lowest:9.1f}{distance * 100:8.2f}"
                    f"{len(load):6d}{its.sum():5.0f}{cuts.sum():5.0f}{wall.sum():8.1f}")  # fmt: skip
        if stopped:
            command.say(stopped)
        right = right and not stopped and balanced and abs(error) <= 0.01 and distance <= 0.01
        runs.append((thickness, rows))
        results.on_root(comm, lambda: plot(out / "load_deflection.png", runs))
    verdict = "yes" if right else "NO"
    command.say(f"check: limit loads and paths within 1 % of the published ones, in balance: {verdict}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
