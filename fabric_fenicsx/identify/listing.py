"""Reads the list of the tests of one fabric, a TOML file: strip, records, and what is assumed for want of a test.

Every key; the files that it names are told in `fabric_fenicsx.identify.files.records`:

    name = "my shirt"
    label = "S1"
    material = "Cotton"
    weave = "Plain"
    thickness_mm = 0.38
    density_kg_per_m3 = 590
    gauge_length_mm = 76.2
    width_mm = 25.4
    source = "tested on ..."        # optional, as is all that follows but one record
    columns = ["displacement (mm)", "force (N)"]  # of records of force that do not name theirs

    preload_N = 0                   # at which the tests began; 0 if a force at the start is an offset of the load cell
    extensometer_mm = 50            # of an extensometer, whose column then counts in place of the machine's

    [records]                       # files beside this one, each of one specimen; as "displacement (mm),force (N)"
    warp = ["warp_1.csv", "warp_2.csv"]
    weft = ["weft_1.csv"]
    bias = ["bias_1.csv"]
    warp_dots = ["warp_1_dots.csv"] # a line a photograph: displacement_mm,a_x_mm,a_y_mm,b_x_mm,b_y_mm,c_x_mm,c_y_mm
    weft_dots = ["weft_1_dots.csv"]

    [assumed]                       # used only where no record tells; a ratio may be zero
    nu12 = 0.3
    nu21 = 0.3
    warp_unloading_MPa = 900        # and weft_..., shear_... (dS12/dE12)

    [bending]                       # warp and weft, or leave it out; a list is one number a specimen
    bias_strip = "narrow"           # free to twist, as one that hangs; "wide": between long grips, as in KES

    [bending.warp]                  # and [bending.weft], [bending.bias]; any of
    B_gf_cm2_per_cm = [0.10, 0.11]  # KES's numbers, always both, or in uN_m, cN_cm2_per_cm ...
    2HB_gf_cm_per_cm = [0.05, 0.04] # or in mN, cN_cm_per_cm ...
    loops = ["warp_loop.csv"]       # a specimen each; as "curvature (1/cm),moment (gf cm/cm)", in the order of the test
    bending_length_mm = [20.5, 21]  # ASTM D1388, FAST-2: half of the overhang at 41.5 degrees
    overhang_mm = [30, 40, 50]      # and at each the angle below the horizontal of the line from edge to end
    angle_deg = [12.5, 25, 38]
    heart_length_mm = 150           # strip between the grips, and heights from the grip to the lowest point
    heart_height_mm = [61.5, 62]

    [[frame]]                       # a picture frame, from which the shear curve comes then; once a specimen
    file = "frame_1.csv"            # as the records above: of the crosshead, along the diagonal; several cycles, if any
    frame_mm = 150                  # side of the frame between its hinges, and of the cloth that shears
    specimen_mm = 110

    [[strip]]                       # strips at any angle, each of its own size, and
    [[biaxial]]                     # specimens drawn along both yarns; see `fabric_fenicsx.identify.tensile.strips`

Or the sheet of a laboratory, [kes] or [fast], in the place of gauge_length_mm, width_mm, [records] and [bending]:

    [kes]                           # in the units of the sheet; WT may stand for LT
    warp = { EM = 5.1, LT = 0.72, RT = 58, G = 0.6, 2HG = 0.8, 2HG5 = 1.5, B = 0.10, 2HB = 0.05 }
    weft = { EM = 6.3, LT = 0.70, RT = 55, G = 0.6, 2HG = 0.9, 2HG5 = 1.6, B = 0.08, 2HB = 0.04 }
    # or curves, tension = ["t.csv"], shear = ["s.csv"], bending = ["b.csv"]: "strain (%),force (gf/cm)", "shear angle
    # (deg),force (gf/cm)", "curvature (1/cm),moment (gf cm/cm)", in place of the numbers that they tell

    [fast]
    warp = { E5 = 0.4, E20 = 1.1, E100 = 3.0, C = 18.5 }
    weft = { E5 = 0.6, E20 = 1.6, E100 = 4.1, C = 16.0 }
    EB5 = 4.2
"""

import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from .bending import tests as bending_tests
from .files.keys import expect
from .files.records import Strip
from .shear import picture_frame
from .sheets import kes_and_fast as sheets
from .tensile import strips
from .tensile.strips import BiaxialTest, Ends, StripTest

TEXTS = ("name", "label", "material", "weave")
NUMBERS = ("thickness_mm", "density_kg_per_m3", "gauge_length_mm", "width_mm")
RECORDS = ("warp", "weft", "bias", "warp_dots", "weft_dots")
RATIOS = ("nu12", "nu21")
ASSUMED = (*RATIOS, "warp_unloading_MPa", "weft_unloading_MPa", "shear_unloading_MPa")


