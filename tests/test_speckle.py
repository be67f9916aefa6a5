"""Digital image correlation: facets of a random pattern, followed to a twentieth of a pixel, and their strains."""

import csv
import re

import numpy as np
import pytest
import rendered
from click.testing import CliRunner

from fabric_fenicsx.app.cli import app
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify.tensile import markers
from fabric_fenicsx.photographs import reading, speckle, tracking

PIXELS = (240, 320)  # rows, columns
ACCURATE = 0.05  # pixels, root mean square
PART = np.linspace(0, 1, 5)
F = np.eye(2) + PART[:, None, None] * np.array([[0.14, 0.04], [0.02, -0.05]])
SHIFT = PART[:, None] * np.array([9.3, -6.7])


@pytest.fixture(scope="module")
def photographs(tmp_path_factory):
    """A folder of five, drawn by 14 %, sheared and moved, with noise of 4 grey levels in light that falls and turns."""
    folder, rng = tmp_path_factory.mktemp("speckle"), np.random.default_rng(7)
    for k, (gradient, shift, part) in enumerate(zip(F, SHIFT, PART, strict=True)):
        light = rendered.speckle(PIXELS, gradient, shift, level=1 - 0.15 * part, lamp=0.2 * part, rng=rng)
        rendered.save(folder / f"p{k}.png", light)
    return folder


@pytest.fixture(scope="module")
def followed(photographs):
    lights = [lambda k=k: reading.light(photographs / f"p{k}.png") for k in range(len(F))]
    x0 = speckle.facets(lights[0](), (50, 40, 270, 200), 31)
    return x0, speckle.follow(lights, x0, np.full((len(F), len(x0), 2), np.nan), 31)


def test_facets_are_followed_to_a_twentieth_of_a_pixel(followed):
    x0, tracks = followed
    middle = rendered.middle(PIXELS)
    true = np.array([(x0 - middle) @ gradient.T + middle + shift for gradient, shift in zip(F, SHIFT, strict=True)])
    assert len(x0) == 35 and (tracks.state == tracking.FOUND).all()
    off = np.sqrt(((tracks.places - true) ** 2).mean(axis=(1, 2)))
    assert off[0] == 0 and 0 < off[1:].max() < ACCURATE
    assert np.abs((tracks.places - true).mean(axis=1)).max() < 0.4 * ACCURATE


def test_the_field_has_the_strains_of_the_cloth(followed):
    x0, tracks = followed
    E = speckle.strains(tracks.places, x0)
    for k, gradient in enumerate(F):
        C = (gradient.T @ gradient - np.eye(2)) / 2
        assert np.abs(E[k].mean(axis=0) - [C[0, 0], C[1, 1], C[0, 1]]).max() < 3e-4
        assert E[k].std(axis=0).max() < 1e-3


def test_a_facet_that_is_covered_is_lost_and_found_again(photographs):
    """A hand hides a corner in one photograph; what the others show is untouched."""
    lights = [reading.light(photographs / f"p{k}.png").copy() for k in (0, 1, 2)]
    lights[1][:90, :110] = 0.4
    x0 = speckle.facets(lights[0], (20, 20, 300, 220), 31)
    tracks = speckle.follow([lambda one=one: one for one in lights], x0, np.full((3, len(x0), 2), np.nan), 31)
    lost = tracks.state == tracking.LOST
    hidden = (x0 < [80, 60]).all(axis=1)
    assert hidden.any() and lost[1, hidden].all() and not lost[2].any() and not lost[1, (x0 > 140).any(axis=1)].any()


def test_the_verb_writes_marks_strains_and_a_picture(photographs, tmp_path):
    words = ["markers", str(photographs), "--kind", "speckle", "--region", "50,40,270,200", "--out", str(tmp_path)]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0 and "35 facets of 31 x 31 pixels in 5 photographs" in answer.output, answer.output
    with (tmp_path / "strains.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["photograph"] == "p4.png"]
    C = (F[-1].T @ F[-1] - np.eye(2)) / 2
    mean = [np.mean([float(row[f"E_{name} (-)"]) for row in rows]) for name in ("xx", "yy", "xy")]
    assert len(rows) == 35 and mean == pytest.approx([C[0, 0], C[1, 1], -C[0, 1]], abs=3e-4)  # y is upward there
    for name in ("strains.png", "contact_sheet.png"):
        assert (tmp_path / name).stat().st_size > 5000
    seen = markers.contraction(tmp_path / "markers.csv")
    assert seen.ratio == pytest.approx(-C[1, 1] / C[0, 0], rel=0.05)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("plain.png", "plain.png: shows fewer than three facets of 31 x 31 pixels with speckles"),
        ("pattern.png --region 0,0,40,40", "pattern.png: shows fewer than three facets"),
        ("pattern.png --region 0,0,10,40", "The region 0,0,10,40 holds nothing of"),
    ],
)
def test_every_fault_is_one_sentence(photographs, tmp_path, monkeypatch, words, reason):
    rendered.save(tmp_path / "plain.png", np.full(PIXELS, 128, dtype=np.uint8))
    (tmp_path / "pattern.png").write_bytes((photographs / "p0.png").read_bytes())
    monkeypatch.chdir(tmp_path)
    answer = CliRunner().invoke(app, ["markers", *words.split(), "--kind", "speckle"])
    assert isinstance(answer.exception, InputError) and reason in re.sub(r"\s+", " ", str(answer.exception))
