"""The small scenes of `lean_scenes.py`, each with or without a feature, and one of them in plain DOLFINx."""

import time
from dataclasses import dataclass, replace

import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import NonlinearProblem

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.laws.bending import Bending
from fabric_fenicsx.laws.potential import Potential
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.shell import directors, kinematics
from fabric_fenicsx.solvers import energy, explicit, motion, newmark, statics
from fabric_fenicsx.surfaces import meshing, yarns
from fabric_fenicsx.terms import hook, supports, weakform
from fabric_fenicsx.terms.work import InternalWork

FABRIC, STRIP = fabrics.load("blend"), meshing.MESHES / "strip.geo"
LENGTH, WIDTH, PULL, DT = 0.3, 0.2, 0.01, 1e-3  # m, m, strain, s
STEPS = 16
H = FABRIC.thickness
AREAL_MASS = FABRIC.density * H


@dataclass(frozen=True)
class Scene:
    """What a scene has. law: linear, hooked (the same by a hook), yarns (no shear hysteresis), whole or potential."""

    level: str = "plane"
    law: str = "linear"
    element: str | None = None
    layers: int = 3
    quadratic: bool = False
    curved: bool = False
    load: str = "none"
    bending: bool = False
    moving: bool = False
    explicit: bool = False
    rotary: str = "none"
    damping: float = 0.0
    stiff_damping: float = 0.0
    ledger: bool = False
    contact: bool = False


PLANE = Scene()
HOOKED, YARNS = replace(PLANE, law="hooked"), replace(PLANE, law="yarns")
MEMBRANE, SHELL = Scene("membrane"), Scene("shell")
WHOLE = Scene("shell", "whole", layers=2)
MOVING, MOVING_SHELL = replace(MEMBRANE, moving=True), replace(SHELL, moving=True)
FLAT = replace(SHELL, element="regge")
EXPLICIT = replace(MOVING_SHELL, rotary="cell", explicit=True, law="hooked")
FEATURES = {
    "third dimension": (PLANE, MEMBRANE),
    "director and bending": (MEMBRANE, SHELL),
    "hook at all": (PLANE, HOOKED),
    "hysteresis in tension": (HOOKED, YARNS),
    "hysteresis in shear": (YARNS, replace(PLANE, law="whole")),
    "law with a potential": (replace(PLANE, law="whole"), replace(PLANE, law="potential")),
    "a third layer": (WHOLE, replace(WHOLE, layers=3)),
    "quadratic in thickness": (WHOLE, replace(WHOLE, quadratic=True)),
    "bending of its own": (SHELL, replace(SHELL, bending=True)),
    "curved frame": (FLAT, replace(FLAT, curved=True)),
    "assumed strain": (replace(SHELL, element="q1"), SHELL),
    "dead load": (MEMBRANE, replace(MEMBRANE, load="dead")),
    "follower load": (replace(MEMBRANE, load="dead"), replace(MEMBRANE, load="follower")),
    "inertia": (MEMBRANE, MOVING),
    "rotary inertia": (MOVING_SHELL, replace(MOVING_SHELL, rotary="cell")),
    "damping by mass": (MOVING, replace(MOVING, damping=1.0)),
    "damping by stiffness": (MOVING, replace(MOVING, stiff_damping=1e-4)),
    "contact and friction": (SHELL, replace(SHELL, contact=True)),
    "history, explicit": (EXPLICIT, replace(EXPLICIT, law="potential")),
    "energy ledger": (MOVING, replace(MOVING, ledger=True)),
}
"""Feature -> the scene without and with it."""
QUICK = ("hook at all", "hysteresis in shear", "damping by mass")


class NoStiffness:
    """A linear law that does not tell its stiffness, so that it gets a hook."""

    symmetric = True

    def __init__(self, law):
        self.initial_state, self.respond = law.initial_state, law.respond


def law_of(scene):
    linear = StVenantKirchhoff.from_fabric(FABRIC)
    if scene.law == "linear":
        return linear
    if scene.law == "potential":
        return Potential(FABRIC)
    return NoStiffness(linear) if scene.law == "hooked" else Woven(FABRIC, shear_hysteresis=scene.law == "whole")


