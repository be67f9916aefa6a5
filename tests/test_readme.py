"""README tells no fairy tales: links, pictures, commands, verbs and code of it exist and run."""

import importlib.util
import re
import shlex
import subprocess
import sys
import tomllib

import numpy as np
import pytest
import ufl
from dolfinx import fem
from test_demos import ROOT
from test_setup import PROJECT

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.identify.synthetic import synthetic
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.shell import kinematics
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing, yarns
from fabric_fenicsx.terms import hook, supports, weakform

README = (ROOT / "README.md").read_text()
PAGES = tomllib.loads((ROOT / ".readme" / "measured.toml").read_text())


def test_it_is_short():
    assert len(README.splitlines()) <= 125


def test_links_and_pictures():
    pages = [ROOT / "README.md", *(ROOT / ".readme").glob("*.md"), *(ROOT / ".readme" / "theory").glob("*.md")]
    for page in pages:
        for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
            built = target.endswith(".html") and page.parent.name == "theory"
            path = page.parent / (target[:-5] + ".md" if built else target)
            assert target.startswith("https:") or path.exists(), f"{page.name}: {target}"


def test_scripts_and_their_options():
    """Every script that a page or README names is there, and knows the options that are shown, up to --."""
    commands = re.findall(r"(?:`|python )((?:demos|\.setup)/[\w/]+\.py[^`\n]*)`?", README)
    commands += [command for page in PAGES.values() for command in page["commands"]]
    assert len(commands) > 20
    known = {}
    for command in commands:
        path = ROOT / shlex.split(command)[0]
        assert path.exists(), command
        if path.parent not in known:  # scripts share their options with the files beside them
            text = "".join(beside.read_text() for beside in path.parent.glob("*.py"))
            known[path.parent] = set(re.findall(r"\"(--[\w-]+)\"", text))
        assert {word for word in shlex.split(command.split(" -- ")[0]) if word.startswith("--")} <= known[
            path.parent
        ], command


def test_targets_of_make():
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.M))
    assert set(re.findall(r"`make (\w+)`|^    make (\w+)", README, re.M)) - {("", "")}
    for pair in re.findall(r"`make (\w+)`|^    make (\w+)", README, re.M):
        assert set(pair) - {""} <= targets


def test_measured_pages_are_those_of_their_commands():
    there = {name for name in PAGES if (ROOT / ".readme" / f"{name}.md").exists()}
    assert there and there <= set(re.findall(r"\]\(\.readme/(\w+)\.md\)", README))
    for name in there:
        text = (ROOT / ".readme" / f"{name}.md").read_text()
        assert re.findall(r"^## `python (.+)`$", text, re.M) == PAGES[name]["commands"], name
        assert not any("status" in ended for ended in re.findall(r"^\d+ s(.*)$", text, re.M)), name


def test_the_table_is_that_of_its_page():
    spec = importlib.util.spec_from_file_location("measured", ROOT / ".setup" / "measured.py")
    measured = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(measured)
    assert measured.table("peers") in README and "| CalculiX" in README


@pytest.mark.slow
def test_verbs_run(tmp_path):
    """As a newcomer would, line by line, in an empty folder that has the demos and the records of a fabric."""
    (tmp_path / "demos").symlink_to(ROOT / "demos")
    (tmp_path / "meshes").symlink_to(ROOT / "meshes")
    synthetic.write(fabrics.load("blend"), tmp_path, specimens=1, noise=0.0)
    lines = re.findall(r"^    fabric-fenicsx ([^#\n]+)", README, re.M)
    assert len(lines) >= 6
    code = "import sys; sys.argv[0] = 'fabric-fenicsx'; from fabric_fenicsx.app import cli; cli.main()"
    for line in lines:
        words = [sys.executable, "-c", code, *shlex.split(line)]
        answer = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=250)
        assert answer.returncode == 0, (line, answer.stdout, answer.stderr)
    assert PROJECT["scripts"]["fabric-fenicsx"] == "fabric_fenicsx.app.cli:main"


@pytest.mark.filterwarnings("ignore:.*is beyond the measured")
def test_code():
    """The two scripts, with what a reader has to bring."""
    plane, motion = re.findall(r"```python\n(.*?)```", README, re.S)
    names = {"fem": fem, "ufl": ufl, "np": np, "meshing": meshing, "yarns": yarns, "kinematics": kinematics}
    names |= {"hook": hook, "weakform": weakform, "statics": statics, "fabrics": fabrics, "Potential": Potential}
    names |= {"sheet": sheet, "supports": supports, "loads": [0.1], "set_load": lambda part: None}
    head, solve = plane.split("solver =")
    exec(head, names)
    held = supports.hinge(names["domain"], names["V"], "fixed_end")
    pull = fem.Constant(names["domain"].mesh, 1e-3)
    names["bcs"] = held + supports.lead(names["domain"], names["V"], "pulled_end", 0, pull)
    names["pulled"] = supports.unknowns(names["domain"], names["V"], "pulled_end", 0)
    exec("solver =" + solve, names)
    assert names["solver"].reaction(names["pulled"]) > 0.0
    names["domain"] = meshing.read(meshing.MESHES / "drape.geo", n=4)
    names |= {"G": 1e6, "m": 0.2}
    exec(motion.replace("end=0.5", "end=0.01"), names)
    assert names["ledger"].totals["external"] > 0.0
