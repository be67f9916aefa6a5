"""From a TOML file to a `Fabric`: units to SI, and every entry checked; a fault is an `InputError` of one sentence."""

from __future__ import annotations

import math
import reprlib
import tomllib
from dataclasses import dataclass
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.polynomial import Polynomial

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics.data import Curve, Fabric

_HERE = Path(__file__).parent
_MM, _MPA = 1e-3, 1e6


def names() -> tuple[str, ...]:
    """The fabrics that come with the package, in alphabetical order."""
    return tuple(sorted(file.stem for file in _HERE.glob("*.toml")))


def load(name_or_path: str | PathLike[str]) -> Fabric:
    """The fabric of that name (see `names`), or of that TOML file: a path object, or text with a "/" or ending in .toml.

    Raises InputError where the name is unknown, the file cannot be read or is not TOML, or an entry is missing,
    unknown, of the wrong type, not finite, negative, or contradicts physics.
    """
    if not isinstance(name_or_path, str | PathLike):
        raise InputError(
            f"a fabric is given by its name or the path of its TOML file, not by {name_or_path!r}."
        )
    path = Path(name_or_path)
    if isinstance(name_or_path, str) and path.suffix != ".toml" and path.name == name_or_path:
        if name_or_path not in names():
            known = ", ".join(names())
            raise InputError(
                f"unknown fabric {name_or_path!r}; known are {known}, or give the path of a .toml file."
            )
        path = _HERE / f"{name_or_path}.toml"
    return _fabric(_Table(str(path), "", _parse(path)))


