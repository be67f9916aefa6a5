"""What a garment does to its wearer: moments at joints, pressure on the skin, strain and slip of the cloth.

moment = joint_moment(touch.forces(arm), limb.rates("elbow", elbow=60.0))
on_skin = pressed(touch.pressure(arm), touch.places(arm), arm.faces)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from ..contact.bodies import Body
from ..contact.contact import Contact
from ..contact.triangles import areas_of_corners
from ..errors import InputError
from ..fabrics import Fabric
from ..laws import Array
from ..material import Material
from ..sheet import Sheet
from ..solvers.statics import StaticSolver
from ..surfaces import placing
from .limb import Joint

SUDDEN = 0.03
"""Part of the work of a step, of which more is only released in a snap."""


def joint_moment(forces: Array, rates: Array) -> float:
    """Moment with which the cloth turns a joint, N m; negative where it resists a bend that goes on.

    Args:
        forces: of the sheet on the corners of the skin (n, 3), N; see `Contact.forces`.
        rates: how far the corners go with the angle (n, 3), m/rad; see `Limb.rates`. So the work of the moment over the
            angle is that of all forces over the way of the skin, which bends, too.
    """
    return float(np.sum(forces * rates))


class Effort:
    """What it takes to lead bodies through a sheet at rest, and where it goes; a `step` after each step of a march.

        effort = Effort(touch, solver)
        for step in march(solver, arm.at, times): effort.step()

    Public: `work` of those who lead bodies and supports, J; `work_on`, of each body, by the mean of the forces at both
    ends of a step, to which `work` adds `held`, that of supports, as `step` is told it, for they are to rest else, and
    `onset`, what friction takes at once where it sets in; `stored`
    since the start, in cloth and contact; `by_law` and `by_friction`, what these took; `released`, the rest, and of it
    `snapped`, what the sheet gave up where it snapped from one balance to another: in steps that released more than 3 %
    of their work. What is left of it is the error of finite steps, which falls with their square.
    """

    def __init__(self, touch: Contact, solver: StaticSolver) -> None:
        self._touch, self._solver = touch, solver
        self.work_on, self.held = [0.0] * len(touch.bodies), 0.0
        self.stored, self.by_law, self.by_friction, self._start = 0.0, 0.0, 0.0, (0.0, 0.0)
        self.onset = self.snapped = 0.0
        self._last: list[tuple[Array, Array, Array]] = []

    def _look(self) -> list[tuple[Array, Array, Array]]:
        """Of each body, and last of the sheet: forces, friction in them, and where they act."""
        touch, found = self._touch, []
        for body in [*touch.bodies, None]:
            forces, x = touch.forces(body), touch.nodes() if body is None else touch.places(body)
            found.append((forces, forces - touch.forces(body, friction=False), x))
        return found

    def _energy(self) -> float:
        terms = self._solver.terms
        return float(self._solver.comm.allreduce(sum(term.energy() or 0.0 for term in terms)))

    def step(self, held: float = 0.0) -> None:
        """After a step, in which supports did this work, J; the first is that to the state from which on it counts."""
        now, comm, before = self._look(), self._solver.comm, (self.work, self.released)
        self.held += held
        laws = [term for term in self._solver.terms if term.loses == "law"]
        meant = 0.0  # what friction has taken, by its mean
        for k, ((f0, rubbed0, x0), (f1, rubbed1, x1)) in enumerate(zip(self._last, now, strict=bool(self._last))):
            meant -= float(np.sum((rubbed0 + rubbed1) * (x1 - x0)) / 2)
            if k < len(self.work_on):
                self.work_on[k] -= float(np.sum((f0 + f1) * (x1 - x0)) / 2)
        taken = comm.allreduce(sum(term.dissipated() for term in laws))
        for term in laws:
            term.watch()
        energy, friction = self._energy(), self._touch.lost()
        if not self._last:
            self._start, taken = (energy, friction), 0.0
        else:
            self.onset += friction - self._start[1] - self.by_friction - meant
        self._last, self.stored, self.by_friction = now, energy - self._start[0], friction - self._start[1]
        self.by_law += taken
        released = self.released - before[1]
        if released > SUDDEN * abs(self.work - before[0]):
            self.snapped += released

    @property
    def work(self) -> float:
        """Of all bodies and supports."""
        return sum(self.work_on) + self.held + self.onset

    @property
    def released(self) -> float:
        """See above."""
        return self.work - self.stored - self.by_law - self.by_friction

    def row(self) -> dict[str, float]:
        """Columns of a history, beside the friction_J of a `Recorder`."""
        work = {"work_J": self.work, "stored_J": self.stored, "dissipated_J": self.by_law}
        return {**work, "onset_J": self.onset, "released_J": self.released, "snapped_J": self.snapped}


def work(degrees: Sequence[float] | Array, moments: Sequence[float] | Array) -> Array:
    """Work of moments (N m) over their angles in degrees, up to each of them, J; by trapezoids."""
    angle, M = np.radians(degrees), np.asarray(moments, dtype=float)
    if angle.shape != M.shape or angle.ndim != 1:
        raise InputError(f"There are {angle.size} angles for {M.size} moments; give one each.")
    return np.concatenate([[0.0], np.cumsum(np.diff(angle) * (M[1:] + M[:-1]) / 2)])


@dataclass(frozen=True)
class Pressed:
    """Pressure on a skin: its mean where it is pressed and its peak, Pa, that area, and the force of it all, N."""

    mean: float
    peak: float
    area: float
    force: float


def pressed(pressure: Array, places: Array, faces: np.ndarray) -> Pressed:
    """Of a pressure at the places (n, 3), m, of a skin's corners, see `Contact.pressure`; faces: (m, 3)."""
    share = areas_of_corners(places, faces)
    on = pressure > 0.0
    area, force = float(share[on].sum()), float((share * pressure)[on].sum())
    return Pressed(force / area if on.any() else 0.0, float(pressure.max(initial=0.0)), area, force)


