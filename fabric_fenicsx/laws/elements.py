"""The compiled part of `potential`: one-dimensional dissipative elements, their energy, and the loops over points.

They stand in one file because Numba's cache looks at the file of a function, not at what it calls.

An element is a tuple of ten numbers (see `pack`). First loading, from its peak strain p on, follows a modulus
D(e) = c0 + c1 e + c2 e^2 + c3 e^3, constant beyond the limit, which starts at the slack modulus d instead of c0 and
joins the polynomial at `start`. Below the peak the modulus is, as a function of the stress s,

    m(s) = min(sqrt(D_p^2 + 2 r (S_p - s)), U, sqrt(d^2 + 2 r s)),    d below zero stress:

it rises at the rate r from that of the peak to the unloading modulus U, stays, and falls to d where the stress is
gone; reloading retraces it.
"""

from math import sqrt

import numba
import numpy as np

jit = numba.njit(cache=True, error_model="numpy")
# as in `kernels`: LLVM would call these with all ten numbers
inlined = numba.njit(forceinline=True, error_model="numpy")
UNLOAD, LIMIT, RATE, INVERSE_RATE, SLACK, START = 4, 5, 6, 7, 8, 9
ELASTIC, HYSTERETIC, ELSEWHERE = range(3)
"""Shear without history, by the element of `woven`, or by `play`."""


def pack(modulus, unloading, limit, rate, slack, start):
    """The element as the kernels read it; moduli in Pa, `rate` in Pa a strain, `start` where D joins the polynomial."""
    return (*(float(m) for m in modulus), *map(float, (unloading, limit, rate, 1.0 / rate, slack, start)))


@inlined
def loading(c, e):
    """Stress and modulus of first loading at e >= 0."""
    x = min(e, c[LIMIT])
    D = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
    S = x * (c[0] + x * (c[1] / 2.0 + x * (c[2] / 3.0 + x * c[3] / 4.0))) + D * (e - x)
    if e < c[START]:
        # 1 - 4 t + 3 t^2, whose integral from 0 to 1 is zero: the stress beyond is that of the polynomial
        t = e / c[START]
        S += (c[SLACK] - c[0]) * e * (1.0 - t) * (1.0 - t)
        D += (c[SLACK] - c[0]) * (1.0 - t) * (1.0 - 3.0 * t)
    return S, D


@inlined
def loading_energy(c, e):
    """Integral of the stress of first loading from 0 to e >= 0."""
    x = min(e, c[LIMIT])
    S = x * (c[0] + x * (c[1] / 2.0 + x * (c[2] / 3.0 + x * c[3] / 4.0)))
    D = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
    total = x * x * (c[0] / 2.0 + x * (c[1] / 6.0 + x * (c[2] / 12.0 + x * c[3] / 20.0)))
    total += (S + 0.5 * D * (e - x)) * (e - x)
    if c[START] > 0.0:
        y = min(e, c[START])
        t = y / c[START]
        total += (c[SLACK] - c[0]) * y * y * (0.5 - t * (2.0 / 3.0 - 0.25 * t))
    return total


@inlined
def _ramps(c, peak_stress, peak_modulus):
    """Of the way down from a peak: top modulus; strains of rise, plateau, fall; stress after rise and plateau."""
    d = c[SLACK]
    # both ramps without a plateau use up the peak stress: r S = top^2 - (peak^2 + slack^2)/2
    square = c[RATE] * peak_stress + 0.5 * (peak_modulus * peak_modulus + d * d)
    full = square >= c[UNLOAD] * c[UNLOAD]
    top = c[UNLOAD] if full else sqrt(square)
    rise, fall = (top - peak_modulus) * c[INVERSE_RATE], (top - d) * c[INVERSE_RATE]
    s_rise, s_fall = peak_stress - 0.5 * (peak_modulus + top) * rise, 0.5 * (top + d) * fall
    flat = (s_rise - s_fall) / top if full and top > 0.0 else 0.0
    return top, rise, flat, fall, s_rise, s_fall


