"""A plane law through the thickness of a shell: resultants from strain and curvature.

The strain at a height z is E + z K (`kinematics`), the law answers at Gauss points z_l with weights w_l, and
the resultants N = sum w_l S_l and M = sum w_l z_l S_l are conjugate to E and K: N . dE + M . dK is the work per
area, (5.17) integrated through the thickness.
"""

from collections.abc import Callable
from functools import partial

import numba
import numpy as np

from ..errors import InputError
from . import Array, HasHardened, HasPotential, HasRecoverable, HasStiffest, HasStiffness, Law, empty


class Section:
    """A plane law on Gauss points through the thickness, itself a law (see `laws.Law`).

    Its strain is packed as (E11, E22, 2 E12, K11, K22, 2 K12), the strain at a height z being E + z K;
    with `quadratic` three more components follow, which go with z^2. Its stress is the resultants
    (N, M, ...), the integrals of S, z S and z^2 S, in N/m, N and N m. Its state is the law's own at
    each layer, one after the other. What the law offers besides, energies, `stiffness`, `stiffest`, it offers too.
    `elastic` tells the same in closed form for a linear law.

    thickness in m; layers: number of points, at least 2 for the section to bend. Raises InputError.
    """

    def __init__(self, law: Law, thickness: float, layers: int = 3, quadratic: bool = False) -> None:
        if not (np.isfinite(thickness) and thickness > 0):
            raise InputError(f"A thickness of {thickness!r} m is not a positive number.")
        if not (layers >= 2 and layers == int(layers)):
            raise InputError(f"A section of {layers} layers cannot bend: take a whole number from 2 on, or a membrane.")
        points, weights = np.polynomial.legendre.leggauss(layers)
        self.law, self.thickness = law, thickness
        self.heights, self._weights = points * thickness / 2, weights * thickness / 2
        self._powers = self.heights[:, None] ** np.arange(3 if quadratic else 2)
        self._moments = self._weights * self.heights ** np.arange(5 if quadratic else 3)[:, None]
        self.initial_state = np.tile(law.initial_state, layers)
        self.symmetric = law.symmetric
        if isinstance(law, HasRecoverable):
            self.recoverable = partial(self._through, law.recoverable)
        if isinstance(law, HasPotential):
            self.potential = partial(self._through, law.potential)
        if isinstance(law, HasStiffness):
            self.stiffness = self.elastic(law.stiffness)
        if isinstance(law, HasStiffest):
            self.stiffest = Section(law.stiffest, thickness, layers, quadratic)
        if isinstance(law, HasHardened):
            self.hardened = Section(law.hardened, thickness, layers, quadratic)
        self._scratch: tuple[Array, ...] = (np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3, 3)))

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Resultants (n, m), tangent (n, m, m) and new state, m being 6 or 9; see `laws.Law.respond`."""
        out = resultants, moduli, new = out or empty(strain, state)
        stiffness = self._respond(strain, state, resultants, new)
        _moduli(stiffness.reshape(-1, 9), self._moments, moduli)
        return out

    def advance(self, strain: Array, state: Array, stress: Array, new: Array) -> float:
        """See `laws.HasAdvance`, for resultants and new state."""
        if isinstance(self.law, HasHardened):
            own, moments = (-1, self.law.initial_state.size), self._moments[: self._powers.shape[1]]
            layers = self._powers, moments
            return self.law.advance(strain, state.reshape(own), stress, new.reshape(own), *layers)  # type: ignore[call-arg]
        self._respond(strain, state, stress, new)
        return 0.0

    def _respond(self, strain: Array, state: Array, resultants: Array, new: Array) -> Array:
        """Put resultants and new state in place: the tangents of all layers."""
        n, layers = len(strain), len(self._powers)
        if len(self._scratch[0]) != n * layers:
            # strain, stress and tangent of the layers: room that is kept, nothing that is remembered
            self._scratch = tuple(np.empty((n * layers, *shape)) for shape in ((3,), (3,), (3, 3)))
        layer_strain, stress, stiffness = self._scratch
        _spread(np.ascontiguousarray(strain), self._powers, layer_strain)
        own = (n * layers, self.law.initial_state.size)
        changed = new.reshape(own)
        self.law.respond(layer_strain, state.reshape(own), (stress, stiffness, changed))
        if not np.may_share_memory(changed, new):  # `new` is not in one piece
            new[:] = changed.reshape(new.shape)
        _resultants(stress, self._moments, resultants)
        return stiffness

    def _through(self, energy: Callable[[Array, Array], Array], strain: Array, state: Array) -> Array:
        """An energy of the law, J/m3, summed over the layers: J/m2 (n,)."""
        n, layers = len(strain), len(self._powers)
        layer_strain = np.empty((n * layers, 3))
        _spread(np.ascontiguousarray(strain), self._powers, layer_strain)
        density = energy(layer_strain, state.reshape(n * layers, self.law.initial_state.size))
        return np.asarray(density.reshape(n, layers) @ self._weights)

    def shear_limit(self, least: float) -> float:
        """What limits the transverse shear of a thin shell, Pa: E/2/(1 + nu) of the larger modulus E, or `least`."""
        stiffest: object = self.law if isinstance(self.law, HasStiffness) else getattr(self.law, "stiffest", None)
        if not isinstance(stiffest, HasStiffness):
            return least
        C = stiffest.stiffness
        nu = np.sqrt(C[0, 1] * C[1, 0] / (C[0, 0] * C[1, 1]))
        return max(least, float(C.diagonal()[:2].max() * (1 - nu) / 2))

    def elastic(self, stiffness: Array) -> Array:
        """Stiffness (m, m) of the section for a law of constant stiffness (3, 3): diag(h C, h^3/12 C, ...)."""
        moments = np.einsum("l,lp,lq->pq", self._weights, self._powers, self._powers)
        return np.kron(moments, stiffness)


_jit = numba.njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


@_jit
def _spread(strain, powers, layer_strain):
    """Strain of each layer: the sum of the parts of `strain` with their powers of z."""
    layers = powers.shape[0]
    for i in range(strain.shape[0]):
        for layer in range(layers):
            for a in range(3):
                total = strain[i, a]
                for p in range(1, powers.shape[1]):
                    total += powers[layer, p] * strain[i, 3 * p + a]
                layer_strain[i * layers + layer, a] = total


@_jit
def _resultants(stress, moments, resultants):
    """Sum the layers: resultants p from the moment p of stress."""
    layers = moments.shape[1]
    for i in range(resultants.shape[0]):
        for p in range(resultants.shape[1] // 3):
            x = y = z = 0.0
            for layer in range(layers):
                w, at = moments[p, layer], i * layers + layer
                x += w * stress[at, 0]
                y += w * stress[at, 1]
                z += w * stress[at, 2]
            resultants[i, 3 * p], resultants[i, 3 * p + 1], resultants[i, 3 * p + 2] = x, y, z


@_jit
def _moduli(stiffness, moments, tangent):
    """Sum the layers: tangent (p, q) from the moment p + q of stiffness."""
    layers, powers = moments.shape[1], tangent.shape[1] // 3
    sums = np.empty(9)
    for i in range(tangent.shape[0]):
        for k in range(moments.shape[0]):
            sums[:] = 0.0
            for layer in range(layers):
                w, at = moments[k, layer], i * layers + layer
                for j in range(9):
                    sums[j] += w * stiffness[at, j]
            for p in range(max(0, k - powers + 1), min(k, powers - 1) + 1):
                for a in range(3):
                    for b in range(3):
                        tangent[i, 3 * p + a, 3 * (k - p) + b] = sums[3 * a + b]
