"""Strips between grips, simulated with the law that has a potential, for the one fit of all tests.

Elements as `inverse` has them for clamped ends.
"""

import warnings
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ... import specimen
from ...fabrics import Fabric
from ...laws import Array
from ...laws.potential import Potential
from ...output import pictures
from ...solvers import statics
from ...surfaces import meshing, yarns
from ..files.records import Strip
from ..joint import Simulate
from . import curves
from .inverse import ELEMENTS
from .strips import Ends


def strips(mesh: Path, cells: tuple[int, int] | None = None) -> Simulate:
    """What pulls strips of `meshes/strip.geo`, or of one with its numbers and groups; see `joint.Simulate`."""
    (_, across), degree, quadrature = ELEMENTS["clamped"]
    known: dict[tuple[float, float, float], specimen.Strip] = {}

    def pull(fabric: Fabric, strip: Strip, angle: float, displacements: Array) -> Array:
        law, key = Potential(fabric), (strip.gauge_length, strip.width, angle)
        if key in known:
            known[key].renew(law)
        else:
            square = strip.gauge_length / strip.width  # as many cells along as keep them as long as wide
            nx, ny = cells or (int(np.clip(round(across * square), across, 40)), across)
            domain = meshing.read(
                mesh, MPI.COMM_SELF, gdim=2, orient=False, nx=nx, ny=ny, length=strip.gauge_length, width=strip.width
            )
            known[key] = specimen.strip(
                domain, fabric, law, angle, ends="clamped", degree=degree, quadrature=quadrature
            )
        scene, forces = known[key], []
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*is beyond the measured")
            for _ in statics.march(scene.solver, scene.pull, list(displacements)):
                forces.append(scene.solver.reaction(scene.ends[1]))
        return curves.piola_kirchhoff(np.array(forces), displacements, strip.gauge_length, strip.area)

    return pull


def picture(mesh: Path, fabric: Fabric, strip: Strip, angle: float, displacement: float, ends: Ends) -> Array:
    """A strip that is pulled by so many m, the warp at `angle` (degrees), by its axial strain: (rows, columns, 3)."""
    length, width = strip.gauge_length, strip.width
    domain = meshing.read(mesh, MPI.COMM_SELF, gdim=2, nx=18, ny=6, length=length, width=width)
    turn = np.radians(angle)
    scene = specimen.strip(domain, fabric, Potential(fabric), turn, ends=ends, degree=2)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*is beyond the measured")
        for _ in statics.march(scene.solver, scene.pull, list(np.linspace(0, displacement, 11)[1:])):
            pass
    E1, E2, gamma = scene.points.strain[..., :3].mean(axis=1).T
    c, s = np.cos(turn), np.sin(turn)
    moved = yarns.Yarns(domain.mesh, scene.u, yarns.plane_axes(domain.mesh, turn))
    shown = pictures.shape(scene.u, c * c * E1 + s * s * E2 - c * s * gamma, moved())
    assert shown is not None  # a single rank has all of it
    return pictures.page(shown, "axial strain (-)")
