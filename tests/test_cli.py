"""The command line: every verb, what it says to bad input, and what `doctor` finds."""

import dataclasses
import importlib.util
import json
import os
import re
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest
import scenes as scenes_of_tests
import test_demos
from mpi4py import MPI
from dolfinx import fem
from test_setup import PROJECT, ROOT

from fabric_fenicsx import fabrics, identify, scenes, system
from fabric_fenicsx.app import cli, doctor
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify.synthetic import synthetic
from fabric_fenicsx.output.fields import Fields
from fabric_fenicsx.solvers import checkpoint

read, look, MESHES = test_demos.read, test_demos.look, test_demos.MESHES
pytestmark = pytest.mark.filterwarnings("ignore:.*is beyond the measured")
SCENES = ROOT / "demos" / "scenes"
STATIC = f"""
[mesh]
file = "{MESHES}/strip.geo"
numbers = {{ nx = 6, ny = 2 }}
[sheet]
fabric = "blend"
[[support]]
at = "fixed_end"
kind = "clamp"
[[support]]
at = "pulled_end"
kind = "grip"
shift_m = [0.004, 0, 0]
[statics]
steps = 2
turns = [1, 0.5]
[[probe]]
name = "end"
at = "pulled_end"
axis = "x"
"""
MOTION = f"""
[mesh]
file = "{MESHES}/drape.geo"
numbers = {{ side = 1.0, n = 4, a = 0.25 }}
[sheet]
fabric = "blend"
[[support]]
at = "corners"
kind = "hinge"
[[load]]
kind = "gravity"
acceleration_m_per_s2 = [0, 0, -9.81]
[dynamics]
end_s = 0.02
[[probe]]
name = "centre"
at = "centre"
axis = "z"
"""
ENTRY = "import sys; sys.argv[0] = 'fabric-fenicsx'; from fabric_fenicsx.app import cli; cli.main()"


