"""Internal work of a shell by batches of cells: strains, forces and stiffness with no kernel to compile.

The strains of a shell do not change when it turns or moves as a whole, and are quadratic in the places of the nodes
and in the directors of a cell. So they are sums over pairs of vectors x_i, the places of the nodes as seen from the
first one, and the directors:

    E_a = sum over pairs (i, j) of  M_a,ij (x_i . x_j - r_i . r_j),    r being x at rest.

M belongs to the cell alone. It is found once, from the strain in UFL. With the stress N and the tangent C of the law at
the points of a rule with weights w, forces f and stiffness K are

    f_i  = sum_j (W_ij + W_ji) x_j,  W_ij = sum over points of  w N_a M_a,ij,
    K_ik,jl = sum over points of  w B_a,ik C_ab B_b,jl + (W_ij + W_ji) delta_kl,  B_a,i = sum_j (M_a,ij + M_a,ji) x_j,

k, l being the components in space.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.form import Form

from ..errors import InputError
from ..laws import Array
from ..shell.directors import ShellSpace
from . import kernels, weakform
from .hook import LawHook
from .kernels import LANES

CHUNK = 1000  # cells


class InternalWork:
    """Internal work of a shell at one strain, by batches of cells; `form` is the same in UFL.

    space, q: the shell and its (u, d). strain: UFL vector, quadratic in q and zero at rest, as of `assumed_strain`.
    stress: a LawHook of this strain, which it then measures, or a UFL matrix in N/m, the stiffness of a linear law,
    which stays as it is. dx: measure of the strain. Give it to a solver as one of `works`.

    It keeps 3 kB a cell. Raises InputError, on every rank, for a strain that is not quadratic.
    """

    def __init__(
        self, space: ShellSpace, q: fem.Function, strain: Expr, stress: LawHook | Expr, dx: ufl.Measure
    ) -> None:
        self.q, self.hook = q, stress if isinstance(stress, LawHook) else None
        self._space, self._strain, self._law, self._dx = space, strain, stress, dx
        self._mesh = domain = space.mesh
        cells = domain.topology.index_map(2)
        self._cells, self._owned = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32), cells.size_local
        rule = basix.make_quadrature(domain.basix_cell(), dx.metadata()["quadrature_degree"])
        self._points, weights = (np.asarray(part) for part in rule)
        self._dofs = space.V.dofmap.list
        self._directors = space.normal.function_space.dofmap.list
        self._start = self._places()
        self._batch = *self._quadratic(), self._start, space.normal.x.array, self._directors, q.x.array, self._dofs
        self._weights = self._at_points(ufl.JacobianDeterminant(domain)).reshape(-1, len(self._points)) * weights
        self._strains = np.empty((len(self._cells), len(self._points), strain.ufl_shape[0]))
        if isinstance(stress, LawHook):
            stress.measure = self.measure
        else:
            self._tangent = self._at_points(stress).reshape(*self._strains.shape, self._strains.shape[-1])

    @cached_property
    def form(self) -> Form:
        """Virtual work of the stress, in UFL."""
        hook = self.hook
        force = ufl.dot(self._law, self._strain) if hook is None else hook.stress
        return weakform.internal(force, self._strain, self.q, ufl.TestFunction(self._space.V), 1.0, self._dx)

    def _at_points(self, expression: Expr) -> Array:
        return fem.Expression(expression, self._points).eval(self._mesh, self._cells)

    def _places(self) -> Array:
        """Reference places of the other nodes of each cell, as seen from the first one: (cells, nodes - 1, 3)."""
        space, dofs = self._space.V.sub(0).collapse()
        x = np.empty((len(self.q.x.array), 3))
        x[np.array(dofs).reshape(-1, 3)[:, 0]] = space.tabulate_dof_coordinates()
        nodes = self._dofs[:, : self._dofs.shape[1] - 3 * self._directors.shape[1] : 3]
        return np.ascontiguousarray(x[nodes[:, 1:]] - x[nodes[:, :1]])

    def _quadratic(self) -> tuple[Any, Any, Any]:
        """M (blocks, points, terms, LANES), of each strain the first and last pair that it has, and the pairs."""
        trial = ufl.TrialFunction(self._space.V)
        derivative = fem.Expression(expand_derivatives(ufl.derivative(self._strain, self.q, trial)), self._points)
        kept, cells, nodes = self.q.x.array.copy(), len(self._cells), self._start.shape[1]
        n = nodes + self._directors.shape[1]
        # each probe tells three columns, one for every component in space; some more make it well posed
        states = [np.random.default_rng(seed).uniform(-1, 1, len(kept)) for seed in range(n // 3 + 2)]
        # pairs of nodes, of a node and a director, and of directors; those that no strain has are left out
        pairs = [(i, j) for i in range(n) for j in range(i, n)]
        pairs.sort(key=lambda pair: (pair[0] >= nodes) + (pair[1] >= nodes))
        i, j = np.array(pairs, dtype=np.int64).T
        pieces, misfit, shape = [], False, (len(self._points) * self._strain.ufl_shape[0], n + 1, 3)
        # so many cells at a time that their probes take little memory
        for part in np.split(np.arange(cells), range(CHUNK, cells, CHUNK)):
            probes, changes = [], []
            for state in states:
                self.q.x.array[:] = state
                q = state[self._dofs[part]].reshape(len(part), 1, n + 1, 3)
                change = derivative.eval(self._mesh, self._cells[part]).reshape(len(part), *shape)
                probes.append(q[:, :, 1:] - np.where(np.arange(n)[:, None] < nodes, q[:, :, :1], 0.0))
                probes[-1][:, 0, :nodes] += self._start[part]
                changes.append(change[:, :, 1:])
            probe, change = np.concatenate(probes, axis=3), np.concatenate(changes, axis=3)
            inverse = np.linalg.pinv(probe)
            S = change @ inverse
            S += (change - S @ probe) @ inverse
            misfit |= bool(np.abs(S @ probe - change).max(initial=0.0) > 1e-8 * np.abs(change).max(initial=0.0))
            # exact zeros: a thin sheet would feel a membrane strain of round-off when it bends
            S[np.abs(S) < 1e-11 * np.abs(S).max(axis=(2, 3), keepdims=True, initial=0.0)] = 0.0
            pieces.append(np.where(i == j, 0.5, 1.0) * (S[..., i, j] + S[..., j, i]) / 2)
        self.q.x.array[:] = kept
        if self._mesh.comm.allreduce(misfit):
            raise InputError("A strain is not quadratic in displacement and director, or changes with a rotation.")
        M = np.concatenate(pieces).reshape(cells, len(self._points), self._strain.ufl_shape[0], len(pairs))
        spans = []
        for there in M.any(axis=(0, 1)):
            found = np.flatnonzero(there)
            spans.append((found[0], found[-1] + 1) if len(found) else (0, 0))
        M = np.concatenate([M[:, :, a, first:last] for a, (first, last) in enumerate(spans)], axis=2)
        low, high = min(first for first, _ in spans), max(last for _, last in spans)
        # cells by `LANES`, side by side: what processors are good at
        count = -(-cells // LANES)
        blocks = np.zeros((count * LANES, *M.shape[1:]))
        blocks[:cells] = M
        blocks = np.moveaxis(blocks.reshape(count, LANES, *M.shape[1:]), 1, 3).copy()
        return blocks, np.array(spans) - low, np.array(pairs[low:high], dtype=np.int64).reshape(-1, 2)

    def measure(self, out: Array) -> None:
        """Strains (cells, points, strains) of all local cells at the present q."""
        kernels.strains(self._batch, out)

    def _stress(self) -> Array:
        """Of the last evaluation of the law; (cells, points, strains)."""
        if self.hook is not None:
            return self.hook.resultants
        self.measure(self._strains)
        return np.einsum("cpab,cpb->cpa", self._tangent, self._strains)

    def add_force(self, total: Array) -> None:
        """Add the internal forces (N) of the owned cells to a local array of V, at the last evaluation of the law."""
        kernels.forces(self._batch, self._stress(), self._weights[: self._owned], total)

    def add_stiffness(self, total: Array) -> None:
        """Add the matrices of the owned cells, at the last evaluation of the law, to (cells, n, n)."""
        tangent = self._tangent if self.hook is None else self.hook.tangent
        kernels.stiffness(self._batch, tangent, self._stress(), self._weights[: self._owned], total)

    @cached_property
    def matrices(self) -> Array:
        """Room for the stiffness of the owned cells, (cells, n, n)."""
        return np.empty((self._owned, self._dofs.shape[1], self._dofs.shape[1]))

    def places(self) -> tuple[Array, Array]:
        """Global rows and columns of the entries of `matrices`, flat."""
        local = self._dofs[: self._owned]
        dofs = self.q.function_space.dofmap.index_map.local_to_global(local.ravel()).reshape(local.shape)
        return np.repeat(dofs, dofs.shape[1], axis=1).ravel(), np.tile(dofs, (1, dofs.shape[1])).ravel()


def matrix(works: Sequence[InternalWork]) -> PETSc.Mat:
    """An empty matrix in the space of (u, d), for `assemble`."""
    space = works[0].q.function_space
    index_map, result = space.dofmap.index_map, PETSc.Mat().create(space.mesh.comm)
    result.setSizes([[index_map.size_local, index_map.size_global]] * 2)
    result.setType(PETSc.Mat.Type.AIJ)
    everywhere = index_map.local_to_global(np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32))
    result.setLGMap(PETSc.LGMap().create(everywhere.astype(PETSc.IntType), comm=space.mesh.comm))
    rows, columns = works[0].places()
    result.setPreallocationCOO(rows.astype(PETSc.IntType), columns.astype(PETSc.IntType))
    return result


def assemble(K: PETSc.Mat, works: Sequence[InternalWork]) -> None:
    """Put the stiffness of works of one shell into its `matrix`."""
    total = works[0].matrices
    total[:] = 0.0
    for work in works:
        work.add_stiffness(total)
    K.setValuesCOO(total.ravel())
