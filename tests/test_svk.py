"""St. Venant-Kirchhoff against its formulas, and what it refuses."""

from types import SimpleNamespace

import numpy as np
import pytest

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws import Law
from fabric_fenicsx.laws.svk import StVenantKirchhoff


def fabric(D1=9.0e6, D2=28.0e6, G12=0.5e6, nu=(1.1, 0.6)):
    curve = lambda first: SimpleNamespace(modulus=(first, 1e8, -2e8, 3e8))  # noqa: E731
    return SimpleNamespace(warp=curve(D1), weft=curve(D2), shear=curve(G12), poisson={"measured": nu})


def test_isotropic_plane_stress():
    """C11 = E/(1 - nu^2), C12 = nu C11, G = E/(2 (1 + nu))."""
    E, nu = 210e9, 0.3
    expected = E / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    law: Law = StVenantKirchhoff.isotropic(E, nu)
    np.testing.assert_allclose(law.stiffness, expected, rtol=1e-14)
    assert law.symmetric and law.initial_state.shape == (0,)


def test_orthotropic_is_the_inverse_of_its_compliance():
    E1, E2, nu12, G12 = 50e6, 9e6, 0.3, 1e6
    compliance = np.array([[1 / E1, -nu12 / E1, 0], [-nu12 / E1, 1 / E2, 0], [0, 0, 1 / G12]])
    law = StVenantKirchhoff.orthotropic(E1, E2, nu12, G12)
    np.testing.assert_allclose(law.stiffness @ compliance, np.eye(3), atol=1e-14)


def test_fabric_is_coupled_by_the_geometric_mean():
    law = StVenantKirchhoff.from_fabric(fabric())
    p = 1.1 * 0.6
    b = np.sqrt(p * 9e6 * 28e6)
    expected = np.array([[9e6, b, 0], [b, 28e6, 0], [0, 0, 0.5e6 * (1 - p)]]) / (1 - p)
    np.testing.assert_allclose(law.stiffness, expected, rtol=1e-14)
    assert law.symmetric and np.linalg.eigvalsh(law.stiffness)[0] > 0


def test_respond_is_batched_and_writes_into_out():
    C = np.array([[4.0, 1.0, 0.2], [0.5, 3.0, 0.0], [0.0, 0.1, 2.0]]) * 1e6
    law = StVenantKirchhoff(C)
    assert not law.symmetric
    strain, state = np.random.default_rng(1).normal(size=(7, 3)), np.empty((7, 0))
    stress, tangent, new_state = law.respond(strain, state)
    np.testing.assert_allclose(stress, np.einsum("ij,nj->ni", C, strain), rtol=1e-14)
    assert (tangent == C).all() and tangent.shape == (7, 3, 3) and new_state.shape == (7, 0)
    tangent[0] = 0  # the answer is the caller's, the stiffness is not
    assert (law.stiffness == C).all()
    out = np.empty((7, 3)), np.empty((7, 3, 3)), np.empty((7, 0))
    answer = law.respond(strain, state, out)
    assert all(a is b for a, b in zip(answer, out, strict=True)) and (out[0] == stress).all()
    assert law.respond(strain[:0], state[:0])[0].shape == (0, 3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_strain_that_is_not_finite_gives_nan_and_nothing_else(bad):
    strain = np.array([[0.1, 0.2, 0.3], [bad, 0.0, 0.0], [0.1, 0.2, 0.3]])
    stress = StVenantKirchhoff.isotropic(1e6, 0.3).respond(strain, np.empty((3, 0)))[0]
    assert np.isnan(stress[1]).all() and np.isfinite(stress[[0, 2]]).all()


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: StVenantKirchhoff("stiff"), "square array of numbers"),
        (lambda: StVenantKirchhoff([[1, 2], [3]]), "square array of numbers"),
        (lambda: StVenantKirchhoff(np.ones((2, 3))), r"shape is \(2, 3\)"),
        (lambda: StVenantKirchhoff(np.diag([1, np.inf, 1])), "not finite"),
        (lambda: StVenantKirchhoff(np.diag([1.0, 0.0, 1.0])), "not positive definite"),
        (lambda: StVenantKirchhoff([[1, 3], [0, 1]]), "not positive definite"),
        (lambda: StVenantKirchhoff.isotropic(-1e6, 0.3), "E1 = -1e.06 Pa is not a positive"),
        (lambda: StVenantKirchhoff.isotropic(1e6, 1.0), "nu12 nu21 = 1 is not below 1"),
        (lambda: StVenantKirchhoff.isotropic(1e6, -1.0), "G12 = inf Pa"),
        (lambda: StVenantKirchhoff.orthotropic(1e6, 1e6, np.nan, 1e5), "nu12 nu21 = nan"),
        (lambda: StVenantKirchhoff.from_fabric(fabric(), "lowered"), "choose one of measured"),
        (lambda: StVenantKirchhoff.from_fabric(fabric(nu=(2.0, 0.6))), "nu12 nu21 = 1.2 is not below 1"),
        (lambda: StVenantKirchhoff.from_fabric(fabric(nu=(-0.2, 0.6))), "differ in sign"),
        (lambda: StVenantKirchhoff.from_fabric(fabric(G12=0.0)), "G12 = 0 Pa"),
    ],
)
def test_bad_input_is_one_sentence(make, sentence):
    with pytest.raises(InputError, match=sentence) as error:
        make()
    assert "\n" not in str(error.value) and str(error.value).endswith(".")
