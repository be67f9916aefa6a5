"""What tests of closed surfaces of triangles ask of them."""

import numpy as np
import pytest


def volume(x, faces):
    a, b, c = x[faces].transpose(1, 0, 2)
    return np.einsum("ij,ij", a, np.cross(b, c)) / 6


def crossed(x, faces):
    ipctk = pytest.importorskip("ipctk")
    faces, x = np.asfortranarray(faces), np.asfortranarray(x)
    return ipctk.has_intersections(ipctk.CollisionMesh(x, ipctk.edges(faces), faces), x, ipctk.LBVH())
