"""Pictures of a sheet, all of one look.

Undeformed outline in black, the deformed sheet coloured by one value a cell, and at a few places an arrow along the
warp (red, long) and one along the weft (black, short), on the side of the eye. Values of both signs have colours that
part at zero. A sheet in space stands beside a length to scale and the directions of the axes.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem

from .. import files
from ..laws import Array
from ..system import can_draw
from . import results, solids
from .gathering import Whole
from .solids import Solid

VIEW = (1.0, -2.0, 1.2)
"""From the sheet to the eye."""
BESIDE = 0.1
"""How far around a sheet its bodies are in sight, as a part of its diagonal."""
SIGNED = 0.02
"""Values have both signs if those of the rarer one reach this part of the others."""


@dataclass
class Shape:
    """A sheet as it is drawn, of all ranks: cells and points as VTK wants them."""

    dim: int
    cells: np.ndarray
    kinds: np.ndarray
    points: Array
    """Where the nodes were (n, 3), m."""
    moved: Array
    """Their displacement (n, 3), m."""
    values: Array
    """Of each cell (cells, any number)."""
    yarns: Array | None = None
    """Warp and weft of each cell as they are now (cells, 2, 3)."""
    title: str = ""
    view: tuple[float, float, float] = VIEW
    bodies: Sequence[tuple[Array, np.ndarray]] = ()
    """Corners of each body now (n, 3), m, and its triangles (m, 3)."""

    def in_sight(self) -> Array:
        """Places that a picture has to show (n, 3): the sheet, at rest and now, and of bodies what is near to it."""
        own = np.concatenate([self.points, self.points + self.moved])
        low, high = own.min(axis=0), own.max(axis=0)
        margin = BESIDE * np.linalg.norm(high - low)
        return np.concatenate([own, *(np.clip(x, low - margin, high + margin) for x, _ in self.bodies)])


def shape(u: fem.Function, values: Array, yarns: Array | None = None) -> Shape | None:
    """Gather a displacement and what belongs to each local cell; on rank 0, None elsewhere."""
    whole = Whole(u.function_space)
    gathered = whole(u, {"values": values} | ({} if yarns is None else {"yarns": yarns}))
    if gathered is None:
        return None
    moved, cells = gathered
    count, nodes = whole.cells.shape
    flat = np.insert(whole.cells, 0, nodes, axis=1).ravel()
    kinds = np.full(count, whole.kind, dtype=np.uint8)
    return Shape(whole.dim, flat, kinds, whole.points, moved, cells["values"], cells.get("yarns"))


def picture(
    path: Path,
    u: fem.Function,
    cell_values: Array,
    label: str,
    title: str = "",
    *,
    view: tuple[float, float, float] = VIEW,
    limits: tuple[float, float] | None = None,
    box: tuple[float, ...] | None = None,
    yarns: Array | None = None,
    bodies: Sequence[Solid] = (),
) -> None:
    """Draw the deformed sheet, coloured by cell_values, one for each local cell, over its undeformed outline.

    To be called on every rank; rank 0 draws. `label` names the value with its unit. view: the direction
    from the middle of a sheet in space to the eye; z is up. limits: of the colours, and box: what to
    have in sight (x0, x1, y0, y1, z0, z1), both that of this picture unless given (for frames of a film).
    yarns: as `sheet.Sheet.yarns` gives them, to be shown by arrows. bodies: see `solids.drawn`.
    """
    shown = shape(u, cell_values, yarns)
    if shown is not None:
        shown.bodies = [(body.points, body.faces) for body in bodies]
    results.on_root(
        u.function_space.mesh.comm,
        lambda: draw(path, shown, label, title, view=view, limits=limits, box=box) if shown else None,
    )


def draw(
    path: Path,
    shape: Shape,
    label: str,
    title: str = "",
    *,
    view: tuple[float, float, float] = VIEW,
    limits: tuple[float, float] | None = None,
    box: tuple[float, ...] | None = None,
) -> None:
    """As `picture`, on one rank; says so where pictures cannot be drawn. Raises OSError."""
    fault = can_draw()
    if fault:
        print(fault)
        return
    from PIL import Image

    with files.whole(path) as rough:
        Image.fromarray(page(shape, label, title, view=view, limits=limits, box=box)).save(rough)


def page(
    shape: Shape,
    label: str,
    title: str = "",
    *,
    view: tuple[float, float, float] = VIEW,
    limits: tuple[float, float] | None = None,
    box: tuple[float, ...] | None = None,
) -> np.ndarray:
    """As `draw`, the picture itself (pixels down, pixels across, 3); only where pictures can be drawn."""
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista

    pyvista.OFF_SCREEN = True
    dim = shape.dim
    grid = pyvista.UnstructuredGrid(shape.cells, shape.kinds, shape.points)
    grid["moved"], grid.cell_data[label] = shape.moved, shape.values
    deformed = grid.warp_by_vector("moved")
    low, high, colours = scale(*(limits or deformed.get_data_range(label)))
    plotter = pyvista.Plotter()
    plotter.background_color = "white"
    tips = np.zeros((0, 3))
    if shape.yarns is not None:
        tips = _arrows(plotter, shape, np.array(view if dim == 3 else (0.0, 0.0, 1.0)))
    seen = np.concatenate([shape.in_sight(), tips])
    for x, faces in shape.bodies:
        solids.add(plotter, x, faces)
    low_corner, high_corner = seen.min(axis=0), seen.max(axis=0)
    width, height = (high_corner - low_corner)[:2]
    pixel = max(width / 1100, height / 800) if dim == 2 else None
    above, below = 70, 120  # pixels for the title and the colour bar
    size = (1200, round(height / pixel) + above + below) if pixel else (1200, 900)
    plotter.window_size = size
    outline = grid.extract_feature_edges(feature_edges=False, manifold_edges=False)
    if dim == 2:
        outline.translate((0.0, 0.0, 0.01 * max(width, height)), inplace=True)  # nothing may hide it
    if outline.n_points:  # a closed surface has none
        plotter.add_mesh(outline, color="black", line_width=2)
    # edges are those of the curved cells themselves, and thin: a dense mesh must not hide the colours
    lines = deformed.extract_all_edges()
    if shape.bodies and shape.kinds[0] == 9:
        deformed = solids.as_touched(deformed)
    else:
        deformed = deformed.extract_surface(nonlinear_subdivision=3, algorithm="dataset_surface")
    plotter.add_mesh(lines, color="black", line_width=1, opacity=0.25)
    rim = deformed.extract_feature_edges(feature_edges=False, manifold_edges=False)
    if rim.n_points:
        plotter.add_mesh(rim, color="black", line_width=1)
    actor = plotter.add_mesh(
        deformed,
        scalars=label,
        cmap=colours,
        clim=(low, high),
        show_scalar_bar=False,
        lighting=dim == 3,  # it would darken the colours of a flat sheet
        smooth_shading=True,
        split_sharp_edges=False,
        ambient=0.35 if dim == 3 else 0.0,
        diffuse=0.7,
        specular=0.1,
    )
    # behind the lines that lie in it
    actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2.0, 2.0)
    digits = int(np.clip(np.ceil(np.log10(max(abs(low), abs(high)) / max(high - low, 1e-300) + 1e-9)) + 2, 3, 7))
    bar = {"color": "black", "fmt": f"%.{digits}g", "n_labels": 5, "label_font_size": 20}
    bar |= {"position_x": 0.37, "width": 0.53, "position_y": 15 / size[1], "height": 75 / size[1]}
    plotter.add_scalar_bar(title=" ", mapper=actor.mapper, **bar)
    plotter.add_text(label, position=(40, 25), color="black", font_size=14 if len(label) < 28 else 11)
    plotter.add_text(title, position=(40, size[1] - 45), color="black", font_size=14)
    said = "black line: undeformed" + ("; arrows: warp red, weft black" if shape.yarns is not None else "")
    plotter.add_text(said, position=(1170 - 11 * len(said), size[1] - 40), color="black", font_size=11)
    if pixel:
        plotter.view_xy()
        plotter.enable_parallel_projection()
        middle = (low_corner + high_corner) / 2 + [0.0, (above - below) / 2 * pixel, 0.0]
        plotter.camera.focal_point = middle
        plotter.camera.position = middle + [0.0, 0.0, max(width, height)]
        plotter.camera.parallel_scale = size[1] * pixel / 2
    else:
        if box is not None:
            seen = np.stack(np.meshgrid(*np.reshape(box, (3, 2))), axis=-1).reshape(-1, 3)
        _aim(plotter.camera, seen, np.array(view), size[0] / size[1], 1.0 - (above + below) / size[1])
        _measure(plotter, size[1])
        plotter.camera.SetWindowCenter(0.0, -(below - above) / size[1])
        plotter.renderer.ResetCameraClippingRange()
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(image)[..., :3]


def scale(low: float, high: float) -> tuple[float, float, str]:
    """Limits and name of the colours for values from low to high."""
    if min(-low, high) > SIGNED * max(-low, high):
        most = max(-low, high)
        return -most, most, "coolwarm"
    if high - low <= 1e-4 * max(abs(low), abs(high)):
        # a uniform value: without zero in the range, colours would show its noise
        low, high = min(low, 0.0), max(high, 0.0)
    return low, high, "viridis"


def _aim(camera: Any, points: Array, view: Array, aspect: float, share: float) -> None:
    """Look along -view, from as near as shows all points (n, 3) in this share of the height and most of the width."""
    back = view / np.linalg.norm(view)
    right = np.cross((0.0, 1.0, 0.0) if abs(back[2]) > 0.999 else (0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back])
    at = points @ axes.T
    middle = (at.min(axis=0) + at.max(axis=0)) / 2
    half = np.tan(np.radians(camera.view_angle) / 2)
    x, y, nearer = np.abs(at - middle)[:, 0], np.abs(at - middle)[:, 1], (at - middle)[:, 2]
    distance = max((x / (0.92 * half * aspect) + nearer).max(), (y / (share * half) + nearer).max())
    camera.up, camera.focal_point = axes[1], middle @ axes
    camera.position = (middle + [0.0, 0.0, distance]) @ axes


def _measure(plotter: Any, height: int) -> None:
    """Add the directions of the axes, and a length to the scale of what is as far away as the middle of the sheet."""
    import pyvista
    from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

    pixel = 2 * plotter.camera.distance * np.tan(np.radians(plotter.camera.view_angle) / 2) / height
    length = max(n * 10.0**k for k in range(-6, 6) for n in (1, 2, 5) if n * 10.0**k <= 200 * pixel)
    right, low, tick = 40 + length / pixel, 78, 5
    ends = [(40, low + tick), (40, low - tick), (40, low), (right, low), (right, low + tick), (right, low - tick)]
    mapper, line = vtkPolyDataMapper2D(), vtkActor2D()
    mapper.SetInputData(pyvista.MultipleLines([(x, y, 0.0) for x, y in ends]))
    line.SetMapper(mapper)
    line.GetProperty().SetColor(0.0, 0.0, 0.0)
    line.GetProperty().SetLineWidth(2)
    plotter.add_actor(line)
    said = f"{length:g} m" if length >= 1.0 else f"{1e3 * length:g} mm"
    plotter.add_text(said, position=(48, low + 4), color="black", font_size=11)
    grey = {"x_color": "dimgrey", "y_color": "dimgrey", "z_color": "dimgrey"}
    plotter.add_axes(color="black", line_width=3, viewport=(0.89, 0.12, 1.0, 0.26), **grey)


def _arrows(plotter: Any, shape: Shape, eye: Array, count: int = 5) -> Array:
    """Draw warp and weft at a few cells that face the eye, far from each other; where the arrows end (n, 3)."""
    import pyvista

    assert shape.yarns is not None
    corners = shape.cells.reshape(len(shape.kinds), -1)[:, 1:]
    corners = corners[:, : 3 if shape.kinds[0] in (5, 69, 22) else 4]  # VTK's triangles, linear and quadratic
    middle = (shape.points + shape.moved)[corners].mean(axis=1)
    normal = np.cross(shape.yarns[:, 0], shape.yarns[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-300
    facing = normal @ eye / np.linalg.norm(eye)
    extent = float(np.linalg.norm(np.ptp(middle, axis=0)))
    seen = np.flatnonzero(np.abs(facing) > 0.6 * np.abs(facing).max())
    chosen = [seen[np.linalg.norm(middle[seen] - middle.mean(axis=0), axis=1).argmin()]]
    while len(chosen) < min(count, len(seen)):
        away = np.linalg.norm(middle[seen, None] - middle[chosen], axis=2).min(axis=1)
        chosen.append(seen[away.argmax()])
    tips = []
    for cell in chosen:
        start = middle[cell] + 0.01 * extent * np.sign(facing[cell]) * normal[cell]
        for k, (color, length) in enumerate((("#d00000", 0.09), ("black", 0.06))):
            along = shape.yarns[cell, k] / np.linalg.norm(shape.yarns[cell, k])
            arrow = pyvista.Arrow(
                start=start, direction=along, tip_radius=0.12, shaft_radius=0.045, scale=length * extent
            )
            plotter.add_mesh(arrow, color=color, lighting=False)
            tips.append(start + length * extent * along)
    return np.array(tips)
