"""What the law and its hook cost: the plane law against a memory copy, the hook against assembly.

Times are medians over repeats; compare ratios, not machines. The targets: the law takes at most 2.5 times
a copy of the arrays it touches, and law and data transfer at most 15 % of the assembly of residual and
Jacobian. Only the absence of allocations is checked; how fast is fast enough is for the reader to judge.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
import warnings
from functools import partial
from itertools import product
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import numpy as np
import tensile
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc as fempetsc
from numba.core.runtime import _nrt_python, rtsys

from fabric_fenicsx import fabrics
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.printed import Printed
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.output import results
from fabric_fenicsx.shell import kinematics
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import yarns
from fabric_fenicsx.terms import hook, weakform

COPY_TARGET, HOOK_TARGET = 2.5, 0.15
ELEMENTS = {
    "Q1 quadrilaterals, 2x2 points": (mesh.CellType.quadrilateral, 1, 2, 4),
    "P2 triangles, 3 points": (mesh.CellType.triangle, 2, 2, 3),
    "Q2 quadrilaterals, 3x3 points": (mesh.CellType.quadrilateral, 2, 4, 9),
}
"""Cell, degree of the displacement, degree of the quadrature rule, points of a cell."""


def clock(repeats, *calls, comm=MPI.COMM_SELF):
    """Times in s, shape (repeats, calls), of calls that are made in turn; the slowest rank counts."""
    for call in calls:
        call()
    times = np.empty((repeats, len(calls)))
    for i in range(repeats):
        for j, call in enumerate(calls):
            comm.Barrier()
            start = time.perf_counter()
            call()
            times[i, j] = comm.allreduce(time.perf_counter() - start, MPI.MAX)
    return times


# The law: strains and committed states of many points


def uniaxial(law, n, rng):
    """Warp stress, every point a little further than ever before."""
    nu = law.fabric.poisson["measured"][0]
    end = law.fabric.warp.limit * rng.uniform(0.5, 1.0, (n, 1)) * [1.0, -nu, 0.0]
    return end, law.respond(0.95 * end, np.tile(law.initial_state, (n, 1)))[2]


def turned(law, n, rng):
    """Both yarns and shear a little below their peaks."""
    curves = law.fabric.warp, law.fabric.weft, law.fabric.shear
    peak = rng.uniform(0.3, 0.6, (n, 1)) * [curve.limit for curve in curves]
    state = law.respond(peak, np.tile(law.initial_state, (n, 1)))[2]
    return peak * rng.uniform(0.96, 1.0, (n, 3)), state


def scattered(law, n, rng):
    """Any strain after any past: every branch in no order, the worst case."""
    low, high = np.array([-0.1, -0.1, -0.6]), np.array([0.3, 0.3, 0.6])
    state, strain = np.tile(law.initial_state, (n, 1)), np.zeros((n, 3))
    for _ in range(4):
        # one point in two takes a small step, so that the ramps are met as well
        strain, last = rng.uniform(low, high, (n, 3)), strain
        strain += rng.choice([0.0, 0.99], (n, 1)) * (last - strain)
        state, past = law.respond(strain, state)[2], state
    return strain, past


MIXES = {"virgin uniaxial": uniaxial, "unloading": turned, "random branches": scattered}


def recorded(angle):
    """What the law is asked in a tensile test of its fabric, over the whole cycle."""

    def mix(law, n, rng):
        calls = []

        class Recorder(Woven):
            def respond(self, strain, state, out=None):
                calls.append((strain.copy(), state.copy()))
                return super().respond(strain, state, out)

        ny = int(np.clip(np.sqrt(n / 720), 1, 12))
        ends = "free" if angle == 45.0 else "clamped"
        case = tensile.Case(law.fabric, angle, cells=(3 * ny, ny), degree=1, steps=8, ends=ends)
        scene = tensile.strip(case, MPI.COMM_SELF)
        scene.points.begin(Recorder(law.fabric))
        tensile.run(case, comm=MPI.COMM_SELF, scene=scene)
        # whole calls, evenly spread over the test
        wanted = np.linspace(0, len(calls) - 1, n // len(calls[0][0]) + 1).astype(int)
        strain, state = (np.concatenate([calls[k][i] for k in wanted]) for i in (0, 1))
        return np.resize(strain, (n, 3)), np.resize(state, (n, state.shape[1]))

    return mix


def law_table(points, repeats):
    """Rows of the law's table, and whether no call allocated memory."""
    blend, duck = (fabrics.load(name) for name in ("blend", "duck"))
    cases = [
        ("continuous", Woven(blend), "virgin uniaxial", uniaxial),
        ("continuous", Woven(blend), "unloading", turned),
        ("continuous", Woven(blend), "random branches", scattered),
        ("continuous", Woven(blend), "blend bias test", recorded(45.0)),
        ("continuous", Woven(duck), "duck weft test", recorded(90.0)),
        ("no shear hysteresis", Woven(blend, shear_hysteresis=False), "random branches", scattered),
        ("reciprocal", Woven(blend, coupling="reciprocal"), "random branches", scattered),
        ("printed", Printed(blend), "random branches", scattered),
    ]
    rows, clean = [], True
    for name, law, mix, make in cases:
        strain, state = make(law, points, np.random.default_rng(0))
        out = np.empty((points, 3)), np.empty((points, 3, 3)), np.empty_like(state)
        arrays = [strain, state, *out]
        targets = [np.empty_like(array) for array in arrays]

        def copy(arrays=arrays, targets=targets):
            for array, target in zip(arrays, targets, strict=True):
                np.copyto(target, array)

        def respond(law=law, strain=strain, state=state, out=out):
            law.respond(strain, state, out)

        times = clock(repeats, copy, respond)
        extra = allocated(respond, len(arrays))
        clean = clean and extra == 0
        copy_s, law_s = np.median(times, axis=0)
        rows.append(
            {
                "law": name,
                "points_are": mix,
                "copy_ns": copy_s / points * 1e9,
                "law_ns": law_s / points * 1e9,
                "ratio": float(np.median(times[:, 1] / times[:, 0])),
                "allocated_bytes": extra,
            }
        )
    return rows, clean


