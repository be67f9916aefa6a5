"""What the cases of `shell_benchmarks.py` are made of: an elastic shell, and what is asked of it.

Shells are in any consistent units.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import ufl
from dolfinx import fem

from fabric_fenicsx import sheet
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import pictures
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.shell import directors
from fabric_fenicsx.solvers import marching
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform


@dataclass(frozen=True)
class Settings:
    """What can be chosen for every case; None is the case's own choice."""

    element: str | None = None
    cells: int | None = None
    thickness: float | None = None
    skew: float = 0.0
    steps: int | None = None
    turns: int = 1

    def __post_init__(self):
        if self.thickness is not None and self.thickness <= 0:
            raise InputError(f"A thickness of {self.thickness:g} is not a positive number.")
        if not 0 <= self.skew < 0.5:
            raise InputError(f"Nodes can move by 0 to 0.5 of a cell, not by {self.skew:g}: cells would fold.")

    def count(self, default):
        """Cells along a side: those chosen, or `default`, and twice as many of a bilinear element."""
        bilinear = self.element and directors.ELEMENTS[self.element][1][1] == 1
        return self.cells or default * (2 if bilinear else 1)

    def thick(self, default):
        """The thickness chosen, or `default`."""
        return default if self.thickness is None else self.thickness


class Shell:
    """An elastic shell: its mesh, unknown (u, d), supports, and a weak form that loads are subtracted from.

    file: in meshes/, with `numbers` set in it; gather: see `move_nodes`. `load` is the Constant that every load
    has as a factor.
    """

    def __init__(
        self, file, settings, E, nu, thickness, *, comm, warp=(1, 0, 0), shear_factor=1.0, gather=1.0, **numbers
    ):
        element = settings.element or "regge"
        cell, (_, degree), *_ = directors.ELEMENTS[element]
        if file != "strip.geo":
            # displacements must be able to turn the sheet as a whole: never a geometry of higher degree
            numbers["order"] = degree
        self.domain = meshing.read(meshing.MESHES / file, comm, gdim=3, triangles=int(cell == "triangle"), **numbers)
        self.mesh, self.comm = self.domain.mesh, comm
        if file == "strip.geo":
            move_nodes(self.mesh, settings.skew, gather, numbers)
        elif settings.skew:
            raise InputError("Only strips can be skewed: end_shear, roll_up, heavy_elastica, locking.")
        G = shear_factor * E / (2 * (1 + nu))
        law = StVenantKirchhoff.isotropic(E, nu)
        self.sheet = shell = sheet.Sheet(self.domain, law, thickness, (G, G), warp=warp, element=element)
        self.space, self.q = shell.space, shell.q
        self.u, self.d, self.v, self.w = shell.u, shell.director, shell.v, shell.delta
        self.load, self.bcs, self.loads = fem.Constant(self.mesh, 0.0), [], 0

    def clamp(self, group):
        """Hold displacement and director of an edge."""
        self.bcs += supports.clamp(self.domain, self.space, group)

    def mirror(self, group, axis):
        """Make an edge a line of symmetry, in the plane across an axis."""
        self.bcs += supports.symmetry(self.domain, self.space, group, "xyz".index(axis))

    def hold(self, group, axes):
        """Hold the displacement along these axes."""
        for axis in axes:
            self.bcs += supports.lead(self.domain, self.space, group, "xyz".index(axis), 0.0)

    def line_force(self, group, force):
        """A dead force per length of an edge."""
        self.loads += weakform.traction(self.force(force), self.v, supports.over(self.domain, group, 2))

    def point_force(self, group, force):
        """A dead force at a point."""
        self.loads += weakform.point_force(self.force(force), self.v, supports.over(self.domain, group, 0))

    def area_force(self, force):
        """A dead force per area."""
        self.loads += weakform.surface_traction(self.force(force), self.v, self.space.dx)

    def edge_moment(self, group, moment):
        """A dead moment per length of an edge."""
        ds = supports.over(self.domain, group, 1)
        self.loads += weakform.edge_moment(self.force(moment), self.d, self.w, ds)

    def force(self, vector):
        """A vector that grows with the load."""
        return self.load * fem.Constant(self.mesh, tuple(map(float, vector)))

    def mean(self, group, axis):
        """Mean displacement of a group's nodes along an axis; to be called on every rank."""
        return supports.mean(self.domain, self.space, self.q, group, "xyz".index(axis))

    def solver(self):
        """Newton on this shell, patient: at its start a thin shell is far from balance."""
        return self.sheet.equilibrium(self.bcs, self.loads, options={"snes_max_it": 50})

    def picture(self, path, title, full=1.0, drawn=1.0):
        """Draw the deformed shell, coloured by how far it moved.

        full: what the displacement is to be multiplied by, and drawn: by what it is to be seen larger.
        """
        u = self.q.sub(0).collapse()
        u.x.array[:] *= full
        far = fem.Function(fem.functionspace(self.mesh, ("DG", 0)))
        size = ufl.sqrt(ufl.dot(u, u) + 1e-30)
        far.interpolate(fem.Expression(size, far.function_space.element.interpolation_points))
        u.x.array[:] *= drawn
        pictures.picture(path, u, far.x.array, "distance moved (consistent units)", title)


