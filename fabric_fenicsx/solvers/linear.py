"""How the linear system of a Newton iteration is solved: PETSc options, and what its solvers are to know of a sheet."""

import itertools
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import fem, la
from petsc4py import PETSc

from ..shell.directors import ShellSpace
from ..surfaces import placing
from .redundant import Redundant, own
from .substructures import Substructures

Options = dict[str, object]
"""None: not given, where another has been."""

DIRECT: Options = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}
"""LU by MUMPS, the default: few entries of a surface fill in; 340 x 340 cells take 7.1 GB."""

# of a front on several ranks, which ScaLAPACK would take, pivots are not counted
SYMMETRIC: Options = DIRECT | {"pc_type": "cholesky", "mat_mumps_icntl_13": 1}
"""LDL' by MUMPS, the default where all terms are symmetric: about half the entries (`demos/studies/scaling.py`)."""

# rows of given unknowns make any stiffness non-symmetric; from the right, it is true forces that become small
GMRES: Options = {"ksp_type": "gmres", "ksp_pc_side": "right", "ksp_gmres_restart": 100}

ITERATIVE: Options = GMRES | {
    "ksp_rtol": 1e-6,
    "ksp_max_it": 500,
    "pc_type": "gamg",
    "pc_factor_mat_solver_type": None,
    "pc_mg_cycle_type": "w",
    "mg_levels_ksp_type": "richardson",
    "mg_levels_pc_type": "sor",
    "mg_levels_ksp_max_it": 2,
    # unknowns of a coarse grid that no rigid motion moves
    "mg_levels_pc_sor_diagonal_shift": 1e-12,
}
"""GMRES with smoothed aggregation, which keeps `RigidMotions`.

Iterations on 40 x 40 and 80 x 80 cells, elastic sheet at rest, "mitc4": flat, 35, 34 for h/L = 1e-2 and 47, 63 for
1e-4; stretched by 0.5 %, 21, 19 and 15, 19. "regge", whose thin flat sheet of 80 x 80 cells 500 do not solve, takes two
to four times as many. Without rigid motions, the flat sheet of 40 x 40 cells is not solved by 500. LU takes a third to
a tenth of the time.
"""

IN_MOTION: Options = GMRES | {
    "ksp_rtol": 1e-4,
    "ksp_max_it": 500,
    "pc_type": "gamg",
    "pc_factor_mat_solver_type": None,
    "mg_levels_ksp_type": "chebyshev",
    # of whole nodes at once, which PETSc leaves where a diagonal is shifted: with it twice the iterations
    "mg_levels_pc_type": "sor",
    "mg_levels_ksp_max_it": 2,
}
"""For `newmark`, whose mass helps: a V-cycle of smoothed aggregation.

Drape of blend, bending of its own, "mitc4", step 5 ms, iterations of the first linear system on 20 x 20, 40 x 40,
80 x 80 and 160 x 160 cells: 4, 4, 5, 5; buckled, at 0.3 s, 7 and 9 on the first two. On 160 x 160 it takes 2.0 s, and
LDL' 1.5. The first 0.1 s of 500 x 500 cells (1.5 million unknowns) take 20 steps of 4 to 8 of Newton's with 6 to 12 in
each, 75 s of one processor a step, and 9.3 GB (`demos/studies/scaling.py --cells 500 --solver iterative`).
"""


MUMPS: Options = {"mat_mumps_icntl_6": 0, "mat_mumps_icntl_8": 1}
"""A stiffness has a diagonal: MUMPS need look for no other, and scale by it. That saves 10 to 20 % of the time."""

NULL_PIVOTS: Options = {"mat_mumps_icntl_24": 1, "mat_mumps_cntl_3": -1e-20, "mat_mumps_icntl_13": 1}
"""Found and left alone, on several ranks too: what nothing resists is not moved by round-off. By MUMPS's own threshold
the smallest pivots of thin shells that lock would pass for null."""

SMALL: Options = {"mat_mumps_icntl_7": 2}
"""An ordering by least fill (AMF) saves as much; from 10 000 unknowns on MUMPS's own choice is better."""

ROOM: Options = {"mat_mumps_icntl_14": 200}
"""MUMPS guesses the room that it needs, on several ranks not well enough, and then fails (10 725 unknowns of a strip on
two): percent more of it."""

WHOLE = 10000
"""Unknowns below which each of several ranks factorises the whole matrix: `redundant`."""

