"""Small systems on several ranks: each rank factorises the whole matrix, which is faster and repeats to the last bit.

MUMPS on several ranks adds up as messages come, in the analysis, the factors and the solution, whatever its ordering;
residual and stiffness are the same bits each time. `mpirun -n 2 python demos/studies/redundant.py` compares the two.
"""

import numpy as np
from petsc4py import PETSc


class Redundant:
    """Context of a PC of PETSc's type "python".

    Public: `ksp`, of this rank alone, with MUMPS's factors.

    Args:
        prefix: of PETSc's options, which are those of the shared system.
    """

    def __init__(self, prefix: str) -> None:
        self.ksp = alone(prefix)
        self._shared: PETSc.Mat | None = None
        self._whole: list[PETSc.Mat] | None = None

    def setUp(self, pc: PETSc.PC) -> None:
        """Gather the matrix and factorise it."""
        _, A = pc.getOperators()
        if self._shared != A:  # a new one has another pattern
            self._release()
            self._shared = A
        every = PETSc.IS().createStride(A.size[0], step=1, comm=PETSc.COMM_SELF)
        self._whole = gather(self.ksp, A, every, self._whole)
        self.ksp.setUp()
        pc.setFailedReason(self.ksp.getPC().getFailedReason())

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve on every rank, and keep the own part."""
        assert self._whole is not None
        right, answer = self._whole[0].createVecs()
        b.comm.tompi4py().Allgatherv(np.array(b.array_r), [right.array_w, np.diff(b.owner_ranges)])
        self.ksp.solve(right, answer)
        x.array_w[:] = answer.array_r[slice(*x.owner_range)]

    def reset(self, pc: PETSc.PC) -> None:
        """Forget the factors."""
        self.ksp.reset()

    def destroy(self, pc: PETSc.PC) -> None:
        """Let everything go."""
        self._release()
        self.ksp.destroy()

    def _release(self) -> None:
        for matrix in [*(self._whole or []), *([self._shared] if self._shared else [])]:
            matrix.destroy()
        self._shared = self._whole = None


def alone(prefix: str) -> PETSc.KSP:
    """A solver of one rank by factors, of these options."""
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOptionsPrefix(prefix)
    ksp.setFromOptions()
    ksp.setType("preonly")
    return ksp


def gather(ksp: PETSc.KSP, A: PETSc.Mat, every: PETSc.IS, last: list[PETSc.Mat] | None) -> list[PETSc.Mat]:
    """Give a solver of one rank the part of a shared matrix at these unknowns; last: what this has returned before."""
    part = A.createSubMatrices([every], [every], last)
    part[0].stateIncrease()  # which PETSc forgets
    for option in (PETSc.Mat.Option.SYMMETRIC, PETSc.Mat.Option.SYMMETRY_ETERNAL):
        part[0].setOption(option, ksp.getPC().getType() == "cholesky")
    ksp.setOperators(part[0])
    return part


def own(ksp: PETSc.KSP) -> PETSc.KSP:
    """What has the factors: a KSP itself, or that of this rank."""
    pc = ksp.getPC()
    return pc.getPythonContext().ksp if pc.getType() == "python" else ksp
