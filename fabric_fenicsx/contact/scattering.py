"""Where derivatives of forces go among the entries of the stiffness, compiled."""

import numba

jit = numba.njit(cache=True, error_model="numpy")


@jit
def add_blocks(blocks, shares, slots, points, values):
    """Add derivatives (k, 3, 3) of forces on points to entries; slots (all points, 3, 3): of pairs of their nodes."""
    for i in range(len(points)):
        p = points[i]
        for a in range(3):
            for b in range(3):
                share, slot = shares[p, a] * shares[p, b], slots[p, a, b]
                if slot >= 0 and share != 0.0:
                    for k in range(3):
                        for m in range(3):
                            values[9 * slot + 3 * k + m] += share * blocks[i, k, m]


@jit
def slot_of(starts, columns, i, j):
    """Where the pair (i, j) is among sorted ones, -1 if nowhere."""
    low, high = starts[i], starts[i + 1]
    while low < high:
        middle = (low + high) // 2
        if columns[middle] < j:
            low = middle + 1
        else:
            high = middle
    return low if low < starts[i + 1] and columns[low] == j else -1


@jit
def located(indptr, indices, starts, columns, here, entries):
    """Where entries of a matrix by columns go among those of pairs of corners, -1 if nowhere; and whether all are."""
    whole, count = True, len(starts) - 1
    for column in range(len(indptr) - 1):
        last, slot = -1, -1
        for k in range(indptr[column], indptr[column + 1]):
            i, entries[k] = indices[k] // 3, -1
            if i >= count or column >= 3 * count or not here[i]:
                continue
            if i != last:
                last, slot = i, slot_of(starts, columns, i, column // 3)
            if slot < 0:
                whole = False
            else:
                entries[k] = 9 * slot + 3 * (indices[k] - 3 * i) + column % 3
    return whole


@jit
def add_entries(entries, data, values):
    """Add to the entries that are somewhere."""
    for k in range(len(entries)):
        if entries[k] >= 0:
            values[entries[k]] += data[k]
