"""Demos of contact: their checked numbers, their files, and the same answer on two ranks."""

import numpy as np
import pytest
import test_demos

demo, read, look = test_demos.demo, test_demos.read, test_demos.look
pytestmark = pytest.mark.filterwarnings("ignore:.*is assumed")
QUICK = {
    "incline": "incline.py --slopes 0.2 0.4 --end 0.1",
    "capstan": "capstan.py --cells 30 --around 12 --steps 6 --angle 90",
    "stack": "stack.py --sheets 3 --cells 2 --end 0.25 --apart 1.5",
    "tablecloth": "tablecloth.py --cells 6 --around 4 --end 0.9 --step 20",
    "fold": "fold.py --law svk --length 160 --width 20 --cells 32 --across 1 --step 10 --move 0.4 --end 0.35",
    "ring": "pull_through_ring.py --cells 6 --around 4 --way 4 --end 0.012 --step 2",
    "woven": "pull_through_ring.py --law potential --cells 6 --around 4 --way 4 --end 0.012 --step 2",
    "skirt": "skirt.py --cell 100 --skin 60 --law svk --step 20 --settle 0.3 --end 0.4",
}
WHOLE = {
    "weft": "incline.py --friction 0.3 --weft 0.2 --along weft --static 1.2",
    "box": "incline.py --body box --slopes 0.4",
    "sweep": "incline.py --sweep",
    "capstan": "capstan.py",
    "catenary": "capstan.py --catenary",
    "stack": "stack.py",
    "fold": "fold.py",
    "tablecloth": "tablecloth.py --cells 10 --around 8 --end 1.3",
    "ring": "pull_through_ring.py",
    "woven": "pull_through_ring.py --law potential",
    "skirt": "skirt.py --cell 80",
    "cusick": "cusick.py --contact --cell 20 --step 25 --around 6 --end 0.8",
}


def run(demo, line, out):
    """Status, what was said, and the history of a demo."""
    name, *words = line.split()
    status, said, _ = demo(name, *words, "--out", out)
    assert status == 0 and ": yes;" in said
    return said


def test_incline(demo, tmp_path):
    run(demo, QUICK["incline"], tmp_path)
    table = read(tmp_path / "history.csv")
    assert table["expected_m_per_s2"] == pytest.approx([0.0, 9.81 * (0.4 - 0.3) / np.hypot(1, 0.4)])
    one = read(next(tmp_path.glob("1_*")) / "history.csv")
    assert {"slope_x_N", "slope_z_Nm", "least_gap_m", "friction_J", "impact_J"} <= set(one)
    look(tmp_path / "slopes.png")


def test_capstan(demo, tmp_path):
    run(demo, QUICK["capstan"], tmp_path)
    table = read(tmp_path / "history.csv")
    assert table["friction_J"][-1] > 0.0 and (tmp_path / "bodies.pvd").exists()
    look(tmp_path / "pull.png")
    look(tmp_path / "deformed.png")


def test_stack(demo, tmp_path):
    run(demo, QUICK["stack"], tmp_path)
    look(tmp_path / "deformed.png")


def test_tablecloth(demo, tmp_path):
    said = run(demo, QUICK["tablecloth"], tmp_path)
    assert "of the weight" in said
    look(tmp_path / "deformed.png")


def test_fold(demo, tmp_path):
    run(demo, QUICK["fold"], tmp_path)
    table = read(tmp_path / "history.csv")
    assert table["loop_m"].max() > 0.05 and np.isfinite(table["least_gap_m"]).all()
    look(tmp_path / "deformed.png")


@pytest.mark.parametrize("law", ["ring", "woven"])
def test_pull_through_ring(demo, tmp_path, law):
    said = run(demo, QUICK[law], tmp_path)
    table = read(tmp_path / "history.csv")
    assert "largest pull" in said and table["pull_N"][-1] > 0.0 and table["ring_z_N"].min() < 0.0
    assert table["way_m"][-1] == pytest.approx(4e-3) and (table["dissipated_J"][-1] > 0.0) == (law == "woven")
    look(tmp_path / "pull.png")
    look(tmp_path / "deformed.png")


def test_skirt(demo, tmp_path):
    said = run(demo, QUICK["skirt"], tmp_path)
    assert "dressed in" in said and "folds of a hem" in said and (tmp_path / "worn.npz").exists()
    table = read(tmp_path / "history.csv")
    assert (table["crossed"] == 0).all() and (table["hem_outer_m"] > table["hem_inner_m"]).all()
    look(tmp_path / "deformed.png")


@pytest.mark.slow
@pytest.mark.parametrize("name", WHOLE)
def test_whole_demos_meet_their_numbers(demo, tmp_path, name):
    run(demo, WHOLE[name], tmp_path)


@pytest.mark.slow
def test_two_ranks_give_the_same(demo, tmp_path):
    test_demos.on_two_ranks([
        [str(test_demos.script(name)), *words, "--out", str(tmp_path / "two" / key)]
        for key, (name, *words) in ((key, line.split()) for key, line in QUICK.items())
    ])  # fmt: skip
    for key, line in QUICK.items():
        run(demo, line, tmp_path / "one" / key)
        one, two = (read(tmp_path / ranks / key / "history.csv") for ranks in ("one", "two"))
        for column in set(one) - {"wall_s", "cpu_s", "memory_MB", "newton_iterations", "iterations"}:
            same = np.abs(np.nan_to_num(one[column] - two[column], posinf=0.0)).max()
            assert same <= 1e-4 * np.nan_to_num(np.abs(one[column]), posinf=0.0).max() + 1e-9, (key, column)
