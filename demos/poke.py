"""The middle of a clamped sheet is pushed out by 0.40 m and back in 0.5 s (thesis 7.3.3).

2 m x 2 m, all of the rim clamped, warp along x; the middle fifth of each side (4 x 4 of the thesis's 20 x 20 elements)
moves as one rigid body, by 0.2 m (1 - cos(2 pi t / 0.5 s)). The thesis does not tell how it moved; --jerk: at constant
speed. There is no gravity. With --law svk the sheet recovers; the fabric law leaves it stretched, and so wrinkled.

Elements 207 and 271 of Figure 7-32, numbered down the columns from 1, are beside the middle in the warp and in
the weft direction: their strains and stresses are in history.csv and stress_strain.png.

The checked numbers: at most 1 % of the largest external work is not accounted for; the middle is where it was put.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import moving
import numpy as np

from fabric_fenicsx import fabrics, plots
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

MESH = meshing.MESHES / "drape.geo"
HEIGHT, TIME = 0.40, 0.5  # m, s
ELEMENTS = {"element_207": (206 % 20, 206 // 20), "element_271": (270 % 20, 270 // 20)}
"""Place in the 20 x 20 grid along warp and along weft."""


def height(t, jerk=False):
    """How far the middle is out at a time, m; it stays at rest after its way."""
    part = min(max(t / TIME, 0.0), 1.0)
    if jerk:
        return HEIGHT * (1.0 - abs(2.0 * part - 1.0))
    return HEIGHT / 2 * (1.0 - np.cos(2.0 * np.pi * part))


def probe(cloth, place):
    """Mean strain and stress (E11, E22, S11, S22 in MPa) of the cells in a square of Figure 7-32; a function."""
    mesh = cloth.domain.mesh
    owned = mesh.topology.index_map(2).size_local
    x = mesh.geometry.x[mesh.geometry.dofmaps[0][:owned]].mean(axis=1)
    inside = (np.floor(x[:, :2] / (moving.SIDE / 20) + 1e-9) == place).all(axis=1)
    count = mesh.comm.allreduce(int(inside.sum()))

    def values():
        strain, stress = (cells[:owned][inside][:, :2] for cells in (cloth.cell_strain(), cloth.cell_stress()))
        total = np.concatenate([strain, stress / 1e6], axis=1).sum(axis=0)
        return mesh.comm.allreduce(total) / max(count, 1)

    return values


def scene(args, comm=MPI.COMM_WORLD):
    """The sheet, held and ready to be pushed."""
    if args.cells % 10:
        raise InputError(f"--cells {args.cells}: take a multiple of 10, so that the middle is made of whole cells.")
    cloth, areal_mass = moving.square(MESH, args, 0.4 * moving.SIDE, comm)
    held, move = supports.grip(cloth.domain, cloth.space, "middle")
    bcs = supports.clamp(cloth.domain, cloth.space, "rim") + held
    run, ledger = moving.runner(args, cloth, areal_mass, bcs, 0, set_load=lambda t: move((0, 0, height(t, args.jerk))))
    probes = {"centre_z_m": moving.value_at(cloth, 2, "centre")}
    for name, place in ELEMENTS.items():
        values = probe(cloth, place)
        for k, column in enumerate(("E11", "E22", "S11_MPa", "S22_MPa")):
            probes[f"{name}_{column}"] = lambda values=values, k=k: values()[k]
    name = f"poke of {Path(args.fabric).stem}" + (", St. Venant-Kirchhoff" if not cloth.points else "")
    made_with = moving.settings("poke", args, way="at constant speed" if args.jerk else "smoothly")
    return moving.Scene(name, cloth, run, ledger, probes, made_with)


def plot(path, table, fabric):
    """Stress against strain along the yarn of each of the two elements, with the fitted curves."""
    figure, panels = plots.panels(2, width=5.0, height=3.8)
    for axes, (name, yarn, k) in zip(panels, (("element_207", "warp", 1), ("element_271", "weft", 2)), strict=True):
        strain, stress = table.column(f"{name}_E{k}{k}"), table.column(f"{name}_S{k}{k}_MPa")
        axes.plot(strain, stress, label=f"element, along the {yarn}", **plots.style(fabric.name, yarn))
        smooth = np.linspace(0.0, max(strain.max(), 1e-6), 100)
        fitted = getattr(fabric, yarn).stress(smooth) / 1e6
        axes.plot(smooth, fitted, label="uniaxial stress, fitted", **plots.FITTED)
        plots.label(axes, name.replace("_", " "), f"{yarn} strain E{k}{k} (-)", f"{yarn} stress S{k}{k} (MPa)")
    plots.legend(figure)
    plots.save(figure, path)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    moving.add_arguments(parser, end=TIME, rho=0.8)
    parser.add_argument("--jerk", action="store_true", help="constant speed out and back")
    parser.add_argument("--out", type=Path, default=Path("out/poke"))
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    played = scene(args)
    command.say(f"{played.name}: {played.sheet.q.function_space.dofmap.index_map.size_global} unknowns")
    table = moving.play(played, args, out, progress=True)
    fabric = fabrics.load(args.fabric)
    results.on_root(played.run.comm, lambda: plot(out / "stress_strain.png", table, fabric))
    imbalance = moving.summary(table, played.run)
    last, peak = table.rows[-1], table.column("element_207_E11").max()
    command.say(f"element 207: warp strain {peak:.4f} at most, {last['element_207_E11']:.4f} at the end")
    good = imbalance <= 1.0 and abs(last["centre_z_m"] - height(last["time_s"], args.jerk)) < 1e-9
    command.say(f"check: middle where it was put, imbalance at most 1 %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
