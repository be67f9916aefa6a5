"""A trousers' leg on a leg that bends at the knee, and straightens again: what it costs the wearer.

    python demos/knee.py --fabric denim --ease 25 50 --film

As `elbow.py`, with the same checked numbers. The leg of the trousers is held above the knee.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

from pathlib import Path

import bending_limb

from fabric_fenicsx.app import command
from fabric_fenicsx.garments import limbs


def main():
    args = bending_limb.arguments(
        __doc__, fabric=["muslin"], ease=[25.0, 50.0], length=0.36, angle=120.0, out=Path("out/knee")
    )
    leg = limbs.leg(size=1e-3 * args.skin)
    return bending_limb.play(leg, "knee", args, MPI.COMM_WORLD)


if __name__ == "__main__":
    command.run(main)
