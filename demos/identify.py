"""From test records to a fabric and back: is a known fabric found again?

`fabric-fenicsx identify tests.toml` identifies your own fabric. Here synthetic records are made of a known one, with
2 % noise and three specimens of each test; it is identified again, and the curves must come back. As if nobody had
photographed the yarns of the bias test, --shear inverse finds the shear curve by which a simulated strip pulls like the
measured one, and --shear net takes the strip for a net of inextensible yarns.
"""

import argparse
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fabric_fenicsx import fabrics
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify import making
from fabric_fenicsx.identify.synthetic import synthetic
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing

STRIP = meshing.MESHES / "strip.geo"
ACCEPTED = {"warp_curve": 3.0, "weft_curve": 3.0, "shear_curve": 5.0, "nu12": 5.0, "nu21": 5.0}
ACCEPTED |= {f"{way}_unloading": 5.0 for way in ("warp", "weft", "shear")}


def recovery(known, again):
    """By how many percent an identified fabric misses the known one; curves: largest miss over the peak stress."""
    miss = {}
    for way in "warp", "weft", "shear":
        there, here = getattr(known, way), getattr(again, way)
        strain = np.linspace(0, min(there.limit, here.limit), 201)
        stress = there.stress(strain)
        miss[f"{way}_curve"] = 100 * np.abs(here.stress(strain) - stress).max() / stress.max()
        miss[f"{way}_unloading"] = 100 * (here.unloading / there.unloading - 1)
    pairs = zip(("nu12", "nu21"), known.poisson["measured"], again.poisson["measured"], strict=True)
    return miss | {key: 100 * (here / there - 1) for key, there, here in pairs}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--fabric", default="blend", help="a name, a TOML file, or all")
    parser.add_argument("--noise", type=command.number, default=2.0, help="%% of the largest value of each test")
    parser.add_argument("--specimens", type=command.positive, default=3, help="of each synthetic test")
    parser.add_argument("--seed", type=command.positive, default=2010)
    parser.add_argument("--shear", choices=making.SHEAR, default="photographs")
    parser.add_argument("--ends", choices=["clamped", "free"], default="free", help="of the simulated strip")
    parser.add_argument("--out", type=Path, default=Path("out/identify"))
    return command.parse(parser)


def main():
    args = arguments()
    if MPI.COMM_WORLD.rank > 0:  # nothing here is large enough to share
        return 0
    out = results.folder(args.out, MPI.COMM_SELF)
    if not 0 <= args.noise <= 20:
        raise InputError(f"--noise {args.noise:g} is no part of the largest value; give percent from 0 to 20.")
    right = True
    command.say(
        f"{'fabric':12s}" + "".join(f"{key.replace('_unloading', '_unl.'):>12s}" for key in ACCEPTED) + "   (%)"
    )
    for name in fabrics.names() if args.fabric == "all" else [args.fabric]:
        known = fabrics.load(name)
        folder = results.folder(out / Path(name).stem, MPI.COMM_SELF)
        tests = synthetic.write(
            known, folder / "synthetic_records", args.specimens, noise=args.noise / 100, seed=args.seed
        )
        _, again = making.make(tests, folder, args.shear, mesh=STRIP, ends=args.ends, say=command.say)
        miss = recovery(known, again)
        right = right and all(abs(miss[key]) <= accepted for key, accepted in ACCEPTED.items())
        command.say(f"{known.name:12s}" + "".join(f"{miss[key]:12.2f}" for key in ACCEPTED))
    verdict = "yes" if right else "NO"
    command.say(f"check: curves within 3 (shear 5) %, ratios and unloading slopes within 5 %: {verdict}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