@inlined
def unloading(c, peak_stress, peak_modulus, x):
    """Stress and modulus a strain x >= 0 below the peak; a number that is negative past zero stress, by how much."""
    if peak_stress <= 0.0:
        return -c[SLACK] * x, c[SLACK], -x
    top, rise, flat, fall, s_rise, _ = _ramps(c, peak_stress, peak_modulus)
    if x < rise:
        return peak_stress - (peak_modulus + 0.5 * c[RATE] * x) * x, peak_modulus + c[RATE] * x, 0.0
    x -= rise
    if x < flat:
        return s_rise - top * x, top, 0.0
    above = flat + fall - x  # the strain at which the stress is zero
    if above > 0.0:
        return (c[SLACK] + 0.5 * c[RATE] * above) * above, c[SLACK] + c[RATE] * above, above
    return c[SLACK] * above, c[SLACK], above


@inlined
def stored(c, peak_stress, peak_modulus, x):
    """Work that unloading from a strain x >= 0 below the peak gives back until the stress is zero."""
    d, r = c[SLACK], c[RATE]
    if peak_stress <= 0.0:
        return 0.5 * d * x * x
    top, rise, flat, fall, s_rise, s_fall = _ramps(c, peak_stress, peak_modulus)
    above = rise + flat + fall - x
    if above <= 0.0:
        return 0.5 * d * above * above
    y = min(above, fall)
    total = y * y * (0.5 * d + r * y / 6.0)
    if above > fall:
        y = min(above - fall, flat)
        total += y * (s_fall + 0.5 * top * y)
        if x < rise:
            y = rise - x
            total += y * (s_rise + y * (0.5 * top - r * y / 6.0))
    return total


@inlined
def _element(c, e, peak, peak_stress, peak_modulus):
    """Stress and modulus; new peak, and stress and modulus there."""
    if e > peak:
        S, D = loading(c, e)
        return S, D, e, S, D
    S, D, _ = unloading(c, peak_stress, peak_modulus, peak - e)
    return S, D, peak, peak_stress, peak_modulus


@inlined
def _energy(c, e, peak, peak_stress, peak_modulus):
    """Incremental potential: what the peak gives back, and the work of loading beyond it; or what is stored below."""
    if e > peak:
        return stored(c, peak_stress, peak_modulus, 0.0) + (loading_energy(c, e) - loading_energy(c, peak))
    return stored(c, peak_stress, peak_modulus, peak - e)


@inlined
def _shear(c, gamma, origin, signed_peak):
    """Shear stress and modulus; new origin gamma* and signed peak of gamma - gamma*."""
    sign = 1.0 if signed_peak >= 0.0 else -1.0
    peak, relative = sign * signed_peak, sign * (gamma - origin)
    if relative >= peak:
        S, G = loading(c, relative)
        return sign * S, G, origin, sign * relative
    peak_stress, peak_modulus = loading(c, peak)
    S, G, above = unloading(c, peak_stress, peak_modulus, peak - relative)
    if above >= 0.0:
        return sign * S, G, origin, signed_peak
    # past zero stress: first loading to the other side begins there
    S, G = loading(c, -above)
    return -sign * S, G, origin + sign * (relative - above), sign * above


@inlined
def _shear_energy(c, gamma, origin, signed_peak):
    """Incremental potential of `_shear`."""
    sign = 1.0 if signed_peak >= 0.0 else -1.0
    peak, relative = sign * signed_peak, sign * (gamma - origin)
    peak_stress, peak_modulus = loading(c, peak)
    if relative >= peak:
        return _energy(c, relative, peak, peak_stress, peak_modulus)
    _, _, above = unloading(c, peak_stress, peak_modulus, peak - relative)
    if above >= 0.0:
        return stored(c, peak_stress, peak_modulus, peak - relative)
    return loading_energy(c, -above)


@jit
def follow_shear(gamma, c):
    """Stress (n,) of a point that goes from rest through the shears gamma (n,), one after the other."""
    stress, origin, peak = np.empty(len(gamma)), 0.0, 0.0
    for i in range(len(gamma)):
        stress[i], _, origin, peak = _shear(c, gamma[i], origin, peak)
    return stress


