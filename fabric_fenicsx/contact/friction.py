"""Coulomb's friction, smoothed: below a slip speed it grows with the speed, as 2 y - y^2 of their ratio y.

So nothing sticks for ever: under a load that a part t of the friction could hold, a sheet creeps with 1 - sqrt(1 - t)
of the slip speed.
"""

from typing import Any

import numpy as np

from ..laws import Array
from .coefficients import Coefficients
from .facing import Facing
from .gaps import Near
from .pairs import Blocks, PairTerm
from .surroundings import Surroundings


class Friction(PairTerm):
    """Friction between all that the barrier keeps apart, at the normal force of the end of a step.

    slip: speed from which on all of it acts, m/s. creep: the way in a step, m, that stands for it in statics, and is
    the least in motion: Newton's method goes round in circles where it steps far over. In explicit motion, whose steps
    are short, it is as long at most as is needed so that friction does not turn back in a step what it slows down.
    """

    loses = "friction"

    def __init__(self, around: Surroundings, coefficients: Coefficients, slip: float, creep: float) -> None:
        super().__init__(around)
        self._coefficients, self._slip, self._creep = coefficients, slip, creep
        self._length, self._dt, self._lost, self._kit = creep, 0.0, 0.0, around.collisions.kit
        if self._kit is not None:
            self._law = self._kit.FrictionPotential(creep)
        self._pairs: list[tuple[Facing, Any, Any]] = []
        """What touches each other, the potential that presses, and the pairs that rub."""
        self._at: tuple[Array, Array] | None = None
        self._force: Array = np.zeros(around.x0.shape)

    def prepare(self, dt: float) -> None:
        """See `Term.prepare`."""
        if self._dt != dt:
            self._dt, self._at = dt, None

    def _smooth(self) -> None:
        """Choose the way over which friction grows: `_length`."""
        least = self._creep
        if self._around.masses is not None:  # two nodes are slowed down at most by 2 mu N over the slip speed, each
            least = min(least, 4 * float(self._coefficients.static.max()) * self._dt**2 * self._around.pushed())
        self._length = max(self._slip * self._dt, least)
        if self._kit is not None:
            self._law.eps_v = self._length

    def _forces(self) -> Array:
        near, x0 = self._around.collisions, self._around.x0
        if self._at is None or self._at[0] is not near.x or self._at[1] is not x0:
            self._at, force = (near.x, x0), np.zeros(near.x.shape)
            self._smooth()
            self._pairs = self._rubbing([(facing, facing.x, facing.sets) for facing in near.facings])
            for facing, law, pairs in self._pairs:
                if not self._coefficients.uniform:
                    self._orient(facing, pairs)
                rubbed = self._law.force(pairs, facing.mesh, *self._ways(facing), law, facing.offset)
                force[facing.which] -= rubbed.reshape(-1, 3)
            closed = near.gaps.friction(near.x, x0, self._length, self._coefficients, False, self._around.still)
            near.gaps.add([push for push, _ in closed], force)
            self._force = force
        return self._force

    def _rubbing(self, sets: list[tuple[Facing, Array, list[Any]]]) -> list[tuple[Facing, Any, Any]]:
        """Of what is near to each other at its places, the pairs that rub."""
        mu, rubbing = (self._coefficients.static[0], self._coefficients.kinetic[0]), []
        for facing, x, normal in sets:
            for found, law in zip(normal, facing.barriers, strict=True):
                if len(found):
                    pairs = self._kit.TangentialCollisions()
                    pairs.build(facing.mesh, x, found, law, *mu)
                    rubbing.append((facing, law, pairs))
        return rubbing

    def _orient(self, facing: Facing, found: Any) -> None:
        """Give each pair the coefficients along its way. Their derivative is not in the matrix of pairs."""
        pairs, places = [found[k] for k in range(len(found))], (facing.edges, facing.faces)
        slid, x = self._way(facing), facing.x
        nodes = np.array([pair.vertex_ids(*places) for pair in pairs]).reshape(-1, 4)
        ways = np.array([pair.relative_velocity(pair.dof(slid, *places)) for pair in pairs]).reshape(-1, 3)
        bases = np.array([pair.tangent_basis for pair in pairs]).reshape(-1, 3, 2)
        ways = np.einsum("pik,pjk,pj->pi", bases, bases, ways)
        weights = np.zeros(nodes.shape)
        for k, pair in enumerate(pairs):
            weights[k, : pair.num_vertices()] = np.abs(pair.compute_coefficients(pair.dof(x, *places)))
        weights[(nodes < 0) | (nodes >= facing.count)] = 0.0
        every = np.where((nodes < 0) | (nodes >= facing.count), 0, nodes).ravel()
        mu, _ = self._coefficients.along(every, np.repeat(ways, 4, axis=0), x[: facing.count])
        mean = np.sum(mu.reshape(2, -1, 4) * weights, axis=2) / weights.sum(axis=1)
        for pair, static, kinetic in zip(pairs, *mean, strict=True):
            pair.mu_s_effective_lagged, pair.mu_k_effective_lagged = static, kinetic

    def _ways(self, facing: Facing) -> tuple[Array, Array, Array]:
        """Present places, no way before, and the way since the last commit."""
        return facing.x, np.zeros(facing.x.shape, order="F"), self._way(facing)

    def _way(self, facing: Facing) -> Array:
        return np.asfortranarray(facing.x - self._around.x0[facing.which])

    def _blocks(self) -> Blocks:
        near = self._around.collisions
        closed = near.gaps.friction(near.x, self._around.x0, self._length, self._coefficients, True, self._around.still)
        return [(one, change) for one, (_, change) in zip(near.gaps.near, closed, strict=True)]

    def _matrices(self) -> list[Any]:
        self._forces()
        found: list[Any] = []
        for facing, law, pairs in self._pairs:
            by = type(self._law).DiffWRT
            for wrt in (by.VELOCITIES, by.LAGGED_DISPLACEMENTS):
                own = self._law.force_jacobian(pairs, facing.mesh, *self._ways(facing), law, wrt, facing.offset)
                found.append(facing.of_all(-own))
        return found

    def energy(self) -> float:
        """None is stored."""
        return 0.0

    def _step_loss(self) -> float:
        around = self._around
        if not self._first:
            return 0.0
        return float(np.sum(self._forces() * (around.collisions.x - around.x0)))

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

    def past(self) -> Any:
        """See `Term.past`."""
        return self._lost, super().past()

    def take_back(self, past: Any) -> None:
        """See `Term.take_back`."""
        self._lost, own = past
        super().take_back(own)


