"""Nodes of a shell that move as one rigid body, such as an edge in a stiff bar: six unknowns for all of them.

From the last commit, where its nodes were at c_0 + a with directors d_0, a body has moved and turned to

    x = c + R a,    d = R d_0,    R = I + sin|w|/|w| [w] + (1 - cos|w|)/|w|^2 [w]^2,

c being the middle of its nodes, R the turn by the vector w, less than half a turn, and [w] the matrix of a cross
product. About another point, Newton's method would not keep the symmetry of a sheet: far from balance it depends on the
unknowns.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import InputError
from ..laws import Array


def _cross(v: Array) -> Array:
    """Matrices (n, 3, 3) of v x, of vectors (n, 3)."""
    return np.cross(v[:, None, :], np.eye(3)).transpose(0, 2, 1)


def _derivatives(factorials: list[float]) -> Array:
    """Coefficients of the alternating series 1/f_0 - x/f_1 + ..., and of its first two derivatives, (3, 5)."""
    series = np.polynomial.Polynomial((-1.0) ** np.arange(5) / np.array(factorials))
    return np.array([np.pad(series.deriv(k).coef, (0, k)) for k in range(3)])


SMALL = np.array(
    [_derivatives(f) for f in ([1.0, 6.0, 120.0, 5040.0, 362880.0], [2.0, 24.0, 720.0, 40320.0, 3628800.0])]
)


def _series(x: float) -> Array:
    """sin t/t and (1 - cos t)/t^2 at x = t^2, with two derivatives by x each, (2, 3); by series where x is small."""
    if x < 0.04:
        return np.array(SMALL @ x ** np.arange(5))
    t = np.sqrt(x)
    s, c = np.sin(t) / t, (1 - np.cos(t)) / x
    s1, c1 = (np.cos(t) - s) / (2 * x), (s / 2 - c) / x
    return np.array([[s, s1, -(s / 4 + 1.5 * s1) / x], [c, c1, (s1 / 2 - 2 * c1) / x]])


def turned(w: Array, v: Array) -> tuple[Array, Array]:
    """R v and its derivative by w, (n, 3) and (n, 3, 3), of vectors v (n, 3)."""
    (s, s1, _), (c, c1, _) = _series(float(w @ w))
    along = (v @ w)[:, None]
    once, twice = np.cross(w, v), along * w - (w @ w) * v
    slope = c * (along[:, :, None] * np.eye(3) + w[:, None] * v[:, None, :] - 2 * v[:, :, None] * w) - s * _cross(v)
    return v + s * once + c * twice, slope + 2 * (s1 * once + c1 * twice)[:, :, None] * w


def second(w: Array, v: Array, r: Array) -> Array:
    """Sum over the vectors of r . d2(R v)/dw2, (3, 3)."""
    # r . R v = r . v + s m . w + c w . T w, and ds/dw = 2 s1 w
    m, T = np.cross(v, r).sum(axis=0), (r.T @ v + v.T @ r) / 2 - np.sum(r * v) * np.eye(3)
    (_, s1, s2), (c, c1, c2) = _series(float(w @ w))
    once, twice, mixed = m @ w, w @ T @ w, np.outer(2 * s1 * m + 4 * c1 * T @ w, w)
    bent = 2 * (s1 * once + c1 * twice) * np.eye(3) + 4 * (s2 * once + c2 * twice) * np.outer(w, w)
    return np.asarray(2 * c * T + mixed + mixed.T + bent)


class Body:
    """A rigid body of some nodes of a shell; to be made on every rank.

    Public: `name`; `nodes` and `directors`, their local unknowns in V, (n, 3) each; `columns`, global unknowns in W of
    the body's displacement and turn, which six of its nodes' unknowns stand for; `slaves`, local unknowns in W of the
    others, which stay 0; `pattern` and `entries`, global rows in V, columns and values of the derivative at the last
    `move`.

    Args:
        name: of its group, for messages.
        comm, V, W: communicator, and index maps of both spaces.
        rows: of the directors in `ShellSpace.nodes`, as they are in `directors`.
        nodes, directors: see above.
        x: places of the nodes at rest, m.
        moves, angles: unknowns in W of the displacements (n, 3) and of the directors (n, 2).

    Raises InputError, on every rank, for a group that has no two directors.
    """

    def __init__(
        self,
        name: str,
        comm: MPI.Comm,
        V: Any,
        W: Any,
        rows: np.ndarray,
        nodes: Array,
        directors: Array,
        x: Array,
        moves: Array,
        angles: Array,
    ) -> None:
        self.name, self.comm, self.rows, self.nodes, self.directors, self._x = name, comm, rows, nodes, directors, x
        self.owned = nodes[:, 0] < V.size_local, directors[:, 0] < V.size_local
        """Nodes and directors that this rank owns."""
        own = [part[owned].astype(np.int32) for part, owned in zip((moves, angles), self.owned, strict=True)]
        found = comm.allgather([W.local_to_global(part[:2].ravel()) for part in own])
        leads, turns = (np.concatenate([rank[k] for rank in found]) for k in (0, 1))
        if len(turns) < 4:
            raise InputError(f"The group {name!r} has less than two nodes with directors: it cannot be a rigid body.")
        self.columns = np.concatenate([leads[:3], turns[:3]]).astype(np.int32)
        every = np.concatenate([moves.ravel(), angles.ravel()]).astype(np.int32)
        self.slaves = every[~np.isin(W.local_to_global(every), self.columns)]
        begin, end = W.local_range
        self._here = (begin <= self.columns) & (self.columns < end)
        self._kept = self.columns[self._here] - begin
        self._count = comm.allreduce(int(self.owned[0].sum()))
        self._rest = self._mean(x)
        at = np.concatenate([part[own] for part, own in zip((nodes, directors), self.owned, strict=True)])
        own_rows = V.local_to_global(at.ravel().astype(np.int32)).astype(np.int32)[:, None]
        self.pattern = own_rows, np.tile(self.columns, (len(own_rows), 1))
        self.arms = self.moved = x
        """From the middle, and displacements, of the nodes (n, 3) at the last commit, m."""
        self.settle(np.zeros(V.size_local + V.num_ghosts))
        self._turn = np.zeros(3)

    def _mean(self, values: Array) -> Array:
        """Of values at the nodes (nodes, 3), over all ranks."""
        return np.asarray(self.comm.allreduce(values[self.owned[0]].sum(axis=0)) / self._count)

    def settle(self, q: Array) -> None:
        """The displacements of q, a local array of V, are those of the last commit."""
        self.moved = q[self.nodes]
        self.arms = self._x + self.moved
        self.arms -= self._mean(self.arms)

    def put(self, values: Array, y: Array) -> None:
        """Set the body's six unknowns in y, a local array of W, and the others to 0."""
        y[self.slaves] = 0.0
        y[self._kept] = values[self._here]

    def rest(self, q: Array, y: Array) -> None:
        """Set the unknowns in y to the displacement of q, and no turn."""
        self.put(np.concatenate([self._mean(q[self.nodes]), np.zeros(3)]), y)

    def move(self, y: Array, q: Array, d: Array) -> Array:
        """Put the displacements of y into q; the directors, from those at the last commit, d (n, 3)."""
        values = np.zeros(6)
        values[self._here] = y[self._kept]
        values = self.comm.allreduce(values)
        self._turn = values[3:]
        arms, arms_by_turn = turned(self._turn, self.arms)
        d, d_by_turn = turned(self._turn, d)
        q[self.nodes] = self._rest + values[:3] + arms - self._x
        moves = np.tile(np.eye(3), (len(arms), 1, 1)), np.zeros((len(d), 3, 3))
        parts = zip(moves, (arms_by_turn, d_by_turn), self.owned, strict=True)
        self.entries = np.concatenate([np.concatenate([a, b], axis=2)[own] for a, b, own in parts]).reshape(-1, 6)
        return d

    def check(self, given: Array) -> None:
        """Raise InputError, on every rank, where unknowns of V that are given (True) are its own."""
        if self.comm.allreduce(bool(given[self.nodes].any() or given[self.directors].any())):
            raise InputError(f"The group {self.name!r} is rigid and free: leave out what else holds nodes of it.")

    def curvature(self, force: Array, d: Array) -> Array:
        """This rank's share of the second derivative (3, 3) by the turn of the work of forces, at the last `move`.

        force: a local array of V; d: directors at the last commit, (n, 3).
        """
        v = np.concatenate([part[own] for part, own in zip((self.arms, d), self.owned, strict=True)])
        at = np.concatenate([part[own] for part, own in zip((self.nodes, self.directors), self.owned, strict=True)])
        return second(self._turn, v, force[at])

    def rates(self, v: Array, arms: Array, d: Array) -> tuple[Array, Array]:
        """Rates of displacement, of the middle, and turn of the motion nearest to v (V's array).

        arms: from the middle, (n, 3), m; d: directors at the last commit, (n, 3).
        """
        r, at = arms[self.owned[0]], (self.nodes[self.owned[0]], self.directors[self.owned[1]])
        size = np.sqrt(self.comm.allreduce(float(np.sum(r * r))) / self._count)
        # directors count as arms as long as the body; those from the middle feel no common speed
        r = np.concatenate([r, size * d[self.owned[1]]])
        turning = np.cross(r, np.concatenate([v[at[0]], size * v[at[1]]])).sum(axis=0)
        sums = self.comm.allreduce(np.column_stack([np.sum(r * r) * np.eye(3) - r.T @ r, turning]))
        return self._mean(v[self.nodes]), np.linalg.solve(sums[:, :3], sums[:, 3])

    # -- in explicit motion, with a lumped mass of each local unknown ------------------------------------------------

    def project(self, values: Array, q: Array, mass: Array) -> tuple[Array, Array]:
        """Make rates (an array of V) at the places of q those of a rigid body, with the same momentum.

        Rate of the centre of mass and turn. mass: a local array of V, kg and kg m2.
        """
        at = np.concatenate([self.nodes[self.owned[0]], self.directors[self.owned[1]]])
        split = int(self.owned[0].sum())
        m = mass[at[:, 0]]
        total = self.comm.allreduce(np.append(m[:split] @ (self._x[self.owned[0]] + q[at[:split]]), m[:split].sum()))
        self._arms = self._x + q[self.nodes] - total[:3] / total[3]
        r = np.concatenate([self._arms[self.owned[0]], q[at[split:]]])
        p = m[:, None] * values[at]
        self._inertia = np.sum(m * (r * r).sum(axis=1)) * np.eye(3) - (r * m[:, None]).T @ r
        sums = np.column_stack([p[:split].sum(axis=0), np.cross(r, p).sum(axis=0), self._inertia])
        sums = self.comm.allreduce(sums)
        self._inertia = sums[:, 2:]
        shift, turn = sums[:, 0] / total[3], np.linalg.solve(self._inertia, sums[:, 1])
        self._set(values, q, shift, turn)
        return shift, turn

    def _set(self, values: Array, q: Array, shift: Array, turn: Array) -> None:
        values[self.nodes] = shift + np.cross(turn, self._arms)
        values[self.directors] = np.cross(turn, q[self.directors])

    def drift(self, q: Array, v: Array, mass: Array, dt: float) -> None:
        """Move q by dt (s) of the free motion that v is, with which momentum and its moment stay.

        Over the step it turns by dt w about the w of its middle: the moment of momentum over the inertia of the body
        when it has turned by half of that. mass: of V's unknowns.
        """
        shift, turn = self.project(v, q, mass)
        moment = self._inertia @ turn
        for _ in range(50):
            axes, _ = turned(dt / 2 * turn, np.eye(3))
            before, turn = turn, axes.T @ np.linalg.solve(self._inertia, axes @ moment)
            if np.abs(turn - before).max() <= 1e-15 * np.abs(turn).max():
                break
        axes, _ = turned(dt * turn, np.eye(3))
        q[self.nodes] += dt * shift + self._arms @ axes - self._arms
        q[self.directors] = q[self.directors] @ axes
        self._arms = self._arms @ axes
        self._set(v, q, shift, axes.T @ np.linalg.solve(self._inertia, axes @ moment))

    def lay(self, q: Array, v: Array, a: Array, by_mass: Callable[[Array], Array]) -> None:
        """Make velocity v and acceleration a (arrays of V) those of a rigid body, at the places of q.

        It keeps its momentum, on which the order of a time step depends; by_mass: mass times an array of V, owned part.
        """
        arms, d = self._x + q[self.nodes], q[self.directors]
        arms -= self._mean(arms)
        modes = np.zeros((6, len(q)))
        for k, e in enumerate(np.eye(3)):
            modes[k][self.nodes] = e
            modes[k + 3][self.nodes], modes[k + 3][self.directors] = np.cross(e, arms), np.cross(e, d)
        weighed = np.array([by_mass(mode) for mode in modes])
        owned = weighed.shape[1]
        # a body without rotary inertia may have none about its own line
        inverse = np.linalg.pinv(self.comm.allreduce(weighed @ modes[:, :owned].T), 1e-13, hermitian=True)
        mine = np.concatenate([self.nodes.ravel(), self.directors.ravel()])

        def rigid(rates: Array) -> Array:
            alone = np.zeros(len(q))
            alone[mine] = rates[mine]
            return np.asarray(inverse @ self.comm.allreduce(weighed @ alone[:owned]))

        speed = rigid(v)
        v[mine] = (speed @ modes)[mine]
        turning = np.zeros(len(q))
        for dofs, vectors in ((self.nodes, arms), (self.directors, d)):
            turning[dofs] = np.cross(speed[3:], np.cross(speed[3:], vectors))
        a[mine] = (turning + rigid(a - turning) @ modes)[mine]
