"""An arm and a leg: closed, as thick as they are told, bent without crossing themselves, and where their joints are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from scipy.spatial.transform import Rotation
from solids import crossed, volume

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments import limbs
from fabric_fenicsx.garments.limb import FILLET, TURN, Bend, Limb

ARM = limbs.arm(size=12e-3)
LEG = limbs.leg(size=16e-3)


@pytest.mark.parametrize("limb", [limbs.arm(), limbs.arm("woman"), limbs.leg(), limbs.leg("woman")])
def test_a_straight_limb_is_closed_and_has_its_thickness_and_volume(limb):
    x, faces = limb.pose(**dict.fromkeys(limb.joints, 0.0)), limb.faces
    edges, counts = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0, return_counts=True)
    assert (counts == 2).all() and len(x) - len(edges) + len(faces) == 2
    ends = -float(limb.radius(0.0)), limb.length
    assert np.hypot(x[:, 0], x[:, 1]) == pytest.approx(limb.radius(-x[:, 2]), abs=1e-7)
    assert (-x[-2:, 2]) == pytest.approx(ends)
    for place, r in limb.stations:
        assert float(limb.radius(place)) == pytest.approx(r)
    s = np.linspace(*ends, 20001)
    exact = np.trapezoid(np.pi * limb.radius(s) ** 2, s)
    assert volume(x, faces) == pytest.approx(exact, rel=0.01)


def test_sizes_are_those_of_the_survey():
    assert limbs.arm().length == pytest.approx(0.335 + 0.267 + 0.193)
    assert 2 * np.pi * limbs.arm("woman").stations[0][1] == pytest.approx(0.304)
    knee, ankle = limbs.leg().joints.values()
    assert (knee.place, ankle.place) == pytest.approx((0.899 - 0.491, 0.899 - 0.073))


@settings(max_examples=8, deadline=None)
@given(angle=some.floats(-130.0, 130.0), ankle=some.floats(-100.0, 100.0))
@pytest.mark.parametrize("limb", [ARM, LEG], ids=lambda limb: limb.name)
def test_a_bent_limb_does_not_cross_itself_and_keeps_its_volume(limb, angle, ankle):
    bend = {"elbow": angle} if limb is ARM else {"knee": angle, "ankle": ankle}
    x = limb.pose(**bend)
    assert not crossed(x, limb.faces)
    straight = limb.pose(**dict.fromkeys(bend, 0.0))
    assert volume(x, limb.faces) == pytest.approx(volume(straight, limb.faces), rel=0.03)
    p = x[limb.faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) / 2
    assert area.min() > 1e-7


@settings(max_examples=8, deadline=None)
@given(angle=some.floats(-129.0, 129.0), shoulder=some.floats(-180.0, 180.0))
def test_what_is_beyond_a_joint_turns_about_it_and_all_moves_smoothly(angle, shoulder):
    straight, bent = ARM.pose(), ARM.pose(elbow=angle, shoulder=shoulder)
    elbow = ARM.joint("elbow")
    place, reach = -straight[:, 2], ARM._reach(ARM.joints["elbow"])
    turn = Rotation.from_rotvec(np.radians(angle) * np.array(elbow.axis))
    expected = straight.copy()
    fore = place > ARM.joints["elbow"].place + reach
    expected[fore] = turn.apply(straight[fore] - elbow.centre) + elbow.centre
    whole = Rotation.from_rotvec(np.radians(shoulder) * np.array(ARM.joint("shoulder").axis))
    rigid = fore | (place < ARM.joints["elbow"].place - reach)
    assert 0.5 < rigid.mean() < 0.9
    assert bent[rigid] == pytest.approx(whole.apply(expected)[rigid], abs=1e-12)
    assert ARM.joint("elbow", shoulder=shoulder).centre == pytest.approx(whole.apply(elbow.centre))
    small = 1e-4
    moved = np.linalg.norm(ARM.pose(elbow=angle + small, shoulder=shoulder) - bent, axis=1)
    assert moved.max() < np.radians(small) * ARM.length


@pytest.mark.parametrize("angle", [60.0, 120.0, -120.0])
def test_skin_is_a_radius_off_the_bones_but_in_the_fold(angle):
    x, elbow = ARM.pose(elbow=angle), np.array(ARM.joint("elbow").centre)
    bones = np.array([[0, 0, 1], Rotation.from_rotvec([np.radians(angle), 0, 0]).apply([0, 0, -1])])
    along = (x - elbow) @ bones.T
    off = np.sqrt(np.maximum(np.sum((x - elbow) ** 2, axis=1)[:, None] - np.maximum(along, 0.0) ** 2, 0.0))
    above = off - ARM.radius(ARM.joints["elbow"].place + np.array([-1, 1]) * np.maximum(along, 0.0))
    near = np.abs(along).max(axis=1) < 0.2
    apart = near & (np.abs(np.diff(above)[:, 0]) > 0.04)
    assert apart.sum() > 100 and np.abs(above[apart].min(axis=1)).max() < 1e-9
    fillet = FILLET * float(ARM.radius(ARM.joints["elbow"].place)) * np.sin(np.radians(abs(angle)) / 2)
    assert -1e-9 < above[near].min() and above[near].min(axis=1).max() < fillet / 6 + 1e-9


def test_limbs_are_placed_and_bend_as_they_are_told():
    arm = limbs.arm(origin=(1.0, 2.0, 3.0), along=(2.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), size=12e-3)
    assert arm.joint("shoulder").centre == (1.0, 2.0, 3.0)
    assert arm.joint("elbow").centre == pytest.approx((1.335, 2.0, 3.0))
    assert arm.pose(elbow=90.0)[-1] == pytest.approx([1.335, 2.0 + 0.46, 3.0])
    toes, heel = LEG.pose(knee=30.0)[-1], np.array(LEG.joint("ankle", knee=30.0).centre)
    turned = Rotation.from_rotvec([np.radians(30.0), 0, 0])
    assert turned.inv().apply(toes - heel) == pytest.approx([0, -0.75 * 0.271, 0], abs=1e-12)
    assert LEG.joint("ankle").axis == (-1.0, 0.0, 0.0)


def test_a_motion_goes_through_its_angles_and_rests_at_its_ends():
    arm = limbs.arm(size=25e-3)
    body = arm.motion([0.0, 0.5, 1.5], elbow=[0.0, 60.0, 30.0])
    for time, angle in ((0.0, 0.0), (0.5, 60.0), (1.5, 30.0)):
        assert body.places(time) == pytest.approx(arm.pose(elbow=angle), abs=1e-12)
    assert np.abs(np.diff(body.frames[:, -1], axis=0)).max() < 0.46 * np.radians(TURN) * 1.1
    straight = volume(body.frames[0], body.faces)
    half = (body.times[:-1] + body.times[1:]) / 2
    for time in half[::8]:
        assert volume(body.places(time), body.faces) == pytest.approx(straight, rel=0.02)
        assert not crossed(body.places(time), body.faces)
        fore = body.places(time)[-1] - arm.joint("elbow").centre
        assert np.linalg.norm(fore) == pytest.approx(0.46, rel=1e-4), "an arm is no shorter between two frames"
    start, end = body.places(1e-3) - body.places(0.0), body.places(1.5) - body.places(1.499)
    assert np.abs([start, end]).max() < 1e-4


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: ARM.pose(elbow=140.0), "cannot bend by 140.0 degrees at its elbow; at most 130"),
        (lambda: ARM.pose(knee=10.0), "has no joint 'knee'; it has shoulder, elbow"),
        (lambda: ARM.joint("knee"), "has no joint 'knee'"),
        (lambda: ARM.motion([0.0], elbow=[0.0]), "two times at least"),
        (lambda: ARM.motion([0.0, 1.0], elbow=[0.0]), "an angle for each"),
        (lambda: ARM.motion([0.0, 0.0], elbow=[0.0, 1.0]), "times that increase"),
        (lambda: limbs.arm("child"), "no 'child' here; choose one of man, woman"),
        (lambda: limbs.arm(axis=(0, 0, 1)), "cannot go along"),
        (lambda: limbs.arm(size=-1.0), "all in m and positive"),
        (lambda: limbs.arm(length=0.6), "all in m and positive"),
        (
            lambda: Limb("tail", 1.0, ((0.0, 0.2), (0.5, 0.2)), "root", {"middle": Bend(0.25)}),
            "too thick to bend by 130",
        ),
    ],
)
def test_what_is_no_limb_is_refused_in_a_sentence(make, reason):
    with pytest.raises(InputError, match=reason) as fault:
        make()
    assert "\n" not in str(fault.value)
