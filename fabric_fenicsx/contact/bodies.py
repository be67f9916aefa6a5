"""Bodies that a sheet may touch: planes, simple ones, and surfaces of triangles, fixed, led or free.

Planes, spheres and capsules without mass are exact, see `shapes`, if these are not small against a sheet's cells; their
triangles are for pictures. Others touch as triangles, whose corners are on curved surfaces: a finer one costs little
where the sheet does not touch it.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..laws import Array
from ..surfaces import meshing
from .triangles import cube, joined, squares, turned

type Vector = Sequence[float]


class Body:
    """A surface of triangles, open or closed, that does not move unless it is led, or is `free`.

    Public: `rest`, its corners (n, 3) in m, and `faces` (m, 3); `target`, where its corners are led to, or have got
    to; `mass` and what else `free` sets.

    Args:
        rest, faces: see above.
        name: by which results call it.
    """

    mass: float | None = None
    inertia: Array | None = None
    velocity: Vector = (0, 0, 0)
    spin: Vector = (0, 0, 0)

    def __init__(self, rest: Array, faces: np.ndarray, name: str) -> None:
        self.rest, self.faces, self.name = np.array(rest, dtype=float), np.array(faces, dtype=np.int32), name
        if not (np.isfinite(self.rest).all() and self.faces.size and self.faces.max() < len(self.rest)):
            raise InputError(f"The body {name!r} is not a surface of triangles with finite corners.")
        self.target = self.rest.copy()

    def free(
        self,
        mass: float,
        *,
        inertia: Literal["solid"] | Sequence[float] | Array | None = None,
        velocity: Vector = (0, 0, 0),
        spin: Vector = (0, 0, 0),
    ) -> Self:
        """Let it move as the sheet and its weight have it; itself. It touches the sheet alone, no other body.

        Args:
            mass: kg.
            inertia: None: it does not turn. Else its moments of inertia, kg m2, about axes along x, y and z through its
                middle, or their matrix; or those of a body that is filled evenly.
            velocity, spin: at the start, m/s and rad/s.
        """
        _positive(self.name, mass=mass)
        self.mass, self.middle, solid = mass, *_filled(self.rest, self.faces)
        if inertia is not None:
            solid = mass * solid if isinstance(inertia, str) else np.array(inertia, dtype=float)
            self.inertia = np.diag(solid) if solid.shape == (3,) else solid
            whole = self.inertia.shape == (3, 3) and np.isfinite(self.inertia).all()
            if not whole or 2 * np.linalg.eigvalsh(self.inertia).max() > np.trace(self.inertia) * (1 + 1e-9) + 1e-300:
                raise InputError(
                    f"The body {self.name!r} has inertia = {inertia!r}, which is no body's: give three moments in "
                    "kg m2, none larger than the other two together, or 'solid'."
                )
        self.velocity, self.spin = velocity, spin
        if not np.isfinite([*velocity, *spin]).all() or (np.any(spin) and self.inertia is None):
            raise InputError(
                f"The body {self.name!r} has velocity = {tuple(velocity)!r} and spin = {tuple(spin)!r}: give finite "
                "numbers, and an inertia to what spins."
            )
        return self

    def move(self, shift: Vector = (0, 0, 0), turn: Vector = (0, 0, 0), centre: Vector = (0, 0, 0)) -> None:
        """Lead it as one rigid body: a shift (m) after a turn (rad) about a centre, see `supports.grip`."""
        self._ledable()
        R, c = Rotation.from_rotvec(np.array(turn, dtype=float)).as_matrix(), np.array(centre, dtype=float)
        self.target = (self.rest - c) @ R.T + c + np.array(shift, dtype=float)

    def deform(self, places: Array) -> None:
        """Lead its corners to these places (n, 3), m."""
        self._ledable()
        if np.shape(places) != self.rest.shape or not np.isfinite(places).all():
            raise InputError(f"The body {self.name!r} has {len(self.rest)} corners; each needs a finite place.")
        self.target = np.array(places, dtype=float)

    def _ledable(self) -> None:
        if self.mass is not None:
            raise InputError(f"The body {self.name!r} has mass and moves freely; leave the mass out to lead it.")


class Rigid(Body):
    """A body that keeps its shape, which is exact where no triangles are needed; see `shapes`."""

    def deform(self, places: Array) -> None:
        """Refused."""
        raise InputError(
            f"The body {self.name!r} keeps its shape: take a `Body` of its corners and faces to deform it."
        )


class Plane(Rigid):
    """The space behind a plane without end, exactly; it may be shifted but not turned.

    normal: towards the free side. point: on it, m. size: of the square that pictures show, m.
    """

    def __init__(
        self, normal: Vector = (0, 0, 1), point: Vector = (0, 0, 0), *, size: float = 1.0, name: str = "plane"
    ) -> None:
        self.normal, self.point = _unit(normal, name), np.array(point, dtype=float)
        across = np.linalg.svd(self.normal[None])[2][1:]
        corners = self.point + size / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ across
        super().__init__(corners, np.array([[0, 1, 2], [0, 2, 3]]), name)

    def free(self, mass: float, **motion: Any) -> Self:
        """None has an end, and so none moves freely, whatever its mass (kg)."""
        raise InputError(f"The plane {self.name!r} cannot have mass; take a box.")

    def move(self, shift: Vector = (0, 0, 0), turn: Vector = (0, 0, 0), centre: Vector = (0, 0, 0)) -> None:
        """Lead it by a shift in m; its turn has to be none, and so `centre` says nothing."""
        if np.any(turn):
            raise InputError(f"The plane {self.name!r} cannot be turned; take a box.")
        super().move(shift)


class Sphere(Rigid):
    """radius, centre in m; cells: along a quarter of its circumference."""

    def __init__(self, radius: float, centre: Vector = (0, 0, 0), *, cells: int = 12, name: str = "sphere") -> None:
        _positive(name, radius=radius, cells=cells)
        corners, faces = cube(cells)
        ball = np.tan(np.pi / 4 * corners)
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        self.radius, self.centre = radius, np.array(centre, dtype=float)
        super().__init__(self.centre + radius * ball, faces, name)


class Box(Rigid):
    """size (3 numbers) and centre in m, its sides along the axes before its turn (rad, see `Body.move`)."""

    def __init__(
        self, size: Vector, centre: Vector = (0, 0, 0), turn: Vector = (0, 0, 0), *, cells: int = 1, name: str = "box"
    ) -> None:
        _positive(name, size=min(size), cells=cells)
        corners, faces = cube(cells)
        super().__init__(corners * np.array(size) / 2, faces, name)
        self.size, self.frame = size, Rotation.from_rotvec(np.array(turn, dtype=float)).as_matrix().T
        self.rest = self.rest @ self.frame + np.array(centre, dtype=float)
        self.target = self.rest.copy()


class Cylinder(Rigid):
    """A closed cylinder: radius and length in m, axis through its centre (m); cells: in a quarter of its circle."""

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
        rest, faces = turned(self._profile(radius, length, cells), 4 * cells)
        self.radius, self.length, self.frame = radius, length, _frame(axis, name)
        super().__init__(rest @ self.frame + np.array(centre, dtype=float), faces, name)

    def _profile(self, radius: float, length: float, cells: int) -> Array:
        """Radii and heights, upwards."""
        return np.array([[0, -1], [radius, -1], [radius, 1], [0, 1]]) * np.array([1, length / 2])


class Capsule(Cylinder):
    """A `Cylinder` of this length, its centre and axis, with half a sphere of its radius at each end; all in m."""

    def _profile(self, radius: float, length: float, cells: int) -> Array:
        angle = np.linspace(-np.pi / 2, 0, cells + 1)
        half = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) - np.array([0, length / 2])
        half[0, 0] = 0.0
        return np.concatenate([half, half[::-1] * np.array([1, -1])])


class Ring(Body):
    """A torus: radius of its middle line and of its wire, centre in m, axis across it; cells: in a quarter of it."""

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
        rest, faces = joined(np.concatenate(circles), squares(len(around), len(across)))
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


def _filled(x: Array, faces: np.ndarray) -> tuple[Array, Array]:
    """Middle, and inertia about it (3, 3) for a mass of 1, of what a closed surface holds; of an open one, itself."""
    corners = x[faces]
    about = corners.mean(axis=(0, 1))
    a, b, c = (corners - about).transpose(1, 0, 2)
    volume = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6
    ends = np.stack([np.zeros_like(a), a, b, c], axis=1)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    if (np.unique(edges, axis=0, return_counts=True)[1] != 2).any() or abs(volume.sum()) < 1e-300:
        volume, ends = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, ends[:, 1:]
    parts, n = volume / volume.sum(), ends.shape[1]
    middle = parts @ ends.mean(axis=1)
    # of a simplex of unit mass: sum of its ends' squares, and the square of their sum, over n (n + 1)
    total = ends.sum(axis=1)
    square = np.einsum("n,nki,nkj->ij", parts, ends, ends) + np.einsum("n,ni,nj->ij", parts, total, total)
    square = square / (n * (n + 1)) - np.outer(middle, middle)
    return about + middle, np.trace(square) * np.eye(3) - square


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


KINDS: dict[str, Callable[..., Body]] = {
    "plane": Plane, "sphere": Sphere, "cylinder": Cylinder, "capsule": Capsule, "box": Box,
    "ring": Ring, "surface": Surface
}  # fmt: skip
"""Name -> kind of body."""
