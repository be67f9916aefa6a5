"""The report on chapter 7: its figures, its numbers, what it keeps, and what it says of a case that fails."""

import base64
import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
import test_demos

import fabric_fenicsx
from fabric_fenicsx import fabrics
from fabric_fenicsx.laws.woven import Woven

demo, DEMOS = test_demos.demo, test_demos.DEMOS
QUICK = {"7-1", "7-5", "7-10", "7-14", "7-19", "7-20", "7-27", "7-31", "7-37"}


@pytest.fixture
def cases(monkeypatch):
    monkeypatch.syspath_prepend(DEMOS / "thesis")
    from chapter7 import cases

    return cases


def answer(folder, name):
    """What the run has kept of a case; there is one answer."""
    (path,) = (folder / "cache").glob(f"{name.replace(' ', '_')}-*.json")
    return json.loads(path.read_text())["answer"]


@pytest.mark.slow
def test_the_page(demo, cases, tmp_path, monkeypatch):
    """A run with a case that fails, and another where one has changed."""
    listed = cases.listed(quick=True)
    broken = cases.Case("cycles tweed", "statics.cycles", {"fabric": "tweed", "steps": 2, "cells": [9, 3]})
    monkeypatch.setattr(cases, "listed", lambda quick: [broken, *listed])
    status, said, _ = demo("thesis.py", "--quick", "--out", tmp_path)
    page = (tmp_path / "thesis.html").read_text()
    assert status == 1 and f"{len(listed)} of {len(listed) + 1} cases have an answer (0 kept)" in said
    assert re.search(r"The case “cycles tweed” failed: [^<]*'tweed'", page), "and why the other has none"
    check_figures(page)
    check_numbers(page, tmp_path)

    # the broken one is gone, and one setting is another: that case alone runs
    changed = [
        cases.Case(c.name, c.function, c.settings | ({"steps": 5} if c.name == "shear sign blend" else {}))
        for c in listed
    ]
    monkeypatch.setattr(cases, "listed", lambda quick: changed)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").iterdir()}
    status, said, _ = demo("thesis.py", "--quick", "--out", tmp_path)
    assert status == 0 and f"({len(listed) - 1} kept)" in said and ": yes;" in said
    after = {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").iterdir()}
    assert {path: after[path] for path in before} == before and len(after) == len(before) + 1
    again = (tmp_path / "thesis.html").read_text()
    assert "tweed" not in again
    # what is kept gives the same figures
    assert re.findall(r'id="fig-7-10".*?</figure>', page) == re.findall(r'id="fig-7-10".*?</figure>', again)


def check_figures(page):
    """The page stands alone; its figures are pictures, and the others are named as left out."""
    there = set(re.findall(r'id="fig-(7-\d+)"', page))
    assert there == QUICK
    (left_out,) = re.findall(r"Without a counterpart in this run: ([^<]*)\.<", page)
    assert there | set(left_out.split(", ")) == {f"7-{k}" for k in range(1, 38)}
    sources = re.findall(r'src="([^"]*)"', page)
    assert len(sources) >= len(QUICK) - 1 and not re.search(r"https?://(?!www\.w3)", page)
    for source in sources:
        kind, data = source.removeprefix("data:image/").split(";base64,")
        picture = base64.b64decode(data)
        assert (b"<svg" in picture and b"<path" in picture) if kind == "svg+xml" else picture.startswith(b"\x89PNG")
    assert "break-inside: avoid" in page and "nan" not in re.sub(r"<[^>]*>", " ", page).lower().split()


def check_numbers(page, folder):
    """Numbers on the page are those that the cases gave."""
    blend, words = fabrics.load("blend"), re.sub(r"<[^>]*>", " ", page)
    cycles = answer(folder, "cycles blend")
    for way in "warp", "weft":
        top = cycles[f"{way} measured continuous"]["top"]
        miss = 100 * (1e-6 * top["axial_stress_MPa"] * 1e12 / getattr(blend, way).stress(top["axial_strain"]) - 1)
        assert f"Along the {way}, 27 elements read {miss:+.1f} %" in words
        assert f"{top['axial_stress_MPa']:.3f}" in words
    S12 = np.array(answer(folder, "shear sign blend")["continuous"]["history"]["shear_stress_MPa"])
    assert f"to {S12.max():.3f} MPa" in words and f"{S12.min():.3f} MPa" in words
    loop = answer(folder, "loops blend")["measured measured"]
    assert f"makes {loop['share']:.3g} times what it stores" in words and loop["gap"] < 1e-9
    fall = answer(folder, "drape continuous blend")
    assert f"{fall['history']['centre_z_m'][-1]:.3f}" in words and f"{fall['imbalance_percent']:.2f} %" in words
    assert "8 + 826 E" in words and "Every row of Table 7.1 that is shown is reproduced" in words
    laws, strips = answer(folder, "laws blend"), answer(folder, "clamped blend")
    assert f"{laws['continuous']['loop']['share']:.2g} times what is stored" in words
    assert abs(laws["potential"]["warp"]["misfit_percent"]) < 1e-8 and laws["potential"]["loop"]["share"] < 1e-12
    assert set(strips) == {f"{way} {law}" for way in ("warp", "weft") for law in ("printed", "continuous", "potential")}
    assert "44 % at 0.3" in words, "what the thesis says itself"


def test_what_the_thesis_prints_is_what_the_fabrics_hold():
    """Tables 7.1 and 7.3 twice, by hand: as the report quotes them and as the package reads them."""
    said = tomllib.loads((DEMOS / "thesis" / "chapter7" / "printed.toml").read_text())
    for name in fabrics.names():
        given, yarns, shear = fabrics.load(name), said["table_7_1"][name], said["table_7_3"][name]
        for way in "warp", "weft":
            curve, modulus = getattr(given, way), yarns[way]
            assert np.allclose(curve.modulus, 1e6 * np.pad(modulus, (0, 4 - len(modulus))))
            assert curve.unloading == pytest.approx(1e6 * yarns[f"{way}_unloading"])
        assert np.allclose(given.shear.modulus, 1e6 * np.array(shear["loading"]) / 2.0 ** np.arange(1, 5))
        assert given.shear.unloading == pytest.approx(0.5e6 * shear["unloading"])
        assert given.poisson["measured"] == (said["table_7_2"][name]["nu12"], said["table_7_2"][name]["nu21"])


def test_a_case_changes_with_the_code_that_it_uses(cases, tmp_path):
    """The key sees an edit of a demo that a case uses, if only through another one, and of no other demo."""
    folder = tmp_path / "demos"
    shutil.copytree(DEMOS, folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(DEMOS.parent / "meshes", tmp_path / "meshes")
    rooms = ("statics", "motion", "points")

    def codes():
        cases.code.cache_clear()
        return np.array([cases.code(room, folder) for room in rooms])

    before = codes()
    assert list(before) == [cases.code(room) for room in rooms], "the copy is the same code"
    for file, changed in (
        ("tensile.py", [True, True, False]),  # motion draws with statics
        ("moving.py", [False, True, False]),
        ("thesis/closed_loops.py", [False, False, True]),
        ("thesis/thesis.py", [False, False, False]),
        ("../meshes/strip.geo", [True, True, True]),
        ("my_law.py", [False, False, False]),
    ):
        path = folder / file
        text = path.read_text()
        path.write_text(text + "\n")
        assert list(codes() != before) == changed, file
        path.write_text(text)
    package = Path(fabric_fenicsx.__file__).parent
    seen = {room: set() for room in rooms}
    for room in rooms:
        wanted = [DEMOS / "thesis" / "chapter7" / f"{room}.py"]
        while wanted:
            file = wanted.pop()
            if file.exists() and file not in seen[room]:
                seen[room].add(file)
                wanted += cases._imported(file, (DEMOS / "thesis", DEMOS, package.parent))
    assert {package / "laws" / "kernels.py", package / "fabrics" / "reading.py"} <= set.intersection(*seen.values())
    assert (
        DEMOS / "moving.py" in seen["motion"] - seen["statics"] and package / "terms" / "hook.py" not in seen["points"]
    )
    assert package / "app" / "doctor.py" not in set.union(*seen.values())
    case = cases.Case("a", "points.loops", {"trials": 1})
    assert case.key == cases.Case("b", "points.loops", {"trials": 1}).key != cases.Case("a", "points.loops", {}).key


class Linear:
    """S = C E of a C without symmetry, which stores nothing."""

    initial_state = np.empty(0)

    def respond(self, strain, state):
        return strain @ np.array([[5.0, 3.0, 0.0], [1.0, 4.0, 0.0], [0.0, 0.0, 1.0]]).T, None, state

    def recoverable(self, strain, state):
        return np.zeros(len(strain))


def test_what_a_loop_makes(monkeypatch):
    """Round a loop of the area A the work is (C21 - C12) A (Green); gone round the other way, its opposite."""
    monkeypatch.syspath_prepend(DEMOS / "thesis")
    import closed_loops

    ellipse = [0.3, 0.2, 0.1, 0.05, -0.25, 0.0]  # E22 follows E11 by a quarter: anticlockwise
    loops = np.array([ellipse, [*ellipse[:4], 0.25, 0.0], [*ellipse[:4], 0.2, 1.0], [*ellipse[:4], 0.7, 1.0]])
    made, stored, gap = closed_loops.created(Linear(), loops, parts=2000, rounds=2)
    work = (1.0 - 3.0) * np.array([np.pi * 0.1 * 0.05, -np.pi * 0.1 * 0.05, 4 * 0.1 * 0.05, -4 * 0.1 * 0.05])
    assert np.allclose(made, -work, rtol=1e-5) and not stored.any() and gap.max() < 1e-12


@pytest.mark.parametrize("coupling", ["measured", "reciprocal"])
def test_the_worst_loop_lies_where_the_fabric_was_tested(monkeypatch, coupling):
    """What the search says of its loop is what the loop gives, and better than any at random."""
    monkeypatch.syspath_prepend(DEMOS / "thesis")
    import closed_loops

    blend = fabrics.load("blend")
    law = Woven(blend, coupling=coupling)
    short, longer = (closed_loops.worst(law, trials=100, generations=n, parts=60) for n in (0, 4))
    made, stored, gap = closed_loops.created(law, np.array([longer["loop"]]), 300, longer["rounds"])
    assert longer["share"] == pytest.approx(made[0] / stored[0]) and longer["gap"] == pytest.approx(gap[0], abs=1e-15)
    assert longer["E11"][1] <= blend.warp.limit and longer["E22"][1] <= blend.weft.limit
    if coupling == "measured":
        assert longer["share"] > short["share"] > 0 and gap < 1e-12, "of a law without potential, and closed"
    else:
        assert longer["share"] < 0.5


def test_numbers_of_chapter_7_are_typed_in_one_place_only():
    """No room of the report that writes sentences has a number with a decimal point in its sentences."""
    for path in sorted((DEMOS / "thesis" / "chapter7").glob("*.py")):
        if path.stem in ("parameters", "strips", "shearing", "sheets", "left_open", "three_laws"):
            for line in path.read_text().splitlines():
                for text in re.findall(r'f?"([^"]*)"', line):
                    typed = re.sub(r"\{[^}]*\}", "", text)
                    assert not re.search(r"\d\.\d+ (%|MPa|mm|J|N\b)", typed), f"{path.name}: {line.strip()}"
