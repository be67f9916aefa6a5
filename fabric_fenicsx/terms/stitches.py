"""A seam that can open: two edges with nodes of their own, tied by a thread.

At each point of the seam the other edge is away by w from the first one, and the thread stores

    (a |w|^2 + (b - a) (w . t)^2) / 2     in J per metre of the first edge at rest,

with the stiffness a against opening, in the sheet or out of it, b against sliding, and t the unit tangent, the mean of
both edges. It does not change where the sheet turns as a whole. The directors of both sides are free of each other: the
seam folds without a moment.
"""

from math import inf

import numpy as np
from dolfinx import fem

from ..errors import InputError
from ..laws import Array, Stiffest
from ..shell.directors import ShellSpace
from ..surfaces import placing
from ..surfaces.meshing import Domain
from .supports import Space
from .term import Indices, Term


class Stitches(Term):
    """The thread between two edges, which it joins evenly, cell by cell, in the direction that is nearer at the start.

    Public: `opening` (cells, points, 3), w in m at the last evaluation, and `torn` (cells, points).

    Args:
        domain, space, q: of the sheet that has both edges: `sheet.domain`, `sheet.space`, `sheet.q`.
        one, other: names of the edges, each a path of as many cells.
        across: stiffness against opening, N/m2.
        along: against sliding along the seam, N/m2; by default the same.
        strength: force per length, N/m, beyond which the thread is torn at a point once the step is over.

    Raises InputError, on every rank.
    """

    symmetric = True

    def __init__(
        self,
        domain: Domain,
        space: Space,
        q: fem.Function,
        one: str,
        other: str,
        *,
        across: float,
        along: float | None = None,
        strength: float = inf,
    ) -> None:
        along = across if along is None else along
        for what, value in (("across", across), ("along", along), ("strength", strength)):
            if not value > 0.0 or (what != "strength" and value == inf):
                raise InputError(f"The thread between {one!r} and {other!r} has {what}={value!r}; make it positive.")
        self.q, self.name, self._comm = q, f"{one} {other}", domain.mesh.comm
        self._across, self._more, self._strength = across, along - across, strength
        first, second = _Edge(domain, space, one), _Edge(domain, space, other)
        if len(first.nodes) != len(second.nodes):
            raise InputError(f"The edge {one!r} has {len(first.nodes)} cells and {other!r} {len(second.nodes)}.")
        turned = second.turned()
        apart, apart_turned = (np.linalg.norm(first.start - edge.start, axis=-1).sum() for edge in (second, turned))
        second = turned if apart_turned < apart else second

        s, weight = np.polynomial.legendre.leggauss(first.nodes.shape[1])
        s, weight = (s + 1) / 2, weight / 2
        if first.nodes.shape[1] == 2:
            shape, slope = np.stack([1 - s, s], axis=1), np.tile([-1.0, 1.0], (2, 1))
        else:
            shape = np.stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)], axis=1)
            slope = np.stack([4 * s - 3, 4 * s - 1, 4 - 8 * s], axis=1)
        self._by_node = np.hstack([-shape, shape]), np.hstack([slope, slope]) / 2
        self._weight = weight * np.linalg.norm(np.einsum("gn,eni->egi", slope, first.rest), axis=-1)

        self._start = np.concatenate([first.start, second.start], axis=1)
        dofs = np.concatenate([first.dofs, second.dofs], axis=1)
        index_map, bs = q.function_space.dofmap.index_map, q.function_space.dofmap.index_map_bs
        begin, end = (bs * number for number in index_map.local_range)
        self._own, flat = (dofs >= begin) & (dofs < end), dofs.reshape(len(dofs), -1)
        self._local = dofs[self._own] - begin
        self._rows = np.repeat(self._own.reshape(flat.shape), flat.shape[1], axis=1).ravel()
        size = flat.shape[1]
        self._pattern = np.repeat(flat, size, axis=1).ravel()[self._rows], np.tile(flat, size).ravel()[self._rows]
        # a node that several cells have is told by its owner, to each of them
        self.torn = np.zeros(self._weight.shape, dtype=bool)
        self._kept = [(cells, at, np.zeros((len(cells), len(s)))) for cells, at in first.places]
        self._lost = self._watched = 0.0
        self.evaluate()

    def evaluate(self, tangent: bool = True, stiffest: Stiffest = False) -> bool:
        """See `Term.evaluate`."""
        moved = np.zeros(self._start.shape)
        moved[self._own] = self.q.x.array[self._local]
        x = self._start + self._comm.allreduce(moved)
        self.opening = w = np.einsum("gn,eni->egi", self._by_node[0], x)
        t = np.einsum("gn,eni->egi", self._by_node[1], x)
        R, p, b = np.sum(t * t, axis=-1)[..., None], np.sum(w * t, axis=-1)[..., None], self._more
        line = self._across * w + b * p * t / R
        self._stored = self._weight * np.sum(w * line, axis=-1) / 2
        self._tearing = (np.linalg.norm(line, axis=-1) > self._strength) & ~self.torn
        part = self._weight * ~self.torn
        by_t = b * (p * w / R - p**2 * t / R**2)
        self._force = sum(
            np.einsum("eg,gn,egi->eni", part, by_node, f)
            for by_node, f in zip(self._by_node, (line, by_t), strict=True)
        )
        if tangent:
            tt, ww, tw = (u[..., :, None] * v[..., None, :] for u, v in ((t, t), (w, w), (t, w)))
            R, p, one = R[..., None], p[..., None], np.eye(3)
            wt = b * (tw / R + p * one / R - 2 * p * tt / R**2)
            second = {
                (0, 0): self._across * one + b * tt / R,
                (0, 1): wt,
                (1, 0): wt.swapaxes(-1, -2),
                (1, 1): b * (ww / R - 2 * p * (tw + tw.swapaxes(-1, -2)) / R**2 - p**2 * one / R**2)
                + 4 * b * p**2 * tt / R**3,
            }
            self._stiffness = sum(
                np.einsum("eg,gn,gm,egij->enimj", part, self._by_node[k], self._by_node[m], values)
                for (k, m), values in second.items()
            )
        return bool(np.isfinite(self._force).all())

    def add_force(self, total: Array) -> None:
        """See `Term.add_force`."""
        np.add.at(total, self._local, self._force[self._own])

    def pattern(self) -> tuple[Indices, Indices]:
        """See `Term.pattern`."""
        return self._pattern

    def add_stiffness(self, values: Array) -> None:
        """See `Term.add_stiffness`."""
        values += self._stiffness.ravel()[self._rows]

    def _on_root(self, value: float) -> float:
        # every rank knows the whole seam
        return float(value) if self._comm.rank == 0 else 0.0

    def energy(self) -> float | None:
        """See `Term.energy`; that of threads which the step tears is lost already."""
        return self._on_root(self._stored[~self.torn & ~self._tearing].sum())

    def potential(self) -> float | None:
        """See `Term.potential`."""
        return self._on_root(self._stored[~self.torn].sum())

    def dissipated(self) -> float:
        """See `Term.dissipated`."""
        return self._on_root(self._lost + self._stored[self._tearing].sum() - self._watched)

    def watch(self) -> None:
        """See `Term.watch`."""
        self._watched = self._lost

    def commit(self) -> None:
        """See `Term.commit`; what was pulled too hard is torn."""
        if self._tearing.any():
            self._lost += float(self._stored[self._tearing].sum())
            self.torn |= self._tearing
            for _, at, kept in self._kept:
                kept[:] = self.torn[at]
            self.evaluate()

    def renew(self) -> None:
        """See `Term.renew`."""
        told = np.zeros(self.torn.shape)
        for _, at, kept in self._kept:
            told[at] = kept
        self.torn = self._comm.allreduce(told) > 0.5
        self.evaluate()

    def fields(self) -> list[tuple[str, np.ndarray, Array]]:
        """See `Term.fields`."""
        return [(f"torn {self.name} {k}", cells, kept) for k, (cells, _, kept) in enumerate(self._kept)]


