"""Sheets that bend by a law of their own: what goes in as B and 2HB comes out of a shell, on any number of ranks."""

import warnings

import numpy as np
import pytest
import scenes as small
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics, scenes, sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import BendingCurve, BendingCurves
from fabric_fenicsx.fabrics.bending import bias_of_twist
from fabric_fenicsx.identify.bending import elastica, hanging
from fabric_fenicsx.identify.bending.elastica import Beam
from fabric_fenicsx.laws.bending import Bending
from fabric_fenicsx.laws.own_bending import OwnBending
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.scenes import reading
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

BLEND = fabrics.load("blend")
SVK = StVenantKirchhoff.from_fabric(BLEND)
G, MASS = BLEND.shear.modulus[0], 0.2


def curves(curve):
    return BendingCurves(curve, curve, curve)


def hung(curve, length, cells, element):
    """Angle (radians) of an overhang of a shell."""
    triangles = int(element == "regge")
    width = length / 2
    domain = meshing.read(
        small.MESHES / "strip.geo", length=length, width=width, nx=cells, ny=cells // 2, triangles=triangles
    )
    cloth = sheet.Sheet(domain, SVK, BLEND.thickness, (G, G), element=element, bending=Bending(curves(curve)))
    g = fem.Constant(domain.mesh, (0.0, 0.0, 0.0))

    def put(part):
        g.value[2] = -9.80665 * part

    solver = cloth.equilibrium(supports.clamp(domain, cloth.space, "fixed_end"), cloth.weight(MASS, g))
    cuts = sum(step.step_cuts for step in statics.march(solver, put, [0.25, 0.5, 0.75, 1.0]))
    assert cuts == 0
    x, z = (supports.mean(domain, cloth.space, cloth.q, "pulled_end", k) for k in (0, 2))
    return float(np.arctan2(-z, length + x))


def rigidity(curve, cells, element):
    """What ASTM D1388 makes of a shell's overhang, over what it makes of the elastica's: 41.5 degrees, c^3."""
    beam, lengths = Beam(curve, MASS), np.geomspace(0.02, 0.1, 400)
    angles = elastica.overhang_angle(beam, lengths)
    length = float(np.interp(hanging.ASTM_ANGLE, angles, lengths))
    seen = float(np.interp(hung(curve, length, cells, element), angles, lengths))
    return (length / seen) ** 3


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("element", ["mitc4", "regge"])
@pytest.mark.parametrize(
    "curve", [BendingCurve(5e-6), BendingCurve(100e-6), BendingCurve(10e-6, 0.0, 0.5e-3)], ids=["5", "100", "friction"]
)
def test_b_goes_in_and_b_comes_out(element, curve):
    """Of cells of a quarter bending length 2 %."""
    assert rigidity(curve, 8, element) == pytest.approx(1.0, abs=0.02)


def test_half_the_cell_has_a_quarter_of_the_error():
    """Of cells of an eighth 0.6 %; softening too."""
    curve = BendingCurve(13.8e-6, -35.6e-9)
    coarse, fine = (rigidity(curve, cells, "mitc4") - 1 for cells in (8, 16))
    assert abs(fine) < 0.006 and abs(coarse) < 0.02 and 3 < coarse / fine < 5


@pytest.mark.parametrize(
    ("length", "width", "cells", "middle", "wide"),
    [(0.06, 0.004, (45, 4), 1 / 6, False), (0.01, 0.1, (6, 24), 0.5, True)],
)
def test_a_bias_strip_of_a_shell(length, width, cells, middle, wide):
    """Bent by a moment between two bars: a narrow one twists between them and is soft, a wide one cannot."""
    linear = BendingCurve(12e-6), BendingCurve(8e-6), BendingCurve(2e-6)
    nx, ny = cells
    domain = meshing.read(small.MESHES / "strip.geo", MPI.COMM_SELF, length=length, width=width, nx=nx, ny=ny)
    cloth = sheet.Sheet(
        domain,
        SVK,
        BLEND.thickness,
        (G, G),
        warp=np.array([1.0, 1.0, 0.0]) / np.sqrt(2),
        bending=Bending(BendingCurves(*linear)),
    )
    held, given = supports.clamp(domain, cloth.space, "fixed_end"), bias_of_twist(*linear, wide=wide).B
    supports.rigid(domain, cloth.space, "pulled_end")
    moment, edge = fem.Constant(domain.mesh, np.zeros(3)), supports.over(domain, "pulled_end", 1)
    solver = cloth.equilibrium(held, weakform.edge_moment(moment, cloth.director, cloth.delta, edge))

    def bend(curvature):
        moment.value[1] = given * curvature

    assert len(list(statics.march(solver, bend, [2.0]))) == 1
    u = cloth.displacement()
    x, z = u.function_space.tabulate_dof_coordinates()[:, 0], u.x.array.reshape(-1, 3)[:, 2]
    seen = np.abs(x - length / 2) <= middle * length + 1e-9
    curvature = -2 * np.polyfit(x[seen], z[seen], 2)[0]
    assert curvature == pytest.approx(2.0, rel=0.02)


