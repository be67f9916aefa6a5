"""The compiled part of the woven laws: one-dimensional curves, and the loops over points.

They share one file because Numba's cache looks at the file of a function, not at what it calls.

A curve is a tuple of eight numbers (see `pack`): the loading modulus D(E) = c0 + c1 E + c2 E^2 + c3 E^3
for 0 <= E <= limit, constant outside (c0 in compression, as (6.18); the tangent beyond the
calibrated strain), the unloading modulus, the limit, and the ramp rate of `unloading`.
"""

from math import sqrt

import numba
import numpy as np

jit = numba.njit(cache=True, error_model="numpy")
# left to itself LLVM calls these with all eight numbers of a curve, which doubles the time of a law
inlined = numba.njit(forceinline=True, error_model="numpy")
UNLOAD, LIMIT, RATE, INVERSE_RATE = 4, 5, 6, 7


def pack(modulus: tuple[float, ...], unloading: float, limit: float, ramp: float) -> tuple[float, ...]:
    """The curve as the kernels read it; moduli in Pa, `ramp` the strain over which they change."""
    rate = max(unloading - modulus[0], 1e-6 * modulus[0]) / ramp
    return (
        *(float(m) for m in modulus),
        *[0.0] * (4 - len(modulus)),
        float(unloading),
        float(limit),
        rate,
        1.0 / rate,
    )


@inlined
def modulus(c, strain):
    """Loading modulus D(strain), (6.16)-(6.18)."""
    x = min(max(strain, 0.0), c[LIMIT])
    return c[0] + x * (c[1] + x * (c[2] + x * c[3]))


@inlined
def slope(c, strain):
    """dD/dstrain."""
    if strain < 0.0 or strain > c[LIMIT]:
        return 0.0
    return c[1] + strain * (2.0 * c[2] + strain * 3.0 * c[3])


@inlined
def loading_stress(c, strain):
    """Integral of the loading modulus from 0, (6.14) without its constant."""
    x = min(max(strain, 0.0), c[LIMIT])
    inside = x * (c[0] + x * (c[1] / 2.0 + x * (c[2] / 3.0 + x * c[3] / 4.0)))
    return inside + modulus(c, strain) * (strain - x)


@inlined
def mean_modulus(c, a, b):
    """Mean of D over [a, b], and its derivatives by a and by b."""
    da, db = modulus(c, a), modulus(c, b)
    low, high = min(a, b), max(a, b)
    if low >= 0.0 and high <= c[LIMIT]:
        # Simpson's rule is exact for a cubic, and has no cancellation as b approaches a
        m = 0.5 * (a + b)
        slope_m = 2.0 * slope(c, m)
        mean = (da + 4.0 * modulus(c, m) + db) / 6.0
        return mean, (slope(c, a) + slope_m) / 6.0, (slope_m + slope(c, b)) / 6.0
    length = b - a
    if high <= 0.0 or low >= c[LIMIT] or length == 0.0:
        return da, 0.0, 0.0
    mean = (loading_stress(c, b) - loading_stress(c, a)) / length
    return mean, (mean - da) / length, (db - mean) / length


@inlined
def _ramps(c, peak_stress, peak_modulus):
    """Of `unloading`: lowest modulus, square and top of the ramps, and strains of rise, plateau and fall."""
    slack = c[0]
    low = max(peak_modulus, slack)
    high = max(c[UNLOAD], low)
    # both ramps without a plateau use up the peak stress: rate S = top^2 - (peak^2 + slack^2)/2
    square = c[RATE] * peak_stress + 0.5 * (peak_modulus * peak_modulus + slack * slack)
    top = high if square >= high * high else max(sqrt(square), low)
    rise = (top - peak_modulus) * c[INVERSE_RATE]
    fall = (top - slack) * c[INVERSE_RATE]
    s_rise = peak_stress - 0.5 * (peak_modulus + top) * rise
    flat = max(s_rise - 0.5 * (top + slack) * fall, 0.0) / top
    return low, square, top, rise, flat, fall


