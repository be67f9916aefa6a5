"""A sleeve and a trousers' leg on limbs that bend: what the wearer pays is what the cloth stores, and no more."""

import numpy as np
import pytest
import test_demos

from fabric_fenicsx.surfaces import meshing

demo, read, look = test_demos.demo, test_demos.read, test_demos.look
QUICK = "--fabric soft --ease 0 --friction 0 --angle 6 --step 2 --cell 45 --skin 25 --reach 2 --stiffness 100"


@pytest.mark.parametrize("name, length", [("elbow.py", "0.18"), ("knee.py", "0.25")])
def test_an_elastic_cloth_without_friction_gives_back_what_it_takes(demo, tmp_path, name, length):
    status, said, _ = demo(name, *QUICK.split(), "--length", length, "--out", tmp_path)
    table = read(tmp_path / "soft_0" / "history.csv")
    assert status == 0 and "or is lost without friction, hysteresis or snaps: yes" in said
    work, stored, most = table["work_J"], table["stored_J"], table["work_J"].max()
    assert table["angle_deg"] == pytest.approx([0, 2, 4, 6, 4, 2, 0]) and (np.diff(work[:4]) > 0.0).all()
    assert work == pytest.approx(stored, abs=0.01 * most) and abs(work[-1]) < 0.01 * most
    assert table["moment_Nm"][0] == pytest.approx(0.0, abs=1e-3 * table["moment_Nm"].max())
    assert table["strain_skin"][3] > 0.01 and table["pressure_peak_Pa"].min() > 0.0
    look(tmp_path / "moment.png")
    look(tmp_path / "soft_0" / "deformed.png")


def test_a_taut_sleeve_gives_back_what_it_takes_and_pulls_the_forearm_by_its_hem(demo, tmp_path):
    """Held at both ends, with work at the hem, too; drawn along less, it pulls less."""
    words = "--fabric soft --ease -20 --friction 0 --angle 15 --step 5 --cell 30 --skin 16 --reach 3 --stiffness 100"
    moments = []
    for stretch in ("20", "40"):
        status, said, _ = demo("elbow.py", *words.split(), "--length", "0.3", "--stretch", stretch, "--out", tmp_path)
        table = read(tmp_path / "soft_-20" / "history.csv")
        work, stored, most = table["work_J"], table["stored_J"], table["work_J"].max()
        assert status == 0 and "nothing passes through the skin" in said and (np.diff(work[:4]) > 0.0).all()
        assert work == pytest.approx(stored, abs=0.01 * most) and abs(work[-1]) < 0.01 * most
        assert table["moment_Nm"][[0, 6]] == pytest.approx(0.0, abs=0.02 * table["moment_Nm"].max())
        moments.append(table["moment_Nm"][3])
    assert moments[1] > 1.1 * moments[0] > 0.0


@pytest.mark.slow
def test_two_ranks_bend_the_same_sleeve(demo, tmp_path):
    words = [*QUICK.split(), "--length", "0.18"]
    demo("elbow.py", *words, "--out", tmp_path / "one")
    script = str(test_demos.script("elbow.py"))
    test_demos.on_two_ranks([[script, *words, "--out", str(tmp_path / "two")]])
    one, two = (read(tmp_path / ranks / "soft_0" / "history.csv") for ranks in ("one", "two"))
    for column in ("moment_Nm", "work_J", "stored_J", "pressure_peak_Pa", "strain_cloth", "slip_max_m"):
        assert two[column] == pytest.approx(one[column], abs=1e-6 * np.abs(one[column]).max())


@pytest.mark.slow
def test_a_shirt_is_dressed_onto_a_torso_that_bears_its_weight(demo, tmp_path):
    status, said, _ = demo("tshirt.py", "--cell", "60", "--skin", "40", "--reach", "3", "--out", tmp_path)
    table = read(tmp_path / "history.csv")
    assert status == 0 and "bears the weight: yes" in said and table["relaxed"][-1] == 1.0
    assert not table["crossed"].any() and table["pressed_m2"][-1] > 0.0
    look(tmp_path / "worn.png")


def test_another_body_is_told_its_arm(demo, tmp_path):
    status, _, error = demo("tshirt.py", "--body", meshing.MESHES / "bag.obj", "--out", tmp_path)
    assert status != 0 and "tell the places of --joint and --elbow" in error


def test_moments_on_half_the_cells_are_told(demo, tmp_path):
    words = *QUICK.split(), "--length", "0.18", "--converge", "--about", "4", "2", "--out", tmp_path
    status, said, _ = demo("elbow.py", *words)
    moments = []
    for cell in (45, 22.5):
        table = read(tmp_path / f"soft_0_{cell:g}" / "history.csv")
        angle, work = table["angle_deg"], table["work_J"]
        assert angle == pytest.approx([0, 2, 4, 6])
        moments.append((table["moment_Nm"][2], (work[3] - work[1]) / np.radians(4)))
    at, mean = np.array(moments[0]) / moments[1] - 1
    assert f"at 4 degrees is {100 * at:+.1f} % off, and its mean within 2 degrees of them {100 * mean:+.1f} %" in said
    assert status == int(max(abs(at), abs(mean)) > 0.05) and f"5 % at most: {'NO' if status else 'yes'}" in said
    status, _, error = demo("elbow.py", *words[:-4], "9", "2", "--out", tmp_path)
    assert status != 0 and "--angle 11 at least" in error
