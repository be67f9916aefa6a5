"""Tables of test records: CSV with named, unit-bearing columns, as testing machines write them.

Lines of text before, between and after the readings, units in a line of their own, columns between commas, semicolons,
tabs, bars or spaces, repeated heads, and the numbers of any country are understood; columns that nobody asks for may
hold anything.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...laws import Array
from . import decoding, numerals, units
from .cleaning import seconds

SPACES = r"\s+(?![\[(])"  # a unit in brackets belongs to the name before it
SHOWN = 4  # names of a column that the sentence on a missing head tells
EXAMPLES = {"force": "N", "length": "mm", "time": "s", "ratio": "%", "angle": "deg", "curvature": "1/cm"}
EXAMPLES |= {"force per width": "gf/cm", "moment per width": "gf cm/cm"}
COMMENT = re.compile(r"#(?![\"\s]*[\t;,|])")  # a lone # is the head of a column of numbers
FEW = 8  # lines below another head that are no test, but a summary


@dataclass(frozen=True)
class Table:
    """Named columns of a file as (name, unit), and their cells (rows, columns) as they were written."""

    file: str
    columns: list[tuple[str, str | None]]
    headers: list[str]
    cells: list[list[str]]
    lines: list[int]
    """Of each row, in the file."""
    blocks: list[int]
    """Of each row, how many heads stand above it."""
    notes: tuple[str, ...] = ()

    def si(self, index: int, kinds: Sequence[str]) -> tuple[str, Array]:
        """Kind of a column's unit, one of `kinds`, and the column in SI; refuses a unit that is missing or wrong."""
        unit = self.columns[index][1]
        head = f"{self.file}: column {self.headers[index]!r}"
        example = EXAMPLES[kinds[0]]
        name = self.columns[index][0]
        if unit is None:
            raise InputError(f"{head} has no unit; write it into the name, as in '{name} ({example})'.")
        found = units.factor(unit)
        if found is None:
            known = ", ".join(u for kind in kinds for u in units.SHOWN.get(kind, units.KINDS[kind]))
            raise InputError(f"{head} has the unknown unit {unit!r}; give one of {known}.")
        kind, factor = found
        if kind not in kinds:
            raise InputError(f"{head} gives {name} in {unit}, a unit of {kind}; correct the name or the unit.")
        return kind, self.numbers(index) * factor

    def numbers(self, index: int) -> Array:
        """The numbers (rows,) of a column, NaN where missing."""
        cells = self.column(index)
        others = (numerals.decimal_marks(self.column(j)) for j in range(len(self.headers)) if j != index)
        try:
            return numerals.numbers(cells, (mark for marks in others if len(marks) == 1 for mark in marks))
        except numerals.NoNumber as error:
            raise InputError(
                f"{self.file}: column {self.headers[index]!r} holds {shorten(cells[error.index])!r} in line "
                f"{self.lines[error.index]}, which is no number; correct it, or leave the cell empty."
            ) from None
        except numerals.Unclear as error:
            raise InputError(
                f"{self.file}: column {self.headers[index]!r} {error}; write its numbers without marks between "
                "thousands."
            ) from None

    def column(self, index: int) -> list[str]:
        """The cells (rows,) of a column."""
        return [row[index] for row in self.cells]

    def take(self, rows: Sequence[int]) -> "Table":
        """The same with some of the rows."""
        return replace(
            self,
            cells=[self.cells[i] for i in rows],
            lines=[self.lines[i] for i in rows],
            blocks=[self.blocks[i] for i in rows],
        )

    def readings(self, used: Sequence[int], clock: int | None = None) -> "Table":
        """The same without the rows that hold words in the columns `used`, and a note on them.

        Words where all readings are words or missing, and after the last reading, are remarks and results; elsewhere
        they stay, and `numbers` refuses them. What has a word in place of a time, in the column `clock`, is no reading.
        """
        kinds = np.array([[_kind(row[j]) for j in used] for row in self.cells]).reshape(-1, len(used))
        words, known = (kinds == "word").any(axis=1), (kinds == "number").any(axis=1)
        timeless = np.zeros(len(words), dtype=bool)
        if clock is not None:
            timeless = np.array(
                [_kind(cell) == "word" and not np.isfinite(seconds(cell)) for cell in self.column(clock)], dtype=bool
            )
            timeless &= 2 * np.count_nonzero(timeless) < len(timeless)
        whole = np.flatnonzero(~words & known & ~timeless)
        last = int(whole[-1]) if len(whole) else -1
        out = (words & ~known) | ((words | timeless) & (np.arange(len(words)) > last))
        note = told(self.file, [self.lines[i] for i in np.flatnonzero(out)], "no readings")
        return replace(self.take(np.flatnonzero(~out).tolist()), notes=(*self.notes, *note))


