"""Bodies that a sheet may touch, as they are written and drawn."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..laws import Array
from .showing import Touching

TRIANGLES = {
    5: ((0, 1, 2),),
    9: ((0, 1, 2), (0, 2, 3)),
    22: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    28: ((0, 4, 8), (0, 8, 7), (4, 1, 5), (4, 5, 8), (8, 5, 2), (8, 2, 6), (7, 8, 6), (7, 6, 3)),
}
"""Kind of cell, as VTK numbers it -> the triangles between its nodes."""


@dataclass
class Solid:
    """A body as it is written and drawn."""

    name: str
    points: Array
    """Its corners now (n, 3), m."""
    faces: np.ndarray
    """Its triangles (m, 3)."""
    pressure: Array
    """Of contact at the corners (n,), Pa; not a number where it is not told."""


def drawn(touch: Touching | None) -> list[Solid]:
    """The bodies that a sheet may touch, where they are now."""
    bodies = [] if touch is None else touch.bodies
    return [Solid(b.name, touch.places(b), b.faces, touch.pressure(b)) for b in bodies]  # type: ignore[union-attr]


def add(plotter: Any, x: Array, faces: np.ndarray) -> None:
    """Draw a body in grey, sharp edges as lines."""
    import pyvista

    body = pyvista.PolyData.from_regular_faces(x, faces)
    actor = plotter.add_mesh(
        body, color="#c9ccd2", smooth_shading=True, split_sharp_edges=True, ambient=0.3, diffuse=0.7, specular=0.1
    )
    # behind the sheet, which lies on it; but not behind the far side of a sleeve, as ten times that would put it
    actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(4.0, 40.0)
    edges = body.extract_feature_edges(feature_angle=40, manifold_edges=False, non_manifold_edges=False)
    if edges.n_points:
        lines = plotter.add_mesh(edges, color="#80848c", line_width=1)
        lines.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        lines.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(3.0, 30.0)


def as_touched(grid: Any) -> Any:
    """Squares as the triangles that contact takes them for, so that no body is seen through one that is warped."""
    import pyvista

    corners = grid.cells.reshape(-1, 5)[:, 1:]
    surface = pyvista.PolyData.from_regular_faces(grid.points, corners[:, np.array(TRIANGLES[9])].reshape(-1, 3))
    for name, values in grid.cell_data.items():
        surface.cell_data[name] = np.repeat(values, 2, axis=0)
    return surface
