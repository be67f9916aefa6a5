"""The standard problems of `shell_benchmarks.py`: sheet, supports, load, and the displacements to look at.

Numbers are in the units of the sources (any consistent ones); x, y, z are the mesh's. Every case is a function that
returns a `Case`; what it is held against is in tests/data, with its source.
"""

import csv
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import assumed_strain, continuation, directors, meshing, results, statics, supports, weakform
from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff

HERE = Path(__file__).parent
MESHES, DATA = HERE.parent / "meshes", HERE.parent / "tests" / "data"


@dataclass(frozen=True)
class Settings:
    """What can be chosen for every case; None is the case's own choice."""

    element: str | None = None
    cells: int | None = None
    thickness: float | None = None
    skew: float = 0.0
    steps: int | None = None
    turns: int = 1

    def count(self, default):
        """Cells along a side: those chosen, or `default`, and twice as many of a bilinear element."""
        bilinear = self.element and directors.ELEMENTS[self.element][1][1] == 1
        return self.cells or default * (2 if bilinear else 1)


class Shell:
    """An elastic shell: its mesh, unknown (u, d), supports, and a weak form that loads are subtracted from.

    `load` is the Constant that every load has as a factor, from 0 to 1.
    """

    def __init__(
        self,
        file,
        settings,
        E,
        nu,
        thickness,
        warp=(1, 0, 0),
        comm=MPI.COMM_WORLD,
        shear_factor=1.0,
        gather=1.0,
        **numbers,
    ):
        element = settings.element or "regge"
        if thickness <= 0:
            raise InputError(f"A thickness of {thickness:g} is not a positive number.")
        cell, (_, degree), *_ = directors.ELEMENTS[element]
        if file != "strip.geo":
            # displacements must be able to turn the sheet as a whole: never a geometry of higher degree
            numbers["order"] = degree
        self.domain = meshing.read(MESHES / file, comm, gdim=3, triangles=int(cell == "triangle"), **numbers)
        self.mesh, self.comm = self.domain.mesh, comm
        if file == "strip.geo":
            move_nodes(self.mesh, settings.skew, gather, numbers)
        elif settings.skew:
            raise InputError("Only strips can be skewed: end_shear, roll_up, heavy_elastica, locking.")
        self.space = directors.ShellSpace(self.mesh, element)
        self.q, test = self.space.function(), ufl.TestFunction(self.space.V)
        (self.u, self.d), (self.v, self.w) = ufl.split(self.q), ufl.split(test)
        self.load, self.bcs = fem.Constant(self.mesh, 0.0), []

        h = fem.Constant(self.mesh, float(thickness))
        strain, shear = assumed_strain.shell_strains(self.space, self.q, warp)
        plane = StVenantKirchhoff.isotropic(E, nu).stiffness
        section = np.kron(np.diag([thickness, thickness**3 / 12]), plane)
        stress = weakform.elastic_stress(self.mesh, section, strain)
        G = shear_factor * E / (2 * (1 + nu))
        shear_stress = ufl.dot(weakform.shear_stiffness(self.mesh, (G, G), h), shear)
        self.residual = weakform.internal(stress, strain, self.q, test, 1.0, self.space.dx)
        self.residual += weakform.internal(shear_stress, shear, self.q, test, 1.0, self.space.dx_shear)

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
        self.residual -= weakform.traction(self.force(force), self.v, supports.over(self.domain, group, 2))

    def point_force(self, group, force):
        """A dead force at a point."""
        self.residual -= weakform.point_force(self.force(force), self.v, supports.over(self.domain, group, 0))

    def area_force(self, force):
        """A dead force per area."""
        self.residual -= weakform.surface_traction(self.force(force), self.v, self.space.dx)

    def edge_moment(self, group, moment):
        """A dead moment per length of an edge."""
        ds = supports.over(self.domain, group, 1)
        self.residual -= weakform.edge_moment(self.force(moment), self.d, self.w, ds)

    def force(self, vector):
        """A vector that grows with the load."""
        return self.load * ufl.as_vector([float(component) for component in vector])

    def mean(self, group, axis):
        """Mean displacement of a group's nodes along an axis; to be called on every rank."""
        dofs = supports.unknowns(self.domain, self.space, group, "xyz".index(axis))
        owned = dofs[dofs < self.space.V.dofmap.index_map.size_local]
        total, count = self.comm.allreduce(np.array([self.q.x.array[owned].sum(), len(owned)]))
        return total / count

    def solver(self):
        """Newton on this shell, patient: at its start a thin shell is far from balance."""
        return statics.StaticSolver(self.residual, self.q, self.bcs, space=self.space, options={"snes_max_it": 50})

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
        results.picture(path, u, far.x.array, "distance moved", title)


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

        with results.Table(out and out / "history.csv", shell.comm) as table:
            try:
                for step in continuation.march(solver, set_load, self.loads, smallest=smallest, progress=progress):
                    values = {name: factor * shell.mean(group, axis)
                              for name, (group, axis, factor) in self.probes.items()}  # fmt: skip
                    wanted = {f"{name}_reference": column[step.number - 1] for name, column in self.reference.items()}
                    table.row(**{self.load_name: step.load}, **values, **self.also(values), **wanted,
                              newton_iterations=step.newton_iterations, step_cuts=step.step_cuts,
                              wall_s=step.wall_s)  # fmt: skip
            except StepFailed as error:
                return table, str(error)
        return table, None

    def errors(self, table):
        """Name -> error of each step as a part of what is allowed; NaN where there is no reference."""
        done = slice(len(table.rows))

        def at_steps(values):
            return np.broadcast_to(values, len(self.loads))[done]

        return {
            name: np.abs(table.column(name) - column[done]) / at_steps(self.scale[name]) / at_steps(self.tolerance)
            for name, column in self.reference.items()
        }


