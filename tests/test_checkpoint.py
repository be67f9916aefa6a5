"""A motion on disk: gone on with to the last bit, on other ranks too, and refused where it does not fit."""

import os
import re
import signal
from pathlib import Path

import motions
import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import checkpoint, marching
from fabric_fenicsx.surfaces import meshing
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


def known(run):
    """All that is known of the present step."""
    return run.numbers(), [array.copy() for _, _, array in run.fields()]


def march(run, steps):
    """A number of steps, and all that is known after each."""
    return [known(run) for _ in run.march(run.time + steps * STEP, STEP)]


def test_resumed_equals_uninterrupted_bit_for_bit(tmp_path):
    """A shell of the fabric law, with its account of energy."""
    whole = pulled(MPI.COMM_SELF)
    expected, run = [], whole.march(10 * STEP, STEP)
    for step in run:
        if step.number == 5:
            checkpoint.save(tmp_path / "state.npz", whole, {"scene": "a"})
        elif step.number > 5:
            expected.append(known(whole))
    resumed = pulled(MPI.COMM_SELF)
    checkpoint.load(tmp_path / "state.npz", resumed, {"scene": "a"})
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
    both = (run.numbers().items() for run in (whole, resumed))
    energies, energies2 = (np.array([value for name, value in own if "from" not in name]) for own in both)
    assert np.allclose(energies, energies2, rtol=1e-8, atol=1e-8 * whole.ledger.most)


@pytest.mark.parallel
def test_what_does_not_fit_is_refused_in_a_sentence(tmp_path):
    tmp_path = COMM.bcast(tmp_path)
    run, path, marks = pulled(COMM, "membrane"), tmp_path / "state.npz", {"warp": (1, 0), "rho": 0.8}
    march(run, 1)
    checkpoint.save(path, run, marks)
    if COMM.rank == 0:
        (tmp_path / "folder").mkdir()
    COMM.barrier()
    start = run.motion.q.x.array.copy()
    cases = [
        (path, run, {"warp": (0, 1), "rho": 0.8}, r"it was made with warp \(1, 0\) and not \(0, 1\)"),
        (path, run, {"warp": (0, 1)}, r"warp \(1, 0\) and not \(0, 1\); rho 0.8 and not left out"),
        (path, pulled(COMM, "membrane", cells=4), marks, "another mesh"),
        (path, pulled(COMM), marks, "law, the shell or"),
        (tmp_path / "none.npz", run, marks, "No such file"),
        (tmp_path / "folder", run, marks, "directory"),
    ]
    for file, other, scene, reason in cases:
        with pytest.raises(InputError, match=reason) as said:
            checkpoint.load(file, other, scene)
        assert re.fullmatch(r"The checkpoint '.*' does not fit: [^\n]*\.", str(said.value))
    assert np.array_equal(run.motion.q.x.array, start)
    for file in (tmp_path / "folder", tmp_path / "none" / "state.npz"):
        with pytest.raises(InputError, match=r"cannot be written \(.*\)\.$"):
            checkpoint.save(file, run)


