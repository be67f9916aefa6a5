"""The force that keeps surfaces apart, and what leads the bodies: a term with an energy."""

from typing import Any

from ..laws import Array
from .pairs import Blocks, PairTerm


class Barrier(PairTerm):
    """Keeps a sheet from bodies and from itself; no step may go through them. It leads the bodies, and comes last.

    Last among the terms of contact: its `commit` is theirs.
    """

    symmetric = True

    def _forces(self) -> Array:
        return self._around.collisions.gradient()

    def _matrices(self) -> list[Any]:
        return self._around.collisions.hessians()

    def _blocks(self) -> Blocks:
        return [(near, near.hessian()) for near in self._around.collisions.gaps.near]

    def longest_step(self, change: Array) -> float:
        """See `Term.longest_step`."""
        return self._around.free_part(change)

    def fastest(self, mass: Array) -> float:
        """See `Term.fastest`."""
        if self._around.masses is None:
            self._around.masses = self._skin.moved(mass)[:, 0]
        return self._around.collisions.fastest(self._around.masses)

    def follow(self) -> bool:
        """See `Term.follow`."""
        before = self._around.led
        there = self._around.lead()
        if self._around.led is not before:
            self.evaluate()
        return there

    def carry(self, given: Array) -> Array | None:
        """See `Term.carry`."""
        return self._around.carry(given)

    def energy(self) -> float:
        """See `Term.energy`."""
        return self._around.collisions.energy() if self._first else 0.0

    def potential(self) -> float:
        """See `Term.potential`."""
        return self.energy()

    def commit(self) -> None:
        """See `Term.commit`."""
        super().commit()
        self._around.commit()

    def restore(self) -> None:
        """See `Term.restore`."""
        self._around.restore()
        self.evaluate()

    def renew(self) -> None:
        """See `Term.renew`."""
        self._around.renew()
        super().renew()
