"""A motion on disk: saved between two steps, and gone on with, on any number of ranks.

Everything is kept cell by cell, in the order of the cells in the mesh's own file, so that it fits however the
mesh is shared out. On as many ranks as before, what follows is the same to the last bit.
"""

import hashlib
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, Protocol
from zipfile import BadZipFile

import numpy as np
from mpi4py import MPI
from dolfinx import fem

from ..errors import InputError, StepFailed
from ..laws import Array

FORMAT = 1


class Run(Protocol):
    """What can be saved: `newmark.Newmark` and `explicit.CentralDifference`."""

    comm: MPI.Comm
    interrupted: bool

    def numbers(self) -> dict[str, float]: ...
    def set_numbers(self, numbers: dict[str, float]) -> None: ...
    def fields(self) -> tuple[fem.FunctionSpace, list[tuple[str, str, Array]]]: ...
    def renew(self) -> None: ...


def save(path: str | Path, run: Run, scene: str = "") -> None:
    """Write the last accepted step of a run; to be called on every rank. scene: text that `load` has to be given too.

    The file is there in whole or not at all. Raises InputError, on every rank, if it cannot be written.
    """
    space, fields = run.fields()
    mesh = space.mesh
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    order = np.array(mesh.topology.original_cell_index[:owned])
    parts = {name: _rows(space, kind, array)[:owned] for name, kind, array in fields}
    gathered = run.comm.gather((order, parts), 0)
    mark, fault = identity(mesh), None
    if gathered is not None:
        place = np.argsort(np.concatenate([rank[0] for rank in gathered]))
        arrays = {name: np.concatenate([rank[1][name] for rank in gathered])[place] for name in parts}
        numbers = run.numbers()
        path = Path(path)
        rough = path.with_name(path.name + ".part")
        try:
            with open(rough, "wb") as file:
                content = {f"cell_{name}": array for name, array in arrays.items()}
                content |= {"format": np.array(FORMAT), "mesh": np.array(mark), "scene": np.array(scene)}
                content |= {"names": np.array(list(numbers)), "numbers": np.array(list(numbers.values()))}
                np.savez(file, allow_pickle=False, **content)
            os.replace(rough, path)
        except OSError as error:
            fault = f"The checkpoint {str(path)!r} cannot be written ({error.strerror})."
    fault = run.comm.bcast(fault, 0)
    if fault:
        raise InputError(fault)


def load(path: str | Path, run: Run, scene: str = "") -> None:
    """Put a run that was made for the same mesh and scene where a saved one was; to be called on every rank.

    Raises InputError, on every rank, for a file that is none or that belongs to another mesh or scene.
    """
    space, fields = run.fields()
    mesh, mark = space.mesh, identity(space.mesh)
    fault, data = None, {}
    try:
        with np.load(path, allow_pickle=False) as file:
            data = dict(file)
        if data["format"] != FORMAT:
            fault = f"it has format {data['format']}, not {FORMAT}"
        elif str(data["mesh"]) != mark:
            fault = "it was made on another mesh"
        elif str(data["scene"]) != scene:
            fault = f"it was made by another scene: {data['scene']}; this one is: {scene}"
        elif any(f"cell_{name}" not in data for name, *_ in fields):
            fault = "the law, the shell or the energy account is another"
        else:
            for name, kind, array in fields:
                rows = data[f"cell_{name}"]
                if rows.shape[1:] != _rows(space, kind, array).shape[1:]:
                    fault = f"its {name} has another size: the law, the layers or the element are others"
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        fault = f"it cannot be read ({error.strerror if isinstance(error, OSError) else 'no checkpoint'})"
    fault = next((said for said in run.comm.allgather(fault) if said), None)
    if fault:
        raise InputError(f"The checkpoint {str(path)!r} does not fit: {fault}.")
    order = mesh.topology.original_cell_index
    for name, kind, array in fields:
        _set_rows(space, kind, array, data[f"cell_{name}"][order])
    run.set_numbers(dict(zip(map(str, data["names"]), map(float, data["numbers"]), strict=True)))
    run.renew()


@contextmanager
def guard(path: str | Path, run: Run, scene: str = "") -> Iterator[None]:
    """Save the last accepted step if the run fails or is interrupted (Ctrl-C) in here.

    The first Ctrl-C lets the present step end, a second one does not wait for it.
    """

    def interrupt(number: int, where: FrameType | None) -> None:
        run.interrupted = True
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    except (StepFailed, KeyboardInterrupt) as error:
        save(path, run, scene)
        if run.comm.rank == 0:
            print(f"{type(error).__name__}: the last good state is in {path}", flush=True)
        raise
    finally:
        signal.signal(signal.SIGINT, before)


def identity(mesh: Any) -> str:
    """A mark of the cells and their places, the same on any number of ranks."""
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    order = np.array(mesh.topology.original_cell_index[:owned])
    places = mesh.geometry.x[mesh.geometry.dofmaps[0][:owned]]
    gathered = mesh.comm.gather((order, places), 0)
    mark = None
    if gathered is not None:
        order, places = (np.concatenate([rank[k] for rank in gathered]) for k in (0, 1))
        mark = hashlib.sha256(np.ascontiguousarray(places[np.argsort(order)]).tobytes()).hexdigest()
    return str(mesh.comm.bcast(mark, 0))


def _index(space: fem.FunctionSpace) -> np.ndarray:
    """Unrolled local unknowns of each cell."""
    dofs, bs = space.dofmap.list, space.dofmap.bs
    return (dofs[..., None] * bs + np.arange(bs)).reshape(len(dofs), -1)


def _rows(space: fem.FunctionSpace, kind: str, array: Array) -> Array:
    """A row for each local cell: of the unknowns of the space, or of as many equal parts as there are cells."""
    index = _index(space)
    return array[index] if kind == "unknowns" else array.reshape(len(index), -1)


def _set_rows(space: fem.FunctionSpace, kind: str, array: Array, rows: Array) -> None:
    if kind == "unknowns":
        array[_index(space)] = rows
    else:
        array.reshape(len(rows), -1)[:] = rows
