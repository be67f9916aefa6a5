"""The bending law and the section that takes it: exact loops, bias strips, energy, promises of a law."""

import numpy as np
import pytest
import scenes
from hypothesis import given, settings
from hypothesis import strategies as st

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import BendingCurve, BendingCurves
from fabric_fenicsx.fabrics.bending import bias_bound, bias_of_twist, twist_of_bias
from fabric_fenicsx.identify.bending import loops
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.bending import CHORDS, Bending
from fabric_fenicsx.laws.own_bending import OwnBending
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven

BLEND = fabrics.load("blend")
LINEAR = BendingCurves(BendingCurve(12e-6), BendingCurve(8e-6), BendingCurve(5e-6))
SOFT = BendingCurves(
    BendingCurve(13.8e-6, -35.6e-9, 0.5e-3),
    BendingCurve(8.8e-6, -22e-9, 0.3e-3),
    BendingCurve(5.85e-6, -22.5e-9, 0.2e-3),
    (BendingCurve(10e-6, 12e-9), BendingCurve(7e-6)),
    0.1e-6,
    12.0,
)
LAWS = {
    "linear": LINEAR,
    "softening, friction, back, coupling": SOFT,
    "friction in one direction": BendingCurves(BendingCurve(1e-5, 0, 1e-3), BendingCurve(1e-5), BendingCurve(5e-6)),
    "stiffening": BendingCurves(BendingCurve(1e-5, 4e-8), BendingCurve(1e-5, 1e-8), BendingCurve(5e-6)),
}
each = pytest.mark.parametrize("curves", LAWS.values(), ids=LAWS)
LOOP = np.concatenate([np.linspace(0, 250, 51), np.linspace(250, -250, 101)[1:], np.linspace(-250, 250, 101)[1:]])


def curvatures(n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (n, 3)) * 10 ** rng.uniform(0, 2.7, (n, 1))


def along(path, direction):
    K = np.zeros((len(path), 3))
    K[:, direction] = path
    return K


@each
def test_it_keeps_the_promises_of_a_law(curves):
    report = driver.check(Bending(curves), curvatures(64))
    assert report.judged > 0.99 and report.tangent_error < 1e-6 and report.asymmetry == 0.0


@pytest.mark.parametrize("direction", range(3))
def test_what_kes_reads_comes_back(direction):
    """B of both branches on both sides and 2HB of a loop between -+250 1/m, to round-off, with softening or without."""
    curve = BendingCurve(10e-6, 0.0, 0.5e-3)
    law = Bending(BendingCurves(curve, curve, curve))
    M = driver.run(law, along(LOOP, direction)).stress[:, direction]
    assert loops.read_loop(LOOP, M) == pytest.approx((10e-6, 0.5e-3), rel=1e-9)
    soft = BendingCurve(13e-6, -15e-9, 0.5e-3)
    M = driver.run(Bending(BendingCurves(soft, soft, soft)), along(LOOP, direction)).stress[:, direction]
    # between 50 and 150 1/m the mean slope of B K + B2 K^2 is B + 200 B2
    assert loops.read_loop(LOOP, M) == pytest.approx((13e-6 - 200 * 15e-9, 0.5e-3), rel=1e-9)


def test_friction_builds_up_over_its_curvature():
    curve = BendingCurve(10e-6, 0.0, 2e-3)
    K = np.linspace(0, 120, 200)
    law = Bending(BendingCurves(curve, curve, curve, friction_per_m=20.0))
    friction = law.respond(along(K, 0), np.zeros((200, 9)))[0][:, 0] - 10e-6 * K
    assert np.abs(friction / 1e-3 - (1 - np.exp(-K / 20))).max() < 0.04
    for x, part in CHORDS:
        M = law.respond(np.array([[0.0, 20 * x, 0.0]]), np.zeros((1, 9)))[0][0, 1]
        assert M == pytest.approx(10e-6 * 20 * x + part * 1e-3, rel=1e-12)


def test_a_moment_that_wavers_does_not_ratchet():
    """50 cycles between 1.50 and 1.55 mN: the curvature comes back to where it was."""
    curve = BendingCurve(10e-6, 0.0, 0.5e-3)
    moments = along(np.concatenate([[1.55e-3], np.tile([1.50e-3, 1.55e-3], 50)]), 0)
    result = driver.mixed(Bending(BendingCurves(curve, curve, curve)), moments, ["stress"] * 3)
    K = result.strain[:, 0]
    assert K[0] == pytest.approx((1.55e-3 - 0.25e-3) / 10e-6)
    assert np.ptp(K[::2]) < 1e-9 * K[0] and np.ptp(K[1::2]) < 1e-9 * K[0] and K[1] < K[0]


