"""Picture frames: the geometry against the work of the crosshead, and fabrics that come back from their records."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify import fabric_file, identify, listing
from fabric_fenicsx.identify.shear import picture_frame
from fabric_fenicsx.identify.synthetic import synthetic
from fabric_fenicsx.laws import driver
from fabric_fenicsx.laws.woven import Woven

SIDE, CLOTH = 0.15, 0.11
FRAME = picture_frame.Frame(None, SIDE, CLOTH)


def crosshead(E12):
    """Displacement (m) at a shear strain."""
    return 2 * SIDE * np.sqrt(E12 + 0.5) - np.sqrt(2) * SIDE


def test_the_geometry_is_that_of_rods():
    """Hinges at the corners of a rhombus; and the crosshead's work is that of the cloth."""
    gamma = np.radians([5.0, 20.0, 45.0])
    d = 2 * SIDE * np.cos((np.pi / 2 - gamma) / 2) - np.sqrt(2) * SIDE
    assert FRAME.strain(d) == pytest.approx(np.sin(gamma) / 2)
    way = np.linspace(0, 0.05, 4001)
    force = 30 * way / 0.05 + 400 * (way / 0.05) ** 4
    E, S = FRAME.strain(way), FRAME.stress(way, force, 0.5e-3)
    assert np.trapezoid(S, 2 * E) * CLOTH**2 * 0.5e-3 == pytest.approx(np.trapezoid(force, way), rel=1e-5)
    # the benchmark's normalised shear force
    phi = np.arccos(2 * E)
    assert S * 0.5e-3 == pytest.approx(force / (2 * np.cos(phi / 2)) * SIDE / CLOTH**2)


def listed(folder, fabric, noise, tops):
    """Records of a fabric whose shear is measured in frames with several cycles; no photographs of the bias test."""
    path = synthetic.write(fabric, folder, 3, noise=noise)
    text = re.sub(r"bias = .*\n", "", path.read_text(encoding="utf-8"))
    rng = np.random.default_rng(5)
    legs = [np.linspace(a, b, 150)[1:] for a, b in tops]
    E12 = np.concatenate([[0.0], *legs])
    strain = np.column_stack([0 * E12, 0 * E12, 2 * E12])
    S = driver.run(Woven(fabric), strain).stress[:, 2]
    force = S * fabric.thickness * CLOTH**2 / SIDE * 2 * np.sqrt(E12 + 0.5)
    for k in (1, 2, 3):
        noisy = force + noise * force.max() * rng.standard_normal(len(force))
        table = np.column_stack([1e3 * crosshead(E12), noisy])
        np.savetxt(folder / f"frame_{k}.csv", table, "%.7g", ";", header="Standardweg (mm);Kraft (N)", comments="")
        text += f'[[frame]]\nfile = "frame_{k}.csv"\nframe_mm = 150\nspecimen_mm = 110\n'
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["blend", "denim"])
def test_a_fabric_comes_back_from_its_frames(tmp_path, name):
    """2 % noise, three specimens, cycles to two heights: the shear curve within 3 % of its peak, unloading 5 %."""
    fabric = fabrics.load(name)
    top = 0.95 * fabric.shear.limit / 2
    middle = 0.6 * top
    rest, last = (x - float(fabric.shear.stress(2 * x)) / fabric.shear.unloading / 2 for x in (middle, top))
    cycles = [(0, middle), (middle, rest), (rest, top), (top, last)]  # back until the force is gone
    found = identify(listing.read(listed(tmp_path, fabric, 0.02, cycles)))
    again = fabric_file.write(found, tmp_path)[1]
    assert found.curves["shear"].how == "measured in picture frames" and not found.doubts
    gamma = np.linspace(0, min(again.shear.limit, fabric.shear.limit), 101)
    true = fabric.shear.stress(gamma)
    assert np.abs(again.shear.stress(gamma) - true).max() < 0.03 * true.max()
    assert again.shear.limit == pytest.approx(2 * top, rel=0.02)
    assert again.shear.unloading == pytest.approx(fabric.shear.unloading, rel=0.05)


GOOD = {"file": "a.csv", "frame_mm": 150, "specimen_mm": 110}


@pytest.mark.parametrize(
    ("entries", "reason"),
    [
        ({}, "frame is not a list of tables"),
        ([GOOD | {"side_mm": 3}], "frame 1: side_mm is not a known key"),
        ([GOOD, {"file": "a.csv", "frame_mm": 150}], "frame 2: specimen_mm is missing"),
        ([GOOD | {"frame_mm": 0.15}], "frame_mm = 0.15 is not a side from 5 to 2000 mm"),
        ([GOOD | {"specimen_mm": 160}], "specimen_mm = 160 is larger than frame_mm = 150"),
        ([GOOD | {"file": 3}], "file = 3 is not the name of a file"),
    ],
)
def test_every_fault_is_one_sentence(entries, reason):
    with pytest.raises(InputError, match=re.escape(reason)) as error:
        picture_frame.read("t.toml", entries)
    assert "\n" not in str(error.value)


def test_a_frame_that_would_close(tmp_path):
    d = np.linspace(0, 88, 50)
    np.savetxt(tmp_path / "a.csv", np.column_stack([d, d]), "%.5g", ",", header="displacement_mm,force_N", comments="")
    frame = replace(FRAME, path=tmp_path / "a.csv")
    with pytest.raises(InputError, match="by more than 85 degrees; correct its unit, or frame_mm"):
        picture_frame.shear([frame], 0.5e-3, [], None)
