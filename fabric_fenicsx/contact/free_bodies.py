"""The free bodies of a sheet: their unknowns, inertia and weight, as a term."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse

from ..errors import InputError
from ..laws import Array, Stiffest
from ..terms.extra import Extra, Rule
from ..terms.term import NOWHERE, Indices
from .bodies import Body
from .free_body import FreeBody
from .skin import Skin


class FreeBodies(Extra):
    """All of them, of one sheet. gravity: m/s2, may be changed; it accelerates them as their weight does."""

    symmetric = True

    def __init__(self, skin: Skin, bodies: Sequence[Body], starts: Sequence[int], gravity: Sequence[float]) -> None:
        self._skin, self.bodies, self.count = skin, list[FreeBody](), 0
        self.gravity = np.array(gravity, dtype=float)
        if self.gravity.shape != (3,) or not np.isfinite(self.gravity).all():
            raise InputError(f"The gravity of contact, {gravity!r}, is not three numbers in m/s2.")
        for body, start in zip(bodies, starts, strict=True):
            if body.mass is not None:
                own = slice(start, start + len(body.rest))
                self.bodies.append(FreeBody(body, own, self.count))
                self.count = self.bodies[-1].own.stop
        self._rule: Rule | None = None
        self.change, self._now = np.zeros(self.count), np.zeros(self.count)
        self.unknowns = skin.beyond + np.arange(self.count).reshape(-1, 3)
        """Their global numbers, three in a row."""
        self.here = skin.last
        """Whether this rank has their rows."""

    @property
    def values(self) -> Array:
        """See `Extra`."""
        return self._now

    @values.setter
    def values(self, values: Array) -> None:
        self._now = values
        for body in self.bodies:
            body.place(values[body.own])
            if self._rule is not None and self._rule.dt > 0.0:
                body.follow(self._rule)

    def after(self, x: Array) -> None:
        """Put corners where they are after `change`, into all bodies' x (n, 3)."""
        for body in self.bodies:
            x[body.corners] = body.moved(self._now[body.own] + self.change[body.own])[0]

    def put(self, x: Array) -> None:
        """Put corners where they are now, into all bodies' x (n, 3)."""
        for body in self.bodies:
            x[body.corners] = body.x

    def straight(self, offset: float) -> float:
        """The part of `change` in which no corner is further from its straight way than half of the offset."""
        part = 1.0
        for body in self.bodies:
            angle = float(np.linalg.norm(self.change[body.own][3:]))
            part = min(part, np.sqrt(4 * offset / body.size) / max(angle, 1e-300))
        return part

    def pulled(self, forces: Array) -> Array:
        """Forces on all bodies' corners (n, 3), at the unknowns."""
        return np.concatenate([body.pulled(forces[body.corners]) for body in self.bodies])

    def reduced(self, parts: Sequence[Any], forces: Array) -> scipy.sparse.coo_array:
        """A derivative by all corners, a sum, those of the sheet first, by the sheet's and by the unknowns instead.

        forces: on all corners (n, 3).
        """
        count, n = len(self._skin.rest), forces.size
        kept = scipy.sparse.eye_array(3 * count, format="coo")
        rows, columns, values = [kept.row], [kept.col], [kept.data]
        bent = np.zeros((self.count, self.count))
        for body in self.bodies:
            first = 3 * (count + body.corners.start)
            entries = body.derivative().reshape(-1, body.own.stop - body.own.start)
            i, j = np.indices(entries.shape)
            rows.append(first + i.ravel())
            columns.append(3 * count + body.own.start + j.ravel())
            values.append(entries.ravel())
            bent[body.own, body.own] = body.bend(forces[count:][body.corners])
        data, i, j = (np.concatenate(part) for part in (values, rows, columns))
        turn = scipy.sparse.csr_array((data, (i, j)), shape=(n, 3 * count + self.count))
        i, j = np.indices(bent.shape) + 3 * count
        curved = scipy.sparse.csr_array((bent.ravel(), (i.ravel(), j.ravel())), shape=(turn.shape[1],) * 2)
        kept = [scipy.sparse.csr_array(part) for part in parts]
        for part in kept:
            part.resize(n, n)  # bodies in closed form have no entries
        return (sum(turn.T @ (part @ turn) for part in kept) + curved).tocoo()

    # -- a term ----------------------------------------------------------------------------------------------------

    def join(self, rule: Rule) -> None:
        """See `Extra.join`."""
        self._rule = rule

    def evaluate(self, tangent: bool = True, stiffest: Stiffest = False) -> bool:
        """See `Term.evaluate`."""
        return bool(np.isfinite(self._now).all())

    def add_force(self, total: Array) -> None:
        """See `Term.add_force`."""

    def add_extra_force(self, total: Array) -> None:
        """See `Term.add_extra_force`."""
        if self._rule is not None and self._rule.dt > 0.0:
            total += np.concatenate([body.force(self.gravity) for body in self.bodies])

    def pattern(self) -> tuple[Indices, Indices]:
        """See `Term.pattern`."""
        if not self.here:
            return NOWHERE
        rows = [self.unknowns.ravel()[body.own] for body in self.bodies]
        every = [(np.repeat(own, len(own)), np.tile(own, len(own))) for own in rows]
        return np.concatenate([i for i, _ in every]), np.concatenate([j for _, j in every])

    def add_stiffness(self, values: Array) -> None:
        """See `Term.add_stiffness`."""
        if self.here and self._rule is not None:
            parts = [body.stiffness(self._rule.shift, self.gravity).ravel() for body in self.bodies]
            values += np.concatenate(parts)

    def commit(self) -> None:
        """See `Term.commit`."""
        for body in self.bodies:
            body.commit()
        self._now = np.zeros(self.count)

    def restore(self) -> None:
        """See `Term.restore`."""
        for body in self.bodies:
            body.restore()
        self._now = np.zeros(self.count)

    def past(self) -> dict[str, float]:
        """See `Term.past`."""
        return self.numbers()

    def take_back(self, past: dict[str, float]) -> None:
        """See `Term.take_back`."""
        self.set_numbers(past)

    # -- a motion --------------------------------------------------------------------------------------------------

    def start(self, force: Array) -> None:
        """See `Extra.start`."""
        for body in self.bodies:
            body.accelerate(force[body.own], self.gravity)
            body.commit()

    def rates(self) -> Array:
        """See `Extra.rates`."""
        every = [(body.own.stop - body.own.start, np.concatenate(body.motion(body.v))) for body in self.bodies]
        return np.concatenate([rates[:size] for size, rates in every])

    def hit(self, force: Array) -> None:
        """See `Extra.hit`."""
        assert self._rule is not None
        for body in self.bodies:
            body.hit(force[body.own], self._rule)

    def aim(self, dt: float) -> None:
        """See `Extra.aim`."""
        self.change = np.concatenate([body.step(dt) for body in self.bodies])

    def slow(self, part: float) -> None:
        """See `Extra.slow`."""
        for body in self.bodies:
            body.v, body.a = part * body.v, part * body.a

    def drift(self, dt: float) -> None:
        """See `Extra.drift`."""
        self._now = np.concatenate([body.drift(dt) for body in self.bodies])

    def kick(self, force: Array, dt: float) -> None:
        """See `Extra.kick`."""
        for body in self.bodies:
            body.accelerate(force[body.own], self.gravity)
            body.v = body.v + 0.5 * dt * body.a
            body.lay()

    def kinetic(self) -> float:
        """See `Extra.kinetic`."""
        return float(sum(np.sum(body.inertia(body.v) * body.v) for body in self.bodies)) / 2

    def weighed(self) -> tuple[Array, Array, Array]:
        """See `Extra.weighed`."""
        x = [body.at for body in self.bodies]
        dead = [-body.inertia(np.broadcast_to(self.gravity, body.at.shape)) for body in self.bodies]
        moved = [body.inertia(body.stage) for body in self.bodies]
        return _flat(x), _flat(dead), _flat(moved)

    def jump(self) -> Array:
        """See `Extra.jump`."""
        return _flat([body.inertia(body.jump) for body in self.bodies])

    def lag(self) -> float:
        """See `Extra.lag`."""
        return float(sum(np.sum(body.inertia(body.a) * body.a) for body in self.bodies))

    def numbers(self) -> dict[str, float]:
        """See `Extra.numbers`."""
        states = {body.body.name: body.state() for body in self.bodies}
        return {f"{name}_{i}": float(value) for name, state in states.items() for i, value in enumerate(state)}

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """See `Extra.set_numbers`."""
        for body in self.bodies:
            size = len(body.state())
            body.set_state(np.array([numbers[f"{body.body.name}_{i}"] for i in range(size)]))
        self._now = np.zeros(self.count)


def _flat(parts: Sequence[Array]) -> Array:
    return np.concatenate([part.ravel() for part in parts])
