"""What is recorded and drawn of a sheet: its displacement, and of each local cell, ghosts included, a row."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import basix
import numpy as np
from dolfinx import fem
from ufl.core.expr import Expr

from ..laws import Array
from ..shell.directors import ShellSpace
from ..surfaces.meshing import Domain
from ..surfaces.yarns import Yarns, surface_axes
from ..terms.points import LawPoints


class Shown(Protocol):
    """What `recording.Recorder` asks of a sheet: a `sheet.Sheet`, or `Plain`."""

    def displacement(self) -> fem.Function:
        """At present, m; always the same Function."""
        ...

    def cell_strain(self) -> Array:
        """E11, E22, 2 E12, and of a shell the curvatures K11, K22, 2 K12 (1/m)."""
        ...

    def cell_stress(self) -> Array:
        """S11, S22, S12, Pa; of a shell the mean through its thickness."""
        ...

    def cell_director(self) -> Array | None:
        """Unit vectors across a shell; None of what has none."""
        ...

    def yarns(self) -> Array:
        """Warp and weft as they are now, (cells, 2, 3)."""
        ...


class Touching(Protocol):
    """What `recording.Recorder` asks of the contact of a sheet, a `contact.contact.Contact`; on every rank."""

    bodies: list[Any]
    """Each with a `name` and triangles, `faces`."""

    def row(self) -> dict[str, float]:
        """Columns of a history."""
        ...

    def lost(self) -> float:
        """Energy that friction has taken, J."""
        ...

    def pressure(self, body: Any = None) -> Array:
        """At the nodes of the sheet, as the ranks number them, or at a body's corners, Pa."""
        ...

    def places(self, body: Any) -> Array:
        """Where the corners of a body are now, m."""
        ...


@dataclass
class Plain:
    """A sheet that was put together by hand. thickness in m: of a shell's law, 1 of others."""

    displacement: Callable[[], fem.Function]
    points: LawPoints
    yarns: Callable[[], Array]
    thickness: float = 1.0

    def cell_strain(self) -> Array:
        """Of the last evaluation."""
        return np.asarray(self.points.strain.mean(axis=1))

    def cell_stress(self) -> Array:
        """Of the last evaluation."""
        return np.asarray(self.points.stress[..., :3].mean(axis=1) / self.thickness)

    def cell_director(self) -> None:
        """It is not known here."""


class Showing:
    """Gives `sheet.Sheet` what is asked in `Shown`; of a law that is not linear, strain and stress last evaluated."""

    domain: Domain
    thickness: Expr | float
    """m; a function that is constant in each cell, or a number."""
    q: fem.Function
    u: Any
    strain: Expr
    shell: ShellSpace | None
    points: list[LawPoints]
    linear: list[tuple[np.ndarray | None, np.ndarray]]
    """Cells of each linear law (None: all), which has no points, and its stress or resultants from the strain."""
    warp: Sequence[float] | Expr

    def displacement(self) -> fem.Function:
        """The present displacement in m, as a Function of its own; each call brings the same one up to date."""
        if self.shell is None:
            return self.q
        u, dofs = self._apart
        u.x.array[:] = self.q.x.array[dofs]
        return u

    def cell_strain(self) -> Array:
        """Mean strain over each local cell, in the components of `strain`."""
        cells = self.domain.mesh.topology.index_map(2)
        told = np.zeros(cells.size_local + cells.num_ghosts, dtype=bool)
        strain = np.zeros((len(told), self.strain.ufl_shape[0]))
        for points in self.points:
            strain[points.cells], told[points.cells] = points.strain.mean(axis=1), True
        others = np.flatnonzero(~told).astype(np.int32)
        if len(others):
            strain[others] = self._strains.eval(self.domain.mesh, others).mean(axis=1)
        return strain

    def cell_stress(self) -> Array:
        """Mean stress S11, S22, S12 of each local cell, in Pa; of a shell, through its thickness too."""
        strain = self.cell_strain()
        stress = np.zeros((len(strain), 3))
        for cells, stiffness in self.linear:
            own = slice(None) if cells is None else cells
            stress[own] = strain[own] @ stiffness[:3].T
        for points in self.points:
            stress[points.cells] = points.stress[..., :3].mean(axis=1)
        h: Any = 1.0 if self.shell is None else self.thickness
        if isinstance(h, fem.Function):
            h = h.x.array[h.function_space.dofmap.list[:, :1]]
        return np.asarray(stress / h)

    def cell_director(self) -> Array | None:
        """Mean director of each local cell, a unit vector; None of a membrane."""
        if self.shell is None:
            return None
        mean = self.q.x.array[self._directors].mean(axis=1)
        return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))

    def yarns(self) -> Array:
        """Warp and weft of each local cell as they are now, shape (cells, 2, 3): unit vectors, moved and stretched."""
        return self._yarns()

    @cached_property
    def _apart(self) -> tuple[fem.Function, np.ndarray]:
        space, dofs = self.q.function_space.sub(0).collapse()
        return fem.Function(space), np.array(dofs)

    @cached_property
    def _strains(self) -> fem.Expression:
        points, _ = basix.make_quadrature(self.domain.mesh.basix_cell(), 2)
        return fem.Expression(self.strain, points)

    @cached_property
    def _directors(self) -> np.ndarray:
        """Unknowns of the directors of each local cell, (cells, directors of a cell, 3)."""
        space, dofs = self.q.function_space.sub(1).collapse()
        return np.reshape(dofs, (-1, 3))[space.dofmap.list]

    @cached_property
    def _yarns(self) -> Yarns:
        mesh = self.domain.mesh
        return Yarns(mesh, self.u, surface_axes(mesh, self.warp, 1))
