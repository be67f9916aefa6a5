"""A law at the points of some cells, with its history and its work.

History has a committed and a trial state: every evaluation starts from the committed one, so that a line search or a
step that fails leaves nothing behind, and only `commit` moves the past.
"""

import warnings
from collections.abc import Callable

import numpy as np
from dolfinx import mesh

from ..laws import Array, Law, Stiffest


class History:
    """Committed and trial state of every point, shape (number of points, state variables)."""

    def __init__(self, initial: Array, points: int) -> None:
        self.committed = np.tile(initial, (points, 1))
        self.trial = self.committed.copy()

    def commit(self) -> None:
        """What was tried has happened."""
        self.committed, self.trial = self.trial, self.committed


class LawPoints:
    """A law at the points of a quadrature rule on some cells of a mesh.

    Public: `law`, `history`, and of the last evaluation `strain` and `stress`, shape (cells, points of a cell,
    components), and `tangent` (cells, points of a cell, components, components). Who has them fills `strain` before.

    Args:
        law: see `laws.Law`.
        domain: the mesh.
        cells: local cells (cells,), this rank's own before ghosts: a law needs no communication.
        shape: points of a cell, and components of the strain.
        weights: gives, when first needed, what stress times strain is multiplied by to be a work in J, (own cells,
            points of a cell).
        stress: an array to hold it, if it lives elsewhere.
    """

    def __init__(
        self,
        law: Law,
        domain: mesh.Mesh,
        cells: np.ndarray,
        shape: tuple[int, int],
        *,
        weights: Callable[[], Array],
        stress: Array | None = None,
    ) -> None:
        self.mesh, self.cells = domain, cells
        self.owned = int(np.searchsorted(cells, domain.topology.index_map(2).size_local))
        """Number of this rank's own cells."""
        self.strain = np.zeros((len(cells), *shape))
        self.stress = np.zeros_like(self.strain) if stress is None else stress.reshape(self.strain.shape)
        self.tangent: Array | None = None
        self._weigh = weights
        self.law = law
        self.begin(law)

    def begin(self, law: Law) -> None:
        """Forget the past: from here on this law, of as many components."""
        self.law = law
        self.history = History(law.initial_state, self.strain.shape[0] * self.strain.shape[1])
        self._advance: Callable[..., float] | None = getattr(law, "advance", None)
        self.hardens, self.risen = hasattr(law, "hardened"), 0.0
        self._beyond: Callable[[Array], str | None] | None = getattr(law, "beyond_calibration", None)
        self._recoverable = getattr(law, "recoverable", None)
        self._potential: Callable[[Array, Array], Array] | None = getattr(law, "potential", None)
        self._start: tuple[Array, Array, Array] | None = None
        self._taken: Array | None = None
        self._energy = 0.0
        self._each = self._before = np.empty(0)  # what points give back at the last `_stored`, and at the start, J/m3
        self._known: float | None = None  # what is stored at the last evaluation
        self._moved = False  # whether the state of the last evaluation is the committed one

    def evaluate(self, tangent: bool = True, stiffest: Stiffest = False) -> bool:
        """Stress, tangent and trial state at `strain`, from the committed state; False if one is not finite.

        tangent: whether it is wanted; a law that cannot leave it out gives it. stiffest: of the stiffest linear law
        that the law tells, else of the law at its first state; "so far": after the committed state; the trial state
        stays. Without a tangent, and not stiffest, `risen` then tells by how much the law has hardened.
        """
        m, history, self._known, self._moved, self.risen = self.strain.shape[-1], self.history, None, False, 0.0
        strain, stress = self.strain.reshape(-1, m), self.stress.reshape(-1, m)
        if stiffest:
            law, state = getattr(self.law, "stiffest", self.law), history.committed
            if stiffest == "so far" and self.hardens:
                law = self.law.hardened  # type: ignore[attr-defined]
            else:
                state = np.tile(law.initial_state, (len(strain), 1))
            self._respond(law, strain, state, stress, np.empty_like(state))
        elif tangent or self._advance is None:
            self._respond(self.law, strain, history.committed, stress, history.trial)
            return bool(np.isfinite(stress.sum()) and np.isfinite(history.trial.sum()))
        else:
            self.risen = self._advance(strain, history.committed, stress, history.trial)
        return bool(np.isfinite(stress.sum()))

    def linearise(self, strain: Array) -> None:
        """Stress and tangent at another strain, of the shape of `strain`; strain and trial state stay."""
        m = strain.shape[-1]
        new = np.empty_like(self.history.trial)
        self._respond(self.law, strain.reshape(-1, m), self.history.committed, self.stress.reshape(-1, m), new)

    def _respond(self, law: Law, strain: Array, state: Array, stress: Array, new: Array) -> None:
        n, m = strain.shape
        if self.tangent is None:
            self.tangent = np.empty((*self.strain.shape, m))
        moduli = self.tangent.reshape(-1, m, m)[:n]
        law.respond(strain, state, (stress, moduli, new))

    def commit(self) -> None:
        """Move the past: the trial state of the last evaluation becomes the committed one."""
        self.history.commit()
        self._moved = True
        if self._beyond is not None:
            said = self._beyond(self.strain.reshape(-1, self.strain.shape[-1])) if self.strain.size else None
            said = next((s for s in self.mesh.comm.allgather(said) if s), None)
            if said is not None:
                self._beyond = None
                if self.mesh.comm.rank == 0:
                    warnings.warn(said, stacklevel=2)

    def fields(self) -> list[tuple[str, np.ndarray, Array]]:
        """See `Term.fields`."""
        count, points, m = self.strain.shape
        states = self.history.committed.reshape(count, points * self.history.committed.shape[1])
        taken = [] if self._taken is None else [("taken", self.cells, self._taken)]
        return [("history", self.cells, states), ("stress", self.cells, self.stress.reshape(count, points * m)), *taken]

    def worst(self) -> tuple[float, str]:
        """Largest strain on this rank (infinite where it or its stress is not finite), and where it is."""
        size = np.abs(self.strain[: self.owned]).max(axis=2)
        if not size.size:
            return -1.0, ""
        stress = self.stress[: self.owned]
        size[~(np.isfinite(size) & np.isfinite(stress).all(axis=2))] = np.inf
        cell, point = np.unravel_index(np.argmax(size), size.shape)
        here = self.cells[cell : cell + 1].astype(np.int32)
        number = self.mesh.topology.original_cell_index[here[0]]
        middle = mesh.compute_midpoints(self.mesh, self.mesh.topology.dim, here)[0]
        strain = ", ".join(f"{value:.3g}" for value in self.strain[cell, point])
        where = ", ".join(f"{x:.4g}" for x in middle[: self.mesh.geometry.dim])
        return float(size[cell, point]), f"cell {number} at ({where}) m, point {point}: strain ({strain})"

    def potential(self) -> float | None:
        """Incremental potential at the last evaluation, J on this rank; None of a law that has none."""
        if self._potential is None:
            return None
        return float(self._weights.ravel() @ self._potential(self._own()[0], self._states(self.history.committed)))

    # -- its work: from its potential, or along the straight path of strain by Simpson's rule with one more call -------

    def watch(self) -> None:
        """Account for work from the present strain, and the state after it, on; see `Term.watch`."""
        if self._recoverable is None:
            self._taken = np.zeros(self.strain.shape[:2]) if self._taken is None else self._taken
            self._taken[: self.owned] += self._work().reshape(self.owned, self.strain.shape[1])
        strain, stress = self._own()
        self._start = strain.copy(), stress.copy(), self._states(self.history.committed).copy()
        if self._known is None:
            self._known = self._stored(self.history.committed)
        # what a strain gives back is also its potential from the state that it is in
        self._before, self._energy = self._each, self._known

    def energy(self) -> float:
        """What the law gives back, J on this rank; of a law that cannot tell, all that it has taken since `watch`."""
        if self._known is None:
            self._known = self._stored(self.history.committed if self._moved else self.history.trial)
        return self._known

    def dissipated(self) -> float:
        """The rest of the work since `watch`, J on this rank."""
        if self._recoverable is None:
            return 0.0
        return float(self._work().sum()) - (self.energy() - self._energy)

    def _own(self) -> tuple[Array, Array]:
        """Strain and stress at this rank's own points, (points, components)."""
        m = self.strain.shape[-1]
        return self.strain[: self.owned].reshape(-1, m), self.stress[: self.owned].reshape(-1, m)

    def _states(self, states: Array) -> Array:
        return states[: self.owned * self.strain.shape[1]]

    def _stored(self, states: Array) -> float:
        if self._recoverable is None:
            before = 0.0 if self._taken is None else float(self._taken[: self.owned].sum())
            return before + float(self._work().sum())
        self._each = self._recoverable(self._own()[0], self._states(states))
        return float(self._weights.ravel() @ self._each)

    def _work(self) -> Array:
        """Work since `watch` at this rank's own points, flat, J."""
        if self._start is None:
            return np.zeros(self.owned * self.strain.shape[1])
        (strain, stress, state), (now, force) = self._start, self._own()
        if self._potential is not None:  # exactly
            return np.asarray(self._weights.ravel() * (self._potential(now, state) - self._before))
        change, (n, m) = now - strain, strain.shape
        middle, new = np.empty_like(stress), np.empty_like(state)
        if self._advance is None:
            self.law.respond(strain + 0.5 * change, state, (middle, np.empty((n, m, m)), new))
        else:
            self._advance(strain + 0.5 * change, state, middle, new)
        mean = (stress + 4.0 * middle + force) / 6.0
        return np.asarray(self._weights.ravel() * np.einsum("na,na->n", mean, change))

    @property
    def _weights(self) -> Array:
        if not hasattr(self, "_known_weights"):
            self._known_weights = self._weigh()
        return self._known_weights
