"""How fast the displacements of the default elements converge, to exact solutions."""

import numpy as np
import pytest
from mpi4py import MPI
from dolfinx import fem, mesh
from shells import Shell, surface

from fabric_fenicsx import fabrics
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.terms import supports

COMM = MPI.COMM_WORLD
defaults = pytest.mark.parametrize("element", ["regge", "mitc4"])
SMALL = 1e-7
"""The part of a displacement of order 1 that is given and loaded, lest directors feel the arc."""


def first_step(shell, u, d):
    """Root mean square over the nodes of what one linear step from rest misses of u(x), over that of u.

    u and d, the change of the directors, both (3, n) from x, are given on the rim, times `SMALL`.
    """
    space, domain = shell.space, shell.space.mesh
    domain.topology.create_connectivity(1, 2)
    rim, bcs = mesh.exterior_facet_indices(domain.topology), []
    values = shell.place(lambda x: SMALL * u(x), lambda x, n: n + SMALL * d(x))
    for i in (0, 1):
        part, dofs = space.V.sub(i).collapse()
        f = fem.Function(part)
        f.x.array[:] = values[dofs[0]]
        bcs.append(fem.dirichletbc(f, fem.locate_dofs_topological((space.V.sub(i), part), 1, rim), space.V.sub(i)))
    solver = shell.solver(bcs)
    residual = solver.residual(solver.begin())
    step = residual.duplicate()
    solver.factorised(residual).solve(residual, step)
    part, dofs = space.W.sub(0).collapse()
    exact = fem.Function(part)
    exact.interpolate(u)
    return np.linalg.norm(exact.x.array + step.array[dofs[0]] / SMALL) / np.linalg.norm(exact.x.array)


ISOTROPIC = StVenantKirchhoff.isotropic(1.0, 0.3)


def clamped_square(element, n, t):
    """Error of a clamped unit square of thickness t, on smoothly skewed cells.

    Exact: Chinosi and Lovadina 1995, doi 10.1007/BF00350269, of a plate that shears (Reissner and Mindlin, 5/6).
    """
    nu = 0.3

    def parts(x):
        """Polynomials of x - x^2 = -p in the source: p, p^3, their factors of the load."""
        p = x * (x - 1)
        return p, 5 * x**2 - 5 * x + 1, 2 * x - 1

    def load(x):
        (p, f, _), (q, g, _) = parts(x[0]), parts(x[1])
        force = 12 * q * f * (2 * q**2 + p * g) + 12 * p * g * (2 * p**2 + q * f)
        return SMALL * np.array([0 * p, 0 * p, t**3 / 12 / (1 - nu**2) * force])

    def u(x):
        (p, f, _), (q, g, _) = parts(x[0]), parts(x[1])
        w = (p * q) ** 3 / 3 - 2 * t**2 / (5 * (1 - nu)) * (q**3 * p * f + p**3 * q * g)
        return np.array([0 * p, 0 * p, w])

    domain = surface(element, "square", (n, n), 0.0625 * n).mesh
    shell = Shell(domain, element, ISOTROPIC, t, (1, 0, 0), 1.0, load)
    return first_step(shell, u, lambda x: 0 * x)


def pressed_cylinder(element, n, t, waves, skew):
    """Error of a quarter of a cylinder, radius 1, length 1, under the pressure cos 2 theta cos(waves pi y).

    Its displacement and the turn of its normal are five such waves. Their strains are those of (5.20), linear; the
    amplitudes follow from a system of five equations. They are given on the rim.
    """
    k, m = 2, waves * np.pi
    # amplitudes along the arc, along y and outwards, then of the director along the arc and y
    E = np.array([[k, 0, 1, 0, 0], [0, m, 0, 0, 0], [-m, -k, 0, 0, 0]])
    K = np.array([[k, 0, 1, k, 0], [0, 0, 0, 0, m], [-m, 0, 0, -m, -k]])
    S = np.array([[-1, 0, -k, 1, 0], [0, 0, -m, 0, 1]])
    C = ISOTROPIC.stiffness
    stiffness = t * E.T @ C @ E + t**3 / 12 * K.T @ C @ K + 5 / 6 * t * C[2, 2] * S.T @ S
    own = np.arange(5) if waves else np.array([0, 2, 3])
    a = np.zeros(5)
    a[own] = np.linalg.solve(stiffness[np.ix_(own, own)], np.array([0, 0, 1.0, 0, 0])[own])
    pressure = 1 / np.abs(a).max()
    a *= pressure

    def waved(x):
        """Axes along the arc, along y and outwards; the pressure, and waves along the arc and along y."""
        angle, y, nil = np.arctan2(x[0], x[2]), x[1], 0 * x[0]
        axes = np.array(
            [[np.cos(angle), nil, -np.sin(angle)], [nil, nil + 1, nil], [np.sin(angle), nil, np.cos(angle)]]
        )
        c, s = np.cos(k * angle), np.sin(k * angle)
        return axes, c * np.cos(m * y), s * np.cos(m * y), c * np.sin(m * y)

    def u(x):
        axes, cc, sc, cs = waved(x)
        return a[0] * sc * axes[0] + a[1] * cs * axes[1] + a[2] * cc * axes[2]

    def d(x):
        axes, _, sc, cs = waved(x)
        return outwards * (a[3] * sc * axes[0] + a[4] * cs * axes[1])

    def load(x):
        axes, cc, *_ = waved(x)
        return SMALL * pressure * cc * axes[2]

    domain = surface(element, "short", (n, n), skew * n).mesh
    shell = Shell(domain, element, ISOTROPIC, t, (0, 1, 0), 1.0, load)
    outwards = np.sign(shell.space.normal.x.array.reshape(-1, 3)[:, 2].sum())
    return first_step(shell, u, d)


