"""What a run leaves behind: histories as CSV, fields for ParaView, pictures."""

import csv
import ctypes
import os
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem, io, plot
from ufl.core.expr import Expr

from .errors import InputError


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


def can_draw() -> str | None:
    """None if pictures can be drawn off-screen, else the sentence that says what to install."""
    for library in ("libEGL.so.1", "libOSMesa.so.8"):
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return None
    # without either, VTK ends the whole process
    return (
        "Pictures are left out, since libEGL.so.1 is missing: on Debian or Ubuntu, "
        "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri."
    )


def film(path: Path, frames: Sequence[Path], seconds: float) -> None:
    """Put pictures together into an animated `.gif` (or `.mp4`, where imageio has ffmpeg); on rank 0 alone."""
    import imageio.v3 as iio

    images = [iio.imread(frame)[::2, ::2, :3] for frame in frames]
    iio.imwrite(path, np.stack(images), duration=1000 * seconds / len(images), loop=0)


def picture(
    path: Path,
    u: fem.Function,
    cell_values: np.ndarray,
    label: str,
    title: str = "",
    view: tuple[float, float, float] = (1.0, -2.0, 1.2),
    limits: tuple[float, float] | None = None,
    box: tuple[float, ...] | None = None,
) -> None:
    """Draw the deformed sheet, coloured by one value for each local cell, over its undeformed outline.

    To be called on every rank; rank 0 draws. `label` names the value with its unit. view: the direction
    from the middle of a sheet in space to the eye; z is up. limits: of the colours, and box: what to
    have in sight (x0, x1, y0, y1, z0, z1), both that of this picture unless given (for frames of a film).
    """
    space = u.function_space
    domain = space.mesh
    owned = domain.topology.index_map(domain.topology.dim).size_local
    topology, kinds, points = plot.vtk_mesh(space, np.arange(owned, dtype=np.int32))
    moved = np.zeros_like(points)
    dim = domain.geometry.dim
    moved[:, :dim] = u.x.array.reshape(-1, dim)
    parts = domain.comm.gather((topology, kinds, points, moved, cell_values[:owned]), root=0)
    if domain.comm.rank != 0:
        return
    fault = can_draw()
    if fault:
        print(fault)
        return
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista

    pyvista.OFF_SCREEN = True
    blocks = []
    # VTK takes no empty part; a rank may be without cells
    for topology, kinds, points, moved, values in (part for part in parts if len(part[-1])):
        grid = pyvista.UnstructuredGrid(topology, kinds, points)
        grid["moved"], grid.cell_data[label] = moved, values
        blocks.append(grid)
    grid = blocks[0] if len(blocks) == 1 else pyvista.merge(blocks, merge_points=True)
    deformed = grid.warp_by_vector("moved")
    low, high = deformed.get_data_range(label)
    if high - low <= 1e-6 * max(abs(low), abs(high)):
        # a uniform value: without zero in the range, colours would show round-off
        low, high = min(low, 0.0), max(high, 0.0)
    low, high = limits or (low, high)
    ends = np.array([grid.bounds, deformed.bounds]).reshape(2, 3, 2)
    low_corner, high_corner = ends[..., 0].min(axis=0), ends[..., 1].max(axis=0)
    width, height = (high_corner - low_corner)[:2]
    pixel = max(width / 1100, height / 800) if dim == 2 else None
    above, below = 70, 120  # pixels for the title and the colour bar
    size = (1200, round(height / pixel) + above + below) if pixel else (1200, 900)
    plotter = pyvista.Plotter(window_size=size)
    plotter.background_color = "white"
    outline = grid.extract_feature_edges(feature_edges=False, manifold_edges=False)
    if dim == 2:
        outline.translate((0.0, 0.0, 0.01 * max(width, height)), inplace=True)  # nothing may hide it
    plotter.add_mesh(outline, color="black", line_width=2)
    edges: dict[str, Any] = {"show_edges": True, "edge_color": "white"}
    if dim == 3:
        # on the curved cells themselves, and thin: a dense mesh must not hide the colours
        edges = {"smooth_shading": True, "ambient": 0.3, "specular": 0.1}
        lines = deformed.extract_all_edges()
        deformed = deformed.extract_surface(nonlinear_subdivision=3, algorithm="dataset_surface")
        plotter.add_mesh(lines, color="black", line_width=1, opacity=0.25)
        rim = deformed.extract_feature_edges(feature_edges=False, manifold_edges=False)
        plotter.add_mesh(rim, color="black", line_width=1)
    actor = plotter.add_mesh(
        deformed,
        scalars=label,
        cmap="viridis",
        clim=(low, high),
        show_scalar_bar=False,
        lighting=dim == 3,  # it would darken the colours of a flat sheet
        **edges,
    )
    # behind the lines that lie in it
    actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2.0, 2.0)
    bar = {"color": "black", "fmt": "%.3g", "n_labels": 5, "label_font_size": 20}
    bar |= {"position_x": 0.35, "width": 0.6, "position_y": 15 / size[1], "height": 75 / size[1]}
    plotter.add_scalar_bar(title=" ", **bar)
    plotter.add_text(label, position=(40, 25), color="black", font_size=14)
    plotter.add_text(title, position=(40, size[1] - 45), color="black", font_size=14)
    plotter.add_text("black line: undeformed", position=(900, size[1] - 40), color="black", font_size=11)
    if pixel:
        plotter.view_xy()
        plotter.enable_parallel_projection()
        middle = (low_corner + high_corner) / 2 + [0.0, (above - below) / 2 * pixel, 0.0]
        plotter.camera.focal_point = middle
        plotter.camera.position = middle + [0.0, 0.0, max(width, height)]
        plotter.camera.parallel_scale = size[1] * pixel / 2
    else:
        plotter.view_vector(view, viewup=(0, 0, 1))
        if box is not None:
            plotter.reset_camera(bounds=box)
        plotter.camera.SetWindowCenter(0.0, -(below - above) / size[1])
    plotter.screenshot(path)
    plotter.close()
