"""The cheap trials of `demos/studies/stability.py`, and that it would see one that goes wrong."""

from dataclasses import replace
from pathlib import Path

import pytest

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.printed import Printed
from fabric_fenicsx.laws.woven import Woven

SUBJECTS = ("thickness", "yarns", "poisson", "slack", "far", "reversals", "rotation", "cells", "loads", "time_steps",
            "explicit_steps", "inputs", "bending")  # fmt: skip


@pytest.fixture
def stability(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent.parent / "demos" / "studies")
    import stability

    return stability


@pytest.mark.parametrize("subject", SUBJECTS)
def test_trials_end_as_they_must(stability, subject):
    subjects = {each.__name__: each for each in stability.stability_more.SUBJECTS}
    assert set(subjects) == set(SUBJECTS)
    trials = list(subjects[subject](quick=True))
    assert trials
    for trial in trials:
        verdict, said = stability.stability_trials.attempt(trial)
        assert stability.as_wanted(trial.wanted, verdict), f"{trial.tried}: {verdict}, {said}"


def test_what_goes_wrong_is_seen(stability):
    def raising(error):
        def call():
            raise error

        return call

    trials = stability.stability_trials
    calls = {
        "works": lambda: ("", True),
        "inaccurate": lambda: ("", False),
        "refused": raising(InputError("")),
        "stopped": raising(StepFailed("")),
        "FAULT": raising(trials.NotRestored()),
    }
    for verdict, call in calls.items():
        assert trials.attempt(trials.Trial("", call))[0] == verdict
    assert trials.attempt(trials.Trial("", raising(ZeroDivisionError())))[0] == "FAULT"
    for wanted, allowed in (("works", {"works"}), ("refused", {"refused"}), ("any", {"works", "refused", "stopped"})):
        assert {verdict for verdict in calls if stability.as_wanted(wanted, verdict)} == allowed
    rows = [
        {"tried": "a", "verdict": "works", "wanted": "works"},
        {"tried": "b", "verdict": "stopped", "wanted": "any"},
    ]
    assert stability.limit(rows) == "1 work, 0 refused; not: b"


@pytest.mark.parametrize("law", [Woven, Printed])
def test_a_fabric_made_in_python_is_checked_by_its_law(law):
    fabric = fabrics.load("blend")
    with pytest.raises(InputError, match=r"Poisson's ratios 1\.25 and 0\.8 must have a product below 1"):
        law(replace(fabric, poisson={"measured": (1.25, 0.8)}))
    falling = replace(fabric.shear, modulus=(1e6, -1e8, 0.0, 0.0))
    with pytest.raises(InputError, match=r"the shear curve has moduli of -.* must be positive"):
        law(replace(fabric, shear=falling))
    law(replace(fabric, poisson={"measured": (1.24, 0.8)}))
