"""A strip of cloth overhangs the edge of a table: the bending length of ASTM D1388 and FAST-2, and angle by overhang.

Strips of several overhangs, clamped at the edge, are loaded by their weight in --steps parts. Where the line from the
edge to the free end is 41.5 degrees below the horizontal, the overhang is twice the bending length c, and a
laboratory writes B = mass x g x c^3. That holds friction and softening too; --B, --softening and --hysteresis give a
cloth by numbers.

The checked number: c^3 within 2 % of that of the elastica with the same bending law.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import bent
import numpy as np
from dolfinx import fem
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.identify.bending import elastica, hanging
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.terms import supports

WIDTH = 0.025  # m
ANGLES = (12, 25, 35, 41.5, 48, 60)  # degrees, about, of the strips


def hang(cloth, length, args):
    """Angle (radians) of a strip of this overhang (m); the sheet; Newton iterations and cuts."""
    strip = cloth.strip(length, WIDTH, args.cells, args.way)
    g = fem.Constant(strip.domain.mesh, (0.0, 0.0, 0.0))

    def put(part):
        g.value[2] = -part * bent.GRAVITY

    solver = strip.equilibrium(supports.clamp(strip.domain, strip.space, "fixed_end"), strip.weight(cloth.mass, g))
    steps = list(statics.march(solver, put, list(np.arange(1, args.steps + 1) / args.steps)))
    x, z = (supports.mean(strip.domain, strip.space, strip.q, "pulled_end", k) for k in (0, 2))
    counts = sum(step.newton_iterations for step in steps), sum(step.step_cuts for step in steps)
    return np.arctan2(-z, length + x), strip, counts


def twice_c(lengths, angles):
    """The overhang (m) at 41.5 degrees, between those that were hung."""
    angle = CubicSpline(np.log(lengths), np.log(angles))
    return np.exp(brentq(lambda x: angle(x) - np.log(hanging.ASTM_ANGLE), *np.log([lengths[0], lengths[-1]])))


def plot(path, table, beam, way, name):
    """Angle by overhang, and the elastica."""
    figure, (axes,) = plots.panels(1, width=6.0, height=4.5)
    length, angle = table.column("overhang_mm"), table.column("angle_deg")
    axes.plot(length, angle, "o", label="shell")
    L = np.linspace(0.3 * length[0], 1.1 * length[-1], 100)
    axes.plot(L, np.degrees(elastica.overhang_angle(beam, L / 1e3)), "-", label="elastica")
    axes.axhline(41.5, **plots.FITTED)
    plots.label(axes, f"{name}, {way}", "overhang (mm)", "angle below the horizontal (degrees)", ylim=(0, 90))
    plots.legend(figure, 2)
    figure.savefig(path, dpi=150)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    bent.add_arguments(parser)
    parser.add_argument("--way", choices=bent.WAYS, default="warp", help="along which the strips are cut")
    parser.add_argument(
        "--cells", type=command.positive, default=10, help="along an overhang; 8 are c/4 at 41.5 degrees"
    )
    parser.add_argument("--steps", type=command.positive, default=4, help="in which the weight comes")
    parser.add_argument("--out", type=Path, default=Path("out/cantilever"))
    return command.parse(parser)


def main():
    args = arguments()
    out, cloth = results.folder(args.out), bent.Cloth(args)
    cloth.say()
    beam = elastica.Beam(cloth.strip_curve(args.way), cloth.mass, cloth.curves.friction_per_m)
    length, drop, reach = elastica.cantilever(beam, np.radians(np.linspace(2, 85, 60)))
    with results.Table(out / "history.csv") as table:
        for L in np.interp(np.radians(ANGLES), np.arctan2(drop, reach), length):
            angle, strip, (iterations, cuts) = hang(cloth, L, args)
            expected = elastica.overhang_angle(beam, np.array([L]))[0]
            table.row(
                overhang_mm=1e3 * L, angle_deg=np.degrees(angle), elastica_deg=np.degrees(expected),
                newton_iterations=iterations, step_cuts=cuts,
            )  # fmt: skip
            command.say(f"overhang {1e3 * L:6.2f} mm: {np.degrees(angle):5.2f} degrees, the elastica "
                        f"{np.degrees(expected):5.2f}; {iterations} Newton iterations, {cuts} cuts")  # fmt: skip
            if ANGLES[len(table.rows) - 1] == 41.5:
                title = f"{cloth.name}, {args.way}: overhang {1e3 * L:.1f} mm"
                pictures.picture(
                    out / "deformed.png",
                    strip.displacement(),
                    bent.height(strip),
                    "height (mm)",
                    title,
                    view=(0.6, -2.0, 0.4),
                )
    lengths = table.column("overhang_mm") / 1e3
    c, exact = (twice_c(lengths, np.radians(table.column(f"{name}_deg"))) / 2 for name in ("angle", "elastica"))
    error = (c / exact) ** 3 - 1
    B = 1e6 * cloth.mass * bent.GRAVITY * c**3
    command.say(f"bending length {1e3 * c:.2f} mm, so that mass g c^3 = {B:.2f} uN m; by the elastica "
                f"{1e3 * exact:.2f} mm, {100 * error:+.2f} % of c^3 apart")  # fmt: skip
    if MPI.COMM_WORLD.rank == 0:
        plot(out / "angle.png", table, beam, args.way, cloth.name)
    good = abs(error) <= 0.02
    command.say(f"check: c^3 within 2 % of the elastica: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
