"""What is said of a step that Newton's method has not solved."""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ..errors import LawFailed, StepFailed

REASONS = {value: name.lower() for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)}
"""PETSc's number -> its name."""
SINGULAR = "residual or Jacobian is not finite, or singular"


def failed(reason: str, residuals: Sequence[float], where: str) -> StepFailed:
    """What to raise: the reason, norms of the residuals of all iterations in N, and the largest strain, if known."""
    norms = [f"{norm:.2e}" for norm in residuals]
    history = ", ".join(norms if len(norms) <= 8 else [*norms[:4], "...", *norms[-4:]])
    return StepFailed(
        f"Newton's method failed ({reason}); residuals in N: {history}{f'; largest strain in {where}' if where else ''}"
    )


def blame(comm: MPI.Comm, fault: Exception | None) -> None:
    """Raise LawFailed, on every rank, if a law has raised on one of them."""
    faults = [said for said in comm.allgather(fault and repr(fault)) if said]
    if faults:
        raise LawFailed(f"A law must not raise, but one did: {faults[0]}.") from fault


def solve(ksp: PETSc.KSP, b: PETSc.Vec, x: PETSc.Vec) -> str:
    """Solve a linear system; why there is no answer, on every rank, or nothing."""
    try:
        ksp.solve(b, x)
    except PETSc.Error:  # what a factorisation meets is the same on every rank
        return SINGULAR
    if ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT:
        return "diverged_linear_solve"
    return "" if ksp.getConvergedReason() >= 0 and np.isfinite(x.norm()) else SINGULAR
