"""How much energy a law can make: the work that it gives back round closed loops of the strains E11 and E22.

The measured coupling has no potential, so that round a loop a fabric can do work. A loop counts when it has been gone
round before. What it makes is the work that it gives back and what it has stored more than a round before; with the
measured coupling stress and state come back to what they were, and the second part is nothing. With the reciprocal one
they creep from round to round, and it takes more rounds until what a loop makes by that is used up.

As a program it prints, for the continuous law and the one with a potential, the worst loop that a short search finds,
and the least eigenvalue of the tangent's symmetric part on random polygons of six strains (E11, E22, 2 E12) in the box
of those that were measured; for the latter law also the worst of many such polygons. The checked numbers: it makes
nothing, and its tangent is positive.
"""

import argparse

import numpy as np

from fabric_fenicsx import fabrics
from fabric_fenicsx.app import command
from fabric_fenicsx.laws import HasPotential
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.woven import Woven

CORNERS, ROUNDS = 6, 3
"""Of a polygon; the last round counts."""


def path(loops, t):
    """Strains (n, 2) of loops (n, 6) at a part t of the way round.

    A loop: centre (2), half widths (2), phase of E22 against E11 as a part of a turn, and 1 for a rectangle (gone
    round the one way or the other by its phase) or 0 for an ellipse.
    """
    centre, half, phase = loops[:, :2], loops[:, 2:4], loops[:, 4]
    round_ = np.column_stack([np.cos(2 * np.pi * t) + 0 * phase, np.cos(2 * np.pi * (t + phase))])
    x, y = (np.interp(4 * t, range(5), corners) for corners in ([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1]))
    cornered = np.where(phase[:, None] < 0.5, (x, y), (y, x))
    return centre + half * np.where(loops[:, 5:] > 0.5, cornered, round_)


def created(law, loops, parts, rounds):
    """What the last of some rounds makes, and the most that is stored on the way, both J/m3; and the gap; all (n,).

    gap: how far the stress is from that of the round before, over its largest size. Work is exact for a law with a
    potential, by the trapezoidal rule for others.
    """
    n, exact = len(loops), isinstance(law, HasPotential)
    state, stress, last = np.tile(law.initial_state, (n, 1)), np.zeros((n, 3)), np.zeros((n, 3))
    work, peak, size = np.zeros(n), np.zeros(n), np.full(n, 1e-300)
    for k in range(rounds * parts + 1):
        strain = np.column_stack([path(loops, (k % parts) / parts), np.zeros(n)])
        gained = law.potential(strain, state) - law.potential(last, state) if exact else None
        new, _, state = law.respond(strain, state)
        if k >= (rounds - 1) * parts:
            stored = law.recoverable(strain, state)
            if k == (rounds - 1) * parts:
                first, stored_first = new, stored
            else:
                work += gained if exact else 0.5 * ((new + stress) * (strain - last)).sum(axis=1)
            peak, size = np.maximum(peak, stored), np.maximum(size, np.abs(new).max(axis=1))
        stress, last = new, strain
    return stored - stored_first - work, peak, np.abs(stress - first).max(axis=1) / size


def inside(loops, low, high):
    """The loops, moved and shrunk into the box of strains from low to high, each (2,)."""
    loops, size = loops.copy(), high - low
    centre = np.clip(loops[:, :2], low + 0.02 * size, high - 0.02 * size)
    loops[:, :2] = centre
    loops[:, 2:4] = np.clip(loops[:, 2:4], 0.005 * size, np.minimum(centre - low, high - centre))
    loops[:, 4] %= 1.0
    return loops


def box(fabric):
    """Lowest and highest strains (3,): from the contraction of the uniaxial tests to their ends, shear both ways."""
    (nu12, nu21), high = fabric.poisson["measured"], [c.limit for c in (fabric.warp, fabric.weft, fabric.shear)]
    return np.array([-nu21 * high[1], -nu12 * high[0], -high[2]]), np.array(high)


def polygons(law, n, seed=0):
    """The most that the last round of n random polygons makes of what it stores, of a law with a potential."""
    rng, most = np.random.default_rng(seed), -np.inf
    for start in range(0, n, 50_000):
        size = min(50_000, n - start)
        corners = rng.uniform(*box(law.fabric), (CORNERS, size, 3))
        state, last, made, peak = np.tile(law.initial_state, (size, 1)), np.zeros((size, 3)), np.zeros(size), 1e-300
        for k in range(CORNERS * ROUNDS + 1):
            strain, counts = corners[k % CORNERS], k > CORNERS * (ROUNDS - 1)
            if counts:
                made -= law.potential(strain, state) - law.potential(last, state)
            _, _, state = law.respond(strain, state)
            last, stored = strain, law.recoverable(strain, state)
            if k == CORNERS * (ROUNDS - 1):
                made -= stored
            peak = np.maximum(peak, stored)
        most = max(most, float(np.max((made + stored) / peak)))
    return most


