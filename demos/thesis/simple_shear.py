"""Cyclic simple shear of nine elements (thesis 7.2.2): --cycle sign is Figure 7-27, reload is Figure 7-28.

The whole edge of a square sheet, warp along x, is moved by u = (g y, 0), so that 2 E12 = g. Simple shear
also stretches the weft, E22 = g^2/2 whichever way it goes, so that S22 rises along with the S12 of the
figures. The checked number is the stress: at every point that of a material point taken along the same
strains, and in balance with the forces on the edges, P = F S.

The printed law seldom gets through, and is not held to this: E11 stays zero, so that the sign of a round-off
error decides whether its warp loads or unloads, and the sheet may break into patches.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np
import ufl
from dolfinx import fem

from fabric_fenicsx import fabrics, plots
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws import driver, named
from fabric_fenicsx.output import results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.output.showing import Plain
from fabric_fenicsx.shell import kinematics
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing, yarns
from fabric_fenicsx.terms import hook, weakform

MESH = meshing.MESHES / "square.geo"
SIDE = 0.0254  # m


def cycle_path(cycle, fabric, amplitude, steps):
    """Shears to go through: over zero and back, or unloading by half of the stress on the way up."""
    turns = [amplitude, -amplitude, amplitude]
    if cycle == "reload":
        first = 0.75 * amplitude
        turns = [first, first - fabric.shear.stress(first) / fabric.shear.unloading / 2, first, amplitude]
    legs = pairwise([0.0, *turns])
    return np.concatenate([np.linspace(a, b, max(5, 1 + round(steps * abs(b - a) / amplitude)))[1:] for a, b in legs])


def plane(mesh, law, thickness):
    """A sheet in the plane, warp along x: displacement, the law's hook, residual, and its yarns to be drawn."""
    V = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    axes = yarns.plane_axes(mesh, 0.0)
    strain = kinematics.membrane_strain(u, axes)
    sheet = hook.LawHook(law, strain, mesh, degree=2)
    return u, sheet, weakform.internal(sheet.stress, strain, u, v, thickness, sheet.dx), yarns.Yarns(mesh, u, axes)


def run(fabric, law, cycle="sign", steps=20, amplitude=0.4, out=None, mesh=MESH, comm=MPI.COMM_WORLD):
    """Run a cycle: its table, the relative errors of stress and force, what stopped it (None, or a sentence)."""
    domain = meshing.read(mesh, comm, gdim=2, **({"side": SIDE, "n": 3} if mesh == MESH else {}))
    u, sheet, residual, yarns = plane(domain.mesh, law, fabric.thickness)
    V = u.function_space

    moved, edge = fem.Function(V), {}
    for name in "bottom", "right", "top", "left":
        dim, facets = domain.entities(name)
        edge[name] = [fem.locate_dofs_topological(V.sub(i), dim, facets) for i in (0, 1)]
    _, facets = zip(*map(domain.entities, edge), strict=True)
    bcs = [fem.dirichletbc(moved, fem.locate_dofs_topological(V, dim, np.concatenate(facets)))]
    # far below the tolerance of the check
    solver = statics.StaticSolver(residual, u, bcs, rtol=1e-10, options={"snes_linesearch_type": "bt"})

    def shear(g):
        moved.interpolate(lambda x: (g * x[1], 0 * x[1]))

    path = cycle_path(cycle, fabric, amplitude, steps)
    point = driver.run(law, np.stack([0 * path, path**2 / 2, path], axis=1)).stress
    S = sheet.stress.ref_coefficient
    means = [results.Average(S[i], ufl.as_ufl(1.0), sheet.dx, comm) for i in range(3)]
    stress_error, force_error, stopped, peak = np.zeros(3), 0.0, None, np.argmax(path) + 1

    def probes(step):
        g, expected = step.load, point[step.number - 1]
        # forces on the edges with the normals x and y, from P = F S with F = [[1, g], [0, 1]]
        S11, S22, S12 = (mean.value() for mean in means)
        P = np.array([[1.0, g], [0.0, 1.0]]) @ [[S11, S12], [S12, S22]] * SIDE * fabric.thickness
        wanted = {"right": P[:, 0], "left": -P[:, 0], "top": P[:, 1], "bottom": -P[:, 1]}
        force = {name: np.array([*map(solver.reaction, dofs)]) for name, dofs in edge.items()}
        return {
            "step": step.number,
            "displacement_mm": g * SIDE * 1e3,
            "force_N": force["top"][0],
            "axial_strain": 0.0,
            "axial_stress_MPa": S11 / 1e6,
            "transverse_strain": g * g / 2,
            "transverse_stress_MPa": S22 / 1e6,
            "shear_strain_E12": g / 2,
            "shear_stress_MPa": S12 / 1e6,
            "point_shear_stress_MPa": expected[2] / 1e6,
            "imbalance_N": max(np.abs(force[name] - wanted[name]).max() for name in edge),
        }

    with Recorder(
        Plain(lambda: u, sheet.points, yarns), out, probes, title=f"{fabric.name}, simple shear",
        when=lambda step: f"2 E12 = {step.load:.3g}", colour="shear", picture=peak,
    ) as record:  # fmt: skip
        try:
            for step in statics.march(solver, shear, path, progress=out and f"{fabric.name} shear"):
                row, expected = record(step), point[step.number - 1]
                difference = np.abs(S.x.array.reshape(-1, 3) - expected).max(axis=0, initial=0.0)
                stress_error = np.max([stress_error, *comm.allgather(difference)], axis=0)
                force_error = max(force_error, row["imbalance_N"])
        except StepFailed as error:
            stopped = str(error)
    table = record.table
    stress_error = (stress_error / np.abs(point).max(axis=0)).max()
    return table, stress_error, force_error / np.abs(table.column("force_N")).max(initial=1e-300), stopped


