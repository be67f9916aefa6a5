"""Whether a sheet is held: rigid motions of its pieces that supports leave free and that nothing resists.

A piece is what edges join. Of its rigid motions (three translations and three turns in space) those remain that vanish
at every given unknown; of them, those that do no work in the stiffness of the unstrained sheet, so that springs, and
points where pieces meet, count as supports. A membrane that has no stiffness out of its plane yet is another matter:
that is no rigid motion.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from dolfinx import fem
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..errors import InputError
from ..laws import Array
from ..shell.directors import ShellSpace
from ..surfaces import placing

FREE = 1e-12
"""Square of a given unknown's motion, as a part of the piece's size, that is none."""
SOFT = 1e-9
"""Stiffness against a rigid motion, as a part of the largest of an unknown, that is none."""
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Piece:
    """Cells that edges join."""

    number: int
    cells: int
    centre: Array
    """Mean of the middles of its cells, m."""
    size: float
    """Root mean square of their distance from it, m."""


@dataclass(frozen=True)
class FreeMotion:
    """Rigid motions of a piece that nothing resists: rows of a shift (m) and a turn (rad) at its centre each."""

    piece: Piece
    pieces: int
    motions: Array
    rigid: "Rigid"

    def __str__(self) -> str:
        here = ", ".join(f"{x:.4g}" for x in self.piece.centre)
        whole = "the sheet" if self.pieces == 1 else f"the piece of {self.piece.cells} cells at ({here}) m"
        return f"{whole} can {' and '.join(named(self.motions, self.piece.centre))}"

    def kept_by(self, solver: Any) -> bool:
        """Whether the present loads do no work on these motions at first, and negative work on each of them next."""
        n, forces = len(self.piece.centre), -solver.forces()
        mine = self.rigid.nodes(self.piece, len(forces))
        f, r = (np.zeros((len(mine), 3)) for _ in range(2))
        f[:, :n], r[:, :n] = forces[self.rigid.dofs[mine]], self.rigid.places[mine] - self.piece.centre
        told = solver.comm.allreduce(np.concatenate([f.sum(axis=0), (f.T @ r).ravel(), [np.abs(f).sum()]]))
        F, S, total = told[:3], told[3:12].reshape(3, 3), told[12] * self.piece.size
        shift, turn = (np.zeros((len(self.motions), 3)) for _ in range(2))
        shift[:, :n] = self.motions[:, :n]
        turn[:, 3 - self.motions.shape[1] + n :] = self.motions[:, n:]
        moment = np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])
        if np.abs(shift @ F + turn @ moment).max() > 1e-9 * total:
            return False
        # of x + shift + turn x r the next term is half of turn x (shift + turn x r)
        second = turn @ ((S + S.T) / 2 - np.trace(S) * np.eye(3)) @ turn.T
        across = np.cross(shift, F) @ turn.T
        return bool(np.linalg.eigvalsh(second + (across + across.T) / 2).max() < -1e-9 * total)


def require(solver: Any, set_load: Callable[[float], None], start: float, load: float) -> None:
    """Raise InputError, on every rank, where a `StaticSolver`'s unstrained sheet is not held at the load `start`.

    Let off is what the first `load` keeps in its place: a curtain may turn about its rod, which its weight prevents.
    """
    free = free_motions(solver, lambda: set_load(start)) if solver.scale == 0.0 else []
    if not free:
        return
    set_load(load)
    solver.residual(solver.begin())
    loose = [motion for motion in free if not motion.kept_by(solver)]
    set_load(start)
    if loose:
        more = f" (and {len(loose) - 3} more pieces are loose)" if len(loose) > 3 else ""
        raise InputError(
            f"The supports do not hold the sheet: {'; '.join(map(str, loose[:3]))}{more}; add what holds it, or let it "
            "move as a motion, which needs no support."
        )


def free_motions(solver: Any, unload: Callable[[], None] = lambda: None) -> list[FreeMotion]:
    """Of a `StaticSolver` whose sheet is unstrained, under the loads that `unload` leaves; to be called on every rank.

    A pressure that follows the sheet would pass for a support.
    """
    u, y, space, comm = solver.u, solver._y, solver._shell, solver.comm
    n = u.function_space.mesh.geometry.dim
    number, found = pieces(u.function_space.mesh)
    rigid = Rigid(u, y, space, number, found)
    gram = np.zeros((len(found), len(rigid.fields), len(rigid.fields)))
    given = solver._given
    rows = (rigid.fields * rigid.scale)[:, given]
    np.add.at(gram, rigid.of[given], np.einsum("id,jd->dij", rows, rows))
    gram = comm.allreduce(gram)
    values, vectors = np.linalg.eigh(gram)
    suspects = [p for p in found if values[p.number, 0] <= FREE]
    if not suspects:
        return []
    unload()
    solver.residual(solver.begin())
    A = solver.factorised().getOperators()[0]
    stiffest = float(comm.allreduce(np.abs(A.getDiagonal().array_r).max(initial=0.0), MPI.MAX))
    v, Av = A.createVecs()
    result = []
    for piece in suspects:
        modes = vectors[piece.number][:, values[piece.number] <= FREE].T  # a row each
        motions = [rigid.motion(piece, mode) for mode in modes]
        energy = np.zeros((len(modes), len(modes)))
        for k, motion in enumerate(motions):
            v.array_w[:] = motion[: v.local_size]
            v.array_w[given] = 0.0
            A.mult(v, Av)
            energy[k] = [float(other[: v.local_size] @ Av.array_r) for other in motions]
        energy = comm.allreduce(energy)
        stiffness, combined = np.linalg.eigh((energy + energy.T) / 2)
        free = combined[:, stiffness <= SOFT * stiffest * piece.size**2].T @ modes
        if len(free):
            free[:, :n] *= piece.size
            result.append(FreeMotion(piece, len(found), free, rigid))
    return result


def pieces(mesh: Any) -> tuple[Array, list[Piece]]:
    """Number of the piece of each local cell, ghosts included, and the pieces; the same on every rank."""
    topology, comm = mesh.topology, mesh.comm
    topology.create_connectivity(2, 1)
    cells, edges = topology.index_map(2), topology.index_map(1)
    owned, to_edges = cells.size_local, topology.connectivity(2, 1)
    sides = to_edges.array.reshape(-1, len(to_edges.links(0)))[:owned] if owned else np.empty((0, 0), dtype=np.int32)
    x, first = placing.cells(mesh), cells.local_range[0]
    middles = x[:owned].mean(axis=1)[:, : mesh.geometry.dim]
    reach = comm.allreduce(float(np.ptp(x, axis=(0, 1)).max()) if len(x) else 0.0, MPI.MAX)
    rows = np.repeat(np.arange(first, first + owned), sides.shape[1])
    own = rows, edges.local_to_global(sides.ravel().astype(np.int32)), middles
    gathered = comm.gather(own, 0)
    told = None
    if gathered is not None:
        gathered = [rank for rank in gathered if len(rank[0])]
        rows, columns, middles = (np.concatenate([rank[k] for rank in gathered]) for k in range(3))
        total = cells.size_global
        joined = coo_array(
            (np.ones(len(rows), np.int8), (rows, columns + total)), shape=(total + edges.size_global,) * 2
        )
        labels = np.unique(connected_components(joined, directed=False)[1][:total], return_inverse=True)[1]
        count = np.bincount(labels)
        centres = np.array([np.bincount(labels, x) / count for x in middles.T]).T
        squares = np.bincount(labels, ((middles - centres[labels]) ** 2).sum(axis=1)) / count
        # of a single cell there is but one middle
        least = reach / max(1.0, total**0.5)
        sizes = np.maximum(np.sqrt(squares), least)
        told = labels, [Piece(k, int(c), centres[k], float(sizes[k])) for k, c in enumerate(count)]
    labels, found = comm.bcast(told, 0)
    here = np.arange(owned + cells.num_ghosts, dtype=np.int32)
    return labels[cells.local_to_global(here)], found


class Rigid:
    """Rigid motions of the pieces, in the unknowns that are solved for: `fields`, a row for each of one piece's.

    A translation is by the size of its piece, a turn by one radian, about axes through its centre. of: the piece of
    each unknown; scale: what makes an unknown's motion a part of the piece's size.
    """

    def __init__(
        self, u: fem.Function, y: fem.Function, space: ShellSpace | None, number: Array, found: Sequence[Piece]
    ) -> None:
        self._u, self._y, self._space, self._number, self._found = u, y, space, number, found
        V, self.n = u.function_space, u.function_space.mesh.geometry.dim
        U, dofs = (V, np.arange(len(u.x.array))) if space is None else V.sub(0).collapse()
        self.dofs = np.array(dofs).reshape(-1, self.n)
        self.places = placing.places(U)[:, : self.n]
        size = np.array([piece.size for piece in found])
        centre = np.array([piece.centre for piece in found])
        piece_of_u = self._pieces_of(V)
        self.of = self._pieces_of(y.function_space)
        self._node = node = piece_of_u[self.dofs[:, 0]]
        away = self.places - centre[node]
        fields = []
        for k in range(self.n):
            fields.append(self._field(size[node][:, None] * np.eye(self.n)[k], None))
        for spin in spins(self.n):
            fields.append(self._field(away @ spin.T, spin))
        self.fields = np.array(fields)
        of_u = np.zeros(len(u.x.array), dtype=bool)
        of_u[self.dofs] = True
        turns = np.ones(len(y.x.array), dtype=bool)
        turns[self._displacements()] = False
        self.scale = np.where(turns, 1.0, 1.0 / size[self.of])

    def motion(self, piece: Piece, mode: Array) -> Array:
        """Local array of a combination of one piece's motions, the others at rest."""
        mine = np.zeros(self.fields.shape[1], dtype=bool)
        table = _unrolled(self._y.function_space)
        mine[table[self._number == piece.number].ravel()] = True
        return np.asarray(np.where(mine, mode @ self.fields, 0.0))

    def nodes(self, piece: Piece, owned: int) -> np.ndarray:
        """This rank's own nodes of a piece: rows of `dofs` and `places`."""
        return np.flatnonzero((self._node == piece.number) & (self.dofs[:, 0] < owned))

    def _displacements(self) -> np.ndarray:
        if self._space is None:
            return np.arange(len(self._y.x.array))
        return np.array(self._space.W.sub(0).collapse()[1])

    def _pieces_of(self, V: fem.FunctionSpace) -> Array:
        """The piece of each local unknown; of one where two meet, either."""
        table = _unrolled(V)
        of = np.zeros(V.dofmap.index_map_bs * (V.dofmap.index_map.size_local + V.dofmap.index_map.num_ghosts), int)
        of[table] = self._number[:, None]
        return of

    def _field(self, moved: Array, spin: Array | None) -> Array:
        v = np.zeros(len(self._u.x.array))
        v[self.dofs] = moved
        if self._space is None:
            return v
        if spin is not None:
            v[self._space.nodes] = self._u.x.array[self._space.nodes] @ spin.T
        return np.array(self._space.rate(v))


