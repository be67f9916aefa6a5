"""Records with the headings, units and decimal marks of testing machines of several countries."""

import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from fabric_fenicsx import fabrics
from fabric_fenicsx.app.cli import app
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify.files import records, units

STRIP = records.Strip(gauge_length=0.1, width=0.05, thickness=0.4e-3)
D = np.linspace(0, 10e-3, 40)
F = 20 * D / 0.01 + 80 * (D / 0.01) ** 2  # N

EXPORTS = {
    "German, Zwick": ("Zeit;Standardweg;Standardkraft\ns;mm;daN", (1.0, 1e3, 0.1), ",", "utf-8"),
    "German": ("Prüfzeit (s);Dehnung (%);Prüfkraft (cN)", (1.0, 1e3, 100.0), ",", "latin-1"),
    "French": ("Temps (s);Déplacement de la traverse (mm);Force (daN)", (1.0, 1e3, 0.1), ",", "utf-8"),
    "French, strip of 5 cm": ("Temps (s);Allongement (%);Charge (N/5cm)", (1.0, 1e3, 1.0), ",", "utf-8"),
    "Spanish": ("Tiempo (s);Alargamiento (mm);Carga (kgf)", (1.0, 1e3, 1 / 9.80665), ",", "latin-1"),
    "Spanish, per width": ("Tiempo (s);Desplazamiento (mm);Fuerza (kN/m)", (1.0, 1e3, 0.02), ",", "utf-8"),
    "Italian": ("Tempo (s);Allungamento (mm);Forza (N/cm)", (1.0, 1e3, 0.2), ",", "utf-8"),
    "Italian, crosshead": ("Tempo (s);Corsa (mm);Carico (N)", (1.0, 1e3, 1.0), ",", "latin-1"),
    "Japanese, Shimadzu": ("時間(sec)\tストローク(mm)\t試験力(N)", (1.0, 1e3, 1.0), ".", "shift_jis"),
    "Portuguese": ("Tempo (s);Deslocamento (mm);Força (N)", (1.0, 1e3, 1.0), ",", "cp1252"),
    "Dutch": ("Tijd (s);Verplaatsing (mm);Kracht (N)", (1.0, 1e3, 1.0), ",", "utf-8"),
    "Polish": ("Czas (s);Wydłużenie (%);Siła (N/5cm)", (1.0, 1e3, 1.0), ",", "utf-8"),
    "Chinese": ("时间(s),位移(mm),力(N)", (1.0, 1e3, 1.0), ".", "utf-8"),
    "Korean, numbered": ("#,시간(s),변위(mm),하중(N)", (1.0, 1e3, 1.0), ".", "utf-8-sig"),
    "Japanese, EUC": ("時間(sec)\t変位(mm)\t荷重(N)", (1.0, 1e3, 1.0), ".", "euc_jp"),
    "Japanese, JIS": ("時間(sec)\tストローク(mm)\t試験力(N)", (1.0, 1e3, 1.0), ".", "iso2022_jp"),
    "Japanese, Kato Tech": ("時間(s)\t伸び(%)\t荷重(gf/cm)", (1.0, 1e3, 1 / 9.80665e-3 / 5), ".", "shift_jis"),
    "English, Instron": ("Time (s),Extension (in),Load (lbf)", (1.0, 1e3 / 25.4, 1 / 4.4482216), ".", "utf-8"),
    "English, MTS": ("Time (s),Crosshead (mm),Load (lbf/in)", (1.0, 1e3, 25.4 / 50 / 4.4482216), ".", "utf-8"),
    "German, Instron": ("Zeit;Verlängerung;Last\n(s);(mm);(N)", (1.0, 1e3, 1.0), ",", "cp1252"),
    "German, in words": ("Zeit in s;Längenänderung in mm;Kraft in daN/5cm", (1.0, 1e3, 0.1), ",", "cp1252"),
    "French, Zwick": ("Temps d'essai;Course standard;Force standard\ns;mm;N", (1.0, 1e3, 1.0), ",", "cp1252"),
    "French, effort": ("Temps (s);Allongement (mm);Effort (newton)", (1.0, 1e3, 1.0), ",", "utf-8"),
    "Spanish, Zwick": ("Tiempo;Recorrido estándar;Fuerza estándar\ns;mm;N", (1.0, 1e3, 1.0), ",", "cp1252"),
    "Spanish, elongation": ("Tiempo;Elongación;Carga\ns;mm;cN", (1.0, 1e3, 100.0), ",", "cp1252"),
    "Japanese, Instron": ("時間,伸長,荷重\n(s),(mm),(N)", (1.0, 1e3, 1.0), ".", "utf-8-sig"),
    "Japanese, full width": ("時間（ｓ）,変位（ｍｍ）,試験力（Ｎ）", (1.0, 1e3, 1.0), ".", "shift_jis"),
    "Shimadzu": ('"1 _ 1"\n"Time","Stroke","Force"\n"sec","mm","N"', (1.0, 1e3, 1.0), ".", "utf-8"),
    "MTS": ("MTS793\nTime\tAxial Displacement\tAxial Force\nSec\tin\tlbf", (1.0, 1e3 / 25.4, 0.2248089), ".", "utf-8"),
    "Bluehill": ('"Width","50","mm"\n\n"Time","Extension","Load"\n"(s)","(mm)","(N)"', (1.0, 1e3, 1.0), ".", "utf-8"),
    "English, ext": ("Time (s),Ext (in),Load (lb/in)", (1.0, 1e3 / 25.4, 25.4 / 50 / 4.4482216), ".", "utf-8"),
    "English, tension": ("Time (s),Strain (%),Tension (kN/m)", (1.0, 1e3, 0.02), ".", "utf-8"),
}  # fmt: skip


