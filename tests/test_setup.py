"""The set-up: what it says when something is missing, and that what it made works."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem, mesh

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
BASE_PYTHON = os.path.realpath(sys.executable)


def run(*command, **environment):
    """Run a command with some variables changed."""
    return subprocess.run(
        command, env={**os.environ, **environment}, capture_output=True, text=True, timeout=60, check=False
    )


def python(code):
    """Run some Python lines in a process of their own."""
    return run(sys.executable, "-c", code)


# --- the package without its DOLFINx


@pytest.mark.parametrize(
    ("before", "cause"),
    [
        ("sys.modules['dolfinx'] = None", "ModuleNotFoundError: import of dolfinx halted"),
        ("sys.modules['dolfinx'] = types.SimpleNamespace(__version__='0.9.0')", "DOLFINx is version 0.9.0"),
        ("sys.modules['mpi4py'] = None", "mpi4py"),
    ],
)
def test_import_without_dolfinx_says_how_to_get_it(before, cause):
    answer = python(f"import sys, types\n{before}\nimport fabric_fenicsx")
    assert answer.returncode == 1
    last = answer.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: fabric_fenicsx needs DOLFINx 0.11")
    for way in "make setup", "[wheel]", "conda-forge", "python3-dolfinx", "container":
        assert way in last
    assert cause in answer.stderr, "the genuine failure has to be seen"


def test_import_is_light():
    heavy = "{'gmsh', 'matplotlib', 'pyvista', 'vtkmodules'}"
    answer = python(f"import sys, fabric_fenicsx; print({heavy} & set(sys.modules))")
    assert answer.stdout.strip() == "set()", answer.stderr


# --- the system


def check_system(**environment):
    return run(sys.executable, str(ROOT / "fabric_fenicsx/system.py"), **environment)


def test_whole_system_passes():
    answer = check_system()
    assert (answer.returncode, answer.stdout, answer.stderr) == (0, "", "")


@pytest.mark.parametrize(
    ("library", "package"),
    [("libGLU.so.1", "libglu1-mesa"), ("libEGL.so.1", "libegl1 libegl-mesa0 libgl1-mesa-dri")],
)
def test_hidden_library_is_named_with_its_package(tmp_path, library, package):
    (tmp_path / library).touch()  # the loader meets the empty file first and cannot load it
    answer = check_system(LD_LIBRARY_PATH=str(tmp_path))
    assert answer.returncode == 1
    assert answer.stdout.strip() == package
    assert library.split(".")[0] in answer.stderr
    assert f"apt-get install --no-install-recommends {package}\n" in answer.stderr


def test_compiler_that_does_not_compile_is_named():
    answer = check_system(CC="false")
    assert answer.returncode == 1
    assert answer.stdout.strip() == "gcc libc6-dev"


# --- the choice of a Python


@pytest.fixture
def fresh(tmp_path):
    """A copy of the set-up that stops once a Python is chosen, on a machine with none; make one in `bin`."""
    shutil.copytree(ROOT / ".setup", tmp_path / ".setup")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "fabric_fenicsx").mkdir()
    (tmp_path / "fabric_fenicsx/system.py").write_text("import sys; sys.exit(f'chosen: {sys.executable}')\n")
    (tmp_path / "bin").mkdir()
    for tool in ("sh", "cat", "dirname", "find", "flock", "id", "rm", "sha256sum"):
        (tmp_path / "bin" / tool).symlink_to(shutil.which(tool))
    return tmp_path


def set_up(folder):
    environment = {"PATH": str(folder / "bin"), "HOME": str(folder), "PYENV_ROOT": str(folder / "pyenv")}
    return subprocess.run(
        [folder / ".setup/setup.sh"], env=environment, capture_output=True, text=True, timeout=60, check=False
    )


def program(path, line):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)


def test_no_python_gives_one_sentence(fresh):
    program(fresh / "bin/python3", "echo 'pyenv: python3: command not found' >&2; exit 127")
    answer = set_up(fresh)
    assert answer.returncode == 1
    assert answer.stdout == ""
    (sentence,) = answer.stderr.splitlines()
    assert "Python 3.12, 3.13 or 3.14 is needed: install it" in sentence


@pytest.mark.parametrize("place", ["bin/python3.12", "pyenv/versions/3.12.9/bin/python"])
def test_broken_python_is_passed_over(fresh, place):
    program(fresh / "bin/python3", "exit 127")
    program(fresh / place, f'exec "{BASE_PYTHON}" "$@"')
    answer = set_up(fresh)
    assert answer.returncode == 1
    assert answer.stderr.splitlines() == [f"chosen: {BASE_PYTHON}"]


def test_python_that_lacks_venv_comes_last(fresh):
    lame = f'case "$2" in *ensurepip*) exit 1;; esac; echo {fresh}/lame'
    program(fresh / "bin/python3", lame)
    program(fresh / "lame", "echo chosen: lame >&2; exit 1")
    assert set_up(fresh).stderr == "chosen: lame\n"
    program(fresh / "pyenv/versions/3.13.1/bin/python", f'exec "{BASE_PYTHON}" "$@"')
    assert set_up(fresh).stderr == f"chosen: {BASE_PYTHON}\n"


# --- what was installed


def test_every_dependency_is_pinned():
    pins = dict(
        re.fullmatch(r"(.+)==(.+)", line).groups()
        for line in (ROOT / ".setup/constraints.txt").read_text().lower().splitlines()
        if not line.startswith("#")
    )
    extras = PROJECT["optional-dependencies"]
    for requirement in [*PROJECT["dependencies"], *extras["wheel"], *extras["dev"], "setuptools"]:
        assert re.match(r"[\w.-]+", requirement.lower()).group() in pins
    assert pins["dolfinx-external-operator"].startswith("0.11.")
    assert f"dolfinx-solver-real=={pins['dolfinx-solver-real']}" in extras["wheel"]


@pytest.mark.parallel
def test_compiled_form_is_summed_over_the_ranks():
    square = mesh.create_unit_square(MPI.COMM_WORLD, 4, 4)
    x = ufl.SpatialCoordinate(square)
    part = fem.assemble_scalar(fem.form(x[0] * ufl.dx(square)))
    assert np.isclose(square.comm.allreduce(part), 0.5, rtol=1e-14)
