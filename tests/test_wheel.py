"""The wheel in an environment of its own, away from the source: every verb of the command works."""

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest
from test_setup import ROOT

SCENE = """
[mesh]
file = "strip.geo"
numbers = { length = 0.2, width = 0.1, nx = 2, ny = 1 }
[sheet]
fabric = "blend"
law = "svk"
[[support]]
at = "fixed_end"
kind = "clamp"
[[support]]
at = "pulled_end"
kind = "lead"
axis = "x"
shift_m = 0.002
[statics]
steps = 1
"""


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """Runs the command of a wheel; its packages are those of this environment, the project itself is not there."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    shutil.copytree(ROOT / "fabric_fenicsx", folder / "source" / "fabric_fenicsx")  # a build leaves files behind
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder / "source")
    build = ["wheel", str(folder / "source"), "--no-deps", "--no-build-isolation", "-w", str(folder)]
    subprocess.run([*pip, *build], check=True, timeout=100)
    venv.create(folder / "env", with_pip=False)
    (libraries,) = (folder / "env" / "lib").glob("python*/site-packages")
    (wheel,) = folder.glob("*.whl")
    install = [
        *pip,
        "--python",
        str(folder / "env"),
        "install",
        "--force-reinstall",
        "--no-deps",
        "--no-index",
        str(wheel),
    ]
    subprocess.run(install, check=True, timeout=100)
    # a .pth in a folder that a .pth names is not read: an editable install is not seen
    (libraries / "others.pth").write_text(sysconfig.get_path("purelib"))
    for library in Path(sys.prefix, "lib").glob("[!p]*"):  # mpi4py looks for MPI's library there
        (folder / "env" / "lib" / library.name).symlink_to(library)
    (folder / "strip.toml").write_text(SCENE)

    def run(*words, program="fabric-fenicsx"):
        line = [str(folder / "env" / "bin" / program), *words]
        environment = os.environ | {"PYTHONPATH": "", "PYTHONNOUSERSITE": "1"}
        done = subprocess.run(
            line, cwd=folder, env=environment, capture_output=True, text=True, timeout=200, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run.folder = folder
    return run


def test_the_package_is_that_of_the_wheel(command):
    said = command("-c", "import fabric_fenicsx; print(fabric_fenicsx.__file__)", program="python")
    assert said.startswith(str(command.folder / "env"))


def test_its_metadata_are_whole(command):
    code = "from importlib.metadata import metadata; m = metadata('fabric_fenicsx'); print(*m.keys())"
    said = command("-c", code, program="python").split()
    assert {"Summary", "Author", "Keywords", "Classifier", "License-Expression", "Requires-Python"} <= set(said)


@pytest.mark.slow
def test_every_verb_works(command):
    assert "blend" in command("fabrics", "list")
    assert "blend" in command("fabrics", "show", "blend")
    assert "hanging" in command("run", "--help")
    assert "file = " in command("run", "--keys") and command("identify", "--keys")
    assert command("doctor")
    command("run", "strip.toml", "--quiet")
    command("view", "out/strip", "--out", "picture.png")
    assert (command.folder / "picture.png").stat().st_size > 10_000
    code = "from fabric_fenicsx import scenes; print(scenes.read('hanging').mesh.exists())"
    assert "True" in command("-c", code, program="python")
