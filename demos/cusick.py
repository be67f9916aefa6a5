"""Cusick's drape test: a disc of cloth of 300 mm, clamped between two discs of 180 mm, is lowered and hangs in folds.

The drape coefficient is the shadow of what hangs, in percent of the ring that there would be if the cloth did not bend.
The cloth is flat but for waves of random height and phase, which its --seed draws. Its weight comes over 0.6 s, as if
it was lowered slowly, and damping brings it to rest. Which folds it gets is not unique, as in the laboratory: mean and
spread of several --seeds are told. The free ring is held where the discs end; with --contact the cloth goes on between
them, to a pin of 80 mm, and lies on the lower disc and under the upper one, which it touches with friction.

The checked numbers: at most 1 % of the largest external work is not accounted for, and the drape coefficient does not
change by more than 1 point in the last tenth of the time.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import time
from pathlib import Path

import bent
import moving
import numpy as np
import touching
from dolfinx import fem
from scipy.signal import find_peaks

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.output.solids import drawn
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

PIN, DISC, SPECIMEN = 0.04, 0.09, 0.15  # radii, m
LOWERED = 0.6  # s
THICK = 0.01  # of the discs, m
WAVES = 24
RAYS = np.arange(360) / 360 * 2 * np.pi
FOLD = 0.003  # m, by which a fold sticks out at least


def ring(args, seed):
    """The free part of the specimen, waved; with contact, all around the pin."""
    inner = PIN if args.contact else DISC
    domain = moving.read(
        meshing.MESHES / "ring.geo", args.element, MPI.COMM_WORLD, inner=inner, outer=SPECIMEN,
        nx=max(1, round((SPECIMEN - inner) / (1e-3 * args.cell))),
        ny=max(1, round(np.pi * (SPECIMEN + DISC) / 4 / (1e-3 * args.cell))),
    )  # fmt: skip
    touching.wave(domain, DISC, SPECIMEN, 1e-3 * args.imperfection, seed, WAVES)
    return domain


def outline(cloth):
    """Radius (m) of the shadow along `RAYS`, the farthest edge of any cell; on rank 0, None elsewhere."""
    u = cloth.displacement()
    shape = pictures.shape(u, cloth.cell_strain())
    if shape is None:
        return None
    cells = shape.cells.reshape(len(shape.values), -1)[:, 1:]
    corners = cells[:, : 4 if cells.shape[1] in (4, 9) else 3]
    a = (shape.points + shape.moved)[corners, :2].reshape(-1, corners.shape[1], 2)
    a, b = a.reshape(-1, 2), np.roll(a, -1, axis=1).reshape(-1, 2)
    out = np.empty(len(RAYS))
    for k, (c, s) in enumerate(zip(np.cos(RAYS), np.sin(RAYS), strict=True)):
        across_a, across_b = s * a[:, 0] - c * a[:, 1], s * b[:, 0] - c * b[:, 1]
        crossed = across_a * across_b <= 0
        t = across_a[crossed] / np.where(across_a == across_b, 1.0, across_a - across_b)[crossed]
        along = (1 - t) * (a[crossed] @ (c, s)) + t * (b[crossed] @ (c, s))
        out[k] = max(along.max(initial=0.0), DISC)
    return out


def drape_coefficient(radii):
    """Percent of the ring that lies in the shadow."""
    return 100 * (np.mean(radii**2) - DISC**2) / (SPECIMEN**2 - DISC**2)


def folds(radii):
    """How many folds stick out, and the mean of their radii (m)."""
    start = int(np.argmin(radii))  # so that no fold is cut in two
    peaks, _ = find_peaks(np.append(np.roll(radii, -start), radii[start]), prominence=FOLD)
    return len(peaks), float(np.roll(radii, -start)[peaks].mean()) if len(peaks) else float(radii.mean())


def between(cloth, h, args):
    """Contact with both discs, which press on the cloth from half of the reach away; None without."""
    if not args.contact:
        return None
    from fabric_fenicsx.contact import bodies
    from fabric_fenicsx.contact.contact import Contact

    away = 1.5 * h + THICK / 2
    discs = [bodies.Cylinder(DISC, THICK, (0, 0, z), cells=args.around, name=name)
             for name, z in (("table", -away), ("cover", away))]  # fmt: skip
    return Contact(cloth, discs, friction=args.friction, reach=h, stiffness=args.stiffness, creep=1e-4)


def drape(args, material, seed, out):
    """Run one seed to the end: outline on rank 0, coefficients over time, the ledger, the sheet and its contact."""
    cloth = material.sheet(ring(args, seed), (1.0, 0.0, 0.0))
    g = fem.Constant(cloth.domain.mesh, (0.0, 0.0, 0.0))
    weight, bcs = cloth.weight(material.mass, g), supports.clamp(cloth.domain, cloth.space, "inner")
    touch = between(cloth, material.fabric.thickness, args)
    loads = weight if touch is None else [weight, *touch.terms]
    # full steps: cloth that does not stretch needs 5 iterations a step so, 11 with a search along each correction
    options = {"snes_linesearch_type": "basic"}
    run, ledger = cloth.newmark(
        material.mass, bcs, loads, rho=args.rho, damping=args.damping, set_load=bent.lowering(g, LOWERED), rtol=1e-3,
        options=options,
    )  # fmt: skip

    def probes(step):
        radii = outline(cloth)
        coefficient = None if radii is None else drape_coefficient(radii)
        return {"time_s": step.load, "drape_coefficient": cloth.domain.mesh.comm.bcast(coefficient)}

    marks = {"fabric": material.name, "seed": seed} | {k: v for k, v in vars(args).items() if k not in ("out", "end")}
    with Recorder(
        cloth,
        out,
        probes,
        title=f"{material.name}, seed {seed}",
        run=run,
        marks=marks,
        picture=None,
        every=8,
        touch=touch,
    ) as record:
        for step in run.march(args.end, 1e-3 * args.step, progress=f"seed {seed}"):
            record(step)
    return outline(cloth), record.table, ledger, cloth, touch


def plot(path, title, outlines):
    """Outlines in the plane, with disc and specimen."""
    figure, (axes,) = plots.panels(1, width=6.0, height=6.0)
    for radius, look in ((DISC, "k-"), (SPECIMEN, "k:")):
        axes.plot(1e3 * radius * np.cos(RAYS), 1e3 * radius * np.sin(RAYS), look, lw=1)
    for k, (label, radii) in enumerate(outlines.items()):
        closed = np.append(RAYS, 0.0)
        look = plots.series(k) | {"marker": None}
        axes.plot(*(1e3 * np.append(radii, radii[0]) * f(closed) for f in (np.cos, np.sin)), label=label, **look)
    axes.set_aspect("equal")
    plots.label(axes, title, "along the warp (mm)", "along the weft (mm)")
    plots.legend(figure, 3)
    figure.savefig(path, dpi=150)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    bent.add_arguments(parser)
    parser.add_argument("--cell", type=command.above_zero, default=10.0, help="mm; below half a bending length")
    parser.add_argument("--seeds", type=command.positive, default=1, help="how many, from --seed on")
    parser.add_argument("--seed", type=int, default=0, help="of the waves")
    parser.add_argument("--imperfection", type=command.above_zero, default=1.0, help="height of the waves, mm")
    parser.add_argument("--step", type=command.above_zero, default=12.5, help="ms")
    parser.add_argument("--end", type=command.above_zero, default=1.0, help="s")
    parser.add_argument("--damping", type=command.number, default=25.0, help="a of Rayleigh's a M, 1/s")
    parser.add_argument("--rho", type=command.number, default=0.0, help="left of the fastest oscillation after a step")
    touch = parser.add_argument_group("contact")
    touch.add_argument("--contact", action="store_true", help="the discs are bodies, and the cloth touches itself")
    touch.add_argument("--friction", type=command.number, default=0.3, help="coefficient")
    touch.add_argument("--stiffness", type=command.above_zero, default=1e3, help="Pa")
    touch.add_argument("--around", type=command.positive, default=20, help="cells along a quarter of a disc")
    parser.add_argument("--out", type=Path, default=Path("out/cusick"))
    args = command.parse(parser)
    if args.end <= LOWERED:
        raise InputError(f"--end {args.end:g}: the cloth is lowered until {LOWERED:g} s; take more.")
    return args


def main():
    args, comm = arguments(), MPI.COMM_WORLD
    out, material = results.folder(args.out), bent.Cloth(args)
    material.say()
    found, outlines, good = [], {}, True
    for seed in range(args.seed, args.seed + args.seeds):
        folder, clock = results.folder(out / f"seed{seed}"), time.process_time()
        radii, table, ledger, cloth, touch = drape(args, material, seed, folder)
        seconds = time.process_time() - clock
        DC, t = table.column("drape_coefficient"), table.column("time_s")
        moved = np.ptp(DC[t >= 0.9 * args.end - 1e-9])
        iterations, cuts = (table.column(name).sum() for name in ("newton_iterations", "step_cuts"))
        imbalance = 100 * ledger.worst / max(ledger.most, 1e-300)
        number, far = comm.bcast(folds(radii) if comm.rank == 0 else None)
        found.append((DC[-1], number))
        good &= imbalance <= 1.0 and moved <= 1.0 and (touch is None or touching.passed(table))
        command.say(
            f"seed {seed}: drape coefficient {DC[-1]:.1f} %, {number} folds to {1e3 * far:.0f} mm; {len(t)} steps of "
            f"{iterations / len(t):.1f} Newton iterations, {cuts:g} cuts, {seconds:.1f} s of processor; imbalance "
            f"{imbalance:.2f} %, moved by {moved:.2f} points at the end"
        )
        title = f"drape coefficient {DC[-1]:.1f} %, {number} folds"
        pictures.picture(folder / "deformed.png", cloth.displacement(), bent.height(cloth), "height (mm)", title,
                         bodies=drawn(touch))  # fmt: skip
        if comm.rank == 0:
            outlines[f"seed {seed}: {DC[-1]:.1f} %, {number} folds"] = radii
            np.savetxt(folder / "outline.csv", np.column_stack([np.degrees(RAYS), 1e3 * radii]), "%.6g", ",",
                       header="angle_deg,radius_mm", comments="")  # fmt: skip
    if comm.rank == 0:
        plot(out / "outline.png", material.name, outlines)
    if len(found) > 1:
        DC, number = np.array(found).T
        command.say(f"mean of {len(DC)} seeds: {DC.mean():.1f} %, {number.mean():.1f} folds; standard deviation of the "
                    f"drape coefficient {DC.std(ddof=1):.1f} points")  # fmt: skip
    command.say(f"check: imbalance at most 1 %, at rest to 1 point: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
