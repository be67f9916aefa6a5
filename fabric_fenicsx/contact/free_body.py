"""A body with mass that moves as the sheet lets it, by the rule that moves the sheet.

It is points with mass, held together: one in its middle, or, where it turns, a pair on each of its main axes. From
the last commit on it has moved and turned to x = c + s + R(w) a, as a rigid group of a shell (`shell.bodies`), and the
rule of the time step is applied to the points. After a step their motion is laid into that of a rigid body which has
the same momentum.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..laws import Array
from ..shell.bodies import second, turned
from ..terms.extra import Rule
from .bodies import Body


class FreeBody:
    """A free body. Public: `corners`, of all bodies', that are its own; `own`, of all unknowns; `x`, its corners now.

    The motion is kept as that of points: `v`, `a`, `stage` and `jump`, see `solvers.motion`.
    """

    def __init__(self, body: Body, corners: slice, first: int) -> None:
        self.body, self.corners = body, corners
        mass, self.centre = float(body.mass or 0.0), body.middle.copy()
        self._masses, self._rest = np.array([mass]), np.zeros((1, 3))
        if body.inertia is not None:
            moments, axes = np.linalg.eigh(body.inertia)
            spread = np.sqrt(3 / mass * np.maximum(moments.sum() / 2 - moments, 0.0))
            half = (axes * spread).T
            self._masses, self._rest = np.full(6, mass / 6), np.concatenate([half, -half])
        self.turns = body.inertia is not None
        self.own = slice(first, first + (6 if self.turns else 3))
        self._turn, self._arms0 = np.eye(3), body.rest - body.middle
        self.size = float(np.linalg.norm(self._arms0, axis=1).max())
        self._settle()
        r = self._points
        self.v = np.array(body.velocity) + np.cross(np.array(body.spin), r)
        self.a, self.stage, self.jump = (np.zeros_like(r) for _ in range(3))
        self._kept = self.v.copy(), self.a.copy(), self.stage.copy()

    def _settle(self) -> None:
        """Its present turn is that of the last commit."""
        self._arms, self._points = self._arms0 @ self._turn.T, self._rest @ self._turn.T
        self.at0 = self.centre + self._points
        self.place(np.zeros(self.own.stop - self.own.start))

    def moved(self, values: Array) -> tuple[Array, Array, Array, Array]:
        """Corners and mass points at these unknowns, and their derivatives by a turn."""
        if not self.turns:
            none = np.empty((0, 3, 3))
            return self.centre + values + self._arms, self.centre + values + self._points, none, none
        (x, by_w), (points, points_by_w) = (turned(values[3:], v) for v in (self._arms, self._points))
        return self.centre + values[:3] + x, self.centre + values[:3] + points, by_w, points_by_w

    def place(self, values: Array) -> None:
        """Put it where its unknowns are."""
        self._values = values
        self.x, self.at, self._by_w, self._points_by_w = self.moved(values)

    def pulled(self, forces: Array, points: bool = False) -> Array:
        """Forces on its corners, or points, at its unknowns."""
        total = forces.sum(axis=0)
        if not self.turns:
            return np.asarray(total)
        by_w = self._points_by_w if points else self._by_w
        return np.concatenate([total, np.einsum("ni,nij->j", forces, by_w)])

    def derivative(self) -> Array:
        """Of its corners by its unknowns, (n, 3, 3 or 6)."""
        shifts = np.tile(np.eye(3), (len(self.x), 1, 1))
        return np.concatenate([shifts, self._by_w], axis=2) if self.turns else shifts

    def bend(self, forces: Array) -> Array:
        """Of forces on its corners: second derivative of their work by its unknowns."""
        result = np.zeros((self.own.stop - self.own.start,) * 2)
        if self.turns:
            result[3:, 3:] = second(self._values[3:], self._arms, forces)
        return result

    # -- motion --------------------------------------------------------------------------------------------------------

    def follow(self, rule: Rule) -> None:
        """Velocity and acceleration that belong to the present place."""
        v0, a0, _ = self._kept
        dt, beta = rule.dt, rule.beta
        self.a = (self.at - self.at0 - dt * v0) / (beta * dt**2) - (0.5 / beta - 1.0) * a0
        self.v = v0 + dt * ((1.0 - rule.gamma) * a0 + rule.gamma * self.a)
        self.stage = (1.0 - rule.alpha_m) * a0 + rule.alpha_m * self.a

    def inertia(self, rates: Array) -> Array:
        """Mass times velocity or acceleration of the points."""
        return np.asarray(self._masses[:, None] * rates)

    def force(self, gravity: Array) -> Array:
        """Inertia less weight, at its unknowns."""
        return self.pulled(self.inertia(self.stage - gravity), points=True)

    def stiffness(self, shift: float, gravity: Array) -> Array:
        """Derivative of `force`."""
        result = shift * self._metric()
        if self.turns:
            result[3:, 3:] += second(self._values[3:], self._points, self.inertia(self.stage - gravity))
        return result

    def _metric(self) -> Array:
        """Mass of its unknowns."""
        if not self.turns:
            return self._masses[0] * np.eye(3)
        J = np.concatenate([np.tile(np.eye(3), (len(self.at), 1, 1)), self._points_by_w], axis=2)
        return np.asarray(np.einsum("n,nij,nik->jk", self._masses, J, J))

    def pushed(self, force: Array) -> Array:
        """Acceleration of the points, at no speed, by a residual force at its unknowns."""
        change = -np.linalg.pinv(self._metric(), 1e-13, hermitian=True) @ force
        return np.asarray(change[:3] + (self._points_by_w @ change[3:] if self.turns else np.zeros((1, 3))))

    def _arms_of_points(self) -> Array:
        return self.at - self._masses @ self.at / self._masses.sum()

    def motion(self, v: Array) -> tuple[Array, Array]:
        """Velocity of the middle and spin, of the rigid motion that has the momentum of the points' v."""
        mean, r = self._masses @ v / self._masses.sum(), self._arms_of_points()
        return mean, self._spin(np.cross(r, self.inertia(v)).sum(axis=0)) if self.turns else np.zeros(3)

    def _spin(self, moment: Array) -> Array:
        """That has this angular momentum about the middle."""
        r, m = self._arms_of_points(), self._masses
        inertia = m @ (r * r).sum(axis=1) * np.eye(3) - (m[:, None] * r).T @ r
        return np.asarray(np.linalg.pinv(inertia, 1e-13, hermitian=True) @ moment)

    def _rigid(self, mean: Array, spin: Array) -> Array:
        """Velocities of the points."""
        return np.asarray(mean + np.cross(spin, self._arms_of_points()))

    def _inwards(self, spin: Array) -> Array:
        return np.cross(spin, np.cross(spin, self._arms_of_points()))

    def lay(self) -> None:
        """Make velocity and acceleration those of a rigid body with the same momentum."""
        if self.turns:
            mean, spin = self.motion(self.v)
            inwards = self._inwards(spin)
            self.v = self._rigid(mean, spin)
            self.a = self._rigid(*self.motion(self.a - inwards)) + inwards

    def hit(self, force: Array, rule: Rule) -> None:
        """See `Extra.hit`."""
        a = self.jump = self.pushed(force)
        self.a = self.a - a / (2 * rule.beta)
        self.stage = self.stage - rule.impulses * a
        self.v = self.v + rule.dt * (1.0 - rule.gamma / (2 * rule.beta)) * a
        self.lay()

    def accelerate(self, force: Array, gravity: Array) -> None:
        """Set the acceleration under a force at its unknowns, without inertia, and its weight."""
        self.a = self.pushed(force) + gravity
        self.lay()
        self.stage = self.a

    def step(self, dt: float) -> Array:
        """Its unknowns after an explicit step."""
        mean, spin = self.motion(self.v)
        more, spun = self.motion(self.a - self._inwards(spin))
        mean = dt * (mean + 0.5 * dt * more)
        return np.concatenate([mean, dt * (spin + 0.5 * dt * spun)]) if self.turns else mean

    def drift(self, dt: float) -> Array:
        """See `Extra.drift`; its unknowns. It keeps its angular momentum, not its spin."""
        values, half = self.step(dt), self.inertia(self.v + 0.5 * dt * self.a)
        moment = np.cross(self._arms_of_points(), half).sum(axis=0)
        self.place(values)
        self.v = self._rigid(values[:3] / dt, self._spin(moment) if self.turns else np.zeros(3))
        return values

    def commit(self) -> None:
        """The step to the present place has happened."""
        self.centre = self.centre + self._values[:3]
        if self.turns:
            self._turn = Rotation.from_rotvec(self._values[3:]).as_matrix() @ self._turn
        self._settle()
        self.body.target = self.x.copy()
        self._kept = self.v.copy(), self.a.copy(), self.stage.copy()

    def restore(self) -> None:
        """Back to the last commit."""
        self.place(np.zeros_like(self._values))
        self.v, self.a, self.stage = self._kept

    def state(self) -> Array:
        """All numbers of the last commit."""
        return np.concatenate([self.centre, self._turn.ravel(), *(part.ravel() for part in self._kept)])

    def set_state(self, state: Array) -> None:
        """As `state` gave them."""
        self.centre, self._turn = state[:3].copy(), state[3:12].reshape(3, 3).copy()
        self._kept = tuple(state[12:].reshape(3, -1, 3).copy())  # type: ignore[assignment]
        self._settle()
        self.body.target = self.x.copy()
        self.restore()
