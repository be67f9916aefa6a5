"""A motion on disk: gone on with to the last bit, on other ranks too, and refused where it does not fit."""

import os
import re
import signal

import motions
import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import checkpoint
from fabric_fenicsx.terms import supports

COMM = MPI.COMM_WORLD
BLEND = fabrics.load("blend")
STEP = 4e-3


def pulled(comm, kinematics="shell", cells=2, rtol=1e-8):
    """A sheet of blend that hangs by one edge and is pulled to and fro by the other."""
    cloth = motions.cloth(comm, Woven(BLEND), kinematics, cells)
    end = fem.Constant(cloth.domain.mesh, 0.0)
    bcs = supports.hinge(cloth.domain, cloth.space, "left")
    bcs += supports.lead(cloth.domain, cloth.space, "right", 0, end)

    def set_load(t):
        end.value = 0.01 * np.sin(60 * t)

    return motions.moving(cloth, bcs, (0, 0, -9.81), ledger=True, set_load=set_load, rho=0.8, rtol=rtol)


def march(run, steps):
    """A number of steps, and all that is known after each."""
    known = []
    for _ in run.march(run.time + steps * STEP, STEP):
        arrays = [array.copy() for _, _, array in run.fields()[1]]
        known.append((run.numbers(), arrays))
    return known


def test_resumed_equals_uninterrupted_bit_for_bit(tmp_path):
    """A shell of the fabric law, with its account of energy."""
    whole = pulled(MPI.COMM_SELF)
    march(whole, 5)
    checkpoint.save(tmp_path / "state.npz", whole, "a scene")
    expected = march(whole, 5)
    resumed = pulled(MPI.COMM_SELF)
    checkpoint.load(tmp_path / "state.npz", resumed, "a scene")
    assert resumed.time == 5 * STEP
    assert os.listdir(tmp_path) == ["state.npz"]
    for (numbers, arrays), (numbers2, arrays2) in zip(expected, march(resumed, 5), strict=True):
        assert numbers == numbers2
        assert all(np.array_equal(a, b) for a, b in zip(arrays, arrays2, strict=True))


@pytest.mark.parallel
@pytest.mark.parametrize("there, back", [(MPI.COMM_SELF, COMM), (COMM, MPI.COMM_SELF)], ids=["spread", "gather"])
def test_goes_on_with_another_number_of_ranks(tmp_path, there, back):
    path = COMM.bcast(tmp_path) / (f"{COMM.rank}.npz" if there.size < COMM.size else "0.npz")
    whole = pulled(there, cells=4)
    march(whole, 5)
    checkpoint.save(path, whole)
    COMM.barrier()
    resumed = pulled(back, cells=4)
    checkpoint.load(path.with_name("0.npz"), resumed)
    march(whole, 5)
    march(resumed, 5)
    u, v = (motions.nodes(f)[0] for f in (whole.motion.q, whole.motion.velocity))
    u2, v2 = (motions.nodes(f)[0] for f in (resumed.motion.q, resumed.motion.velocity))
    assert np.abs(u - u2).max() < 1e-10 * np.abs(u).max()
    assert np.abs(v - v2).max() < 1e-8 * np.abs(v).max()
    energies, energies2 = (np.array(list(run.numbers().values())) for run in (whole, resumed))
    assert np.allclose(energies, energies2, rtol=1e-8, atol=1e-8 * whole.ledger.most)


@pytest.mark.parallel
def test_what_does_not_fit_is_refused_in_a_sentence(tmp_path):
    tmp_path = COMM.bcast(tmp_path)
    run, path = pulled(COMM, "membrane"), tmp_path / "state.npz"
    march(run, 1)
    checkpoint.save(path, run, "poke of blend")
    if COMM.rank == 0:
        (tmp_path / "text.npz").write_text("no checkpoint")
        (tmp_path / "cut.npz").write_bytes(path.read_bytes()[:2000])
        np.savez(tmp_path / "other.npz", a=np.ones(3))
        (tmp_path / "folder").mkdir()
    COMM.barrier()
    before = run.motion.q.x.array.copy()
    cases = [
        (path, run, "drape of duck", "made by another scene: poke of blend; this one is: drape of duck"),
        (path, pulled(COMM, "membrane", cells=4), "poke of blend", "another mesh"),
        (path, pulled(COMM), "poke of blend", "law, the shell or"),
        (tmp_path / "none.npz", run, "", "No such file"),
        *((tmp_path / f"{name}.npz", run, "", "no checkpoint") for name in ("text", "cut", "other")),
    ]
    for file, other, scene, reason in cases:
        with pytest.raises(InputError, match=reason) as said:
            checkpoint.load(file, other, scene)
        assert re.fullmatch(r"The checkpoint '.*' does not fit: [^\n]*\.", str(said.value))
    assert np.array_equal(run.motion.q.x.array, before)
    for file in (tmp_path / "folder", tmp_path / "none" / "state.npz"):
        with pytest.raises(InputError, match=r"cannot be written \(.*\)\.$"):
            checkpoint.save(file, run)


@pytest.mark.parallel
@pytest.mark.parametrize("fault", [StepFailed, KeyboardInterrupt])
def test_guard_keeps_the_last_good_state(tmp_path, capsys, fault):
    """A step that fails, and Ctrl-C during one, which is let end."""
    path = COMM.bcast(tmp_path) / "state.npz"
    run = pulled(COMM, "membrane")
    handler, steps = signal.getsignal(signal.SIGINT), 0
    with pytest.raises(fault), checkpoint.guard(path, run):
        for step in run.march(10 * STEP, STEP):
            steps += 1
            if step.number == 3:
                if fault is StepFailed:
                    run.solver.snes.setTolerances(max_it=0)
                elif COMM.rank == 0:
                    os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) == handler
    assert steps == 3
    resumed = pulled(COMM, "membrane")
    checkpoint.load(path, resumed)
    if fault is StepFailed:
        assert resumed.time == 3 * STEP
    else:
        assert resumed.time == 4 * STEP
    again = pulled(COMM, "membrane")
    march(again, round(resumed.time / STEP))
    assert np.array_equal(again.motion.q.x.array, resumed.motion.q.x.array)
    if COMM.rank == 0:
        assert f"{fault.__name__}: the last good state is in" in capsys.readouterr().out
