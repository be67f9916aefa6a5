"""Unit directors at nodes, turned by two angles each, without a limit (5.43)-(5.55).

A shell's weak form is written in the mid-surface displacement u and the director d, six numbers a node: strains are
then polynomials. But a director has unit length, so the solver's unknown is the displacement and two angles theta,
about which d turns from the director d0 of the last commit,

    d = cos|t| d0 + sin|t|/|t| t,    t = theta_1 e1 + theta_2 e2,    (e1, e2, d0) orthonormal,

((5.43) to (5.46), sign of the last term mended). A commit makes d the new d0, so a step may turn by anything less than
half a turn, and a strip may roll up as often as it likes. Between nodes d is interpolated, as in Chapter 5: strains do
not change when the whole shell turns.
"""

from collections.abc import Callable, Sequence

import basix.ufl
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem, mesh
from petsc4py import PETSc
from ufl.core.expr import Expr

from ..errors import InputError
from ..laws import Array
from . import kinematics, rotation
from .bodies import Body
from .dirichlet import check, put

ELEMENTS = {
    "regge": ("triangle", ("Lagrange", 2), ("CR", 1), 2),
    "p2cr1": ("triangle", ("Lagrange", 2), ("CR", 1), 2),
    "mitc4": ("quadrilateral", ("Lagrange", 1), ("Lagrange", 1), 2),
    "q1": ("quadrilateral", ("Lagrange", 1), ("Lagrange", 1), 1),
}
"""Name -> cell, element of the displacement, element of the director, degree of the rule for shear.

"regge" is the default on triangles, quadratic in displacement, with directors at the middles of the edges; "p2cr1" is
the same with the strain of the displacement itself, which locks. "mitc4" is the default on quadrilaterals, bilinear,
with assumed shear and membrane strains (see `assumed_strain`); below a thickness of 1e-4 of the length it needs a fine
mesh or a regular one. "q1" is the thesis's element, with the strains of the displacement and transverse shear at one
point: it locks on skewed meshes, and a pattern of a sheet, nodes that go up and down by turns, costs it no energy; pins
at the corners may not stop it.
"""

ASKEW = 0.3
"""Sine of the angle by which a normal may miss its plane of symmetry; half the turn of the surface within a cell."""

DEGREE = 2
"""Of the quadrature rule on which strains and law of a shell are taken."""