def _parse(path: Path) -> dict[str, Any]:
    """The entries of a TOML file; InputError with the place of the fault where it is none."""
    try:
        raw = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"{path}: the fabric file cannot be read ({reason}); check its path and rights."
        ) from error
    try:
        return tomllib.loads(raw.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise InputError(
            f"{path}: not a TOML file, line {line} is not UTF-8 text; save it as UTF-8."
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a TOML file ({error}); correct it there.") from error


@dataclass(frozen=True)
class _Table:
    """One table of a fabric file; whatever is taken out of it has been checked."""

    file: str
    prefix: str  # "" or "warp."
    entries: dict[str, Any]

    def refuse(self, key: str, reason: str, remedy: str) -> NoReturn:
        """Raise the one sentence that names file, key, value, reason and remedy."""
        value = f" = {reprlib.repr(self.entries[key])}" if key in self.entries else ""
        raise InputError(f"{self.file}: {self.prefix}{key}{value} {reason}; {remedy}.")

    def expect(self, required: str, optional: str = "") -> None:
        """Refuse unknown keys first, for a misspelt key is also a missing one, then missing ones."""
        known = required.split() + optional.split()
        for key in self.entries:
            if key not in known:
                near = get_close_matches(key, known, n=1)
                hint = (
                    f"did you mean {self.prefix}{near[0]}"
                    if near
                    else f"the keys here are {', '.join(known)}"
                )
                self.refuse(key, "is not a known key", hint)
        for key in required.split():
            if key not in self.entries:
                self.refuse(key, "is missing", f"add it, as in {_HERE / 'blend.toml'}")

    def table(self, key: str) -> _Table:
        if not isinstance(self.entries[key], dict):
            self.refuse(key, "is not a table", f"write its entries under [{self.prefix}{key}]")
        return _Table(self.file, f"{self.prefix}{key}.", self.entries[key])

    def text(self, key: str, among: tuple[str, ...] = ()) -> str:
        value = self.entries[key]
        if not isinstance(value, str) or not value.strip():
            self.refuse(key, "is not a text", "write it in double quotes")
        if among and value not in among:
            self.refuse(key, "is not a known choice", f"choose {' or '.join(among)}")
        return value

    def finite(self, key: str, value: Any, unit: float = 1.0) -> float:
        """`value`, an entry or a member of the list `key`, in SI."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(key, f"is not a number ({reprlib.repr(value)})", "write a number, without quotes")
        try:
            number = float(value) * unit
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.refuse(key, "is not finite", "give a finite number")
        return number

    def positive(self, key: str, unit: float = 1.0) -> float:
        number = self.finite(key, self.entries[key], unit)
        if number <= 0:
            self.refuse(
                key, "is not positive", "give a number greater than zero, in the unit that the key names"
            )
        return number


def _fabric(file: _Table) -> Fabric:
    file.expect(
        "name label material weave thickness_mm density_kg_per_m3 warp weft shear poisson test", "sources"
    )
    test = file.table("test")
    directions = ("warp", "weft", "bias")
    test.expect("gauge_length_mm width_mm " + " ".join(f"{way}_displacement_mm" for way in directions))
    gauge_length = test.positive("gauge_length_mm", _MM)
    displacement = {way: test.positive(f"{way}_displacement_mm", _MM) for way in directions}
    stretch = {way: d / gauge_length for way, d in displacement.items()}
    reach = {
        way: d + d * d / 2 for way, d in stretch.items()
    }  # (3.2); in bias this is E12, see the package's docstring

    poisson = file.table("poisson")
    poisson.expect("measured", "lowered")
    measured = _ratios(poisson.table("measured"))
    lowered = _ratios(poisson.table("lowered")) if "lowered" in poisson.entries else measured
    sources = file.table("sources") if "sources" in file.entries else _Table(file.file, "sources.", {})
    sources.expect("", optional=" ".join(file.entries))
    return Fabric(
        **{key: file.text(key) for key in ("name", "label", "material", "weave")},
        thickness=file.positive("thickness_mm", _MM),
        density=file.positive("density_kg_per_m3"),
        warp=_curve(file.table("warp"), reach["warp"]),
        weft=_curve(file.table("weft"), reach["weft"]),
        shear=_shear(file.table("shear"), reach["bias"]),
        poisson={"measured": measured, "lowered": lowered},
        gauge_length=gauge_length,
        width=test.positive("width_mm", _MM),
        displacement=displacement,
        sources={key: sources.text(key) for key in sources.entries},
    )


def _ratios(table: _Table) -> tuple[float, float]:
    """(nu12, nu21), neither negative: the reciprocal coupling sqrt(nu12 nu21) of the law cannot carry a sign, and
    would turn a fabric that widens under tension into one that narrows without a word."""
    table.expect("nu12 nu21")
    nu12, nu21 = (table.finite(key, table.entries[key]) for key in ("nu12", "nu21"))
    for key, value in (("nu12", nu12), ("nu21", nu21)):
        if value < 0:
            reason = "is negative, and the law's coupling sqrt(nu12 nu21) would lose the sign"
            table.refuse(key, reason, "give the contraction per stretch, a number not below zero")
    if nu12 * nu21 >= 1:
        reason = f"times {table.prefix}nu21 = {nu21:g} is {nu12 * nu21:.4g}, and from 1 on no sheet is stable"
        table.refuse("nu12", reason, "give ratios with a product below 1")
    return nu12, nu21


def _curve(table: _Table, reach: float, other: str = "") -> Curve:
    """The curve as the file measures it, in Pa; `reach` is the largest strain of its test, `other` one more key."""
    table.expect(f"loading_MPa unloading_MPa {other}", "limit_strain")
    limit = table.positive("limit_strain") if "limit_strain" in table.entries else reach
    listed = table.entries["loading_MPa"]
    if not isinstance(listed, list) or not 1 <= len(listed) <= 4:
        remedy = "give one to four coefficients, [c0, c1, c2, c3], of a modulus that is at most cubic"
        table.refuse("loading_MPa", "is not a list of one to four numbers", remedy)
    modulus = [table.finite("loading_MPa", c, _MPA) for c in listed] + [0.0] * (4 - len(listed))
    unloading = table.positive("unloading_MPa", _MPA)

    strains, moduli = _sampled(modulus, limit)
    if not np.isfinite(moduli).all():
        table.refuse(
            "loading_MPa", f"has no finite value up to strain {limit:.4g}", "check the test's displacement"
        )
    lowest = int(np.argmax(moduli <= 0))
    if moduli[lowest] <= 0:
        reason = f"is a modulus of {moduli[lowest] / _MPA:.4g} MPa at strain {strains[lowest]:.4g}, and not positive there"
        remedy = f"fit one that is positive up to {limit:.4g}"
        remedy += (
            f", or set {table.prefix}limit_strain below that strain" if lowest else ", from zero strain on"
        )
        table.refuse("loading_MPa", reason, remedy)
    if unloading < moduli.max():
        reason = f"is below the loading modulus, {moduli.max() / _MPA:.4g} MPa at strain {strains[moduli.argmax()]:.4g}"
        table.refuse(
            "unloading_MPa", f"{reason}, so that a cycle would create energy", "give at least that value"
        )
    return Curve(tuple(modulus), unloading, limit)


def _sampled(modulus: list[float], limit: float) -> tuple[np.ndarray, np.ndarray]:
    """Strains from 0 to the limit, turning points of the cubic among them, and its values there."""
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = np.asarray(modulus) * np.float64(limit) ** np.arange(
            4
        )  # coefficients over strain / limit, in 0..1
    if not np.isfinite(scaled).all():
        return np.array([limit]), np.array([np.nan])
    cubic = Polynomial(scaled)
    turning = cubic.deriv().trim(1e-12 * abs(scaled).max()).roots()
    turning = turning[np.isreal(turning) & (turning.real > 0) & (turning.real < 1)].real
    places = np.sort(np.concatenate([np.linspace(0.0, 1.0, 1001), turning]))
    return places * limit, cubic(places)


def _shear(table: _Table, reach: float) -> Curve:
    """S12 against gamma = 2 E12. Table 7.3 is read here and nowhere else, as the file's `strain` says.

    "tensor":       sum c_k E12^k = dS12/dE12, so G12 = dS12/dgamma = 1/2 sum c_k (gamma/2)^k, unloading likewise
    "engineering":  sum c_k gamma^k = G12, used as is
    """
    table.expect("strain", "loading_MPa unloading_MPa limit_strain")
    if table.text("strain", among=("tensor", "engineering")) == "engineering":
        return _curve(table, 2 * reach, other="strain")
    curve = _curve(table, reach, other="strain")
    modulus = tuple(c / 2 ** (k + 1) for k, c in enumerate(curve.modulus))
    return Curve(modulus, curve.unloading / 2, 2 * curve.limit)
