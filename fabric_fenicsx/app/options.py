"""Options that verbs of the command share. Nothing heavy is imported here."""

import inspect
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import click

from ..errors import InputError

folder = click.Path(file_okay=False, path_type=Path)
file = click.Path(dir_okay=False, path_type=Path)


@contextmanager
def drawn_to(path: Path) -> Iterator[None]:
    """What cannot be written, or has an ending that is no picture's, is the user's fault."""
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError, ImportError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error).splitlines()[0].rstrip(".")
        raise InputError(f"{str(path)!r} cannot be written ({reason}); choose another with --out.") from error


def keys(room: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """An option that prints the head of a room, where the keys of its file are told."""

    def tell(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
        if wanted and not context.resilient_parsing:
            click.echo(inspect.getdoc(import_module(f"fabric_fenicsx.{room}")))
            context.exit()

    return click.option("--keys", is_flag=True, is_eager=True, expose_value=False, callback=tell,
                        help="Print an example with every key of the file, and leave.")  # fmt: skip


def numbers(count: int) -> Callable[[click.Context, click.Parameter, str | None], tuple[float, ...] | None]:
    """A callback that reads so many finite numbers, as 1,-2,1.2."""

    def read(context: click.Context, parameter: click.Parameter, text: str | None) -> tuple[float, ...] | None:
        if text is None:
            return None
        out = _split(text, count)
        if not all(map(math.isfinite, out)):
            raise click.BadParameter(f"{text} is not finite; give {count} numbers")
        return out

    return read


def direction(context: click.Context, parameter: click.Parameter, text: str | None) -> tuple[float, ...] | None:
    """Three numbers, as 1,-2,1.2, not all zero."""
    if text is None:
        return None
    found = _split(text, 3)
    if not (all(map(math.isfinite, found)) and any(found)):
        raise click.BadParameter(f"{text} is no direction; give three finite numbers, as 1,-2,1.2")
    return found


def _split(text: str, count: int) -> tuple[float, ...]:
    try:
        out = tuple(map(float, text.split(",")))
    except ValueError:
        out = ()
    if len(out) != count:
        raise click.BadParameter(f"{text} is not of the form {','.join(('1', '-2', '1.2', '3')[:count])}")
    return out
