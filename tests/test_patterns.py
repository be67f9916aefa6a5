"""Patterns from files: DXF of the trade, GarmentCode's JSON and our own TOML, to panels that can be sewn."""

import json
from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments import outlines, patterns
from fabric_fenicsx.garments.sewing import sew

# half a shirt's front, m: from the middle of the hem round to the neck, with an arc of the armhole
ARMHOLE = [[0.28 - 0.06 * np.sin(t), 0.46 - 0.06 * np.cos(t)] for t in np.linspace(0, np.pi / 2, 40)]
HALF = [[[0, 0], [0.28, 0]], [[0.28, 0], [0.28, 0.40]], ARMHOLE, [[0.22, 0.46], [0.22, 0.6], [0.1, 0.65]],
        [[0.1, 0.65], [0, 0.6]], [[0, 0.6], [0, 0]]]  # fmt: skip
TURNS = [line[0] for line in HALF]
AREA = 0.28 * 0.4 + 0.22 * 0.2 + 0.06**2 * (1 - np.pi / 4) + 0.5 * 0.12 * 0.05 + 0.5 * 0.1 * 0.05
"""Without the arc's polygon, which is 1e-6 m2 smaller at most."""


def area(panel):
    return outlines.area([*panel.curves().values()])


def turned(points, degrees):
    t = np.radians(degrees)
    return (np.array(points) @ np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])).tolist()


def written(path, pieces, *, unit="METRIC", sample="M", about=True):
    """A DXF file of the kind AAMA: pieces as (name, size, {layer: lines or points in m}, {key: text})."""
    ezdxf = pytest.importorskip("ezdxf")
    file, scale = ezdxf.new("R12"), {"METRIC": 1e3, "ENGLISH": 1 / 0.0254}.get(unit, 1.0)
    model = file.modelspace()
    for text in ["STYLE NAME: TEE", f"Sample Size: {sample}", f"Units: {unit}"] if about else []:
        model.add_text(text, dxfattribs={"layer": "1"})
    for name, size, layers, texts in pieces:
        block = file.blocks.new(f"{name}_{size}")
        for key, value in {"Piece Name": name, "SIZE": size, **texts}.items():
            block.add_text(f"{key}: {value}", dxfattribs={"layer": "1"})
        for layer, lines in layers.items():
            for line in lines:
                if np.ndim(line) == 1:
                    block.add_point(scale * np.array(line), dxfattribs={"layer": layer})
                elif len(line) == 2:
                    block.add_line(*(scale * np.array(line)), dxfattribs={"layer": layer})
                else:
                    block.add_polyline2d(scale * np.array(line), dxfattribs={"layer": layer})
        model.add_blockref(f"{name}_{size}", (0, 0))
    file.saveas(path)
    return path


def half(**more):
    return {"1": HALF, "2": TURNS, "7": [[[0.1, 0.1], [0.1, 0.5]]]} | more


@pytest.mark.parametrize("unit", ["METRIC", "ENGLISH"])
def test_a_piece_has_its_area_grain_edges_notches_and_size(tmp_path, unit):
    tilted = {layer: [turned(line, 7.3) for line in lines] for layer, lines in half(**{"4": [[0.28, 0.2]]}).items()}
    pieces = [("FR", "M", tilted, {"MATERIAL": "denim"}), ("FR", "L", {"1": HALF[:1]}, {})]
    path = written(tmp_path / "tee.dxf", pieces, unit=unit)
    found = patterns.read(path, allowance=0.0)
    (panel,) = found.panels
    assert (panel.name, panel.material, list(panel.outline)) == ("FR", "denim", list("123456"))
    assert area(panel) == pytest.approx(AREA, abs=2e-6)
    polygon = np.concatenate([np.array(line)[:-1] for line in HALF])
    x, y = polygon.T
    assert area(panel) == pytest.approx(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y), rel=1e-6)
    assert np.degrees(panel.grain) == pytest.approx(97.3, abs=0.1)
    assert found.notches["FR"] == pytest.approx(np.array([turned([0.28, 0.2], 7.3)]), abs=1e-6)
    assert [*panel.lengths().values()][:2] == pytest.approx([0.28, 0.4])
    with pytest.raises(InputError, match="'FR' has an outline with a gap"):
        patterns.read(path, size="L", allowance=0.0)


