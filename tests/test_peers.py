"""The study of other programs: what they are given is the same sheet, and their answers are read rightly."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fabric_fenicsx.surfaces import meshing

DEMOS = Path(__file__).resolve().parent.parent / "demos"


@pytest.fixture
def peers(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS / "studies")
    import peers

    return peers


def test_the_input_of_calculix_is_the_sheet_of_the_drape(peers, tmp_path):
    text = peers.calculix_input(10)
    (tmp_path / "drape.inp").write_text(text)
    domain = meshing.read(tmp_path / "drape.inp", MPI.COMM_SELF)
    assert len(domain.mesh.geometry.x) == 121 and domain.mesh.topology.index_map(2).size_local == 100
    assert np.ptp(domain.mesh.geometry.x, axis=0) == pytest.approx([2.0, 2.0, 0.0])
    fixed = [int(line.split(",")[0]) - 1 for line in text.split("*BOUNDARY\n")[1].split("\n*")[0].splitlines()]
    own = meshing.read(meshing.MESHES / "drape.geo", MPI.COMM_SELF, side=2.0, n=10, a=peers.PATCH)
    cells = own.entities("corner_patches")[1]
    places = own.mesh.geometry.x[np.unique(own.mesh.geometry.dofmaps[0][cells])]  # of the nodes that the demo holds
    given = np.array([[node // 11, node % 11] for node in fixed]) * 0.2
    assert sorted(map(tuple, np.round(given, 6))) == sorted(map(tuple, np.round(places[:, :2], 6)))


def test_the_largest_step_is_near_its_half(peers):
    def run(step):  # an error of 2 % at 1 ms, that goes with the step squared; lost from 3 ms on
        return "", 0, 0.0, None if step > 3e-3 else [0.0, -1 - 0.02 * (step / 1e-3) ** 2]

    assert peers.largest_step(run)[0] == pytest.approx(8e-4)
    assert peers.largest_step(lambda step: ("", 0, 0.0, None if step > 4e-5 else [-1.0]))[0] == pytest.approx(2.5e-5)


@pytest.mark.skipif(not shutil.which("ccx"), reason="CalculiX is not installed")
def test_calculix_computes_the_drape(peers):
    row = peers.calculix(6)
    assert row["unknowns"] == 6 * 49 and row["lowest_z_m"] < -0.2


def test_mujoco_falls_freely_at_first(peers):
    pytest.importorskip("mujoco")
    unknowns, _, heights = peers.stepped("drape", 10, 1e-4, "Euler")[1:]
    assert unknowns == 3 * (121 - 16) and len(heights) == 5001
    assert heights[1000] == pytest.approx(-9.81 * 0.1**2 / 2, rel=2e-3)  # the centre falls freely until the wave comes
