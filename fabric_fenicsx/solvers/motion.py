"""Velocity and acceleration of a moving sheet, and Newmark's rule that ties them to its displacement (Box 5-2).

Equilibrium is asked for at the end of a step, of the acceleration (1 - alpha_m) a0 + alpha_m a1, as by Wood,
Bossak and Zienkiewicz (1980, doi 10.1002/nme.1620151011): forces, supports and history live at one time. With
rho in [0, 1], the amplitude that is left of the fastest oscillations after a step,

    alpha_m = 2/(1 + rho),    gamma = alpha_m - 1/2,    beta = alpha_m^2/4,

is of second order; rho = 1 is the trapezoidal rule, which dissipates nothing in a linear problem.

An impulsive force f, as that of contact, acts at the end of a step only (Kane, Repetto, Ortiz and Marsden 1999, doi
10.1016/S0045-7825(99)00034-1): dt f/m in the velocity, dt^2/2 f/m in the place, and nothing in the acceleration with
which the next step begins. In the equation above it counts alpha_m/(2 beta) times, which makes its part of the place;
`hit` then sees to the rest. Until then the velocity is 2 (q1 - q0)/dt - v0, as accurate and stable as the rule's, but
zero in a sheet that rests on something, so that damping bears none of its weight. What impulses take from the motion,
f . (q1 - q0) less the change of its potential, is not negative where that is convex, as in backward Euler; other
schemes make energy where much of a sheet lands at once.

A shell's directors move on the unit sphere. The rule is applied to d itself, not to its angles, whose
axes change with every step; after a step its velocity is laid into the tangent plane, and its acceleration
along d is the -|d'|^2 that keeps its length.
"""

from functools import cached_property

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fempetsc
from petsc4py import PETSc
from ufl.form import Form

from ..errors import InputError
from ..laws import Array
from ..shell.directors import ShellSpace
from ..terms.term import Indices
from .turned import compact


