"""The demos in motion: their checked numbers, their files, and the same answer on two ranks."""

import numpy as np
import pytest
import test_demos

demo, read = test_demos.demo, test_demos.read
COLUMNS = {"time_s", "newton_iterations", "step_cuts", "kinetic_J", "recoverable_J", "dissipated_J"}
COLUMNS |= {"external_work_J", "imbalance_J", "wall_s"}


def files(folder):
    """The history of a run, which has the agreed columns; fields, checkpoint and pictures are there."""
    table = read(folder / "history.csv")
    assert set(table) >= COLUMNS
    assert (folder / "fields.pvd").exists() and (folder / "checkpoint.npz").exists()
    test_demos.look(folder / "energy.png")
    test_demos.look(folder / "deformed.png")
    return table


@pytest.mark.slow
def test_pendulum(demo, tmp_path):
    status, said, _ = demo("pendulum.py", "--angle", "120", "--step", "5", "--out", tmp_path)
    table = files(tmp_path / "120_degrees")
    assert status == 0 and ": yes;" in said
    angle = table["angle_deg"]
    assert angle[0] == pytest.approx(120, abs=1) and angle.min() == pytest.approx(-120, abs=1)
    # all that the weight has done is speed
    assert np.allclose(table["kinetic_J"], table["external_work_J"], atol=2e-3 * table["kinetic_J"].max())


def test_free_plate(demo, tmp_path):
    status, said, _ = demo("pendulum.py", "--free", "--steps", "60", "--out", tmp_path)
    table = files(tmp_path)
    assert status == 0 and ": yes;" in said and len(table["time_s"]) == 60
    start = np.array([table[f"angular_momentum_{axis}_Nms"][0] for axis in "xyz"])
    # of a thin square plate in the plane z = 0, and of its flight about the origin
    mass, inertia = 5.0, 5.0 * 0.25 / 12 * np.array([1, 1, 2]) + 5.0 * 0.02**2 / 12 * np.array([1, 1, 0])
    expected = inertia * (2.0, 6.0, 3.0) + mass * np.cross([0.25, 0.25, 0.0], (0.3, 0.0, 0.1))
    assert start == pytest.approx(expected, rel=1e-2)


@pytest.mark.slow
def test_hanging_strip(demo, tmp_path):
    status, said, _ = demo("hanging_strip.py", "--modes", "2", "--cells", "20", "--points", "40", "--out", tmp_path)
    assert status == 0 and ": yes;" in said
    for mode in (1, 2):
        end = files(tmp_path / f"mode_{mode}")["end_x_m"]
        assert end.min() == pytest.approx(-end.max(), rel=0.05)


def test_explicit_poke_is_accounted_for_from_its_first_steps(demo, tmp_path):
    """The plunger starts at full acceleration, and all that has been done after 35 steps is 13 mJ."""
    words = ["--cells", "10", "--method", "explicit", "--step", "20", "--end", "0.02", "--out", tmp_path]
    assert demo("poke.py", *words)[0] == 0


def test_explicit_and_implicit_drapes_agree(demo, tmp_path):
    words = ["drape.py", "--cells", "4", "--isotropic", "8e5,0.25", "--patch", "0.5", "--end", "0.2"]
    other = ["--against", tmp_path / "explicit" / "history.csv", "--out", tmp_path / "implicit"]
    assert demo(*words, "--method", "explicit", "--out", tmp_path / "explicit")[0] == 0
    status, said, _ = demo(*words, "--lumped", "--step", "2.5", *other)
    assert status == 0 and "apart: yes;" in said
    # a consistent mass is another sheet on so few cells
    status, said, _ = demo(*words, *other)
    assert status == 1 and "apart: NO;" in said


@pytest.mark.slow
def test_cost_is_told_and_ranks_agree(demo, tmp_path):
    also = ["--", "--isotropic", "8e6,0.25"]
    status, said, _ = demo(
        "scaling.py", "--cells", "10", "20", "--ranks", "1", "2", "--end", "0.01", "--out", tmp_path, *also
    )
    assert status == 0 and "until 0.25 s: yes" in said
    table = np.genfromtxt(tmp_path / "scaling.csv", delimiter=",", names=True)
    assert list(table["unknowns"]) == [6 * 11**2] * 2 + [6 * 21**2] * 2 and (tmp_path / "scaling.png").exists()
    assert min(table["cpu_ms"]) > 0


