"""What a run leaves in its folder: fields that others can open, and nothing lost, whatever stops it."""

import csv
import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest
import pyvista
import test_cli
import test_demos
from mpi4py import MPI
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

from fabric_fenicsx import fabrics, files, scenes, sheet, system
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.output import fields, pictures, results, series
from fabric_fenicsx.output.gathering import Whole
from fabric_fenicsx.output.recording import Recorder, cell_values
from fabric_fenicsx.solvers import continuation, step
from fabric_fenicsx.solvers.continuation import Step
from fabric_fenicsx.surfaces import meshing

COMM = MPI.COMM_WORLD
MOTION = 'title = "a fall"' + test_cli.MOTION.replace("end_s = 0.02", "end_s = 0.04")
STATIC = test_cli.STATIC.replace("nx = 6, ny = 2", "nx = 3, ny = 1").replace("steps = 2", "steps = 4")


def shared(tmp_path):
    """The same folder on all ranks."""
    return COMM.bcast(tmp_path, root=0)


def read(path):
    """A file, by the reader that ParaView has for it."""
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    return pyvista.wrap(reader.GetOutput())


def stretched(comm, kind, curved=False):
    """A sheet of 0.2 m x 0.1 m, pulled by 10 % along x, sheared by 0.05 and turned by a quarter about x."""
    domain = meshing.read(
        meshing.MESHES / "strip.geo", comm, length=0.2, width=0.1, nx=4, ny=2, triangles=int(kind == "regge")
    )
    kinematics, element = ("membrane", None) if kind == "membrane" else ("shell", kind)
    fabric = fabrics.load("blend")
    law = StVenantKirchhoff.isotropic(1e6, 0.3) if kind == "mitc4" else Woven(fabric)
    cloth = sheet.Sheet(domain, law, 4e-4, (1e5, 1e5), kinematics=kinematics, element=element)
    parts = [cloth.q] if kind == "membrane" else [cloth.q.sub(0), cloth.q.sub(1)]
    parts[0].interpolate(lambda x: [0.1 * x[0] + 0.05 * x[1], -x[1], x[1]])
    if kind != "membrane":
        parts[1].interpolate(lambda x: [0 * x[0], -1 + 0 * x[0], 0 * x[0]])
    cloth.q.x.scatter_forward()
    for term in cloth.terms:
        term.evaluate()
    return cloth


# --- fields


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("kind", ["membrane", "regge", "mitc4"])
def test_fields_hold_what_the_sheet_does(tmp_path, kind):
    """The exact strain, stress, yarns and director of a homogeneous deformation, at cells and nodes, on any ranks."""
    folder, cloth = shared(tmp_path), stretched(COMM, kind)
    writer = fields.Fields(folder, cloth.displacement())
    writer.write(0.25, "pulled", **cell_values(cloth))
    alone = stretched(MPI.COMM_SELF, kind)
    if COMM.rank > 0:
        return
    grid = read(folder / "fields" / "000000.vtu")
    x = grid.points
    assert np.allclose(
        grid.point_data["displacement_m"], np.stack([0.1 * x[:, 0] + 0.05 * x[:, 1], -x[:, 1], x[:, 1]]).T
    )
    F = np.array([[1.1, 0.05], [0.0, 0.0], [0.0, 1.0]])
    E = (F.T @ F - np.eye(2)) / 2
    strain = np.array([E[0, 0], E[1, 1], 2 * E[0, 1]])
    law = alone.law
    stress = strain @ law.stiffness.T if kind == "mitc4" else law.respond(strain[None], law.initial_state[None])[0][0]
    for data in grid.cell_data, grid.point_data:
        assert np.allclose(data["strain"], strain, atol=1e-7)
        assert np.allclose(data["stress_Pa"], stress, rtol=1e-5, atol=1e-4 * abs(stress).max())
        if kind != "membrane":
            assert np.allclose(data["director"], [0, -1, 0], atol=1e-6)
    assert np.allclose(grid.cell_data["warp"], F[:, 0], atol=1e-6)
    assert np.allclose(grid.cell_data["weft"], F[:, 1], atol=1e-6)
    array = grid.GetCellData().GetArray("stress_Pa")
    assert [array.GetComponentName(k) for k in range(3)] == ["S11", "S22", "S12"]
    assert grid.field_data["TimeValue"] == 0.25 and grid.field_data["title"][0] == "pulled"
    # cells and nodes are numbered alike on any number of ranks
    whole = Whole(alone.displacement().function_space)
    assert np.array_equal(grid.cells.reshape(grid.n_cells, -1)[:, 1:], whole.cells)
    assert np.allclose(x, whole.points, atol=1e-14)


