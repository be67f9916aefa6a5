"""Cyclic tensile test of a fabric strip (thesis 7.2.1, 7.2.2): load, unload until the force is gone.

The warp lies at --angle to the load: 0 is the warp test, 90 the weft test, 45 the bias test. Where the
ends may contract, a warp or weft test must give the fitted curve of Table 7.1: that is the checked number.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import command, fabrics, frame, hook, kinematics, meshing, results, statics, weakform
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.laws.printed import Printed
from fabric_fenicsx.laws.woven import Woven

MESHES = Path(__file__).parent.parent / "meshes"
LAWS = {"continuous": Woven, "printed": Printed}


@dataclass
class Case:
    """Settings of one test; angle in degrees."""

    fabric: fabrics.Fabric
    angle: float = 0.0
    law: str = "continuous"
    poisson: str = "measured"
    cells: tuple[int, int] = (9, 3)
    degree: int = 1
    steps: int = 20
    ends: str = "clamped"
    reload: bool = False

    @property
    def displacement(self):
        """How far the end is pulled, m: Table 3.4, and 20 mm off the yarns."""
        return self.fabric.displacement[{0.0: "warp", 90.0: "weft"}.get(self.angle, "bias")]

    def fitted(self, strain):
        """Stress (Pa) of Table 7.1 at an axial strain, for a test along a yarn; else None."""
        curve = {0.0: self.fabric.warp, 90.0: self.fabric.weft}.get(self.angle)
        return None if curve is None else curve.stress(strain)

    def path(self):
        """Displacements (m) to go through, and the number of the step at the highest."""
        path, last = [], 0.0
        for turn in [0.75, 0.70, 1.0, 0.0] if self.reload else [1.0, 0.0]:
            path += [*np.linspace(last, turn, self.steps + 1)[1:]]
            last = turn
        return np.array(path) * self.displacement, len(path) - self.steps


def strip(case, comm=MPI.COMM_WORLD):
    """The strip in its grips: unknown, solver, hook, and a function that pulls the end."""
    nx, ny = case.cells
    domain = meshing.read(MESHES / "strip.geo", comm, gdim=2, nx=nx, ny=ny,
                          length=case.fabric.gauge_length, width=case.fabric.width)  # fmt: skip
    mesh = domain.mesh
    V = fem.functionspace(mesh, ("Lagrange", case.degree, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)

    axes = frame.plane_axes(mesh, np.radians(case.angle))
    strain = kinematics.plane_strain_vector(u, axes)
    law = LAWS[case.law](case.fabric, case.poisson)
    fabric = hook.LawHook(law, strain, mesh, degree=2 * case.degree)
    h = fem.Constant(mesh, case.fabric.thickness)
    residual = weakform.internal(fabric.stress, strain, u, v, h, fabric.dx)

    def dofs(group, component):
        dim, entities = domain.entities(group)
        mesh.topology.create_connectivity(dim, mesh.topology.dim)
        return fem.locate_dofs_topological(V.sub(component), dim, entities)

    end = fem.Constant(mesh, 0.0)
    zero = fem.Constant(mesh, 0.0)
    fixed, pulled = dofs("fixed_end", 0), dofs("pulled_end", 0)
    bcs = [fem.dirichletbc(zero, fixed, V.sub(0)), fem.dirichletbc(end, pulled, V.sub(0))]
    across = ["fixed_end", "pulled_end"] if case.ends == "clamped" else ["pin"]
    bcs += [fem.dirichletbc(zero, dofs(group, 1), V.sub(1)) for group in across]

    # under displacement control a line search takes far fewer iterations past the kinks of the law
    solver = statics.StaticSolver(residual, u, bcs, [fabric], options={"snes_linesearch_type": "bt"})

    def pull(displacement):
        end.value = displacement

    return u, solver, fabric, pull, (fixed, pulled)


def run(case, out=None, comm=MPI.COMM_WORLD, progress=None):
    """Run a test: its table, the step at the highest load, and what stopped it (None, or a sentence)."""
    u, solver, fabric, pull, (fixed, pulled) = strip(case, comm)
    mesh = u.function_space.mesh
    length, area = case.fabric.gauge_length, case.fabric.width * case.fabric.thickness
    middle = ufl.conditional(abs(ufl.SpatialCoordinate(mesh)[0] - length / 2) < length / 6, 1.0, 0.0)
    across = ufl.grad(u)[:, 1]
    across = results.Average(across[1] + ufl.dot(across, across) / 2, middle, fabric.dx, comm)

    path, peak = case.path()
    with results.Table(out and out / "history.csv", comm) as table:
        fields = results.Fields(out / "fields.bp", u, ("axial_strain",)) if out else None
        try:
            for step in statics.march(solver, pull, path, progress=progress):
                force = solver.reaction(pulled)
                d = step.load / length
                table.row(
                    step=step.number,
                    displacement_mm=step.load * 1e3,
                    force_N=force,
                    axial_strain=d + d * d / 2,
                    axial_stress_MPa=force / area / (1 + d) / 1e6,
                    transverse_strain=across.value(),
                    newton_iterations=step.newton_iterations,
                    step_cuts=step.step_cuts,
                    imbalance_N=force + solver.reaction(fixed),
                    wall_s=step.wall_s,
                )
                if fields:
                    fields.write(step.number, axial_strain=axial_strain(case, fabric))
                    if step.number == peak:
                        title = f"{case.fabric.name}, warp at {case.angle:g} degrees, {step.load * 1e3:g} mm"
                        results.picture(
                            out / "deformed.png", u, axial_strain(case, fabric), "axial strain", title
                        )
                if step.number > peak and force <= 0.0:
                    break
        except StepFailed as error:
            return table, peak, str(error)
        finally:
            if fields:
                fields.close()
    return table, peak, None


def axial_strain(case, fabric):
    """Mean over each cell of the Green-Lagrange strain along the load."""
    E1, E2, gamma = fabric.strain.mean(axis=1).T
    c, s = np.cos(np.radians(case.angle)), np.sin(np.radians(case.angle))
    return c * c * E1 + s * s * E2 - c * s * gamma


def plot(path, runs):
    """Stress against strain of some (case, table), a panel a fabric, with the fitted curves."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(case.fabric.name for case, _ in runs))
    figure = Figure(
        figsize=(min(12.0, 6.0 * len(names)), 4.0 * ((len(names) + 1) // 2)), layout="constrained"
    )
    panels = figure.subplots((len(names) + 1) // 2, min(len(names), 2), squeeze=False).flat
    for name, axes in zip(names, panels, strict=False):
        for case, table in (run for run in runs if run[0].fabric.name == name):
            strain, stress = table.column("axial_strain"), table.column("axial_stress_MPa")
            strain, stress = np.insert(strain, 0, 0.0), np.insert(stress, 0, 0.0)
            color = {0.0: "C0", 90.0: "C3", 45.0: "C2"}.get(case.angle, "C4")
            axes.plot(strain, stress, ".-", color=color, label=f"warp at {case.angle:g}°, {case.ends} ends")
            if case.fitted(0.0) is not None:
                smooth = np.linspace(0.0, strain.max(), 100)
                axes.plot(smooth, case.fitted(smooth) / 1e6, "--", color="black", lw=1, zorder=0)
        axes.plot([], [], "--", color="black", lw=1, label="fitted curve, Table 7.1")
        axes.set(
            title=name, xlabel="axial Green-Lagrange strain", ylabel="axial stress S, MPa", ylim=(0, None)
        )
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=150)


def report(case, table, peak, stopped):
    """One line of the table, and whether what can be checked is right."""
    rows, force = table.rows, table.column("force_N")
    top = rows[min(peak, len(rows)) - 1]
    iterations = table.column("newton_iterations")
    up, down = iterations[:peak].mean(), iterations[peak:].mean() if len(rows) > peak else 0.0
    fitted = case.fitted(top["axial_strain"])
    difference = "" if fitted is None else f"{top['axial_stress_MPa'] / fitted * 1e8 - 100:+9.3f}"
    balanced = np.abs(table.column("imbalance_N")).max() <= 1e-5 * np.abs(force).max()
    exact = case.law == "continuous" and case.ends == "free" and fitted is not None
    right = balanced and not (exact and abs(top["axial_stress_MPa"] / fitted * 1e6 - 1) > 0.005)
    line = (
        f"{case.fabric.name:24s}{case.angle:6g} {case.ends:8s}{top['displacement_mm']:9.2f}"
        f"{top['axial_stress_MPa']:10.3f}{difference:>11s}{up:7.1f}{down:7.1f}"
        f"{int(table.column('step_cuts').sum()):5d}{table.column('wall_s').sum():8.2f}  "
    )
    if stopped:
        return line + f"stopped at {rows[-1]['displacement_mm']:.2f} mm", right
    return line + ("force gone" if force[-1] <= 0 else "back at zero") + (
        "" if right else ", CHECK FAILED"
    ), right


def angles(text):
    """Angles in degrees from the command line."""
    return [0.0, 90.0, 45.0] if text == "all" else [command.number(text)]


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument(
        "--fabric", default="blend", help=f"{', '.join(fabrics.names())}, a TOML file, or all"
    )
    parser.add_argument(
        "--angle", type=angles, default="0", help="degrees from the load to the warp, or all: 0, 90 and 45"
    )
    parser.add_argument("--law", choices=LAWS, default="continuous")
    parser.add_argument("--poisson", choices=["measured", "lowered"], default="measured")
    parser.add_argument("--cells", type=command.grid, default="9x3", help="cells along and across the strip")
    parser.add_argument("--degree", type=int, choices=[1, 2], default=1, help="degree of the displacement")
    parser.add_argument("--steps", type=command.positive, default=20, help="steps up, and as many down")
    parser.add_argument(
        "--ends",
        choices=["clamped", "free"],
        help="may the ends contract? (if left out, as the thesis: only in bias)",
    )
    parser.add_argument(
        "--reload", action="store_true", help="go to 75, back to 70, and on to 100 %% of the way"
    )
    parser.add_argument("--out", type=Path, default=Path("out/tensile"))
    return command.parse(parser)


def main():
    args = arguments()
    names = fabrics.names() if args.fabric == "all" else [args.fabric]
    comm, right, runs = MPI.COMM_WORLD, True, []
    out = results.folder(args.out)
    command.say(f"{'fabric':24s}{'angle':>6s} {'ends':8s}{'up to mm':>9s}{'S MPa':>10s}{'to fit %':>11s}"
                f"{'its up':>7s}{'down':>7s}{'cuts':>5s}{'s':>8s}  end")  # fmt: skip
    for name in names:
        fabric = fabrics.load(name)
        for angle in args.angle:
            ends = args.ends or ("clamped" if angle in (0.0, 90.0) else "free")
            case = Case(
                fabric, angle, args.law, args.poisson, args.cells, args.degree, args.steps, ends, args.reload
            )
            folder = results.folder(out / f"{Path(name).stem}_{angle:g}")
            table, peak, stopped = run(case, folder, comm, progress=f"{fabric.name} {angle:g}")
            line, good = report(case, table, peak, stopped)
            command.say(line)
            if stopped and len(names) * len(args.angle) == 1:
                command.say(stopped)
            right = right and good and (stopped is None or args.law == "printed")
            runs.append((case, table))
            if comm.rank == 0:
                plot(folder / "stress_strain.png", runs[-1:])
    if comm.rank == 0 and len(runs) > 1:
        plot(out / "stress_strain.png", runs)
    verdict = "yes" if right else "NO"
    command.say(
        f"check: grips in balance, cycles complete, free yarn tests on the fitted curve: {verdict}; see {out}"
    )
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
