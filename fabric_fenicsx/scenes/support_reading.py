"""What the tables [[support]] and [[load]] of a scene say, and by which path either is put on."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..entries import Table
from .sheet_reading import Vector

AXES = ("x", "y", "z")
LOADS = {
    "gravity": ("acceleration_m_per_s2", 3),
    "pressure": ("pressure_Pa", 1),
    "surface": ("force_N_per_m2", 3),
    "edge": ("force_N_per_m", 3),
    "moment": ("moment_N_m_per_m", 3),
    "point": ("force_N", 3),
}
"""Kind of load -> key of its value, and how many numbers that is."""

ZERO: Vector = (0.0, 0.0, 0.0)

type Course = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Support:
    """How a group is held or moved; shift in m, turn in radians, about a point in m."""

    at: str
    kind: str
    axis: int
    shift: Vector
    turn: Vector
    about: Vector
    path: Course


@dataclass(frozen=True)
class Load:
    """A load in SI units on a group, or on the whole sheet (at is "")."""

    kind: str
    at: str
    value: Vector
    path: Course


def axes(held: Support) -> str:
    """The axes along which a support holds or leads."""
    return {"lead": AXES[held.axis], "symmetry": AXES[held.axis], "rigid": ""}.get(held.kind, "xyz")


def support(table: Table, dynamic: bool, end: float) -> Support:
    """A support; end: of the motion, in s, to which a path goes that is left out."""
    kinds = {"hinge": "", "clamp": "", "symmetry": "axis", "lead": "axis shift_m", "grip": "", "rigid": ""}
    kind = table.choice("kind", tuple(kinds))
    table.expect(f"at kind {kinds[kind]}", {"lead": "path", "grip": "shift_m turn_deg about_m path"}.get(kind, ""))
    shift, turn, about = ZERO, ZERO, ZERO
    if kind == "lead":
        shift = (table.number("shift_m", table.entries["shift_m"]),)
    elif kind == "grip":
        shift, turn, about = move(table)
    path = whole_course(table, dynamic, end)
    axis = AXES.index(table.choice("axis", AXES)) if "axis" in table.entries else 0
    return Support(table.text("at"), kind, axis, shift, turn, about, path)


def move(table: Table) -> tuple[Vector, Vector, Vector]:
    """Shift in m, turn in radians, and the point in m that it is about, of what moves as one."""
    shift, turn, about = (
        table.numbers(key, 3) if key in table.entries else ZERO for key in ("shift_m", "turn_deg", "about_m")
    )
    return shift, tuple(np.radians(turn).tolist()), about


def load(table: Table, dynamic: bool) -> Load:
    """A load."""
    kind = table.one_of("kind", tuple(LOADS))
    key, count = LOADS[kind]
    needs_place = kind in ("edge", "moment", "point")
    table.expect(f"kind {key}" + (" at" if needs_place else ""), "path" + ("" if needs_place else " at"))
    value = table.numbers(key, 3) if count == 3 else (table.number(key, table.entries[key]),)
    at = table.text("at") if "at" in table.entries else ""
    return Load(kind, at, value, course(table, ((0.0, 1.0),) if dynamic else ((0.0, 0.0), (1.0, 1.0))))


def whole_course(table: Table, dynamic: bool, end: float) -> Course:
    """The path of a move; one that is left out goes evenly to the whole of it, in motion at the end (s)."""
    return course(table, ((0.0, 0.0), (end if dynamic else 1.0, 1.0)))


def course(table: Table, default: Course) -> Course:
    """Pairs of load part or time, and share; the first of each pair grows."""
    listed = table.entries.get("path", [[*pair] for pair in default])
    if not isinstance(listed, list) or not listed or not all(isinstance(p, list) and len(p) == 2 for p in listed):
        table.refuse("path", "is not a list of pairs", "write it as [[0, 0], [1, 1]]")
    pairs = tuple((table.number("path", a), table.number("path", b)) for a, b in listed)
    if any(before[0] >= after[0] for before, after in pairwise(pairs)):
        table.refuse("path", "goes back", "order its pairs by their first number")
    return pairs
