"""A square sheet falls from rest, held at its four corners (thesis 7.3.2), with the whole law or parts of it.

2 m x 2 m, horizontal at first, warp along x. It is pinned at points, or over squares in its corners (--patch), since
at points the sag of a sheet without bending stiffness has no limit under refinement.

The two methods agree on one mesh if the mass of both is lumped, and the implicit steps are short:

    python demos/drape.py --cells 20 --patch 0.1 --method explicit --out out/explicit
    python demos/drape.py --cells 20 --patch 0.1 --lumped --step 1.25 --against out/explicit/history.csv

The checked numbers: the centre falls freely until the wave from the corners is there, 9.81 t^2/2 at 0.1 s to 0.3 %; and
at most 1 % of the external work is not accounted for. With --against, the heights of the centre at 0.1, 0.2 ... s
differ by at most 1 % of the largest sag.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import csv
from pathlib import Path

import moving
import numpy as np
import ufl

from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

MESH = meshing.MESHES / "drape.geo"
G = 9.81


def scene(args, comm=MPI.COMM_WORLD):
    """The sheet, held and loaded, ready to fall."""
    if not 0 <= args.patch < moving.SIDE / 2:
        raise InputError(
            f"--patch {args.patch:g} is not from 0 (points) to less than half the side, {moving.SIDE / 2:g} m."
        )
    cloth, areal_mass = moving.square(MESH, args, args.patch or moving.SIDE / args.cells, comm)
    weight = cloth.weight(areal_mass, ufl.as_vector((0.0, 0.0, -G)))
    bcs = supports.hinge(cloth.domain, cloth.space, "corner_patches" if args.patch else "corners")
    run, ledger = moving.runner(args, cloth, areal_mass, bcs, weight)
    probes = {"centre_z_m": moving.value_at(cloth, 2, "centre")}
    name, made_with = f"drape of {Path(args.fabric).stem}", moving.settings("drape", args, patch=args.patch)
    return moving.Scene(name, cloth, run, ledger, probes, made_with)


def history(path):
    """Times in s and heights of the centre in m of another run."""
    try:
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
        return tuple(np.array([float(row[name]) for row in rows or [{}]]) for name in ("time_s", "centre_z_m"))
    except OSError as error:
        raise InputError(
            f"--against {path} cannot be read ({error.strerror}); give the history.csv of a drape."
        ) from None
    except (KeyError, ValueError, TypeError):
        raise InputError(
            f"--against {path} has no columns time_s and centre_z_m; give the history.csv of a drape."
        ) from None


def apart(one, other):
    """Largest difference of two histories at 0.1, 0.2 ... s, in percent of the first one's largest sag."""
    sag, worst = np.abs(one[1]).max(), 0.0
    for at in np.arange(0.1, one[0][-1] + 1e-9, 0.1):
        rows = [np.flatnonzero(np.abs(t - at) < 1e-9) for t, _ in (one, other)]
        if not all(map(len, rows)):
            raise InputError(f"One of the two runs has no row at {at:.1f} s; take another --step or --end.")
        z = [heights[row[0]] for (_, heights), row in zip((one, other), rows, strict=True)]
        command.say(f"centre at {at:.1f} s: {z[0]:.4f} m, there {z[1]:.4f} m, {100 * (z[0] - z[1]) / sag:+.2f} % apart")
        worst = max(worst, 100 * abs(z[0] - z[1]) / sag)
    return worst


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    moving.add_arguments(parser, end=0.5, rho=0.8)
    parser.add_argument("--patch", type=command.number, default=0.0, help="side of the squares that are held, m")
    parser.add_argument("--against", type=Path, help="history.csv of another run, to be compared with")
    parser.add_argument("--out", type=Path, default=Path("out/drape"))
    return command.parse(parser)


def main():
    args = arguments()
    other = history(args.against) if args.against else None
    out = results.folder(args.out)
    played = scene(args)
    command.say(f"{played.name}: {played.sheet.q.function_space.dofmap.index_map.size_global} unknowns")
    table = moving.play(played, args, out, progress=True)
    imbalance = moving.summary(table, played.run)
    fall = [row["centre_z_m"] for row in table.rows if abs(row["time_s"] - 0.1) < 1e-9]
    missed = abs(fall[0] / (-G * 0.1**2 / 2) - 1) if fall else 0.0
    command.say(f"centre at {table.rows[-1]['centre_z_m']:.4f} m")
    if fall:
        command.say(f"free fall at 0.1 s missed by {100 * missed:.3f} %")
    good, checks = imbalance <= 1.0 and missed <= 0.003, "free fall to 0.3 %, imbalance at most 1 %"
    if other:
        good &= apart((table.column("time_s"), table.column("centre_z_m")), other) <= 1.0
        checks += ", at most 1 % of the sag apart"
    command.say(f"check: {checks}: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