def told(file: str, lines: Sequence[int], what: str) -> tuple[str, ...]:
    """A note on lines that are left out, if there are any."""
    if not len(lines):
        return ()
    first = f"line {lines[0]} holds" if len(lines) == 1 else f"{len(lines)} lines from {lines[0]} on hold"
    return (f"{file}: {first} {what} and {'is' if len(lines) == 1 else 'are'} left out.",)


def read_table(path: str | Path, recognise: Sequence[str], example: str, unnamed: Sequence[str] = ()) -> Table:
    """The columns below the lines in which every one of the words `recognise` (regular expressions) is met.

    `example` is such a line, for the sentence that says that there is none. A file without one has the columns
    `unnamed`, if they are given, from its first line of numbers on. Of several heads that differ the one with the
    most lines below it counts; what stands below the others must be short.
    """
    file = Path(path).name
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a CSV file.") from error
    except ValueError as error:
        raise InputError(f"{str(path)!r} is no path of a file ({error}); give that of a CSV file.") from error
    text = decoding.decode(raw, file)
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not COMMENT.match(line)]
    heads = [k for k in range(len(lines)) if _names_columns([line for _, line in lines[k : k + 4]], recognise)]
    if not heads and unnamed:
        start = next((k for k, (_, line) in enumerate(lines) if _starts_with_number(line)), len(lines))
        mark = _mark([line for _, line in lines[start : start + 50]]) if start < len(lines) else ","
        lines.insert(start, (0, ("  " if mark == SPACES else mark).join(unnamed)))
        heads = [start]
    if not heads:
        wanted = " and one with ".join(
            " or ".join(", ".join(words.split("|")[:SHOWN]).rsplit(", ", 1)) for words in recognise
        )
        raise InputError(
            f"{file}: no line names its columns, one with {wanted}; add one, such as "
            f"{example!r}, or give the columns of all files in the list of tests."
        )
    longest = max(heads, key=lambda k: next((h for h in heads if h > k), len(lines)) - k)
    return _columns(file, lines, heads, longest)


def _columns(file: str, lines: list[tuple[int, str]], heads: list[int], main: int) -> Table:
    """The table below the head `main` and those that repeat it; `heads` are indices into `lines`."""
    end = next((h for h in heads if h > main), len(lines))
    mark = _mark([line for _, line in lines[main:end]])
    try:
        rows = [_cells(line, mark) for _, line in lines]
    except csv.Error as error:
        raise InputError(f"{file}: is no table of readings ({error}); export the test again.") from error
    headers = rows[main]
    columns, named = [units.split(h) for h in headers], rows[main + 1 : main + 2]
    with_units = bool(named) and not any(map(numerals.is_number, named[0])) and any(map(_unit, named[0]))
    if with_units:
        columns = [(name, unit or (_unit(cell) or None)) for (name, unit), cell in zip(columns, named[0], strict=False)]
    if len(columns) < len(headers):
        raise InputError(f"{file}: line {lines[main + 1][0]} has fewer units than columns; give one for each.")

    table = Table(file, columns, headers, [], [], [])
    notes: list[str] = []
    for start, stop in zip(heads, [*heads[1:], len(lines)], strict=True):
        block = range(start + 1, stop)
        if rows[start] != headers:
            if sum(_readings(rows[k]) for k in block) >= FEW:
                raise InputError(
                    f"{file}: line {lines[start][0]} names other columns than line {lines[main][0]}; "
                    "put the two tables into files of their own."
                )
            notes += told(file, [lines[k][0] for k in range(start, stop)], "another table") if start > main else ()
            continue
        for k in block:
            if with_units and rows[k] == named[0]:
                continue
            table.cells.append(rows[k])
            table.lines.append(lines[k][0])
            table.blocks.append(start)
    level = _level(table, mark)
    return replace(level, notes=(*notes, *level.notes))


