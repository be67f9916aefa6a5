"""Where the work goes in a motion: the judge of its stability.

At every accepted step

    external work = kinetic + recoverable + dissipated by the law, by damping, by the scheme, by friction, by impact
                    + imbalance.

Terms tell what they store and lose: a law by its own work (`points.LawPoints`), linear laws exactly. Work of the
others' nodal forces is by the trapezoidal rule, (f0 + f1)/2 . (q1 - q0). The
scheme's part is (M a0 + M a1)/2 . (q1 - q0) less the change of kinetic energy: zero for the trapezoidal rule, and not
negative in a linear problem. Impulses act at the end of an implicit step (`motion`), and their work is f1 . (q1 - q0):
what of it is neither stored nor lost to friction is lost by impact. An explicit motion is weighed every few steps, and
tells its scheme's part itself. The imbalance is then what no term explains, the error of the finite step; it grows
without bound where a run is unstable.
"""

from collections.abc import Iterable

import numpy as np
from dolfinx.fem import petsc as fempetsc
from petsc4py import PETSc

from ..laws import Array
from ..terms.extra import extra_force
from ..terms.term import Term
from .explicit import CentralDifference
from .newmark import Newmark

type Forces = tuple[Array, Array, Array, Array, Array, float]
"""Owned parts of q, of external, damping and inertia forces, reactions at given unknowns, the scheme's `lag`."""
LOSSES = "by_law", "by_friction", "by_impact"


