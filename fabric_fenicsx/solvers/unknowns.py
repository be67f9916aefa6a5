"""What a Newton iteration solves for: displacements, angles of a shell, and unknowns that terms bring with them."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fempetsc
from petsc4py import PETSc

from ..laws import Array
from ..shell.directors import ShellSpace
from ..terms.extra import extra_force, extra_of
from ..terms.term import Term
from .leading import free_part, limited


class Unknowns:
    """Vectors of what is solved for, y, and of forces at q; unknowns of an `Extra` are the last of the last rank.

    Public: `y`, q or (u, angles) of a shell; `extra`; `turn`, dq/dy with ones for the extra unknowns, and `of_sheet`
    without them, both None for a membrane; `force`, the last sum of the terms' forces, and `of_q`, without those at
    extra unknowns;
    `owned` unknowns of y that are this rank's own.
    """

    def __init__(self, q: fem.Function, space: ShellSpace | None, terms: Sequence[Term]) -> None:
        self._q, self._space, self._terms, self.extra = q, space, terms, extra_of(terms)
        self._comm = q.function_space.mesh.comm
        self.y = q if space is None else fem.Function(space.W)
        self.of_q = self.force = fempetsc.create_vector(q.function_space)
        self.owned = int(fempetsc.create_vector(self.y.function_space).local_size)
        self.count = self.extra.count if self.extra else 0
        self.here = self.count if self._comm.rank == self._comm.size - 1 else 0
        """Extra unknowns, in all and on this rank."""
        if self.count:
            self.force = self._wide(self.of_q.local_size)
        self.of_sheet: Any = None
        self.turn: Any = None

    def _wide(self, size: int) -> PETSc.Vec:
        return PETSc.Vec().createMPI((size + self.here, None), comm=self._comm)

    def vector(self) -> PETSc.Vec:
        """A new vector of what is solved for."""
        return self._wide(self.owned) if self.count else fempetsc.create_vector(self.y.function_space)

    def link(self) -> PETSc.Mat | None:
        """Set q from y, and `turn`, once given directors are known."""
        if self._space is not None:
            self.of_sheet = self._space.turn(self.y, self._q)
            self.turn = self._widened() if self.count else self.of_sheet
        return self.turn

    def _widened(self) -> PETSc.Mat:
        indptr, columns, values = self.of_sheet.getValuesCSR()
        first = self.of_sheet.size[1]
        indptr = np.concatenate([indptr, indptr[-1] + 1 + np.arange(self.here)]).astype(PETSc.IntType)
        columns = np.concatenate([columns, first + np.arange(self.here)]).astype(PETSc.IntType)
        sizes = [(size + self.here, None) for size in self.of_sheet.getLocalSize()]
        csr = indptr, columns, np.concatenate([values, np.ones(self.here)])
        self._rows = csr[:2]
        return PETSc.Mat().createAIJ(sizes, csr=csr, comm=self._comm)

    def settle(self) -> None:
        """Set q from y."""
        if self._space is None:
            return
        self._space.turn(self.y, self._q)
        if self.count:
            values = np.concatenate([self.of_sheet.getValuesCSR()[2], np.ones(self.here)])
            self.turn.setValuesCSR(*self._rows, values)
            self.turn.assemble()

    def take(self, x: PETSc.Vec) -> None:
        """Set all unknowns, and q, from x."""
        if self.extra is None:
            x.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)
            fempetsc.assign(x, self.y)
        else:
            self.y.x.array[: self.owned] = x.array_r[: self.owned]
            self.y.x.scatter_forward()
            self.extra.values = self._told(x.array_r[self.owned :])
        self.settle()

    def _told(self, values: Array) -> Array:
        """What the last rank has, on every rank."""
        return np.array(self._comm.bcast(np.array(values), self._comm.size - 1))

    def put(self, x: PETSc.Vec) -> None:
        """The present unknowns into x."""
        if self.extra is None:
            fempetsc.assign(self.y, x)
        else:
            x.array_w[: self.owned] = self.y.x.array[: self.owned]
            x.array_w[self.owned :] = self.extra.values[: self.here]

    def add_up(self, impulses: float = 1.0, terms: Sequence[Term] | None = None) -> PETSc.Vec:
        """The forces of all or some terms at q, of impulsive ones times `impulses`, in `force`."""
        terms = self._terms if terms is None else terms
        with self.of_q.localForm() as local:
            local.set(0.0)
            add_forces(terms, local.array_w, impulses)
        self.of_q.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        if self.extra is not None:
            size, every = self.of_q.local_size, extra_force(terms, self.count, impulses)
            self.force.array_w[:size], self.force.array_w[size:] = self.of_q.array_r, every[: self.here]
        return self.force

    def carry(self, x: PETSc.Vec, given: np.ndarray, targets: Array) -> None:
        """Take the sheet, in x and q, along with what leads the terms, and the given unknowns to their targets."""
        some = [term for term in self._terms if type(term).carry is not Term.carry]
        if not some:
            return
        mask, gap = self.vector(), self.vector()
        mask.array_w[given], gap.array_w[given] = 1.0, targets[given] - x.array_r[given]
        change = np.where(self.change(mask) != 0.0, self.change(gap), np.nan)
        for way in [carried for term in some if (carried := term.carry(change)) is not None]:
            x.array_w[: self.owned] += (way if self._space is None else self._space.rate(way))[: self.owned]
            self.take(x)

    def residual(self, b: PETSc.Vec, impulses: float = 1.0) -> None:
        """The forces of all terms, in `force` as `add_up` leaves them, and at what is solved for, in b."""
        self.add_up(impulses)
        if self.turn is None:
            self.force.copy(b)
        else:
            self.turn.multTranspose(self.force, b)

    def longest_step(self, change: PETSc.Vec) -> float:
        """The part of a change of the unknowns that all terms allow, up to 1."""
        some = limited(self._terms)
        return free_part(some, self.change(change), self._comm) if some else 1.0

    def change(self, change: PETSc.Vec) -> Array:
        """That of q (local array) to first order."""
        moved = fem.Function(self._q.function_space)
        if self.extra is not None:
            self.extra.change = self._told(change.array_r[self.owned :])
            of_sheet = fempetsc.create_vector(self.y.function_space)
            of_sheet.array_w[:] = change.array_r[: self.owned]
            change = of_sheet
        if self.of_sheet is None:
            change.copy(moved.x.petsc_vec)
        else:
            self.of_sheet.mult(change, moved.x.petsc_vec)
        moved.x.scatter_forward()
        return np.asarray(moved.x.array)


def add_forces(terms: Iterable[Term], total: Array, impulses: float = 1.0) -> None:
    """Add the forces (N) of some terms to a local array, those of impulsive ones times `impulses`."""
    late = []
    for term in terms:
        if term.impulsive:
            late.append(term)
        else:
            term.add_force(total)
    if late and impulses != 0.0:
        force = np.zeros_like(total)
        for term in late:
            term.add_force(force)
        total += impulses * force