class _Edge:
    """A path of edges of cells, from one end to the other, the same on every rank.

    nodes: numbers (cells, 2 or 3) of its displacement, ends first; start, rest: their places in m; dofs: (cells, nodes,
    3), global unknowns of q; places: for each edge of a cell, this rank's cells that have it, and where on the path.
    """

    def __init__(self, domain: Domain, space: Space, name: str) -> None:
        mesh, (_, edges) = domain.mesh, domain.entities(name, 1)
        whole = space.V if isinstance(space, ShellSpace) else space
        part, inside = whole.sub(0).collapse() if isinstance(space, ShellSpace) else (space, None)
        unknowns = np.arange(3 * len(placing.places(part))) if inside is None else np.array(inside)
        mesh.topology.create_connectivity(1, 2)
        mesh.topology.create_connectivity(2, 1)
        cell_of, edges_of = mesh.topology.connectivity(1, 2), mesh.topology.connectivity(2, 1)
        edges = edges[edges < mesh.topology.index_map(1).size_local]
        cells = np.array([cell_of.links(edge)[0] for edge in edges], dtype=np.int32)
        side = np.array([list(edges_of.links(c)).index(e) for c, e in zip(cells, edges, strict=True)], dtype=np.int32)
        layout, count = part.dofmap.dof_layout, mesh.ufl_cell().num_edges
        on = np.array([sorted(layout.entity_closure_dofs(1, k)) for k in range(count)])[side]
        local = np.take_along_axis(part.dofmap.list[cells], on, axis=1)
        numbers, bs = whole.dofmap.index_map, whole.dofmap.index_map_bs
        blocks, component = np.divmod(unknowns.reshape(-1, 3)[local].astype(np.int32), bs)
        own = (
            part.dofmap.index_map.local_to_global(local.ravel()).reshape(local.shape),
            placing.places(part)[local],
            np.take_along_axis(placing.at_rest(part, cells), on[..., None], axis=1),
            numbers.local_to_global(blocks.ravel()).reshape(blocks.shape) * bs + component,
        )
        every = mesh.comm.allgather(own)
        before = sum(len(ranks[0]) for ranks in every[: mesh.comm.rank])
        self.nodes, self.start, self.rest, self.dofs = (np.concatenate(column) for column in zip(*every, strict=True))
        order, turn = _path(self.nodes[:, :2], name)
        for what in ("nodes", "start", "rest", "dofs"):
            values = getattr(self, what)[order]
            values[turn, :2] = values[turn, 1::-1]
            setattr(self, what, values)
        at = np.argsort(order)[before : before + len(cells)]
        self.places = [(cells[side == k], at[side == k]) for k in range(count)]

    def turned(self) -> "_Edge":
        """The same from its other end."""
        other = object.__new__(_Edge)
        for what in ("nodes", "start", "rest", "dofs"):
            values = getattr(self, what)[::-1].copy()
            values[:, :2] = values[:, 1::-1]
            setattr(other, what, values)
        return other


def _path(ends: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Order in which edges between nodes (edges, 2) follow each other, and which of them are turned. InputError."""
    met: dict[int, list[int]] = {}
    for edge, pair in enumerate(ends):
        for node in pair:
            met.setdefault(int(node), []).append(edge)
    loose = sorted(node for node, edges in met.items() if len(edges) == 1)
    order: list[int] = []
    turn: list[bool] = []
    if len(loose) == 2 and max(map(len, met.values())) == 2:
        node = loose[0]
        while (left := [edge for edge in met[node] if edge not in order[-1:]]) and len(order) < len(ends):
            order.append(left[0])
            turn.append(bool(ends[left[0], 0] != node))
            node = int(ends[left[0], 0 if turn[-1] else 1])
    if not len(ends) or len(order) < len(ends):
        raise InputError(f"The edge {name!r} is no path from one end to another; sew each of its parts.")
    return np.array(order), np.array(turn)
