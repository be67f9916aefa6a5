"""Stiffness of a shell by batches of cells: no kernel to compile, and a third of the time of FFCx's.

The strains of a shell are quadratic in the unknowns q = (u, d) of a cell, and do not change when it turns:

    E_a = E0_a + B0_a . q + q_ik S_a,ij q_jk / 2,    i, j nodes, k the components in space.

B0 and S belong to the cell alone. They are found once, from the strain in UFL; then B = B0 + S q are the
derivatives of the strains, and with the tangent C and the stress N of the law at the points of a rule with weights w

    K_ik,jl = sum over points of  w (B_a,ik C_ab B_b,jl + N_a S_a,ij delta_kl).
"""

from collections.abc import Sequence

import basix
import numba
import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.form import Form

from . import weakform
from .directors import ShellSpace
from .errors import InputError
from .hook import LawHook
from .laws import Array


class InternalWork:
    """Internal work of a shell at one strain: `form`, its virtual work, and `stiffness`, in batches.

    space, q: the shell and its (u, d). strain: UFL vector, quadratic in q, as of `assumed_strain`. stress: a LawHook
    of this strain, or a UFL matrix in N/m, the stiffness of a linear law, which stays as it is. dx: measure of the
    strain. Give it to `StaticSolver` as one of `works`.

    It keeps 16 kB a cell. Raises InputError, on every rank, for a strain that is not quadratic.
    """

    def __init__(
        self, space: ShellSpace, q: fem.Function, strain: Expr, stress: LawHook | Expr, dx: ufl.Measure
    ) -> None:
        self.q, self.hook = q, stress if isinstance(stress, LawHook) else None
        self._mesh = domain = space.mesh
        self._cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
        rule = basix.make_quadrature(domain.basix_cell(), dx.metadata()["quadrature_degree"])
        self._points, weights = (np.asarray(part) for part in rule)
        self._dofs = space.V.dofmap.list[self._cells]
        test = ufl.TestFunction(space.V)
        if isinstance(stress, LawHook):
            force = stress.stress
        else:
            force = ufl.dot(stress, strain)
            self._stress = fem.Expression(force, self._points)
            m = strain.ufl_shape[0]
            self._tangent = self._at_points(stress).reshape(len(self._cells), len(self._points), m, m)
        self.form: Form = weakform.internal(force, strain, q, test, 1.0, dx)
        self._weights = self._at_points(ufl.JacobianDeterminant(domain)).reshape(-1, len(self._points)) * weights
        self._quadratic(strain, ufl.TrialFunction(space.V))
        width = self._dofs.shape[1]
        self._matrices = np.empty((len(self._cells), width, width))

    def _at_points(self, expression: Expr) -> Array:
        return fem.Expression(expression, self._points).eval(self._mesh, self._cells)

    def _quadratic(self, strain: Expr, trial: Expr) -> None:
        """Find B0 (cells, points, strains, nodes, 3) and S (cells, points, strains, nodes, nodes)."""
        derivative = fem.Expression(expand_derivatives(ufl.derivative(strain, self.q, trial)), self._points)
        kept, cells, n = self.q.x.array.copy(), len(self._cells), self._dofs.shape[1] // 3
        probes, changes = [], []
        self.q.x.array[:] = 0.0
        start = derivative.eval(self._mesh, self._cells)
        # each probe tells three columns of S, one for every component in space; some more make it well posed
        for seed in range(n // 3 + 2):
            self.q.x.array[:] = np.random.default_rng(seed).uniform(-1, 1, len(kept))
            probes.append(self.q.x.array[self._dofs].reshape(cells, 1, n, 3))
            changes.append((derivative.eval(self._mesh, self._cells) - start).reshape(cells, -1, n, 3))
        self.q.x.array[:] = kept
        probe, change = np.concatenate(probes, axis=3), np.concatenate(changes, axis=3)
        S = change @ np.linalg.pinv(probe)
        misfit = np.abs(S @ probe - change).max(initial=0.0) > 1e-8 * np.abs(change).max(initial=0.0)
        if self._mesh.comm.allreduce(bool(misfit)):
            raise InputError("A strain is not quadratic in displacement and director, or changes with a rotation.")
        # exact zeros: a thin sheet would feel a membrane strain of round-off when it bends
        S = S.reshape(cells, -1, n, n)
        S[np.abs(S) < 1e-11 * np.abs(S).max(axis=(2, 3), keepdims=True, initial=0.0)] = 0.0
        shape = (*start.shape[:3], n)
        self._S, self._B0 = S.reshape(*shape, n), start.reshape(*shape, 3)

    def stiffness(self) -> Array:
        """Matrices (cells, n, n) of the owned cells at the last evaluation of the law."""
        nodes = self.q.x.array[self._dofs].reshape(len(self._cells), -1, 3)
        if self.hook is None:
            tangent, stress = self._tangent, self._stress.eval(self._mesh, self._cells)
        else:
            tangent, stress = (values[: len(self._cells)] for values in (self.hook.tangent, self.hook.resultants))
        _stiffness(self._S, self._B0, nodes, tangent, stress.reshape(tangent.shape[:3]), self._weights, self._matrices)
        return self._matrices

    def places(self) -> tuple[Array, Array]:
        """Global rows and columns of the entries of `stiffness`, flat."""
        dofs = self.q.function_space.dofmap.index_map.local_to_global(self._dofs.ravel())
        dofs, width = dofs.reshape(self._dofs.shape), self._dofs.shape[1]
        return np.repeat(dofs, width, axis=1).ravel(), np.tile(dofs, (1, width)).ravel()


def matrix(works: Sequence[InternalWork]) -> PETSc.Mat:
    """An empty matrix in the space of (u, d), to be filled by `setValuesCOO` with what `stiffness` of each gives."""
    space = works[0].q.function_space
    index_map, result = space.dofmap.index_map, PETSc.Mat().create(space.mesh.comm)
    result.setSizes([[index_map.size_local, index_map.size_global]] * 2)
    result.setType(PETSc.Mat.Type.AIJ)
    everywhere = index_map.local_to_global(np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32))
    result.setLGMap(PETSc.LGMap().create(everywhere.astype(PETSc.IntType), comm=space.mesh.comm))
    rows, columns = (np.concatenate(parts) for parts in zip(*(work.places() for work in works), strict=True))
    result.setPreallocationCOO(rows.astype(PETSc.IntType), columns.astype(PETSc.IntType))
    return result