@pytest.mark.slow
def test_solvers_of_linear_systems_are_compared(demo, tmp_path):
    words = ["--cells", "10", "--solver", "direct", "iterative", "--end", "0.01", "--out", tmp_path]
    status, said, _ = demo("scaling.py", *words, "--", "--isotropic", "8e6,0.25")
    assert status == 0 and "times as fast as direct on 1" in said and "until 0.25 s: yes" in said
    table = np.genfromtxt(tmp_path / "scaling.csv", delimiter=",", names=True)
    assert 1 <= table["linear_iterations"][0] < table["linear_iterations"][1] < 10
    words = ["--thickness", "1e-2", "1e-4", "--cells", "6", "--out", tmp_path]
    status, said, _ = demo("scaling.py", *words)
    table = np.genfromtxt(tmp_path / "thickness.csv", delimiter=",", names=True)
    assert status == 0 and "solvers agree to 1e-3" in said and len(table) == 8
    assert (table["iterations"] > 1).all() and (table["apart"] > 0).all()


@pytest.mark.parametrize(
    ("name", "words", "reason"),
    [
        ("drape.py", "--against {folder}/none.csv", "cannot be read"),
        ("drape.py", "--method explicit --rotary none --cells 4", "directors with inertia"),
        ("pendulum.py", "--angle 180", "between 0 and 180"),
        ("pendulum.py", "--rho 2", "rho must be"),
        ("hanging_strip.py", "--modes 0", "0 is not a whole number of at least 1"),
        ("drape.py", "--cells 5", "take an even number"),
        ("scaling.py", "--cells 12", "take multiples of 10"),
        ("drape.py", "--resume {folder}/none.npz", "No such file"),
    ],
)
def test_bad_input_is_answered_in_a_sentence(demo, tmp_path, name, words, reason):
    words = words.format(folder=tmp_path).split()
    status, said, complaint = demo(name, *words, "--out", tmp_path / "out")
    assert status == 2 and ": yes;" not in said and "Traceback" not in complaint
    assert "error: " in complaint and reason in complaint


@pytest.mark.slow
def test_two_ranks_give_the_same(demo, tmp_path):
    """The drape of fabric until after the start of its fall, a swing, and a flight."""
    runs = {
        "drape": (["drape.py", "--cells", "4", "--end", "0.05"], "", "centre_z_m"),
        "swing": (["pendulum.py", "--angle", "60", "--step", "10"], "60_degrees", "angle_deg"),
        "flight": (["pendulum.py", "--free", "--steps", "20"], "", "angular_momentum_x_Nms"),
        "strip": (["hanging_strip.py", "--modes", "1", "--cells", "10", "--points", "20"], "mode_1", "end_x_m"),
    }
    commands = [
        [str(test_demos.script(name)), *words, "--out", str(tmp_path / "two" / key)]
        for key, ((name, *words), *_) in runs.items()
    ]
    test_demos.on_two_ranks(commands)
    for key, ((name, *words), folder, probe) in runs.items():
        assert demo(name, *words, "--out", tmp_path / "one" / key)[0] == 0
        one, two = (read(tmp_path / ranks / key / folder / "history.csv") for ranks in ("one", "two"))
        for column in (probe, "kinetic_J", "external_work_J"):
            assert np.abs(one[column] - two[column]).max() <= 1e-6 * np.abs(one[column]).max(), (key, column)


def test_sphere(demo, tmp_path):
    status, said, _ = demo("sphere.py", "--cells", "8", "--end", "0.15", "--out", tmp_path)
    table = files(tmp_path)
    assert status == 0 and ": yes;" in said
    assert table["ball_z_N"].min() < -1.0 and table["friction_J"][-1] > 0.0 and (table["crossed"] == 0).all()


def test_ball_drop(demo, tmp_path):
    words = ["--law", "svk", "--cells", "10", "--ball-cells", "3", "--step", "2", "--end", "0.06"]
    status, said, _ = demo("ball_drop.py", *words, "--out", tmp_path)
    table = files(tmp_path)
    assert status == 0 and ": yes;" in said
    assert table["ball_z_m"].min() < -0.03 and table["ball_z_N"].max() > 10.0


@pytest.mark.slow
def test_balls_of_other_masses_heights_and_on_other_fabrics(demo, tmp_path):
    words = ["--study", "--cells", "10", "--ball-cells", "4", "--end", "0.1"]
    status, said, _ = demo("ball_drop.py", *words, "--out", tmp_path)
    assert status == 0 and said.count("good True") == 10
    test_demos.look(tmp_path / "study.png")
