"""The compiled part of `work`: strains, forces and stiffness of a shell's cells, many side by side.

They share one file because Numba's cache looks at the file of a function, not at what it calls. A batch is a tuple:
M (blocks, points, terms, LANES), padded by zeros; spans (strains, 2), first and last pair of each strain; pairs
(pairs, 2); rest and start (cells, nodes - 1, 3), places at rest and where displacements are measured from, as seen from
a cell's first node; normal, directors at rest, flat, and the numbers of each cell's; q, and each cell's unknowns in
it.
"""

import numba
import numpy as np

LANES = 32
"""Cells that are worked on at once."""
_FAST = {"contract", "nsz"}


@numba.njit(forceinline=True, error_model="numpy", fastmath=_FAST)
def _gather(block, start, directors, q, dofs, x):
    """The present vectors of a block's cells, (n, 3, LANES)."""
    nodes = start.shape[1]
    for lane in range(min(LANES, len(start) - block * LANES)):
        c = block * LANES + lane
        for i in range(nodes):
            for k in range(3):
                x[i, k, lane] = start[c, i, k] + (q[dofs[c, 3 * i + 3 + k]] - q[dofs[c, k]])
        for i in range(directors.shape[1]):
            for k in range(3):
                x[nodes + i, k, lane] = q[dofs[c, 3 * (nodes + i) + 3 + k]]


@numba.njit(forceinline=True, error_model="numpy", fastmath=_FAST)
def _gather_rest(block, rest, normal, directors, r):
    """As `_gather`, at rest."""
    nodes = rest.shape[1]
    for lane in range(min(LANES, len(rest) - block * LANES)):
        c = block * LANES + lane
        for i in range(nodes):
            for k in range(3):
                r[i, k, lane] = rest[c, i, k]
        for i in range(directors.shape[1]):
            for k in range(3):
                r[nodes + i, k, lane] = normal[3 * directors[c, i] + k]


@numba.njit(cache=True, error_model="numpy", fastmath=_FAST)
def strains(batch, out):
    """Strains `out` (cells, points, strains) of all local cells."""
    M, spans, pairs, rest, start, normal, directors, q, dofs = batch
    n = start.shape[1] + directors.shape[1]
    r, x = np.zeros((n, 3, LANES)), np.zeros((n, 3, LANES))
    change, E = np.empty((len(pairs), LANES)), np.empty(LANES)
    for block in range(M.shape[0]):
        _gather(block, start, directors, q, dofs, x)
        _gather_rest(block, rest, normal, directors, r)
        for k in range(len(pairs)):
            i, j = pairs[k, 0], pairs[k, 1]
            for lane in range(LANES):
                total = 0.0
                for m in range(3):
                    # of the difference of two products, without cancellation
                    before, after = r[i, m, lane], x[j, m, lane]
                    total += before * (after - r[j, m, lane]) + (x[i, m, lane] - before) * after
                change[k, lane] = total
        for p in range(M.shape[1]):
            t = 0
            for a in range(len(spans)):
                E[:] = 0.0
                # by twos: sums that go through memory half as often take two thirds of the time
                for k in range(spans[a, 0], spans[a, 1] - 1, 2):
                    for lane in range(LANES):
                        first, second = M[block, p, t, lane], M[block, p, t + 1, lane]
                        E[lane] += first * change[k, lane] + second * change[k + 1, lane]
                    t += 2
                if (spans[a, 1] - spans[a, 0]) % 2 == 1:
                    for lane in range(LANES):
                        E[lane] += M[block, p, t, lane] * change[spans[a, 1] - 1, lane]
                    t += 1
                for lane in range(min(LANES, len(start) - block * LANES)):
                    out[block * LANES + lane, p, a] = E[lane]


