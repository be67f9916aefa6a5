"""What the studies share: tables, processor time, kernels that are compiled, other ranks, the machine."""

import contextlib
import csv
import io
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import dolfinx
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from fabric_fenicsx import system
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError

WIDTHS = {"program": 16, "method": 28, "case": 16, "worst": 13, "computed": 12, "reference": 12}


def show(rows, head=True):
    """Print rows under their names."""
    widths = [WIDTHS.get(name, max(len(name), 9)) + 2 for name in rows[0]]
    if head:
        command.say("".join(f"{name:>{width}s}" for name, width in zip(rows[0], widths, strict=True)))
    for row in rows:
        words = [f"{value:.4g}" if isinstance(value, float) else str(value) for value in row.values()]
        command.say("".join(f"{word:>{width}s}" for word, width in zip(words, widths, strict=True)))


def write(path, rows):
    """The same rows to a file, by rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        with open(path, "w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


def processor():
    """Processor time of this process and of the compilers that it started, s."""
    return sum(os.times()[:4])


def fastest(call, repeats=5):
    """Least processor time of several calls, in s; one more comes first."""
    call()
    times = []
    for _ in range(repeats):
        clock = time.process_time()
        call()
        times.append(time.process_time() - clock)
    return min(times)


def scene_of(demo, args, comm):
    """The scene of a demo in motion, without what it says of it."""
    with contextlib.redirect_stdout(io.StringIO()):
        return demo.scene(args, comm)


def on_ranks(ranks, script, *words, cwd=None):
    """Run a script in a process of its own on each rank, with a core each; how it ended and what it said."""
    before = []
    if ranks > 1:
        mpirun = system.mpirun()
        if mpirun is None:
            raise InputError(f"{ranks} ranks need mpirun, and there is none on the path.")
        before = [mpirun, "-n", ranks]
    words = [str(word) for word in (*before, sys.executable, script, *words)]
    return subprocess.run(words, cwd=cwd, env=os.environ | {"OMP_NUM_THREADS": "1"}, capture_output=True, text=True)


@dataclass
class Compiled:
    """What was compiled: integrals of forms, expressions, and processor time in s."""

    integrals: int = 0
    expressions: int = 0
    cpu_s: float = 0.0


@contextlib.contextmanager
def compiled(cold):
    """Count what DOLFINx compiles in this block; `cold`: into an empty cache, so that it is compiled indeed."""
    count, settings, compiler = Compiled(), dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS, dolfinx.jit.ffcx_jit
    cache = settings["cache_dir"]

    def counted(comm, what, *arguments, **options):
        if isinstance(what, ufl.Form):
            count.integrals += len(what.integrals())
        else:
            count.expressions += 1
        clock = processor()
        try:
            return compiler(comm, what, *arguments, **options)
        finally:
            count.cpu_s += processor() - clock

    # compilation is collective, and all ranks look into one folder
    folder = tempfile.mkdtemp(prefix="forms") if cold and MPI.COMM_WORLD.rank == 0 else None
    folder = MPI.COMM_WORLD.bcast(folder, root=0)
    dolfinx.jit.ffcx_jit = counted
    if folder:
        settings["cache_dir"] = (Path(folder), cache[1])
    try:
        yield count
    finally:
        dolfinx.jit.ffcx_jit, settings["cache_dir"] = compiler, cache
        MPI.COMM_WORLD.Barrier()
        if folder and MPI.COMM_WORLD.rank == 0:
            shutil.rmtree(folder, ignore_errors=True)  # what is loaded stays so


def machine():
    """One line on what the times are of."""
    model = platform.processor() or platform.machine()
    with contextlib.suppress(OSError), open("/proc/cpuinfo") as file:
        model = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), model)
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    load = f", {os.getloadavg()[0]:.1f} processes at work" if hasattr(os, "getloadavg") else ""
    return f"{os.cpu_count()} x {model}{load}; DOLFINx {dolfinx.__version__}, PETSc {petsc}"
