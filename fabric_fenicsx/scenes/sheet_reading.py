"""What the table [sheet] of a scene says of its materials, of their warp, and of how they bend."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from ..entries import Table
from ..laws import Poisson
from ..laws.named import BENDING, DEFAULT, NAMES

type Vector = tuple[float, ...]


@dataclass(frozen=True)
class Ply:
    """One of several layers of cloth: a fabric by name or file, and the angle of its warp in radians."""

    fabric: str
    angle: float


@dataclass(frozen=True)
class Entry:
    """A material as a scene has it, on the group `at`, "" for the whole sheet; plies: of a lay-up, if it is one."""

    at: str
    fabric: str
    plies: tuple[Ply, ...]
    law: str
    poisson: Poisson
    shear_hysteresis: bool
    warp: Vector | dict[str, Vector]
    bending: str
    layers: int | None


def materials(sheet: Table, folder: Path) -> tuple[Entry, ...]:
    """What the sheet is made of; folder: where fabric files are."""
    if "material" not in sheet.entries:
        sheet.expect("fabric", "law poisson shear_hysteresis warp kinematics element bending layers")
        return (_entry(sheet, folder, "", warp(sheet)),)
    sheet.expect("material", "kinematics element")
    found = []
    for table in sheet.tables("material"):
        if "ply" in table.entries:
            table.expect("at ply", "law poisson shear_hysteresis warp layers")
        else:
            table.expect("at fabric", "law poisson shear_hysteresis warp bending layers")
        if isinstance(table.entries.get("warp"), dict):
            table.refuse("warp", "is not a direction", "write it as [1, 0, 0]")
        known = {key: sheet.entries[key] for key in ("kinematics",) if key in sheet.entries}
        own = replace(table, entries=table.entries | known)
        found.append(_entry(own, folder, table.text("at"), warp(table)))
    if len({entry.at for entry in found}) < len(found):
        sheet.refuse("material", "has two materials at one group", "leave one of them out")
    if not found:
        sheet.refuse("material", "is empty", "write each under [[sheet.material]]")
    return tuple(found)


def _entry(table: Table, folder: Path, at: str, direction: Vector | dict[str, Vector]) -> Entry:
    plies = []
    for ply in table.tables("ply"):
        ply.expect("fabric", "angle_deg")
        plies.append(Ply(_fabric(ply, folder), math.radians(ply.real("angle_deg", 0.0))))
    if plies and table.entries.get("kinematics") == "membrane":
        table.refuse("ply", "is of a shell, and a membrane does not bend", "give its fabric")
    bends = "layers" if plies else bending(table)
    layered = bends == "layers"
    return Entry(
        at=at,
        fabric="" if plies else _fabric(table, folder),
        plies=tuple(plies),
        law=table.choice("law", NAMES, DEFAULT),
        poisson=table.choice("poisson", ("measured", "lowered")),
        shear_hysteresis=table.yes("shear_hysteresis", True),
        warp=direction,
        bending=bends,
        layers=table.count("layers", 2 if plies else 3) if layered else None,
    )


def _fabric(table: Table, folder: Path) -> str:
    fabric = table.text("fabric")
    return str(folder / fabric) if fabric.endswith(".toml") else fabric


def bending(sheet: Table) -> str:
    """How the sheet bends, a name of `named.BENDING`; "" for a membrane."""
    for key in ("bending", "layers"):
        if key in sheet.entries and sheet.entries.get("kinematics") == "membrane":
            sheet.refuse(key, "is of a shell, and a membrane does not bend", "leave it out")
    chosen = sheet.choice("bending", BENDING, "layers" if "layers" in sheet.entries else "own")
    if chosen == "own" and "layers" in sheet.entries:
        sheet.refuse("layers", "does not go with bending = 'own'", "leave one of them out")
    return "" if sheet.entries.get("kinematics") == "membrane" else chosen


def warp(sheet: Table) -> Vector | dict[str, Vector]:
    """A direction, or one for each group of cells."""
    if "warp" not in sheet.entries:
        return (1.0, 0.0, 0.0)
    if isinstance(sheet.entries["warp"], dict):
        groups = sheet.table("warp")
        if not groups.entries:
            sheet.refuse("warp", "names no group", "write a direction, or one for each group of cells")
        return {name: _direction(groups, name) for name in groups.entries}
    return _direction(sheet, "warp")


def _direction(table: Table, key: str) -> Vector:
    numbers = table.numbers(key, 3)
    if not any(numbers):
        table.refuse(key, "is no direction", "write it as [1, 0, 0]")
    return numbers
