"""Shells that several test files share: skewed meshes, flat and curved, and an element's strains with a law on them."""

import functools

import basix
import numpy as np
import scenes
import scipy.sparse
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.shell import assumed_strain, directors
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import weakform
from fabric_fenicsx.terms.work import InternalWork

FABRIC = fabrics.load("blend")
WOVEN, STIFFNESS = Woven(FABRIC), StVenantKirchhoff.from_fabric(FABRIC).stiffness
H = 5e-3
SIZES = {"flat": (1.2, 0.9), "square": (1.0, 1.0), "cylinder": (np.pi / 2, 0.9), "short": (np.pi / 2, 1.0)}
"""Length along x, or of the arc of a quarter of a cylinder of radius 1, and width."""


def surface(element, shape, cells=(4, 3), skew=0.25, comm=MPI.COMM_SELF):
    """A flat sheet or a quarter of a cylinder, see `SIZES`; nodes inside are moved within it by `skew` of a cell."""
    triangles = int(directors.ELEMENTS[element][0] == "triangle")
    (length, width), flat = SIZES[shape], shape in ("flat", "square")
    numbers = {"nx": cells[0], "ny": cells[1], "triangles": triangles}
    if flat:
        domain = meshing.read(scenes.MESHES / "strip.geo", comm, **numbers, length=length, width=width)
    else:
        domain = meshing.read(scenes.MESHES / "cylinder.geo", comm, **numbers, length=width, order=1 + triangles)
    x = domain.mesh.geometry.x
    s, t = x[:, 0] / length if flat else np.arctan2(x[:, 0], x[:, 2]) / length, x[:, 1] / width
    wave = np.sin(7 * s + 11 * t) * s * (1 - s) * t * (1 - t) * 16
    s, t = s + skew / cells[0] * wave, t - skew / cells[1] * wave * np.cos(5 * t - 6 * s)
    if flat:
        x[:, 0], x[:, 1] = length * s, width * t
    else:
        x[:, 0], x[:, 1], x[:, 2] = np.sin(length * s), width * t, np.cos(length * s)
    return domain


class Shell:
    """An element's strains with a law in three layers, on a mesh.

    ratio: of the two shear moduli. load: force per area, interpolated like the displacement.
    """

    def __init__(self, domain, element, law=WOVEN, thickness=H, warp=(1.0, 0.3, 0.2), ratio=0.8, load=None):
        self.space = space = directors.ShellSpace(domain, element)
        self.q, test = space.function(), ufl.TestFunction(space.V)
        G = law.respond(np.zeros((1, 3)), law.initial_state[None])[1][0, 2, 2]
        h, curvature = fem.Constant(domain, thickness), space.curvature()
        self.variation = weakform.shear_variation(domain, G, h, curvature=curvature)
        strain, shear = assumed_strain.shell_strains(space, self.q, warp, self.variation)
        stiffness = weakform.shear_stiffness(domain, (G, ratio * G), h, curvature=curvature)
        parts = [(strain, Section(law, thickness, 3), space.dx), (shear, stiffness, space.dx_shear)]
        self.work = InternalWork(space, self.q, parts)
        self.fabric = self.work.points[0]
        self.residual = [self.work]
        if load is not None:
            f, v = fem.Function(space.V.sub(0).collapse()[0]), ufl.split(test)[0]
            f.interpolate(load)
            load = weakform.surface_traction(f, v, ufl.dx(domain, metadata={"quadrature_degree": 4}))
            self.residual.append(-load)
        self.shear = shear

    def solver(self, bcs=()):
        return statics.StaticSolver(self.residual, self.q, bcs, space=self.space)

    @functools.cached_property
    def free(self):
        """A solver of a shell that nothing holds."""
        return self.solver()

    @functools.cached_property
    def _shear(self):
        points, _ = basix.make_quadrature(self.space.mesh.basix_cell(), self.space.shear_degree)
        return fem.Expression(self.shear, points)

    def place(self, displacement, director):
        """(u, d) with u from x, and d from x and the reference directors; both take and give (3, n)."""
        values = self.space.function().x.array
        for i, value in enumerate((displacement, director)):
            part, dofs = self.space.V.sub(i).collapse()
            f = fem.Function(part)
            if i == 0:
                f.interpolate(value)
            else:
                x = part.tabulate_dof_coordinates()
                f.x.array[:] = value(x.T, self.space.normal.x.array.reshape(-1, 3).T).T.ravel()
            values[dofs[0]] = f.x.array
        return values

    def strains(self, values):
        """Strain and curvature (cells, points, 6) and shear (cells, points, 2) at (u, d)."""
        self.q.x.array[:] = values
        assert self.work.evaluate()
        cells = np.arange(len(self.fabric.strain), dtype=np.int32)
        return self.fabric.strain.copy(), self._shear.eval(self.space.mesh, cells).reshape(len(cells), -1, 2)

    def force(self, values):
        """Internal forces at (u, d), in V."""
        self.strains(values)
        result = np.zeros_like(values)
        self.work.add_force(result)
        return result

    def stiffness(self):
        """Tangent at rest in V, a SciPy matrix."""
        self.strains(self.space.function().x.array)
        rows, columns = self.work.pattern()
        entries = np.zeros(len(rows))
        self.work.add_stiffness(entries)
        return scipy.sparse.coo_array((entries, (rows, columns))).tocsr()

    @property
    def stress(self):
        """Resultants at the last strains, (cells, points, 6)."""
        return self.fabric.stress
