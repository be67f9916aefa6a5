"""The matrix of a Newton iteration: the stiffness of all terms, in the unknowns that are solved for."""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from dolfinx import fem
from petsc4py import PETSc

from ..shell.directors import ShellSpace
from ..terms.term import Term


class Tangent:
    """Derivative of the residual of some terms by the unknowns, u or the (u, angles) of a shell.

    Its pattern is the union of the terms' patterns, and made anew where one of them says that it has changed.

    Public: `K`, the sum of the terms in the space of q; `A`, what is solved with: K, or of a shell its product with
    `turn` from both sides and the curvature of its directors.

    Args:
        terms: of the residual.
        V: the space of q.
        shell: with its directors, if it is one.
        turn: of a shell, d(u, d)/d(u, angles), V rows by W columns; `extra` of them are not V's, on this rank.
    """

    def __init__(
        self,
        terms: Sequence[Term],
        V: fem.FunctionSpace,
        shell: ShellSpace | None,
        turn: PETSc.Mat | None,
        extra: int = 0,
    ) -> None:
        self._terms, self._space, self._shell, self._turn, self._extra = terms, V, shell, turn, extra
        self._symmetric = all([term.symmetric for term in terms])
        self._build()

    def _build(self) -> None:
        comm, index_map, bs = self._space.mesh.comm, self._space.dofmap.index_map, self._space.dofmap.index_map_bs
        begin, end = index_map.local_range
        # LU needs a diagonal, whatever the terms have
        diagonal = np.arange(begin * bs, end * bs + self._extra)
        patterns = [*(term.pattern() for term in self._terms), (diagonal, diagonal)]
        rows, columns = (np.concatenate([np.asarray(p[k], dtype=PETSc.IntType) for p in patterns]) for k in (0, 1))
        ends = np.cumsum([len(pattern[0]) for pattern in patterns])
        self._values = np.zeros(len(rows))
        self._parts = np.split(self._values, ends)[: len(self._terms)]
        self.K = PETSc.Mat().create(comm)
        self.K.setSizes([[len(diagonal), None]] * 2)
        self.K.setType(PETSc.Mat.Type.AIJ)
        self.K.setPreallocationCOO(rows, columns)
        self.K.setValuesCOO(self._values)
        # a copy of a product cannot be the result of the next one: PETSc crashes
        self.A = self.K if self._turn is None else self.K.ptap(self._turn)
        self.A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self.declare(self._symmetric)

    def declare(self, symmetric: bool) -> None:
        """Whether `A` is and stays symmetric once given unknowns are eliminated; by default, as the terms are."""
        self._symmetric = symmetric
        for option in (PETSc.Mat.Option.SYMMETRIC, PETSc.Mat.Option.SYMMETRY_ETERNAL):
            self.A.setOption(option, symmetric)

    def follow(self) -> bool:
        """Whether the pattern of a term has changed; `K` and `A` are then new matrices."""
        changed = any(term.pattern_changed for term in self._terms)
        if self._space.mesh.comm.allreduce(changed, MPI.LOR):
            self._build()
            return True
        return False

    def sum_up(self, impulses: float = 1.0) -> None:
        """Fill `K` with the stiffness of the terms at their last evaluation, of impulsive ones times `impulses`."""
        self._values[:] = 0.0
        for term, part in zip(self._terms, self._parts, strict=True):
            term.add_stiffness(part)
            if term.impulsive:
                part *= impulses
        self.K.setValuesCOO(self._values)

    def assemble(self, force: PETSc.Vec, impulses: float = 1.0) -> None:
        """Fill `A`, before any condition; force: sum of the terms' forces in V, at their last evaluation."""
        self.sum_up(impulses)
        if self._shell is not None:
            self.K.ptap(self._turn, result=self.A)
            self._shell.add_curvature(self.A, force)

    def sound(self) -> bool:
        """Whether all entries of `A` are finite; else it becomes the identity, for MUMPS would end the whole solve."""
        if np.isfinite(self.A.norm(PETSc.NormType.FROBENIUS)):
            return True
        self.A.zeroEntries()
        self.A.shift(1.0)
        return False

    def eliminate(self, rows: np.ndarray, symmetric: bool, right: Sequence[PETSc.Vec] = ()) -> None:
        """Take given unknowns, global `rows` on this rank, out of `A`.

        symmetric: take out their columns too, and correct right-hand sides, in which those rows hold the values of the
        given unknowns. Their diagonal is then as large as any.
        """
        if not symmetric:
            self.A.zeroRows(rows, 1.0)
            return
        size = self.A.getDiagonal().norm(PETSc.NormType.NORM_INFINITY) or 1.0
        own = rows - self.A.getOwnershipRange()[0]
        for b in right:
            given = b.duplicate()
            given.array_w[own] = b.array_r[own]
            b.axpy(-1.0, self.A * given)
            b.array_w[own] = size * given.array_r[own]
        self.A.zeroRowsColumns(rows, size)
