"""What the tables [[body]] and [contact] of a scene say, and the bodies and the contact that they make.

Nothing of `contact` is imported for a scene that has none of it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..entries import Table
from ..sheet import Sheet
from . import shipped
from .sheet_reading import Vector
from .support_reading import Course, move, whole_course

if TYPE_CHECKING:
    from ..contact.bodies import Body
    from ..contact.contact import Contact

KINDS = {
    "plane": ("", "normal point_m size_m"),
    "sphere": ("radius_m", "centre_m cells"),
    "cylinder": ("radius_m length_m", "centre_m axis cells"),
    "capsule": ("radius_m length_m", "centre_m axis cells"),
    "box": ("size_m", "centre_m orientation_deg cells"),
    "ring": ("radius_m wire_m", "centre_m axis cells"),
    "surface": ("file", "numbers scale merge"),
    "frames": ("frames", "rate_per_s scale"),
}
"""Kind of body, see `contact.bodies` -> keys that it needs, and those that it may have."""
MOVE = {kind: "shift_m turn_deg about_m path" for kind in KINDS} | {"plane": "shift_m path", "frames": "path"}


MASS = "mass_kg inertia_kg_m2 velocity_m_per_s spin_rad_per_s"
FIXED = ("plane", "frames")
"""Kinds that cannot have mass."""

type Options = dict[str, float | bool | Vector]
"""Those of `contact.Contact` that the scene gives, in SI units."""


@dataclass(frozen=True)
class Solid:
    """A body; options: of its class in `contact.bodies`, in SI units. Its move is that of a `Support`.

    A path leads one of frames through the time that they take; without one, their times are those of the motion.
    """

    name: str
    kind: str
    options: dict[str, Any]
    shift: Vector
    turn: Vector
    about: Vector
    path: Course
    motion: dict[str, Any]
    """What `Body.free` takes, of a body with mass."""


def solids(file: Table, folder: Path, dynamic: bool, end: float, trust: bool) -> tuple[Solid, ...]:
    """All bodies of a scene file; folder: where surfaces are; trust: whether their meshes may run programs."""
    found = []
    for table in file.tables("body"):
        kind = table.one_of("kind", tuple(KINDS))
        needed, more = KINDS[kind]
        table.expect(f"name kind {needed}", f"{more} {MOVE[kind]} {'' if kind in FIXED else MASS}")
        keys = [key for key in f"{needed} {more}".split() if key in table.entries]
        options = dict(_option(table, key, kind, folder) for key in keys)
        if kind == "surface":
            options["trust"] = trust
        # frames have times of their own
        own = kind == "frames" and dynamic and "path" not in table.entries
        path = () if own else whole_course(table, dynamic, end)
        free = _free(table, dynamic)
        for key in MOVE[kind].split() if free else []:
            if key in table.entries:
                table.refuse(key, "leads a body that its mass_kg lets move freely", "leave one of the two out")
        found.append(Solid(table.text("name"), kind, options, *move(table), () if free else path, free))
    if "body" in file.entries and not found:
        file.refuse("body", "is empty", "write each under [[body]]")
    return tuple(found)


def _free(table: Table, dynamic: bool) -> dict[str, Any]:
    """What a body with mass moves with, in SI units; nothing for one without."""
    if "mass_kg" not in table.entries:
        for key in MASS.split():
            if key in table.entries:
                table.refuse(key, "belongs to a body that moves freely", "give its mass_kg too")
        return {}
    if not dynamic:
        table.refuse("mass_kg", "lets a body move freely, which takes time", "give [dynamics], or lead it")
    motion: dict[str, Any] = {"mass": table.positive("mass_kg")}
    if "inertia_kg_m2" in table.entries:
        words = isinstance(table.entries["inertia_kg_m2"], str)
        motion["inertia"] = table.choice("inertia_kg_m2", ("solid",)) if words else table.numbers("inertia_kg_m2", 3)
    for key, name in (("velocity_m_per_s", "velocity"), ("spin_rad_per_s", "spin")):
        if key in table.entries:
            motion[name] = table.numbers(key, 3)
    return motion


def _option(table: Table, key: str, kind: str, folder: Path) -> tuple[str, Any]:
    """Name and value in SI units of what a body is made with."""
    if key == "file":
        return "path", str(shipped.mesh(folder, table.text(key)))
    if key == "frames":
        return "path", str(folder / table.text(key))
    if key == "numbers":
        own = table.table(key)
        return key, {name: own.number(name, value) for name, value in own.entries.items()}
    if key == "cells":
        return key, table.count(key, 1)
    if key == "orientation_deg":
        return "turn", tuple(math.radians(angle) for angle in table.numbers(key, 3))
    name = key.removesuffix("_m").removesuffix("_per_s")
    if name in ("radius", "length", "wire", "scale", "merge", "rate") or (name == "size" and kind == "plane"):
        return name, table.positive(key)
    numbers = table.numbers(key, 3)
    if name in ("normal", "axis") and not any(numbers):
        table.refuse(key, "is no direction", "write it as [0, 0, 1]")
    if name == "size" and min(numbers) < 1e-15:
        table.refuse(key, "holds a number that is not positive", "give the lengths of three edges")
    return name, numbers


def contact(file: Table) -> Options | None:
    """How surfaces touch; None where nothing is to touch."""
    if not {"contact", "body"} & file.entries.keys():
        return None
    table = file.table("contact") if "contact" in file.entries else Table(file.file, "contact.", {})
    lengths = {"offset_m": "offset", "reach_m": "reach", "stiffness_Pa": "stiffness"}
    lengths |= {"slip_m_per_s": "slip", "creep_m": "creep"}
    table.expect("", f"friction static_friction itself {' '.join(lengths)}")
    options: Options = {name: table.positive(key) for key, name in lengths.items() if key in table.entries}
    friction = _coefficients(table, "friction", 0.0)
    static = _coefficients(table, "static_friction", friction)
    if (np.array(static) < friction).any():
        said = f"{friction:g}" if isinstance(friction, float) else f"{list(friction)}"
        table.refuse("static_friction", f"is less than the friction of sliding, {said}", "give at least that")
    itself = table.yes("itself", True)
    if not itself and "body" not in file.entries:
        table.refuse("itself", "leaves nothing to touch", "add a [[body]], or leave [contact] out")
    return options | {"friction": friction, "static": static, "itself": itself}


def _coefficients(table: Table, key: str, default: float | Vector) -> float | Vector:
    """A coefficient of friction, or two, along warp and weft."""
    found = default
    if key in table.entries:
        told = table.entries[key]
        found = table.numbers(key, 2) if isinstance(told, list) else table.number(key, told)
    if np.min(found) < 0.0:
        table.refuse(key, "is negative", "give a coefficient of 0 or more")
    return found


def led(solid: Solid) -> tuple[Body, Callable[[float], None]]:
    """A body, and what leads it to a share of its move. Raises InputError."""
    from ..contact import bodies, deforming

    if solid.kind == "frames":
        moved = deforming.Deforming.read(**solid.options, name=solid.name)
        first, last = moved.times[[0, -1]]
        return moved, lambda part: moved.at(first + part * (last - first) if solid.path else part)
    body = bodies.KINDS[solid.kind](**solid.options, name=solid.name)
    if solid.motion:
        return body.free(**solid.motion), lambda part: None
    shift, turn = np.array(solid.shift), np.array(solid.turn)
    return body, lambda part: body.move(part * shift, part * turn, solid.about)


def touching(cloth: Sheet, bodies: list[Body], options: Options | None) -> Contact | None:
    """The contact of a sheet that is where it starts, as its bodies are. Raises InputError, on every rank."""
    if options is None:
        return None
    from ..contact.contact import Contact

    touch = Contact(cloth, bodies, **options)  # type: ignore[arg-type]
    if touch.assumed and cloth.domain.mesh.comm.rank == 0:
        warnings.warn(f"contact.stiffness_Pa is assumed: {touch.describe()}.", stacklevel=3)
    return touch
