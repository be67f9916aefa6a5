"""Dressing by metric relaxation: clear of the body, at rest, in balance, and kept for scenes."""

import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem, la

from fabric_fenicsx import scenes
from fabric_fenicsx.contact.bodies import Cylinder
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.contact.skin import Skin
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments import dressing
from fabric_fenicsx.garments.panels import Edge, Flat, Panel
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.material import Material
from fabric_fenicsx.output import results
from fabric_fenicsx.solvers.unknowns import add_forces
from fabric_fenicsx.surfaces import placing
from fabric_fenicsx.terms import supports

COMM = MPI.COMM_WORLD
R, LENGTH, E, H, SMALLER = 0.1, 0.05, 2e5, 1e-3, 0.95
CLOTH = Material(law=StVenantKirchhoff.isotropic(E, 0.3), thickness=H, shear=(E / 2.6, E / 2.6), areal_mass=0.2)
kinds = pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])


def tube(kind, cells):
    """Two panels before and behind a cylinder, sewn at their sides, and smaller than it."""
    half, panels = np.pi * R * SMALLER / 2, []
    for name, y, turn in (("front", -1.2 * R, (0.5, 0, 0)), ("back", 1.2 * R, (0, 0.5**0.5, 0.5**0.5))):
        corners = ((-half, 0), (half, 0), (half, LENGTH), (-half, LENGTH))
        outline = dict(zip(("hem", "right", "top", "left"), map(Edge, corners), strict=True))
        panels.append(Panel(name, outline, placed=Flat((0, y, 0), tuple(np.pi * np.array(turn)))))
    seams = [Seam(("front", "right"), ("back", "left")), Seam(("front", "left"), ("back", "right"))]
    return sew(panels, seams, cell=2 * half / cells, kind=kind)


def body():
    return Cylinder(R, 0.4, (0, 0, LENGTH / 2), cells=6)


def contact(sheet, around):
    return Contact(sheet, [around], itself=False, stiffness=2e3, reach=2e-3)


@pytest.mark.parallel(first=1)
@kinds
def test_a_tube_of_two_panels_shrinks_onto_a_cylinder_and_is_kept(kind, tmp_path):
    path, cells = COMM.bcast(tmp_path / "worn.npz"), 6 if kind == "triangle" else 12
    cloth, around = tube(kind, cells).sheet(CLOTH), body()
    touch = contact(cloth, around)
    dress = dressing.Dressing(cloth, touch.terms)
    for step in dress.march(0.04):
        assert np.isfinite(step.load) and not touch.crossed()
    assert dress.relaxed == 1.0 and dress.stir < dressing.AT_REST
    assert touch.least_gap() > 0.0
    # flat panels have told its strain, not its start, in which it was twice as wide
    stretch = (R + H + 1e-3) / (SMALLER * R)
    assert np.sqrt(1 + 2 * cloth.cell_strain()[:, 1]) == pytest.approx(stretch, rel=0.03)
    assert dress.solver.descends and dress.stored > 0.0
    dress.save(path)

    again = dressing.worn(path, tube(kind, cells), CLOTH)
    assert all([term.evaluate() for term in again.terms])
    f = fem.Function(again.q.function_space)
    add_forces(again.terms, f.x.array)
    f.x.scatter_reverse(la.InsertMode.add)
    pressed = touch.forces()
    assert np.abs(pressed - Skin(again).moved(f.x.array)).max() < 2e-3 * np.abs(pressed).max()
    assert not contact(again, around).crossed()
    assert again.cell_strain() == pytest.approx(cloth.cell_strain(), abs=1e-6)


@pytest.mark.parallel(first=1)
@kinds
def test_a_frill_gathered_into_a_band_comes_to_balance(kind):
    """1.5 : 1; nothing but the seam pulls it together."""
    band = {"hem": Edge((0, 0)), "right": Edge((0.12, 0)), "top": Edge((0.12, 0.04)), "left": Edge((0, 0.04))}
    frill = {name: Edge((1.5 * edge.start[0], edge.start[1])) for name, edge in band.items()}

    def wavy(points):
        x = points[:, 0] / 1.5
        return np.column_stack([x, points[:, 1] - 0.04, 2e-3 * np.sin(x * np.pi / 0.03) * (0.04 - points[:, 1]) / 0.04])

    panels = [Panel("band", band), Panel("frill", frill, placed=wavy)]
    garment = sew(panels, [Seam(("band", "hem"), ("frill", "top"))], cell=0.015, kind=kind)
    cloth = garment.sheet(CLOTH)
    bcs = supports.clamp(garment.domain, cloth.space, "band.top")
    dress = dressing.Dressing(cloth, [], bcs)
    list(dress.march(0.02))
    assert dress.stir < dressing.AT_REST and np.isfinite(cloth.q.x.array).all()
    # it has buckled: its hem is nearly as long as the panel's, its top as short as the band's
    frill = garment.domain.entities("frill", 2)[1]
    assert len(frill) == 0 or np.abs(cloth.cell_strain()[frill, 1]).max() < 0.2
    height = np.abs(cloth.displacement().x.array[2::3]).max(initial=0.0)
    assert COMM.allreduce(height, MPI.MAX) > 5e-3


