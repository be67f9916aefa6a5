"""From a TOML file to a `Fabric`: units to SI, every entry checked, a fault answered in one sentence."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import cast

from fabric_fenicsx import entries
from fabric_fenicsx.entries import Table
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics.bending_reading import read_bending
from fabric_fenicsx.fabrics.curve_reading import read_curve, read_shear
from fabric_fenicsx.fabrics.data import TRANSVERSE, TRANSVERSE_SOURCES, Fabric, TransverseSource

_HERE = Path(__file__).parent


def names() -> tuple[str, ...]:
    """The fabrics that come with the package, in alphabetical order."""
    return tuple(sorted(file.stem for file in _HERE.glob("*.toml")))


def load(name_or_path: str | PathLike[str]) -> Fabric:
    """The fabric of that name, see `names`, or of a TOML file: a path, or text with a "/" in it or .toml at its end.

    Raises InputError where the name is unknown, the file cannot be read or is not TOML, or an entry is
    missing, unknown, of the wrong type, not finite, negative, or contradicts physics.
    """
    if not isinstance(name_or_path, str | PathLike):
        raise InputError(f"{name_or_path!r} is no fabric; give a name or the path of a .toml file.")
    path = Path(name_or_path)
    if isinstance(name_or_path, str) and path.suffix != ".toml" and path.name == name_or_path:
        if name_or_path not in names():
            known = ", ".join(names())
            raise InputError(f"{name_or_path!r} is no known fabric; give {known}, or the path of a .toml file.")
        path = _HERE / f"{name_or_path}.toml"
    return _fabric(entries.read(path, "a fabric file", str(_HERE / "blend.toml")))


def _fabric(file: Table) -> Fabric:
    file.expect(
        "name label material weave thickness_mm density_kg_per_m3 warp weft shear poisson test",
        "transverse sources bending",
    )
    test = file.table("test")
    test.expect("gauge_length_mm width_mm warp_displacement_mm weft_displacement_mm bias_displacement_mm")
    gauge_mm = test.positive("gauge_length_mm")
    moved_mm = {way: test.positive(f"{way}_displacement_mm") for way in ("warp", "weft", "bias")}
    reach = {way: d / gauge_mm + (d / gauge_mm) ** 2 / 2 for way, d in moved_mm.items()}  # (3.2)

    width_mm = test.positive("width_mm")
    if file.positive("thickness_mm") >= width_mm:
        file.refuse("thickness_mm", f"is not below test.width_mm = {width_mm:g}", "give both in mm")

    shear, friction = read_shear(file.table("shear"), reach["bias"], file.positive("thickness_mm") / 1000)
    poisson = file.table("poisson")
    poisson.expect("measured", "lowered")
    across, source = _transverse(file)
    sources = file.table("sources") if "sources" in file.entries else Table(file.file, "sources.", {})
    sources.expect("", " ".join(file.entries))
    return Fabric(
        **{key: file.text(key) for key in ("name", "label", "material", "weave")},
        thickness=file.positive("thickness_mm") / 1000,
        density=file.positive("density_kg_per_m3"),
        warp=read_curve(file.table("warp"), reach["warp"]),
        weft=read_curve(file.table("weft"), reach["weft"]),
        shear=shear,
        poisson={
            "measured": _ratios(poisson.table("measured")),
            "lowered": _ratios(poisson.table("lowered" if "lowered" in poisson.entries else "measured")),
        },
        gauge_length=gauge_mm / 1000,
        width=width_mm / 1000,
        displacement={way: d / 1000 for way, d in moved_mm.items()},
        sources={key: sources.text(key) for key in sources.entries},
        transverse=across,
        transverse_source=source,
        bending=read_bending(file.table("bending")) if "bending" in file.entries else None,
        shear_friction=friction,
    )


def _ratios(table: Table) -> tuple[float, float]:
    """(nu12, nu21), none negative: there are fabrics that widen under tension, but the law's reciprocal coupling,
    sqrt(nu12 nu21), would lose the sign and narrow them without a word."""
    table.expect("nu12 nu21")
    nu12, nu21 = (table.number(key, table.entries[key]) for key in ("nu12", "nu21"))
    for key in ("nu12", "nu21"):
        if table.entries[key] < 0:
            reason = "is negative, and the law's coupling sqrt(nu12 nu21) would lose the sign"
            table.refuse(key, reason, "give the contraction per stretch, zero or more")
    if nu12 * nu21 >= 1:
        reason = f"times {table.prefix}nu21 = {nu21:g} is {nu12 * nu21:.4g}, and from 1 on no sheet is stable"
        table.refuse("nu12", reason, "give ratios whose product is below 1")
    return nu12, nu21


def _transverse(file: Table) -> tuple[tuple[float, float], TransverseSource]:
    """(warp, weft) and their source, see `Fabric`; assumed where the table is left out."""
    if "transverse" not in file.entries:
        return (TRANSVERSE, TRANSVERSE), "assumed"
    table = file.table("transverse")
    table.expect("warp weft source")
    source = cast(TransverseSource, table.choice("source", TRANSVERSE_SOURCES))
    return (table.positive("warp"), table.positive("weft")), source