@pytest.fixture
def command(monkeypatch, capsys):
    """Runs the command in this process: its status and what it wrote to the two streams."""
    monkeypatch.setattr(warnings, "formatwarning", warnings.formatwarning)

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["fabric-fenicsx", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return end.value.code, *capsys.readouterr()

    return run


def apart(*words, **environment):
    """The command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", ENTRY, *map(str, words)],
        env=os.environ | environment, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


TWICE = """
import json, sys
from fabric_fenicsx.app import cli
ends = []
for words in json.loads(sys.argv[1]):
    sys.argv = ["fabric-fenicsx", *words]
    try:
        cli.main()
    except SystemExit as end:
        ends.append(end.code)
print("ends", ends)
"""
ONE_CELL = STATIC.replace("nx = 6, ny = 2", "nx = 1, ny = 1")
ON_RANKS = {
    "two": (STATIC, 0),
    "tweed": (STATIC.replace("blend", "tweed"), 2),
    "statics": (ONE_CELL, 0),
    "dynamics": (ONE_CELL.replace("[statics]\nsteps = 2\nturns = [1, 0.5]", "[dynamics]\nend_s = 0.02"), 0),
}
"""Scenes that are run on two ranks, with their status; of a single cell one rank has none."""


@pytest.fixture(scope="module")
def on_two_ranks(tmp_path_factory):
    """Folders of the scenes above once they were run, one after the other, and what was said."""
    folder, words = tmp_path_factory.mktemp("ranks"), []
    for name, (text, _) in ON_RANKS.items():
        (folder / name).mkdir()
        words.append(["run", str(scene(folder / name, text)), "--out", str(folder / name)])
    answer = test_demos.python_on_two_ranks("-c", TWICE, json.dumps(words))
    assert f"ends {[status for _, status in ON_RANKS.values()]}" in answer.stdout, answer.stderr
    return folder, answer


def scene(folder, text):
    """A scene file."""
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def one_frame(folder):
    """What a run of a few cells leaves behind for `view`."""
    u = fem.Function(scenes_of_tests.space(scenes_of_tests.grid(MPI.COMM_SELF, cells=(2, 2)), 1))
    yarns = np.tile([[1.0, 0, 0], [0, 1, 0]], (4, 1, 1))
    values = {"strain": np.tile([0.1, 0.1, 0.0], (4, 1)), "warp": yarns[:, 0], "weft": yarns[:, 1]}
    Fields(folder, u).write(1.0, "four cells", **values)
    return folder


# --- what each verb does


def test_the_entry_point_is_this_command():
    assert PROJECT["scripts"] == {"fabric-fenicsx": "fabric_fenicsx.app.cli:main"}
    verbs = {"fabrics", "identify", "markers", "run", "view", "doctor"}
    assert set(cli.app.commands) == verbs and all(cli.app.commands[verb].help for verb in verbs)


def test_help_and_completion(command):
    status, said, _ = command("--help")
    assert status == 0 and "doctor" in said and "--traceback" in said
    line = re.search(r'eval "\$\((\w+)=bash_source fabric-fenicsx\)"', " ".join(said.split()))
    assert "complete -o nosort" in apart(**{line[1]: "bash_source"}).stdout
    words = {"COMP_WORDS": "fabric-fenicsx fabrics show d", "COMP_CWORD": "3"}
    assert apart(_FABRIC_FENICSX_COMPLETE="bash_complete", **words).stdout.split() == ["plain,denim", "plain,duck"]


def test_fabrics(command, tmp_path):
    status, said, _ = command("fabrics", "list")
    assert status == 0 and all(name in said for name in fabrics.names())
    status, said, _ = command("fabrics", "show", "duck")
    assert status == 0 and "modulus 9 + 5620 E11 MPa" in said and "Table 7.1" in said
    for names, file in ((["muslin"], "one.png"), ([], "all.png")):
        assert command("fabrics", "plot", *names, "--out", tmp_path / file)[0] == 0
        look(tmp_path / file)


def test_identify(command, tmp_path):
    known = fabrics.load("blend")
    tests = synthetic.write(known, tmp_path / "records", 1, noise=0.0, seed=1)
    status, said, _ = command("identify", tests, "--out", tmp_path / "out")
    again = fabrics.load(tmp_path / "out" / "fabric.toml")
    assert status == 0 and "fabric.toml" in said and (tmp_path / "out" / "report.pdf").exists()
    assert again.warp.stress(0.1) == pytest.approx(known.warp.stress(0.1), rel=0.01)


def test_identify_ones_own_records(command, tmp_path):
    """Records in other units; and a bias test alone, of which a report comes and no fabric."""
    known = fabrics.load("muslin")
    tests = synthetic.write(known, tmp_path / "records", 1, noise=0.02, seed=1)
    before = identify.identify(identify.read(tests)).curves["warp"].loading
    for path in tests.parent.glob("warp_?.csv"):
        word, _, *rows = path.read_text().splitlines()
        rows = [[float(cell) for cell in row.split(",")] for row in rows]
        lines = [f"{t:.9g};{d / 25.4:.9g};{-f / 4.4482216152605:.9g}".replace(".", ",") for t, d, f in reversed(rows)]
        path.write_text("\n".join([word, "Time;Extension;Load", "(s);(in);(lbf)", *lines]))
    status, said, _ = command("identify", tests, "--out", tmp_path / "own")
    assert status == 0 and "sorted" in said and "sign is turned" in said and "--fabric" in said
    again = fabrics.load(tmp_path / "own" / "fabric.toml").warp
    assert np.allclose(again.modulus[: len(before.modulus)], before.modulus, rtol=1e-4)
    bias = tests.with_name("bias.toml")
    bias.write_text(tests.read_text().split("[records]")[0] + '[records]\nbias = ["bias_1.csv"]\n')
    status, said, complaint = command("identify", bias, "--shear", "net", "--out", tmp_path / "net")
    assert status == 2 and "not determined" in said and "under [assumed]" in complaint
    assert not (tmp_path / "net" / "fabric.toml").exists()
    look(tmp_path / "net" / "report.png")


def test_run_and_view(command, on_two_ranks, tmp_path):
    """Clamped ends, and what a cycle must do; the same on two ranks."""
    path = scene(tmp_path, STATIC)
    status, said, _ = command("run", path, "--out", tmp_path / "one")
    table = read(tmp_path / "one" / "history.csv")
    assert status == 0 and "4 steps" in said and np.allclose(table["load_part"], [0.5, 1, 0.75, 0.5])
    assert np.allclose(table["end_x_m"], 0.004 * table["load_part"])
    assert np.allclose(table["pulled_end_x_N"], -table["fixed_end_x_N"], rtol=1e-4)
    force, area = table["pulled_end_x_N"], 0.0254 * 0.38e-3
    # about the origin, in a corner: half of the width is the arm
    assert np.allclose(table["pulled_end_z_Nm"], -0.0127 * force, rtol=1e-2)
    assert np.allclose(table["fixed_end_z_Nm"], -table["pulled_end_z_Nm"], rtol=1e-4)
    assert force[1] > 2 * force[0] > 0 and force[3] < force[0], "stiffening, and hysteresis"
    E = 0.004 / 0.0762 + (0.004 / 0.0762) ** 2 / 2
    free = fabrics.load("blend").warp.stress(E) * (1 + 0.004 / 0.0762) * area
    assert 1.0 < force[1] / free < 1.15, "a little stiffer than between ends that contract"
    assert (tmp_path / "one" / "fields.pvd").exists()
    look(tmp_path / "one" / "deformed.png")
    status, said, _ = command("view", tmp_path / "one", "--frame", "1", "--colour", "weft", "--view", "0,-1,1")
    assert status == 0 and str(tmp_path / "one" / "view.png") in said
    look(tmp_path / "one" / "view.png")
    assert command("view", tmp_path / "one", "--animation")[0] == 0
    assert (tmp_path / "one" / "animation.gif").stat().st_size > 10_000

    folder, answer = on_two_ranks
    assert answer.stdout.count("4 steps") == 3, answer.stderr
    assert np.allclose(read(folder / "two" / "history.csv")["pulled_end_x_N"], force, rtol=1e-6)
    assert answer.stderr.count("error: ") == 1 and "'tweed'" in answer.stderr


def test_a_motion_and_its_resumption(command, tmp_path):
    path = scene(tmp_path, MOTION)
    assert command("run", path, "--out", tmp_path / "whole", "--quiet")[0] == 0
    table = read(tmp_path / "whole" / "history.csv")
    assert table["centre_z_m"][-1] == pytest.approx(-9.81 * 0.02**2 / 2, rel=0.03), "it falls freely at first"
    assert abs(table["imbalance_J"][-1]) < 0.01 * table["external_work_J"][-1]
    path.write_text(MOTION.replace("end_s = 0.02", "end_s = 0.04"))
    state = tmp_path / "whole" / "checkpoint.npz"
    assert command("run", path, "--resume", state, "--out", tmp_path / "on")[0] == 0
    assert read(tmp_path / "on" / "history.csv")["time_s"][0] == pytest.approx(0.025)


@pytest.mark.parametrize(("step", "wrong"), [(5, False), (60, False), (600, True)])
def test_a_motion_whose_energies_do_not_balance_is_not_trusted(command, tmp_path, step, wrong):
    """The first step is weighed like any other (else 17.6 % in one of 60 ms, 43 % of 600), and the end says so.

    Deflection in the first 60 ms by steps of 5 ms: 11.2 mm.
    """
    text = MOTION.replace("n = 4, a = 0.25", "n = 6, a = 0.34").replace('"corners"', '"corner_patches"')
    text = text.replace('"blend"', '"blend"\nlayers = 3\nlaw = "continuous"')
    steps = f"end_s = {max(60, step) * 1e-3}\nstep_ms = {step}\ndamping_per_s = 5.0"
    path = scene(tmp_path, text.replace("end_s = 0.02", steps))
    status, said, complaint = command("run", path, "--out", tmp_path / "out", "--quiet")
    part = float(re.search(r"largest imbalance of energy: (\S+) %", said)[1])
    assert (status, part >= 5, "do not balance" in complaint) == (int(wrong), wrong, wrong)
    table = read(tmp_path / "out" / "history.csv")
    if not wrong:
        assert part < 2 and table["centre_z_m"][-1] == pytest.approx(-0.0112, rel=0.05)
    assert (table["step_cuts"][0] > 0) == (step > 5)


def test_a_run_that_has_ended_ends_again_and_another_one_forgets_it(command, tmp_path):
    """--resume of a run that was stopped while it drew; a run from the start does not leave checkpoints of an older."""
    path, out = scene(tmp_path, STATIC), tmp_path / "out"
    assert command("run", path, "--out", out, "--quiet")[0] == 0
    history = (out / "history.csv").read_text()
    (out / "deformed.png").unlink()
    status, said, _ = command("run", path, "--out", out, "--quiet", "--resume")
    assert status == 0 and "4 steps" in said and (out / "history.csv").read_text() == history
    look(out / "deformed.png")
    assert (out / "checkpoint.before.npz").exists()
    path.write_text(STATIC.replace("0.004", "0.003"))
    assert command("run", path, "--out", out, "--quiet")[0] == 0
    assert not (out / "checkpoint.before.npz").exists(), "that is of the older run"
    path.write_text(STATIC + "[output]\ncheckpoint_s = -1\n")
    assert "checkpoint_s = -1 is negative" in command("run", path, "--out", out)[2]


def test_a_checkpoint_of_another_scene_is_refused_with_the_difference(command, tmp_path):
    """Whatever the answer depends on, in the scene, in the fabric's file and in the groups of the mesh."""
    (tmp_path / "cloth.toml").write_text(Path(fabrics.reading.__file__).with_name("blend.toml").read_text())
    text = MOTION.replace('"blend"', '"cloth.toml"\nwarp = [1, 0, 0]').replace("end_s = 0.02", "end_s = 0.005")
    path = scene(tmp_path, text)
    assert command("run", path, "--out", tmp_path / "whole", "--quiet")[0] == 0
    state = tmp_path / "whole" / "checkpoint.npz"
    built = scenes.build(scenes.read(path))
    run, _ = built.cloth.newmark(built.areal_mass, built.bcs, built.loads, set_load=built.set_load)
    made = scenes.marks.marks(built)
    kept = json.loads(str(np.load(state)["marks"]))
    assert kept == made and len(made) > 30
    changes = [
        ("warp = [1, 0, 0]", "warp = [0, 1, 0]", "warp (1.0, 0.0, 0.0) and not (0.0, 1.0, 0.0)"),
        ('"cloth.toml"', '"cloth.toml"\nelement = "q1"', "element None and not q1"),
        ('"cloth.toml"', '"cloth.toml"\npoisson = "lowered"', "poisson measured and not lowered"),
        ('"cloth.toml"', '"cloth.toml"\nshear_hysteresis = false', "shear_hysteresis True and not False"),
        ('"cloth.toml"', '"cloth.toml"\nkinematics = "membrane"', "kinematics shell and not membrane"),
        ('"cloth.toml"', '"cloth.toml"\nlayers = 5', "bending own and not layers; layers None and not 5"),
        ('"cloth.toml"', '"cloth.toml"\nlaw = "printed"', "law potential and not printed"),
        ('"cloth.toml"', '"denim"', "fabric."),
        ("-9.81]", "-9.80]", "load[1].value (0.0, 0.0, -9.81) and not (0.0, 0.0, -9.8)"),
        ('"hinge"', '"clamp"', "support[1].kind hinge and not clamp"),
        ('at = "corners"', 'at = "rim"', "support[1].at corners and not rim"),
        ("end_s = 0.005", "end_s = 0.005\ndamping_per_s = 1", "damping 0.0 and not 1.0"),
        ("end_s = 0.005", "end_s = 0.005\nrho = 1", "rho 0.8 and not 1.0"),
    ]
    for old, new, said in changes:
        assert old in text
        path.write_text(text.replace(old, new))
        said_now = scenes.read(path)
        known = {"": fabrics.load(said_now.materials[0].fabric)}
        other = dataclasses.replace(built, scene=said_now, fabrics=known)
        with pytest.raises(InputError, match=re.escape(said)):
            checkpoint.load(state, run, scenes.marks.marks(other))
    path.write_text(text)
    cloth = (tmp_path / "cloth.toml").read_text()
    for line, other in (("density_kg_per_m3 = 590", "density_kg_per_m3 = 5900"), ("[8, 8.26e2]", "[8, 8.27e2]")):
        assert line in cloth
        (tmp_path / "cloth.toml").write_text(cloth.replace(line, other))
        status, _, complaint = command("run", path, "--resume", state, "--out", tmp_path / "on")
        assert status == 2 and "it was made with fabric." in complaint, complaint
    assert not (tmp_path / "on" / "history.csv").exists(), "nothing is begun"


@pytest.mark.parametrize("name", ["statics", "dynamics"])
def test_a_rank_without_cells_takes_part(command, on_two_ranks, tmp_path, name):
    assert command("run", scene(tmp_path, ON_RANKS[name][0]), "--out", tmp_path, "--quiet")[0] == 0
    one, two = (read(folder / "history.csv") for folder in (tmp_path, on_two_ranks[0] / name))
    for column in one:
        if column[-2:] in ("_m", "_N"):
            assert np.allclose(one[column], two[column], rtol=1e-5, atol=1e-6 * np.abs(one[column]).max() + 1e-9)


@pytest.mark.parametrize("name", ["hanging", "twisted_strip"])
def test_the_examples_can_be_built(name):
    built = scenes.build(scenes.read(SCENES / f"{name}.toml"))
    assert built.bcs and (SCENES / f"{name}.toml").read_text().startswith("# ")


def test_loads_of_a_file_are_those_of_a_script(tmp_path):
    """Every kind of load, as its virtual work on a shift of the whole sheet: force times one metre."""
    loads = """
[[load]]
kind = "surface"
force_N_per_m2 = [0, 0, 3]
path = [[0, 0], [2, 1]]
[[load]]
kind = "edge"
at = "pulled_end"
force_N_per_m = [0, 0, 7]
[[load]]
kind = "point"
at = "pin"
force_N = [0, 0, 0.25]
[[load]]
kind = "pressure"
pressure_Pa = 2
at = "sheet"
"""
    built = scenes.build(scenes.read(scene(tmp_path, STATIC + loads)))
    built.set_load(1.0)
    vector = fem.assemble_vector(fem.form(built.loads)).array
    _, z = built.cloth.q.function_space.sub(0).sub(2).collapse()
    area = 0.0762 * 0.0254
    assert vector[z].sum() == pytest.approx(1.5 * area + 7 * 0.0254 + 0.25 + 2 * area)


# --- bad input


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('fabric = "blend"', 'fabrik = "blend"', "sheet.fabrik = 'blend' is not a known key; perhaps sheet.fabric"),
        ('fabric = "blend"', 'fabric = "tweed"', "'tweed' is no known fabric"),
        ('fabric = "blend"', 'fabric = "blend"\nlaw = "prnted"', "perhaps 'printed' is meant"),
        ('fabric = "blend"', 'fabric = "blend"\nwarp = [1, 0]', "sheet.warp = [1, 0] is not a list of 3 numbers"),
        ('fabric = "blend"', 'fabric = "blend"\nwarp = [0, 0, 1]', "along the normal"),
        ('fabric = "blend"', 'fabric = "blend"\nelement = "regge"', "'regge' is not one for quadrilaterals"),
        ('kind = "grip"', 'kind = "gripp"', "support[2].kind = 'gripp' is not known; perhaps 'grip'"),
        ('kind = "grip"', 'kind = "lead"', "support[2].axis is missing"),
        ('at = "fixed_end"', 'at = "left"', "no physical group 'left'"),
        ("nx = 6", "nz = 6", "does not let nz be set"),
        ("nx = 6", "nx = 0", "nx and ny must be whole numbers of at least 1"),
        ("nx = 6", "nx = 6.5", "nx and ny must be whole numbers of at least 1"),
        ("nx = 6", "length = -1", "length and width positive"),
        ('fabric = "blend"', 'fabric = "blend"\nwarp = [0, 0, 0]', "sheet.warp = [0, 0, 0] is no direction"),
        ('fabric = "blend"', 'fabric = "blend"\nwarp = {}', "sheet.warp = {} names no group"),
        (
            'fabric = "blend"',
            'fabric = "blend"\nwarp = { sheet = [0, 0, 0] }',
            "sheet.warp.sheet = [0, 0, 0] is no direc",
        ),
        ('at = "pulled_end"\nkind', 'at = "fixed_end"\nkind', "support[2].at = 'fixed_end' is held along x already"),
        (
            "[[probe]]",
            '[[support]]\nat = "pulled_end"\nkind = "lead"\naxis = "z"\nshift_m = 1\n[[probe]]',
            "along z already",
        ),
        (
            "[[probe]]",
            '[[probe]]\nname = "end"\nat = "pin"\naxis = "x"\n[[probe]]',
            "probe[2].name = 'end' names another",
        ),
        ("steps = 2", "smallest = 7", "statics.smallest = 7 is more than a whole step"),
        ('axis = "x"', "axis = 0", "probe[1].axis = 0 is not known; known are x, y, z"),
        ("strip.geo", "stripe.geo", "There is no mesh file"),
        ("steps = 2", "steps = 0", "statics.steps = 0 is not a whole number of at least 1"),
        ("[statics]", "[dynamics]\nend_s = 1\n[statics]", "keep [statics] or [dynamics]"),
        ("shift_m = [0.004, 0, 0]", "path = [[1, 0], [0, 1]]", "support[2].path = [[1, 0], [0, 1]] goes back"),
        ("[[probe]]", '[[load]]\nkind = "edge"\nat = "sheet"\nforce_N_per_m = [0, 0, 1]\n[[probe]]', "group of edges"),
        ("[mesh]", "[mesh", "is not TOML"),
    ],
)
def test_a_scene_that_cannot_be_is_refused_in_a_sentence(command, tmp_path, old, new, reason):
    assert old in STATIC
    status, _, complaint = command("run", scene(tmp_path, STATIC.replace(old, new)), "--out", tmp_path / "out")
    assert status == 2 and complaint.startswith("error: ") and reason in complaint
    assert complaint.count("\n") == 1 and "Traceback" not in complaint


