"""Factors of K + sigma M that are positive definite, and the lowest mode of K: what the pivots of LDL' tell.

By Sylvester's law of inertia as many pivots are negative as eigenvalues. M is 1 for displacements and a quarter of the
mean area of a cell for angles, so that the unit of length does not matter; it is 0 at given unknowns.
"""

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from petsc4py import PETSc

from ..surfaces import placing
from .redundant import own

LEAST, MOST, GROWTH, DECAY = 1e-9, 1e3, 8.0, 16.0  # of shifts: the first and last one, as parts of the largest diagonal

ROOM, CRAMPED, WIDEST = "mat_mumps_icntl_14", (-8, -9), 1000  # percent more than MUMPS guesses that it needs


class Pivots:
    """LDL' by MUMPS of the matrices that are given to a KSP.

    Public: `area`, mean one of a cell, m2; `shift`, sigma of the last factors (N/m).

    Args:
        y: the unknown; of a shell, (u, angles).
        x: a vector of it.
        displacements, given: owned unknowns.
    """

    def __init__(self, y: fem.Function, x: PETSc.Vec, displacements: np.ndarray, given: np.ndarray) -> None:
        mesh = y.function_space.mesh
        cells = mesh.topology.index_map(mesh.topology.dim).size_global
        area = mesh.comm.allreduce(fem.assemble_scalar(fem.form(fem.Constant(mesh, 1.0) * ufl.dx(mesh))))
        self.area = float(area) / cells
        self._metric, self._start, self._given = x.duplicate(), uneven(y, x), given
        self._metric.set(self.area / 4.0)
        self._metric.array_w[displacements] = 1.0
        for v in (self._metric, self._start):
            v.array_w[given] = 0.0
        self.shift = self._kept = 0.0

    def count(self, ksp: PETSc.KSP, A: PETSc.Mat) -> tuple[int, int]:
        """Factorise; numbers of negative and of null pivots, (-1, -1) if it cannot be done."""
        store = PETSc.Options(ksp.getOptionsPrefix())
        before = room = store.getInt(ROOM, 20)
        fault, negative, null = self._factors(ksp, A)
        while fault in CRAMPED and room < WIDEST:  # of a singular matrix, too, which no room helps
            room = store[ROOM] = 3 * room
            fault, negative, null = self._factors(ksp, A)
        if fault < 0:
            store[ROOM] = before
            return -1, -1
        return negative, null

    def _factors(self, ksp: PETSc.KSP, A: PETSc.Mat) -> tuple[int, int, int]:
        """MUMPS's error, 0 if there is none, and numbers of negative and of null pivots."""
        ksp.setOperators(A)
        ksp.setUp()
        factors = own(ksp).getPC().getFactorMatrix()
        fault, negative, null = (factors.getMumpsInfog(k) for k in (1, 12, 28))
        factors.destroy()  # one hold on them, that of Python, which on several ranks lets nothing go by itself
        if fault < 0:
            ksp.getPC().reset()  # PETSc never factorises again with what has failed once
        return fault, negative, null

    def factorise(self, ksp: PETSc.KSP, A: PETSc.Mat) -> None:
        """Shift A, by no more than it takes, until its factors are positive definite."""
        diagonal = A.getDiagonal()
        largest = diagonal.norm(PETSc.NormType.NORM_INFINITY)
        self.shift = 0.0
        while self.count(ksp, A) != (0, 0) and self.shift < MOST * largest:
            self.shift = GROWTH * self.shift if self.shift else max(self._kept, LEAST * largest)
            A.setDiagonal(diagonal + self.shift * self._metric)
        self._kept = self.shift / DECAY

    def lowest(self, ksp: PETSc.KSP) -> tuple[float, PETSc.Vec]:
        """Lowest eigenvalue of K v = lambda M v (N/m) and its mode, by inverse iteration with the last factors."""
        v, w, known = self._start.copy(), self._start.duplicate(), np.inf
        for _ in range(100):
            v.scale(1.0 / np.sqrt(v.dot(v * self._metric)))
            ksp.solve(v * self._metric, w)
            w.array_w[self._given] = 0.0
            value = 1.0 / v.dot(w * self._metric) - self.shift
            w.copy(v)
            if abs(value - known) <= 1e-3 * abs(value):
                break
            known = value
        return float(value), v


def uneven(y: fem.Function, x: PETSc.Vec) -> PETSc.Vec:
    """Displacements without symmetry, the same on any number of ranks: a function of the place."""
    field = fem.Function(V := y.function_space)
    if V.num_sub_spaces and V.dofmap.bs == 1:  # (u, angles)
        space, dofs = V.sub(0).collapse()
    else:
        space, dofs = V, np.arange(len(field.x.array))
    span = V.mesh.comm.allreduce(np.abs(V.mesh.geometry.x).max(initial=0.0), MPI.MAX)
    phase = placing.places(space) @ np.array([1.7, 2.3, 2.9]) / span
    values = np.stack([np.cos((1.0 + 0.3 * k) * phase + k) + 0.2 for k in range(space.dofmap.index_map_bs)], axis=1)
    field.x.array[np.array(dofs)] = values.ravel()
    v = x.duplicate()
    v.array_w[:] = field.x.array[: v.local_size]
    return v
