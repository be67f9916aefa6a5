"""What tests of closed surfaces of triangles ask of them, and of contact with them."""

import numpy as np
import pytest
import scipy.sparse


def volume(x, faces):
    a, b, c = x[faces].transpose(1, 0, 2)
    return np.einsum("ij,ij", a, np.cross(b, c)) / 6


def crossed(x, faces):
    ipctk = pytest.importorskip("ipctk")
    faces, x = np.asfortranarray(faces), np.asfortranarray(x)
    return ipctk.has_intersections(ipctk.CollisionMesh(x, ipctk.edges(faces), faces), x, ipctk.LBVH())


def derivatives(touch, q, z, way, e=1e-9):
    """Of each term of contact, once nodes have gone z (n, 3) further, and their change `way` as one of all unknowns.

    Yields the term, its force, that change, its stiffness times it, and differences of force and energy along it.
    """
    q, local = q.x.array, touch._around.skin.local
    rest = q.copy()

    def force(term, at):
        q[:] = rest
        q[local] += at
        assert term.evaluate()
        total = np.zeros_like(q)
        term.add_force(total)
        return total, term.energy()

    for term in touch.terms:
        term.prepare(0.1)  # s: slides by 0.5 mm
        (after, up), (before, down) = (force(term, z + step * way) for step in (e, -e))
        now, _ = force(term, z)
        rows, columns = term.pattern()
        values, change = np.zeros(len(rows)), np.zeros_like(q)
        term.add_stiffness(values)
        change[local] = way
        found = scipy.sparse.csr_array((values, (rows, columns)), shape=(len(q), len(q))) @ change
        slope = None if up is None else (up - down) / (2 * e)
        yield term, now, change, found, (after - before) / (2 * e), slope