def move_nodes(domain, skew, gather, numbers):
    """Move the inner nodes of a strip at random by up to `skew` of a cell, alike on any number of ranks.

    Then move all along it, from x to length (x / length)^gather: above 1, cells get smaller towards the clamp.
    """
    size, cells = np.array([numbers["length"], numbers["width"]]), np.array([numbers["nx"], numbers["ny"]])
    x, number = domain.geometry.x, domain.geometry.input_global_indices
    inner = ((x[:, :2] > 1e-9 * size) & (x[:, :2] < (1 - 1e-9) * size)).all(axis=1)
    noise = np.random.default_rng(3).uniform(-skew, skew, ((cells + 1).prod(), 2))
    x[inner, :2] += (noise[number] * size / cells)[inner]
    x[:, 0] = size[0] * (x[:, 0] / size[0]) ** gather


@dataclass
class Case:
    """A shell and what is asked of it.

    probes: name -> (group, axis, factor). reference: name -> values at `loads`, NaN where there is none. scale:
    name -> what 100 % of error is, a number or one for each load. tolerance: of the error, likewise.
    also: more names from those of the probes. full, drawn: see `Shell.picture`.
    """

    name: str
    title: str
    shell: Shell
    loads: np.ndarray
    probes: dict[str, tuple[str, str, float]]
    reference: dict[str, np.ndarray]
    scale: dict[str, float | np.ndarray]
    tolerance: float | np.ndarray
    full: float = 1.0
    drawn: float = 1.0
    load_name: str = "load_fraction"
    also: Callable[[dict[str, float]], dict[str, float]] = field(default=lambda values: {})

    def run(self, out=None, progress=None, smallest=1 / 64):
        """Load the shell step by step: its table, and what stopped it (None, or a sentence)."""
        shell, solver = self.shell, self.shell.solver()

        def set_load(value):
            shell.load.value = value

        def probes(step):
            values = {name: factor * shell.mean(group, axis) for name, (group, axis, factor) in self.probes.items()}
            wanted = {f"{name}_reference": column[step.number - 1] for name, column in self.reference.items()}
            return {self.load_name: step.load} | values | self.also(values) | wanted

        stopped = None
        with Recorder(shell.sheet, out, probes, title=self.title, when=lambda step: "", picture=None) as record:
            try:
                for step in marching.march(solver, set_load, self.loads, smallest=smallest, progress=progress):
                    record(step)
            except StepFailed as error:
                stopped = str(error)
        return record.table, stopped

    def errors(self, table):
        """Name -> error of each step as a part of what is allowed; NaN where there is no reference."""
        done = slice(len(table.rows))

        def at_steps(values):
            return np.broadcast_to(values, len(self.loads))[done]

        return {
            name: np.abs(table.column(name) - column[done]) / at_steps(self.scale[name]) / at_steps(self.tolerance)
            for name, column in self.reference.items()
        }