PARTED = 4000
"""Unknowns from which each of several ranks eliminates its own interior, where null pivots need not be counted."""

FACTORS = {"lu": "LU by MUMPS", "cholesky": "LDL' by MUMPS"}
"""Types of PETSc's PC, and their names."""

_number = itertools.count()


def weak(method: Callable[..., Any]) -> Callable[..., Any]:
    """A callback that does not keep its owner alive: PETSc's reference closes a cycle that Python cannot see."""
    reference = weakref.WeakMethod(method)
    return lambda *arguments: reference()(*arguments)  # type: ignore[misc]


def configure(snes: PETSc.SNES, A: PETSc.Mat, options: Options, symmetric: bool = False) -> None:
    """Give a SNES its options, under a prefix of its own; A: its Jacobian, factorised as LDL' where it is symmetric.

    Options that name a preconditioner, such as `DIRECT`, are taken as they are. As options they outlive a change of the
    pattern, with which MUMPS starts anew.
    """
    prefix = f"statics{next(_number)}_"
    snes.setOptionsPrefix(prefix)
    store = PETSc.Options(prefix)
    several, size = A.comm.size > 1, A.size[0]
    whole = several and size < WHOLE
    room = ROOM if several and not whole else SMALL if size < 10000 else {}
    every = MUMPS | room | (SYMMETRIC if symmetric else DIRECT) | options
    given = {name: value for name, value in every.items() if value is not None}
    for name, value in given.items():
        store[name] = value
    snes.setFromOptions()
    pc = snes.ksp.getPC()
    parted = several and size >= PARTED and "mat_mumps_icntl_24" not in given
    if (parted or whole) and pc.getType() in FACTORS and given["pc_factor_mat_solver_type"] == "mumps":
        pc.setType("python")
        pc.setPythonContext(Substructures(prefix, WHOLE) if parted else Redundant(prefix))
    weakref.finalize(snes, _forget, store, list(given))


def method(snes: PETSc.SNES) -> str:
    """How a SNES solves its linear systems, in words."""
    kind, pc = snes.ksp.getType(), own(snes.ksp).getPC().getType()
    factors = FACTORS.get(pc, pc)
    return factors if kind == "preonly" else f"{kind} with {factors}"


def _forget(store: PETSc.Options, names: list[str]) -> None:
    for name in names:
        store.delValue(name)


class RigidMotions:
    """Translations and rotations of a sheet, which do not strain it: the near-null space of its stiffness.

    q: displacement, or (u, d) of the shell `space`; y: what is solved for, q or (u, angles). Rotations turn
    displacements about the origin and directors with them, as they are at the time of `give`.
    """

    def __init__(self, q: fem.Function, y: fem.Function, space: ShellSpace | None) -> None:
        self._q, self._space = q, space
        V = q.function_space
        U, dofs = (V, np.arange(len(q.x.array))) if space is None else V.sub(0).collapse()
        self._size = V.mesh.geometry.dim
        self._dofs = np.array(dofs).reshape(-1, self._size)
        self._places = placing.places(U)[:, : self._size]
        count = self._size * (self._size + 1) // 2
        self._motions = [fem.Function(y.function_space) for _ in range(count)]

    def give(self, A: PETSc.Mat, fixed: np.ndarray) -> None:
        """Let the solvers of A know the motions; at the owned unknowns `fixed`, which are given, they are 0."""
        n = self._size
        x = self._places + self._q.x.array[self._dofs]
        moves = [(np.eye(n)[k], np.zeros((n, n))) for k in range(n)]
        for i in range(n):
            for j in range(i):
                spin = np.zeros((n, n))
                spin[i, j], spin[j, i] = 1.0, -1.0
                moves.append((np.zeros(n), spin))
        for motion, (shift, spin) in zip(self._motions, moves, strict=True):
            v = np.zeros(len(self._q.x.array))
            v[self._dofs] = shift + x @ spin.T
            if self._space is not None:
                v[self._space.nodes] = self._q.x.array[self._space.nodes] @ spin.T
                v = self._space.rate(v)
            v[fixed] = 0.0
            motion.x.array[:] = v
        la.orthonormalize([motion.x for motion in self._motions])
        A.setNearNullSpace(
            PETSc.NullSpace().create(vectors=[motion.x.petsc_vec for motion in self._motions], comm=A.comm)
        )