def spins(n: int) -> list[Array]:
    """Matrices of the turns by a radian: in the plane one, in space about x, y and z."""
    if n == 2:
        return [np.array([[0.0, -1.0], [1.0, 0.0]])]
    return [np.cross(np.eye(3)[k], np.eye(3)).T for k in range(3)]


def _unrolled(V: fem.FunctionSpace) -> Array:
    dofs, bs = V.dofmap.list, V.dofmap.bs
    return (dofs[..., None] * bs + np.arange(bs)).reshape(len(dofs), dofs.shape[1] * bs)


def named(motions: Array, centre: Array) -> list[str]:
    """Words for a space of rigid motions, each a shift (m) and a turn (rad) at the centre."""
    n = len(centre)
    turns = motions[:, n:]
    # what has no turn in it
    _, values, right = np.linalg.svd(turns.T)
    rank = int((values > 1e-6 * max(1e-300, np.abs(motions).max())).sum())
    shifts, rest = right[rank:] @ motions[:, :n], right[:rank] @ motions
    shifts = np.linalg.svd(shifts)[2][: len(shifts)] if len(shifts) else shifts
    along = [AXES[k] for k in range(n) if np.linalg.norm(shifts @ np.eye(n)[k]) > 1 - 1e-6] if len(shifts) else []
    said = []
    if len(along) == len(shifts):
        said += [f"move along {', '.join(along)}"] if along else []
    else:
        said += [f"move along ({', '.join(f'{x:.3g}' for x in shift)})" for shift in shifts]
    if n == 2:
        return said + (["turn in its plane"] if rank else [])
    if rank == 3:
        return [*said, "turn about every axis"]
    axes = [k for k in range(n) if np.linalg.norm(np.linalg.qr(rest[:, n:].T)[0].T @ np.eye(n)[k]) > 1 - 1e-6]
    if len(axes) == rank:
        rest = np.linalg.lstsq(rest[:, n:].T, np.eye(n)[axes].T, rcond=None)[0].T @ rest
    for motion in rest:
        shift, turn = motion[:n], motion[n:] / np.linalg.norm(motion[n:])
        shift = shift / np.linalg.norm(motion[n:])
        k = int(np.abs(turn).argmax())
        way = AXES[k] if abs(turn[k]) > 1 - 1e-6 else f"({', '.join(f'{x:.3g}' for x in turn)})"
        if len(shifts) == n:
            said.append(f"turn about {way}")
        else:
            through = ", ".join(f"{x:.4g}" for x in np.round(centre + np.cross(turn, shift), 12) + 0.0)
            said.append(f"turn about the line along {way} through ({through}) m")
    return said
