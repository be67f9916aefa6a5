"""Histories as CSV, means over a part of a sheet, and how a folder of results is written."""

import csv
import io
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from ufl.core.expr import Expr

from .. import files
from ..errors import InputError


def on_root[T](comm: MPI.Comm, write: Callable[[], T]) -> T | None:
    """Write something on rank 0, and go on together; what it returns there, None elsewhere.

    To be called on every rank. What cannot be written, as on a full disk, raises InputError on all of them.
    """
    result, fault = None, None
    if comm.rank == 0:
        try:
            result = write()
        except OSError as error:
            reason = error.strerror or str(error)
            fault = f"{error.filename or 'A file of the results'} cannot be written ({reason}); make room there, or "
            fault += "choose another folder with --out."
        except InputError as error:
            fault = str(error)
    fault = comm.bcast(fault, root=0)
    if fault:
        raise InputError(fault)
    return result


def folder(path: str | Path, comm: MPI.Comm = MPI.COMM_WORLD) -> Path:
    """Make the folder for a run's results; InputError on every rank if it cannot be written."""
    path, fault = Path(path), None
    if comm.rank == 0:
        try:
            path.mkdir(parents=True, exist_ok=True)
            probe = path / ".writable"
            probe.touch()
            probe.unlink()
        except OSError as error:
            fault = f"The output folder {str(path)!r} cannot be written ({error.strerror}); choose another with --out."
    fault = comm.bcast(fault, root=0)
    if fault:
        raise InputError(fault)
    return path


class Table:
    """A CSV file that grows by one row a step; each row is on disk before the next step starts.

    Names carry units (`force_N`). Every rank calls `row`, rank 0 writes; without a path nobody does. What an earlier
    run left at the path stays until the first row. until: of that run, the rows stay whose first column is not above
    this number, in `rows` and in the file.
    """

    def __init__(self, path: Path | None, comm: MPI.Comm = MPI.COMM_WORLD, *, until: float | None = None) -> None:
        self.rows: list[dict[str, Any]] = []
        self._path, self._comm, self._begun = path, comm, False
        if path is not None and until is not None:
            self.rows = comm.bcast(_kept(path, until) if comm.rank == 0 else None, root=0)

    def row(self, **values: float) -> None:
        """Append values as a row; the first names the columns. InputError, on every rank, if it cannot be written."""
        if self.rows and list(self.rows[0]) != list(values):
            raise InputError(
                f"{self._path or 'The table'} has the columns {', '.join(self.rows[0])}, and a row of "
                f"{', '.join(values)} does not fit; choose another folder with --out."
            )
        self.rows.append(values)
        if self._path is not None:
            on_root(self._comm, self._write)
        self._begun = True

    def _write(self) -> None:
        assert self._path is not None
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, list(self.rows[-1]))
        if not self._begun:
            writer.writeheader()
        for row in self.rows[-1:] if self._begun else self.rows:
            writer.writerow({name: f"{value:.10g}" for name, value in row.items()})
        (files.append if self._begun else files.replace)(self._path, text.getvalue())

    def column(self, name: str) -> np.ndarray:
        """All values of a column so far."""
        return np.array([row[name] for row in self.rows])

    def __enter__(self) -> "Table":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is open between two rows."""


def _kept(path: Path, until: float) -> list[dict[str, float]]:
    """Rows of a history up to a number of its first column, as far as they are whole; none of a file that is none."""
    rows: list[dict[str, float]] = []
    try:
        with open(path, newline="") as file:
            for row in csv.DictReader(file):
                rows.append({name: float(value) for name, value in row.items()})
    except (OSError, ValueError, TypeError):  # the rest was lost while it was written
        pass
    return [row for row in rows if next(iter(row.values())) <= until + 1e-9 * abs(until)]


class Average:
    """Mean of a UFL scalar over the part of the mesh where the UFL scalar `where` is 1 (else 0)."""

    def __init__(self, values: Expr, where: Expr, dx: ufl.Measure, comm: MPI.Comm) -> None:
        self._forms, self._comm = [fem.form(values * where * dx), fem.form(where * dx)], comm

    def value(self) -> float:
        """The mean at present, over all ranks; to be called on every rank."""
        total, area = (self._comm.allreduce(fem.assemble_scalar(form)) for form in self._forms)
        if area == 0.0:
            raise InputError("There is nothing to average over: no point of the mesh is in the given part.")
        return float(total / area)