def pair_table(points, repeats):
    """Rows: the law with a potential and the continuous one, in turns, on the same kinds of points."""
    rows = []
    for name, (mix, make) in product(fabrics.names(), MIXES.items()):
        fabric, calls = fabrics.load(name), []
        for law in (Woven(fabric), Potential(fabric)):
            strain, state = make(law, points, np.random.default_rng(0))
            out = np.empty((points, 3)), np.empty((points, 3, 3)), np.empty_like(state)
            calls.append(partial(law.respond, strain, state, out))
        calls.append(partial(law.potential, strain, state))
        # the least times: what else runs on the machine only adds
        continuous, potential, energy = clock(repeats, *calls).min(axis=0) / points * 1e9
        rows.append(
            {"fabric": name, "points_are": mix, "continuous_ns": continuous, "potential_ns": potential}
            | {"ratio": potential / continuous, "energy_ns": energy}
        )
    return rows


def allocated(call, arrays):
    """Bytes that NumPy allocates in a call, or blocks that Numba does beyond one handle per array; 0 if none.

    What a call of a Python function takes, 2 kB at most, does not count.
    """
    call()
    _nrt_python.memsys_enable_stats()
    blocks = rtsys.get_allocation_stats().alloc
    call()
    blocks = rtsys.get_allocation_stats().alloc - blocks - arrays
    _nrt_python.memsys_disable_stats()
    tracemalloc.start()
    call()
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    call()
    used = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    return max(blocks, 0) + (used if used > 2048 else 0)


# The hook: a strip of about the given number of points, in the middle of a bias test


class Timed:
    """A law that keeps the time of its last call."""

    def __init__(self, law):
        self.law, self.initial_state, self.symmetric, self.last = law, law.initial_state, law.symmetric, 0.0

    def respond(self, strain, state, out=None):
        start = time.perf_counter()
        out = self.law.respond(strain, state, out)
        self.last = time.perf_counter() - start
        return out


