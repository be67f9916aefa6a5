"""TOML files as tables whose entries are checked as they are taken out; a fault is one sentence that names the key."""

from __future__ import annotations

import reprlib
import tomllib
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

from fabric_fenicsx.errors import InputError


def read(path: Path, what: str, example: str) -> Table:
    """The whole of a TOML file; `what` it should be, and an `example` of it, for messages. Raises InputError."""
    try:
        raw = path.read_bytes()
        return Table(str(path), "", tomllib.loads(raw.decode("utf-8-sig")), example)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of {what}.") from error
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise InputError(f"{path}: is not TOML, for line {line} is not UTF-8 text; save it as UTF-8.") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not TOML ({error}); correct it there.") from error


@dataclass(frozen=True)
class Table:
    """One table of a file; whatever is taken out of it has been checked."""

    file: str
    prefix: str  # "" or, as an example, "warp."
    entries: dict[str, Any]
    example: str = ""

    def refuse(self, key: str, reason: str, remedy: str) -> NoReturn:
        """Raise the one sentence that names file, key, value, reason and remedy."""
        value = f" = {reprlib.repr(self.entries[key])}" if key in self.entries else ""
        raise InputError(f"{self.file}: {self.prefix}{key}{value} {reason}; {remedy}.")

    def expect(self, required: str, optional: str = "") -> None:
        """Refuse unknown keys, and then missing ones: a misspelt key is both, and better called unknown."""
        known = f"{required} {optional}".split()
        for key in (key for key in self.entries if key not in known):
            near = get_close_matches(key, known, n=1)
            hint = f"perhaps {self.prefix}{near[0]} is meant" if near else f"known here are {', '.join(known)}"
            self.refuse(key, "is not a known key", hint)
        for key in required.split():
            if key not in self.entries:
                self.refuse(key, "is missing", f"add it, as in {self.example}" if self.example else "add it")

    def table(self, key: str) -> Table:
        """The table `key`."""
        if not isinstance(self.entries[key], dict):
            self.refuse(key, "is not a table", f"write its entries under [{self.prefix}{key}]")
        return Table(self.file, f"{self.prefix}{key}.", self.entries[key], self.example)

    def tables(self, key: str) -> list[Table]:
        """The tables of the list `key`; none where it is left out."""
        listed = self.entries.get(key, [])
        if not isinstance(listed, list) or not all(isinstance(entry, dict) for entry in listed):
            self.refuse(key, "is not a list of tables", f"write each under [[{self.prefix}{key}]]")
        return [Table(self.file, f"{self.prefix}{key}[{i}].", e, self.example) for i, e in enumerate(listed, 1)]

    def text(self, key: str) -> str:
        """The text `key`, not empty."""
        value = self.entries[key]
        if not isinstance(value, str) or not value.strip():
            self.refuse(key, "is not a text", "write at least one word in double quotes")
        return value

    def one_of(self, key: str, known: tuple[str, ...]) -> str:
        """The text `key`, one of a few, which has to be there."""
        if key not in self.entries:
            self.refuse(key, "is missing", f"write one of {', '.join(known)}")
        return self.choice(key, known)

    def choice[T: str](self, key: str, known: tuple[T, ...], default: T | None = None) -> T:
        """The text `key`, one of a few; the first, or `default`, where it is left out."""
        if key not in self.entries:
            return known[0] if default is None else default
        value = self.entries[key]
        if value not in known:
            near = get_close_matches(value, known, n=1) if isinstance(value, str) else []
            hint = f"perhaps {near[0]!r} is meant" if near else f"known are {', '.join(known)}"
            self.refuse(key, "is not known", hint)
        return known[known.index(value)]

    def number(self, key: str, value: Any) -> float:
        """`value`, which is the entry `key` or a member of it; 1e15 is as good as infinite."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            which = "is" if value is self.entries[key] else f"holds {reprlib.repr(value)},"
            self.refuse(key, f"{which} not a number", "write numbers, without quotes")
        if not abs(value) < 1e15:  # or NaN
            self.refuse(key, "is not a finite number below 1e15", "give measured values")
        return float(value)

    def numbers(self, key: str, count: int | None = None) -> tuple[float, ...]:
        """The list of numbers `key`, of a given length."""
        listed = self.entries[key]
        if not isinstance(listed, list) or (count is not None and len(listed) != count) or not listed:
            self.refuse(key, f"is not a list of {count or 'some'} numbers", "write it as [0, 0, 1]")
        return tuple(self.number(key, value) for value in listed)

    def real(self, key: str, default: float) -> float:
        """The number `key`, or what it is where left out."""
        return self.number(key, self.entries[key]) if key in self.entries else default

    def positive(self, key: str, default: float | None = None) -> float:
        """The entry `key`; below 1e-15 it is as good as zero."""
        if default is not None and key not in self.entries:
            return default
        value = self.number(key, self.entries[key])
        if value < 1e-15:
            self.refuse(key, "is not positive", "give a number greater than zero in the unit that the key names")
        return value

    def count(self, key: str, default: int) -> int:
        """The whole number `key`, at least 1."""
        value = self.entries.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            self.refuse(key, "is not a whole number of at least 1", "give one")
        return value

    def yes(self, key: str, default: bool = False) -> bool:
        """Whether `key` is true."""
        value = self.entries.get(key, default)
        if not isinstance(value, bool):
            self.refuse(key, "is neither true nor false", "write true or false, without quotes")
        return value
