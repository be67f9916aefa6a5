"""Statics downhill: Newton's method that descends the energy, and ends where equilibrium is stable.

Where every term has a potential, a step from the last commit has an energy

    E(y) = sum of potentials,    dE/dy = residual,    d2E/dy2 = K, symmetric,

and the signs of D in K = L D L' tell whether K is positive definite. Where it is not, K + sigma M is solved with, sigma
being just large enough (`pivots`). A correction is shortened until E falls (Armijo). Where K is positive definite,
whole steps are tried first, and E may rise for a few (watchdog, Chamberlain et al. 1982, doi 10.1007/BFb0120945). In
balance K is looked at again: where it has a negative pivot, the sheet goes along the lowest mode, as far as E falls,
and descends from there. A balance after that which is no lower is taken: at a kink a pivot tells of one side only.

After a whole step strains are unknowns of their own (`foreseen`), until whole steps have not let E fall.
"""

from typing import Any, Literal

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ..errors import InputError
from . import linear
from .failures import SINGULAR, solve
from .foreseen import Foreseen
from .leading import HELD, balanced
from .pivots import Pivots
from .statics import OPTIONS as NEWTON
from .statics import StaticSolver

MOST = 200  # iterations, if options do not say snes_max_it
TURN = 0.8  # rad, by which a director turns at most in one: beyond pi the map of `directors` comes back
PATIENCE, AHEAD = 3, 10  # whole steps in which the energy may rise; where strains are unknowns of their own
SUFFICIENT = 1e-4  # of the slope
ROUND_OFF = 1e-10  # of the sum of the energies' sizes: below, slopes tell a change better
ESCAPES = 5
NEUTRAL = 1e-12  # of the largest entry on the diagonal

type Search = Literal["energy", "newton"]

# null pivots are found, and there is room for pivots that are put off
OPTIONS: linear.Options = linear.SYMMETRIC | linear.ROOM | {"mat_mumps_icntl_24": 1}


