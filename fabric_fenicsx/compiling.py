"""Forms that are compiled once and kept: a compile that was killed, or a file that is not whole, blocks nobody.

FFCx makes X.c first, its library next and X.c.cached last, and waits for the last wherever it finds the first, though
the process that compiled may be dead. Here that process holds a lock, X.lock, which ends with it: what is not whole and
has no such process is compiled anew.
"""

import contextlib
import fcntl
import importlib.machinery
import os
import sys
import time
from pathlib import Path
from typing import Any

from mpi4py import MPI
from ffcx.codegeneration import jit

from . import system

_load, _compile = jit.get_cached_module, jit._compile_objects
_held: dict[Path, int] = {}  # lock that this process holds, and its descriptor
_said: set[str] = set()


def install() -> None:
    """Let DOLFINx find and make its compiled forms by what is in here."""
    jit.get_cached_module, jit._compile_objects = find, make


def find(name: str, objects: list[str], folder: Path | str, timeout: int = 10) -> tuple[Any, Any]:
    """The kept objects and their module, or (None, None) where this process is to compile them; never waits in vain."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    while (found := _kept(name, objects, folder)) is None:
        if not _take(folder / f"{name}.lock"):
            _say(f"waiting for another process that compiles a form ({folder / name}.lock)")
            time.sleep(0.2)
        elif (found := _kept(name, objects, folder)) is not None:  # it has just been finished
            _release()
            break
        else:
            for left in folder.glob(f"{name}.*"):
                if left.suffix != ".lock":
                    left.unlink(missing_ok=True)
            (folder / f"{name}.c").touch()
            _say(f"compiling forms, for some seconds each; they are kept in {folder}")
            return None, None
    return found


def make(*arguments: Any, **options: Any) -> Any:
    """As of FFCx; the lock ends with it."""
    try:
        return _compile(*arguments, **options)
    finally:
        _release()


def _kept(name: str, objects: list[str], folder: Path) -> tuple[Any, Any] | None:
    if whole(folder, name):
        with contextlib.suppress(ImportError, AttributeError):  # of another machine, or not what it was
            return _load(name, objects, folder, 1)
    return None


def whole(folder: Path, name: str) -> bool:
    """Whether a form was compiled to its end, and its library has the size that its head tells."""
    if not (folder / f"{name}.c.cached").exists():
        return False
    suffixes = importlib.machinery.EXTENSION_SUFFIXES
    return any(system.complete(path) for path in (folder / (name + suffix) for suffix in suffixes) if path.exists())


def _take(lock: Path) -> bool:
    """Take a lock that no living process holds."""
    descriptor = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return False
    except OSError:
        pass  # a file system without locks
    try:
        same = os.path.samestat(os.stat(lock), os.fstat(descriptor))
    except FileNotFoundError:  # whoever held it has just removed it
        same = False
    if not same:
        os.close(descriptor)
        return False
    _held[lock] = descriptor
    return True


def _release() -> None:
    """Let go of the lock of the form that was compiled."""
    while _held:
        lock, descriptor = _held.popitem()
        lock.unlink(missing_ok=True)
        os.close(descriptor)


def _say(what: str) -> None:
    """Tell once, on rank 0: nothing else is heard of the first minute of a first run."""
    if what not in _said and MPI.COMM_WORLD.rank == 0:
        _said.add(what)
        print(f"fabric_fenicsx: {what}", file=sys.stderr, flush=True)
