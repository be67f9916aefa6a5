"""Follows marks through a series of photographs.

Between two photographs a mark may move by less than half of the distance to its neighbour from where it was, from where
its motion would take it, or, if about all of them are seen, from where the pattern as a whole has gone. One that is not
where its neighbours go is lost; a lost one is looked for again, where its neighbours say, in every photograph that
follows. What a hand has corrected counts as it stands.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..laws import Array
from .marks import FAINT, SYMMETRIC, Picture

GATE = 0.45  # of the distance to the next mark: how far a mark may be from where it is expected
NEIGHBOURS = 8  # of a mark, whose motion it goes along with
ROUNDS = 4  # of matching marks, each with the motion of those met before
APART = 0.2  # of the distance to the next mark: how far it may be from where they say
LOST, FOUND, BY_HAND = 0, 1, 2


@dataclass
class Tracks:
    """Marks through m photographs, in pixels."""

    x: Array
    """(m, n, 2); where a mark is lost, the place where it was looked for."""
    state: np.ndarray
    """(m, n): of `LOST`, `FOUND` and `BY_HAND`."""

    @property
    def places(self) -> Array:
        """(m, n, 2), NaN where a mark is lost."""
        return np.where((self.state == LOST)[..., None], np.nan, self.x)


def follow(pictures: list[Callable[[], Picture]], x0: Array, hand: Array) -> Tracks:
    """Follow marks from their places `x0` (n, 2) in the first photograph.

    `hand` (m, n, 2) has places that were corrected by hand, infinite where a mark is not to be seen, NaN elsewhere.
    pictures: each is opened once, in order, and let go.
    """
    m, n = hand.shape[:2]
    x, state = np.zeros((m, n, 2)), np.zeros((m, n), dtype=int)
    spacing = cKDTree(x0).query(x0, k=2)[0][:, 1]
    depth = np.zeros(n)
    for k, opened in enumerate(pictures):
        picture = opened()
        if k == 0:
            x[0], state[0] = x0, FOUND
        else:
            x[k], state[k] = _next(picture, x[:k], state[:k], spacing, depth)
        given = np.isfinite(hand[k]).all(axis=-1)
        x[k, given], state[k, given] = hand[k, given], BY_HAND
        state[k, np.isinf(hand[k]).any(axis=-1)] = LOST
        seen = state[k] != LOST
        if k == 0:
            depth = picture.depth(x0)
        if seen.sum() > 1:
            near = cKDTree(x[k, seen]).query(x[k, seen], k=2)[0][:, 1]
            spacing[seen] = near
    return Tracks(x, state)


def _next(picture: Picture, x: Array, state: np.ndarray, spacing: Array, depth: Array) -> tuple[Array, np.ndarray]:
    """Places and states in a photograph, from those in the photographs before it, (k, n, 2) and (k, n)."""
    marks, last = picture.marks(), x[-1]
    known = state[-1] != LOST
    guesses = [last] if len(x) < 2 else [2 * last - x[-2], last]
    guesses += [_as_a_whole(marks, last, known)] if len(marks) > 3 and known.sum() > 3 else []
    matches = [_match(marks, guess, known, spacing) for guess in guesses]
    found = max(matches, key=lambda one: int((one >= 0).sum()))
    place, seen = last.copy(), found >= 0
    if not seen.any():
        return guesses[0], np.full(len(last), LOST)
    place[seen] = marks[found[seen]]
    while seen.sum() > 3:  # one that is wrong makes its neighbours look wrong: the worst goes first
        off = np.linalg.norm(place[seen] - carried(last[seen], last[seen], place[seen]), axis=1) / spacing[seen]
        if off.max() <= APART:
            break
        seen[np.flatnonzero(seen)[off.argmax()]] = False
    missing = np.flatnonzero(~seen)
    place[missing] = carried(last[missing], last[seen], place[seen])
    again, symmetric = picture.place(place[missing])
    near = np.linalg.norm(again - place[missing], axis=1) < APART * spacing[missing]
    good = near & picture.whole(again) & (symmetric > SYMMETRIC)
    place[missing[good]], seen[missing[good]] = again[good], True
    seen &= picture.depth(place) > FAINT * depth
    return place, np.where(seen, FOUND, LOST)


def _as_a_whole(marks: Array, last: Array, known: np.ndarray) -> Array:
    """Where the marks are if the pattern has the middle and the spread of all that is seen, and has hardly turned."""

    def spread(x: Array) -> tuple[Array, Array]:
        values, axes = np.linalg.eigh(np.cov(x.T) + 1e-6 * np.eye(2))
        return x.mean(axis=0), axes * np.sqrt(values) @ axes.T

    (before, one), (after, other) = spread(last[known]), spread(marks)
    return np.asarray(after + (last - before) @ np.linalg.solve(one, other))


def _match(marks: Array, guess: Array, known: np.ndarray, spacing: Array) -> np.ndarray:
    """Which of the `marks` each one is (n,), -1 where it is none; a guess is mended by the affine map of those met."""
    out = np.full(len(guess), -1)
    if not len(marks) or not known.any():
        return out
    tree, numbers = cKDTree(marks), np.flatnonzero(known)
    for _ in range(ROUNDS):
        far, nearest = tree.query(guess)
        back = cKDTree(guess[known]).query(marks)[1]
        met = known & (numbers[back[nearest]] == np.arange(len(guess))) & (far < GATE * spacing)
        out = np.where(met, nearest, -1)
        A = np.column_stack([np.ones(len(guess)), guess])
        if met.sum() < 6:
            break
        guess = A @ np.linalg.lstsq(A[met], marks[nearest[met]])[0]
    return out


def carried(at: Array, before: Array, after: Array) -> Array:
    """Where places `at` (p, 2) have gone with the marks around them, which went from `before` to `after`.

    By the affine map of the nearest ones, of which a few may be wrong; a mark tells nothing of itself.
    """
    if not len(at):
        return at
    near = cKDTree(before).query(at, k=np.arange(1, min(NEIGHBOURS + 1, len(before)) + 1))[1]
    out = np.empty_like(at)
    for i, (place, numbers) in enumerate(zip(at, near, strict=True)):
        d, moved = before[numbers] - place, after[numbers] - before[numbers]
        others = (d != 0).any(axis=1)
        d, moved = (d[others], moved[others]) if others.any() else (d, moved)
        flat = np.linalg.svd(d - d.mean(axis=0), compute_uv=False)
        if len(d) < 4 or flat[-1] < 0.2 * flat[0]:
            out[i] = place + np.median(moved, axis=0)
            continue
        A = np.column_stack([np.ones(len(d)), d])
        c = np.linalg.lstsq(A, moved)[0]
        miss = np.linalg.norm(A @ c - moved, axis=1)
        good = miss <= 3 * np.median(miss) + 0.1
        out[i] = place + (np.linalg.lstsq(A[good], moved[good])[0] if 4 <= good.sum() < len(good) else c)[0]
    return out
