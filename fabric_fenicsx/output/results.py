"""What a run leaves behind: histories as CSV, and fields for ParaView."""

import csv
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem, io
from ufl.core.expr import Expr

from ..errors import InputError


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

    Names carry units (`force_N`). Every rank may call `row`, rank 0 writes; without a path nobody does.
    """

    def __init__(self, path: Path | None, comm: MPI.Comm = MPI.COMM_WORLD) -> None:
        self.rows: list[dict[str, Any]] = []
        self._file = open(path, "w", newline="") if path and comm.rank == 0 else None  # noqa: SIM115
        self._writer: csv.DictWriter[str] | None = None

    def row(self, **values: float) -> None:
        """Append a row; the first one names the columns."""
        self.rows.append(values)
        if self._file is None:
            return
        if self._writer is None:
            self._writer = csv.DictWriter(self._file, list(values))
            self._writer.writeheader()
        self._writer.writerow({k: f"{v:.10g}" for k, v in values.items()})
        self._file.flush()

    def column(self, name: str) -> np.ndarray:
        """All values of a column so far."""
        return np.array([row[name] for row in self.rows])

    def __enter__(self) -> "Table":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            self._file.close()


class Fields:
    """Displacement and cell values over time, as a series (`.bp`) that ParaView opens."""

    def __init__(self, path: Path, u: fem.Function, cell_values: tuple[str, ...] = ()) -> None:
        self.u = u
        u.name = "displacement_m"
        domain = u.function_space.mesh
        space = fem.functionspace(domain, ("DG", 0))
        self.cells = {name: fem.Function(space, name=name) for name in cell_values}
        self._writer = io.VTXWriter(domain.comm, path, [u, *self.cells.values()])

    def write(self, time: float, **cell_values: np.ndarray) -> None:
        """Write the present displacement, and one value for each local cell (ghosts included)."""
        for name, values in cell_values.items():
            self.cells[name].x.array[:] = values
        self._writer.write(time)

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()


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
