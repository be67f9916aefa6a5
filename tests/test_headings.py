"""Records with the headings, units and decimal marks of testing machines of several countries."""

import numpy as np
import pytest

from fabric_fenicsx.identify import records, units

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
    "Japanese, Kato Tech": ("時間(s)\t伸び(%)\t荷重(gf/cm)", (1.0, 1e3, 1 / 9.80665e-3 / 5), ".", "shift_jis"),
    "English, Instron": ("Time (s),Extension (in),Load (lbf)", (1.0, 1e3 / 25.4, 1 / 4.4482216), ".", "utf-8"),
    "English, MTS": ("Time (s),Crosshead (mm),Load (lbf/in)", (1.0, 1e3, 25.4 / 50 / 4.4482216), ".", "utf-8"),
}  # fmt: skip


@pytest.mark.parametrize("name", EXPORTS)
def test_exports_of_several_countries(tmp_path, name):
    head, (_, per_m, per_N), decimal, encoding = EXPORTS[name]
    mark = next(m for m in ("\t", ";", ",") if m in head)
    rows = [(0.1 * k, d * per_m, f * per_N) for k, (d, f) in enumerate(zip(D, F, strict=True))]
    body = "\n".join(mark.join(f"{value:.7f}".replace(".", decimal) for value in row) for row in rows)
    file = tmp_path / "test.csv"
    file.write_bytes(f"{head}\n{body}\n".encode(encoding))
    record = records.read(file, STRIP)
    assert record.displacement == pytest.approx(D, abs=1e-8) and record.force == pytest.approx(F, abs=1e-4)
    assert not record.notes


@pytest.mark.parametrize(
    ("unit", "si"),
    [("N/5cm", 20.0), ("daN/5 cm", 200.0), ("N/cm", 100.0), ("kN/m", 1e3), ("gf/cm", 0.980665), ("lbf/in", 175.12684),
     ("cN/cm", 1.0), ("N/50mm", 20.0), ("N/2in", 1 / 0.0508), ("kgf/5cm", 196.133)],
)  # fmt: skip
def test_forces_per_width(unit, si):
    assert units.factor(unit) == ("force per width", pytest.approx(si, rel=1e-6))
