"""My own fabric: write down what you measured, and pull a strip of it.

A fabric is a TOML file. Moduli are polynomials in the strain, so that loading_MPa = [40, 3000] means
dS11/dE11 = 40 + 3000 E11 in MPa, over the measured thickness. Where you have force-displacement records and no
polynomials, `fabric-fenicsx identify` writes such a file from them. A misspelt key, a missing number, a modulus that
becomes negative: each is refused in one sentence that names it.

The checked number: a strip whose ends may contract is under uniaxial stress, so it must give the curve of the file,
S11 = 40 E11 + 3000 E11^2 / 2.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import numpy as np

from fabric_fenicsx import fabrics, specimen
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing

STRIP = meshing.MESHES / "strip.geo"

MY_FABRIC = """
name = "my_fabric"
label = "swatch 1"
material = "Linen"
weave = "Plain"
thickness_mm = 0.50
density_kg_per_m3 = 400

[warp]
loading_MPa = [40, 3000]          # of E11, ascending powers, up to the cube
unloading_MPa = 900               # slope at the start of unloading

[weft]
loading_MPa = [25, 1500]
unloading_MPa = 500

[shear]
strain = "engineering"            # the moduli are dS12 / d(2 E12); "tensor": dS12 / dE12
loading_MPa = [0.5, 0, 8]
unloading_MPa = 6

[poisson]                         # nu12: contraction along weft per stretch along warp
measured = { nu12 = 0.30, nu21 = 0.20 }

[test]                            # the strip, and how far its tests went: beyond that a warning says so
gauge_length_mm = 100
width_mm = 25
warp_displacement_mm = 8
weft_displacement_mm = 10
bias_displacement_mm = 20
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/my_fabric"))
    out = results.folder(command.parse(parser).out)
    comm, file = MPI.COMM_WORLD, out / "my_fabric.toml"
    if comm.rank == 0:
        file.write_text(MY_FABRIC)
    comm.Barrier()

    # the file is used like the name of a fabric that comes along
    fabric = fabrics.load(file)
    domain = meshing.read(STRIP, gdim=2, length=fabric.gauge_length, width=fabric.width)
    strip = specimen.strip(domain, fabric, Woven(fabric), ends="free")
    pulls = np.linspace(0.0, fabric.displacement["warp"], 11)[1:]
    with results.Table(out / "history.csv") as table:
        for step in statics.march(strip.solver, strip.pull, pulls, progress=fabric.name):
            stretch = step.load / fabric.gauge_length
            force = strip.solver.reaction(strip.ends[1])
            stress = force / (fabric.width * fabric.thickness) / (1 + stretch)
            table.row(displacement_mm=1e3 * step.load, force_N=force, E11=stretch + stretch**2 / 2, S11_Pa=stress)

    # look at it: the three curves of the file, and the strip
    if comm.rank == 0:
        fabric.plot(out / "curves.png")
    strain = strip.hook.strain.mean(axis=1)[:, 0]
    pictures.picture(out / "deformed.png", strip.u, strain, "warp strain E11 (-)", fabric.label)

    E11, S11 = table.column("E11"), table.column("S11_Pa")
    miss = np.abs(S11 / (40e6 * E11 + 3000e6 * E11**2 / 2) - 1).max()
    command.say(f"force at {table.rows[-1]['displacement_mm']:g} mm: {table.rows[-1]['force_N']:.4g} N")
    command.say(f"largest miss of the curve in the file: {100 * miss:.2g} %")
    command.say(f"check: the strip gives the curve to 0.01 %: {'yes' if miss <= 1e-4 else 'NO'}; see {out}")
    return 0 if miss <= 1e-4 else 1


if __name__ == "__main__":
    command.run(main)
