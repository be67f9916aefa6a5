"""A run's sheet at every step, on disk, to be drawn later without its mesh, its law or MPI."""

from pathlib import Path

import numpy as np
from mpi4py import MPI
from dolfinx import fem

from .. import system
from ..errors import InputError
from ..laws import Array
from . import pictures

LABELS = {
    "yarn": "larger yarn strain (-)",
    "warp": "warp strain E11 (-)",
    "weft": "weft strain E22 (-)",
    "shear": "shear strain 2 E12 (-)",
}
"""What a sheet can be coloured by, and how it is labelled."""


def coloured(strain: Array, colour: str) -> Array:
    """One value for each cell from its strains (cells, 3 or more); colour: of `LABELS`."""
    if colour == "yarn":
        return np.asarray(strain[:, :2].max(axis=1))
    return np.asarray(strain[:, ("warp", "weft", "shear").index(colour)])


class Frames:
    """Writes a folder, one file a step; what an earlier run left there is removed.

    title: of every picture, and `when` what follows it, as in "t = {:.4g} s". view: from the sheet to the eye.
    """

    def __init__(
        self,
        folder: Path,
        title: str,
        when: str,
        view: tuple[float, float, float] = pictures.VIEW,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> None:
        about = {"title": title, "when": when, "view": view}
        self.folder, self._about, self._count = folder, {name: np.array(value) for name, value in about.items()}, 0
        if comm.rank == 0:
            folder.mkdir(parents=True, exist_ok=True)
            for old in folder.glob("*.npz"):
                old.unlink()

    def add(self, time: float, u: fem.Function, strain: Array, yarns: Array) -> None:
        """Add the present state, each array with one row a local cell; to be called on every rank."""
        shape = pictures.shape(u, strain, yarns)
        if shape is None:
            return
        if self._count == 0:
            mesh = {"dim": np.array(shape.dim), "cells": shape.cells, "kinds": shape.kinds, "points": shape.points}
            np.savez_compressed(self.folder / "mesh.npz", allow_pickle=False, **mesh, **self._about)
        small = {"moved": shape.moved, "strain": shape.values, "yarns": shape.yarns}
        arrays = {name: np.asarray(array, dtype=np.float32) for name, array in small.items()}
        arrays["time"] = np.array(time)
        np.savez_compressed(self.folder / f"{self._count:06d}.npz", allow_pickle=False, **arrays)
        self._count += 1


class Series:
    """What `Frames` has written. Raises InputError for a folder that holds none."""

    def __init__(self, folder: Path) -> None:
        self._files = sorted(file for file in folder.glob("*.npz") if file.name != "mesh.npz")
        try:
            self._mesh = dict(np.load(folder / "mesh.npz"))
            self.times = [float(np.load(file)["time"]) for file in self._files]
            x, y, z = map(float, self._mesh["view"])
        except (OSError, KeyError, ValueError) as error:
            raise InputError(
                f"{str(folder)!r} holds no frames; give the output folder of 'fabric-fenicsx run', or of a demo that "
                "was run with --animation."
            ) from error
        self.view = (x, y, z)

    def shape(self, number: int, colour: str) -> pictures.Shape:
        """A frame, coloured; -1 is the last."""
        frame, mesh = np.load(self._files[number]), self._mesh
        values, moved, yarns = (frame[key].astype(float) for key in ("strain", "moved", "yarns"))
        return pictures.Shape(
            int(mesh["dim"]), mesh["cells"], mesh["kinds"], mesh["points"], moved, coloured(values, colour), yarns
        )

    def picture(
        self,
        path: Path,
        number: int = -1,
        colour: str = "yarn",
        view: tuple[float, float, float] | None = None,
        limits: tuple[float, float] | None = None,
        box: tuple[float, ...] | None = None,
    ) -> None:
        """Draw a frame; limits and box as of `pictures.draw`."""
        title = f"{self._mesh['title']}, {str(self._mesh['when']).format(self.times[number])}"
        pictures.draw(path, self.shape(number, colour), LABELS[colour], title, view or self.view, limits, box)

    def animation(
        self, path: Path, colour: str = "yarn", view: tuple[float, float, float] | None = None, most: int = 50
    ) -> None:
        """Draw at most so many frames with one scale and one camera, and put them together into a .gif or .mp4.

        Says so where pictures cannot be drawn.
        """
        if (fault := system.can_draw()) is not None:
            print(fault)
            return
        numbers = range(0, len(self.times), -(-len(self.times) // most))
        shapes = [self.shape(number, colour) for number in numbers]
        places = np.concatenate([shape.points + shape.moved for shape in shapes])
        box = tuple(np.column_stack([places.min(axis=0), places.max(axis=0)]).ravel())
        limits = min(s.values.min() for s in shapes), max(s.values.max() for s in shapes)
        folder = path.parent / f"{path.stem}_frames"
        folder.mkdir(exist_ok=True)
        drawn = [folder / f"{number:06d}.png" for number in numbers]
        for file, number in zip(drawn, numbers, strict=True):
            self.picture(file, number, colour, view, limits, box)
        pictures.film(path, drawn, seconds=5.0)