@jit
def respond(strain, state, stress, tangent, new, elements, nu12, nu21, b1, b2, shearing):
    """The law of `potential.Potential`; arrays as in `Law.respond`. What shear is left to `play` is elastic here."""
    warp, warp_tension, weft, weft_tension, shear = elements
    for i in range(strain.shape[0]):
        E1, E2, gamma = strain[i, 0], strain[i, 1], strain[i, 2]
        Sa, Da, new[i, 0], new[i, 1], new[i, 2] = _element(warp, E1 + nu21 * E2, state[i, 0], state[i, 1], state[i, 2])
        Sb, Db, new[i, 3], new[i, 4], new[i, 5] = _element(
            warp_tension, E1 - b1 * E2, state[i, 3], state[i, 4], state[i, 5]
        )
        Sc, Dc, new[i, 6], new[i, 7], new[i, 8] = _element(weft, E2 + nu12 * E1, state[i, 6], state[i, 7], state[i, 8])
        Sd, Dd, new[i, 9], new[i, 10], new[i, 11] = _element(
            weft_tension, E2 - b2 * E1, state[i, 9], state[i, 10], state[i, 11]
        )
        if shearing == HYSTERETIC:
            S12, G, new[i, 12], new[i, 13] = _shear(shear, gamma, state[i, 12], state[i, 13])
        else:
            S12, G = loading(shear, abs(gamma))
            S12 = S12 if gamma >= 0.0 else -S12
        S1 = Sa + Sb + nu12 * Sc - b2 * Sd
        S2 = nu21 * Sa - b1 * Sb + Sc + Sd
        if not np.isfinite(E1 + E2 + gamma):
            # one bad component spoils the whole point, so that it cannot pass unseen
            S1 = S2 = S12 = np.nan
        stress[i, 0], stress[i, 1], stress[i, 2] = S1, S2, S12
        C12 = nu21 * Da - b1 * Db + nu12 * Dc - b2 * Dd
        tangent[i, 0, 0], tangent[i, 0, 1], tangent[i, 0, 2] = Da + Db + nu12 * nu12 * Dc + b2 * b2 * Dd, C12, 0.0
        tangent[i, 1, 0], tangent[i, 1, 1], tangent[i, 1, 2] = C12, nu21 * nu21 * Da + b1 * b1 * Db + Dc + Dd, 0.0
        tangent[i, 2, 0], tangent[i, 2, 1], tangent[i, 2, 2] = 0.0, 0.0, G


@inlined
def _top(c, peak_stress, peak_modulus):
    """Largest modulus below a peak."""
    return min(sqrt(c[RATE] * peak_stress + 0.5 * (peak_modulus * peak_modulus + c[SLACK] * c[SLACK])), c[UNLOAD])


@inlined
def _pass(c, e, state, new, i, at):
    """As `_element` with the state from column `at` on: stress, and the rise of `_top` as a part of the largest."""
    peak, S0, D0 = state[i, at], state[i, at + 1], state[i, at + 2]
    if e > peak:
        S, D = loading(c, e)
        new[i, at], new[i, at + 1], new[i, at + 2] = e, S, D
        return S, (_top(c, S, D) - _top(c, S0, D0)) / c[UNLOAD] if c[UNLOAD] > 0.0 else 0.0
    S, _, _ = unloading(c, S0, D0, peak - e)
    new[i, at], new[i, at + 1], new[i, at + 2] = peak, S0, D0
    return S, 0.0