def hook_row(element, points, repeats, comm):
    """A row of the hook's table."""
    cell, degree, rule, per_cell = ELEMENTS[element]
    squares = points / per_cell / (2 if cell == mesh.CellType.triangle else 1)
    ny = max(1, round((squares / 3) ** 0.5))
    length, width = 76.2e-3, 25.4e-3
    domain = mesh.create_rectangle(comm, [[0, 0], [length, width]], [max(1, round(squares / ny)), ny], cell)
    V = fem.functionspace(domain, ("Lagrange", degree, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    strain = kinematics.membrane_strain(u, yarns.plane_axes(domain, np.pi / 4))
    law = Timed(Woven(fabrics.load("blend")))
    fabric = hook.LawHook(law, strain, domain, degree=rule)
    residual = weakform.internal(fabric.stress, strain, u, v, law.law.fabric.thickness, fabric.dx)
    ends = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 0.0) | np.isclose(x[0], length))
    bcs = [fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, ends), V)]
    solver = statics.StaticSolver(residual, u, bcs)

    def wave(pull):
        # pulled, narrowed, and uneven: from one pull to the next some points load and others unload
        def field(x):
            s, t = x[0] / length, x[1] / width
            along = pull * x[0] * (1 + 0.2 * np.sin(9 * s) * np.cos(40 * pull))
            return np.vstack([along, -0.5 * pull * x[1] * (1 + 0.3 * np.sin(7 * s + 3 * t))])

        return field

    u.interpolate(wave(0.20))
    solver.commit()
    u.interpolate(wave(0.21))

    (form,), ksp = solver.terms, solver.snes.ksp
    A, b = fempetsc.create_matrix(form.jacobian), fempetsc.create_vector(V)
    x = b.duplicate()
    law_times = []

    def evaluate():
        fabric.evaluate()
        law_times.append(law.last)

    def assemble_residual():
        with b.localForm() as local:
            local.set(0.0)
        fempetsc.assemble_vector(b, form.residual)

    def assemble_jacobian():
        A.zeroEntries()
        fempetsc.assemble_matrix(A, form.jacobian, bcs=bcs)
        A.assemble()

    times = clock(repeats, evaluate, assemble_residual, assemble_jacobian, comm=comm)
    hook_s, residual_s, jacobian_s = np.median(times, axis=0)
    law_s = comm.allreduce(float(np.median(law_times[1:])), MPI.MAX)
    ksp.setOperators(A)
    solve_s = np.median(clock(max(2, repeats // 10), assemble_jacobian, lambda: ksp.solve(b, x), comm=comm)[:, 1])
    return {
        "element": element,
        "points": comm.allreduce(per_cell * domain.topology.index_map(2).size_local),
        "unknowns": V.dofmap.index_map.size_global * V.dofmap.index_map_bs,
        "strain_ms": (hook_s - law_s) * 1e3,
        "law_ms": law_s * 1e3,
        "residual_ms": residual_s * 1e3,
        "jacobian_ms": jacobian_s * 1e3,
        "solve_ms": solve_s * 1e3,
        "share": float(np.median(times[:, 0] / (times[:, 1] + times[:, 2]))),
    }


# Start-up, in fresh processes

STARTUP = """
import json, sys, time
times, last = {}, time.perf_counter()
def lap(name):
    global last
    times[name], last = time.perf_counter() - last, time.perf_counter()
from mpi4py import MPI
import tensile
lap("imports")
u, solver, fabric, pull, _ = tensile.strip(tensile.Case(tensile.fabrics.load("blend"), 45.0, **tensile.THESIS))
lap("mesh and forms")
fabric.evaluate()
lap("first call of the law")
pull(1e-3)
solver.solve()
lap("first step")
import pyvista
pyvista.Plotter
lap("import for pictures")
json.dump(times, sys.stdout)
"""


def startup_table():
    """Seconds of each stage of demos/tensile.py up to its first step, with empty and with full caches."""
    with tempfile.TemporaryDirectory() as folder:
        env = os.environ | {"XDG_CACHE_HOME": folder, "NUMBA_CACHE_DIR": str(Path(folder) / "numba")}
        env["PYTHONPATH"] = os.pathsep.join(sys.path)
        cold, warm = (
            json.loads(subprocess.check_output([sys.executable, "-c", STARTUP], env=env, text=True)) for _ in range(2)
        )
    return [{"stage": stage, "empty_caches_s": cold[stage], "full_caches_s": warm[stage]} for stage in cold]


def show(title, rows, path):
    """Print a table and write it as CSV, on rank 0."""
    if MPI.COMM_WORLD.rank != 0:
        return
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    text = [[f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values()] for row in rows]
    widths = [max(map(len, column)) for column in zip(*text, list(rows[0]), strict=True)]
    print(f"\n{title}")
    for line in [list(rows[0]), *text]:
        print("  ".join(f"{word:>{width}}" for word, width in zip(line, widths, strict=True)), flush=True)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--points", type=command.positive, default=100_000, help="over all ranks")
    parser.add_argument(
        "--quick", action="store_true", help="few repeats, a tenth of the points in the hook, no start-up times"
    )
    parser.add_argument("--out", type=Path, default=Path("out/benchmark"))
    return command.parse(parser)


def main():
    args, comm = arguments(), MPI.COMM_WORLD
    out = results.folder(args.out)
    warnings.simplefilter("ignore", UserWarning)  # strains beyond the measured range are meant here

    law, clean = law_table(max(1, args.points // comm.size), 10 if args.quick else 50)
    clean = comm.allreduce(clean, MPI.LAND)
    show("The law: ns a point; the copy is one of each of its five arrays", law, out / "law.csv")
    pairs = pair_table(max(1, args.points // comm.size), 10 if args.quick else 50)
    show("The law with a potential: ns a point, in turns with the continuous law", pairs, out / "potential.csv")
    points, repeats = (max(1, args.points // 10), 5) if args.quick else (args.points, 20)
    rows = [hook_row(element, points, repeats, comm) for element in ELEMENTS]
    show("The hook: ms a Newton iteration; share = (strain + law) / (residual + Jacobian)", rows, out / "hook.csv")
    if comm.size == 1 and not args.quick:
        show("Start-up of demos/tensile.py: s", startup_table(), out / "startup.csv")

    ratio = max(row["ratio"] for row in law if row["law"] == "continuous")
    share = max(row["share"] for row in rows)
    dearest = {mix: max(row["ratio"] for row in pairs if row["points_are"] == mix) for mix in MIXES}
    command.say(
        "\npotential / continuous, at most: " + ", ".join(f"{mix} {value:.2f}" for mix, value in dearest.items())
    )
    command.say(
        f"largest: law / copy {ratio:.2f} (target {COPY_TARGET}), hook / assembly {share:.1%} "
        f"(target {HOOK_TARGET:.0%}), for information"
    )
    command.say(f"check: no memory allocated by a law with out=: {'yes' if clean else 'NO'}; see {out}")
    return 0 if clean else 1


if __name__ == "__main__":
    command.run(main)
