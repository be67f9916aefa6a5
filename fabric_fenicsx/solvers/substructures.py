"""Systems on several ranks, each of which eliminates its own interior; the interface between them is solved by all.

Unknowns that couple two ranks are of the interface B; what else is a rank's own is its interior I. MUMPS factorises
A_II on one process and leaves the Schur complement A_BB - A_BI A_II^-1 A_IB, dense, but small, for the cut through a
surface is a line. All is added up in the order of the ranks, so that answers repeat to the last bit, unlike those of
MUMPS on several ranks (see `redundant`).
"""

import ctypes

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ..laws import Array
from .redundant import Redundant, alone, gather

LONG = 20.0
"""Most unknowns of an interface, over the cube root of all; beyond, its dense factors would be a good part of all."""

_petsc = ctypes.CDLL(PETSc.__file__)  # petsc4py does not show Schur complements of factors


class Substructures:
    """Context of a PC of PETSc's type "python", for systems without null pivots.

    Public: `ksp`, of this rank's interior, with MUMPS's factors.

    Args:
        prefix: of PETSc's options, which are those of the shared system.
        whole: unknowns below which a matrix whose interface is too long, or nothing, is left to `Redundant`; from there
            on MUMPS shares it.
    """

    def __init__(self, prefix: str, whole: float) -> None:
        self._prefix, self._whole = prefix, whole
        self.ksp, self._dense = alone(prefix), PETSc.KSP().create(PETSc.COMM_SELF)
        self._dense.getPC().setType("lu")
        self._dense.setType("preonly")
        self._shared: PETSc.Mat | None = None
        self._part: list[PETSc.Mat] | None = None
        self._other: PETSc.PC | None = None  # where the interface is too long, or there is none
        self._fresh = True  # no factors yet

    def setUp(self, pc: PETSc.PC) -> None:
        """Factorise the interior, and the sum of what all ranks leave at the interface."""
        _, A = pc.getOperators()
        if self._shared != A:  # a new one has another pattern
            self._release()
            self.reset(pc)
            self._shared = A
            self._divide(A)
        if self._other is not None:
            self._other.setOperators(A)
            self._other.setUp()
            pc.setFailedReason(self._other.getFailedReason())
            return
        comm, inner = A.comm.tompi4py(), self.ksp.getPC()
        self._part = gather(self.ksp, A, self._every, self._part)
        if self._fresh:
            inner.setFactorSetUpSolverType()
            at = PETSc.IS().createGeneral(self._outer.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
            _call("MatFactorSetSchurIS", inner.getFactorMatrix(), at)
            self._fresh = False
        self.ksp.setUp()
        inner.getFactorMatrix().setMumpsIcntl(26, 0)  # solve with the interior alone
        failed = comm.allreduce(inner.getFailedReason(), MPI.MAX)
        if not failed:
            self._factorise_interface(comm)
            failed = self._dense.getPC().getFailedReason()
        pc.setFailedReason(failed)

    def _divide(self, A: PETSc.Mat) -> None:
        """Find the interface, and what is this rank's own."""
        B, (begin, end) = interface(A), A.getOwnershipRange()
        if not 0 < len(B) <= LONG * A.size[0] ** (1 / 3):
            self._other = PETSc.PC().create(A.comm)
            self._other.setOptionsPrefix(self._prefix)
            self._other.setFromOptions()
            if A.size[0] < self._whole:
                self._other.setType("python")
                self._other.setPythonContext(Redundant(self._prefix))
            return
        inner = np.setdiff1d(np.arange(begin, end), B)
        every = np.union1d(inner, B)
        self._every = PETSc.IS().createGeneral(every.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        self._inner, self._outer = np.searchsorted(every, inner), np.searchsorted(every, B)
        self._mine = (B >= begin) & (B < end)
        self._own, self._at = inner - begin, B[self._mine] - begin
        self._blocks: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def _factorise_interface(self, comm: MPI.Comm) -> None:
        assert self._part is not None
        n, (indptr, columns, values) = len(self._outer), self._part[0].getValuesCSR()
        if not self._blocks:
            of, place = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr)), np.full(len(indptr) - 1, -1)
            place[self._outer] = np.arange(n)
            rows, outer = place[of], place[columns]
            for at, row, column in (
                (np.flatnonzero((rows >= 0) & (outer >= 0)), rows, outer),
                (np.flatnonzero((rows >= 0) & (outer < 0)), rows, columns),
                (np.flatnonzero((rows < 0) & (outer >= 0)), of, outer),
            ):
                self._blocks.append((at, row[at], column[at]))
        self._edges = [values[at] for at, _, _ in self._blocks[1:]]
        parts = np.empty((comm.size, n, n))
        comm.Allgather(_schur(self.ksp.getPC().getFactorMatrix(), n), parts)
        at, row, column = self._blocks[0]
        transposed = parts.sum(axis=0)
        transposed[column, row] -= (comm.size - 1) * values[at]  # all have the whole A_BB
        self._alone = np.count_nonzero(transposed, axis=0) == 1  # rows of given unknowns, which pivots mix with others
        self._diagonal = transposed.diagonal()[self._alone]
        self._dense.setOperators(PETSc.Mat().createDense((n, n), array=transposed.T, comm=PETSc.COMM_SELF))
        self._dense.setUp()

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve with the interior, with the interface, and with the interior again."""
        if self._other is not None:
            self._other.apply(b, x)
            return
        if pc.getFailedReason():
            x.set(np.inf)
            return
        assert self._part is not None
        comm, n, (right, answer) = b.comm.tompi4py(), len(self._outer), self._part[0].createVecs()
        (_, row, column), (_, of, to) = self._blocks[1:]
        right.array_w[self._inner] = b.array_r[self._own]
        self.ksp.solve(right, answer)
        left = -np.bincount(row, self._edges[0] * answer.array_r[column], n)
        left[self._mine] += b.array_r[self._at]
        parts = np.empty((comm.size, n))
        comm.Allgather(left, parts)
        load, edge = self._dense.getOperators()[0].createVecs()
        load.array_w[:] = parts.sum(axis=0)
        self._dense.solve(load, edge)
        edge.array_w[self._alone] = load.array_r[self._alone] / self._diagonal
        right.array_w[:] -= np.bincount(of, self._edges[1] * edge.array_r[to], right.size)
        self.ksp.solve(right, answer)
        x.array_w[self._own] = answer.array_r[self._inner]
        x.array_w[self._at] = edge.array_r[self._mine]

    def reset(self, pc: PETSc.PC) -> None:
        """Forget the factors."""
        self._fresh = True
        for solver in (self.ksp, self._dense, self._other):
            if solver is not None:
                solver.reset()

    def destroy(self, pc: PETSc.PC) -> None:
        """Let everything go."""
        self._release()
        self.ksp.destroy()
        self._dense.destroy()

    def _release(self) -> None:
        for one in (self._shared, *(self._part or []), self._other):
            if one is not None:
                one.destroy()
        self._shared = self._part = self._other = None


def interface(A: PETSc.Mat) -> np.ndarray:
    """Global unknowns, sorted, without which no rank's are coupled with another's; the same on every rank.

    Again and again those with the most such couplings, which are on the cut itself and not beside it.
    """
    comm, (begin, end) = A.comm.tompi4py(), A.getOwnershipRange()
    indptr, columns, _ = A.getValuesCSR()
    rows = np.repeat(np.arange(begin, end), np.diff(indptr))
    away = (columns < begin) | (columns >= end)
    pairs = np.concatenate(comm.allgather(np.column_stack([rows[away], columns[away]])))
    unknowns, pairs = np.unique(np.unique(np.sort(pairs, axis=1), axis=0), return_inverse=True)
    pairs = pairs.reshape(-1, 2)
    owner = np.searchsorted(A.getOwnershipRanges()[1:], unknowns, side="right")
    taken = np.zeros(len(unknowns), dtype=bool)
    while len(pairs):
        count = np.bincount(pairs.ravel(), minlength=len(unknowns))
        most = np.flatnonzero(count == count.max())
        taken[most[owner[most] == np.bincount(owner[most]).argmax()]] = True  # those of one rank are no pairs
        pairs = pairs[~taken[pairs].any(axis=1)]
    return unknowns[taken]


def _schur(factors: PETSc.Mat, n: int) -> Array:
    """Transpose (n, n) of the Schur complement that factors have left."""
    matrix, state, entries = ctypes.c_void_p(), ctypes.c_int(), ctypes.POINTER(ctypes.c_double)()
    _call("MatFactorCreateSchurComplement", factors, ctypes.byref(matrix), ctypes.byref(state))
    _call("MatDenseGetArray", matrix, ctypes.byref(entries))
    values = np.ctypeslib.as_array(entries, (n, n)).copy()
    _call("MatDenseRestoreArray", matrix, ctypes.byref(entries))
    _call("MatDestroy", ctypes.byref(matrix))
    return values


def _call(name: str, *arguments: object) -> None:
    """A function of PETSc."""
    given = [ctypes.c_void_p(one.handle) if isinstance(one, PETSc.Object) else one for one in arguments]
    if fault := getattr(_petsc, name)(*given):
        raise PETSc.Error(fault)
