"""Coulomb's friction, smoothed: below a slip speed it grows with the speed, as 2 y - y^2 of their ratio y.

So nothing sticks for ever: under a load that a part t of the friction could hold, a sheet creeps with 1 - sqrt(1 - t)
of the slip speed.
"""

from typing import Any

import numpy as np

from ..laws import Array
from .pairs import PairTerm
from .planes import blocks
from .surroundings import Surroundings


class Friction(PairTerm):
    """Friction between all that the barrier keeps apart, at the normal force of the end of a step.

    static, kinetic: coefficients. slip: speed from which on all of it acts, m/s. creep: the way in a step, m, that
    stands for it in statics, and is the least in motion: Newton's method goes round in circles where it steps far over.
    """

    loses = "friction"

    def __init__(self, around: Surroundings, static: float, kinetic: float, slip: float, creep: float) -> None:
        super().__init__(around)
        self._static, self._kinetic, self._slip, self._creep = static, kinetic, slip, creep
        kit = around.collisions.kit
        self._law, self._pairs, self._lost = kit.FrictionPotential(creep), kit.TangentialCollisions(), 0.0
        self._at: tuple[Array, Array] | None = None
        self._force: Array = np.zeros(around.x0.shape)

    def prepare(self, dt: float) -> None:
        """See `Term.prepare`."""
        length = max(self._slip * dt, self._creep)
        if self._law.eps_v != length:
            self._law.eps_v, self._at = length, None

    def _forces(self) -> Array:
        near, x0 = self._around.collisions, self._around.x0
        if self._at is None or self._at[0] is not near.x or self._at[1] is not x0:
            self._at, force = (near.x, x0), np.zeros(near.x.shape)
            if len(near.set):
                self._pairs.build(near.mesh, near.x, near.set, near.barrier, self._static, self._kinetic)
                force = -self._law.force(*self._arguments()).reshape(-1, 3)
            for k in range(len(near.shifts)):
                nodes, own, _ = self.of_plane(k)
                force[nodes] += own
            self._force = force
        return self._force

    def _arguments(self) -> tuple[Any, ...]:
        near, x0 = self._around.collisions, self._around.x0
        still = np.zeros(near.x.shape, order="F")
        return self._pairs, near.mesh, near.x, still, np.asfortranarray(near.x - x0), near.barrier, near.offset

    def of_plane(self, k: int) -> tuple[np.ndarray, Array, Array]:
        """See `Planes.friction`."""
        around, near = self._around, self._around.collisions
        law, shifts = (self._law.eps_v, self._static, self._kinetic), (around.shifts[k], around.shifts0[k])
        return near.planes.friction(k, near.nodes, around.x0[: near.count], shifts, law)

    def _matrix(self) -> Any:
        self._forces()
        near = self._around.collisions
        found = blocks([self.of_plane(k)[::2] for k in range(len(near.shifts))], near.x.size)
        if len(near.set):
            *first, offset = self._arguments()
            by = near.kit.FrictionPotential.DiffWRT
            for wrt in (by.VELOCITIES, by.LAGGED_DISPLACEMENTS):
                found = found - self._law.force_jacobian(*first, wrt, offset)
        return found.tocoo()

    def energy(self) -> float:
        """None is stored."""
        return 0.0

    def _step_loss(self) -> float:
        around = self._around
        if not self._first:
            return 0.0
        loss = float(np.sum(self._forces() * (around.collisions.x - around.x0)))
        return loss - float(np.sum(self._on_planes() * (around.shifts - around.shifts0)))

    def _on_planes(self) -> Array:
        return np.array([self.of_plane(k)[1].sum(axis=0) for k in range(len(self._around.shifts))]).reshape(-1, 3)

    def _step_work(self) -> float:
        around = self._around
        led = float(np.sum(self._on_planes() * (around.shifts - around.shifts0))) if self._first else 0.0
        return super()._step_work() - led

    def dissipated(self) -> float:
        """See `Term.dissipated`."""
        return self._lost + self._step_loss()

    def watch(self) -> None:
        """See `Term.watch`."""
        super().watch()
        self._lost = 0.0

    def commit(self) -> None:
        """See `Term.commit`."""
        self._lost += self._step_loss()
        super().commit()
