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
from ufl.core.expr import Expr
from ufl.form import Form

from ..laws import Array, Law, Stiffest
from ..shell.directors import ShellSpace
from . import kernels, pairing, weakform
from .hook import LawHook
from .points import LawPoints
from .term import Indices, Term

type Part = tuple[Expr, Law | Expr, ufl.Measure]
"""A strain, the law or the stiffness that answers it, and the measure of both."""


class InternalWork(Term):
    """Internal work of a shell on some of its cells, without a form; `form` is the same in UFL.

    It keeps 3 kB a cell. Raises InputError, on every rank, for a strain that is not quadratic, and for a stiffness that
    is not symmetric or may be negative.

    Public: `parts`; `points`, the `LawPoints` of those that have a law.

    Args:
        space, q: the shell and its (u, d).
        parts: strain, response and measure of each part of the work. The strain is a UFL vector, quadratic in q and
            zero at rest, as of `assumed_strain`; the response a law of this strain, whose stress are resultants, or a
            UFL matrix in N/m and so on, the stiffness of a linear law, which stays as it is.
        cells: local cells that do this work, ascending; by default all.
    """

    def __init__(
        self, space: ShellSpace, q: fem.Function, parts: Sequence[Part], *, cells: np.ndarray | None = None
    ) -> None:
        self.q, self.parts = q, tuple(parts)
        every = space.mesh.topology.index_map(2)
        if cells is None:
            cells = np.arange(every.size_local + every.num_ghosts, dtype=np.int32)
        self._cells, self._space, self._whole = cells, space, len(cells) == every.size_local + every.num_ghosts
        self._owned = int(np.searchsorted(cells, every.size_local))
        self._dofs = space.V.dofmap.list[cells]
        self._directors = space.normal.function_space.dofmap.list.shape[1]
        shell = pairing.Cells(space, q, cells, self._dofs, space.normal.function_space.dofmap.list[cells])
        self._parts = [_Part(shell, self._owned, *part) for part in parts]
        self.points = [part.points for part in self._parts if part.points is not None]
        self.symmetric = all(part.symmetric for part in self._parts)
        self.has_kinks = bool(self.points)

    def relax(self, part: float) -> None:
        """Let the sheet be at rest where it starts (0), as the mesh lies (1, as it is at first), or between, by strain.

        From where it starts strains are measured in part: E - (1 - part) E(start).
        """
        for own in self._parts:
            own.relax(part)

    def supplied(self) -> float:
        """See `Term.supplied`: by what relaxes it."""
        return sum(part.supplied() for part in self._parts)

    @cached_property
    def form(self) -> Form:
        """Virtual work of the stress, in UFL, not relaxed, of directors of length 1; a law has a hook of its own."""
        result, test, mesh = Form([]), ufl.TestFunction(self._space.V), self._space.mesh
        own = [(k, self._cells[: self._owned]) for k in range(len(self.parts))]  # a kernel each: see `ShellSpace`
        for k, (strain, response, rule) in enumerate(self.parts):
            dx = rule if self._whole else rule(subdomain_data=own, subdomain_id=k)
            if isinstance(response, Expr):
                stress = ufl.dot(response, strain)
            else:
                degree = dx.metadata()["quadrature_degree"]
                stress = LawHook(response, strain, mesh, degree, cells=self._cells, dx=dx).stress
            result += weakform.internal(stress, strain, self.q, test, 1.0, dx)
        return result

    def evaluate(self, tangent: bool = True, stiffest: Stiffest = False) -> bool:
        """See `Term.evaluate`."""
        return all([part.evaluate(tangent, stiffest) for part in self._parts])

    def hardening(self) -> float | None:
        """See `Term.hardening`."""
        return max((points.risen for points in self.points if points.hardens), default=None)

    def foresee(self, change: Array) -> None:
        """See `Term.foresee`."""
        for part in self._parts:
            part.foresee(change)

    def linearise(self, reach: float) -> None:
        """See `Term.linearise`."""
        for part in self._parts:
            part.linearise(reach)

    def add_force(self, total: Array) -> None:
        """See `Term.add_force`."""
        for part in self._parts:
            kernels.forces(part.batch, part.stress, part.weights, total)

    def pattern(self) -> tuple[Indices, Indices]:
        """See `Term.pattern`."""
        return pairing.every(self._space.V, self._cells[: self._owned])

    def add_stiffness(self, values: Array) -> None:
        """See `Term.add_stiffness`."""
        for part in self._parts:
            kernels.stiffness(*part.response(), None, values.reshape(self._owned, *[self._dofs.shape[1]] * 2))

    def turned_pattern(self) -> tuple[Indices, Indices]:
        """See `Term.turned_pattern`."""
        self._nodes = np.searchsorted(self._space.nodes[:, 0], self._dofs[:, -3 * self._directors :: 3])
        return pairing.every(self._space.W, self._cells[: self._owned])

    def add_turned(self, values: Array) -> None:
        """See `Term.add_turned`."""
        size, turn = self._dofs.shape[1] - self._directors, (self._nodes, self._space.slopes)
        for part in self._parts:
            kernels.stiffness(*part.response(), turn, values.reshape(self._owned, size, size))

    def energy(self) -> float | None:
        """See `Term.energy`."""
        return sum(part.energy() for part in self._parts)

    def potential(self) -> float | None:
        """See `Term.potential`."""
        parts = [part.energy() if part.points is None else part.points.potential() for part in self._parts]
        return None if None in parts else sum(parts)  # type: ignore[arg-type]

    def dissipated(self) -> float:
        """See `Term.dissipated`."""
        return sum(points.dissipated() for points in self.points)

    def watch(self) -> None:
        """See `Term.watch`."""
        for part in self._parts:
            part.watch()

    def commit(self) -> None:
        """See `Term.commit`."""
        for points in self.points:
            points.commit()

    def renew(self) -> None:
        """See `Term.renew`."""
        for part in self._parts:
            kept = None if part.points is None else part.stress.copy()  # came from the checkpoint
            part.evaluate(True, False)
            part.stress[:] = part.stress if kept is None else kept

    def fields(self) -> list[tuple[str, np.ndarray, Array]]:
        """See `Term.fields`."""
        return [field for points in self.points for field in points.fields()]

    def worst(self) -> tuple[float, str]:
        """See `Term.worst`."""
        return max((points.worst() for points in self.points), default=(0.0, ""))


