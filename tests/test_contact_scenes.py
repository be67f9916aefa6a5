"""Contact in a scene file: the answer of the script, columns, moves, faults, checkpoints, one and two ranks."""

import re
import subprocess
import sys

import numpy as np
import pytest
import pyvista
import ufl
from mpi4py import MPI

from fabric_fenicsx import scenes
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.output import fields, results
from fabric_fenicsx.output.series import Series
from fabric_fenicsx.surfaces import meshing

pytestmark = pytest.mark.filterwarnings("ignore:.*is assumed")
SIDE = 0.6
SHEET = f"""
[mesh]
file = "{meshing.MESHES}/drape.geo"
numbers = {{ side = {SIDE}, n = 4, a = 0.15 }}
[sheet]
fabric = "blend"
law = "svk"
"""
BALL = """
[[body]]
name = "ball"
kind = "sphere"
radius_m = 0.15
centre_m = [0.3, 0.3, -0.155]
cells = 6
"""
GRAVITY = """
[[load]]
kind = "gravity"
acceleration_m_per_s2 = [0, 0, -9.81]
"""
DROP = SHEET + BALL + GRAVITY + "[contact]\nfriction = 0.3\nitself = false\n[dynamics]\nend_s = 0.05\n"
RIM = '[[support]]\nat = "rim"\nkind = "hinge"\n'
PUSH = SHEET + RIM + BALL + "shift_m = [0, 0, 0.02]\n[statics]\nsteps = 2\n"
BOX = '[[body]]\nname = "box"\nkind = "box"\nsize_m = [1, 2, 3]\n'


def scene(folder, text):
    """What a scene file with this text says."""
    (folder / "scene.toml").write_text(text)
    return scenes.read(folder / "scene.toml")


def run(text, out, **more):
    """The history of a run of a scene."""
    return scenes.run(scene(out.parent, text), results.folder(out), progress=False, **more)


def test_a_scene_falls_onto_a_sphere_as_its_script_does(tmp_path):
    table = run(DROP, tmp_path / "out")
    cloth = scenes.build(scene(tmp_path, SHEET + RIM + "[dynamics]\nend_s = 1\n")).cloth
    ball = bodies.Sphere(0.15, (0.3, 0.3, -0.155), cells=6)
    touch = Contact(cloth, [ball], friction=0.3, itself=False)
    weight = cloth.weight(cloth.areal_mass, ufl.as_vector((0.0, 0.0, -9.81)))
    motion, ledger = cloth.newmark(cloth.areal_mass, [], [weight, *touch.terms])
    rows = [[touch.least_gap(), *touch.force(ball), *touch.moment(ball)] for _ in motion.march(0.05, 5e-3)]
    columns = ["least_gap_m", *(f"ball_{axis}_{unit}" for unit in ("N", "Nm") for axis in "xyz")]
    found = np.array([table.column(name) for name in columns]).T
    assert found == pytest.approx(np.array(rows), rel=1e-6, abs=1e-9)
    assert found[-1][0] > 0.0 and found[-1][3] < -0.1
    assert table.column("friction_J")[-1] == pytest.approx(ledger.totals["by_friction"], rel=1e-6)