@pytest.mark.parametrize("how", ["lines in any order and direction", "one closed line", "clockwise"])
def test_an_outline_is_put_together_as_programs_write_it(tmp_path, how):
    if how == "one closed line":
        lines = [[point for line in HALF for point in line[:-1]] + [HALF[0][0]]]
    elif how == "clockwise":
        lines = [line[::-1] for line in HALF[::-1]]
    else:
        lines = [line if k % 2 else line[::-1] for k, line in enumerate(HALF)]
        lines = [lines[k] for k in (0, 3, 1, 5, 2, 4)]
        lines[1] = (np.array(lines[1]) + 1e-4).tolist()  # they do not quite meet
    path = written(tmp_path / "tee.dxf", [("FR", "M", half(**{"1": lines}), {})])
    (panel,) = patterns.read(path, allowance=0.0).panels
    assert len(panel.outline) == 6 and area(panel) == pytest.approx(AREA, abs=1e-4 if "order" in how else 2e-6)
    assert sorted(panel.lengths().values())[-1] == pytest.approx(0.6, abs=2e-4)


def test_half_a_piece_is_unfolded_at_its_mirror_line(tmp_path):
    path = written(tmp_path / "tee.dxf", [("FR", "M", half(**{"6": [[[0, 0.1], [0, 0.5]]]}), {})])
    (panel,) = patterns.read(path, allowance=0.0).panels
    assert list(panel.outline) == ["1", "2", "3", "4", "5", "4-mirrored", "3-mirrored", "2-mirrored"]
    assert area(panel) == pytest.approx(2 * AREA, abs=4e-6)
    lengths = panel.lengths()
    assert lengths["1"] == pytest.approx(0.56) and lengths["3"] == pytest.approx(lengths["3-mirrored"])