class StableSolver(StaticSolver):
    """`StaticSolver` that descends the energy where there is one, else it is that; see above.

    There is one if every term has a `potential`, the stiffness is symmetric at the unknowns that are free, and options
    do not ask for other linear solvers than MUMPS's. search: "newton" for Newton's method alone.

    Public: `descends`, whether there is an energy, once something was solved; `negative`, the number of negative pivots
    in the last balance, 0 if it is stable.
    """

    descends: bool | None = None
    negative = 0

    def __init__(
        self, *arguments: Any, options: linear.Options | None = None, search: Search = "energy", **settings: Any
    ) -> None:
        super().__init__(*arguments, options=options, **settings)
        self._options = options or {}
        self._most_iterations = int(str(self._options.get("snes_max_it", MOST)))
        if search not in ("energy", "newton"):
            raise InputError(f"search={search!r} is neither 'energy' nor 'newton'.")
        if search == "newton" or self._options.keys() & {"ksp_type", "pc_type"}:
            self.descends = False
        self._count, self._sizes = 0, 0.0
        self._foreseen = Foreseen(self.terms, self._unknowns)
        self._pivots = Pivots(self._y, self._x, self.displacements, self._given)
        self._random = [self._x.duplicate() for _ in range(2)]
        for k, v in enumerate(self._random):
            v.array_w[:] = np.random.default_rng((k, self.comm.rank)).standard_normal(v.local_size)
            v.array_w[self._given] = 0.0
        self._angles = np.setdiff1d(np.arange(self._x.local_size), self.displacements)

    @property
    def iterations(self) -> int:
        """See `StaticSolver.iterations`."""
        return self._count if self.descends else super().iterations

    def solve(self) -> int:
        """See `StaticSolver.solve`; what is found is stable, or neutral."""
        here = self._y.x.array.copy(), self.u.x.array.copy()
        if self.descends is None:
            self._look()
        if self.descends:
            self._count = 0
            PETSc.garbage_cleanup(self.comm)  # vectors of the last solve, which on several ranks nobody else lets go
            iterations = self._descend()
            if self.descends:
                return iterations
            self._y.x.array[:], self.u.x.array[:] = here
        self._foreseen.forget(end=True)
        return super().solve()

    def _look(self) -> None:
        """Whether every term has a potential."""
        self.descends = bool(np.isfinite(self._at(self.begin())[1]))
        if self.descends:
            self._assume(True, OPTIONS)

    def _assume(self, symmetric: bool, options: linear.Options) -> None:
        self.symmetric = symmetric
        self.tangent.declare(symmetric)
        linear.configure(self.snes, self.tangent.A, NEWTON | options | self._options)

    # -- Newton's method ---------------------------------------------------------------------------------------------

    def _descend(self) -> int:
        self.begin()
        self.negative = 0
        self._foreseen.begin()
        self._unknowns.carry(self._x, self._given, self._targets)
        moved = self._move_supports()
        self._pushed, self._push = not moved, 0.0
        iterations = balanced(self.terms, lambda: self._take(self._x), self._go_down)
        if iterations is None:
            raise self.failure(HELD)
        return moved + iterations

    def _go_down(self) -> int:
        x = self._x
        b, E = self._at(x)
        correction, escapes, rises, whole, lowest = np.inf, 0, 0, True, np.inf
        start: tuple[PETSc.Vec, float, PETSc.Vec] | None = None
        for iteration in range(self._most_iterations + 1):
            self._count = iteration
            norm = b.norm()
            if not np.isfinite(norm) or not np.isfinite(E):
                raise self.failure("residual or energy is not finite")
            if self.converged(None, self._count, (x.norm(), correction, norm)) is not None:
                way = self._way_down(x)
                if not self.descends or way is None or E >= lowest:  # at a kink a pivot tells of one side only
                    self._take(x)
                    return self._count
                if escapes == ESCAPES:
                    raise self.failure("every balance is unstable")
                escapes, rises, start, correction, lowest = escapes + 1, 0, None, np.inf, E
                self._foreseen.forget()
                b, E = self._escape(x, E, way)
                continue
            b, p = b.copy(), b.duplicate()
            right = self._right(b)
            fault = solve(self.prepared(right), right, p)
            if fault or not self._sound:
                raise self.failure(fault or SINGULAR)
            if not self.descends:
                return 0
            self.linear_iterations += 1
            self._cap(p)
            definite = self._pivots.shift == 0.0
            correction = self._correction if definite else np.inf
            if whole and definite and (start is None or rises < (AHEAD if self._foreseen.used else PATIENCE)):
                start = start or (x.copy(), E, b)
                self._ahead(p)
                x.axpy(-1.0, p)
                b, E = self._at(x)
                if self._falls(E, b, *start[1:], x - start[0]):
                    rises, start = 0, None
                else:
                    rises += 1
                if np.isfinite(E):
                    continue
            if start is None and b.dot(p) > 0.0:
                b, E = self._search(x, E, b, p)
                whole = True
            else:
                if start is not None:  # back to where energy was lowest, and from there down
                    (at, E, b), start, rises, whole = start, None, 0, False
                    at.copy(x)
                    self._foreseen.forget(end=True)
                b = self._at(x)[0]
            self._foreseen.forget()
        raise self.failure("too many iterations")

    def _ahead(self, correction: PETSc.Vec) -> None:
        self._foreseen.keep(correction)

    def _right(self, b: PETSc.Vec) -> PETSc.Vec:
        """What to solve with at residual b."""
        if not self._foreseen.known:
            return b.copy()
        self._seen = None  # terms will not be as they were evaluated
        try:
            self._foreseen.linearise()
        except Exception as error:
            self._fault = error
        if self.comm.allreduce(self._fault is not None, MPI.LOR):
            raise self.failure("a law failed")
        return self._foreseen.right(b, self._given)

    def _search(self, x: PETSc.Vec, E: float, b: PETSc.Vec, p: PETSc.Vec) -> tuple[PETSc.Vec, float]:
        """From x along -p to a lower energy: residual and energy there."""
        origin, part = x.copy(), 1.0
        while part > 1e-10:
            x.waxpy(-part, p, origin)
            new, energy = self._at(x)
            if self._falls(energy, new, E, b, x - origin):
                return new, energy
            part /= 2
        raise self.failure("energy does not fall")

    def _falls(self, new: float, b_new: PETSc.Vec, E: float, b: PETSc.Vec, way: PETSc.Vec) -> bool:
        """Whether energy has fallen enough on a way from (E, b)."""
        if not np.isfinite(new):
            return False
        change = new - E
        if abs(change) < ROUND_OFF * self._sizes:
            change = 0.5 * (b.dot(way) + b_new.dot(way))
        return bool(change <= min(0.0, SUFFICIENT * b.dot(way)))

    def _at(self, x: PETSc.Vec) -> tuple[PETSc.Vec, float]:
        """Residual and energy at x."""
        b = self.residual(x)
        return b, self._energy()

    def _energy(self) -> float:
        """At the last residual, J; NaN, on every rank, if it is not finite or a term has none."""
        try:
            parts = [term.potential() for term in self.terms]
        except Exception as error:
            self._fault, parts = error, [None]
        known = [np.nan if part is None else part for part in parts]
        E, sizes = self.comm.allreduce(np.array([sum(known), sum(np.abs(known))]))
        self._sizes = max(float(sizes), 1e-300)
        return float(E)

    def _cap(self, p: PETSc.Vec) -> None:
        """Shorten a correction so far that terms allow it and no director turns too far."""
        p.scale(TURN / max(self._most(p, self._angles), TURN))
        self._correction = p.norm()
        p.scale(self.longest_step(-p))

    def _most(self, v: PETSc.Vec, where: np.ndarray) -> float:
        return float(self.comm.allreduce(np.abs(v.array_r[where]).max(initial=0.0), MPI.MAX))

    # -- factors, and the signs of their pivots ----------------------------------------------------------------------

    def prepared(self, *right: PETSc.Vec) -> PETSc.KSP:
        """What solves with the Jacobian, shifted until it is positive definite."""
        if not self.descends:
            return self.factorised(*right)
        self._assemble_tangent(*right)
        if self._turns_back():
            return self.snes.ksp
        self._pivots.factorise(self.snes.ksp, self.tangent.A)
        return self.snes.ksp

    def _turns_back(self) -> bool:
        """To Newton's method, for good, where the matrix is not symmetric; given unknowns are eliminated."""
        v, w = self._random
        Av, Aw = self.tangent.A * v, self.tangent.A * w
        skew = abs(w.dot(Av) - v.dot(Aw)) > 1e-12 * np.sqrt(Av.norm() * v.norm() * Aw.norm() * w.norm())
        if skew:
            self.descends = False
            self._assume(False, linear.DIRECT)
        return bool(skew)

    # -- stability ---------------------------------------------------------------------------------------------------

    def lowest(self) -> tuple[float, PETSc.Vec]:
        """Lowest eigenvalue of K v = lambda M v at the present u (N/m), and its mode, by inverse iteration."""
        self.residual(self.begin())
        return self._pivots.lowest(self.prepared())

    def _way_down(self, x: PETSc.Vec) -> PETSc.Vec | None:
        """The mode along which energy falls from a balance, by a small part of a cell; None if that is stable."""
        self._assemble_tangent()
        if self._turns_back():
            return None
        self.negative = self._pivots.count(self.snes.ksp, self.tangent.A)[0]
        if self.negative == 0:
            return None
        largest = self.tangent.A.getDiagonal().norm(PETSc.NormType.NORM_INFINITY)
        value, v = self._pivots.lowest(self.prepared())
        if value >= -NEUTRAL * largest:  # a pivot of round-off, as of a sheet that nothing holds
            self.negative = 0
            return None
        reach, turn = self._most(v, self.displacements), self._most(v, self._angles)
        v.scale(1e-3 / max(reach / np.sqrt(self._pivots.area), turn / TURN))
        return v

    def _escape(self, x: PETSc.Vec, E: float, way: PETSc.Vec) -> tuple[PETSc.Vec, float]:
        """Along a mode, to the side where energy falls, twice as far while it does; the last residual and energy."""
        origin, best = x.copy(), 0.0
        for ahead in (way, -way):
            most = 1023.0 * self.longest_step(1023.0 * ahead)
            part = first = min(1.0, most)
            while part <= most:
                x.waxpy(part, ahead, origin)
                energy = self._at(x)[1]
                if not energy < E:
                    break
                best, E, part = part, energy, 2.0 * part
            if best:
                break
        x.waxpy(best or first, ahead, origin)
        return self._at(x)
