"""The compiled part of contact: points of a sheet near bodies in closed form.

They share one file because Numba's cache looks at the file of a function, not at what it calls. A body is a tuple of
its kind, the half sizes of its core (of a plane its normal) and its radius; a frame is the middle and the axes of its
shape, rows. Points of a sheet are rows of `nodes` and their `shares` (k, 3), see `points.Grid`.
"""

from math import sqrt

import numba
import numpy as np

jit = numba.njit(cache=True, error_model="numpy")
inlined = numba.njit(forceinline=True, error_model="numpy")
PLANE, BALL, ROUND, BOX = range(4)


@inlined
def _core(kind, size, radius, x, y, z):
    """The nearest place of the core, in its own frame."""
    if kind == ROUND:
        left = 0.0 if radius > 0.0 else min(1.0, size[0] / max(sqrt(x * x + y * y), 1e-300))
        return left * x, left * y, min(max(z, -size[2]), size[2])
    if kind == BOX:
        return min(max(x, -size[0]), size[0]), min(max(y, -size[1]), size[1]), min(max(z, -size[2]), size[2])
    return 0.0, 0.0, 0.0


@inlined
def _away(kind, size, radius, x, y, z):
    """Distance and its gradient, in the own frame."""
    if kind == PLANE:
        return x * size[0] + y * size[1] + z * size[2], size[0], size[1], size[2]
    a, b, c = _core(kind, size, radius, x, y, z)
    x, y, z = x - a, y - b, z - c
    d = sqrt(x * x + y * y + z * z)
    return d - radius, x / max(d, 1e-300), y / max(d, 1e-300), z / max(d, 1e-300)


@inlined
def _own(middle, frame, x, y, z, k):
    """A coordinate in the own frame."""
    return frame[k, 0] * (x - middle[0]) + frame[k, 1] * (y - middle[1]) + frame[k, 2] * (z - middle[2])


@inlined
def _at(nodes, shares, p, x, k):
    """A coordinate of a point of the sheet."""
    total = shares[p, 0] * x[nodes[p, 0], k]
    for a in range(1, 3):
        if shares[p, a] != 0.0:
            total += shares[p, a] * x[nodes[p, a], k]
    return total


@jit
def distances(body, middle, frame, x):
    """Of places (k, 3), and their gradients (k, 3)."""
    kind, size, radius = body
    far, normals = np.empty(len(x)), np.empty((len(x), 3))
    for p in range(len(x)):
        y0, y1, y2 = (
            _own(middle, frame, x[p, 0], x[p, 1], x[p, 2], 0),
            _own(middle, frame, x[p, 0], x[p, 1], x[p, 2], 1),
            _own(middle, frame, x[p, 0], x[p, 1], x[p, 2], 2),
        )
        far[p], a, b, c = _away(kind, size, radius, y0, y1, y2)
        for k in range(3):
            normals[p, k] = frame[0, k] * a + frame[1, k] * b + frame[2, k] * c
    return far, normals


@jit
def curvatures(body, middle, frame, x):
    """Second derivatives (k, 3, 3) of the distances of places (k, 3)."""
    kind, size, radius = body
    bend, own, free = np.zeros((len(x), 3, 3)), np.empty(3), np.zeros((3, 3))
    for p in range(len(x)):
        if kind == PLANE:
            break
        for k in range(3):
            own[k] = _own(middle, frame, x[p, 0], x[p, 1], x[p, 2], k)
        d, a, b, c = _away(kind, size, radius, own[0], own[1], own[2])
        # I less the derivative of the nearest place of the core
        free[:] = 0.0
        for k in range(3):
            free[k, k] = 1.0 if kind == BALL or abs(own[k]) > size[k] else 0.0
        if kind == ROUND:
            across = sqrt(own[0] ** 2 + own[1] ** 2)
            left = 0.0 if radius > 0.0 else min(1.0, size[0] / max(across, 1e-300))
            for k in range(2):
                for m in range(2):
                    out = own[k] * own[m] / max(across, 1e-300) ** 2 if left < 1.0 else 0.0
                    free[k, m] = (1.0 - left if k == m else 0.0) + left * out
        n = (a, b, c)
        for k in range(3):
            for m in range(3):
                free[k, m] = (free[k, m] - n[k] * n[m]) / max(d + radius, 1e-300)
        bend[p] = frame.T @ free @ frame
    return bend