def test_a_seam_allowance_is_taken_off_inside_and_not_at_the_fold(tmp_path):
    square = [[[0, 0], [0.3, 0]], [[0.3, 0], [0.3, 0.2]], [[0.3, 0.2], [0, 0.2]], [[0, 0.2], [0, 0]]]
    layers = {"1": square, "7": [[[0.1, 0.05], [0.1, 0.15]]], "6": [[[0, 0], [0, 0.2]]]}
    path = written(tmp_path / "box.dxf", [("BOX", "M", layers, {})])
    (panel,) = patterns.read(path, allowance=0.01).panels
    assert area(panel) == pytest.approx(2 * 0.29 * 0.18, rel=1e-9)
    cut = written(tmp_path / "cut.dxf", [("FR", "M", half(), {})])
    (whole,), (sewn,) = patterns.read(cut, allowance=0.0).panels, patterns.read(cut, allowance=0.008).panels
    length = sum(whole.lengths().values())
    corners = 0.008**2 * 4.5  # of the order of a square each
    assert area(sewn) == pytest.approx(area(whole) - 0.008 * length, abs=2 * corners)
    for name, points in sewn.curves().items():
        outer = whole.curves()[name]
        middle = points[len(points) // 2]
        off = min(_distance(middle, a, b) for a, b in pairwise(outer))
        assert off == pytest.approx(0.008, abs=1e-5)


def _distance(x, a, b):
    t = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(x - a - t * (b - a))


def test_a_sew_line_needs_no_allowance_and_is_closed_by_the_mirror_line(tmp_path):
    sewn = [[[0, 0.01], [0.28, 0.01]], [[0.28, 0.01], [0.28, 0.19]], [[0.28, 0.19], [0, 0.19]]]
    cut = [[[0, 0], [0.3, 0]], [[0.3, 0], [0.3, 0.2]], [[0.3, 0.2], [0, 0.2]], [[0, 0.2], [0, 0]]]
    layers = {"1": cut, "14": sewn, "6": [cut[-1]], "7": [[[0.1, 0.05], [0.2, 0.05]]]}
    path = written(tmp_path / "box.dxf", [("BOX", "M", layers, {})])
    (panel,) = patterns.read(path).panels
    assert area(panel) == pytest.approx(2 * 0.28 * 0.18) and panel.grain == pytest.approx(0.0)
    with pytest.raises(InputError, match="needs no seam allowance"):
        patterns.read(path, allowance=0.01)


@pytest.mark.parametrize(
    ("layers", "options", "reason"),
    [
        (half(), {}, r"'FR' has a cut line and no sew line \(layer 14\): tell its seam allowance"),
        (half(**{"7": []}), {"allowance": 0.0}, r"has no grain line \(layer 7\)"),
        (half(**{"7": [HALF[0], HALF[1]]}), {"allowance": 0.0}, "has 2 grain lines"),
        (half(**{"6": [[[0, 0], [0.1, 0.4]]]}), {"allowance": 0.0}, "has a mirror line that is no edge of it"),
        (half(**{"1": HALF[1:]}), {"allowance": 0.0}, "gap of 280 mm"),
        (half(**{"CUT": [HALF[0]]}), {"allowance": 0.0}, "has a layer 'CUT'"),
        (half(), {"allowance": 0.2}, "seam allowance"),
        (half(), {"allowance": -0.01}, "negative seam allowance"),
        (half(), {"size": "XXL", "allowance": 0.0}, "has no size 'XXL'; it has M"),
        ({"1": [[*HALF[0], [0.1, 0.2], [0, 0]]], "7": [HALF[0]]}, {"allowance": 0.0}, "no turn points"),
    ],
)  # fmt: skip
def test_a_dxf_file_that_is_not_understood_is_refused_in_a_sentence(tmp_path, layers, options, reason):
    path = written(tmp_path / "tee.dxf", [("FR", "M", layers, {})])
    with pytest.raises(InputError, match=reason) as fault:
        patterns.read(path, **options)
    assert "\n" not in str(fault.value) and "tee.dxf" in str(fault.value)


def test_files_that_are_no_patterns_are_refused_in_a_sentence(tmp_path):
    path = written(tmp_path / "tee.dxf", [("FR", "M", half(), {})], about=False)
    with pytest.raises(InputError, match="does not say 'UNITS: METRIC' or 'UNITS: ENGLISH'"):
        patterns.read(path, size="M", allowance=0.0)
    assert area(patterns.read(path, allowance=0.0, unit=1e-3).panels[0]) == pytest.approx(AREA, rel=1e-4)
    (tmp_path / "no.dxf").write_text("no DXF")
    (tmp_path / "no.json").write_text("{}")
    (tmp_path / "no.svg").write_text("")
    for name, reason in (("no.dxf", "cannot be read"), ("no.json", "is not a pattern"), ("no.svg", "not 'no.svg'"),
                         ("none.json", "No such file"), ("none.dxf", "No such file")):  # fmt: skip
        with pytest.raises(InputError, match=reason) as fault:
            patterns.read(tmp_path / name)
        assert "\n" not in str(fault.value)
    with pytest.raises(InputError, match=r"only a \.dxf file needs one"):
        patterns.read(tmp_path / "no.json", size="M")


def code(panels, stitches, unit=100):
    return {"pattern": {"panels": panels, "stitches": stitches},
            "properties": {"units_in_meter": unit, "curvature_coords": "relative"}}  # fmt: skip


def flap(curvature=None, over=False):
    """A panel of 40 cm x 30 cm in GarmentCode's words."""
    x = [[0, 0], [40, 0], [40, 30], [0, 30]]
    ends = [[0, 3], [3, 2], [2, 1], [1, 0]] if over else [[0, 1], [1, 2], [2, 3], [3, 0]]
    edges = [{"endpoints": pair} for pair in ends]
    if curvature is not None:
        edges[0]["curvature"] = curvature
    return {"vertices": x, "edges": edges, "translation": [10, 0, 5], "rotation": [0, 90, 0]}


@pytest.mark.parametrize(
    ("curvature", "extra"),
    [
        (None, 0.0),
        ([0.5, -0.5], 2 / 3 * 0.4 * 0.1),  # below a parabola
        ({"type": "quadratic", "params": [[0.5, 0.5]]}, -2 / 3 * 0.4 * 0.1),
        ({"type": "cubic", "params": [[0.0, -0.25], [1.0, -0.25]]}, 0.4 * 0.1 * 3 / 5),
        ({"type": "circle", "params": [20, 0, 1]}, np.pi * 0.2**2 / 2),
        ({"type": "circle", "params": [25, 0, 0]}, 0.2 * 0.15 - 0.25**2 * np.arcsin(0.8)),
        ({"type": "circle", "params": [25, 1, 1]}, 0.2 * 0.15 + 0.25**2 * (np.pi - np.arcsin(0.8))),
    ],
)
def test_curves_of_garmentcode_have_their_areas(tmp_path, curvature, extra):
    (tmp_path / "flap.json").write_text(json.dumps(code({"flap": flap(curvature)}, [])))
    (panel,) = patterns.read(tmp_path / "flap.json").panels
    assert area(panel) == pytest.approx(0.12 + extra, rel=2e-4)
    assert np.degrees(panel.grain) == pytest.approx(90.0)


def test_panels_of_garmentcode_are_placed_turned_over_and_sewn(tmp_path):
    file = code({"front": flap(), "back": flap(over=True) | {"translation": [12, 0, 5]}},
                [[{"panel": "front", "edge": 1}, {"panel": "back", "edge": 2}]])  # fmt: skip
    (tmp_path / "two.json").write_text(json.dumps(file))
    found = patterns.read(tmp_path / "two.json")
    front, back = found.panels
    corner = np.array([[0.4, 0.3]])
    assert front.placed(corner) == pytest.approx(np.array([[0.1, 0.3, 0.05 - 0.4]]))
    assert back.placed(corner * [-1, 1]) == pytest.approx(front.placed(corner) + [0.02, 0, 0]) and area(
        back
    ) == pytest.approx(0.12)
    sewn = sew(found.panels, found.seams, cell=0.1, comm=MPI.COMM_SELF)
    assert sewn.domain.pieces == 1 and {"front.0", "back.2"} <= set(sewn.domain.names)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda f: f["properties"].update(curvature_coords="absolute"), "not told relative"),
        (lambda f: f["properties"].update(units_in_meter=0), "is not a pattern of GarmentCode"),
        (lambda f: f["pattern"]["stitches"][0].append("right_wrong"), "right side with a wrong side"),
        (lambda f: f["pattern"]["stitches"][0][0].update(edge=7), "at the edge 7 of 'a', which there is not"),
        (lambda f: f["pattern"]["panels"]["a"]["edges"].pop(), "do not go round"),
        (lambda f: f["pattern"]["panels"]["a"]["edges"][0].update(curvature={"type": "loop", "params": []}), "'loop'"),
        (lambda f: f["pattern"]["panels"]["a"]["edges"][0].update(curvature={"type": "circle", "params": [5, 0, 0]}),
         "radius of 0.05 m and ends that are 0.4 m apart"),
    ],
)  # fmt: skip
def test_what_is_not_understood_of_garmentcode_is_refused_in_a_sentence(tmp_path, change, reason):
    file = code({"a": flap(), "b": flap()}, [[{"panel": "a", "edge": 1}, {"panel": "b", "edge": 3}]])
    change(file)
    (tmp_path / "two.json").write_text(json.dumps(file))
    with pytest.raises(InputError, match=reason) as fault:
        patterns.read(tmp_path / "two.json")
    assert "\n" not in str(fault.value)


