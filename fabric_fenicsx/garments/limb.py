"""Limbs that bend, as one closed surface of triangles each; positions in m, angles in degrees.

A limb is a chain of bones in one plane with a radius along it. Near a joint its skin is that of the smooth union of the
two parts that meet there (as of implicit surfaces: Ricci 1973, doi:10.1093/comjnl/16.2.157), found along rays from the
bones. All rays of a ring are in one plane, and all those planes meet in a line inside of the bend, beyond the skin, so
that no two rings cross however far it bends. Flesh is not moved aside: what two parts share is there once.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from ..contact.deforming import Deforming
from ..errors import InputError
from ..laws import Array

type Vector = Sequence[float]
FILLET = 0.5
"""Of the radius at a joint: what rounds the fold of a limb that is bent by 180 degrees."""
STEP = 1e-3
"""Degrees, for differences by the angle."""
TURN = 4.0
"""Degrees between two frames of a motion."""


@dataclass(frozen=True)
class Bend:
    """A joint along a limb: its place (m), to how many degrees it bends either way, and -1 where it does backwards."""

    place: float
    most: float = 130.0
    sign: int = 1


@dataclass(frozen=True)
class Joint:
    """Where a limb bends: its centre (m), and the axis about which what is beyond it turns by the right-hand rule."""

    centre: tuple[float, float, float]
    axis: tuple[float, float, float]


@dataclass(frozen=True)
class Limb:
    """A limb that hangs from its first joint; straight, it goes along `along`.

    Args:
        name: of the body.
        length: from the first joint to the tip, m.
        stations: places along it (m) and radii there (m); between them the radius has no steps, at joints no slope.
            Both ends are round.
        root: name of the first joint.
        joints: the others, by their names.
        origin: place of the first joint.
        along, axis: direction of the straight limb, and of the axes of all joints.
        size: of its triangles, m.
        posture: angles of joints that are not told.
    """

    name: str
    length: float
    stations: tuple[tuple[float, float], ...]
    root: str
    joints: Mapping[str, Bend]
    origin: Vector = (0.0, 0.0, 0.0)
    along: Vector = (0.0, 0.0, -1.0)
    axis: Vector = (1.0, 0.0, 0.0)
    size: float = 10e-3
    posture: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        s, r = np.array(self.stations, dtype=float).T
        fine = np.isfinite([*s, *r, self.length, self.size]).all() and self.size > 0.0
        if not (fine and s[0] == 0.0 and (np.diff(s) > 0.0).all() and (r > 0.0).all() and s[-1] + r[-1] <= self.length):
            raise InputError(
                f"The {self.name} needs radii at places from 0 on, the last of them its radius before the tip at "
                f"{self.length:g} m, all in m and positive."
            )
        across = np.cross(self.along, self.axis)
        if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(self.along) * np.linalg.norm(self.axis):
            raise InputError(f"The {self.name} cannot go along {tuple(self.along)} and bend about {tuple(self.axis)}.")
        before = 0.0
        for name, bend in self.joints.items():
            reach = self._reach(bend)
            if not before <= bend.place - reach < bend.place + reach <= self.length - r[-1]:
                raise InputError(f"The {self.name} is too thick to bend by {bend.most:g} degrees at its {name}.")
            before = bend.place + reach

    # -- shape ---------------------------------------------------------------------------------------------------------

    def radius(self, s: Array | float) -> Array:
        """Of the straight limb at a distance from the first joint, ends included, m."""
        profile, last = self._profile
        s = np.asarray(s, dtype=float)
        inside = profile(np.clip(s, 0.0, last))
        beyond = np.where(s < 0.0, s, np.maximum(s - last, 0.0))
        return np.sqrt(np.maximum(inside**2 - beyond**2, 0.0))

    @cached_property
    def _profile(self) -> tuple[CubicHermiteSpline, float]:
        """The radius between the round ends, and where it ends."""
        x, r = np.array(self.stations, dtype=float).T
        last = self.length - r[-1]
        if x[-1] < last:
            x, r = np.append(x, last), np.append(r, r[-1])
        slopes = PchipInterpolator(x, r)(x, 1)
        slopes[np.isin(x, [0.0, last, *(bend.place for bend in self.joints.values())])] = 0.0
        return CubicHermiteSpline(x, r, slopes), float(last)

    def _reach(self, bend: Bend) -> float:
        """How far from a joint the skin is that of one bone, even in the furthest bend; infinite if nowhere."""
        angle, r0 = np.radians(bend.most), float(self.radius(bend.place))
        a = np.arange(1, 401) / 400 * min(bend.place, self.length - bend.place)
        clear = np.ones(len(a), dtype=bool)
        for sign in (1, -1):
            own = self.radius(bend.place + sign * a)
            along = np.maximum(own * np.sin(angle) - a * np.cos(angle), 0.0)
            clear &= a * np.sin(angle) + own * np.cos(angle) - self.radius(bend.place - sign * along) > FILLET * r0
        return float(a[np.flatnonzero(~clear).max(initial=-1) + 1]) if clear[-1] else np.inf

    def _rings(self) -> tuple[Array, int]:
        """Places of rings along the limb, and how many corners each has."""
        first, last = -float(self.radius(0.0)), self.length
        s = first + (last - first) * (1 - np.cos(np.linspace(0, np.pi, 4001))) / 2
        way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(s), np.diff(self.radius(s))))])
        rings = np.interp(np.linspace(0, way[-1], int(np.ceil(way[-1] / self.size)) + 1), way, s)[1:-1]
        around = int(np.ceil(2 * np.pi * max(r for _, r in self.stations) / self.size))
        return rings, 2 * ((around + 1) // 2)

    @property
    def faces(self) -> np.ndarray:
        """Triangles (m, 3) between the corners of a pose, outwards; the two tips come last."""
        rings, n = self._rings()
        i = (np.arange(len(rings) - 1)[:, None] * n + np.arange(n)).ravel()
        j = i - i % n + (i + 1) % n
        k, top, tip = np.arange(n), len(rings) * n, (len(rings) - 1) * n
        ends = [
            np.stack([np.full(n, top), (k + 1) % n, k], axis=1),
            np.stack([np.full(n, top + 1), tip + k, tip + (k + 1) % n], axis=1),
        ]
        walls = [np.stack([i, j, j + n], axis=1), np.stack([i, j + n, i + n], axis=1)]
        return np.concatenate([*walls, *ends]).astype(np.int32)

    # -- poses ---------------------------------------------------------------------------------------------------------

    def pose(self, **degrees: float) -> Array:
        """Corners of the skin (n, 3) with these angles at its joints, others as in its posture. Raises InputError."""
        angles = self._angles(degrees)
        rings, n = self._rings()
        around = 2 * np.pi * np.arange(n) / n
        y = np.empty((len(rings), n, 3))
        bent = np.zeros(len(rings), dtype=bool)
        for name, bend in self.joints.items():
            at = np.abs(rings - bend.place) < self._reach(bend)
            bent |= at
            y[at] = self._bent(name, rings[at], around, angles)
        centre, ahead = self._line(rings[~bent], angles)
        out = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        r = self.radius(rings[~bent])[:, None]
        y[~bent, :, 0] = r * np.sin(around)
        y[~bent, :, 1:] = centre[:, None] + (r * np.cos(around))[..., None] * out[:, None]
        ends = np.zeros((2, 3))
        ends[:, 1:] = self._line(np.array([-float(self.radius(0.0)), self.length]), angles)[0]
        return np.concatenate([y.reshape(-1, 3), ends]) @ self._frame() + np.array(self.origin, dtype=float)

    def joint(self, name: str, **degrees: float) -> Joint:
        """A joint in a pose."""
        self._check(name)
        bend, frame = self.joints.get(name, Bend(0.0)), self._frame()
        point = np.append(0.0, self._line(np.array([bend.place]), self._angles(degrees))[0][0])
        centre, axis = point @ frame + np.array(self.origin, dtype=float), bend.sign * frame[0]
        return Joint((*map(float, centre),), (*map(float, axis),))  # type: ignore[arg-type]

    def rates(self, name: str, **degrees: float) -> Array:
        """How far the corners of the skin go with the angle of a joint, in a pose: (n, 3), m/rad."""
        self._check(name)
        at, most = degrees.get(name, dict(self.posture).get(name, 0.0)), self.joints.get(name, Bend(0.0, 360.0)).most
        low, high = max(at - STEP, -most), min(at + STEP, most)
        ends = [self.pose(**{**degrees, name: angle}) for angle in (low, high)]
        return np.asarray((ends[1] - ends[0]) / np.radians(high - low))

    def motion(self, times: Sequence[float] | Array, **degrees: Sequence[float] | Array) -> Deforming:
        """A body that goes through these angles at these times (s), without a jump of its speed, see `Deforming`.

        Raises InputError for an angle that cannot be, or not one for each time.
        """
        return motion(self.name, self.pose, self.faces, times, degrees)

    def _check(self, name: str) -> None:
        if name != self.root and name not in self.joints:
            raise InputError(f"The {self.name} has no joint {name!r}; it has {', '.join([self.root, *self.joints])}.")

    def _angles(self, degrees: Mapping[str, float]) -> dict[str, float]:
        """Of all joints, rad, with their signs."""
        for name, value in degrees.items():
            self._check(name)
            most = 360.0 if name == self.root else self.joints[name].most
            if not abs(value) <= most:
                raise InputError(f"The {self.name} cannot bend by {value!r} degrees at its {name}; at most {most:g}.")
        told = {self.root: 0.0} | dict.fromkeys(self.joints, 0.0) | dict(self.posture) | dict(degrees)
        return {name: self.joints.get(name, Bend(0.0)).sign * np.radians(value) for name, value in told.items()}

    def _frame(self) -> Array:
        """Rows: the axes, what is across, and along."""
        z = np.array(self.along, dtype=float) / np.linalg.norm(self.along)
        x = np.array(self.axis, dtype=float) - np.dot(self.axis, z) * z
        x /= np.linalg.norm(x)
        return np.array([x, np.cross(z, x), z])

    def _line(self, s: Array, angles: Mapping[str, float]) -> tuple[Array, Array]:
        """Points on the bones and their directions, each (n, 2): across and along the straight limb."""
        at, turn = np.zeros(2), angles[self.root]
        ahead = _direction(turn)
        points, ways = at + s[:, None] * ahead, np.tile(ahead, (len(s), 1))
        before = 0.0
        for name, bend in self.joints.items():
            place = bend.place
            at = at + (place - before) * ahead
            turn, before = turn + angles[name], place
            ahead = _direction(turn)
            beyond = s > place
            points[beyond], ways[beyond] = at + (s[beyond, None] - place) * ahead, ahead
        return points, ways

    def _bent(self, name: str, s: Array, around: Array, angles: Mapping[str, float]) -> Array:
        """Corners of the rings around a joint, (rings, corners, 3): the axis, across, along."""
        place, angle = self.joints[name].place, angles[name]
        reach = self._reach(self.joints[name])
        joint, start = (x[0] for x in self._line(np.array([place]), angles))
        end = _direction(np.arctan2(-start[0], start[1]) + angle)
        centre, ahead = self._line(s, angles)
        across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        width = 0.0
        if abs(angle) > 1e-6:
            width = FILLET * float(self.radius(place)) * np.sin(abs(angle) / 2)
            inwards = (end - start) / np.linalg.norm(end - start)
            out = centre - (joint + reach / np.sin(abs(angle) / 2) * inwards)
            out /= np.linalg.norm(out, axis=1, keepdims=True)
            across = np.sign(np.sum(out * across, axis=1, keepdims=True)) * out
        rays = np.empty((len(s), len(around), 3))
        rays[..., 0] = np.sin(around)
        rays[..., 1:] = np.cos(around)[:, None] * across[:, None]
        origin = np.pad(centre, ((0, 0), (1, 0)))[:, None]
        bones = [(-start, lambda a: self.radius(place - a)), (end, lambda a: self.radius(place + a))]

        def depth(t: Array) -> Array:
            """Above the skin it is positive."""
            x = origin + t[..., None] * rays - np.append(0.0, joint)
            found = []
            for ahead, radius in bones:
                a = x[..., 1:] @ ahead
                off = np.sqrt(np.maximum(np.sum(x**2, axis=-1) - np.maximum(a, 0.0) ** 2, 0.0))
                found.append(off - radius(np.minimum(np.maximum(a, 0.0), reach)))
            share = np.maximum(width - np.abs(found[0] - found[1]), 0.0)
            return np.minimum(*found) - (width / 6 * (share / width) ** 3 if width else 0.0)

        thick = float(self.radius(np.linspace(place - reach, place + reach, 50)).max())
        steps = np.linspace(0.0, 3 * thick, 61)
        outside = np.stack([depth(np.full(rays.shape[:2], t)) > 0.0 for t in steps])
        first = np.argmax(outside, axis=0)
        low, high = steps[first - 1], steps[first]
        for _ in range(45):
            middle = (low + high) / 2
            above = depth(middle) > 0.0
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return np.asarray(origin + high[..., None] * rays)


def _direction(angle: float) -> Array:
    return np.array([-np.sin(angle), np.cos(angle)])


def motion(
    name: str,
    pose: Callable[..., Array],
    faces: np.ndarray,
    times: Sequence[float] | Array,
    degrees: Mapping[str, Sequence[float] | Array],
) -> Deforming:
    """A body that goes through these angles at these times, see `Limb.motion`."""
    t = np.array(times, dtype=float)
    told = {joint: np.array(values, dtype=float) for joint, values in degrees.items()}
    if any(values.shape != t.shape for values in told.values()) or not told or t.ndim != 1 or len(t) < 2:
        raise InputError(f"The motion of the {name} needs two times at least, and an angle for each of them.")
    values = np.stack([*told.values()], axis=1)
    if not (np.diff(t) > 0.0).all() or not np.isfinite(values).all():
        raise InputError(f"The motion of the {name} needs times that increase, and angles that are finite.")
    slopes = PchipInterpolator(t, values)(t, 1)  # it overshoots no angle
    slopes[[0, -1]] = 0.0
    most = 2 * np.abs(np.diff(values, axis=0)).max(axis=1)
    parts = [np.linspace(a, b, max(int(np.ceil(way / TURN)), 1), endpoint=False)
             for a, b, way in zip(t[:-1], t[1:], most, strict=True)]  # fmt: skip
    moments = np.concatenate([*parts, t[-1:]])
    angles = CubicHermiteSpline(t, values, slopes)(moments)
    frames = np.array([pose(**dict(zip(told, at.tolist(), strict=True))) for at in angles])
    return Deforming(frames, faces, moments, name=name)