@pytest.mark.parametrize(
    ("words", "status", "reason"),
    [
        ("rnu", 2, "Did you mean 'run'?"),
        ("run nowhere.toml", 2, "nowhere.toml: cannot be read"),
        ("fabrics show tweed", 2, "'tweed' is no known fabric"),
        ("fabrics plot blend --out nowhere/a.png", 2, "cannot be written"),
        ("identify nowhere.toml", 2, "cannot be read"),
        ("identify {broken}", 2, "is not TOML"),
        ("view nowhere", 2, "holds no frames"),
        ("view . --view 1,2", 2, "1,2 is not of the form"),
        ("view {run} --out nowhere/a.png", 2, "'nowhere/a.png' cannot be written"),
        ("view {run} --out a.xyz", 2, "'a.xyz' cannot be written"),
        ("view {run} --animation --out nowhere/a.gif", 2, "'nowhere/a.gif' cannot be written"),
        ("view {run} --frame 7", 2, "the run has the frames 0 to 0"),
        ("view . --view 0,0,0", 2, "0,0,0 is no direction"),
        ("view . --view nan,0,1", 2, "nan,0,1 is no direction"),
        ("run {static} --resume {broken}", 2, "does not fit: it cannot be read"),
    ],
)
def test_bad_input_is_answered_in_a_sentence(command, tmp_path, words, status, reason):
    static, broken = scene(tmp_path, STATIC).rename(tmp_path / "static.toml"), scene(tmp_path, "[mesh")
    words = words.format(broken=broken, static=static, run=one_frame(tmp_path))
    found, _, complaint = command(*words.split())
    assert found == status and reason in complaint and "Traceback" not in complaint
    if "Usage" not in complaint:
        assert "Traceback" in command("--traceback", *words.split())[2]


