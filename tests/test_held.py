"""Sheets that are not held: what is free is found, counted as a dense matrix counts it, and named before a step."""

from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers import held, statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

COMM = MPI.COMM_WORLD
DATA = Path(__file__).parent / "data"
MESHES = Path(meshing.__file__).parents[1] / "meshes"
LAW = StVenantKirchhoff.isotropic(1e6, 0.3)


def cloth(comm=COMM, mesh=MESHES / "strip.geo", kinematics="shell", gdim=3, **numbers):
    """An elastic sheet, by default a strip from x = 0 to 0.2 m, y = 0 to 0.1 m."""
    size = {} if mesh.parent == DATA else {"length": 0.2, "width": 0.1, "nx": 4, "ny": 2} | numbers
    return sheet.Sheet(meshing.read(mesh, comm, **size), LAW, 1e-3, (1e5, 1e5), kinematics=kinematics)


def hold(sheet, *conditions):
    """Dirichlet conditions from (kind, group, further arguments)."""
    return [bc for kind, *rest in conditions for bc in getattr(supports, kind)(sheet.domain, sheet.space, *rest)]


def said(sheet, *conditions, load=0, set_load=lambda t: None):
    """What a march says before its first step."""
    solver = sheet.equilibrium(hold(sheet, *conditions), load)
    with pytest.raises(InputError) as error:
        next(statics.march(solver, set_load, [1.0]))
    assert "\n" not in str(error.value) and str(error.value).startswith("The supports do not hold the sheet: ")
    return str(error.value).split(": ", 1)[1].split(";")[0]


CASES = [
    ([], "the sheet can move along x, y, z and turn about every axis"),
    ([("hinge", "pin")], "the sheet can turn about every axis"),
    ([("hinge", "fixed_end")], "the sheet can turn about the line along y through (0, 0.05, 0) m"),
    ([("symmetry", "fixed_end", 0), ("lead", "fixed_end", 2, 0.0)], "the sheet can move along y"),
    ([("lead", "sheet", 2, 0.0)], "the sheet can move along x, y and turn about the line along z through"),
    ([("lead", "sheet", 2, 0.0), ("hinge", "pin")], "the sheet can turn about the line along z through (0, 0, 0) m"),
]


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize(("conditions", "words"), CASES, ids=[str(k) for k in range(len(CASES))])
def test_what_is_free_is_named(conditions, words):
    assert said(cloth(), *conditions).startswith(words)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_a_piece_that_nothing_holds_is_named_with_its_place(kinematics):
    held_piece = [("clamp", "left")] if kinematics == "shell" else [("clamp", "left"), ("lead", "sheet", 2, 0.0)]
    words = said(cloth(mesh=DATA / "two_parts.geo", kinematics=kinematics), *held_piece)
    free = "move along x, y, z and turn about every axis" if kinematics == "shell" else "move along x, y and turn about"
    assert words.startswith("the piece of 22 cells at (1.1, 0.05, 0) m can " + free)


@pytest.mark.parametrize("seed", range(40))
def test_the_motions_are_as_many_as_a_dense_matrix_has_without_stiffness(seed):
    """A shell of one or two pieces, supported at random: held or not."""
    rng = np.random.default_rng(seed)
    two = rng.random() < 0.3
    numbers = {} if two else {"nx": int(rng.integers(1, 4)), "ny": int(rng.integers(1, 3))}
    own = cloth(mesh=DATA / "two_parts.geo") if two else cloth(triangles=int(rng.integers(2)), **numbers)
    groups = ("left",) if two else ("fixed_end", "pulled_end", "pin")
    conditions, taken = [], set()
    for _ in range(rng.integers(0, 4)):
        kind, group, axis = rng.choice(["lead", "symmetry", "hinge"]), str(rng.choice(groups)), int(rng.integers(3))
        axis = axis % 2 if kind == "symmetry" else axis  # directors lie in no plane z = 0
        axes = {(group, k) for k in (range(3) if kind == "hinge" else [axis])}
        if axes & taken or (kind == "symmetry" and group == "pin"):
            continue
        taken |= axes
        conditions.append((kind, group, *([] if kind == "hinge" else [axis]), *([0.0] if kind == "lead" else [])))
    solver = own.equilibrium(hold(own, *conditions))
    found = held.free_motions(solver)
    solver.residual(solver.begin())
    A = solver.factorised().getOperators()[0].copy().convert("dense").getDenseArray()
    scale = np.sqrt(np.abs(np.diag(A)))
    values = np.linalg.svd(A / scale / scale[:, None], compute_uv=False)
    assert sum(len(motion.motions) for motion in found) == np.count_nonzero(values < 1e-12 * values.max())
    if not found:
        return
    assert said(own, *conditions)
    for motion in found:  # they strain nothing
        moved = sum(motion.rigid.motion(motion.piece, part) for part in motion.motions)
        assert np.abs(moved).max() > 0


