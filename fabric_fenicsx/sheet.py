"""A sheet on a surface mesh: kinematics, laws and masses put together, ready for supports and loads."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import ufl
from dolfinx import fem
from ufl.core.expr import Expr
from ufl.form import Form

from .errors import InputError
from .laws import HasStiffness, Law
from .material import Kinematics, Material, Patchwork
from .output.showing import Showing
from .shell import assumed_strain, directors, kinematics
from .solvers import motion
from .solvers.descent import Search, StableSolver
from .solvers.energy import Ledger
from .solvers.explicit import CentralDifference
from .solvers.newmark import Newmark
from .surfaces import yarns
from .surfaces.meshing import Domain
from .terms import weakform
from .terms.form import FormTerm
from .terms.hook import LawHook
from .terms.points import LawPoints
from .terms.term import Term
from .terms.work import InternalWork

type Loads = Form | int | Sequence[Form | Term]
"""Virtual work of forces, or a list of that and of terms; 0 for nothing."""
type Rotary = Literal["thickness", "cell", "none"]
ROTARY: dict[Rotary, float | None] = {"thickness": 0.0, "cell": 3.0, "none": None}
"""Inertia of directors -> its `reach` in `weakform.rotary_inertia`.

Poke of muslin, 20 x 20, the hardest: 75 cuts, or none that helps, with a reach of 1; 37 with 1.5; 25 to 30 with 3.
"""


class Sheet(Showing):
    """A shell or a membrane in space, at rest, with nothing that holds or loads it.

    Hold it with `supports`, load it with terms of `weakform` on its test function `v`, and solve:

        cloth = Sheet(meshing.read("sheet.geo"), Potential(fabric), fabric.thickness, shear=(G, G))
        load = weakform.pressure(p, cloth.u, cloth.v, cloth.dx)
        solver = cloth.equilibrium(supports.clamp(cloth.domain, cloth.space, "rim"), load)

    Of several materials, each on a group of cells:

        coat = Sheet(domain, {"panel": Material.of(blend), "lining": Material.of(muslin, warp=(0, 1, 0))})

    Args:
        domain: mesh and groups.
        law: see `laws.Law`; one that is linear and symmetric (it has `stiffness`) needs no hook. Or materials by the
            names of their groups, which cover every cell once; what follows up to `warp`, `layers` and `bending` is
            then theirs.
        thickness: m.
        shear: transverse shear moduli (G13, G23) in Pa, of a shell.
        warp: see `yarns.surface_axes`.
        kinematics: "shell" or "membrane".
        element: of a shell, see `directors.ELEMENTS`.
        layers: through the thickness of a shell that bends as the law does, 3 unless told, see `laws.section`.
        reach: see `weakform.shear_stiffness`.
        bending: a bending law of its own instead of layers, see `laws.bending`.

    Raises InputError. Public: `domain`, `q` (unknown: displacement, or displacement and director), `test`,
    `u` and `v` (the displacement's part of both, for loads), `space` (for `supports`), `shell` (a ShellSpace or
    None), `dx`, `strain`; `terms`, which a solver takes, and what is sewn on may be added to; `points`, the `LawPoints`
    of laws that are not linear; `stored`, the form of the energy outside of laws; `velocity`; `materials`; `thickness`
    and `areal_mass`, numbers or functions that are constant in each cell.
    """

    def __init__(
        self,
        domain: Domain,
        law: Law | Mapping[str, Material],
        thickness: float | None = None,
        shear: tuple[float, float] | None = None,
        *,
        warp: Sequence[float] | Expr | None = None,
        kinematics: Kinematics = "shell",
        element: str | None = None,
        layers: int | None = None,
        reach: float = weakform.SHEAR_REACH,
        bending: Law | None = None,
    ) -> None:
        if kinematics not in ("shell", "membrane"):
            raise InputError(f"kinematics={kinematics!r} is neither 'shell' nor 'membrane'.")
        if not isinstance(law, Mapping):
            h, w = math.nan if thickness is None else thickness, (1.0, 0.0, 0.0) if warp is None else warp
            law = {"": Material(law=law, thickness=h, shear=shear, warp=w, layers=layers, bending=bending)}
        elif any(given is not None for given in (thickness, shear, warp, layers, bending)):
            raise InputError("Thickness, shear, warp, layers and bending are those of each material; leave them out.")
        for name, material in law.items():
            material.check(name, kinematics, domain.mesh.comm)
        self.domain, self.materials, self._patches = domain, dict(law), Patchwork(domain, law)
        self.law = next(iter(law.values())).law
        self.thickness = self._patches.each({name: material.thickness for name, material in law.items()})
        self.stored = Form([])
        self.terms: list[Term] = []
        self.points: list[LawPoints] = []
        self.shell: directors.ShellSpace | None = None
        self._velocity: fem.Function | None = None
        self.warp = self._patches.warp()
        self.linear: list[tuple[np.ndarray | None, np.ndarray]] = []
        if kinematics == "membrane":
            self._build_membrane(element)
        else:
            self._build_shell(element, reach)

    def _build_shell(self, element: str | None, reach: float) -> None:
        mesh, of, each = self.domain.mesh, self.materials, self._patches.each
        self.space = self.shell = space = directors.ShellSpace(mesh, element)
        self.q, self.test = space.function(), ufl.TestFunction(space.V)
        (self.u, self.director), (self.v, self.delta) = ufl.split(self.q), ufl.split(self.test)
        self.dx = space.dx
        through = {name: material.through() for name, material in of.items()}
        h = self.thickness if isinstance(self.thickness, Expr) else fem.Constant(mesh, self.thickness)
        limits = each({name: material.shear_limit(through[name]) for name, material in of.items()})
        limit: dict[str, Any] = {"reach": reach, "bending": limits, "curvature": space.curvature()}
        shear = [each({name: material.shear[k] for name, material in of.items()}) for k in (0, 1)]  # type: ignore[index]
        most = each({name: max(material.shear or ()) for name, material in of.items()})
        variation = weakform.shear_variation(mesh, most, h, **limit)
        self.strain, across = assumed_strain.shell_strains(space, self.q, self.warp, variation)
        across_stiffness = weakform.shear_stiffness(mesh, (shear[0], shear[1]), h, **limit)
        self.stored += weakform.stored(ufl.dot(across_stiffness, across), across, 1.0, space.dx_shear)
        for name, law in through.items():
            response: Law | Expr = law
            if isinstance(law, HasStiffness):
                C, part = fem.Constant(mesh, law.stiffness), each({name: 1.0})
                self.linear.append((self._patches.cells[name], law.stiffness))
                self.stored += weakform.stored(ufl.dot(C, self.strain), self.strain, part, self.dx)
                response = C if law.symmetric else law
            parts = [(self.strain, response, self.dx), (across, across_stiffness, space.dx_shear)]
            work = InternalWork(space, self.q, parts, cells=self._patches.cells[name])
            self.terms.append(work)
            self.points += work.points

    def _build_membrane(self, element: str | None) -> None:
        mesh = self.domain.mesh
        degree = 2 if mesh.basix_cell().name == "triangle" and element != "p1" else 1
        self.space = fem.functionspace(mesh, ("Lagrange", degree, (3,)))
        self.q, self.test = fem.Function(self.space), ufl.TestFunction(self.space)
        self.u, self.v = self.q, self.test
        self.dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 2, "quadrature_scheme": "default"})
        self.strain = kinematics.membrane_strain(self.u, yarns.surface_axes(mesh, self.warp, 2))
        for name, material in self.materials.items():
            law, h, dx = material.law, fem.Constant(mesh, float(material.thickness)), self._patches.over(name, self.dx)
            assert law is not None
            energy, cells = None, self._patches.cells[name]
            if isinstance(law, HasStiffness):
                stress = weakform.elastic_stress(mesh, law.stiffness, self.strain)
                energy = weakform.stored(stress, self.strain, h, dx)
                self.stored += energy
                self.linear.append((cells, law.stiffness))
            else:
                hook = LawHook(law, self.strain, mesh, 2, factor=material.thickness, cells=cells, dx=dx)
                stress = hook.stress
                self.points.append(hook.points)
            internal = weakform.internal(stress, self.strain, self.q, self.test, h, dx)
            self.terms.append(FormTerm(internal, self.q, energy=energy, symmetric=law.symmetric))

    @property
    def areal_mass(self) -> Expr | float:
        """Of the materials, kg/m2. Raises InputError for one that has none."""
        return self._patches.areal_mass()

    def mass(self, areal_mass: Expr | float, rotary: Rotary = "thickness") -> Form:
        """Bilinear form of the mass for `motion.Motion`; areal_mass in kg/m2.

        rotary: inertia of directors, a name in `ROTARY`: that of the thickness (5.75), that of a cell, or none (see
        `weakform.rotary_inertia`). Raises InputError.
        """
        if rotary not in ROTARY:
            raise InputError(f"rotary={rotary!r} is not one of {', '.join(ROTARY)}.")
        if not isinstance(areal_mass, Expr) and not (np.isfinite(areal_mass) and areal_mass > 0.0):
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

    def weight(self, areal_mass: Expr | float, acceleration: Expr) -> Form:
        """Virtual work of the weight; subtract it. areal_mass: in kg/m2; acceleration: a vector in m/s2."""
        return weakform.gravity(areal_mass, acceleration, self.v, self.dx)

    # -- ready to be solved ------------------------------------------------------------------------------------------

    def equilibrium(
        self,
        bcs: Sequence[fem.DirichletBC],
        loads: Loads = 0,
        *,
        rtol: float = 1e-6,
        options: dict[str, object] | None = None,
        search: Search = "energy",
    ) -> StableSolver:
        """The solver of this sheet at rest, for `statics.march`; bcs, rtol, options: see `statics.StaticSolver`.

        loads: virtual work of the forces on the sheet, in J; what resists, such as a spring, is negative. Or a list of
        such forms and of terms, as of `contact`, which count as they are.
        search: downhill to a stable state, where law and loads have an energy (`descent.StableSolver`), or Newton's
        method alone.
        """
        work = self._residual(loads)
        return StableSolver(work, self.q, bcs, rtol=rtol, options=options, space=self.shell, search=search)

    def newmark(
        self,
        areal_mass: Expr | float,
        bcs: Sequence[fem.DirichletBC],
        loads: Loads = 0,
        *,
        rho: float = 0.8,
        damping: float = 0.0,
        rotary: Rotary = "cell",
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
        areal_mass: Expr | float,
        bcs: Sequence[fem.DirichletBC],
        loads: Loads = 0,
        *,
        damping: float = 0.0,
        rotary: Rotary = "cell",
        **settings: Any,
    ) -> tuple[CentralDifference, Ledger]:
        """As `newmark`, in explicit motion; damping in 1/s; settings: of `explicit.CentralDifference`."""
        return self._in_motion(CentralDifference, areal_mass, rotary, {"damping": damping}, bcs, loads, settings)

    def _in_motion(
        self,
        kind: Any,
        areal_mass: Expr | float,
        rotary: Rotary,
        rule: dict[str, Any],
        bcs: Sequence[fem.DirichletBC],
        loads: Loads,
        settings: dict[str, Any],
    ) -> tuple[Any, Ledger]:
        moved = motion.Motion(self.q, self.mass(areal_mass, rotary), self.shell, velocity=self._velocity, **rule)
        run = kind(moved, self._residual(loads), bcs, **settings)
        return run, Ledger(run)

    def _residual(self, loads: Loads) -> list[Form | Term]:
        """Terms of the sheet and of what loads it."""
        parts: Sequence[Any] = loads if isinstance(loads, Sequence) else [loads]
        return [*self.terms, *(-part if isinstance(part, Form) else part for part in parts if part != 0)]
