"""Marks in photographs: found to a few hundredths of a pixel, followed, and written as `identify` reads them."""

import re
import subprocess
import sys

import numpy as np
import pytest
import rendered
from click.testing import CliRunner
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from test_setup import ROOT

from fabric_fenicsx import fabrics
from fabric_fenicsx.app.cli import app
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify.files import records
from fabric_fenicsx.identify.synthetic import synthetic
from fabric_fenicsx.identify.tensile import curves, markers
from fabric_fenicsx.output import pictures
from fabric_fenicsx.photographs import contact_sheet, corrections, making, marker_file, marks, plane, reading, tracking
from fabric_fenicsx.system import can_draw

PIXELS = (260, 300)  # rows, columns
ACCURATE = 0.05  # pixels, root mean square


def found(light, **given):
    """Places of all marks in a picture, and how they look."""
    light = light.astype(np.float32) / 255
    look = marks.look(light, **given)
    return marks.Picture(light, look).marks(), look


def errors(places, true):
    """Distances of places to those that are true, one each."""
    assert len(places) == len(true)
    far, nearest = cKDTree(true).query(places)
    assert len(set(nearest)) == len(true)
    return far


@pytest.mark.parametrize("kind", marks.KINDS)
@pytest.mark.parametrize("turn", [0.0, 45.0])
def test_marks_are_found_to_a_twentieth_of_a_pixel(kind, turn):
    """Noise of 4 grey levels, a blur of 1.2 pixels, light that changes by a half across the picture."""
    size = {"dots": 9.0, "crosses": 14.0, "grid": 3.0}[kind]
    true = rendered.grid(5, 4, 40.3, (150, 30) if turn else (60.4, 55.7), np.radians(turn))
    seen = {"size": size, "spacing": 40.3, "blur": 1.2, "lamp": (0.5, -0.2), "rng": np.random.default_rng(3)}
    light = rendered.light(kind, PIXELS, true, rotation(turn), **seen)
    places, look = found(light)
    off = errors(places, true)
    assert look.kind == kind and look.dark
    assert np.sqrt((off**2).mean()) < ACCURATE and off.max() < 3 * ACCURATE


def rotation(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])


def test_light_marks_on_dark_cloth_among_other_things():
    """A word, a dirty edge and a dark background are no marks."""
    rng = np.random.default_rng(5)
    true = rendered.grid(4, 5, 36.0, (90.2, 50.6))
    light = rendered.light("dots", PIXELS, true, size=8, dark=0.8, cloth=0.3, rng=rng)
    light[:, :40] = 10  # the table
    light[30:32, 200:290] = 230
    places, look = found(light)
    assert not look.dark and np.sqrt((errors(places, true) ** 2).mean()) < ACCURATE


@settings(max_examples=8, phases=[Phase.reuse, Phase.generate])
@given(
    st.sampled_from(["dots", "crosses"]),
    st.tuples(*[st.floats(-0.25, 0.25)] * 4),
    st.floats(0, 1), st.floats(0.8, 1.4), st.floats(0.6, 1.2),
)  # fmt: skip
def test_strained_marks_are_found_as_well(kind, gradient, shift, blur, level):
    """Any deformation gradient within a quarter of none, place, blur and light."""
    F = np.eye(2) + np.reshape(gradient, (2, 2))
    x = rendered.grid(3, 3, 44.0, (0, 0)) - 44
    true = np.array([100 + shift, 100 - shift / 2]) + x @ F.T
    light = rendered.light(
        kind,
        (200, 200),
        true,
        F,
        size=12.0 if kind == "dots" else 18.0,
        blur=blur,
        level=level,
        lamp=(0.2, 0.2),
        noise=0.01,
    )
    off = errors(found(light)[0], true)
    assert np.sqrt((off**2).mean()) < ACCURATE


def series(folder, count=7, hidden=(), kind="dots", size=10.0):
    """Photographs of cloth that is stretched and sheared in changing light; the places (m, n, 2) that are true.

    hidden: (photograph, mark) that something light covers.
    """
    x = rendered.grid(4, 4, 40.0, (0, 0)) - 60
    true, rng = [], np.random.default_rng(8)
    for k in range(count):
        part = k / (count - 1)
        F = np.eye(2) + part * np.array([[0.02, 0.35], [0.1, 0.12]])
        places = np.array([140.3, 120.2]) + part * np.array([9.0, 13.0]) + x @ F.T
        light = rendered.light(
            kind, (270, 300), places, F, size=size, level=1 - 0.3 * part, lamp=(0.3 * part, 0.1), rng=rng
        )
        for photo, mark in hidden:
            if photo == k:
                i, j = places[mark].round().astype(int)[::-1]
                light[i - 9 : i + 10, j - 9 : j + 10] = light[i - 12, j - 12]
        rendered.save(folder / f"img_{k + 8}.png", light)  # 8, 9, 10: not in the order of letters
        true.append(places)
    return np.array(true)


