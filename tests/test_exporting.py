"""Fabrics for other programs: the numbers that are written stand for the same cloth."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from fabric_fenicsx import fabrics
from fabric_fenicsx.app.cli import app
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import BendingCurve, BendingCurves, exporting


def said(text, after):
    """Numbers of the lines below a keyword."""
    rows = text.split(after + "\n")[1].split("*")[0].split("\n")
    return np.array([[float(x) for x in row.split(",")] for row in rows if row], dtype=object)


@pytest.mark.parametrize("name", fabrics.names())
def test_engineering_constants_stretch_and_bend_like_the_cloth(name):
    """E h is the tension at rest, E h^3/12/(1 - nu12 nu21) the rigidity, density h the mass; the matrix is stable."""
    fabric = fabrics.load(name)
    text = exporting.export(fabric, "calculix")
    (first, second) = said(text, "*ELASTIC, TYPE=ENGINEERING CONSTANTS")
    E1, E2, _, nu12, _, _, G, _ = first
    h = float(text.rstrip().split("\n")[-1].strip("* "))
    bent = fabric.bending_or_estimate()
    for E, curve in ((E1, fabric.warp), (E2, fabric.weft), (G, fabric.shear)):
        assert E * h == pytest.approx(curve.modulus[0] * fabric.thickness, rel=1e-6)
    nu21 = nu12 * E2 / E1
    B = np.sqrt(E1 * E2) * h**3 / 12 / (1 - nu12 * nu21)
    assert pytest.approx(np.sqrt(bent.warp.B * bent.weft.B), rel=1e-6) == B and second == [G]
    assert 0 <= nu12 * nu21 < 1
    assert said(text, "*DENSITY")[0][0] * h == pytest.approx(fabric.areal_mass, rel=1e-6)
    assert "assumed" in text and "left out" in text


@pytest.mark.parametrize("name", fabrics.names())
def test_fabric_tables_do_the_work_of_the_curves(name):
    """Nominal stress over nominal strain, and shear stress over the angle: the same work as S over E."""
    fabric = fabrics.load(name)
    text = exporting.export(fabric, "abaqus")
    for component, curve in (("1", fabric.warp), ("2", fabric.weft), ("SHEAR", fabric.shear)):
        table = said(text, f"*UNIAXIAL, COMPONENT={component}\n*LOADING DATA, EXTRAPOLATION=LINEAR").astype(float)
        assert (np.diff(table[:, 1]) > 0).all() and (0 in table[:, 0])
        up = table[table[:, 1] >= 0]
        end = np.sin(up[-1, 1]) if component == "SHEAR" else up[-1, 1] + up[-1, 1] ** 2 / 2
        E = np.linspace(0, end, 4001)
        assert np.trapezoid(up[:, 0], up[:, 1]) == pytest.approx(np.trapezoid(curve.stress(E), E), rel=5e-3)
        assert end == pytest.approx(min(curve.limit, 0.95), rel=1e-6)


def test_linear_numbers():
    curves = BendingCurves(BendingCurve(12e-6), BendingCurve(8e-6), BendingCurve(5e-6))
    fabric = replace(fabrics.load("blend"), bending=curves, poisson={"measured": (0.9, 4.0), "lowered": (0.9, 4.0)})
    n = exporting.linear(fabric)
    assert [n[f"bending_{way}_N_m"] for way in ("warp", "weft", "twist")] == [12e-6, 8e-6, 5e-6]
    assert n["nu12"] * n["nu21"] == pytest.approx(0.95**2)  # 0.9 and 4.0 together would give work back
    assert n["nu12"] / n["tension_warp_N_per_m"] == pytest.approx(n["nu21"] / n["tension_weft_N_per_m"])
    with pytest.raises(InputError, match=re.escape("'dyna' is no format of an export; give one of calculix")):
        exporting.export(fabric, "dyna")


def test_the_command():
    run = CliRunner().invoke(app, ["fabrics", "export", "denim"])
    numbers = json.loads(run.output)
    assert run.exit_code == 0 and "not measured" in numbers["assumed"] and numbers["areal_mass_kg_per_m2"] > 0.3
    for to in exporting.FORMATS:
        assert CliRunner().invoke(app, ["fabrics", "export", "denim", "--to", to]).exit_code == 0
