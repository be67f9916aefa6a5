"""The arm and the leg of a median man or woman.

Sizes are those of ANSUR II (Gordon et al. 2014, NATICK/TR-15/007), of 4082 men and 1986 women.
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from ..errors import InputError
from .limb import Bend, Limb

_ANSUR: dict[str, dict[str, float]] = {
    "man": {
        "acromionradialelength": 335.0, "radialestylionlength": 267.0, "handlength": 193.0, "handcircumference": 212.0,
        "bicepscircumferenceflexed": 357.0, "forearmcircumferenceflexed": 310.0, "wristcircumference": 176.0,
        "thighcircumference": 624.0, "lowerthighcircumference": 408.0, "calfcircumference": 392.0,
        "anklecircumference": 228.0, "trochanterionheight": 899.0, "lateralfemoralepicondyleheight": 491.0,
        "lateralmalleolusheight": 73.0, "footlength": 271.0, "balloffootcircumference": 252.0,
        "waistbreadth": 325.0, "waistdepth": 234.0, "waistheightomphalion": 1055.0, "hipbreadth": 344.0,
        "buttockdepth": 246.0,
    },
    "woman": {
        "acromionradialelength": 311.0, "radialestylionlength": 240.5, "handlength": 180.0, "handcircumference": 187.0,
        "bicepscircumferenceflexed": 304.0, "forearmcircumferenceflexed": 263.0, "wristcircumference": 154.0,
        "thighcircumference": 613.0, "lowerthighcircumference": 398.0, "calfcircumference": 372.0,
        "anklecircumference": 215.0, "trochanterionheight": 844.0, "lateralfemoralepicondyleheight": 465.0,
        "lateralmalleolusheight": 63.0, "footlength": 246.0, "balloffootcircumference": 227.0,
        "waistbreadth": 298.0, "waistdepth": 209.0, "waistheightomphalion": 977.5, "hipbreadth": 353.0,
        "buttockdepth": 231.0,
    },
}  # fmt: skip
"""Medians, mm, by the names of the survey's public data."""


def arm(of: Literal["man", "woman"] = "man", **options: object) -> Limb:
    """From the shoulder to the fingers' tips, with an elbow; options: of `Limb`.

    The survey has no girth of the elbow: it is taken for 0.88 of the forearm's; and the shoulder for as thick as the
    biceps. The hand is a stub.
    """
    size = sizes(of)
    upper, fore, hand = (size[f"{name}length"] for name in ("acromionradiale", "radialestylion", "hand"))
    biceps, forearm, wrist, palm = (
        size[f"{name}circumference"] / (2 * np.pi) for name in ("biceps", "forearm", "wrist", "hand")
    )
    stations = [(0.0, biceps), (0.55 * upper, biceps), (upper, 0.88 * forearm), (upper + 0.3 * fore, forearm)]
    stations += [(upper + fore, wrist), (upper + fore + 0.45 * hand, palm)]
    limb = Limb("arm", upper + fore + hand, tuple(stations), "shoulder", {"elbow": Bend(upper)})
    return replace(limb, **options)  # type: ignore[arg-type]


def leg(of: Literal["man", "woman"] = "man", **options: object) -> Limb:
    """From the hip to the toes, with a knee, and an ankle which is at 90 degrees unless told; options: of `Limb`.

    The survey's lower thigh is just above the knee, whose girth is taken for 0.93 of it. The foot is a stub.
    """
    size = sizes(of)
    hip, knee, ankle = (
        size[f"{name}height"] for name in ("trochanterion", "lateralfemoralepicondyle", "lateralmalleolus")
    )
    thigh, low, calf, thin, foot = (
        size[f"{name}circumference"] / (2 * np.pi) for name in ("thigh", "lowerthigh", "calf", "ankle", "balloffoot")
    )
    bend, shank = hip - knee, knee - ankle
    stations = [(0.0, thigh), (0.2 * bend, thigh), (0.8 * bend, low), (bend, 0.93 * low), (bend + 0.3 * shank, calf)]
    stations += [(bend + shank, thin), (bend + shank + 0.5 * size["footlength"], foot)]
    limb = Limb("leg", bend + shank + 0.75 * size["footlength"], tuple(stations), "hip",
                {"knee": Bend(bend), "ankle": Bend(bend + shank, 100.0, -1)}, posture={"ankle": 90.0})  # fmt: skip
    return replace(limb, **options)  # type: ignore[arg-type]


def sizes(of: str) -> dict[str, float]:
    """Medians in m, by shorter names."""
    if of not in _ANSUR:
        raise InputError(f"There is no {of!r} here; choose one of {', '.join(_ANSUR)}.")
    return {name.replace("flexed", ""): 1e-3 * value for name, value in _ANSUR[of].items()}