@pytest.mark.skipif(system.can_draw() is not None, reason="nothing can draw here")
def test_fields_can_be_drawn(tmp_path, monkeypatch):
    """By PyVista's and ParaView's reader of the collection, with plain VTK cells, coloured by a component."""
    cloth = stretched(MPI.COMM_SELF, "regge")
    writer = fields.Fields(tmp_path, cloth.displacement())
    for t in (0.0, 0.5, 1.5):
        writer.write(t, **cell_values(cloth))
    found = pyvista.get_reader(tmp_path / "fields.pvd")
    assert found.time_values == [0.0, 0.5, 1.5]
    found.set_active_time_value(1.5)
    grid = found.read()[0]
    assert set(grid.celltypes) == {22}
    plotter = pyvista.Plotter(off_screen=True, window_size=(200, 200))
    plotter.add_mesh(grid.warp_by_vector("displacement_m"), scalars="stress_Pa", component=0)
    image = plotter.screenshot(return_img=True)
    plotter.close()
    assert 0.05 < (image[..., 0] != image[0, 0, 0]).mean() < 0.95


def test_a_recorder_without_a_folder_keeps_a_table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cloth = stretched(MPI.COMM_SELF, "membrane")
    with Recorder(cloth, None, lambda step: {"load": step.load}) as record:
        for k in (1, 2):
            row = record(Step(k, k / 2, 3, 0, 0.1), more_m=0.5)
    assert row == {"load": 1.0, "more_m": 0.5, "newton_iterations": 3, "step_cuts": 0, "wall_s": 0.1}
    assert list(record.table.column("load")) == [0.5, 1.0] and not list(tmp_path.iterdir())


# --- going on


def history(folder):
    """Its rows."""
    with open(folder / "history.csv", newline="") as file:
        return list(csv.DictReader(file))


def scene(folder, text=MOTION):
    """A scene, read from a file of its own."""
    path = folder / "scene.toml"
    path.write_text(text)
    return scenes.read(path)


def same(one, other):
    """Whether two folders hold the same steps, to the last bit."""
    rows = [[{k: v for k, v in row.items() if k != "wall_s"} for row in history(f)] for f in (one, other)]
    steps = [[(time, path.read_bytes()) for time, path in fields.index(f)] for f in (one, other)]
    return rows[0] == rows[1] and steps[0] == steps[1]


@pytest.fixture
def interrupted(monkeypatch):
    """Runs a scene until the step after which a stop is asked for."""

    def run(said, out, after, resume=None):
        seen = Recorder.__call__

        def stop(self, step, **more):
            row = seen(self, step, **more)
            if step.number == after:
                os.kill(os.getpid(), signal.SIGINT)
            return row

        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(Recorder, "__call__", stop)
            scenes.run(said, out, False, resume)

    return run


@pytest.mark.parametrize("text", [STATIC, MOTION], ids=["statics", "motion"])
def test_a_run_that_goes_on_appends(interrupted, tmp_path, text):
    """Stopped twice and gone on with in its folder: as without a stop; no row twice, none lost."""
    said, whole, out = scene(tmp_path, text), tmp_path / "whole", tmp_path / "out"
    for folder in whole, out:
        results.folder(folder)
    scenes.run(said, whole, False)
    interrupted(said, out, 3)
    assert len(history(out)) == len(fields.index(out)) == 3
    interrupted(said, out, 5, out / "checkpoint.npz")
    scenes.run(said, out, False, True)
    assert len(history(out)) == 8 and same(whole, out)


def test_a_step_stands_in_one_history_only(interrupted, tmp_path):
    """Gone on with in another folder, what was seen is in the first, what comes is in the second."""
    said, first, second = scene(tmp_path), tmp_path / "first", tmp_path / "second"
    for folder in first, second:
        results.folder(folder)
    interrupted(said, first, 3)
    scenes.run(said, second, False, first / "checkpoint.npz")
    times = [float(row["time_s"]) for folder in (first, second) for row in history(folder)]
    assert np.allclose(times, 0.005 * np.arange(1, 9)), times


