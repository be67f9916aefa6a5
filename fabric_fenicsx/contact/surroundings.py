"""Where sheet and bodies are, now and at the last commit, and how far they may go."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from scipy.spatial import cKDTree

from ..laws import Array
from .collisions import Collisions
from .free_bodies import FreeBodies
from .skin import Skin


class Surroundings:
    """Sheet and bodies in their places, of the present and of the last commit.

    Public: `skin`, `collisions`, `free`; `x0`, all places at the last commit (n, 3); `masses` of the sheet's
    nodes (n,), kg, in explicit motion.
    """

    def __init__(self, skin: Skin, collisions: Collisions, free: FreeBodies | None) -> None:
        self.skin, self.collisions, self.free = skin, collisions, free
        self.led = self._targets()
        self.masses: Array | None = None
        self.carries = False
        """Whether the sheet goes along with what is led."""
        self.driven = np.ones(len(self.led), dtype=bool)
        """Corners of bodies that are led, or stay."""
        for body in free.bodies if free else []:
            self.driven[body.corners] = False
        self._placed: Array | None = None  # where bodies were led at the last `place`
        self.place()
        self.x0 = self._before = collisions.x.copy()
        self._led0 = self._led_before = self.led

    def _targets(self) -> Array:
        every = np.concatenate([np.empty((0, 3)), *(body.target for body in self.collisions.bodies)])
        if self.free:
            self.free.put(every)
        return every

    def _places(self) -> Array:
        if self.free:
            self.free.put(self.led)
        return np.concatenate([self.skin.places(), self.led])

    def place(self) -> bool:
        """Put the sheet where its unknowns are; False if that is nowhere."""
        if self.free:
            return self.collisions.place(self._places())
        nodes = self.skin.places()
        if self._placed is self.led and np.array_equal(nodes, self.collisions.nodes):
            return True
        self._placed = self.led
        return self.collisions.place(np.concatenate([nodes, self.led]))

    @property
    def still(self) -> bool:
        """Whether no body has moved since x0, as far as can be told at once."""
        return self.free is None and self.led is self._led0

    def free_part(self, change: Array) -> float:
        """The part that is free of a change of q, a local array, and of free bodies."""
        x0, part = self._places(), 1.0
        x1, count = x0.copy(), self.collisions.count
        x1[:count] += self.skin.moved(change)
        if self.free:
            part = self.free.straight(self.collisions.offset)
            self.free.after(x1[count:])
        if not np.isfinite(x1).all():
            return 1.0
        return min(part, self.collisions.free_part(x0, x1))

    def pushed(self) -> float:
        """Largest force of contact over the mass that it moves, in explicit motion, m/s2."""
        push = np.sqrt(np.einsum("ni,ni->n", *[self.collisions.gradient()] * 2))
        most = float((push[: self.collisions.count] / self.masses).max())
        for body in self.free.bodies if self.free else []:
            # as if all of it pushed at one corner of a solid
            own = push[self.collisions.count :][body.corners].sum() / body.body.mass
            most = max(most, 4.0 * float(own))
        return most

    def lead(self) -> bool:
        """Move the bodies towards their targets, as far as the sheet lets them; whether they are there."""
        led = self._targets()
        if self.free:
            self.free.put(self.led)
        if np.array_equal(led, self.led):
            return True
        x0 = self._places()
        return self._go(led, x0, x0[: self.collisions.count]) == 1.0

    def _go(self, led: Array, x0: Array, nodes: Array) -> float:
        """Lead bodies from all places x0 to where they are led, as nodes go to theirs: the part that is free."""
        part = self.collisions.free_part(x0, np.concatenate([nodes, led]))
        self.led = led if part == 1.0 else self.led + part * (led - self.led)
        return part

    def carry(self, given: Array) -> Array | None:
        """See `Term.carry`: each node goes with the corner of a body that is nearest to it."""
        led = self._targets()
        if not self.carries or self.free or np.array_equal(led, self.led):
            return None
        x0, count = self._places(), self.collisions.count
        change = self.skin.change((led - self.led)[cKDTree(self.led).query(x0[:count])[1]])
        change = np.where(np.isnan(given), change, given)
        return self._go(led, x0, x0[:count] + self.skin.moved(change)) * change

    def commit(self) -> None:
        """The step to the present places has happened."""
        self._before, self.x0 = self.x0, self.collisions.x.copy()
        self._led_before, self._led0 = self._led0, self.led

    @contextmanager
    def looking_back(self) -> Iterator[None]:
        """After a commit, take the step to it for the present one, for what depends on the way."""
        now = self.x0, self._led0
        if np.array_equal(self.collisions.x, self.x0):
            self.x0, self._led0 = self._before, self._led_before
        try:
            yield
        finally:
            self.x0, self._led0 = now

    def restore(self) -> None:
        """Back to the last commit."""
        if self.free:
            self.free.restore()
        self.led = self.x0[self.collisions.count :].copy()

    def past(self) -> tuple[Array, ...]:
        """What commits move, for `take_back`."""
        return self._before, self.x0, self._led_before, self._led0, self.led

    def take_back(self, past: tuple[Array, ...]) -> None:
        """Back to where all was as `past` was asked for."""
        self._before, self.x0, self._led_before, self._led0, self.led = past

    def renew(self) -> None:
        """Places have been set from outside; bodies are where they are led to."""
        self.led = self._targets()
        self.place()
        self.commit()
