"""Compiled forms: what a killed compile leaves behind blocks nobody, and homes and caches that cannot be used."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_setup import ROOT

from fabric_fenicsx import system

FORM = """
import fabric_fenicsx, ufl
from mpi4py import MPI
from dolfinx import fem, mesh
comm = {comm}
square = mesh.create_unit_square(MPI.COMM_SELF if comm.size == 1 else comm, 2, 2)
print("area", comm.allreduce(fem.assemble_scalar(fem.form(fem.Constant(square, 1.0) * ufl.dx))) , flush=True)
"""
SLOW = '#!/bin/sh\n[ -e {go} ] || {{ touch {begun}; while [ ! -e {go} ]; do sleep 0.05; done; }}\nexec gcc "$@"\n'


def start(cache, comm="MPI.COMM_WORLD", ranks=1, **environment):
    """A process that needs one form."""
    words = [sys.executable, "-c", FORM.format(comm=comm)]
    words = words if ranks == 1 else [system.mpirun(), "-n", str(ranks), *words]
    changed = os.environ | {"XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(ROOT)} | environment
    changed = {key: value for key, value in changed.items() if value is not None}
    return subprocess.Popen(words, env=changed, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def answer(process, timeout=100, ranks=1):
    """What it says, once it has ended well; the lines of ranks may be mixed."""
    said, complaint = process.communicate(timeout=timeout)
    assert process.returncode == 0 and "".join(sorted(said)) == "".join(sorted("area 1.0\n" * ranks)), complaint
    return complaint


def wait_for(path, seconds=60):
    """Until a file is there."""
    end = time.monotonic() + seconds
    while not path.exists():
        assert time.monotonic() < end, f"{path} did not come"
        time.sleep(0.02)


@pytest.fixture
def compiler(tmp_path):
    """A compiler that waits for the file `go`, having made `begun`."""
    path = tmp_path / "slow"
    path.write_text(SLOW.format(go=tmp_path / "go", begun=tmp_path / "begun"))
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_compile_blocks_no_later_run(tmp_path, compiler, end):
    killed = start(tmp_path, CC=compiler)
    wait_for(tmp_path / "begun")
    (left,) = (tmp_path / "fenics").glob("*.c")
    killed.send_signal(end)
    (tmp_path / "go").touch()
    killed.communicate(timeout=60)
    assert killed.returncode != 0 and not Path(f"{left}.cached").exists()
    begun = time.monotonic()
    assert "compiling forms" in answer(start(tmp_path))
    assert time.monotonic() - begun < 60
    assert not list((tmp_path / "fenics").glob("*.lock"))
    assert answer(start(tmp_path)) == "", "it is kept, and nothing is said"


def test_the_form_of_a_living_process_is_waited_for(tmp_path, compiler):
    first = start(tmp_path, CC=compiler)
    wait_for(tmp_path / "begun")
    (source,) = (tmp_path / "fenics").glob("*.c")
    os.utime(source, (0, 0))  # however old
    made = source.stat().st_ino
    second = start(tmp_path, CC="false")
    for line in second.stderr:
        assert "waiting for another process" in line
        break
    assert source.stat().st_ino == made, "it is left alone"
    (tmp_path / "go").touch()
    answer(first)
    second.stderr = open(os.devnull)  # noqa: SIM115  its first line was read
    assert second.communicate(timeout=60)[0] == "area 1.0\n"


def test_a_library_that_is_cut_short_is_made_anew(tmp_path):
    answer(start(tmp_path))
    (library,) = (tmp_path / "fenics").glob("*.so")
    whole = library.read_bytes()
    for rest in (b"", bytes(len(whole)), whole[: len(whole) // 2], whole[:-100]):
        library.write_bytes(rest)
        assert not system.complete(library)
    assert "compiling forms" in answer(start(tmp_path))
    assert system.complete(library)
    library.unlink()
    answer(start(tmp_path))


WRITES = """
import os, fabric_fenicsx
from mpi4py import MPI
from dolfinx import fem, io, mesh
u = fem.Function(fem.functionspace(mesh.create_unit_square(MPI.COMM_WORLD, 2, 2), ("Lagrange", 1)))
io.VTXWriter(MPI.COMM_WORLD, "{path}", [u]).write(0.0)
print(os.environ["HOME"])
"""


def test_adios_writes_without_a_home(tmp_path):
    """It ends the process where HOME is not set."""
    environment = {key: value for key, value in os.environ.items() if key != "HOME"}
    words = [sys.executable, "-c", WRITES.format(path=tmp_path / "u.bp")]
    said = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert said.returncode == 0 and said.stdout.strip() and (tmp_path / "u.bp").exists(), said.stderr


@pytest.mark.parametrize("known", [True, False], ids=["listed", "unlisted"])
@pytest.mark.parametrize("home", [None, "", "file", "{}/gone"])
def test_a_home_that_cannot_be_used_is_replaced(tmp_path, monkeypatch, home, known):
    """A file for a home stands for what may not be entered, which root always may."""
    (tmp_path / "file").touch()
    (tmp_path / "listed").mkdir()
    monkeypatch.setattr(system, "SETTLED", [])
    monkeypatch.setattr(system.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(system.os.path, "expanduser", lambda path: str(tmp_path / "listed") if known else path)
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.delenv("HOME")
    if home is not None:
        monkeypatch.setenv("HOME", str(tmp_path / "file") if home == "file" else home.format(tmp_path))
    system.settle()
    if home == "{}/gone":
        assert os.environ["HOME"] == f"{tmp_path}/gone" and not system.SETTLED
    else:
        assert os.environ["HOME"] == str(tmp_path / ("listed" if known else f"fabric_fenicsx-{os.getuid()}"))
        assert len(system.SETTLED) == 1 and os.environ["HOME"] in system.SETTLED[0]
    assert "XDG_CACHE_HOME" not in os.environ, "an empty one would be the present folder"


@pytest.mark.parametrize("ranks", [1, 2])
def test_without_a_cache_a_temporary_one_is_used(tmp_path, ranks):
    (tmp_path / "file").touch()
    complaint = answer(start(tmp_path / "file" / "cache", ranks=ranks, TMPDIR=str(tmp_path)), ranks=ranks)
    folder = tmp_path / f"fabric_fenicsx-{os.getuid()}" / "fenics"
    assert str(folder) in complaint and list(folder.glob("*.so"))


def test_the_temporary_folder_is_this_users_own(tmp_path, monkeypatch):
    monkeypatch.setattr(system.tempfile, "tempdir", str(tmp_path))
    folder = system._temporary()
    assert folder == system._temporary() and folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)
    assert system._temporary() != folder, "somebody else could put libraries there"
