"""The studies in their quick form: what they find, and the files that they leave."""

import csv
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image

DEMOS = Path(__file__).resolve().parent.parent / "demos"


@pytest.fixture
def study(monkeypatch, capsys, tmp_path):
    """Runs a script in this process: its status, its lines and the rows of its CSV file."""
    monkeypatch.syspath_prepend(DEMOS)

    def run(name, *words):
        monkeypatch.setattr(sys, "argv", [name, "--out", str(tmp_path), *words])
        with pytest.raises(SystemExit) as end:
            runpy.run_path(str(DEMOS / f"{name}.py"), run_name="__main__")
        assert len(np.unique(image.imread(tmp_path / f"{name}.png")[::3, ::3, :3] @ [1, 300, 90000])) > 20
        with open(tmp_path / f"{name}.csv", newline="") as file:
            return end.value.code, capsys.readouterr().out, list(csv.DictReader(file))

    return run


def test_lean_scenes(study):
    _, said, rows = study("lean_scenes", "--quick")
    assert "nothing is paid for that is not used: yes" in said
    # of the time by hand; the script asks for 1.1, which a machine that does other things may miss
    assert float(said.split("ratio ")[1].split()[0]) < 1.5
    rows = {row["feature"]: row for row in rows}
    hook, shear = rows["hook at all"], rows["hysteresis in shear"]
    assert hook["history_bytes"] == hook["history_bytes_with"] == "0"
    assert int(hook["kernels_with"]) == int(hook["kernels"]) + 1  # the strain at the points
    points = 18 * 12 * 4
    # eight numbers a point, and two of shear, committed and trial
    assert int(shear["history_bytes"]) == 2 * 8 * 8 * points
    assert int(shear["history_bytes_with"]) == 2 * 8 * 10 * points


def test_stability(study):
    status, said, rows = study("stability", "--quick", "--only", "poisson", "slack")
    assert status == 0 and "every trial ends as it must: yes" in said
    assert [row["verdict"] for row in rows] == ["works", "refused", *["works"] * 4]