OWN = """
unit = "mm"
[[panel]]
name = "front"
material = "blend"
allowance = 10
fold = "middle"
notches = [[150, 0]]
outline = [
    { name = "hem", from = [0, 0], allowance = 30 },
    { name = "side", from = [310, 0] },
    { name = "top", from = [310, 410] },
    { name = "middle", from = [0, 410] },
]
place = { shift_m = [0, 0, 0.2], turn_deg = [90, 0, 0] }
[[panel]]
name = "back"
grain_deg = 0
outline = [
    { name = "hem", from = [-300, 0] },
    { name = "side", from = [300, 0] },
    { name = "top", from = [300, 370], through = [[0, 430]], shape = "arc" },
    { name = "other", from = [-300, 370] },
]
roll = { radius_m = 0.2, axis = [0, 0, 1], facing = [0, -1, 0], around_deg = 180 }
[[seam]]
join = ["front.side", "back.other"]
name = "left"
[[seam]]
join = ["back.side", "front.side-mirrored"]
"""


def own(folder, text):
    (folder / "tee.toml").write_text(text)
    return patterns.read(folder / "tee.toml")


def test_a_pattern_of_our_own_is_drawn_placed_and_sewn(tmp_path):
    found = own(tmp_path, OWN)
    front, back = found.panels
    assert area(front) == pytest.approx(2 * 0.3 * 0.37, rel=1e-9) and front.material == "blend"
    assert (front.grain, back.grain) == pytest.approx((np.pi / 2, 0.0))
    assert found.notches["front"] == pytest.approx(np.array([[0.15, 0.0]]))
    assert front.placed(np.array([[0.1, 0.2]])) == pytest.approx(np.array([[0.1, 0.0, 0.4]]))
    places = back.placed(np.array([[-0.3, 0.0], [0.0, 0.1], [0.3, 0.0]]))
    assert places == pytest.approx(np.array([[-0.2, 0, 0], [0, -0.2, 0.1], [0.2, 0, 0]]), abs=1e-12)
    sewn = sew(found.panels, found.seams, cell=0.1, comm=MPI.COMM_SELF)
    assert sewn.domain.pieces == 1 and "left" in sewn.domain.names