JOINED = """*NODE
1, 0, 0\n2, .1, 0\n3, .1, .1\n4, 0, .1\n5, .2, .1\n6, .2, .2\n7, .1, .2
*ELEMENT, TYPE=S4
1, 1, 2, 3, 4\n2, 3, 5, 6, 7
*NSET, NSET=FIXED
1, 4
*NSET, NSET=TIP
6
"""


@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_pieces_that_meet_in_one_point_turn_about_it(tmp_path, kinematics):
    """A shell's shared director leaves the turn in its plane; a load along it does not excite it, and it is said."""
    (tmp_path / "joined.inp").write_text(JOINED)
    own = sheet.Sheet(
        meshing.read(tmp_path / "joined.inp", MPI.COMM_SELF), LAW, 1e-3, (1e5, 1e5), kinematics=kinematics
    )
    load = own.weight(0.2, ufl.as_vector((1.0, -1.0, 0.0)))
    held_piece = [("clamp", "FIXED"), ("lead", "TIP", 2, 0.0)]
    words = said(own, *held_piece, load=load)
    free = "turn about the line along z through (0.1, 0.1" if kinematics == "shell" else "turn about every axis"
    assert words.startswith(f"the piece of 1 cells at (0.15, 0.15, 0) m can {free}")


@pytest.mark.parallel
def test_what_loads_keep_in_place_is_let_off():
    """A curtain on its rod: its weight down, up, across it and along the rod; in the last three it would turn."""
    own = cloth()
    s = fem.Constant(own.domain.mesh, 0.0)

    def put(t):
        s.value = t

    for g in np.vstack([np.eye(3), -np.eye(3)]):
        solver = own.equilibrium(hold(own, ("hinge", "fixed_end")), own.weight(0.2, s * ufl.as_vector(9.81 * g)))
        if g[0] == 1.0:
            held.require(solver, put, 0.0, 1.0)
        else:
            with pytest.raises(InputError, match="turn about the line along y"):
                held.require(solver, put, 0.0, 1.0)


@pytest.mark.parallel
def test_springs_hold_and_a_pressure_that_turns_with_the_sheet_does_not():
    own = cloth()
    spring = -10.0 * ufl.inner(own.u, own.v) * own.dx
    solver = own.equilibrium([], spring + own.weight(0.2, ufl.as_vector((0.0, 0.0, -9.81))))
    assert not held.free_motions(solver)
    p = fem.Constant(own.domain.mesh, 0.0)

    def put(t):
        p.value = 5.0 * t

    load = weakform.pressure(p, own.u, own.v, own.dx)
    assert "turn about the line along y" in said(own, ("hinge", "fixed_end"), load=load, set_load=put)


@pytest.mark.parametrize("cell", [0, 1])
def test_a_membrane_without_stiffness_yet_is_not_called_loose(cell):
    """Flat and slack, held all round: no rigid motion."""
    own = cloth(kinematics="membrane", triangles=cell)
    conditions = [("hinge", "fixed_end"), ("hinge", "pulled_end")]
    assert not held.free_motions(own.equilibrium(hold(own, *conditions)))
