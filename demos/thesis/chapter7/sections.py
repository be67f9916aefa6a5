"""What every section of the report stands on: the answers of the cases, the thesis's own numbers, common curves."""

import tomllib
from pathlib import Path

import numpy as np

from fabric_fenicsx import fabrics, plots

from . import page

SAID = tomllib.loads(Path(__file__).with_name("printed.toml").read_text())
NAMES = ("blend", "denim", "duck", "muslin")
YARN = {"warp": ("E11", "S11"), "weft": ("E22", "S22")}


class Missing(Exception):
    """A case that a block cannot do without has no answer."""


class Answers:
    """The answers by the names of their cases; what was asked for in vain is kept in `missing`."""

    def __init__(self, done):
        self.done, self.missing = done, []

    def __getitem__(self, name):
        found = self.done.get(name)
        if found is None or found.answer is None:
            self.missing.append(name)
            raise Missing(name)
        return found.answer

    def get(self, name):
        """The answer, or None."""
        try:
            return self[name]
        except Missing:
            return None

    def settings(self, name):
        """What the case was run with."""
        return self.done[name].case.settings

    def fabrics(self, prefix, among=NAMES):
        """name -> answer of the case of each fabric that has one; Missing where none has."""
        found = {name: self.get(f"{prefix} {name}") for name in among}
        found = {name: answer for name, answer in found.items() if answer is not None}
        if not found:
            raise Missing(prefix)
        return found


BLOCKS = []


def block(section, title):
    """Marks a function of the answers that gives the HTML of one block of a section."""

    def keep(function):
        BLOCKS.append((section, title, function))
        return function

    return keep


def written(answers, rooms):
    """The body of the page: every block, and in its place what failed or was left out.

    Sections are in the order of their titles, blocks in a section in that of the rooms, and of their lines there.
    """
    places = [room.__name__ for room in rooms]
    parts, last = [], None
    for section, title, function in sorted(BLOCKS, key=lambda one: (one[0], places.index(one[2].__module__))):
        if section != last:
            parts.append(f"<h2>{page.text(section)}</h2>")
            last = section
        answers.missing = []
        try:
            inside = function(answers)
        except Missing:
            inside = ""
        boxes = []
        for name in dict.fromkeys(answers.missing):
            known = answers.done.get(name)
            if known is not None:
                boxes.append(page.p(f"The case “{name}” failed: {known.failure}", kind="failed"))
        left_out = [name for name in dict.fromkeys(answers.missing) if name not in answers.done]
        if left_out:
            boxes.append(page.settings(f"not run in this variant: {page.joined(left_out)}."))
        parts.append(f"<section><h3>{page.text(title)}</h3>{''.join(boxes)}{inside}</section>")
    return "\n".join(parts)


# --- tensile tests


def fitted(fabric, way, strain):
    """Stress (MPa) of Table 7.1 or, in bias, of Table 7.3 with yarns that turn and keep their length."""
    given = fabrics.load(fabric)
    if way == "bias":
        return 2 * given.shear.stress(2 * np.asarray(strain)) / 1e6
    return getattr(given, way).stress(strain) / 1e6


def loading(test):
    """Axial strain and stress of the way up, from zero."""
    history, peak = test["history"], test["peak"]
    return (np.insert(np.array(history[name][:peak]), 0, 0.0) for name in ("axial_strain", "axial_stress_MPa"))


def above(test, fabric, way, strain=None):
    """By how many percent a test is above its fitted curve, at its highest displacement or at a strain."""
    E, S = (values[1:] for values in loading(test))
    return float(np.interp(E[-1] if strain is None else strain, E, 100 * (S / fitted(fabric, way, E) - 1)))


def worst(test, fabric, way):
    """Largest difference from the fitted curve on the way up, in percent of that curve."""
    E, S = loading(test)
    miss = 100 * (S[1:] / fitted(fabric, way, E[1:]) - 1)
    return float(miss[np.abs(miss).argmax()])


def full(test):
    """Whether the test reached its full displacement."""
    return not test["stopped_on_the_way_up"]


def ending(test):
    """How a test ended, as text."""
    d = test["history"]["displacement_mm"][-1]
    if test["stopped"]:
        return f"stopped at {d:.2f} mm on its way {'down' if full(test) else 'up'}"
    return f"force gone at {d:.2f} mm"


def row(test, fabric, way):
    """Cells of a table: highest stress, against the fit there, largest on the way, iterations, cuts, end."""
    iterations = np.array(test["history"]["newton_iterations"][: test["peak"]])
    return (
        f"{test['top']['axial_stress_MPa']:.3f}"
        + ("" if full(test) else f" at {test['top']['displacement_mm']:.2f} mm"),
        page.percent(above(test, fabric, way)) if full(test) else "-",
        page.percent(worst(test, fabric, way)),
        f"{iterations.mean():.1f}",
        f"{sum(test['history']['step_cuts']):.0f}",
        ending(test).removeprefix("force gone at "),
    )


ROW = ("S, MPa", "to the fit", "largest on the way up", "Newton", "cuts", "force gone at")


def trace(axes, test, label, **style):
    """Stress against strain of a test."""
    history = test["history"]
    strain, stress = (np.insert(history[name], 0, 0.0) for name in ("axial_strain", "axial_stress_MPa"))
    axes.plot(strain, stress, label=label, **style)


def trace_fit(axes, fabric, way, strain):
    """The fitted curve up to a strain."""
    E = np.linspace(0, strain, 100)
    label = "Table 7.3, yarns of constant length" if way == "bias" else "fitted curve, Table 7.1"
    axes.plot(E, fitted(fabric, way, E), label=label, **plots.FITTED)


def looks(fabric):
    """Styles of the variants of a test, in the colour of the fabric."""
    color = plots.style(fabric)["color"]
    return {
        "bilinear": {"color": color, "lw": 1.6},
        "refined": {"color": color, "lw": 1.3, "ls": "--"},
        "printed": {"color": "0.4", "marker": "x", "ms": 3.5, "ls": "", "mew": 0.9},
        "lowered": {"color": color, "lw": 0.9, "marker": "*", "ms": 4.5, "markevery": 2},
        "element": {"color": color, "marker": "o", "ms": 3.5, "ls": "", "mfc": "none", "mew": 0.8},
    }
