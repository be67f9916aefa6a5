"""Panels of the report on bending: moment over curvature, and the angle of overhangs, data and curves."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...laws import Array
from . import elastica, hanging
from .elastica import Beam
from .fit import Direction, IdentifiedBending
from .loops import moments

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REACH = 250.0  # 1/m, of a KES loop
Panel = tuple[str, str, str, Callable[["Axes"], None]]


def of(bending: IdentifiedBending) -> list[Panel]:
    """Title, labels and drawing of each panel; the second only where a strip was held by its edge."""
    out: list[Panel] = [("bending", "curvature (1/m)", "moment (mN)", partial(_loops, bending))]
    if any({"overhang", "bending_length"} & one.tests.numbers.keys() for one in bending.ways.values()):
        out.append(("overhangs", "overhang (mm)", "angle (deg)", partial(_overhangs, bending)))
    return out


def _loops(bending: IdentifiedBending, axes: "Axes") -> None:
    """Readings of loops, and of each direction the loop of its curve."""
    for k, (way, one) in enumerate(bending.ways.items()):
        for loop in one.loops:
            axes.plot(loop.curvature, 1e3 * loop.moment, ".", ms=1.5, color=f"C{k}", alpha=0.4)
        reach = max([REACH, *(float(np.abs(loop.curvature).max()) for loop in one.loops)])
        K = np.concatenate(
            [np.linspace(0, reach, 60), np.linspace(reach, -reach, 120), np.linspace(-reach, reach, 120)]
        )
        curve = one.found.curve
        axes.plot(
            K, 1e3 * moments(K, curve, one.found.back or curve, one.spread, True), lw=0.9, color=f"C{k}", label=way
        )
    axes.legend(fontsize=6)


def _overhangs(bending: IdentifiedBending, axes: "Axes") -> None:
    """Pairs as they were read, bending lengths at 41.5 degrees (crosses), and the elastica of each curve."""
    for k, one in enumerate(bending.ways.values()):
        lengths, angles, kinds = _pairs(one)
        if not len(lengths):
            continue
        for kind, mark in ((0, "."), (1, "x")):
            axes.plot(1e3 * lengths[kinds == kind], np.degrees(angles[kinds == kind]), mark, ms=4, color=f"C{k}")
        L = np.linspace(0.3 * lengths.min(), 1.2 * lengths.max(), 60)
        angle = elastica.overhang_angle(Beam(one.found.curve, bending.areal_mass, one.spread), L)
        axes.plot(1e3 * L, np.degrees(angle), lw=0.9, color=f"C{k}")


def _pairs(one: Direction) -> tuple[Array, Array, Array]:
    """Overhangs (m), their angles (radians), and 1 for a bending length."""
    numbers = one.tests.numbers
    pairs, lengths = numbers.get("overhang", np.empty(0)), 2 * numbers.get("bending_length", np.empty(0))
    angles = np.append(numbers.get("angle", np.empty(0)), np.full(len(lengths), hanging.ASTM_ANGLE))
    return np.append(pairs, lengths), angles, np.repeat([0, 1], [len(pairs), len(lengths)])
