"""One material point of a fabric, without a mesh: its cycles, what its numbers cost, what it gives back.

Draws uniaxial cycles along warp, weft and in bias with the printed and the continuous law, and prints

- what the ramp of the modulus after a reversal costs: stress of a cycle against a ramp of 1e-5;
- how much energy the worst closed strain loop makes that a short search finds, and as a part of what is stored at its
  peak. The measured coupling has no potential, so that round a loop in the plane of E11 and E22 a fabric can do work;
  with the reciprocal coupling it has one as long as both yarns keep their modulus.

The checked number: uniaxial stress along warp and weft is the fitted curve of Table 7.1.
"""

import argparse
from pathlib import Path

import closed_loops
import numpy as np
from mpi4py import MPI

from fabric_fenicsx import fabrics, plots
from fabric_fenicsx.app import command
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.printed import Printed
from fabric_fenicsx.laws.woven import RAMP, Woven
from fabric_fenicsx.output import results


def cycle(limit, steps):
    """Strains up to a limit, down to zero, and a little beyond the limit again."""
    return np.concatenate([np.linspace(*ends, steps + 1)[1:] for ends in ((0, limit), (limit, 0), (0, 1.1 * limit))])


def ramp_error(fabric, ramp, steps=400):
    """Largest difference of the warp stress of a cycle with this ramp and one of 1e-5, over the peak."""
    strain = np.zeros((3 * steps, 3))
    strain[:, 0] = cycle(fabric.warp.limit, steps)
    strain[:, 1] = -fabric.poisson["measured"][0] * strain[:, 0]
    fine, wide = (driver.run(Woven(fabric, ramp=w), strain).stress[:, 0] for w in (1e-5, ramp))
    return np.abs(fine - wide).max() / fine.max()


def plot(path, fabric, steps=40):
    """Uniaxial cycles of both laws, three panels."""
    figure, panels = plots.panels(3, height=3.8)
    for axes, (title, angle, limit) in zip(
        panels,
        (("warp", 0.0, fabric.warp.limit), ("weft", 90.0, fabric.weft.limit), ("bias", 45.0, 0.2)),
        strict=True,
    ):
        for law, look in (
            (Printed(fabric), {"color": "0.4", "marker": "x", "linestyle": "", "ms": 4}),
            (Woven(fabric), plots.style(fabric.name) | {"linestyle": "-", "marker": None}),
        ):
            label = "law as printed" if isinstance(law, Printed) else "continuous law"
            try:
                found = driver.uniaxial(law, cycle(limit, steps)[: 2 * steps], angle=np.radians(angle))
            except Exception as error:
                axes.plot([], [], label=f"{label}: stopped", **look)
                command.say(f"  {label}, {title}: {str(error)[:110]}")
                continue
            axes.plot(found.strain[:, 0], found.stress[:, 0] / 1e6, label=label, **look)
        plots.label(axes, f"{fabric.name}, {title}", "axial Green-Lagrange strain (-)", "axial stress S (MPa)")
    plots.legend(figure)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fabric", default="all", help=f"{', '.join(fabrics.names())}, a TOML file, or all (default)")
    parser.add_argument("--out", type=Path, default=Path("out/material_point"))
    args = command.parse(parser)
    out, comm = results.folder(args.out), MPI.COMM_WORLD
    right = True
    with results.Table(out / "material_point.csv", comm) as table:
        command.say(f"{'':24s}{'ramp error, % of peak':>33s}{'a loop makes, measured':>28s}{'reciprocal':>19s}")
        command.say(
            f"{'fabric':24s}{RAMP:11g}{2 * RAMP:11g}{5 * RAMP:11g}"
            + f"{'kJ/m3':>18s}{'ratio':>10s}"
            + f"{'kJ/m3':>10s}{'ratio':>9s}"
        )
        for name in fabrics.names() if args.fabric == "all" else [args.fabric]:
            fabric = fabrics.load(name)
            errors = [ramp_error(fabric, k * RAMP) for k in (1, 2, 5)]
            made = {
                kind: closed_loops.worst(Woven(fabric, coupling=kind), trials=300, generations=8, parts=150)
                for kind in ("measured", "reciprocal")
            }
            command.say(
                f"{fabric.name:24s}" + "".join(f"{100 * e:11.2f}" for e in errors)
                + f"{made['measured']['created_kJ_per_m3']:18.2f}{made['measured']['share']:10.2f}"
                + f"{made['reciprocal']['created_kJ_per_m3']:10.2f}{made['reciprocal']['share']:9.2f}"
            )  # fmt: skip
            row = {f"ramp_{k * RAMP:g}_error": e for k, e in zip((1, 2, 5), errors, strict=True)}
            for kind, loop in made.items():
                row |= {f"{kind}_made_kJ_per_m3": loop["created_kJ_per_m3"], f"{kind}_ratio": loop["share"]}
            table.row(**row)
            for yarn, curve in ((0, fabric.warp), (1, fabric.weft)):
                uniaxial = driver.uniaxial(Woven(fabric), np.array([0.3, 1.0]) * curve.limit, direction=yarn)
                right &= bool(np.allclose(uniaxial.stress[:, yarn], curve.stress(uniaxial.strain[:, yarn]), rtol=1e-9))
            if comm.rank == 0:
                plot(out / f"{Path(name).stem}.png", fabric)
    command.say(f"check: uniaxial stress is the fitted curve: {'yes' if right else 'NO'}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
