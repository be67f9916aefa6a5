"""A sheet, what it may touch, and the terms that see to it."""

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..laws import Array
from ..sheet import Sheet
from ..terms.term import Term
from .barrier import Barrier
from .bodies import Body
from .coefficients import Coefficients, Directions, start_of_slip
from .collisions import Collisions
from .free_bodies import FreeBodies
from .friction import Friction, Lagged
from .pressure import pressures
from .skin import Skin
from .surroundings import Surroundings
from .triangles import edges

DENSITY = 500.0
"""kg/m3, of a fabric whose mass is not told."""
G = 9.81


class Contact:
    """Contact of a sheet with bodies and with itself; its pieces are sheets that touch each other.

        touch = Contact(cloth, [Sphere(0.3)], friction=0.3)
        run, ledger = cloth.newmark(mass, bcs, [weight, *touch.terms])

    To be made on every rank, with the sheet where it starts. Raises InputError, on every rank, where it crosses
    something there. Public: `terms`, for a solver; `bodies`, `offset`, `reach`; `stiffness`; `free`, those of the
    bodies that have mass; `rest`, places of the sheet's nodes at rest (n, 3), in the order of the ranks that own them.

    Args:
        friction: coefficient of sliding, or two, along warp and weft; static: of sticking, by default the same.
            Smoothed, it holds hardly more: from half the slip speed on the coefficient is nearer to that of sliding.
        itself: whether the sheet may touch itself, or goes through itself.
        offset: the distance, m, that always stays between nodes' surfaces; by default the largest thickness.
        reach: beyond the offset, m, from which on surfaces push; by default five times the thickness, and at most a
            tenth of the shortest edge.
        stiffness: pressure (Pa) at about half the reach. The force has no limit below that, so that it only decides how
            near things get. By default what stops the sheet, at the speed of a fall over its own size, within the
            reach; with free bodies, at least ten times their energy, at that speed and their own, over the volume of
            the box that holds them.
        slip: m/s, creep: m, see `friction`.
        lagged: whether friction is that of the normal force at the start of a step, see `friction.Lagged`; statics
            needs it to go downhill.
        carried: whether a sheet at rest is taken along with what leads it before its balance is looked for, as a
            garment is by its wearer: each node with the corner of a body that is nearest to it, or as it is held.
        gravity: acceleration of free bodies by their weight, m/s2.
    """

    def __init__(
        self,
        sheet: Sheet,
        bodies: Sequence[Body] = (),
        *,
        friction: float | Sequence[float] = 0.0,
        static: float | Sequence[float] | None = None,
        itself: bool = True,
        offset: float | None = None,
        reach: float | None = None,
        stiffness: float | None = None,
        slip: float = 1e-3,
        creep: float = 2e-5,
        lagged: bool = False,
        carried: bool = False,
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        self.bodies, skin = list(bodies), Skin(sheet)
        self.rest = skin.rest
        edge = float(edges(skin.rest, skin.faces).min())
        thickness = max(float(material.thickness) for material in sheet.materials.values())
        self.offset = thickness if offset is None else offset
        self.reach = min(5 * thickness, 0.1 * edge) if reach is None else reach
        static = friction if static is None else static
        if not all(np.shape(mu) in ((), (2,)) for mu in (static, friction)):
            raise InputError(
                f"Friction {friction!r} and static friction {static!r} are a number or two, warp and weft."
            )
        kinetic, most = np.broadcast_to(friction, 2).astype(float), np.broadcast_to(static, 2).astype(float)
        if not (np.isfinite(most).all() and (kinetic >= 0.0).all() and (kinetic <= most).all()):
            raise InputError(f"Friction {friction!r} and static friction {static!r} must be 0 <= friction <= static.")
        most = np.array([start_of_slip(*pair) for pair in zip(most, kinetic, strict=True)])
        self.assumed, stiffness = stiffness is None, stiffness or _stopping(sheet, skin.rest, bodies, self.reach)
        self.stiffness = stiffness
        positive = {"offset": self.offset, "reach": self.reach, "stiffness": stiffness, "slip": slip, "creep": creep}
        for name, value in positive.items():
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"Contact has {name} = {value!r}, which is not a positive number.")
        if itself and self.offset + self.reach > 0.5 * edge:
            raise InputError(
                f"Contact of the sheet with itself from {self.offset + self.reach:.3g} m on needs edges of twice that, "
                f"and one is {edge:.3g} m long: take larger cells, a smaller offset or reach, or itself=False."
            )
        near = Collisions(skin.rest, skin.faces, bodies, itself, self.offset, self.reach, stiffness)
        self.free = None
        if any(body.mass is not None for body in self.bodies):
            starts = [corners.start - len(skin.rest) for corners in near.corners]
            self.free = FreeBodies(skin, near.bodies, starts, gravity)
        self._around = around = Surroundings(skin, near, self.free)
        around.carries = carried
        if near.crossed() or near.least_gap() <= 0.0:
            raise InputError(
                f"The sheet starts across a body or itself, or nearer than the offset of {self.offset:.3g} m; "
                "start it clear of everything, or take a smaller offset."
            )
        self._barrier = Barrier(around)
        self._pressed: tuple[Array, Array] | None = None  # all places, and pressures there
        self._friction = []
        if most.any():
            differ = np.ptp(kinetic) > 0.0 or np.ptp(most) > 0.0
            coefficients = Coefficients(most, kinetic, Directions(sheet, skin) if differ else None)
            if lagged and differ:
                raise InputError("Lagged friction takes one coefficient for all directions.")
            self._friction = [(Lagged if lagged else Friction)(around, coefficients, slip, creep)]
        self.terms: list[Term] = [*self._friction, self._barrier, *([self.free] if self.free else [])]

    def describe(self) -> str:
        """Offset, reach and stiffness in words, and whether the last is assumed."""
        told = f"surfaces stay {self.offset:.3g} m apart and push from {self.reach:.3g} m further on, with "
        why = ", enough to stop what falls over the size of the sheet" if self.assumed else ""
        return f"{told}{self.stiffness:.3g} Pa at half of that{why}"

    # -- what a user wants to know of the present state ------------------------------------------------------------

    def least_gap(self) -> float:
        """Least distance less the offset, m; infinite where nothing is within reach."""
        self._around.place()
        return self._around.collisions.least_gap()

    def crossed(self) -> bool:
        """Whether anything has gone through anything, which it must not."""
        self._around.place()
        return self._around.collisions.crossed()

    def nodes(self) -> Array:
        """Where the sheet's nodes are now, (n, 3) in m, in the order of `Skin`."""
        self._around.place()
        return self._around.collisions.nodes

    def touching(self, body: Body) -> np.ndarray:
        """Which nodes of the sheet belong to what a body presses on, (n,)."""
        self._around.place()
        near, found, part = self._around.collisions, np.zeros(len(self.rest), dtype=bool), self._part(body)
        for one in near.gaps.near:
            if one.shape.body is body:
                found[one.grid.nodes[one.points][one.grid.shares[one.points] > 0.0]] = True
        for nodes, _, _ in near.pushes():
            if ((nodes >= part.start) & (nodes < part.stop)).any():
                found[nodes[nodes < near.count]] = True
        return found

    def forces(self, body: Body | None = None, *, friction: bool = True) -> Array:
        """Of contact and friction on the sheet's nodes, (n, 3) in N, in the order of `Skin`, or on a body's corners.

        friction: whether it counts.
        """
        self._around.place()
        with self._around.looking_back():
            part = slice(0, len(self._around.skin.rest)) if body is None else self._part(body)
            return -(self._all() if friction else self._barrier._forces())[part]

    def force(self, body: Body) -> Array:
        """Of the sheet on a body, 3 numbers in N."""
        with self._around.looking_back():
            return -self._on(body)[1].sum(axis=0)

    def moment(self, body: Body, about: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """As `force`: its moment about a point, N m."""
        with self._around.looking_back():
            x, derivative = self._on(body)
        return -np.cross(x - np.array(about), derivative).sum(axis=0)

    def pressure(self, body: Body | None = None) -> Array:
        """At the nodes of the sheet, in the order of `Skin`, or at a body's corners, Pa; see `pressure`.

        Not a number at the corners of a plane: its pressure is that of the sheet on it.
        """
        self._around.place()
        near = self._around.collisions
        if self._pressed is None or self._pressed[0] is not near.x:  # the sheet and each body ask for theirs
            self._pressed = near.x, pressures(near)
        every = self._pressed[1]
        return every[: near.count] if body is None else every[self._part(body)]

    def places(self, body: Body) -> Array:
        """Where the corners of a body are now, (n, 3) in m."""
        self._around.place()
        return self._around.collisions.x[self._part(body)]

    def lost(self) -> float:
        """Energy that friction has taken since the start, or since a ledger watches, J."""
        return float(self._around.skin.comm.allreduce(sum(term.dissipated() for term in self._friction)))

    def row(self) -> dict[str, float]:
        """Columns of a history: the least gap, and force and moment about the origin of the sheet on each body."""
        row = {"least_gap_m": self.least_gap()}
        for name, body in zip(_apart([body.name for body in self.bodies]), self.bodies, strict=True):
            for unit, values in (("N", self.force(body)), ("Nm", self.moment(body))):
                row |= {f"{name}_{axis}_{unit}": float(value) for axis, value in zip("xyz", values, strict=True)}
        return row

    def _part(self, body: Body) -> slice:
        """Its corners among all."""
        near = self._around.collisions
        return near.corners[[other is body for other in near.bodies].index(True)]

    def _all(self) -> Array:
        return np.asarray(sum((term._forces() for term in self._friction), self._barrier._forces()))

    def _on(self, body: Body) -> tuple[Array, Array]:
        """Corners of a body and the derivative of the work by them."""
        self._around.place()
        part = self._part(body)
        return self._around.collisions.x[part], self._all()[part]


def _apart(names: Sequence[str]) -> list[str]:
    """The same names, each of its own: a second ball is ball_2."""
    count = [names[:k].count(name) for k, name in enumerate(names)]
    return [f"{name}_{n + 1}" if n else name for name, n in zip(names, count, strict=True)]


def _stopping(sheet: Sheet, x: Array, bodies: Sequence[Body], reach: float) -> float:
    """Stiffness by default, Pa; see `Contact`."""
    fall = 2 * G * float(np.linalg.norm(np.ptp(x, axis=0)))
    masses = [material.areal_mass or DENSITY * float(material.thickness) for material in sheet.materials.values()]
    free = [body for body in bodies if body.mass is not None]
    energies = [float(body.mass or 0.0) * (fall + np.dot(body.velocity, body.velocity)) / 2 for body in free]
    sizes = [float(np.ptp(body.rest, axis=0).prod()) for body in free]
    parts = [10 * energy / max(size, 1e-9) for energy, size in zip(energies, sizes, strict=True)]
    return float(max([max(map(float, masses)) * fall / reach, *parts]))
