"""The studies in their quick form: what they find, and the files that they leave."""

import argparse
import csv
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem
from dolfinx import mesh as dmesh
from matplotlib import image
from petsc4py import PETSc

DEMOS = Path(__file__).resolve().parent.parent / "demos" / "studies"


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


@pytest.mark.slow
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


def test_stability_of_contact_and_bending(study):
    status, _, rows = study("stability", "--quick", "--only", "contact_steps", "bending")
    assert status == 0 and "impact takes" in rows[0]["said"]
    assert [row["verdict"] for row in rows[1:]] == ["works", "works"]


def test_parts_of_an_iteration_add_up(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(DEMOS)
    import iteration

    row = iteration.measured(10, argparse.Namespace(end=0.02, also=["--bending", "layers"]))
    named = [row[part] for part in ("law", "element stiffness", "sum of the matrix", "directors", "factors", "ledger")]
    assert min(named) > 0 and row["rest"] > -0.01 * row["us_each"] and sum(named) < row["us_each"]


def test_the_gap_decides_the_error_of_a_lifted_strip(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import error_cases

    case = error_cases.CASES["lift"][0](quick=True)
    force = [error_cases.go("lift", s, error_cases.build("lift", s))
             for s in (case.coarser, case.base, case.base | {"reach": 1.6})]  # fmt: skip
    near, far = (np.abs(f / force[0] - 1).max() for f in force[1:])
    assert near < 0.01 and 2 * near < far < 0.05


@pytest.mark.slow
def test_error_vs_runtime(study):
    cases = ("lift", "point", "strip", "end_shear_0.0001", "drape")
    status, said, rows = study("error_vs_runtime", "--quick", "--case", *cases)
    assert status == 0 and "one within 10 % in every case: yes" in said
    error = {(row["case"], row["setting"]): float(row["error"]) for row in rows}
    assert all(float(row["cpu_s"]) > 0 and float(row["wall_s"]) > 0 for row in rows)
    # the printed law takes its modulus at the end of an increment, and is of first order
    printed = [error["point", f"printed, {n} steps"] for n in (5, 20)]
    assert 2 < printed[0] / printed[1] < 6 and error["point", "continuous, 20 steps"] < 1e-3 * printed[1]
    shear = [error["end_shear_0.0001", f"regge, {n} cells, 5 steps"] for n in (4, 16)]
    assert shear[1] < shear[0] / 4 < 0.01
    assert "drape" in {row["case"] for row in rows if row["pareto"] == "True"}


def test_front_and_cheapest_setting(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import error_vs_runtime as study

    cost, error = np.array([1.0, 2.0, 3.0, 4.0, 0.1, 2.0]), np.array([0.05, 0.5, 0.002, 0.002, np.inf, 0.009])
    assert study.front(cost, error).tolist() == [True, False, True, False, False, True]
    rows = [{"cpu_s": c, "error": e} for c, e in zip(cost, error, strict=True)]
    assert [row and row["cpu_s"] for row in study.cheapest(rows, 1e-4).values()] == [1.0, 2.0, None]
    assert study.cheapest(rows, 0.05) == {0.1: rows[0], 0.01: None, 0.001: None}
    assert study.apart(None, np.ones(2)) == np.inf and study.apart(np.array([1.0, 3.0]), np.array([1.0, 4.0])) == 0.25


def test_the_cost_of_contact_is_told(monkeypatch, tmp_path, capsys):
    monkeypatch.syspath_prepend(DEMOS)
    words = ["--cells", "4", "--end", "0.03", "--laws", "elastic", "--stack", "3", "--lying", "0.02"]
    monkeypatch.setattr(sys, "argv", ["contact_cost", *words, "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(DEMOS / "contact_cost.py"), run_name="__main__")
    assert end.value.code == 0 and "times the Newton iterations a step of the drape" in capsys.readouterr().out
    with open(tmp_path / "contact_cost.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    shares = [float(row["contact_percent"]) for row in rows]
    assert len(rows) == 5 and all(0.0 < share < 100.0 for share in shares[::2]) and shares[1] == shares[3] == 0.0


def test_the_search_of_pairs_is_timed_on_sheets_that_grow(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    monkeypatch.syspath_prepend(DEMOS.parent)
    import contact_cost

    few, many = (contact_cost.found(cells) for cells in (8, 16))
    assert few["triangles"] == 256 and many["triangles"] == 1024 and many["cpu_s"] > 0.0
    # each node of a sheet is above a triangle of the other
    assert few["pairs"] > 2 * 81 and 3.5 < many["pairs"] / few["pairs"] < 4.6


def test_numbers_whose_errors_shrink_by_one_factor_are_extrapolated(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import error_vs_runtime as study

    limit, error = np.array([3.0, -2.0]), np.array([0.1, 0.4])
    meshes = [limit + error * factor**k for k in range(3) for factor in [np.array([0.5, 0.3])]]
    assert study.extrapolated(*meshes) == pytest.approx(limit, rel=1e-12)
    strip = {"law": "potential", "degree": 2, "steps": 1, "rtol": 1e-6}
    once = study.once("strip", strip | {"cells": 4, "way": "extrapolated"})
    runs = [study.once("strip", strip | {"cells": n}) for n in (1, 2, 4)]
    assert once[0] == pytest.approx(study.extrapolated(*(run[0] for run in runs)), rel=1e-12)
    assert len(once) == 4 and min(once[1:]) > 0.0


def test_the_base_of_a_study_is_the_default_of_its_demo(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    monkeypatch.syspath_prepend(DEMOS.parent)
    monkeypatch.setattr(sys, "argv", ["demo"])
    import drape
    import error_cases
    import poke
    import tensile

    for demo in drape, poke:
        base, args = error_cases.CASES[demo.__name__][0](quick=False).base, demo.arguments()
        assert base == {"element": args.element, "cells": args.cells, "ms": args.step, "layers": args.layers,
                        "rtol": args.rtol, "method": args.method, "ranks": 1, "solver": args.solver}  # fmt: skip
    args = tensile.arguments()
    tried = error_cases.CASES["strip"][0](quick=False).settings
    assert any(args.cells == (3 * s["cells"], s["cells"]) and args.degree == s["degree"] for s in tried)


def test_what_many_ranks_gain_is_predicted_from_counts(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import rank_model

    work, messages, length, reductions = 1e-5, 30.0, 1e6, 5.0
    counts = rank_model.Counts(4, 4000, 0.0, messages, length, reductions, neighbours=3, linear_iterations=1.0)
    assumed = {"latency": 2e-6, "bandwidth": 1e10}
    # 16 parts as large as those of the four, with eight neighbours and four sides
    seconds, share = rank_model.predicted(work, counts, 16000, 16, **assumed)
    talk = 2e-6 * (80.0 + 2 * 5 * 4) + 2e6 / 1e10
    assert seconds == pytest.approx(1e-2 + talk, rel=1e-12) and share == pytest.approx(talk / seconds, rel=1e-12)
    assert rank_model.efficiency(work, counts, 16000, 16, **assumed) == pytest.approx(1e-2 / seconds, rel=1e-12)
    # sides are half as long in a quarter of the unknowns
    quarter, _ = rank_model.predicted(work, counts, 4000, 16, **assumed)
    assert quarter == pytest.approx(2.5e-3 + talk - 1e6 / 1e10, rel=1e-12)
    assert rank_model.predicted(work, counts, 4000, 1) == (0.04, 0.0)
    assert rank_model.efficiency(work, counts, 4000, 512, latency=0.0, bandwidth=np.inf) == pytest.approx(1.0)


@pytest.mark.parallel
def test_messages_and_sums_of_a_rank_are_counted(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS)
    import rank_model

    domain = dmesh.create_unit_square(MPI.COMM_WORLD, 4, 4)
    u = fem.Function(fem.functionspace(domain, ("Lagrange", 1, (2,))))
    ghosts = u.function_space.dofmap.index_map
    v = u.x.petsc_vec.duplicate()
    PETSc.Log.begin()
    with rank_model.Counter() as counter:
        assert domain.comm.allreduce(1) == MPI.COMM_WORLD.size
        u.x.scatter_forward()
        v.dot(v)
    assert counter.messages == len(set(ghosts.owners)) and counter.bytes == 16 * ghosts.num_ghosts
    assert counter.reductions == 2
    domain.comm.allreduce(1)
    assert counter.reductions == 2
