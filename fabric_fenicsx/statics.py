"""Newton's method by PETSc SNES for one load step, and the march through many."""

import itertools
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from dolfinx import fem
from dolfinx.fem import petsc as fempetsc
from petsc4py import PETSc
from tqdm import tqdm
from ufl.form import Form

from .errors import InputError, StepFailed
from .hook import LawHook, derive

_prefix = itertools.count()

OPTIONS = {
    "snes_linesearch_type": "basic",
    "snes_max_it": 25,
    "ksp_type": "preonly",
    "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
}
"""PETSc options of `StaticSolver` that a user may override."""


class StaticSolver:
    """Equilibrium residual(u) = 0 at the present loads and Dirichlet values.

    residual: UFL form, a sum of the terms of `weakform`, linear in a test function. u: the unknown.
    bcs: Dirichlet conditions, whose values may change between solves. hooks: every `LawHook` whose
    stress is in the residual. rtol: a step is solved when the residual at the free unknowns is
    below rtol times the largest internal or support force so far. options: PETSc options, over `OPTIONS`.

    The SNES itself is `problem.solver`.
    """

    def __init__(
        self,
        residual: Form,
        u: fem.Function,
        bcs: Sequence[fem.DirichletBC],
        hooks: Sequence[LawHook] = (),
        rtol: float = 1e-6,
        options: dict[str, object] | None = None,
    ) -> None:
        self.u, self.hooks, self.rtol = u, tuple(hooks), rtol
        self._comm = u.function_space.mesh.comm
        self._accepted = u.x.array.copy()
        self._scale = self._size = 0.0
        self.residuals: list[float] = []
        """Norms of the residual in the last solve, N."""
        form, jacobian = derive(residual, u, self.hooks)
        self.problem = fempetsc.NonlinearProblem(
            form,
            u,
            bcs=list(bcs),
            J=jacobian,
            petsc_options_prefix=f"statics{next(_prefix)}_",
            petsc_options=OPTIONS | (options or {}),
        )
        self._bcs = list(bcs)
        self._force = fempetsc.create_vector(u.function_space)
        snes = self.problem.solver
        snes.setFunction(self._residual, self.problem.b)
        snes.setConvergenceTest(self._converged)

    def _assemble_force(self) -> None:
        """Residual at the present u with no condition applied: at supports, the reactions."""
        with self._force.localForm() as local:
            local.set(0.0)
        fempetsc.assemble_vector(self._force, self.problem.F)
        self._force.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)

    def _residual(self, snes: PETSc.SNES, x: PETSc.Vec, b: PETSc.Vec) -> None:
        x.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)
        fempetsc.assign(x, self.u)
        ok = all([hook.evaluate() for hook in self.hooks])
        # never raise in here: a point that is not finite must fail the step on every rank
        if not self._comm.allreduce(ok, MPI.LAND):
            b.set(np.nan)
            return
        self._assemble_force()
        self._size = self._force.norm(PETSc.NormType.NORM_INFINITY)
        self._force.copy(b)
        with b.localForm() as local:
            # lifting adds to ghosts too, so it goes into a vector of its own
            local.array_w[self._force.local_size :] = 0.0
        fempetsc.apply_lifting(b, [self.problem.J], bcs=[self._bcs], x0=[x], alpha=-1.0)
        b.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        fempetsc.set_bc(b, self._bcs, x0=x, alpha=-1.0)

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int | None:
        norm = norms[2]
        self.residuals.append(norm)
        if not np.isfinite(norm):
            return PETSc.SNES.ConvergedReason.DIVERGED_FNORM_NAN
        if norm <= self.rtol * max(self._scale, self._size):
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        return None

    def solve(self) -> int:
        """Solve from the present u; the number of Newton iterations.

        Raises StepFailed on every rank, with u as it was at the last commit, if Newton fails.
        """
        self.residuals = []
        self.problem.solve()
        reason = self.problem.solver.getConvergedReason()
        if reason > 0:
            return self.problem.solver.getIterationNumber()
        worst = max(self._comm.allgather(max((hook.worst() for hook in self.hooks), default=(0.0, ""))))
        self.restore()
        history = ", ".join(f"{norm:.2e}" for norm in self.residuals)
        raise StepFailed(
            f"Newton's method failed ({reasons.get(reason, reason)}); residuals in N: {history}"
            + (f"; largest strain in {worst[1]}" if worst[1] else "")
        )

    def commit(self) -> None:
        """Accept the present u: the only call that moves the past."""
        for hook in self.hooks:
            # the last residual need not have been at the accepted u
            hook.evaluate()
            hook.commit()
        self._accepted = self.u.x.array.copy()
        self._scale = max(self._scale, self._size)

    def restore(self) -> None:
        """Back to the last commit."""
        self.u.x.array[:] = self._accepted

    def reaction(self, dofs: np.ndarray) -> float:
        """Sum of the forces (N) that the supports exert on these local unknowns, over all ranks.

        To be called on every rank, at a solved u.
        """
        self._assemble_force()
        owned = dofs[dofs < self._force.local_size]
        return float(self._comm.allreduce(self._force.array_r[owned].sum()))


reasons = {
    value: name.lower() for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)
}


@dataclass(frozen=True)
class Step:
    """What it took to reach one load."""

    number: int
    load: float
    newton_iterations: int
    step_cuts: int
    wall_s: float


def march(
    solver: StaticSolver,
    set_load: Callable[[float], None],
    loads: Sequence[float],
    start: float = 0.0,
    smallest: float = 1 / 64,
    progress: str | None = None,
) -> Iterator[Step]:
    """Solve and commit at each of `loads` in turn, from `start` on; yields a Step after each.

    `set_load(load)` puts a load into the scene. A step that fails is restored and halved, and grows
    again once it works; parts below `smallest` of a step raise StepFailed, on every rank, with the last
    good state in place. `progress` names the bar that rank 0 shows. Stop early by leaving the loop.
    """
    if len(loads) == 0:
        raise InputError("A march needs at least one load step.")
    fraction, done = 1.0, float(start)
    hidden = progress is None or solver._comm.rank != 0
    calm = 0.2 if sys.stderr.isatty() else 30.0
    with tqdm(
        total=len(loads), desc=progress, unit="step", disable=hidden, leave=False, mininterval=calm
    ) as bar:
        for number, target in enumerate(map(float, loads), 1):
            clock, iterations, cuts, origin, part = time.perf_counter(), 0, 0, done, 0.0
            while part < 1.0:
                trial = min(1.0, part + fraction)
                load = target if trial == 1.0 else origin + trial * (target - origin)
                set_load(load)
                try:
                    iterations += solver.solve()
                except StepFailed as error:
                    cuts += 1
                    iterations += len(solver.residuals) - 1
                    fraction /= 2
                    if fraction < smallest:
                        set_load(done)
                        raise StepFailed(
                            f"Step {number} stopped at load {done:.6g} on its way to {target:.6g}, after "
                            f"{cuts} cuts of the step: {error}. Smaller steps or a smoother load may help."
                        ) from None
                    continue
                solver.commit()
                part, done = trial, load
                fraction = min(1.0, 2 * fraction)
            bar.set_postfix(load=f"{done:.4g}", newton=iterations, cuts=cuts, refresh=False)
            bar.update()
            yield Step(number, done, iterations, cuts, time.perf_counter() - clock)