def test_contents_are_checked(tmp_path):
    """Whatever is another shape, type or no number; damage on disk; nothing of it is taken over."""
    run, path = pulled(MPI.COMM_SELF, "membrane"), tmp_path / "state.npz"
    march(run, 2)
    checkpoint.save(path, run)
    good, start, bad = dict(np.load(path)), run.motion.q.x.array.copy(), tmp_path / "bad.npz"
    v, names, numbers = good["cell_v"], good["names"], good["numbers"]
    cases = [
        ({"cell_v": np.full_like(v, np.nan)}, "not finite"),
        ({"cell_v": np.where(v == v.max(), np.inf, v)}, "not finite"),
        ({"cell_q": v[:-1]}, "another size"),
        ({"cell_q": np.concatenate([v, v])}, "another size"),
        ({"cell_q": v[:, :-1]}, "another size"),
        ({"cell_q": v.ravel()}, "another size"),
        ({"cell_q": v.astype(complex)}, "another size or type"),
        ({"cell_q": v.astype("f4")}, "another size or type"),
        ({"cell_q": v.astype(str)}, "another size or type"),
        ({"cell_v": None}, "law, the shell or the energy account"),
        *(
            ({name: None}, f"no checkpoint: it has no {name}")
            for name in ("names", "numbers", "mesh", "marks", "format")
        ),
        ({"names": names[:-1], "numbers": numbers[:-1]}, "energy account is another"),
        ({"names": np.append(names, "time"), "numbers": np.append(numbers, 0.0)}, "not one for each name"),
        ({"numbers": numbers[:-1]}, "not one for each name"),
        ({"numbers": np.where(names == "time", np.nan, numbers)}, "not finite"),
        ({"names": np.arange(len(names))}, "energy account is another"),
        ({"numbers": numbers.astype(str)}, "not one for each name"),
        ({"marks": np.array("{")}, "made with cannot be read"),
        ({"marks": np.array("3")}, "made with cannot be read"),
        ({"format": np.array(1)}, "format 1, not 3"),
    ]
    for changes, reason in cases:
        np.savez(bad, **{name: array for name, array in (good | changes).items() if array is not None})
        with pytest.raises(InputError, match=reason):
            checkpoint.load(bad, run)
    np.savez_compressed(bad, **good)
    checkpoint.load(bad, run)
    rng = np.random.default_rng(3)
    for content in (bad.read_bytes(), path.read_bytes()):
        for _ in range(60):
            damaged = bytearray(content)
            if rng.random() < 0.3:
                damaged = damaged[: rng.integers(len(damaged))]
            for place in rng.integers(0, max(1, len(damaged)), 40):
                damaged[place : place + 1] = bytes([rng.integers(256)])
            bad.write_bytes(damaged)
            with pytest.raises(InputError, match="does not fit"):
                checkpoint.load(bad, run)
    for text in (b"", b"no checkpoint", good["cell_v"].tobytes()):
        bad.write_bytes(text)
        with pytest.raises(InputError, match=r"no checkpoint\)\.$"):
            checkpoint.load(bad, run)
    np.save(tmp_path / "one.npy", v)
    with pytest.raises(InputError, match="no checkpoint"):
        checkpoint.load(tmp_path / "one.npy", run)
    assert np.array_equal(run.motion.q.x.array, start)


@pytest.mark.parallel
def test_what_is_not_finite_is_not_saved_and_the_last_two_are_kept(tmp_path):
    tmp_path = COMM.bcast(tmp_path)
    run, path = pulled(COMM, "membrane", cells=4), tmp_path / "state.npz"
    march(run, 1)
    checkpoint.save(path, run)
    march(run, 1)
    checkpoint.save(path, run)
    if COMM.rank == COMM.size - 1:
        run.motion.accepted["v"][0] = np.nan
    with pytest.raises(StepFailed, match=r"not finite \(v\) and is not saved"):
        checkpoint.save(path, run)
    found = []
    for file in (path, checkpoint.before(path)):
        resumed = pulled(COMM, "membrane", cells=4)
        checkpoint.load(file, resumed)
        found.append(resumed.time)
    assert found == [2 * STEP, STEP]
    assert checkpoint.last(path, COMM) == path
    if COMM.rank == 0:
        assert sorted(os.listdir(tmp_path)) == ["state.before.npz", "state.npz"]
        path.write_bytes(path.read_bytes()[:5000])
    assert checkpoint.last(path, COMM) == checkpoint.before(path)
    COMM.barrier()
    if COMM.rank == 0:
        path.unlink()
        checkpoint.before(path).unlink()
    assert checkpoint.last(path, COMM) is None