def table(name):
    """Columns of a file in tests/data."""
    with open(DATA / name) as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def at(loads, columns, steps):
    """The loads of a table (without zero) and its columns there, or `steps` equal ones and what it has of them."""
    if steps is None:
        return loads[loads > 0], [column[loads > 0] for column in columns]
    wanted = np.linspace(0, loads[-1], steps + 1)[1:]
    where = np.abs(loads - wanted[:, None]).argmin(axis=1)
    found = np.isclose(loads[where], wanted, rtol=0, atol=1e-9 * loads[-1])
    return wanted, [np.where(found, column[where], np.nan) for column in columns]


def strip(settings, cells, length, width, E, thickness, nu=0.0, **more):
    """A flat strip along x, two cells wide, clamped at one end."""
    n = settings.count(cells)
    shell = Shell("strip.geo", settings, E, nu, thickness, length=length, width=width, nx=n, ny=2, **more)
    shell.clamp("fixed_end")
    return shell


def end_shear(settings, comm=MPI.COMM_WORLD):
    """Cantilever under a dead end force (Sze 2004, 3.1), against the elastica. E h^3 is the same for any thickness."""
    h = settings.thickness or 0.1
    shell = strip(settings, 16, 10.0, 1.0, 1.2e6 * (0.1 / h) ** 3, h, comm=comm)
    shell.line_force("pulled_end", (0, 0, 4.0))
    data = table("sze2004_3.1_cantilever_end_shear.csv")
    loads, (U, W) = at(data["P_over_Pmax"], (data["exact_minus_U"], data["exact_W"]), settings.steps)
    return Case(
        "end_shear", "Cantilever, dead end force", shell, loads,
        {"minus_U_tip": ("pulled_end", "x", -1.0), "W_tip": ("pulled_end", "z", 1.0)},
        {"minus_U_tip": U, "W_tip": W}, {"minus_U_tip": U[-1], "W_tip": W[-1]}, 0.005,
    )  # fmt: skip