class Ledger:
    """The energies of a motion from here on, in J; see `totals`. `run` then tells it of every step.

    Each term of the motion tells its energy and what it loses; work of the others is external, or that of damping, as
    they say. Supports that move are external.
    """

    _last: Forces
    _next: Forces

    def __init__(self, run: Newmark | CentralDifference) -> None:
        self._run, self.motion, self.comm = run, run.motion, run.comm
        # what has an energy says so once it is evaluated
        self._silent: dict[str, list[Term]] = {"external": [], "damping": []}
        self._vector = fempetsc.create_vector(self.motion.q.function_space)
        self._given = self.motion.given[self.motion.given < self._vector.local_size]
        self.totals = dict.fromkeys(
            ("kinetic", "recoverable", *LOSSES, "by_damping", "by_scheme", "external", "imbalance"), 0.0
        )
        """External work, where it is now, and where it went since the start."""
        self.most = self.worst = 0.0
        """Largest external work and largest imbalance so far, J, without their signs."""
        self.made = self._dissipated = self._stored = self._stored_next = 0.0
        """By how much, J, what the law has dissipated has fallen at most: energy that a law without potential made."""
        self._explicit = isinstance(run, CentralDifference)
        self._impulsive = [] if self._explicit else [term for term in run.terms if term.impulsive]
        self._touches = any(term.impulsive or term.loses == "friction" for term in run.terms)
        run.ledger = self

    def start(self) -> None:
        """Take the present state as the start: its kinetic and stored energy count as external work."""
        self.renew()
        kinetic, stored = self._kinetic(), self._sum(self._energies())
        self.totals |= {"kinetic": kinetic, "recoverable": stored, "external": kinetic + stored}

    def weigh(self) -> float:
        """Account for the step that is solved but not yet committed; what it adds to the imbalance, J."""
        q0, fe0, fd0, ma0, r0, lag0 = self._last
        self._next = q1, fe1, fd1, ma1, r1, lag1 = self._forces()
        dq = q1 - q0
        external = np.sum((r0 + r1) * dq[self._given]) - np.sum((fe0 + fe1) * dq)
        local = [external, np.sum((fd0 + fd1) * dq), np.sum((ma0 + ma1) * dq), 2 * (lag0 - lag1)]
        lost = {"law": 0.0, "friction": 0.0}
        for term in self._run.terms:
            lost[term.loses] += term.dissipated()
        sudden = self._sudden(dq) if self._impulsive else (0.0,) * 4
        supplied = sum(term.supplied() for term in self._run.terms)
        suddenly = sum(term.supplied() for term in self._impulsive)
        sums = self.comm.allreduce(
            np.array([*(0.5 * np.array(local)), *lost.values(), self._energies(), *sudden, supplied, suddenly])
        )
        t, kinetic = self.totals.copy(), self._kinetic()
        inertia, met, touching, stored = sums[7:11]
        t["external"] += sums[0] + met + sums[11]
        t["by_damping"] += sums[1]
        # an explicit scheme tells it in closed form, whatever number of steps has been made
        t["by_scheme"] += sums[3] if self._explicit else sums[2] - (kinetic - t["kinetic"]) + inertia
        t["kinetic"] = kinetic
        t["by_law"] += sums[4]
        t["by_friction"] += sums[5]
        t["recoverable"] = sums[6]
        if self._impulsive:
            self._stored_next = stored
            t["by_impact"] += touching + sums[12] - sums[5] - (stored - self._stored)
        explained = sum(value for name, value in t.items() if name not in ("external", "imbalance"))
        t["imbalance"] = t["external"] - explained
        self._totals_next = t
        return t["imbalance"] - self.totals["imbalance"]

    @property
    def size(self) -> float:
        """External work or kinetic energy after the step that was weighed, J: after the first, all there is."""
        return max(abs(self._totals_next["external"]), self._totals_next["kinetic"])

    def accept(self) -> None:
        """The step that was weighed has been committed."""
        t = self.totals = self._totals_next
        self._last = self._next
        self._stored = self._stored_next
        for term in self._run.terms:
            term.watch()
        self.most, self.worst = max(self.most, abs(t["external"])), max(self.worst, abs(t["imbalance"]))
        self._dissipated = max(self._dissipated, t["by_law"])
        self.made = max(self.made, self._dissipated - t["by_law"])

    def row(self) -> dict[str, float]:
        """The totals with units, as columns of a `results.Table`."""
        t = self.totals
        return {
            "kinetic_J": t["kinetic"],
            "recoverable_J": t["recoverable"],
            "dissipated_J": t["by_law"],
            **({"friction_J": t["by_friction"], "impact_J": t["by_impact"]} if self._touches else {}),
            "damped_J": t["by_damping"],
            "scheme_J": t["by_scheme"],
            "external_work_J": t["external"],
            "imbalance_J": t["imbalance"],
        }

    def numbers(self) -> dict[str, float]:
        """The totals, and the largest of them so far."""
        return {f"energy_{name}": value for name, value in self.totals.items()} | {
            "energy_most": self.most,
            "energy_worst": self.worst,
            "energy_made": self.made,
            "energy_dissipated": self._dissipated,
        }

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them."""
        self.totals = {name: numbers.get(f"energy_{name}", 0.0) for name in self.totals}
        self.most, self.worst, self.made, self._dissipated = (
            numbers[f"energy_{name}"] for name in ("most", "worst", "made", "dissipated")
        )

    def renew(self) -> None:
        """Go on from the present state, that of the last commit."""
        self.motion.q.x.scatter_forward()
        for account, terms in self._silent.items():
            terms[:] = [term for term in self._run.terms if term.account == account and term.energy() is None]
        for term in self._run.terms:
            term.watch()
        self._last = self._forces()
        self._stored = self._sum(self._of(self._impulsive))

    def _kinetic(self) -> float:
        """Of all that moves, J."""
        return self.motion.kinetic() + (self._run.extra.kinetic() if self._run.extra else 0.0)

    def _sudden(self, dq: Array) -> tuple[float, ...]:
        """Of impulses on this rank, J: work of their inertia, at given unknowns, in all; what they store."""
        motion, extra = self.motion, self._run.extra
        force = self._assembled(self._impulsive)
        inertia = np.array(motion.by_mass(motion.jump).array_r) if motion.jump is not None else np.zeros_like(force)
        met = (inertia + force)[self._given] @ dq[self._given]
        touching = force @ dq[: len(force)]
        if extra and self.comm.rank == 0:
            inertia = np.concatenate([inertia, extra.jump()])
            touching += extra_force(self._impulsive, extra.count) @ extra.values
        work = [inertia @ dq, met, touching, self._of(self._impulsive)]
        return tuple(map(float, work))

    def _of(self, terms: Iterable[Term]) -> float:
        return sum(energy for term in terms if (energy := term.energy()) is not None)

    def _energies(self) -> float:
        """Of all terms that have one, J on this rank."""
        return self._of(self._run.terms)

    def _sum(self, value: float) -> float:
        return float(self.comm.allreduce(value))

    def _assembled(self, terms: Iterable[Term]) -> Array:
        """Forces of some terms at the owned unknowns."""
        with self._vector.localForm() as local:
            local.set(0.0)
            for term in terms:
                term.add_force(local.array_w)
        self._vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        return np.array(self._vector.array_r)

    def _forces(self) -> Forces:
        motion = self.motion
        external, damping = (self._assembled(self._silent[account]) for account in ("external", "damping"))
        inertia = np.array(motion.by_mass(motion.acceleration).array_r)
        lag = self._run.lag() if isinstance(self._run, CentralDifference) else 0.0
        reaction = self._run.forces()[self._given]
        if self._impulsive:
            # their part of it acts at the end of the step only
            reaction = reaction - self._assembled(self._impulsive)[self._given]
            if motion.jump is not None:
                reaction -= motion.by_mass(motion.jump).array_r[self._given]
        q = motion.q.x.array[: len(inertia)].copy()
        if self._run.extra and self.comm.rank == 0:
            x, dead, moved = self._run.extra.weighed()
            q, external, inertia = (np.concatenate(pair) for pair in ((q, x), (external, dead), (inertia, moved)))
            damping = np.concatenate([damping, np.zeros_like(x)])
        return q, external, damping, inertia, reaction, lag
