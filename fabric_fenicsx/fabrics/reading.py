"""From a TOML file to a `Fabric`: units to SI, every entry checked, a fault answered in one sentence."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import cast

import numpy as np
from numpy.polynomial import Polynomial

from fabric_fenicsx import entries
from fabric_fenicsx.entries import Table
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics.bending_reading import read_bending
from fabric_fenicsx.fabrics.data import TRANSVERSE, TRANSVERSE_SOURCES, Curve, Fabric, TransverseSource

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

    poisson = file.table("poisson")
    poisson.expect("measured", "lowered")
    across, source = _transverse(file)
    sources = file.table("sources") if "sources" in file.entries else Table(file.file, "sources.", {})
    sources.expect("", " ".join(file.entries))
    return Fabric(
        **{key: file.text(key) for key in ("name", "label", "material", "weave")},
        thickness=file.positive("thickness_mm") / 1000,
        density=file.positive("density_kg_per_m3"),
        warp=_curve(file.table("warp"), reach["warp"]),
        weft=_curve(file.table("weft"), reach["weft"]),
        shear=_shear(file.table("shear"), reach["bias"]),
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


def _curve(table: Table, reach: float, more: str = "") -> Curve:
    """The curve in Pa, in the file's measure of strain; `reach` is the strain at the end of its test."""
    table.expect(f"loading_MPa unloading_MPa {more}", "limit_strain")
    limit = table.positive("limit_strain") if "limit_strain" in table.entries else reach
    listed = table.entries["loading_MPa"]
    if not isinstance(listed, list) or not 1 <= len(listed) <= 4:
        remedy = "write [c0, c1, c2, c3], ascending powers of the strain, or fewer"
        table.refuse("loading_MPa", "is not a list of one to four numbers", remedy)
    modulus = [table.number("loading_MPa", c) for c in listed] + [0.0] * (4 - len(listed))
    unloading = table.positive("unloading_MPa")

    strains, moduli = _sample(modulus, limit)
    first, most = int(np.argmax(moduli <= 0)), int(np.argmax(moduli))
    if moduli[first] <= 0:
        reason = f"is a modulus of {moduli[first]:.4g} MPa at strain {strains[first]:.4g}, not positive"
        remedy = f"set {table.prefix}limit_strain below that strain" if first else "raise the first coefficient"
        table.refuse("loading_MPa", reason, f"{remedy}, or fit one that is positive from 0 to {limit:.4g}")
    if unloading < moduli[most]:
        reason = f"is below the loading modulus, {moduli[most]:.4g} MPa at strain {strains[most]:.4g}, so that a cycle"
        table.refuse("unloading_MPa", f"{reason} would create energy", "give at least that loading modulus")
    return Curve(tuple(1e6 * c for c in modulus), 1e6 * unloading, limit)


def _sample(modulus: list[float], limit: float) -> tuple[np.ndarray, np.ndarray]:
    """Strains from 0 to the limit, the turning points of the cubic among them, and its values there."""
    cubic = Polynomial(np.array(modulus) * (limit ** np.arange(4.0)))  # of strain / limit
    turning = cubic.deriv().trim(1e-12 * abs(cubic.coef).max()).roots()
    turning = turning[np.isreal(turning) & (turning.real > 0) & (turning.real < 1)].real
    places = np.sort(np.concatenate([np.linspace(0.0, 1.0, 1001), turning]))
    return places * limit, cubic(places)


def _shear(table: Table, reach: float) -> Curve:
    """S12 against gamma = 2 E12. Table 7.3 is read here and nowhere else, as the file's `strain` says:

    "tensor":       sum c_k E12^k = dS12/dE12, so G12 = 1/2 sum c_k (gamma/2)^k; unloading likewise
    "engineering":  sum c_k gamma^k = G12, used as is
    """
    measure = table.entries.get("strain")
    if measure not in (None, "tensor", "engineering"):
        table.refuse("strain", "is not a measure of shear strain", 'write "tensor" (E12) or "engineering" (2 E12)')
    curve = _curve(table, 2 * reach if measure == "engineering" else reach, more="strain")
    if measure == "engineering":
        return curve
    modulus = tuple(c / 2 ** (k + 1) for k, c in enumerate(curve.modulus))
    return Curve(modulus, curve.unloading / 2, 2 * curve.limit)
