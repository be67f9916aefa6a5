"""Shear from picture frames: a square of cloth whose yarns are held parallel to four hinged bars.

With L the side of the frame between its hinges, l that of the cloth that shears, d the way of the crosshead along the
diagonal, and phi the angle between the bars (Cao et al. 2008, doi 10.1016/j.compositesa.2008.02.016):

    cos(phi/2) = (sqrt(2) L + d)/(2 L),    2 E12 = cos(phi),    h S12 = F/(2 cos(phi/2)) L/l^2

Yarns keep their length, so 2 E12 is the sine of the shear angle. S12 is conjugate, F d(d) = l^2 h S12 d(2 E12): the
benchmark's normalised shear force over the thickness h.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...laws import Array
from ..files import records
from ..files.records import Strip
from ..tensile import branches, curves, origin
from ..tensile.curves import Readings
from . import cycles

KEYS = ("file", "frame_mm", "specimen_mm")
ZEROED = 0.06  # of the peak force: a first reading below it is that of a load cell that was zeroed
RUBS = 0.01  # of the peak force: friction at the start below it is not worth a remark
LARGEST = np.radians(85.0)  # shear angle, beyond which the bars meet


@dataclass(frozen=True)
class Frame:
    """One test: its record of force over displacement, the side of the frame and that of the sheared cloth, m."""

    path: Path
    side: float
    specimen: float

    def strain(self, displacement: Array) -> Array:
        """E12 (n,) of displacements (m)."""
        half = (np.sqrt(2) * self.side + displacement) / (2 * self.side)
        return np.asarray(half**2 - 0.5)  # cos(phi)/2

    def stress(self, displacement: Array, force: Array, thickness: float) -> Array:
        """S12 (n,) in Pa of forces (N)."""
        half = (np.sqrt(2) * self.side + displacement) / (2 * self.side)
        return np.asarray(force / (2 * half) * self.side / self.specimen**2 / thickness)


@dataclass(frozen=True)
class Sheared:
    """Virgin loading and ways back of all frames, the unloading slopes of each, the records, and remarks."""

    readings: list[Readings]
    back: list[tuple[Array, Array]]
    slopes: list[list[tuple[float, float, int] | None]]
    records: list[records.Record]
    notes: list[str]
    whole: list[tuple[Array, Array]]  # strain and stress of records with several cycles, in the order of the test


def read(path: str | Path, entries: Any) -> list[Frame]:
    """The tables [[frame]] of a list of tests; raises InputError for what is missing, unknown or no number."""
    if not isinstance(entries, list) or not entries or not all(isinstance(one, dict) for one in entries):
        raise InputError(f"{path}: frame is not a list of tables; write [[frame]] over each.")
    out = []
    for k, one in enumerate(entries, 1):
        for key in (*one, *KEYS):
            if key not in KEYS:
                raise InputError(f"{path}: frame {k}: {key} is not a known key; known are {', '.join(KEYS)}.")
            if key not in one:
                raise InputError(f"{path}: frame {k}: {key} is missing; add it.")
        if not isinstance(one["file"], str):
            raise InputError(f"{path}: frame {k}: file = {one['file']!r} is not the name of a file.")
        for key in KEYS[1:]:
            value = one[key]
            if isinstance(value, bool) or not isinstance(value, int | float) or not 5 <= value <= 2000:
                raise InputError(f"{path}: frame {k}: {key} = {value!r} is not a side from 5 to 2000 mm.")
        if one["specimen_mm"] > one["frame_mm"]:
            raise InputError(
                f"{path}: frame {k}: specimen_mm = {one['specimen_mm']:g} is larger than frame_mm = "
                f"{one['frame_mm']:g}; give the side of the cloth that shears, and that between the hinges."
            )
        out.append(Frame(Path(path).parent / one["file"], one["frame_mm"] / 1e3, one["specimen_mm"] / 1e3))
    return out


def shear(frames: list[Frame], thickness: float, columns: list[str], preload: float | None) -> Sheared:
    """Strain E12 and stress S12 of all frames; thickness in m."""
    out = Sheared([], [], [], [], [], [])
    for frame in frames:
        strip = Strip(np.sqrt(2) * frame.side, frame.specimen, thickness)
        for record in records.read_all(frame.path, strip, columns):
            rubs = cycles.several(record.displacement) and abs(record.force[0]) < ZEROED * record.force.max()
            record, part = origin.find(record, branches.split(record), strip.gauge_length, preload, friction=rubs)
            E, S = frame.strain(record.displacement), frame.stress(record.displacement, record.force, thickness)
            if 2 * E.max() > np.sin(LARGEST):
                d = 1e3 * record.displacement.max()
                raise InputError(
                    f"{record.file}: a displacement of {d:.4g} mm shears a frame of {1e3 * frame.side:g} mm by more "
                    f"than {np.degrees(LARGEST):g} degrees; correct its unit, or frame_mm."
                )
            out.readings.append(Readings(record.file, E[part.virgin], S[part.virgin]))
            out.back.extend((E[run], S[run]) for run in part.unloading)
            out.slopes.append([curves.unloading(E[run], E[run], S[run]) for run in part.unloading])
            if rubs:
                out.whole.append((E, S))
            out.records.append(record)
            out.notes.extend((*record.notes, *part.notes, *(_rubbing(record, part) if rubs else ())))
    return out


def _rubbing(record: records.Record, part: branches.Branches) -> tuple[str, ...]:
    """A remark on the force with which a frame begins to shear: who rubs, cloth or hinges, it does not tell."""
    d, force = record.displacement[part.virgin], record.force[part.virgin]
    start = curves.offset(d[1:], force[1:]) / float(force.max())
    if start < RUBS:
        return ()
    return (
        f"{record.file}: the force begins at {100 * start:.2g} % of its peak, which is taken for friction of the "
        "cloth; that of the hinges is in it, so subtract the force of the empty frame, if it is not small beside it.",
    )
