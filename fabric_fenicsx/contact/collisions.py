"""What is near to what: pairs of corners, edges and triangles, by the IPC Toolkit (Li et al. 2020, `ipctk`).

Its barrier b(d) is zero from the `reach` on and infinite at distance zero, d being the distance less the offset. With
area weights, and its stiffness k as a pressure (Pa), sheets at half the reach press with about k to 6 k, by meshes.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..laws import Array
from .bodies import Body, Plane
from .planes import Planes

MISSING = "Contact needs the IPC Toolkit: pip install 'fabric_fenicsx[contact]', or pip install ipctk==1.6.0."


def toolkit() -> Any:
    """The module `ipctk`, which is loaded here and nowhere else, so that a scene without contact needs none."""
    try:
        import ipctk
    except ImportError as error:
        raise InputError(MISSING) from error
    # what a rank does alone has one thread, as all else
    ipctk.set_num_threads(1)
    return ipctk


class Collisions:
    """All corners of a sheet and of bodies, in one array of places: those of the sheet, then those of the bodies.

    Public: `count` of the sheet's corners; `x`, the present places (n, 3), and `shifts` of the `planes` (m, 3);
    `set` and `barrier`, the toolkit's present pairs and potential; `mesh` and `kit`, the toolkit's surface and itself.

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
        self.kit = kit = toolkit()
        self.count, self.offset, self.reach, self.stiffness = len(rest), offset, reach, stiffness
        areas = _areas(rest, faces)
        flat = [body for body in bodies if isinstance(body, Plane)]
        self.planes, self.shifts = Planes(flat, areas, offset, reach, stiffness), np.zeros((len(flat), 3))
        places, triangles, starts = [rest], [faces], [len(rest)]
        for body in bodies:
            if not isinstance(body, Plane):
                # the toolkit weighs pairs by areas at rest, also by those of bodies, which are none of a pressure on
                # the sheet: a body's are at most as large as the sheet's
                shrunk = min(1.0, np.sqrt(areas.mean() / _areas(body.rest, body.faces).mean()))
                places.append(shrunk * body.rest)
                triangles.append(body.faces + starts[-1])
                starts.append(starts[-1] + len(body.rest))
        self.starts = starts
        every = np.asfortranarray(np.concatenate(triangles).astype(np.int32))
        self.edges, self.faces = kit.edges(every), every
        self.mesh = kit.CollisionMesh(np.asfortranarray(np.concatenate(places)), self.edges, every)
        if itself:
            self.mesh.can_collide = kit.make_static_obstacle_filter(self.count)
        else:
            part = (np.arange(starts[-1]) >= self.count).astype(np.int32)
            self.mesh.can_collide = kit.make_vertex_patches_filter(part)
        self.barrier = kit.BarrierPotential(kit.ClampedLogBarrier(), reach, stiffness, True)
        self._broad, self._narrow = kit.LBVH(), kit.AdditiveCCD()
        self.set = self._empty()
        self._allowed = 2 * reach
        """How far a corner may go before pairs that are near are looked for again, m."""
        self.x = np.full((starts[-1], 3), np.nan)
        self._near, self._about = kit.Candidates(), np.full((starts[-1], 3), np.inf)
        self._gradient: Array | None = None

    def _empty(self) -> Any:
        found = self.kit.NormalCollisions()
        found.collision_set_type = self.kit.NormalCollisions.IPC
        found.use_area_weighting = True
        return found

    def at(self, x: Array) -> Any:
        """The pairs of corners in these places (n, 3), in Fortran's order."""
        found, near = self._empty(), self._near
        if not np.linalg.norm(x - self._about, axis=1).max() < self._allowed:
            near = self.kit.Candidates()
            near.build(self.mesh, x, (self.reach + self.offset) / 2, self._broad)
        found.build(near, self.mesh, x, self.reach, self.offset)
        return found

    def place(self, x: Array, shifts: Array) -> bool:
        """Put all corners and planes in their places; False where they are not finite, and nothing then touches."""
        if np.array_equal(x, self.x) and np.array_equal(shifts, self.shifts):
            return True
        self._gradient = None
        if not (np.isfinite(x).all() and np.isfinite(shifts).all()):
            self.set.clear()
            self.x = np.full(x.shape, np.nan)
            return False
        self.x, self.shifts = np.asfortranarray(x), shifts.copy()
        # a broad phase costs as much as all the rest: its pairs are of a wider reach, good until a corner has left it
        if not np.linalg.norm(x - self._about, axis=1).max() < self._allowed:
            self._about = self.x
            self._near.build(self.mesh, self.x, self._allowed + (self.reach + self.offset) / 2, self._broad)
        self.set.build(self._near, self.mesh, self.x, self.reach, self.offset)
        return True

    @property
    def nodes(self) -> Array:
        """The sheet's part of `x`."""
        return self.x[: self.count]

    def energy(self) -> float:
        """Of the barrier, J."""
        pairs = float(self.barrier(self.set, self.mesh, self.x)) if len(self.set) else 0.0
        return pairs + (self.planes.energy(self.nodes, self.shifts) if len(self.shifts) else 0.0)

    def gradient(self) -> Array:
        """Its derivative by all places (n, 3), N."""
        if self._gradient is None:
            self._gradient = np.zeros(self.x.shape)
            if len(self.set):
                self._gradient = self.barrier.gradient(self.set, self.mesh, self.x).reshape(-1, 3)
            for k, shift in enumerate(self.shifts):
                self._gradient[: self.count] += self.planes.forces(k, self.nodes, shift)
        return self._gradient

    def hessians(self) -> list[Any]:
        """Its second derivative, sparse matrices (3 n, 3 n) of SciPy, N/m, to be summed up."""
        found = []
        if len(self.set):
            found.append(self.barrier.hessian(self.set, self.mesh, self.x))
        if len(self.shifts):
            found.append(self.planes.matrix(self.nodes, self.shifts, self.x.size))
        return found

    def least_gap(self) -> float:
        """Least distance less the offset, m; infinite where nothing is within reach."""
        gap = min(float(self.planes.gaps(self.nodes, self.shifts).min(initial=np.inf)), self._apart())
        return gap if gap < self.reach else np.inf

    def _apart(self) -> float:
        """Least distance less the offset of all pairs, m; infinite where there are none."""
        if not len(self.set):
            return np.inf
        return float(np.sqrt(self.set.compute_minimum_distance(self.mesh, self.x))) - self.offset

    def pairs(self) -> Iterator[tuple[Any, np.ndarray]]:
        """What is within reach: each pair, and the numbers of its corners."""
        for k in range(len(self.set)):
            pair = self.set[k]
            yield pair, np.array(pair.vertex_ids(self.edges, self.faces)[: pair.num_vertices()])

    def _cannot_meet(self, moved: Array) -> bool:
        """Whether nothing that is near can meet on a way of all corners as short as this."""
        gap = min(self.reach, self._apart())
        squares = np.einsum("ij,ij->i", moved, moved)
        # two corners of the sheet may close in on each other, those of bodies do not
        most = np.sqrt(squares[: self.count].max()), np.sqrt(squares[self.count :].max(initial=0.0))
        return bool(most[0] + max(most) < 0.9 * gap)

    def crossed(self) -> bool:
        """Whether any triangles cross in the present places, or nodes are behind a plane."""
        gaps = self.planes.gaps(self.nodes, self.shifts) + self.offset
        return bool((gaps < 0.0).any() or self.kit.has_intersections(self.mesh, self.x, self.kit.LBVH()))

    def free_part(self, x0: Array, x1: Array, way: Array) -> float:
        """The part of the straight way of all corners from x0 to x1, and of the planes along `way`, up to 1.

        At its end all distances are still above the offset, if they are at its start: by continuous detection, additive
        since the toolkit's other one may take minutes.
        """
        part = self.planes.free_part(x0[: self.count], x1[: self.count], self.shifts, way)
        x0, x1 = np.asfortranarray(x0), np.asfortranarray(x0 + part * (x1 - x0))
        moved = x1 - x0
        if np.array_equal(x0, self.x) and self._cannot_meet(moved):
            return part
        if max(np.linalg.norm(x - self._about, axis=1).max() for x in (x0, x1)) < self._allowed:
            swept = self._near
        else:
            swept = self.kit.Candidates()
            swept.build(self.mesh, x0, x1, self.offset / 2, self._broad)
        if len(swept):
            part *= swept.compute_collision_free_stepsize(self.mesh, x0, x1, self.offset, self._narrow)
        return part


def _areas(x: Array, faces: np.ndarray) -> Array:
    """Area that belongs to each corner, m2."""
    a, b, c = x[faces[:, 0]], x[faces[:, 1]], x[faces[:, 2]]
    third = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6
    return np.bincount(faces.ravel(), np.repeat(third, 3), minlength=len(x))
