"""One material point without a mesh: any law along a path of strains, stresses or both; and a check of a law.

uniaxial(law, np.linspace(0, 0.2, 50), angle=np.pi / 4).plot("bias.png")
print(check(law))
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, StepFailed
from . import Array, Law
from .checks import Report, as_path, check, listed
from .stability import Result, rotate_strain, rotate_stress, rotate_tangent

__all__ = ["Report", "check", "mixed", "run", "uniaxial"]

type Answer = tuple[Array, Array, Array]
type Point = Callable[[Array, Array], Answer]


def run(law: Law, strain_path: ArrayLike, angle: float = 0.0) -> Result:
    """Drive one point, unstrained so far, through the strains (n, m), and commit after every one.

    `angle` (radians) turns the axes of path and result against the warp (m = 3 only). InputError where
    the path cannot be used; StepFailed where the law answers with something that is not finite.
    """
    path = as_path(strain_path)
    return mixed(law, path, ["strain"] * path.shape[1], angle, max_iterations=0, max_halvings=0)


def uniaxial(law: Law, strains: ArrayLike, direction: int = 0, angle: float = 0.0, **options: Any) -> Result:
    """Uniaxial stress of a plane law: axial strains (n,) along axis 0 (warp) or 1 (weft), no other stress.

    `angle` (radians) turns the axes, and so the axial direction, against the warp. Options: see `mixed`.
    """
    axial = np.asarray(strains, dtype=np.float64)
    if axial.ndim != 1 or direction not in (0, 1):
        raise InputError("the axial strains must have the shape (steps,), and the direction be 0 or 1.")
    targets = np.zeros((len(axial), 3))
    targets[:, direction] = axial
    return mixed(law, targets, ["strain" if k == direction else "stress" for k in range(3)], angle, **options)


def mixed(
    law: Law,
    targets: ArrayLike,
    prescribed: Sequence[str],
    angle: float = 0.0,
    *,
    rtol: float = 1e-10,
    max_iterations: int = 25,
    max_halvings: int = 10,
) -> Result:
    """Drive one point, unstrained so far, through targets (n, m): each a strain or a stress in Pa.

    `prescribed` says which, per component: "strain" or "stress". Newton with the law's tangent, which may be
    nonsymmetric; a correction is shortened while it does not lower the residual, and a step that still
    fails (at a kink, say) is halved, each part being committed. Converged is a residual below
    rtol x (largest stress) + 1e-12 x (largest modulus). `angle` as in `run`.
    InputError where the input cannot be used; StepFailed where a part of 2^-max_halvings of a step fails.
    """
    path = as_path(targets)
    m = path.shape[1]
    if len(prescribed) != m or not set(prescribed) <= {"strain", "stress"}:
        raise InputError(f'prescribed must hold "strain" or "stress" for each of the {m} components.')
    if not np.isfinite(angle) or (angle and m != 3):
        raise InputError("the angle must be finite, and zero for a law that is not plane (m = 3).")
    point, given = _point(law, angle), np.array([p == "strain" for p in prescribed])
    strain, state = np.zeros(m), np.array(law.initial_state, dtype=np.float64)
    start = stress = point(strain, state)[0]
    old, rows = np.where(given, strain, stress), []
    for step, target in enumerate(path):
        done, part = 0.0, 1.0
        while done < 1:
            goal = target if done + part == 1 else old + (done + part) * (target - old)
            answer, history = _newton(point, strain, state, goal, given, rtol, max_iterations)
            if answer is not None:
                strain, stress, tangent, state = answer  # the commit
                done += part
                if part < 1 and (done / part) % 2 == 0:  # grow where the larger part has its place
                    part *= 2
            elif part > 2.0**-max_halvings:
                part /= 2
            else:
                raise StepFailed(
                    f"step {step + 1} of {len(path)} stopped {done:.4g} of the way to the target "
                    f"{listed(target)}, in parts of {part:.2g}, at strain {listed(strain)} with the residuals "
                    f"{listed(history)} Pa; the material may be unstable there, or the target out of reach."
                )
        old = target
        rows.append((strain, stress, tangent, state))
    return Result.of(start, *(np.array(column) for column in zip(*rows, strict=True)))


def _newton(
    point: Point, strain: Array, state: Array, goal: Array, given: Array, rtol: float, iterations: int
) -> tuple[tuple[Array, Array, Array, Array] | None, list[float]]:
    """Strain, stress, tangent and new state at the goal, or None; and the norms of the residuals in Pa."""
    free, jump = np.logical_not(given), np.where(given, goal - strain, 0.0)
    if free.any():  # a linear guess: no stress peak from the step in the given strains alone
        stress, tangent, _ = point(strain, state)
        guess = _correction(goal - stress - tangent @ jump, tangent, free)
        jump = jump if guess is None else jump + guess
    strain = np.where(given, goal, strain + jump)
    history: list[float] = []
    for _ in range(iterations + 1):
        stress, tangent, new_state = point(strain, state)
        residual = np.where(given, 0.0, goal - stress)
        history.append(float(np.linalg.norm(residual)))
        if not (np.isfinite(stress).all() and np.isfinite(tangent).all()):
            return None, [*history[:-1], np.nan]
        largest = max(np.abs(stress).max(), np.abs(goal[free]).max(initial=0))
        if history[-1] <= rtol * largest + 1e-12 * np.abs(tangent).max():
            return (strain, stress, tangent, new_state), history
        change = _correction(residual, tangent, free)
        if change is None:
            break
        for _ in range(8):
            shorter = np.where(given, 0.0, goal - point(strain + change, state)[0])
            if np.linalg.norm(shorter) < history[-1]:  # false for NaN
                break
            change = change / 2
        strain = strain + change
    return None, history


def _correction(residual: Array, tangent: Array, free: Array) -> Array | None:
    """Change of the free strains (the others zero) that cancels the residual; None if that is singular."""
    change = np.zeros(len(free))
    try:
        change[free] = np.linalg.solve(tangent[np.ix_(free, free)], residual[free])
    except np.linalg.LinAlgError:
        return None
    return change


def _point(law: Law, angle: float) -> Point:
    """One point of the law, without batch axis, in turned axes; copies keep a law from writing into it."""

    def respond(strain: Array, state: Array) -> Answer:
        turned = rotate_strain(strain[None], -angle) if angle else strain[None].copy()
        stress, tangent, new_state = (np.array(a[0]) for a in law.respond(turned, state[None].copy()))
        if angle:
            stress, tangent = rotate_stress(stress, angle), rotate_tangent(tangent, angle)
        return stress, tangent, new_state

    return respond