def test_a_led_body_pushes_a_sheet_at_rest_and_its_supports_bear_it(tmp_path):
    table = run(PUSH, tmp_path / "out")
    pushed, borne = table.column("ball_z_N"), table.column("rim_z_N")
    assert table.column("load_part") == pytest.approx([0.5, 1.0])
    assert pushed[1] < 2 * pushed[0] < 0.0
    assert borne == pytest.approx(pushed, rel=1e-3, abs=5e-4), "Newton's tolerance, of the first residual"
    assert (table.column("least_gap_m") > 0.0).all()
    # beside the sheet there is the body, where it is then, and both have the pressure of contact
    series, sheet_files = (fields.index(tmp_path / "out", kind) for kind in ("bodies", "fields"))
    assert [time for time, _ in series] == [time for time, _ in sheet_files] == [1.0, 2.0]
    ball = bodies.Sphere(0.15, (0.3, 0.3, -0.155), cells=6)
    for (_, file), shift in zip(series, (0.01, 0.02), strict=True):
        grid = pyvista.read(file)
        assert np.array(grid.points) == pytest.approx(ball.rest + [0, 0, shift])
        assert grid.field_data["body_0"][0] == "ball" and grid.n_cells == len(ball.faces)
        assert grid.point_data[fields.PRESSURE].max() > 0.0
    sheet = pyvista.read(sheet_files[-1][1])
    assert (sheet.point_data[fields.PRESSURE] > 0.0).sum() >= 1
    shape = Series(tmp_path / "out").shape(-1, "pressure")
    assert shape.values.max() > 0.0 and len(shape.bodies) == 1 and len(shape.in_sight()) > 2 * len(shape.points)
    run(SHEET + RIM + GRAVITY + "[dynamics]\nend_s = 0.005\n", tmp_path / "out")
    assert not (tmp_path / "out" / "bodies.pvd").exists() and not list((tmp_path / "out" / "bodies").glob("*"))
    with pytest.raises(InputError, match="has no pressure, as nothing can touch"):
        Series(tmp_path / "out").shape(-1, "pressure")


@pytest.mark.parametrize(
    ("said", "made"),
    [
        ('"plane"\nnormal = [0, 0, 2]\npoint_m = [0, 0, -1]\nsize_m = 3', bodies.Plane((0, 0, 1), (0, 0, -1), size=3)),
        ('"sphere"\nradius_m = 0.1\ncentre_m = [0, 0, -1]\ncells = 4', bodies.Sphere(0.1, (0, 0, -1), cells=4)),
        ('"cylinder"\nradius_m = 0.1\nlength_m = 2\naxis = [1, 0, 0]', bodies.Cylinder(0.1, 2, axis=(1, 0, 0))),
        ('"capsule"\nradius_m = 0.1\nlength_m = 2\ncells = 4', bodies.Capsule(0.1, 2, cells=4)),
        ('"ring"\nradius_m = 1\nwire_m = 0.2\ncells = 5', bodies.Ring(1, 0.2, cells=5)),
        ('"box"\nsize_m = [1, 2, 3]\norientation_deg = [0, 0, 90]', bodies.Box((1, 2, 3), turn=(0, 0, np.pi / 2))),
        (
            '"surface"\nfile = "square.geo"\nnumbers = { side = 0.5, n = 2 }\nscale = 2',
            bodies.Surface(meshing.MESHES / "square.geo", numbers={"side": 0.5, "n": 2}, scale=2.0),
        ),
    ],
    ids=lambda value: getattr(value, "name", ""),
)  # fmt: skip
def test_every_kind_of_body_is_that_of_a_script(tmp_path, said, made):
    told = scene(tmp_path, f'{SHEET}[[body]]\nname = "it"\nkind = {said}\nshift_m = [1, 0, 0]\n[statics]\n')
    body, move = scenes.bodies.led(told.bodies[0])
    assert type(body) is type(made) and body.name == "it"
    assert body.rest == pytest.approx(made.rest) and (body.faces == made.faces).all()
    assert told.contact == {"friction": 0.0, "static": 0.0, "itself": True}
    move(0.5)
    assert body.target == pytest.approx(made.rest + [0.5, 0, 0])