ORDERS = [
    ("regge", clamped_square, (), 0.015),
    ("mitc4", clamped_square, (), 0.09),
    ("regge", pressed_cylinder, (0, 0.0625), 2e-4),
    ("mitc4", pressed_cylinder, (0, 0.0625), 3e-3),
    ("regge", pressed_cylinder, (1, 0.0625), 0.04),
    ("mitc4", pressed_cylinder, (1, 0.0), 0.005),
]
"""Element, scene, its waves along the axis (none: it bends alone) and skew, and the error at 16 cells.

On smoothly skewed quadrilaterals a thin cylinder that stretches bends where it need not, "q1" as well: the order is
near 0 to 32 cells and 1.3 to 64, of an error that has come to 3 % there.
"""


@pytest.mark.parametrize(("element", "scene", "more", "largest"), ORDERS)
def test_displacements_converge_with_order_two_or_more(element, scene, more, largest):
    """Of shells a thousandth thick, on 16 and 32 cells a side; the larger error is on record.

    It is so at a hundredth, too. On triangles no wider than two or three thicknesses, which no cloth has,
    the order falls to 1: there the error, below 0.1 % by then, changes its sign; later it is 2 again.
    """
    coarse, fine = (scene(element, cells, 1e-3, *more) for cells in (16, 32))
    assert np.log2(coarse / fine) > 1.9
    assert coarse < largest


BENT = StVenantKirchhoff.isotropic(1.0, 0.0)
THICK = 0.02
FIRST, LAST = 0.5 * np.pi, 0.8 * np.pi


def bend(element, cells, comm=MPI.COMM_SELF, law=BENT, loads=(0.25, 0.5, 0.75, 1.0)):
    """Bend a quarter of a cylinder by its side to an arc of `LAST`: u, what it misses of the exact one, the shell.

    An arc is exact where the law does not contract. With k the turn per length, 1 that of the reference and p
    the stretch along it, E11 = (p^2 - 1) / 2 and K11 = p k - 1; there is no shear; and the part of the stress
    along the arc is zero where N p + M k = 0, that is 6 (p^3 - p) + h^2 k (p k - 1) = 0.
    """
    domain = surface(element, "cylinder", cells, 0.25, comm)
    shell = Shell(domain.mesh, element, law, THICK, warp=(0, 1, 0))
    held, move = supports.grip(domain, shell.space, "side")

    def arc(x, angle):
        """The place of x on the arc, which begins at the top."""
        s, k = np.arctan2(x[0], x[2]), angle / FIRST
        stretch = np.roots([6, 0, THICK**2 * k**2 - 6, -(THICK**2) * k]).real.max()
        r = stretch / k
        return np.array([r * np.sin(s * k), x[1], r * np.cos(s * k) - r + 1])

    def load(t):
        angle, side = FIRST + t * (LAST - FIRST), np.array([1.0, 0, 0])
        move(arc(side, angle) - side, (0, angle - FIRST, 0), side)

    solver = shell.solver(held + supports.clamp(domain, shell.space, "top"))
    for _ in statics.march(solver, load, loads):
        pass
    part, dofs = shell.space.V.sub(0).collapse()
    u, exact = fem.Function(part), fem.Function(part)
    u.x.array[:] = shell.q.x.array[dofs[0]]
    exact.interpolate(lambda x: arc(x, FIRST + loads[-1] * (LAST - FIRST)) - x)
    return u.x.array - exact.x.array, u, shell


@defaults
def test_a_quarter_of_a_cylinder_is_bent_on(element):
    """To an arc of 144 degrees, on skewed cells: the exact solution is approached with order 2 or more."""
    errors = [np.abs(bend(element, (n, n // 2))[0]).max() for n in (8, 16)]
    assert np.log2(errors[0] / errors[1]) > (3.0 if element == "regge" else 2.0), errors
    assert errors[1] < (3.2e-4 if element == "regge" else 1e-3)


@pytest.mark.parallel
@defaults
def test_two_ranks_find_what_one_finds(element):
    """With history: the woven law, bent on and back by a third."""
    law, found = Woven(fabrics.load("denim")), []
    for comm in (COMM, MPI.COMM_SELF):
        _, u, shell = bend(element, (6, 3), comm, law, loads=(0.15, 0.3, 0.2))
        n = u.function_space.dofmap.index_map.size_local
        x, value = u.function_space.tabulate_dof_coordinates()[:n], u.x.array.reshape(-1, 3)[:n]
        x, value = (np.concatenate(comm.allgather(a)) for a in (x, value))
        found.append((x[np.lexsort(np.round(x, 8).T)], value[np.lexsort(np.round(x, 8).T)]))
        moved = shell.fabric.history.committed != shell.fabric.law.initial_state
        assert comm.allreduce(int(moved.sum())) > 0
    (x, u), (x_alone, alone) = found
    assert np.abs(x - x_alone).max() < 1e-12
    assert np.abs(u - alone).max() < 1e-8
