"""Small scenes and toy laws that several test files share."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import ufl
from dolfinx import fem, mesh

from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.shell import assumed_strain, kinematics
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing, yarns
from fabric_fenicsx.terms import hook, weakform
from fabric_fenicsx.terms.points import LawPoints
from fabric_fenicsx.terms.work import InternalWork

MESHES = Path(__file__).parent.parent / "meshes"
THICKNESS = 0.5e-3


def grid(comm, cell="quadrilateral", cells=(4, 3), size=(0.4, 0.3), skew=0.0):
    """Rectangle whose inner nodes are moved by up to `skew` of a cell; the same on any number of ranks."""
    kind = getattr(mesh.CellType, cell)
    domain = mesh.create_rectangle(comm, [(0.0, 0.0), size], cells, kind)
    x, h = domain.geometry.x, np.array(size) / cells
    place = np.rint(x[:, :2] / h)
    inner = ((place > 0) & (place < cells)).all(axis=1)
    noise = np.sin(place @ [[12.9898, 39.346], [78.233, 11.135]] + [0, 1]) * 43758.5453 % 2 - 1
    x[inner, :2] += skew * h * noise[inner]
    return domain


def space(domain, degree=1):
    """Displacements in the plane."""
    return fem.functionspace(domain, ("Lagrange", degree, (2,)))


def random(function, scale, seed=0):
    """Fill a function with noise, the same on any number of ranks."""
    function.interpolate(lambda x: scale * (np.sin((7 + seed) * 1e3 * np.array([x[0] + 2 * x[1], x[1] - x[0]]))))
    return function


def turned(angle):
    """Rotation matrix."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@dataclass
class Scene:
    """A sheet whose whole rim goes through the homogeneous deformation F of a load."""

    u: fem.Function
    fabric: LawPoints
    solver: statics.StaticSolver
    pull: Callable[[float], None]
    F: Callable[[float], np.ndarray]


def rim(domain, law, gradient, warp=0.0, degree=1, turn=0.0, rtol=1e-10, **options):
    """The Scene, F = turn (1 + load gradient), at load 0; `options` are PETSc's."""
    V = space(domain, degree)
    u, v, given = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    strain = kinematics.membrane_strain(u, yarns.plane_axes(domain, warp))
    fabric = hook.LawHook(law, strain, domain, degree=2 * degree)
    residual = weakform.internal(fabric.stress, strain, u, v, fem.Constant(domain, THICKNESS), fabric.dx)
    domain.topology.create_connectivity(1, 2)
    edge = fem.locate_dofs_topological(V, 1, mesh.exterior_facet_indices(domain.topology))

    def F(load):
        return turned(turn) @ (np.eye(2) + load * np.array(gradient))

    def pull(load):
        given.interpolate(lambda x: (F(load) - np.eye(2)) @ x[:2])

    pull(0.0)
    u.x.array[:] = given.x.array
    solver = statics.StaticSolver(residual, u, [fem.dirichletbc(given, edge)], rtol=rtol, options=options)
    return Scene(u, fabric.points, solver, pull, F)


def side(u, component, where):
    """Unknowns of one component on the edges where `where(x)` holds, for `StaticSolver.reaction`."""
    V = u.function_space
    edges = mesh.locate_entities_boundary(V.mesh, 1, where)
    return fem.locate_dofs_topological(V.sub(component), 1, edges)


def points(u):
    """All nodes (n, 2) and displacements (n, 2) of a function, over all ranks, in an order that depends on neither."""
    V = u.function_space
    n = V.dofmap.index_map.size_local
    x, value = V.tabulate_dof_coordinates()[:n, :2], u.x.array.reshape(-1, 2)[:n]
    x, value = (np.concatenate(V.mesh.comm.allgather(a)) for a in (x, value))
    order = np.lexsort(np.round(x, 9).T)
    return x[order], value[order]


class Toy:
    """A smooth law, far from symmetric and nonlinear in every component, without history."""

    symmetric = False
    initial_state = np.empty(0)
    A = 1e6 * np.array([[4.0, 1.9, 0.3], [-0.6, 3.0, 0.8], [0.5, -0.7, 2.0]])
    B = 1e7 * np.array([[1.0, 0.4, -0.2], [0.7, -0.5, 0.9], [0.3, 0.8, 0.6]])

    def respond(self, strain, state, out=None):
        """S = A E + B (E1 E2, E2 E3, E3 E1)."""
        n = len(strain)
        stress, tangent, new = out or (np.empty((n, 3)), np.empty((n, 3, 3)), np.empty_like(state))
        after = np.roll(strain, -1, axis=1)
        stress[:] = strain @ self.A.T + (strain * after) @ self.B.T
        product = np.zeros((n, 3, 3))
        for k in range(3):
            product[:, k, k], product[:, k, (k + 1) % 3] = after[:, k], strain[:, k]
        tangent[:] = self.A + self.B @ product
        new[:] = state
        return stress, tangent, new


class Impatient(Toy):
    """The toy law, but not a number where a component moves by more than `stride` in one increment.

    A sheet looks at its law before it takes it, and may not see this: give the stride when it is made.
    """

    initial_state = np.zeros(3)

    def __init__(self, stride):
        self.stride = stride

    def respond(self, strain, state, out=None):
        """Its state is the committed strain."""
        stress, tangent, new = super().respond(strain, state, out)
        stress[np.abs(strain - state).max(axis=1) > self.stride] = np.nan
        new[:] = strain
        return stress, tangent, new