@pytest.mark.parametrize("name", EXPORTS)
def test_exports_of_several_countries(tmp_path, name):
    head, (_, per_m, per_N), decimal, encoding = EXPORTS[name]
    mark = next(m for m in ("\t", ";", ",") if m in head.splitlines()[-1])
    rows = [
        (k,) * head.startswith("#") + (0.1 * k, d * per_m, f * per_N) for k, (d, f) in enumerate(zip(D, F, strict=True))
    ]
    body = "\n".join(mark.join(f"{value:.7f}".replace(".", decimal) for value in row) for row in rows)
    file = tmp_path / "test.csv"
    file.write_bytes(f"{head}\n{body}\n".encode(encoding))
    record = records.read(file, STRIP)
    assert record.displacement == pytest.approx(D, abs=1e-8) and record.force == pytest.approx(F, abs=1e-4)
    assert not record.notes


SIDE_BY_SIDE = {
    "Zwick": "Probe 1;;;Probe 2;;\nDehnung;Kraft;;Dehnung;Kraft;\n%;N;;%;N;",
    "Shimadzu": "1 _ 1;;;1 _ 2;;\nストローク;試験力;;ストローク;試験力;\nmm;N;;mm;N;",
}


@pytest.mark.parametrize("name", SIDE_BY_SIDE)
def test_specimens_side_by_side(tmp_path, name):
    """The second one is stiffer, and breaks earlier."""
    body = [
        f"{1e3 * d:.5f};{f:.5f};;" + (f"{1e3 * d:.5f};{2 * f:.5f};" if k < 30 else ";;")
        for k, (d, f) in enumerate(zip(D, F, strict=True))
    ]
    (tmp_path / "two.csv").write_text("\n".join([SIDE_BY_SIDE[name], *body]), encoding="utf-8")
    first, second = records.read_all(tmp_path / "two.csv", STRIP)
    assert (first.file, second.file) == ("two.csv (1)", "two.csv (2)")
    assert first.force == pytest.approx(F, abs=1e-4) and second.force == pytest.approx(2 * F[:30], abs=1e-4)
    assert second.displacement == pytest.approx(D[:30], abs=1e-7) and not second.notes


@pytest.mark.parametrize(
    ("head", "reason"),
    [
        ("Zeit (s);Traversenweg (mm);Dehnung Längenaufnehmer (mm);Kraft (N)", "could each be the displacement"),
        ("Time (s);Extension (mm);Load (N);Load set point (N)", "could each be the force"),
        ("Time (s);Extension (mm);Load (g);Temperature (C)", "has the unknown unit 'g'; give one of N, kN"),
        ("Time (s);Strain;Load (N);Temperature (C)", "column 'Strain' has no unit"),
    ],
)
def test_what_could_be_read_two_ways_is_refused(tmp_path, head, reason):
    """No guess: the sentence names the columns."""
    rows = "\n".join(f"{k};{1e3 * d:.5f};{f:.5f};{f:.5f}" for k, (d, f) in enumerate(zip(D, F, strict=True)))
    (tmp_path / "a.csv").write_text(f"{head}\n{rows}", encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(reason)):
        records.read_all(tmp_path / "a.csv", STRIP)


@pytest.mark.parametrize(
    ("unit", "si"),
    [("N/5cm", 20.0), ("daN/5 cm", 200.0), ("N/cm", 100.0), ("kN/m", 1e3), ("gf/cm", 0.980665), ("lbf/in", 175.12684),
     ("cN/cm", 1.0), ("N/50mm", 20.0), ("N/2in", 1 / 0.0508), ("kgf/5cm", 196.133)],
)  # fmt: skip
def test_forces_per_width(unit, si):
    assert units.factor(unit) == ("force per width", pytest.approx(si, rel=1e-6))