def plate(law=SVK, comm=MPI.COMM_SELF, **more):
    domain = meshing.read(small.MESHES / "square.geo", comm, n=4)
    return sheet.Sheet(domain, law, BLEND.thickness, (G, G), **more)


def test_a_linear_sheet_stays_linear():
    linear, bent = Bending(curves(BendingCurve(10e-6))), Bending(curves(BendingCurve(10e-6, 0.0, 1e-3)))
    assert (
        not plate(bending=linear).points and plate(bending=bent).points and plate(Woven(BLEND), bending=linear).points
    )
    assert isinstance(plate(bending=bent).points[0].law, OwnBending)
    assert isinstance(plate(Woven(BLEND)).points[0].law, Section)


def test_the_limit_of_transverse_shear():
    h = BLEND.thickness
    assert OwnBending(SVK, h, Bending(curves(BendingCurve(10e-6)))).shear_limit(1e9) == pytest.approx(6 * 10e-6 / h**3)
    rough = Bending(BendingCurves(BendingCurve(10e-6, 0.0, 1e-3), BendingCurve(20e-6), BendingCurve(5e-6)))
    sticking = 10e-6 + 0.47 / 0.6 * 0.5e-3 / 15
    assert OwnBending(Woven(BLEND), h, rough).shear_limit(1.0) == pytest.approx(6 * sticking / h**3)
    assert OwnBending(SVK, h, small.Toy()).shear_limit(1.0) > 0  # one that tells no bound
    isotropic = StVenantKirchhoff.isotropic(1e6, 0.25)
    assert Section(isotropic, h).shear_limit(1.0) == pytest.approx(0.4e6)
    assert Section(isotropic, h).shear_limit(1e6) == 1e6 and Section(small.Toy(), h).shear_limit(7.0) == 7.0


def test_what_does_not_go_together():
    law = Bending(curves(BendingCurve(10e-6)))
    with pytest.raises(InputError, match=r"bending law does not go with layers=3; leave one"):
        plate(bending=law, layers=3)
    with pytest.raises(InputError, match="membrane, which does not bend"):
        plate(bending=law, kinematics="membrane")
    with pytest.raises(InputError, match="law list cannot be used"):
        plate(bending=[1.0])


SCENE = """
[mesh]
file = "square.geo"
[sheet]
fabric = "blend"
{more}
[[support]]
at = "left"
kind = "hinge"
[statics]
"""


def scene(folder, more):
    (folder / "square.geo").write_text((small.MESHES / "square.geo").read_text())
    (folder / "scene.toml").write_text(SCENE.format(more=more))
    return reading.read(folder / "scene.toml")


@pytest.mark.parametrize(
    ("more", "bending", "layers"),
    [
        ("", "own", None),
        ('bending = "own"', "own", None),
        ("layers = 2", "layers", 2),
        ('bending = "layers"', "layers", 3),
        ('kinematics = "membrane"', "", None),
    ],
)
def test_how_a_scene_bends(tmp_path, more, bending, layers):
    (material,) = scene(tmp_path, more).materials
    assert (material.bending, material.layers) == (bending, layers)


def test_a_scene_says_what_is_assumed(tmp_path):
    with pytest.warns(UserWarning, match="blend: bending is assumed: not measured; B = mass x g x c"):
        built = scenes.build(scene(tmp_path, 'law = "continuous"'))
    own = built.cloth.points[0].law
    assert isinstance(own, OwnBending) and own.bending.curves == BLEND.bending_or_estimate()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        built = scenes.build(scene(tmp_path, "layers = 2"))
    assert isinstance(built.cloth.points[0].law, Section)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('bending = "own"\nlayers = 3', "sheet.layers = 3 does not go with bending"),
        ('bending = "measured"', "sheet.bending = 'measured' is not known; .*own, layers"),
        ('kinematics = "membrane"\nlayers = 3', "sheet.layers = 3 is of a shell"),
        ('kinematics = "membrane"\nbending = "own"', "sheet.bending = 'own' is of a shell"),
    ],
)
def test_contradictions_of_a_scene(tmp_path, more, said):
    with pytest.raises(InputError, match=said):
        scene(tmp_path, more)