def plot(path, fabric, table, law):
    """S12 against 2 E12, with the loading curve of Table 7.3."""
    gamma = np.insert(2 * table.column("shear_strain_E12"), 0, 0.0)
    stress = np.insert(table.column("shear_stress_MPa"), 0, 0.0)
    smooth = np.linspace(gamma.min(), gamma.max(), 201)
    figure, (axes,) = plots.panels(1, width=5.5, height=4.4)
    look = plots.style(fabric.name, "warp")
    axes.plot(gamma, stress, label=f"sheet of nine elements, {law} law", **look)
    fitted = np.sign(smooth) * fabric.shear.stress(np.abs(smooth)) / 1e6
    axes.plot(smooth, fitted, label="loading curve, Table 7.3", **plots.FITTED)
    axes.axhline(0.0, color="0.6", lw=0.8, zorder=0)
    plots.label(axes, fabric.name, "shear strain $2 E_{12}$ (-)", "shear stress $S_{12}$ (MPa)")
    plots.legend(figure)
    plots.save(figure, path)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--fabric", default="blend", help=f"{', '.join(fabrics.names())}, or a TOML file")
    parser.add_argument(
        "--cycle", choices=["sign", "reload"], default="sign", help="change sign, or unload a little and reload"
    )
    parser.add_argument("--law", choices=named.MEASURED, default="continuous")
    parser.add_argument("--poisson", choices=["measured", "lowered"], default="measured")
    parser.add_argument("--steps", type=command.positive, default=20, help="steps for a shear of the amplitude")
    parser.add_argument("--amplitude", type=command.number, default=0.4, help="largest shear 2 E12")
    parser.add_argument(
        "--mesh", type=Path, default=MESH, help="another mesh of a square of 25.4 mm, edges named alike"
    )
    parser.add_argument("--out", type=Path, default=Path("out/simple_shear"))
    return command.parse(parser)


def main():
    args = arguments()
    if args.amplitude <= 0.0:
        raise InputError(f"--amplitude {args.amplitude:g} must be a positive shear 2 E12, such as 0.4.")
    fabric = fabrics.load(args.fabric)
    out = results.folder(args.out / f"{Path(args.fabric).stem}_{args.cycle}")
    law = named.law(args.law, fabric, args.poisson)
    table, stress_error, force_error, stopped = run(fabric, law, args.cycle, args.steps, args.amplitude, out, args.mesh)
    if table.rows:
        results.on_root(MPI.COMM_WORLD, lambda: plot(out / "stress_strain.png", fabric, table, args.law))
    S12, S22 = table.column("shear_stress_MPa"), table.column("transverse_stress_MPa")
    command.say(
        f"{fabric.name}, {args.law}: {len(S12)} steps, {table.column('newton_iterations').mean():.1f} Newton "
        f"iterations a step, {table.column('step_cuts').sum()} cuts, {table.column('wall_s').sum():.2f} s; S12 from "
        f"{S12.min():.4g} to {S12.max():.4g} MPa, S22 up to {S22.max():.4g} MPa"
    )
    if stopped:
        command.say(stopped)
    right = stress_error <= 1e-8 and force_error <= 1e-8 and not stopped
    verdict = "yes" if right else "NO" if args.law != "printed" else "not asked of the printed law"
    command.say(
        f"check: stress that of a material point to {stress_error:.0e}, forces on the edges P = F S to "
        f"{force_error:.0e}, relative: {verdict}; see {out}"
    )
    return 1 if verdict == "NO" else 0


if __name__ == "__main__":
    command.run(main)