class Lagged(Friction):
    """Friction at the normal force of the start of a step, along the surfaces of then: it has a potential.

    So statics can go downhill. It is of first order in the step, and what comes to touch slides freely until the next.
    There is one coefficient for all directions.
    """

    symmetric = True
    _since: Array | None = None
    _start: list[Near]

    def _slid(self) -> None:
        """Let `_pairs` and `_start` be those of the start of the step."""
        near, x0 = self._around.collisions, self._around.x0
        if self._since is not x0:
            self._since, self._start = x0, near.gaps.look(x0)
            sets = [(facing, np.asfortranarray(x0[facing.which]), facing.at(x0)) for facing in near.facings]
            self._pairs = self._rubbing(sets)
        self._smooth()

    def _in_closed_form(self) -> list[tuple[float, Array, Array]]:
        near, mu = self._around.collisions, (self._coefficients.static[0], self._coefficients.kinetic[0])
        return near.gaps.lagged(self._start, near.x, self._around.x0, self._length, mu)

    def _forces(self) -> Array:
        self._slid()
        near = self._around.collisions
        total = np.zeros(near.x.shape)
        for facing, _, pairs in self._pairs:
            total[facing.which] += self._law.gradient(pairs, facing.mesh, self._way(facing)).reshape(-1, 3)
        near.gaps.add([force for _, force, _ in self._in_closed_form()], total, self._start)
        return total

    def _blocks(self) -> Blocks:
        self._slid()
        return [(one, change) for one, (_, _, change) in zip(self._start, self._in_closed_form(), strict=True)]

    def _matrices(self) -> list[Any]:
        self._slid()
        each = [(facing, self._law.hessian(pairs, facing.mesh, self._way(facing))) for facing, _, pairs in self._pairs]
        return [facing.of_all(own) for facing, own in each]

    def potential(self) -> float:
        """See `Term.potential`."""
        self._slid()
        if not self._first:
            return 0.0
        closed = sum(part for part, _, _ in self._in_closed_form())
        each = [self._law(pairs, facing.mesh, self._way(facing)) for facing, _, pairs in self._pairs]
        return float(closed + sum(each))
