"""The sheets in motion of 7.3.2 and 7.3.3: histories, what the energies say, and pictures at the thesis's times."""

import csv
import sys
import tempfile
import warnings
from pathlib import Path

import drape as drape_demo
import moving
import poke as poke_demo

from fabric_fenicsx.errors import StepFailed

from .statics import draw

warnings.filterwarnings("ignore", message=".*beyond the measured")


def _arguments(demo, words):
    """What the demo's own command line makes of these words."""
    before = sys.argv
    try:
        sys.argv = [demo.__name__, *map(str, words)]
        return demo.arguments()
    finally:
        sys.argv = before


def _play(demo, words, times, most):
    """Run a demo's scene to its end, to where it stops, or until it has taken `most` Newton iterations."""
    args, pictures, taken = _arguments(demo, words), {}, []

    def watch(row, *shown):
        t = row["time_s"]
        taken.append(row.get("newton_iterations", 0))
        for wanted in times:
            if abs(t - wanted) < 1e-9:
                pictures[f"{wanted:g} s"] = draw(*shown, f"{scene.name}, t = {t:.2f} s")
        if sum(taken) > most:
            raise StepFailed(f"Given up at t = {t:g} s, after {sum(taken)} Newton iterations.")

    with tempfile.TemporaryDirectory() as folder:
        scene, stopped = demo.scene(args), None
        try:
            moving.play(scene, args, Path(folder), progress=False, watch=watch)
        except StepFailed as error:
            stopped = str(error)
        with open(Path(folder) / "history.csv", newline="") as file:
            rows = list(csv.DictReader(file))
    history = {name: [float(row[name]) for row in rows] for name in (rows[0] if rows else ())}
    most = max(scene.ledger.most, 1e-300)
    return {
        "history": history,
        "stopped": stopped,
        "stopped_at_s": history["time_s"][-1] if stopped else None,
        "imbalance_percent": 100 * scene.ledger.worst / most,
        "external_work_most_J": most,
        "law_gives_back_percent": 100 * scene.ledger.made / most,
        "dissipated_least_percent": 100 * min(*history["dissipated_J"], 0.0) / most,
        "iterations_a_step": sum(history["newton_iterations"]) / max(sum(history["steps_taken"]), 1),
        "smallest_part": scene.run.finest,
        "pictures": pictures,
    }


def drape(times, most, **options):
    """The sheet held at its four corners; options: of drape.py, times: of pictures (s), most: Newton iterations."""
    return _play(drape_demo, _words(options), times, most)


def poke(times, most, **options):
    """The sheet pushed out and back; options: of poke.py, times: of pictures (s), most: Newton iterations."""
    return _play(poke_demo, _words(options), times, most)


def _words(options):
    """{"no_rotary": True, "cells": 20} as a command line."""
    words = []
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        words += [flag] if value is True else [] if value is False else [flag, value]
    return words
