"""In-plane shear as cloth does it: friction at the start, softening from cycle to cycle, locking (a generalised play).

Stress tau of gamma = 2 E12, from two numbers of state, the strain p at which the stress would be gone along the
unloading modulus K, and the largest shear so far, m:

    tau = clip(K (gamma - p_old), C, O),    p = gamma - tau/K,    m = max(m_old, |gamma|).

With y0 the friction of fresh cloth and L the measured curve, for gamma = g >= 0 (for gamma < 0 the upper limit is
-C(|gamma|), the lower one -O(|gamma|)):

    T(g) = y0 + L(g)                                    first loading
    f(m) = y0 (r + (1 - r) m0/(m0 + m)) + phi L(m)      friction that is left after a shear of m
    B(g) = T(g) - f(g)                                  what the weave, and not friction, bears
    O    = f(m) + B(g) (1 - D (1 - z)),  z = x/(n - (n - 1) x),  x = g/m      limit of opening; T where g = m
    C    = -f(m) + beta B(g)                                                  limit of closing

r is `kept`, m0 `strain`, phi `set_in`, beta `returned`, D `softening`, n >= 1 `rejoining` of
`fabrics.ShearFriction`. What is stored is tau^2/2K + H(p), where H' is the elastic part E = beta B at the gamma at
which gamma - E/K = p.

No energy is made, because C <= E <= O (beta <= 1 - D, f >= 0) and no limit is as steep as K: p is then one to one
along a limit, the stored energy does not depend on m, and (tau - H') dp >= 0 opening and closing. Along a straight
increment the trial stress crosses each limit once, also while m grows, so that one increment is as good as many and
its work has a potential. With s the largest slope of T + f(0) - f, and a the largest B(g)/g, O' <= s + D n B(m)/m:
n is taken no larger than (0.999 K - s) m/(D B(m)), which is 1 or more where s + D a <= 0.999 K.
"""

from math import log1p
from typing import TYPE_CHECKING

import numba
import numpy as np

from ..errors import InputError
from ..fabrics.friction import BELOW

if TYPE_CHECKING:
    from ..fabrics import Curve, ShearFriction

jit = numba.njit(cache=True, error_model="numpy")
# as in `kernels`: LLVM would call these with all numbers of a play
inlined = numba.njit(forceinline=True, error_model="numpy")
LIMIT, K, Y0, KEPT, M0, SET_IN, RETURNED, SOFTENING, REJOINING, STEEPEST = range(4, 14)
RESTING = 1e-11
"""Strain within which a point counts as lying on a limit: its tangent is that of loading on."""
NODES, WEIGHTS = (tuple(map(float, x)) for x in np.polynomial.legendre.leggauss(16))


def pack(name: str, curve: "Curve", friction: "ShearFriction") -> tuple[float, ...]:
    """A play as the kernels read it; InputError where it would make energy, which names the fabric."""
    said = friction.contradiction(curve)
    if said:
        raise InputError(f"{name}: {said}.")
    numbers = [*curve.modulus, 0.0, 0.0, 0.0][:4] + [curve.limit, curve.unloading]
    numbers += [friction.friction, friction.kept, friction.strain, friction.set_in, friction.returned]
    return (*map(float, (*numbers, friction.softening, friction.rejoining, friction.steepest(curve))),)


@inlined
def _curve(c, g):
    """L(g) and L'(g) at g >= 0."""
    x = min(g, c[LIMIT])
    D = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
    return x * (c[0] + x * (c[1] / 2.0 + x * (c[2] / 3.0 + x * c[3] / 4.0))) + D * (g - x), D


@inlined
def _borne(c, g):
    """B(g) and its slope at g >= 0."""
    L, D = _curve(c, g)
    fading, part = c[Y0] * (1.0 - c[KEPT]), c[M0] / (c[M0] + g)
    return (1.0 - c[SET_IN]) * L + fading * (1.0 - part), (1.0 - c[SET_IN]) * D + fading * part / (c[M0] + g)


@inlined
def _friction(c, m):
    """f(m)."""
    L, _ = _curve(c, m)
    return c[Y0] * (c[KEPT] + (1.0 - c[KEPT]) * c[M0] / (c[M0] + m)) + c[SET_IN] * L


