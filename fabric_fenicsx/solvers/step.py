"""Newton's method for one implicit time step: statics with inertia, begun where the velocity leads."""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from dolfinx import fem
from petsc4py import PETSc
from ufl.form import Form

from ..terms.hook import LawHook
from ..terms.work import InternalWork
from .motion import Motion
from .statics import StaticSolver


class MovingSolver(StaticSolver):
    """`StaticSolver` of one time step: M a is added to the residual, and velocity and acceleration follow u.

    motion: with the unknown, its space and its rule; the others as in `StaticSolver`.
    """

    def __init__(
        self,
        motion: Motion,
        residual: Form | int,
        bcs: Sequence[fem.DirichletBC],
        hooks: Sequence[LawHook] = (),
        rtol: float = 1e-4,
        options: dict[str, object] | None = None,
        works: Sequence[InternalWork] = (),
    ) -> None:
        self.motion, self.rate = motion, (motion.velocity, motion.rate)
        self._mass: PETSc.Mat | None = None
        super().__init__(residual, motion.q, bcs, hooks, rtol, options, motion.space, works)

    def _take(self, x: PETSc.Vec) -> None:
        super()._take(x)
        self.motion.follow()

    def _assemble_force(self) -> None:
        super()._assemble_force()
        inertia = self.motion.inertia()
        self._inertia = inertia.norm(PETSc.NormType.NORM_INFINITY)
        self._force.axpy(1.0, inertia)

    def assemble(self, x: PETSc.Vec, b: PETSc.Vec) -> None:
        """As of `StaticSolver`; what is small is measured by the inertia too, for nothing else may hold the sheet."""
        super().assemble(x, b)
        self._size = max(self._size, self._inertia)

    def _add_to_jacobian(self, K: PETSc.Mat) -> None:
        if self._mass is None:  # in the pattern of K a sum takes a tenth of the time
            self._mass = K.duplicate()
            self._mass.axpy(1.0, self.motion.mass, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        K.axpy(self.motion.shift, self._mass, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)

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
        motion = self.motion
        b = self.residual(self.begin())
        mass = motion.mass if self._shell is None else motion.mass.ptap(self._transformation)
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
        if self._shell is None:
            correction.copy(a.x.petsc_vec)
        else:
            self._transformation.mult(correction, a.x.petsc_vec)
        a.x.scatter_forward()
        return np.asarray(motion.acceleration.x.array - a.x.array)

    def begin(self) -> PETSc.Vec:
        """As of `StaticSolver`; where supports stand still, from where the velocity leads to if that is nearer balance.

        The drape takes a fifth fewer iterations so; in a stretched sheet the straight way may strain far too much.
        """
        x = super().begin()
        dt, here = self.motion.dt, x.array_r.copy()
        still = self.comm.allreduce(bool((here == self._targets[: len(here)])[self._given].all()), MPI.LAND)
        if dt > 0.0 and still:
            v = self.motion.accepted["v"]
            there = here + dt * (v if self._shell is None else self._shell.rate(v))[: len(here)]
            there[self._given] = here[self._given]
            before = self.residual(x).norm()
            x.array_w[:] = there
            if not self.residual(x).norm() < before:
                x.array_w[:] = here
        return x

    def renew(self) -> None:
        """Take u, directors and histories as they have been set from outside for the last commit."""
        if self._shell is None:
            self._y.x.array[:] = self.u.x.array
        else:
            self._y.x.array[:] = self._shell.at_rest(self.u.x.array)
            self._shell.turn(self._y, fem.Function(self.u.function_space))
        self._accepted = self._y.x.array.copy()
        for hook in self.hooks:
            stress = hook.resultants.copy()
            hook.evaluate()
            hook.resultants[:] = stress
