"""Biaxial stretch of a square sheet, 1:1 (thesis 7.3.1, Figures 7-29, 7-30): up, and down until no force is left.

The sheet of 25.4 cm, warp along x, is stretched by 3 cm both ways. The thesis calls that the maximum
displacement; here it is the whole extension of a side, E = 0.125: with twice that the weft would leave its
measured range. Each edge moves along its normal and is free along itself. The checked number is the stress,
which must be that of a material point taken along the same strains; and opposite edges must balance.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import numpy as np
from dolfinx import fem
from simple_shear import plane

from fabric_fenicsx import fabrics, plots
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws import driver, named
from fabric_fenicsx.output import results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.output.showing import Plain
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing

MESH = meshing.MESHES / "square.geo"
SIDE = 0.254  # m


def run(fabric, law, steps=20, displacement=0.03, out=None, cells=4, mesh=MESH, comm=MPI.COMM_WORLD):
    """Run a cycle: its table, the relative errors of stress and balance, what stopped it (None, or a sentence)."""
    domain = meshing.read(mesh, comm, gdim=2, **({"side": SIDE, "n": cells} if mesh == MESH else {}))
    u, sheet, residual, yarns = plane(domain.mesh, law, fabric.thickness)
    V = u.function_space

    still, pulled = fem.Constant(domain.mesh, 0.0), fem.Constant(domain.mesh, 0.0)
    edge, bcs = {}, []
    for name, normal, value in ("left", 0, still), ("right", 0, pulled), ("bottom", 1, still), ("top", 1, pulled):
        edge[name] = fem.locate_dofs_topological(V.sub(normal), *domain.entities(name))
        bcs.append(fem.dirichletbc(value, edge[name], V.sub(normal)))
    # far below the tolerance of the check
    solver = statics.StaticSolver(residual, u, bcs, rtol=1e-10, options={"snes_linesearch_type": "bt"})

    def pull(d):
        pulled.value = d

    up = displacement * np.linspace(0.0, 1.0, steps + 1)
    path = np.concatenate([up[1:], up[-2::-1]])
    E = path / SIDE + (path / SIDE) ** 2 / 2
    point = driver.run(law, np.stack([E, E, 0 * E], axis=1)).stress
    S = sheet.stress.ref_coefficient
    stress_error, force_error, stopped = 0.0, 0.0, None

    area = SIDE * fabric.thickness

    def probes(step):
        force = {name: solver.reaction(dofs) for name, dofs in edge.items()}
        expected, strain, stretch = point[step.number - 1], E[step.number - 1], 1 + step.load / SIDE
        return {
            "step": step.number,
            "displacement_mm": step.load * 1e3,
            "force_N": force["right"],
            "axial_strain": strain,
            "axial_stress_MPa": force["right"] / area / stretch / 1e6,
            "transverse_strain": strain,
            "transverse_stress_MPa": force["top"] / area / stretch / 1e6,
            "transverse_force_N": force["top"],
            "point_axial_stress_MPa": expected[0] / 1e6,
            "point_transverse_stress_MPa": expected[1] / 1e6,
            "imbalance_N": max(abs(force["left"] + force["right"]), abs(force["bottom"] + force["top"])),
        }

    with Recorder(
        Plain(lambda: u, sheet.points, yarns), out, probes, title=f"{fabric.name}, 1:1 biaxial",
        when=lambda step: f"{step.load * 1e3:g} mm", colour="warp", picture=steps,
    ) as record:  # fmt: skip
        try:
            for step in statics.march(solver, pull, path, progress=out and f"{fabric.name} biaxial"):
                row = record(step)
                expected = point[step.number - 1]
                difference = comm.allreduce(np.abs(S.x.array.reshape(-1, 3) - expected).max(initial=0.0), MPI.MAX)
                stress_error, force_error = max(stress_error, difference), max(force_error, row["imbalance_N"])
                if step.number > steps and max(row["force_N"], row["transverse_force_N"]) <= 0.0:
                    break
        except StepFailed as error:
            stopped = str(error)
    table = record.table
    force = np.abs([table.column(name) for name in ("force_N", "transverse_force_N")]).max(initial=1e-300)
    return table, stress_error / np.abs(point).max(), force_error / force, stopped


def end_of_force(table, name, steps):
    """Strain of the step down at which a force is gone, as text."""
    for row in table.rows[steps:]:
        if row[name] <= 0.0:
            return f"{row['axial_strain']:.4f}"
    return "-"


def plot(path, runs):
    """Warp and weft stress against strain of some (fabric, table), next to the fitted curves of Table 7.1."""
    figure, panels = plots.panels(len(runs), width=5.0, height=4.4)
    for axes, (fabric, table) in zip(panels, runs, strict=True):
        strain = np.insert(table.column("axial_strain"), 0, 0.0)
        smooth = np.linspace(0.0, strain.max(), 100)
        for yarn, name, marker in ("warp", "axial", "."), ("weft", "transverse", "x"):
            look = plots.style(fabric.name, yarn) | {"marker": marker, "ms": 4}
            stress = np.insert(table.column(f"{name}_stress_MPa"), 0, 0.0)
            axes.plot(strain, stress, label=f"{yarn}, 1:1 biaxial strain", **look)
            fitted = getattr(fabric, yarn).stress(smooth) / 1e6
            axes.plot(smooth, fitted, label="uniaxial stress, fitted", **plots.FITTED)
        axes.axhline(0.0, color="0.6", lw=0.8, zorder=0)
        plots.label(axes, fabric.name, "Green-Lagrange strain $E_{11} = E_{22}$ (-)", "stress S (MPa)")
    plots.legend(figure)
    plots.save(figure, path)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument(
        "--fabric", nargs="+", default=["blend", "denim"], help=f"of {', '.join(fabrics.names())}, or TOML files"
    )
    parser.add_argument("--law", choices=named.MEASURED, default="continuous")
    parser.add_argument("--poisson", choices=["measured", "lowered"], default="measured")
    parser.add_argument("--displacement", type=command.number, default=30.0, help="extension of a side, mm")
    parser.add_argument("--cells", type=command.positive, default=4, help="cells along a side")
    parser.add_argument("--steps", type=command.positive, default=20, help="steps up, and as many down")
    parser.add_argument("--mesh", type=Path, default=MESH, help="another mesh of a square of 254 mm, edges named alike")
    parser.add_argument("--out", type=Path, default=Path("out/biaxial"))
    return command.parse(parser)


def main():
    args = arguments()
    if args.displacement <= 0.0:
        raise InputError(f"--displacement {args.displacement:g} must be a positive extension in mm, such as 30.")
    out, right, runs, worst = results.folder(args.out), True, [], np.zeros(2)
    command.say(f"{'fabric':12s}{'E':>7s}{'warp MPa':>10s}{'x fit':>7s}{'weft MPa':>10s}{'x fit':>7s}"
                f"{'its':>5s}{'cuts':>5s}{'s':>7s}  no force at E (warp, weft)")  # fmt: skip
    for name in args.fabric:
        fabric = fabrics.load(name)
        folder = results.folder(out / Path(name).stem)
        law = named.law(args.law, fabric, args.poisson)
        table, *errors, stopped = run(fabric, law, args.steps, args.displacement * 1e-3, folder, args.cells, args.mesh)
        top = table.rows[min(args.steps, len(table.rows)) - 1]
        warp, weft, E = top["axial_stress_MPa"], top["transverse_stress_MPa"], top["axial_strain"]
        gone = [end_of_force(table, name, args.steps) for name in ("force_N", "transverse_force_N")]
        command.say(
            f"{fabric.name:12s}{E:7.4f}{warp:10.3f}{warp / fabric.warp.stress(E) * 1e6:7.2f}{weft:10.3f}"
            f"{weft / fabric.weft.stress(E) * 1e6:7.2f}{table.column('newton_iterations').mean():5.1f}"
            f"{table.column('step_cuts').sum():5d}{table.column('wall_s').sum():7.2f}  {stopped or ', '.join(gone)}"
        )
        worst = np.maximum(worst, errors)
        right = right and max(errors) <= 1e-8 and not (stopped and args.law != "printed")
        runs.append((fabric, table))
        results.on_root(MPI.COMM_WORLD, lambda folder=folder: plot(folder / "stress_strain.png", runs[-1:]))
    if len(runs) > 1:
        results.on_root(MPI.COMM_WORLD, lambda: plot(out / "stress_strain.png", runs))
    command.say(
        f"check: stress that of a material point to {worst[0]:.0e}, opposite edges in balance to {worst[1]:.0e}, "
        f"relative: {'yes' if right else 'NO'}; see {out}"
    )
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
