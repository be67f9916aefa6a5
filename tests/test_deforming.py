"""Bodies that deform as frames tell: their motion, the way they are read, what they do to a sheet, and faults."""

import numpy as np
import pytest
from mpi4py import MPI
from hypothesis import given, settings
from hypothesis import strategies as some

from fabric_fenicsx import scenes, sheet
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.contact.deforming import Deforming
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

pytestmark = pytest.mark.filterwarnings("ignore:.*is assumed")
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
SCENE = f"""
[mesh]
file = "{meshing.MESHES}/drape.geo"
numbers = {{ side = 0.6, n = 4, a = 0.15 }}
[sheet]
fabric = "blend"
law = "svk"
[[support]]
at = "rim"
kind = "hinge"
[contact]
friction = 0.3
itself = false
"""
BALL = bodies.Sphere(0.15, (0.3, 0.3, -0.155), cells=6)


@settings(max_examples=20, deadline=None)
@given(times=some.lists(some.floats(0.05, 1.0), min_size=4, max_size=7), inside=some.floats(0.0, 1.0))
def test_between_frames_it_goes_through_a_parabola_and_rests_outside(times, inside):
    times = np.cumsum(times)
    rng = np.random.default_rng(0)
    a, b, c = rng.standard_normal((3, 4, 3))

    def way(t):
        return a + b * t + c * t**2

    body = Deforming(np.array([way(t) for t in times]), FACES, times)
    t = times[1] + inside * (times[-2] - times[1])
    assert body.places(t) == pytest.approx(way(t), rel=1e-9, abs=1e-9)
    body.at(times[0] - 1.0)
    assert (body.target == way(times[0])).all()
    body.at(times[-1] + 1.0)
    assert (body.target == body.frames[-1]).all()
    small = 1e-7
    for t in times:
        before, after = (body.places(t) - body.places(t - small)), (body.places(t + small) - body.places(t))
        assert after == pytest.approx(before, abs=small * 1e-4 * np.abs([a, b, c]).max() / np.diff(times).min() ** 2)


def save(folder, frames, faces, ending):
    folder.mkdir()
    for k, places in enumerate(frames):
        points = [" ".join(map(repr, x)) for x in places.tolist()]
        if ending == "obj":
            lines = [f"v {x}" for x in points] + ["f " + " ".join(str(i + 1) for i in face) for face in faces]
        else:
            head = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty double x\nproperty double y\n"
            head += f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header"
            lines = [head, *points, *(" ".join(map(str, [len(face), *face])) for face in faces)]
        (folder / f"frame{k}.{ending}").write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("ending", ["obj", "ply", "npz"])
def test_frames_are_read_from_files_in_their_order(tmp_path, ending):
    frames = CORNERS + np.arange(11)[:, None, None]  # frame 10 comes after frame 9
    if ending == "npz":
        np.savez(tmp_path / "walk.npz", frames=frames, faces=FACES, times=np.arange(11) / 4)
        body = Deforming.read(tmp_path / "walk.npz", scale=0.01)
    else:
        save(tmp_path / "walk", frames, FACES, ending)
        body = Deforming.read(tmp_path / "walk", rate=4.0, scale=0.01)
    assert body.name == "walk" and body.times == pytest.approx(np.arange(11) / 4)
    assert body.frames == pytest.approx(0.01 * frames) and (body.faces == FACES).all()


def test_corners_on_no_triangle_are_left_out_and_squares_are_cut(tmp_path):
    save(
        tmp_path / "cube", [np.array([[0, 0, 9], [0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])], [(1, 2, 3, 4)], "obj"
    )
    body = Deforming.read(tmp_path / "cube", rate=1.0)
    assert len(body.rest) == 4 and len(body.faces) == 2
    x = body.rest[body.faces]
    assert np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])[:, 2] == pytest.approx([1, 1])


def test_one_frame_stays():
    body = Deforming([CORNERS], FACES, [0.0])
    body.at(3.0)
    assert (body.target == CORNERS).all()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"times": [0.0, 1.0]}, "2 times for 3 frames"),
        ({"times": [0.0, 2.0, 2.0]}, "frame 2 is at 2 s and the next at 2 s"),
        ({"times": [0.0, np.nan, 2.0]}, "times that do not increase"),
        ({"faces": FACES + 1}, "faces of corners 1 to 4; its frames have 4"),
        ({"faces": FACES - 1}, "faces of corners -1 to 2"),
        ({"faces": FACES.astype(float)}, "give whole numbers"),
        ({"frames": CORNERS}, r"frames of shape \(4, 3\)"),
        ({"frames": np.array([CORNERS, CORNERS * np.nan, CORNERS])}, "places in frame 2 that are not finite"),
    ],
)
def test_what_is_no_motion_is_refused_in_a_sentence(change, reason):
    good = {"frames": np.array([CORNERS] * 3), "faces": FACES, "times": [0.0, 1.0, 2.0]}
    with pytest.raises(InputError, match=reason) as fault:
        Deforming(**(good | change), name="arm")
    assert "\n" not in str(fault.value) and "'arm'" in str(fault.value)


