"""Size of the code at some commits: rooms, imports between them, lines of the package and of the scripts.

    python .setup/shape.py 25cf099 HEAD

A room is a module, or a folder whose files are one subject; an import arrow is a pair of rooms of which one imports the
other, wherever in its file; a passage is 6 lines in a row (blank ones and comments apart) that stand in two places.
"""

import ast
import subprocess
import sys
from collections import Counter
from pathlib import PurePosixPath

ONE_SUBJECT = ("fabrics", "laws", "identify", "scenes")
SCRIPTS = {"thesis": ("thesis", "chapter7", "simple_shear", "biaxial", "law_steps", "material_point", "closed_loops"),
           "studies": ("studies", "benchmark", "error_", "lean_", "scaling", "shell_", "stability", "pendulum",
                       "hanging_strip")}  # fmt: skip


def git(*words):
    """What git prints."""
    return subprocess.run(["git", *words], capture_output=True, text=True, check=True).stdout


def files(commit):
    """Path -> text of the Python files of a commit."""
    names = [name for name in git("ls-tree", "-r", "--name-only", commit).splitlines() if name.endswith(".py")]
    return {PurePosixPath(name): git("show", f"{commit}:{name}") for name in names}


def room(parts):
    """The room of a dotted name inside of the package."""
    return parts[0] if len(parts) < 2 or parts[0] in ONE_SUBJECT else ".".join(parts[:2])


def arrows(package, rooms):
    """Pairs (importing room, imported room)."""
    found = set()
    for path, text in package.items():
        here = room(path.with_suffix("").parts[1:])
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.ImportFrom):
                continue
            base = list(path.parts[: len(path.parts) - node.level]) if node.level else []
            base += (node.module or "").split(".") if node.module else []
            if base[:1] != ["fabric_fenicsx"]:
                continue
            for alias in node.names:
                parts = [*base[1:], alias.name]
                there = next((room(parts[:n]) for n in (2, 1) if room(parts[:n]) in rooms), None)
                if there and there != here:
                    found.add((here, there))
    return found


def passages(texts):
    """Number of 6 lines in a row that stand in more than one place."""
    seen = Counter()
    for text in texts:
        lines = [line.strip() for line in text.splitlines() if line.strip() and not line.strip().startswith("#")]
        lines = [line for line in lines if not line.startswith(("import ", "from "))]
        seen.update(tuple(lines[k : k + 6]) for k in range(len(lines) - 5))
    return sum(count > 1 for count in seen.values())


def kind(path):
    """What a file is for."""
    top, rest = path.parts[0], path.parts[1:]
    if top != "demos":
        return top
    for name, starts in SCRIPTS.items():
        if rest[0].startswith(starts):
            return f"demos: {name}"
    return "demos: examples"


def main():
    """Print a column for each commit."""
    commits = sys.argv[1:] or ["HEAD"]
    rows = {}
    for commit in commits:
        texts = files(commit)
        package = {
            path: text for path, text in texts.items() if path.parts[0] == "fabric_fenicsx" and len(path.parts) > 1
        }
        rooms = {room(path.with_suffix("").parts[1:]) for path in package} - {"__init__"}
        counts = Counter()
        for path, text in texts.items():
            counts[f"lines, {kind(path)}"] += len(text.splitlines())
        found = arrows(package, rooms)
        counts["rooms"], counts["import arrows of rooms"] = len(rooms), len(found)
        folders = {(here.split(".")[0], there.split(".")[0]) for here, there in found}
        counts["folders and single rooms"] = len({name.split(".")[0] for name in rooms})
        counts["import arrows of folders"] = sum(here != there for here, there in folders)
        counts["files of the package"] = len(package)
        counts["repeated passages"] = passages(text for path, text in texts.items() if path.parts[0] != "tests")
        for name, value in counts.items():
            rows.setdefault(name, {})[commit] = value
    print(f"{'':28s}" + "".join(f"{commit:>12s}" for commit in commits))
    for name in sorted(rows):
        print(f"{name:28s}" + "".join(f"{rows[name].get(commit, 0):12d}" for commit in commits))


if __name__ == "__main__":
    main()