HIDDEN = [(2, 5), (3, 5), (6, 15)]


@pytest.fixture(scope="module")
def stretched(tmp_path_factory):
    """Folder and true places of a series with two marks that are covered for a while."""
    folder = tmp_path_factory.mktemp("series")
    return folder, series(folder / "photos", hidden=HIDDEN)


def test_marks_are_followed_and_losses_told(stretched, tmp_path):
    folder, true = stretched
    said = []
    path = making.make([folder / "photos"], tmp_path, say=said.append)
    table = np.genfromtxt(path, delimiter=",", skip_header=1)[:, 1:].reshape(7, 16, 2)
    lost = np.isnan(table).any(axis=-1)
    assert {(k, j) for k, j in np.argwhere(lost)} == set(HIDDEN)
    off = np.linalg.norm(table * [1, -1] - true, axis=-1)[~lost]
    assert np.sqrt((off**2).mean()) < ACCURATE and off.max() < 4 * ACCURATE
    assert path.read_text().startswith("photograph,m01_x_px,m01_y_px,") and "img_8.png," in path.read_text()
    words = "\n".join(said)
    assert "16 dark dots in 7 photographs" in words and "m06 is lost in 2 of them, from img_10.png on" in words
    assert "m16 is lost in img_14.png" in words and "pixels" in words
    from PIL import Image

    sheet = np.asarray(Image.open(tmp_path / "contact_sheet.png").convert("RGB")).reshape(-1, 3)
    assert len(sheet) > 5e5 and (sheet == [213, 94, 0]).all(axis=1).any() and (sheet == [0, 158, 115]).all(axis=1).any()


def test_corrections_by_hand_are_kept(stretched, tmp_path):
    folder, _ = stretched
    making.make([folder / "photos"], tmp_path, say=lambda _: None)
    own = tmp_path / "corrections.csv"
    assert "img_007.png" in own.read_text()  # an empty one, with what may be written
    own.write_text(own.read_text() + "img_10.png,m06,150.5,99.25\nimg_9.png;m02;;\n,m16,,\nimg_8.png,extra,40,200\n")
    before, said = own.read_text(), []
    making.make([folder / "photos"], tmp_path, say=said.append)
    assert own.read_text() == before and "  1 places are by hand" not in said and "  2 places are by hand" in said
    head, *lines = (tmp_path / "markers.csv").read_text().splitlines()
    names, cells = head.split(","), [line.split(",") for line in lines]
    x = {name: [row[names.index(name)] for row in cells] for name in names}
    assert "m16_x_px" not in names and float(x["m06_x_px"][2]) == 150.5 and float(x["m06_y_px"][2]) == -99.25
    assert x["m02_x_px"][1] == "" and x["m02_x_px"][2] != "" and float(x["extra_x_px"][0]) == 40


