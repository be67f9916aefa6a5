"""Files that are there in whole or not at all, whatever happens while they are written."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Lends a name beside `path`, of the same ending, to write to; in the end it takes the place of `path`.

    If that fails, what was at `path` stays, and nothing else is left. An OSError names `path`.
    """
    rough = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        with _named(path):
            yield rough
            os.replace(rough, path)
    except BaseException:
        with suppress(OSError):
            rough.unlink()
        raise


def replace(path: Path, content: str | bytes) -> None:
    """Put this content at `path`. Raises OSError, which names it."""
    with whole(path) as rough:
        rough.write_bytes(content if isinstance(content, bytes) else content.encode())


def append(path: Path, content: str) -> None:
    """Add this content at the end of a file, all of it or nothing. Raises OSError, which names the file."""
    left = content.encode()
    with _named(path), open(path, "ab", buffering=0) as file:
        size = file.tell()
        try:
            while left:  # a disk that fills up takes a part first
                left = left[file.write(left) :]
        except OSError:
            with suppress(OSError):
                file.truncate(size)
            raise


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """An OSError from in here names `path`: one from writing has no name, one from a rough copy another."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def in_order(path: Path) -> list[tuple[int, int, str]]:
    """Key by which files come in the order of the numbers in their names: 2 before 10."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", path.name) if part]