def softest(law, n=20_000, seed=1):
    """Least eigenvalue of the tangent's symmetric part, Pa, at the corners of n random polygons."""
    corners = np.random.default_rng(seed).uniform(*box(law.fabric), (CORNERS, n, 3))
    state, least = np.tile(law.initial_state, (n, 1)), np.inf
    for strain in corners:
        _, C, state = law.respond(strain, state)
        least = min(least, np.linalg.eigvalsh(0.5 * (C + C.transpose(0, 2, 1))).min())
    return float(least)


def worst(law, trials=2000, generations=25, parts=400, seed=0):
    """The loop that makes most energy as a part of what is stored at its peak: random loops, the best bred further.

    Strains lie between the contraction of the uniaxial tests and their ends. The best twenty are gone round again in
    five times as many parts, since a law of first order makes or loses some energy by its increments alone.
    """
    rounds = 10 if isinstance(law, Woven) and law.reciprocal else ROUNDS
    rng = np.random.default_rng(seed)
    low, high = (ends[:2] for ends in box(law.fabric))
    size = high - low

    def score(loops, parts):
        made, stored, _ = created(law, loops, parts, rounds)
        return made / np.maximum(stored, 1.0)

    loops = np.column_stack([
        rng.uniform(low, high, (trials, 2)), rng.uniform(0, 0.5, (trials, 2)) * size, rng.uniform(0, 1, trials),
        rng.integers(0, 2, trials),
    ])  # fmt: skip
    loops, width = inside(loops, low, high), 0.2
    share = score(loops, parts)
    for _ in range(generations):
        best = np.argsort(-share)[:20]
        young = np.repeat(loops[best], 10, axis=0)
        young[:, :5] += width * rng.normal(size=(len(young), 5)) * [*size, *size, 0.5]
        young = inside(young, low, high)
        loops, share = np.vstack([loops[best], young]), np.concatenate([share[best], score(young, parts)])
        width *= 0.85
    finalists = loops[np.argsort(-share)[:20]]
    made, stored, gap = created(law, finalists, 5 * parts, rounds)
    best = int(np.argmax(made / np.maximum(stored, 1.0)))
    centre, half = finalists[best, :2], finalists[best, 2:4]
    return {
        "share": float(made[best] / stored[best]),
        "created_kJ_per_m3": float(made[best] / 1e3),
        "stored_kJ_per_m3": float(stored[best] / 1e3),
        "gap": float(gap[best]),
        "rounds": rounds,
        "rectangle": bool(finalists[best, 5] > 0.5),
        "E11": [float(centre[0] - half[0]), float(centre[0] + half[0])],
        "E22": [float(centre[1] - half[1]), float(centre[1] + half[1])],
        "loop": finalists[best].tolist(),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fabric", default="all", help=f"{', '.join(fabrics.names())}, a TOML file, or all (default)")
    parser.add_argument("--loops", type=command.positive, default=1_000_000, help="random polygons a fabric")
    args = command.parse(parser)
    made, soft = "energy made, of what is stored", "least eigenvalue, MPa"
    command.say(f"{'':24s}{made:>48s}{soft:>24s}")
    polygon = f"of {args.loops} polygons"
    command.say(
        f"{'fabric':24s}{'continuous':>12s}{'potential':>12s}{polygon:>24s}{'continuous':>12s}{'potential':>12s}"
    )
    most, least = -np.inf, np.inf
    for name in fabrics.names() if args.fabric == "all" else [args.fabric]:
        fabric = fabrics.load(name)
        laws, search = (Woven(fabric), Potential(fabric)), {"trials": 300, "generations": 8, "parts": 150}
        old, new = (worst(law, **search)["share"] for law in laws)
        soft_old, soft_new = (softest(law) for law in laws)
        many = polygons(laws[1], args.loops)
        most, least = max(most, new, many), min(least, soft_new)
        eigenvalues = f"{soft_old / 1e6:12.3g}{soft_new / 1e6:12.3g}"
        command.say(f"{fabric.name:24s}{old:12.2f}{new:12.1e}{many:24.1e}{eigenvalues}")
    good = most <= 1e-12 and least > 0.0
    said = "the law with a potential makes less than 1e-12, its tangent is positive definite"
    command.say(f"check: {said}: {'yes' if good else 'NO'}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