@jit
def look(body, middle, frame, nodes, shares, points, x, least):
    """Of these points of a sheet at x, those nearer than `least`: numbers, places, distances, their gradients."""
    kind, size, radius = body
    count, found = 0, np.empty(len(points), np.int64)
    places, far, normals = np.empty((len(points), 3)), np.empty(len(points)), np.empty((len(points), 3))
    for p in points:
        x0, x1, x2 = _at(nodes, shares, p, x, 0), _at(nodes, shares, p, x, 1), _at(nodes, shares, p, x, 2)
        y0, y1 = _own(middle, frame, x0, x1, x2, 0), _own(middle, frame, x0, x1, x2, 1)
        d, a, b, c = _away(kind, size, radius, y0, y1, _own(middle, frame, x0, x1, x2, 2))
        if d < least:
            found[count], far[count] = p, d
            places[count, 0], places[count, 1], places[count, 2] = x0, x1, x2
            for k in range(3):
                normals[count, k] = frame[0, k] * a + frame[1, k] * b + frame[2, k] * c
            count += 1
    return found[:count], places[:count], far[:count], normals[:count]


@jit
def free_part(body, before, after, nodes, shares, points, x0, x1, offset, moved):
    """See `gaps.Gaps.free_part`; also the least gap at x0, and how far points are from the middle.

    before, after: frames; moved: more than any point comes nearer.
    """
    kind, size, radius = body
    part, least, widest = 1.0, np.inf, 0.0
    y, way = np.empty(3), np.empty(3)
    for p in points:
        a0, a1, a2 = _at(nodes, shares, p, x0, 0), _at(nodes, shares, p, x0, 1), _at(nodes, shares, p, x0, 2)
        for k in range(3):
            y[k] = _own(before[0], before[1], a0, a1, a2, k)
        d, n0, n1, n2 = _away(kind, size, radius, y[0], y[1], y[2])
        start = d - offset
        least, widest = min(least, start), max(widest, sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2))
        if not start < moved:
            continue
        a0, a1, a2 = _at(nodes, shares, p, x1, 0), _at(nodes, shares, p, x1, 1), _at(nodes, shares, p, x1, 2)
        for k in range(3):
            way[k] = _own(after[0], after[1], a0, a1, a2, k) - y[k]
        at = 0.0
        for _ in range(30):
            if at > 0.0:
                d, n0, n1, n2 = _away(kind, size, radius, y[0] + at * way[0], y[1] + at * way[1], y[2] + at * way[2])
            gap, rate = d - offset - 0.1 * start, n0 * way[0] + n1 * way[1] + n2 * way[2]
            if rate >= 0.0:
                at = 1.0
            elif gap > 1e-3 * start:
                at -= gap / rate
            else:
                break
            if at >= part:
                break
        part = min(part, at)
    return part, least, widest


@jit
def spread(forces, nodes, shares, points, total):
    """Add forces on points (k, 3) to those on nodes."""
    for i in range(len(points)):
        for a in range(3):
            share = shares[points[i], a]
            if share != 0.0:
                for k in range(3):
                    total[nodes[points[i], a], k] += share * forces[i, k]


@jit
def between(nodes, shares, points, x):
    """Of values x at the nodes, those at points (k, 3)."""
    found = np.empty((len(points), 3))
    for i in range(len(points)):
        for k in range(3):
            found[i, k] = _at(nodes, shares, points[i], x, k)
    return found


@jit
def most(way):
    """The longest of some vectors (k, 3)."""
    square = 0.0
    for p in range(len(way)):
        square = max(square, way[p, 0] ** 2 + way[p, 1] ** 2 + way[p, 2] ** 2)
    return sqrt(square)


@jit
def apart(x, about):
    """How far corners (n, 3) are from where they were, less what all have gone together (n,)."""
    mean, far = np.zeros(3), np.empty(len(x))
    for p in range(len(x)):
        for k in range(3):
            mean[k] += (x[p, k] - about[p, k]) / len(x)
    for p in range(len(x)):
        square = 0.0
        for k in range(3):
            square += (x[p, k] - about[p, k] - mean[k]) ** 2
        far[p] = sqrt(square)
    return far


@inlined
def _coulomb(slid, static, kinetic, length):
    """See `coefficients.coulomb`."""
    y = slid / length
    if y >= 1.0:
        return kinetic / slid, -kinetic / slid**3
    below = y < 0.5
    drop, step = kinetic - static, 2 * y**2 if below else 1 - 2 * (1 - y) ** 2
    mu, rise = static + drop * step, drop * (4.0 if below else 4 / y - 4)
    return mu * (2 - y) / length, (rise * (2 - y) - mu / max(y, 1e-12)) / length**3


