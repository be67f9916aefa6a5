"""One material point without a mesh: any law along a path of strains, stresses or both; and a check of a law.

uniaxial(law, np.linspace(0, 0.2, 50), angle=np.pi / 4).plot("bias.png")
print(check(law))
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, StepFailed
from . import Array, Law
from .stability import Result, rotate_strain, rotate_stress, rotate_tangent

NAMES = ("the stress", "the tangent", "the new state")
TANGENT = 1e-5  # relative error of a tangent that `check` lets pass

type Answer = tuple[Array, Array, Array]
type Point = Callable[[Array, Array], Answer]


def run(law: Law, strain_path: ArrayLike, angle: float = 0.0) -> Result:
    """Drive one point, unstrained so far, through the strains (n, m), and commit after every one.

    `angle` (radians) turns the axes of path and result against the warp (m = 3 only). InputError where
    the path cannot be used; StepFailed where the law answers with something that is not finite.
    """
    path = _path(strain_path)
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
    path = _path(targets)
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
                    f"{_list(target)}, in parts of {part:.2g}, at strain {_list(strain)} with the residuals "
                    f"{_list(history)} Pa; the material may be unstable there, or the target out of reach."
                )
        old = target
        rows.append((strain, stress, tangent, state))
    return Result.of(start, *(np.array(column) for column in zip(*rows, strict=True)))


def _path(values: ArrayLike) -> Array:
    path = np.array(values, dtype=np.float64)
    if path.ndim != 2 or 0 in path.shape or not np.isfinite(path).all():
        raise InputError(f"a path must be finite, of shape (steps, components), but it is {path.shape}.")
    return path


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


def _list(values: ArrayLike) -> str:
    return "(" + ", ".join(f"{v:.4g}" for v in np.atleast_1d(np.asarray(values))) + ")"


@dataclass(frozen=True)
class Report:
    """What `check` saw of a law that kept its promises."""

    points: int  # tangents looked at, each with its own strain and history
    judged: float  # share of their entries that differences can judge, as the stress has no kink there
    tangent_error: float  # largest |tangent - central difference|, relative to the largest entry of its row
    tangent_strain: Array  # (m,), the strain at which that was
    symmetric: bool  # what the law declares
    asymmetry: float  # largest |C - C^T| over the largest |C| of a point

    def __str__(self) -> str:
        return (
            f"all promises kept at {self.points} points; worst tangent error {self.tangent_error:.1e} at "
            f"strain {_list(self.tangent_strain)}, {self.judged:.1%} of the entries judged (rest: kinks); "
            f"declared symmetric = {self.symmetric}, largest asymmetry seen {self.asymmetry:.1e}."
        )


@np.errstate(all="ignore")  # what is not finite is found and named
def check(law: Law, strains: ArrayLike | None = None, seed: int = 0) -> Report:
    """Hold a law to the promises of `Law`; InputError names the first one broken, and the strain.

    `strains` (n, m): where to look; without it 64 random strains of a plane law, of 1e-4 to 0.3. Each is
    looked at from the initial state and again after each of three steps to random others of them.
    A tangent is judged by central differences where both one-sided differences agree; where they do not,
    the stress has a kink, and any of its tangents is right.
    """
    rng = np.random.default_rng(seed)
    if strains is None:
        strains = 10 ** rng.uniform(-4, -0.5, (64, 1)) * rng.uniform(-1, 1, (64, 3))
    E = _path(strains)
    n = len(E)
    start = getattr(law, "initial_state", None)
    if not (isinstance(start, np.ndarray) and start.ndim == 1 and start.dtype == np.float64):
        raise InputError("initial_state must be a one-dimensional NumPy array of float64.")
    if not isinstance(getattr(law, "symmetric", None), bool | np.bool):
        raise InputError("symmetric must be True or False.")
    state, asymmetry, judged, worst, where = np.tile(start, (n, 1)), 0.0, 0.0, -1.0, E[0]
    for _ in range(4):
        stress, tangent = _check_answers(law, E, state, rng)
        skew = np.abs(tangent - np.swapaxes(tangent, 1, 2)).max((1, 2)) / (np.abs(tangent).max((1, 2)) + 1e-300)
        asymmetry = max(asymmetry, float(skew.max()))
        _require(skew < 1e-10 if law.symmetric else True, E, "symmetric is True but the tangent is not so")
        error, smooth = _tangent_errors(law, E, state, stress, tangent)
        _require((error <= TANGENT).all((1, 2)), E, "the tangent is not the derivative of the stress")
        judged += float(smooth.mean()) / 4
        if error.max() > worst:
            worst, where = float(error.max()), E[error.max((1, 2)).argmax()]
        state = _ask(law, E[rng.permutation(n)], state)[2]
    if judged == 0:
        raise InputError("the stress has a kink or a jump at every strain looked at; no tangent can be judged.")
    return Report(4 * n, judged, worst, where, bool(law.symmetric), asymmetry)


def _check_answers(law: Law, E: Array, state: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """All promises but those on the tangent, which is returned with the stress."""
    n, m = E.shape
    answer = _ask(law, E, state)
    first = tuple(a.copy() for a in answer)
    _require_close(first, first, E, "{} is not finite")
    _require_close(_ask(law, E, state), first, E, "{} differs when the same is asked again", 0)
    out = (np.full((n, m), np.nan), np.full((n, m, m), np.nan), np.full(state.shape, np.nan))
    _require_close(_ask(law, E, state, out), first, E, "{} is another one when out is given")
    _require_close(out, first, E, "{} is not written into out")
    _ask(law, E[::-1], state)
    _require_close(answer, first, E, "{} returned earlier is changed by a later call", 0)
    alone = [_ask(law, E[k : k + 1], state[k : k + 1]) for k in range(n)]
    single = [np.concatenate(a) for a in zip(*alone, strict=True)]
    _require_close(single, first, E, "{} depends on the other points of the batch")
    far = rng.uniform(-10, 10, (n, m))
    answer = _ask(law, far, state)
    _require_close(answer, answer, far, "{} is not finite")
    three = [0, 0, n - 1]  # the one in the middle is made unusable; n may be 1
    for k, bad in product(range(m), (np.nan, np.inf)):
        batch = E[three]
        batch[1, k] = bad
        answer = _ask(law, batch, state[three])
        _require(np.isnan(answer[0][1]).all(), batch[1:2], "the stress is not NaN")
        sides, expected = [a[::2] for a in answer], [a[three[::2]] for a in first]
        _require_close(sides, expected, batch[::2], "{} is spoilt by a neighbour that is not finite")
    return first[0], first[1]


def _tangent_errors(law: Law, E: Array, state: Array, S: Array, C: Array) -> tuple[Array, NDArray[np.bool]]:
    """Relative errors of the tangent, 0 where it cannot be judged, and whether it can be: both (n, m, m)."""
    forward, backward = np.empty_like(C), np.empty_like(C)
    for j in range(E.shape[1]):
        for side, difference in ((1, forward), (-1, backward)):
            moved = E.copy()
            moved[:, j] += side * 1e-8 * np.maximum(1, np.abs(E[:, j]))
            difference[:, :, j] = (_ask(law, moved, state)[0] - S) / (moved - E)[:, j, None]
    # An error counts against its row, or against what round-off in the largest stress does to a difference.
    noise = 16 * np.finfo(float).eps * np.abs(S).max(1) / 1e-8
    scale = (np.abs(C).max(2) + noise[:, None] / TANGENT + 1e-300)[:, :, None]
    # One limit for both, so that a tangent between two agreeing one-sided differences is never refused.
    smooth = np.abs(forward - backward) / scale <= TANGENT
    return np.where(smooth, np.abs((forward + backward) / 2 - C) / scale, 0.0), smooth


def _ask(law: Law, E: Array, state: Array, out: Answer | None = None) -> Answer:
    """The law's answer, if it raises nothing, has the right form and leaves its arguments alone."""
    strain, committed = E.copy(), state.copy()
    try:
        answer = law.respond(strain, committed) if out is None else law.respond(strain, committed, out)
    except Exception as error:
        for k in range(len(E) if len(E) > 1 else 0):
            _ask(law, E[k : k + 1], state[k : k + 1])  # raises with the strain that is to blame
        raise InputError(f"respond raises {error!r}, at strain {_list(E[0])}.") from error
    _require(np.array_equal(strain, E, equal_nan=True), E, "respond changes the strain it is given")
    _require(np.array_equal(committed, state, equal_nan=True), E, "respond changes the state it is given")
    if not isinstance(answer, tuple) or len(answer) != 3:
        raise InputError("respond must return a tuple of stress, tangent and new state.")
    for name, array, shape in zip(NAMES, answer, (E.shape, (*E.shape, E.shape[1]), state.shape), strict=True):
        if not isinstance(array, np.ndarray) or array.dtype != np.float64 or array.shape != shape:
            form = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
            _require(False, E, f"{name} must be an array of float64 {shape} but is {form}")
    return answer


def _require_close(a: Sequence[Array], b: Sequence[Array], E: Array, what: str, rtol: float = 1e-10) -> None:
    """All three arrays the same, point by point, relative to the largest entry of the point; NaN is never."""
    for name, x, y in zip(NAMES, a, b, strict=True):
        axes = tuple(range(1, x.ndim))
        size = np.abs(y).max(axes, initial=0)
        _require(np.abs(x - y).max(axes, initial=0) <= rtol * size, E, what.format(name))


def _require(kept: NDArray[np.bool] | bool, E: Array, broken: str) -> None:
    if (lost := np.flatnonzero(~np.broadcast_to(kept, len(E)))).size:
        raise InputError(f"{broken}, at strain {_list(E[lost[0]])}.")
