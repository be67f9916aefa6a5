"""What a run leaves in its folder, step by step: history, fields, checkpoints; and in the end a picture and a film."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from mpi4py import MPI

from ..errors import InputError
from ..laws import Array
from ..solvers import checkpoint
from ..solvers.continuation import Step
from . import pictures, results
from .fields import PRESSURE, Fields
from .series import Colour, Series
from .showing import Shown, Touching
from .solids import drawn


class Recorder:
    """Records the steps of a run; to be used, and called with each step, on every rank.

        with Recorder(cloth, out, lambda step: {"time_s": step.load, "sag_m": sag()}, run=run) as record:
            for step in run.march(end=0.5, dt=5e-3):
                record(step)
        record.table.column("sag_m")

    The folder then holds history.csv, fields.pvd for ParaView (see `fields`), deformed.png and, where `run` is given,
    the last two checkpoints (see `checkpoint.guard`). What an earlier run left there stays until the first step is
    recorded.

    Args:
        sheet: what is recorded.
        folder: where; None keeps the table alone, in memory.
        probes: of a step, the first columns of its row: names with units -> numbers, the same on every rank. Of a
            run that is kept by checkpoints the first of all is the time of a motion, else the number of the step.
        title: of pictures; when: of a step, what follows the title.
        touch: contact of the sheet: columns of its `row` follow the probes, its pressure is among the fields, and its
            bodies are drawn and written to bodies.pvd.
        colour: of pictures, of `series.LABELS`; view: from the sheet to the eye.
        run: a motion, or a `marching.March`, to be kept by checkpoints each `save_s` seconds; marks: what they must
            have been made with, see `checkpoint.save`.
        resume: a checkpoint to go on from; True for the last one in `folder` that can be read. If it lies in `folder`,
            history and fields go on, too: what is later than the checkpoint is dropped, for it comes again. Raises
            InputError, before anything is touched.
        picture: number of the step that deformed.png shows, -1 for the last one; None for no picture.
        film: whether to make animation.gif.
        every: fields of each so manieth step only.
    """

    def __init__(
        self,
        sheet: Shown,
        folder: str | Path | None,
        probes: Callable[[Step], Mapping[str, float]],
        *,
        title: str = "",
        when: Callable[[Step], str] = lambda step: f"t = {step.load:.4g} s",
        touch: Touching | None = None,
        colour: Colour = "yarn",
        view: tuple[float, float, float] = pictures.VIEW,
        run: Any = None,
        marks: Mapping[str, object] | None = None,
        resume: str | Path | bool | None = None,
        picture: int | None = -1,
        film: bool = False,
        every: int = 1,
        save_s: float = checkpoint.EVERY,
    ) -> None:
        self.sheet, self.folder, self._probes = sheet, None if folder is None else Path(folder), probes
        self._touch = touch
        self._title, self._when, self._colour, self._picture = title, when, colour, picture
        self._run, self._marks, self._film, self._every = run, marks, film, every
        u = sheet.displacement()
        self._comm: MPI.Comm = u.function_space.mesh.comm
        until = self._go_on(resume) if resume else None
        self._save_s, self._goes_on = save_s, until is not None
        self.table = results.Table(self.folder and self.folder / "history.csv", self._comm, until=until)
        """A row for each step; of a run that goes on in its folder, those before, too."""
        self._fields = None if self.folder is None else Fields(self.folder, u, view=view, until=until)
        self._numbers: list[int] = []
        self._stack = ExitStack()

    def _go_on(self, resume: str | Path | bool) -> float | None:
        """Load a checkpoint; its time, if the history goes on with it."""
        if self.state is None:
            raise InputError("Only a run that is recorded in a folder can go on from a checkpoint.")
        file = checkpoint.last(self.state, self._comm) if isinstance(resume, bool) else Path(resume)
        if file is None:
            raise InputError(f"{str(self.folder)!r} holds no checkpoint to go on from; leave out --resume.")
        checkpoint.load(file, self._run, self._marks)
        return self._at(self._run) if file.resolve().parent == self.state.resolve().parent else None

    def _at(self, where: Any) -> float:
        """Time of a step, or of the run, if it is a motion; else its number, for loads may come back."""
        if not hasattr(self._run, "time"):
            return float(where.number)
        return float(where.load if isinstance(where, Step) else where.time)

    @property
    def state(self) -> Path | None:
        """Where the checkpoint is; None where none is kept."""
        return self.folder / "checkpoint.npz" if self.folder is not None and self._run is not None else None

    def __enter__(self) -> "Recorder":
        if self.state is not None:
            self._stack.enter_context(checkpoint.guard(self.state, self._run, self._marks, self._save_s))
        return self

    def __call__(self, step: Step, **more: float) -> dict[str, Any]:
        """Record the present state, that after `step`; its row. more: columns after those of the probes."""
        if self.state is not None and not self._goes_on:  # those of an earlier run would be gone on with
            results.on_root(self._comm, self._forget)
        self._goes_on, ledger = True, getattr(self._run, "ledger", None)
        self.table.row(
            **self._probes(step), **self._pressed(ledger), **more, newton_iterations=step.newton_iterations,
            step_cuts=step.step_cuts, **(ledger.row() if ledger else {}), wall_s=step.wall_s,
        )  # fmt: skip
        if self._fields is not None and step.number % self._every == 0:
            self.sheet.displacement()  # brings it up to date
            title = ", ".join(filter(None, (self._title, self._when(step))))
            nodes = {} if self._touch is None else {PRESSURE: self._touch.pressure()}
            self._fields.write(
                self._at(step), title, at_nodes=nodes, bodies=drawn(self._touch), **cell_values(self.sheet)
            )
            self._numbers.append(step.number)
        return self.table.rows[-1]

    def _pressed(self, ledger: Any) -> dict[str, float]:
        """Columns of contact; friction's loss is among those of a ledger, if there is one."""
        if self._touch is None:
            return {}
        return self._touch.row() | ({} if ledger else {"friction_J": self._touch.lost()})

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)
        if kind is not None or self.folder is None or not (self._numbers or self._goes_on):
            return
        results.on_root(self._comm, self._draw)

    def _forget(self) -> None:
        assert self.state is not None
        for file in (self.state, checkpoint.before(self.state)):
            file.unlink(missing_ok=True)

    def _draw(self) -> None:
        assert self.folder is not None
        series = Series(self.folder)
        if self._picture is not None:
            known = self._picture in self._numbers
            number = self._numbers.index(self._picture) - len(self._numbers) if known else -1
            series.picture(self.folder / "deformed.png", number, colour=self._colour)
        if self._film:
            series.film(self.folder / "animation.gif", self._colour)


def cell_values(sheet: Shown) -> dict[str, Array]:
    """What `Recorder` writes for each local cell, and `fields` at the nodes."""
    strain, yarns, director = sheet.cell_strain(), sheet.yarns(), sheet.cell_director()
    values = {"strain": strain[:, :3], "stress_Pa": sheet.cell_stress()}
    if strain.shape[1] >= 6:
        values["curvature_per_m"] = strain[:, 3:6]
    if director is not None:
        values["director"] = director
    return values | {"warp": yarns[:, 0], "weft": yarns[:, 1]}
