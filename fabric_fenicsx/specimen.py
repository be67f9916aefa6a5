"""The tensile test of a strip in its grips, as a scene: of the thesis's section 7.2, and of an inverse simulation."""

from collections.abc import Callable
from typing import Literal, NamedTuple, get_args

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem

from . import sheet
from .errors import InputError
from .fabrics import Fabric
from .laws import Law
from .shell import kinematics
from .shell.directors import ShellSpace
from .solvers import statics
from .solvers.descent import Search, StableSolver
from .surfaces import yarns
from .surfaces.meshing import Domain
from .terms import hook, supports, weakform
from .terms.form import FormTerm
from .terms.points import LawPoints
from .terms.term import Term

type Ends = Literal["clamped", "free"]
type Level = Literal["plane", "membrane", "shell"]
FOUNDATION = 1.0  # N/m3


class Strip(NamedTuple):
    """A strip at rest: unknown, solver, the law's points, what pulls the end (m), unknowns of both ends along x."""

    u: fem.Function
    solver: statics.StaticSolver
    points: LawPoints
    pull: Callable[[float], None]
    ends: tuple[np.ndarray, np.ndarray]

    def renew(self, law: Law) -> None:
        """Back to rest, of another law of the same kind: in the plane or as a membrane, without a new form."""
        self.pull(0.0)
        self.u.x.array[:] = 0.0
        self.points.begin(law)
        self.solver.commit()


def strip(
    domain: Domain,
    fabric: Fabric,
    law: Law,
    angle: float = 0.0,
    *,
    ends: Ends = "clamped",
    degree: int = 1,
    level: Level = "plane",
    imperfection: float = 0.0,
    quadrature: int | None = None,
    search: Search | None = None,
) -> Strip:
    """A strip along x between its groups fixed_end and pulled_end, the warp at `angle` (radians) to x.

    `ends` may contract where they are "free"; the group pin then holds one point. `level` of the kinematics is
    "plane", "membrane" or "shell", the latter two of a mesh in space: there the ends stay in their plane and are
    gripped; while the strip is flat it does what it does in the plane. `imperfection` (m) bends a shell into a half
    wave. `quadrature` is the degree of polynomials whose work in the plane is integrated exactly, by
    default twice `degree`. `search`: see `sheet.Sheet.equilibrium`; by default along the energy.
    """
    for what, value, known in (("ends", ends, Ends), ("level", level, Level)):
        if value not in get_args(known.__value__):
            raise InputError(f"{what}={value!r} is not one of {', '.join(get_args(known.__value__))}.")
    plane, mesh, h = level == "plane", domain.mesh, fabric.thickness
    warp = (np.cos(angle), np.sin(angle), 0.0)
    shell: ShellSpace | None = None
    residual: list[Term]
    if level == "shell":
        x = mesh.geometry.x
        length = mesh.comm.allreduce(x[:, 0].max(initial=0.0), MPI.MAX)
        x[:, 2] = imperfection * np.sin(np.pi * x[:, 0] / length)
        element = "q1" if mesh.basix_cell().name == "quadrilateral" else None
        G = fabric.shear.modulus[0]
        bent = sheet.Sheet(domain, law, h, (G, G), warp=warp, element=element)
        u, shell, points, residual = bent.q, bent.shell, bent.points[0], bent.terms
    else:
        flat = fem.functionspace(mesh, ("Lagrange", degree, (mesh.geometry.dim,)))
        u, v = fem.Function(flat), ufl.TestFunction(flat)
        rule = quadrature or 2 * degree
        axes = yarns.plane_axes(mesh, angle) if plane else yarns.surface_axes(mesh, warp, rule)
        strain = kinematics.membrane_strain(u, axes)
        cloth = hook.LawHook(law, strain, mesh, degree=rule, factor=h)
        work = weakform.internal(cloth.stress, strain, u, v, fem.Constant(mesh, h), cloth.dx)
        residual = [FormTerm(work, u, symmetric=law.symmetric)]
        if not plane:
            # across itself a membrane without stress has no stiffness: it lies on a soft foundation
            residual.append(FormTerm(fem.Constant(mesh, FOUNDATION) * u[2] * v[2] * cloth.dx, u))
        points = cloth.points
    space = shell or flat

    end = fem.Constant(mesh, 0.0)
    held: list[tuple[str, int, float | fem.Constant]] = [("fixed_end", 0, 0.0), ("pulled_end", 0, end)]
    held += [(group, 1, 0.0) for group in (["fixed_end", "pulled_end"] if ends == "clamped" else ["pin"])]
    held += [] if plane else [("fixed_end", 2, 0.0), ("pulled_end", 2, 0.0)]
    bcs = [bc for group, axis, value in held for bc in supports.lead(domain, space, group, axis, value)]
    if shell is not None:
        bcs += supports.hold(domain, shell, "fixed_end") + supports.hold(domain, shell, "pulled_end")

    # under displacement control a line search takes far fewer iterations past the kinks of the law; but it does not
    # get a slack strip to bend, whose forces are a millionth of those that pulled it
    buckles = imperfection != 0.0
    options: dict[str, object] = {"snes_linesearch_type": "basic" if buckles else "bt"}
    rtol = 1e-10 if buckles else 1e-6
    solver = StableSolver(residual, u, bcs, rtol=rtol, options=options, space=shell, search=search or "energy")

    def pull(displacement: float) -> None:
        end.value = displacement

    fixed, pulled = (supports.unknowns(domain, space, group, 0) for group in ("fixed_end", "pulled_end"))
    return Strip(u, solver, points, pull, (fixed, pulled))