@inlined
def unloading(c, peak_stress, peak_modulus, x):
    """Stress and modulus a strain x >= 0 below the peak, and the x at which the stress is zero.

    The modulus rises from that of the peak to the unloading modulus, stays, and falls to the
    initial modulus, which it meets where the stress is zero (3.3.2: the slope "gradually decreases
    as some crimp is recovered"); both ramps have the same rate, so stress and modulus are continuous
    everywhere. Where the stress is too small for the whole height, the ramps meet below it.
    """
    rate, slack = c[RATE], c[0]
    low, square, top, rise, flat, fall = _ramps(c, peak_stress, peak_modulus)
    s_rise = peak_stress - 0.5 * (peak_modulus + top) * rise
    s_fall = 0.5 * (top + slack) * fall
    zero = rise + flat + fall
    s_end = s_rise - top * flat - s_fall
    if square < low * low:
        # less stress than one ramp needs: it is used up on the ramp, or on the way down to slack
        sign = 1.0 if peak_modulus < slack else -1.0
        zero = 2.0 * peak_stress / (peak_modulus + sqrt(peak_modulus**2 + sign * 2.0 * rate * peak_stress))
    if x < rise:
        return peak_stress - (peak_modulus + 0.5 * rate * x) * x, peak_modulus + rate * x, zero
    x -= rise
    if x < flat:
        return s_rise - top * x, top, zero
    x -= flat
    if x < fall:
        return s_rise - top * flat - (top - 0.5 * rate * x) * x, top - rate * x, zero
    return s_end - slack * (x - fall), slack, zero


@inlined
def released(c, peak_stress, peak_modulus, x):
    """Work of unloading from a strain x below the peak until the stress is zero: the integral of `unloading`.

    Stress is a quadratic between the ends of its ramps, so Simpson's rule is exact from one to the next.
    """
    _, _, zero = unloading(c, peak_stress, peak_modulus, x)
    low, high = min(x, zero), max(x, zero)
    _, _, _, rise, flat, fall = _ramps(c, peak_stress, peak_modulus)
    total, a = 0.0, low
    for end in (rise, rise + flat, rise + flat + fall, high):
        b = min(max(end, low), high)
        if b > a:
            sa, _, _ = unloading(c, peak_stress, peak_modulus, a)
            sm, _, _ = unloading(c, peak_stress, peak_modulus, 0.5 * (a + b))
            sb, _, _ = unloading(c, peak_stress, peak_modulus, b)
            total += (b - a) * (sa + 4.0 * sm + sb) / 6.0
            a = b
    return total if zero >= x else -total


@inlined
def _yarn(c, e_old, e_new, strain_old, strain_new, peak, peak_stress, peak_modulus):
    """Stress of one yarn family, its derivatives by e and by E, its modulus; new peak, stress, modulus."""
    if not e_new > peak:
        stress, D, _ = unloading(c, peak_stress, peak_modulus, peak - e_new)
        return stress, D, 0.0, D, peak, peak_stress, peak_modulus
    # the part of the increment below the peak retraces; the rest is virgin, from strain `start` on
    part = 0.0
    start = strain_old
    by_part = 0.0
    if e_old < peak:
        part = (peak - e_old) / (e_new - e_old)
        by_part = (strain_new - strain_old) * part / (e_new - e_old)
        start += part * (strain_new - strain_old)
    mean, by_start, by_end = mean_modulus(c, start, strain_new)
    beyond = e_new - peak
    stress = peak_stress + mean * beyond
    D = modulus(c, strain_new)
    return (
        stress,
        mean - beyond * by_start * by_part,
        beyond * (by_end + by_start * part),
        D,
        e_new,
        stress,
        D,
    )


@inlined
def _shear(c, gamma, origin, signed_peak):
    """Shear stress and modulus; new origin gamma* and signed peak of gamma - gamma*."""
    sign = 1.0 if signed_peak >= 0.0 else -1.0
    peak = sign * signed_peak
    relative = sign * (gamma - origin)
    if relative >= peak:
        return sign * loading_stress(c, relative), modulus(c, relative), origin, sign * relative
    below = peak - relative
    stress, G, zero = unloading(c, loading_stress(c, peak), modulus(c, peak), below)
    if below <= zero:
        return sign * stress, G, origin, signed_peak
    # past zero stress: the virgin branch of the other sign begins there
    other = below - zero
    return -sign * loading_stress(c, other), modulus(c, other), origin + sign * (peak - zero), -sign * other


