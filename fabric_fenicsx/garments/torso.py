"""A torso from the hips to the neck, with upper arms held out: one closed surface of triangles; m, angles in degrees.

It is the smooth union of a trunk with elliptic sections, a neck, shoulders that slope, and two tapering arms that end
at the elbows. It stands along z and looks along -y; its hips are at z = 0, left is at x > 0.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..contact.bodies import Body
from ..errors import InputError
from ..laws import Array
from . import implicit

FILLET = 0.04
"""m; rounds where the parts meet."""


@dataclass(frozen=True)
class Torso:
    """Of a mannequin about as large as a man of 1.75 m, unless told.

    Args:
        seat, waist, chest: half of width and depth of the trunk there, m; heights: of waist, chest and the neck's root.
        neck: its radius; breadth: half of the distance of the shoulders' joints, which are at the height `level`.
        arm: radii at shoulder and elbow; length: of an upper arm; lowered: angle of the arms below the horizontal.
        size: of triangles.

    Raises InputError for lengths that are not positive.
    """

    seat: tuple[float, float] = (0.172, 0.12)
    waist: tuple[float, float] = (0.15, 0.11)
    chest: tuple[float, float] = (0.168, 0.125)
    heights: tuple[float, float, float] = (0.2, 0.38, 0.54)
    neck: float = 0.058
    breadth: float = 0.185
    level: float = 0.47
    arm: tuple[float, float] = (0.058, 0.046)
    length: float = 0.3
    lowered: float = 40.0
    size: float = 15e-3
    name: str = "torso"

    def __post_init__(self) -> None:
        own = (*self.seat, *self.waist, *self.chest, *self.heights, self.neck, self.breadth, *self.arm, self.length)
        if not (np.isfinite([*own, self.lowered]).all() and min(*own, self.level, self.size) > 0.0):
            raise InputError("The torso needs lengths that are positive, in m.")

    @property
    def along(self) -> Array:
        """Direction of the left arm, from the shoulder."""
        angle = np.radians(self.lowered)
        return np.array([np.cos(angle), 0.0, -np.sin(angle)])

    @property
    def joint(self) -> Array:
        """Place of the left shoulder's joint."""
        return np.array([self.breadth, 0.0, self.level])

    @property
    def elbow(self) -> Array:
        """Place of the left elbow."""
        return self.joint + self.length * self.along

    @property
    def places(self) -> Array:
        """Corners of the skin (n, 3)."""
        return self._made[0]

    @property
    def faces(self) -> np.ndarray:
        """Triangles (m, 3), outwards."""
        return self._made[1]

    @property
    def body(self) -> Body:
        """For contact."""
        return Body(self.places, self.faces, self.name)

    def depth(self, x: Array) -> Array:
        """How far places x (n, 3) are above the skin, about, m."""
        waist, chest, root = self.heights
        halves = [self.seat, self.waist, self.chest, (0.6 * self.chest[0], 0.55 * self.chest[1])]
        top = self.level + 0.3 * (root - self.level)
        parts = [implicit.column(x, [0.0, waist, chest, top], halves)]
        parts.append(implicit.cone(x, ((0, 0, self.level), (0, -0.01, root + 0.09)), (self.neck, self.neck)))
        for side in (1, -1):
            joint, elbow = (tuple(place * [side, 1, 1]) for place in (self.joint, self.elbow))
            parts.append(implicit.cone(x, ((0, 0, root - 0.05), joint), (0.05, self.arm[0])))
            parts.append(implicit.cone(x, (joint, elbow), self.arm))
        return implicit.union(parts, FILLET)

    @cached_property
    def _made(self) -> tuple[Array, np.ndarray]:
        out = self.breadth + self.length + self.arm[1] + 3 * self.size
        low, high = -self.seat[1] - 3 * self.size, self.heights[-1] + self.neck + 0.09 + 3 * self.size
        return implicit.surface(self.depth, (-out, -0.25, low), (out, 0.25, high), self.size)
