"""Reads the records of tensile tests: CSV with named, unit-bearing columns, as testing machines write them.

    time_s,displacement_mm,force_N

or, as other machines write it, `Extension (mm);Load (N)`; the time is optional, and a strain may stand for the
displacement, a stress or a force per width for the force. Several readings up, and where there are any, back.

What a file may have and is understood: lines of text before the columns, between the readings and after them, units in
a line of their own, commas, semicolons, tabs, bars or spaces between the columns, decimal commas, marks between
thousands, repeated heads, other columns of any text, UTF-8, UTF-16, Shift-JIS, EUC-JP and Latin letters, and several
specimens, each below a head of its own, side by side, or told apart by a column "specimen". What is mended, with a
note: readings that are missing, single wild readings, times out of order, clocks that restart, times that cannot be
read, force or displacement with reversed sign, a displacement that does not begin at zero, slack and pre-load
(`identify.tensile.origin`). Anything else is refused in one sentence (`InputError`).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...laws import Array
from . import cleaning, readings, units
from .tables import Table, read_table

WORDS = {
    "time": ("time", "zeit", "temps", "tiempo", "tempo", "時間", "tijd", "时间", "시간", "czas"),
    "force": (
        *("force", "load", "stress", "kraft", "spannung", "contrainte", "charge", "fuerza", "carga", "esfuerzo"),
        *("forza", "carico", "sforzo", "荷重", "試験力", "応力", "張力", "effort", r"\blast\b", r"\btension"),
        *("força", "kracht", "belasting", "kuvvet", "siła", "obciążenie", "力", "载荷", "负荷", "하중", "응력"),
    ),
    "displacement": (
        *("displacement", "extension", "elongation", "stroke", "crosshead", "position", "travel", "strain"),
        *("weg", "dehnung", "verformung", "déplacement", "deplacement", "allongement", "déformation"),
        *("desplazamiento", "extensión", "alargamiento", "deformación", "spostamento", "allungamento", "corsa"),
        *("deformazione", "変位", "ストローク", "伸", "ひずみ", "歪", "verlängerung", "längenänderung", r"\bcourse"),
        *("recorrido", "elongación", "elongazione", r"\bext\b", r"extens[oóô]m", "estensim", "strain gau?ge"),
        *("deslocamento", "alongamento", "deformação", "verplaatsing", r"\brek\b", "uzama", "przemieszczenie"),
        *("wydłużenie", "位移", "应变", "변위", "신장", "변형률"),
    ),
    "warp_stretch": ("warp stretch",),
    "weft_stretch": ("weft stretch",),
    "angle": ("angle",),
}
"""Quantity -> regular expressions, of which its name, in small letters, holds one."""
ALLOWED = {
    "force": ("force", "force per width", "stress"),
    "displacement": ("length", "ratio"),
    "warp_stretch": ("ratio",),
    "weft_stretch": ("ratio",),
    "angle": ("angle",),
}
"""Quantity -> kinds of unit, the preferred one first."""
ON_THE_STRIP = re.compile(r"extens[oóô]m|estensim|(nungs|änderungs|ansatz)aufnehmer|strain ga|伸び計|標点")
"""An extensometer or a strain gauge, which sees a part of the strip and not what yields in the grips."""
AMBIGUOUS = ("green", "lagrange", "true", "cauchy", "piola", "logarithmic", "transverse", "lateral")


@dataclass(frozen=True)
class Strip:
    """The specimen before the test, and the gauge length of an extensometer on it, in m."""

    gauge_length: float
    width: float
    thickness: float
    extensometer: float | None = None

    @property
    def area(self) -> float:
        """Cross-section A0 of (3.1), m2."""
        return self.width * self.thickness


@dataclass(frozen=True)
class Record:
    """One test in the order of time: displacement (n,) in m from zero, force (n,) in N, tension positive.

    `yarns` holds, if the file does, warp_stretch (n,), weft_stretch (n,) and angle (n,) in radians of the
    marked yarns of a bias test, NaN where there is no photograph. `notes` says what was mended, `doubts` what it may
    have been instead. `zero` is the displacement (m) in the file where it is zero here.
    """

    file: str
    displacement: Array
    force: Array
    yarns: dict[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    zero: float = 0.0
    doubts: tuple[str, ...] = ()


def read(path: str | Path, strip: Strip, columns: Sequence[str] = ()) -> Record:
    """The tensile test of a CSV file of one specimen, see `read_all`."""
    several = read_all(path, strip, columns)
    if len(several) > 1:
        raise InputError(f"{Path(path).name}: holds {len(several)} specimens; put each into a file of its own.")
    return several[0]


def read_all(path: str | Path, strip: Strip, columns: Sequence[str] = ()) -> list[Record]:
    """The tensile tests of a CSV file, one of each specimen.

    Columns, by a word in their names: force or load, in a unit of force, of force per width, or of nominal stress
    (force over the first cross-section); displacement, extension, elongation ..., in a unit of length or relative to
    the gauge length (an extensometer's, if there is one whose gauge length is known); time, if there; and for a bias
    test with marked yarns "warp_stretch", "weft_stretch" and "angle" between them. Other columns are left alone. A
    file that names no columns has those of `columns`.
    """
    wanted = "|".join(WORDS["force"]), "|".join(WORDS["displacement"])
    table = read_table(path, wanted, "time_s,displacement_mm,force_N", columns)
    return [record for one in _beside(table) for record in _read(one, strip)]


def _beside(table: Table) -> list[Table]:
    """A table for each of several specimens side by side, whose columns repeat with all their names and units."""
    used = [i for i, header in enumerate(table.headers) if header.strip()]
    named, n = [table.columns[i] for i in used], len(used)
    for width in range(2, n // 2 + 1):
        if n % width == 0 and len(set(named[:width])) == width and named == named[:width] * (n // width):
            parts = [used[k : k + width] for k in range(0, n, width)]
            return [_part(table, f"{table.file} ({k})", part) for k, part in enumerate(parts, 1)]
    return [table]


def _part(table: Table, file: str, used: list[int]) -> Table:
    """The same with some columns, and the rows in which one of them holds something."""
    full = [i for i, row in enumerate(table.cells) if any(row[j].strip() for j in used)]
    cells = [[table.cells[i][j] for j in used] for i in full]
    columns, headers = [table.columns[j] for j in used], [table.headers[j] for j in used]
    return replace(table.take(full), file=file, columns=columns, headers=headers, cells=cells)


def _read(table: Table, strip: Strip) -> list[Record]:
    """The tensile tests below one head."""
    table, gauged = _on_the_strip(table, strip)
    found = {name: _find(table, name, name in ("force", "displacement")) for name in WORDS}
    used = {name: index for name, index in found.items() if index is not None}
    yarns = [name for name in ("warp_stretch", "weft_stretch", "angle") if name in used]
    if 0 < len(yarns) < 3:
        raise InputError(
            f"{table.file}: has {', '.join(yarns)} of the marked yarns only; give warp_stretch, weft_stretch and angle."
        )
    table = table.readings([used["force"], used["displacement"]], used.get("time"))
    kind, force = table.si(used["force"], ALLOWED["force"])
    force = force * {"force": 1.0, "force per width": strip.width, "stress": strip.area}[kind]
    kind, displacement = table.si(used["displacement"], ALLOWED["displacement"])
    displacement = displacement * (strip.gauge_length / (1.0 if kind == "ratio" else gauged))
    marked = {name: table.si(used[name], ALLOWED[name])[1] for name in yarns}
    time, said = readings.times(table, used["time"]) if "time" in used else (None, [])
    notes = [*table.notes, *(f"{table.file}: {word}." for word in said)]

    out: list[Record] = []
    groups = readings.groups(table, list(used.values()))
    for group, rows in groups.items():
        name = f"{table.file} ({group})" if len(groups) > 1 else table.file
        clock = None if time is None else time[rows]
        parts, said = readings.sort_out(table.take(rows), name, displacement[rows], force[rows], clock)
        notes += said
        for k, (part, zero) in enumerate(parts, 1):
            chosen = np.array(rows, dtype=int)[part]
            file = f"{name} ({k})" if len(parts) > 1 else name
            kept, said = _without_wild(table, file, chosen, {key: values[chosen] for key, values in marked.items()})
            out.append(Record(file, displacement[chosen] - zero, force[chosen], kept, tuple(said), zero))
    long = [record for record in out if len(record.force) >= readings.LEAST]
    if not long:
        n, least = max(len(record.force) for record in out), readings.LEAST
        raise InputError(f"{table.file}: has {n} complete lines, and a curve needs {least}; record it more densely.")
    if len(out) > 1:
        short = len(out) - len(long)
        less = f"; {short} of fewer than {readings.LEAST} lines left out" if short else ""
        notes.append(f"{table.file}: holds {len(long)} specimen{'s' * (len(long) > 1)}{less}.")
    long = [_upright(record, strip) for record in long]
    return [replace(long[0], notes=(*notes, *long[0].notes)), *long[1:]]


def _without_wild(
    table: Table, file: str, rows: np.ndarray, yarns: dict[str, Array]
) -> tuple[dict[str, Array], list[str]]:
    """Columns (n,) of the marked yarns with NaN for single wild readings, and notes; `rows` (n,) of the table."""
    out, notes = {}, []
    for key, values in yarns.items():
        seen = np.flatnonzero(np.isfinite(values))
        bad = seen[cleaning.wild(values[seen])]
        notes += [f"{file}: line {table.lines[rows[i]]} holds a wild {key.replace('_', ' ')}; left out." for i in bad]
        out[key] = np.where(np.isin(np.arange(len(values)), bad), np.nan, values)
    return out, notes


def _upright(record: Record, strip: Strip) -> Record:
    """The same with tension positive; refuses what a wrong unit or a wrong column would give."""
    displacement, force, zero, notes = record.displacement, record.force, record.zero, list(record.notes)
    if -force.min() > force.max():
        force = -force
        notes.append(f"{record.file}: the force is negative in tension; its sign is turned.")
    if -displacement.min() > displacement.max():
        displacement, zero = -displacement, -zero
        notes.append(f"{record.file}: the displacement is negative in tension; its sign is turned.")
    _plausible(record.file, displacement, force, strip)
    return replace(record, displacement=displacement, force=force, zero=zero, notes=tuple(notes))


def names(quantity: str, column: str) -> bool:
    """Whether the name of a column, in small letters, is one of a quantity of `WORDS`."""
    return any(re.search(word, column) for word in WORDS[quantity])


def _on_the_strip(table: Table, strip: Strip) -> tuple[Table, float]:
    """The table with one way of measuring the displacement, and its gauge length (m): an extensometer's, where known.

    A note says what is left out.
    """
    moved = [i for i, (name, _) in enumerate(table.columns) if names("displacement", name) and not vague(name)]
    gauged = [i for i in moved if ON_THE_STRIP.search(table.columns[i][0])]
    others = [i for i in moved if i not in gauged]
    relative = [i for i in gauged if (units.factor(table.columns[i][1] or "") or ("",))[0] == "ratio"]
    known = gauged if strip.extensometer else relative
    if not gauged:
        return table, strip.gauge_length
    if not known and not others:
        raise InputError(
            f"{table.file}: column {table.headers[gauged[0]]!r} is that of an extensometer; give its gauge length as "
            "extensometer_mm in the list of tests (gauge_length_mm, if it sees all that is between the grips)."
        )
    used, out = (known, [i for i in moved if i not in known]) if known else (others, gauged)
    if out:
        took, left = (" and ".join(repr(table.headers[i]) for i in some) for some in (used, out))
        why = "" if known else " (the list of tests has no extensometer_mm)"
        note = f"{table.file}: the displacement is that of column {took}; {left} is left out{why}."
        table = _part(table, table.file, [i for i in range(len(table.headers)) if i not in out])
        table = replace(table, notes=(*table.notes, note))
    return table, (strip.extensometer if known and strip.extensometer else strip.gauge_length)


def vague(column: str) -> bool:
    """Whether a column is a strain of another kind, or another direction, than what is asked for."""
    return any(word in column for word in AMBIGUOUS)


def _find(table: Table, quantity: str, needed: bool) -> int | None:
    """Index of the one column that holds a quantity; None if it may be missing and is."""
    found = [i for i, (name, _) in enumerate(table.columns) if names(quantity, name)]
    found = [i for i in found if not vague(table.columns[i][0])]
    if not found:
        if not needed:
            return None
        example = f"{quantity} ({'N' if quantity == 'force' else 'mm'})"
        raise InputError(f"{table.file}: no column holds a {quantity}; name one as in {example!r}.")
    if quantity in ("force", "displacement"):  # "stress" and "strain" may stand beside the force and the displacement
        kinds = [units.factor(table.columns[i][1] or "") for i in found]
        for kind in ALLOWED[quantity]:
            best = [i for i, k in zip(found, kinds, strict=True) if k and k[0] == kind]
            if best:
                found = best
                break
    if len(found) > 1:
        several = " and ".join(repr(table.headers[i]) for i in found)
        raise InputError(f"{table.file}: columns {several} could each be the {quantity}; rename all but one.")
    return found[0]


def _plausible(file: str, displacement: Array, force: Array, strip: Strip) -> None:
    """Refuse what a wrong unit or a wrong column would give."""
    reach, peak = displacement.max() / strip.gauge_length, force.max()
    if not reach > 0:
        raise InputError(f"{file}: the displacement never changes; check that its column is the machine's.")
    if not 1e-3 < reach < 3:
        raise InputError(
            f"{file}: the displacement reaches {1e3 * displacement.max():.4g} mm on a gauge length of "
            f"{1e3 * strip.gauge_length:g} mm; correct the unit of its column, or the gauge length."
        )
    if not peak > 0:
        raise InputError(f"{file}: the force is zero throughout; check that its column is the load cell's.")
    if not 1e2 < peak / strip.area < 1e10:
        raise InputError(
            f"{file}: the force reaches {peak:.4g} N, a stress of {peak / strip.area / 1e6:.3g} MPa; "
            "correct the unit of its column, or width and thickness."
        )
