"""The demos of bending: their checked numbers, their files, and the same outline on two ranks."""

import re

import numpy as np
import pytest
import test_demos

demo, read = test_demos.demo, test_demos.read


def test_cantilever(demo, tmp_path):
    """B 10 and 2HB 0.5 read as 14.9 uN m, 15.0 by the elastica."""
    words = ("--B", "10", "--hysteresis", "0.5", "--mass", "200", "--steps", "2", "--cells", "8")
    status, said, _ = demo("cantilever.py", *words, "--out", tmp_path)
    table = read(tmp_path / "history.csv")
    assert status == 0 and ": yes;" in said and "assumed twist" in said
    assert np.abs(table["angle_deg"] - table["elastica_deg"]).max() < 1.5 and len(table["angle_deg"]) == 6
    assert float(said.split("mass g c^3 = ")[1].split()[0]) == pytest.approx(14.9, abs=0.2)
    for name in ("angle.png", "deformed.png"):
        test_demos.look(tmp_path / name)


def test_a_bias_strip_of_assumed_bending(demo, tmp_path):
    status, said, _ = demo("cantilever.py", "--fabric", "denim", "--way", "bias", "--steps", "2", "--out", tmp_path)
    assert status == 0 and ": yes;" in said and said.count("(assumed)") == 3
    c = float(said.split("bending length ")[1].split()[0])
    assert c == pytest.approx(19.22, rel=0.01)  # the median of 618 bias strips


def test_loop(demo, tmp_path):
    """0.1 gf cm2/cm and 0.05 gf cm/cm."""
    words = ("--B", "9.80665", "--hysteresis", "0.490333", "--step", "25")
    status, said, _ = demo("bending_loop.py", *words, "--out", tmp_path)
    table = read(tmp_path / "history.csv")
    assert status == 0 and ": yes;" in said
    assert table["curvature_per_m"].max() == 250 and table["curvature_per_m"].min() == -250
    B, width = (float(number) for number in re.findall(r" = ([\d.]+) gf", said))
    assert (B, width) == (pytest.approx(0.1, rel=0.006), pytest.approx(0.05, rel=0.006))
    for name in ("loop.png", "deformed.png"):
        test_demos.look(tmp_path / name)


CUSICK = ("--percentile", "50", "--cell", "20", "--end", "0.8", "--step", "20")


@pytest.mark.slow
def test_cusick(demo, tmp_path):
    """Cells of 20 mm are too coarse for folds, but not for the area; the same outline on two ranks."""
    status, said, _ = demo("cusick.py", *CUSICK, "--seeds", "2", "--out", tmp_path / "one")
    assert status == 0 and ": yes;" in said and "mean of 2 seeds" in said
    outlines = [read(tmp_path / "one" / f"seed{seed}" / "outline.csv") for seed in (0, 1)]
    table = read(tmp_path / "one" / "seed0" / "history.csv")
    radii = outlines[0]["radius_mm"] / 1e3
    shadow = 100 * (np.mean(radii**2) - 0.09**2) / (0.15**2 - 0.09**2)
    assert shadow == pytest.approx(table["drape_coefficient"][-1], abs=1e-3) and 50 < shadow < 75
    assert table["drape_coefficient"][0] > 99 and not np.allclose(*(o["radius_mm"] for o in outlines), atol=2)
    for name in ("outline.png", "seed0/deformed.png"):
        test_demos.look(tmp_path / "one" / name)
    command = [str(test_demos.script("cusick.py")), *CUSICK, "--out", str(tmp_path / "two")]
    test_demos.on_two_ranks([command])
    assert read(tmp_path / "two" / "seed0" / "outline.csv")["radius_mm"] == pytest.approx(1e3 * radii, abs=0.05)


@pytest.mark.parametrize(
    ("name", "words", "reason"),
    [
        ("cantilever.py", "--B 0", "0 is not greater than zero"),
        ("cantilever.py", "--B 10 --hysteresis -1", "hysteresis"),
        ("cusick.py", "--percentile 101", "--percentile 101 is not from 0 to 100"),
        ("cusick.py", "--end 0.5", "lowered until 0.6 s"),
    ],
)
def test_bad_input(demo, tmp_path, name, words, reason):
    status, _, error = demo(name, *words.split(), "--out", tmp_path)
    assert status not in (0, None) and reason in error


def test_the_outline_is_that_of_the_farthest_edges(monkeypatch):
    """Of a flat ring its rim, whose corners lie on the circle; and folds are counted as they are drawn."""
    monkeypatch.syspath_prepend(test_demos.script("cusick.py").parent)
    import cusick

    waved = 0.12 + 0.02 * np.cos(7 * cusick.RAYS + 0.3)
    assert cusick.folds(waved) == (7, pytest.approx(0.14, rel=1e-3))
    assert cusick.folds(np.full(360, 0.15))[0] == 0
    assert cusick.drape_coefficient(np.full(360, 0.15)) == pytest.approx(100)
    assert cusick.drape_coefficient(np.full(360, 0.09)) == pytest.approx(0)
