"""Fields of a sheet over time, for ParaView, PyVista and `series`: `fields.pvd`, and a `.vtu` file for each step.

Bodies that it may touch are beside it, as `bodies.pvd` and its files. Rank 0 writes all of it, each file whole or not
at all, so that a step that is on disk can be read whatever happens later.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem

from .. import files
from ..laws import Array
from . import results
from .gathering import Whole
from .solids import Solid

COMPONENTS = {
    "strain": ("E11", "E22", "2E12"),
    "stress_Pa": ("S11", "S22", "S12"),
    "curvature_per_m": ("K11", "K22", "2K12"),
}
"""What the columns of an array are, in the axes of warp (1) and weft (2)."""
SMOOTH = (*COMPONENTS, "director")
"""What is written at the nodes, too."""
PRESSURE = "contact_pressure_Pa"
"""At the nodes of a sheet and at the corners of bodies."""


def index(folder: Path, kind: str = "fields") -> list[tuple[float, Path]]:
    """Time and file of every step in a folder; raises OSError and ValueError where there is no index to read."""
    try:
        listed = ET.parse(folder / f"{kind}.pvd").iter("DataSet")
        return [(float(entry.attrib["timestep"]), folder / entry.attrib["file"]) for entry in listed]
    except (ET.ParseError, KeyError) as error:
        raise ValueError(f"{kind}.pvd is broken: {error}") from error


class Fields:
    """Writes the steps of one sheet.

    u: its displacement, which later steps bring up to date; view: from the sheet to the eye, for pictures. What an
    earlier run left in the folder is replaced by the first step, all but the steps up to the time `until` (s), if that
    is given.
    """

    def __init__(
        self,
        folder: Path,
        u: fem.Function,
        *,
        view: tuple[float, float, float] = (1.0, -2.0, 1.2),
        until: float | None = None,
    ) -> None:
        self._folder, self._u, self._view, self._whole = folder, u, view, Whole(u.function_space)
        self._steps: list[tuple[float, Path]] = []
        self._begun = False
        if until is not None and self._whole.comm.rank == 0:
            with suppress(OSError, ValueError):  # there is none, or it is none
                self._steps = [step for step in index(folder) if step[0] <= until + 1e-9 * abs(until)]

    def write(
        self,
        time: float,
        title: str = "",
        *,
        at_nodes: Mapping[str, Array] | None = None,
        bodies: Sequence[Solid] = (),
        **cell_values: Array,
    ) -> None:
        """Write the present displacement (displacement_m) and arrays with a row for each local cell.

        at_nodes: arrays of all nodes, as the ranks number them. Bodies go to `bodies.pvd` and its files. Names carry
        units; of `COMPONENTS`, the columns are named as there. To be called on every rank. Raises InputError on all of
        them if it cannot be written, the steps before being in place.
        """
        gathered = self._whole(self._u, cell_values)

        def write() -> None:
            assert gathered is not None
            moved, cells = gathered
            whole, name = self._whole, f"{len(self._steps):06d}.vtu"
            nodes = {"displacement_m": moved}
            nodes |= {key: whole.in_order(values).astype(np.float32) for key, values in (at_nodes or {}).items()}
            nodes |= {key: whole.at_nodes(cells[key]).astype(np.float32) for key in SMOOTH if key in cells}
            about = {"title": title, "TimeValue": [time], "view": self._view, "dim": [whole.dim]}
            text = vtu(whole.points, whole.cells, whole.kind, nodes, cells, about)
            if bodies:
                self._put("bodies", name, surfaces(time, bodies))
            self._put("fields", name, text)
            self._steps.append((time, self._folder / "fields" / name))
            for kind in ("bodies", "fields"):
                if bodies or kind == "fields":
                    self._write_index(kind)
                if not self._begun:
                    self._forget(kind, bool(bodies) or kind == "fields")
            self._begun = True

        results.on_root(self._whole.comm, write)

    def _put(self, kind: str, name: str, text: str) -> None:
        path = self._folder / kind / name
        path.parent.mkdir(exist_ok=True)
        files.replace(path, text)

    def _forget(self, kind: str, kept: bool) -> None:
        """Remove what an earlier run has left of a kind."""
        known = {path.name for _, path in self._steps} if kept else set()
        for old in (self._folder / kind).glob("*.vtu"):
            if old.name not in known:
                old.unlink()
        if not kept:
            (self._folder / f"{kind}.pvd").unlink(missing_ok=True)

    def _write_index(self, kind: str) -> None:
        steps = [
            f'    <DataSet timestep="{time!r}" part="0" file="{kind}/{path.name}"/>\n' for time, path in self._steps
        ]
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        files.replace(self._folder / f"{kind}.pvd", f"{head}{''.join(steps)}  </Collection>\n</VTKFile>\n")


def surfaces(time: float, bodies: Sequence[Solid]) -> str:
    """The text of a file with all bodies, told apart by the number `body` of their cells, from 0."""
    starts = np.cumsum([0, *(len(body.points) for body in bodies)])
    faces = np.concatenate([body.faces + start for body, start in zip(bodies, starts[:-1], strict=True)])
    pressure: Any = np.concatenate([body.pressure for body in bodies]).astype(np.float32)
    number: Any = np.repeat(np.arange(len(bodies)), [len(body.faces) for body in bodies])
    points, about = np.concatenate([body.points for body in bodies]), {"TimeValue": [time]}
    names = {f"body_{k}": body.name for k, body in enumerate(bodies)}
    return vtu(points, faces, 5, {PRESSURE: pressure}, {"body": number}, about | names)


def vtu(
    points: Array,
    cells: np.ndarray,
    kind: int,
    at_points: Mapping[str, Array],
    at_cells: Mapping[str, Array],
    about: Mapping[str, Any],
) -> str:
    """The text of one file, of any reader of VTK's XML; cells of one kind, as VTK numbers it; about: texts, numbers."""
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints, vtkStringArray
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkUnstructuredGrid
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    def add(to: Any, name: str, values: Any) -> None:
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        for k, component in enumerate(COMPONENTS.get(name, ())):
            array.SetComponentName(k, component)
        to.AddArray(array)

    grid, corners, table = vtkUnstructuredGrid(), vtkPoints(), vtkCellArray()
    corners.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(corners)
    flat = np.ascontiguousarray(cells, dtype=np.int64).ravel()
    table.SetData(cells.shape[1], numpy_to_vtkIdTypeArray(flat, deep=True))
    grid.SetCells(kind, table)
    for name, values in at_points.items():
        add(grid.GetPointData(), name, values)
    for name, values in at_cells.items():
        add(grid.GetCellData(), name, values.astype(np.float32))
    for name, told in about.items():
        if isinstance(told, str):
            text = vtkStringArray()
            text.SetName(name)
            text.InsertNextValue(told)
            grid.GetFieldData().AddArray(text)
        else:
            add(grid.GetFieldData(), name, np.array(told, dtype=float)[None])
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetDataModeToBinary()
    writer.SetCompressorTypeToZLib()
    writer.SetCompressionLevel(1)
    writer.WriteToOutputStringOn()
    writer.Write()
    return str(writer.GetOutputString())