def test_a_record_comes_along_and_identify_reads_both(stretched, tmp_path):
    """Dots: strains of the gradient; a bias test: stretches and angle of yarns that lie at 45 degrees at first."""
    folder, _ = stretched
    F = np.eye(2) + np.linspace(0, 1, 7)[:, None, None] * np.array([[0.02, 0.35], [0.1, 0.12]])
    lines = ["photo;weg (mm);kraft (N)"]
    for k in range(31):
        name = f"img_{k // 5 + 8}.png" if k % 5 == 0 else ""
        lines.append(f"{name};{0.4 * k:g}" + f";{2.5 * k:g}")
    (tmp_path / "machine.csv").write_text("\n".join(lines) + "\n")
    answer = CliRunner().invoke(
        app,
        ["markers", str(folder / "photos"), "--record", str(tmp_path / "machine.csv"), "--warp", "45", "--out",
         str(tmp_path), "--ends", "0,0,100,0", "--bar", "20", "--kind", "dots"],
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    assert "0.2 mm for a pixel" in answer.output
    strip = records.Strip(0.08, 0.025, 0.0005)
    record = records.read(tmp_path / "markers.csv", strip)
    assert len(record.force) == 31 and np.isfinite(record.yarns["angle"]).sum() == 7
    mirrored = np.diag([1, -1]) @ F @ np.diag([1, -1])
    for name, way in (("warp_stretch", (1, 1)), ("weft_stretch", (-1, 1))):
        stretch = np.linalg.norm(mirrored @ way, axis=1) / np.sqrt(2)
        assert record.yarns[name][::5] == pytest.approx(stretch, abs=1e-3)
    warp, weft = mirrored @ (1, 1), mirrored @ (-1, 1)
    cosine = (warp * weft).sum(axis=1) / np.linalg.norm(warp, axis=1) / np.linalg.norm(weft, axis=1)
    assert np.cos(record.yarns["angle"][::5]) == pytest.approx(cosine, abs=1e-3)


def test_a_strip_gives_its_ratio(tmp_path):
    """Stretched by 20 % along y, contracted by 0.3 of the Green-Lagrange strain."""
    x, lines = rendered.grid(3, 4, 45.0, (0, 0)) - (45, 67), ["photograph,displacement_mm"]
    for k in range(6):
        along = 0.2 * k / 5
        across = np.sqrt(1 - 0.3 * ((1 + along) ** 2 - 1)) - 1
        F = np.diag([1 + across, 1 + along])
        light = rendered.light("crosses", (280, 200), np.array([100, 140]) + x @ F.T, F, size=14)
        rendered.save(tmp_path / f"p{k}.png", light)
        lines.append(f"p{k}.png,{100 * along:g}")
    (tmp_path / "machine.csv").write_text("\n".join(lines))
    photos = sorted(tmp_path.glob("p*.png"))
    path = making.make(photos, tmp_path, making.Settings(record=tmp_path / "machine.csv"), lambda _: None)
    seen = markers.contraction(path)
    assert seen.ratio == pytest.approx(0.3, rel=0.01) and seen.along[-1] == pytest.approx(0.22, rel=0.005)


def camera(x):
    """Pixels (..., 2) of places (mm) in a plane tilted by 15 degrees, a lens distorting by 2 %."""
    x = np.asarray(x, dtype=float)
    turned = np.stack([x[..., 0], x[..., 1] * np.cos(0.26), 160 + x[..., 1] * np.sin(0.26)], axis=-1)
    flat = turned[..., :2] / turned[..., 2:]
    r2 = (flat**2).sum(axis=-1, keepdims=True)
    return np.array([149.5, 129.5]) + 700 * flat * (1 - 0.35 * r2)


@pytest.fixture(scope="module")
def board():
    """A photograph of a checkerboard by that camera, and its plane."""
    grid = np.stack(np.meshgrid(np.linspace(-60, 60, 201), np.linspace(-60, 60, 201)), axis=-1)
    pixels = camera(grid).reshape(-1, 2)
    from scipy.interpolate import RBFInterpolator

    some = np.random.default_rng(0).choice(len(pixels), 3000, replace=False)
    back = RBFInterpolator(pixels[some], grid.reshape(-1, 2)[some], neighbors=40, degree=3, kernel="cubic")
    coarse = np.stack(np.meshgrid(np.arange(0, 301.0, 10), np.arange(0, 261.0, 10)), axis=-1)
    from scipy.interpolate import RegularGridInterpolator

    at = back(coarse.reshape(-1, 2)).reshape(coarse.shape)
    inverse = RegularGridInterpolator((coarse[0, :, 0], coarse[:, 0, 1]), at.swapaxes(0, 1), "cubic", False, None)
    return rendered.checkerboard((260, 300), (8, 7), lambda p: inverse(p) / 6.0 + (3.5, 3.0))


def test_a_checkerboard_takes_tilt_and_distortion_away(board, tmp_path):
    """Distances between places come back to 0.1 % all over the board, which a scale alone misses by 2 %."""
    rendered.save(tmp_path / "board.png", board)
    seen = plane.board(reading.light(tmp_path / "board.png"), (8, 7), 6.0)
    x = np.stack(np.meshgrid(np.linspace(-18, 18, 5), np.linspace(-16, 16, 5)), axis=-1).reshape(-1, 2)
    apart = np.linalg.norm(x[:, None] - x, axis=-1)
    there = np.linalg.norm(seen(camera(x))[:, None] - seen(camera(x)), axis=-1)
    assert np.abs(there - apart)[apart > 0].max() < 0.001 * apart.max()
    plain = camera(x) * seen.scale
    scaled = np.linalg.norm(plain[:, None] - plain, axis=-1)
    assert np.abs(scaled - apart).max() > 0.02 * apart.max()
    right, up = seen(np.array([[150.0, 130.0], [160.0, 130.0], [150.0, 120.0]]))[1:] - seen(np.array([150.0, 130.0]))
    assert right[0] > 0 and up[1] > 0 and abs(right[1]) < 0.05 * right[0]
    with pytest.raises(InputError, match="no checkerboard of 5 x 4 inner corners"):
        plane.board(reading.light(tmp_path / "board.png"), (5, 4), 6.0)


def test_a_bar_is_found():
    light = np.full((200, 400), 200, dtype=np.uint8)
    light[150:156, 60:340] = 20
    light = np.asarray(rendered.ndimage.gaussian_filter(light.astype(np.float32), 1.0)) / 255
    ends = plane.find_bar(light)
    assert np.hypot(ends[2] - ends[0], ends[3] - ends[1]) == pytest.approx(280, abs=0.7)
    with pytest.raises(InputError, match="no straight dark bar"):
        plane.find_bar(np.full((200, 400), 0.5, dtype=np.float32))


def test_the_order_of_a_series():
    names = [path.name for path in reading.series(["b/img_10.png", "b/img_9.png", "b/img_1b.png"])]
    assert names == ["img_1b.png", "img_9.png", "img_10.png"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("nowhere.png", "nowhere.png: cannot be read (No such file"),
        ("text.png", "text.png: is no picture"),
        ("empty", "empty: holds no photograph"),
        ("photos/img_8.png photos/img_8.png", "is given twice"),
        ("photos/img_8.png small.png", "small.png: is 50 x 40 pixels, and the first photograph 300 x 270"),
        ("plain.png", "plain.png: shows fewer than three marks alike"),
        ("photos --region 0,0,10,10", "The region 0,0,10,10 holds nothing of"),
        ("photos --region 0,0,1", "0,0,1 is not of the form"),
        ("photos --checkerboard plain.png --bar 20", "A checkerboard and a bar are given"),
        ("photos --ends 0,0,1,1", "add --bar, in mm"),
        ("photos --bar 20 --ends 0,0,1,1", "The bar is 1.41 pixels long"),
        ("photos --bar 20", "shows no straight dark bar"),
        ("photos --checkerboard plain2.png", "plain2.png: shows no checkerboard of 9 x 6"),
        ("photos --record text.csv", "no line names its columns"),
        ("photos --record machine.csv", "its column 'photograph' names img_9.png 0 times"),
    ],
)
def test_every_fault_is_one_sentence(stretched, tmp_path, monkeypatch, words, reason):
    folder, _ = stretched
    (tmp_path / "photos").symlink_to(folder / "photos")
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "text.csv").write_text("no table")
    (tmp_path / "machine.csv").write_text("photograph,displacement_mm\nimg_8.png,0\n")
    for name, size in (("small", (40, 50)), ("plain", (100, 100)), ("plain2", (270, 300))):
        rendered.save(tmp_path / f"{name}.png", np.full(size, 128, dtype=np.uint8))
    monkeypatch.chdir(tmp_path)
    answer = CliRunner().invoke(app, ["markers", *words.split()])
    said = str(answer.exception) if isinstance(answer.exception, InputError) else answer.output
    assert answer.exit_code and reason in re.sub(r"\s+", " ", said), said
    assert not isinstance(answer.exception, InputError) or "\n" not in said


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("img_8.png,m01,1", "line 2 is not of the form"),
        ("img_8.png,m01,a,2", "has the place 'a', '2'"),
        (",m01,1,2", "has a place, but no photograph"),
        ("img_99.png,m01,1,2", "'img_99.png' is none of the photographs"),
        ("img_9.png,m77,1,2", "'m77' is none of the marks"),
        (",m77,,", "'m77' is none of the marks"),
    ],
)
def test_a_faulty_correction_is_told(tmp_path, line, reason):
    (tmp_path / "corrections.csv").write_text(f"{corrections.HEAD}\n{line}\n")
    with pytest.raises(InputError, match=re.escape(reason)):
        corrections.read(tmp_path / "corrections.csv").apply(
            ["img_8.png", "img_9.png"], ["m01", "m02", "m03"], np.zeros((3, 2))
        )


