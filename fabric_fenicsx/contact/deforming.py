"""Bodies that deform as they are told: a surface of triangles with the places of its corners at so many times."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..errors import InputError
from ..files import in_order
from ..laws import Array
from ..surfaces import importing
from .bodies import Body

ENDINGS = (".obj", ".ply")
"""Of the files of a folder of frames."""


class Deforming(Body):
    """A surface whose corners go from frame to frame, without a jump of their velocity; it rests before and after them.

        arm = Deforming(frames, faces, times)
        def set_load(t): arm.at(t)

    Public: `frames`, `times`; `rest` is the first frame.

    Args:
        frames: places of its corners (frames, n, 3), m.
        faces: (m, 3). Corners on none of them are left out.
        times: of the frames, s, each after the one before.
        name: see `Body`.

    Raises InputError for what is no such motion.
    """

    def __init__(self, frames: Array, faces: np.ndarray, times: Sequence[float] | Array, *, name: str = "body") -> None:
        frames, faces, self.times = np.asarray(frames, dtype=float), np.asarray(faces), np.array(times, dtype=float)
        if frames.ndim != 3 or frames.shape[2] != 3 or not len(frames):
            raise InputError(f"The body {name!r} has frames of shape {frames.shape}; give (frames, corners, 3).")
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu" or not faces.size:
            raise InputError(f"The body {name!r} has faces of shape {faces.shape}; give whole numbers (triangles, 3).")
        if not 0 <= faces.min() <= faces.max() < frames.shape[1]:
            raise InputError(
                f"The body {name!r} has faces of corners {faces.min()} to {faces.max()}; its frames have "
                f"{frames.shape[1]}, which are counted from 0."
            )
        if self.times.shape != (len(frames),):
            raise InputError(f"The body {name!r} has {self.times.size} times for {len(frames)} frames; give one each.")
        late = np.flatnonzero(~(np.diff(self.times) > 0.0))
        if not np.isfinite(self.times).all() or late.size:
            k = int(late[0]) if late.size else 0
            raise InputError(
                f"The body {name!r} has times that do not increase: frame {k + 1} is at {self.times[k]:g} s and the "
                f"next at {self.times[min(k + 1, len(frames) - 1)]:g} s."
            )
        lost = np.flatnonzero(~np.isfinite(frames).all(axis=(1, 2)))
        if lost.size:
            raise InputError(f"The body {name!r} has places in frame {lost[0] + 1} that are not finite.")
        used, which = np.unique(faces, return_inverse=True)
        self.frames = frames[:, used]
        super().__init__(self.frames[0], which.reshape(-1, 3), name)

    @classmethod
    def read(cls, path: str | Path, *, rate: float | None = None, scale: float = 1.0, name: str = "") -> Self:
        """From a .npz file with `frames`, `faces` and `times` (s), or a folder of .obj or .ply files, one a frame.

        Args:
            rate: frames a second; a folder needs it, and a file without times.
            scale: metres to a unit of the file.

        Raises InputError.
        """
        path, name = Path(path), name or Path(path).stem
        frames, faces, times = _folder(path) if path.is_dir() else _archive(path)
        if (times is None) == (rate is None):
            reason = "no times: give a rate" if rate is None else f"times of its own, and no rate of {rate!r}"
            raise InputError(f"{str(path)!r} has {reason}.")
        if rate is not None:
            if not (np.isfinite(rate) and rate > 0.0):
                raise InputError(f"The body {name!r} has rate = {rate!r}, which is not a positive number.")
            times = np.arange(len(frames)) / rate
        assert times is not None
        return cls(scale * frames, faces, times, name=name)

    def places(self, time: float) -> Array:
        """Where its corners are at a time in s, (n, 3) in m."""
        t = float(np.clip(time, self.times[0], self.times[-1]))
        k = int(np.searchsorted(self.times, t, side="right")) - 1
        if t == self.times[k]:
            return np.asarray(self.frames[k])
        near = slice(max(k - 1, 0), k + 3)
        speeds = np.gradient(self.frames[near], self.times[near], axis=0)[k - near.start :][:2]
        if k == 0:
            speeds[0] = 0.0
        if k == len(self.times) - 2:
            speeds[1] = 0.0
        return np.asarray(CubicHermiteSpline(self.times[k : k + 2], self.frames[k : k + 2], speeds)(t))

    def at(self, time: float) -> None:
        """Lead its corners to where they are at a time in s."""
        self.deform(self.places(time))


type _Frames = tuple[Array, np.ndarray, Array | None]


def _archive(path: Path) -> _Frames:
    try:
        with np.load(path, allow_pickle=False) as file:
            missing = {"frames", "faces"} - set(file.files)
            if missing:
                raise InputError(f"{str(path)!r} has no array {sorted(missing)[0]!r}; it has {', '.join(file.files)}.")
            found = np.asarray(file["frames"]), np.asarray(file["faces"])
            return *found, np.asarray(file["times"]) if "times" in file.files else None
    except InputError:
        raise
    except (OSError, ValueError, EOFError, AttributeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is no .npz archive of numbers"
        raise InputError(
            f"The frames in {str(path)!r} cannot be read: {reason}; give an .npz file, or a folder of .obj or .ply."
        ) from error


def _folder(path: Path) -> _Frames:
    files = sorted((file for file in path.iterdir() if file.suffix.lower() in ENDINGS), key=in_order)
    if not files:
        raise InputError(f"The folder {str(path)!r} has no .obj or .ply file in it.")
    frames, first = [], None
    for file in files:
        points, faces = _triangles(file)
        if first is None:
            first = points, faces
        if len(points) != len(first[0]):
            raise InputError(
                f"{str(file)!r} has {len(points)} corners, and the first frame, {files[0].name!r}, {len(first[0])}."
            )
        if not np.array_equal(faces, first[1]):
            raise InputError(f"{str(file)!r} has other triangles than the first frame, {files[0].name!r}.")
        frames.append(points)
    assert first is not None
    return np.array(frames), first[1], None


def _triangles(path: Path) -> tuple[Array, np.ndarray]:
    """Corners and triangles of a file, in its order; squares are cut in two."""
    raw, faces = importing.load(path), [np.empty((0, 3), dtype=np.int64)]
    for kind, nodes, _ in raw.faces:
        if kind == "triangle":
            faces.append(nodes[:, :3])
        elif kind == "quadrilateral":
            faces += [nodes[:, [0, 1, 3]], nodes[:, [0, 3, 2]]]
        else:
            raise InputError(f"{str(path)!r} has faces of {nodes.shape[1]} corners: save it with triangles.")
    return raw.points, np.concatenate(faces)