@jit
def advance(strain, state, stress, new, powers, moments, elements, nu12, nu21, b1, b2, shearing):
    """`respond` without a tangent, in the layers of a `section.Section`; see `potential.Potential.advance`."""
    warp, warp_tension, weft, weft_tension, shear = elements
    layers, parts = powers.shape
    risen = 0.0
    for i in range(strain.shape[0]):
        for a in range(stress.shape[1]):
            stress[i, a] = 0.0
        for layer in range(layers):
            at = i * layers + layer
            E1, E2, gamma = strain[i, 0], strain[i, 1], strain[i, 2]
            for p in range(1, parts):
                z = powers[layer, p]
                E1, E2, gamma = (
                    E1 + z * strain[i, 3 * p], E2 + z * strain[i, 3 * p + 1], gamma + z * strain[i, 3 * p + 2]
                )  # fmt: skip
            Sa, ra = _pass(warp, E1 + nu21 * E2, state, new, at, 0)
            Sb, rb = _pass(warp_tension, E1 - b1 * E2, state, new, at, 3)
            Sc, rc = _pass(weft, E2 + nu12 * E1, state, new, at, 6)
            Sd, rd = _pass(weft_tension, E2 - b2 * E1, state, new, at, 9)
            risen = max(risen, max(max(ra, rb), max(rc, rd)))
            if shearing == HYSTERETIC:
                S12, _, new[at, 12], new[at, 13] = _shear(shear, gamma, state[at, 12], state[at, 13])
            elif shearing == ELASTIC:
                S12, _ = loading(shear, abs(gamma))
                S12 = S12 if gamma >= 0.0 else -S12
            else:
                S12 = 0.0
            S1, S2 = Sa + Sb + nu12 * Sc - b2 * Sd, nu21 * Sa - b1 * Sb + Sc + Sd
            if not np.isfinite(E1 + E2 + gamma):
                S1 = S2 = S12 = np.nan
            for p in range(parts):
                w = moments[p, layer]
                stress[i, 3 * p] += w * S1
                stress[i, 3 * p + 1] += w * S2
                stress[i, 3 * p + 2] += w * S12
    return risen


@jit
def hardened(strain, state, stress, tangent, elements, nu12, nu21, b1, b2):
    """The law of `potential.Hardened`; arrays as in `Law.respond`."""
    warp, warp_tension, weft, weft_tension, shear = elements
    for i in range(strain.shape[0]):
        Da, Db = _top(warp, state[i, 1], state[i, 2]), _top(warp_tension, state[i, 4], state[i, 5])
        Dc, Dd = _top(weft, state[i, 7], state[i, 8]), _top(weft_tension, state[i, 10], state[i, 11])
        C11, C22 = Da + Db + nu12 * nu12 * Dc + b2 * b2 * Dd, nu21 * nu21 * Da + b1 * b1 * Db + Dc + Dd
        C12 = nu21 * Da - b1 * Db + nu12 * Dc - b2 * Dd
        tangent[i, 0, 0], tangent[i, 0, 1], tangent[i, 0, 2] = C11, C12, 0.0
        tangent[i, 1, 0], tangent[i, 1, 1], tangent[i, 1, 2] = C12, C22, 0.0
        tangent[i, 2, 0], tangent[i, 2, 1], tangent[i, 2, 2] = 0.0, 0.0, shear[UNLOAD]
        stress[i, 0], stress[i, 1] = C11 * strain[i, 0] + C12 * strain[i, 1], C12 * strain[i, 0] + C22 * strain[i, 1]
        stress[i, 2] = shear[UNLOAD] * strain[i, 2]


@jit
def potential(strain, state, energy, elements, nu12, nu21, b1, b2, shearing):
    """Of `potential.Potential.potential`."""
    warp, warp_tension, weft, weft_tension, shear = elements
    for i in range(strain.shape[0]):
        E1, E2, gamma = strain[i, 0], strain[i, 1], strain[i, 2]
        total = _energy(warp, E1 + nu21 * E2, state[i, 0], state[i, 1], state[i, 2])
        total += _energy(warp_tension, E1 - b1 * E2, state[i, 3], state[i, 4], state[i, 5])
        total += _energy(weft, E2 + nu12 * E1, state[i, 6], state[i, 7], state[i, 8])
        total += _energy(weft_tension, E2 - b2 * E1, state[i, 9], state[i, 10], state[i, 11])
        if shearing == HYSTERETIC:
            total += _shear_energy(shear, gamma, state[i, 12], state[i, 13])
        elif shearing == ELASTIC:
            total += loading_energy(shear, abs(gamma))
        energy[i] = total
