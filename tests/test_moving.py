"""Runs as moving scenes for other programs: what is written is read back by others, step by step."""

import json
import struct

import numpy as np
import pytest
import pyvista

from fabric_fenicsx.app import cli
from fabric_fenicsx.contact.bodies import Sphere
from fabric_fenicsx.contact.deforming import Deforming
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.output import fields, moving, series
from fabric_fenicsx.output.solids import Solid

TIMES = (0.0, 0.1, 0.4)
X = np.array([[x, y, 0.5] for y in (0.0, 1.0) for x in (0.0, 1.0, 2.0)])
CELLS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
BALL = Sphere(0.4, (1, 0.5, 0), cells=3)


def moved(k):
    """Where the sheet's nodes are at a step."""
    return X + k * np.array([0.1, 0.0, 0.2]) * (X[:, :1] - 1.0)


@pytest.fixture
def run(tmp_path):
    """The folder of a run of three steps: two cells that stretch, and a ball that rises."""
    about = {"title": "two cells", "view": (1.0, -2.0, 1.2), "dim": [3]}
    for k, time in enumerate(TIMES):
        cells = {
            "strain": np.array([[0.1 * k, 0, 0], [0.2 * k, 0, 0]]),
            "warp": np.eye(3)[[0, 0]],
            "weft": np.eye(3)[[1, 1]],
        }
        text = fields.vtu(X, CELLS, 9, {"displacement_m": moved(k) - X}, cells, about | {"TimeValue": [time]})
        solid = Solid("ball", BALL.rest + [0, 0, 0.1 * k], BALL.faces, np.zeros(len(BALL.rest)))
        for kind, content in (("fields", text), ("bodies", fields.surfaces(time, [solid]))):
            (tmp_path / kind).mkdir(exist_ok=True)
            (tmp_path / kind / f"{k:06d}.vtu").write_text(content)
    steps = "".join(f'<DataSet timestep="{t}" file="fields/{k:06d}.vtu"/>' for k, t in enumerate(TIMES))
    (tmp_path / "fields.pvd").write_text(f"<VTKFile><Collection>{steps}</Collection></VTKFile>")
    return tmp_path


