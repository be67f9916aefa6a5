"""Prove by use that the system has what the Python packages need from it.

Run by the Python that is to use them, with nothing but the standard library. With all in place it
says nothing; else standard error gets one sentence and standard output the Debian packages.
"""

import ctypes
import functools
import importlib.util
import os
import shlex
import shutil
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