class ShellSpace:
    """The spaces of a shell on a surface mesh, and its directors.

    V: displacement and director (u, d), in which forms are written. W: displacement and angles (u, theta), in which the
    solver solves. `normal`, `start`: see `kinematics.reference`.

    element: a name in `ELEMENTS`, by default the first for the cells of the mesh. dx, dx_shear: measures of
    its strains and of its transverse shear.

    Raises InputError, on every rank, for a mesh that is not a surface in space, another cell, cells that
    are more curved than the element can turn, or neighbours with opposite normals.
    """

    def __init__(self, domain: mesh.Mesh, element: str | None = None) -> None:
        cell = domain.basix_cell()
        if domain.topology.dim != 2 or domain.geometry.dim != 3:
            raise InputError("A shell needs a surface mesh in space: read the mesh with gdim=3.")
        fitting = [name for name, (needed, *_) in ELEMENTS.items() if needed == cell.name]
        self.element = element or fitting[0]
        if self.element not in fitting:
            raise InputError(f"Element {element!r} is not one for {cell.name}s, which are: {', '.join(fitting)}.")
        _, (u_family, u_degree), (d_family, d_degree), self.shear_degree = ELEMENTS[self.element]
        if domain.geometry.cmaps[0].degree > u_degree:
            # no displacement would turn the sheet as a whole
            raise InputError(f"Element {self.element!r} needs cells of order {u_degree} at most; mesh in that order.")
        self.dx, self.dx_shear = (
            ufl.Measure("dx", domain, metadata={"quadrature_degree": degree, "quadrature_scheme": "default"})
            for degree in (DEGREE, self.shear_degree)
        )
        if self.shear_degree == 1:
            # in one kernel with another rule, FFCx 0.11 takes what it computes for a point as constant in the cell
            cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
            self.dx_shear = self.dx_shear(subdomain_data=[(1, cells)], subdomain_id=1)
        displacement = basix.ufl.element(u_family, cell, u_degree, shape=(3,))
        director, angles = (basix.ufl.element(d_family, cell, d_degree, shape=(n,)) for n in (3, 2))
        self.mesh = domain
        self.V = fem.functionspace(domain, basix.ufl.mixed_element([displacement, director]))
        self.W = fem.functionspace(domain, basix.ufl.mixed_element([displacement, angles]))

        # the same cell's unknowns in V and W, one after the other
        V, W = self.V.dofmap.list, self.W.dofmap.list
        split = V.shape[1] - 3 * (V.shape[1] - W.shape[1])
        self.displaced = np.unique(np.column_stack([V[:, :split].ravel(), W[:, :split].ravel()]), axis=0)
        in_v, in_w = V[:, split:].reshape(-1, 3), W[:, split:].reshape(-1, 2)
        _, first = np.unique(in_v[:, 0], return_index=True)
        self.nodes, self.angles = in_v[first], in_w[first]
        """Unknowns of each local node: of its director in V (nodes, 3), of its angles in W (nodes, 2)."""
        self._owned = self.nodes[:, 0] < self.V.dofmap.index_map.size_local

        directors, in_v = self.V.sub(1).collapse()
        self._in_v = in_v[0]
        self.normal, self.start = kinematics.reference(directors)
        self.lay(self.start.x.array.reshape(-1, 3).copy())
        self._angles, self.slopes = np.zeros((len(self.nodes), 2)), np.empty((len(self.nodes), 2, 3))
        self.bodies: list[Body] = []
        """What moves as one, see `join`."""
        self._map = self._transformation()
        self.moves: list[Callable[[], None]] = []
        """Called when the reference directors have been laid into planes of symmetry: what is led starts from them."""

    def lay(self, start: Array) -> None:
        """Let the directors start along these unit vectors at the nodes of `start`; before a solver is made."""
        self.start.x.array[:] = start.ravel()
        self.frame = rotation.frames(start[np.argsort(self._in_v[::3])])
        self._start = self._d = self.frame[:, 2].copy()

    def function(self) -> fem.Function:
        """A new (u, d) in V as the sheet starts: no displacement, the directors `start`."""
        q = fem.Function(self.V)
        q.x.array[self.nodes] = self._start
        return q

    def join(self, name: str, nodes: np.ndarray, places: Array, rows: np.ndarray) -> Body:
        """Let nodes move as one rigid body; to be called before a solver is made, on every rank.

        nodes: local unknowns (n, 3) in V of displacements, and their places; rows: of directors. Raises InputError.
        """
        if hasattr(self, "_led"):
            raise InputError(f"The group {name!r} becomes rigid too late: say so before a solver is made.")
        moves, W = self.displaced[np.searchsorted(self.displaced[:, 0], nodes), 1], self.W.dofmap.index_map
        own = rows, nodes, self.nodes[rows], places, moves, self.angles[rows]
        self.bodies.append(Body(name, self.mesh.comm, self.V.dofmap.index_map, W, *own))
        every = np.concatenate([body.nodes[:, 0] for body in self.bodies])
        if self.mesh.comm.allreduce(len(np.unique(every)) < len(every)):
            raise InputError(f"The group {name!r} has nodes of another rigid body.")
        self._map = self._transformation()
        return self.bodies[-1]

    def curvature(self) -> Expr | None:
        """Size of the curvature at rest, 1/m, where the element's transverse shear asks for it: on curved triangles."""
        gradient = ufl.grad(self.normal)
        # a garment is of flat panels, also where directors lean
        bent = self.element == "regge" and self.normal.function_space is self.start.function_space
        size = fem.assemble_scalar(fem.form(ufl.inner(gradient, gradient) * self.dx)) if bent else 0.0
        flat = self.mesh.comm.allreduce(float(size)) < 1e-16
        return None if flat else ufl.sqrt(ufl.inner(gradient, gradient))

    def _transformation(self) -> PETSc.Mat:
        """The matrix d(u, d)/d(u, theta), V rows by W columns; `turn` fills in the directors' part."""
        matrix = PETSc.Mat().create(self.mesh.comm)
        maps = [space.dofmap.index_map for space in (self.V, self.W)]
        matrix.setSizes([[m.size_local, m.size_global] for m in maps])
        matrix.setType(PETSc.Mat.Type.AIJ)
        matrix.setPreallocationNNZ((8, 6) if self.bodies else (2, 0))
        indices = [m.local_to_global(np.arange(m.size_local + m.num_ghosts, dtype=np.int32)) for m in maps]
        matrix.setLGMap(*(PETSc.LGMap().create(i.astype(PETSc.IntType), comm=self.mesh.comm) for i in indices))
        owned = self.displaced[self.displaced[:, 0] < maps[0].size_local].astype(PETSc.IntType)
        joined = np.concatenate([np.empty(0), *(body.nodes.ravel() for body in self.bodies)])
        matrix.setValuesLocalRCV(owned[:, :1], owned[:, 1:], 1.0 - np.isin(owned[:, :1], joined))
        rows = self.nodes[self._owned].reshape(-1, 1).astype(PETSc.IntType)
        self._rows, self._columns = rows, np.repeat(self.angles[self._owned], 3, axis=0).astype(PETSc.IntType)
        matrix.setValuesLocalRCV(self._rows, self._columns, np.zeros(self._columns.shape))
        for body in self.bodies:
            matrix.setValuesRCV(*body.pattern, np.zeros(body.pattern[1].shape))
        matrix.assemble()
        return matrix

    def axes(self) -> tuple[Array, Array]:
        """e1 and d0 of each node's frame, as local arrays of V, with displacements of bodies, and zeros elsewhere."""
        values = np.zeros((2, len(self.function().x.array)))
        values[0][self.nodes], values[1][self.nodes] = self.frame[:, 0], self.frame[:, 2]
        for body in self.bodies:
            values[1][body.nodes] = body.moved
        return values[0], values[1]

    def set_axes(self, e1: Array, d0: Array) -> None:
        """Lay the frames along e1 and d0, local arrays of V as `axes` gives them."""
        for body in self.bodies:
            body.settle(d0)
        e1, d0 = e1[self.nodes], d0[self.nodes]
        self.frame = np.stack([e1, np.cross(d0, e1), d0], axis=1)

    def at_rest(self, q: Array) -> Array:
        """The local array of W that has the displacements of q, and no angles."""
        values = np.zeros(2 * len(self.angles) + len(self.displaced))
        values[self.displaced[:, 1]] = q[self.displaced[:, 0]]
        for body in self.bodies:
            body.rest(q, values)
        return values

    def rate(self, v: Array) -> Array:
        """A velocity v of (u, d), at the directors of the last commit, as a local array of W."""
        values = self.at_rest(v)
        values[self.angles] = np.einsum("nj,naj->na", v[self.nodes], self.frame[:, :2])
        for body in self.bodies:
            body.put(np.concatenate(body.rates(v, body.arms, self.frame[body.rows, 2])), values)
        return values

    def turn(self, y: fem.Function, q: fem.Function) -> PETSc.Mat:
        """Set q = (u, d) from y = (u, theta), and return dq/dy; ghosts of y are up to date."""
        q.x.array[self.displaced[:, 0]] = y.x.array[self.displaced[:, 1]]
        self._angles = y.x.array[self.angles]
        d, self.slopes = rotation.turned(self.frame, self._angles)
        for body in self.bodies:
            d[body.rows] = body.move(y.x.array, q.x.array, self.frame[body.rows, 2])
            self.slopes[body.rows] = 0.0
        self._q, self._d, q.x.array[self.nodes] = q, d, d
        values = self.slopes[self._owned].transpose(0, 2, 1).reshape(-1, 2)
        self._map.setValuesLocalRCV(self._rows, self._columns, np.ascontiguousarray(values))
        for body in self.bodies:
            self._map.setValuesRCV(*body.pattern, body.entries)
        self._map.assemble()
        return self._map

    def add_curvature(self, matrix: PETSc.Mat, force: PETSc.Vec) -> None:
        """Add r . d2d/dtheta2, the part of a Jacobian in W of the directors' own curvature; force: residual r in V."""
        for body in self.bodies:
            bent = body.curvature(force.array_r, self.frame[body.rows, 2])
            matrix.setValues(body.columns[3:], body.columns[3:], bent, addv=True)
        triplets = *self.curvature_pattern(), self.curvature_entries(force)
        matrix.setValuesRCV(*(numbers.reshape(-1, 1) for numbers in triplets), addv=True)
        matrix.assemble()

    def curvature_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Global rows and columns in W of `curvature_entries`."""
        own = self.angles[self._owned].astype(np.int32).ravel()
        nodes = self.W.dofmap.index_map.local_to_global(own).astype(PETSc.IntType).reshape(-1, 2)
        return np.repeat(nodes, 2, axis=1).ravel(), np.tile(nodes, (1, 2)).ravel()

    def curvature_entries(self, force: PETSc.Vec) -> Array:
        """What `add_curvature` adds but for rigid bodies, four entries an owned node."""
        r = force.array_r[self.nodes[self._owned]]
        r[np.concatenate([np.empty(0, int), *(body.rows[body.owned[1]] for body in self.bodies)])] = 0.0
        return np.asarray(rotation.second(self.frame[self._owned], self._angles[self._owned], r).ravel())

    def commit(self, y: fem.Function) -> None:
        """Make the turned directors the new start; the angles of y become zero."""
        self.frame = rotation.carried(self.frame, self._d)
        y.x.array[self.angles] = 0.0
        for body in self.bodies:
            body.settle(self._q.x.array)
            body.rest(self._q.x.array, y.x.array)

    def supports(self, bcs: Sequence[fem.DirichletBC]) -> np.ndarray:
        """The owned unknowns of W that these conditions on V give, in any order; `targets` tells their values.

        A condition that gives a director whole holds or leads it. One that gives a component keeps it in the plane
        across that axis (a plane of symmetry), where it may turn; in two planes (a corner) it cannot. Called before the
        first step: it lays the frames along those axes, and the reference directors into those planes, which a
        mesh meets only nearly, also where they are led.

        Raises InputError, on every rank, where the director is further from such a plane than `ASKEW`.
        """
        led, across = np.zeros(len(self.nodes), dtype=bool), np.zeros((len(self.nodes), 3), dtype=bool)
        every = np.zeros(len(self.function().x.array), dtype=bool)
        for bc in bcs:
            given = np.zeros_like(every)
            given[bc.dof_indices()[0]] = True
            whole = given[self.nodes].all(axis=1)
            led |= whole
            across |= given[self.nodes] & ~whole[:, None]
            every |= given
        for body in self.bodies:
            body.check(every)
        planes = across.sum(axis=1)
        partly = np.flatnonzero(planes)
        d = self.frame[partly, 2]
        astray = bool((np.abs(d[across[partly]]) > ASKEW).any())
        if self.mesh.comm.allreduce(astray, MPI.LOR):
            raise InputError("A director is held in a plane (one component given) that it does not lie in.")
        axes = np.eye(3)[across[partly].argmax(axis=1)]
        d0 = rotation.unit(np.where(across[partly], 0.0, d))
        self.frame[partly] = np.stack([axes, np.cross(d0, axes), d0], axis=1)
        # strains are measured from `normal`: it must be the directors' start, else the shell is stressed at rest
        self._start[partly] = d0
        self.start.x.array[:] = self.function().x.array[self._in_v]
        for move in self.moves:
            move()
        self._led = np.flatnonzero(led)
        moved, turned = self.displaced[every[self.displaced[:, 0]], 1], self.angles
        fixed = np.concatenate([moved, turned[led | (planes > 1)].ravel(), turned[planes == 1, 0]])
        fixed = np.concatenate([fixed, *(body.slaves for body in self.bodies)])
        return np.unique(fixed[fixed < self.W.dofmap.index_map.size_local]).astype(np.int32)

    def targets(self, bcs: Sequence[fem.DirichletBC], y: fem.Function) -> Array:
        """Values in W that meet the present values of the conditions; zero elsewhere. Raises as `dirichlet.check`."""
        values = np.zeros(len(self.function().x.array))
        check(bcs, self.V)
        put(bcs, values)
        result = np.zeros_like(y.x.array)
        result[self.displaced[:, 1]] = values[self.displaced[:, 0]]
        d = rotation.unit(values[self.nodes[self._led]])
        along = np.einsum("nij,nj->ni", self.frame[self._led], d)
        sine = np.linalg.norm(along[:, :2], axis=1)
        angle = np.arctan2(sine, along[:, 2])
        scale = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0)
        result[self.angles[self._led]] = along[:, :2] * scale[:, None]
        return result
