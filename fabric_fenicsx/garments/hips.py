"""Hips from the waist to the knees, with two thighs that swing: one closed surface of triangles; m, angles in degrees.

It is the smooth union of a trunk with an elliptic section and two tapering thighs. Its triangles are made once, where
it stands; in a pose each corner goes with the parts that it is near to, and then onto the skin.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from ..contact.deforming import Deforming
from ..errors import InputError
from ..laws import Array
from . import implicit
from .limb import Joint, motion
from .limbs import sizes

type Vector = Sequence[float]
FILLET = 0.03
"""m; rounds where the parts meet."""
MOST = 30.0
"""Degrees by which a thigh swings, either way."""


@dataclass(frozen=True)
class Hips:
    """Hips that stand along z and look along -y; the thighs' joints are at z = 0, left is at x > 0.

    Args:
        waist, seat: half of width and depth of the trunk there, m; height: of the waist.
        thigh, knee: radii, m; length: of a thigh; apart: half of the distance of its joints.
        origin: middle between the joints.
        size: of triangles, m.
    """

    waist: tuple[float, float]
    seat: tuple[float, float]
    height: float
    thigh: float
    knee: float
    length: float
    apart: float
    origin: Vector = (0.0, 0.0, 0.0)
    size: float = 12e-3
    name: str = "hips"

    def __post_init__(self) -> None:
        own = (*self.waist, *self.seat, self.height, self.thigh, self.knee, self.length, self.apart, self.size)
        if not (np.isfinite(own).all() and min(own) > 0.0):
            raise InputError("The hips need lengths that are positive, in m.")

    @property
    def faces(self) -> np.ndarray:
        """Triangles (m, 3), outwards."""
        return self._made[1]

    def pose(self, *, left: float = 0.0, right: float = 0.0) -> Array:
        """Corners of the skin (n, 3) with the thighs swung forwards by these angles. Raises InputError."""
        turns = self._turns(left, right)
        rest, shares = self._made[0], self._shares
        joints = np.array([[self.apart, 0, 0], [-self.apart, 0, 0]])
        x = shares[:, :1] * rest
        for k, (turn, joint) in enumerate(zip(turns, joints, strict=True)):
            x = x + shares[:, k + 1 : k + 2] * (turn.apply(rest - joint) + joint)
        return self._onto(x, turns) + np.array(self.origin, dtype=float)

    def motion(self, times: Sequence[float] | Array, **degrees: Sequence[float] | Array) -> Deforming:
        """A body whose thighs, `left` and `right`, go through these angles, see `Limb.motion`."""
        for joint in degrees.keys() - {"left", "right"}:
            raise InputError(f"The hips have no joint {joint!r}; they have left and right.")
        return motion(self.name, self.pose, self.faces, times, degrees)

    def walk(
        self, strides: int = 2, stride: float = 1.1, *, flexion: float = 30.0, extension: float = 10.0
    ) -> Deforming:
        """A body that stands, walks so many strides on the spot (s each), and stands again.

        flexion, extension: of the hip, as of level walking at one's own pace (Perry and Burnfield 2010).
        """
        quarter = stride / 2
        swings = [flexion if k % 2 else -extension for k in range(2 * strides)]
        times = [quarter * k for k in range(2 * strides + 2)]
        return self.motion(times, left=[0.0, *swings, 0.0], right=[0.0, *(swings[1:] + swings[:1]), 0.0])

    def joint(self, name: Literal["left", "right"]) -> Joint:
        """Where a thigh swings; it goes forwards by the right-hand rule about the axis."""
        side = {"left": 1.0, "right": -1.0}[name] * self.apart
        x, y, z = (float(a) for a in np.array(self.origin, dtype=float) + [side, 0.0, 0.0])
        return Joint((x, y, z), (-1.0, 0.0, 0.0))

    # -- the skin ------------------------------------------------------------------------------------------------------

    def _turns(self, left: float, right: float) -> list[Rotation]:
        for name, angle in (("left", left), ("right", right)):
            if not abs(angle) <= MOST:
                raise InputError(f"The {name} thigh cannot swing by {angle!r} degrees; at most {MOST:g}.")
        return [Rotation.from_rotvec([-np.radians(angle), 0, 0]) for angle in (left, right)]

    def _parts(self, x: Array, turns: Sequence[Rotation]) -> list[Array]:
        """How far places are above the trunk and the two thighs, about, m."""
        low = 0.75 * self.seat[0], 0.75 * self.seat[1]
        found = [implicit.column(x, [-0.6 * self.thigh, 0.0, self.height], [low, self.seat, self.waist])]
        for turn, side in zip(turns, (self.apart, -self.apart), strict=True):
            ends = (0.0, 0.0, 0.0), (0.0, 0.0, -self.length)
            found.append(implicit.cone(turn.inv().apply(x - [side, 0, 0]), ends, (self.thigh, self.knee)))
        return found

    def _depth(self, x: Array, turns: Sequence[Rotation]) -> Array:
        """Above the skin it is positive, m."""
        return implicit.union(self._parts(x, turns), FILLET)

    def _onto(self, x: Array, turns: Sequence[Rotation]) -> Array:
        """The same corners, moved onto the skin along its gradient."""
        return implicit.onto(lambda x: self._depth(x, turns), x, self.size)

    @cached_property
    def _made(self) -> tuple[Array, np.ndarray]:
        """Corners and triangles where the hips stand, each about as large."""
        still, size = self._turns(0.0, 0.0), self.size
        wide = max(*self.seat, *self.waist, self.apart + self.thigh) + 2 * size
        low, high = -self.length - self.knee - 2 * size, self.height + max(self.waist) + 2 * size
        return implicit.surface(lambda x: self._depth(x, still), (-wide, -wide, low), (wide, wide, high), size)

    @cached_property
    def _shares(self) -> Array:
        """How much each corner goes with the trunk and the thighs, (n, 3)."""
        off = np.stack(self._parts(self._made[0], self._turns(0.0, 0.0)), axis=1)
        near = np.exp(-(off - off.min(axis=1, keepdims=True)) / FILLET)
        return np.asarray(near / near.sum(axis=1, keepdims=True))


def hips(of: Literal["man", "woman"] = "man", **options: object) -> Hips:
    """Of a median man or woman of ANSUR II, see `limbs`; options: of `Hips`.

    The thighs' joints are where four fifths of a thigh's radius end at the hips' breadth, at the trochanter's height.
    """
    size: Mapping[str, float] = sizes(of)
    thigh, knee = (size[f"{name}circumference"] / (2 * np.pi) for name in ("thigh", "lowerthigh"))
    told: dict[str, object] = {
        "waist": (size["waistbreadth"] / 2, size["waistdepth"] / 2),
        "seat": (size["hipbreadth"] / 2, size["buttockdepth"] / 2),
        "height": size["waistheightomphalion"] - size["trochanterionheight"],
        "thigh": thigh,
        "knee": knee,
        "length": size["trochanterionheight"] - size["lateralfemoralepicondyleheight"],
        "apart": size["hipbreadth"] / 2 - 0.8 * thigh,
    }
    return Hips(**(told | options))  # type: ignore[arg-type]
