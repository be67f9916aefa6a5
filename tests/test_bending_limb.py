"""A sleeve and a trousers' leg on limbs that bend: what the wearer pays is what the cloth stores, and no more."""

import numpy as np
import pytest
import test_demos

from fabric_fenicsx.surfaces import meshing

demo, read, look = test_demos.demo, test_demos.read, test_demos.look
QUICK = "--fabric soft --ease 0 --friction 0 --angle 6 --step 2 --cell 45 --skin 25 --reach 3"


@pytest.mark.parametrize("name, length", [("elbow.py", "0.18"), ("knee.py", "0.25")])
def test_an_elastic_cloth_without_friction_gives_back_what_it_takes(demo, tmp_path, name, length):
    status, said, _ = demo(name, *QUICK.split(), "--length", length, "--out", tmp_path)
    table = read(tmp_path / "soft_0" / "history.csv")
    assert status == 0 and "and at most 1 % of the work comes from nowhere: yes" in said
    work, stored, most = table["work_J"], table["stored_J"], table["work_J"].max()
    assert table["angle_deg"] == pytest.approx([0, 2, 4, 6, 4, 2, 0]) and (np.diff(work[:4]) > 0.0).all()
    assert work == pytest.approx(stored, abs=0.01 * most) and abs(work[-1]) < 0.01 * most
    assert table["moment_Nm"][0] == pytest.approx(0.0, abs=1e-3 * table["moment_Nm"].max())
    assert table["strain_skin"][3] > 0.01 and table["pressure_peak_Pa"].min() > 0.0
    look(tmp_path / "moment.png")
    look(tmp_path / "soft_0" / "deformed.png")


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
