"""The pages are built from what stands in the code, and say what a reader needs."""

import ast
import re
import subprocess
import sys

from test_layers import FILES, PACKAGE
from test_setup import PROJECT, ROOT

DEMOS = [*sorted((ROOT / "demos").glob("my_*.py")), ROOT / "demos" / "sleeve.py"]


def test_every_room_and_public_name_is_told():
    silent = []
    for path in FILES:
        tree = ast.parse(path.read_text())
        named = [node for node in tree.body if isinstance(node, ast.ClassDef | ast.FunctionDef)]
        silent += [f"{path.name}: {n.name}" for n in named if n.name[0] != "_" and not ast.get_docstring(n)]
        silent += [] if ast.get_docstring(tree) else [path.name]
    assert not silent


def test_the_theory_cites_its_source():
    """Equations of the thesis, or a paper, where a room stands on them."""
    for room in ("kinematics", "directors", "assumed_strain", "hook", "motion", "laws/woven", "laws/section"):
        text = ast.get_docstring(ast.parse((PACKAGE / f"{room}.py").read_text()))
        assert re.search(r"\([56]\.\d+\)|Box [56]-\d|doi 10\.", text), room


def test_the_package_lists_rooms_that_are_there_and_its_limits():
    text = ast.get_docstring(ast.parse((PACKAGE / "__init__.py").read_text()))
    assert "# What it cannot do" in text and "Contact" in text
    listed = text[text.index("- `fabrics`") : text.index("The five demos")]
    named = {name.split(".")[0] for name in re.findall(r"`([a-z_.]+)`", listed)}
    rooms = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in FILES}
    assert len(named) > 20 and named <= rooms


def test_make_docs(tmp_path):
    recipe = re.search(r"^docs:.*\n\t\$\(python\) (.*)", (ROOT / "Makefile").read_text(), re.M).group(1).split()
    assert any(name.startswith("pdoc") for name in PROJECT["optional-dependencies"]["dev"])
    words = [str(d) for word in recipe for d in (sorted(ROOT.glob(word)) if word.startswith("demos/") else [word])]
    words[words.index("out/docs")] = str(tmp_path)
    answer = subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, timeout=200, check=False
    )
    assert answer.returncode == 0, answer.stderr
    assert "What it cannot do" in (tmp_path / "fabric_fenicsx.html").read_text()
    for path in DEMOS:
        assert "The checked number" in (tmp_path / f"{path.stem}.html").read_text()
