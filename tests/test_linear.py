"""The iterative solver of linear systems: its rigid motions, the same answers as LU, iterations, failure."""

import motions
import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem
from petsc4py import PETSc

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.errors import StepFailed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.solvers import linear, redundant, substructures, tangent
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, term

COMM = MPI.COMM_WORLD
BLEND = fabrics.load("blend")
LAWS = {"elastic": StVenantKirchhoff.from_fabric(BLEND), "woven": Woven(BLEND)}
AREAL_MASS = BLEND.density * BLEND.thickness


def square(law="elastic", cells=6, element="mitc4", kinematics="shell"):
    """A sheet of cloth, 0.3 m x 0.3 m."""
    domain = meshing.read(motions.SQUARE, COMM, side=motions.SIDE, n=cells, triangles=int(element == "regge"))
    G = BLEND.shear.modulus[0]
    element = element if kinematics == "shell" else None
    return sheet.Sheet(domain, LAWS[law], BLEND.thickness, (G, G), kinematics=kinematics, element=element)


def stretched(cloth, options, rtol=1e-9):
    """A solver of the sheet, gripped at two edges and stretched by 1 %, and its weight, so far 0."""
    domain, space, end = cloth.domain, cloth.space, fem.Constant(cloth.domain.mesh, 0.01 * motions.SIDE)
    bcs = supports.clamp(domain, space, "left") + supports.lead(domain, space, "right", 0, end)
    bcs += [bc for k in (1, 2) for bc in supports.lead(domain, space, "right", k, 0.0)]
    g = fem.Constant(domain.mesh, np.zeros(3))
    return cloth.equilibrium(bcs, cloth.weight(AREAL_MASS, g), rtol=rtol, options=options), g


def falling(cloth, options):
    """The sheet in motion, clamped at one edge, after three steps."""
    weight = cloth.weight(AREAL_MASS, ufl.as_vector((0.0, 0.0, -9.81)))
    bcs = supports.clamp(cloth.domain, cloth.space, "left")
    run, _ = cloth.newmark(AREAL_MASS, bcs, weight, rtol=1e-9, options=options)
    for _ in run.march(6e-3, 2e-3):
        pass
    return run.solver


@pytest.mark.parallel
def test_a_system_that_each_rank_has_as_a_whole_is_solved_as_the_shared_one(monkeypatch):
    """The same answer, through new values of one matrix, and one answer to the last bit; the same signs of pivots."""
    cloth, answers = square("elastic", 4, "mitc4"), {}
    for whole in (0, np.inf):
        monkeypatch.setattr(linear, "WHOLE", whole)
        solver, g = stretched(cloth, {})
        found = []
        for pull in (-1.0, -9.81, -1.0):
            g.value[2] = pull
            for _ in range(2):
                cloth.q.x.array[:] = 0.0
                b = solver.residual(solver.begin()).copy()
                x = b.duplicate()
                solver.factorised(b).solve(b, x)
                found.append(x.array_r.copy())
        answers[whole] = found, solver._pivots.count(solver.snes.ksp, solver.tangent.A)
        assert linear.method(solver.snes) == "LDL' by MUMPS"
    shared, own = answers[0][0], answers[np.inf][0]
    size = COMM.allreduce(np.abs(own[0]).max(initial=0.0), MPI.MAX)
    for one, other in zip(shared, own, strict=True):
        assert np.abs(one - other).max(initial=0.0) < 1e-9 * size
    assert all(np.array_equal(own[k], own[k + 1]) for k in (0, 2, 4)) and np.array_equal(own[0], own[4])
    assert answers[0][1] == answers[np.inf][1] == (0, 0)


