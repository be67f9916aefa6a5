"""Short runs of every case of demos/studies/shell_benchmarks.py: coarse meshes, whose errors are known, few steps."""

import csv
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from matplotlib import image

from fabric_fenicsx import sheet

DEMOS = Path(__file__).resolve().parent.parent / "demos" / "studies"


@pytest.fixture
def cases(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import shell_cases

    return shell_cases


@pytest.fixture
def settings_of(monkeypatch):
    """Makes the settings of a case."""
    monkeypatch.syspath_prepend(DEMOS)
    import shell_model

    return shell_model.Settings


@pytest.fixture
def studies(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import shell_studies

    return shell_studies


def worst(case):
    """The largest error over steps and displacements, as a part of the tolerance of the whole case."""
    table, stopped = case.run()
    assert stopped is None and len(table.rows) == len(case.loads)
    return max(np.nanmax(part) for part in case.errors(table).values())


# measured: what these meshes give, in parts of the tolerance that the case keeps on its own mesh
@pytest.mark.parametrize(
    "name, measured, settings",
    [
        ("end_shear", 1.061, {"cells": 8, "steps": 10}),
        ("end_shear", 1.249, {"cells": 16, "steps": 10, "element": "mitc4", "thickness": 1e-3, "skew": 0.25}),
        ("roll_up", 2.644, {"cells": 16, "steps": 10}),
        ("roll_up", 4.963, {"cells": 32, "steps": 12, "turns": 3}),
        ("slit_annulus", 3.456, {"cells": 3, "steps": 4}),
        ("pullout_cylinder", 7.805, {"cells": 8, "steps": 20}),
        ("pinched_semicylinder", 0.884, {"cells": 16, "steps": 10}),
        ("pinched_tube", 3.574, {"cells": 8}),
        ("scordelis_lo", 0.583, {"cells": 6}),
        ("pinched_cylinder", 13.42, {"cells": 12}),
        ("hemisphere", 0.296, {"cells": 10}),
        ("heavy_elastica", 4.874, {"cells": 16, "steps": 14, "thickness": 1e-3}),
    ],
)
def test_a_coarse_mesh_is_as_good_as_it_was(cases, settings_of, name, measured, settings):
    assert worst(cases.CASES[name](settings_of(**settings))) <= 1.02 * measured


def test_errors_are_taken_where_the_table_has_a_value(cases):
    """Seven steps hit the table of 20 only at the end; the bar of the scale and tolerance is that of the step."""
    loads, (W,) = cases.at(np.array([0, 0.5, 1.0]), (np.array([0, 5.0, 7.0]),), 7)
    assert len(loads) == 7 and np.isnan(W[:-1]).all() and W[-1] == 7.0
    loads, (W,) = cases.at(np.array([0, 0.5, 1.0]), (np.array([0, 5.0, 7.0]),), None)
    assert loads.tolist() == [0.5, 1.0] and W.tolist() == [5.0, 7.0]


def test_thin_and_skewed(studies, settings_of):
    """At h/L = 1e-5 the thesis's bilinear element has lost 45 % of its deflection, and the default nothing."""
    rows = {element: studies.bent(settings_of(element, 16, 1e-4, 0.25, 20)) for element in ("regge", "q1")}
    assert abs(rows["regge"]["W_tip_error_percent"]) < 0.1
    assert rows["q1"]["W_tip_error_percent"] == pytest.approx(-44.56, abs=0.1)


def test_the_largest_step_is_the_one_before_the_first_cut(studies, settings_of):
    """One step to all of the load fails; two do not."""
    reached = [studies.bent(settings_of("regge", 16, 0.1, 0.0, n), smallest=1.0)["load_reached"] for n in (1, 2)]
    assert reached == [0.0, 1.0]


def test_cost_is_split(studies):
    row = studies.cost_row("q1", "elastic", 3, repeats=2)
    parts = [row[name] for name in studies.PARTS]
    assert min(parts) > 0 and sum(parts) == pytest.approx(row["sum"])


@pytest.fixture
def demo(monkeypatch, capsys, tmp_path):
    """Runs the demo as from the command line: its status and what it wrote to the two streams."""
    monkeypatch.syspath_prepend(DEMOS)

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["shell_benchmarks.py", *words, "--out", str(tmp_path)])
        with pytest.raises(SystemExit) as end:
            runpy.run_path(str(DEMOS / "shell_benchmarks.py"), run_name="__main__")
        return end.value.code, *capsys.readouterr()

    return run


@pytest.mark.parametrize("cells, status", [("16", 0), ("8", 1)])
def test_the_demo_ends_in_a_verdict(demo, tmp_path, cells, status):
    found, said, _ = demo("--case", "end_shear", "--cells", cells, "--steps", "5")
    assert found == status and f"case: {'yes' if status == 0 else 'NO'};" in said
    with open(tmp_path / "end_shear" / "history.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["load_fraction"]) for row in rows] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert {"minus_U_tip", "W_tip", "W_tip_reference", "newton_iterations", "step_cuts", "wall_s"} <= set(rows[0])
    assert image.imread(tmp_path / "end_shear" / "curves.png").std() > 0.05
    with open(tmp_path / "summary.csv", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["verdict"] == ("within" if status == 0 else "MISSED")


def test_a_step_that_does_not_converge_is_a_miss(cases, settings_of, demo, monkeypatch):
    """What was reached is said, and nothing passes that was not computed."""
    run = cases.Case.run
    monkeypatch.setattr(cases.Case, "run", lambda case, *a, **k: run(case, *a, **k, smallest=1.0))
    few, solver = {"snes_max_it": 3}, sheet.Sheet.equilibrium
    monkeypatch.setattr(sheet.Sheet, "equilibrium", lambda own, bcs, loads, **k: solver(own, bcs, loads, options=few))
    status, said, _ = demo("--case", "end_shear", "--cells", "16", "--steps", "1")
    assert status == 1 and "Step 1 stopped" in said and "MISSED" in said


@pytest.mark.parametrize(
    "words, sentence",
    [
        (["--thickness", "0"], "not a positive number"),
        (["--skew", "0.5"], "would fold"),
        (["--case", "hemisphere", "--skew", "0.1"], "Only strips"),
        (["--case", "hemisphere", "--element", "mitc9"], "invalid choice"),
        (["--case", "sphere"], "invalid choice"),
        (["--turns", "2"], "invalid choice"),
        (["--cells", "0"], "at least 1"),
    ],
)
def test_a_wrong_word_is_answered_in_one_sentence(demo, words, sentence):
    status, _, complaint = demo(*words)
    assert status == 2 and sentence in complaint.splitlines()[-1] and "Traceback" not in complaint


@pytest.mark.parallel
@pytest.mark.parametrize("name, settings", [("roll_up", {"cells": 12, "steps": 8}), ("scordelis_lo", {"cells": 4})])
def test_ranks_agree(cases, settings_of, name, settings):
    """One process against all of them: a rolled-up strip, and a curved sheet between planes of symmetry."""
    tables = [cases.CASES[name](settings_of(**settings), comm).run()[0] for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)]
    for label in cases.CASES[name](settings_of(**settings), MPI.COMM_SELF).probes:
        alone, together = (table.column(label) for table in tables)
        assert together == pytest.approx(alone, rel=1e-8, abs=1e-8 * np.abs(alone).max())