@each
def test_moments_are_the_gradient_of_the_potential(curves):
    law, rng = Bending(curves), np.random.default_rng(3)
    state = law.respond(curvatures(200, 1), np.tile(law.initial_state, (200, 1)))[2]
    K = curvatures(200, 2)
    moment = law.respond(K, state)[0]
    for a in range(3):
        # a line through a kink of the moment has an error of the first order
        h = 1e-4 * (1 + np.abs(K[:, a]))
        ahead, behind = K.copy(), K.copy()
        ahead[:, a] += h
        behind[:, a] -= h
        slope = (law.potential(ahead, state) - law.potential(behind, state)) / (2 * h)
        assert np.abs(slope - moment[:, a]).max() < 1e-5 * np.abs(moment).max()
    # least at the answer: convex
    way = rng.uniform(-50, 50, (200, 3))
    middle = law.potential(K + way / 2, state)
    assert (middle <= (law.potential(K, state) + law.potential(K + way, state)) / 2 + 1e-12).all()


finite = st.floats(-400, 400)


@settings(max_examples=150, deadline=None)
@given(
    path=st.lists(st.tuples(finite, finite, finite), min_size=2, max_size=30),
    B=st.lists(st.floats(0.5e-6, 1e-4), min_size=5, max_size=5),
    part=st.lists(st.floats(-1, 1), min_size=9, max_size=9),
)
def test_no_path_of_curvatures_makes_energy(path, B, part):
    """Work of each increment less the change of the stored energy is never negative, and the work is exact."""
    softening = [B[k] * part[k] / 60 for k in range(5)]
    friction = [abs(part[5 + k]) * 1e-3 for k in range(3)]
    c = [BendingCurve(B[k], softening[k], friction[k] if k < 3 else 0.0) for k in range(5)]
    bound = BendingCurves(*c[:3], (c[3], c[4])).largest_coupling
    law = Bending(BendingCurves(*c[:3], (c[3], c[4]), 0.99 * part[8] * bound, 5 + 30 * abs(part[7])))
    state, K = law.initial_state[None], np.zeros((1, 3))
    size = spent = 0.0
    for step in path:
        new = np.array([step])
        _, tangent, after = law.respond(new, state)
        # from one committed state the moment has a potential: the work of any way to `new` is its difference
        work = (law.potential(new, state) - law.potential(K, state))[0]
        lost = work - (law.recoverable(new, after) - law.recoverable(K, state))[0]
        size = max(size, abs(work), 1e-9)
        assert lost >= -1e-12 * size
        assert np.linalg.eigvalsh(tangent[0])[0] > 0
        spent += lost
        state, K = after, new
    assert spent >= -1e-12 * size


@each
def test_the_stiffest_is_no_softer_than_any_tangent(curves):
    law = Bending(curves)
    K = curvatures(500)
    tangent = law.respond(K, np.tile(law.initial_state, (500, 1)))[1]
    assert np.linalg.eigvalsh(law.stiffest.stiffness - tangent).min() > -1e-18
    near = law.respond(1e-9 * K, np.tile(law.initial_state, (500, 1)))[1]
    assert np.linalg.eigvalsh(law.stiffest.stiffness - near).min() > -1e-18


def test_only_a_straight_law_has_a_constant_stiffness():
    coupled = BendingCurves(LINEAR.warp, LINEAR.weft, LINEAR.twist, coupling=3e-6)
    C = Bending(coupled).stiffness
    assert np.array_equal(C, [[12e-6, 3e-6, 0], [3e-6, 8e-6, 0], [0, 0, 5e-6]])
    K = curvatures(9)
    assert np.allclose(Bending(coupled).respond(K, np.empty((9, 0)))[0], K @ C, rtol=1e-14)
    for curves in list(LAWS.values())[1:]:
        assert not hasattr(Bending(curves), "stiffness")
    back = BendingCurves(LINEAR.warp, LINEAR.weft, LINEAR.twist, (BendingCurve(9e-6), LINEAR.weft))
    assert not hasattr(Bending(back), "stiffness")