def test_a_body_is_led_and_turned_along_its_path_and_contact_has_si_units(tmp_path):
    led = "shift_m = [0, 0, 1]\nturn_deg = [0, 0, 90]\nabout_m = [1, 0, 0]\npath = [[0, 0], [1, 1], [2, 0]]\n"
    numbers = (
        "friction = 0.2\nstatic_friction = 0.3\nitself = false\noffset_m = 1e-3\nreach_m = 2e-3\nstiffness_Pa = 50\n"
    )
    text = SHEET + BOX + "centre_m = [0, 0, -10]\n" + led + "[contact]\n" + numbers
    built = scenes.build(scene(tmp_path, text + "slip_m_per_s = 1e-2\ncreep_m = 1e-5\n[statics]\nturns = [2]\n"))
    box = built.touch.bodies[0]
    expected = {"friction": 0.2, "static": 0.3, "itself": False, "offset": 1e-3, "reach": 2e-3}
    assert built.scene.contact == expected | {"stiffness": 50.0, "slip": 1e-2, "creep": 1e-5}
    assert (built.touch.offset, built.touch.reach) == (1e-3, 2e-3)
    built.set_load(1.0)
    x = box.rest
    assert box.target == pytest.approx(np.column_stack([1 - x[:, 1], x[:, 0] - 1, x[:, 2] + 1]))
    built.set_load(2.0)
    assert box.target == pytest.approx(x)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('kind = "sphere"\n', "", r"body\[1\]\.kind is missing; write one of plane, sphere"),
        ('kind = "gravity"\n', "", r"load\[1\]\.kind is missing; write one of gravity, pressure"),
        ('"sphere"', '"spere"', r"kind = 'spere' is not known; perhaps 'sphere' is meant"),
        ('name = "ball"\n', "", r"body\[1\]\.name is missing"),
        ("radius_m = 0.15\n", "", r"body\[1\]\.radius_m is missing"),
        ("radius_m = 0.15", "radius_m = -1", r"body\[1\]\.radius_m = -1 is not positive"),
        ("radius_m", "radius_mm", "radius_mm = 0.15 is not a known key; perhaps .*radius_m is meant"),
        ("cells = 6", "cells = 0", "cells = 0 is not a whole number of at least 1"),
        ("cells = 6", "path = [[1, 0], [0, 1]]", "path = .* goes back"),
        ('"sphere"\nradius_m = 0.15\ncentre_m = [0.3, 0.3, -0.155]\ncells = 6', '"plane"\nturn_deg = [1, 0, 0]',
         "turn_deg = .* is not a known key"),
        ('"sphere"\nradius_m = 0.15\ncentre_m = [0.3, 0.3, -0.155]\ncells = 6', '"plane"\nnormal = [0, 0, 0]',
         "normal = .* is no direction"),
        ('"sphere"\nradius_m = 0.15\ncentre_m = [0.3, 0.3, -0.155]\ncells = 6', '"box"\nsize_m = [1, 0, 1]',
         "size_m = .* holds a number that is not positive"),
        ('"sphere"\nradius_m = 0.15\ncentre_m = [0.3, 0.3, -0.155]\ncells = 6', '"surface"\nfile = "none.stl"',
         "none.stl"),
        ("[[load]]", BALL + "[[load]]", r"body\[2\]\.name = 'ball' names another body"),
        ("[[load]]", RIM.replace('"rim"', '"ball"') + "[[load]]", "name = 'ball' is also a place of a support"),
        (BALL, "", "support is missing"),
        (BALL, RIM, "contact.itself = False leaves nothing to touch"),
        ("friction = 0.3", "friction = -0.3", "contact.friction = -0.3 is negative"),
        ("friction = 0.3", "friction = 0.3\nstatic_friction = 0.2", "static_friction = 0.2 is less than the friction"),
        ("friction = 0.3", "friction = [0.3, -1]", r"contact.friction = \[0.3, -1\] is negative"),
        ("friction = 0.3", "friction = [0.3, 0.2, 1]", "contact.friction"),
        ("friction = 0.3", "friction = [0.3, 0.2]\nstatic_friction = 0.25", r"less than .* sliding, \[0.3, 0.2\]"),
        ("friction = 0.3", "stiffness = 1", "contact.stiffness = 1 is not a known key; perhaps contact.stiffness_Pa"),
        ("friction = 0.3", "reach_m = 0", "contact.reach_m = 0 is not positive"),
        ("-0.155]", "-0.1]", "The sheet starts across a body"),
        (DROP, SHEET + RIM + '[statics]\n[output]\ncolour = "pressure"\n', "colour = 'pressure' is of contact"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_a_sentence(tmp_path, old, new, reason):
    assert old in DROP
    with pytest.raises(InputError, match=reason) as fault:
        scenes.build(scene(tmp_path, DROP.replace(old, new)))
    assert "\n" not in str(fault.value)


def test_without_the_toolkit_a_sentence_says_what_to_install(tmp_path, without_toolkit):
    with pytest.raises(InputError, match=r"pip install 'fabric_fenicsx\[contact\]'"):
        scenes.build(scene(tmp_path, DROP.replace("itself = false", "itself = true")))


def test_a_scene_without_contact_imports_nothing_of_it(tmp_path):
    """One after the other in a process of their own."""
    code = "import sys; from fabric_fenicsx import scenes\n"
    for name, text in (("without", SHEET + RIM), ("with", SHEET + BALL)):
        results.folder(tmp_path / name)
        (tmp_path / f"{name}.toml").write_text(text + GRAVITY + "[dynamics]\nend_s = 0.005\n")
        code += f"scenes.run(scenes.read({str(tmp_path / name) + '.toml'!r}), {str(tmp_path / name)!r}, False)\n"
        code += "print(*sys.modules)\n"
    words = [sys.executable, "-W", "ignore", "-c", code]
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    listed = [set(line.split()) for line in told.splitlines() if line.startswith("sys ")]
    for name in ("ipctk", "fabric_fenicsx.contact"):
        assert [name in modules for modules in listed] == [False, True]
    for name in ("without", "with"):
        assert ("least_gap_m" in (tmp_path / name / "history.csv").read_text()) == (name == "with")


def test_a_run_goes_on_with_the_same_bodies_and_contact_only(tmp_path):
    whole = run(DROP, tmp_path / "whole")
    short, out = DROP.replace("end_s = 0.05", "end_s = 0.04"), tmp_path / "out"
    run(short, out)
    changes = [
        ("friction = 0.3", "friction = 0.2", "contact.friction 0.3 and not 0.2"),
        ("friction = 0.3", "friction = 0.3\nreach_m = 1e-3", "contact.reach left out and not 0.001"),
        ("-0.155]", "-0.156]", "body[1].options.centre (0.3, 0.3, -0.155) and not (0.3, 0.3, -0.156)"),
        ("cells = 6", "shift_m = [0, 0, 0.1]", "body[1].options.cells 6 and not left out"),
        ("[[load]]", BOX + "centre_m = [0, 0, -10]\n[[load]]", "body[2].name left out and not box"),
        (BALL, RIM.replace("rim", "corners") + BALL, "support[1].at left out"),
    ]
    for old, new, said in changes:
        assert old in DROP
        with pytest.raises(InputError, match=re.escape(said)):
            run(DROP.replace(old, new), out, resume=True)
    table = run(DROP, out, resume=True)
    for name in ("time_s", "least_gap_m", "ball_z_N", "kinetic_J", "friction_J"):
        assert table.column(name) == pytest.approx(whole.column(name), rel=1e-6, abs=1e-9)


def test_statics_go_on_with_the_body_where_it_was(tmp_path):
    text = PUSH.replace("[statics]", "[contact]\nfriction = 0.3\n[statics]\nturns = [1, 0.5]")
    whole = run(text, tmp_path / "whole")
    out = tmp_path / "out"
    run(text.replace("[1, 0.5]", "[1]"), out)
    with pytest.raises(InputError, match=r"body\[1\]\.shift \(0\.0, 0\.0, 0\.02\) and not"):
        run(text.replace("0.02", "0.03"), out, resume=True)
    table = run(text, out, resume=True)
    assert table.column("load_part") == pytest.approx([0.5, 1.0, 0.75, 0.5])
    for name in ("least_gap_m", "ball_z_N", "rim_z_N"):
        assert table.column(name) == pytest.approx(whole.column(name), rel=1e-3, abs=1e-4)


def test_a_surface_counts_by_its_triangles_and_not_by_its_place(tmp_path):
    floor = '[[body]]\nname = "floor"\nkind = "surface"\nfile = "floor.geo"\nshift_m = [0, 0, -0.1]\npath = [[0, 1]]\n'

    def marks(name, side):
        (tmp_path / name).mkdir()
        (tmp_path / name / "floor.geo").write_text((meshing.MESHES / "square.geo").read_text())
        text = f"{SHEET}{floor}numbers = {{ side = {side}, n = 2 }}\n[dynamics]\nend_s = 1\n"
        return scenes.marks.marks(scenes.build(scene(tmp_path / name, text)))

    first, moved, larger = marks("first", 1.0), marks("moved", 1.0), marks("larger", 1.1)
    assert first == moved
    assert {key for key in first if first[key] != larger[key]} == {"body[1].options.corners"}


def test_the_example_that_comes_with_the_package_can_be_built():
    built = scenes.build(scenes.read("sphere"))
    assert [body.name for body in built.touch.bodies] == ["ball"] and not built.bcs


@pytest.mark.parallel
def test_ranks_do_not_change_the_answer(tmp_path):
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path, 0)
    if comm.rank == 0:
        (folder / "scene.toml").write_text(DROP)
    comm.barrier()
    built = [scenes.build(scenes.read(folder / "scene.toml"), of) for of in (MPI.COMM_SELF, comm)]
    rows = []
    for one in built:
        motion, _ = one.cloth.newmark(one.areal_mass, one.bcs, one.acting, rtol=1e-10, set_load=one.set_load)
        rows.append([list(one.touch.row().values()) for _ in motion.march(0.04, 5e-3)])
    assert np.array(rows[1]) == pytest.approx(np.array(rows[0]), rel=1e-6, abs=1e-9)


