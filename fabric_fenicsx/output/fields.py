"""Fields of a sheet over time, for ParaView, PyVista and `series`: `fields.pvd`, and a `.vtu` file for each step.

Rank 0 writes both, whole or not at all, so that a step that is on disk can be read whatever happens later.
"""

import xml.etree.ElementTree as ET
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem

from .. import files
from ..laws import Array
from . import results
from .gathering import Whole

COMPONENTS = {
    "strain": ("E11", "E22", "2E12"),
    "stress_Pa": ("S11", "S22", "S12"),
    "curvature_per_m": ("K11", "K22", "2K12"),
}
"""What the columns of an array are, in the axes of warp (1) and weft (2)."""
SMOOTH = (*COMPONENTS, "director")
"""What is written at the nodes, too."""


def index(folder: Path) -> list[tuple[float, Path]]:
    """Time and file of every step in a folder; raises OSError and ValueError where there is no index to read."""
    try:
        listed = ET.parse(folder / "fields.pvd").iter("DataSet")
        return [(float(entry.attrib["timestep"]), folder / entry.attrib["file"]) for entry in listed]
    except (ET.ParseError, KeyError) as error:
        raise ValueError(f"fields.pvd is broken: {error}") from error


class Fields:
    """Writes the steps of one sheet.

    u: its displacement, which later steps bring up to date. What an earlier run left in the folder is replaced by the
    first step, all but the steps up to the time `until`, if that is given.
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

    def write(self, time: float, title: str = "", **cell_values: Array) -> None:
        """Write the present displacement (displacement_m) and arrays with a row for each local cell.

        Names carry units; of `COMPONENTS`, the columns are named as there. To be called on every rank. Raises
        InputError on all of them if it cannot be written, the steps before being in place.
        """
        gathered = self._whole(self._u, cell_values)

        def write() -> None:
            assert gathered is not None
            path = self._folder / "fields" / f"{len(self._steps):06d}.vtu"
            path.parent.mkdir(exist_ok=True)
            files.replace(path, self._vtu(time, title, *gathered))
            self._steps.append((time, path))
            self._write_index()
            if not self._begun:
                known = {path for _, path in self._steps}
                for old in path.parent.glob("*.vtu"):
                    if old not in known:
                        old.unlink()
            self._begun = True

        results.on_root(self._whole.comm, write)

    def _write_index(self) -> None:
        steps = [
            f'    <DataSet timestep="{time!r}" part="0" file="fields/{path.name}"/>\n' for time, path in self._steps
        ]
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        files.replace(self._folder / "fields.pvd", f"{head}{''.join(steps)}  </Collection>\n</VTKFile>\n")

    def _vtu(self, time: float, title: str, moved: Array, cells: dict[str, Array]) -> str:
        """The text of one file, of any reader of VTK's XML."""
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

        whole, grid, points, table = self._whole, vtkUnstructuredGrid(), vtkPoints(), vtkCellArray()
        points.SetData(numpy_to_vtk(whole.points, deep=True))
        grid.SetPoints(points)
        table.SetData(whole.cells.shape[1], numpy_to_vtkIdTypeArray(whole.cells.ravel(), deep=True))
        grid.SetCells(whole.kind, table)
        add(grid.GetPointData(), "displacement_m", moved)
        for name, values in cells.items():
            add(grid.GetCellData(), name, values.astype(np.float32))
            if name in SMOOTH:
                add(grid.GetPointData(), name, whole.at_nodes(values).astype(np.float32))
        about = vtkStringArray()
        about.SetName("title")
        about.InsertNextValue(title)
        grid.GetFieldData().AddArray(about)
        for name, numbers in (("TimeValue", [time]), ("view", [self._view]), ("dim", [whole.dim])):
            add(grid.GetFieldData(), name, np.array(numbers, dtype=float))
        writer = vtkXMLUnstructuredGridWriter()
        writer.SetInputData(grid)
        writer.SetDataModeToBinary()
        writer.SetCompressorTypeToZLib()
        writer.SetCompressionLevel(1)
        writer.WriteToOutputStringOn()
        writer.Write()
        return str(writer.GetOutputString())
