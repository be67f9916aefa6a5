"""What a sheet is made of: materials, and the cells that each of them has."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from ufl.core.expr import Expr

from .errors import InputError
from .fabrics import Fabric
from .laws import HasStiffest, HasStiffness, Law, Poisson, checks, named
from .laws.own_bending import OwnBending
from .laws.section import Section
from .laws.svk import StVenantKirchhoff
from .surfaces.meshing import Domain, name_cell

type Kinematics = Literal["shell", "membrane"]


@dataclass(frozen=True, kw_only=True)
class Material:
    """One material of a sheet.

    Args:
        law: of the plane, see `laws.Law`; None where a `section` is given.
        thickness: m; of a `section` its own, if it tells one.
        shear: transverse shear moduli (G13, G23) in Pa, of a shell.
        warp: see `yarns.surface_axes`; a direction, or a UFL vector.
        layers: through the thickness of a shell that bends as the law does, 3 unless told, see `laws.section`.
        bending: a bending law of its own instead, see `laws.bending`.
        section: in place of law, layers and bending: a law of (E11, E22, 2 E12, K11, K22, 2 K12) whose stress are
            resultants, such as a `lay_up.LayUp`, or its constant stiffness (6, 6) in N/m, N and N m.
        areal_mass: kg/m2, of a motion and of its weight.
    """

    law: Law | None = None
    thickness: float = math.nan
    shear: tuple[float, float] | None = None
    warp: Sequence[float] | Expr = (1.0, 0.0, 0.0)
    layers: int | None = None
    bending: Law | None = None
    section: Any = None
    areal_mass: float | None = None

    @classmethod
    def of(
        cls,
        fabric: Fabric,
        *,
        law: str = named.DEFAULT,
        poisson: Poisson = "measured",
        shear_hysteresis: bool = True,
        bending: str | None = None,
        layers: int | None = None,
        warp: Sequence[float] | Expr = (1.0, 0.0, 0.0),
    ) -> Self:
        """Of a measured fabric; law and bending by their names in `laws.named`, bending "" for a membrane.

        By default it bends as the fabric's own bending law says, or by the law in layers if their number is given.
        """
        G = fabric.shear.modulus[0]
        return cls(
            law=named.law(law, fabric, poisson, shear_hysteresis),
            thickness=fabric.thickness,
            shear=(G, G),
            warp=warp,
            layers=layers,
            bending=named.bending(bending or ("own" if layers is None and bending is None else "layers"), fabric),
            areal_mass=fabric.areal_mass,
        )

    def __post_init__(self) -> None:
        if np.isnan(self.thickness):
            object.__setattr__(self, "thickness", getattr(self.section, "thickness", math.nan))

    def check(self, name: str, kinematics: Kinematics, comm: MPI.Comm) -> None:
        """Raise InputError, on every rank, for what cannot be a membrane or a shell; name: "", or of its group."""
        try:
            self._check(kinematics, comm)
        except InputError as error:
            raise InputError(f"The material {name!r}: {error}" if name else str(error)) from None

    def _check(self, kinematics: Kinematics, comm: MPI.Comm) -> None:
        flat = kinematics == "membrane"
        if self.bending is not None and (self.layers is not None or flat):
            other = "a membrane, which does not bend" if flat else f"layers={self.layers}"
            raise InputError(f"A bending law does not go with {other}; leave one of them out.")
        if not (np.isfinite(self.thickness) and self.thickness > 0.0):
            raise InputError(f"A thickness of {self.thickness!r} m is not a positive number.")
        if (self.law is None) == (self.section is None):
            raise InputError("A material has a law or a section: give one of them.")
        if self.section is not None and (flat or self.bending is not None or self.layers is not None):
            raise InputError("A section is that of a shell, and goes with no bending law and no layers.")
        for given in (self.law, self.bending):
            if given is not None:
                _look_at(given, comm)
        if not flat and self.shear is None:
            raise InputError("A shell needs two transverse shear moduli, shear=(G13, G23) in Pa.")
        if not flat and not all(np.isfinite(G) and G > 0.0 for G in self.shear or ()):
            raise InputError(f"The transverse shear moduli {self.shear!r} Pa are not two positive numbers.")
        if self.areal_mass is not None and not (np.isfinite(self.areal_mass) and self.areal_mass > 0.0):
            raise InputError(f"An areal mass of {self.areal_mass!r} kg/m2 is not a positive number.")

    def through(self) -> Law:
        """The law of strain and curvature, whose stress are resultants. Raises InputError."""
        if self.law is not None:
            if self.bending is not None:
                return OwnBending(self.law, self.thickness, self.bending)
            return Section(self.law, self.thickness, 3 if self.layers is None else self.layers)
        if not hasattr(self.section, "respond"):
            if np.shape(self.section) != (6, 6):
                raise InputError(
                    f"A section is a law of six strains or a stiffness (6, 6), not {np.shape(self.section)}."
                )
            return StVenantKirchhoff(self.section)
        return self.section

    def shear_limit(self, through: Law) -> float:
        """What limits the transverse shear of a thin shell, Pa; see `weakform.shear_stiffness`."""
        least = max(self.shear or (0.0,))
        if isinstance(through, Section | OwnBending):
            return through.shear_limit(least)
        stiffest: object = through.stiffest if isinstance(through, HasStiffest) else through
        if isinstance(stiffest, HasStiffness):
            C = stiffest.stiffness
        else:  # as it is at rest
            C = through.respond(np.zeros((1, 6)), through.initial_state[None])[1][0]
        D = np.asarray(C)[3:5, 3:5]
        nu = np.sqrt(abs(D[0, 1] * D[1, 0] / (D[0, 0] * D[1, 1])))
        # of layers of the same bending stiffness
        return max(least, float(6 * D.diagonal().max() * (1 - nu) / self.thickness**3))


class Patchwork:
    """Materials and their cells. Public: `materials` by name, and `cells`, local ones of each (None: all).

    Raises InputError, on every rank, for a cell that has no material, or two.
    """

    def __init__(self, domain: Domain, materials: Mapping[str, Material]) -> None:
        if not materials:
            raise InputError("A sheet has no material: give one for each group of cells.")
        self.materials, self._mesh = dict(materials), domain.mesh
        self.cells: dict[str, np.ndarray | None] = dict.fromkeys(materials)
        self._numbers: list[tuple[int, np.ndarray]] = []
        if list(materials) == [""]:
            return
        own = domain.mesh.topology.index_map(2).size_local
        of = np.full(own + domain.mesh.topology.index_map(2).num_ghosts, -1)
        for k, name in enumerate(materials):
            if 2 not in domain.dims(name):
                raise InputError(f"The group {name!r} is not one of cells, and cannot have a material.")
            _, members = domain.entities(name, 2)
            twice = members[of[members] >= 0]
            if (where := name_cell(domain.mesh, twice[twice < own])) is not None:
                raise InputError(f"In {where} there are two materials, of {name!r} and of a group before it.")
            of[members] = k
        if (where := name_cell(domain.mesh, np.flatnonzero(of[:own] < 0))) is not None:
            raise InputError(f"In {where} there is no material: it is in none of {', '.join(sorted(materials))}.")
        if len(materials) == 1:
            return
        self.cells = {name: np.flatnonzero(of == k).astype(np.int32) for k, name in enumerate(materials)}
        self._numbers = [(k, np.flatnonzero(of[:own] == k).astype(np.int32)) for k in range(len(materials))]

    def over(self, name: str, dx: ufl.Measure) -> ufl.Measure:
        """A measure of all cells on those of a material."""
        if self.cells[name] is None:
            return dx
        k = list(self.cells).index(name)
        return ufl.Measure("dx", self._mesh, subdomain_data=self._numbers, subdomain_id=k, metadata=dx.metadata())

    def each(self, values: Mapping[str, float]) -> Expr | float:
        """A number for each material, 0 where none is given; of a single one the number itself."""
        if len(self.cells) == 1:
            return next(iter(values.values()))
        field = fem.Function(fem.functionspace(self._mesh, ("DG", 0)))
        for name, value in values.items():
            field.x.array[field.function_space.dofmap.list[self.cells[name], 0]] = value
        field.x.scatter_forward()
        return field

    def areal_mass(self) -> Expr | float:
        """kg/m2. Raises InputError for a material that has none."""
        known = {}
        for name, material in self.materials.items():
            if material.areal_mass is None:
                whose = f"material {name!r}" if name else "sheet"
                raise InputError(f"The {whose} has no areal mass: give it one in kg/m2.")
            known[name] = material.areal_mass
        return self.each(known)

    def warp(self) -> Sequence[float] | Expr:
        """Of the whole sheet, for `yarns.surface_axes`."""
        given = [material.warp for material in self.materials.values()]
        if len(given) == 1:
            return given[0]
        shares: list[Any] = []
        for name, warp in zip(self.materials, given, strict=True):
            if not isinstance(warp, Expr):
                w = np.asarray(warp, dtype=float)
                if w.shape != (3,):
                    raise InputError(f"The warp of the material {name!r} must be three numbers, and not {warp!r}.")
                warp = fem.Constant(self._mesh, w)
            shares.append(self.each({name: 1.0}) * warp)
        total = shares[0]
        for share in shares[1:]:
            total += share
        return total


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