def factorise_by_diagonal(ksp: PETSc.KSP, A: PETSc.Mat) -> None:
    """Tell MUMPS that a stiffness has a diagonal: it need look for no other, and scale by it.

    It saves a tenth to a fifth of the time, and so does an ordering by least fill (AMF) for small sheets; for large
    ones MUMPS's own choice is better. Other solvers stay as they are.
    """
    pc = ksp.getPC()
    if pc.getType() == "lu" and pc.getFactorSolverType() == "mumps":
        ksp.setOperators(A)
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setMumpsIcntl(6, 0)
        pc.getFactorMatrix().setMumpsIcntl(8, 1)
        if A.size[0] < 20000:
            pc.getFactorMatrix().setMumpsIcntl(7, 2)


@numba.njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _stiffness(S, B0, nodes, tangent, stress, weights, out):
    """K of each cell, see the head of the module."""
    cells, points, m, n, _ = S.shape
    B, CB, G = np.empty((m, 3 * n)), np.empty((m, 3 * n)), np.empty((n, n))
    for c in range(cells):
        K = out[c]
        K[:] = 0.0
        G[:] = 0.0
        for p in range(points):
            w = weights[c, p]
            for a in range(m):
                N = w * stress[c, p, a]
                for i in range(n):
                    x, y, z = B0[c, p, a, i, 0], B0[c, p, a, i, 1], B0[c, p, a, i, 2]
                    for j in range(n):
                        s = S[c, p, a, i, j]
                        x += s * nodes[c, j, 0]
                        y += s * nodes[c, j, 1]
                        z += s * nodes[c, j, 2]
                        G[i, j] += N * s
                    B[a, 3 * i], B[a, 3 * i + 1], B[a, 3 * i + 2] = x, y, z
            for a in range(m):
                CB[a] = 0.0
                for b in range(m):
                    C = w * tangent[c, p, a, b]
                    for j in range(3 * n):
                        CB[a, j] += C * B[b, j]
            for i in range(3 * n):
                for a in range(m):
                    t = B[a, i]
                    for j in range(3 * n):
                        K[i, j] += t * CB[a, j]
        for i in range(n):
            for j in range(n):
                for k in range(3):
                    K[3 * i + k, 3 * j + k] += G[i, j]
