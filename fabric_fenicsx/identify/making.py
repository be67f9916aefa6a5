"""The whole way from a list of tests to a report and a fabric file."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

from ..errors import InputError
from ..fabrics import Fabric
from ..fabrics.per_width import PerWidth
from ..laws import Array
from . import fabric_file
from .identification import Identified, identify
from .listing import read
from .report import comparison, pages
from .report import page as report
from .tensile import net
from .tensile.strips import Ends

type Shear = Literal["photographs", "inverse", "net"]
SHEAR: tuple[Shear, ...] = ("photographs", "inverse", "net")
"""Where the shear curve comes from: photographed yarns of the bias test, a simulated strip, inextensible yarns."""


def make(
    tests: str | Path,
    out: Path,
    shear: Shear = "photographs",
    *,
    mesh: Path | None = None,
    ends: Ends = "clamped",
    say: Callable[[str], object] = print,
    per_width: PerWidth | None = None,
) -> tuple[Path, Fabric]:
    """Identify the fabric of a list of tests; the path of its file, and the fabric.

    Writes report.pdf, report.html, report.png (its first page) and fabric.toml into `out`, and tests.pdf and tests.png
    where strips off the yarns or biaxial records are in the list, which goes into one fit then. shear: of `SHEAR`; mesh
    and ends: of the simulated strip, see `inverse.shear`; per_width: a unit of `fabrics.per_width` beside Pa in all of
    them. Raises InputError, after the report, where no whole fabric comes of the tests, and after the fabric, where the
    records do not fit it.
    """
    found = identify(replace(read(tests), ends=ends))
    if shear != "photographs":
        found = _without_photographs(found)
        if shear == "net":
            found = net.shear(found)
        else:
            from .tensile import inverse

            say("  looking for the shear curve on a simulated strip ...")
            assert mesh is not None
            found = inverse.shear(found, mesh, ends=ends)
    if found.strips or found.biaxial:
        from . import joint
        from .tensile import simulated

        say("  one fit of all tests ...")
        found = joint.fit(found, simulated.strips(mesh) if mesh else None)
    report.write(found, out / "report.png", per_width=per_width)
    for ending in ("pdf", "png") if found.compared else ():
        comparison.write(found, out / f"tests.{ending}", per_width=per_width)
    for word in (*found.notes, *found.fits, "not determined:", *(found.undetermined or ["nothing"])):
        say(f"  {word}")
    try:
        path, fabric = fabric_file.write(found, out, per_width=per_width)
    except InputError:
        pages.write(found, None, out, per_width=per_width)
        raise
    drawn = _strip(found, fabric, mesh, ends) if mesh else None
    pages.write(found, fabric, out, drawn, per_width=per_width)
    if found.doubts:
        raise InputError(
            f"{found.tests.file}: the fabric is not to be trusted: {'; '.join(found.doubts)}; {path} is written, but "
            "look at the report for readings that are off, correct the records and identify again."
        )
    return path, fabric


def _strip(found: Identified, fabric: Fabric, mesh: Path, ends: Ends) -> pages.Simulated:
    """What draws a simulated strip of the fabric."""

    def drawn(angle: float, displacement: float) -> Array:
        from .tensile import simulated

        return simulated.picture(mesh, fabric, found.tests.strip, angle, displacement, ends)

    return drawn


def _without_photographs(found: Identified) -> Identified:
    """The same tests, as if nobody had photographed the yarns of the bias test."""
    curves = {way: curve for way, curve in found.curves.items() if way != "shear"}
    return replace(found, curves=curves, yarn_stretch=None)
