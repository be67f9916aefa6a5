#!/bin/sh
# Makes .venv, in which every package is pinned, and mends what the system lacks.
# The Makefile calls it before every job; with nothing to do it takes a moment and says nothing.
set -e
cd "$(dirname "$0")/.."
exec 9<.setup && flock 9 # of two jobs started together, one waits for the other's set-up

say() { echo "fabric_fenicsx: $*" >&2; }

# The pins have been tried with these Pythons. The real path is asked for, because the name may be
# a version manager's shim or belong to the .venv that is about to be replaced.
works='import ctypes, os, ssl, sys, zlib
if sys.abiflags or sys.implementation.cache_tag not in ("cpython-312", "cpython-313", "cpython-314"): sys.exit(1)
print(os.path.realpath(sys._base_executable))'
complete='import ensurepip, os, sysconfig
os.stat(sysconfig.get_path("include") + "/Python.h")'

find_python() {
    pyenv=${PYENV_ROOT:-$HOME/.pyenv}/versions
    for needs in "$complete" ""; do # a Python without headers or venv can be mended, one with them is better
        for python in python3 python3.13 python3.12 python3.14 \
            "$pyenv"/3.13*/bin/python "$pyenv"/3.12*/bin/python "$pyenv"/3.14*/bin/python; do
            "$python" -c "$needs
$works" 2>/dev/null </dev/null && return
        done
    done
    return 1
}

apt_get() { # only root on a Debian can; anyone else is told what to install
    [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
    say "as root: apt-get $*"
    export DEBIAN_FRONTEND=noninteractive
    {
        apt-get update || true # a dead third-party source need not matter
        apt-get -y --no-install-recommends -o DPkg::Lock::Timeout=300 "$@"
    } >/dev/null </dev/null
}

# The place is part of it, because a .venv that was moved does not work.
wanted=$(pwd && cat .setup/setup.sh fabric_fenicsx/system.py .setup/constraints.txt pyproject.toml | sha256sum)
if [ "$(cat .venv/made-from 2>/dev/null)" = "$wanted" ] && .venv/bin/python -c '' 2>/dev/null; then
    made=yes python=.venv/bin/python
else
    made=no
    python=$(find_python) ||
        { apt_get satisfy 'python3 (>= 3.12), python3-venv, python3-dev' && python=$(find_python); } ||
        {
            say "Python 3.12, 3.13 or 3.14 is needed: install it with 'apt-get install python3 python3-venv python3-dev' (Debian 13, Ubuntu 24.04) or 'pyenv install 3.13'."
            exit 1
        }
fi

packages=$("$python" -I fabric_fenicsx/system.py) ||
    # shellcheck disable=SC2086 # a list of names
    { apt_get install $packages && "$python" -I fabric_fenicsx/system.py >/dev/null; } || exit 1

[ $made = yes ] && exit
say "making .venv with $python; this takes a few minutes, once"
rm -rf .venv
"$python" -m venv .venv
pip_install() { .venv/bin/python -m pip --disable-pip-version-check install -q -c .setup/constraints.txt "$@"; }
pip_install setuptools # pinned too: it builds the two packages that are not wheels
pip_install --no-build-isolation -e '.[wheel,dev,contact,photos,patterns,peers]'
# It asks for fenics-dolfinx, a name that the index does not have; the wheel above is the same DOLFINx.
pip_install --no-build-isolation --no-deps dolfinx-external-operator
# The stamp comes last and after a proof: a set-up that was interrupted or does not work is made anew.
.venv/bin/python -c 'import fabric_fenicsx, dolfinx_external_operator, gmsh'
echo "$wanted" >.venv/made-from
