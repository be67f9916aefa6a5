"""The woven law with a potential: it is what was measured, makes no energy, is stable; for any admissible fabric."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import ShearFriction
from fabric_fenicsx.laws import HasPotential, driver, elements, named, potential, stability
from fabric_fenicsx.laws.bending import Bending
from fabric_fenicsx.laws.own_bending import OwnBending
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven

FABRICS = fabrics.names()
every_fabric = pytest.mark.parametrize("name", FABRICS)
yarns = pytest.mark.parametrize("yarn", [0, 1], ids=["warp", "weft"])
strains = st.floats(-0.1, 0.3)
points = st.tuples(strains, strains, st.floats(-0.6, 0.6))


def ray(fabric, yarn, strain):
    """Strains (n, 3) under uniaxial stress along a yarn, from axial ones (n,)."""
    E = np.zeros((len(strain), 3))
    E[:, yarn], E[:, 1 - yarn] = strain, -fabric.poisson["measured"][yarn] * strain
    return E


def follow(law, path):
    """Stresses (n, 3) along strains (n, 3), committed one after the other."""
    state, stresses = law.initial_state[None], []
    for strain in path:
        stress, _, state = law.respond(strain[None], state)
        stresses.append(stress[0])
    return np.array(stresses)


def box(fabric):
    """Lowest and highest strains (3,) of the measured range: contraction and stretch of the tests, shear both ways."""
    (nu12, nu21), high = (
        fabric.poisson["measured"],
        np.array([c.limit for c in (fabric.warp, fabric.weft, fabric.shear)]),
    )
    return np.array([-nu21 * high[1], -nu12 * high[0], -high[2]]), high


def histories(law, n, steps=4, seed=0, wide=1.0):
    """Random paths of n points inside the measured range: yields committed strain, state, next strain and new state."""
    rng = np.random.default_rng(seed)
    low, high = box(law.fabric)
    strain, state = np.zeros((n, 3)), np.tile(law.initial_state, (n, 1))
    for _ in range(steps):
        # one step in two is small, so that the ramps are met as well
        target = rng.uniform(wide * low, wide * high, (n, 3))
        target = strain + rng.choice([1.0, 0.01], (n, 1)) * (target - strain)
        new = law.respond(target, state)[2]
        yield strain, state, target, new
        strain, state = target, new


def mean_transverse(law, yarn, parts=2000):
    """What tension along a yarn adds to the stiffness across, mean over the measured range, over that of rest."""
    fabric, nu = law.fabric, law.fabric.poisson["measured"]
    own, other = (fabric.warp, fabric.weft) if yarn == 0 else (fabric.weft, fabric.warp)
    E = own.limit * (np.arange(parts) + 0.5) / parts
    C = law.respond(ray(fabric, yarn, E), np.tile(law.initial_state, (parts, 1)))[1]
    # C = D1 e1 e1' + k n n' on the ray; the other yarn at rest has its part in k
    rest = law._elements[0 if yarn else 2][0]
    return (C[:, 1 - yarn, 1 - yarn].mean() - rest) * (1 - nu[0] * nu[1]) / other.modulus[0]


@every_fabric
@yarns
@pytest.mark.parametrize("parts", [1, 7])
def test_uniaxial_stress_is_the_fitted_curve_and_the_contraction_the_measured_one(name, yarn, parts):
    """With the strain across in Poisson's ratio to that along, the stress along is the curve's, and none across."""
    fabric = fabrics.load(name)
    law, curve = Potential(fabric), (fabric.warp, fabric.weft)[yarn]
    for end in np.linspace(0.01, 1.5, 20) * curve.limit:
        way = np.linspace(0, end, parts + 1)[1:]
        S = follow(law, ray(fabric, yarn, way))[-1]
        miss = max(abs(S[yarn] - curve.stress(end)), abs(S[1 - yarn]))
        if end >= potential.START:
            assert miss < 1e-12 * curve.stress(end)
        else:
            assert miss < 0.15 * potential.START * curve.modulus[0] * (1 + law._directions[2 + yarn])


@every_fabric
@yarns
def test_unloading_is_that_of_the_woven_law(name, yarn):
    """Along a yarn, up to where the tension elements go slack: stress, set and modulus of a whole cycle."""
    fabric = fabrics.load(name)
    curve = (fabric.warp, fabric.weft)[yarn]
    top, ramp = 0.8 * curve.limit, 1e-4
    down = np.concatenate([np.linspace(top, 0.5 * top, 2000), np.linspace(0.99, 1.0, 9) * top])
    laws = Potential(fabric, ramp=ramp), Woven(fabric, ramp=ramp)
    new, old = (follow(law, ray(fabric, yarn, down))[:, yarn] for law in laws)
    carrying = old > 0.02 * old[0]
    assert carrying.sum() > 20 and np.abs(new - old)[carrying].max() < 1e-9 * old[0]
    ends = [down[np.flatnonzero(S[:2000] > 0)[-1]] for S in (new, old)]
    assert abs(ends[0] - ends[1]) < ramp


@every_fabric
def test_shear_is_that_of_the_woven_law(name):
    fabric = fabrics.load(name)
    path = np.random.default_rng(0).uniform(-0.6, 0.6, 300)
    path[::3] = path[1::3] + 1e-3 * path[::3]
    strain = np.outer(path, [0, 0, 1])
    new, old = (follow(kind(fabric), strain)[:, 2] for kind in (Potential, Woven))
    assert np.abs(new - old).max() < 1e-12 * np.abs(old).max()


@every_fabric
@pytest.mark.parametrize(
    "options", [{}, {"ramp": 5e-3}, {"poisson": "lowered"}, {"shear_hysteresis": False}, {"transverse": (0.1, 0.05)}]
)
def test_it_keeps_the_promises_of_a_law(name, options):
    """Pure; the tangent is the derivative of the stress, and symmetric; the stress the gradient of the potential."""
    report = driver.check(Potential(fabrics.load(name), **options))
    assert report.asymmetry == 0.0 and report.judged > 0.9 and report.potential_error < 1e-9


@every_fabric
def test_so_does_its_section(name):
    fabric = fabrics.load(name)
    section = Section(Potential(fabric), fabric.thickness)
    size = np.repeat([0.1, 0.1 / fabric.thickness], 3)
    report = driver.check(section, np.random.default_rng(0).uniform(-1, 1, (40, 6)) * size)
    assert report.symmetric and report.potential_error < 1e-9


def test_a_section_of_a_linear_law_has_the_energy_of_its_stiffness():
    law = StVenantKirchhoff.from_fabric(fabrics.load("duck"))
    section, E = Section(law, 1e-3), np.random.default_rng(0).uniform(-1, 1, (9, 6)) * np.repeat([0.1, 100.0], 3)
    exact = np.einsum("na,ab,nb->n", E, section.elastic(law.stiffness), E) / 2
    assert np.allclose(section.potential(E, np.empty((9, 0))), exact, rtol=1e-12)
    assert not isinstance(StVenantKirchhoff([[2.0, 1.0], [0.5, 2.0]]), HasPotential)
    assert not isinstance(Section(Woven(fabrics.load("duck")), 1e-3), HasPotential)


@every_fabric
@pytest.mark.parametrize("wide", [1.0, 2.0])
def test_no_step_makes_energy(name, wide):
    """Work = change of the recoverable + dissipation, and no dissipation is negative, on 1e5 random steps."""
    law = Potential(fabrics.load(name))
    lost = np.zeros(25_000)
    for start, state, end, new in histories(law, 25_000, wide=wide):
        before, W, kept = law.potential(start, state), law.potential(end, state), law.recoverable(end, new)
        assert (np.abs(before - law.recoverable(start, state)) == 0).all() and (kept >= 0).all()
        assert (W - kept >= -1e-12 * W).all()
        lost += W - kept
    assert (lost > 0).all()


@every_fabric
def test_closed_loops_make_nothing(name):
    """Polygons of six random strains, gone round three times: the last round gives back no more than it takes."""
    law, n, rounds = Potential(fabrics.load(name)), 20_000, 3
    rng = np.random.default_rng(1)
    corners = rng.uniform(*box(law.fabric), (6, n, 3))
    state, strain, work, peak = np.tile(law.initial_state, (n, 1)), np.zeros((n, 3)), np.zeros(n), np.zeros(n)
    for k in range(6 * rounds + 1):
        end = corners[k % 6]
        if k > 6 * (rounds - 1):
            work += law.potential(end, state) - law.potential(strain, state)
        state, strain = law.respond(end, state)[2], end
        stored = law.recoverable(end, state)
        peak = np.maximum(peak, stored)
        if k == 6 * (rounds - 1):
            first = stored
    assert (stored - first - work <= 1e-12 * peak).all()


@every_fabric
def test_the_work_of_a_long_step_is_the_difference_of_the_potential(name):
    """Against the stress on the way, with all kinks: trapezoidal rule in 40000 parts."""
    law, parts = Potential(fabrics.load(name)), 40_000
    for start, state, end, _ in histories(law, 8, seed=2):
        way = np.linspace(start, end, parts + 1)
        S = law.respond(way.reshape(-1, 3), np.tile(state, (parts + 1, 1)))[0].reshape(way.shape)
        work = np.trapezoid((S * (end - start)).sum(2), dx=1 / parts, axis=0)
        size = np.abs(S * (end - start)).sum(2).max(0)
        assert (np.abs(law.potential(end, state) - law.potential(start, state) - work) < 1e-7 * size).all()


@every_fabric
@pytest.mark.parametrize("wide", [1.0, 2.0])
def test_tangent_is_positive_definite_and_below_the_stiffest(name, wide):
    law = Potential(fabrics.load(name))
    K = law.stiffest.stiffness
    for _, state, end, _ in histories(law, 20_000, wide=wide):
        C = law.respond(end, state)[1]
        assert (stability.second_order_work(C) > 0).all()
        assert np.linalg.eigvalsh(K - C)[:, 0].min() > -1e-12 * np.abs(K).max()


@every_fabric
@pytest.mark.parametrize("shearing", ["measured", "none", "friction"])
def test_without_a_tangent_it_says_the_same_and_by_how_much_it_has_hardened(name, shearing):
    fabric = fabrics.load(name)
    if shearing == "friction":
        fabric = replace(fabric, shear_friction=ShearFriction(5.0, set_in=0.0, returned=0.5))
    law = Potential(fabric, shear_hysteresis=shearing != "none")
    section = Section(law, fabric.thickness, 3)
    bent = OwnBending(law, fabric.thickness, Bending.from_fabric(fabric))
    most, rng = law.stiffest.stiffness, np.random.default_rng(1)
    for _, state, end, new in histories(law, 2000, steps=6):
        stress, after = np.empty_like(end), np.empty_like(state)
        risen = law.advance(end, state, stress, after)
        S, C, _ = law.respond(end, state)
        assert np.abs(stress - S).max() <= 1e-13 * np.abs(S).max() and (after == new).all()
        H, later = (law.hardened.respond(end, s)[1] for s in (state, new))
        # wherever it goes at once, and as if all else had hardened by as much
        assert np.linalg.eigvalsh(later - C)[:, 0].min() > -1e-12 * most.max()
        assert np.linalg.eigvalsh(H + risen * most - later)[:, 0].min() > -1e-12 * most.max()
        assert np.linalg.eigvalsh(later - H)[:, 0].min() > -1e-12 * most.max() and risen <= 1.0
        E = np.concatenate([end, rng.normal(size=end.shape)], axis=1)
        for whole in (section, bent):
            own = np.tile(whole.initial_state, (len(E), 1))
            N, _, later = whole.respond(E, own)
            stress, after = np.empty_like(E), np.empty_like(own)
            assert whole.advance(E, own, stress, after) > 0.0
            assert np.abs(stress - N).max() <= 1e-12 * np.abs(N).max()
            assert np.allclose(after, later, rtol=1e-12, atol=1e-13)


@every_fabric
def test_stress_is_lipschitz_with_the_stiffest(name):
    law = Potential(fabrics.load(name))
    rng, most = np.random.default_rng(3), np.linalg.eigvalsh(law.stiffest.stiffness)[-1]
    for _, state, end, _ in histories(law, 20_000):
        step = 10.0 ** rng.uniform(-9, -1, (len(end), 1)) * rng.normal(size=end.shape)
        jump = law.respond(end + step, state)[0] - law.respond(end, state)[0]
        assert (np.linalg.norm(jump, axis=1) <= most * np.linalg.norm(step, axis=1) + 1e-3).all()


@every_fabric
def test_it_is_elliptic_wherever_no_stress_is_compressive(name):
    law, seen = Potential(fabrics.load(name)), 0
    for _, state, end, _ in histories(law, 2000):
        S, C, _ = law.respond(end, state)
        tension = (S[:, :2].min(axis=1) >= 0) & (S[:, 0] * S[:, 1] >= S[:, 2] ** 2)
        seen += tension.sum()
        assert (stability.acoustic(end[tension], S[tension], C[tension]).eigenvalue > 0).all()
    assert seen > 100


@every_fabric
@settings(deadline=None, max_examples=40)
@given(path=st.lists(points, min_size=1, max_size=4), parts=st.integers(2, 9))
def test_splitting_a_straight_increment_changes_nothing(name, path, parts):
    law = Potential(fabrics.load(name))
    state, last, largest = law.initial_state[None], np.zeros(3), 1.0
    for target in np.array(path):
        whole, _, after = law.respond(target[None], state)
        for k in range(1, parts + 1):
            split, _, state = law.respond((last + (target - last) * k / parts)[None], state)
            largest = max(largest, np.abs(split).max())
        # the last part ends at the target to a digit of strain
        assert np.abs(split - whole).max() <= 1e-13 * largest + 1e-16 * law.stiffest.stiffness.max()
        state, last = after, target


def test_any_finite_strain_and_a_bad_point():
    law, rng = Potential(fabrics.load("duck")), np.random.default_rng(3)
    state = np.tile(law.initial_state, (5000, 1))
    for _ in range(4):
        strain = rng.uniform(-10, 10, (5000, 3)) * 10.0 ** rng.uniform(-12, 0, (5000, 3))
        answer = law.respond(strain, state)
        assert all(np.isfinite(a).all() for a in (*answer, law.potential(strain, state)))
        state = answer[2]
    for bad in (np.nan, np.inf):
        strain[17, 1] = bad
        stress = law.respond(strain, state)[0]
        assert np.isnan(stress[17]).all() and np.isfinite(np.delete(stress, 17, axis=0)).all()


@every_fabric
@yarns
@pytest.mark.parametrize("part", [0.3, 0.1])
def test_tension_adds_the_stiffness_across_that_is_asked_for(name, yarn, part):
    assert mean_transverse(Potential(fabrics.load(name), transverse=(part, part)), yarn) == pytest.approx(
        part, rel=1e-5
    )


def test_too_much_stiffness_across_is_refused_if_given_and_cut_if_assumed():
    denim = fabrics.load("denim")
    with pytest.raises(InputError, match=r"denim: transverse of 1 along the warp .* at most 0\.\d+") as error:
        Potential(denim, transverse=(1.0, 0.3))
    most = float(str(error.value).split("at most ")[1][:-1])
    assert mean_transverse(Potential(denim, transverse=(0.999 * most, 0.3)), 0) == pytest.approx(0.999 * most, rel=1e-4)
    # as its file would have it: measured, or assumed
    much = replace(denim, transverse=(1.0, 0.3), transverse_source="biaxial record")
    with pytest.raises(InputError, match="at most"):
        Potential(much)
    assert Potential(replace(much, transverse_source="assumed"))._directions[2] == potential.LARGEST


@pytest.mark.parametrize("nu", [(0.3, 0.0), (0.0, 0.3), (0.0, 0.0)])
def test_yarns_that_do_not_contract(nu):
    blend = fabrics.load("blend")
    law = Potential(replace(blend, poisson={"measured": nu}))
    driver.check(law)
    for yarn, curve in enumerate((blend.warp, blend.weft)):
        S = follow(law, ray(law.fabric, yarn, np.array([curve.limit])))[0]
        assert S[yarn] == pytest.approx(float(curve.stress(curve.limit)), rel=1e-12)
        assert abs(S[1 - yarn]) < 1e-12 * S[yarn]


REFUSED = {
    "loading above unloading": (
        lambda f: replace(f, weft=replace(f.weft, unloading=10e6)),
        r"blend: the weft element has a loading modulus of 267\.744 MPa, .* 10 MPa, .* of at least 267\.746 MPa",
    ),
    "no room for the start of tension": (
        lambda f: replace(f, warp=fabrics.Curve((8e6, 0.0, 0.0, 0.0), 8.5e6, 0.2)),
        r"the warp tension element has a loading modulus of 10\.6667 MPa, .* at least 10.6668 MPa",
    ),
    "shear": (
        lambda f: replace(f, shear=replace(f.shear, unloading=1e5)),
        "the shear element .* give unloading_MPa",
    ),
    "negative ratio": (lambda f: replace(f, poisson={"measured": (-0.1, 0.2)}), "must not be negative"),
    "ratios": (lambda f: replace(f, poisson={"measured": (2.0, 0.5)}), "product below 1"),
    "transverse": (lambda f: replace(f, transverse=(0.0, 0.3)), "two positive numbers"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_a_fabric_of_which_no_such_law_can_be_made_is_refused(fault):
    change, sentence = REFUSED[fault]
    with pytest.raises(InputError, match=sentence) as error:
        Potential(change(replace(fabrics.load("blend"), transverse_source="assumed")))
    assert str(error.value).startswith("blend: ") and str(error.value).endswith(".")


@pytest.mark.parametrize(("options", "word"), [({"poisson": "guessed"}, "guessed"), ({"ramp": 0.0}, "ramp")])
def test_unknown_choices_are_refused(options, word):
    with pytest.raises(InputError, match=word):
        Potential(fabrics.load("duck"), **options)


def test_it_has_a_name_and_a_ramp_there():
    muslin = fabrics.load("muslin")
    law = named.law("potential", muslin, "lowered", False, ramp=5e-3)
    assert isinstance(law, Potential) and law.initial_state.size == 12
    assert law._elements == Potential(muslin, "lowered", ramp=5e-3)._elements != Potential(muslin, "lowered")._elements
    with pytest.raises(InputError, match="'printed'"):
        named.law("printed", muslin, ramp=5e-3)


@st.composite
def curves(draw):
    """A cubic modulus of 0.2 to 100 MPa with its turns anywhere, and an unloading modulus that may be too small."""
    limit = draw(st.floats(0.01, 0.5))
    at = np.array([draw(st.floats(0.2e6, 100e6)) for _ in range(4)])
    cubic = np.linalg.solve(np.vander(np.linspace(0, 1, 4), increasing=True), at)
    # scaled up, so that it is positive in between as well
    samples = np.polynomial.polynomial.polyval(np.linspace(0, 1, 400), cubic)
    cubic[0] += max(0.0, 0.1e6 - samples.min())
    unloading = draw(st.floats(0.8, 100.0)) * (samples.max() + max(0.0, 0.1e6 - samples.min()))
    return fabrics.Curve(tuple(float(c) for c in cubic / limit ** np.arange(4)), float(unloading), limit)


@settings(deadline=None, max_examples=30)
@given(
    warp=curves(), weft=curves(), shear=curves(), nu12=st.floats(0.0, 3.0), product=st.floats(0.0, 0.98),
    transverse=st.tuples(st.floats(0.01, 2.0), st.floats(0.01, 2.0)), ramp=st.floats(1e-5, 3e-2),
)  # fmt: skip
def test_any_admissible_fabric_keeps_the_proofs_and_any_other_is_refused(
    warp, weft, shear, nu12, product, transverse, ramp
):
    nu21 = min(product / nu12, 3.0) if nu12 > 1e-3 else product
    assume(nu12 == 0 or nu12 > 1e-6)
    fabric = replace(
        fabrics.load("blend"), warp=warp, weft=weft, shear=shear, poisson={"measured": (nu12, nu21)},
        transverse=transverse, transverse_source="assumed",
    )  # fmt: skip
    excess = []
    for curve, tension in ((warp, True), (weft, True), (shear, False)):
        e = np.linspace(0, curve.limit, 20_001)
        D = curve.tangent(e)
        excess.append(D.max() / curve.unloading)
        if tension:
            t = np.linspace(0, 1, 2001)
            e = t * min(potential.START, curve.limit / 2)
            excess.append((curve.tangent(e) - curve.modulus[0] * (1 - t) * (1 - 3 * t)).max() / curve.unloading)
    try:
        law = Potential(fabric, ramp=ramp)
    except InputError as error:
        assert "loading modulus" in str(error) and max(excess) > 1 - 1e-5
        return
    assert max(excess) < 1 + 1e-5
    K = law.stiffest.stiffness
    for start, state, end, new in histories(law, 60, steps=5, wide=1.3):
        W, kept = law.potential(end, state), law.recoverable(end, new)
        assert (W - kept >= -1e-12 * W).all() and (kept >= 0).all()
        S, C, _ = law.respond(end, state)
        assert (stability.second_order_work(C) > -1e-15 * np.abs(C).max((1, 2))).all()
        assert np.linalg.eigvalsh(K - C)[:, 0].min() > -1e-12 * np.abs(K).max()
        half = law.respond((start + end) / 2, state)[2]
        assert np.abs(law.respond(end, half)[0] - S).max() <= 1e-12 * np.abs(S).max() + 1e-15 * K.max()
    driver.check(law, box(fabric)[1] * np.random.default_rng(0).uniform(-1, 1, (3, 3)))


def test_a_steep_curve_narrows_the_ramp():
    """A modulus that falls by 100 MPa over 1e-3 of strain, faster than a ramp of 0.1 could follow."""
    steep = fabrics.Curve((101e6, -1e11, 0.0, 0.0), 150e6, 1e-3)
    law = Potential(replace(fabrics.load("blend"), shear=steep), ramp=0.1)
    assert law._elements[4][elements.RATE] == pytest.approx(1.001e11)
    wide = Potential(fabrics.load("blend"), ramp=0.1)
    assert wide._elements[4][elements.RATE] == pytest.approx((6e6 - 1e6) / 0.1)
