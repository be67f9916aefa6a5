"""A run on disk: saved between two steps, and gone on with, on any number of ranks.

Everything is kept cell by cell, in the order of the cells in the mesh's own file, so that it fits however the
mesh is shared out. On as many ranks what follows is the same to the last bit; large systems on several ranks differ in
round-off, with or without a checkpoint (`redundant`).
"""

import hashlib
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI

from ..errors import InputError, LawFailed, StepFailed
from ..laws import Array
from ..surfaces import placing

FORMAT = 3
EVERY = 60.0
"""Time from one checkpoint to the next, s: what a run loses at most."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


type Field = tuple[str, np.ndarray | None, Array]
"""Name, and a local array of unknowns with None, or local cells and an array with a row for each."""


class Run(Protocol):
    """What can be saved: `marching.March`, `newmark.Newmark` and `explicit.CentralDifference`."""

    comm: MPI.Comm
    q: Any
    pause: Callable[[], None]
    """Is called on every rank between two steps, when the last one has been dealt with."""

    def numbers(self) -> dict[str, float]: ...
    def set_numbers(self, numbers: dict[str, float]) -> None: ...
    def fields(self) -> list[Field]: ...
    def renew(self) -> None: ...


def save(path: str | Path, run: Run, marks: Mapping[str, object] | None = None) -> None:
    """Write the last accepted step of a run; to be called on every rank.

    marks: by name, all that the answer depends on beside mesh and kind of run; `load` has to be given the same.
    The file is there in whole or not at all, and the one that was there before is kept as `before(path)`. Raises, on
    every rank, InputError if it cannot be written, and StepFailed for a state that is not finite.
    """
    fields, mesh, path = run.fields(), run.q.function_space.mesh, Path(path)
    parts = {name: _rows(run, cells, array) for name, cells, array in fields}
    numbers = run.numbers()
    bad = [name for name, (_, rows) in parts.items() if not np.isfinite(rows).all()]
    bad += [name for name, value in numbers.items() if not np.isfinite(value)]
    bad = sorted(set().union(*run.comm.allgather(bad)))
    if bad:
        raise StepFailed(f"The state is not finite ({', '.join(bad)}) and is not saved in {str(path)!r}.")
    gathered = run.comm.gather(parts, 0)
    mark, fault = identity(mesh), None
    if gathered is not None:
        content = {}
        for name in parts:
            ranks = [rank[name] for rank in gathered if len(rank[name][0])]
            numbered = np.concatenate([of for of, _ in ranks]) if ranks else np.empty(0, dtype=np.int64)
            place = np.argsort(numbered)
            content[f"of_{name}"] = numbered[place]
            content[f"cell_{name}"] = np.concatenate([rows for _, rows in ranks])[place] if ranks else np.empty((0, 0))
        content |= {"format": np.array(FORMAT), "mesh": np.array(mark), "marks": np.array(_text(marks))}
        content |= {"names": np.array(list(numbers)), "numbers": np.array([*map(float, numbers.values())])}
        fault = _write(path, content)
    fault = run.comm.bcast(fault, 0)
    if fault:
        raise InputError(fault)


def load(path: str | Path, run: Run, marks: Mapping[str, object] | None = None) -> None:
    """Put a run that was made for the same mesh and the same marks where a saved one was; to be called on every rank.

    Raises InputError, on every rank, for a file that is none, or that belongs to another run, with the difference.
    """
    fields, mesh = run.fields(), run.q.function_space.mesh
    mark, data = identity(mesh), _read(Path(path))
    fault = data if isinstance(data, str) else _misfit(data, run, fields, mark, json.loads(_text(marks)))
    fault = next((said for said in run.comm.allgather(fault) if said), None)
    if fault or isinstance(data, str):
        raise InputError(f"The checkpoint {str(path)!r} does not fit: {fault}.")
    for name, cells, array in fields:
        rows = data[f"cell_{name}"][np.searchsorted(data[f"of_{name}"], _numbers(run, cells))]
        if cells is None:
            array[_index(run)] = rows
        elif len(rows):
            array[:] = rows
    run.set_numbers(dict(zip(map(str, data["names"]), map(float, data["numbers"]), strict=True)))
    run.renew()


def before(path: str | Path) -> Path:
    """Where the checkpoint before the last one is kept."""
    return Path(path).with_suffix(f".before{Path(path).suffix}")


def last(path: str | Path, comm: MPI.Comm) -> Path | None:
    """The last checkpoint of a run that can be read in whole: that at the path, or the one before; None without."""
    found = None
    if comm.rank == 0:
        found = next((p for p in (Path(path), before(path)) if not isinstance(_read(p), str)), None)
    return comm.bcast(found, 0)


@contextmanager
def guard(
    path: str | Path, run: Run, marks: Mapping[str, object] | None = None, every: float = EVERY
) -> Iterator[None]:
    """Save the run in here: every so many seconds, and when it ends, fails, or is interrupted; marks: see `save`.

    Ctrl-C, SIGTERM and SIGHUP let the present step end; a second one does not, but waits for a file that is being
    written. To be used on every rank.
    """
    keeper = _Keeper(path, run, marks, every)
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    for number, handler in handlers.items():
        if number != signal.SIGHUP or handler != signal.SIG_IGN:  # nohup
            signal.signal(number, keeper.interrupt)
    run.pause = keeper.pause
    try:
        yield
        keeper.save()
    except (StepFailed, LawFailed, KeyboardInterrupt) as error:
        if keeper.hurried:
            if run.comm.size > 1:  # the others do not know
                run.comm.Abort(128 + keeper.hurried)
            raise
        try:
            keeper.save()
            keeper.say(f"{type(error).__name__}: the last good state is in {path}")
        except StepFailed as fault:
            keeper.say(f"{fault} The last good one, if any, is there still")
        raise
    finally:
        run.pause = _nothing
        for number, handler in handlers.items():
            signal.signal(number, handler)


class _Keeper:
    """Saves a run between its steps."""

    def __init__(self, path: str | Path, run: Run, marks: Mapping[str, object] | None, every: float) -> None:
        self._path, self._run, self._marks, self._every = path, run, marks, every
        self._saved, self._caught, self._saving = time.monotonic(), 0, False
        self.hurried = 0
        """Number of the signal that does not wait for the step to end."""

    def interrupt(self, number: int, where: FrameType | None) -> None:
        if self._caught and not self._saving:
            self.hurried = number
            raise KeyboardInterrupt(number)
        if not self._caught:
            self._caught = number
            with suppress(OSError):  # print may be in the middle of a line
                os.write(
                    2, b"\nstopping after the present step; once more to stop at once\n" * (self._run.comm.rank == 0)
                )

    def pause(self) -> None:
        """Between two steps: save if it is time; raise KeyboardInterrupt, on every rank, if one has been told to."""
        due = self._run.comm.rank == 0 and time.monotonic() - self._saved >= self._every
        told = self._run.comm.allreduce(2 * self._caught + due, MPI.MAX)  # in one message, for it is one a step
        if told > 1:
            raise KeyboardInterrupt(told // 2)
        if told:
            self.save()

    def save(self) -> None:
        self._saving = True
        try:
            save(self._path, self._run, self._marks)
        finally:
            self._saving = False
        self._saved = time.monotonic()

    def say(self, what: str) -> None:
        if self._run.comm.rank == 0:
            with suppress(OSError):  # SIGHUP: nobody listens any more
                print(what, file=sys.stderr, flush=True)


def _nothing() -> None: ...


def identity(mesh: Any) -> str:
    """A mark of the cells, their places and where they start, the same on any number of ranks."""
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    order = np.array(mesh.topology.original_cell_index[:owned])
    gathered, mark = mesh.comm.gather((order, placing.both(mesh)[:owned]), 0), None
    if gathered is not None:
        order, places = (np.concatenate([rank[k] for rank in gathered]) for k in (0, 1))
        mark = hashlib.sha256(np.ascontiguousarray(places[np.argsort(order)]).tobytes()).hexdigest()
    return str(mesh.comm.bcast(mark, 0))


def _text(marks: Mapping[str, object] | None) -> str:
    return json.dumps({name: str(value) for name, value in (marks or {}).items()})


def _write(path: Path, content: dict[str, np.ndarray]) -> str | None:
    """Write aside and rename; what went wrong."""
    rough = path.with_name(path.name + ".part")
    try:
        with open(rough, "wb") as file:
            np.savez(file, allow_pickle=False, **content)
            file.flush()
            os.fsync(file.fileno())
        if path.is_file():
            os.replace(path, before(path))
        os.replace(rough, path)
    except OSError as error:
        with suppress(OSError):
            rough.unlink()
        return f"The checkpoint {str(path)!r} cannot be written ({error.strerror})."
    return None


def _read(path: Path) -> dict[str, np.ndarray] | str:
    """All arrays of a file, or why there are none."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except OSError as error:
        return f"it cannot be read ({error.strerror or 'no checkpoint'})"
    except Exception:  # whatever NumPy, zip and zlib say to what is none
        return "it cannot be read (no checkpoint)"