def plane(scene, cells, comm):
    """The mesh, space and unknown of a scene in the plane, its internal work, the points of its law if any."""
    domain = meshing.read(STRIP, comm, gdim=2, nx=cells[0], ny=cells[1], length=LENGTH, width=WIDTH)
    V = fem.functionspace(domain.mesh, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    strain, law, points = kinematics.membrane_strain(u, yarns.plane_axes(domain.mesh, 0.0)), law_of(scene), []
    if scene.law == "linear":
        stress, dx = (
            weakform.elastic_stress(domain.mesh, law.stiffness, strain),
            ufl.dx(metadata={"quadrature_degree": 2}),
        )
    else:
        cloth = hook.LawHook(law, strain, domain.mesh, 2)
        stress, dx, points = cloth.stress, cloth.dx, [cloth.points]
    inner = weakform.internal(stress, strain, u, v, fem.Constant(domain.mesh, H), dx)
    return domain, V, u, inner, points


def thick(cloth):
    """Internal work of a sheet whose strain has the part that goes with the square of the height, too."""
    axes = yarns.surface_axes(cloth.domain.mesh, (1, 0, 0), directors.DEGREE)
    more = kinematics.quadratic_strain(cloth.director, cloth.shell.normal, axes)
    strain = ufl.as_vector([*(cloth.strain[i] for i in range(6)), *(more[i] for i in range(3))])
    through = Section(cloth.law, H, len(cloth.points[0].law.heights), quadratic=True)
    return InternalWork(cloth.shell, cloth.q, [(strain, through, cloth.dx), cloth.terms[0].parts[1]])


def _lying(cloth):
    """Contact of a sheet with a table on which it lies, and with itself."""
    from fabric_fenicsx.contact.bodies import Box
    from fabric_fenicsx.contact.contact import Contact

    table = Box((2 * LENGTH, 2 * WIDTH, 0.1), (LENGTH / 2, WIDTH / 2, -0.05 - 1.5 * H))
    return Contact(cloth, [table], friction=0.3, reach=H, stiffness=1.0)


def pulled(steps):
    """Displacement of the end after a number of steps, m."""
    return PULL * LENGTH * (steps / (1.25 * STEPS)) ** 2


class Built:
    """A scene that is stretched step by step. Public: `unknowns`, `batches`, `history`, `iteration`."""

    def __init__(self, scene, cells, comm):
        self.run, self.end = None, None
        if scene.level == "plane":
            self.domain, space, q, inner, points = plane(scene, cells, comm)
            self.end = fem.Constant(self.domain.mesh, 0.0)
            bcs = supports.hinge(self.domain, space, "fixed_end")
            bcs += supports.lead(self.domain, space, "pulled_end", 0, self.end)
            self.solver = statics.StaticSolver(inner, q, bcs)
        else:
            cloth = self._sheet(scene, cells, comm)
            q, terms, points = cloth.q, cloth.terms, cloth.points
            if scene.quadratic:
                work = thick(cloth)
                terms, points = [work], work.points
            external = self._load(scene, cloth)
            ends, along = (("middle", "end"), 1) if scene.curved else (("fixed_end", "pulled_end"), 0)
            bcs = supports.clamp(self.domain, cloth.space, ends[0])
            bcs += supports.lead(self.domain, cloth.space, ends[1], along, self.end)
            if scene.level == "membrane":  # flat and without tension it has no stiffness across itself
                bcs += supports.lead(self.domain, cloth.space, "sheet", 2, 0.0)
            if scene.contact:
                terms = [*terms, *_lying(cloth).terms]
            if external is not None:
                terms = [*terms, -external]
            if scene.moving:
                self._move(scene, cloth, terms, bcs)
            else:
                self.solver = statics.StaticSolver(terms, q, bcs, space=cloth.shell)
        works = [term for term in self.solver.terms if isinstance(term, InternalWork)]
        self.unknowns = q.x.petsc_vec.getSize() if scene.explicit else self.solver.begin().getSize()
        self.batches = sum(len(work.parts) for work in works)
        arrays = [array for law in points for array in (law.history.committed, law.history.trial)]
        if self.run is not None:
            moved = self.run.motion
            arrays += [*moved.accepted.values(), moved.velocity.x.array, moved.acceleration.x.array]
        self.history = comm.allreduce(sum(array.nbytes for array in arrays))
        times = np.arange(1, STEPS + 1) * DT
        self._way = self.run.march(times[-1], DT) if self.run else statics.march(self.solver, self._pull, times)

    def _sheet(self, scene, cells, comm):
        triangles = int(scene.element == "regge")
        numbers = {"nx": cells[0], "ny": cells[1], "triangles": triangles}
        if scene.curved:
            self.domain = meshing.read(
                meshing.MESHES / "cylinder.geo", comm, radius=LENGTH, length=WIDTH, angle=60, order=2, **numbers
            )
        else:
            self.domain = meshing.read(STRIP, comm, gdim=3, length=LENGTH, width=WIDTH, **numbers)
        self.end = fem.Constant(self.domain.mesh, 0.0)
        G = FABRIC.shear.modulus[0]
        more = {"shear": (G, G), "layers": scene.layers, "element": scene.element} if scene.level == "shell" else {}
        more |= {"layers": None, "bending": Bending.from_fabric(FABRIC)} if scene.bending else {}
        return sheet.Sheet(self.domain, law_of(scene), H, warp=(0, 1, 0) if scene.curved else (1, 0, 0),
                           kinematics=scene.level, **more)  # fmt: skip

    def _load(self, scene, cloth):
        """Virtual work of the load, or None."""
        if scene.load == "none":
            return None
        dx = ufl.Measure("dx", self.domain.mesh, metadata={"quadrature_degree": 4})
        p = fem.Constant(self.domain.mesh, 1.0)
        if scene.load == "follower":
            return weakform.pressure(p, cloth.u, cloth.v, dx)
        return weakform.surface_traction(ufl.as_vector([0.0, 0.0, p]), cloth.v, dx)

    def _move(self, scene, cloth, terms, bcs):
        moved = motion.Motion(cloth.q, cloth.mass(AREAL_MASS, scene.rotary), cloth.shell, damping=scene.damping)
        if scene.stiff_damping:
            C = H * cloth.law.stiffness
            damping = weakform.stiffness_damping(
                scene.stiff_damping, C, cloth.strain, cloth.q, moved.velocity, cloth.v, cloth.dx
            )
            terms = [*terms, damping]
        if scene.explicit:
            self.run = self.solver = explicit.CentralDifference(moved, terms, bcs, set_load=self._pull)
            return
        run = newmark.Newmark(moved, terms, bcs, set_load=self._pull)
        if scene.ledger:
            energy.Ledger(run)
        self.run, self.solver = run, run.solver

    def _pull(self, t):
        self.end.value = pulled(t / DT)

    def iteration(self, steps):
        """Processor time of a Newton iteration in s, or of an explicit step: that of a step by their number, the least
        of the next steps."""
        least = np.inf
        for _ in range(steps):
            clock = time.process_time()
            step = next(self._way)
            least = min(least, (time.process_time() - clock) / step.newton_iterations)
        return least


def by_hand(cells, comm):
    """The elastic plane scene in plain DOLFINx: what moves its end, and its problem."""
    domain = mesh.create_rectangle(comm, [(0, 0), (LENGTH, WIDTH)], cells, mesh.CellType.quadrilateral)
    V = fem.functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    G, C = ufl.grad(u), fem.Constant(domain, StVenantKirchhoff.from_fabric(FABRIC).stiffness)
    E = (G + G.T + G.T * G) / 2
    strain = ufl.as_vector([E[0, 0], E[1, 1], 2 * E[0, 1]])
    dx = ufl.dx(metadata={"quadrature_degree": 2})
    residual = fem.Constant(domain, H) * ufl.inner(C * strain, ufl.derivative(strain, u, v)) * dx
    end, bcs = fem.Constant(domain, 0.0), []
    for at, axis, value in ((0.0, 0, fem.Constant(domain, 0.0)), (0.0, 1, fem.Constant(domain, 0.0)), (LENGTH, 0, end)):
        edges = mesh.locate_entities_boundary(domain, 1, lambda x, at=at: np.isclose(x[0], at))
        bcs.append(fem.dirichletbc(value, fem.locate_dofs_topological(V.sub(axis), 1, edges), V.sub(axis)))
    options = {"snes_linesearch_type": "basic", "snes_rtol": 1e-6, "snes_error_if_not_converged": True,
               "ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}  # fmt: skip
    return u, end, NonlinearProblem(residual, u, bcs=bcs, petsc_options_prefix="by_hand_", petsc_options=options)