@jit
def woven(strain, state, stress, tangent, new, curve, nu12, nu21, hysteretic, reciprocal):
    """The law of `woven.Woven`; arrays as in `Law.respond`."""
    warp, weft, shear = curve
    den = 1.0 / (1.0 - nu12 * nu21)
    for i in range(strain.shape[0]):
        E1, E2, gamma = strain[i, 0], strain[i, 1], strain[i, 2]
        E1_old, E2_old = state[i, 0], state[i, 1]
        if reciprocal:
            # the committed modulus ratio in place of the measured nu21 / nu12
            a12, a21 = sqrt(nu12 * nu21) * state[i, 12], sqrt(nu12 * nu21) / state[i, 12]
            e1_old, e2_old = state[i, 10], state[i, 11]
            e1 = e1_old + (E1 - E1_old + a12 * (E2 - E2_old)) * den
            e2 = e2_old + (E2 - E2_old + a21 * (E1 - E1_old)) * den
        else:
            a12, a21 = nu21, nu12
            e1_old, e2_old = (E1_old + a12 * E2_old) * den, (E2_old + a21 * E1_old) * den
            e1, e2 = (E1 + a12 * E2) * den, (E2 + a21 * E1) * den
        S1, by_e1, by_E1, D1, new[i, 2], new[i, 3], new[i, 4] = _yarn(
            warp, e1_old, e1, E1_old, E1, state[i, 2], state[i, 3], state[i, 4]
        )
        S2, by_e2, by_E2, D2, new[i, 5], new[i, 6], new[i, 7] = _yarn(
            weft, e2_old, e2, E2_old, E2, state[i, 5], state[i, 6], state[i, 7]
        )
        if hysteretic:
            S12, G, new[i, 8], new[i, 9] = _shear(shear, gamma, state[i, 8], state[i, 9])
        else:
            S12, G = loading_stress(shear, abs(gamma)), modulus(shear, abs(gamma))
            S12 = S12 if gamma >= 0.0 else -S12
            if reciprocal:
                new[i, 8], new[i, 9] = state[i, 8], state[i, 9]
        new[i, 0], new[i, 1] = E1, E2
        if reciprocal:
            new[i, 10], new[i, 11], new[i, 12] = e1, e2, sqrt(D2 / D1)
        if not np.isfinite(E1 + E2 + gamma):
            # one bad component spoils the whole point, so that it cannot pass unseen
            S1 = S2 = S12 = np.nan
        stress[i, 0], stress[i, 1], stress[i, 2] = S1, S2, S12
        tangent[i, 0, 0], tangent[i, 0, 1], tangent[i, 0, 2] = by_e1 * den + by_E1, by_e1 * den * a12, 0.0
        tangent[i, 1, 0], tangent[i, 1, 1], tangent[i, 1, 2] = by_e2 * den * a21, by_e2 * den + by_E2, 0.0
        tangent[i, 2, 0], tangent[i, 2, 1], tangent[i, 2, 2] = 0.0, 0.0, G


@jit
def woven_recoverable(strain, state, energy, curve, nu12, nu21, hysteretic, reciprocal):
    """Of `woven.Woven.recoverable`; the state is that of the strain."""
    warp, weft, shear = curve
    den = 1.0 / (1.0 - nu12 * nu21)
    for i in range(strain.shape[0]):
        if reciprocal:
            e1, e2 = state[i, 10], state[i, 11]
        else:
            e1, e2 = (strain[i, 0] + nu21 * strain[i, 1]) * den, (strain[i, 1] + nu12 * strain[i, 0]) * den
        total = released(warp, state[i, 3], state[i, 4], state[i, 2] - e1)
        total += released(weft, state[i, 6], state[i, 7], state[i, 5] - e2)
        gamma = strain[i, 2]
        if hysteretic:
            peak = abs(state[i, 9])
            sign = 1.0 if state[i, 9] >= 0.0 else -1.0
            below = peak - sign * (gamma - state[i, 8])
            energy[i] = total + released(shear, loading_stress(shear, peak), modulus(shear, peak), below)
        else:
            energy[i] = total + _stored_in_shear(shear, abs(gamma))