@pytest.mark.parallel
def test_a_run_is_saved_every_so_many_seconds_and_at_its_end(tmp_path, monkeypatch):
    path = COMM.bcast(tmp_path) / "state.npz"
    run, clock, seen = pulled(COMM, "membrane"), [0.0], []
    monkeypatch.setattr(checkpoint.time, "monotonic", lambda: clock[0])
    with checkpoint.guard(path, run, every=60.0):
        for _ in run.march(10 * STEP, STEP):
            seen.append(path.exists() and float(np.load(path)["numbers"][0]))
            clock[0] += 25.0
            COMM.barrier()
    assert seen == pytest.approx([0, 0, 0, *3 * [3 * STEP], *3 * [6 * STEP], 9 * STEP])
    assert np.load(path)["numbers"][0] == run.time


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("fault", [StepFailed, signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_guard_keeps_the_last_good_state(tmp_path, capsys, fault):
    """A step that fails, and signals to one rank, which let the step end."""
    path = COMM.bcast(tmp_path) / "state.npz"
    run = pulled(COMM, "membrane")
    handlers, steps = [signal.getsignal(number) for number in checkpoint.SIGNALS], 0
    kind = StepFailed if fault is StepFailed else KeyboardInterrupt
    with pytest.raises(kind) as said, checkpoint.guard(path, run):
        for step in run.march(10 * STEP, STEP):
            steps += 1
            if step.number == 3:
                if fault is StepFailed:
                    run.solver.snes.setTolerances(max_it=0)
                elif COMM.rank == COMM.size - 1:
                    os.kill(os.getpid(), fault)
    assert [signal.getsignal(number) for number in checkpoint.SIGNALS] == handlers
    assert steps == 3 and (fault is StepFailed or said.value.args == (fault,))
    resumed = pulled(COMM, "membrane")
    checkpoint.load(path, resumed)
    assert resumed.time == 3 * STEP, "the step that has been seen"
    again = pulled(COMM, "membrane")
    march(again, 3)
    assert np.array_equal(again.motion.q.x.array, resumed.motion.q.x.array)
    if COMM.rank == 0:
        assert f"{kind.__name__}: the last good state is in" in capsys.readouterr().err


def test_a_second_signal_waits_for_the_file_but_not_for_the_step(tmp_path, monkeypatch):
    path, run = tmp_path / "state.npz", pulled(MPI.COMM_SELF, "membrane")
    write, steps = checkpoint._write, 0

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        return write(*arguments)

    monkeypatch.setattr(checkpoint, "_write", interrupted)
    with pytest.raises(KeyboardInterrupt), checkpoint.guard(path, run):
        for _ in run.march(10 * STEP, STEP):
            os.kill(os.getpid(), signal.SIGTERM)
    resumed = pulled(MPI.COMM_SELF, "membrane")
    checkpoint.load(path, resumed)
    assert resumed.time == STEP
    path.unlink()
    with pytest.raises(KeyboardInterrupt), checkpoint.guard(path, run):
        for _ in run.march(run.time + 10 * STEP, STEP):
            steps += 1
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)
            steps += 100
    assert steps == 1 and not path.exists()


# --- statics


def drawn(comm, kinematics="shell", turns=(1.0, 0.3)):
    """A strip of blend that is drawn and let back; its march of eight loads."""
    path = Path(meshing.__file__).parents[1] / "meshes" / "strip.geo"
    domain = meshing.read(path, comm, nx=4, ny=2)
    cloth = sheet.Sheet(domain, Woven(BLEND), BLEND.thickness, (1e6, 1e6), kinematics=kinematics)
    end = fem.Constant(domain.mesh, 0.0)
    bcs = supports.clamp(domain, cloth.space, "fixed_end") + supports.lead(domain, cloth.space, "pulled_end", 0, end)
    bcs += [bc for k in (1, 2) for bc in supports.lead(domain, cloth.space, "pulled_end", k, 0.0)]
    bcs += supports.lead(domain, cloth.space, "sheet", 2, 0.0) if kinematics == "membrane" else []

    def put(load):
        end.value = 0.006 * load

    loads = np.concatenate([np.linspace(0, turns[0], 5)[1:], np.linspace(turns[0], turns[1], 5)[1:]])
    return marching.March(cloth.equilibrium(bcs), put, loads)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_a_march_goes_on_to_the_last_bit(tmp_path, kinematics):
    path = COMM.bcast(tmp_path) / "state.npz"
    whole, expected = drawn(COMM, kinematics), []
    for step in whole.steps():
        if step.number == 3:
            checkpoint.save(path, whole, {"scene": "a"})
        elif step.number > 3:
            expected.append((step.load, *known(whole)))
    on = drawn(COMM, kinematics)
    checkpoint.load(path, on, {"scene": "a"})
    assert (on.number, on.load) == (3, 0.75)
    for step, (load, numbers, arrays) in zip(on.steps(), expected, strict=True):
        numbers2, arrays2 = known(on)
        assert step.load == load and numbers == numbers2
        assert all(np.array_equal(a, b) for a, b in zip(arrays, arrays2, strict=True))
    with pytest.raises(InputError, match="has reached its last load"):
        next(on.steps())
    with pytest.raises(InputError, match=r"load number 3 is 0\.75"):
        checkpoint.load(path, drawn(COMM, kinematics, turns=(0.8, 0.3)), {"scene": "a"})


@pytest.mark.parallel
def test_guard_keeps_a_march(tmp_path):
    path, march = COMM.bcast(tmp_path) / "state.npz", drawn(COMM)
    with pytest.raises(KeyboardInterrupt), checkpoint.guard(path, march):
        for step in march.steps():
            if step.number == 2 and COMM.rank == 0:
                os.kill(os.getpid(), signal.SIGTERM)
    on = drawn(COMM)
    checkpoint.load(path, on)
    assert on.number == 2 and on.load == 0.5
