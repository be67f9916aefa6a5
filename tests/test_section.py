"""The section of a shell: closed forms, tangent, layers, promises of a law."""

import numpy as np
import pytest
import scenes

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.printed import Printed
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven

BLEND = fabrics.load("blend")
H = BLEND.thickness
C = np.array([[4.0, 1.0, 0.3], [1.0, 2.0, -0.2], [0.3, -0.2, 1.5]])


def strains(n, quadratic=False, seed=0, size=0.1):
    """Random strains and curvatures whose parts matter alike at the faces of the sheet."""
    scale = [size] * 3 + [size / H] * 3 + [size / H**2] * 3
    return np.random.default_rng(seed).uniform(-1, 1, (n, 9 if quadratic else 6)) * scale[: 9 if quadratic else 6]


@pytest.mark.parametrize("layers", [2, 3, 5])
def test_a_linear_law_has_the_stiffness_h_and_h3_by_12(layers):
    """A = h C, B = 0, D = h^3/12 C, for two layers or more; and what goes with z^2: h^3/12 and h^5/80."""
    for quadratic in [False, True] if layers > 2 else [False]:
        section, E = Section(StVenantKirchhoff(C), H, layers, quadratic), strains(20, quadratic)
        resultants, tangent, state = section.respond(E, np.empty((20, 0)))
        moments = np.array([[H, 0, H**3 / 12], [0, H**3 / 12, 0], [H**3 / 12, 0, H**5 / 80]])
        m, scale = E.shape[1], np.repeat(H ** np.arange(3), 3)[: E.shape[1]]
        exact = np.kron(moments[: m // 3, : m // 3], C)
        close = {"rtol": 1e-12, "atol": 1e-14 * H}
        assert np.allclose(tangent / np.outer(scale, scale), exact / np.outer(scale, scale), **close)
        assert np.allclose(resultants / scale, E @ exact / scale, **close)
        assert np.allclose(section.elastic(C) / np.outer(scale, scale), exact / np.outer(scale, scale), **close)
        assert state.shape == (20, 0) and section.symmetric


def test_a_layer_sees_the_strain_at_its_height():
    section = Section(scenes.Toy(), H, 3, quadratic=True)
    E = strains(7, quadratic=True)
    N, M, Q = np.split(section.respond(E, np.empty((7, 0)))[0], 3, axis=1)
    z, w = np.array([-1, 0, 1]) * np.sqrt(0.6) * H / 2, np.array([5, 8, 5]) * H / 18
    assert np.allclose(section.heights, z, rtol=1e-14, atol=1e-20)
    S = [scenes.Toy().respond(E[:, :3] + k * E[:, 3:6] + k * k * E[:, 6:], np.empty((7, 0)))[0] for k in z]
    assert np.allclose(N, np.einsum("l,lnc->nc", w, S), rtol=1e-12)
    assert np.allclose(M, np.einsum("l,lnc->nc", w * z, S), rtol=1e-12, atol=1e-12 * np.abs(M).max())
    assert np.allclose(Q, np.einsum("l,lnc->nc", w * z * z, S), rtol=1e-12)


@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize(
    "law", [Woven(BLEND), Printed(BLEND), StVenantKirchhoff(C)], ids=lambda law: type(law).__name__
)
def test_it_keeps_the_promises_of_a_law(law, quadratic):
    """Pure, in batches of any size, NaN where it must be; its tangent is the difference of its stress."""
    report = driver.check(Section(law, H, 3, quadratic), strains(40, quadratic))
    assert report.judged > 0.9 and report.tangent_error < 1e-5
    assert report.symmetric == law.symmetric


def test_arrays_are_its_own_whatever_is_asked_in_between():
    """Room is reused between calls of one size, and never handed out."""
    section = Section(Woven(BLEND), H)
    E, state = strains(9), np.tile(section.initial_state, (9, 1))
    first = section.respond(E, state)
    kept = [a.copy() for a in first]
    for n in (9, 4, 0, 9):
        section.respond(2 * E[:n], state[:n])
    assert all(np.array_equal(a, b) for a, b in zip(first, kept, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(section.respond(E, state), kept, strict=True))
    # arrays that are not in one piece
    wide, out = np.zeros((9, 12)), [np.zeros((9, 12)), np.zeros((9, 6, 12)), np.zeros((9, 2 * state.shape[1]))]
    wide[:, ::2] = E
    spread = tuple(a[..., ::2] for a in out)
    section.respond(wide[:, ::2], np.repeat(state, 2, axis=1)[:, ::2], spread)
    assert all(np.array_equal(a, b) for a, b in zip(spread, kept, strict=True))


def test_more_layers_converge_in_bending():
    """The moment of the woven law, with history layer by layer, bent to 5 % strain at the faces and as far back.

    Two layers miss a tenth of it, three 1.3 %, five 0.2 %, of forty.
    """
    path = np.concatenate([np.linspace(0, 1, 21), np.linspace(1, -1, 41)])[1:] * 0.05 / (H / 2)
    moments = {}
    for layers in (2, 3, 5, 40):
        section = Section(Woven(BLEND), H, layers)
        K = np.zeros((len(path), 6))
        K[:, 3] = path
        moments[layers] = driver.run(section, K).stress[-len(path) :, 3]
    errors = {n: np.abs(moments[n] / moments[40] - 1)[[19, 59]].max() for n in (2, 3, 5)}
    worst = {n: np.abs(moments[n] - moments[40]).max() / np.abs(moments[40]).max() for n in (2, 3, 5)}
    assert worst[2] < 0.1 and worst[3] < 0.015 and worst[5] < 0.002
    assert errors[5] < 0.2 * errors[3] < 0.1 * errors[2]


def test_what_cannot_be_a_section():
    with pytest.raises(InputError, match="cannot bend"):
        Section(Woven(BLEND), H, layers=1)
    for thickness in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="thickness"):
            Section(Woven(BLEND), thickness)