class _Part:
    """One strain of the work, on its rule, or of a linear law the numbers of `pairing.squares`.

    Public: `batch` and `weights` for `kernels`; `stress`, `tangent`.
    """

    def __init__(self, shell: pairing.Cells, owned: int, strain: Expr, response: Law | Expr, dx: ufl.Measure) -> None:
        mesh, self._cells = shell.space.mesh, shell.cells
        rule = basix.make_quadrature(mesh.basix_cell(), dx.metadata()["quadrature_degree"])
        points, weights = (np.asarray(part) for part in rule)

        def at_points(expression: Expr) -> Array:
            return fem.Expression(expression, points).eval(mesh, shell.cells)

        q, normal = shell.q.x.array, shell.space.normal.x.array
        area = at_points(ufl.JacobianDeterminant(mesh)).reshape(len(shell.cells), len(points))
        M, pairs = pairing.quadratic(shell, strain, points)
        self.weights = (area * weights)[:owned]
        self.points: LawPoints | None = None
        if isinstance(response, Expr):
            C = at_points(response).reshape(*M.shape[:3], M.shape[2])
            M = pairing.squares(mesh.comm, M, C * (area * weights)[:, :, None, None])
            self.weights, self.symmetric = np.ones((owned, 1)), True
            self._strain, self._stress = np.zeros((2, *M.shape[:3]))
            self._tangent = np.empty((0, 1, M.shape[2], M.shape[2]))  # the identity
        else:
            self.points = LawPoints(response, mesh, shell.cells, M.shape[1:3], weights=lambda: self.weights)
            self.symmetric = response.symmetric
        self.batch = *pairing.packed(M, pairs), shell.rest, shell.start, normal, shell.directors, q, shell.dofs
        self._shell, self._shape, self._left = shell, M.shape[:3], 0.0
        self._of_start: Any = None  # strains at the start, of a sheet that is relaxed
        self._foreseen: Any = None  # strains
        self._about: Any = None  # stress there
        self._watched: tuple[float, Array] | None = None

    def measure(self, out: Array) -> None:
        """Strains (cells, points, strains) of all cells at the present q."""
        kernels.strains(self.batch, out)
        if self._left != 0.0:
            out -= self._left * self._of_start

    def response(self) -> tuple[Any, Array, Array, Array]:
        return self.batch, self.tangent, self.stress, self.weights

    def relax(self, part: float) -> None:
        if self._of_start is None:
            q = self._shell.q.x.array
            now = q.copy()
            q[:] = self._shell.space.function().x.array
            self._of_start = np.zeros(self._shape)
            kernels.strains(self.batch, self._of_start)
            q[:] = now
        self._left = 1.0 - part

    def watch(self) -> None:
        if self.points is not None:
            self.points.watch()
        if self._of_start is not None:
            self._watched = self._left, self.stress[: len(self.weights)].copy()

    def supplied(self) -> float:
        if self._watched is None or self._watched[0] == self._left:
            return 0.0
        (left, before), n = self._watched, len(self.weights)
        mean = 0.5 * (before + self.stress[:n])
        return (left - self._left) * float(np.einsum("cp,cpa,cpa", self.weights, mean, self._of_start[:n]))

    def evaluate(self, tangent: bool, stiffest: Stiffest) -> bool:
        self.measure(self.strain)
        if self.points is not None:
            return self.points.evaluate(tangent, stiffest)
        self._stress[:] = self._strain
        return True

    def foresee(self, change: Array) -> None:
        q, (on, back) = self._shell.q.x.array, np.empty((2, *self._shape))
        here = q.copy()
        for out, sign in ((on, 1.0), (back, -1.0)):
            q[:] = here + sign * change
            self.measure(out)
        q[:] = here
        self._foreseen, self._about = self.strain + 0.5 * (on - back), None  # exact, as strains are quadratic

    def linearise(self, reach: float) -> None:
        if self._about is None:
            if self.points is None:
                self._stress[:] = self._foreseen
            else:
                self.points.linearise(self._foreseen)
            self._about = self.stress.copy()
        way = reach * (self.strain - self._foreseen)
        if self.points is None:
            np.add(self._about, way, out=self.stress)
            return
        np.einsum("cpab,cpb->cpa", self.tangent, way, out=self.stress)
        self.stress[:] += self._about

    @property
    def strain(self) -> Array:
        return self._strain if self.points is None else self.points.strain

    @property
    def stress(self) -> Array:
        return self._stress if self.points is None else self.points.stress

    @property
    def tangent(self) -> Array:
        return self._tangent if self.points is None else self.points.tangent  # type: ignore[return-value]

    def energy(self) -> float:
        if self.points is not None:
            return self.points.energy()
        n = len(self.weights)
        return 0.5 * float(np.einsum("cp,cpa,cpa", self.weights, self._strain[:n], self._stress[:n]))
