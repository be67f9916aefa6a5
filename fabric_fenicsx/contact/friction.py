"""Coulomb's friction, smoothed: below a slip speed it grows with the speed, as 2 y - y^2 of their ratio y.

So nothing sticks for ever: under a load that a part t of the friction could hold, a sheet creeps with 1 - sqrt(1 - t)
of the slip speed.
"""

from typing import Any

import numpy as np

from ..laws import Array
from .coefficients import Coefficients
from .pairs import PairTerm
from .planes import blocks
from .surroundings import Surroundings


class Friction(PairTerm):
    """Friction between all that the barrier keeps apart, at the normal force of the end of a step.

    slip: speed from which on all of it acts, m/s. creep: the way in a step, m, that
    stands for it in statics, and is the least in motion: Newton's method goes round in circles where it steps far over.
    """

    loses = "friction"

    def __init__(self, around: Surroundings, coefficients: Coefficients, slip: float, creep: float) -> None:
        super().__init__(around)
        self._coefficients, self._slip, self._creep = coefficients, slip, creep
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
                mu = self._coefficients.static[0], self._coefficients.kinetic[0]
                self._pairs.build(near.mesh, near.x, near.set, near.barrier, *mu)
                if not self._coefficients.uniform:
                    self._orient()
                force = -self._law.force(*self._arguments()).reshape(-1, 3)
            for k in range(len(near.shifts)):
                nodes, own, _ = self.of_plane(k)
                force[nodes] += own
            self._force = force
        return self._force

    def _orient(self) -> None:
        """Give each pair the coefficients along its way. Their derivative is not in the matrix of pairs."""
        near, pairs = self._around.collisions, [self._pairs[k] for k in range(len(self._pairs))]
        slid, x, places = near.x - self._around.x0, near.nodes, (near.edges, near.faces)
        nodes = np.array([pair.vertex_ids(*places) for pair in pairs]).reshape(-1, 4)
        slid = np.asfortranarray(slid)
        ways = np.array([pair.relative_velocity(pair.dof(slid, *places)) for pair in pairs]).reshape(-1, 3)
        bases = np.array([pair.tangent_basis for pair in pairs]).reshape(-1, 3, 2)
        ways = np.einsum("pik,pjk,pj->pi", bases, bases, ways)
        weights = np.zeros(nodes.shape)
        for k, pair in enumerate(pairs):
            weights[k, : pair.num_vertices()] = np.abs(pair.compute_coefficients(pair.dof(near.x, *places)))
        weights[(nodes < 0) | (nodes >= near.count)] = 0.0
        every = np.where((nodes < 0) | (nodes >= near.count), 0, nodes).ravel()
        mu, _ = self._coefficients.along(every, np.repeat(ways, 4, axis=0), x)
        mean = np.sum(mu.reshape(2, -1, 4) * weights, axis=2) / weights.sum(axis=1)
        for pair, static, kinetic in zip(pairs, *mean, strict=True):
            pair.mu_s_effective_lagged, pair.mu_k_effective_lagged = static, kinetic

    def _arguments(self) -> tuple[Any, ...]:
        near, x0 = self._around.collisions, self._around.x0
        still = np.zeros(near.x.shape, order="F")
        return self._pairs, near.mesh, near.x, still, np.asfortranarray(near.x - x0), near.barrier, near.offset

    def of_plane(self, k: int) -> tuple[np.ndarray, Array, Array]:
        """See `Planes.friction`."""
        around, near = self._around, self._around.collisions
        law, shifts = (self._law.eps_v, self._coefficients), (around.shifts[k], around.shifts0[k])
        return near.planes.friction(k, near.nodes, around.x0[: near.count], shifts, *law)

    def _matrices(self) -> list[Any]:
        self._forces()
        near, found = self._around.collisions, []
        if len(near.shifts):
            found.append(blocks([self.of_plane(k)[::2] for k in range(len(near.shifts))], near.x.size))
        if len(near.set):
            *first, offset = self._arguments()
            by = near.kit.FrictionPotential.DiffWRT
            for wrt in (by.VELOCITIES, by.LAGGED_DISPLACEMENTS):
                found.append(-self._law.force_jacobian(*first, wrt, offset))
        return found

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


class Lagged(Friction):
    """Friction at the normal force of the start of a step, along the surfaces of then: it has a potential.

    So statics can go downhill. It is of first order in the step, and what comes to touch slides freely until the next.
    There is none of planes, and one coefficient for all directions.
    """

    symmetric = True
    _since: Array | None = None

    def _slid(self) -> Array:
        """How far all corners have gone; `_pairs` is then that of the start."""
        near, x0 = self._around.collisions, self._around.x0
        if self._since is not x0:
            self._since, start = x0, np.asfortranarray(x0)
            mu = self._coefficients.static[0], self._coefficients.kinetic[0]
            self._pairs.build(near.mesh, start, near.at(start), near.barrier, *mu)
        return np.asfortranarray(near.x - x0)

    def _forces(self) -> Array:
        slid = self._slid()
        if not len(self._pairs):
            return np.zeros(slid.shape)
        return np.asarray(self._law.gradient(self._pairs, self._around.collisions.mesh, slid).reshape(-1, 3))

    def _matrices(self) -> list[Any]:
        slid = self._slid()
        return [self._law.hessian(self._pairs, self._around.collisions.mesh, slid)] if len(self._pairs) else []

    def potential(self) -> float:
        """See `Term.potential`."""
        slid = self._slid()
        mine = self._first and len(self._pairs)
        return float(self._law(self._pairs, self._around.collisions.mesh, slid)) if mine else 0.0
