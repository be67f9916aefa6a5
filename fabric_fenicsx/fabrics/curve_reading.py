"""The tables [warp], [weft] and [shear] of a fabric file: curves in SI, every entry checked, a contradiction refused.

Shear has optional keys of how it comes back and is repeated; without any of them it is the thesis's:

    [shear]
    strain = "tensor"               # of E12, so dS12/dE12 | "engineering": of 2 E12, so G12 = dS12/d(2 E12)
    loading_MPa = [2, -18, 90, -24]
    unloading_MPa = 12
    friction_MPa = 0.012            # that fresh cloth bears before it shears, on top of its curve
    friction_kept = 0.5             # part of it that is left after large shears ...
    friction_strain = 0.05          # ... the rest being half gone after this one
    set_in = 0.1                    # friction that shear adds, as a part of the largest loading stress so far
    returned = 0.1                  # part of the curve that is elastic; at most 1 - softening
    softening = 0.5                 # what a small shear lacks of the first one when repeated ...
    rejoining = 3                   # ... and over the mean slope, that with which it rejoins the first

    [shear.kes]                     # in the place of loading_MPa, friction_MPa and returned; reaches 8 degrees
    G_gf_cm_deg = 0.6               # gf/cm/degree
    2HG_gf_cm = 0.8                 # gf/cm, at 0.5 degrees
    2HG5_gf_cm = 1.5                # at 5 degrees

With [shear.kes], unloading_MPa may be left out: it is then the least with which the loop has closed by 5 degrees; and
so may `strain`, if nothing is given in it.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from fabric_fenicsx.entries import Table
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import friction
from fabric_fenicsx.fabrics.data import Curve
from fabric_fenicsx.fabrics.friction import GF_CM, KES_REACH, ShearFriction

PARTS = ("set_in", "returned", "softening", "rejoining")
FRICTION = ("friction_MPa", "friction_kept", "friction_strain", *PARTS)
OF_KES = ("loading_MPa", "friction_MPa", "friction_kept", "friction_strain", "returned", "set_in")


def read_curve(table: Table, reach: float, more: str = "", optional: str = "") -> Curve:
    """The curve in Pa, in the file's measure of strain; `reach` is the strain at the end of its test."""
    table.expect(f"loading_MPa unloading_MPa {more}", f"limit_strain {optional}")
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


def read_shear(table: Table, reach: float, thickness: float) -> tuple[Curve, ShearFriction | None]:
    """S12 against gamma = 2 E12, and how it comes back, if the file tells. Table 7.3 is read here and nowhere else, as
    the file's `strain` says:

    "tensor":       sum c_k E12^k = dS12/dE12, so G12 = 1/2 sum c_k (gamma/2)^k; unloading likewise
    "engineering":  sum c_k gamma^k = G12, used as is

    `reach` is E12 at the end of its test, `thickness` in m.
    """
    if "kes" in table.entries:
        return _kes(table, thickness)
    measure = _measure(table)
    curve = read_curve(table, reach * measure, "strain", " ".join(FRICTION))
    modulus = tuple(c / (2 / measure) ** (k + 1) for k, c in enumerate(curve.modulus))
    curve = Curve(modulus, curve.unloading * measure / 2, 2 / measure * curve.limit)
    if not any(key in table.entries for key in FRICTION):
        return curve, None
    given = {"friction": 1e6 * _part(table, "friction_MPa", 0.0), "kept": _part(table, "friction_kept", 1.0)}
    return curve, _friction(table, curve, given, 2 / measure)


def _measure(table: Table) -> int:
    """1 for E12, 2 for 2 E12."""
    measure = table.entries.get("strain")
    if measure not in (None, "tensor", "engineering"):
        table.refuse("strain", "is not a measure of shear strain", 'write "tensor" (E12) or "engineering" (2 E12)')
    return 2 if measure == "engineering" else 1


def _part(table: Table, key: str, default: float) -> float:
    """A number of `ShearFriction`, in its range."""
    value = table.real(key, default)
    low, high, remedy = friction.RANGES[key.removeprefix("friction_").replace("MPa", "friction")]
    if not low <= value <= high:
        table.refuse(key, f"is not from {low:g} to {high:g}", remedy)
    return value


def _friction(table: Table, curve: Curve, given: dict[str, float], scale: float) -> ShearFriction:
    """Of the keys of a table and of what else is known; `scale` from the file's measure of strain to 2 E12."""
    given |= {key: _part(table, key, 0.0) for key in PARTS if key in table.entries}
    if "friction_strain" in table.entries:
        given["strain"] = scale * _part(table, "friction_strain", 0.0)
    try:
        whole = ShearFriction(**given)
    except InputError as error:
        raise InputError(f"{table.file}: {table.prefix}{error}") from error
    said = whole.contradiction(curve)
    if said:
        raise InputError(f"{table.file}: {said}.")
    return whole


def _kes(table: Table, thickness: float) -> tuple[Curve, ShearFriction]:
    for key in OF_KES:
        if key in table.entries:
            table.refuse(key, f"stands beside {table.prefix}kes, which tells it", "leave out one of them")
    measured = any(key in table.entries for key in ("unloading_MPa", "limit_strain"))
    table.expect("kes" + " strain" * measured, "strain unloading_MPa limit_strain softening rejoining")
    sheet, measure = table.table("kes"), _measure(table)
    sheet.expect("G_gf_cm_deg 2HG_gf_cm 2HG5_gf_cm")
    G, width, width5 = (GF_CM * sheet.positive(key) for key in ("G_gf_cm_deg", "2HG_gf_cm", "2HG5_gf_cm"))
    try:
        y0, returned = friction.of_kes(G, width, width5)
    except InputError as error:
        raise InputError(f"{table.file}: {sheet.prefix}{error}") from error
    per_radian = np.degrees(1.0) / thickness
    least = friction.kes_unloading(G, y0, returned) * per_radian
    unloading = 1e6 * table.positive("unloading_MPa", least / 1e6 * 2 / measure) * measure / 2
    if unloading < least * (1 - 1e-9):
        reason = "is too soft for the loop to have closed by 5 degrees"
        table.refuse("unloading_MPa", reason, f"give {2 * least / measure / 1e6:.5g} or more, or leave it out")
    reach = table.positive("limit_strain", KES_REACH * measure / 2) * 2 / measure
    curve = Curve((float(G * per_radian), 0.0, 0.0, 0.0), float(unloading), reach)
    given = {"friction": float(y0 / thickness), "returned": float(returned), "set_in": 0.0}
    return curve, _friction(table, curve, given, 2 / measure)