def test_a_fault_of_the_program_shows_no_traceback_unasked(command, monkeypatch):
    def broken():
        raise RuntimeError("broken")

    monkeypatch.setattr(fabrics, "names", broken)
    status, _, complaint = command("fabrics", "list")
    assert status == 1 and complaint.startswith("error: RuntimeError: broken") and "Traceback" not in complaint
    assert "in broken" in command("--traceback", "fabrics", "list")[2]


def test_the_example_in_the_docstring_is_a_scene(tmp_path):
    """But for [statics], [dynamics] and [dressing], of which it shows all."""
    text = scenes.reading.__doc__
    example = text[text.index("title =") :].replace("[statics]", "[other]")
    tables = tomllib.loads(example)
    del tables["other"]
    with pytest.raises(InputError, match="other"):
        scenes.read(scene(tmp_path, example))
    with pytest.raises(InputError, match="not dynamics and dressing"):
        scenes.read(scene(tmp_path, example[: example.index("[other]")] + example[example.rindex("[dynamics]") :]))
    start, end = example.index("    [other]"), example.rindex("    [dynamics]")
    dressing, probe = example.index("    [dressing]"), example.index("    [[probe]]")
    found = scenes.read(scene(tmp_path, example[:start] + example[end:dressing] + example[probe:]))
    assert found.dynamic and found.probes[0].axis == 2 and found.loads[0].value == (0, 0, -9.81)


