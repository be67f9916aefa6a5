"""What many ranks would gain: work and messages of a Newton iteration, counted on a few ranks, and a prediction.

    python demos/studies/scaling.py --model
    mpirun -n 4 python demos/studies/rank_model.py --cells 40 --end 0.02      # what is counted, as one line of JSON

Of the drape with bending of its own and the iterative solver: factors of MUMPS are for few ranks. Counted are the
messages that PETSc sends and those of DOLFINx's updates of ghosts, their bytes, and the reductions of both and of this
code, on the rank that has most of each. A rank of many has neighbours all around, `AROUND` of them, and an interface of
four sides of its square part; the counting ranks have fewer. So, with n unknowns, p ranks and the time of an iteration

    T(p) = w n/p + latency (messages + 2 reductions log2 p) + bytes/bandwidth

the efficiency is T(1)/(p T(p)), T(1) = w n. It is a prediction: that parts are equal, that messages do not wait for
each other, and that linear iterations and coarse grids are those of the counted sheet, is assumed.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import ctypes
import json
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import drape
import moving
import numpy as np
import studies
from dolfinx import la, mesh
from petsc4py import PETSc

from fabric_fenicsx.app import command
from fabric_fenicsx.errors import StepFailed

AROUND = 8
"""Neighbours of a square part of a sheet."""
LATENCY, BANDWIDTH = 2e-6, 1e10
"""Assumed: s of a message, and bytes/s of a rank."""
REDUCTIONS = "allreduce", "allgather", "Allgather", "Allgatherv", "bcast"
SUMS = "VecDot", "VecMDot", "VecNorm", "VecTDot", "VecReduceComm"


@dataclass(frozen=True)
class Counts:
    """Of a Newton iteration, on the rank that has most of each."""

    ranks: int
    unknowns: int
    seconds: float  # of the processor
    messages: float
    bytes: float
    reductions: float
    neighbours: int
    linear_iterations: float


def predicted(work, counts, unknowns, ranks, latency=LATENCY, bandwidth=BANDWIDTH):
    """Time of an iteration in s, and the part of it that is communication.

    work: s an unknown; counts: of a few ranks, whose square parts share two sides (four ranks).
    """
    if ranks == 1:
        return work * unknowns, 0.0
    sides = 2.0 * np.sqrt((unknowns / ranks) / (counts.unknowns / counts.ranks))  # four instead of two, and longer
    messages = counts.messages * AROUND / counts.neighbours
    talk = latency * (messages + 2.0 * counts.reductions * np.log2(ranks)) + counts.bytes * sides / bandwidth
    whole = work * unknowns / ranks + talk
    return whole, talk / whole


def efficiency(work, counts, unknowns, ranks, **assumed):
    """T(1)/(p T(p)) at as many unknowns in all."""
    return work * unknowns / (ranks * predicted(work, counts, unknowns, ranks, **assumed)[0])


class Counter:
    """Messages, bytes and reductions of this rank while it is entered."""

    def __init__(self):
        self.messages = self.bytes = self.reductions = 0.0

    def __enter__(self):
        self._scatter, self._comm, counter = la.Vector.scatter_forward, mesh.Mesh.comm, self

        # a communicator that counts, under a name by which petsc4py knows it
        counts = {name: _counting(getattr(MPI.Intracomm, name), self) for name in REDUCTIONS}
        counted = type("Intracomm", (MPI.Intracomm,), counts | {"__module__": "mpi4py.MPI"})

        def scatter(vector):
            counter.messages += len(np.unique(vector.index_map.owners))
            counter.bytes += 8.0 * vector.block_size * vector.index_map.num_ghosts
            counter._scatter(vector)

        la.Vector.scatter_forward = scatter
        mesh.Mesh.comm = property(lambda self: counted(counter._comm.fget(self)))
        self._before = _of_petsc()
        return self

    def __exit__(self, *_):
        la.Vector.scatter_forward, mesh.Mesh.comm = self._scatter, self._comm
        messages, length, reductions = _of_petsc() - self._before
        self.messages += messages
        self.bytes += length
        self.reductions += reductions


def _counting(method, counter):
    def counted(comm, *arguments, **options):
        counter.reductions += 1
        return method(comm, *arguments, **options)

    return counted


def _of_petsc():
    """Messages, bytes and reductions of PETSc so far."""
    library = ctypes.CDLL(PETSc.__file__)

    def read(*names):
        return sum(ctypes.c_double.in_dll(library, f"petsc_{name}").value for name in names)

    # PETSc does not count what the norms and products of vectors add up
    sums = sum(PETSc.Log.Event(name).getPerfInfo()["count"] for name in SUMS)
    return np.array([read("isend_ct", "send_ct"), read("isend_len", "send_len"), read("allreduce_ct") + sums])


def counted(cells, end, comm):
    """`Counts` of the drape on the ranks of `comm`, and work of one rank in s an unknown."""
    parser = argparse.ArgumentParser()
    moving.add_arguments(parser, end=end, rho=0.8)
    own = parser.parse_args(["--bending", "own", "--solver", "iterative", "--cells", str(cells), "--end", str(end)])
    own.patch = 0.2
    PETSc.Log.begin()
    counter = Counter()
    with counter:
        run, first = drape.scene(own, comm).run, 2 * own.step * 1e-3
        for _ in run.march(first, own.step * 1e-3):  # what is made once
            pass
    counter.messages = counter.bytes = counter.reductions = 0.0
    clock, iterations, before = time.process_time(), 0, run.solver.linear_iterations
    with counter:
        for step in run.march(end, own.step * 1e-3):
            iterations += step.newton_iterations
    every = [time.process_time() - clock, counter.messages, counter.bytes, counter.reductions]
    seconds, messages, length, reductions = (comm.allreduce(value, MPI.MAX) / iterations for value in every)
    V = run.q.function_space.dofmap.index_map
    neighbours = comm.allreduce(len(np.unique(V.owners)), MPI.MAX)
    linear = (run.solver.linear_iterations - before) / iterations
    return Counts(comm.size, V.size_global, seconds, messages, length, reductions, neighbours, linear)


def of_ranks(ranks, cells, end):
    """`Counts` of as many ranks, in a process of its own on each."""
    done = studies.on_ranks(ranks, __file__, "--cells", cells, "--end", end)
    said = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not said:
        raise StepFailed(f"The drape on {ranks} ranks has not run: {done.stderr.strip()[-300:]}")
    return Counts(**json.loads(said[-1]))


def table(end, of=(4, 40), work_of=80, cells=500, ranks=(8, 64, 512)):
    """Lines that tell what is counted, with `of` ranks and cells, and predicted, for `cells` and for as many a rank."""
    counts, alone = of_ranks(*of, end), of_ranks(1, work_of, end)
    work = alone.seconds / alone.unknowns
    yield (
        f"counted on {counts.ranks} ranks, {counts.unknowns} unknowns, an iteration: {counts.messages:.0f} messages to "
        f"{counts.neighbours} neighbours, {counts.bytes / 1e3:.0f} kB, {counts.reductions:.0f} reductions, "
        f"{counts.linear_iterations:.1f} linear iterations"
    )
    yield f"measured on 1 rank, {alone.unknowns} unknowns: {1e6 * work:.2f} us of the processor an unknown"
    yield f"assumed: latency {1e6 * LATENCY:g} us, {BANDWIDTH / 1e9:g} GB/s a rank; parts are equal squares"
    whole, part = 6 * (cells + 1) ** 2, 6 * (work_of + 1) ** 2
    for p in ranks:
        row = []
        for unknowns in (whole, p * part):
            seconds, talk = predicted(work, counts, unknowns, p)
            share = efficiency(work, counts, unknowns, p)
            row.append(f"{unknowns / 1e6:.2f} million unknowns {1e3 * seconds:.0f} ms, efficiency {share:.2f}, "
                       f"{100 * talk:.1f} % of it messages and sums")  # fmt: skip
        yield f"predicted, {p:3d} ranks: {'; '.join(row)}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--cells", type=command.positive, default=40)
    parser.add_argument("--end", type=command.number, default=0.02, help="s")
    args = command.parse(parser)
    command.say(json.dumps(asdict(counted(args.cells, args.end, MPI.COMM_WORLD))))
    return 0


if __name__ == "__main__":
    command.run(main)
