"""Runs that are killed at random moments and gone on with; demos/studies/kills.py does a hundred, on more ranks."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / "demos" / "studies"))
import kills


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_killed_run_goes_on_to_the_history_of_one_that_was_not(tmp_path):
    """To the same text; a motion that begins on two ranks and goes on, on one, to the same numbers."""
    assert kills.study(2, tmp_path, pairs=((1, 1), (2, 1)), kinds=("motion",)) == 0
