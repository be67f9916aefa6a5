"""What is near to what: pairs of corners, edges and triangles, by the IPC Toolkit (Li et al. 2020, `ipctk`).

Its barrier b(d) is zero from the `reach` on and infinite at distance zero, d being the distance less the offset. With
area weights, and its stiffness k as a pressure (Pa), a sheet at half the reach presses with 1.5 k on a body of much
larger cells, about 8 k on one of cells like its own, 16 k where these are a quarter: all crossings of edges count.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..laws import Array
from . import kernels
from .bodies import Body, Capsule, Plane, Sphere
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
PAIRS = 8.0
"""Stiffness of all pairs of a node, as a part of that of a plane at the least of their gaps."""


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
    `corners` of each; `gaps`, with those in closed form, the last `shaped` ones. Of the toolkit, `kit`, None where it
    has nothing to do: `set` and `barrier`, its present pairs and potential, `mesh`, its surface, and `surface`, the
    triangles of that (m, 3).

    Args:
        rest, faces: of the sheet.
        bodies: what it may touch.
        itself: whether the sheet may touch itself.
        offset, reach: in m; stiffness: in Pa. See above.
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
        self.set: Any = []
        self.x, self.surface = np.full((starts[-1], 3), np.nan), faces
        self._gradient: Array | None = None
        if kit is not None:
            self._tie(kit, rest, faces, solid, itself)

    def _tie(self, kit: Any, rest: Array, faces: np.ndarray, solid: Sequence[Body], itself: bool) -> None:
        """Make the toolkit's surface, of the sheet and bodies of triangles."""
        self._areas, places, triangles = areas_of_corners(rest, faces), [rest], [faces]
        for body, corners in zip(solid, self.corners, strict=False):
            # the toolkit weighs pairs by areas at rest, also by those of bodies, which are none of a pressure on the
            # sheet: a body's are at most as large as the sheet's
            shrunk = min(1.0, np.sqrt(self._areas.mean() / areas_of_corners(body.rest, body.faces).mean()))
            places.append(shrunk * body.rest)
            triangles.append(body.faces + corners.start)
        every = np.asfortranarray(np.concatenate(triangles).astype(np.int32))
        self.edges, self.faces, self.surface = kit.edges(every), every, every
        self.mesh = kit.CollisionMesh(np.asfortranarray(np.concatenate(places)), self.edges, every)
        if itself:
            self.mesh.can_collide = kit.make_static_obstacle_filter(self.count)
        else:
            part = (np.arange(self._solid) >= self.count).astype(np.int32)
            self.mesh.can_collide = kit.make_vertex_patches_filter(part)
        self.barrier = kit.BarrierPotential(kit.ClampedLogBarrier(), self.reach, self.stiffness, True)
        self._broad, self._narrow = kit.LBVH(), kit.AdditiveCCD()
        self.set = self._empty()
        self._size, self._allowed = float(np.sqrt(self._areas.mean())), 0.0
        """How far a corner may go before pairs that are near are looked for again, m."""
        self._near, self._about = kit.Candidates(), np.full((self._solid, 3), np.nan)
        self._free = np.zeros(self._solid)
        """How far each corner may go from there while nothing touches it, m, if all others go as far as they may."""

    def _empty(self) -> Any:
        found = self.kit.NormalCollisions()
        found.collision_set_type = self.kit.NormalCollisions.IPC
        found.use_area_weighting = True
        return found

    def at(self, x: Array) -> Any:
        """The pairs of corners in these places (n, 3)."""
        found, near, x = self._empty(), self._near, np.asfortranarray(x[: self._solid])
        if not self._far(x).max() < self._allowed:
            near = self.kit.Candidates()
            near.build(self.mesh, x, (self.reach + self.offset) / 2, self._broad)
        found.build(near, self.mesh, x, self.reach, self.offset)
        return found

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
            self.set.clear()
            self.gaps.near, self.x = [], np.full(x.shape, np.nan)
            return False
        self.x = np.asfortranarray(x)
        self.gaps.place(x)
        if self.kit is None:
            return True
        # a broad phase costs as much as all the rest: its pairs are of a wider reach, good until a corner has left it
        far = self._far(self.met)
        if not far.max() < self._allowed:
            self._look_around()
            far = np.zeros(self._solid)
        if (far < self._free).all():
            self.set.clear()
        else:
            self.set.build(self._near, self.mesh, self.met, self.reach, self.offset)
            if self._apart() <= 0.0:
                self.set.ee_collisions = self._off_line(self.set.ee_collisions, self.met)
        return True

    def _look_around(self) -> None:
        """Find the pairs that are near: further around where nothing touches, since large cells have few."""
        self._about, touch = self.met, self.reach + self.offset
        self._allowed = max(2 * self.reach, (0.1 if len(self.set) else 0.25) * self._size)
        around = self._allowed + touch / 2
        self._near.build(self.mesh, self.met, around, self._broad)
        # pairs that have not been found are twice as far apart as was looked around each
        apart = np.ravel(self._near.compute_per_vertex_safe_distances(self.mesh, self.met, 2 * around, 0.0))
        self._free = (apart - touch) / 2
        lone = apart >= 2 * around
        if lone.all():
            self._near.clear()
        elif lone.mean() > 0.5:  # boxes around neighbours overlap: drop pairs with a corner far from all else
            edges, faces = lone[self.edges].any(axis=1), lone[self.faces].any(axis=1)
            near = self._near
            near.ee_candidates = [p for p in near.ee_candidates if not (edges[p.edge0_id] or edges[p.edge1_id])]
            near.fv_candidates = [p for p in near.fv_candidates if not (faces[p.face_id] or lone[p.vertex_id])]

    def _off_line(self, pairs: list[Any], x: Array) -> list[Any]:
        """Pairs of edges without those on one line, one after the other.

        If they are off that line by some 1e-8 of their length, the toolkit takes one in a thousand for crossing.
        """
        if not pairs:
            return pairs
        a, b = x[self.edges[[(pair.edge0_id, pair.edge1_id) for pair in pairs]]].transpose(1, 2, 0, 3)
        along = a[1] - a[0]
        size = np.linalg.norm(along, axis=1)
        off = np.linalg.norm(np.cross(b - a[0], along), axis=2).max(axis=0) / size**2
        at = np.einsum("jki,ki->jk", b - a[0], along) / size**2
        apart = (at.min(axis=0) > 1.0) | (at.max(axis=0) < 0.0)
        return [pair for pair, out in zip(pairs, (off > 1e-6) | ~apart, strict=True) if out]

    @property
    def nodes(self) -> Array:
        """The sheet's part of `x`."""
        return self.x[: self.count]

    def energy(self) -> float:
        """Of the barrier, J."""
        return self.gaps.energy() + (float(self.barrier(self.set, self.mesh, self.met)) if len(self.set) else 0.0)

    def gradient(self) -> Array:
        """Its derivative by all places (n, 3), N."""
        if self._gradient is None:
            self._gradient = np.zeros(self.x.shape)
            if len(self.set):
                pushed = self.barrier.gradient(self.set, self.mesh, self.met)
                self._gradient[: self._solid] = pushed.reshape(-1, 3)
            self.gaps.add(self.gaps.forces(), self._gradient)
        return self._gradient

    def hessians(self) -> list[Any]:
        """Second derivative of what pairs store, sparse matrices of SciPy, N/m, to be summed up."""
        return [self.barrier.hessian(self.set, self.mesh, self.met)] if len(self.set) else []

    def least_gap(self) -> float:
        """Least distance less the offset, m; infinite where nothing is within reach."""
        gap = min(self.gaps.least(), self._apart())
        return gap if gap < self.reach else np.inf

    def _apart(self) -> float:
        """Least distance less the offset of all pairs, m; infinite where there are none."""
        if not len(self.set):
            return np.inf
        return float(np.sqrt(self.set.compute_minimum_distance(self.mesh, self.met))) - self.offset

    def fastest(self, masses: Array) -> float:
        """A bound of the largest stiffness over the masses (n,) of nodes, kg, 1/s2: as if all were the nearest."""
        fastest, gap = self.gaps.fastest(masses), max(self._apart(), 1e-12)
        if gap < self.reach:
            slope = PAIRS * -response(gap / self.reach)[2] * self.stiffness / self.reach
            fastest = max(fastest, float((slope * self._areas / masses).max()))
        return fastest

    def pairs(self) -> Iterator[tuple[Any, np.ndarray]]:
        """What is within reach: each pair, and the numbers of its corners."""
        for k in range(len(self.set)):
            pair = self.set[k]
            yield pair, np.array(pair.vertex_ids(self.edges, self.faces)[: pair.num_vertices()])

    def _far(self, x: Array) -> Array:
        """How far each corner is from where pairs were looked for (n,), m; what all go together does not count."""
        return np.asarray(kernels.apart(x, self._about))

    def _cannot_meet(self, moved: Array) -> bool:
        """Whether nothing that is near can meet on a way of all corners as short as this."""
        gap, far = min(self.reach, self._apart()), kernels.apart(moved, np.zeros_like(moved))
        # two corners of the sheet may close in on each other, those of bodies do not
        most = far[: self.count].max(), far[self.count :].max(initial=0.0)
        return bool(most[0] + max(most) < 0.9 * gap)

    def crossed(self) -> bool:
        """Whether any triangles cross in the present places, or points of the sheet are in a body."""
        if self.gaps.crossed():
            return True
        return self.kit is not None and bool(self.kit.has_intersections(self.mesh, self.met, self.kit.LBVH()))

    def free_part(self, x0: Array, x1: Array) -> float:
        """The part of the straight way of all corners from x0 to x1, up to 1.

        At its end all distances are still above the offset, if they are at its start: by continuous detection, additive
        since the toolkit's other one may take minutes.
        """
        here = np.array_equal(x0, self.x)
        part = self.gaps.free_part(x0, x1)
        if self.kit is None:
            return part
        x0, x1 = x0[: self._solid], x1[: self._solid]
        x0, x1 = np.asfortranarray(x0), np.asfortranarray(x0 + part * (x1 - x0))
        moved = x1 - x0
        if here and self._cannot_meet(moved):
            return part
        before, after = self._far(x0), self._far(x1)
        if here and after.max() >= self._allowed and before.max() > 0.25 * self._allowed:
            self._look_around()
            before, after = self._far(x0), self._far(x1)
        far = np.maximum(before, after)
        if (far < self._free).all():
            return part
        if far.max() < self._allowed:
            swept = self._near
        else:
            swept = self.kit.Candidates()
            swept.build(self.mesh, x0, x1, self.offset / 2, self._broad)
        if len(swept):
            free = swept.compute_collision_free_stepsize(self.mesh, x0, x1, self.offset, self._narrow)
            if free == 0.0:
                seen = self.kit.Candidates()
                seen.fv_candidates, seen.ee_candidates = swept.fv_candidates, self._off_line(swept.ee_candidates, x0)
                free = seen.compute_collision_free_stepsize(self.mesh, x0, x1, self.offset, self._narrow)
            part *= free
        return part
