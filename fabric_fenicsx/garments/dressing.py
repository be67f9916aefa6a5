"""Dressing: the stress-free state of a garment goes from where it starts to its flat panels, around the wearer.

A garment starts clear of the body, without stress. Then its metric is relaxed: strains are measured from a state that
goes in pseudo-time from the start to the panels. The cloth shrinks, or widens, to its size, against contact with the
body and with itself, so that nothing passes through anything. In the end it is at rest on the body, its stress that of
the panels, and its place the start of scenes.

Each step is one of statics downhill, under a drag that keeps in its place what nothing holds (`solvers.drag`): it ends
in the balance that energy leads to, however the cloth buckles on the way.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem

from ..errors import InputError, StepFailed
from ..laws import Array
from ..sheet import Sheet
from ..shell import rotation
from ..solvers import checkpoint, marching
from ..solvers.continuation import Step
from ..solvers.drag import Drag
from ..surfaces import placing
from ..terms.work import InternalWork
from .sewing import Garment

AT_REST = 1e-6
"""Kinetic energy, as a part of the work that has been done, of a garment that is at rest."""
LEAST, EASING = 4, 3.0
"""Steps in which it comes to rest, at least, and by what the drag falls in each."""


class Dressing:
    """A sheet that is dressed; `march` does it, `save` keeps it, and `worn` takes it up.

        touch = Contact(cloth, [arm])
        dressing = Dressing(cloth, touch.terms)
        for step in dressing.march(): ...
        dressing.save("worn.npz")

    Public: `sheet`; `solver`; `relaxed`, from 0 to 1; `stored`, the energy of sheet and contact, J.

    Args:
        sheet: a shell where it starts, of a garment, see `sewing.Garment.sheet`.
        loads: what acts on it, see `Sheet.equilibrium`: contact at least. With friction there is no energy, unless it
            is lagged, and Newton's method alone gets stuck where cloth buckles.
        bcs: what holds it.
        areal_mass: kg/m2, by default that of its materials; with the time it decides about the drag, and nothing in
            the end.
        time: in which the metric is relaxed, s; it sets the unit of the drag.

    Raises InputError for a membrane, or a sheet that starts where it is at rest.
    """

    def __init__(
        self,
        sheet: Sheet,
        loads: Any,
        bcs: Sequence[fem.DirichletBC] = (),
        *,
        areal_mass: Any = None,
        time: float = 0.4,
    ) -> None:
        if sheet.shell is None or sheet.domain.placement is None:
            raise InputError("Only a shell that has been sewn from panels can be dressed.")
        if not (np.isfinite(time) and time > 0.0):
            raise InputError(f"A time of {time!r} s to dress in is not a positive number.")
        self.sheet, self.time, self.relaxed = sheet, time, 0.0
        self._works = [term for term in sheet.terms if isinstance(term, InternalWork)]
        mass = sheet.areal_mass if areal_mass is None else areal_mass
        self._drag = Drag(sheet.q, sheet.mass(mass, "cell"), 1.0)
        every = [*(loads if isinstance(loads, Sequence) else [loads]), self._drag]
        self.solver = sheet.equilibrium(bcs, every, rtol=1e-4)
        self.stir, self._comm = np.inf, sheet.domain.mesh.comm
        """Kinetic energy, had the last step taken as long as one of `march`, as a part of the work done so far."""

    def _relax(self, t: float) -> None:
        """Smoothly, so that it starts and ends without a blow."""
        s = min(max(t / self.time, 0.0), 1.0)
        self.relaxed = s * s * (3.0 - 2.0 * s)
        for work in self._works:
            work.relax(self.relaxed)

    @property
    def stored(self) -> float:
        """See above."""
        return float(self._comm.allreduce(sum(term.energy() or 0.0 for term in self.solver.terms)))

    def march(self, dt: float = 0.02, *, most: int = 60, progress: str | None = None) -> Iterator[Step]:
        """Relax in steps of dt (s), then go on until it is at rest, in `most` steps at most; yields each.

        History on the way there is forgotten: it is that of no real dressing. Raises StepFailed where it does not come
        to rest.
        """
        self._drag.coefficient, before = 2.0 / dt**2, self._comm.allreduce(self._drag.taken)
        count = max(int(np.ceil(self.time / dt - 1e-9)), 1)
        times = self.time * np.arange(1, count + most + 1) / count
        for step in marching.march(self.solver, self._relax, times, progress=progress):
            taken = self._comm.allreduce(self._drag.taken)
            moved = (taken - before) / self._drag.coefficient / dt**2
            before, self.stir = taken, moved / 2.0 / max(abs(self.stored) + taken, 1e-300)
            yield step
            if step.number == count:
                for points in self.sheet.points:
                    points.begin(points.law)
            if step.number >= count:
                self._drag.coefficient /= EASING
            if step.number >= count + LEAST and self.stir < AT_REST:
                return
        raise StepFailed(
            f"The garment is not at rest after {most} steps more: its kinetic energy is {self.stir:.1e} of the work. "
            "Is it held, or does something pull it on?"
        )

    def save(self, path: str | Path) -> None:
        """Keep where it is, for `worn`; to be called on every rank. Raises InputError if it cannot be written."""
        checkpoint.save(path, _Worn(self.sheet.domain.mesh, *_now(self.sheet)))


def worn(path: str | Path, garment: Garment, of: Any, **options: Any) -> Sheet:
    """The sheet of a garment, sewn as that which was saved, where it was then; its displacements begin there.

    of, options: see `Garment.sheet`; at rest it is the flat panels. To be called on every rank, once for a garment.
    Raises InputError for a file that is none, or of another garment.
    """
    mesh = garment.domain.mesh
    count, nodes = placing.cells(mesh).shape[:2]
    cells, sides = (6, 3) if nodes == 3 else (nodes, 4)
    state = _Worn(mesh, np.zeros((count, 3 * cells)), np.zeros((count, 3 * sides)))
    checkpoint.load(path, state)
    placing.place(mesh, state.places.reshape(count, cells, 3))
    sheet = garment.sheet(of, **options)
    assert sheet.shell is not None
    directors = np.zeros((len(sheet.shell.start.x.array) // 3, 3))
    directors[sheet.shell.start.function_space.dofmap.list] = state.directors.reshape(count, sides, 3)
    sheet.shell.lay(directors)
    sheet.q.x.array[:] = sheet.shell.function().x.array
    return sheet


def _now(sheet: Sheet) -> tuple[Array, Array]:
    """Places of the nodes and directors of each local cell, a row each."""
    u, shell = sheet.displacement(), sheet.shell
    space = u.function_space
    places = placing.places(space) + u.x.array.reshape(-1, 3)
    directors, back = sheet.q.function_space.sub(1).collapse()
    d = rotation.unit(sheet.q.x.array[np.array(back)].reshape(-1, 3))
    assert shell is not None
    count = len(space.dofmap.list)
    return places[space.dofmap.list].reshape(count, -1), d[directors.dofmap.list].reshape(count, -1)


class _Worn:
    """Where a garment is, as `checkpoint` wants it."""

    def __init__(self, mesh: Any, places: Array, directors: Array) -> None:
        self.comm, self.places, self.directors = mesh.comm, places, directors
        self.q: Any = fem.Function(fem.functionspace(mesh, ("DG", 0)))
        self.pause = lambda: None

    def numbers(self) -> dict[str, float]:
        return {"worn": 1.0}

    def set_numbers(self, numbers: dict[str, float]) -> None: ...

    def fields(self) -> list[checkpoint.Field]:
        cells = np.arange(len(self.places), dtype=np.int32)
        return [("places", cells, self.places), ("directors", cells, self.directors)]

    def renew(self) -> None: ...
