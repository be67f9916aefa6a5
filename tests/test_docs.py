"""The pages are built from what stands in the code, and say what a reader needs."""

import ast
import importlib
import re
import subprocess
import sys

from test_layers import FILES, FOLDERS, PACKAGE, placed, room_of
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
    for room in (
        "shell/kinematics",
        "shell/directors",
        "shell/assumed_strain",
        "terms/hook",
        "solvers/motion",
        "laws/woven",
        "laws/section",
    ):
        text = ast.get_docstring(ast.parse((PACKAGE / f"{room}.py").read_text()))
        assert re.search(r"\([56]\.\d+\)|Box [56]-\d|doi 10\.", text), room


def test_the_package_lists_its_rooms_its_names_and_its_limits():
    """Every room, once; what is named is there; and nothing else of the package is imported by a demo."""
    text = ast.get_docstring(ast.parse((PACKAGE / "__init__.py").read_text()))
    assert "# What it cannot do" in text and "Contact" in text
    public, internal = text[text.index("- `fabrics`") : text.index("The five demos")].split("The other rooms")
    rooms = {room_of(path) for path in FILES} - FOLDERS
    found = [name for name in re.findall(r"`([a-z_.]+)`", internal) if name in rooms]
    listed = {}
    for room, names in re.findall(r"(?:- |; (?:\w+ )*)`([a-z_.]+)`: ((?:(?!; (?:\w+ )*`[a-z_.]+`: ).)+)", public):
        listed[room] = set(re.findall(r"`(\w+)`", names))
    told = {placed(name.split(".")) for name in listed}
    assert told | set(found) == rooms
    assert not told & set(found)
    for room, names in listed.items():
        module = importlib.import_module(f"fabric_fenicsx.{room}")
        assert all(hasattr(module, name) for name in names), room
    for path in sorted((ROOT / "demos").rglob("*.py")):
        for name in imports_of(path):
            assert any(f"{name}.".startswith(f"{room}.") or name in FOLDERS for room in listed), (
                f"{path.name} imports {name}"
            )


def imports_of(path):
    """What a demo imports from the package, without the package's own name."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "fabric_fenicsx":
            base = node.module.partition(".")[2]
            yield from (f"{base}.{alias.name}".strip(".") for alias in node.names if alias.name != "__version__")


def test_make_docs(tmp_path):
    text = (ROOT / "Makefile").read_text().replace("\\\n", "")
    recipe = re.search(r"^docs:.*\n\t\$\(python\) (.*)", text, re.M).group(1).split()
    assert any(name.startswith("pdoc") for name in PROJECT["optional-dependencies"]["dev"])
    words = [str(d) for word in recipe for d in (sorted(ROOT.glob(word)) if word.startswith("demos/") else [word])]
    words[words.index("out/docs")] = str(tmp_path)
    answer = subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, timeout=200, check=False
    )
    assert answer.returncode == 0, answer.stderr
    assert "What it cannot do" in (tmp_path / "fabric_fenicsx.html").read_text()
    for page, key in (("scenes/reading", "turn_deg"), ("identify/listing", "warp_dots"), ("identify/records", "Load")):
        assert key in (tmp_path / "fabric_fenicsx" / f"{page}.html").read_text()
        room, name = page.split("/")
        assert f'href="{room}/{name}.html"' in (tmp_path / "fabric_fenicsx" / f"{room}.html").read_text()
    for path in DEMOS:
        assert "The checked number" in (tmp_path / f"{path.stem}.html").read_text()
