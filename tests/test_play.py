"""Shear with friction, softening and return: exact work, no energy out of nothing, no ratchet, the numbers of KES-F."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import ShearFriction
from fabric_fenicsx.fabrics.friction import BELOW, GF_CM
from fabric_fenicsx.laws import driver, named, play
from fabric_fenicsx.laws.potential import SHEAR, Potential
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.woven import Woven

BLEND = fabrics.load("blend")
KINDS = {
    "friction": ShearFriction(2e4, set_in=0.0, returned=1.0),
    "softening": ShearFriction(softening=0.5, set_in=0.1, returned=0.1),
    "all": ShearFriction(5e4, 0.4, 0.05, 0.05, 0.2, 0.4, 6.0),
    "even": ShearFriction(5e4, 0.0, 0.3, 0.0, 0.7, 0.3, 1.0),
}
every_kind = pytest.mark.parametrize("kind", KINDS)


def cloth(friction, fabric=BLEND, **curve):
    """A fabric with that shear, and its law."""
    fabric = replace(fabric, shear=replace(fabric.shear, **curve), shear_friction=friction)
    return fabric, Potential(fabric)


def sheared(law, path, state=None):
    """Shear stress (n,) along 2 E12 (n,), committed one after the other, and the last state."""
    out, state = [], law.initial_state[None] if state is None else state
    for gamma in path:
        S, _, state = law.respond(np.array([[0.0, 0.0, gamma]]), state)
        out.append(S[0, 2])
    return np.array(out), state


def legs(*corners, n=200):
    return np.concatenate([np.linspace(a, b, n)[1:] for a, b in pairwise(corners)])


@every_kind
def test_it_keeps_the_promises_of_a_law(kind):
    """The tangent is the derivative of the stress, this the gradient of the potential, and no step makes energy."""
    _, law = cloth(KINDS[kind])
    rng = np.random.default_rng(2)
    report = driver.check(law, rng.uniform(-1, 1, (96, 3)) * [0.1, 0.1, 0.6])
    assert report.symmetric and report.judged > 0.9 and report.potential_error < 1e-9
    section = Section(law, BLEND.thickness)
    wide = np.repeat([0.1, 0.1 / BLEND.thickness], 3)
    assert driver.check(section, rng.uniform(-1, 1, (20, 6)) * wide).potential_error < 1e-9


@st.composite
def frictions(draw):
    part = st.floats(0.0, 1.0)
    softening = draw(st.floats(0.0, 0.95))
    return ShearFriction(
        friction=draw(st.floats(0.0, 3e5)), kept=draw(part), strain=draw(st.floats(0.005, 1.0)),
        set_in=draw(st.floats(0.0, 0.9)), returned=max(1e-3, draw(part) * (1 - softening)), softening=softening,
        rejoining=draw(st.one_of(st.just(1.0), st.floats(1.0, 50.0))),
    )  # fmt: skip


@settings(max_examples=60)
@given(friction=frictions(), stiffer=st.floats(1.0, 30.0), seed=st.integers(0, 999))
def test_any_admissible_numbers_keep_the_proofs_and_any_other_are_refused(friction, stiffer, seed):
    """Limits in order and less steep than K; work of long steps against many parts; nothing made; tangent > 0."""
    gamma = np.linspace(0, BLEND.shear.limit, 4001)
    unloading = stiffer * BLEND.shear.tangent(gamma).max()
    curve = replace(BLEND.shear, unloading=unloading)
    fading = friction.friction * (1 - friction.kept) / (friction.strain + gamma)
    B = (1 - friction.set_in) * curve.stress(gamma) + fading * gamma
    steepest = (curve.tangent(gamma) + fading * friction.strain / (friction.strain + gamma)).max()
    secant = max((B[1:] / gamma[1:]).max(), (1 - friction.set_in) * curve.tangent(curve.limit))  # the latter far beyond
    wanted = (steepest + friction.softening * secant) / unloading
    assume(abs(wanted / BELOW - 1) > 1e-3)
    try:
        _, law = cloth(friction, unloading=unloading)
    except InputError as error:
        assert wanted > BELOW and str(error).startswith("blend: shear with ")
        return
    assert wanted < BELOW
    rng, n = np.random.default_rng(seed), 40
    state, strain = np.tile(law.initial_state, (n, 1)), np.zeros((n, 3))
    for _ in range(6):
        end = np.zeros((n, 3))
        end[:, 2] = rng.uniform(-1.3, 1.3, n) * curve.limit
        end[:, 2] = np.where(rng.random(n) < 0.3, strain[:, 2] + 0.01 * end[:, 2], end[:, 2])
        S, C, new = law.respond(end, state)
        W, kept, before = law.potential(end, state), law.recoverable(end, new), law.recoverable(strain, state)
        assert np.array_equal(before, law.potential(strain, state)) and (kept >= 0).all()
        assert (W - kept >= -1e-12 * W - 1e-9).all()
        assert (C[:, 2, 2] > 0).all() and (C[:, 2, 2] <= unloading * (1 + 1e-12)).all()
        # the same in parts, with the work of each: as the potential says it
        parts, work, at, split = 7, before.copy(), strain, state
        for k in range(1, parts + 1):
            to = strain + (end - strain) * k / parts
            work += law.potential(to, split) - law.recoverable(at, split)
            T, _, split = law.respond(to, split)
            at = to
        assert np.abs(T - S).max() <= 1e-13 * np.abs(S).max() + 1e-15 * unloading
        assert np.abs(work - W).max() <= 1e-11 * W.max() + 1e-9
        strain, state = end, new


@every_kind
def test_the_work_of_a_long_step_is_the_difference_of_the_potential(kind):
    """Against the stress on the way, trapezoidal rule in 40000 parts, from random histories."""
    fabric, law = cloth(KINDS[kind])
    rng, n, parts = np.random.default_rng(0), 12, 40_000
    state, strain = np.tile(law.initial_state, (n, 1)), np.zeros((n, 3))
    for _ in range(5):
        end = np.zeros((n, 3))
        end[:, 2] = rng.uniform(-1.2, 1.2, n) * fabric.shear.limit
        way = np.linspace(strain, end, parts + 1)
        S = law.respond(way.reshape(-1, 3), np.tile(state, (parts + 1, 1)))[0].reshape(way.shape)[..., 2]
        work = np.trapezoid(S * (end - strain)[:, 2], dx=1 / parts, axis=0)
        W = law.potential(end, state) - law.potential(strain, state)
        assert np.abs(W - work).max() < 1e-7 * np.abs(S * (end - strain)[:, 2]).max()
        state, strain = law.respond(end, state)[2], end


@every_kind
def test_first_loading_is_the_curve_and_unloading_its_modulus(kind):
    friction = KINDS[kind]
    fabric, law = cloth(friction)
    top = fabric.shear.limit
    up = np.linspace(friction.friction / fabric.shear.unloading + 0.01, top, 50)
    S, state = sheared(law, up)
    assert np.abs(S - friction.friction - fabric.shear.stress(up)).max() < 1e-14 * S.max()
    down = top - np.linspace(0, 0.05 * S[-1], 9)[1:] / fabric.shear.unloading
    back, _ = sheared(law, down, state)
    assert np.abs(back - S[-1] + fabric.shear.unloading * (top - down)).max() < 1e-13 * S.max()


def test_second_shearing_lacks_what_softening_says_and_rejoins():
    friction = KINDS["all"]
    fabric, law = cloth(friction)
    top, curve = 0.4, fabric.shear
    path = legs(0, top, 0, top, 0, top, 1.2 * top)
    S, _ = sheared(law, path)
    first, third = S[:199], S[4 * 199 : 5 * 199]
    assert np.abs(third - S[2 * 199 : 3 * 199]).max() < 1e-13 * S.max()  # cycle 2 = cycle 3
    g = path[:199]

    def f(m):
        fresh = friction.friction * (friction.kept + (1 - friction.kept) * friction.strain / (friction.strain + m))
        return fresh + friction.set_in * curve.stress(m)

    # the fourth leg ends where the closing limit leaves the point, from which it goes up along K
    slack = friction.friction + curve.stress(g) - f(g)
    x = g / top
    z = x / (friction.rejoining - (friction.rejoining - 1) * x)
    opening = f(top) + slack * (1 - friction.softening * (1 - z))
    open_ = third > opening - 1e-9 * S.max()
    assert open_.sum() > 150 and np.abs(third - opening)[open_].max() < 1e-13 * S.max()
    assert (third[50:150] < 0.9 * first[50:150]).all() and third[-1] == pytest.approx(first[-1], rel=1e-12)
    beyond = path > top
    assert np.abs(S - friction.friction - curve.stress(path))[beyond].max() < 1e-13 * S.max()


@every_kind
@pytest.mark.parametrize("low", [-0.3, -0.9])
def test_cycles_of_stress_do_not_ratchet(kind, low):
    """Between 0.5 and -0.3 (-0.9) of the stress at the end: the same strains in every cycle; the thesis's shear walks
    by a quarter of its reach in each."""
    fabric, law = cloth(KINDS[kind])
    T = float(fabric.shear.stress(fabric.shear.limit))
    turns = np.tile([0.5 * T, low * T], 6)
    targets = np.zeros((12, 3))
    targets[:, 2] = turns
    strain = driver.mixed(law, targets, ["strain", "strain", "stress"]).strain[:, 2]
    assert np.ptp(strain[4::2]) < 1e-9 and np.ptp(strain[5::2]) < 1e-9
    walked = driver.mixed(Woven(fabric), targets, ["strain", "strain", "stress"]).strain[:, 2]
    assert np.ptp(walked[4::2]) > 0.2 * fabric.shear.limit


def kes_of(law, thickness):
    """G, 2HG, 2HG5 (gf/cm ...) of either side, as KES-F reads them from a loop to 8 degrees and back."""
    degrees = legs(0, 8, -8, 8, n=1601)
    S, _ = sheared(law, np.radians(degrees))
    force = S * thickness / GF_CM
    up, down, again = slice(0, 1600), slice(1600, 3200), slice(3200, None)

    def at(part, x):
        order = np.argsort(degrees[part])
        return np.interp(x, degrees[part][order], force[part][order])

    right = (at(up, 2.5) - at(up, 0.5)) / 2, at(up, 0.5) - at(down, 0.5), at(up, 5) - at(down, 5)
    left = (at(down, -0.5) - at(down, -2.5)) / 2, at(again, -0.5) - at(down, -0.5), at(again, -5) - at(down, -5)
    return right, left


FILE = Path(fabrics.__file__).parent / "blend.toml"


def written(folder, shear):
    """A file of blend with another table [shear]."""
    text = FILE.read_text(encoding="utf-8")
    text = re.sub(r"\[shear\].*?\n\n", lambda _: f"{shear}\n\n", text, flags=re.S)
    (folder / "own.toml").write_text(text, encoding="utf-8")
    return folder / "own.toml"


@settings(max_examples=25)
@given(G=st.floats(0.2, 3.0), first=st.floats(0.1, 3.0), wider=st.floats(0.0, 0.95))
def test_a_sheet_of_kes_comes_out_again(tmp_path_factory, G, first, wider):
    """All six numbers of both sides, from the closed formulas."""
    at5 = first + 4.5 * G * wider
    shear = f"[shear]\n[shear.kes]\nG_gf_cm_deg = {G!r}\n2HG_gf_cm = {first!r}\n2HG5_gf_cm = {at5!r}"
    path = written(tmp_path_factory.getbasetemp(), shear)
    if at5 > 10 * first:
        with pytest.raises(InputError, match="less than a tenth of 2HG5"):
            fabrics.load(path)
        return
    fabric = fabrics.load(path)
    for side in kes_of(Potential(fabric), fabric.thickness):
        assert side == pytest.approx((G, first, at5), rel=1e-9)
    assert fabric.shear.limit == pytest.approx(np.radians(8)) and fabric.shear_friction.set_in == 0


def test_the_keys_of_a_file_are_in_its_measure_of_strain(tmp_path):
    keys = "friction_MPa = 0.05\nfriction_kept = 0.4\nset_in = 0.05\nreturned = 0.2\nsoftening = 0.4\nrejoining = 6"
    fabric = fabrics.load(written(tmp_path, f"{PLAIN}friction_strain = 0.025\n{keys}"))
    assert fabric.shear == BLEND.shear and fabric.shear_friction == KINDS["all"]
    engineering = '[shear]\nstrain = "engineering"\nloading_MPa = [1, -4.5, 11.25, -1.5]\nunloading_MPa = 6\n'
    other = fabrics.load(written(tmp_path, f"{engineering}friction_strain = 0.05\n{keys}"))
    assert other.shear.modulus == pytest.approx(BLEND.shear.modulus) and other.shear_friction == fabric.shear_friction
    assert BLEND.shear_friction is None


PLAIN = '[shear]\nstrain = "tensor"\nloading_MPa = [2, -18, 90, -24]\nunloading_MPa = 12\n'
SHEET = "[shear]\n{}\n[shear.kes]\nG_gf_cm_deg = 0.6\n2HG_gf_cm = 0.8\n2HG5_gf_cm = 1.5"
REFUSED = {
    f"{PLAIN}returned = 0.7\nsoftening = 0.5": r"returned = 0\.7 .* give at most 0\.5\.",
    f"{PLAIN}set_in = 1": r"shear\.set_in = 1 is not from 0 to 0\.999; give friction as a part",
    f"{PLAIN}returned = 0": r"shear\.returned = 0 is not from 0\.001 to 1",
    f"{PLAIN}rejoining = 0.5": r"shear\.rejoining = 0\.5 is not from 1",
    f"{PLAIN}friction_MPa = -1": r"shear\.friction_MPa = -1 is not from 0",
    f"{PLAIN}friction_MPa = 9\nfriction_kept = 0\nfriction_strain = 0.05": r"factor of \d",
    f"{PLAIN.replace('= 12', '= 5')}softening = 0.9": r"softening of at most 0\.\d+, or raise unloading_MPa by",
    f"{PLAIN}soften = 0.4": "perhaps shear.softening is meant",
    SHEET.format("loading_MPa = [1]"): r"shear\.loading_MPa = \[1\] stands beside shear\.kes",
    SHEET.format("returned = 0.5"): r"shear\.returned = 0\.5 stands beside",
    SHEET.format('strain = "tensor"\nunloading_MPa = 0.05'): r"too soft for the loop .*; give \d",
    SHEET.format("").replace("= 1.5", "= 0.7"): r"2HG5 = 0\.7 gf/cm .* from 2HG, 0\.8, to less than .* 3\.5",
    SHEET.format("").replace("= 1.5", "= 3.6"): r"2HG5 = 3\.6 gf/cm .* to less than",
    SHEET.format("softening = 0.9"): r"returned = 0\.7407\d* .* give at most 0\.1",
    SHEET.format("").replace("2HG_gf_cm = 0.8\n", ""): r"shear\.kes\.2HG_gf_cm is missing",
}  # fmt: skip


@pytest.mark.parametrize("shear", REFUSED)
def test_every_contradiction_is_one_sentence_with_its_remedy(tmp_path, shear):
    with pytest.raises(InputError, match=REFUSED[shear]) as error:
        fabrics.load(written(tmp_path, shear))
    assert "own.toml" in str(error.value) and "\n" not in str(error.value)


def test_the_remedies_are_the_bounds(tmp_path):
    """What a refusal asks for is taken, and a thousandth less is not."""
    soft = PLAIN.replace("= 12", "= 5") + "softening = {}"
    with pytest.raises(InputError) as error:
        fabrics.load(written(tmp_path, soft.format(0.9)))
    most = float(re.search(r"at most ([\d.]+)", str(error.value))[1])
    factor = float(re.search(r"factor of ([\d.]+)", str(error.value))[1])
    Potential(fabrics.load(written(tmp_path, soft.format(most))))
    with pytest.raises(InputError):
        fabrics.load(written(tmp_path, soft.format(1.002 * most)))
    stiff = soft.replace("= 5", f"= {5 * factor}").format(0.9)
    Potential(fabrics.load(written(tmp_path, stiff)))
    with pytest.raises(InputError):
        fabrics.load(written(tmp_path, stiff.replace(f"= {5 * factor}", f"= {4.99 * factor}")))


def test_laws_without_friction_say_so():
    fabric, _ = cloth(KINDS["all"])
    for name in named.THESIS:
        with pytest.raises(InputError, match=f"blend: the law '{name}' knows nothing of friction_MPa"):
            named.law(name, fabric)
    elastic = Potential(fabric, shear_hysteresis=False)
    plain = Potential(BLEND, shear_hysteresis=False)
    strain = np.random.default_rng(0).uniform(-0.3, 0.3, (50, 3))
    state = np.tile(plain.initial_state, (50, 1))
    for a, b in zip(elastic.respond(strain, state), plain.respond(strain, state), strict=True):
        assert np.array_equal(a, b)
    with pytest.raises(InputError, match="kept = 2"):
        ShearFriction(kept=2)


def test_a_point_at_rest_answers_with_the_modulus_of_loading():
    """Newton's first guess: else it would be K."""
    _, law = cloth(KINDS["softening"])
    gamma = np.array([0.0, 0.2])
    state = sheared(law, [0.2])[1]
    states = np.vstack([law.initial_state, state[0]])
    G = law.respond(np.outer(gamma, [0, 0, 1]), states)[1][:, 2, 2]
    assert G == pytest.approx(BLEND.shear.tangent(gamma), rel=1e-12)
    assert state[0, SHEAR + 1] == 0.2 and play.RESTING < 1e-10
