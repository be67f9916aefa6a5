"""The thesis's tests of strips and sheets at rest (7.2, 7.3.1), as plain numbers, columns and pictures.

Every function here takes settings that JSON can hold, and gives back what JSON can hold; see `cases`.
"""

import base64
import io
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import biaxial
import law_steps
import numpy as np
import simple_shear
import tensile
from mpi4py import MPI

from fabric_fenicsx import fabrics
from fabric_fenicsx.laws import named
from fabric_fenicsx.output import pictures

warnings.filterwarnings("ignore", message=".*beyond the measured")  # the sections say it
LAWS = named.THESIS
WAYS = {way: angle for angle, way in tensile.WAYS.items()}


def columns(table):
    """A `results.Table` as lists."""
    return {name: table.column(name).tolist() for name in table.rows[0]} if table.rows else {}


def thumbnail(path, width=560):
    """A png file, made smaller and of few colours, as text for a page; None where pictures cannot be drawn."""
    from PIL import Image

    if not path.exists():
        return None
    data = io.BytesIO()
    with Image.open(path) as full:
        small = full.convert("RGB").resize((width, round(width * full.height / full.width)), Image.Resampling.LANCZOS)
    small.quantize(128, dither=Image.Dither.NONE).save(data, "png", optimize=True)
    return base64.b64encode(data.getvalue()).decode()