def test_a_fabric_from_records_of_three_countries(tmp_path):
    """The whole way, with its report: a French, a Japanese and a Spanish file, and one whose columns the list names."""
    d = np.concatenate([1e3 * D, 1e3 * D[-2:-12:-1]])
    force = np.concatenate([F, F[-2:-12:-1] * np.linspace(0.8, 0, 10)])
    files = {
        "warp": ("Temps (s);Allongement (mm);Charge (daN)\n", 0.1, "cp1252"),
        "warp_2": ("", 1.0, "utf-8"),
        "weft": ("時間(s);ストローク(mm);試験力(N)\n", 0.8, "shift_jis"),
        "bias": ("Tiempo (s);Alargamiento (mm);Carga (N/5cm)\n", 0.2, "cp1252"),
    }
    for name, (head, part, encoding) in files.items():
        body = "\n".join(f"{k};{x:.5f};{part * f:.6f}" for k, (x, f) in enumerate(zip(d, force, strict=True)))
        (tmp_path / f"{name}.csv").write_bytes((head + body).encode(encoding))
    (tmp_path / "tests.toml").write_text(
        'name = "a"\nlabel = "a"\nmaterial = "a"\nweave = "plain"\nthickness_mm = 0.4\ndensity_kg_per_m3 = 500\n'
        'gauge_length_mm = 100\nwidth_mm = 50\ncolumns = ["time (s)", "displacement (mm)", "force (N)"]\n[records]\n'
        'warp = ["warp.csv", "warp_2.csv"]\nweft = ["weft.csv"]\nbias = ["bias.csv"]\n'
        "[assumed]\nnu12 = 0.2\nnu21 = 0.2\n"
    )
    words = ["identify", str(tmp_path / "tests.toml"), "--shear", "net", "--per-width", "N/5cm", "--out", str(tmp_path)]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, answer.output
    fabric = fabrics.load(tmp_path / "fabric.toml")
    E, stretch = D[-1] / 0.1 + (D[-1] / 0.1) ** 2 / 2, 1 + D[-1] / 0.1
    for curve, part in ((fabric.warp, 1.0), (fabric.weft, 0.8)):
        assert curve.stress(E) == pytest.approx(part * F[-1] / stretch / (0.05 * 0.4e-3), rel=0.005)
    assert f"stress {F[-1] / stretch:.3g}" in (tmp_path / "fabric.toml").read_text()


EXTENSOMETERS = {  # two headings of the displacement, and what a reading of the second is of that of the first
    "relative": ("Crosshead (mm)", "Extensometer (%)", 0.8),
    "German": ("Traversenweg (mm)", "Längenänderungsaufnehmer (mm)", 0.8 * 0.3),
    "Japanese": ("ストローク(mm)", "伸び計(mm)", 0.8 * 0.3),
    "gauge": ("Strain gauge (%)", "Stroke (mm)", 1 / 0.8),
}


@pytest.mark.parametrize("name", EXTENSOMETERS)
def test_an_extensometer_counts_and_the_crosshead_is_left_out(tmp_path, name):
    """It sees 0.8 of the strain, on 30 mm of the strip; without these it is not used, which is said."""
    first, second, part = EXTENSOMETERS[name]
    reads = D if name != "gauge" else 0.8 * D
    rows = [
        ",".join(f"{1e3 * value:.7f}" for value in (d, part * d)) + f",{f:.7f}" for d, f in zip(reads, F, strict=True)
    ]
    (tmp_path / "both.csv").write_text("\n".join([f"{first},{second},Force (N)", *rows]), encoding="utf-8")
    told = records.read(tmp_path / "both.csv", replace(STRIP, extensometer=0.03))
    assert told.displacement == pytest.approx(0.8 * D, abs=1e-8) and told.force == pytest.approx(F, abs=1e-4)
    used, left = (second, first) if name != "gauge" else (first, second)
    assert told.notes == (f"both.csv: the displacement is that of column {used!r}; {left!r} is left out.",)
    silent = records.read(tmp_path / "both.csv", STRIP)
    relative = "%" in used
    assert silent.displacement == pytest.approx(0.8 * D if relative else D, abs=1e-8)
    assert relative or "(the list of tests has no extensometer_mm)" in silent.notes[0]


def test_an_extensometer_alone_must_tell_its_gauge_length(tmp_path):
    rows = [f"{1e3 * d:.7f},{f:.7f}" for d, f in zip(0.3 * D, F, strict=True)]
    (tmp_path / "one.csv").write_text("\n".join(["Extensometer (mm),Force (N)", *rows]))
    with pytest.raises(InputError, match="give its gauge length as extensometer_mm"):
        records.read(tmp_path / "one.csv", STRIP)
    told = records.read(tmp_path / "one.csv", replace(STRIP, extensometer=0.03))
    assert told.displacement == pytest.approx(D, abs=1e-8) and not told.notes
