"""The short demos that a user extends from: their checked numbers, on one rank and on two."""

import ast

import numpy as np
import pytest
import test_demos

demo, read, look, DEMOS = test_demos.demo, test_demos.read, test_demos.look, test_demos.DEMOS
pytestmark = pytest.mark.filterwarnings("ignore:.*is beyond the measured")
MINE = {
    "my_fabric": ["curves.png", "deformed.png"],
    "my_materials": ["deformed.png"],
    "my_mesh": ["sleeve.png", "bag.png"],
    "my_load": ["deformed.png"],
    "my_law": ["deformed.png"],
    "my_term": ["deformed.png"],
    "my_seam": ["deformed.png"],
    "my_bar": ["deformed.png"],
}


@pytest.mark.parametrize("name", MINE)
def test_it_ends_in_its_checked_number(demo, tmp_path, name):
    status, said, _ = demo(f"{name}.py", "--out", tmp_path)
    assert status == 0 and ": yes;" in said
    for picture in MINE[name]:
        look(tmp_path / picture)


def test_a_wrong_answer_is_seen(demo, tmp_path):
    """Few cells are not enough: the check is one."""
    for name in "my_load", "my_term":
        status, said, _ = demo(f"{name}.py", "--cells", "3", "--out", tmp_path)
        assert status == 1 and ": NO;" in said


@pytest.mark.parametrize("name", MINE)
def test_it_is_short_and_says_what_it_shows(name):
    text = (DEMOS / f"{name}.py").read_text()
    assert len([line for line in text.splitlines() if line[:1] not in ("#", "")]) <= 100
    assert "The checked number" in ast.get_docstring(ast.parse(text))


@pytest.mark.slow
def test_two_ranks_give_the_same(demo, tmp_path):
    commands = [[str(DEMOS / f"{name}.py"), "--out", str(tmp_path / "two" / name)] for name in MINE]
    sleeve = ["--around", "16", "--along", "12", "--end", "0.06", "--out"]
    commands.append([str(DEMOS / "sleeve.py"), *sleeve, str(tmp_path / "two" / "sleeve")])
    test_demos.on_two_ranks(commands)
    for name, column in (("my_load", "sag_m"), ("my_law", "force_N")):
        assert demo(f"{name}.py", "--out", tmp_path / "one" / name)[0] == 0
        one, two = (read(tmp_path / ranks / name / "history.csv")[column] for ranks in ("one", "two"))
        assert np.abs(one - two).max() <= 1e-6 * np.abs(one).max(), name
    assert demo("sleeve.py", *sleeve, tmp_path / "one" / "sleeve")[0] == 0
    one, two = (read(tmp_path / ranks / "sleeve" / "history.csv")["wrist_x_N"] for ranks in ("one", "two"))
    assert np.abs(one - two).max() <= 1e-6 * np.abs(one).max()


def test_sleeve(demo, tmp_path):
    """The beginning of its way, on few cells: it folds already."""
    status, said, _ = demo("sleeve.py", "--around", "16", "--along", "12", "--end", "0.1", "--out", tmp_path)
    table = read(tmp_path / "history.csv")
    assert status == 0 and ": yes;" in said
    assert table["dissipated_J"][-1] > 0 and table["fold_mm"][-1] > 3 > table["fold_mm"][0]
    for picture in "deformed.png", "inner_side.png":
        look(tmp_path / picture)
