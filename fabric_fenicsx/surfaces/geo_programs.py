"""What a `.geo` file would do besides making a mesh: gmsh's language runs programs and writes files.

The words are found as gmsh's lexer finds them. Where that could be led astray, the file is taken for one that does.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

from ..errors import InputError
from .preparing import decoded

_RUNS = {"System", "SystemCall", "NonBlockingSystemCall", "OnelabRun", "ExternalProcess", "CommandLine"}
_WRITES = {"Print", "Save", "CreateDir", "SendToServer"}
_HIDES = {"StringToName", "S2N"}
"""Make a word out of a text, and so any of the others."""
_ENDS = {"Exit", "Abort"}
_TAKES_IN = {"Include", "Merge", "MergeWithBoundingBox"}
_PLUGINS = {"Bubbles", "NearToFarField", "VoroMetal"}
"""Plugins that write files."""
_READ_ONLY = {
    ".step", ".stp", ".iges", ".igs", ".brep", ".brp", ".xao", ".stl", ".unv", ".med", ".bdf", ".nas", ".vtk", ".ply",
    ".off", ".obj", ".mesh", ".cgns", ".wrl",
}  # fmt: skip
"""Endings of files that gmsh reads as data."""
_DATA = (b"$MeshFormat", b"$Comments", b"$NO", b"$PTS", b"$PARA", b"$ELM", b"$PostFormat")
"""How a file starts that gmsh reads as data, whatever its ending."""

_TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/) | (?P<text>"[^"]*"|'[^']*') | (?P<odd>/\*|"|')
    | (?P<number>\d+\.\d*(?:[Ee][-+]?\d+)?|\d*\.\d+(?:[Ee][-+]?\d+)?|\d+[Ee][-+]?\d+|\d+)
    | (?P<word>[A-Za-z_]\w*) | (?P<space>\s+) | (?P<sign>.)""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)
# In what an If, For or Macro passes over, gmsh looks for its end letter by letter, and does not see a quotation mark or
# a comment right after a letter that may begin it.
_ASTRAY = re.compile(r"[EIFR](?=[\"']|//|/\*)|(?<![A-Za-z_])(?:If|For)(?=[^\n]{0,3}(?:[\"']|//|/\*))")
_LONGEST = 1000
"""Characters of a text; of longer ones gmsh reads the end as part of the program."""


def check(path: Path, trust: bool) -> None:
    """Make sure that a file can be given to gmsh: that neither it, nor what it takes in, runs a program, writes a file
    or ends the process. trust: only the last. Raises InputError, naming file and line."""
    for file in (path, Path(f"{path}.opt")):  # gmsh reads options from beside a file
        if file.is_file() and not (file == path and _is_data(file)):
            _scan(file, trust, ())


def _is_data(file: Path) -> bool:
    with file.open("rb") as stream:
        start = stream.read(20)
    return start.startswith(_DATA) or file.suffix.lower() in _READ_ONLY


def _scan(file: Path, trust: bool, before: tuple[Path, ...]) -> None:
    text = decoded(file)

    def refuse(at: int, what: str, always: bool = False) -> None:
        if always or not trust:
            line = text.count("\n", 0, at) + 1
            how = (
                "take it out" if always else "take it out, or, if you trust the file, run it with --trust (trust=True)"
            )
            raise InputError(f"{str(file)!r}, line {line}: {what}; {how}.")

    if len(before) > 20:
        refuse(0, "it is taken in by itself", always=True)
    if (zero := text.find("\0")) >= 0:
        refuse(zero, "a zero byte, behind which a program could hide")
    if before and not text.endswith("\n"):
        raise InputError(f"{str(file)!r}: gmsh does not read all of a last line without an end: add an empty line.")
    tokens = [m for m in _TOKEN.finditer(text) if m.lastgroup not in ("comment", "space")]
    code = re.sub(_TOKEN, lambda m: _blank(m), text)
    for k, match in enumerate(tokens):
        word, at = match[0], match.start()
        after = tokens[k + 1 : k + 3]
        if match.lastgroup == "odd" or (match.lastgroup == "text" and len(word) > _LONGEST):
            refuse(at, "a comment or text without an end, or too long, behind which a program could hide")
        elif match.lastgroup == "sign" and word == ">" and _follows_printf(tokens, k):
            refuse(at, "Printf writes a file")
        elif match.lastgroup != "word":
            continue
        elif word in _RUNS:
            refuse(at, f"{word} runs a program")
        elif word in _WRITES:
            if after and (after[0].lastgroup in ("text", "word") or after[0][0] == "("):
                refuse(at, f"{word} writes a file")
        elif word in _HIDES:
            refuse(at, f"{word} can stand for a command that runs a program")
        elif word in _ENDS:
            refuse(at, f"{word} ends the run without a word", always=True)
        elif word in _TAKES_IN:
            _taken_in(file, after, at, refuse, trust, before)
        elif word == "Plugin" and len(after) == 2 and after[1][0] in _PLUGINS:
            refuse(at, f"the plugin {after[1][0]} writes a file")
        elif word == "General" and len(after) == 2 and re.search("File|Editor|Options|Session", after[1][0]):
            refuse(at, f"General.{after[1][0]} can make gmsh write or remove a file")
    if (astray := _ASTRAY.search(code)) is not None:
        refuse(astray.start(), "a quotation mark or comment right after a word, behind which a program could hide")


def _blank(match: re.Match[str]) -> str:
    """Comments and texts as their marks alone, of the same length."""
    if match.lastgroup in ("comment", "text"):
        return match[0][:2].ljust(2) + re.sub(r"[^\n]", " ", match[0][2:])
    return match[0]


def _follows_printf(tokens: list[re.Match[str]], k: int) -> bool:
    """Whether the sign `>` at k sends a Printf to a file: it comes after its closing bracket."""
    return tokens[k - 1][0] == ")" and any(token[0] == "Printf" for token in _backwards(tokens, k - 1))


def _backwards(tokens: list[re.Match[str]], k: int) -> Iterator[re.Match[str]]:
    """The tokens before k, to the end of the statement before."""
    while k >= 0 and tokens[k][0] != ";":
        yield tokens[k]
        k -= 1


def _taken_in(
    file: Path, after: list[re.Match[str]], at: int, refuse: Callable[..., None], trust: bool, before: tuple[Path, ...]
) -> None:
    """Look into a file that is taken in, unless gmsh reads it as data."""
    if not (len(after) == 2 and after[0].lastgroup == "text" and after[1][0] == ";"):
        refuse(at, "a file is taken in by a name that is not written out, and it could run a program")
        return
    other = file.parent / after[0][0][1:-1]
    if not other.is_file():
        return  # gmsh says so
    if other.suffix.lower() in (".gz", ".py", ".m", ".exe"):
        refuse(at, f"{str(other)!r} would be run as a program")
    elif re.match(rb"\$MeshFormat\s+2", other.read_bytes()[:100]):
        raise InputError(
            f"{str(other)!r} is of version 2, in which gmsh takes the groups of a cell for those of its whole surface: "
            "save it in version 4."
        )
    elif not _is_data(other):
        _scan(other, trust, (*before, file))
    if (options := Path(f"{other}.opt")).is_file():
        _scan(options, trust, (*before, file))
