"""Keys of the tables of a list of tests."""

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ...errors import InputError


def expect(
    path: str | Path, where: str, entries: Mapping[str, Any], needed: tuple[str, ...], more: tuple[str, ...]
) -> None:
    """Refuse unknown keys, and then missing ones; where: "" or, as an example, "records."."""
    for key in entries:
        if key not in needed + more:
            near = get_close_matches(key, needed + more, n=1) or [", ".join(needed + more)]
            raise InputError(f"{path}: {where}{key} is not a known key; known is {near[0]}.")
    for key in needed:
        if key not in entries:
            raise InputError(f"{path}: {where}{key} is missing; add it.")