def roll_up(settings, comm=MPI.COMM_WORLD):
    """Cantilever under an end moment (Sze 2004, 3.2) that rolls it up once or more, against the circle."""
    h, L, turns = settings.thickness or 0.1, 12.0, settings.turns
    shell = strip(settings, 40 * turns, L, 1.0, 1.2e6 * (0.1 / h) ** 3, h, comm=comm)
    shell.edge_moment("pulled_end", (0, -turns * 50 * np.pi / 3, 0))
    loads = np.linspace(0, 1, (settings.steps or 20 * turns) + 1)[1:]
    angle = 2 * np.pi * turns * loads
    return Case(
        f"roll_up_{turns}", f"Cantilever, end moment for {turns} turn{'s' * (turns > 1)}", shell, loads,
        {"minus_U_tip": ("pulled_end", "x", -1.0), "W_tip": ("pulled_end", "z", 1.0)},
        {"minus_U_tip": L * (1 - np.sin(angle) / angle), "W_tip": L * (1 - np.cos(angle)) / angle},
        {"minus_U_tip": L, "W_tip": L}, 0.01,
    )  # fmt: skip


def heavy_elastica(settings, comm=MPI.COMM_WORLD):
    """A clamped strip bends under its own weight: the cantilever test of cloth. Gamma = weight L^3 / rigidity."""
    h = settings.thickness or 1e-4
    # hanging, it bends next to the clamp only
    shell = strip(settings, 32, 1.0, 0.1, 12 / h**3, h, comm=comm, gather=2.0)
    shell.area_force((0, 0, -1.0))
    data = table("exact_heavy_elastica_cantilever.csv")
    last = len(data["Gamma"]) - 1
    rows = np.unique(np.rint(np.linspace(0, last, (settings.steps or 28) + 1)).astype(int))
    H, W = data["H_over_L"][rows], data["W_over_L"][rows]
    return Case(
        "heavy_elastica", "Strip under its own weight", shell, data["Gamma"][rows],
        {"H": ("pulled_end", "z", -1.0), "U": ("pulled_end", "x", 1.0)},
        {"H": H, "W": W}, {"H": H, "W": W}, 0.01, load_name="Gamma",
        also=lambda values: {"W": 1 + values["U"],
                             "chord_degrees": np.degrees(np.arctan2(values["H"], 1 + values["U"]))},
    )  # fmt: skip


def slit_annulus(settings, comm=MPI.COMM_WORLD):
    """A slit ring whose one lip is lifted (Sze 2004, 3.3)."""
    n = settings.count(10)
    shell = Shell("annulus.geo", settings, 21e6, 0.0, settings.thickness or 0.03, comm=comm, nx=n, ny=2 * n)
    shell.clamp("clamped_lip")
    shell.line_force("loaded_lip", (0, 0, 0.8))
    data = table("sze2004_3.3_slit_annular_plate.csv")
    loads, (A, B) = at(data["P_over_Pmax"], (data["W_A"], data["W_B"]), settings.steps)
    return Case(
        "slit_annulus", "Slit ring, one lip lifted", shell, loads, {"W_A": ("A", "z", 1.0), "W_B": ("B", "z", 1.0)},
        {"W_A": A, "W_B": B}, {"W_A": A, "W_B": B}, 0.01,
    )  # fmt: skip


def octant(settings, cells, comm, radius, length, angle=90, **more):
    """Part of a tube or roof, half as long as it, with the symmetry of its middle and its top."""
    n = settings.count(cells)
    shell = Shell("cylinder.geo", settings, warp=(0, 1, 0), comm=comm,
                  radius=radius, length=length / 2, angle=angle, nx=n, ny=n, **more)  # fmt: skip
    shell.mirror("middle", "y")
    shell.mirror("top", "x")
    return shell


