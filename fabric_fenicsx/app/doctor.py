"""What this machine has of what the package needs: tried by use, each in a process of its own, for some end it.

Nothing but the standard library is imported here, so that it can tell the truth where everything else is missing.
"""

import os
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from .. import system


@dataclass(frozen=True)
class Finding:
    """One thing looked at; `remedy` where it is not good."""

    name: str
    good: bool
    said: str
    remedy: str = ""
    needed: bool = True


PARTS = [
    ("DOLFINx 0.11", "import fabric_fenicsx, dolfinx; print(dolfinx.__version__, dolfinx.__file__)", True,
     "run 'make setup' in the source folder, or pip install 'fabric_fenicsx[wheel]'"),
    ("dolfinx-external-operator", "import fabric_fenicsx, dolfinx_external_operator as m; print(m.__file__)", True,
     "pip install --no-deps dolfinx-external-operator"),
    ("PETSc with MUMPS", "import fabric_fenicsx; from petsc4py import PETSc; a = PETSc.Mat().createDense([1, 1]); "
     "a.setUp(); a.assemble(); b = a.convert('aij'); p = PETSc.PC().create(); p.setOperators(b); p.setType('lu'); "
     "p.setFactorSolverType('mumps'); p.setFactorSetUpSolverType(); print('.'.join(map(str, PETSc.Sys.getVersion())))",
     True, "take a PETSc that was configured with MUMPS, as the pip extra [wheel] has"),
    ("MPI", "import fabric_fenicsx; from mpi4py import MPI; print(MPI.Get_library_version().splitlines()[0])", True,
     "pip install mpi4py, for the MPI library that DOLFINx was built with"),
    ("Numba", "import numba; print(numba.__version__)", True, "pip install numba"),
    ("gmsh (meshes)", "import gmsh; gmsh.initialize(); print(gmsh.__version__); gmsh.finalize()", True,
     "pip install gmsh, and the system libraries named here"),
    ("meshio (meshes of other programs)", "import meshio; print(meshio.__version__)", True, "pip install meshio"),
    ("Matplotlib (plots)", "import matplotlib.figure; print(matplotlib.__version__)", False, "pip install matplotlib"),
    ("PyVista (pictures)", "import os, tempfile; os.environ.setdefault('VTK_DEFAULT_OPENGL_WINDOW', "
     "'vtkEGLRenderWindow'); import pyvista as v; v.OFF_SCREEN = True; p = v.Plotter(window_size=(64, 64)); "
     "p.add_mesh(v.Sphere()); p.screenshot(os.path.join(tempfile.mkdtemp(), 'a.png')); print(v.__version__, 'draws')",
     False, "pip install pyvista, and apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"),
    ("FFmpeg (films .mp4; .gif needs none)", "import os, tempfile, numpy as n, imageio.v3 as i; i.imwrite(os.path.join("
     "tempfile.mkdtemp(), 'a.mp4'), n.zeros((2, 64, 64, 3), 'uint8')); print('writes .mp4')", False,
     "pip install imageio-ffmpeg"),
]  # fmt: skip


def look() -> list[Finding]:
    """Everything, in the order in which a newcomer would mend it. Takes some seconds."""
    version = platform.python_version()
    found = [Finding("Python 3.12 or newer", sys.version_info >= (3, 12), f"{version}, {sys.executable}",
                     "apt-get install python3 python3-venv python3-dev, or pyenv install 3.13")]  # fmt: skip
    lacks = system.missing()
    for name, packages in lacks.items():
        remedy = f"apt-get install --no-install-recommends {' '.join(packages)} (Debian, Ubuntu)"
        needed = "pictures" not in name and "venv" not in name
        found.append(Finding(name, False, "missing", remedy, needed))
    if not lacks:
        found.append(Finding("compiler, headers, system libraries", True, "a C library was compiled, all are found"))
    with ThreadPoolExecutor(2) as pool:
        found += pool.map(lambda part: _part(*part), PARTS)
    mpirun = system.mpirun()
    remedy = "install the MPI that DOLFINx was built with, for runs on several ranks"
    found.append(Finding("mpirun", mpirun is not None, mpirun or "not found", remedy, needed=False))
    return [*found, _folders(), _cache(), _size()]


def _part(name: str, code: str, needed: bool, remedy: str) -> Finding:
    if name.startswith("PyVista") and (fault := system.can_draw()) is not None:
        return Finding(name, False, fault.split(":")[0], remedy, needed)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [str(_HERE), os.environ.get("PYTHONPATH")]))}
    try:
        answer = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120
        )
    except subprocess.TimeoutExpired:
        return Finding(name, False, "no answer in two minutes", remedy, needed)
    if answer.returncode == 0:
        return Finding(name, True, " ".join(answer.stdout.split()), "", needed)
    last = (answer.stderr.strip().splitlines() or [f"the process was ended by signal {-answer.returncode}"])[-1]
    return Finding(name, False, last[:200], remedy, needed)


_HERE = Path(__file__).parents[2]


def cache_folder() -> Path:
    """Where DOLFINx keeps compiled forms."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fenics"


def _folders() -> Finding:
    said = "; ".join(system.SETTLED)
    remedy = "set HOME, and XDG_CACHE_HOME, to folders of yours, for what is kept there outlives a restart"
    return Finding("home and cache folders", not said, said or "can be written", remedy if said else "", needed=False)


def _cache() -> Finding:
    folder = cache_folder()
    name = "cache of compiled forms"
    if not system.writable(folder):
        return Finding(name, False, f"{folder} cannot be written", "set XDG_CACHE_HOME to a folder of yours")
    files = list(folder.glob("*")) if folder.exists() else []
    libraries = [file for file in files if file.suffix == ".so"]
    size = sum(file.stat().st_size for file in files) / 1e6
    begun = sum(file.suffix == ".c" and not Path(f"{file}.cached").exists() for file in files)
    cut = sum(not system.complete(file) for file in libraries)
    said = f"{folder}: {len(libraries)} forms, {size:.0f} MB"
    if begun + cut:
        said += f"; {begun} not compiled to the end and {cut} cut short, which a run that needs them compiles anew"
    return Finding(name, True, said)


def _size() -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30 if hasattr(os, "sysconf") else 0.0
    threads = os.environ.get("OMP_NUM_THREADS", "not set; 1 is best for small sheets")
    return Finding("machine", True, f"{cores} cores, {memory:.1f} GiB, OMP_NUM_THREADS {threads}")