@pytest.mark.parallel
@pytest.mark.parametrize("kind", ["elastic", "woven"])
@pytest.mark.parametrize("long, whole", [(20.0, 0), (0.0, 0), (0.0, np.inf)])
def test_a_system_whose_ranks_eliminate_their_interiors_is_solved_as_the_whole(kind, long, whole, monkeypatch):
    """Also where the interface is too long; through new values of one matrix, one without factors among them."""
    monkeypatch.setattr(substructures, "LONG", long)
    solver = falling(square(kind, 6), {})
    A, b, answers = solver.tangent.A, solver._b.duplicate(), []
    symmetric, name = ("LDL'", "cholesky") if kind == "elastic" else ("LU", "lu")
    assert linear.method(solver.snes) == f"{symmetric} by MUMPS"
    b.array_w[:] = np.cos(np.arange(*b.owner_range))
    prefix = solver.snes.getOptionsPrefix()
    for context in (redundant.Redundant(prefix), substructures.Substructures(prefix, whole)):
        ksp, found = PETSc.KSP().create(COMM), []
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(context)
        assert context.ksp.getPC().getType() == name
        values = A.copy()
        for factor in (1.0, 2.0, 2.0, 0.0, 2.0):
            A.copy(values)
            values.scale(factor)
            ksp.setOperators(values)
            x = b.duplicate()
            ksp.solve(b, x)
            assert (ksp.getConvergedReason() < 0) == (factor == 0.0)
            if factor == 0.0:
                ksp.reset()
            else:
                found.append(factor * x.array_r)
        assert np.array_equal(found[1], found[2]) or (long == 0.0 and whole == 0)  # MUMPS's own do not repeat
        answers.append(found)
    size = COMM.allreduce(np.abs(answers[0][0]).max(initial=0.0), MPI.MAX)
    for one, other in zip(*answers, strict=True):
        assert np.abs(one - other).max(initial=0.0) < 1e-9 * size


@pytest.mark.parallel
def test_an_interface_is_a_line_that_parts_the_ranks():
    cells = 8
    A = falling(square("elastic", cells), {}).tangent.A
    B, (begin, end) = substructures.interface(A), A.getOwnershipRange()
    indptr, columns, _ = A.getValuesCSR()
    rows = np.repeat(np.arange(begin, end), np.diff(indptr))
    away = (columns < begin) | (columns >= end)
    assert (np.isin(rows, B) | np.isin(columns, B))[away].all()
    assert len(B) <= (COMM.size - 1) * 5 * (cells + 3)


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("kinematics, element", [("shell", "mitc4"), ("shell", "regge"), ("membrane", "mitc4")])
def test_a_free_sheet_resists_no_rigid_motion(kinematics, element):
    """Directors turn along, which the shear stiffness of a thick sheet feels; nothing is built for LU."""
    cloth = motions.cloth(COMM, kinematics="membrane") if kinematics == "membrane" else square("elastic", 3, element)
    assert cloth.equilibrium([])._motions is None
    solver = cloth.equilibrium([], options=linear.ITERATIVE)
    solver.residual(solver.begin())
    A = solver.factorised().getOperators()[0]
    vectors = A.getNearNullSpace().getVecs()
    assert len(vectors) == 6
    diagonal = A.getDiagonal()
    for motion in vectors:
        assert abs(motion.norm() - 1) < 1e-12
        # row by row, for membrane, shear and bending differ by many powers of ten
        force = (A * motion).array_r / np.maximum(diagonal.array_r, 1e-30)
        largest = COMM.allreduce(np.abs(force).max(initial=0.0), MPI.MAX)
        assert largest <= 1e-10


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize(("law", "element"), [("woven", "mitc4"), ("elastic", "regge")])
def test_the_same_equilibrium_as_by_lu(law, element):
    answers = []
    for options in (linear.DIRECT, linear.ITERATIVE):
        cloth = square(law, 6, element)
        solver, g = stretched(cloth, options)
        for g.value[2] in (0.0, -9.81):
            solver.solve()
            solver.commit()
        answers.append(cloth.q.x.array.copy())
    assert np.abs(answers[0] - answers[1]).max() < 1e-8 * np.abs(answers[0]).max()


