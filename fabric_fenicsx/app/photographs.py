"""The verb `markers`: from photographs of a marked strip to the file of its marks."""

from pathlib import Path
from typing import Any

import click

from .options import drawn_to, file, folder, numbers


@click.command()
@click.argument("photographs", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--kind", type=click.Choice(["dots", "crosses", "grid", "speckle"]), help="Of the marks; found, if left "
              "out, but for speckle: a sprayed pattern, which gives a field of strains, too.")  # fmt: skip
@click.option("--light", is_flag=True, help="Marks are lighter than the cloth; found, if left out.")
@click.option("--size", "widest", type=click.IntRange(3), help="Width in pixels that no mark, or line, exceeds.  "
              "[default: 5 % of the photograph]; of speckle the side of a facet.  [default: 31]")  # fmt: skip
@click.option("--region", callback=numbers(4), metavar="X0,Y0,X1,Y1", help="Where to look in the first photograph, "
              "in pixels from its upper left corner.")  # fmt: skip
@click.option("--checkerboard", type=file, help="Photograph of one in the plane of the cloth: scale and distortion.")
@click.option("--corners", callback=numbers(2), default="9,6", show_default=True, metavar="N,M",
              help="Its inner corners, across and down.")  # fmt: skip
@click.option("--square", type=float, default=10.0, show_default=True, help="Side of its squares, mm.")
@click.option("--bar", type=float, help="Length in mm of a dark bar in the first photograph: the scale.")
@click.option("--ends", callback=numbers(4), metavar="X1,Y1,X2,Y2", help="Its ends in pixels; found, if left out.")
@click.option("--record", type=file, help="Of the testing machine, with a column photograph: comes into the file.")
@click.option("--warp", type=float, help="Degrees to the warp, anticlockwise from the right of the picture (of a row "
              "of the checkerboard): adds stretches and angle of the yarns, as a bias test needs them.")  # fmt: skip
@click.option("--out", type=folder, default=Path("out/markers"), show_default=True)
def markers(photographs: tuple[Path, ...], out: Path, light: bool, corners: tuple[float, float], **more: Any) -> None:
    """From PHOTOGRAPHS (files, or a folder) of a marked strip to markers.csv, which `identify` reads.

    Name it there under warp_dots or weft_dots, or, made with --record and --warp, under bias. See contact_sheet.png for
    what was found and lost; what you write into corrections.csv beside it is kept when you run this again.
    """
    from mpi4py import MPI

    from ..output import results
    from ..photographs import making

    if MPI.COMM_WORLD.rank > 0:  # nothing here is large enough to share
        return
    out = results.folder(out, MPI.COMM_SELF)
    whole = (int(corners[0]), int(corners[1]))
    with drawn_to(out / "contact_sheet.png"):
        path = making.make(photographs, out, making.Settings(dark=False if light else None, corners=whole, **more),
                           click.echo)  # fmt: skip
    click.echo(f"see {out / 'contact_sheet.png'}; the marks are in {path}")
