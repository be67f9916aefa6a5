"""A sleeve on an arm that bends at the elbow, and straightens again: what it costs the wearer.

    python demos/elbow.py --fabric soft --ease -10 --friction 0
    python demos/elbow.py --fabric muslin denim --ease 25 50 --film
    python demos/elbow.py --fabric soft --thickness 3 --ease -20 --stretch 50 --length 0.36 --angle 90 --cell 12
    python demos/elbow.py --fabric soft --thickness 5 --friction 0 --angle 30 --about 25 5 --cell 12 --converge

A compression sleeve is drawn along the arm (--stretch), so that it stays taut on the inside of the bend, up to some 85
degrees, and no fold forms there. The moment is that against which the wearer bends; its work over the angle is stored
in the cloth, lost in it and to friction, or released where folds snap. A fold that is not much longer than a cell is
the mesh's, and so is the moment: how long folds are is told, and --converge does it again on half the cells. The
checked numbers: nothing passes through the skin; the work of the moment is that of all forces over the ways of the skin
(1 %); at most 1 % of it is more than the wearer has put in, or, without friction and hysteresis, is lost but for the
snaps.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

from pathlib import Path

import bending_limb

from fabric_fenicsx.app import command
from fabric_fenicsx.garments import limbs


def main():
    args = bending_limb.arguments(
        __doc__, fabric=["muslin"], ease=[25.0, 50.0], length=0.24, angle=120.0, out=Path("out/elbow")
    )
    arm = limbs.arm(size=1e-3 * args.skin)
    return bending_limb.play(arm, "elbow", args, MPI.COMM_WORLD)


if __name__ == "__main__":
    command.run(main)
