"""Hips with two thighs: closed, of the sizes of the survey, and whole in any pose of walking."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from solids import crossed, volume

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments.hips import FILLET, hips

MAN = hips(size=15e-3)


@pytest.mark.parametrize("of", ["man", "woman"])
def test_hips_are_closed_and_as_wide_as_the_survey_says(of):
    body = hips(of)
    x, faces = body.pose(), body.faces
    edges, counts = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0, return_counts=True)
    assert (counts == 2).all() and len(x) - len(edges) + len(faces) == 2 and volume(x, faces) > 0.02
    waist = x[np.abs(x[:, 2] - body.height) < 5e-3]
    assert np.abs(waist[:, :2]).max(axis=0) == pytest.approx(body.waist, abs=2e-3)
    low = x[np.abs(x[:, 2] + 0.8 * body.length) < 8e-3]
    radius = body.thigh + 0.8 * (body.knee - body.thigh)
    off = np.hypot(np.abs(low[:, 0]) - body.apart, low[:, 1])
    assert off == pytest.approx(radius, abs=4e-3)
    assert np.abs(x[:, 0] + x[:, 0].min()).min() < 5e-3, "alike on both sides"


@settings(max_examples=6, deadline=None)
@given(left=some.floats(-30.0, 30.0), right=some.floats(-30.0, 30.0))
def test_swung_thighs_keep_the_skin_whole(left, right):
    x = MAN.pose(left=left, right=right)
    assert np.abs(MAN._depth(x, MAN._turns(left, right))).max() < 1e-6
    assert not crossed(x, MAN.faces)
    assert volume(x, MAN.faces) == pytest.approx(volume(MAN.pose(), MAN.faces), rel=0.02)


def test_a_walk_swings_the_thighs_in_turn_and_ends_where_it_stood():
    body, length = hips(size=30e-3).walk(1, 1.0, flexion=16.0, extension=6.0), MAN.length
    left, right = (body.frames[0][:, 0] * side > 0.02 for side in (1, -1))
    knees = body.frames[0][:, 2] < -length

    def ahead(time, side):
        return -body.places(time)[side & knees, 1].mean()

    assert body.places(0.0) == pytest.approx(body.places(1.5))
    assert ahead(0.0, left) == pytest.approx(0.0, abs=1e-2)
    assert ahead(0.5, left) < -0.03 < 0.1 < ahead(0.5, right)
    assert ahead(1.0, right) < -0.03 < 0.1 < ahead(1.0, left)
    assert MAN.joint("left").centre == pytest.approx((MAN.apart, 0, 0)) and MAN.joint("left").axis == (-1.0, 0.0, 0.0)


def test_what_cannot_be_is_refused_in_a_sentence():
    for make, reason in (
        (lambda: MAN.pose(left=31.0), "left thigh cannot swing by 31.0 degrees; at most 30"),
        (lambda: MAN.motion([0, 1], knee=[0, 1]), "no joint 'knee'; they have left and right"),
        (lambda: MAN.motion([0, 1], left=[0]), "two times at least"),
        (lambda: hips(size=0.0), "positive"),
        (lambda: hips("child"), "no 'child' here"),
    ):
        with pytest.raises(InputError, match=reason) as fault:
            make()
        assert "\n" not in str(fault.value)
    assert FILLET < MAN.apart
