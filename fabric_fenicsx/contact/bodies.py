"""Bodies that a sheet may touch: planes, and surfaces of triangles, fixed or led.

A curved surface is made of triangles with their corners on it, so that they stand inside by the `sagitta`. A finer one
costs little where the sheet does not touch it.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..laws import Array
from ..surfaces import meshing

type Vector = Sequence[float]


class Body:
    """A surface of triangles, open or closed, that does not move unless it is led.

    Public: `rest`, its corners (n, 3) in m, and `faces` (m, 3); `target`, where its corners are led to.

    Args:
        rest, faces: see above.
        name: by which results call it.
    """

    def __init__(self, rest: Array, faces: np.ndarray, name: str) -> None:
        self.rest, self.faces, self.name = np.array(rest, dtype=float), np.array(faces, dtype=np.int32), name
        if not (np.isfinite(self.rest).all() and self.faces.size and self.faces.max() < len(self.rest)):
            raise InputError(f"The body {name!r} is not a surface of triangles with finite corners.")
        self.target = self.rest.copy()

    def move(self, shift: Vector = (0, 0, 0), turn: Vector = (0, 0, 0), centre: Vector = (0, 0, 0)) -> None:
        """Lead it as one rigid body: a shift in m after a turn about `centre`, see `supports.grip`; from the start."""
        R, c = Rotation.from_rotvec(np.array(turn, dtype=float)).as_matrix(), np.array(centre, dtype=float)
        self.target = (self.rest - c) @ R.T + c + np.array(shift, dtype=float)

    def deform(self, places: Array) -> None:
        """Lead its corners to these places (n, 3), m."""
        if np.shape(places) != self.rest.shape or not np.isfinite(places).all():
            raise InputError(f"The body {self.name!r} has {len(self.rest)} corners; each needs a finite place.")
        self.target = np.array(places, dtype=float)


class Plane(Body):
    """The space behind a plane without end, exactly; it may be shifted but not turned.

    normal: towards the free side. size: of the square that pictures show, m.
    """

    def __init__(
        self, normal: Vector = (0, 0, 1), point: Vector = (0, 0, 0), *, size: float = 1.0, name: str = "plane"
    ) -> None:
        self.normal, self.point = _unit(normal, name), np.array(point, dtype=float)
        across = np.linalg.svd(self.normal[None])[2][1:]
        corners = self.point + size / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ across
        super().__init__(corners, np.array([[0, 1, 2], [0, 2, 3]]), name)

    def move(self, shift: Vector = (0, 0, 0), turn: Vector = (0, 0, 0), centre: Vector = (0, 0, 0)) -> None:
        """Lead it by a shift in m."""
        if np.any(turn):
            raise InputError(f"The plane {self.name!r} cannot be turned; take a box.")
        super().move(shift)


class Sphere(Body):
    """radius, centre in m; cells: along a quarter of its circumference."""

    def __init__(self, radius: float, centre: Vector = (0, 0, 0), *, cells: int = 12, name: str = "sphere") -> None:
        _positive(name, radius=radius, cells=cells)
        cube, faces = _cube(cells)
        ball = np.tan(np.pi / 4 * cube)
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        self.radius, self.centre = radius, np.array(centre, dtype=float)
        super().__init__(self.centre + radius * ball, faces, name)


class Box(Body):
    """size (3 numbers) and centre in m, its sides along the axes unless turned (rad, see `Body.move`)."""

    def __init__(
        self, size: Vector, centre: Vector = (0, 0, 0), turn: Vector = (0, 0, 0), *, cells: int = 1, name: str = "box"
    ) -> None:
        _positive(name, size=min(size), cells=cells)
        corners, faces = _cube(cells)
        super().__init__(corners * np.array(size) / 2, faces, name)
        self.rest = Rotation.from_rotvec(np.array(turn, dtype=float)).apply(self.rest) + np.array(centre, dtype=float)
        self.target = self.rest.copy()


class Cylinder(Body):
    """A closed cylinder about an axis through its centre, m; cells: along a quarter of its circumference."""

    def __init__(
        self,
        radius: float,
        length: float,
        centre: Vector = (0, 0, 0),
        axis: Vector = (0, 0, 1),
        *,
        cells: int = 12,
        name: str = "",
    ) -> None:
        name = name or type(self).__name__.lower()
        _positive(name, radius=radius, length=length, cells=cells)
        rest, faces = _turned(self._profile(radius, length, cells), 4 * cells)
        super().__init__(rest @ _frame(axis, name) + np.array(centre, dtype=float), faces, name)

    def _profile(self, radius: float, length: float, cells: int) -> Array:
        """Radii and heights, upwards."""
        return np.array([[0, -1], [radius, -1], [radius, 1], [0, 1]]) * np.array([1, length / 2])


class Capsule(Cylinder):
    """A cylinder of this length with half a sphere at each end, about an axis through its centre; as a `Cylinder`."""

    def _profile(self, radius: float, length: float, cells: int) -> Array:
        angle = np.linspace(-np.pi / 2, 0, cells + 1)
        half = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) - np.array([0, length / 2])
        half[0, 0] = 0.0
        return np.concatenate([half, half[::-1] * np.array([1, -1])])


class Ring(Body):
    """A torus: radius of its middle line and of its wire, m; cells: along a quarter of the middle line."""

    def __init__(
        self,
        radius: float,
        wire: float,
        centre: Vector = (0, 0, 0),
        axis: Vector = (0, 0, 1),
        *,
        cells: int = 12,
        name: str = "ring",
    ) -> None:
        _positive(name, radius=radius, wire=wire, cells=cells)
        if wire >= radius:
            raise InputError(f"The body {name!r} has a wire of {wire:g} m, which fills its radius of {radius:g} m.")
        around, across = (2 * np.pi * np.arange(n + 1) / n for n in (4 * cells, max(8, cells)))
        around[-1] = across[-1] = 0.0
        out = radius + wire * np.cos(across)
        circles = [np.column_stack([out * c, out * s, wire * np.sin(across)])
                   for c, s in zip(np.cos(around), np.sin(around), strict=True)]  # fmt: skip
        rest, faces = _joined(np.concatenate(circles), _squares(len(around), len(across)))
        super().__init__(rest @ _frame(axis, name) + np.array(centre, dtype=float), faces, name)


class Surface(Body):
    """Any surface that `meshing.read` takes, open or closed; options are those of `meshing.read`."""

    def __init__(self, path: str | Path, *, name: str = "", **options: float | bool) -> None:
        mesh = meshing.read(path, MPI.COMM_SELF, **options).mesh  # type: ignore[arg-type]
        cells = mesh.geometry.dofmaps[0]
        if mesh.basix_cell().name == "quadrilateral":
            cells = np.concatenate([cells[:, [0, 1, 3]], cells[:, [0, 3, 2]]])
        used, faces = np.unique(cells[:, :3], return_inverse=True)
        super().__init__(mesh.geometry.x[used], faces.reshape(-1, 3), name or Path(path).stem)


def _unit(vector: Vector, name: str) -> Array:
    size = np.linalg.norm(vector)
    if not (np.isfinite(size) and size > 0.0):
        raise InputError(f"The direction {tuple(vector)!r} of the body {name!r} is none; write it as (0, 0, 1).")
    return np.array(vector, dtype=float) / size


def _positive(name: str, **sizes: float) -> None:
    for key, value in sizes.items():
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"The body {name!r} has {key} = {value!r}, which is not a positive number.")


def _frame(axis: Vector, name: str) -> Array:
    """Rows: two directions across the axis, and the axis."""
    z = _unit(axis, name)
    x = np.linalg.svd(z[None])[2][1]
    return np.array([x, np.cross(z, x), z])


def _cube(cells: int) -> tuple[Array, np.ndarray]:
    """Corners of the cube from -1 to 1 whose sides are of cells x cells squares, and its triangles, outward."""
    n = cells + 1
    s, t = (a.ravel() for a in np.meshgrid(*[np.linspace(-1, 1, n)] * 2, indexing="ij"))
    sides = [np.roll(np.stack([np.full(n * n, side), s, t * side], axis=1), k, axis=1) for side in (-1.0, 1.0)
             for k in range(3)]  # fmt: skip
    squares = _squares(n, n)
    faces = np.concatenate([squares + k * n * n for k in range(6)])
    return _joined(np.concatenate(sides), faces)


def _turned(profile: Array, count: int) -> tuple[Array, np.ndarray]:
    """A surface about z of a profile of radii and heights (n, 2), upwards, whose ends are on the axis."""
    angle = 2 * np.pi * np.arange(count + 1) / count
    angle[-1] = 0.0
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    x = np.concatenate([np.column_stack([r * around, np.full(count + 1, z)]) for r, z in profile])
    return _joined(x, _squares(len(profile), count + 1)[:, ::-1])


def _squares(n: int, m: int) -> np.ndarray:
    """Two triangles for each square of a grid of n x m points."""
    i = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    return np.concatenate([np.stack([i, i + m, i + m + 1], axis=1), np.stack([i, i + m + 1, i + 1], axis=1)])


def _joined(x: Array, faces: np.ndarray) -> tuple[Array, np.ndarray]:
    """The same with points that coincide as one, and without the triangles that this makes lines of."""
    size = np.abs(x).max()
    _, first, which = np.unique(np.round(x / size, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    faces = which.ravel()[faces]
    a, b, c = faces.T
    return x[first], faces[(a != b) & (b != c) & (c != a)]


KINDS: dict[str, Callable[..., Body]] = {
    "plane": Plane, "sphere": Sphere, "cylinder": Cylinder, "capsule": Capsule, "box": Box,
    "ring": Ring, "surface": Surface
}  # fmt: skip
"""Name -> kind of body."""
