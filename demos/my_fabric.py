"""My own fabric: write down what you measured, and pull a strip of it.

A fabric is a TOML file. Where you have force-displacement records and no polynomials, `fabric-fenicsx identify` writes
such a file from them. A misspelt key, a missing number, a modulus that becomes negative: each is refused in one
sentence that names it.

The checked number: a strip whose ends may contract is under uniaxial stress, so it must give the curve of the file.
"""

# %% [markdown]
# ## The file
# Moduli are polynomials in the strain, over the measured thickness: `loading_MPa = [40, 3000]` means
#
# $$ \frac{\mathrm{d}S_{11}}{\mathrm{d}E_{11}} = 40 + 3000\,E_{11} \quad\text{MPa}. $$
#
# `unloading_MPa` is the slope at the start of unloading, and $\nu_{12}$ the contraction along weft per stretch along
# warp.

# %%
from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import numpy as np

from fabric_fenicsx import fabrics, specimen
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing

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

[poisson]
measured = { nu12 = 0.30, nu21 = 0.20 }

[test]                            # the strip, and how far its tests went: beyond that a warning says so
gauge_length_mm = 100
width_mm = 25
warp_displacement_mm = 8
weft_displacement_mm = 10
bias_displacement_mm = 20
"""

# %% [markdown]
# The path of the file is used like the name of a fabric that comes along, here and in every `--fabric linen.toml`.

# %%
args = command.script(__doc__, "out/my_fabric")
file = args.out / "my_fabric.toml"
if MPI.COMM_WORLD.rank == 0:
    file.write_text(MY_FABRIC)
MPI.COMM_WORLD.Barrier()
fabric = fabrics.load(file)

# %% [markdown]
# ## The test
# A strip along x, its ends free to contract, is pulled as far as the tests went. Each accepted step is a row of
# `history.csv`.

# %%
domain = meshing.read(meshing.MESHES / "strip.geo", gdim=2, length=fabric.gauge_length, width=fabric.width)
strip = specimen.strip(domain, fabric, Potential(fabric), ends="free")
pulls = np.linspace(0.0, fabric.displacement["warp"], 11)[1:]
with results.Table(args.out / "history.csv") as table:
    for step in statics.march(strip.solver, strip.pull, pulls, progress=fabric.name):
        stretch = step.load / fabric.gauge_length
        force = strip.solver.reaction(strip.ends[1])
        stress = force / (fabric.width * fabric.thickness) / (1 + stretch)
        table.row(displacement_mm=1e3 * step.load, force_N=force, E11=stretch + stretch**2 / 2, S11_Pa=stress)

if MPI.COMM_WORLD.rank == 0:
    fabric.plot(args.out / "curves.png")
strain = strip.points.strain.mean(axis=1)[:, 0]
pictures.picture(args.out / "deformed.png", strip.u, strain, "warp strain E11 (-)", fabric.label)

# %% [markdown]
# ![The three curves of the file](curves.png)
#
# ![The strip at its largest extension](deformed.png)
#
# ## The check
# $$ S_{11} = 40\,E_{11} + \tfrac12\,3000\,E_{11}^2 \quad\text{MPa} $$

# %%
E11, S11 = table.column("E11"), table.column("S11_Pa")
miss = np.abs(S11 / (40e6 * E11 + 3000e6 * E11**2 / 2) - 1).max()
command.say(f"force at {table.rows[-1]['displacement_mm']:g} mm: {table.rows[-1]['force_N']:.4g} N")
command.say(f"largest miss of the curve in the file: {100 * miss:.2g} %")
command.check(miss <= 1e-4, "the strip gives the curve to 0.01 %", args.out)