@inlined
def _rejoining(c, m):
    """n after a largest shear of m > 0."""
    B, _ = _borne(c, m)
    steep = c[SOFTENING] * B
    return max(1.0, min(c[REJOINING], (BELOW * c[K] - c[STEEPEST]) * m / steep)) if steep > 0.0 else c[REJOINING]


@inlined
def _upper(c, gamma, m):
    """Upper limit of the stress and its slope by gamma, after a largest shear of m; first loading from m on."""
    if gamma >= m:
        L, D = _curve(c, gamma)
        return c[Y0] + L, D
    B, slope = _borne(c, abs(gamma))
    if gamma < 0.0:
        return _friction(c, m) - c[RETURNED] * B, c[RETURNED] * slope
    n, x = _rejoining(c, m), gamma / m
    q = n - (n - 1.0) * x
    lost = c[SOFTENING] * (1.0 - x / q)
    return _friction(c, m) + B * (1.0 - lost), slope * (1.0 - lost) + B * c[SOFTENING] * n / (q * q * m)


@inlined
def _point(c, gamma, p, m):
    """Stress and modulus; new p and m."""
    S, G = c[K] * (gamma - p), c[K]
    high, by_high = _upper(c, gamma, m)
    low, by_low = _upper(c, -gamma, m)
    if S >= high - RESTING * c[K]:
        G = by_high
        if S > high:
            S, p = high, gamma - high / c[K]
    elif S <= RESTING * c[K] - low:
        G = by_low
        if S < -low:
            S, p = -low, gamma + low / c[K]
    return S, G, p, max(m, abs(gamma))


@jit
def respond(strain, state, stress, tangent, new, c, first):
    """Shear of `potential.Potential`; arrays as in `Law.respond`, p and m from column `first` of the state on."""
    for i in range(strain.shape[0]):
        gamma = strain[i, 2]
        S, tangent[i, 2, 2], new[i, first], new[i, first + 1] = _point(c, gamma, state[i, first], state[i, first + 1])
        stress[i, 2] = S if np.isfinite(strain[i, 0] + strain[i, 1] + gamma) else np.nan


@jit
def advance(strain, state, stress, new, powers, moments, c, first):
    """Shear of `potential.Potential.advance`, to be added to the rest."""
    layers, parts = powers.shape
    for i in range(strain.shape[0]):
        for layer in range(layers):
            at, gamma = i * layers + layer, strain[i, 2]
            for p in range(1, parts):
                gamma += powers[layer, p] * strain[i, 3 * p + 2]
            S, _, new[at, first], new[at, first + 1] = _point(c, gamma, state[at, first], state[at, first + 1])
            for p in range(parts):
                stress[i, 3 * p + 2] += moments[p, layer] * S


@jit
def follow(gamma, c):
    """Stress (n,) of a point that goes from rest through the shears gamma (n,), one after the other."""
    stress, p, m = np.empty(len(gamma)), 0.0, 0.0
    for i in range(len(gamma)):
        stress[i], _, p, m = _point(c, gamma[i], p, m)
    return stress


@inlined
def _curve_work(c, g):
    """Integral of L from 0 to g >= 0."""
    x = min(g, c[LIMIT])
    L, D = _curve(c, x)
    total = x * x * (c[0] / 2.0 + x * (c[1] / 6.0 + x * (c[2] / 12.0 + x * c[3] / 20.0)))
    return total + (L + 0.5 * D * (g - x)) * (g - x)


@inlined
def _borne_work(c, g):
    """Integral of B from 0 to g >= 0."""
    fading = c[Y0] * (1.0 - c[KEPT])
    return (1.0 - c[SET_IN]) * _curve_work(c, g) + fading * (g - c[M0] * log1p(g / c[M0]))


