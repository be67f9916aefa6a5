"""The steps that a run has left in its folder, to be drawn without its mesh, its law or MPI; and films of them."""

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .. import files, system
from ..errors import InputError
from ..laws import Array
from . import fields, pictures

type Colour = Literal["yarn", "warp", "weft", "shear", "pressure"]
LABELS: dict[Colour, str] = {
    "yarn": "larger yarn strain (-)",
    "warp": "warp strain E11 (-)",
    "weft": "weft strain E22 (-)",
    "shear": "shear strain 2 E12 (-)",
    "pressure": "contact pressure (Pa)",
}
"""What a sheet can be coloured by, and how it is labelled."""


def coloured(strain: Array, colour: Colour) -> Array:
    """One value for each cell from its strains (cells, 3 or more); colour: of `LABELS`, one of strain."""
    if colour == "yarn":
        return np.asarray(strain[:, :2].max(axis=1))
    return np.asarray(strain[:, ("warp", "weft", "shear").index(colour)])


class Series:
    """What `fields.Fields` has written into a folder. Raises InputError for a folder that holds none of it."""

    def __init__(self, folder: Path) -> None:
        try:
            steps = fields.index(folder)
        except (OSError, ValueError) as error:
            raise InputError(
                f"{str(folder)!r} holds no frames ({_reason(error)}); give the output folder of "
                "'fabric-fenicsx run' or of a demo."
            ) from error
        self.times, self.files = [time for time, _ in steps], [file for _, file in steps]
        if not steps:
            raise InputError(f"{str(folder)!r} holds no frames yet; wait for the first one.")

    def broken(self) -> list[int]:
        """Numbers of the steps whose files are not there or have no end."""
        return [number for number, file in enumerate(self.files) if not _has_an_end(file)]

    def last(self) -> int:
        """Number of the last step that can be read. InputError if there is none."""
        for number in range(len(self.files) - 1, -1, -1):
            try:
                self.shape(number, "yarn")
            except InputError:
                continue
            return number
        raise InputError(f"None of the {len(self.files)} steps in {str(self.files[0].parent)!r} can be read.")

    def shape(self, number: int, colour: Colour) -> pictures.Shape:
        """A step, coloured; -1 is the last. InputError, which names its file, if it is broken."""
        return _read(self.files[number], colour)

    def picture(
        self,
        path: Path,
        number: int = -1,
        *,
        colour: Colour = "yarn",
        view: tuple[float, float, float] | None = None,
    ) -> None:
        """Draw a step; view: from the sheet to the eye, by default that of the run."""
        shape = self.shape(number, colour)
        pictures.draw(path, shape, LABELS[colour], shape.title, view=view or shape.view)

    def film(
        self, path: Path, colour: Colour = "yarn", *, view: tuple[float, float, float] | None = None, most: int = 50
    ) -> list[int]:
        """Put at most so many steps, from the first to the last, into a .gif or .mp4, of one scale and one camera.

        view: from the sheet to the eye, by default that of the run.

        Numbers of the broken ones, which are left out. Says so where pictures cannot be drawn. Raises InputError.
        """
        refuse_ending(path)
        if (fault := system.can_draw()) is not None:
            print(fault)
            return []
        whole = [number for number in range(len(self.files)) if _has_an_end(self.files[number])]
        chosen = np.unique(np.linspace(0, len(whole) - 1, min(len(whole), most)).round().astype(int))
        shapes, left_out = [], [number for number in range(len(self.files)) if number not in set(whole)]
        for number in (whole[k] for k in chosen):
            try:
                shapes.append(self.shape(number, colour))
            except InputError:
                left_out.append(number)
        if not shapes:
            raise InputError(f"None of the {len(self.files)} steps in {str(self.files[0].parent)!r} can be read.")
        places = np.concatenate([shape.in_sight() for shape in shapes])
        box = tuple(np.column_stack([places.min(axis=0), places.max(axis=0)]).ravel())
        limits, label = _scale(np.concatenate([shape.values for shape in shapes]), LABELS[colour])
        pages = [pictures.page(s, label, s.title, view=view or s.view, limits=limits, box=box) for s in shapes]
        _write_film(path, [page[::2, ::2] for page in pages], seconds=5.0)
        return sorted(left_out)