def test_what_is_later_than_the_checkpoint_comes_again_once(interrupted, tmp_path, monkeypatch):
    """As after a SIGKILL: rows and fields are ahead of the last checkpoint."""
    said, whole, out = scene(tmp_path), tmp_path / "whole", tmp_path / "out"
    for folder in whole, out:
        results.folder(folder)
    scenes.run(said, whole, False)
    interrupted(said, out, 3)
    shutil.copy(out / "checkpoint.npz", tmp_path / "kept.npz")
    interrupted(said, out, 6, out / "checkpoint.npz")
    with open(out / "history.csv", "a") as file:
        file.write("0.035,-0.0")  # a torn row
    shutil.copy(tmp_path / "kept.npz", out / "checkpoint.npz")
    scenes.run(said, out, False, out / "checkpoint.npz")
    assert same(whole, out)


def test_nothing_is_emptied_before_the_run_goes_on(interrupted, tmp_path, monkeypatch):
    """A checkpoint of another scene, and a run that fails in its first step, leave all that was there."""
    said, out = scene(tmp_path), results.folder(tmp_path / "out")
    scenes.run(said, out, False)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file() and path.name != "checkpoint.npz"}
    with pytest.raises(InputError, match="it was made with"):
        scenes.run(scene(tmp_path, MOTION.replace("blend", "denim")), out, False, out / "checkpoint.npz")
    with monkeypatch.context() as patch, pytest.raises(StepFailed):
        patch.setattr(step.MovingSolver, "solve", failing)
        scenes.run(said, out, False)
    assert before == {path: path.read_bytes() for path in before}
    # a run anew replaces all of it
    scenes.run(scene(tmp_path, MOTION.replace("end_s = 0.04", "end_s = 0.01")), out, False)
    assert len(history(out)) == len(fields.index(out)) == len(list((out / "fields").iterdir())) == 2


def failing(self):
    """In place of a solver's `solve`."""
    raise StepFailed("no")


def test_other_columns_are_not_appended(tmp_path):
    cloth = stretched(MPI.COMM_SELF, "membrane")
    for name, until in (("load", None), ("force_N", 5.0)):
        table = results.Table(tmp_path / "history.csv", cloth.domain.mesh.comm, until=until)
        if until is None:
            table.row(step=1, **{name: 0.5})
    with pytest.raises(InputError, match=r"history.csv has the columns step, load, and a row of step, force_N"):
        table.row(step=2, force_N=1.0)
    assert [row["step"] for row in history(tmp_path)] == ["1"]


# --- a full disk

FULL = """
import resource, sys
from pathlib import Path
from fabric_fenicsx.app import command
from fabric_fenicsx import scenes
from fabric_fenicsx.output import results
said, out, size = scenes.read(Path(sys.argv[1])), Path(sys.argv[2]), int(sys.argv[3])
before = out.with_name("before")
results.folder(out)
results.folder(before)
def main():
    scenes.run(said, before, False)  # what is compiled is kept in files, too
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
    scenes.run(said, out, False)
command.run(main)
"""


@pytest.mark.parametrize(
    ("size", "name", "ranks"), [(6000, "000000.vtu", 2), (30_000, "checkpoint.npz", 1), (30_000, "checkpoint.npz", 2)]
)
def test_a_file_that_cannot_grow_ends_the_run_in_a_sentence(tmp_path, ranks, size, name):
    """A limit on the size of files takes a part of what is written, as a full disk does."""
    scene(tmp_path)
    words = ["-c", FULL, tmp_path / "scene.toml", tmp_path / "out", size]
    if ranks == 2:
        answer = test_demos.python_on_two_ranks(*words, timeout=100)
    else:
        answer = subprocess.run([sys.executable, *map(str, words)], capture_output=True, text=True, timeout=100)
    assert answer.returncode == 2, answer.stderr
    (line,) = (line for line in answer.stderr.splitlines() if "error" in line.lower())
    assert line.startswith("error: ") and name in line and "File too large" in line
    assert all(row["wall_s"] for row in history(tmp_path / "out")), "no row in part"
    if name != "000000.vtu":
        for _, path in fields.index(tmp_path / "out"):
            assert read(path).n_cells == 16
    else:
        assert not (tmp_path / "out" / "fields.pvd").exists()
    assert not [path for path in (tmp_path / "out").rglob(".*") if path.is_file()], "nothing rough is left"


