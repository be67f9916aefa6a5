"""From photographs to a fabric and back: a simulated strip is photographed, and gives its own fabric again.

Warp, weft and bias tests of demos/tensile.py are simulated; their strip, with a grid of dots, is drawn as a tilted
camera sees it, blurred, with noise and in changing light, and a checkerboard in its plane. The photographs go through
`fabric-fenicsx markers`, with the record of force, and what that writes through `fabric-fenicsx identify`.

The checked numbers: Poisson's ratios come back within 3 %, the shear curve within 5 % of its peak, the curves of warp
and weft within 3 %.
"""

import argparse
import os
from pathlib import Path

import identify as round_trip
import numpy as np
import tensile
from mpi4py import MPI
from scipy import ndimage

from fabric_fenicsx import fabrics
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify import making as identifying
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.photographs import making
from fabric_fenicsx.system import can_draw

TESTS = {"warp": 0.0, "weft": 90.0, "bias": 45.0}
ACCEPTED = {"nu12": 3.0, "nu21": 3.0, "warp_curve": 3.0, "weft_curve": 3.0, "shear_curve": 5.0}
TEXTURE = 25  # pixels for a mm of the cloth
DOT, SPACING, DOTS = 1.6, 4.8, (8, 4)  # mm, mm, and how many
BOARD, SQUARE = (13, 6), 6.0  # inner corners, and mm
FINER = 2  # so many pixels across are drawn for each one of a photograph


class Camera:
    """Photographs what lies in the plane z = 0; lengths in m, pixels across of its pictures."""

    def __init__(self, pixels, middle, width, tilt, noise, rng):
        """It sees `width` about `middle` (2,), tilted by so many degrees about both axes of the picture."""
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        import pyvista

        pyvista.OFF_SCREEN = True
        self.size, self.noise, self.rng = (pixels, round(0.42 * pixels)), noise, rng
        self.plotter = pyvista.Plotter(window_size=[FINER * n for n in self.size])
        self.plotter.background_color = (0.3, 0.3, 0.3)
        camera, a = self.plotter.camera, np.radians(tilt)
        camera.view_angle = 12.0
        far = width * self.size[1] / pixels / 2 / np.tan(np.radians(6.0))
        camera.focal_point = (*middle, 0.0)
        camera.position = np.array([*middle, 0.0]) + far * np.array([np.sin(a), -np.sin(a), np.cos(a)])
        camera.up = (0.0, 1.0, 0.0)

    def see(self, mesh, image):
        """Have nothing in sight but a mesh with texture coordinates that wears an image (rows, columns, 3)."""
        import pyvista

        self.plotter.clear_actors()
        self.plotter.add_mesh(mesh, texture=pyvista.Texture(image), lighting=False, show_scalar_bar=False)

    def photograph(self, path, level=1.0, lamp=0.0):
        """Write a photograph; light: its level, and how much it changes from left to right."""
        from PIL import Image

        self.plotter.renderer.ResetCameraClippingRange()
        self.plotter.render()
        fine = np.asarray(self.plotter.screenshot(return_img=True))[..., 0] / 255.0
        light = fine.reshape(self.size[1], FINER, self.size[0], FINER).mean(axis=(1, 3))
        light = ndimage.gaussian_filter(light, 0.8) * level * (1 + lamp * np.linspace(-0.5, 0.5, self.size[0]))
        light += self.noise * self.rng.standard_normal(light.shape)
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.round(255 * np.clip(light, 0, 1)).astype(np.uint8)).save(path)


def dotted(length, width):
    """The cloth of a strip (m) with its dots: an image (rows, columns, 3)."""
    columns, rows = round(1e3 * length * TEXTURE), round(1e3 * width * TEXTURE)
    x, y = (np.arange(columns) + 0.5) / TEXTURE - 500 * length, (np.arange(rows) + 0.5) / TEXTURE - 500 * width
    near = []
    for at, count in ((x, DOTS[0]), (y, DOTS[1])):
        cell = np.clip(np.round(at / SPACING + (count - 1) / 2), 0, count - 1)
        near.append(at - (cell - (count - 1) / 2) * SPACING)
    depth = DOT / 2 - np.hypot(*np.meshgrid(*near))
    light = 0.8 - 0.6 * np.clip(0.5 + depth * TEXTURE, 0, 1)
    return np.repeat(np.round(255 * light).astype(np.uint8)[..., None], 3, axis=2)


def board(middle):
    """A checkerboard about a place (m), and its image."""
    import pyvista

    squares = np.array(BOARD) + 1
    j, i = np.meshgrid(np.arange(-1, squares[0] + 1), np.arange(-1, squares[1] + 1))
    white = ((i + j) % 2 == 1) | (i < 0) | (j < 0) | (i == squares[1]) | (j == squares[0])
    image = np.kron(np.where(white, 230, 25).astype(np.uint8), np.ones((40, 40), dtype=np.uint8))
    size = 1e-3 * SQUARE * (squares + 2)
    plane = pyvista.Plane(center=(*middle, 0.0), i_size=size[0], j_size=size[1], i_resolution=1, j_resolution=1)
    return plane, np.repeat(image[..., None], 3, axis=2)


def cloth(shape, length, width):
    """A strip, as it is now, as a surface that takes the image of `dotted`."""
    import pyvista

    grid = pyvista.UnstructuredGrid(shape.cells, shape.kinds, shape.points + shape.moved)
    grid["place"] = shape.points[:, :2] / (length, width)
    surface = grid.extract_surface(nonlinear_subdivision=3, algorithm="dataset_surface").triangulate()
    surface.active_texture_coordinates = np.asarray(surface["place"])
    return surface