def draw(*words, by=pictures.picture, **more):
    """What `by` draws, as text for a page."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        by(path, *words, **more)
        return thumbnail(path)


def test(case, shots=()):
    """One tensile test: its history, the step at the highest load, how it ended, and pictures after some steps.

    shots: numbers of steps, -1 for the last one.
    """
    scene, views = tensile.strip(case), {}
    shown = tensile.sheet(case, scene[0], scene[2])

    def shoot(name, load):
        title = f"{case.fabric.name}, warp at {case.angle:g} degrees, {load * 1e3:.3g} mm"
        views[name] = draw(case, shown, title, by=tensile.picture)

    def watch(step, points):
        if step.number in shots:
            shoot(str(step.number), step.load)

    table, peak, stopped = tensile.run(case, scene=scene, watch=watch)
    if -1 in shots:
        shoot("last", table.rows[-1]["displacement_mm"] * 1e-3)
    top = {name: float(value) for name, value in table.rows[min(peak, len(table.rows)) - 1].items()}
    return {
        "history": columns(table),
        "peak": peak,
        "top": top,
        "stopped": stopped,
        "stopped_on_the_way_up": bool(stopped) and len(table.rows) < peak,
        "displacement_mm": case.displacement * 1e3,
        "pictures": views,
    }


def cycles(fabric, steps, cells, element="bilinear", kinds=("measured",), laws=("continuous", "printed"), shots=()):
    """Cyclic tests along warp and weft between clamps, and in bias with ends that may contract.

    element: bilinear in the plane, regge for the default shell; kinds: of Poisson's ratios.
    shots: "warp", "bias", ... whose pictures are wanted, at the start, at the peak and at the end.
    """
    given, found = fabrics.load(fabric), {}
    shape = {"kinematics": "shell", "triangles": True} if element == "regge" else {}
    for way, angle in WAYS.items():
        ends = "free" if way == "bias" else "clamped"
        for poisson in kinds:
            for law in laws:
                case = tensile.Case(given, angle, law, poisson, tuple(cells), degree=1, steps=steps, ends=ends, **shape)
                wanted = (1, steps, -1) if way in shots and law == "continuous" else ()
                found[f"{way} {poisson} {law}"] = test(case, wanted)
    return found


def clamped(fabric, steps, cells):
    """Cyclic tests along the yarns between clamps, of quadratic cells, with every law that was fitted to a fabric."""
    given = fabrics.load(fabric)
    return {
        f"{way} {law}": test(tensile.Case(given, WAYS[way], law, cells=tuple(cells), steps=steps))
        for way in ("warp", "weft")
        for law in named.MEASURED
    }


def off_axis(fabric, steps, angles, meshes, shots=False):
    """Cyclic tests with the warp at some angles to the load, the ends free to contract; meshes: cells of each."""
    given, found = fabrics.load(fabric), {}
    for angle in angles:
        for cells in meshes:
            for law in LAWS if cells == meshes[0] else ("continuous",):
                case = tensile.Case(given, float(angle), law, cells=tuple(cells), degree=1, steps=steps, ends="free")
                wanted = (1, steps) if shots and angle == 30 and law == "continuous" and cells == meshes[0] else ()
                found[f"{angle} {'x'.join(map(str, cells))} {law}"] = test(case, wanted)
    return found


def reload(fabric, steps):
    """Warp test that goes to 75, back to 70, and on to 100 % of its way, and then down."""
    given = fabrics.load(fabric)
    return {
        f"{ends} {law}": test(tensile.Case(given, 0.0, law, steps=steps, ends=ends, reload=True, **tensile.THESIS))
        for ends in ("clamped", "free")
        for law in LAWS
    }


def buckled(fabric, steps, cells, height_mm):
    """Warp test of a shell strip that is not quite flat, pushed back to where it began."""
    case = tensile.Case(
        fabrics.load(fabric), law="continuous", steps=steps, cells=tuple(cells), kinematics="shell",
        imperfection=height_mm * 1e-3, whole=True,
    )  # fmt: skip
    scene, views = tensile.strip(case), {}
    shown, heights = tensile.sheet(case, scene[0], scene[2]), []

    def watch(step, points):
        heights.append(1e3 * float(np.abs(shown.displacement().x.array[2::3]).max()))
        if step.number in (1, steps) or step.load == 0.0:
            title = f"{case.fabric.name}, {step.load * 1e3:.3g} mm"
            view = draw(case, shown, title, by=tensile.picture, view=(0.5, -2.0, 0.9))
            views[f"{step.load * 1e3:.3g} mm"] = view

    table, peak, stopped = tensile.run(case, scene=scene, watch=watch)
    return {
        "history": columns(table) | {"height_mm": heights},
        "peak": peak,
        "stopped": stopped,
        "pictures": views,
    }


def shear(fabric, cycle, steps):
    """Cyclic simple shear of nine elements, with both laws."""
    given, found = fabrics.load(fabric), {}
    for law, kind in LAWS.items():
        table, stress, _, stopped = simple_shear.run(given, kind(given), cycle, steps)
        found[law] = {"history": columns(table), "stress_error": float(stress), "stopped": stopped}
    return found


def stretch(fabric, steps, displacement_mm):
    """Equibiaxial strain of the square sheet, up and down, with both laws."""
    given, found = fabrics.load(fabric), {}
    for law, kind in LAWS.items():
        table, stress, _, stopped = biaxial.run(given, kind(given), steps, displacement_mm * 1e-3)
        found[law] = {"history": columns(table), "stress_error": float(stress), "stopped": stopped, "peak": steps}
    return found


def ratios(fabric, steps, values):
    """The parametric study behind Table 7.4: 27 elements along warp and weft, with nu12 = nu21 of each value."""
    known, found = fabrics.load(fabric), {}
    for nu in values:
        given = replace(known, poisson={"measured": (nu, nu), "lowered": (nu, nu)})
        for way in "warp", "weft":
            for law in LAWS:
                done = test(tensile.Case(given, WAYS[way], law, steps=steps, **tensile.THESIS))
                fitted = getattr(known, way).stress(done["top"]["axial_strain"]) / 1e6
                found[f"{nu:g} {way} {law}"] = {
                    "stopped": done["stopped"],
                    "complete_up": not done["stopped_on_the_way_up"],
                    "above_fit_percent": float(100 * (done["top"]["axial_stress_MPa"] / fitted - 1)),
                }
    return found


def increments(fabric, counts):
    """Peak stress of the six tensile tests by the printed law, with so many steps, against the continuous law's."""
    given, found = fabrics.load(fabric), {}
    for way, angle in WAYS.items():
        for ends in "free", "clamped":
            peaks = {}
            for law in LAWS:
                case = tensile.Case(given, angle, law, ends=ends, **tensile.THESIS)
                scene = tensile.strip(case)
                steps = counts if law == "printed" else [counts[0], counts[-1]]
                peaks[law], _ = law_steps.study(case, scene, steps, MPI.COMM_WORLD)
            finest = peaks["continuous"][-1]
            error = 100 * (peaks["printed"] / finest - 1)
            found[f"{way} {ends}"] = {
                "steps": list(counts),
                "error_percent": [None if np.isnan(e) else float(e) for e in error],
                "continuous_error_percent": float(100 * (peaks["continuous"][0] / finest - 1)),
            }
    return found
