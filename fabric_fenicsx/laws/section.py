"""A plane law through the thickness of a shell: resultants from strain and curvature."""

import numba
import numpy as np

from ..errors import InputError
from . import Array, Law


class Section:
    """A plane law on Gauss points through the thickness, itself a law (see `laws.Law`).

    Its strain is packed as (E11, E22, 2 E12, K11, K22, 2 K12), the strain at a height z being E + z K;
    with `quadratic` three more components follow, which go with z^2. Its stress is the resultants
    (N, M, ...), the integrals of S, z S and z^2 S, in N/m, N and N m. Its state is the law's own at
    each layer, one after the other. `elastic` tells the same in closed form for a linear law.

    thickness in m; layers: number of points, at least 2 for the section to bend. Raises InputError.
    """

    def __init__(self, law: Law, thickness: float, layers: int = 3, quadratic: bool = False) -> None:
        if not (np.isfinite(thickness) and thickness > 0):
            raise InputError(f"A thickness of {thickness!r} m is not a positive number.")
        if layers < 2:
            raise InputError(f"A section of {layers} layer cannot bend: take 2 or more, or a membrane.")
        points, weights = np.polynomial.legendre.leggauss(layers)
        self.law, self.thickness = law, thickness
        self.heights, self._weights = points * thickness / 2, weights * thickness / 2
        self._powers = self.heights[:, None] ** np.arange(3 if quadratic else 2)
        self.initial_state = np.tile(law.initial_state, layers)
        self.symmetric = law.symmetric

    def respond(
        self, strain: Array, state: Array, out: tuple[Array, Array, Array] | None = None
    ) -> tuple[Array, Array, Array]:
        """Resultants (n, m), tangent (n, m, m) and new state, m being 6 or 9; see `laws.Law.respond`."""
        n, m = strain.shape
        layers, powers = self._powers.shape
        if out is None:
            out = np.empty((n, m)), np.empty((n, m, m)), np.empty_like(state)
        resultants, tangent, new = out
        own = (n * layers, -1) if self.law.initial_state.size else (n * layers, 0)
        parts = strain.reshape(n, powers, 3)
        layer_strain = np.einsum("lp,npc->nlc", self._powers, parts).reshape(-1, 3)
        stress, stiffness, changed = self.law.respond(layer_strain, np.ascontiguousarray(state).reshape(own))
        new[:] = changed.reshape(n, -1)
        _integrate(
            stress.reshape(n, layers, 3),
            stiffness.reshape(n, layers, 3, 3),
            self._weights,
            self._powers,
            resultants.reshape(n, powers, 3),
            tangent.reshape(n, powers, 3, powers, 3),
        )
        return out

    def elastic(self, stiffness: Array) -> Array:
        """Stiffness (m, m) of the section for a law of constant stiffness (3, 3): diag(h C, h^3/12 C, ...)."""
        moments = np.einsum("l,lp,lq->pq", self._weights, self._powers, self._powers)
        return np.kron(moments, stiffness)


@numba.njit(cache=True, error_model="numpy")
def _integrate(stress, stiffness, weights, powers, resultants, tangent):
    """Sum the layers with their powers of z into resultants and tangent."""
    resultants[:] = 0.0
    tangent[:] = 0.0
    for i in range(stress.shape[0]):
        for layer in range(stress.shape[1]):
            for p in range(powers.shape[1]):
                wp = weights[layer] * powers[layer, p]
                for a in range(3):
                    resultants[i, p, a] += wp * stress[i, layer, a]
                for q in range(powers.shape[1]):
                    wpq = wp * powers[layer, q]
                    for a in range(3):
                        for b in range(3):
                            tangent[i, p, a, q, b] += wpq * stiffness[i, layer, a, b]
