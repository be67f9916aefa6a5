"""Newton's method by PETSc SNES for one load step; `march` and `continuation` go through many."""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from dolfinx import fem
from petsc4py import PETSc

from ..errors import InputError, StepFailed
from ..shell.directors import ShellSpace
from ..shell.dirichlet import check, put
from ..terms.form import Rate, terms_of
from ..terms.hook import forget_traversals
from ..terms.term import Residual, Term
from . import linear
from .continuation import Step as Step
from .failures import REASONS, SINGULAR, blame, failed, solve
from .leading import HELD, balanced, leads
from .linear import weak
from .marching import march as march
from .reactions import Reactions
from .tangent import Tangent
from .unknowns import Unknowns

OPTIONS: linear.Options = {"snes_linesearch_type": "basic", "snes_max_it": 25} | linear.NULL_PIVOTS
"""PETSc options of `StaticSolver` that a user may override; those of linear systems: see `linear.configure`."""


class StaticSolver(Reactions):
    """Equilibrium residual(u) = 0 at the present loads and Dirichlet values.

    Public: `terms`, and the matrix of their stiffness, `tangent`; the SNES itself, `snes`; `symmetric`, whether all
    terms are, and so the linear systems.

    Args:
        residual: UFL form, a sum of the terms of `weakform`, linear in a test function; or a `terms.term.Term`, such as
            `InternalWork`; or a list of both.
        u: the unknown, in m; for a shell, (u, d) of `space`.
        bcs: Dirichlet conditions on the space of u, whose values may change between solves.
        rtol: a step is solved when the residual at the free unknowns is below rtol times the largest nodal force or
            support force so far, or the last correction below 1e-9 of the displacement or 1e-14 of the sheet's size.
        options: PETSc options, over `OPTIONS`; for very large sheets `linear.ITERATIVE`, for LU `linear.DIRECT`.
        space: of a shell, whose directors the solver turns.
    """

    def __init__(
        self,
        residual: Residual,
        u: fem.Function,
        bcs: Sequence[fem.DirichletBC],
        *,
        rtol: float = 1e-6,
        options: dict[str, object] | None = None,
        space: ShellSpace | None = None,
    ) -> None:
        if not 0.0 < rtol < 1.0:
            raise InputError(f"A relative tolerance of {rtol!r} is not between 0 and 1.")
        self.u, self.rtol, self._shell, self._bcs = u, rtol, space, list(bcs)
        self.terms: list[Term] = terms_of(residual, u, self.rate)
        self.comm = u.function_space.mesh.comm
        self._unknowns = Unknowns(u, space, self.terms)
        if self._unknowns.extra and self.rate is None:
            raise InputError("A body that moves freely needs a motion, newmark or explicit; or lead it, without mass.")
        self._y = self._unknowns.y  # what is solved for: u, or (u, angles) of a shell
        self._accepted = self._y.x.array.copy()
        self.scale = self._size = self._push = self._correction = self._goal = 0.0
        self._met, self._pushed, self._sound = True, False, True  # sound: the last Jacobian was finite
        self._nothing = 1e-14 * self.comm.allreduce(np.abs(u.function_space.mesh.geometry.x).max(initial=0.0), MPI.MAX)
        self._fault: Exception | None = None
        self._seen: tuple[np.ndarray, PETSc.Vec] | None = None  # the last unknowns, and their residual
        self._leads = leads(self.terms)  # what may change it
        self.residuals: list[float] = []  # their norms in the last solve, N
        self.linear_iterations = 0  # of all solves so far; with factors, a linear system takes one
        self._x, self._b, owned = self._unknowns.vector(), self._unknowns.vector(), self._unknowns.owned
        every = np.arange(owned) if space is None else np.array(space.W.sub(0).collapse()[1])
        self.displacements = every[every < owned]
        """Owned unknowns that are displacements: of a shell, all but the angles."""
        if space is None:
            own = [dofs[:size] for dofs, size in (bc.dof_indices() for bc in bcs)]
            self._given = np.unique(np.concatenate([np.empty(0, dtype=np.int32), *own]))
        else:
            self._given = space.supports(self._bcs)
        self.tangent = Tangent(self.terms, u.function_space, space, self._unknowns.link(), self._unknowns.here)
        self.symmetric = all([term.symmetric for term in self.terms])
        dofmap = self._y.function_space.dofmap
        blocks, components = np.divmod(self._given, dofmap.index_map_bs)
        rows = dofmap.index_map.local_to_global(blocks.astype(np.int32)) * dofmap.index_map_bs + components
        self._given_rows, self._targets = rows.astype(PETSc.IntType), self._y.x.array
        self.snes = PETSc.SNES().create(self.comm)
        self.snes.setFunction(weak(self._residual), self._b)
        self.snes.setJacobian(weak(self._jacobian), self.tangent.A)
        self.snes.setConvergenceTest(weak(self.converged))
        self.snes.setLineSearchPreCheck(weak(self._shorten))
        linear.configure(self.snes, self.tangent.A, OPTIONS | (options or {}), self.symmetric)
        by_grids = self.snes.ksp.getPC().getType() == "gamg" and not self._unknowns.count
        self._motions = linear.RigidMotions(u, self._y, space) if by_grids else None
        self.snes.setTolerances(stol=0.0)  # a step that ends in NaN would pass where the last correction was small
        forget_traversals()

    def _take(self, x: PETSc.Vec) -> None:
        """Set the unknowns from x."""
        self._unknowns.take(x)

    def _residual(self, snes: PETSc.SNES, x: PETSc.Vec, b: PETSc.Vec) -> None:
        # never raise in here: whatever fails, on any rank, must fail the step on every rank
        if self._seen is not None and self.comm.allreduce(self._sound and self._is_at(x.array_r), MPI.LAND):
            self._seen[1].copy(b)  # PETSc asks again where a search has ended, and where it begins
            return
        try:
            self._take(x)
            ok = all([term.evaluate() for term in self.terms])
        except Exception as error:
            self._fault, ok = error, False
        if self.comm.allreduce(ok and self._sound, MPI.LAND):
            self.assemble(x, b)
            self._seen = None if self._leads else (x.array_r.copy(), b.copy())
        else:
            b.set(np.nan)
            self._seen = None

    def _is_at(self, x: np.ndarray) -> bool:
        """Whether the terms were last evaluated at these owned unknowns, on this rank."""
        return self._seen is not None and np.array_equal(x, self._seen[0])

    def assemble(self, x: PETSc.Vec, b: PETSc.Vec) -> None:
        """Residual b (N) at the last x and its stresses, under the present loads; gaps (m) at given unknowns."""
        self._unknowns.residual(b, self.impulses)
        self._size = b.norm(PETSc.NormType.NORM_INFINITY)
        gap = x.array_r[self._given] - self._targets[self._given]
        b.array_w[self._given] = gap
        met = np.abs(gap).max(initial=0.0) <= 1e-10 * x.norm(PETSc.NormType.NORM_INFINITY)
        self._met = self.comm.allreduce(bool(met), MPI.LAND)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        self._assemble_tangent()  # in SNES given values are met: there is no right-hand side to correct

    def _assemble_tangent(self, *right: PETSc.Vec) -> None:
        if self.tangent.follow():
            self.snes.setJacobian(weak(self._jacobian), self.tangent.A)
        self.tangent.assemble(self._unknowns.force, self.impulses)
        self.tangent.eliminate(self._given_rows, self.symmetric, right)
        self._sound = self.tangent.sound()  # else the next residual is NaN

    impulses = 1.0  # what forces of impulsive terms count in a residual
    rate: Rate | None = None  # of `step`: velocity, its derivative by u

    @property
    def iterations(self) -> int:
        """Newton iterations of the last solve, whether it failed or not."""
        return int(self.snes.getIterationNumber())

    def longest_step(self, change: PETSc.Vec) -> float:
        """The part of a change of the unknowns, from where they were last set, that all terms allow, up to 1."""
        return self._unknowns.longest_step(change)

    def _shorten(self, x: PETSc.Vec, correction: PETSc.Vec) -> None:
        """Before a line search, which then stays within what the terms allow; PETSc subtracts corrections."""
        longest, self._correction = self.longest_step(-correction), correction.norm()
        correction.scale(longest)

    def _move_supports(self) -> int:
        """Meet the given values by one linear step of the whole sheet, if they are not met; 1 if it was needed.

        Newton then begins in a state that is strained smoothly, and its residual is made of forces alone.
        """
        gap = np.abs(self._x.array_r[self._given] - self._targets[self._given]).max(initial=0.0)
        far = self.comm.allreduce(float(gap), MPI.MAX) > 1e-10 * self._x.norm(PETSc.NormType.NORM_INFINITY)
        if far:
            b = self.residual(self._x)
            self.residuals.append(b.norm())
            correction = b.duplicate()
            fault = solve(self.prepared(b), b, correction) if np.isfinite(self.residuals[-1]) else SINGULAR
            fault = fault or (HELD if self.longest_step(-correction) < 1.0 else "")
            if fault or not self._sound:
                raise self.failure(fault or SINGULAR)
            self._ahead(correction)
            self._x.axpy(-1.0, correction)
        self._x.array_w[self._given] = self._targets[self._given]  # exactly: systems may leave out their columns
        return int(far)

    def _ahead(self, correction: PETSc.Vec) -> None: ...  # before it is subtracted as a whole

    def begin(self) -> PETSc.Vec:
        """Forget the last solve; the unknowns at the present u."""
        self.residuals, self._fault, self._sound, self._seen = [], None, True, None
        self.aim()
        self._unknowns.put(self._x)
        if self._motions is not None:
            self._motions.give(self.tangent.A, self._given)
        return self._x

    def aim(self) -> None:
        """Take over the present Dirichlet values; angles are those from the last commit on."""
        if self._shell is None:
            self._targets = self._y.x.array.copy()
            check(self._bcs, self.u.function_space)
            put(self._bcs, self._targets)
        else:
            self._targets = self._shell.targets(self._bcs, self._y)

    def residual(self, x: PETSc.Vec) -> PETSc.Vec:
        """Residual at x under the present loads, valid until the next; NaN, on every rank, if a law failed."""
        self._seen = None
        self._residual(self.snes, x, self._b)
        return self._b

    def factorised(self, *right: PETSc.Vec) -> PETSc.KSP:
        """What solves with the Jacobian at the last residual, under the present loads.

        right: right-hand sides, residuals or their differences; corrected where the columns of given unknowns, whose
        changes are in them, are eliminated.
        """
        self._assemble_tangent(*right)
        self.snes.ksp.setOperators(self.tangent.A)
        return self.snes.ksp

    prepared = factorised  # what a step is made with

    def converged(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int | None:
        """SNES's test, with the norms of unknowns, last correction and residual."""
        size, correction, residual = norms
        self.residuals.append(residual)
        correction = max(correction, self._correction if snes else 0.0)  # not what a term has left of it
        # given displacements are in the norm in m, where a small one would pass for a small force
        if iteration == 0 and self._pushed:  # nothing else tells the size of forces on a sheet without reactions
            self._push, self._pushed = self._size, False
        self._goal = self.rtol * max(self.scale, self._size, self._push)
        if self._met and residual <= self._goal:
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        # round-off alone can be more force in a shell as stiff as that; a sheet that nothing moves is in balance
        if self._met and iteration > 0 and correction <= max(1e-9 * size, self._nothing):
            return PETSc.SNES.ConvergedReason.CONVERGED_SNORM_RELATIVE
        return None

    def solve(self) -> int:
        """Solve from the present u; the number of Newton iterations.

        Raises on every rank, with u back at the last commit: StepFailed if Newton fails, LawFailed if a law raised.
        """
        self.begin()
        moved = self._move_supports()
        self._pushed, self._push = self.rate is None and not moved, 0.0
        iterations = balanced(self.terms, lambda: self._take(self._x), self._balance)
        if iterations is None:
            raise self.failure(HELD)
        return moved + iterations

    def _balance(self) -> int:
        """Newton's method from the present x on; the number of its iterations."""
        try:
            self.snes.solve(None, self._x)
        except PETSc.Error as error:
            raise self.failure("Jacobian is singular") from error
        self.linear_iterations += self.snes.getLinearSolveIterations()
        self._take(self._x)
        reason = self.snes.getConvergedReason()
        still = self._met and self._correction <= self._nothing  # where forces are round-off, no line is worth a search
        if reason > 0 or (still and reason == PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH):
            return int(self.snes.getIterationNumber())
        if reason == PETSc.SNES.ConvergedReason.DIVERGED_FUNCTION_NANORINF:
            self.residuals.append(np.nan)  # PETSc has not asked `converged` about this one
        raise self.failure(REASONS.get(reason, str(reason)) if self._sound else "Jacobian is not finite")

    def failure(self, reason: str) -> StepFailed:
        """What to raise when Newton's method has failed; restores. LawFailed, on every rank, if a law raised."""
        worst = max(self.comm.allgather(max(term.worst() for term in self.terms)))
        self.restore()
        self._b = self._b.duplicate()  # PETSc leaves what a linear solver has stopped at locked
        self.snes.setFunction(weak(self._residual), self._b)
        self.snes.ksp.reset()  # factors that failed are no base for others
        blame(self.comm, self._fault)
        return failed(reason, self.residuals, worst[1])

    def commit(self) -> None:
        """Accept the present u: the only call that moves the past."""
        there = self.comm.allreduce(self._is_at(self._y.x.array[: self._x.local_size]), MPI.LAND)
        for term in self.terms:
            if not there:
                term.evaluate()
            term.commit()
        if self._shell is not None:
            self._shell.commit(self._y)
        self._accepted = self._y.x.array.copy()
        self.scale = max(self.scale, self._size, self._push)

    def restore(self) -> None:
        """Back to the last commit."""
        self._y.x.array[:], self._seen = self._accepted, None
        self._unknowns.settle()
        for term in self.terms:
            term.restore()

    def forces(self) -> np.ndarray:
        """Residual in N at the owned unknowns of u, with no condition applied: at supports, the reactions."""
        return np.array(self._unknowns.add_up().array_r[: self._unknowns.of_q.local_size])

    def _unknown(self) -> fem.Function:
        return self.u
