"""Fabrics for other programs: the numbers that are written stand for the same cloth."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial import Delaunay

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


def hinged(cell, x, y):
    """Nodes (n, 2), and hinges (edge, and the two corners across), of an equilateral lattice with this edge."""
    nodes = np.array([(cell * (i + 0.5 * (j % 2)), cell * j * np.sqrt(3) / 2) for j in range(y) for i in range(x)])
    triangles = [t for t in Delaunay(nodes).simplices if np.ptp(nodes[t], axis=0).max() < 1.1 * cell]
    across = {}
    for triangle in triangles:
        for k in range(3):
            edge = frozenset((triangle[k], triangle[k - 1]))
            across.setdefault(edge, []).append(triangle[k - 2])
    return nodes, [(*edge, *ends) for edge, ends in across.items() if len(ends) == 2], triangles


def angle(x, a, b, c, d):
    """Between the normals of the two triangles of a hinge."""
    n1, n2 = np.cross(x[b] - x[a], x[c] - x[a]), np.cross(x[d] - x[a], x[b] - x[a])
    n1, n2 = n1 / np.linalg.norm(n1), n2 / np.linalg.norm(n2)
    return np.arctan2(np.linalg.norm(np.cross(n1, n2)), n1 @ n2)


@pytest.mark.parametrize("name", ["blend", "duck"])
def test_hinges_of_ppf_and_newton_bend_as_the_cloth(name):
    """Energy of the formulas of both programs on a lattice on a cylinder: B/2 curvature^2 over its area."""
    fabric, K, edge = fabrics.load(name), 5.0, 0.005
    nodes, hinges, triangles = hinged(edge, 24, 24)
    B = np.sqrt(np.prod([getattr(fabric.bending_or_estimate(), way).B for way in ("warp", "weft")]))
    rolled = np.column_stack([np.sin(K * nodes[:, 0]) / K, nodes[:, 1], (1 - np.cos(K * nodes[:, 0])) / K])
    squares = sum(angle(rolled, *hinge) ** 2 for hinge in hinges)
    area = len(triangles) * edge**2 * np.sqrt(3) / 4
    ppf, newton = (json.loads(exporting.export(fabric, to, edge=edge)) for to in ("ppf", "newton"))
    for k in (1.28e-5 * ppf["bend"] * ppf["density"] * 2 / np.sqrt(3), newton["edge_ke"] * edge):
        assert k * squares / 2 == pytest.approx(B * K**2 / 2 * area, rel=0.06)  # hinges of the rim are missing


@pytest.mark.parametrize("name", fabrics.names())
def test_ppf_newton_and_blender_pull_as_the_cloth(name):
    """Their own formulas give the tension at rest, and ppf and Blender the shear; newton says by how much it is off."""
    fabric = fabrics.load(name)
    n = exporting.linear(fabric)
    tension, mass = np.sqrt(n["tension_warp_N_per_m"] * n["tension_weft_N_per_m"]), n["areal_mass_kg_per_m2"]
    ppf, newton, blender = (json.loads(exporting.export(fabric, to, edge=0.02)) for to in ("ppf", "newton", "blender"))
    E, nu = ppf["young-mod"], ppf["poiss-rat"]
    assert 0 < nu < 0.5 and ppf["density"] == pytest.approx(mass)
    assert mass * E / (2 * (1 + nu)) == pytest.approx(tension)
    assert mass * E * nu / ((1 + nu) * (1 - 2 * nu)) == pytest.approx(n["shear_N_per_m"])
    mu, lame = newton["tri_ke"], newton["tri_ka"]
    assert 4 * mu * (mu + lame) / (2 * mu + lame) == pytest.approx(tension)  # uniaxial, plane
    assert newton["shear_over_that_of_the_cloth"] * n["shear_N_per_m"] == pytest.approx(mu)
    # a square cell of springs: force at the strain e, and energy of the diagonals at the angle g
    a, e, g = 0.02, 0.01, 0.01
    assert blender["tension_stiffness"] / a * (e * a) == pytest.approx(tension * a * e)
    longer = np.sqrt(2) * a * g / 2
    assert 2 * blender["shear_stiffness"] / a * longer**2 / 2 == pytest.approx(n["shear_N_per_m"] * g**2 / 2 * a**2)
    assert blender["mass"] == pytest.approx(mass * a**2)
    moment = 0.1 * blender["bending_stiffness"] * a * g * a / 2  # half of the vertices of a face are off the edge
    assert moment == pytest.approx(np.sqrt(n["bending_warp_N_m"] * n["bending_weft_N_m"]) * g)
    for told in (ppf, newton, blender):
        assert "friction" in told["lost"] and "assumed" in told


def test_an_edge_that_is_none():
    with pytest.raises(InputError, match="An edge of 0 m is none of a mesh"):
        exporting.export(fabrics.load("blend"), "newton", edge=0.0)
