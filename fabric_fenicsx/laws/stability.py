"""Packed plane tensors in turned axes, material stability, and the record of a driven point that reports it.

Packing as everywhere in `laws`: strain (E11, E22, 2 E12), stress (S11, S22, S12), tangent with row =
stress and column = strain. All functions work on batches: any leading axes, components last.
"""

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any, Self

import numpy as np

from . import Array

DIRECTIONS = 360  # directions scanned over half a turn, before the smallest value is refined
PACKED = np.array([[0, 2], [2, 1]])  # place of the tensor component (I, J) in a packed stress


def rotate_strain(strain: Array, angle: float) -> Array:
    """Strain (..., 3) as seen from axes turned by `angle` (radians, from 1 towards 2)."""
    return strain @ _turn(-angle)  # the transposed inverse of the stress's matrix: S . dE stays


def rotate_stress(stress: Array, angle: float) -> Array:
    """Stress (..., 3) as seen from axes turned by `angle` (radians, from 1 towards 2)."""
    return stress @ _turn(angle).T


def rotate_tangent(tangent: Array, angle: float) -> Array:
    """Tangent (..., 3, 3) as seen from axes turned by `angle` (radians, from 1 towards 2)."""
    T = _turn(angle)
    return T @ tangent @ T.T


def _turn(angle: float) -> Array:
    """Matrix that takes a packed stress to axes turned by `angle`: S' = R S R^T, R = [[c, s], [-s, c]]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s], [-c * s, c * s, c * c - s * s]])


def second_order_work(tangent: Array) -> Array:
    """Smallest eigenvalue (...,) in Pa of the symmetric part of the tangent (..., m, m).

    Positive: every small strain dE costs work dE . C dE > 0 (Hill's condition, without the geometric part).
    """
    return np.linalg.eigvalsh((tangent + np.swapaxes(tangent, -1, -2)) / 2)[..., 0]


@dataclass(frozen=True)
class Acoustic:
    """What the acoustic tensor says at n points; angles in radians in (-pi/2, pi/2], from axis 1.

    While `eigenvalue` > 0 the material is strongly elliptic. Where `determinant` first falls to zero,
    ellipticity is lost: strain can localise in a band with the reference normal at `determinant_angle`.
    For a tangent without symmetry the first may fail well before the second.
    """

    eigenvalue: Array
    """(n,) in Pa: smallest eigenvalue of the symmetric part of Q(N), over all directions N."""
    eigenvalue_angle: Array
    """(n,): the direction N of it."""
    determinant: Array
    """(n,) in Pa^2: smallest det Q(N) over all directions N."""
    determinant_angle: Array
    """(n,): the direction N of it."""


def acoustic(strain: Array, stress: Array, tangent: Array) -> Acoustic:
    """Material stability in the plane, from strain (n, 3), stress (n, 3) in Pa and tangent (n, 3, 3) in Pa.

        Q_ik(N) = N_J (delta_ik S_JL + F_iI C_IJKL F_kK) N_L,    F = sqrt(I + 2 E)

    that is, A_iJkL N_J N_L with A = dP/dF. The rotation left out of F turns Q and changes no eigenvalue. C
    has the minor symmetries, not the major one. Each minimum is the smallest of 360 directions, refined
    by golden section between its neighbours. NaN where I + 2 E is not positive definite.
    """
    F = _stretch(strain)
    C = tangent[:, PACKED[:, :, None, None], PACKED]  # C_IJKL = dS_IJ/dE_KL, shape (n, 2, 2, 2, 2)
    A = np.einsum("niI,nIJKL,nkK->nikJL", F, C, F, optimize=True)
    A += np.eye(2)[:, :, None, None] * stress[:, None, None, PACKED]
    A_11, A_12, A_22 = A[..., 0, 0], A[..., 0, 1] + A[..., 1, 0], A[..., 1, 1]

    def Q(angle: Array) -> Array:
        c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
        q: Array = A_11 * c * c + A_12 * (c * s) + A_22 * s * s
        return q

    def determinant(angle: Array) -> Array:
        q = Q(angle)
        return q[:, 0, 0] * q[:, 1, 1] - q[:, 0, 1] * q[:, 1, 0]

    def eigenvalue(angle: Array) -> Array:
        q = Q(angle)
        mean, half = (q[:, 0, 0] + q[:, 1, 1]) / 2, (q[:, 0, 0] - q[:, 1, 1]) / 2
        return mean - np.hypot(half, (q[:, 0, 1] + q[:, 1, 0]) / 2)

    return Acoustic(*_smallest(eigenvalue, len(strain)), *_smallest(determinant, len(strain)))


def _stretch(strain: Array) -> Array:
    """Right stretch U = sqrt(I + 2 E), (n, 2, 2), by Cayley-Hamilton: U = (C + det U I)/tr U."""
    C = np.eye(2) + np.array([2.0, 2.0, 1.0])[PACKED] * strain[:, PACKED]
    trace, determinant = C[:, 0, 0] + C[:, 1, 1], C[:, 0, 0] * C[:, 1, 1] - C[:, 0, 1] * C[:, 1, 0]
    possible = (trace > 0) & (determinant > 0)
    det_U = np.sqrt(np.where(possible, determinant, np.nan))
    tr_U = np.sqrt(np.where(possible, trace, np.nan) + 2 * det_U)
    U: Array = (C + det_U[:, None, None] * np.eye(2)) / tr_U[:, None, None]
    return U


def _smallest(f: Callable[[Array], Array], n: int) -> tuple[Array, Array]:
    """Smallest value and its angle, both (n,), of n functions of period pi: f maps angles to values, (n,)."""
    step = np.pi / DIRECTIONS
    value, angle = f(np.zeros(n)), np.zeros(n)
    for k in range(1, DIRECTIONS):  # a loop over directions keeps the memory at that of one
        trial = f(np.full(n, k * step))
        lower = trial < value
        value[lower], angle[lower] = trial[lower], k * step

    golden = (np.sqrt(5) - 1) / 2
    a, b = angle - step, angle + step
    for _ in range(36):  # shrinks the bracket to 1e-9 rad, where the value is at round-off
        x, y = b - golden * (b - a), a + golden * (b - a)
        left = f(x) < f(y)
        a, b = np.where(left, a, x), np.where(left, y, b)
    refined = f((a + b) / 2)
    lower = refined < value
    value, angle = np.where(lower, refined, value), np.where(lower, (a + b) / 2, angle)
    return value, np.where(angle > np.pi / 2, angle - np.pi, angle)


@dataclass(frozen=True)
class Result:
    """A driven point: one row per step, n in all, in the axes of the call, the start left out."""

    strain: Array
    """(n, m)"""
    stress: Array
    """(n, m) in Pa"""
    tangent: Array
    """(n, m, m) in Pa, of the step (or of the last part of it, where it was cut), row = stress"""
    state: Array
    """(n, number of state variables), the law's own, as committed"""
    work: Array
    """(n,) in J/m3: integral of S . dE since the start, by the trapezoidal rule over the given steps"""
    second_order_work: Array
    """(n,) in Pa: smallest eigenvalue of the symmetric part of the tangent"""
    stability: Acoustic | None
    """Acoustic tensor over the directions of the plane; None for a law that is not plane (m = 3)"""

    @classmethod
    def of(cls, start: Array, strain: Array, stress: Array, tangent: Array, state: Array) -> Self:
        """The record of a path that began unstrained with the stress `start` (m,)."""
        mean = (stress + np.vstack([start, stress[:-1]])) / 2
        work = np.cumsum((mean * np.diff(strain, axis=0, prepend=0 * strain[:1])).sum(axis=1))
        plane = acoustic(strain, stress, tangent) if strain.shape[1] == 3 else None
        return cls(strain, stress, tangent, state, work, second_order_work(tangent), plane)

    @property
    def acoustic(self) -> Array:
        """(n,) in Pa: smallest eigenvalue of the acoustic tensor's symmetric part, over all directions."""
        return self.stability.eigenvalue if self.stability else np.full(len(self.strain), np.nan)

    @property
    def localisation(self) -> tuple[int, float] | None:
        """First step (from 0) at which det Q is not positive, and the band's normal in radians; or None."""
        if self.stability is None or not (lost := np.flatnonzero(self.stability.determinant <= 0)).size:
            return None
        return int(lost[0]), float(self.stability.determinant_angle[lost[0]])

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw each stress component in MPa over its strain; save to `path` if given; return the figure."""
        from .. import plots

        figure, (axes,) = plots.panels(1, width=5.5, height=4.2)
        m = self.strain.shape[1]
        for k, ij in enumerate(("11", "22", "12") if m == 3 else map(str, range(m))):
            name = f"$S_{{{ij}}}$ over ${'2' if ij == '12' else ''}E_{{{ij}}}$"
            axes.plot(self.strain[:, k], self.stress[:, k] / 1e6, label=name, ms=3, **plots.series(k))
        plots.label(axes, "", "Green-Lagrange strain (-)", "second Piola-Kirchhoff stress (MPa)")
        axes.axhline(0, color="0.7", lw=0.8, zorder=0)
        plots.legend(figure)
        if path is not None:
            figure.savefig(path, dpi=150)
        return figure