def pullout_cylinder(settings, comm=MPI.COMM_WORLD):
    """A tube with open ends is pulled apart at two points (Sze 2004, 3.5): it snaps half-way."""
    shell = octant(settings, 16, comm, 4.953, 10.35, E=10.5e6, nu=0.3125, thickness=settings.thickness or 0.094)
    shell.mirror("side", "z")
    shell.point_force("A", (0, 0, 40000 / 4))
    data = table("sze2004_3.5_pullout_open_cylinder.csv")
    names = ("W_A", "minus_U_B", "minus_U_C")
    loads, columns = at(data["P_over_Pmax"], [data[name] for name in names], settings.steps)
    reference = dict(zip(names, columns, strict=True))
    return Case(
        "pullout_cylinder", "Open tube, pulled apart", shell, loads,
        {"W_A": ("A", "z", 1.0), "minus_U_B": ("B", "x", -1.0), "minus_U_C": ("C", "x", -1.0)},
        reference, reference, np.where(loads < 0.51, 0.02, 0.05),
    )  # fmt: skip


def linear(name, title, shell, size, load, drawn, **probe):
    """A case of small displacements: one number, from `load` times its load, and scaled to all of it.

    The code is the nonlinear one. The load must be small against the thickness, and not so small that
    round-off is left of the strains. drawn: how much larger in the picture.
    """
    ((label, (group, axis, sign)),) = probe.items()
    value = {label: np.array([size])}
    return Case(name, title, shell, np.array([load]), {label: (group, axis, sign / load)}, value, value, 0.01,
                full=1 / load, drawn=drawn)  # fmt: skip


def scordelis_lo(settings, comm=MPI.COMM_WORLD):
    """A barrel roof on diaphragms under its weight."""
    shell = octant(settings, 16, comm, 25.0, 50.0, 40, E=4.32e8, nu=0.0, thickness=settings.thickness or 0.25)
    shell.hold("end", "xz")
    shell.area_force((0, 0, -90.0))
    return linear("scordelis_lo", "Scordelis-Lo roof", shell, 0.3020, 1e-3, 10.0, minus_W_B=("B", "z", -1.0))


def pinched_cylinder(settings, comm=MPI.COMM_WORLD):
    """A tube on diaphragms, pinched at two points, against the series of a shell that is rigid in shear.

    So this one is ten times too stiff in shear: without that it gives more with every refinement, as
    under a point force it must (by a logarithm), and is 1.5 % softer at 64 cells.
    """
    shell = octant(settings, 64, comm, 300.0, 600.0,
                   E=3e6, nu=0.3, thickness=settings.thickness or 3.0, shear_factor=10.0)  # fmt: skip
    shell.mirror("side", "z")
    shell.hold("end", "xz")
    shell.point_force("A", (0, 0, -1 / 4))
    return linear("pinched_cylinder", "Pinched tube", shell, 1.82488e-5, 100.0, 3e6, minus_W_A=("A", "z", -1.0))


def hemisphere(settings, comm=MPI.COMM_WORLD):
    """A hemisphere with a hole of 18 degrees, pulled and pushed at four points of its equator."""
    n = settings.count(20)
    h = settings.thickness or 0.04
    shell = Shell("hemisphere.geo", settings, 6.825e7, 0.3, h, (0, 0, 1), comm, nx=n, ny=n)
    shell.mirror("y_plane", "y")
    shell.mirror("x_plane", "x")
    shell.hold("A", "z")
    shell.point_force("A", (1.0, 0, 0))
    shell.point_force("B", (0, -1.0, 0))
    return linear("hemisphere", "Hemisphere, pulled and pushed", shell, 0.093, 1e-3, 20.0, U_A=("A", "x", 1.0))


CASES = {
    case.__name__: case
    for case in (end_shear, roll_up, slit_annulus, pullout_cylinder, scordelis_lo, pinched_cylinder, hemisphere,
                 heavy_elastica)
}  # fmt: skip