def test_pieces_of_a_dxf_file_are_sewn_by_a_pattern_of_our_own(tmp_path):
    written(tmp_path / "tee.dxf", [("FR", "M", half(**{"6": [HALF[-1]]}), {}), ("BK", "M", half(), {})])
    names = '["hem", "side", "armhole", "shoulder", "neck", "middle"]'
    text = f'file = "tee.dxf"\n[[panel]]\nname = "front"\npiece = "FR"\nedges = {names}\nallowance = 8\n'
    text += '[[panel]]\nname = "BK"\nallowance = 0\nfold = "6"\n[[seam]]\njoin = ["front.side", "BK.2-mirrored"]\n'
    found = own(tmp_path, text)
    front, back = found.panels
    assert list(front.outline)[:5] == ["hem", "side", "armhole", "shoulder", "neck"]
    assert area(back) == pytest.approx(2 * AREA, abs=4e-6) and area(front) < area(back)
    assert found.seams[0].edges == (("front", "side"), ("BK", "2-mirrored"))
    with pytest.raises(InputError, match=r"edges = .* are not 6 different names"):
        own(tmp_path, text.replace('"hem", ', ""))
    with pytest.raises(InputError, match="is missing; draw it, or name a piece of a file; the file has FR, BK"):
        own(tmp_path, text.replace('piece = "FR"', 'piece = "FT"'))
    with pytest.raises(InputError, match="tell its seam allowance"):
        own(tmp_path, text.replace("allowance = 8\n", ""))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('unit = "mm"\n', "", "has no unit"),
        ('unit = "mm"', 'unit = "ell"', "unit = 'ell' is not known"),
        ('name = "side", from = [310, 0]', 'name = "hem", from = [310, 0]', "name = 'hem' is that of two edges"),
        ("from = [310, 0]", "from = [310]", "is not a list of 2 numbers"),
        ("through = [[0, 430]]", "through = [0, 430]", "is not a list of points"),
        ('shape = "arc"', 'shape = "arch"', "perhaps 'arc' is meant"),
        ('fold = "middle"', 'fold = "center"', "fold = 'center' is no edge of the panel"),
        ("allowance = 10\n", "allowance = 350\n", "seam allowance"),
        ("radius_m = 0.2", "radius_m = 0", "radius_m = 0 is not positive"),
        ("place = {", "roll = { radius_m = 1 }\nplace = {", "leave one out"),
        ('["front.side", "back.other"]', '["front.side"]', "is not a pair of edges"),
        ("notches = [[150, 0]]", "notches = [150]", "are not a list of points"),
        ("[[seam]]", 'size = "M"\n[[seam]]', "is not a known key"),
        ('unit = "mm"', 'unit = "mm"\nsize = "M"', "is of a .dxf file, and there is none"),
        ('unit = "mm"', 'unit = "mm"\nfile = "a.svg"', "is neither a .dxf nor a .json file"),
    ],
)
def test_a_fault_in_a_pattern_of_our_own_is_refused_in_a_sentence(tmp_path, old, new, reason):
    assert old in OWN
    with pytest.raises(InputError, match=reason) as fault:
        own(tmp_path, OWN.replace(old, new, 1))
    assert "\n" not in str(fault.value)


def test_without_the_extra_a_sentence_says_what_to_install(tmp_path, monkeypatch):
    path = written(tmp_path / "tee.dxf", [("FR", "M", half(), {})])
    for name in ("ezdxf.filemanagement", "shapely"):
        monkeypatch.setitem(__import__("sys").modules, name, None)
        with pytest.raises(InputError, match=r"pip install 'fabric_fenicsx\[patterns\]'"):
            patterns.read(path, allowance=0.01) if "ezdxf" in name else own(tmp_path, OWN)
        monkeypatch.undo()
