"""How much of a correction is taken: pure numbers, and Newton's method on a barrier."""

import numpy as np
import pytest

from fabric_fenicsx.solvers.search import SMALL, TRIALS, part_to_take


@pytest.mark.parametrize("end", [0.9, 0.2, 0.0, -0.2])
def test_a_whole_correction_is_taken_where_the_slope_is_small_or_still_positive_at_its_end(end):
    asked = []
    assert part_to_take(lambda part: asked.append(part) or 1.0 + part * (end - 1.0), 1.0) == 1.0
    assert asked == [1.0]


@pytest.mark.parametrize("power", [1, 3, 9])
@pytest.mark.parametrize("zero", [0.02, 0.3, 0.6])
def test_one_that_overshoots_is_shortened_to_a_small_slope(power, zero):
    def slope(part):
        return 1.0 - (part / zero) ** power

    asked = []
    part = part_to_take(lambda part: asked.append(part) or slope(part), 1.0)
    assert part == asked[-1]  # where the residual was asked for last
    assert abs(slope(part)) <= SMALL or len(asked) == TRIALS + 1
    assert 0.0 < part < 1.0


@pytest.mark.parametrize("start", [1.0, -1.0])
def test_what_has_no_residual_is_not_taken(start):
    def slope(part):
        return start if part < 0.3 else np.nan

    assert part_to_take(slope, start) < 0.3


def test_a_slope_that_rises_at_the_start_is_no_reason_to_search():
    assert part_to_take(lambda part: -5.0, -1.0) == 1.0


def test_corrections_that_are_too_long_end_in_balance():
    """2.2 times those of Newton's method, on a force with a kink: whole ones never end."""

    def force(x):
        return x / 2 - 1.0 if x < 0.0 else 10 * x - 1.0

    def after(iterations, shortened):
        x = -1.0
        for _ in range(iterations):
            way = -force(x) / (0.5 if x < 0.0 else 10.0) * 2.2
            part = (
                part_to_take(lambda p, x=x, way=way: -force(x + p * way) * way, -force(x) * way) if shortened else 1.0
            )
            x += part * way
        return abs(force(x))

    assert after(30, True) < 1e-6 < 1.0 < after(30, False)