@numba.njit(cache=True, error_model="numpy", fastmath=_FAST)
def forces(batch, stress, weights, out):
    """Add forces of owned cells to a local array; stress (cells, points, strains), weights (owned cells, points)."""
    M, spans, pairs, _, start, _, directors, q, dofs = batch
    nodes, n, points = start.shape[1], start.shape[1] + directors.shape[1], M.shape[1]
    x, f = np.zeros((n, 3, LANES)), np.empty((n, 3, LANES))
    W, N = np.empty((len(pairs), LANES)), np.zeros((points, LANES))
    for block in range(-(-len(weights) // LANES)):
        cells = min(LANES, len(weights) - block * LANES)
        _gather(block, start, directors, q, dofs, x)
        W[:] = 0.0
        before = 0
        for a in range(len(spans)):
            for lane in range(cells):
                c = block * LANES + lane
                for p in range(points):
                    N[p, lane] = weights[c, p] * stress[c, p, a]
            for k in range(spans[a, 0], spans[a, 1]):
                t = before + k - spans[a, 0]
                for p in range(0, points - 1, 2):
                    for lane in range(LANES):
                        W[k, lane] += N[p, lane] * M[block, p, t, lane] + N[p + 1, lane] * M[block, p + 1, t, lane]
                if points % 2 == 1:
                    for lane in range(LANES):
                        W[k, lane] += N[points - 1, lane] * M[block, points - 1, t, lane]
            before += spans[a, 1] - spans[a, 0]
        f[:] = 0.0
        for k in range(len(pairs)):
            i, j = pairs[k, 0], pairs[k, 1]
            for m in range(3):
                for lane in range(LANES):
                    f[i, m, lane] += W[k, lane] * x[j, m, lane]
                for lane in range(LANES):
                    f[j, m, lane] += W[k, lane] * x[i, m, lane]
        for lane in range(cells):
            c = block * LANES + lane
            for m in range(3):
                first = 0.0
                for i in range(n):
                    out[dofs[c, 3 * i + 3 + m]] += f[i, m, lane]
                for i in range(nodes):
                    first += f[i, m, lane]
                # the first node moves against the others
                out[dofs[c, m]] -= first


@numba.njit(cache=True, error_model="numpy", fastmath=_FAST)
def stiffness(batch, tangent, stress, weights, turn, out):
    """Add to `out` (owned cells, n, n) the stiffness of each cell, of tangent and stress at the points.

    tangent: without cells where it is the identity, of weight 1. turn: None, or numbers of each cell's directors, and
    by these their derivatives by two angles (directors, 2, 3): the stiffness is then by displacements and angles.
    """
    M, spans, pairs, _, start, _, directors, q, dofs = batch
    nodes, n, strains = start.shape[1], start.shape[1] + directors.shape[1], len(spans)
    points, size, moved = M.shape[1], 3 * n + 3, 3 * start.shape[1] + 3
    x, W = np.zeros((n, 3, LANES)), np.empty((len(pairs), LANES))
    side, N = np.empty((points * strains, size, LANES)), np.zeros(LANES)
    T = np.zeros((directors.shape[1], 2, 3, LANES))
    last = size if turn is None else moved + 2 * directors.shape[1]
    B, CB, K, G = (
        np.empty((len(side), last)),
        np.empty((len(side), last)),
        np.empty((last, last)),
        np.empty((n + 1, n + 1)),
    )
    for block in range(-(-len(weights) // LANES)):
        cells = min(LANES, len(weights) - block * LANES)
        _gather(block, start, directors, q, dofs, x)
        W[:], side[:] = 0.0, 0.0
        if turn is not None:
            numbers, slopes = turn
            for lane in range(cells):
                for i in range(directors.shape[1]):
                    T[i, :, :, lane] = slopes[numbers[block * LANES + lane, i]]
        for p in range(points):
            t = 0
            for a in range(strains):
                row = side[p * strains + a]
                for lane in range(cells):
                    N[lane] = weights[block * LANES + lane, p] * stress[block * LANES + lane, p, a]
                for k in range(spans[a, 0], spans[a, 1]):
                    i, j, s = pairs[k, 0], pairs[k, 1], M[block, p, t]
                    t += 1
                    for lane in range(LANES):
                        W[k, lane] += N[lane] * s[lane]
                    for m in range(3):
                        for lane in range(LANES):
                            row[3 * i + 3 + m, lane] += s[lane] * x[j, m, lane]
                        for lane in range(LANES):
                            row[3 * j + 3 + m, lane] += s[lane] * x[i, m, lane]
                for i in range(nodes):
                    for m in range(3):
                        for lane in range(LANES):
                            row[m, lane] -= row[3 * i + 3 + m, lane]
                if turn is not None:
                    for i in range(directors.shape[1]):
                        at, to = moved + 3 * i, moved + 2 * i
                        for lane in range(LANES):
                            one, two, three = row[at, lane], row[at + 1, lane], row[at + 2, lane]
                            for angle in range(2):
                                of = T[i, angle]
                                row[to + angle, lane] = of[0, lane] * one + of[1, lane] * two + of[2, lane] * three
        for lane in range(cells):
            c = block * LANES + lane
            for a in range(points * strains):
                for j in range(last):
                    B[a, j] = side[a, j, lane]
            if len(tangent) == 0:
                np.dot(B.T, B, K)
            else:
                CB[:] = 0.0
                for p in range(points):
                    for a in range(strains):
                        for b in range(strains):
                            C = weights[c, p] * tangent[c, p, a, b]
                            for j in range(last):
                                CB[p * strains + a, j] += C * B[p * strains + b, j]
                np.dot(B.T, CB, K)
            G[:] = 0.0
            for k in range(len(pairs)):
                i, j = pairs[k, 0] + 1, pairs[k, 1] + 1
                G[i, j] += W[k, lane]
                G[j, i] += W[k, lane]
            for i in range(1, nodes + 1):
                G[0] -= G[i]
            G[1:, 0] = G[0, 1:]
            for i in range(1, nodes + 1):
                G[0, 0] -= G[0, i]
            alike = n + 1 if turn is None else nodes + 1
            for i in range(alike):
                for j in range(alike):
                    for m in range(3):
                        K[3 * i + m, 3 * j + m] += G[i, j]
            if turn is not None:
                _turn_stress(G, nodes, numbers[c], slopes, K)
            for i in range(last):
                for j in range(last):
                    out[c, i, j] += K[i, j]


@numba.njit(forceinline=True, error_model="numpy", fastmath=_FAST)
def _turn_stress(G, nodes, numbers, slopes, K):
    """Add what the stress G of a cell does to its angles."""
    moved = 3 * nodes + 3
    for i in range(len(numbers)):
        of = slopes[numbers[i]]
        for j in range(nodes + 1):
            for s in range(2):
                for m in range(3):
                    change = G[nodes + 1 + i, j] * of[s, m]
                    K[moved + 2 * i + s, 3 * j + m] += change
                    K[3 * j + m, moved + 2 * i + s] += change
        for j in range(len(numbers)):
            other = slopes[numbers[j]]
            for s in range(2):
                for t in range(2):
                    along = of[s, 0] * other[t, 0] + of[s, 1] * other[t, 1] + of[s, 2] * other[t, 2]
                    K[moved + 2 * i + s, moved + 2 * j + t] += G[nodes + 1 + i, nodes + 1 + j] * along
