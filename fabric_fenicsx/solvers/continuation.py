"""What it takes to go through many loads, and arc length, which follows where loads must fall."""

import itertools
import math
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from tqdm import tqdm

from ..errors import InputError, StepFailed
from . import held


class Solver(Protocol):
    """What a way needs of a solver; see `statics.StaticSolver`. Vectors are PETSc's."""

    comm: MPI.Comm
    u: Any
    snes: Any
    residuals: list[float]
    displacements: np.ndarray

    @property
    def iterations(self) -> int: ...

    def solve(self) -> int: ...
    def commit(self) -> None: ...
    def begin(self) -> Any: ...
    def aim(self) -> None: ...
    def residual(self, x: Any) -> Any: ...
    def assemble(self, x: Any, b: Any) -> None: ...
    def factorised(self, *right: Any) -> Any: ...
    def converged(self, snes: Any, iteration: int, norms: tuple[float, float, float]) -> int | None: ...
    def failure(self, reason: str) -> StepFailed: ...


@dataclass(frozen=True)
class Step:
    """What it took to reach one load."""

    number: int
    load: float
    newton_iterations: int
    step_cuts: int
    wall_s: float


def progress_bar(steps: int, name: str | None, comm: MPI.Comm) -> Any:
    """A bar of that many steps on rank 0 of a terminal, and a line each half minute elsewhere; without a name, none."""
    shown = name is not None and comm.rank == 0
    if shown and not sys.stderr.isatty():
        return Lines(steps, str(name))
    return tqdm(total=steps, desc=name, unit="step", disable=not shown, leave=False, mininterval=0.2)


class Lines:
    """What a bar is where it would tear a file apart: a whole line now and then, as far as tqdm's names are needed."""

    every = 30.0  # s

    def __init__(self, steps: int, name: str) -> None:
        self._steps, self._name, self._done, self._said = steps, name, 0, ""
        self._last = time.monotonic()

    def __enter__(self) -> "Lines":
        return self

    def __exit__(self, *fault: object) -> None:
        """A file needs no clearing."""

    def close(self) -> None:
        """A file needs none."""

    def set_postfix(self, refresh: bool = True, **numbers: object) -> None:
        """What the next line ends with."""
        self._said = ", ".join(f"{name}={value}" for name, value in numbers.items())

    def set_postfix_str(self, said: str, refresh: bool = True) -> None:
        """What the next line ends with."""
        self._said = said

    def update(self) -> None:
        """One step more."""
        self._done += 1
        if time.monotonic() - self._last >= self.every:
            self._last = time.monotonic()
            print(f"{self._name}: {self._done} of {self._steps} steps, {self._said}", file=sys.stderr, flush=True)


def arc_length(
    solver: Solver,
    set_load: Callable[[float], None],
    first: float,
    start: float = 0.0,
    *,
    wanted: int = 4,
    longest: float = math.inf,
    smallest: float = 1 / 256,
    most: int = 15,
) -> Iterator[Step]:
    """Follow equilibrium along its path, also where the load or the displacement must go back; without end.

    `set_load(load)` puts a load into the scene: forces, or Dirichlet values, that are linear in it. The first
    step goes from `start` to `start + first`. A later one has a given length, the root mean square over the
    nodes of the change of displacement, in m, and its load is unknown; it sets out along the parabola
    through the last states. Its length grows or shrinks towards `wanted` Newton iterations, up to `longest`.
    A step that fails, or takes more than `most`, is restored and halved; below `smallest` of the first
    StepFailed is raised, on every rank, with the last good state in place. Leave the loop to stop.

    The length is that of Crisfield's cylinder (1981, doi 10.1016/0045-7949(81)90108-5), without the angles of a
    shell, but Newton's method meets it along with equilibrium: two solves with one factorisation.
    Hooks and directors are committed once a step, before it is yielded.

    Measured on the thin roof of `demos/snap_through.py`: 3.2 factorisations a step, as many as with Crisfield's
    quadratic equation, between whose roots one would have to choose. To set out along the tangent takes one
    more; along the last step, half as many in this roof, but twice as many to roll up a thin strip.
    SNESNEWTONAL of PETSc 3.25 takes 3.3, but goes the whole way in one solve, where nothing can be
    committed or cut, by steps of one length: ten times too long a one jumps, or never arrives.
    """
    if not (np.isfinite(first) and first != 0.0):
        raise InputError(f"The first load of a path must be a number other than 0, not {first!r}.")
    load = float(start)
    held.require(solver, set_load, load, load + first)
    way: _Way | None = None
    before: _Way | None = None
    # length of a step: that of the whole first one, m, times part
    whole, part = 0.0, 1.0
    for number in itertools.count(1):
        clock, iterations, cuts = time.perf_counter(), 0, 0
        while True:
            try:
                if way is None:
                    new = _first_step(solver, set_load, load, part * first)
                    whole = new.length / part
                else:
                    new = _next_step(solver, set_load, load, first, _ahead(way, before, part * whole), most)
                break
            except StepFailed as error:
                cuts, part = cuts + 1, part / 2
                iterations += len(solver.residuals) - 1
                set_load(load)
                if part < smallest:
                    raise StepFailed(
                        f"Step {number} of the path stopped at load {load:.6g}, after {cuts} cuts of its length: "
                        f"{error}. A shorter first step, or a smoother load, may help."
                    ) from None
        solver.commit()
        before, way = way, new
        load += way.rise
        yield Step(number, load, iterations + way.iterations, cuts, time.perf_counter() - clock)
        part *= min(2.0, max(0.5, math.sqrt(wanted / max(1, way.iterations))))
        part = min(part, longest / whole)