def test_photographs_need_opencv(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "cv2", None)
    with pytest.raises(InputError, match=re.escape("fabric_fenicsx[photos]")):
        reading.toolkit()


def test_the_sheet_shows_the_worst_of_many():
    state = np.full((100, 5), tracking.FOUND)
    state[[31, 32], 0] = tracking.LOST
    shown = contact_sheet.chosen(tracking.Tracks(np.zeros((100, 5, 2)), state))
    assert {0, 31, 32, 99} <= set(shown) and len(shown) <= contact_sheet.SHOWN + 1


def test_the_gradient_of_uneven_marks_is_told():
    x = rendered.grid(3, 3, 10, (0, 0))
    F, miss = marker_file.gradient(np.array([x, x + 0.01 * x**2]), x)
    assert F[0] == pytest.approx(np.eye(2)) and miss > making.UNEVEN


@pytest.fixture(scope="module")
def demo():
    """The demo, as a module."""
    sys.path.insert(0, str(ROOT / "demos"))
    import photographs

    yield photographs
    sys.path.remove(str(ROOT / "demos"))


def test_photographs_of_a_strip_in_bias_give_its_shear_curve(demo, tmp_path):
    """The strain of the law at a point, on a strip that a tilted camera sees; quick variant of the demo."""
    if can_draw() is not None:
        pytest.skip("pictures cannot be drawn here")
    fabric = fabrics.load("blend")
    test = synthetic._test(fabric, "bias")
    top = int(test["displacement"].argmax())
    chosen = np.linspace(0, top, 9).astype(int)
    length, width = fabric.gauge_length, fabric.width
    import pyvista

    flat = pyvista.ImageData(dimensions=(9, 5, 1), spacing=(length / 8, width / 4, 1)).cast_to_unstructured_grid()
    X = np.asarray(flat.points)
    l1, l2 = test["warp_stretch"][chosen], test["weft_stretch"][chosen]
    E = np.array([(l1**2 - 1) / 2, (l2**2 - 1) / 2, -np.sqrt(l1**2 * l2**2) * np.cos(test["angle"][chosen]) / 2])
    rows, shapes = [], []
    for e11, e22, e12, k in zip(*E, chosen, strict=True):
        C = 2 * np.array([[(e11 + e22) / 2 - e12, (e11 - e22) / 2], [(e11 - e22) / 2, (e11 + e22) / 2 + e12]]) + np.eye(
            2
        )
        U = np.linalg.cholesky(C).T  # C = U.T U, x stays along the load
        moved = np.column_stack([X[:, :2] @ (U - np.eye(2)).T, 0 * X[:, 0]])
        shapes.append(pictures.Shape(2, flat.cells, flat.celltypes, X, moved, np.zeros(flat.n_cells)))
        rows.append((1e3 * test["displacement"][k], test["force"][k]))
    camera = demo.Camera(500, (0.05, width / 2), 0.105, 8.0, 0.01, np.random.default_rng(1))
    case = demo.tensile.Case(fabric, 45.0)
    taken = demo.photograph(camera, case, rows, shapes, tmp_path / "photos", 1)
    camera.plotter.close()
    path = demo.measure(taken, tmp_path, 45.0)
    record = records.read(path, records.Strip(length, width, fabric.thickness))
    E12 = markers.shear_strain(record)
    S12 = curves.piola_kirchhoff(record.force, record.displacement, length, width * fabric.thickness) / 2
    good = np.isfinite(E12)  # a last reading may be taken for a wild one
    assert good.sum() >= 8 and np.abs(S12 - fabric.shear.stress(2 * E12))[good].max() < 0.05 * S12.max()
    for name, stretch in (("warp_stretch", l1), ("weft_stretch", l2)):
        assert record.yarns[name][good] == pytest.approx(stretch[good], abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("fabric", ["blend", "duck"])
def test_a_simulated_strip_gives_its_own_fabric_back(tmp_path, fabric):
    answer = subprocess.run(
        [sys.executable, str(ROOT / "demos" / "photographs.py"), "--fabric", fabric, "--out", str(tmp_path)],
        capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert answer.returncode == 0 and "within 5 %: yes" in answer.stdout, answer.stdout + answer.stderr
