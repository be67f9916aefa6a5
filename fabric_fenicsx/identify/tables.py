"""Tables of test records: CSV with named, unit-bearing columns, as testing machines write them.

Lines of text before the columns, units in a line of their own, semicolons, tabs and decimal commas are understood.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..laws import Array
from . import units

MISSING = {"", "inf", "-inf", "-", "--", "---", "nan", "na", "n/a", "null", "none"}


@dataclass(frozen=True)
class Table:
    """Named columns of a file as (name, unit), and their cells as numbers, NaN where missing."""

    file: str
    columns: list[tuple[str, str | None]]
    headers: list[str]
    values: Array  # (rows, columns)

    def si(self, index: int, kinds: Sequence[str]) -> tuple[str, Array]:
        """Kind of a column's unit, one of `kinds`, and the column in SI; refuses a unit that is missing or wrong."""
        unit = self.columns[index][1]
        head = f"{self.file}: column {self.headers[index]!r}"
        example = {"force": "N", "length": "mm", "time": "s", "ratio": "%", "angle": "deg"}[kinds[0]]
        name = self.columns[index][0]
        if unit is None:
            raise InputError(f"{head} has no unit; write it into the name, as in '{name} ({example})'.")
        found = units.factor(unit)
        if found is None:
            known = ", ".join(u for kind in kinds for u in units.KINDS[kind])
            raise InputError(f"{head} has the unknown unit {unit!r}; give one of {known}.")
        kind, factor = found
        if kind not in kinds:
            raise InputError(f"{head} gives {name} in {unit}, a unit of {kind}; correct the name or the unit.")
        return kind, self.values[:, index] * factor


def read_table(path: str | Path, recognise: Sequence[str], example: str, unnamed: Sequence[str] = ()) -> Table:
    """The columns below the first line in which every one of the words `recognise` (regular expressions) is met.

    `example` is such a line, for the sentence that says that there is none. A file without one has the columns
    `unnamed`, if they are given, from its first line of numbers on.
    """
    file = Path(path).name
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a CSV file.") from error
    except ValueError as error:
        raise InputError(f"{str(path)!r} is no path of a file ({error}); give that of a CSV file.") from error
    if b"\0" in raw:
        raise InputError(f"{file}: is no plain text; export the test as CSV (UTF-8).")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # what most testing machines write
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    start = next((k for k, (_, line) in enumerate(lines) if _names_columns(line, recognise)), None)
    if start is None and unnamed:
        start = next((k for k, (_, line) in enumerate(lines) if _is_number(line.split(_mark(line))[0])), len(lines))
        mark = _mark(lines[start][1]) if start < len(lines) else ","
        lines.insert(start, (0, mark.join(unnamed)))
    if start is None:
        wanted = " and one with ".join(" or ".join(words.replace("|", ", ").rsplit(", ", 1)) for words in recognise)
        raise InputError(
            f"{file}: no line names its columns, one with {wanted}; add one, such as "
            f"{example!r}, or give the columns of all files in the list of tests."
        )
    mark = _mark(lines[start][1])
    numbers = [n for n, _ in lines[start:]]
    try:
        rows = [next(csv.reader([line], delimiter=mark, skipinitialspace=True)) for _, line in lines[start:]]
    except csv.Error as error:
        raise InputError(f"{file}: is no table of readings ({error}); export the test again.") from error
    headers = [cell.strip() for cell in rows[0]]
    body, columns = 1, [units.split(h) for h in headers]
    if len(rows) > 1 and not any(_is_number(cell) for cell in rows[1]) and any(map(_unit, rows[1])):
        columns = [(name, unit or (_unit(cell) or None)) for (name, unit), cell in zip(columns, rows[1], strict=False)]
        body = 2
    if len(columns) < len(headers):
        raise InputError(f"{file}: line {numbers[1]} has fewer units than columns; give one for each.")
    values = np.full((len(rows) - body, len(headers)), np.nan)
    for i, (row, number) in enumerate(zip(rows[body:], numbers[body:], strict=True)):
        if any(cell.strip() for cell in row[len(headers) :]):
            raise InputError(
                f"{file}: line {number} has more cells than there are columns; where numbers have decimal commas, "
                "put semicolons between the columns."
            )
        for j, cell in enumerate(row[: len(headers)]):
            if cell.strip().lower() in MISSING:
                continue
            try:
                values[i, j] = float(_dot(cell))
            except ValueError:
                raise InputError(
                    f"{file}: column {headers[j]!r} holds {shorten(cell)!r} in line {number}, which is no number; "
                    "correct it, or leave the cell empty."
                ) from None
    return Table(file, columns, headers, values)


def shorten(text: str) -> str:
    """What of a cell a sentence shows."""
    return text if len(text) <= 30 else f"{text[:27]}..."


def _names_columns(line: str, recognise: Sequence[str]) -> bool:
    """Whether a line holds every word in a cell of its own."""
    cells = line.lower().split(_mark(line))
    found = [next((i for i, cell in enumerate(cells) if re.search(word, cell)), None) for word in recognise]
    return None not in found and len(set(found)) == len(found)


def _mark(line: str) -> str:
    """What separates the columns; a comma may also stand within a name, or within a number."""
    return next((mark for mark in "\t;" if mark in line), ",")


def _unit(cell: str) -> str:
    """The unit that a cell of a line of units holds, or ''."""
    cell = cell.strip().strip("()[]").strip()
    return cell if units.factor(cell) else ""


def _dot(cell: str) -> str:
    """A number as Python writes it: decimal comma, or commas between thousands."""
    cell = cell.strip().replace("\u2212", "-")
    if "," in cell:
        cell = cell.replace(",", "") if "." in cell or cell.count(",") > 1 else cell.replace(",", ".")
    return cell


def _is_number(cell: str) -> bool:
    try:
        float(_dot(cell))
    except ValueError:
        return False
    return True
