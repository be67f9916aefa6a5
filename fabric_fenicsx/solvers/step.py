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
from .statics import StaticSolver


class MovingSolver(StaticSolver):
    """`StaticSolver` of one time step: M a is added to the residual, and velocity and acceleration follow u.

    motion: with the unknown, its space and its rule; the others as in `StaticSolver`.
    """

    def __init__(
        self,
        motion: Motion,
        residual: Residual,
        bcs: Sequence[fem.DirichletBC],
        *,
        rtol: float = 1e-4,
        options: dict[str, object] | None = None,
    ) -> None:
        self.motion, self.rate, self._inertia = motion, (motion.velocity, motion.rate), Mass(motion)
        terms = [*terms_of(residual, motion.q, self.rate), self._inertia]
        self.impulses, motion.impulsive = motion.impulses, any(term.impulsive for term in terms)
        super().__init__(terms, motion.q, bcs, rtol=rtol, options=options, space=motion.space)

    def _take(self, x: PETSc.Vec) -> None:
        super()._take(x)
        self.motion.follow()

    def assemble(self, x: PETSc.Vec, b: PETSc.Vec) -> None:
        """As of `StaticSolver`; what is small is measured by the inertia too, for nothing else may hold the sheet."""
        super().assemble(x, b)
        self._size = max(self._size, self._inertia.size)

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