@jit
def coulomb(slid, static, kinetic, length):
    """See `coefficients.coulomb`; all but the length are arrays (k,)."""
    h, bend = np.empty(len(slid)), np.empty(len(slid))
    for p in range(len(slid)):
        h[p], bend[p] = _coulomb(slid[p], static[p], kinetic[p], length)
    return h, bend


@inlined
def _slid(nodes, shares, point, i, x, normals, x0, middle, mean, by_x, way, along):
    """Row i of `slid`."""
    off = 0.0
    for k in range(3):
        went = mean[k]
        for m in range(3):
            went += (x[i, m] - middle[m]) * by_x[m, k]
        way[i, k] = x[i, k] - _at(nodes, shares, point, x0, k) - went
        off += way[i, k] * normals[i, k]
    for k in range(3):
        along[i, k] = way[i, k] - off * normals[i, k]


@jit
def slid(nodes, shares, points, x, normals, x0, middle, mean, by_x):
    """How far points at x have gone against a body since the nodes were at x0, and the part of it along the body.

    mean, by_x: a place of the body goes by mean + (place - middle) @ by_x.
    """
    way, along = np.empty_like(x), np.empty_like(x)
    for i in range(len(points)):
        _slid(nodes, shares, points[i], i, x, normals, x0, middle, mean, by_x, way, along)
    return way, along


@jit
def rubbed(force, static, kinetic, length, nodes, shares, points, x, normals, x0, middle, mean, by_x):
    """Friction (k, 3) at normal forces (k,), with the same coefficients everywhere; the rest as of `slid`."""
    way, along = np.empty_like(x), np.empty_like(x)
    for i in range(len(points)):
        _slid(nodes, shares, points[i], i, x, normals, x0, middle, mean, by_x, way, along)
        size = sqrt(along[i, 0] ** 2 + along[i, 1] ** 2 + along[i, 2] ** 2)
        h, _ = _coulomb(size, static, kinetic, length)
        for k in range(3):
            along[i, k] *= force[i] * h
    return along


@jit
def fastest(stiffness, nodes, shares, points, masses):
    """The largest stiffness over the mass of a node (n,), of those of points (k,)."""
    most, sums = 0.0, np.zeros(len(masses))
    for i in range(len(points)):
        for a in range(3):
            sums[nodes[points[i], a]] += shares[points[i], a] * stiffness[i]
    for n in range(len(masses)):
        most = max(most, sums[n] / masses[n])
    return most


@jit
def shared_out(x, forces, middle, turn, inverse):
    """Forces at places (k, 3), on the corners of a body (n, 3); see `shapes.Shape.spread`."""
    n, even, moment = inverse.shape[1], np.zeros(3), np.zeros((3, 3))
    for i in range(len(x)):
        for k in range(3):
            even[k] += forces[i, k] / n
            for m in range(3):
                moment[m, k] += (x[i, m] - middle[m]) * forces[i, k]
    back, found = turn.T @ moment, np.empty((n, 3))
    for c in range(n):
        for k in range(3):
            found[c, k] = even[k] + inverse[0, c] * back[0, k] + inverse[1, c] * back[1, k] + inverse[2, c] * back[2, k]
    return found


@jit
def rub(force, slope, h, bend, normals, curvature, way, along, by_x):
    """Derivative (k, 3, 3) of friction by the place of each point, see `gaps.Near.friction`."""
    change, moves = np.empty((len(force), 3, 3)), np.empty((3, 3))
    for i in range(len(force)):
        n, off = normals[i], 0.0
        for k in range(3):
            off += way[i, k] * n[k]
        for m in range(3):
            turned, lost = 0.0, 0.0
            for k in range(3):
                turned += way[i, k] * curvature[i, k, m]
                lost += n[k] * ((1.0 if k == m else 0.0) - by_x[m, k])
            for k in range(3):
                moves[k, m] = (1.0 if k == m else 0.0) - by_x[m, k] - n[k] * (lost + turned) - off * curvature[i, k, m]
        for m in range(3):
            pulled = along[i, 0] * moves[0, m] + along[i, 1] * moves[1, m] + along[i, 2] * moves[2, m]
            for k in range(3):
                change[i, k, m] = slope[i] * h[i] * along[i, k] * n[m]
                change[i, k, m] += force[i] * (h[i] * moves[k, m] + bend[i] * along[i, k] * pulled)
    return change
