"""Strips of any angle and size, and biaxial specimens, in the list of tests.

    [[strip]]                       # an angle each; its specimens beside those of [records]
    files = ["a30_1.csv", "a30_2.csv"]   # as the records of [records]
    angle_deg = 30                  # of the strip to the warp; 0 and 90 count with warp and weft
    gauge_length_mm = 200
    width_mm = 50
    ends = "clamped"                # "free" to contract, as in narrow strips: pulls evenly; clamped ones are simulated
    held_out = false                # true: not used, but predicted and shown beside its data

    [[biaxial]]
    files = ["equal_1.csv"]         # as "warp displacement (mm),weft displacement (mm),warp force (N),weft force (N)"
    drawn = "both"                  # equally; "warp" or "weft": the other is held, and needs no displacement
    length_mm = [100, 100]          # between the grips along warp, and along weft
    width_mm = [100, 100]           # of the cloth that the warp force pulls, and the weft force
    held_out = false

Of biaxial records one of the forces may be missing. Both give the curves, and what links them: `transverse` of the
law with a potential, by which tension along one yarn stiffens the cloth along the other.
"""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...errors import InputError
from ...laws import Array
from ..files import records
from ..files.keys import expect
from ..files.records import Strip
from ..files.tables import Table, read_table
from . import branches, curves, origin
from .curves import Readings

WAYS = {"warp": "warp|kette|chaîne|chaine|ordito|urdimbre|経|たて", "weft": "weft|fill|schuss|trame|trama|緯|よこ"}
DRAWN = ("both", "warp", "weft")
type Ends = Literal["clamped", "free"]
ENDS: tuple[Ends, ...] = ("clamped", "free")
LEAST = 8  # readings of a biaxial record


@dataclass(frozen=True)
class StripTest:
    """Strips of one angle (radians, to the warp) and size; `ends` of `ENDS`."""

    files: list[Path]
    angle: float
    strip: Strip
    ends: Ends = "clamped"
    held_out: bool = False
    readings: list[Readings] = field(default_factory=list)

    @property
    def name(self) -> str:
        """As a report has it."""
        size = f"{1e3 * self.strip.gauge_length:g} x {1e3 * self.strip.width:g} mm"
        return f"{np.degrees(self.angle):.3g} deg, {size}, {self.ends} ends"

    @property
    def off_yarns(self) -> bool:
        """Whether its yarns are shorter than it, so that it shears."""
        return bool(0.01 < self.angle < np.pi / 2 - 0.01)


def slanted(one: StripTest) -> bool:
    """Whether it shears, and is used."""
    return not one.held_out and one.off_yarns


@dataclass(frozen=True)
class BiaxialTest:
    """Specimens drawn along both yarns; `readings` of each, stress (Pa) over strain along warp, and along weft."""

    files: list[Path]
    drawn: str
    length: tuple[float, float]  # m
    width: tuple[float, float]
    held_out: bool = False
    readings: list[tuple[Readings | None, Readings | None]] = field(default_factory=list)
    strains: list[Array] = field(default_factory=list)  # E11, E22 (n, 2) of each specimen

    @property
    def name(self) -> str:
        """As a report has it."""
        return "equibiaxial" if self.drawn == "both" else f"biaxial, {self.drawn} drawn"


def read_strips(path: str | Path, entries: Any, usual: Strip) -> list[StripTest]:
    """The tables [[strip]], as thick as the usual strip, with its extensometer.

    Raises InputError for what is missing, unknown or out of range.
    """
    out = []
    for k, one in _tables(path, "strip", entries):
        where = f"strip {k}: "
        expect(path, where, one, ("files", "angle_deg", "gauge_length_mm", "width_mm"), ("ends", "held_out"))
        angle = one["angle_deg"]
        if isinstance(angle, bool) or not isinstance(angle, int | float) or not 0 <= angle <= 90:
            raise InputError(f"{path}: {where}angle_deg = {angle!r} is not an angle to the warp from 0 to 90 degrees.")
        length, width = (_size(path, where, key, one[key]) for key in ("gauge_length_mm", "width_mm"))
        ends = one.get("ends", "clamped")
        if ends not in ENDS:
            raise InputError(f"{path}: {where}ends = {ends!r} is neither 'clamped' nor 'free'.")
        files = _files(path, where, one["files"])
        strip = replace(usual, gauge_length=length, width=width)
        out.append(StripTest(files, float(np.radians(angle)), strip, ends, _yes(path, where, one)))
    return out


def read_biaxial(path: str | Path, entries: Any) -> list[BiaxialTest]:
    """The tables [[biaxial]]. Raises InputError for what is missing, unknown or out of range."""
    out = []
    for k, one in _tables(path, "biaxial", entries):
        where = f"biaxial {k}: "
        expect(path, where, one, ("files", "drawn", "length_mm", "width_mm"), ("held_out",))
        if one["drawn"] not in DRAWN:
            raise InputError(f"{path}: {where}drawn = {one['drawn']!r} is not one of {', '.join(DRAWN)}.")
        sizes = []
        for key in ("length_mm", "width_mm"):
            if not isinstance(one[key], list) or len(one[key]) != 2:
                raise InputError(f"{path}: {where}{key} = {one[key]!r} is not two numbers, along warp and along weft.")
            first, second = (_size(path, where, key, value) for value in one[key])
            sizes.append((first, second))
        length, width = sizes
        files = _files(path, where, one["files"])
        out.append(BiaxialTest(files, one["drawn"], length, width, _yes(path, where, one)))
    return out