@inlined
def _rejoined_work(c, a, b, m):
    """Integral of B z from a to b, 0 <= a <= b <= m.

    With t = log(1 + (n - 1)(1 - x))/(n - 1), z dg = -m x dt, an entire function of t that Gauss's rule takes in to
    round-off on both sides of the end of the curve; the part m0/(m0 + g) has two logarithms.
    """
    n, total = _rejoining(c, m), 0.0
    k, fading = n - 1.0, c[Y0] * (1.0 - c[KEPT])
    middle = min(max(c[LIMIT], a), b)
    for low, high in ((a, middle), (middle, b)):
        if high > low:
            y, y_end = 1.0 - low / m, 1.0 - high / m
            t, t_end = (log1p(k * y) / k, log1p(k * y_end) / k) if k > 1e-9 else (y, y_end)
            half = 0.5 * (t - t_end)
            for node, weight in zip(NODES, WEIGHTS):  # noqa: B905  Numba knows no strict
                at = t_end + half * (1.0 + node)
                x = 1.0 - (np.expm1(k * at) / k if k > 1e-9 else at)
                L, _ = _curve(c, m * x)
                total += weight * half * m * x * ((1.0 - c[SET_IN]) * L + fading)
    if fading > 0.0 and b > a:
        y, y_end = 1.0 - a / m, 1.0 - b / m
        whole = (log1p(k * y) - log1p(k * y_end)) / k if k > 1e-9 else y - y_end
        part = n * whole - c[M0] / m * log1p((b - a) / (c[M0] + a))
        total -= fading * c[M0] * part / (n + k * c[M0] / m)
    return total


@inlined
def _upper_work(c, a, b, m):
    """Integral of the upper limit from a to b, -m <= a <= b."""
    total = 0.0
    if a < m:
        end = min(b, m)
        total += _friction(c, m) * (end - a)
        if a < 0.0:
            total -= c[RETURNED] * (_borne_work(c, -a) - _borne_work(c, max(-end, 0.0)))
        if end > 0.0:
            start = max(a, 0.0)
            total += (1.0 - c[SOFTENING]) * (_borne_work(c, end) - _borne_work(c, start))
            if c[SOFTENING] > 0.0:
                total += c[SOFTENING] * _rejoined_work(c, start, end, m)
    if b > m:
        start = max(a, m)
        total += c[Y0] * (b - start) + _curve_work(c, b) - _curve_work(c, start)
    return total


@inlined
def _stored(c, p):
    """H(p): the integral of E dp, with E = beta B at the gamma at which gamma - E/K = p."""
    size, beta = abs(p), c[RETURNED]
    low, high = size, size / (1.0 - beta * c[STEEPEST] / c[K])
    g = low
    for _ in range(60):
        B, slope = _borne(c, g)
        miss = g - beta * B / c[K] - size
        low, high = (g, high) if miss < 0.0 else (low, g)
        step = miss / (1.0 - beta * slope / c[K])
        inside = low <= g - step <= high
        g = g - step if inside else 0.5 * (low + high)
        if abs(step) <= 1e-15 * g:
            break
    B, _ = _borne(c, g)
    return beta * _borne_work(c, g) - 0.5 * (beta * B) ** 2 / c[K]


@inlined
def _crossing(c, gamma, p, m):
    """Where, on the way up to gamma, the trial stress K (g - p) meets the upper limit."""
    low, high, g = -m, gamma, gamma
    for _ in range(80):
        limit, slope = _upper(c, g, m)
        miss = c[K] * (g - p) - limit
        low, high = (g, high) if miss < 0.0 else (low, g)
        step = miss / (c[K] - slope)
        inside = low <= g - step <= high
        g = g - step if inside else 0.5 * (low + high)
        if abs(step) <= 1e-16 + 1e-15 * abs(g):
            break
    return g


@jit
def add_potential(strain, state, energy, c, first):
    """Add the incremental potential of shear, counted from unstrained cloth, to an energy (n,)."""
    for i in range(strain.shape[0]):
        gamma, p, m = strain[i, 2], state[i, first], state[i, first + 1]
        S = c[K] * (gamma - p)
        energy[i] += _stored(c, p)
        high, _ = _upper(c, gamma, m)
        low, _ = _upper(c, -gamma, m)
        sign = 1.0 if S > high else (-1.0 if S < -low else 0.0)
        if sign != 0.0:
            start = _crossing(c, sign * gamma, sign * p, m)
            S = c[K] * (start - sign * p)
            energy[i] += _upper_work(c, start, sign * gamma, m)
        energy[i] += 0.5 * S * S / c[K]
