"""Flat panels of cloth as a pattern has them: outlines, the grain line, and where each starts around the wearer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..laws import Array
from .outlines import area

type Point = Sequence[float]
type Shape = Literal["line", "arc", "spline", "bezier", "points"]
FINE = 200
"""Parts of a curve by which its length is told."""


@dataclass(frozen=True)
class Edge:
    """One edge of an outline, from `start` to where the next edge begins; points in m, two numbers each.

    shape: "line"; "arc" of a circle through the one point of `through`; "spline", a smooth curve through them;
    "bezier", with one or two of them as its control points; "points", straight from each to the next.
    """

    start: Point
    through: Sequence[Point] = ()
    shape: Shape = "line"

    def curve(self, end: Point) -> Array:
        """Points on it as far as its end, (n, 2) in m, near to each other where it is bent. Raises InputError."""
        a, b, inner = np.array(self.start, float), np.array(end, float), np.array(self.through, float).reshape(-1, 2)
        fitting = {"line": (0,), "arc": (1,), "bezier": (1, 2)}.get(self.shape)
        if not (np.isfinite([*a, *b]).all() and np.isfinite(inner).all() and (a != b).any()):
            raise InputError(f"The edge from {self.start} to {tuple(end)} has no length, or is not finite.")
        if (fitting and len(inner) not in fitting) or (not fitting and not len(inner)):
            raise InputError(f"An edge of shape {self.shape!r} cannot go through {len(inner)} points between its ends.")
        every, t = np.array([a, *inner, b]), np.linspace(0, 1, FINE + 1)[:, None]
        if self.shape == "line" or self.shape == "points":
            return every
        if self.shape == "bezier":  # de Casteljau
            parts = list(every)
            while len(parts) > 1:
                parts = [p * (1 - t) + q * t for p, q in pairwise(parts)]
            return np.asarray(parts[0])
        if self.shape == "arc":
            return _arc(a, inner[0], b)
        s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(every, axis=0), axis=1))])
        return np.asarray(CubicSpline(s, every)(s[-1] * t[:, 0]))


class Placed(Protocol):
    """Where a panel starts: from its points (n, 2) to places in space (n, 3), m."""

    def __call__(self, points: Array) -> Array:
        """See above."""
        ...


@dataclass(frozen=True)
class Flat:
    """As it is, after a turn about the origin (rad, by the right-hand rule, as long as its angle) and a shift in m."""

    shift: Sequence[float] = (0.0, 0.0, 0.0)
    turn: Sequence[float] = (0.0, 0.0, 0.0)

    def __call__(self, points: Array) -> Array:
        """See `Placed`."""
        flat = np.column_stack([points, np.zeros(len(points))])
        return np.asarray(Rotation.from_rotvec(np.array(self.turn, float)).apply(flat) + np.array(self.shift, float))


@dataclass(frozen=True)
class Rolled:
    """Rolled onto a cylinder about a limb, y along it, face outwards.

    Args:
        radius: of the cylinder, m.
        origin: where the axis is at y = `level`; axis: along which y goes; facing: direction across the axis where
            x = `middle` comes to lie.
        level, middle: of the panel, m.
        span: angle that a width of the panel takes, as (width in m, angle in rad); by default as wide as it is.
    """

    radius: float
    origin: Sequence[float] = (0.0, 0.0, 0.0)
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    facing: Sequence[float] = (1.0, 0.0, 0.0)
    level: float = 0.0
    middle: float = 0.0
    span: tuple[float, float] | None = None

    def __call__(self, points: Array) -> Array:
        """See `Placed`."""
        z = np.array(self.axis, float) / np.linalg.norm(self.axis)
        out = np.array(self.facing, float) - np.dot(self.facing, z) * z
        if not np.linalg.norm(out) > 1e-6:
            raise InputError(f"A panel is rolled about {tuple(self.axis)}, and cannot face along it.")
        out /= np.linalg.norm(out)
        width, angle = self.span or (self.radius, 1.0)
        t = (points[:, :1] - self.middle) * angle / width
        across = self.radius * (np.cos(t) * out + np.sin(t) * np.cross(z, out))
        return np.asarray(np.array(self.origin, float) + (points[:, 1:] - self.level) * z + across)


@dataclass(frozen=True)
class Panel:
    """A piece of a pattern, as it is drawn on the cloth: at rest it is flat and faces up.

        front = Panel("front", {"hem": Edge((0, 0)), "side": Edge((0.5, 0)), "top": Edge((0.5, 0.6)),
                                "middle": Edge((0, 0.6))}, placed=Flat(shift=(0, 0, 0.2)))

    Args:
        name: of its cells; of an edge "name.edge".
        outline: its edges by their names, anticlockwise.
        grain: direction of the warp from x, rad; by default along y.
        material: name of its material, by default its own.
        placed: where it starts.
        regular: cells in rows and columns, which take four edges, opposite ones with as many cells; by default of four
            straight edges.

    Raises InputError for an outline that is none.
    """

    name: str
    outline: Mapping[str, Edge]
    grain: float = np.pi / 2
    material: str = ""
    placed: Placed = field(default_factory=Flat)
    regular: bool | None = None

    def __post_init__(self) -> None:
        if len(self.outline) < 2:
            raise InputError(f"The outline of the panel {self.name!r} needs two edges at least.")
        if not area([*self.curves().values()]) > 0.0:
            raise InputError(f"The outline of the panel {self.name!r} must go round anticlockwise; turn its order.")
        if self.regular and len(self.outline) != 4:
            raise InputError(f"The panel {self.name!r} has {len(self.outline)} edges, and regular cells need four.")

    @property
    def is_regular(self) -> bool:
        """Whether its cells lie in rows and columns."""
        if self.regular is None:
            return len(self.outline) == 4 and all(edge.shape == "line" for edge in self.outline.values())
        return self.regular

    @property
    def warp(self) -> tuple[float, float, float]:
        """Direction of the warp, for `material.Material`."""
        return float(np.cos(self.grain)), float(np.sin(self.grain)), 0.0

    def curves(self) -> dict[str, Array]:
        """Points on each edge, see `Edge.curve`. Raises InputError."""
        edges = list(self.outline.values())
        ends = [edge.start for edge in [*edges[1:], edges[0]]]
        try:
            return {name: e.curve(end) for (name, e), end in zip(self.outline.items(), ends, strict=True)}
        except InputError as error:
            raise InputError(f"The panel {self.name!r}: {error}") from None

    def lengths(self) -> dict[str, float]:
        """Of each edge, m."""
        return {name: float(np.linalg.norm(np.diff(x, axis=0), axis=1).sum()) for name, x in self.curves().items()}


def spread(curve: Array, parts: int) -> Array:
    """The points that cut a curve (n, 2) into so many parts of one length, its ends included."""
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = s[-1] * np.arange(parts + 1) / parts
    return np.column_stack([np.interp(at, s, column) for column in curve.T])


def _arc(a: Array, m: Array, b: Array) -> Array:
    """Points on the arc of a circle from a through m to b."""
    # |c - a|^2 = |c - m|^2 = |c - b|^2
    rows = np.array([m - a, b - a])
    if abs(np.linalg.det(rows)) < 1e-12 * np.linalg.norm(rows) ** 2:
        raise InputError(f"The arc from {tuple(a)} through {tuple(m)} is a straight line.")
    c = np.linalg.solve(rows, (rows @ np.array([m + a, b + a]).T).diagonal() / 2)
    start, middle, end = (np.arctan2(*(x - c)[::-1]) for x in (a, m, b))
    turn, half = (end - start) % (2 * np.pi), (middle - start) % (2 * np.pi)
    t = start + np.linspace(0, 1, FINE + 1) * (turn if half < turn else turn - 2 * np.pi)
    points = c + np.linalg.norm(a - c) * np.column_stack([np.cos(t), np.sin(t)])
    points[0], points[-1] = a, b
    return np.asarray(points)
