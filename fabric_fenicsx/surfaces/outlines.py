"""Flat outlines filled with cells by gmsh, with the nodes on the outline where they are told to be."""

from collections.abc import Sequence
from typing import Literal

import gmsh
import numpy as np

from ..errors import InputError
from .checking import Array
from .gmsh_models import session

type Kind = Literal["quadrilateral", "triangle"]


def fill(edges: Sequence[Array], kind: Kind, regular: bool) -> tuple[Array, np.ndarray, list[np.ndarray]]:
    """Points (n, 2), cells in the order of DOLFINx, and the points on each edge in its order.

    Args:
        edges: places of the nodes of each edge (nodes, 2), m, going round anticlockwise; each begins where the one
            before ends.
        kind: of cells; of quadrilaterals each edge has an even number of parts.
        regular: rows and columns, for four edges of which opposite ones have as many nodes.

    Raises InputError where gmsh cannot fill it.
    """
    with session():
        gmsh.option.setNumber("Mesh.Algorithm", 8 if kind == "quadrilateral" else 6)
        gmsh.option.setNumber("Mesh.RecombinationAlgorithm", 3)  # blossom alone leaves some triangles
        gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
        try:
            return _filled(edges, kind, regular)
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"gmsh cannot fill the outline: {str(error).strip().rstrip('.')}.") from error


def _filled(edges: Sequence[Array], kind: Kind, regular: bool) -> tuple[Array, np.ndarray, list[np.ndarray]]:
    geo = gmsh.model.geo
    corners = [geo.addPoint(*edge[0], 0) for edge in edges]
    curves = []
    for edge, first, last in zip(edges, corners, [*corners[1:], corners[0]], strict=True):
        inner = [geo.addPoint(*x, 0) for x in edge[1:-1]]
        curves.append(geo.addPolyline([first, *inner, last]))
    surface = geo.addPlaneSurface([geo.addCurveLoop(curves)])
    geo.synchronize()
    mesh = gmsh.model.mesh
    # after the last `synchronize`, which forgets them
    for curve, edge in zip(curves, edges, strict=True):
        mesh.setTransfiniteCurve(curve, len(edge))
    if regular:
        mesh.setTransfiniteSurface(surface, "Alternate")
    if kind == "quadrilateral":
        mesh.setRecombine(2, surface)
    mesh.generate(2)
    tags, x, _ = mesh.getNodes()
    place = np.full(int(tags.max()) + 1, -1)
    place[tags.astype(int)] = np.arange(len(tags))
    points = x.reshape(-1, 3)[:, :2].copy()
    ends = [place[mesh.getNodes(0, corner)[0].astype(int)] for corner in corners]
    on = []
    for k, (curve, edge) in enumerate(zip(curves, edges, strict=True)):
        inner = place[mesh.getNodes(1, curve)[0].astype(int)]
        on.append(np.concatenate([ends[k], inner, ends[(k + 1) % len(ends)]]))
        if len(on[k]) != len(edge):
            raise InputError(f"gmsh put {len(on[k])} nodes on an edge in place of {len(edge)}.")
        points[on[k]] = edge
    return points, _cells(kind, place), on


def _cells(kind: Kind, place: np.ndarray) -> np.ndarray:
    kinds, _, nodes = gmsh.model.mesh.getElements(2)
    wanted, width, order = (3, 4, [0, 1, 3, 2]) if kind == "quadrilateral" else (2, 3, [0, 1, 2])
    if list(kinds) != [wanted]:
        raise InputError(f"gmsh cannot fill the outline with {kind}s alone; take another cell size.")
    return np.asarray(place[nodes[0].astype(int)].reshape(-1, width)[:, order])
