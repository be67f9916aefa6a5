"""What the table [sheet] of a scene says of its warp, and of how it bends."""

from ..entries import Table
from ..laws.named import BENDING

type Vector = tuple[float, ...]


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