def _misfit(data: dict[str, np.ndarray], run: Run, fields: list[Field], mark: str, marks: dict[str, str]) -> str | None:
    """Why a file is not of this run, or not whole."""
    wanted = run.numbers()
    missing = {"format", "mesh", "marks", "names", "numbers"} - data.keys()
    if "format" in data and str(data["format"]) != str(FORMAT):
        return f"it has format {data['format']}, not {FORMAT}"
    if missing:
        return f"it cannot be read (no checkpoint: it has no {', '.join(sorted(missing))})"
    if str(data["mesh"]) != mark:
        return "it was made on another mesh"
    try:
        made = dict(json.loads(str(data["marks"])))
    except (ValueError, TypeError):
        return "what it was made with cannot be read"
    other = [name for name in {**marks, **made} if made.get(name) != marks.get(name)]
    said = [f"{name} {made.get(name, 'left out')} and not {marks.get(name, 'left out')}" for name in other[:3]]
    if said:
        more = f", and {len(other) - 3} more" if len(other) > 3 else ""
        return f"it was made with {'; '.join(said)}{more}"
    there = all({f"cell_{name}", f"of_{name}"} <= data.keys() for name, *_ in fields)
    if not there or {*map(str, data["names"].ravel())} != wanted.keys():
        return "the law, the shell or the energy account is another"
    for name, cells, array in fields:
        rows, of = data[f"cell_{name}"], data[f"of_{name}"]
        width = _index(run).shape[1] if cells is None else array.shape[1]
        right = rows.dtype == np.float64 and rows.ndim == 2 and of.dtype.kind == "i" and of.shape == rows.shape[:1]
        # a rank without cells cannot tell how long a row is
        local = _numbers(run, cells)
        if not right or (len(local) and rows.shape[1] != width) or not np.isin(local, of).all():
            return f"its {name} has another size or type: the law, the layers or the element are others"
    numbers = data["numbers"]
    if numbers.dtype != np.float64 or numbers.shape != (len(wanted),) or data["names"].shape != (len(wanted),):
        return "its numbers are not one for each name"
    bad = [name for name in ("numbers", *(f"cell_{name}" for name, *_ in fields)) if not np.isfinite(data[name]).all()]
    return f"it holds what is not finite ({', '.join(bad)})" if bad else None


def _index(run: Run) -> np.ndarray:
    """Unrolled local unknowns of each cell."""
    dofmap = run.q.function_space.dofmap
    dofs, bs = dofmap.list, dofmap.bs
    return (dofs[..., None] * bs + np.arange(bs)).reshape(len(dofs), dofs.shape[1] * bs)


def _numbers(run: Run, cells: np.ndarray | None) -> np.ndarray:
    """Numbers of local cells, by default all, in the mesh's own file."""
    order = run.q.function_space.mesh.topology.original_cell_index
    return np.asarray(order if cells is None else order[cells])


def _rows(run: Run, cells: np.ndarray | None, array: Array) -> tuple[np.ndarray, Array]:
    """Numbers in the mesh's own file of this rank's own cells that have values, and a row of values for each."""
    topology = run.q.function_space.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    if cells is None:
        cells, array = np.arange(owned), array[_index(run)[:owned]]
    own = cells < owned
    return _numbers(run, cells[own]), array[: np.count_nonzero(own)]