@pytest.mark.parametrize(("verb", "key"), [("run", "acceleration_m_per_s2"), ("identify", "gauge_length_mm")])
def test_the_keys_of_a_file_are_printed(command, verb, key):
    status, said, _ = command(verb, "--keys")
    assert status == 0 and key in said


# --- doctor


def marks(answer):
    """What is said of each thing."""
    assert "Traceback" not in answer.stderr
    return {line.split(":")[0][8:]: line[:7].strip() for line in answer.stdout.splitlines() if line[:1] != " "}


def test_doctor_tells_what_the_system_lacks(tmp_path):
    """The loader meets files first that cannot be loaded, and the compiler does not compile."""
    for library in "libEGL.so.1", "libGLU.so.1":
        (tmp_path / library).touch()
    answer = apart("doctor", CC="false", LD_LIBRARY_PATH=str(tmp_path))
    found = marks(answer)
    assert answer.returncode == 1 and "apt-get install" in answer.stdout
    assert found["a C compiler with the C library's headers"] == "MISSING" and " gcc libc6-dev" in answer.stdout
    assert found["gmsh (meshes)"] == found["libGLU.so.1"] == "MISSING" and "libglu1-mesa" in answer.stdout
    assert found["PyVista (pictures)"] == "without" and "libegl1 libegl-mesa0" in answer.stdout
    assert found["Numba"] == found["DOLFINx 0.11"] == "ok"