def test_a_body_with_mass_falls_freely_onto_a_held_sheet(tmp_path):
    free = 'cells = 6\nmass_kg = 0.2\ninertia_kg_m2 = "solid"\nvelocity_m_per_s = [0, 0, -1]\n'
    ball = BALL.replace("-0.155", "0.2").replace("cells = 6\n", free)
    table = run(SHEET + RIM + ball + GRAVITY + "[dynamics]\nend_s = 0.06\n", tmp_path / "out")
    touches = table.column("time_s")[np.flatnonzero(table.column("ball_z_N"))[0]]
    # from 0.05 m above the sheet, whose middle falls with it
    assert touches == pytest.approx(0.052, abs=4e-3)
    assert table.column("ball_z_N").max() > 0.5


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ("mass_kg = 0", "mass_kg = 0 is not positive"),
        ("velocity_m_per_s = [0, 0, 1]", "belongs to a body that moves freely; give its mass_kg too"),
        ("mass_kg = 1\nshift_m = [0, 0, 1]", "shift_m = .* leads a body that its mass_kg lets move freely"),
        ('mass_kg = 1\ninertia_kg_m2 = "hollow"', "inertia_kg_m2 = 'hollow' is not known"),
        ("mass_kg = 1\ninertia_kg_m2 = [1, 1, 3]", "inertia = .*, which is no body's"),
        ("mass_kg = 1\nspin_rad_per_s = [1, 0, 0]", "an inertia to what spins"),
    ],
)
def test_what_cannot_move_freely_is_refused_in_a_sentence(tmp_path, more, reason):
    with pytest.raises(InputError, match=reason):
        scenes.build(scene(tmp_path, DROP.replace("cells = 6", more)))
    with pytest.raises(InputError, match="mass_kg = 1 lets a body move freely, which takes time"):
        scene(tmp_path, PUSH.replace("shift_m = [0, 0, 0.02]", "mass_kg = 1"))


def test_explicit_motion_is_asked_for_by_a_key(tmp_path):
    rim = '[[probe]]\nname = "rim"\nat = "rim"\naxis = "z"\n'
    one, two = (
        run(DROP.replace("[dynamics]", rim + f'[dynamics]\nmethod = "{method}"'), tmp_path / method)
        for method in ("implicit", "explicit")
    )
    assert two.column("rim_z_m") == pytest.approx(one.column("rim_z_m"), rel=0.02)
    assert (two.column("newton_iterations") > one.column("newton_iterations")).all()  # its steps
