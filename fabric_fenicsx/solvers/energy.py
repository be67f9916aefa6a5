"""Where the work goes in a motion: the judge of its stability.

At every accepted step

    external work = kinetic + recoverable + dissipated by the law, by damping, by the scheme + imbalance.

Work of nodal forces is by the trapezoidal rule, (f0 + f1)/2 . (q1 - q0). What the law takes is integrated at its own
points along the straight path of strain, by Simpson's rule with one more call of the law; elastic energy is exact. The
scheme's part is (M a0 + M a1)/2 . (q1 - q0) less the change of kinetic energy: zero for the trapezoidal rule, and not
negative in a linear problem. An explicit motion is weighed every few steps, and tells its scheme's part itself. The
imbalance is then what no term explains, the error of the finite step; it grows without bound where a run is unstable.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from basix.ufl import quadrature_element
from dolfinx import fem
from dolfinx.fem import petsc as fempetsc
from petsc4py import PETSc
from ufl.form import Form

from ..laws import Array
from ..terms.hook import LawHook
from .explicit import CentralDifference
from .newmark import Newmark


class Ledger:
    """The energies of a motion from here on, in J; see `totals`.

    external: virtual work of the loads (a linear form), damping: that of damping forces in the residual, if any.
    stored: form of elastic energy outside of hooks, if any. hooks: each law's hook and the factor of its
    stress in the weak form, the thickness in m or 1 for resultants.

    A law tells what of its work is recoverable by `recoverable(strain, state)`, J/m3 (n,); of a law that cannot
    tell, all is. Supports that move are external.
    """

    def __init__(
        self,
        run: Newmark | CentralDifference,
        external: Form | None = None,
        stored: Form | None = None,
        hooks: Sequence[tuple[LawHook, float]] = (),
        damping: Form | None = None,
    ) -> None:
        self._run, self.motion, self.comm = run, run.motion, run.comm
        self._external = fem.form(external) if external else None
        self._damping = fem.form(damping) if damping else None
        self._stored = fem.form(stored) if stored and stored.integrals() else None
        self._works = [LawWork(hook, factor) for hook, factor in hooks]
        self._tells = all(work.tells for work in self._works)
        self._vector = fempetsc.create_vector(self.motion.q.function_space)
        self._given = self.motion.given[self.motion.given < self._vector.local_size]
        self.totals = dict.fromkeys(
            ("kinetic", "recoverable", "by_law", "by_damping", "by_scheme", "external", "imbalance"), 0.0
        )
        """External work, where it is now, and where it went since the start."""
        self.most = self.worst = 0.0
        """Largest external work and largest imbalance so far, J, without their signs."""
        self.made = self._dissipated = 0.0
        """By how much, J, what the law has dissipated has fallen at most: energy that a law without potential made."""
        self._law = 0.0
        self._last: tuple[Any, ...] | None = None
        self._explicit = isinstance(run, CentralDifference)
        run.ledger = self

    def start(self) -> None:
        """Take the present state as the start: its kinetic and elastic energy count as external work."""
        self.motion.q.x.scatter_forward()
        self._last = self._forces()
        for work in self._works:
            work.start(work.hook.history.committed)
        kinetic, elastic = self.motion.kinetic(), self._elastic_energy()
        self.totals |= {"kinetic": kinetic, "recoverable": elastic, "external": kinetic + elastic}

    def weigh(self) -> float:
        """Account for the step that is solved but not yet committed; what it adds to the imbalance, J."""
        assert self._last is not None
        q0, fe0, fd0, ma0, r0, lag0 = self._last
        self._next = q1, fe1, fd1, ma1, r1, lag1 = self._forces()
        dq = q1 - q0
        external = np.sum((fe0 + fe1) * dq) + np.sum((r0 + r1) * dq[self._given])
        local = [external, np.sum((fd0 + fd1) * dq), np.sum((ma0 + ma1) * dq), 2 * (lag0 - lag1)]
        works = np.array([work.weigh() for work in self._works]).reshape(-1, 2).sum(axis=0)
        sums = self.comm.allreduce(np.array([*(0.5 * np.array(local)), *works]))
        t, kinetic, elastic = self.totals.copy(), self.motion.kinetic(), self._elastic_energy()
        self._law_next = self._law + sums[4]
        kept = sums[5] if self._tells else self._law_next
        t["external"] += sums[0]
        t["by_damping"] += sums[1]
        # an explicit scheme tells it in closed form, whatever number of steps has been made
        t["by_scheme"] += sums[3] if self._explicit else sums[2] - (kinetic - t["kinetic"])
        t["kinetic"], t["recoverable"], t["by_law"] = kinetic, elastic + kept, self._law_next - kept
        explained = sum(value for name, value in t.items() if name not in ("external", "imbalance"))
        t["imbalance"] = t["external"] - explained
        self._totals_next = t
        return t["imbalance"] - self.totals["imbalance"]

    def accept(self) -> None:
        """The step that was weighed is committed."""
        t = self.totals = self._totals_next
        self._last, self._law = self._next, self._law_next
        for work in self._works:
            work.start(work.hook.history.trial)
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
            "damped_J": t["by_damping"],
            "scheme_J": t["by_scheme"],
            "external_work_J": t["external"],
            "imbalance_J": t["imbalance"],
        }

    def numbers(self) -> dict[str, float]:
        """The totals and what they are made of; each rank's own work of the laws is summed up."""
        return {f"energy_{name}": value for name, value in self.totals.items()} | {
            "energy_law": self._law,
            "energy_most": self.most,
            "energy_worst": self.worst,
            "energy_made": self.made,
            "energy_dissipated": self._dissipated,
        }

    def set_numbers(self, numbers: dict[str, float]) -> None:
        """As `numbers` gave them."""
        self.totals = {name: numbers[f"energy_{name}"] for name in self.totals}
        self._law, self.most, self.worst, self.made, self._dissipated = (
            numbers[f"energy_{name}"] for name in ("law", "most", "worst", "made", "dissipated")
        )

    def renew(self) -> None:
        """Go on from a state that has been put in place from outside."""
        self._last = self._forces()
        for work in self._works:
            work.start(work.hook.history.committed)

    def _elastic_energy(self) -> float:
        return 0.0 if self._stored is None else float(self.comm.allreduce(fem.assemble_scalar(self._stored)))

    def _assembled(self, form: fem.Form | None) -> Array:
        if form is None:
            return np.zeros(self._vector.local_size)
        with self._vector.localForm() as local:
            local.set(0.0)
        fempetsc.assemble_vector(self._vector, form)
        self._vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        return np.array(self._vector.array_r)

    def _forces(self) -> tuple[Any, ...]:
        """Owned parts of q, external, damping and inertia forces, reactions at given unknowns, the scheme's `lag`."""
        motion, size = self.motion, self._vector.local_size
        reaction = self._run.forces()[self._given]
        damping = self._assembled(self._damping)
        motion.mass.mult(motion.velocity.x.petsc_vec, self._vector)
        damping = damping + motion.damping * self._vector.array_r
        motion.mass.mult(motion.acceleration.x.petsc_vec, self._vector)
        inertia = np.array(self._vector.array_r)
        lag = self._run.lag() if isinstance(self._run, CentralDifference) else 0.0
        return motion.q.x.array[:size].copy(), self._assembled(self._external), damping, inertia, reaction, lag


