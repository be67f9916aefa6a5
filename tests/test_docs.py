"""The pages are built from what stands in the code, and say what a reader needs."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from dataclasses import is_dataclass

import pytest
from test_layers import FILES, FOLDERS, PACKAGE, placed, room_of
from test_setup import ROOT

from fabric_fenicsx import laws


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
    listed, internal = rooms_and_names(text)
    rooms = {room_of(path) for path in FILES} - FOLDERS
    found = [name for name in re.findall(r"`([a-z_.]+)`", internal) if name in rooms]
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


def rooms_and_names(text):
    """Public rooms and their names, as the package lists them; and what it says of the others."""
    public, internal = text[text.index("- `fabrics`") : text.index("The eight demos")].split("The other rooms")
    listed = {}
    for entry in re.split(r"^- ", public.replace("\n  ", " "), flags=re.M):
        for room, names in re.findall(r"(?:^|; (?:\w+ )*)`([a-z_.]+)`: ((?:(?!; (?:\w+ )*`[a-z_.]+`: ).)+)", entry):
            listed[room] = set(re.findall(r"`(\w+)`", names))
    return listed, internal


def signatures():
    """Functions that the package lists, classes and their public methods: where, parameters, what is said of them."""
    listed, _ = rooms_and_names(ast.get_docstring(ast.parse((PACKAGE / "__init__.py").read_text())))
    kin = [getattr(laws, name) for name in listed["laws"]]  # protocols, which tell of what all laws do
    for room, names in listed.items():
        for name in sorted(names):
            what = getattr(importlib.import_module(f"fabric_fenicsx.{room}"), name)
            if inspect.isclass(what):
                own = ast.parse(inspect.getsource(what)).body[0].body  # fields tell of themselves below or beside them
                fields = [f.target.id for f in own if isinstance(f, ast.AnnAssign)] if is_dataclass(what) else []
                yield f"{room}.{name}", what.__init__, f"{inspect.getdoc(what)} {' '.join(fields)}"
                for method, function in vars(what).items():
                    if inspect.isfunction(function) and method[0] != "_":
                        same = [getattr(base, method) for base in (what, *kin, *what.__mro__) if hasattr(base, method)]
                        told = " ".join(f"{inspect.getdoc(one)}" for one in (*same, what))
                        yield f"{room}.{name}.{method}", function, told
            elif inspect.isfunction(what):
                yield f"{room}.{name}", what, inspect.getdoc(what)


def annotation(parameter):
    return "" if parameter.annotation is parameter.empty else inspect.formatannotation(parameter.annotation)


def test_what_has_a_unit_or_is_an_array_is_described():
    """Every number and array that a listed function or class takes is named where it is documented."""
    silent, seen = [], 0
    for where, function, told in signatures():
        for name, parameter in inspect.signature(function).parameters.items():
            if re.search(r"\b(float|Array|NDArray|ndarray|Vector|Point)\b", annotation(parameter)):
                seen += 1
                if not re.search(rf"\b{name}\b", told) and parameter.kind is not parameter.VAR_KEYWORD:
                    silent.append(f"{where}: {name}")
    assert seen > 150 and not silent


def test_names_of_choices_are_types():
    """What has a word for its default is one of a few, but for what is written beside or below a picture."""
    free, loose = {"name", "title", "material"}, []
    for where, function, _ in signatures():
        for name, parameter in inspect.signature(function).parameters.items():
            if isinstance(parameter.default, str) and name not in free and annotation(parameter).strip("'") == "str":
                loose.append(f"{where}: {name}")
    assert not loose


def imports_of(path):
    """What a demo imports from the package, without the package's own name."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "fabric_fenicsx":
            base = node.module.partition(".")[2]
            yield from (f"{base}.{alias.name}".strip(".") for alias in node.names if alias.name != "__version__")


@pytest.mark.slow
def test_make_docs(tmp_path):
    """Every page but most demos', which run: their pages are made by `make docs`."""
    recipe = re.search(r"^docs:.*\n\t\$\(python\) (.*)", (ROOT / "Makefile").read_text(), re.M).group(1).split()
    answer = subprocess.run(
        [sys.executable, *recipe, "--out", str(tmp_path), "--only", "my_term"],
        cwd=ROOT, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    assert "What it cannot do" in (tmp_path / "fabric_fenicsx.html").read_text()
    shown = (("scenes/reading", "turn_deg"), ("identify/listing", "warp_dots"), ("identify/files/records", "Load"))
    for page, key in shown:
        assert key in (tmp_path / "fabric_fenicsx" / f"{page}.html").read_text()
        room, name = page.rsplit("/", 1)
        assert f'href="{room.split("/")[-1]}/{name}.html"' in (tmp_path / "fabric_fenicsx" / f"{room}.html").read_text()
    demo = (tmp_path / "my_term" / "index.html").read_text()
    assert "The checked number" in demo and ": yes;" in demo and demo.count("<math") >= 7
    own = {"fabric_fenicsx.html"}  # pdoc's
    pages = [path for path in (*tmp_path.glob("*.html"), *tmp_path.glob("my_*/*.html")) if path.name not in own]
    assert len(pages) >= 7
    for path in pages:
        text = path.read_text()
        assert "$" not in re.sub(r"<(pre|code)>.*?</\1>", "", text, flags=re.S) and "<script" not in text, path
        for target in re.findall(r'(?:href|src)="([^"#]+)', text):
            assert target.startswith(("https:", "data:")) or (path.parent / target).exists(), f"{path.name}: {target}"


def test_every_literate_demo_is_a_page_with_formulas_and_a_picture():
    literate = [path for path in (ROOT / "demos").glob("*.py") if "\n# %% [markdown]\n" in path.read_text()]
    mine = {f"my_{name}" for name in ("fabric", "materials", "mesh", "load", "law", "term", "seam")}
    assert {path.stem for path in literate} >= mine
    for path in literate:
        text = path.read_text()
        assert "# $$" in text and re.search(r"^# !\[.+\]\(.+\.png\)", text, re.M) and "command.check(" in text
