"""Shear from a bias test without photographs and without simulation: the strip as a net of inextensible yarns.

Between grips a strip of length H and width W has a middle that shears by the angle g, two zones of W^2/2 each that
shear by g/2, and ends that stay (Figure 3-52). The middle is as if drawn over the length H - W, so that its stretch is
1 + d/(H - W), and with yarns that keep their length E12 = sin(g)/2 is its axial strain. The work of the force is
that of the shear stress in the two kinds of zone,

    P (H - W) cos(g) / (2 (1 + d/(H - W))) = h (S12(g) cos(g) W (2H - 3W)/2 + S12(g/2) cos(g/2) W^2/2),

which is the normalisation of the bias test by J. Cao et al., Composites Part A 39 (2008) 1037-1053. It is right for a
fabric whose yarns stretch little, as glass; where they do, an inverse simulation (`inverse`) is the better way.
"""

from dataclasses import replace

import numpy as np

from ...errors import InputError, StepFailed
from ..identified import Curve, Identified
from . import curves
from .curves import Readings

ANGLE = 55.0  # degrees of shear beyond which a net is no picture of a fabric


def shear(found: Identified) -> Identified:
    """The same, with the shear curve from the loading of the bias test; unloading is left open.

    Raises InputError where there is no bias test, or the strip is shorter than twice its width; StepFailed where the
    stress at half the angle does not settle.
    """
    strip, bias = found.tests.strip, found.bias
    H, W, h = strip.gauge_length, strip.width, strip.thickness
    if bias is None:
        raise InputError(f"{found.tests.file}: there is no bias test to take shear from; add one under records.bias.")
    if H < 2 * W:
        raise InputError(
            f"{found.tests.file}: gauge_length_mm = {1e3 * H:g} is less than twice width_mm = {1e3 * W:g}, so that no "
            "part of a bias strip shears freely; test a longer one."
        )
    parts, notes = [], list(found.notes)
    for readings in bias.readings:
        stretch = np.sqrt(1 + 2 * readings.strain)
        force = readings.stress * strip.area * stretch
        E12 = curves.green_lagrange((stretch - 1) * H, H - W)
        sure = 2 * E12 < np.sin(np.radians(ANGLE))
        if not sure.all():
            reason = f"would shear by more than {ANGLE:g} degrees, where yarns slip or lock; left out"
            notes.append(f"{readings.file}: a net {reason}.")
        half = np.arcsin(2 * E12[sure]) / 2
        work = force[sure] * (H - W) / (2 * np.sqrt(1 + 2 * E12[sure]) * h)
        parts.append((readings.file, E12[sure], half, work))

    fit, middle, side = None, W * (2 * H - 3 * W) / 2, W * W / 2
    quarters = [np.zeros(len(half)) for *_, half, _ in parts]
    for _ in range(100):  # each time with the stress at the half angle from the times before
        made = [
            Readings(file, E12, (work - side * quarter * np.cos(half) / np.cos(2 * half)) / middle)
            for (file, E12, half, work), quarter in zip(parts, quarters, strict=True)
        ]
        before, fit = fit, curves.loading(made)
        # the mean of two, for in a strip of length 2W an error would return with the other sign
        quarters = [(q + fit.stress(np.sin(half) / 2)) / 2 for (*_, half, _), q in zip(parts, quarters, strict=True)]
        E = np.linspace(0, fit.limit, 51)
        if before and np.abs(fit.stress(E) - before.stress(E)).max() < 1e-5 * fit.stress(E).max():
            break
    else:
        raise StepFailed(
            f"{found.tests.file}: the shear stress of the net does not settle; photograph the yarns instead."
        )
    curve = Curve(fit, None, made, [], "bias test as a net of inextensible yarns")
    return replace(found, curves={**found.curves, "shear": curve}, notes=notes)