@pytest.mark.parallel
def test_the_same_motion_as_by_lu():
    answers = []
    for chosen in (linear.DIRECT, linear.IN_MOTION):
        cloth = square("woven", 6)
        falling(cloth, chosen)
        answers.append(cloth.q.x.array.copy())
    assert np.abs(answers[0] - answers[1]).max() < 1e-7 * np.abs(answers[0]).max()


@pytest.mark.parametrize("moves", [False, True])
def test_iterations_hardly_grow_as_the_mesh_is_refined(moves):
    counts = []
    for cells in (8, 16):
        if moves:
            solver = falling(square("woven", cells), linear.IN_MOTION | {"ksp_rtol": 1e-6})
        else:
            solver, g = stretched(square("elastic", cells), linear.ITERATIVE)
            solver.solve()
            solver.commit()
            g.value[2] = -9.81
            solver.solve()
        counts.append(solver.snes.getLinearSolveIterations() / solver.snes.getIterationNumber())
    assert counts[1] <= 1.6 * counts[0] <= 16


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("stretches", [False, True])
def test_a_linear_solver_that_does_not_get_there_fails_the_step(stretches):
    """Both where the supports move and in Newton's method; the sheet is back at the last commit."""
    cloth, short = square("elastic", 8), linear.ITERATIVE | {"ksp_max_it": 1}
    if stretches:
        solver, _ = stretched(cloth, short)
    else:
        bcs = supports.clamp(cloth.domain, cloth.space, "left")
        solver = cloth.equilibrium(bcs, cloth.weight(AREAL_MASS, ufl.as_vector((0.0, 0.0, -9.81))), options=short)
    before = cloth.q.x.array.copy()
    with pytest.raises(StepFailed, match="diverged_linear_solve"):
        solver.solve()
    assert (cloth.q.x.array == before).all()


@pytest.mark.parallel
@pytest.mark.parametrize("kind", ["elastic", "woven"])
def test_symmetric_systems_are_factorised_as_such(kind):
    """LDL' where all terms are symmetric, LU where the law is not, or is asked for: one answer."""
    heights = []
    for options in ({}, linear.DIRECT):
        solver, g = stretched(square(kind, 6), options)
        symmetric = kind == "elastic" and not options
        assert linear.method(solver.snes) == ("LDL' by MUMPS" if symmetric else "LU by MUMPS")
        assert solver.symmetric == (kind == "elastic")
        solver.solve()
        solver.commit()
        g.value[2] = -9.81
        solver.solve()
        heights.append(solver.u.x.array.copy())
    assert np.abs(heights[1]).max() > 0.0
    assert np.abs(heights[0] - heights[1]).max() < 1e-8 * np.abs(heights[1]).max()


class Untold(term.Term):
    """Another term, which does not tell its stiffness by angles."""

    def __init__(self, other):
        self.pattern, self.add_stiffness = other.pattern, other.add_stiffness


@pytest.mark.parallel
@pytest.mark.parametrize("element", ["mitc4", "regge"])
def test_a_matrix_summed_up_at_once_is_the_product_of_the_one_by_directors(element):
    solver = falling(square("woven", 6, element), {})
    x = solver.begin()
    x.array_w[:] += 1e-3 * np.random.default_rng(COMM.rank).standard_normal(x.local_size)
    solver.residual(x)
    at_once, force = solver.tangent, solver._unknowns.force
    terms = [Untold(other) for other in at_once._terms]
    product = tangent.Tangent(terms, at_once._space, at_once._shell, at_once._turn)
    assert at_once._whole and not product._whole
    for matrix in (at_once, product):
        matrix.assemble(force)
    difference = product.A.copy()
    difference.axpy(-1.0, at_once.A)
    assert difference.norm() < 1e-14 * product.A.norm()
    # what turns the directors is a good part of it
    own = solver._shell.W.dofmap.index_map.local_to_global(solver._shell.angles.ravel().astype(np.int32))
    begin, end = product.A.getOwnershipRange()
    angles = own[(own >= begin) & (own < end)].astype(np.int32)
    assert np.abs(product.A.getDiagonal().array_r[angles - begin]).min() > 0.0