def _level(table: Table, mark: str) -> Table:
    """The same with as many cells in each row as there are columns; refuses a row of numbers with more."""
    width, short = len(table.headers), set()
    for i, (row, line) in enumerate(zip(table.cells, table.lines, strict=True)):
        wide = any(not numerals.missing(cell) for cell in row[width:])
        if wide and not any(_kind(cell) == "word" for cell in row):
            raise InputError(
                f"{table.file}: line {line} has more cells than there are columns; where numbers have decimal commas, "
                "or commas between thousands, put semicolons between the columns."
            )
        if wide or (mark == SPACES and len(row) < width):  # a remark, or nobody knows which cell is missing
            short.add(i)
        table.cells[i] = (row + [""] * width)[:width]
    if not short:
        return table
    rest = table.take([i for i in range(len(table.cells)) if i not in short])
    return replace(rest, notes=told(table.file, [table.lines[i] for i in sorted(short)], "no readings"))


def shorten(text: str) -> str:
    """What of a cell a sentence shows."""
    return text if len(text) <= 30 else f"{text[:27]}..."


def _names_columns(lines: Sequence[str], recognise: Sequence[str]) -> bool:
    """Whether the first of some lines holds every word in a cell of its own.

    Between spaces any sentence does: there a line of as many cells must follow, half of them numbers.
    """
    if not all(re.search(word, lines[0].lower()) for word in recognise):
        return False
    mark = _mark(lines[:1])
    cells = _cells(lines[0].lower(), mark, strict=False)
    names = [units.split(cell)[0] for cell in cells]  # "m" may be a moment, and is a unit
    found = [next((i for i, name in enumerate(names) if re.search(word, name)), None) for word in recognise]
    if None in found or len(set(found)) < len(found):
        return False
    below = [line.split() for line in lines[1:]]
    return mark != SPACES or any(len(row) == len(cells) and _readings(row) for row in below)


def _readings(row: Sequence[str]) -> bool:
    """Whether half of the cells of a row are numbers."""
    return 2 * sum(map(numerals.is_number, row)) >= len(row)


def _cells(line: str, mark: str, strict: bool = True) -> list[str]:
    """The cells of a line, without spaces around them."""
    if mark == SPACES:
        wide = re.split(r"\s{2,}", line.strip())
        return wide if not _starts_with_number(line) and len(wide) > 1 else re.split(SPACES, line.strip())
    if not strict:
        return [cell.strip() for cell in line.split(mark)]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]


def _mark(lines: Sequence[str]) -> str:
    """What separates the columns below a head: the first mark that it has, unless that is within its names or numbers.

    A comma may stand within a name, or within a number; then only spaces are left.
    """
    mark = next((mark for mark in "\t;|" if mark in lines[0]), "")
    if mark:
        return mark
    if "," not in lines[0]:
        return SPACES
    body = [line for line in lines if _starts_with_number(line)]
    spaced = {len(re.split(SPACES, lines[0].strip())), len(re.split(r"\s{2,}", lines[0].strip()))} - {1}
    by_comma = sum(len(_cells(line, ",", strict=False)) > 1 for line in body)
    return SPACES if body and sum(len(line.split()) in spaced for line in body) > by_comma else ","


def _starts_with_number(line: str) -> bool:
    first = re.split(r"[\t;|]|\s", line.strip(), maxsplit=1)[0]
    return numerals.is_number(first.strip('"')) or numerals.is_number(first.split(",")[0].strip('"'))


def _unit(cell: str) -> str:
    """The unit that a cell of a line of units holds, or ''."""
    cell = cell.strip().strip("()[]").strip()
    return cell if units.factor(cell) else ""


def _kind(cell: str) -> str:
    return "" if numerals.missing(cell) else "number" if numerals.is_number(cell) else "word"