@dataclass(frozen=True)
class Tests:
    """The tests of one fabric; paths of the records by kind, assumed numbers in the units of their names."""

    file: str
    texts: dict[str, str]
    density: float  # kg/m3
    strip: Strip
    source: str
    records: dict[str, list[Path]]
    assumed: dict[str, float]
    columns: list[str] = field(default_factory=list)
    preload: float | None = None  # N
    bending: bending_tests.BendingTests | None = None
    sheet: sheets.Sheet | None = None
    frames: list[picture_frame.Frame] = field(default_factory=list)
    strips: list[StripTest] = field(default_factory=list)
    biaxial: list[BiaxialTest] = field(default_factory=list)
    ends: Ends = "clamped"  # of the strips of records, of `strips.ENDS`

    @property
    def areal_mass(self) -> float:
        """kg/m2."""
        return self.density * self.strip.thickness


def read(path: str | Path) -> Tests:
    """Read such a list; raises InputError for what cannot be read, is missing, unknown or no positive number."""
    try:
        entries = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a list of tests.") from error
    except ValueError as error:
        raise InputError(f"{path}: is not TOML ({error}); correct it there.") from error
    kind = next((key for key in ("kes", "fast") if key in entries), None)
    if kind:
        return _of_sheet(path, kind, entries)
    expect(
        path,
        "",
        entries,
        (*TEXTS, *NUMBERS, "records"),
        ("source", "columns", "preload_N", "extensometer_mm", "assumed", "bending", "frame", "strip", "biaxial"),
    )
    _words(path, entries)
    numbers = {key: _number(path, key, entries[key]) for key in NUMBERS}
    records = {}
    expect(path, "records.", _table(path, "records", entries), (), RECORDS)
    for key, names in entries["records"].items():
        if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
            raise InputError(f'{path}: records.{key} is not a list of files; write ["{key}_1.csv"] or more.')
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise InputError(f"{path}: records.{key} names {twice!r} twice; a file is one specimen, so leave one out.")
        records[key] = [Path(path).parent / name for name in names]
    columns = entries.get("columns", [])
    texts = isinstance(columns, list) and all(isinstance(name, str) for name in columns)
    if not texts or set("".join(columns)) & set(",;\t"):
        raise InputError(f'{path}: columns is not a list of names; write ["displacement (mm)", "force (N)"], say.')
    strip = Strip(*(numbers[key] / 1e3 for key in ("gauge_length_mm", "width_mm", "thickness_mm")))
    if "extensometer_mm" in entries:
        strip = replace(strip, extensometer=_number(path, "extensometer_mm", entries["extensometer_mm"]) / 1e3)
    slanted = strips.read_strips(path, entries["strip"], strip) if "strip" in entries else []
    if not slanted and not any(key in records for key in ("warp", "weft", "bias")):
        raise InputError(f"{path}: records names no tensile test; add warp, weft or bias.")
    return Tests(
        str(path),
        {key: entries[key] for key in TEXTS},
        numbers["density_kg_per_m3"],
        strip,
        entries.get("source", "not said"),
        records,
        _assumed(path, entries),
        columns,
        _number(path, "preload_N", entries["preload_N"], zero=True) if "preload_N" in entries else None,
        bending_tests.read(path, entries["bending"]) if "bending" in entries else None,
        frames=picture_frame.read(path, entries["frame"]) if "frame" in entries else [],
        strips=slanted,
        biaxial=strips.read_biaxial(path, entries["biaxial"]) if "biaxial" in entries else [],
    )


def _of_sheet(path: str | Path, kind: str, entries: dict[str, Any]) -> Tests:
    """A list that holds the sheet of a laboratory in the place of records."""
    expect(path, "", entries, (*TEXTS, *NUMBERS[:2], kind), ("source", "assumed"))
    _words(path, entries)
    thickness, density = (_number(path, key, entries[key]) for key in NUMBERS[:2])
    sheet = sheets.read(path, kind, entries[kind])
    texts, source = {key: entries[key] for key in TEXTS}, entries.get("source", f"a sheet of {kind.upper()}")
    strip = sheet.strip(thickness / 1e3)
    return Tests(
        str(path), texts, density, strip, source, {}, _assumed(path, entries), bending=sheet.bending, sheet=sheet
    )


def _words(path: str | Path, entries: dict[str, Any]) -> None:
    for key in (*TEXTS, "source"):
        if not isinstance(entries.get(key, "-"), str) or not entries.get(key, "-").strip():
            raise InputError(f"{path}: {key} is not a text; write at least one word in double quotes.")


def _assumed(path: str | Path, entries: dict[str, Any]) -> dict[str, float]:
    assumed = _table(path, "assumed", entries) if "assumed" in entries else {}
    expect(path, "assumed.", assumed, (), ASSUMED)
    return {key: _number(path, f"assumed.{key}", value, zero=key in RATIOS) for key, value in assumed.items()}


def _table(path: str | Path, key: str, entries: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(entries[key], dict):
        raise InputError(f"{path}: {key} is not a table; write its entries under [{key}].")
    return entries[key]


def _number(path: str | Path, key: str, value: object, zero: bool = False) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not (0 < value < 1e15 or (zero and value == 0)):
        allowed = "zero or a positive number" if zero else "a positive number"
        raise InputError(f"{path}: {key} = {value!r} is not {allowed}; give it in the unit that the key names.")
    return float(value)