def test_beyond_its_limit_a_curve_goes_on_along_its_tangent():
    law = Bending(SOFT)
    limit = SOFT.warp.limit
    assert limit == pytest.approx(0.9 * 13.8e-6 / (2 * 35.6e-9))
    K = along(limit * np.array([1.0, 1.5, 2.0, 4.0]), 0)
    _, tangent, _ = law.respond(K, np.zeros((4, 9)))
    assert np.allclose(tangent[1:, 0, 0], 0.1 * 13.8e-6)  # friction has built up, so that none of it is left
    assert law.beyond_calibration(K[:1]) is None and law.beyond_calibration(np.zeros((0, 3))) is None
    assert "warp K11 is" in law.beyond_calibration(K) and f"{limit:.3g} 1/m" in law.beyond_calibration(K)
    assert "weft K22 of the back" not in str(law.beyond_calibration(along([-1e4], 1)))  # a straight line has no end


STRIPS = [(12e-6, 8e-6, B66, B12) for B66 in (2e-6, 5e-6, 15e-6) for B12 in (0.0, 1.5e-6)]


@pytest.mark.parametrize(("warp", "weft", "twist", "coupling"), STRIPS)
def test_a_bias_strip_reads_compliance_when_narrow_and_stiffness_when_wide(warp, weft, twist, coupling):
    """At the point: uniaxial moment at 45 degrees, and a cylinder bent at 45 degrees."""
    curves = BendingCurve(warp), BendingCurve(weft), BendingCurve(twist)
    law = Bending(BendingCurves(*curves, coupling=coupling))
    narrow = driver.uniaxial(law, [50.0], angle=np.pi / 4).stress[-1, 0] / 50
    wide = driver.run(law, [[50.0, 0.0, 0.0]], angle=np.pi / 4).stress[-1, 0] / 50
    assert bias_of_twist(*curves, wide=False, coupling=coupling).B == pytest.approx(narrow, rel=1e-9)
    assert bias_of_twist(*curves, wide=True, coupling=coupling).B == pytest.approx(wide, rel=1e-9)
    assert wide > narrow
    if not coupling:
        assert narrow == pytest.approx(4 / (1 / warp + 1 / weft + 1 / twist))
        assert wide == pytest.approx((warp + weft + 4 * twist) / 4)
    for wide_strip in (False, True):
        bias = bias_of_twist(*curves, wide=wide_strip, coupling=coupling)
        assert twist_of_bias(*curves[:2], bias, wide_strip, coupling).B == pytest.approx(twist, rel=1e-9)
        assert (bias.B > bias_bound(*curves[:2], wide_strip, coupling)) == wide_strip


@pytest.mark.parametrize("wide", [False, True])
def test_softening_and_friction_of_a_bias_strip(wide):
    """Softening to second order in the curvature, friction where it has built up; and back to the twist."""
    soft = BendingCurve(12e-6, -20e-9), BendingCurve(8e-6, -15e-9), BendingCurve(5e-6, -10e-9)
    rough = [BendingCurve(c.B, 0.0, h) for c, h in zip(soft, (0.5e-3, 0.3e-3, 0.2e-3), strict=True)]

    def moment(curves, K):
        law = Bending(BendingCurves(*curves))
        if wide:
            return driver.run(law, [[K, 0.0, 0.0]], angle=np.pi / 4).stress[-1, 0]
        return driver.uniaxial(law, np.linspace(0, K, 20)[1:], angle=np.pi / 4).stress[-1, 0]

    bias = bias_of_twist(*soft, wide=wide)
    for K in (2.0, 4.0):
        seen = (moment(soft, K) - bias.B * K) / K**2
        assert seen == pytest.approx(bias.softening, rel=0.02 * K)
    assert twist_of_bias(*soft[:2], bias, wide).softening == pytest.approx(-10e-9, rel=1e-9)
    bias = bias_of_twist(*rough, wide=wide)
    assert moment(rough, 600.0) - bias.B * 600 == pytest.approx(bias.hysteresis / 2, rel=1e-6)
    assert twist_of_bias(*rough[:2], bias, wide).hysteresis == pytest.approx(0.2e-3, rel=1e-9)


# -- the section -----------------------------------------------------------------------------------------------------


def both(n, seed=0, size=0.1):
    return np.hstack([np.random.default_rng(seed).uniform(-size, size, (n, 3)), curvatures(n, seed)])


@pytest.mark.parametrize(
    "law", [Woven(BLEND), Potential(BLEND), StVenantKirchhoff.isotropic(1e6, 0.3)], ids=lambda law: type(law).__name__
)
@pytest.mark.parametrize("curves", [LINEAR, SOFT], ids=["linear", "friction"])
def test_the_section_keeps_the_promises_of_a_law(law, curves):
    section = OwnBending(law, BLEND.thickness, Bending(curves))
    report = driver.check(section, both(40))
    assert report.judged > 0.9 and report.symmetric == law.symmetric
    assert (report.potential_error is None) == isinstance(law, Woven)
    assert section.initial_state.size == law.initial_state.size + Bending(curves).initial_state.size


