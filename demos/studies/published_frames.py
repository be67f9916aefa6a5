"""Published picture frames: first and third shearing of three fabrics by the law, and a bias test predicted from one.

    demos/studies/published_frames.py cycles   how well friction and softening describe both, for several turning points
    demos/studies/published_frames.py bias     the plain weave's bias extension, predicted from its frame by strips of
                                               12 x 6, 16 x 8 and 20 x 10 cells

The data are those of the benchmark of Cao et al. (2008), in demos/records/cao2008: openings alone, 1 to 44 degrees. How
far the frame went before it turned back is not said; it counts, since the law meets its first curve again there. So a
few are tried. Yarns of the strip are linear and as stiff as is said, for no test of them was published; a tenth is
tried beside.

The checked numbers: with the best turning point both shearings within 1 % (rms) of the peak of the first, from 1 degree
on; bias: the forces of the two finest meshes within 3 % of each other. How far the prediction is from the test, which
another laboratory made, is told, not checked.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from fabric_fenicsx import fabrics, plots
from fabric_fenicsx.app import command
from fabric_fenicsx.identify.files import records
from fabric_fenicsx.identify.shear import cycles
from fabric_fenicsx.identify.tensile import curves, simulated
from fabric_fenicsx.identify.tensile.curves import Readings
from fabric_fenicsx.laws import play
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing

DATA = Path(__file__).parents[1] / "records" / "cao2008"
THICKNESS = {"plain": 1.2e-3, "balanced": 2.0e-3, "unbalanced": 3.3e-3}
BEYOND = (0.0, 2.0, 5.0, 8.0)  # degrees, from the last reading to where the frame turned back
BIAS = records.Strip(0.230, 0.115, THICKNESS["plain"])
YARNS = 1e6  # N/m, stiffness of the cloth along its yarns
CELLS = ((12, 6), (16, 8), (20, 10))


def published(name):
    """E12 and S12 (Pa) of the first and of the third shearing."""
    rows = np.loadtxt(DATA / f"{name}.csv", delimiter=",", skiprows=4)
    return [(np.sin(np.radians(a)) / 2, 1e3 * F / THICKNESS[name]) for a, F in
            (rows[rows[:, 0] == k, 1:].T for k in (1, 3))]  # fmt: skip


def fit(name, beyond):
    """The curve of shear and its friction, root mean squares of both shearings over the peak, and both by the law."""
    (E1, S1), (E3, S3) = published(name)
    turn = np.sin(np.arcsin(2 * E1[-1]) + np.radians(beyond)) / 2
    E = np.concatenate([[0.0], E1, [turn, 0.0, turn, 0.0], E3])
    S = np.concatenate([[np.nan], S1, [np.nan] * 4, S3])
    start = curves.loading([Readings(name, E1, S1)])
    steepest = float(start.tangent(np.linspace(0, start.limit, 101)).max())
    found = cycles.fit([(E, S)], start, steepest)
    modulus = tuple(c / 2 ** (k + 1) for k, c in enumerate(found.loading.modulus))
    curve = fabrics.Curve(modulus, found.unloading[0] / 2, 2 * found.loading.limit)
    law = play.follow(2 * E, play.pack(name, curve, found.friction))
    first, third = law[1 : len(E1) + 1], law[-len(E3) :]
    seen = [np.degrees(np.arcsin(2 * one)) >= 1 for one in (E1, E3)]
    rms = [
        float(np.sqrt(np.mean((one - S)[some] ** 2))) / S1.max()
        for one, S, some in ((first, S1, seen[0]), (third, S3, seen[1]))
    ]
    return curve, found.friction, rms, (first, third)


def study_cycles(out):
    """Prints a table, draws the best; whether it is good."""
    right = True
    figure, panels = plots.panels(3, width=3.5, height=3.2)
    command.say(
        f"{'fabric':12s}" + "".join(f"   +{b:g} deg" + " " * 6 for b in BEYOND) + "  (rms, % of the first peak)"
    )
    for name, axes in zip(THICKNESS, panels, strict=True):
        several = [fit(name, beyond) for beyond in BEYOND]
        told = "".join(f"{100 * rms[0]:7.2f} {100 * rms[1]:5.2f}  " for _, _, rms, _ in several)
        command.say(f"{name:12s}{told}")
        best = min(several, key=lambda one: max(one[2]))
        right &= max(best[2]) < 0.01
        for k, ((E, S), law, style) in enumerate(zip(published(name), best[3], ("k", "C0"), strict=True)):
            angle, force = np.degrees(np.arcsin(2 * E)), 1e-3 * THICKNESS[name]
            axes.plot(angle, force * S, ".", color=style, ms=3, label=("first", "third")[k])
            axes.plot(angle, force * law, "-", color=style, lw=1, label=f"{('first', 'third')[k]}, law")
        plots.label(axes, name, "shear angle (deg)", "normalised shear force (N/mm)")
    plots.legend(figure, 4)
    plots.save(figure, out / "cycles.png")
    return right


def cloth(stiffness, shearing):
    """The plain weave with yarns of a stiffness in N/m, as first sheared, or as in its third shearing (no friction)."""
    h, (_, (E, S)) = THICKNESS["plain"], published("plain")
    if shearing == "first":
        curve, friction, _, _ = fit("plain", 8.0)
    else:
        found, friction = curves.loading([Readings("plain", E, S)]), None
        modulus = tuple(c / 2 ** (k + 1) for k, c in enumerate(found.modulus))
        steepest = float(found.tangent(np.linspace(0, found.limit, 101)).max()) / 2
        curve = fabrics.Curve(modulus, steepest, 2 * found.limit)
    along = fabrics.Curve((stiffness / h, 0.0), stiffness / h, 0.01)
    return replace(
        fabrics.load("blend"), name="plain", warp=along, weft=along, shear=curve, shear_friction=friction, thickness=h,
        density=0.743 / h, poisson={"measured": (0.0, 0.0)},
    )  # fmt: skip


def study_bias(out):
    """Prints the forces at a few displacements, draws them; whether the meshes agree."""
    d, *tests = np.loadtxt(DATA / "plain_bias.csv", delimiter=",", skiprows=4).T
    pulled = np.linspace(0, 40e-3, 21)[1:]
    figure, (axes,) = plots.panels(1, width=5.0, height=4.0)

    def told(name, force):
        command.say(f"{name:40s}" + "".join(f"{f:7.2f}" for f in force[4::5]) + "   N")

    command.say(f"{'':40s}" + "".join(f"{1e3 * x:7.0f}" for x in pulled[4::5]) + "   mm")
    for lab, force, mark in zip(("HKUST", "INSA and NU"), tests, ("k.", "kx"), strict=True):
        axes.plot(d, force, mark, ms=3, label=f"published, {lab}")
        told(f"published, {lab}", np.interp(1e3 * pulled, d, force))
    forces = []
    first = [(cells, YARNS, "first") for cells in CELLS]
    for cells, stiffness, shearing in [*first, (CELLS[-1], YARNS / 10, "first"), (CELLS[-1], YARNS, "third")]:
        S = simulated.strips(meshing.MESHES / "strip.geo", cells)(cloth(stiffness, shearing), BIAS, np.pi / 4, pulled)
        forces.append(S * BIAS.area * (1 + pulled / BIAS.gauge_length))
        name = f"{shearing} shearing, {cells[0]} x {cells[1]}, {stiffness / 1e3:g} kN/m"
        told(name, forces[-1])
        axes.plot(1e3 * pulled, forces[-1], "-" if stiffness == YARNS else "--", lw=1, label=name)
    plots.label(axes, "bias extension of the plain weave", "displacement (mm)", "force (N)", ylim=(0, 35))
    plots.legend(figure, 2)
    plots.save(figure, out / "bias.png")
    test = np.interp(1e3 * pulled, d, tests[0])
    for name, force in (("first", forces[2]), ("third", forces[4])):
        rms = float(np.sqrt(np.mean((force - test) ** 2))) / test.max()
        command.say(f"by the {name} shearing: {100 * rms:.0f} % (rms) of the largest force from HKUST's test")
    return bool(np.abs(forces[1] - forces[2]).max() < 0.03 * forces[2].max())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("what", choices=["cycles", "bias"])
    parser.add_argument("--out", type=Path, default=Path("out/published_frames"))
    args = command.parse(parser)
    if MPI.COMM_WORLD.rank > 0:  # nothing here is large enough to share
        return 0
    out = results.folder(args.out, MPI.COMM_SELF)
    right = study_cycles(out) if args.what == "cycles" else study_bias(out)
    command.say(f"check: {'yes' if right else 'NO'}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
