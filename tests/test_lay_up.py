"""Plies on each other: against the layered section, closed forms and differences."""

import numpy as np
import pytest

from fabric_fenicsx import fabrics
from fabric_fenicsx.laws.lay_up import LayUp, Ply
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff

FABRIC = fabrics.load("blend")
H = FABRIC.thickness
SVK = StVenantKirchhoff.from_fabric(FABRIC)


@pytest.mark.parametrize("count", [1, 3, 4])
def test_equal_plies_are_the_layered_section(count):
    """Exactly for a linear law; for a measured one, where all plies are strained alike."""
    plies = LayUp([Ply(SVK, H / count)] * count)
    assert np.allclose(plies.stiffness, Section(SVK, H).elastic(SVK.stiffness), rtol=1e-12, atol=1e-9)
    rng, law = np.random.default_rng(3), Potential(FABRIC)
    strain = np.zeros((5, 6))
    strain[:, :3] = rng.uniform(-0.02, 0.05, (5, 3))
    found = [
        one.respond(strain, np.tile(one.initial_state, (5, 1)))
        for one in (LayUp([Ply(law, H / count)] * count), Section(law, H))
    ]
    assert np.allclose(found[0][0][:, :3], found[1][0][:, :3], rtol=1e-12)
    assert np.abs(found[0][0][:, 3:]).max() <= 1e-12 * np.abs(found[0][0]).max()
    assert np.allclose(found[0][1][:, :3, :3], found[1][1][:, :3, :3], rtol=1e-10)


def test_a_lay_up_has_the_moments_of_its_plies():
    """A cross-ply of two: A, B and D in closed form; the tangent of a measured one by differences."""
    A = StVenantKirchhoff.orthotropic(2e8, 1e7, 0.1, 5e6)
    Q = A.stiffness
    turned = Q[np.ix_([1, 0, 2], [1, 0, 2])]
    found = LayUp([Ply(A, H), Ply(A, H, np.pi / 2)]).stiffness
    whole = [H * (Q + turned), H**2 / 2 * (turned - Q), H**3 / 3 * (Q + turned)]
    assert np.allclose(found, np.block([[whole[0], whole[1]], [whole[1], whole[2]]]), rtol=1e-12, atol=1e-9)
    law = LayUp([Ply(Potential(FABRIC), H, 0.3), Ply(SVK, H / 2, -0.7)])
    rng = np.random.default_rng(1)
    strain, change = (rng.uniform(-1, 1, (4, 6)) * np.repeat([0.02, 10.0], 3) for _ in range(2))
    state = np.tile(law.initial_state, (4, 1))
    tangent = law.respond(strain, state)[1]
    up, down = (law.respond(strain + s * change, state)[0] for s in (1e-6, -1e-6))
    assert np.allclose(
        (up - down) / 2e-6, np.einsum("nab,nb->na", tangent, change), rtol=1e-5, atol=1e-6 * np.abs(up).max()
    )
