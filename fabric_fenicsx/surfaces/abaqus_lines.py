"""Lines of an `.inp` file of Abaqus or CalculiX: keywords with their parameters, data, and what it includes."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from ..errors import InputError
from .preparing import decoded

_COMMA = r',(?=(?:[^"]*"[^"]*")*[^"]*$)'
"""That is not between quotes."""


@dataclass
class Line:
    """A line of data, or a keyword with its parameters."""

    file: Path
    number: int
    words: list[str]
    keyword: str = ""
    parameters: dict[str, str] = field(default_factory=dict)
    more: bool = False
    """It ends in a comma."""

    def refuse(self, reason: str) -> NoReturn:
        raise InputError(f"{str(self.file)!r}, line {self.number}: {reason}.")

    def parameter(self, name: str) -> str:
        """The value of a parameter, which must be there."""
        if not self.parameters.get(name):
            self.refuse(f"*{self.keyword} needs {name}=...")
        return self.parameters[name]

    def whole(self, k: int) -> int:
        """The word k, a whole number."""
        try:
            return int(self.words[k])
        except (ValueError, IndexError):
            self.refuse(f"{self.words[k] if k < len(self.words) else 'nothing'!r} is not a whole number")

    def real(self, k: int) -> float:
        """The word k, a number, 0 where it is left out; also as Fortran writes it."""
        word = self.words[k] if k < len(self.words) else ""
        try:
            return float(re.sub("[dD]", "e", word)) if word else 0.0
        except ValueError:
            self.refuse(f"{word!r} is not a number")


def keyword_lines(path: Path, before: tuple[Path, ...] = ()) -> Iterator[Line]:
    """The lines of a file and of those that it includes, without comments; a keyword that goes on is one line."""
    open_keyword: Line | None = None
    for number, text in enumerate(decoded(path).splitlines(), 1):
        text = text.strip()
        if not text or text.startswith("**"):
            continue
        words = [word.strip() for word in re.split(_COMMA if '"' in text else ",", text)]
        more = words[-1] == ""
        if more:
            words.pop()
        if open_keyword is not None and not text.startswith("*") and not re.match(r"[-+.\d]", text):
            line = open_keyword
        elif text.startswith("*"):
            if open_keyword is not None:
                yield from _with_input(open_keyword, before)
            line = Line(path, number, [], re.sub(r"\s", "", words.pop(0).lstrip("*")).upper())
        else:
            if open_keyword is not None:
                yield from _with_input(open_keyword, before)
                open_keyword = None
            yield Line(path, number, [word.strip('"') for word in words], more=more)
            continue
        for word in words:
            key, _, value = word.partition("=")
            line.parameters[re.sub(r"\s", "", key).upper()] = value.strip().strip('"')
        open_keyword = line if more else None
        if not more:
            yield from _with_input(line, before)
    if open_keyword is not None:
        yield from _with_input(open_keyword, before)


def _with_input(line: Line, before: tuple[Path, ...]) -> Iterator[Line]:
    """A keyword, and the lines of the file that it takes in."""
    if line.keyword != "INCLUDE":
        yield line
    if line.keyword == "INCLUDE" or "INPUT" in line.parameters:
        file = line.file.parent / line.parameter("INPUT")
        if file.resolve() in (*before, line.file.resolve()):
            line.refuse(f"{line.parameter('INPUT')!r} takes in itself")
        if not file.is_file():
            line.refuse(f"there is no file {str(file)!r}")
        yield from keyword_lines(file, (*before, line.file.resolve()))