def test_only_what_is_sewn_can_be_dressed(tmp_path):
    garment = tube("quadrilateral", 4)
    with pytest.raises(InputError, match="Only a shell that has been sewn"):
        dressing.Dressing(garment.sheet(CLOTH, kinematics="membrane"), [])
    with pytest.raises(InputError, match=r"worn\.npz' does not fit"):
        dressing.worn(tmp_path / "worn.npz", garment, CLOTH)
    assert placing.of(garment.domain.mesh) is not None


def half(name, facing):
    corners = '{ name = "hem", from = [-149, 0] }, { name = "right", from = [149, 0] }, '
    corners += '{ name = "top", from = [149, 60] }, { name = "left", from = [-149, 60] }'
    roll = f"roll = {{ radius_m = 0.12, facing = [0, {facing}, 0], around_deg = 180 }}"
    return f'[[panel]]\nname = "{name}"\nmaterial = "knit"\noutline = [{corners}]\n{roll}\n'


PATTERN = f"""unit = "mm"
{half("front", -1)}{half("back", 1)}
[[seam]]
join = ["front.right", "back.left"]
[[seam]]
join = ["front.left", "back.right"]
"""
SCENE = """
[mesh]
file = "tube.toml"
cell_m = 0.08
[sheet]
fabric = "blend"
law = "svk"
layers = 3
[[body]]
name = "limb"
kind = "cylinder"
radius_m = 0.1
length_m = 0.4
centre_m = [0, 0, 0.03]
cells = 6
[contact]
itself = false
friction = 0.3
reach_m = 2e-3
stiffness_Pa = 2e3
[[probe]]
name = "hem"
at = "front.hem"
axis = "z"
[dressing]
time_s = 0.2
"""
MOTION = SCENE.replace("[dressing]\ntime_s = 0.2", "[dynamics]\nend_s = 0.02\nstep_ms = 10")


def scene(folder, text, pattern=PATTERN):
    (folder / "tube.toml").write_text(pattern)
    (folder / "scene.toml").write_text(text)
    return scenes.read(folder / "scene.toml")


def test_a_scene_dresses_a_pattern_and_another_goes_on_with_it(tmp_path):
    table = scenes.run(scene(tmp_path, SCENE), results.folder(tmp_path / "out"), progress=False)
    assert table.rows[-1]["least_gap_m"] > 0.0 and (tmp_path / "out" / "worn.npz").exists()
    built = scenes.build(scene(tmp_path, MOTION.replace("cell_m", 'worn = "out/worn.npz"\ncell_m')))
    assert built.touch is not None and not built.touch.crossed() and built.cloth.materials.keys() == {"front", "back"}
    (distance,) = {round(float(r), 3) for r in np.hypot(*built.touch.nodes()[:, :2].T)}
    assert 0.1 < distance < 0.11
    # the weft, around, is stretched on the body by its ease: 2 pi R over the panels
    assert np.sqrt(1 + 2 * built.cloth.cell_strain()[:, 1]) == pytest.approx(2 * np.pi * distance / 0.596, rel=0.05)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (SCENE.replace("tube.toml", "square.geo").replace("cell_m = 0.08", ""), "dressing = .* is of a sewing pattern"),
        (SCENE.replace("cell_m = 0.08", ""), "mesh.*cell_m"),
        (SCENE + '[[load]]\nkind = "gravity"\nacceleration_m_per_s2 = [0, 0, -9.81]\n', "does not go with dressing"),
        (SCENE[: SCENE.index("[[body]]")] + "[dressing]\n[[support]]\nat='front.hem'\nkind='hinge'", "to be dressed"),
        (SCENE.replace("cells = 6", "cells = 6\nmass_kg = 1"), "mass_kg"),
        (SCENE + "[statics]\n", "a scene has one of them"),
    ],
)
def test_what_cannot_be_dressed_by_a_scene_is_refused(tmp_path, text, reason):
    with pytest.raises(InputError, match=reason) as fault:
        scene(tmp_path, text)
    assert "\n" not in str(fault.value)


@pytest.mark.filterwarnings("ignore:.*is assumed")
def test_materials_of_a_pattern_are_those_of_its_panels(tmp_path):
    two = SCENE.replace(
        'fabric = "blend"\nlaw = "svk"\nlayers = 3', '[[sheet.material]]\nat = "silk"\nfabric = "blend"'
    )
    with pytest.raises(InputError, match="No panel is of the material 'silk'; those of the pattern are knit"):
        scenes.build(scene(tmp_path, two), COMM)
    with pytest.raises(InputError, match="leave warp out"):
        scenes.build(scene(tmp_path, SCENE.replace("layers = 3", "warp = [0, 1, 0]")), COMM)
