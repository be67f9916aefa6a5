"""A linear system of a sheet on several ranks, shared by MUMPS or factorised as a whole by each of them.

    mpirun -n 2 python demos/studies/redundant.py --cells 4 8 16 32 64

An elastic strip under its weight, twice as many cells along it as across. Prints the median of the time and of the
processor time of one rank that factors and solution take, in turn, and how many different answers there were. The
checked number: where each rank has the whole matrix, one.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import hashlib
import time

import numpy as np
from dolfinx import fem

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers import linear
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

COMM = MPI.COMM_WORLD
SAID = "{cells:3d} cells across, {unknowns:6d} unknowns: {name:6s} {wall:.4f} s, {cpu:.4f} s of processor, {n} answers"


def solver(cells, whole):
    """Of a strip, at rest and under its weight."""
    domain = meshing.read(meshing.MESHES / "strip.geo", COMM, length=0.2, width=0.1, nx=2 * cells, ny=cells)
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(1e6, 0.3), 1e-3, (4e5, 4e5))
    weight = cloth.weight(0.2, fem.Constant(domain.mesh, (0.0, 0.0, -9.81)))
    before, linear.WHOLE = linear.WHOLE, whole
    try:
        return cloth.equilibrium(supports.clamp(domain, cloth.space, "fixed_end"), weight, search="newton")
    finally:
        linear.WHOLE = before


def answer(own):
    """Times of one system of a solver, and a mark of its solution."""
    b = own.residual(own.begin()).copy()
    ksp, x = own.factorised(), b.duplicate()
    COMM.Barrier()
    clock, processor = time.perf_counter(), time.process_time()
    ksp.setUp()
    ksp.solve(b, x)
    if ksp.getConvergedReason() < 0:
        raise StepFailed("MUMPS has not solved the system.")
    COMM.Barrier()
    times = time.perf_counter() - clock, time.process_time() - processor
    parts = COMM.allgather(hashlib.sha256(x.array_r.tobytes()).hexdigest())
    return times, "".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--cells", type=command.positive, nargs="+", default=[4, 8, 16, 32, 64])
    parser.add_argument("--repeats", type=command.positive, default=10)
    args, worst = command.parse(parser), 1
    for cells in args.cells:
        both = {"shared": solver(cells, 0), "whole": solver(cells, np.inf)}
        times, marks = {name: [] for name in both}, {name: set() for name in both}
        for _ in range(args.repeats):
            for name, own in both.items():
                spent, mark = answer(own)
                times[name].append(spent)
                marks[name].add(mark)
        for name, own in both.items():
            wall, cpu = np.median(times[name], axis=0)
            unknowns = own.tangent.A.size[0]
            command.say(SAID.format(cells=cells, unknowns=unknowns, name=name, wall=wall, cpu=cpu, n=len(marks[name])))
        worst = max(worst, len(marks["whole"]))
    command.say(f"check: one answer where each rank has the whole matrix: {'yes' if worst == 1 else 'NO'}")
    return 0 if worst == 1 else 1


if __name__ == "__main__":
    command.run(main)
