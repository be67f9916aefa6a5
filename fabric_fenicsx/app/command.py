"""What every script of this project does at its command line, alone or under mpirun."""

import argparse
import contextlib
import io
import math
import sys
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import NoReturn

from mpi4py import MPI

from ..errors import InputError, LawFailed, StepFailed
from ..output import results


def number(text: str) -> float:
    """A finite number."""
    with contextlib.suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise argparse.ArgumentTypeError(f"{text} is not a finite number")


def above_zero(text: str) -> float:
    """A finite number greater than zero."""
    if (value := number(text)) <= 0.0:
        raise argparse.ArgumentTypeError(f"{text} is not greater than zero")
    return value


def positive(text: str) -> int:
    """A whole number of at least 1."""
    with contextlib.suppress(ValueError):
        if (value := int(text)) >= 1:
            return value
    raise argparse.ArgumentTypeError(f"{text} is not a whole number of at least 1")


def grid(text: str) -> tuple[int, int]:
    """Two whole numbers of at least 1, as 9x3."""
    parts = text.lower().split("x")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(f"{text} is not of the form 9x3")
    return positive(parts[0]), positive(parts[1])


class Help(argparse.RawDescriptionHelpFormatter, argparse.ArgumentDefaultsHelpFormatter):
    """For --help: the text as it stands in the script, and the defaults that say something."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default is None or action.default is False else super()._get_help_string(action)


def parse(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """The command line; where it is wrong, only rank 0 says so and all ranks leave with status 2."""
    quiet = MPI.COMM_WORLD.rank != 0
    with contextlib.ExitStack() as stack:
        if quiet:
            stack.enter_context(contextlib.redirect_stderr(io.StringIO()))
            stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        return parser.parse_args()


def script(description: str, out: str, **numbers: int | float) -> argparse.Namespace:
    """The command line of a script without a `main`, which is read from top to bottom; `check` ends it.

    Options are --out, a folder that is made, and one for each of `numbers`, named and with defaults. From here on an
    InputError or StepFailed, which all ranks raise together, is said in one sentence.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=Help)
    parser.add_argument("--out", type=Path, default=Path(out), help="folder of the results")
    for name, default in numbers.items():
        parser.add_argument(f"--{name}", type=positive if isinstance(default, int) else number, default=default)
    args = parse(parser)

    def said(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if not isinstance(error, InputError | StepFailed):
            sys.__excepthook__(kind, error, trace)
            if MPI.COMM_WORLD.size > 1:
                MPI.COMM_WORLD.Abort(1)  # the other ranks may be waiting for this one
        elif MPI.COMM_WORLD.rank == 0:
            print(f"error: {error}", file=sys.stderr, flush=True)

    sys.excepthook = said
    warnings.formatwarning = lambda message, *_, **__: f"warning: {message}\n"
    args.out = results.folder(args.out)
    return args


def check(good: bool, what: str, out: Path) -> NoReturn:
    """Say whether a script's checked number is right, and leave: with status 1 if it is not."""
    say(f"check: {what}: {'yes' if good else 'NO'}; see {out}")
    sys.exit(0 if good else 1)


def say(*words: object) -> None:
    """Print on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print(*words, flush=True)


def run(main: Callable[[], int | None], shown: bool | None = None) -> None:
    """Call `main` and leave with its status.

    An InputError, StepFailed or LawFailed, which all ranks raise together, is said in one sentence (status 2, 1 and 1).
    Anything else is a fault of the program: all ranks are ended. shown: whether to show tracebacks; by default of
    faults of the program alone.
    """
    warnings.formatwarning = lambda message, *_, **__: f"warning: {message}\n"
    try:
        status = main() or 0
    except (InputError, StepFailed, LawFailed) as error:
        if shown:
            traceback.print_exc()
        elif MPI.COMM_WORLD.rank == 0:
            print(f"error: {error}", file=sys.stderr, flush=True)
        status = 2 if isinstance(error, InputError) else 1
    except KeyboardInterrupt as error:  # with the number of the signal, on every rank, from `checkpoint.guard`
        status = 128 + int(error.args[0]) if error.args else 130
        if not error.args and MPI.COMM_WORLD.size > 1:
            MPI.COMM_WORLD.Abort(status)  # outside of a guard the other ranks may be waiting for this one
    except Exception as error:
        if shown is False:
            what = f"{type(error).__name__}: {error}"
            hint = "--traceback shows where, and 'fabric-fenicsx doctor' whether something is missing"
            if isinstance(error, OSError) and error.filename:
                what = f"{error.filename} cannot be written or read ({error.strerror})"
                hint = "make room there, or choose another folder with --out"
            print(f"error: {what} ({hint}).", file=sys.stderr, flush=True)
        else:
            traceback.print_exc()
        if MPI.COMM_WORLD.size > 1:
            # the other ranks may be waiting for this one
            MPI.COMM_WORLD.Abort(1)
        status = 1
    sys.exit(status)
