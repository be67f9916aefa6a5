"""Prove by use that the system has what the Python packages need from it.

Run by the Python that is to use them, with nothing but the standard library. With all in place it
says nothing; else standard error gets one sentence and standard output the Debian packages.
"""

import contextlib
import ctypes
import functools
import importlib.util
import os
import shlex
import shutil
import stat
import struct
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

# What gmsh and VTK load at run time, and the Debian package that holds it.
LIBRARIES = {
    "libGL.so.1": "libgl1",
    "libGLU.so.1": "libglu1-mesa",
    "libX11.so.6": "libx11-6",
    "libXcursor.so.1": "libxcursor1",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libXrender.so.1": "libxrender1",
    "libfontconfig.so.1": "libfontconfig1",
    "libgomp.so.1": "libgomp1",
    "libz.so.1": "zlib1g",
}


def loads(library: str) -> bool:
    """Whether the dynamic loader finds the library and all that it needs in turn."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


SETTLED: list[str] = []
"""What `settle` has changed, in sentences."""


def settle() -> None:
    """Where this user has no home folder, or no cache that can be written, let libraries use a temporary one.

    ADIOS2 ends the process where HOME is not set; DOLFINx, Numba and Matplotlib keep what they compile in the cache.
    """
    home = os.environ.get("HOME")
    if not home or not _entered(home):
        os.environ["HOME"] = _home()
        said = f"HOME={home} cannot be used" if home else "HOME is not set"
        SETTLED.append(f"{said}; {os.environ['HOME']} is used")
    cache = os.environ.get("XDG_CACHE_HOME") or str(Path(os.environ["HOME"], ".cache"))
    if not writable(Path(cache, "fenics")):
        os.environ["XDG_CACHE_HOME"] = str(_temporary())
        SETTLED.append(f"{cache} cannot be written; {os.environ['XDG_CACHE_HOME']} is used")
    elif os.environ.get("XDG_CACHE_HOME") == "":  # as good as not set, but DOLFINx takes it for the present folder
        del os.environ["XDG_CACHE_HOME"]


def writable(folder: Path) -> bool:
    """Whether a folder can be written, or made."""
    present = next(parent for parent in (folder, *folder.absolute().parents) if os.path.exists(parent))
    return os.path.isdir(present) and os.access(present, os.W_OK | os.X_OK)


def complete(library: Path) -> bool:
    """Whether a library is not cut short: the loader would end the process where a page of it is missing."""
    with open(library, "rb") as file:
        head = file.read(64)
    if sys.platform != "linux":
        return len(head) == 64
    if len(head) < 64 or head[:6] != b"\x7fELF\x02\x01":
        return False
    # the table of sections is what the linker writes last
    (start,), (size, count) = struct.unpack_from("<Q", head, 0x28), struct.unpack_from("<HH", head, 0x3A)
    return bool(library.stat().st_size >= start + size * count)


def _entered(folder: str) -> bool:
    """Whether this user may look for files in a folder, which need not be there."""
    try:
        os.stat(Path(folder, ".config"))
    except OSError as error:
        return isinstance(error, FileNotFoundError)
    return True


def _home() -> str:
    """That of the list of users, if there is one."""
    os.environ.pop("HOME", None)
    with contextlib.suppress(RuntimeError):
        if _entered(home := str(Path.home())):
            return home
    return str(_temporary())


def _temporary() -> Path:
    """A folder of this user alone, the same for all ranks and later runs."""
    folder = Path(tempfile.gettempdir(), f"fabric_fenicsx-{os.getuid()}")
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if found.st_uid == os.getuid() and stat.S_IMODE(found.st_mode) == 0o700 and stat.S_ISDIR(found.st_mode):
        return folder
    return Path(tempfile.mkdtemp())


def mpirun() -> str | None:
    """Path of the mpirun that comes with this Python, else of another; None if there is none."""
    return shutil.which("mpirun", path=Path(sys.executable).parent) or shutil.which("mpirun")


@functools.cache
def can_draw() -> str | None:
    """None if pictures can be drawn off-screen, else the sentence that says what to install."""
    # VTK ends the whole process where it has neither
    if loads("libOSMesa.so.8") or draws():
        return None
    return (
        "Pictures are left out, since there is no EGL that works without a screen: on Debian or Ubuntu, "
        "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri."
    )


def draws() -> bool:
    """Whether EGL has a driver that works without a screen; VTK crashes where it has none."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return False
    egl.eglGetDisplay.restype = egl.eglGetPlatformDisplay.restype = ctypes.c_void_p
    surfaceless = 0x31DD  # EGL_PLATFORM_SURFACELESS_MESA
    displays = egl.eglGetPlatformDisplay(surfaceless, None, None), egl.eglGetDisplay(None)
    return any(d and egl.eglInitialize(ctypes.c_void_p(d), None, None) for d in displays)


def compiles(header: str, *flags: str) -> bool:
    """Whether the compiler that cffi will use makes a library of a source with this header."""
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "gcc")
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "form.c")
        source.write_text(f"#include <{header}>\n")
        command = [*compiler, *flags, "-shared", "-fPIC", str(source), "-o", f"{folder}/form.so"]
        try:
            return subprocess.run(command, capture_output=True).returncode == 0
        except OSError:
            return False


def missing() -> dict[str, list[str]]:
    """What is missing, with the Debian packages that bring it."""
    lacks = {library: [package] for library, package in LIBRARIES.items() if not loads(library)}
    if not draws():
        lacks["a driver for off-screen pictures (libEGL)"] = ["libegl1", "libegl-mesa0", "libgl1-mesa-dri"]
    python = f"python3.{sys.version_info.minor}"
    if not compiles("math.h"):
        lacks["a C compiler with the C library's headers"] = ["gcc", "libc6-dev"]
    if not Path(sysconfig.get_path("include"), "Python.h").exists():
        lacks[f"Python.h of {sys.executable}"] = [f"{python}-dev"]
    if importlib.util.find_spec("ensurepip") is None:
        lacks[f"the venv module of {sys.executable}"] = [f"{python}-venv"]
    return lacks


if __name__ == "__main__":
    if lacks := missing():
        packages = " ".join(package for needed in lacks.values() for package in needed)
        print(
            f"fabric_fenicsx: this system lacks {', '.join(lacks)}, mended on Debian or Ubuntu by\n"
            f"    apt-get install --no-install-recommends {packages}",
            file=sys.stderr,
        )
        sys.exit(print(packages) or 1)