@inlined
def _stored_in_shear(c, gamma):
    """Integral of the loading stress, a polynomial of degree 4 up to the limit and a line beyond."""
    inside = min(gamma, c[LIMIT])
    total, root = 0.0, 0.7745966692414834  # Gauss's rule with three points
    for place, weight in ((-root, 5.0 / 18.0), (0.0, 4.0 / 9.0), (root, 5.0 / 18.0)):
        total += weight * inside * loading_stress(c, 0.5 * inside * (1.0 + place))
    return total + 0.5 * (gamma - inside) * (loading_stress(c, inside) + loading_stress(c, gamma))


@inlined
def _printed_modulus(c, strain, largest):
    """Modulus of a yarn and its derivative by strain, (6.16)-(6.21)."""
    if strain < 0.0:
        return c[0], 0.0
    if strain >= largest:
        return modulus(c, strain), slope(c, strain)
    stretch, peak = np.sqrt(1.0 + 2.0 * strain), np.sqrt(1.0 + 2.0 * largest)
    weight = (stretch / peak - 0.999) / 0.001
    if weight <= 0.0:
        return c[UNLOAD], 0.0
    step = modulus(c, largest) - c[UNLOAD]
    return c[UNLOAD] + weight * step, step / (0.001 * peak * stretch)


@jit
def printed(strain, state, stress, tangent, new, curve, nu12, nu21, hysteretic):
    """The law of `printed.Printed`, Box 6-1; arrays as in `Law.respond`."""
    warp, weft, shear = curve
    den = 1.0 / (1.0 - nu12 * nu21)
    for i in range(strain.shape[0]):
        E1, E2, gamma = strain[i, 0], strain[i, 1], strain[i, 2]
        dE1, dE2, dgamma = E1 - state[i, 0], E2 - state[i, 1], gamma - state[i, 2]
        S12_old, largest1, largest2 = state[i, 5], state[i, 6], state[i, 7]
        origin, peak = state[i, 8], state[i, 9]
        D1, slope1 = _printed_modulus(warp, E1, largest1)
        D2, slope2 = _printed_modulus(weft, E2, largest2)
        de1, de2 = (dE1 + nu21 * dE2) * den, (dE2 + nu12 * dE1) * den
        S1, S2 = state[i, 3] + D1 * de1, state[i, 4] + D2 * de2

        if not hysteretic:
            S12, G = loading_stress(shear, abs(gamma)), modulus(shear, abs(gamma))
            S12 = S12 if gamma >= 0.0 else -S12
        else:
            relative = abs(gamma - origin)
            virgin = S12_old * dgamma >= 0.0 and relative >= peak
            G = modulus(shear, relative) if virgin else shear[UNLOAD]
            S12 = S12_old + G * dgamma
            if virgin:
                peak = relative
                G += slope(shear, relative) * (dgamma if gamma >= origin else -dgamma)
            if S12_old * S12 < 0.0:
                origin, peak = gamma, 0.0

        new[i, 0], new[i, 1], new[i, 2] = E1, E2, gamma
        new[i, 3], new[i, 4], new[i, 5] = S1, S2, S12
        new[i, 6], new[i, 7] = max(largest1, E1), max(largest2, E2)
        new[i, 8], new[i, 9] = origin, peak
        if not np.isfinite(E1 + E2 + gamma):
            # one bad component spoils the whole point, so that it cannot pass unseen
            S1 = S2 = S12 = np.nan
        stress[i, 0], stress[i, 1], stress[i, 2] = S1, S2, S12
        tangent[i, 0, 0], tangent[i, 0, 1], tangent[i, 0, 2] = D1 * den + slope1 * de1, nu21 * D1 * den, 0.0
        tangent[i, 1, 0], tangent[i, 1, 1], tangent[i, 1, 2] = nu12 * D2 * den, D2 * den + slope2 * de2, 0.0
        tangent[i, 2, 0], tangent[i, 2, 1], tangent[i, 2, 2] = 0.0, 0.0, G
