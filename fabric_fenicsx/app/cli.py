"""The command `fabric-fenicsx`. Rooms are imported by the verbs that use them: `doctor` must start without any."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

import fabric_fenicsx

from ..errors import InputError
from .options import direction, drawn_to, file, folder, keys
from .photographs import markers

if TYPE_CHECKING:
    from ..fabrics.per_width import PerWidth
    from ..identify.making import Shear
    from ..identify.tensile.strips import Ends
    from ..output.series import Colour

STRIP = Path(__file__).parent.parent / "meshes" / "strip.geo"
RANKS = {"PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK"}  # one of which mpirun sets: what is said is said once then
UNBALANCED = 0.05  # imbalance of energy, as a part of the external work, from which a run is wrong

COMPLETION = """\b
Completion by the shell, a line for its own file:
  ~/.bashrc    eval "$(_FABRIC_FENICSX_COMPLETE=bash_source fabric-fenicsx)"
  ~/.zshrc     eval "$(_FABRIC_FENICSX_COMPLETE=zsh_source fabric-fenicsx)"
  config.fish  _FABRIC_FENICSX_COMPLETE=fish_source fabric-fenicsx | source"""


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}, epilog=COMPLETION)
@click.option("--traceback", is_flag=True, help="Where something goes wrong, show where in the program.")
@click.version_option(fabric_fenicsx.__version__)
@click.pass_context
def app(context: click.Context, traceback: bool) -> None:
    """Woven fabric as a thin shell: measured fabrics, scenes, and pictures of what they do."""
    if fabric_fenicsx.MISSING and context.invoked_subcommand != "doctor":
        raise click.ClickException(fabric_fenicsx.MISSING)


def fabric_names(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """For completion: the fabrics of the package."""
    from .. import fabrics

    return [name for name in fabrics.names() if name.startswith(incomplete)]


per_width = click.option(
    "--per-width", is_flag=False, flag_value="N/m", type=click.Choice(["N/m", "N/cm", "N/5cm"]),
    help="Forces per width beside stress over the thickness, N/m if no unit is named.")  # fmt: skip


@app.group("fabrics")
def fabrics_group() -> None:
    """The measured fabrics: list, show, plot, export."""


@fabrics_group.command("list")
def fabrics_list() -> None:
    """Every fabric that comes along, a line each."""
    from .. import fabrics

    click.echo(f"{'name':10s}{'material':22s}{'weave':14s}{'mm':>6s}{'kg/m2':>8s}{'nu12':>7s}{'nu21':>7s}")
    for name in fabrics.names():
        f = fabrics.load(name)
        nu12, nu21 = f.poisson["measured"]
        click.echo(
            f"{name:10s}{f.material:22.21s}{f.weave:14.13s}{f.thickness * 1e3:6.2f}{f.density * f.thickness:8.3f}"
            f"{nu12:7.2f}{nu21:7.2f}"
        )


@fabrics_group.command("show")
@click.argument("name", shell_complete=fabric_names)
@per_width
def fabrics_show(name: str, per_width: "PerWidth | None") -> None:
    """All numbers of a fabric, by NAME or TOML file, with their sources."""
    from .. import fabrics
    from ..fabrics.per_width import describe

    f = fabrics.load(name)
    click.echo(f"{f.name} ({f.label}): {f.material}, {f.weave} weave")
    click.echo(f"  thickness {f.thickness * 1e3:g} mm, density {f.density:g} kg/m3, {f.areal_mass:.4g} kg/m2")
    for way, curve, E in (("warp", f.warp, "E11"), ("weft", f.weft, "E22"), ("shear", f.shear, "(2 E12)")):
        terms = [f"{c / 1e6:.4g}" + (f" {E}" + (f"^{k}" if k > 1 else "") if k else "")
                 for k, c in enumerate(curve.modulus) if c or not k]  # fmt: skip
        click.echo(f"  {way:6s}modulus {' + '.join(terms).replace('+ -', '- ')} MPa up to {E} = {curve.limit:.4g}; "
                   f"unloading {curve.unloading / 1e6:.4g} MPa")  # fmt: skip
    for line in describe(f, per_width) if per_width else []:
        click.echo(f"  {line}")
    if f.shear_friction:
        click.echo(f"  shear, {f.shear_friction.describe()}")
    for key, (nu12, nu21) in f.poisson.items():
        click.echo(f"  Poisson's ratios, {key}: nu12 {nu12:g}, nu21 {nu21:g}")
    for line in f.bending_or_estimate().describe().splitlines():
        click.echo(f"  bending, {line}")
    for key, source in f.sources.items():
        click.echo(f"  source of {key}: {source}")


@fabrics_group.command("plot")
@click.argument("names", nargs=-1, shell_complete=fabric_names)
@click.option("--out", type=file, help="Picture: png, pdf or svg.  [default: out/fabrics.png]")
@per_width
def fabrics_plot(names: tuple[str, ...], out: Path | None, per_width: "PerWidth | None") -> None:
    """Stress against strain of NAMES (all, if left out): a panel for warp, weft and shear."""
    from mpi4py import MPI

    from .. import fabrics
    from ..output import results

    chosen = [fabrics.load(name) for name in names or fabrics.names()]
    if out is None:
        out = results.folder("out", MPI.COMM_SELF) / "fabrics.png"
    with drawn_to(out):
        if len(chosen) == 1:
            chosen[0].plot(out, per_width=per_width)
        else:
            fabrics.compare(chosen, out, per_width=per_width)
    click.echo(f"see {out}")


@fabrics_group.command("export")
@click.argument("name", shell_complete=fabric_names)
@click.option("--to", "format", type=click.Choice(["calculix", "abaqus", "linear", "ppf", "newton", "blender"]),
              default="linear", show_default=True, help="CalculiX *ELASTIC, Abaqus *FABRIC, or linear numbers as JSON: "
              "per width, or as ppf-contact-solver, newton or Blender name them.")  # fmt: skip
@click.option("--edge", type=float, default=10.0, show_default=True, help="Of the mesh, mm, for newton and Blender.")
def fabrics_export(name: str, format: str, edge: float) -> None:
    """The numbers of a fabric, by NAME or TOML file, for another program; it says what is lost."""
    from .. import fabrics
    from ..fabrics import exporting

    click.echo(exporting.export(fabrics.load(name), format, edge=1e-3 * edge), nl=False)


@app.command()
@click.argument("tests", type=file)
@keys("identify.listing")
@click.option("--shear", type=click.Choice(["photographs", "inverse", "net"]), default="photographs",
              show_default=True, help="Where the shear curve comes from: marked yarns, or the force of the bias test, "
              "by simulation (inverse) or of yarns that keep their length (net).")  # fmt: skip
@click.option("--ends", type=click.Choice(["clamped", "free"]), default="clamped", show_default=True,
              help="Of the simulated strip (--shear inverse).")  # fmt: skip
@per_width
@click.option("--out", type=folder, default=Path("out/identify"), show_default=True)
def identify(tests: Path, shear: "Shear", ends: "Ends", out: Path, per_width: "PerWidth | None") -> None:
    """From test records to a fabric: a one-page report and fabric.toml. TESTS is a TOML file that lists the records.

    Strips off the yarns and biaxial records go into one fit with all other tests; tests.pdf shows them beside the law.
    See --keys for all that it may hold, and demos/records for one of published tests.
    """
    from mpi4py import MPI

    from ..identify import making
    from ..output import results

    if MPI.COMM_WORLD.rank > 0:  # nothing here is large enough to share
        return
    out = results.folder(out, MPI.COMM_SELF)
    path, _ = making.make(tests, out, shear, mesh=STRIP, ends=ends, say=click.echo, per_width=per_width)
    click.echo(f"see {out / 'report.pdf'}; use it with --fabric {path}")


app.add_command(markers)


@app.command()
@click.argument("scene", type=file)
@keys("scenes.reading")
@click.option("--out", type=folder, help="Folder for the results.  [default: out/NAME OF THE SCENE]")
@click.option("--resume", is_flag=False, flag_value="", metavar="[FILE]", help="Go on from this checkpoint, "
              "or (as the last word of the line) from the last one in --out; its history goes on, too.")  # fmt: skip
@click.option("--quiet", is_flag=True, help="No progress.")
@click.option("--trust", is_flag=True, help="Let a .geo mesh run programs and write files, if it does.")
def run(scene: Path, out: Path | None, resume: str | None, quiet: bool, trust: bool) -> None:
    """Run SCENE, a TOML file (see --keys) or one that is shipped: hanging, sphere, ...; also by mpirun -n N."""
    from .. import scenes
    from ..output import results
    from . import command

    said = scenes.read(scene, trust=trust)
    out = results.folder(out or Path("out") / scene.stem)
    table = scenes.run(said, out, not quiet, None if resume is None else Path(resume) if resume else True)
    last = table.rows[-1]
    command.say(", ".join(f"{name} {value:.6g}" for name, value in last.items() if name != "wall_s"))
    command.say(f"{len(table.rows)} steps, {table.column('wall_s').sum():.1f} s; see {out}")
    if "imbalance_J" in last:
        worst, most = (max(map(abs, table.column(name))) for name in ("imbalance_J", "external_work_J"))
        part = worst / most if worst else 0.0
        command.say(f"largest imbalance of energy: {100 * part:.2g} % of the external work")
        if not part < UNBALANCED:
            wrong = f"the energies do not balance, by {100 * part:.3g} % of the external work (5 % is too much)"
            remedy = "take a smaller step_ms, or look whether the load is in its unit"
            click.echo(f"warning: {wrong}: do not trust this motion; {remedy}.", err=True)
            raise click.exceptions.Exit(1)


@app.command()
@click.argument("results_folder", metavar="FOLDER", type=folder)
@click.option("--frame", type=int, help="Which step, from 0; the last, if left out.")
@click.option("--colour", type=click.Choice(["yarn", "warp", "weft", "shear", "pressure"]), default="yarn",
              show_default=True, help="By which strain (yarn: the larger of two), or by contact pressure.")  # fmt: skip
@click.option("--view", "eye", callback=direction, metavar="X,Y,Z", help="From the sheet to the eye.")
@click.option("--animation", is_flag=True, help="All steps, as animation.gif.")
@click.option(
    "--export",
    "kind",
    type=click.Choice(["gltf", "obj", "pc2", "usd"]),
    help="Instead of a picture, all "
    "steps of sheet and bodies for other programs: a .glb, a folder of .obj or .pc2, or (extra [usd]) a .usdc.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Picture, or with --animation a .gif (with the extra "
              "[film] also .mp4).  [default: in FOLDER]")  # fmt: skip
def view(results_folder: Path, frame: int | None, colour: "Colour", eye: tuple[float, float, float] | None,
         animation: bool, kind: str | None, out: Path | None) -> None:  # fmt: skip
    """Draw what a run, or a demo, wrote into FOLDER; a broken frame is named, and the others are shown."""
    from .. import system
    from ..output.series import Series, refuse_ending

    series = Series(results_folder)
    if kind is not None:
        from ..output import moving

        if animation or frame is not None or eye is not None:
            raise InputError("--export writes all steps as they are: leave out --animation, --frame and --view.")
        out = out or results_folder / moving.KINDS[kind][0]
        with drawn_to(out):
            broken = moving.export(series, kind, out, colour)
        _tell([series.files[number] for number in broken], out)
        return
    if (fault := system.can_draw()) is not None:
        raise InputError(fault)
    count = len(series.files)
    if frame is not None and not -count <= frame < count:
        raise InputError(f"--frame {frame}: the run has the frames 0 to {count - 1}.")
    out = out or results_folder / ("animation.gif" if animation else "view.png")
    if animation:
        refuse_ending(out)
    with drawn_to(out):
        if animation:
            broken = series.film(out, colour, view=eye)
        else:
            number = series.last() if frame is None else frame
            series.picture(out, number, colour=colour, view=eye)
            broken = sorted({*series.broken(), *range(number + 1, count)}) if frame is None else series.broken()
    _tell([series.files[number] for number in broken], out)


def _tell(broken: list[Path], out: Path) -> None:
    for path in broken:
        click.echo(f"{path} cannot be read, and is left out")
    click.echo(f"see {out}")


@app.command()
def doctor() -> None:
    """What is installed, what is missing, and how to mend it. Status 1 if something needed is missing."""
    from . import doctor as room

    found = room.look()
    for finding in found:
        mark = "ok     " if finding.good else "MISSING" if finding.needed else "without"
        click.echo(f"{mark} {finding.name}: {finding.said}")
        if not finding.good:
            click.echo(f"        to mend it: {finding.remedy}")
    bad = [f for f in found if not f.good]
    needed = [f.name for f in bad if f.needed]
    click.echo("everything is there" if not bad else
               f"missing: {', '.join(needed)}" if needed else "all that is needed is there")  # fmt: skip
    if needed:
        raise click.exceptions.Exit(1)


def main() -> None:
    """Run the command line; a fault is one sentence, and the status is not zero."""
    arguments = [word for word in sys.argv[1:] if word != "--traceback"]
    shown = len(arguments) < len(sys.argv) - 1
    if fabric_fenicsx.MISSING or (fabric_fenicsx.HELP and not RANKS & set(os.environ)):
        sys.exit(app.main(arguments, "fabric-fenicsx"))
    from mpi4py import MPI

    from . import command

    if MPI.COMM_WORLD.rank > 0 and not shown:
        sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115  what is wrong is said once

    def words() -> int | None:
        try:
            return app.main(arguments, "fabric-fenicsx", standalone_mode=False)
        except click.ClickException as error:
            error.show()
            return error.exit_code
        except click.Abort as error:
            raise KeyboardInterrupt(*getattr(error.__cause__, "args", ())) from None

    command.run(words, shown)
