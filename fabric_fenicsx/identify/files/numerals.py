"""Numbers as they are written in different countries: 1234.5, 1234,5, 1,234.5, 1.234,5, 1 234,5, 1'234.5, 1,23,456.

The last mark of a number is the decimal one. A number such as 1,234 tells nothing by itself: the other numbers of its
column decide, then those of the other columns, and last the jump by a thousand that a wrong choice would make.
"""

import re
from collections.abc import Iterable, Sequence

import numpy as np

from ...laws import Array

MISSING = {"", "inf", "-inf", "-", "--", "---", "nan", "na", "n/a", "null", "none", "#n/a", "-nan", "+inf"}
DIGITS = re.compile(
    r"[+-]?(?:\d+[.,]?\d*|[.,]\d+"
    r"|\d{1,3}(?:,\d{3})+(?:\.\d*|,\d\d?)?|\d{1,3}(?:\.\d{3})+(?:,\d*|\.\d\d?)?"
    r"|\d{1,2}(?:,\d\d)+,\d{3}(?:\.\d*)?)(?:[eEdD][+-]?\d+)?"
)  # the last line is that of India
GROUPED = re.compile(r"(?<=\d)[ '’´`_](?=\d{3}(?!\d))")  # thousands by a space, an apostrophe or an underscore
DASHES = re.compile(r"[\u2212\u2010-\u2014](?=[\d.,])")
PLAIN = re.compile(r"[\d.,+eE-]*")  # neither of them
EITHER = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")  # thousands, or a number of three decimals
JUMP = (
    200.0,
    5000.0,
)  # from a number with a mark to its neighbour without one: a thousand, and what it may have grown by


class NoNumber(ValueError):
    """Cell `index` of a column is no number."""

    def __init__(self, index: int) -> None:
        self.index = index


class Unclear(ValueError):
    """The marks of a column contradict each other, or cannot be told apart; the message names two of its cells."""


def missing(cell: str) -> bool:
    """Whether a cell stands for no reading."""
    return cell.strip().lower() in MISSING


def is_number(cell: str) -> bool:
    """Whether a cell is a number in any country."""
    return bool(DIGITS.fullmatch(plain(cell)))


def decimal_marks(cells: Iterable[str]) -> dict[str, str]:
    """The decimal marks that the cells of a column prove, each with the first cell that does."""
    found: dict[str, str] = {}
    for cell in cells:
        if mark := _proof(plain(cell)):
            found.setdefault(mark, cell.strip())
    return found


def numbers(cells: Sequence[str], elsewhere: Iterable[str] = ()) -> Array:
    """The numbers (n,) of a column, NaN where missing; `elsewhere`: the decimal marks that other columns prove.

    Raises NoNumber and Unclear.
    """
    texts = [plain(cell) if not missing(cell) else "" for cell in cells]
    wrong = next((i for i, text in enumerate(texts) if text and not DIGITS.fullmatch(text)), None)
    if wrong is not None:
        raise NoNumber(wrong)
    proved = decimal_marks(cells)
    if len(proved) > 1:
        raise Unclear("writes both {!r} and {!r}".format(*proved.values()))
    either = np.array([bool(EITHER.fullmatch(text)) for text in texts], dtype=bool)
    if not either.any():
        return _values(texts, next(iter(proved), "."))
    bare = np.array([not set(".,") & set(text) for text in texts], dtype=bool)
    first = int(either.argmax())
    own = "," if "," in texts[first] else "."
    known = list(proved) or list(dict.fromkeys(elsewhere))
    if len(known) != 1:
        others = [text for text, e in zip(texts, either, strict=True) if text and not e]
        if others and not any(text.strip("+-0") for text in others):
            raise Unclear(f"holds {cells[first].strip()!r}, which is thousands or decimals")
        known = [own, ".,".replace(own, "")]  # a decimal mark, unless the numbers jump then
    jump: tuple[int, int] | None = None
    for mark in known:
        values = _values(texts, mark)
        jump = _jump(values, either, bare, mark == own)
        if jump is None:
            return values
    raise Unclear("jumps by a thousand between {!r} and {!r}".format(*(cells[i].strip() for i in jump or ())))


def plain(cell: str) -> str:
    """A cell without spaces or apostrophes between thousands, and with a plain minus."""
    cell = cell.strip()
    return cell if PLAIN.fullmatch(cell) else GROUPED.sub("", DASHES.sub("-", cell))


def _proof(text: str) -> str:
    """The decimal mark that a number proves, or ''."""
    mantissa = re.split("[eEdD]", text)[0]
    marks = [c for c in mantissa if c in ".,"]
    if not marks or not DIGITS.fullmatch(text) or EITHER.fullmatch(text):
        return ""
    if len(marks) > 1 and len(set(marks)) == 1 and len(mantissa.rsplit(marks[0], 1)[1]) == 3:
        return ".,".replace(marks[0], "")  # 1,234,567 and 1,23,456; but 1.045.95
    return marks[-1]


def _values(texts: Sequence[str], decimal: str) -> Array:
    """The numbers, of which '' is missing; what is no decimal mark separates thousands."""
    out = np.full(len(texts), np.nan)
    for i, text in enumerate(texts):
        if text:
            whole, mark, part = text.rpartition(decimal)
            if not mark:
                whole, part = text, ""
            whole = whole.replace(".", "").replace(",", "")
            out[i] = float(re.sub("[dD]", "e", f"{whole}.{part}" if mark else whole))
    return out


def _jump(values: Array, either: np.ndarray, bare: np.ndarray, decimal: bool) -> tuple[int, int] | None:
    """Neighbours, one of `either` and one of `bare`, without a mark, of which one is about a thousand times the other.

    The former is the smaller one, where its mark was taken for a decimal one, else the larger.
    """
    seen = np.flatnonzero(np.isfinite(values) & (values != 0))
    pairs = np.column_stack([seen[:-1], seen[1:]])
    pairs = pairs[(either[pairs] & bare[pairs[:, ::-1]]).any(axis=1)]
    size = np.abs(values[pairs])
    ratio = np.where(either[pairs[:, 0]], size[:, 0] / size[:, 1], size[:, 1] / size[:, 0])
    ratio = 1 / ratio if decimal else ratio
    bad = np.flatnonzero((ratio > JUMP[0]) & (ratio < JUMP[1]))
    return (int(pairs[bad[0], 0]), int(pairs[bad[0], 1])) if len(bad) else None