class Motion:
    """The unknown q, its velocity and its stage acceleration, with a constant mass matrix.

    In forms: `velocity`. Vectors and arrays are those of the space of q. Raises InputError.

    Args:
        q: displacement, or (u, d) of the shell `space`.
        mass: bilinear form of the mass, see `weakform.inertia`.
        space: of a shell.
        rho: see above.
        newmark: (beta, gamma) instead of rho, with equilibrium of a1 itself.
        damping: a, in 1/s, of the part a M of Rayleigh's damping (Box 5-2); for the part b K see
            `weakform.stiffness_damping`.
        lumped: see `lump`.
        velocity: a Function of the space of q, which forces that depend on the velocity already hold.
    """

    def __init__(
        self,
        q: fem.Function,
        mass: Form,
        space: ShellSpace | None = None,
        *,
        rho: float = 1.0,
        newmark: tuple[float, float] | None = None,
        damping: float = 0.0,
        lumped: bool = False,
        velocity: fem.Function | None = None,
    ) -> None:
        if not 0.0 <= rho <= 1.0:
            raise InputError(f"rho must be from 0 (most dissipation) to 1 (none), not {rho!r}.")
        self.alpha_m = 2.0 / (1.0 + rho)
        self.gamma, self.beta = self.alpha_m - 0.5, self.alpha_m**2 / 4
        if newmark is not None:
            self.alpha_m, (self.beta, self.gamma) = 1.0, newmark
            if not (self.beta > 0.0 and self.gamma >= 0.5):
                raise InputError(
                    f"Newmark's beta = {self.beta!r} must be above 0 and gamma = {self.gamma!r} at least 0.5."
                )
        if not (np.isfinite(damping) and damping >= 0.0):
            raise InputError(f"The damping must be a number of 1/s that is not negative, not {damping!r}.")
        self.q, self.space, self.damping = q, space, damping
        V = q.function_space
        self.velocity = velocity if velocity is not None else fem.Function(V, name="velocity")
        self.acceleration = fem.Function(V, name="acceleration")
        self.accepted = {
            "q": q.x.array.copy(),
            "v": self.velocity.x.array.copy(),
            "a": self.acceleration.x.array.copy(),
        }
        """Local arrays at the last accepted step: q, velocity v, acceleration a (not that of the stage)."""
        self._a1 = self.acceleration.x.array.copy()
        self.jump: fem.Function | None = None
        """What impulses at the end of the last step have added to the velocity, per second of it."""
        self.impulsive = False
        """Whether impulses act at the ends of steps."""
        self._by_mass: PETSc.KSP | None = None
        self.given, self._given_v, self._given_a = np.empty(0, dtype=np.int32), np.empty(0), np.empty(0)
        """Local unknowns whose motion is prescribed."""
        self._form, self._lumped = fem.form(mass), lumped
        self.mass = compact(fempetsc.assemble_matrix(self._form))
        if lumped:
            diagonal = fem.Function(V)
            diagonal.x.array[:] = self.lump()
            self.mass.zeroEntries()
            self.mass.setDiagonal(diagonal.x.petsc_vec)
        self.rate = fem.Constant(V.mesh, 0.0)
        """Derivative of the velocity by q, 1/s."""
        self.shift = 0.0
        """Derivative of the stage acceleration by q, 1/s2."""
        self.dt = 0.0
        self._force, self._rates = fempetsc.create_vector(V), fem.Function(V)

    @cached_property
    def entries(self) -> tuple[Indices, Indices, Array]:
        """Local rows, columns and values of the mass of this rank's cells, or of its unknowns where it is lumped."""
        if self._lumped:
            every = np.arange(self.mass.getLocalSize()[0])
            return every, every, np.array(self.mass.getDiagonal().array_r)
        part = fem.assemble_matrix(self._form).to_scipy(ghosted=True).tocoo()
        there = part.data != 0.0
        return part.row[there], part.col[there], part.data[there]

    def lump(self) -> Array:
        """Lumped mass of each local unknown: the diagonal of the mass matrix, scaled to keep its total.

        Displacements and directors keep a total each. Positive for quadratic triangles too (Hinton, Rock and
        Zienkiewicz 1976, doi 10.1002/eqe.4290040305).
        """
        comm, result = self.q.function_space.mesh.comm, fem.Function(self.q.function_space)
        m, rows = self.mass.getDiagonal().array_r, self.mass.getRowSum().array_r
        turning = np.zeros(len(m), dtype=bool)
        if self.space is not None:
            turning[self.space.nodes[self.space.nodes < len(m)]] = True
        for kind in (turning, ~turning):
            total, part = comm.allreduce(np.array([rows[kind].sum(), m[kind].sum()]))
            result.x.array[: len(m)][kind] = m[kind] * (total / part if part > 0.0 else 1.0)
        result.x.scatter_forward()
        return np.asarray(result.x.array)

    def prepare(self, dt: float, given: tuple[Array, Array]) -> None:
        """Before a step of dt in s; given: velocity and acceleration of the `given` unknowns at its end."""
        self.dt, (self._given_v, self._given_a), self.jump = dt, given, None
        self.rate.value = (2.0 if self.impulsive else self.gamma / self.beta) / dt
        self.shift = self.alpha_m / (self.beta * dt**2)

    def follow(self) -> None:
        """Velocity and stage acceleration that belong to the present q."""
        if self.dt == 0.0:
            return
        dt, q0, v0, a0 = self.dt, self.accepted["q"], self.accepted["v"], self.accepted["a"]
        a1 = self._a1
        np.subtract(self.q.x.array, q0, out=a1)
        a1 -= dt * v0
        a1 /= self.beta * dt**2
        a1 -= (0.5 / self.beta - 1.0) * a0
        a1[self.given] = self._given_a
        self._move(2.0 / dt * (self.q.x.array - q0) - v0 if self.impulsive else self._moved())
        stage = self.acceleration.x.array
        stage[:] = (1.0 - self.alpha_m) * a0 + self.alpha_m * a1
        # with alpha_m above 1, a0 and a1 lag behind their times, and only the stage is at its own
        stage[self.given] = self._given_a

    def _moved(self) -> Array:
        """Velocity at the end of a step, by the rule."""
        v0, a0 = self.accepted["v"], self.accepted["a"]
        return np.asarray(v0 + self.dt * ((1.0 - self.gamma) * a0 + self.gamma * self._a1))

    def _move(self, velocity: Array) -> None:
        self.velocity.x.array[:] = velocity
        self.velocity.x.array[self.given] = self._given_v

    def by_mass(self, rates: fem.Function) -> PETSc.Vec:
        """Force M times velocity or acceleration, valid until the next call."""
        self.mass.mult(rates.x.petsc_vec, self._force)
        return self._force

    def weigh(self, rates: Array) -> Array:
        """Mass times `rates`, a local array of velocities or accelerations, on this rank's own unknowns."""
        self._rates.x.array[:] = rates
        return np.array(self.by_mass(self._rates).array_r)

    @property
    def impulses(self) -> float:
        """What an impulsive force counts within a step; see above."""
        return self.alpha_m / (2 * self.beta)

    def hit(self, force: PETSc.Vec) -> None:
        """The step is solved: impulses of a residual `force` (N) act on the velocity, and leave no trace else."""
        if self._by_mass is None:
            self._by_mass = self._inverse()
        right, self.jump = force.copy(), fem.Function(self.q.function_space)
        right.scale(-1.0)
        right.array_w[self._fixed] = 0.0
        self._by_mass.solve(right, self.jump.x.petsc_vec)
        self.jump.x.scatter_forward()
        a = self.jump.x.array
        self._a1 -= a / (2 * self.beta)
        self.acceleration.x.array[:] -= self.impulses * a
        self._move(self._moved() + self.dt * a)

    def _inverse(self) -> PETSc.KSP:
        """What solves with the mass; unknowns that are given or have no mass stay as they are."""
        mass = self.mass.copy()
        first, _ = mass.getOwnershipRange()
        massless = np.flatnonzero(mass.getDiagonal().array_r == 0.0)
        self._fixed = np.union1d(self.given[self.given < mass.getLocalSize()[0]], massless)
        mass.zeroRows((first + self._fixed).astype(PETSc.IntType), 1.0)
        ksp = PETSc.KSP().create(mass.comm)
        ksp.setType("cg")
        ksp.getPC().setType("jacobi")
        ksp.setTolerances(rtol=1e-13)
        ksp.setOperators(mass)
        return ksp

    def settle(self) -> None:
        """The step to the present q is solved: lay the motion of directors on their sphere."""
        self.lay_on_sphere(self.velocity.x.array, self._a1)

    def commit(self) -> None:
        """The step to the present q has happened."""
        v, a = self.velocity.x.array, self._a1
        self.accepted = {"q": self.q.x.array.copy(), "v": v.copy(), "a": a.copy()}

    def restore(self) -> None:
        """Back to the last accepted step, q apart."""
        self.velocity.x.array[:], self.acceleration.x.array[:] = self.accepted["v"], self.accepted["a"]

    def restart(self, acceleration: Array) -> None:
        """Begin from the present q and velocity with this acceleration (local array of the space of q)."""
        self._a1[:] = self.acceleration.x.array[:] = acceleration
        self.commit()

    def fields(self) -> list[tuple[str, None, Array]]:
        """What a checkpoint has to hold of it; see `checkpoint`."""
        result: list[tuple[str, None, Array]] = [(name, None, array) for name, array in self.accepted.items()]
        result.append(("stage", None, self.acceleration.x.array))
        if self.space is not None:
            self._axes = self.space.axes()
            result += [("e1", None, self._axes[0]), ("d0", None, self._axes[1])]
        return result

    def renew(self) -> None:
        """Take over what has been put into `fields`."""
        self.q.x.array[:], self.velocity.x.array[:] = self.accepted["q"], self.accepted["v"]
        self._a1[:] = self.accepted["a"]
        if self.space is not None:
            self.space.set_axes(*self._axes)

    def kinetic(self) -> float:
        """Kinetic energy in J, over all ranks."""
        v = self.velocity.x.petsc_vec.array_r
        # NumPy's sum, unlike BLAS's dot, does not depend on where in memory the numbers are
        total = np.sum(self.by_mass(self.velocity).array_r * v)
        return 0.5 * float(self.q.function_space.mesh.comm.allreduce(total))

    def lay_on_sphere(self, v: Array, a: Array) -> None:
        """Take from v, the velocity, what is along directors d, and give them in a the acceleration -|d'|^2 along it.

        Rigid bodies first get a motion that is theirs.
        """
        if self.space is None:
            return
        for body in self.space.bodies:
            body.lay(self.q.x.array, v, a, self.weigh)
        dofs = self.space.nodes
        d, w, b = self.q.x.array[dofs], v[dofs], a[dofs]
        w -= (w * d).sum(axis=1, keepdims=True) * d
        along = (b * d).sum(axis=1, keepdims=True) + (w * w).sum(axis=1, keepdims=True)
        v[dofs], a[dofs] = w, b - along * d
