"""The matrix of a Newton iteration: the stiffness of all terms, in the unknowns that are solved for."""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from dolfinx import fem
from petsc4py import PETSc

from ..shell.directors import ShellSpace
from ..terms.term import NOWHERE, Indices, Term


class Tangent:
    """Derivative of the residual of some terms by the unknowns, u or the (u, angles) of a shell.

    Its pattern is the union of the terms' patterns, and made anew where one of them says that it has changed.

    Public: `A`, what is solved with: the sum of the terms in the space of q, or of a shell its product with `turn` from
    both sides and the curvature of its directors. Where all terms tell their stiffness by displacements and angles, and
    no unknowns are joined, it is summed up at once.

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
        patterns = self._patterns()
        V = self._shell.W if self._whole and self._shell is not None else self._space
        comm, index_map, bs = V.mesh.comm, V.dofmap.index_map, V.dofmap.index_map_bs
        begin, end = index_map.local_range
        # LU needs a diagonal, whatever the terms have
        diagonal = np.arange(begin * bs, end * bs + self._extra)
        patterns = [*patterns, (diagonal, diagonal)]
        rows, columns = (np.concatenate([np.asarray(p[k], dtype=PETSc.IntType) for p in patterns]) for k in (0, 1))
        self._values = np.zeros(len(rows))
        self._parts = np.split(self._values, np.cumsum([len(pattern[0]) for pattern in patterns]))
        self._sum = PETSc.Mat().create(comm)
        self._sum.setSizes([[len(diagonal), None]] * 2)
        self._sum.setType(PETSc.Mat.Type.AIJ)
        self._sum.setPreallocationCOO(rows, columns)
        self._sum.setValuesCOO(self._values)
        # a copy of a product cannot be the result of the next one: PETSc crashes
        self.A = self._sum if self._whole or self._turn is None else self._sum.ptap(self._turn)
        self.A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self.declare(self._symmetric)

    def _patterns(self) -> list[tuple[Indices, Indices]]:
        """Of the terms, in what is solved for if all tell it (`_whole`), and of the curvature of the directors then."""
        shell, known = self._shell, {}
        at_once = shell is not None and not shell.bodies
        at_once = at_once and self._turn.size[1] == shell.W.dofmap.index_map.size_global  # type: ignore[union-attr]
        turned = [term.turned_pattern() if at_once else None for term in self._terms]
        for k, term in enumerate(self._terms):
            if turned[k] is None:
                known[k] = term.pattern()
                at_once = at_once and not len(known[k][0])
        self._whole = self._space.mesh.comm.allreduce(at_once, MPI.LAND)
        if self._whole:
            return [*(pattern or NOWHERE for pattern in turned), shell.curvature_pattern()]  # type: ignore[union-attr]
        return [known[k] if k in known else term.pattern() for k, term in enumerate(self._terms)]

    def declare(self, symmetric: bool) -> None:
        """Whether `A` is and stays symmetric once given unknowns are eliminated; by default, as the terms are."""
        self._symmetric = symmetric
        for option in (PETSc.Mat.Option.SYMMETRIC, PETSc.Mat.Option.SYMMETRY_ETERNAL):
            self.A.setOption(option, symmetric)

    def follow(self) -> bool:
        """Whether the pattern of a term has changed; `A` is then a new matrix."""
        changed = any(term.pattern_changed for term in self._terms)
        if self._space.mesh.comm.allreduce(changed, MPI.LOR):
            self._build()
            return True
        return False

    def assemble(self, force: PETSc.Vec, impulses: float = 1.0) -> None:
        """Fill `A`, before any condition, with the stiffness of the terms at their last evaluation.

        force: sum of the terms' forces in V; impulses: what those of impulsive terms count.
        """
        self._values[:] = 0.0
        for term, part in zip(self._terms, self._parts, strict=False):
            (term.add_turned if self._whole else term.add_stiffness)(part)
            if term.impulsive:
                part *= impulses
        if self._whole:
            self._parts[len(self._terms)] += self._shell.curvature_entries(force)  # type: ignore[union-attr]
        self._sum.setValuesCOO(self._values)
        if self._shell is not None and not self._whole:
            self._sum.ptap(self._turn, result=self.A)
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
