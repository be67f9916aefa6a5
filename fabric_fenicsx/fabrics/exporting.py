"""A fabric's numbers for other programs, each with a sentence on what of the fabric it does not take along.

    text = exporting.export(load("blend"), "calculix")

- `calculix`: *ELASTIC, TYPE=ENGINEERING CONSTANTS (Abaqus reads it too), linear at rest, over a thickness with which an
  elastic shell bends as the cloth does, not over the measured one;
- `abaqus`: *FABRIC of Abaqus/Explicit, nominal stress over nominal strain along each yarn, and over the shear angle;
- `linear`: the linear numbers per width as JSON, for programs of cloth that take stiffness in N/m and bending in N m;
- `ppf`, `newton`, `blender`: those numbers as JSON under the names and in the units of these, see `simulators`.
"""

import json
from typing import Literal, get_args

import numpy as np

from ..errors import InputError
from . import simulators
from .data import Curve, Fabric

type Format = Literal["calculix", "abaqus", "linear", "ppf", "newton", "blender"]
FORMATS: tuple[str, ...] = get_args(Format.__value__)
POINTS = 26
LOST = {
    "calculix": "linear: the curves, unloading, friction and softening are left out, and both Poisson's ratios are "
    "replaced by a pair that goes with one compliance",
    "abaqus": "elastic: unloading and friction are left out, and Poisson's ratios, as *FABRIC keeps warp and weft "
    "apart; bending is that of the element",
    "linear": "the slopes at rest alone: the curves, unloading, friction and softening are left out",
}


def export(fabric: Fabric, format: str, *, edge: float = 0.01) -> str:
    """The text of the file; edge (m): of the mesh of a program whose numbers go with it, newton and blender.

    Raises InputError for another format than `FORMATS`, and an edge that is not above zero.
    """
    if not 0 < edge < 1e3:
        raise InputError(f"An edge of {edge:g} m is none of a mesh; give its length, above zero.")
    if format not in FORMATS:
        raise InputError(f"{format!r} is no format of an export; give one of {', '.join(FORMATS)}.")
    if format in ("calculix", "abaqus"):
        return _calculix(fabric) if format == "calculix" else _abaqus(fabric)
    if format == "linear":
        return _json(fabric, LOST["linear"], dict(linear(fabric)))
    return _json(fabric, simulators.LOST[format], simulators.numbers(linear(fabric), format, edge))


def linear(fabric: Fabric) -> dict[str, float]:
    """Stiffness at rest per width, N/m, the one compliance of Poisson's ratios, bending in N m, mass in kg/m2.

    nu12/E1 and nu21/E2 are alike in an elastic cloth; of the measured ones the mean is taken, at most 0.95 of what
    leaves the cloth stable.
    """
    h, bending = fabric.thickness, fabric.bending_or_estimate()
    E1, E2, G = (h * curve.modulus[0] for curve in (fabric.warp, fabric.weft, fabric.shear))
    nu12, nu21 = fabric.poisson["measured"]
    across = min((nu12 / E1 + nu21 / E2) / 2, 0.95 / np.sqrt(E1 * E2))
    return {
        "tension_warp_N_per_m": E1,
        "tension_weft_N_per_m": E2,
        "shear_N_per_m": G,
        "nu12": across * E1,
        "nu21": across * E2,
        "bending_warp_N_m": bending.warp.B,
        "bending_weft_N_m": bending.weft.B,
        "bending_twist_N_m": bending.twist.B,
        "areal_mass_kg_per_m2": fabric.areal_mass,
    }


def bending_thickness(fabric: Fabric) -> float:
    """Thickness (m) at which an elastic shell of this tension bends like the cloth, in the mean of warp and weft."""
    n = linear(fabric)
    B = np.sqrt(n["bending_warp_N_m"] * n["bending_weft_N_m"])
    tension = np.sqrt(n["tension_warp_N_per_m"] * n["tension_weft_N_per_m"])
    return float(np.sqrt(12 * (1 - n["nu12"] * n["nu21"]) * B / tension))


def _head(fabric: Fabric, format: str, mark: str) -> list[str]:
    bending = fabric.bending_or_estimate()
    said = [f"{fabric.name} by fabric_fenicsx, in m, N, kg, s. {LOST[format]}.".replace(". linear", ". Linear")]
    said += [f"bending, {line}" for line in bending.describe().splitlines()] if format != "abaqus" else []
    return [f"{mark} {line}" for line in said]


def _name(fabric: Fabric) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in fabric.name.upper())[:60]


def _calculix(fabric: Fabric) -> str:
    n, h = linear(fabric), bending_thickness(fabric)
    E1, E2, G = (n[f"{key}_N_per_m"] / h for key in ("tension_warp", "tension_weft", "shear"))
    name = _name(fabric)
    lines = [
        *_head(fabric, "calculix", "**"),
        f"** measured thickness {1e3 * fabric.thickness:.4g} mm; moduli and density are over {1e3 * h:.4g} mm, at "
        "which a shell bends like the cloth",
        f"*MATERIAL, NAME={name}",
        "*ELASTIC, TYPE=ENGINEERING CONSTANTS",
        f"{E1:.8g}, {E2:.8g}, {min(E1, E2):.8g}, {n['nu12']:.8g}, 0., 0., {G:.8g}, {G:.8g}",
        f"{G:.8g}",
        "*DENSITY",
        f"{fabric.areal_mass / h:.8g}",
        f"** *SHELL SECTION, ELSET=CLOTH, MATERIAL={name}, ORIENTATION=WARP",
        f"** {h:.8g}",
    ]
    return "\n".join([*lines, ""])


def _abaqus(fabric: Fabric) -> str:
    lines = [
        *_head(fabric, "abaqus", "**"),
        f"** thickness {fabric.thickness:.8g} m; component 1 is the warp",
        f"*MATERIAL, NAME={_name(fabric)}",
        "*DENSITY",
        f"{fabric.density:.8g}",
        "*FABRIC",
    ]
    for component, curve in (("1", fabric.warp), ("2", fabric.weft), ("SHEAR", fabric.shear)):
        lines += [f"*UNIAXIAL, COMPONENT={component}", "*LOADING DATA, EXTRAPOLATION=LINEAR"]
        table = _sheared(curve) if component == "SHEAR" else _pulled(curve)
        lines += [f"{stress:.8g}, {strain:.8g}" for stress, strain in table]
    return "\n".join([*lines, ""])


def _pulled(curve: Curve) -> list[tuple[float, float]]:
    """Nominal stress (Pa) and nominal strain, with a little compression."""
    E = np.concatenate([[-0.1 * curve.limit], np.linspace(0, curve.limit, POINTS)])
    stretch = np.sqrt(1 + 2 * E)
    return list(zip((curve.stress(E) * stretch).tolist(), (stretch - 1).tolist(), strict=True))


def _sheared(curve: Curve) -> list[tuple[float, float]]:
    """Shear stress (Pa) over the shear angle (radians), of yarns that keep their length: 2 E12 = sin(angle)."""
    angle = np.linspace(0, np.arcsin(min(curve.limit, 0.95)), POINTS)
    return list(zip((curve.stress(np.sin(angle)) * np.cos(angle)).tolist(), angle.tolist(), strict=True))


def _json(fabric: Fabric, lost: str, numbers: dict[str, object]) -> str:
    bending = fabric.bending_or_estimate()
    words = {"name": fabric.name, "lost": lost}
    if bending.assumed:
        words["assumed"] = "; ".join(f"{what}: {why}" for what, why in bending.assumed.items())
    return json.dumps(words | numbers, indent=2) + "\n"
