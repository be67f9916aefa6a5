"""Panels and seams: outlines, cells of one kind, partner edges node to node, groups, materials by the grain line."""

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments.panels import Edge, Flat, Panel, Rolled, spread
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.material import Material
from fabric_fenicsx.surfaces import meshing, placing

COMM = MPI.COMM_WORLD


def bodice(name, z, grain=np.pi / 2, face=1):
    """Half a shirt with a curved neck and armholes, face to the front or to the back."""
    outline = {
        "hem": Edge((-0.25, 0.0)),
        "right": Edge((0.25, 0.0)),
        "armhole_right": Edge((0.25, 0.4), [(0.19, 0.48)], "spline"),
        "shoulder_right": Edge((0.2, 0.6)),
        "neck": Edge((0.08, 0.62), [(0.0, 0.55)], "arc"),
        "shoulder_left": Edge((-0.08, 0.62)),
        "armhole_left": Edge((-0.2, 0.6), [(-0.16, 0.5), (-0.2, 0.44)], "bezier"),
        "left": Edge((-0.25, 0.4)),
    }
    turn = (np.pi / 2, 0, 0) if face == 1 else tuple(np.pi / np.sqrt(2) * np.array([0, 1, 1]))
    return Panel(name, outline, grain=grain, placed=Flat((0, z, 0), turn))


def shirt(kind="quadrilateral", comm=COMM, cell=0.04):
    front, back = bodice("front", -0.2), bodice("back", 0.2, grain=0.3, face=-1)
    seams = [
        Seam(("front", "right"), ("back", "left"), name="side"),
        Seam(("front", "left"), ("back", "right")),
        Seam(("front", "shoulder_right"), ("back", "shoulder_left")),
        Seam(("front", "shoulder_left"), ("back", "shoulder_right")),
    ]
    return sew([front, back], seams, cell=cell, comm=comm, kind=kind)


def area(domain, name):
    cells = domain.entities(name, 2)[1]
    own = cells[cells < domain.mesh.topology.index_map(2).size_local]
    dx = ufl.Measure("dx", domain.mesh, subdomain_data=[(1, own)], subdomain_id=1)
    return COMM.allreduce(fem.assemble_scalar(fem.form(fem.Constant(domain.mesh, 1.0) * dx)))


def total(domain, name):
    """Edges of a group on all ranks."""
    edges = domain.entities(name, 1)[1]
    return COMM.allreduce(int((edges < domain.mesh.topology.index_map(1).size_local).sum()))


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])
def test_a_shirt_of_two_panels_is_one_sheet(kind):
    garment = shirt(kind)
    domain = garment.domain
    assert domain.pieces == 1 and domain.mesh.basix_cell().name == kind
    meshing.check_surface(domain)
    assert total(domain, "side") == total(domain, "front.right") == total(domain, "back.left") >= 0.4 / 0.04
    x, y = np.concatenate([curve[:-1] for curve in garment.panels[0].curves().values()]).T
    exact = abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
    assert area(domain, "front") == pytest.approx(exact, rel=5e-3)
    assert area(domain, "front") == pytest.approx(area(domain, "back"), rel=1e-9)
    # seam nodes start half way, the others where the panel was placed
    start = placing.cells(domain.mesh)
    assert COMM.allreduce(start[..., 1].max(initial=-9), MPI.MAX) == pytest.approx(0.2)
    assert COMM.allreduce(int((np.abs(start[..., 1]) < 1e-12).sum())) >= 4 * 10


@pytest.mark.parallel
def test_the_warp_of_each_panel_lies_along_its_grain_line():
    law = StVenantKirchhoff.isotropic(1e6, 0.3)
    cloth = Material(law=law, thickness=1e-3, shear=(1e5, 1e5), areal_mass=0.2)
    garment = shirt()
    domain, sheet = garment.domain, garment.sheet(cloth, kinematics="membrane")
    warp = sheet.yarns()[:, 0]
    for name, grain in (("front", np.pi / 2), ("back", 0.3)):
        cells = domain.entities(name, 2)[1]
        inside = cells[np.ptp(placing.cells(domain.mesh)[cells, :, 1], axis=1) < 1e-9]
        expected = garment.panels[name == "back"].placed(np.array([[0, 0], [np.cos(grain), np.sin(grain)]]))
        assert warp[inside] == pytest.approx(np.tile(np.diff(expected, axis=0), (len(inside), 1)), abs=1e-9)
    with pytest.raises(InputError, match="'back' is of 'back', and the materials are: front"):
        garment.materials({"front": cloth})


