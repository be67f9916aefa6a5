"""Writes an identified fabric as the TOML file that `fabrics.load` takes."""

import json
from pathlib import Path

from .. import fabrics, files
from ..errors import InputError
from ..fabrics.per_width import PerWidth, describe
from .bending import found as bending
from .identified import WAYS, Identified


def write(found: Identified, folder: str | Path, *, per_width: PerWidth | None = None) -> tuple[Path, fabrics.Fabric]:
    """Write `fabric.toml` and read it again as a user would: its path, and the fabric.

    per_width: a unit of `fabrics.per_width` in which remarks at the end repeat the moduli and stresses.
    """
    path = Path(folder) / "fabric.toml"
    files.replace(path, toml(found))
    fabric = fabrics.load(path)
    if per_width:
        files.append(path, "".join(f"# {line}\n" for line in describe(fabric, per_width)))
    return path, fabric


def toml(found: Identified) -> str:
    """The text of the file; raises InputError if a curve or a ratio is neither measured nor assumed."""
    tests, strip = found.tests, found.tests.strip
    missing = [f"the {way} curve" for way in WAYS if way not in found.curves]
    missing += [key for key in ("nu12", "nu21") if key not in found.poisson and key not in tests.assumed]
    if missing:
        hint = ""
        if found.bias is not None and "shear" not in found.curves:
            hint = " Without photographs of the bias test, --shear inverse finds the shear curve from its force."
        raise InputError(
            f"{tests.file}: the records do not tell {', '.join(missing)}, so there is no whole fabric; "
            f"add the tests, or for a Poisson's ratio a value under [assumed].{hint}"
        )
    lines = [
        f"# Identified by fabric_fenicsx; source of the records: {_quoted(tests.source)}.",
        "# ± is the standard error.",
        "",
    ]
    lines += [f"{key} = {_quoted(value)}" for key, value in tests.texts.items()]
    lines += [f"thickness_mm = {1e3 * strip.thickness:.9g}", f"density_kg_per_m3 = {tests.density:.9g}"]
    for way in WAYS:
        lines += ["", f"[{way}]", *_curve(found, way)]
    ratios = ", ".join(f"{key} = {found.ratio(key):.6g}" for key in ("nu12", "nu21"))
    said = ", ".join(f"{key} {found.poisson.get(key, 'assumed')}" for key in ("nu12", "nu21"))
    lines += ["", "[poisson]", f"measured = {{ {ratios} }}  # {said}", "", "[test]"]
    lines += [f"gauge_length_mm = {1e3 * strip.gauge_length:.9g}", f"width_mm = {1e3 * strip.width:.9g}"]
    lines += [f"{way}_displacement_mm = {1e3 * found.displacement[way]:.7g}" for way in ("warp", "weft", "bias")]
    if found.transverse:
        source = "biaxial record" if any(not one.held_out for one in found.biaxial) else "strips off the yarns"
        lines += ["", "[transverse]", *(f"{way} = {e.value:.6g}  # {e}" for way, e in found.transverse.items())]
        lines += [f'source = "{source}"']
    lines += ["", "[sources]"]
    for way in WAYS:
        curve = found.curves[way]
        number = len(curve.readings) or len(found.bias_records)
        lines.append(f'{way} = "{number} specimen{"s" * (number > 1)}, {curve.how}"')
    if found.bending:
        lines += ["", *(f"# {word}" for word in found.bending.fits), bending.toml(found.bending.curves).rstrip()]
    return "\n".join([*lines, ""])


def _quoted(text: str) -> str:
    """A text in TOML, whose escapes are those of JSON, and one more."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _curve(found: Identified, way: str) -> list[str]:
    """Lines of one curve."""
    fit, measured = found.curves[way].loading, found.curves[way].unloading
    coefficients = ", ".join(f"{c / 1e6:.7g}" for c in fit.modulus)
    errors = ", ".join(f"{e / 1e6:.2g}" for e in fit.errors)
    friction = found.friction if way == "shear" else None
    # rounded up, for it must not come to lie below the largest loading modulus
    unloading = f"{found.unloading(way) / 1e6 * (1 + 1e-6):.9g}"
    return [
        *(['strain = "tensor"'] if way == "shear" else []),
        f"loading_MPa = [{coefficients}]  # ± [{errors}]",
        f"unloading_MPa = {unloading}  # " + (f"± {measured.error / 1e6:.2g}" if measured else "not measured"),
        f"limit_strain = {fit.limit:.7g}",
        *(_friction(friction) if friction else []),
    ]


def _friction(friction: fabrics.ShearFriction) -> list[str]:
    """Lines of [shear]; its strain is E12."""
    first = {"friction_MPa": friction.friction / 1e6, "friction_kept": friction.kept}
    first |= {"friction_strain": friction.strain / 2}
    rest = {key: getattr(friction, key) for key in ("set_in", "returned", "softening", "rejoining")}
    return [f"{key} = {value:.6g}" for key, value in (first | rest).items()]