@pytest.mark.skipif(os.getuid() != 0, reason="only root can mount a small disk")
def test_a_full_disk_keeps_the_last_good_files(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=72k", "tmpfs", str(disk)], capture_output=True)
    if mounted.returncode:
        pytest.skip("no disk can be mounted here")
    try:
        with pytest.raises(InputError, match=r"disk/.* cannot be written \(No space left on device\)"):
            scenes.run(scene(tmp_path), disk, False)
        steps = fields.index(disk)
        assert 2 <= len(steps) < 8 and all(read(path).n_cells == 16 for _, path in steps)
        assert len(steps) <= len(history(disk)) <= len(steps) + 1
    finally:
        subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.parallel
def test_every_rank_is_told(tmp_path, monkeypatch):
    """A row that cannot be added, a step, a picture: the same sentence everywhere, and what was good is there."""
    folder, cloth = shared(tmp_path), stretched(COMM, "membrane")
    table, writer = results.Table(folder / "history.csv", COMM), fields.Fields(folder, cloth.displacement())
    table.row(step=1)
    writer.write(1.0, **cell_values(cloth))
    COMM.barrier()
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    def full(path, content):
        raise OSError(28, "No space left on device", str(path))

    for name in "append", "replace":
        monkeypatch.setattr(files, name, full)
    for write, name in (
        (lambda: table.row(step=2), "history.csv"),
        (lambda: writer.write(2.0, **cell_values(cloth)), "000001.vtu"),
    ):
        with pytest.raises(InputError, match=rf"{name} cannot be written \(No space left on device\); make room"):
            write()
    COMM.barrier()
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_file_is_there_in_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    files.replace(path, "good")
    with pytest.raises(RuntimeError), files.whole(path) as rough:
        rough.write_text("half")
        raise RuntimeError
    assert path.read_text() == "good" and list(tmp_path.iterdir()) == [path]
    files.append(path, " and more")
    assert path.read_text() == "good and more"
    with pytest.raises(OSError, match=r"gone/a\.txt"):
        files.replace(tmp_path / "gone" / "a.txt", "x")
    full = tmp_path / "full"
    full.symlink_to("/dev/full")
    with pytest.raises(OSError, match=r"No space left on device: '.*/full'"):
        files.append(full, "x")


# --- what is seen of it


@pytest.fixture(scope="module")
def fall(tmp_path_factory):
    """The folder of a run of eight steps."""
    folder = tmp_path_factory.mktemp("fall")
    scenes.run(scene(folder), folder, False)
    return folder


@pytest.mark.skipif(system.can_draw() is not None, reason="nothing can draw here")
@pytest.mark.parametrize(("fault", "number"), [("empty", 7), ("cut", 3), ("missing", 7), ("byte", 3)])
def test_a_broken_step_is_named_and_the_others_are_shown(fall, tmp_path, fault, number, capfd, monkeypatch):
    out = tmp_path / "out"
    shutil.copytree(fall, out)
    path = out / "fields" / f"{number:06d}.vtu"
    text = path.read_bytes()
    at = text.index(b'Name="strain"') + 400
    broken = {"empty": b"", "cut": text[:300], "byte": text[:at] + (b"A" if text[at] != 65 else b"B") + text[at + 1 :]}
    path.unlink()
    if fault != "missing":
        path.write_bytes(broken[fault])
    found = series.Series(out)
    with pytest.raises(InputError, match=rf"{number:06d}.vtu' cannot be read \("):
        found.shape(number, "yarn")
    assert found.last() == (6 if number == 7 else 7)
    drawn = []
    monkeypatch.setattr(pictures, "page", lambda *words, **more: np.zeros((8, 8, 3)))
    monkeypatch.setattr(series, "_write_film", lambda path, pages, seconds: drawn.append(len(pages)))
    assert found.film(out / "a.gif") == [number] and drawn == [7]
    assert "vtk" not in capfd.readouterr().err.lower(), "VTK says nothing of its own"


@pytest.mark.skipif(system.can_draw() is not None, reason="nothing can draw here")
def test_a_film_ends_with_the_last_step(fall, monkeypatch):
    titles = []
    monkeypatch.setattr(pictures, "page", lambda s, label, title, **more: titles.append(title) or np.zeros((8, 8, 3)))
    monkeypatch.setattr(series, "_write_film", lambda *words, **more: None)
    for most in (2, 3, 5, 8, 50):
        titles.clear()
        series.Series(fall).film(fall / "a.gif", most=most)
        assert len(titles) == min(most, 8)
        assert titles[0] == "a fall, t = 0.005 s" and titles[-1] == "a fall, t = 0.04 s"


def test_an_mp4_is_refused_where_none_can_be_written(fall):
    import importlib.util

    if importlib.util.find_spec("imageio_ffmpeg") is None:
        with pytest.raises(InputError, match=r"pip install 'fabric_fenicsx\[film\]'"):
            series.Series(fall).film(fall / "a.mp4")
    with pytest.raises(InputError, match=r"\.gif or a \.mp4, not 'a.avi'"):
        series.Series(fall).film(fall / "a.avi")


def test_colours_of_both_signs_part_at_zero():
    low, high, name = pictures.scale(-0.01, 0.04)
    assert (low, high, name) == (-0.04, 0.04, "coolwarm")
    assert pictures.scale(-1e-9, 0.04)[2] == pictures.scale(0.01, 0.04)[2] == "viridis"
    assert pictures.scale(0.02, 0.02 + 1e-9) == (0.0, 0.02 + 1e-9, "viridis")
    assert pictures.scale(0.01, 0.04)[:2] == (0.01, 0.04)


@pytest.mark.skipif(system.can_draw() is not None, reason="nothing can draw here")
def test_a_sheet_in_space_has_a_scale(fall):
    """The bar below it is as long as it says: the sheet of 1 m, seen from above, is as wide as its edge."""
    shape = series.Series(fall).shape(-1, "yarn")
    shape.yarns, shape.moved = None, 0 * shape.moved
    page = pictures.page(shape, "a value", view=(0, 0, 1.0)).astype(int)
    dark = page.max(axis=2) < 60
    (bar,) = (row[:400] for row in dark[[page.shape[0] - 78 - 1]])
    width = np.ptp(np.flatnonzero(bar)) + 1
    edge = max(np.ptp(np.flatnonzero(row)) for row in dark[150:700] if row.sum() > 100)
    assert width / edge == pytest.approx(0.2, rel=0.03)


@pytest.mark.skipif(system.can_draw() is not None, reason="nothing can draw here")
def test_a_limb_hides_the_far_side_of_what_is_worn_on_it():
    tube = pyvista.CylinderStructured(
        radius=[0.05], height=0.2, direction=(0, 0, 1), theta_resolution=24, z_resolution=9
    )
    grid = tube.cast_to_unstructured_grid()
    limb = pyvista.Cylinder(radius=0.045, height=1.0, direction=(0, 0, 1), resolution=60).triangulate()
    shape = pictures.Shape(3, grid.cells, grid.celltypes, grid.points, 0 * grid.points, np.arange(grid.n_cells) * 1.0)
    shape.bodies = [(limb.points, limb.regular_faces)]
    page = pictures.page(shape, "a value", view=(0, 0.7, 0.7)).astype(int)
    coloured = np.ptp(page, axis=2) > 40
    rim = np.flatnonzero(coloured.any(axis=1))[0]  # that of the far side, beside the limb
    front = np.flatnonzero(coloured[:, 600])[0]
    assert 450 > front > rim + 50 and coloured[front : front + 200, 600].mean() > 0.9


def test_progress_in_a_file_is_whole_lines(capsys, monkeypatch):
    monkeypatch.setattr(continuation.Lines, "every", 0.0)
    with continuation.progress_bar(2, "a strip", MPI.COMM_SELF) as bar:
        for k in (1, 2):
            bar.set_postfix(load=k, refresh=False)
            bar.update()
    assert capsys.readouterr().err == "a strip: 1 of 2 steps, load=1\na strip: 2 of 2 steps, load=2\n"
    monkeypatch.setattr(continuation.Lines, "every", 1e9)
    with continuation.progress_bar(1, "a strip", MPI.COMM_SELF) as bar:
        bar.update()
    with continuation.progress_bar(1, None, MPI.COMM_SELF) as bar:
        bar.update()
    assert capsys.readouterr().err == ""