def refuse_ending(path: Path) -> None:
    """Raise InputError for a film that cannot be written here."""
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise InputError(f"A film is a .gif or a .mp4, not {path.name!r}.")
    if path.suffix.lower() == ".mp4" and importlib.util.find_spec("imageio_ffmpeg") is None:
        raise InputError(
            f"{path.name!r} needs imageio-ffmpeg, which is not installed; pip install 'fabric_fenicsx[film]', or take "
            "a .gif."
        )


def _scale(values: Array, label: str) -> tuple[tuple[float, float], str]:
    """Limits of the colours of a film, without few values far beyond all others, and the label that says so."""
    low, high = float(values.min()), float(values.max())
    inner = np.quantile(values, [0.005, 0.995])
    if inner[0] < inner[1] and high - low > 2 * (inner[1] - inner[0]):
        return (float(inner[0]), float(inner[1])), f"{label}, 99 % of it"
    return (low, high), label


def _write_film(path: Path, pages: Sequence[Any], seconds: float) -> None:
    import imageio.v3 as iio

    each = seconds / len(pages)
    if path.suffix.lower() == ".gif":  # made in memory, for on a full disk its writer tries again when it is forgotten
        content = iio.imwrite("<bytes>", np.stack(pages), extension=".gif", duration=1000 * each, loop=0)
        files.replace(path, content)
        return
    with files.whole(path) as rough:
        iio.imwrite(rough, np.stack(pages), fps=1 / each, macro_block_size=2)


def _has_an_end(file: Path) -> bool:
    """Whether the file is there and was written to its end."""
    try:
        with open(file, "rb") as opened:
            opened.seek(max(0, file.stat().st_size - 20))
            return opened.read().rstrip().endswith(b"</VTKFile>")
    except OSError:
        return False


def _read(file: Path, colour: Colour) -> pictures.Shape:
    """A file of `Fields`; InputError, which names it, if it is broken."""
    fault = None if _has_an_end(file) else "it is not there, or has no end"
    try:
        if fault is not None:
            raise ValueError(fault)
        grid = _grid(file)
        title = str(grid.field_data["title"][0])
        (x, y, z), dim = grid.field_data["view"].ravel(), int(grid.field_data["dim"].ravel()[0])
        strain, both = grid.cell_data["strain"], [grid.cell_data[name] for name in ("warp", "weft")]
        moved = grid.point_data["displacement_m"]
        pressure = grid.point_data.get(fields.PRESSURE) if colour == "pressure" else None
    except (ValueError, KeyError, IndexError) as error:
        raise InputError(f"The step in {str(file)!r} cannot be read ({_reason(error)}).") from error
    if colour != "pressure":
        values = coloured(np.asarray(strain).astype(float), colour)
    elif pressure is None:
        raise InputError(f"The step in {str(file)!r} has no pressure, as nothing can touch; choose another colour.")
    else:
        nodes = grid.cells.reshape(grid.n_cells, -1)[:, 1:]
        values = np.asarray(pressure).astype(float)[nodes].mean(axis=1)
    return pictures.Shape(
        dim, grid.cells, grid.celltypes, np.asarray(grid.points).astype(float), np.asarray(moved), values,
        np.stack(both, axis=1).astype(float), title, (float(x), float(y), float(z)),
        _bodies(file.parent.parent / "bodies" / file.name),
    )  # fmt: skip


def _bodies(file: Path) -> list[tuple[Array, np.ndarray]]:
    """Corners and triangles of all bodies beside a step; none where there are none. InputError as `_read`."""
    if not file.exists():
        return []
    try:
        grid = _grid(file)
    except ValueError as error:
        raise InputError(f"The bodies in {str(file)!r} cannot be read ({_reason(error)}).") from error
    return [(np.asarray(grid.points).astype(float), grid.cells.reshape(-1, 4)[:, 1:])]


def _grid(file: Path) -> Any:
    """A PyVista grid. Raises ValueError with what VTK complains of, which it would say to the terminal, and go on."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    window, before, level = (
        vtkStringOutputWindow(),
        vtkOutputWindow.GetInstance(),
        vtkLogger.GetCurrentVerbosityCutoff(),
    )
    vtkOutputWindow.SetInstance(window)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(file))
        reader.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
        vtkLogger.SetStderrVerbosity(level)
    if window.GetOutput().strip():
        raise ValueError(window.GetOutput())
    return pyvista.wrap(reader.GetOutput())


def _reason(error: Exception) -> str:
    if isinstance(error, OSError):
        return str(error.strerror)
    line = str(error).strip().splitlines()[-1] if str(error).strip() else type(error).__name__
    return line.rpartition("): ")[2].rstrip(".")
