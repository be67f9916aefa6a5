"""The same tests in one process and on several ranks (mpirun -n 2 python -m pytest -m parallel).

On several ranks only rank 0 reports, a test fails on all ranks if it fails on any, and one that
hangs is ended with the line where each rank stands.
"""

import builtins
import faulthandler
import gc
import io
import itertools
import os
import sys
from pathlib import Path

# Before anything reads them: one thread a process, pictures without a screen, and forms that are compiled quickly, for
# they are run on few cells.
os.environ.update(
    NUMBA_NUM_THREADS="1",
    OMP_NUM_THREADS="1",
    MPLBACKEND="Agg",
    VTK_DEFAULT_OPENGL_WINDOW="vtkEGLRenderWindow",
    XDG_CONFIG_HOME=str(Path(__file__).parent / "data" / "config"),
)

import fabric_fenicsx  # noqa: F401 I001  first: it loads the MPI that the rest is to use
import pytest
from hypothesis import settings
from mpi4py import MPI

COMM = MPI.COMM_WORLD.Dup()  # the tests' own messages stay apart from the harness's
STDERR = pytest.StashKey[int]()  # the real one, which capturing does not redirect

# Ranks must draw the same examples, and the first call of a compiled law is slow.
settings.register_profile("fabric", deadline=None, derandomize=COMM.size > 1 or "CI" in os.environ)
settings.load_profile("fabric")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config):
    """Keep the real standard error; leave the terminal to rank 0."""
    config.stash[STDERR] = os.dup(2)
    if COMM.rank > 0:
        sys.stdout = io.StringIO()


def pytest_collection_finish():
    """What has been imported stays: else Python looks through it again whenever it looks for garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def without_toolkit(monkeypatch):
    """As if the toolkit of contact was not installed."""
    real = builtins.__import__

    def without(name, *rest, **more):
        if name == "ipctk":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)


if COMM.size > 1:

    def pytest_collection_modifyitems(config, items):
        """Of a test marked parallel(first=n), whose parameters take one way through the ranks, leave n sets of them."""
        kept, left_out = [], []
        for _, same in itertools.groupby(items, lambda item: item.nodeid.partition("[")[0]):
            same = list(same)
            mark = same[0].get_closest_marker("parallel")
            first = mark.kwargs.get("first", len(same)) if mark else len(same)
            kept += same[:first]
            left_out += same[first:]
        items[:] = kept
        config.hook.pytest_deselected(items=left_out)

    def pytest_timeout_set_timer(item, settings):
        """Stand in for pytest-timeout's clock: a hanging MPI call stops Python, but not this one in C."""
        faulthandler.dump_traceback_later(settings.timeout, exit=True, file=item.config.stash[STDERR])
        return True

    def pytest_timeout_cancel_timer(item):
        """Stop the clock."""
        faulthandler.cancel_dump_traceback_later()
        return True

    def pytest_runtest_teardown(item):
        """Free PETSc objects on all ranks at the same place, because that is collective.

        Nothing is frozen here: what still lives may be garbage after the next test, and hold a communicator, of which
        MPI has some two thousand.
        """
        gc.collect()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(item, call):
        """Agree on the outcome, so that all ranks go on to the same next thing; this is the barrier, too."""
        report = yield
        if report.failed:  # said at once: the other rank may hang now, and the summary never come
            text = f"\n{item.nodeid} failed on rank {COMM.rank} ({call.when}):\n{report.longreprtext}\n"
            os.write(item.config.stash[STDERR], text.encode())
        outcomes = COMM.allgather(report.outcome)
        if len(set(outcomes)) > 1:
            report.longrepr = report.longrepr if report.failed else f"outcomes of the ranks: {outcomes}"
            report.outcome = "failed"
        return report