def simulate(case):
    """Record (displacement in mm, force in N) of a test, and the strip's shape after each step, at rest first."""
    strip = tensile.strip(case, MPI.COMM_SELF)
    shapes = [pictures.shape(strip.u, np.zeros(strip.points.strain.shape[0]))]

    def watch(step, points):
        shapes.append(pictures.shape(strip.u, np.zeros(strip.points.strain.shape[0])))

    table, _, stopped = tensile.run(case, comm=MPI.COMM_SELF, watch=watch, scene=strip)
    if stopped:
        raise InputError(f"{case.fabric.name} at {case.angle:g} degrees: {stopped}")
    rows = np.column_stack([table.column("displacement_mm"), table.column("force_N")])
    return np.vstack([np.zeros(2), rows]), shapes


def photograph(camera, case, rows, shapes, folder, every):
    """Photographs of every so many shapes, whose paths are returned, and machine.csv, the record that names them."""
    length, width = case.fabric.gauge_length, case.fabric.width
    image = dotted(length, width)
    lines, taken = ["photograph,displacement_mm,force_N"], []
    for k, (shape, (d, force)) in enumerate(zip(shapes, rows, strict=True)):
        name = ""
        if k % every == 0 or k == len(shapes) - 1:
            name, part = f"{k:03d}.png", k / len(shapes)
            camera.see(cloth(shape, length, width), image)
            taken.append(folder / name)
            camera.photograph(taken[-1], 1 - 0.3 * part, 0.3 * (part - 0.5))
        lines.append(f"{name},{d:.6g},{force:.6g}")
    (folder / "machine.csv").write_text("\n".join(lines) + "\n")
    camera.see(*board((0.55 * length, width / 2)))
    camera.photograph(folder.parent / "board.png")
    return taken


def measure(taken, out, warp):
    """The file of the marks of photographs; warp: degrees from the load to it."""
    folder = taken[0].parent
    seen = making.Settings(record=folder / "machine.csv", warp=warp, checkerboard=folder.parent / "board.png",
                           corners=BOARD, square=SQUARE)  # fmt: skip
    return making.make(taken, results.folder(out, MPI.COMM_SELF), seen, command.say)


def listed(fabric, files, path):
    """The list of tests, with the files of the marks by test."""
    names = "\n".join(f'{way} = ["{os.path.relpath(file, path.parent)}"]' for way, file in files.items())
    dots = "\n".join(f'{way}_dots = ["{os.path.relpath(files[way], path.parent)}"]' for way in ("warp", "weft"))
    path.write_text(
        f'name = "{fabric.name} again"\nlabel = "{fabric.label}"\nmaterial = "{fabric.material}"\n'
        f'weave = "{fabric.weave}"\nthickness_mm = {1e3 * fabric.thickness:g}\n'
        f"density_kg_per_m3 = {fabric.density:g}\ngauge_length_mm = {1e3 * fabric.gauge_length:g}\n"
        f'width_mm = {1e3 * fabric.width:g}\nsource = "photographs of simulated strips of {fabric.name}"\n'
        f"[records]\n{names}\n{dots}\n"
    )
    return path


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--fabric", default="blend", help=f"{', '.join(fabrics.names())}, or a TOML file")
    parser.add_argument("--pixels", type=command.positive, default=1000, help="across a photograph")
    parser.add_argument("--tilt", type=command.number, default=8.0, help="of the camera, degrees about both axes")
    parser.add_argument("--noise", type=command.number, default=0.015, help="standard deviation, over white")
    parser.add_argument("--steps", type=command.positive, default=24, help="of each test up, and as many down")
    parser.add_argument("--every", type=command.positive, default=2, help="photograph every so many of them")
    parser.add_argument("--cells", type=command.grid, default="12x4", help="along and across the strip")
    parser.add_argument("--seed", type=int, default=0, help="of the noise")
    parser.add_argument("--out", type=Path, default=Path("out/photographs"))
    return command.parse(parser)


def main():
    args = arguments()
    if MPI.COMM_WORLD.rank > 0:  # nothing here is large enough to share
        return 0
    if (fault := can_draw()) is not None:
        raise InputError(fault)
    fabric, out, files = fabrics.load(args.fabric), results.folder(args.out, MPI.COMM_SELF), {}
    rng = np.random.default_rng(args.seed)
    for way, angle in TESTS.items():
        case = tensile.Case(fabric, angle, cells=args.cells, steps=args.steps, ends="free")
        rows, shapes = simulate(case)
        width = 1.05 * (fabric.gauge_length + max(fabric.displacement.values()))
        camera = Camera(args.pixels, (0.48 * width, fabric.width / 2), width, args.tilt, args.noise, rng)
        folder = results.folder(out / way / "photos", MPI.COMM_SELF)
        taken = photograph(camera, case, rows, shapes, folder, args.every)
        camera.plotter.close()
        command.say(f"{way}:")
        files[way] = measure(taken, out / way, angle)
    tests = listed(fabric, files, out / "tests.toml")
    _, again = identifying.make(tests, out, mesh=tensile.STRIP, ends="free", say=command.say)
    miss = round_trip.recovery(fabric, again)
    right = all(abs(miss[key]) <= accepted for key, accepted in ACCEPTED.items())
    command.say("off by " + ", ".join(f"{key} {miss[key]:+.2f} %" for key in ACCEPTED))
    command.say(f"check: ratios and curves within 3 %, shear within 5 %: {'yes' if right else 'NO'}; see {out}")
    return 0 if right else 1


if __name__ == "__main__":
    command.run(main)
