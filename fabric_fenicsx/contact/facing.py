"""Contact of triangles with triangles: of a sheet with a body or with itself, by the IPC Toolkit (Li et al. 2020).

Its barrier b(d) is zero from the `reach` on and infinite at distance zero, d being the distance less the offset: see
`gaps`, of the squares of distances.
Corners of either side press on triangles of the other, those of a sheet with the part B/(A + B) of their area, those of
a body with A/(A + B), A and B being the mean areas of corners of sheet and body: together with all of it. So the
pressure at half the reach is the stiffness, whatever the cells of both. What is near to several triangles counts once,
by taking out their common edges and corners (the toolkit's "improved max approximator").

Pairs of edges hold what has no corner near: where sharp edges and folds cross. They count for less, since there are
many where flat sheets lie on each other, and not at all where an edge of a body has one plane on both sides.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse

from ..laws import Array
from . import kernels
from .triangles import areas_of_corners

EDGES = 0.2
"""Stiffness of pairs of edges, as a part of that of corners and triangles."""
USES, OFTEN, LEAST = (6, 16), 64, 0.05
"""How often, about, pairs that are near are gone through before they are looked for again, since that takes the longer
the wider around they have been looked for; how often at most; and the least way to look around, of the reach."""
PLANE = 1e-6
"""Triangles are of one plane up to this difference of the cosine of their angle from one."""


def _mean(areas: Array) -> float:
    """Mean area, by area: what is large counts, of a mesh with large and small triangles."""
    return float(np.sum(areas**2) / np.sum(areas))


class Facing:
    """What faces each other: a sheet and a body of triangles, or a sheet and itself.

    Public: `which`, numbers of its corners (n,) among all, those of the sheet first; `x`, their present places (n, 3);
    `mesh` of the toolkit, `edges` and `faces`; `sets`, its present pairs, of corners and triangles and of edges, and
    `barriers`, the potential of each.

    Args:
        kit: the toolkit.
        rest, faces: of the sheet; body: its places at rest and its triangles, or None.
        first, total: number of its first corner, and of all corners.
        offset, reach: in m; stiffness: in Pa. See above.
    """

    def __init__(
        self, kit: Any, rest: Array, faces: np.ndarray, body: tuple[Array, np.ndarray] | None, first: int,
        total: int, offset: float, reach: float, stiffness: float,
    ) -> None:  # fmt: skip
        self._kit, self.count, self._total, self.offset, self.reach = kit, len(rest), total, offset, reach
        own, self.itself = areas_of_corners(rest, faces), body is None
        self.which, places, triangles = np.arange(len(rest)), rest, faces
        a = b = _mean(own)
        if body is not None:
            self.which = np.concatenate([self.which, first + np.arange(len(body[0]))])
            b = _mean(areas_of_corners(*body))
            triangles = np.concatenate([faces, body[1] + len(rest)])
            # the toolkit weighs by areas at rest
            places = np.concatenate([np.sqrt(b / (a + b)) * rest, np.sqrt(a / (a + b)) * body[0]])
        self.faces = np.asfortranarray(triangles.astype(np.int32))
        self.edges = kit.edges(self.faces)
        self.mesh = kit.CollisionMesh(np.asfortranarray(places), self.edges, self.faces)
        if body is not None:
            part = (np.arange(len(self.which)) >= self.count).astype(np.int32)
            self.mesh.can_collide = kit.make_vertex_patches_filter(part)
        self._sides = self._beside(self.mesh.faces_to_edges)
        # it takes a quarter of an area, and has a pressure of its own at half the reach
        barrier, half = kit.ClampedLogSqBarrier(), (offset + reach / 2) ** 2
        own_one = kit.BarrierPotential(barrier, reach, 1.0, True).force_magnitude(half, offset)
        each = stiffness * (2.0 if body is None else 4.0) / own_one
        self.barriers = [kit.BarrierPotential(barrier, reach, part * each, True) for part in (1.0, EDGES)]
        self._broad, self._narrow = kit.LBVH(), kit.AdditiveCCD()
        self.x, self.sets = np.full((len(self.which), 3), np.nan), self._empty()
        self._gaps: dict[int, float] = {}
        self._size, self._allowed, self._used = float(np.sqrt(own.mean())), np.inf, 0
        """How far a corner may go before pairs that are near are looked for again, m; how often they have been used."""
        self._near, self._about = kit.Candidates(), self.x
        self._parts = self._split(self._near, self.x)
        self._free = np.zeros(len(self.which))
        """How far each corner may go from there while nothing touches it, m, if all others go as far as they may."""

    def _beside(self, of_faces: np.ndarray) -> np.ndarray:
        """The two triangles beside each edge of the body, (edges, 2), -1 for others or where there is none."""
        sides = np.full((len(self.edges), 2), -1)
        body = np.flatnonzero((self.faces >= self.count).all(axis=1))
        each, of = np.asarray(of_faces)[body].ravel(), np.repeat(body, 3)
        order = np.argsort(each, kind="stable")
        found, first, counts = np.unique(each[order], return_index=True, return_counts=True)
        two = counts == 2
        sides[found[two]] = np.stack([of[order][first[two]], of[order][first[two] + 1]], axis=1)
        return sides

    def _empty(self) -> list[Any]:
        sets = [self._kit.NormalCollisions() for _ in self.barriers]
        for found in sets:
            found.use_area_weighting = True
        return sets

    def _build(self, sets: list[Any], parts: list[tuple[Any, Any]], x: Array) -> list[Any]:
        for found, (near, kind) in zip(sets, parts, strict=True):
            found.collision_set_type = kind
            found.build(near, self.mesh, x, self.reach, self.offset)
        return sets

    def at(self, x: Array) -> list[Any]:
        """The sets of all corners in these places (all, 3)."""
        x, parts = np.asfortranarray(x[self.which]), self._parts
        if not self._far(x).max() < self._allowed:
            near = self._kit.Candidates()
            near.build(self.mesh, x, (self.reach + self.offset) / 2, self._broad)
            parts = self._split(near, x)
        return self._build(self._empty(), parts, x)

    def place(self, x: Array) -> None:
        """Take all places x (all, 3) for the present ones."""
        self.x = np.asfortranarray(x[self.which])
        self._gaps.clear()
        # a broad phase costs as much as all the rest: its pairs are of a wider reach, good until a corner has left it
        far = self._far(self.x)
        if not far.max() < self._allowed or (self._used > OFTEN and self._allowed > LEAST * self.reach):
            self._look_around()
            far = np.zeros(len(self.which))
        if (far < self._free).all():
            self._clear()
        else:
            self._used += 1
            self._build(self.sets, self._parts, self.x)
            if self._gap(1) <= 0.0:
                self.sets[1].ee_collisions = self._off_line(self.sets[1].ee_collisions, self.x)
                self._gaps.clear()

    def _clear(self) -> None:
        self._gaps.clear()
        for found in self.sets:
            found.clear()

    def leave(self) -> None:
        """It has no place, and nothing touches."""
        self._clear()
        self.x = np.full(self.x.shape, np.nan)

    @property
    def touches(self) -> bool:
        """Whether anything is within reach."""
        return any(len(found) for found in self.sets)

    def _look_around(self) -> None:
        """Find the pairs that are near: further around where nothing touches, since large cells have few."""
        self._about, touch = self.x, self.reach + self.offset
        widest = max(2 * self.reach, (0.1 if self.touches else 0.25) * self._size)
        part = 2.0 if self._used < USES[0] else 0.5 if self._used > USES[1] else 1.0
        self._allowed, self._used = min(max(part * self._allowed, LEAST * self.reach), widest), 0
        around = self._allowed + touch / 2
        near = self._near
        near.build(self.mesh, self.x, around, self._broad)
        # pairs that have not been found are twice as far apart as was looked around each
        apart = np.ravel(near.compute_per_vertex_safe_distances(self.mesh, self.x, 2 * around, 0.0))
        self._free = (apart - touch) / 2
        lone = apart >= 2 * around
        if lone.all():
            near.clear()
        elif lone.mean() > 0.5:  # boxes around neighbours overlap: drop pairs with a corner far from all else
            edges, faces = lone[self.edges].any(axis=1), lone[self.faces].any(axis=1)
            near.ee_candidates = [p for p in near.ee_candidates if not (edges[p.edge0_id] or edges[p.edge1_id])]
            near.fv_candidates = [p for p in near.fv_candidates if not (faces[p.face_id] or lone[p.vertex_id])]
        self._parts = self._split(near, self.x)

    def _split(self, near: Any, x: Array) -> list[tuple[Any, Any]]:
        """Pairs of corners and triangles, and of edges that count, each with how they are summed up."""
        corners, edges, kinds = self._kit.Candidates(), self._kit.Candidates(), self._kit.NormalCollisions
        corners.fv_candidates, edges.ee_candidates = near.fv_candidates, near.ee_candidates
        a, b, c = x[self.faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
        first, second = self._sides.T
        flat = (first >= 0) & (np.einsum("ij,ij->i", normals[first], normals[second]) > 1.0 - PLANE)
        if not flat.any():
            return [(corners, kinds.IMPROVED_MAX_APPROX), (edges, kinds.IMPROVED_MAX_APPROX)]
        edges.ee_candidates = [p for p in edges.ee_candidates if not (flat[p.edge0_id] or flat[p.edge1_id])]
        # what is counted twice can be taken out of all edges of a corner only
        return [(corners, kinds.IMPROVED_MAX_APPROX), (edges, kinds.IPC)]

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

    def _present(self) -> Iterator[tuple[Any, Any]]:
        return ((found, law) for found, law in zip(self.sets, self.barriers, strict=True) if len(found))

    def energy(self) -> float:
        """J."""
        return float(sum(law(found, self.mesh, self.x) for found, law in self._present()))

    def add_gradient(self, total: Array) -> None:
        """Add the derivative of the energy by all places (all, 3), N."""
        for found, law in self._present():
            total[self.which] += law.gradient(found, self.mesh, self.x).reshape(-1, 3)

    def hessians(self) -> list[Any]:
        """Second derivatives by all places, sparse matrices, N/m, to be summed up."""
        return [self.of_all(law.hessian(found, self.mesh, self.x)) for found, law in self._present()]

    def of_all(self, matrix: Any) -> scipy.sparse.csc_array:
        """A matrix by the own places as one by all places."""
        own = scipy.sparse.csc_array(matrix)
        if own.shape[0] == 3 * self._total:
            return own
        n, more = 3 * self.count, 3 * int(self.which[-1] + 1 - len(self.which))
        indices, size = np.where(own.indices >= n, own.indices + more, own.indices), 3 * self._total
        starts = np.concatenate([own.indptr[:n], np.full(more, own.indptr[n]), own.indptr[n:]])
        starts = np.append(starts, np.full(size + 1 - len(starts), own.nnz))
        return scipy.sparse.csc_array((own.data, indices, starts), shape=(size, size))

    def apart(self) -> float:
        """Least distance less the offset of all pairs, m; infinite where there are none."""
        return min(self._gap(0), self._gap(1))

    def _gap(self, k: int) -> float:
        """Of one of the sets; to find it takes as long as a gradient."""
        if k not in self._gaps:
            found = self.sets[k]
            least = found.compute_minimum_distance(self.mesh, self.x) if len(found) else np.inf
            self._gaps[k] = float(np.sqrt(least)) - self.offset
        return self._gaps[k]

    def pushes(self) -> Iterator[tuple[np.ndarray, Array, float]]:
        """Of each pair: numbers of its corners (k,) among all, the derivative of its energy by them (k, 3), N.

        And 1, or -1 for one that is taken out, being counted twice.
        """
        for found, law in self._present():
            for k in range(len(found)):
                pair = found[k]
                own = np.array(pair.vertex_ids(self.edges, self.faces)[: pair.num_vertices()])
                push = law.gradient(pair, pair.dof(self.x, self.edges, self.faces))
                yield self.which[own], push.reshape(-1, 3), float(np.sign(pair.weight))

    def _far(self, x: Array) -> Array:
        """How far each corner is from where pairs were looked for (n,), m; what all go together does not count."""
        return np.asarray(kernels.apart(x, self._about))

    def _cannot_meet(self, moved: Array) -> bool:
        """Whether nothing that is near can meet on a way of all corners as short as this."""
        gap, far = min(self.reach, self.apart()), kernels.apart(moved, np.zeros_like(moved))
        # two corners of the sheet may close in on each other, those of a body do not
        most = far[: self.count].max(), far[self.count :].max(initial=0.0)
        return bool(most[0] + (max(most) if self.itself else most[1]) < 0.9 * gap)

    def crossed(self) -> bool:
        """Whether any triangles cross in the present places."""
        return bool(self._kit.has_intersections(self.mesh, self.x, self._kit.LBVH()))

    def free_part(self, x0: Array, x1: Array) -> float:
        """See `Collisions.free_part`: by continuous detection, additive since the other one may take minutes."""
        x0, x1 = np.asfortranarray(x0[self.which]), np.asfortranarray(x1[self.which])
        here, moved = np.array_equal(x0, self.x), x1 - x0
        if here and self._cannot_meet(moved):
            return 1.0
        before, after = self._far(x0), self._far(x1)
        if here and after.max() >= self._allowed and before.max() > 0.25 * self._allowed:
            self._look_around()
            before, after = self._far(x0), self._far(x1)
        far = np.maximum(before, after)
        if (far < self._free).all():
            return 1.0
        if far.max() < self._allowed:
            swept = self._near
        else:
            self._used = 0  # short ways are looked for anew all the time
            swept = self._kit.Candidates()
            swept.build(self.mesh, x0, x1, self.offset / 2, self._broad)
        if not len(swept):
            return 1.0
        free = swept.compute_collision_free_stepsize(self.mesh, x0, x1, self.offset, self._narrow)
        if free == 0.0:
            seen = self._kit.Candidates()
            seen.fv_candidates, seen.ee_candidates = swept.fv_candidates, self._off_line(swept.ee_candidates, x0)
            free = seen.compute_collision_free_stepsize(self.mesh, x0, x1, self.offset, self._narrow)
        return float(free)