class Transposed:
    """Another law with its tangent transposed."""

    symmetric = False

    def __init__(self, law):
        self.law, self.initial_state = law, law.initial_state

    def respond(self, strain, state, out=None):
        """Right in all but the tangent."""
        stress, tangent, new = self.law.respond(strain, state, out)
        tangent[:] = np.swapaxes(tangent, 1, 2).copy()
        return stress, tangent, new


def specimen(comm, fabric, cells, **numbers):
    """The mesh of `meshes/strip.geo` in the fabric's size."""
    (nx, ny), path = cells, MESHES / "strip.geo"
    size = {"length": fabric.gauge_length, "width": fabric.width}
    return meshing.read(path, comm, gdim=2, nx=nx, ny=ny, **size, **numbers)


def group(domain, V, name, component=None):
    """Unknowns of a physical group, of both components or of one."""
    dim, entities = domain.entities(name)
    domain.mesh.topology.create_connectivity(dim, 2)
    return fem.locate_dofs_topological(V if component is None else V.sub(component), dim, entities)


def clamped(comm, fabric, law, cells=(9, 3), degree=1, warp=0.0, turn=0.0, rtol=1e-10, **numbers):
    """A strip between grips, all of it turned by `turn`: u, points, solver, pull and measure.

    `pull(d)` gives the displacement of the end, `measure()` the force on it along and across the strip.
    """
    domain, along = specimen(comm, fabric, cells, **numbers), turned(turn)[:, 0]
    x = domain.mesh.geometry.x
    x[:, :2] = x[:, :2] @ turned(turn).T
    V = space(domain.mesh, degree)
    u, v, given = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    strain = kinematics.membrane_strain(u, yarns.plane_axes(domain.mesh, warp + turn))
    sheet = hook.LawHook(law, strain, domain.mesh, degree=2 * degree)
    residual = weakform.internal(sheet.stress, strain, u, v, fem.Constant(domain.mesh, fabric.thickness), sheet.dx)
    end, parts = group(domain, V, "pulled_end"), [group(domain, V, "pulled_end", k) for k in (0, 1)]
    bcs = [fem.dirichletbc(given, dofs) for dofs in (group(domain, V, "fixed_end"), end)]
    solver = statics.StaticSolver(residual, u, bcs, rtol=rtol, options={"snes_linesearch_type": "bt"})

    def pull(displacement):
        given.x.array.reshape(-1, 2)[end] = displacement * along

    def measure():
        return np.array([solver.reaction(part) for part in parts]) @ turned(turn)

    return u, sheet.points, solver, pull, measure


def drawn(comm, fabric, law, cells=(4, 2), warp=0.0, cell="quadrilateral", rtol=1e-10, **options):
    """A strip drawn by a dead traction (Pa, of the reference area) on both ends: u, points, solver, draw.

    Held at (0, 0), and at (length, 0) against rotation: its stress is uniaxial and homogeneous.
    """
    domain = specimen(comm, fabric, cells, triangles=int(cell == "triangle"))
    V = space(domain.mesh)
    u, v = fem.Function(V), ufl.TestFunction(V)
    strain = kinematics.membrane_strain(u, yarns.plane_axes(domain.mesh, warp))
    sheet = hook.LawHook(law, strain, domain.mesh, degree=2)
    traction = fem.Constant(domain.mesh, np.zeros(2))
    edges = ufl.Measure("ds", domain=domain.mesh, subdomain_data=domain.tags[1])
    ends = [edges(domain.names[name][1]) for name in ("pulled_end", "fixed_end")]
    h = fem.Constant(domain.mesh, fabric.thickness)
    residual = (
        weakform.internal(sheet.stress, strain, u, v, h, sheet.dx)
        - weakform.traction(h * traction, v, ends[0])
        + weakform.traction(h * traction, v, ends[1])
    )
    corner = fem.locate_dofs_geometrical(
        (V.sub(1), V.sub(1).collapse()[0]), lambda x: np.hypot(x[0] - fabric.gauge_length, x[1]) < 1e-9
    )[0]
    zero = fem.Constant(domain.mesh, 0.0)
    pins = [(0, group(domain, V, "pin", 0)), (1, group(domain, V, "pin", 1)), (1, corner)]
    bcs = [fem.dirichletbc(zero, dofs, V.sub(k)) for k, dofs in pins]
    solver = statics.StaticSolver(residual, u, bcs, rtol=rtol, options=options)

    def draw(stress):
        traction.value[:] = [stress, 0]

    return u, sheet.points, solver, draw


def shell(space, q, thickness, E, nu, warp=(1, 0, 0)):
    """Internal work of an isotropic elastic shell, for `StaticSolver`; its form is the same in plain UFL."""
    plane, G = StVenantKirchhoff.isotropic(E, nu).stiffness, E / 2 / (1 + nu)
    section = fem.Constant(space.mesh, np.kron(np.diag([thickness, thickness**3 / 12]), plane))
    strain, shear = assumed_strain.shell_strains(space, q, warp)
    across = weakform.shear_stiffness(space.mesh, (G, G), thickness)
    return InternalWork(space, q, [(strain, section, space.dx), (shear, across, space.dx_shear)])