def test_a_compiler_that_is_not_there_is_missed(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    assert "a C compiler with the C library's headers" in system.missing()


@pytest.mark.parametrize("hidden", ["library", "driver"])
def test_without_egl_a_picture_is_left_out_and_nothing_crashes(tmp_path, hidden):
    """Nor with an EGL that has no driver: libglvnd looks for them in this folder alone."""
    for library in "libEGL.so.1", "libOSMesa.so.8":
        (tmp_path / library).touch()
    name = {"library": "LD_LIBRARY_PATH", "driver": "__EGL_VENDOR_LIBRARY_DIRS"}[hidden]
    answer = apart("view", one_frame(tmp_path), **{name: str(tmp_path)})
    if hidden == "driver" and answer.returncode == 0:  # an EGL that is not libglvnd's finds its driver all the same
        assert (tmp_path / "view.png").stat().st_size > 10_000
        return
    assert answer.returncode == 2 and "no EGL that works without a screen" in answer.stderr
    assert answer.stderr.count("\n") == 1 and not (tmp_path / "view.png").exists()


def test_doctor_works_without_dolfinx_and_nothing_else_does(tmp_path):
    (tmp_path / "dolfinx.py").write_text("raise ImportError('it is hidden')\n")
    hidden = {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    answer = apart("doctor", **hidden)
    found = marks(answer)
    assert answer.returncode == 1 and found["DOLFINx 0.11"] == "MISSING" and found["Numba"] == "ok"
    assert "it is hidden" in answer.stdout and "make setup" in answer.stdout
    refused = apart("fabrics", "list", **hidden)
    assert refused.returncode == 1 and "make setup" in refused.stderr and "Traceback" not in refused.stderr


def test_help_loads_no_library(tmp_path):
    """Nor does it need any."""
    for name in "dolfinx", "numpy", "mpi4py":
        (tmp_path / f"{name}.py").write_text("raise ImportError('it is hidden')\n")
    hidden = {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    for words in [], ["--help"], ["run", "-h"], ["--version"]:
        answer = apart(*words, **hidden)
        assert "fabric-fenicsx" in answer.stdout + answer.stderr and "hidden" not in answer.stderr, words
        assert answer.returncode == (0 if words else 2)


def test_doctor_sees_what_became_of_compiled_forms(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "fenics").mkdir()
    left = tmp_path / "fenics" / "libffcx_forms_0.c"
    left.touch()
    left.with_suffix(".so").write_bytes(Path(sys.executable).read_bytes()[:-100])
    found = doctor._cache()
    assert found.good and "1 not compiled to the end and 1 cut short" in found.said, "a run mends it"
    Path(f"{left}.cached").touch()
    left.with_suffix(".so").write_bytes(Path(sys.executable).read_bytes())
    assert "cut short" not in doctor._cache().said


def test_doctor_sees_homes_and_caches_that_cannot_be_used(tmp_path):
    (tmp_path / "file").touch()
    answer = apart("doctor", HOME=str(tmp_path / "file"), XDG_CACHE_HOME=str(tmp_path / "file"), TMPDIR=str(tmp_path))
    assert answer.returncode == 0 and "MISSING" not in answer.stdout, answer.stdout
    assert marks(answer)["home and cache folders"] == "without"
    assert "HOME=" in answer.stdout and f"{tmp_path}/fabric_fenicsx-{os.getuid()} is used" in answer.stdout
    film = importlib.util.find_spec("imageio_ffmpeg") or importlib.util.find_spec("av")
    assert marks(answer)["FFmpeg (films .mp4; .gif needs none)"] == ("ok" if film else "without")