class LawWork:
    """Work of a law at the points of its hook, in J on this rank."""

    def __init__(self, hook: LawHook, factor: float) -> None:
        self.hook = hook
        domain = hook.mesh
        degree = hook.dx.metadata()["quadrature_degree"]
        space = fem.functionspace(domain, quadrature_element(domain.basix_cell(), degree=degree, scheme="default"))
        weights = fem.assemble_vector(fem.form(factor * ufl.TestFunction(space) * hook.dx)).array
        self._weights = weights.copy()
        self._weights[hook.owned_points :] = 0.0
        self._recoverable = getattr(hook.law, "recoverable", None)
        self.tells = self._recoverable is not None
        n, m = self._now()[0].shape
        self._scratch = np.empty((n, m)), np.empty((n, m, m)), np.empty_like(hook.history.committed)

    def start(self, state: Array) -> None:
        """From the present strain, and the state after it, on."""
        strain, stress = self._now()
        self._strain, self._stress, self._state = strain.copy(), stress.copy(), state.copy()

    def _now(self) -> tuple[Array, Array]:
        m = self.hook.strain.shape[-1]
        return self.hook.strain.reshape(-1, m), self.hook.resultants.reshape(-1, m)

    def weigh(self) -> tuple[float, float]:
        """Work of the step that is about to be committed, and what is recoverable after it."""
        hook = self.hook
        strain, stress = self._now()
        change = strain - self._strain
        hook.law.respond(self._strain + 0.5 * change, self._state, self._scratch)
        mean = (self._stress + 4.0 * self._scratch[0] + stress) / 6.0
        work = float(self._weights @ np.einsum("na,na->n", mean, change))
        if self._recoverable is None:
            return work, 0.0
        return work, float(self._weights @ self._recoverable(strain, hook.history.trial))
