"""A sheet of one material on a surface mesh: kinematics, law and mass put together, ready for supports and loads."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from ufl.core.expr import Expr
from ufl.form import Form

from .errors import InputError
from .laws import Law, checks
from .laws.own_bending import OwnBending
from .laws.section import Section
from .output.showing import Showing
from .shell import assumed_strain, directors, kinematics
from .solvers import motion
from .solvers.energy import Ledger
from .solvers.explicit import CentralDifference
from .solvers.newmark import Newmark
from .solvers.statics import StaticSolver
from .surfaces import yarns
from .surfaces.meshing import Domain
from .terms import weakform
from .terms.form import FormTerm
from .terms.hook import LawHook
from .terms.points import LawPoints
from .terms.term import Term
from .terms.work import InternalWork

ROTARY = {"thickness": 0.0, "cell": 3.0, "none": None}
"""Inertia of directors -> its `reach` in `weakform.rotary_inertia`.

Poke of muslin, 20 x 20, the hardest: 75 cuts, or none that helps, with a reach of 1; 37 with 1.5; 25 to 30 with 3.
"""


class Sheet(Showing):
    """A shell or a membrane in space, at rest, with nothing that holds or loads it.

    Hold it with `supports`, load it with terms of `weakform` on its test function `v`, and solve:

        cloth = Sheet(meshing.read("sheet.geo"), Potential(fabric), fabric.thickness, shear=(G, G))
        load = weakform.pressure(p, cloth.u, cloth.v, cloth.dx)
        solver = cloth.equilibrium(supports.clamp(cloth.domain, cloth.space, "rim"), load)

    thickness in m; law: see `laws.Law`; one that is linear and symmetric (it has `stiffness`) needs no hook.
    shear: transverse shear moduli (G13, G23) in Pa, of a shell. warp: see `yarns.surface_axes`.
    kinematics: "shell" or "membrane"; element: of a shell, see `directors.ELEMENTS`. reach: see
    `weakform.shear_stiffness`. A shell bends as the law does in `layers` through the thickness, 3 unless told, see
    `laws.section`; or by a law of its own, `bending`, see `laws.bending`.

    Raises InputError. Public: `domain`, `q` (unknown: displacement, or displacement and director), `test`,
    `u` and `v` (the displacement's part of both, for loads), `space` (for `supports`), `shell` (a ShellSpace or
    None), `dx`, `strain`; `terms`, which a solver takes; `points`, the `LawPoints` of a law that is not linear;
    `stored`, the form of the energy outside of laws; `velocity`.
    """

    def __init__(
        self,
        domain: Domain,
        law: Law,
        thickness: float,
        shear: tuple[float, float] | None = None,
        warp: Sequence[float] | Expr = (1.0, 0.0, 0.0),
        kinematics: str = "shell",
        element: str | None = None,
        layers: int | None = None,
        reach: float = weakform.SHEAR_REACH,
        bending: Law | None = None,
    ) -> None:
        if bending is not None and (layers is not None or kinematics == "membrane"):
            other = "a membrane, which does not bend" if kinematics == "membrane" else f"layers={layers}"
            raise InputError(f"A bending law does not go with {other}; leave one of them out.")
        if kinematics not in ("shell", "membrane"):
            raise InputError(f"kinematics={kinematics!r} is neither 'shell' nor 'membrane'.")
        if not (np.isfinite(thickness) and thickness > 0.0):
            raise InputError(f"A thickness of {thickness!r} m is not a positive number.")
        for given in (law, bending) if bending is not None else (law,):
            _look_at(given, domain.mesh.comm)
        self.domain, self.law, self.thickness = domain, law, float(thickness)
        self.stored = Form([])
        self.terms: list[Term] = []
        self.points: list[LawPoints] = []
        self.shell: directors.ShellSpace | None = None
        self._velocity: fem.Function | None = None
        self.warp = warp
        if kinematics == "membrane":
            self._build_membrane(warp, element)
        elif shear is None:
            raise InputError("A shell needs two transverse shear moduli, shear=(G13, G23) in Pa.")
        elif not all(np.isfinite(G) and G > 0.0 for G in shear):
            raise InputError(f"The transverse shear moduli {shear!r} Pa are not two positive numbers.")
        else:
            through: Section | OwnBending
            if bending is None:
                through = Section(law, thickness, 3 if layers is None else layers)
            else:
                through = OwnBending(law, thickness, bending)
            self._build_shell(warp, element, through, shear, reach)

    def _build_shell(
        self,
        warp: Sequence[float] | Expr,
        element: str | None,
        through: Section | OwnBending,
        shear: tuple[float, float],
        reach: float,
    ) -> None:
        mesh, h = self.domain.mesh, fem.Constant(self.domain.mesh, self.thickness)
        self.space = self.shell = space = directors.ShellSpace(mesh, element)
        self.q, self.test = space.function(), ufl.TestFunction(space.V)
        (self.u, self.director), (self.v, self.delta) = ufl.split(self.q), ufl.split(self.test)
        self.dx = space.dx
        self.linear = linear = getattr(through, "stiffness", None)
        limit = (h, reach, through.shear_limit(max(shear)), space.curvature())
        variation = weakform.shear_variation(mesh, max(shear), *limit)
        self.strain, across = assumed_strain.shell_strains(space, self.q, warp, variation)
        across_stiffness = weakform.shear_stiffness(mesh, shear, *limit)
        response: Law | Expr = through
        if linear is not None:
            response = fem.Constant(mesh, linear)
            self.stored += weakform.stored(ufl.dot(response, self.strain), self.strain, 1.0, self.dx)
        self.stored += weakform.stored(ufl.dot(across_stiffness, across), across, 1.0, space.dx_shear)
        parts = [(self.strain, response, self.dx), (across, across_stiffness, space.dx_shear)]
        work = InternalWork(space, self.q, parts)
        self.terms, self.points = [work], work.points

    def _build_membrane(self, warp: Sequence[float] | Expr, element: str | None) -> None:
        mesh = self.domain.mesh
        degree = 2 if mesh.basix_cell().name == "triangle" and element != "p1" else 1
        self.space = fem.functionspace(mesh, ("Lagrange", degree, (3,)))
        self.q, self.test = fem.Function(self.space), ufl.TestFunction(self.space)
        self.u, self.v = self.q, self.test
        self.dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 2, "quadrature_scheme": "default"})
        self.strain = kinematics.membrane_strain(self.u, yarns.surface_axes(mesh, warp, 2))
        h = fem.Constant(mesh, self.thickness)
        self.linear = linear = getattr(self.law, "stiffness", None)
        if linear is None:
            hook = LawHook(self.law, self.strain, mesh, 2, factor=self.thickness)
            stress, dx, self.points = hook.stress, hook.dx, [hook.points]
        else:
            stress, dx = weakform.elastic_stress(mesh, linear, self.strain), self.dx
            self.stored = weakform.stored(stress, self.strain, h, dx)
        internal = weakform.internal(stress, self.strain, self.q, self.test, h, dx)
        energy = self.stored if linear is not None else None
        self.terms = [FormTerm(internal, self.q, energy=energy, symmetric=self.law.symmetric)]

    def mass(self, areal_mass: float, rotary: str = "thickness") -> Form:
        """Bilinear form of the mass for `motion.Motion`; areal mass in kg/m2.

        rotary: inertia of directors, a name in `ROTARY`: that of the thickness (5.75), that of a cell, or none (see
        `weakform.rotary_inertia`). Raises InputError.
        """
        if rotary not in ROTARY:
            raise InputError(f"rotary={rotary!r} is not one of {', '.join(ROTARY)}.")
        if not (np.isfinite(areal_mass) and areal_mass > 0.0):
            raise InputError(f"An areal mass of {areal_mass!r} kg/m2 is not a positive number.")
        dx = ufl.Measure("dx", self.domain.mesh, metadata={"quadrature_degree": 4})
        trial = ufl.TrialFunction(self.q.function_space)
        if self.shell is None:
            return weakform.inertia(areal_mass, trial, self.v, dx)
        u, d = ufl.split(trial)
        form = weakform.inertia(areal_mass, u, self.v, dx)
        reach = ROTARY[rotary]
        if reach is None:
            return form
        return form + weakform.rotary_inertia(areal_mass, self.thickness, d, self.delta, dx, reach)

    @property
    def velocity(self) -> Expr:
        """Velocity of the mid-surface in m/s, for loads of `newmark` and `explicit` that depend on it."""
        if self._velocity is None:
            self._velocity = fem.Function(self.q.function_space, name="velocity")
        return self._velocity if self.shell is None else ufl.split(self._velocity)[0]

    def weight(self, areal_mass: float, acceleration: Expr) -> Form:
        """Virtual work of the weight; subtract it. Areal mass in kg/m2, acceleration a vector in m/s2."""
        return weakform.gravity(areal_mass, acceleration, self.v, self.dx)

    # -- ready to be solved ------------------------------------------------------------------------------------------

    def equilibrium(
        self,
        bcs: Sequence[fem.DirichletBC],
        loads: Form | int = 0,
        rtol: float = 1e-6,
        options: dict[str, object] | None = None,
    ) -> StaticSolver:
        """The solver of this sheet at rest, for `statics.march`; bcs, rtol, options: see `statics.StaticSolver`.

        loads: virtual work of the forces on the sheet, in J; what resists, such as a spring, is negative.
        """
        return StaticSolver(self._residual(loads), self.q, bcs, rtol=rtol, options=options, space=self.shell)

    def newmark(
        self,
        areal_mass: float,
        bcs: Sequence[fem.DirichletBC],
        loads: Form | int = 0,
        rho: float = 0.8,
        damping: float = 0.0,
        rotary: str = "cell",
        lumped: bool = False,
        **settings: Any,
    ) -> tuple[Newmark, Ledger]:
        """This sheet in implicit motion, and the account of its energies.

        areal_mass in kg/m2; loads as for `equilibrium`; rho, damping, lumped: see `motion.Motion`; rotary: see `mass`;
        settings: of `newmark.Newmark`, such as set_load.
        """
        rule = {"rho": rho, "damping": damping, "lumped": lumped}
        return self._in_motion(Newmark, areal_mass, rotary, rule, bcs, loads, settings)

    def explicit(
        self,
        areal_mass: float,
        bcs: Sequence[fem.DirichletBC],
        loads: Form | int = 0,
        damping: float = 0.0,
        rotary: str = "cell",
        **settings: Any,
    ) -> tuple[CentralDifference, Ledger]:
        """As `newmark`, in explicit motion; settings: of `explicit.CentralDifference`."""
        return self._in_motion(CentralDifference, areal_mass, rotary, {"damping": damping}, bcs, loads, settings)

    def _in_motion(
        self,
        kind: Any,
        areal_mass: float,
        rotary: str,
        rule: dict[str, Any],
        bcs: Sequence[fem.DirichletBC],
        loads: Form | int,
        settings: dict[str, Any],
    ) -> tuple[Any, Ledger]:
        moved = motion.Motion(self.q, self.mass(areal_mass, rotary), self.shell, velocity=self._velocity, **rule)
        run = kind(moved, self._residual(loads), bcs, **settings)
        return run, Ledger(run)

    def _residual(self, loads: Form | int) -> list[Form | Term]:
        """Terms of the sheet and of what loads it."""
        return [*self.terms, -loads] if isinstance(loads, Form) else [*self.terms]


def _look_at(law: Law, comm: MPI.Comm) -> None:
    """Raise InputError, on every rank, for a law that does not keep its promises on one of them."""
    fault = None
    try:
        checks.glance(law)
    except InputError as error:
        fault = str(error)
    fault = next((said for said in comm.allgather(fault) if said), None)
    if fault is not None:
        raise InputError(f"The law {type(law).__name__} cannot be used: {fault}")