def skin_strain(rest: Array, now: Array, faces: np.ndarray) -> Array:
    """Principal Green strains (m, 2), the larger first, of a skin's faces (m, 3); rest, now: its corners (n, 3), m."""
    metric = []
    for x in (rest, now):
        a, b = x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]]
        metric.append(np.stack([np.stack([np.sum(p * q, axis=1) for q in (a, b)], axis=1) for p in (a, b)], axis=1))
    squares = np.linalg.eigvals(np.linalg.solve(*metric)).real
    return np.asarray(np.sort((squares - 1) / 2, axis=1)[:, ::-1])


def cloth_strain(strain: Array) -> Array:
    """Principal Green strains (n, 2), the larger first, from the strain of cells: E11, E22, 2 E12."""
    mean, half = (strain[:, 0] + strain[:, 1]) / 2, (strain[:, 0] - strain[:, 1]) / 2
    radius = np.hypot(half, strain[:, 2] / 2)
    return np.stack([mean + radius, mean - radius], axis=1)


def middles(sheet: Sheet) -> Array:
    """Where the middles of this rank's cells are now, ghosts included, (n, 3) in m."""
    u = sheet.displacement()
    V = u.function_space
    return np.asarray((placing.places(V) + u.x.array.reshape(-1, 3))[V.dofmap.list].mean(axis=1))


def near(points: Array, joint: Joint, within: float) -> np.ndarray:
    """Which points are this near to a joint, m."""
    return np.asarray(np.linalg.norm(points - np.array(joint.centre), axis=1) < within)


def beyond(strain: Array, fabric: Fabric) -> np.ndarray:
    """Where strains of cells, E11, E22 and 2 E12, pass what has been measured of a fabric: (n, 3)."""
    limits = np.array([fabric.warp.limit, fabric.weft.limit, fabric.shear.limit])
    return np.stack([strain[:, 0], strain[:, 1], np.abs(strain[:, 2])], axis=1) > limits


def fold(material: Material, radius: float) -> float:
    """How long a fold of a tight tube (radius in m) that is pressed along its axis is at its onset, m: half a wave,

        pi (D r^2 / A)^(1/4),

    A (N/m) and D (N m) means of warp and weft without strain (Timoshenko and Gere 1961, 11.1). Cells are to be a good
    deal smaller; loose cloth has longer folds.
    """
    law = material.through()
    tangent = law.respond(np.zeros((1, 6)), law.initial_state[None])[1][0]
    A, D = np.sqrt(tangent[0, 0] * tangent[1, 1]), np.sqrt(tangent[3, 3] * tangent[4, 4])
    return float(np.pi * (D * radius**2 / A) ** 0.25)


def share(mask: np.ndarray, weights: Array, comm: MPI.Comm) -> float:
    """Part of the weights, such as areas of own cells, where a mask holds, over all ranks."""
    on, total = comm.allreduce(float(weights[mask].sum())), comm.allreduce(float(weights.sum()))
    return on / total if total else 0.0


class Slip:
    """How far the nodes of a sheet slide over a body; a `step` after each step of a motion, on every rank.

    Each node goes with the place of the skin that is nearest to it at the start of a step. Public: `way`, what each has
    slid so far while the body presses on it, m, in the order of `Contact.forces`; `touching`, which are so now.
    """

    def __init__(self, touch: Contact, body: Body) -> None:
        self._touch, self._body = touch, body
        self.way = np.zeros(len(touch.nodes()))
        self._look()

    def _look(self) -> None:
        """Where the nodes and the nearest places of the skin are."""
        import pyvista

        self._nodes, x, faces = self._touch.nodes(), self._touch.places(self._body), self._body.faces
        surface = pyvista.PolyData.from_regular_faces(x, faces)
        found: Any = surface.find_closest_cell(self._nodes, return_closest_point=True)
        cells, closest = (np.asarray(part) for part in found)
        self.touching = self._touch.touching(self._body)
        self._corners = faces[cells]
        a, b, c = x[self._corners].transpose(1, 0, 2)
        rows = np.stack([a - c, b - c], axis=2)
        two = np.einsum("nij,nj->ni", np.linalg.pinv(rows), self._nodes - c)
        self._weights = np.column_stack([two, 1.0 - two.sum(axis=1)])
        self._above = np.sum((self._nodes - closest) * _normals(x[self._corners]), axis=1, keepdims=True)

    def step(self) -> Array:
        """What each node has slid since the last look, m."""
        x = self._touch.places(self._body)
        normal = _normals(x[self._corners])
        # a node that keeps to its place on the skin turns with it, too
        slid = self._touch.nodes() - np.einsum("nk,nki->ni", self._weights, x[self._corners]) - self._above * normal
        slid -= np.sum(slid * normal, axis=1, keepdims=True) * normal
        before = self.touching
        self._look()
        way = np.linalg.norm(slid, axis=1) * (before & self.touching)
        self.way += way
        return np.asarray(way)


def _normals(corners: Array) -> Array:
    """Of triangles (n, 3, 3), unit vectors (n, 3)."""
    a, b, c = corners.transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))