def test_the_section_is_its_two_laws_side_by_side():
    h, plane, bending = BLEND.thickness, Woven(BLEND), Bending(SOFT)
    section, E = OwnBending(plane, h, bending), both(30)
    start = np.tile(section.initial_state, (30, 1))
    resultants, tangent, state = section.respond(E, start)
    S, C, plane_state = plane.respond(np.ascontiguousarray(E[:, :3]), np.tile(plane.initial_state, (30, 1)))
    M, D, bent = bending.respond(np.ascontiguousarray(E[:, 3:]), np.zeros((30, 9)))
    assert np.array_equal(resultants, np.hstack([h * S, M])) and np.array_equal(state, np.hstack([plane_state, bent]))
    assert np.array_equal(tangent[:, :3, :3], h * C) and np.array_equal(tangent[:, 3:, 3:], D)
    assert not tangent[:, :3, 3:].any() and not tangent[:, 3:, :3].any()
    energy = section.recoverable(E, state)
    assert np.allclose(energy, h * plane.recoverable(E[:, :3], plane_state) + bending.recoverable(E[:, 3:], bent))
    assert section.stiffest.stiffness.shape == (6, 6)
    assert np.allclose(section.stiffest.stiffness[:3, :3], h * plane.stiffest.stiffness)


def test_a_linear_section_is_that_of_layers_with_their_rigidity():
    C, h = np.array([[4.0, 1.0, 0.3], [1.0, 2.0, -0.2], [0.3, -0.2, 1.5]]), BLEND.thickness
    own = OwnBending(StVenantKirchhoff(C), h, StVenantKirchhoff(h**3 / 12 * C))
    assert np.allclose(own.stiffness, Section(StVenantKirchhoff(C), h).elastic(C), rtol=1e-12, atol=1e-18)
    assert own.stiffest is own and own.symmetric
    E = both(20)
    assert np.allclose(own.respond(E, np.empty((20, 0)))[0], E @ own.stiffness, rtol=1e-12)


def test_a_law_that_tells_no_energy_leaves_the_section_silent():
    section = OwnBending(scenes.Toy(), BLEND.thickness, Bending(SOFT))
    assert (
        not hasattr(section, "recoverable") and not hasattr(section, "stiffest") and not hasattr(section, "potential")
    )
    assert "warp K11" in section.beyond_calibration(np.array([[0.0, 0, 0, 1e4, 0, 0]]))
    measured = OwnBending(Woven(BLEND), BLEND.thickness, Bending(LINEAR))
    assert "E11 = 0.900" in measured.beyond_calibration(np.array([[0.9, 0, 0, 1e4, 0, 0]]))
    assert measured.beyond_calibration(np.array([[0.1, 0, 0, 1e4, 0, 0]])) is None
    assert measured.beyond_calibration(np.empty((0, 6))) is None  # a rank without cells


def test_what_cannot_be_such_a_section_or_law():
    with pytest.raises(InputError, match="thickness"):
        OwnBending(Woven(BLEND), 0.0, Bending(LINEAR))
    for wrong in ((0.0,), (-1e-6,), (np.nan,), (1e-6, np.inf), (1e-6, 0.0, -1e-3), (1e-6, 0.0, np.nan)):
        with pytest.raises(InputError, match=r"rigidity of|softening of|hysteresis 2HB of"):
            BendingCurve(*wrong)
    with pytest.raises(InputError, match=r"B12 of 9\.9 uN m is not below 9\.798 uN m"):
        BendingCurves(LINEAR.warp, LINEAR.weft, LINEAR.twist, coupling=9.9e-6)
    with pytest.raises(InputError, match="builds up"):
        BendingCurves(LINEAR.warp, LINEAR.weft, LINEAR.twist, friction_per_m=0.0)
    with pytest.raises(InputError, match=r"narrow bias strip must have a B below 19\.2 uN m"):
        twist_of_bias(LINEAR.warp, LINEAR.weft, BendingCurve(20e-6), wide=False)
    with pytest.raises(InputError, match=r"wide bias strip must have a B above 5 uN m"):
        twist_of_bias(LINEAR.warp, LINEAR.weft, BendingCurve(4e-6), wide=True)
    rough = BendingCurve(12e-6, 0.0, 1e-3)
    with pytest.raises(InputError, match=r"2HB of 1 mN; 0\.5 is less"):
        twist_of_bias(rough, rough, BendingCurve(20e-6, 0.0, 0.5e-3), wide=True)
