"""The studies of bending in their quick form: their checked numbers and their files."""

import csv

import numpy as np
import pytest
import test_demos

demo = test_demos.demo
STUDY = "bending_studies.py"


def read(path):
    """Columns of a CSV file: numbers, words in the first ones."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name].strip() for row in rows] for name in rows[0]}


def numbers(path, name):
    return np.array([float(word) for word in read(path)[name]])


def test_sections(demo, tmp_path):
    status, said, _ = demo(STUDY, "sections", "--quick", "--out", tmp_path)
    file = tmp_path / "sections.csv"
    assert status == 0 and list(numbers(file, "numbers_of_state")) == [30, 20, 10, 19] and "for information" in said
    assert (numbers(file, "ns_a_point") > 1).all() and numbers(file, "ratio")[0] == 1


@pytest.mark.slow
def test_scenes(demo, tmp_path):
    """The softest B with friction: a strip of triangles, a drape of quadrilaterals."""
    status, said, _ = demo(STUDY, "scenes", "--quick", "--out", tmp_path)
    file = tmp_path / "scenes.csv"
    assert status == 0 and "imbalance at most 1 %: yes" in said
    assert read(file)["complete"] == ["yes"] * 2 and (numbers(file, "imbalance_%") < 1).all()
    assert (numbers(file, "most_height_mm") > 5).all() and (numbers(file, "newton_a_step") > 1).all()


@pytest.mark.slow
def test_an_identified_fabric_drapes_as_the_one_it_came_from(demo, tmp_path):
    status, said, _ = demo(STUDY, "records", "--quick", "--out", tmp_path)
    true, again = numbers(tmp_path / "records.csv", "drape_coefficient")
    assert status == 0 and "(2 at most): yes" in said
    assert abs(true - again) < 2 and 60 < true < 90
    assert "hysteresis_mN" in (tmp_path / "fabric.toml").read_text()
