"""What is near to what: a sheet, itself, bodies of triangles (`facing`) and bodies in closed form (`gaps`)."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..laws import Array
from .bodies import Body, Capsule, Plane, Sphere
from .facing import Facing
from .gaps import Gaps, response
from .points import parts
from .triangles import areas_of_corners, edges

MISSING = (
    "This contact needs the IPC Toolkit: pip install 'fabric_fenicsx[contact]', or pip install ipctk==1.6.0. Without "
    "it a sheet touches planes, boxes, cylinders, and spheres and capsules that are large against its cells; they have "
    "no mass, and it does not touch itself (itself=False)."
)
SMOOTH = Plane, Sphere, Capsule
"""Bodies in closed form, always; others have sharp edges, and are of triangles where the toolkit is there."""
PAIRS = 4.0
"""Stiffness of all pairs of a node, as a part of that of a plane at the least of their gaps: twice, as two sides give
way, what corners and edges have there."""


def toolkit() -> Any:
    """The module `ipctk`, or None; it is loaded here and nowhere else, so that a scene without contact needs none."""
    try:
        import ipctk
    except ImportError:
        return None
    # what a rank does alone has one thread, as all else
    ipctk.set_num_threads(1)
    return ipctk


class Collisions:
    """All corners of a sheet and of bodies, in one array of places: of the sheet, of bodies of triangles, of others.

    Public: `count` of the sheet's corners; `x`, the present places (n, 3); `bodies` in the order of their corners, and
    `corners` of each; `gaps`, with those in closed form, the last `shaped` ones; `facings`, with the others, for which
    `kit` is the toolkit, None where it has nothing to do, and `surface` the triangles of these and the sheet (m, 3).

    Args:
        rest, faces: of the sheet.
        bodies: what it may touch.
        itself: whether the sheet may touch itself.
        offset, reach: in m; stiffness: in Pa; see `facing`.
    """

    def __init__(
        self,
        rest: Array,
        faces: np.ndarray,
        bodies: Sequence[Body],
        itself: bool,
        offset: float,
        reach: float,
        stiffness: float,
    ) -> None:
        self.count, self.offset, self.reach, self.stiffness = len(rest), offset, reach, stiffness
        edge = float(edges(rest, faces).max())
        counts = [parts(body, edge, offset) for body in bodies]
        kit = toolkit() if itself or not all(isinstance(body, SMOOTH) for body in bodies) or not all(counts) else None
        if kit is None and (itself or not all(counts)):
            raise InputError(MISSING)
        # with the toolkit, sharp edges are exact
        exact = [n > 0 and (kit is None or isinstance(body, SMOOTH)) for body, n in zip(bodies, counts, strict=True)]
        solid = [body for body, closed in zip(bodies, exact, strict=True) if not closed]
        shaped = [body for body, closed in zip(bodies, exact, strict=True) if closed]
        self.bodies, starts = [*solid, *shaped], np.cumsum([len(rest), *(len(body.rest) for body in [*solid, *shaped])])
        self.corners = [slice(int(a), int(b)) for a, b in itertools.pairwise(starts)]
        self._solid = int(starts[len(solid)])
        chosen = [n for n, closed in zip(counts, exact, strict=True) if closed]
        self.gaps = Gaps(shaped, self.corners[len(solid) :], chosen, rest, faces, offset, reach, stiffness)
        self.shaped = len(shaped)
        self.kit: Any = kit
        self._areas, self.facings = areas_of_corners(rest, faces), []
        self.x, self.surface = np.full((starts[-1], 3), np.nan), faces
        self._gradient: Array | None = None
        if kit is not None:
            sides = [(body.rest, body.faces) for body in solid]
            self.surface = np.concatenate([faces, *(own + n for (_, own), n in zip(sides, starts, strict=False))])
            sizes = self._solid, offset, reach, stiffness
            every = zip([*sides, *([None] if itself else [])], starts, strict=False)
            self.facings = [Facing(kit, rest, faces, side, int(first), *sizes) for side, first in every]

    @property
    def met(self) -> Array:
        """The part of `x` that the toolkit sees."""
        return self.x[: self._solid]

    def place(self, x: Array) -> bool:
        """Put all corners in their places; False where they are not finite, and nothing then touches."""
        if np.array_equal(x, self.x):
            return True
        self._gradient = None
        if not np.isfinite(x).all():
            for facing in self.facings:
                facing.leave()
            self.gaps.near, self.x = [], np.full(x.shape, np.nan)
            return False
        self.x = np.asfortranarray(x)
        self.gaps.place(x)
        for facing in self.facings:
            facing.place(x)
        return True

    @property
    def nodes(self) -> Array:
        """The sheet's part of `x`."""
        return self.x[: self.count]

    def energy(self) -> float:
        """Of the barrier, J."""
        return self.gaps.energy() + sum(facing.energy() for facing in self.facings)

    def gradient(self) -> Array:
        """Its derivative by all places (n, 3), N."""
        if self._gradient is None:
            self._gradient = np.zeros(self.x.shape)
            for facing in self.facings:
                facing.add_gradient(self._gradient)
            self.gaps.add(self.gaps.forces(), self._gradient)
        return self._gradient

    def hessians(self) -> list[Any]:
        """Second derivative of what pairs store, sparse matrices of SciPy, N/m, to be summed up."""
        return [matrix for facing in self.facings for matrix in facing.hessians()]

    def least_gap(self) -> float:
        """Least distance less the offset, m; infinite where nothing is within reach."""
        gap = min(self.gaps.least(), self._apart())
        return gap if gap < self.reach else np.inf

    def _apart(self) -> float:
        """Least distance less the offset of all pairs, m; infinite where there are none."""
        return min((facing.apart() for facing in self.facings), default=np.inf)

    def fastest(self, masses: Array) -> float:
        """A bound of the largest stiffness over the masses (n,) of nodes, kg, 1/s2: as if all were the nearest."""
        fastest, gap = self.gaps.fastest(masses), max(self._apart(), 1e-12)
        if gap < self.reach:
            slope = PAIRS * -response(gap / self.reach)[2] * self.stiffness / self.reach
            fastest = max(fastest, float((slope * self._areas / masses).max()))
        return fastest

    def pushes(self) -> Iterator[tuple[np.ndarray, Array, float]]:
        """See `Facing.pushes`."""
        return itertools.chain.from_iterable(facing.pushes() for facing in self.facings)

    def crossed(self) -> bool:
        """Whether any triangles cross in the present places, or points of the sheet are in a body."""
        return self.gaps.crossed() or any(facing.crossed() for facing in self.facings)

    def free_part(self, x0: Array, x1: Array) -> float:
        """The part of the straight way of all corners from x0 to x1, up to 1.

        At its end all distances are still above the offset, if they are at its start.
        """
        part = self.gaps.free_part(x0, x1)
        for facing in self.facings:
            part *= facing.free_part(x0, x0 + part * (x1 - x0))
        return part