@dataclass(frozen=True)
class _Way:
    """A step along a path: its length (m), change of the unknowns, change of the load, iterations."""

    length: float
    change: Any
    rise: float
    iterations: int = 0


def _ahead(last: _Way, before: _Way | None, length: float) -> _Way:
    """The last step, or the parabola through the last two, gone on by a length.

    Angles of a shell are from the last commit, which carries its frames along: their changes go on as they are.
    """
    a, b = length / last.length, 0.0
    change, rise = last.change * a, last.rise * a
    if before is not None:
        bend = length * (length + last.length) / (last.length + before.length)
        a, b = bend / last.length, bend / before.length
        change, rise = change + last.change * a - before.change * b, rise + last.rise * a - before.rise * b
    return _Way(length, change, rise)


def _product(solver: Solver, a: Any, b: Any) -> float:
    """Mean over the nodes of the products of two displacements, m2."""
    own = solver.displacements
    total, count = solver.comm.allreduce(np.array([a.array_r[own] @ b.array_r[own], len(own)]))
    return float(total / count) * solver.u.function_space.mesh.geometry.dim


def _first_step(solver: Solver, set_load: Callable[[float], None], load: float, rise: float) -> _Way:
    """To a given load."""
    start = solver.begin().copy()
    set_load(load + rise)
    iterations = solver.solve()
    change = solver.begin() - start
    length = math.sqrt(_product(solver, change, change))
    if length == 0.0:
        raise InputError("The load moves nothing: a path cannot start.")
    return _Way(length, change, rise, iterations)


def _next_step(
    solver: Solver, set_load: Callable[[float], None], load: float, unit: float, guess: _Way, most: int
) -> _Way:
    """As long as the guess, by Newton's method for unknowns and load. `unit`: a difference of loads."""

    def put(value: float) -> None:
        set_load(value)
        solver.aim()

    x = solver.begin()
    start, by_residual, by_load, slope = x.copy(), x.duplicate(), x.duplicate(), x.duplicate()
    length, change, rise, correction = guess.length, guess.change.copy(), guess.rise, math.inf
    for iteration in range(most + 1):
        start.copy(x)
        x.axpy(1.0, change)
        put(load + rise)
        residual = solver.residual(x)
        norm = residual.norm()
        if solver.converged(None, iteration, (x.norm(), correction, norm)) is not None:
            if _product(solver, change, guess.change) > 0.0:
                return _Way(length, change, rise, iteration)
            raise solver.failure("the path turned back")
        if not np.isfinite(norm):
            raise solver.failure("residual is not a number")
        residual = residual.copy()
        put(load + rise + unit)
        solver.assemble(x, slope)
        slope.axpy(-1.0, residual)
        put(load + rise)
        solver.assemble(x, by_load)  # the matrix is that of the present load
        ksp = solver.factorised(residual, slope)
        ksp.solve(residual, by_residual)
        solved = ksp.getConvergedReason() > 0
        ksp.solve(slope, by_load)
        # x moves by -by_residual - more by_load, so that |change| becomes `length`, linearly
        moved = _product(solver, change, by_load)
        if not solved or ksp.getConvergedReason() < 0 or moved == 0.0:
            raise solver.failure("Jacobian is singular")
        more = ((_product(solver, change, change) - length**2) / 2 - _product(solver, change, by_residual)) / moved
        by_residual.axpy(more, by_load)
        change.axpy(-1.0, by_residual)
        rise += more * unit
        correction = by_residual.norm()
    raise solver.failure("too many iterations")