def test_an_edge_is_eased_into_a_shorter_one():
    one = {"a": Edge((0, 0)), "b": Edge((0.3, 0)), "c": Edge((0.3, 0.1)), "d": Edge((0, 0.1))}
    wide = {name: Edge((1.5 * edge.start[0], edge.start[1])) for name, edge in one.items()}
    panels = [Panel("band", one, placed=Flat((0, 0.2, 0))), Panel("frill", wide)]
    domain = sew(panels, [Seam(("band", "a"), ("frill", "c"))], cell=0.05, comm=MPI.COMM_SELF).domain
    nodes = domain.mesh.topology.index_map(0).size_global
    assert nodes == 2 * 11 * 3 - 11
    assert sum(len(domain.entities(name, 2)[1]) for name in ("band", "frill")) == 2 * 10 * 2


def test_outlines_are_curves_of_their_length():
    arc = Edge((1, 0), [(0, 1)], "arc").curve((-1, 0))
    assert np.hypot(*arc.T) == pytest.approx(1.0, abs=1e-12)
    assert np.linalg.norm(np.diff(arc, axis=0), axis=1).sum() == pytest.approx(np.pi, rel=1e-4)
    other = Edge((1, 0), [(0, -1)], "arc").curve((-1, 0))
    assert other[:, 1].max() < 1e-12
    cubic = Edge((0, 0), [(0, 1), (1, 1)], "bezier").curve((1, 0))
    assert cubic[100] == pytest.approx([0.5, 0.75])
    assert spread(arc, 4)[2] == pytest.approx([0, 1], abs=1e-9)
    spline = Edge((0, 0), [(1, 1), (2, 0)], "spline").curve((3, 1))
    assert min(np.hypot(*(spline - np.array([1, 1])).T)) < 0.02


def test_a_panel_rolled_onto_a_limb_faces_outwards():
    rolled = Rolled(0.05, origin=(1, 2, 3), axis=(1, 0, 0), facing=(0, 0, 1), level=0.1)
    x = rolled(np.array([[0, 0.1], [0, 0.2], [0.05 * np.pi / 2, 0.1], [1e-7, 0.1]]))
    assert x[0] == pytest.approx([1, 2, 3.05]) and x[1] == pytest.approx([1.1, 2, 3.05])
    assert np.cross(x[3] - x[0], x[1] - x[0]) @ [0, 0, 1] > 0
    assert np.linalg.norm(x[2] - [1, 2, 3]) == pytest.approx(0.05)


SQUARE = {"a": Edge((0, 0)), "b": Edge((1, 0)), "c": Edge((1, 1)), "d": Edge((0, 1))}


@pytest.mark.parametrize(
    "make, said",
    [
        (lambda: Panel("p", dict(reversed(SQUARE.items()))), "'p' must go round anticlockwise"),
        (lambda: Panel("p", {"a": Edge((0, 0))}), "two edges at least"),
        (lambda: Panel("p", SQUARE | {"d": Edge((0, 1), [], "arc")}), "'p': An edge of shape 'arc'"),
        (lambda: Panel("p", SQUARE | {"d": Edge((1, 1))}), "'p': The edge from .* has no length"),
        (lambda: Panel("p", SQUARE | {"e": Edge((0, 0.5))}, regular=True), "has 5 edges"),
        (lambda: Edge((0, 0), [(1, 0)], "arc").curve((2, 0)), "is a straight line"),
        (lambda: Rolled(0.1, axis=(0, 0, 1), facing=(0, 0, 2))(np.zeros((1, 2))), "cannot face along it"),
        (lambda: Seam(("p", "a")), "A seam joins two edges, and not p.a"),
        (lambda: sew([Panel("p", SQUARE)], [Seam(("p", "a"), ("p", "x"))], cell=0.5), "No panel has the edge 'p.x'"),
        (
            lambda: sew([Panel("p", SQUARE)], [Seam(("p", "a"), ("p", "b")), Seam(("p", "b"), ("p", "c"))], cell=0.5),
            "'p.b' is in two seams",
        ),
        (lambda: sew([Panel("p", SQUARE)] * 2, cell=0.5), "2 are called 'p'"),
        (lambda: sew([Panel("p", SQUARE)], cell=0.0), "cell size of 0.0"),
    ],
)
def test_what_cannot_be_sewn_is_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()
