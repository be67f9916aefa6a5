"""Newton's method for one implicit time step: statics with inertia, begun where the velocity leads."""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from dolfinx import fem
from dolfinx.fem import petsc as fempetsc
from petsc4py import PETSc

from ..terms.extra import extra_force
from ..terms.form import terms_of
from ..terms.term import Residual
from .inertia import Mass
from .marching import take_up
from .motion import Motion
from .search import part_to_take
from .statics import StaticSolver

RTOL = 1e-4
SHARE = 0.2
"""Of the time rule's own error, by which a step may be left out of balance.

A clamped sheet that a ball lifts, whose impulses act late: imbalance of 1.8 % with 0.4, below 1.5 % with this.
"""
CHORDS = 2
"""Iterations that may be expected to end a step with the matrix that there is, for which none is made.

Drape of blend held over patches, 20 x 20 cells, steps of 5 ms: 2.8 matrices a step instead of 3.5, elastic 1.0 instead
of 2.0, in 0.7 and 0.6 of the time.
"""


class MovingSolver(StaticSolver):
    """`StaticSolver` of one time step: M a is added to the residual, and velocity and acceleration follow u.

    motion: with the unknown, its space and its rule; rtol: as in `StaticSolver`; None: `RTOL`, or a part, `SHARE`, of
    the error that the time rule makes anyway, whichever is met first; the others as there. Where terms have kinks or
    are impulsive, and options name no line search, corrections are shortened as in `search`.

    Public: `matrices`, that were made and factorised so far; the last iterations of a step do with the one before.
    """

    def __init__(
        self,
        motion: Motion,
        residual: Residual,
        bcs: Sequence[fem.DirichletBC],
        *,
        rtol: float | None = None,
        options: dict[str, object] | None = None,
    ) -> None:
        self.motion, self.rate, self._inertia = motion, (motion.velocity, motion.rate), Mass(motion)
        terms = [*terms_of(residual, motion.q, self.rate), self._inertia]
        self.impulses, motion.impulsive = motion.impulses, any(term.impulsive for term in terms)
        self._by_error = rtol is None
        kinks = motion.impulsive or any(term.has_kinks for term in terms)
        self.matrices, self._kept = 0, False  # whether the last iteration had that of the one before
        self._searches = kinks and "snes_linesearch_type" not in (options or {})
        super().__init__(terms, motion.q, bcs, rtol=RTOL if rtol is None else rtol, options=options, space=motion.space)

    def _take(self, x: PETSc.Vec) -> None:
        super()._take(x)
        self.motion.follow()

    def assemble(self, x: PETSc.Vec, b: PETSc.Vec) -> None:
        """As of `StaticSolver`; what is small is measured by the inertia too, for nothing else may hold the sheet."""
        super().assemble(x, b)
        self._size = max(self._size, self._inertia.size)

    def converged(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int | None:
        """As of `StaticSolver`, or where a step is as good as the time rule."""
        reason = super().converged(snes, iteration, norms)
        if reason is not None or not self._by_error or not self._met or iteration == 0:
            return reason
        self._goal = max(self._goal, SHARE * self._error())
        return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE if norms[2] <= self._goal else None

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        self._kept = snes.getIterationNumber() > 0 and self._ends_soon()
        if not self._kept:
            self.matrices += 1
            super()._jacobian(snes, x, A, P)

    def _ends_soon(self) -> bool:
        """Whether a few more iterations with the present matrix are expected to end the step.

        Each multiplies the residual by as much as the last one did with this matrix, and the first by twice what
        Newton's own did, whose residual is half of what the matrix changes.
        """
        before, now = self.residuals[-2:]
        rate = now / before * (1.0 if self._kept else 2.0)
        return bool(now * rate**CHORDS <= self._goal)

    def _error(self) -> float:
        """Norm of the forces (N) that move the end of a step by as much as the time rule errs in it, at the present q.

        Where q has a third derivative j it errs by ((1 - alpha_m)/2 + beta - 1/6) dt^3 j (Zienkiewicz and Xie 1991,
        doi 10.1002/eqe.4290200907), and a force f moves the end by at most beta dt^2/alpha_m M^-1 f. What impulses add
        to the acceleration of the stage does not count: it is no part of the next step's.
        """
        rule = self.motion
        force = rule.weigh(rule.acceleration.x.array - rule.accepted["a"])
        if rule.impulsive:
            force += self.impulses * self._late()
        force[rule.given[rule.given < len(force)]] = 0.0
        size = np.sqrt(self.comm.allreduce(float(force @ force)))
        return float(size * abs((1.0 - rule.alpha_m) / 2 + rule.beta - 1 / 6) / rule.beta)

    def _late(self) -> np.ndarray:
        """Forces of impulsive terms at this rank's own unknowns of q."""
        own, late = self._unknowns, [term for term in self.terms if term.impulsive]
        every = own.force.copy()
        own.add_up(terms=late)
        found = np.array(own.of_q.array_r)
        every.copy(own.force)
        return found

    def _shorten(self, x: PETSc.Vec, correction: PETSc.Vec) -> None:
        """As of `StaticSolver`, and to where the residual along the correction is small, see `search`."""
        super()._shorten(x, correction)
        if not self._searches:
            return
        b = self.snes.getFunction()[0].copy()
        whole, tried, there = correction.copy(), x.duplicate(), b.duplicate()

        def slope(part: float) -> float:
            whole.copy(correction)
            correction.scale(part)
            tried.waxpy(-1.0, correction, x)
            self._residual(self.snes, tried, there)
            return float(there.dot(whole))

        part_to_take(slope, float(b.dot(whole)))  # the last part that it has tried

    def solve(self) -> int:
        """As of `StaticSolver`; then the impulses at the end of the step are given to the velocity."""
        for term in self.terms:
            term.prepare(self.motion.dt)
        iterations, late, own = super().solve(), [term for term in self.terms if term.impulsive], self._unknowns
        if late:
            own.add_up(terms=late)
            self.motion.hit(own.of_q)
        if own.extra:
            own.extra.hit(extra_force(late, own.count))
        return iterations

    def commit(self) -> None:
        """Accept the present u and its motion."""
        super().commit()
        self.motion.commit()

    def restore(self) -> None:
        """Back to the last commit."""
        self.motion.restore()
        super().restore()

    def accelerate(self) -> np.ndarray:
        """Acceleration (local array) with which the present u starts, from M a + residual = 0.

        `motion.acceleration` holds what is known of it: at given unknowns, and along directors. Unknowns
        without mass get none.
        """
        motion, impulses, self.impulses = self.motion, self.impulses, 0.0
        b, turn = self.residual(self.begin()), self._unknowns.of_sheet
        self.impulses = impulses
        if self._unknowns.extra:
            self._unknowns.extra.start(np.zeros(self._unknowns.count))
            whole, b = b, fempetsc.create_vector(self._y.function_space)
            b.array_w[:] = whole.array_r[: b.local_size]
        mass = motion.mass if turn is None else motion.mass.ptap(turn)
        massless = np.flatnonzero(mass.getDiagonal().array_r == 0.0) + mass.getOwnershipRange()[0]
        fixed = np.union1d(self._given_rows, massless).astype(PETSc.IntType)
        mass = mass.copy()
        mass.zeroRows(fixed, 1.0)
        b.array_w[fixed - mass.getOwnershipRange()[0]] = 0.0
        # a solver of its own, since that of the steps is set up for their matrix; a mass needs no factors
        ksp = PETSc.KSP().create(self.comm)
        ksp.setType("cg")
        ksp.getPC().setType("jacobi")
        ksp.setTolerances(rtol=1e-13)
        ksp.setOperators(mass)
        correction = b.duplicate()
        ksp.solve(b, correction)
        a = fem.Function(self.u.function_space)
        if turn is None:
            correction.copy(a.x.petsc_vec)
        else:
            turn.mult(correction, a.x.petsc_vec)
        a.x.scatter_forward()
        return np.asarray(motion.acceleration.x.array - a.x.array)

    def begin(self) -> PETSc.Vec:
        """As of `StaticSolver`; where supports stand still, from where the velocity leads to if that is nearer balance.

        The drape takes a fifth fewer iterations so; in a stretched sheet the straight way may strain far too much.
        """
        x = super().begin()
        dt, here, owned, extra = self.motion.dt, x.array_r.copy(), self._unknowns.owned, self._unknowns.extra
        still = self.comm.allreduce(bool((here[self._given] == self._targets[self._given]).all()), MPI.LAND)
        if dt > 0.0 and still:
            v = self.motion.accepted["v"]
            way = x.duplicate()
            way.array_w[:owned] = dt * (v if self._shell is None else self._shell.rate(v))[:owned]
            if extra is not None:
                way.array_w[owned:] = dt * extra.rates()[: self._unknowns.here]
            way.array_w[self._given] = 0.0
            before = self.residual(x).norm()
            x.axpy(self.longest_step(way), way)
            if not self.residual(x).norm() < before:
                x.array_w[:] = here
        return x

    def renew(self) -> None:
        """Take u, directors and histories as they have been set from outside for the last commit."""
        take_up(self)
