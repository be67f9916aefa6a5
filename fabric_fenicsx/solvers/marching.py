"""The march from one load to the next, which can be kept by checkpoints and gone on with."""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from dolfinx import fem

from ..errors import InputError, StepFailed
from . import held, zero_energy
from .checkpoint import Field
from .continuation import Solver, Step, progress_bar


class March:
    """Solves and commits at each of `loads` in turn, from `start` on; what a `checkpoint` can keep.

    `set_load(load)` puts a load into the scene. A step that fails is restored and halved, and grows
    again once it works; parts below `smallest` of a step raise StepFailed, on every rank, with the last
    good state in place. `progress` names the bar that rank 0 shows.

    Public: `number` of loads that are done, `load`, the present one, and `reached`, the last of `loads` that was met.
    """

    def __init__(
        self,
        solver: Solver,
        set_load: Callable[[float], None],
        loads: Sequence[float],
        start: float = 0.0,
        *,
        smallest: float = 1 / 64,
        progress: str | None = None,
    ) -> None:
        if len(loads) == 0:
            raise InputError("A march needs at least one load step.")
        if not np.isfinite(loads).all():
            raise InputError("The loads of a march must be finite numbers.")
        self.comm, self.q, self.pause = solver.comm, solver.u, _nothing
        self._solver, self._set_load, self._loads = solver, set_load, [float(start), *map(float, loads)]
        self._smallest, self._progress = smallest, progress
        self.number, self.load, self._fraction = 0, float(start), 1.0

    @property
    def reached(self) -> float:
        """The last of the loads that was met."""
        return self._loads[self.number]

    @property
    def ended(self) -> bool:
        """Whether all loads are done."""
        return self.number + 1 == len(self._loads)

    def steps(self) -> Iterator[Step]:
        """A `Step` after each load. Stop early by leaving the loop."""
        solver = self._solver
        if self.ended:
            raise InputError(f"The march has reached its last load, {self.load:g}: there is nothing to go on with.")
        held.require(solver, self._set_load, self.load, self._loads[self.number + 1])
        with progress_bar(len(self._loads) - 1 - self.number, self._progress, solver.comm) as bar:
            for target in self._loads[self.number + 1 :]:
                clock, iterations, cuts, origin, part = time.perf_counter(), 0, 0, self.load, 0.0
                while part < 1.0:
                    trial = min(1.0, part + self._fraction)
                    load = target if trial == 1.0 else origin + trial * (target - origin)
                    self._set_load(load)
                    try:
                        iterations += solver.solve()
                    except StepFailed as error:
                        cuts += 1
                        iterations += solver.iterations
                        self._fraction /= 2
                        if self._fraction < self._smallest:
                            self._set_load(self.load)
                            slack = zero_energy.named(solver) if solver.scale == 0.0 else ""  # type: ignore[attr-defined]
                            raise StepFailed(
                                f"Step {self.number + 1} stopped at load {self.load:.6g} on its way to {target:.6g}, "
                                f"after {cuts} cuts of the step: {error}. {slack}Smaller steps or a smoother load may "
                                "help, or motion where cloth is slack or flat; is the load in its unit?"
                            ) from None
                        continue
                    solver.commit()
                    part, self.load = trial, load
                    self._fraction = min(1.0, 2 * self._fraction)
                self.number += 1
                bar.set_postfix(load=f"{self.load:.4g}", newton=iterations, cuts=cuts, refresh=False)
                bar.update()
                yield Step(self.number, self.load, iterations, cuts, time.perf_counter() - clock)
                self.pause()

    # -- what a checkpoint asks for -------------------------------------------------------------------------------

    def numbers(self) -> dict[str, float]:
        """Load, part of a step and sizes at the last commit."""
        solver: Any = self._solver
        own = {"number": self.number, "load": self.load, "reached": self.reached}
        return own | {"fraction": self._fraction, "scale": solver.scale}

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them. Raises InputError where this march would have come by other loads."""
        number, solver = int(numbers["number"]), self._solver
        if number >= len(self._loads) or self._loads[number] != numbers["reached"]:
            raise InputError(
                f"The checkpoint was made by a march whose load number {number} is {numbers['reached']:g}, and this "
                "one has another there: keep its steps and turns, and add new ones at the end."
            )
        self.number, self.load, self._fraction = number, numbers["load"], numbers["fraction"]
        solver.scale = numbers["scale"]  # type: ignore[attr-defined]

    def fields(self) -> list[Field]:
        """Unknowns, frames of directors and what the terms remember, at the last commit."""
        solver: Any = self._solver
        result: list[Field] = [("q", None, solver.u.x.array)]
        if solver._shell is not None:
            self._axes = solver._shell.axes()
            result += [("e1", None, self._axes[0]), ("d0", None, self._axes[1])]
        every = [field for term in solver.terms for field in term.fields()]
        return result + [(f"{name}{k}", cells, array) for k, (name, cells, array) in enumerate(every)]

    def renew(self) -> None:
        """Go on from what has been put into `fields` and `numbers`."""
        solver: Any = self._solver
        if solver._shell is not None:
            solver._shell.set_axes(*self._axes)
        self._set_load(self.load)
        take_up(solver)


def march(*arguments: Any, **options: Any) -> Iterator[Step]:
    """Solve and commit at each of some loads: the steps of a `March` of these arguments, where it need not be kept."""
    return March(*arguments, **options).steps()


def take_up(solver: Any) -> None:
    """Let a `StaticSolver` take u, directors and histories as they have been set from outside for the last commit."""
    if solver._shell is None:
        solver._y.x.array[:] = solver.u.x.array
    else:
        solver._y.x.array[:] = solver._shell.at_rest(solver.u.x.array)
        solver._shell.turn(solver._y, fem.Function(solver.u.function_space))
    solver._accepted = solver._y.x.array.copy()
    for term in solver.terms:
        term.renew()


def _nothing() -> None: ...