def _tables(path: str | Path, key: str, entries: Any) -> list[tuple[int, dict[str, Any]]]:
    if not isinstance(entries, list) or not entries or not all(isinstance(one, dict) for one in entries):
        raise InputError(f"{path}: {key} is not a list of tables; write [[{key}]] over each.")
    return list(enumerate(entries, 1))


def _files(path: str | Path, where: str, names: Any) -> list[Path]:
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(f'{path}: {where}files is not a list of files; write ["a30_1.csv"] or more.')
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{path}: {where}files names {twice!r} twice; a file is one specimen, so leave one out.")
    return [Path(path).parent / name for name in names]


def _size(path: str | Path, where: str, key: str, value: Any) -> float:
    """In m."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 1 <= value <= 5000:
        raise InputError(f"{path}: {where}{key} = {value!r} is not a length from 1 to 5000 mm.")
    return value / 1e3


def _yes(path: str | Path, where: str, one: dict[str, Any]) -> bool:
    value = one.get("held_out", False)
    if not isinstance(value, bool):
        raise InputError(f"{path}: {where}held_out = {value!r} is neither true nor false.")
    return value


def load(
    test: StripTest, columns: list[str], preload: float | None, friction: bool = False
) -> tuple[StripTest, list[records.Record]]:
    """The same with its virgin readings, and its records; raises InputError for one that cannot be used.

    `friction`: whether the force at the start is that of shear, and no offset.
    """
    out, seen, strip = [], [], test.strip
    for path in test.files:
        for record in records.read_all(path, strip, columns):
            record, part = origin.find(record, branches.split(record), strip.gauge_length, preload, friction=friction)
            E = curves.green_lagrange(record.displacement, strip.gauge_length)
            S = curves.piola_kirchhoff(record.force, record.displacement, strip.gauge_length, strip.area)
            out.append(Readings(record.file, E[part.virgin], S[part.virgin]))
            seen.append(record)
    return replace(test, readings=out), seen


def load_biaxial(test: BiaxialTest, thickness: float) -> BiaxialTest:
    """The same with its readings, up to the largest displacement; thickness in m."""
    readings, strains = [], []
    for path in test.files:
        table = read_table(
            path,
            ("|".join(records.WORDS["force"]), "|".join(WAYS["warp"].split("|") + WAYS["weft"].split("|"))),
            "warp displacement (mm),weft displacement (mm),warp force (N),weft force (N)",
        )
        E, S = _columns(table, test, thickness)
        lead = E.sum(axis=1)
        end = int(np.nanargmax(lead)) + 1
        further = np.flatnonzero(lead[:end] >= np.fmax.accumulate(lead[:end]))
        used = further[np.isfinite(lead[further]) & (lead[further] > 0)]
        if len(used) < LEAST:
            raise InputError(f"{table.file}: has {len(used)} readings while it is drawn, and needs {LEAST}.")
        E, S = E[used], S[used]
        told = np.isfinite(S).any(axis=0)
        if not (np.nanmax(S[:, told], axis=0) > 0).all():
            raise InputError(f"{table.file}: a force is never positive; check its column, or turn its sign.")
        first, second = (Readings(table.file, E[:, i], S[:, i]) if told[i] else None for i in range(2))
        readings.append((first, second))
        strains.append(E)
    return replace(test, readings=readings, strains=strains)


def _columns(table: Table, test: BiaxialTest, thickness: float) -> tuple[Array, Array]:
    """Strains and stresses (Pa) along warp and weft (n, 2), NaN where there is no column."""
    found = {(way, what): _find(table, way, what) for way in WAYS for what in ("displacement", "force")}
    for k, way in enumerate(WAYS):
        if found[way, "displacement"] is None and test.drawn in ("both", way):
            raise InputError(
                f"{table.file}: no column holds the {way} displacement; name one '{way} displacement (mm)'."
            )
        if found[way, "force"] is None and found[("weft", "warp")[k], "force"] is None:
            raise InputError(f"{table.file}: no column holds a force; name one '{way} force (N)'.")
    used = [index for index in found.values() if index is not None]
    table = table.readings(used)
    E, S = np.zeros((len(table.cells), 2)), np.full((len(table.cells), 2), np.nan)
    for k, way in enumerate(WAYS):
        stretch = np.ones(len(table.cells))
        if (index := found[way, "displacement"]) is not None:
            kind, moved = table.si(index, records.ALLOWED["displacement"])
            nominal = moved if kind == "ratio" else moved / test.length[k]
            nominal = nominal - nominal[0]
            stretch, E[:, k] = 1 + nominal, nominal + nominal**2 / 2
        if (index := found[way, "force"]) is not None:
            kind, force = table.si(index, records.ALLOWED["force"])
            area = {"force": test.width[k] * thickness, "force per width": thickness, "stress": 1.0}[kind]
            S[:, k] = force / area / stretch
    return E, S


def _find(table: Table, way: str, what: str) -> int | None:
    """Index of the one column of a quantity along a yarn, or None."""
    found = [i for i, (name, _) in enumerate(table.columns) if re.search(WAYS[way], name) and records.names(what, name)]
    if len(found) > 1:
        several = " and ".join(repr(table.headers[i]) for i in found)
        raise InputError(f"{table.file}: columns {several} could each be the {way} {what}; rename all but one.")
    return found[0] if found else None