@pytest.fixture
def command(monkeypatch):
    """Runs the command in this process; its status."""

    def call(*words):
        monkeypatch.setattr("sys.argv", ["fabric-fenicsx", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return end.value.code or 0

    return call


def parts(path):
    """The JSON of a .glb file, and a function that gives the numbers of an accessor."""
    raw = path.read_bytes()
    magic, version, size = struct.unpack("<4sII", raw[:12])
    length, kind = struct.unpack("<I4s", raw[12:20])
    assert (magic, version, size, kind) == (b"glTF", 2, len(raw), b"JSON") and length % 4 == 0
    said, content = json.loads(raw[20 : 20 + length]), raw[28 + length :]
    assert len(content) == said["buffers"][0]["byteLength"]

    def numbers(k):
        accessor = said["accessors"][k]
        view, width = said["bufferViews"][accessor["bufferView"]], {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        dtype = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        found = np.frombuffer(content, dtype, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)
        assert found.nbytes == view["byteLength"]
        if "min" in accessor:
            assert (found.min(axis=0) == accessor["min"]).all() and (found.max(axis=0) == accessor["max"]).all()
        return found

    return said, numbers


def test_a_gltf_file_has_each_step_as_a_morph_target_at_its_time(run, command):
    assert command("view", run, "--export", "gltf") == 0
    said, numbers = parts(run / "scene.glb")
    assert [node["name"] for node in said["nodes"]] == ["scene", "sheet", "bodies"]
    (animation,) = said["animations"]
    for mesh, place, sampler in zip(said["meshes"], (moved, lambda k: BALL.rest + [0, 0, 0.1 * k]),
                                    animation["samplers"], strict=True):  # fmt: skip
        (part,) = mesh["primitives"]
        base = numbers(part["attributes"]["POSITION"])
        assert base == pytest.approx(place(0), abs=1e-7)
        assert numbers(sampler["input"])[:, 0] == pytest.approx(TIMES)
        weights = numbers(sampler["output"]).reshape(3, 2)
        for k in range(3):
            targets = [numbers(target["POSITION"]) for target in part["targets"]]
            assert base + np.tensordot(weights[k], targets, 1) == pytest.approx(place(k), abs=1e-6)
    colour = [numbers(t["COLOR_0"]) for t in said["meshes"][0]["primitives"][0]["targets"]]
    first = numbers(said["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
    yellow = (first + colour[1])[2]  # the largest strain of all, at the right
    assert yellow == pytest.approx(moving._linear(np.array([0.993248, 0.906157, 0.143936])), abs=1e-5)
    assert (first >= 0).all() and (first + colour[0] <= 1).all()


def test_a_gltf_file_is_read_by_another_program(run):
    moving.export(series.Series(run), "gltf", run / "scene.glb")
    reader = pyvista.get_reader(run / "scene.glb")
    sheet = reader.read().combine().extract_surface(algorithm=None)
    assert sheet.n_cells == 4 + len(BALL.faces)
    found = np.array(sheet.points)
    up = np.concatenate([moved(0), BALL.rest])[:, [0, 2, 1]] * [1, 1, -1]
    assert np.sort(found, axis=0) == pytest.approx(np.sort(up, axis=0), abs=1e-6)


def test_obj_files_are_frames_of_a_body_too(run, command):
    assert command("view", run, "--export", "obj") == 0
    body = Deforming.read(run / "obj", rate=10.0)
    for k in range(3):
        expected = np.concatenate([moved(k), BALL.rest + [0, 0, 0.1 * k]])
        assert body.frames[k] == pytest.approx(expected, abs=1e-8)
    assert len(body.faces) == 4 + len(BALL.faces)
    text = (run / "obj" / "step_000002.obj").read_text().splitlines()
    assert text[0] == "o sheet" and len(text[1].split()) == 7 and "o bodies" in text
    assert command("view", run, "--export", "obj", "--out", run / "obj") == 0


def test_a_point_cache_has_evenly_spaced_steps(run, command):
    assert command("view", run, "--export", "pc2", "--out", run / "cache") == 0
    raw = (run / "cache" / "sheet.pc2").read_bytes()
    name, version, points, start, rate, count = struct.unpack("<12siiffi", raw[:32])
    assert (name, version, points, start, rate, count) == (b"POINTCACHE2\0", 1, 6, 0.0, 1.0, 3)
    found = np.frombuffer(raw[32:], "<f4").reshape(3, 6, 3)
    assert found[0] == pytest.approx(moved(0)) and found[2] == pytest.approx(moved(2), abs=1e-6)
    assert found[1] == pytest.approx(moved(1) + (moved(2) - moved(1)) / 3, abs=1e-6), "t = 0.2 s"
    assert pyvista.read(run / "cache" / "bodies.obj").n_points == len(BALL.rest)


def test_a_usd_file_has_time_samples(run, command):
    usd = pytest.importorskip("pxr.Usd")
    geometry = pytest.importorskip("pxr.UsdGeom")
    assert command("view", run, "--export", "usd") == 0
    stage = usd.Stage.Open(str(run / "scene.usdc"))
    points = geometry.Mesh(stage.GetPrimAtPath("/scene/sheet")).GetPointsAttr()
    assert points.GetTimeSamples() == pytest.approx([0.0, 100.0, 400.0])
    assert np.array(points.Get(100.0)) == pytest.approx(moved(1), abs=1e-6)
    colours = geometry.Mesh(stage.GetPrimAtPath("/scene/sheet")).GetDisplayColorPrimvar()
    assert len(colours.Get(400.0)) == 6 and stage.GetTimeCodesPerSecond() == 1000.0


def test_without_usd_core_a_sentence_says_what_to_install(run, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pxr", None)
    with pytest.raises(InputError, match=r"pip install 'fabric_fenicsx\[usd\]'"):
        moving.usd(moving.Moving(np.zeros(1), []), run / "scene.usdc")


def test_broken_steps_are_left_out_and_what_cannot_be_is_refused(run, command, capsys):
    (run / "fields" / "000001.vtu").write_text("cut off")
    assert command("view", run, "--export", "gltf") == 0
    assert "000001.vtu cannot be read, and is left out" in capsys.readouterr().out
    said, numbers = parts(run / "scene.glb")
    assert numbers(said["animations"][0]["samplers"][0]["input"])[:, 0] == pytest.approx([0.0, 0.4])
    for words, reason in (
        (("--export", "gltf", "--animation"), "--export writes all steps"),
        (("--export", "gltf", "--out", run / "none" / "a.glb"), "cannot be written"),
        (("--export", "gltf", "--colour", "pressure"), "has no pressure"),
        (("--export", "vrml"), "vrml"),
    ):
        assert command("view", run, *words) == 2
        assert reason in capsys.readouterr().err
    for file in (run / "fields").iterdir():
        file.write_text("cut off")
    assert command("view", run, "--export", "gltf") == 2
    assert "None of the 3 steps" in capsys.readouterr().err


@pytest.mark.parametrize(("kind", "nodes"), [(5, 3), (9, 4), (22, 6), (28, 9)])
def test_triangles_of_every_cell_cover_it_once(kind, nodes):
    corner = np.array([[0, 0], [1, 0], [0, 1]]) if kind in (5, 22) else np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    x = np.concatenate([corner, (corner + np.roll(corner, -1, axis=0)) / 2, corner.mean(axis=0)[None]])[:nodes]
    a, b, c = x[np.array(moving.TRIANGLES[kind])].transpose(1, 0, 2)
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (areas > 0.0).all() and areas.sum() == pytest.approx(0.5 if kind in (5, 22) else 1.0)
