"""Holds a law to its promises: those of `Law`, and of what it offers besides."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from . import Array, HasAdvance, HasCalibration, HasPotential, HasRecoverable, HasStiffest, HasStiffness, Law

NAMES = ("the stress", "the tangent", "the new state")
TANGENT = 1e-5  # relative error of a tangent that `check` lets pass
POTENTIAL = 1e-8  # and of a difference of the potential, over the sum of |S dE|

type Answer = tuple[Array, Array, Array]


def as_path(values: ArrayLike) -> Array:
    """Strains or targets (steps, components) as an array of its own, finite and not empty; InputError."""
    found = np.array(values, dtype=np.float64)
    if found.ndim != 2 or 0 in found.shape or not np.isfinite(found).all():
        raise InputError(f"a path must be finite, of shape (steps, components), but it is {found.shape}.")
    return found


def listed(values: ArrayLike) -> str:
    """Numbers as a message shows them."""
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
    potential_error: float | None = None  # largest |dW - work of the stress| over the sum of |S dE|; None without W

    def __str__(self) -> str:
        return (
            f"all promises kept at {self.points} points; worst tangent error {self.tangent_error:.1e} at "
            f"strain {listed(self.tangent_strain)}, {self.judged:.1%} of the entries judged (rest: kinks); "
            f"declared symmetric = {self.symmetric}, largest asymmetry seen {self.asymmetry:.1e}"
            + ("" if self.potential_error is None else f"; worst error of the potential {self.potential_error:.1e}")
            + "."
        )


@np.errstate(all="ignore")  # what is not finite is found and named
def check(law: Law, strains: ArrayLike | None = None, seed: int = 0) -> Report:
    """Hold a law to the promises of `Law` and of what else it offers; InputError names the first one broken.

    `strains` (n, m): where to look; without it 64 random strains of a plane law, of 1e-4 to 0.3. Each is
    looked at from the initial state and again after each of three steps to random others of them.
    A tangent is judged by differences where those to both sides agree; where they do not,
    the stress has a kink, and any of its tangents is right. A potential is judged likewise, by its differences over
    short straight increments and the integral of the stress along them.
    """
    rng = np.random.default_rng(seed)
    if strains is None:
        strains = 10 ** rng.uniform(-4, -0.5, (64, 1)) * rng.uniform(-1, 1, (64, 3))
    E = as_path(strains)
    n = len(E)
    state, asymmetry, judged, worst, where = np.tile(_members(law), (n, 1)), 0.0, 0.0, -1.0, E[0]
    committed, gradient = np.zeros_like(E), []
    for _ in range(4):
        stress, tangent = _check_answers(law, E, state, rng)
        skew, error, smooth = _check_tangent(law, E, state, stress, tangent)
        asymmetry = max(asymmetry, float(skew.max()))
        judged += float(smooth.mean()) / 4
        if error.max() > worst:
            worst, where = float(error.max()), E[error.max((1, 2)).argmax()]
        _check_stiffness(law, E, stress, tangent)
        gradient.append(_check_energy(law, E, state, committed, rng))
        committed = E[rng.permutation(n)]
        state = _ask(law, committed, state)[2]
    if judged == 0:
        raise InputError("the stress has a kink or a jump at every strain looked at; no tangent can be judged.")
    errors = np.concatenate(gradient)
    if isinstance(law, HasPotential) and not errors.size:
        raise InputError("the stress has a kink or a jump at every strain looked at; no potential can be judged.")
    W = float(errors.max()) if errors.size else None
    return Report(4 * n, judged, worst, where, bool(law.symmetric), asymmetry, W)


@np.errstate(all="ignore")
def glance(law: Law, components: int = 3) -> None:
    """Hold a law to what a run depends on, unstrained and at a few small strains; InputError as of `check`.

    It takes a millisecond or two, and sees neither what comes with history nor at large strains.
    """
    rng = np.random.default_rng(0)
    E = np.array([[0.0], [1e-4], [1e-3], [1e-2]]) * rng.uniform(-1, 1, (4, components))
    state = np.tile(_members(law), (len(E), 1))
    stress, tangent, _ = _check_batch(law, E, state)
    _check_tangent(law, E, state, stress, tangent)
    _check_stiffness(law, E, stress, tangent)


def _members(law: Law) -> Array:
    """The state of a point that was never strained, if all members are what they have to be."""
    start: Any = getattr(law, "initial_state", None)
    flat = isinstance(start, np.ndarray) and start.ndim == 1 and start.dtype == np.float64
    if not (flat and np.isfinite(start).all()):
        raise InputError("initial_state must be a one-dimensional NumPy array of float64, all finite.")
    if not isinstance(getattr(law, "symmetric", None), bool | np.bool):
        raise InputError("symmetric must be True or False.")
    if not callable(getattr(law, "respond", None)):
        raise InputError("respond must be a function of strain, state and out.")
    return np.asarray(start)


def _check_tangent(law: Law, E: Array, state: Array, stress: Array, tangent: Array) -> tuple[Array, Array, Any]:
    """The promises on the tangent; its asymmetry, and the errors of `_tangent_errors`."""
    skew = np.abs(tangent - np.swapaxes(tangent, 1, 2)).max((1, 2)) / (np.abs(tangent).max((1, 2)) + 1e-300)
    _require(skew < 1e-10 if law.symmetric else True, E, "symmetric is True but the tangent is not so")
    error, smooth = _tangent_errors(law, E, state, stress, tangent)
    _require((error <= TANGENT).all((1, 2)), E, "the tangent is not the derivative of the stress")
    return skew, error, smooth


def _check_batch(law: Law, E: Array, state: Array) -> tuple[Array, ...]:
    """The promises on what is returned and written for a few points; copies of it."""
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
    alone = zip(*(_ask(law, E[k : k + 1], state[k : k + 1]) for k in range(n)), strict=True)
    _require_close([np.concatenate(a) for a in alone], first, E, "{} depends on the other points of the batch")
    if isinstance(law, HasAdvance):
        law.advance(E, state, out[0], out[2])
        _require_close(out, first, E, "{} is another one without a tangent")
    return first


def _check_answers(law: Law, E: Array, state: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """All promises but those on the tangent, which is returned with the stress."""
    first, (n, m) = _check_batch(law, E, state), E.shape
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
        for side, slope in ((1, forward), (-1, backward)):
            # two one-sided differences, extrapolated: a modulus may have its least value at the strain itself
            for part, weight in ((1.0, -1.0), (0.5, 2.0)):
                moved = E.copy()
                moved[:, j] += part * side * 1e-8 * np.maximum(1, np.abs(E[:, j]))
                difference = weight * (_ask(law, moved, state)[0] - S) / (moved - E)[:, j, None]
                slope[:, :, j] = difference if part == 1.0 else slope[:, :, j] + difference
    # An error counts against its row, or against what round-off in the largest stress does to a difference.
    noise = 16 * np.finfo(float).eps * np.abs(S).max(1) / 1e-8
    scale = (np.abs(C).max(2) + noise[:, None] / TANGENT + 1e-300)[:, :, None]
    # One limit for both, so that a tangent between two agreeing one-sided differences is never refused.
    smooth = np.abs(forward - backward) / scale <= TANGENT
    return np.where(smooth, np.abs((forward + backward) / 2 - C) / scale, 0.0), smooth


def _check_stiffness(law: Law, E: Array, stress: Array, tangent: Array) -> None:
    """The promises of a stiffness, of a stiffest law and of a calibration."""
    m = E.shape[1]
    if isinstance(law, HasStiffness):
        C = law.stiffness
        _require(isinstance(C, np.ndarray) and C.shape == (m, m), E, f"stiffness must be an array ({m}, {m})")
        _require((np.abs(tangent - C) <= 1e-12 * np.abs(C).max()).all((1, 2)), E, "the tangent is not the stiffness")
        scale = np.abs(E) @ np.abs(C).T
        _require((np.abs(stress - E @ C.T) <= 1e-12 * scale).all(1), E, "the stress is not stiffness . strain")
    measured = np.ones(len(E), bool)
    if isinstance(law, HasCalibration):
        for k, strain in enumerate(E):
            said = law.beyond_calibration(strain[None].copy())
            _require(said is None or (isinstance(said, str) and said != ""), strain[None],
                     "beyond_calibration returns neither None nor a sentence")  # fmt: skip
            measured[k] = said is None
        _require(law.beyond_calibration(np.zeros((1, m))) is None, 0 * E[:1], "beyond_calibration is not None")
    if isinstance(law, HasStiffest):
        bound = law.stiffest
        K = _ask(bound, E, np.tile(bound.initial_state, (len(E), 1)))[1]
        soft = np.linalg.eigvalsh((K + np.swapaxes(K, 1, 2)) / 2)[:, 0]
        _require(soft > 0, E, "the stiffest law has a tangent that is not positive definite")
        _require((_stiff(tangent) <= (1 + 1e-9) * _stiff(K)) | ~measured, E, "the tangent is stiffer than the stiffest")


def _stiff(tangent: Array) -> Array:
    """Largest eigenvalue (n,) of the symmetric part."""
    return np.linalg.eigvalsh((tangent + np.swapaxes(tangent, 1, 2)) / 2)[:, -1]


def _check_energy(law: Law, E: Array, state: Array, committed: Array, rng: np.random.Generator) -> Array:
    """The promises of recoverable work and of a potential; relative errors of its differences where they are judged."""
    if not isinstance(law, HasRecoverable):
        return np.empty(0)
    new = _ask(law, E, state)[2]
    kept = _energy(law.recoverable, "recoverable", E, new)
    _require(kept >= 0, E, "recoverable is negative")
    if not isinstance(law, HasPotential):
        return np.empty(0)
    W = _energy(law.potential, "potential", E, state)
    close = 1e-10 * (np.abs(W) + np.abs(kept))
    _require(np.abs(_energy(law.potential, "potential", E, new) - kept) <= close, E,
             "the potential from the state after the strain is not what is recoverable")  # fmt: skip
    _require(W - kept >= -close, E, "a step makes energy: less potential than is recoverable after it")
    start, back = (_energy(f, "it", committed, state) for f in (law.potential, law.recoverable))
    _require(np.abs(start - back) <= 1e-10 * (np.abs(start) + np.abs(back)), committed,
             "the potential at the committed strain is not what is recoverable")  # fmt: skip
    # short increments, so that most are without a kink; the two rules agree where there is none
    size = np.abs(E) + 1e-3 * np.abs(E).max(0)
    moved = E + 1e-3 * size * rng.uniform(-1, 1, E.shape)
    rough, fine = (_work(law, E, moved, state, parts) for parts in (1, 2))
    ends = _energy(law.potential, "potential", moved, state), W
    S = np.abs(_ask(law, E, state)[0]) + np.abs(_ask(law, moved, state)[0])
    scale = (S * np.abs(moved - E)).sum(1) + 16 * np.finfo(float).eps * np.abs(ends).max(0) / POTENTIAL + 1e-300
    smooth = np.abs(rough - fine) <= 0.1 * POTENTIAL * scale
    error = np.where(smooth, np.abs(ends[0] - ends[1] - fine) / scale, 0.0)
    _require(error <= POTENTIAL, E, "the stress is not the gradient of the potential")
    return np.asarray(error[smooth])


def _work(law: Law, start: Array, end: Array, state: Array, parts: int) -> Array:
    """Work (n,) of the stress from the committed states along straight increments, by Lobatto's rule in each part.

    It looks at the ends, so that a kink close to one of them is seen.
    """
    inner = np.sqrt(3 / 7)
    points, weights = np.array([-1, -inner, 0, inner, 1]), np.array([9, 49, 64, 49, 9]) / 90
    total = np.zeros(len(start))
    for part in range(parts):
        for x, w in zip((part + (1 + points) / 2) / parts, weights / (2 * parts), strict=True):
            total += w * (_ask(law, start + x * (end - start), state)[0] * (end - start)).sum(1)
    return total


def _energy(member: Callable[[Array, Array], Array], name: str, E: Array, state: Array) -> Array:
    """The answer of an energy, if it has the right form, is finite and leaves its arguments alone."""
    strain, committed = E.copy(), state.copy()
    answer = member(strain, committed)
    _require(np.array_equal(strain, E) and np.array_equal(committed, state), E, f"{name} changes what it is given")
    if not (isinstance(answer, np.ndarray) and answer.shape == (len(E),) and answer.dtype == np.float64):
        _require(False, E, f"{name} must return an array of float64 ({len(E)},)")
    _require(np.isfinite(answer), E, f"{name} is not finite")
    return answer


def _ask(law: Law, E: Array, state: Array, out: Answer | None = None) -> Answer:
    """The law's answer, if it raises nothing, has the right form and leaves its arguments alone."""
    strain, committed = E.copy(), state.copy()
    try:
        answer = law.respond(strain, committed) if out is None else law.respond(strain, committed, out)
    except Exception as error:
        for k in range(len(E) if len(E) > 1 else 0):
            _ask(law, E[k : k + 1], state[k : k + 1])  # raises with the strain that is to blame
        raise InputError(f"respond raises {error!r}, at strain {listed(E[0])}.") from error
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
        raise InputError(f"{broken}, at strain {listed(E[lost[0]])}.")