def test_files_that_are_no_frames_are_refused_in_a_sentence(tmp_path):
    def refused(reason, path, **options):
        with pytest.raises(InputError, match=reason) as fault:
            Deforming.read(tmp_path / path, **options)
        assert "\n" not in str(fault.value)

    refused("No such file", "none.npz")
    (tmp_path / "bad.npz").write_text("no archive")
    refused("no .npz archive of numbers", "bad.npz")
    np.savez(tmp_path / "some.npz", frames=CORNERS[None])
    refused("has no array 'faces'; it has frames", "some.npz")
    np.savez(tmp_path / "still.npz", frames=CORNERS[None], faces=FACES)
    refused("no times: give a rate", "still.npz")
    refused("rate = 0", "still.npz", rate=0.0)
    np.savez(tmp_path / "timed.npz", frames=CORNERS[None], faces=FACES, times=[0.0])
    refused("times of its own", "timed.npz", rate=2.0)
    (tmp_path / "empty").mkdir()
    refused("no .obj or .ply file", "empty", rate=1.0)
    save(tmp_path / "fewer", [CORNERS, np.concatenate([CORNERS, CORNERS])], FACES, "obj")
    refused(r"frame1.obj' has 8 corners, and the first frame, 'frame0.obj', 4", "fewer", rate=1.0)
    save(tmp_path / "other", [CORNERS], FACES, "ply")
    save(tmp_path / "turned", [CORNERS], FACES[:, ::-1], "ply")
    (tmp_path / "turned" / "frame0.ply").rename(tmp_path / "other" / "frame1.ply")
    refused("other triangles than the first frame", "other", rate=1.0)


def test_a_ball_that_swells_stretches_a_sheet_by_the_work_of_its_corners():
    domain = meshing.read(meshing.MESHES / "square.geo", MPI.COMM_SELF, side=0.6, n=4, triangles=0)
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(8e6, 0.25), 4e-4, (3.2e6, 3.2e6), element="mitc4")
    ball = Deforming([BALL.rest, (BALL.rest - BALL.centre) * 1.15 + BALL.centre], BALL.faces, [0.0, 0.1])
    touch = Contact(cloth, [ball], itself=False)
    held = supports.hinge(domain, cloth.space, "left") + supports.hinge(domain, cloth.space, "right")
    run, ledger = cloth.newmark(0.224, held, touch.terms, set_load=ball.at, accuracy=np.inf)
    work, before = 0.0, ball.rest
    for _ in run.march(0.06, 2.5e-3):
        x, force = touch._on(ball)
        work, before = work + np.sum(force * (x - before)), x.copy()
        assert touch.least_gap() > 0.0
    assert before == pytest.approx(ball.places(0.06))
    assert ledger.totals["external"] == pytest.approx(work, rel=0.02) and work > 1e-3
    assert abs(ledger.totals["imbalance"]) < 0.01 * ledger.most


def scene(folder, text):
    (folder / "scene.toml").write_text(text)
    return scenes.read(folder / "scene.toml")


def run(folder, text, out, **more):
    return scenes.run(scene(folder, text), results.folder(folder / out), progress=False, **more)


def frames(folder, *heights, times):
    shifted = np.array([BALL.rest + [0, 0, height] for height in heights])
    np.savez(folder / "ball.npz", frames=shifted, faces=BALL.faces, times=np.array(times))
    return '[[body]]\nname = "ball"\nkind = "frames"\nframes = "ball.npz"\n'


def test_frames_of_a_rigid_ball_push_a_sheet_as_the_led_ball_does(tmp_path):
    body = frames(tmp_path, 0.0, 0.02, times=[5.0, 7.0])
    save(tmp_path / "mesh", [BALL.rest], BALL.faces, "obj")
    led = '[[body]]\nname = "ball"\nkind = "surface"\nfile = "mesh/frame0.obj"\n'
    tables = [
        run(tmp_path, SCENE + text + "[statics]\nsteps = 2\n", out)
        for text, out in ((body, "own"), (led + "shift_m = [0, 0, 0.02]\n", "led"))
    ]
    for name in ("ball_z_N", "rim_z_N", "least_gap_m"):
        assert tables[0].column(name) == pytest.approx(tables[1].column(name), rel=1e-6, abs=1e-9)
    assert tables[0].column("ball_z_N")[-1] < -0.01


def test_a_run_goes_on_with_the_same_frames_only(tmp_path):
    body = frames(tmp_path, 0.0, 0.02, 0.0, times=[0.0, 0.03, 0.1])
    text = SCENE + body + "[dynamics]\nend_s = 0.04\n"
    whole = run(tmp_path, text, "whole")
    run(tmp_path, text.replace("0.04", "0.02"), "out")
    table = run(tmp_path, text, "out", resume=True)
    for name in ("ball_z_N", "kinetic_J", "friction_J"):
        assert table.column(name) == pytest.approx(whole.column(name), rel=1e-6, abs=1e-9)
    frames(tmp_path, 0.0, 0.021, 0.0, times=[0.0, 0.03, 0.1])
    with pytest.raises(InputError, match=r"body\[1\]\.options\.corners"):
        run(tmp_path, text.replace("0.04", "0.05"), "out", resume=True)


def test_a_path_leads_through_the_time_of_frames(tmp_path):
    body = frames(tmp_path, 0.0, -0.02, -0.03, times=[1.0, 2.0, 4.0])
    built = scenes.build(scene(tmp_path, SCENE + body + "path = [[0, 0], [1, 1], [2, 0]]\n[dynamics]\nend_s = 2\n"))
    ball = built.touch.bodies[0]
    for t, height in ((0.0, 0.0), (1.0, -0.03), (2.0, 0.0)):
        built.set_load(t)
        assert ball.target[:, 2] == pytest.approx(BALL.rest[:, 2] + height)
    with pytest.raises(InputError, match=r"shift_m = .* is not a known key"):
        scene(tmp_path, SCENE + body + "shift_m = [0, 0, 1]\n[statics]\n")
