"""What is said of a step that Newton's method has not solved."""

from collections.abc import Sequence

from petsc4py import PETSc

from ..errors import StepFailed

REASONS = {value: name.lower() for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)}
"""PETSc's number -> its name."""


def failed(reason: str, residuals: Sequence[float], where: str) -> StepFailed:
    """What to raise: the reason, norms of the residuals of all iterations in N, and the largest strain, if known."""
    norms = [f"{norm:.2e}" for norm in residuals]
    history = ", ".join(norms if len(norms) <= 8 else [*norms[:4], "...", *norms[-4:]])
    return StepFailed(
        f"Newton's method failed ({reason}); residuals in N: {history}{f'; largest strain in {where}' if where else ''}"
    )
