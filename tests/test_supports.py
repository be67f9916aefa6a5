"""Supports that meet: any order is the same, a curved sheet stays unstressed at rest, a contradiction is refused."""

import itertools

import gmsh
import numpy as np
import pytest
import scenes
from mpi4py import MPI
from dolfinx import fem, la

from fabric_fenicsx import sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

COMM = MPI.COMM_WORLD
STEEL = StVenantKirchhoff.isotropic(2e11, 0.3)
both = pytest.mark.parametrize("triangles", [0, 1], ids=["mitc4", "regge"])


def shell(domain, thickness=0.01):
    G = 2e11 / 2.6
    return sheet.Sheet(domain, STEEL, thickness, (G, G))


def cylinder(triangles, comm=COMM):
    """A quarter of a cylinder about y: `top` is in the plane x = 0, `side` in z = 0, and `middle` in y = 0."""
    return meshing.read(scenes.MESHES / "cylinder.geo", comm, nx=3, ny=2, triangles=triangles, order=1 + triangles)


def hypar(triangles, cells=16, comm=COMM):
    """Half of z = x^2 - y^2 over |x|, |y| <= 1/2, the one with y > 0."""

    def build():
        geo = gmsh.model.geo
        points = [geo.addPoint(x, y, 0) for x, y in ((-0.5, 0), (0.5, 0), (0.5, 0.5), (-0.5, 0.5))]
        lines = [geo.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
        face = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        for line, number in zip(lines, 2 * [cells, cells // 2], strict=True):
            geo.mesh.setTransfiniteCurve(line, number + 1)
        geo.mesh.setTransfiniteSurface(face, "Alternate")
        if not triangles:
            geo.mesh.setRecombine(2, face)
        geo.synchronize()
        groups = {"sheet": (2, face), "middle": (1, lines[0]), "clamped": (1, lines[3]), "tip": (0, points[1])}
        for name, (dim, tag) in groups.items():
            gmsh.model.addPhysicalGroup(dim, [tag], name=name)
        gmsh.option.setNumber("Mesh.ElementOrder", 1 + triangles)
        gmsh.model.mesh.generate(2)

    domain = meshing.from_gmsh(build, comm)
    x = domain.mesh.geometry.x
    x[:, 2] = x[:, 0] ** 2 - x[:, 1] ** 2
    return domain


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["clamp first", "symmetry first"])
@both
def test_half_of_a_clamped_hypar_is_as_soft_as_the_whole(triangles, order):
    """t/L = 1/100 (Bathe, Iosilevich, Chapelle 2000, doi 10.1016/S0045-7949(00)00057-2): energy and tip, both elements.

    At 1 % of the load, where it is linear.
    """
    domain, part = hypar(triangles), 0.01
    cloth = shell(domain)
    conditions = [
        supports.clamp(domain, cloth.space, "clamped"),
        supports.symmetry(domain, cloth.space, "middle", 1),
    ]
    load = weakform.surface_traction(fem.Constant(domain.mesh, (0.0, 0.0, -80.0 * part)), cloth.v, cloth.dx)
    cloth.equilibrium([bc for i in order for bc in conditions[i]], load).solve()
    energy = 2 * COMM.allreduce(fem.assemble_scalar(fem.form(cloth.stored))) / part**2
    assert energy == pytest.approx(0.001679, rel=0.03)
    assert supports.mean(domain, cloth.space, cloth.q, "tip", 2) / part == pytest.approx(-9.3355e-5, rel=0.03)


KINDS = {
    "clamp": lambda domain, space: supports.clamp(domain, space, "end"),
    "grip": lambda domain, space: supports.grip(domain, space, "end")[0],
    "hinge": lambda domain, space: supports.hinge(domain, space, "end"),
    "top": lambda domain, space: supports.symmetry(domain, space, "top", 0),
    "side": lambda domain, space: supports.symmetry(domain, space, "side", 2),
    "middle": lambda domain, space: supports.symmetry(domain, space, "middle", 1),
}
MEETINGS = ["clamp top", "grip side", "hinge top", "top middle", "clamp grip", "clamp top middle", "grip side hinge"]


@pytest.mark.parallel(first=1)
@both
def test_in_any_order_the_same_is_held_and_a_curved_sheet_is_at_rest(triangles):
    """Forces of round-off only, against E h times the size."""
    domain = cylinder(triangles)
    for chosen in MEETINGS if COMM.size == 1 else MEETINGS[::3]:
        seen = []
        for order in itertools.permutations(chosen.split()):
            cloth = shell(domain)
            solver = cloth.equilibrium([bc for name in order for bc in KINDS[name](domain, cloth.space)])
            assert np.abs(solver.residual(solver.begin()).array_r).max(initial=0.0) < 1e-12 * 2e9
            seen.append((solver._given_rows, cloth.space.normal.x.array.copy(), solver._targets))
        for other in seen[1:]:
            assert all(np.array_equal(a, b) for a, b in zip(seen[0], other, strict=True))


@pytest.mark.parallel(first=1)
@both
def test_a_grip_in_a_plane_of_symmetry_moves_the_sheet_as_one_body(triangles):
    """About x and along y and z, in the plane x = 0, whatever comes first."""
    domain = cylinder(triangles)
    for first in (True, False):
        cloth = shell(domain)
        held, move = supports.grip(domain, cloth.space, "end")
        symmetry = supports.symmetry(domain, cloth.space, "top", 0)
        solver = cloth.equilibrium(held + symmetry if first else symmetry + held)
        for angle in (0.3, 0.6):
            move((0.0, 0.2, -0.1), (angle, 0.0, 0.0), (0.0, 0.5, 1.0))
            solver.solve()
            solver.commit()
        assert np.abs(cloth.cell_strain()).max(initial=0.0) < 1e-10


@both
def test_explicit_motion_begins_at_rest_beside_a_plane_of_symmetry(triangles):
    domain = cylinder(triangles, MPI.COMM_SELF)
    cloth = shell(domain)
    held = supports.clamp(domain, cloth.space, "end") + supports.symmetry(domain, cloth.space, "top", 0)
    run, _ = cloth.explicit(78.0, held)
    list(run.march(20 * run.stable, 10 * run.stable))
    assert np.abs(cloth.cell_strain()).max() < 1e-13
    assert np.abs(np.linalg.norm(cloth.q.x.array[cloth.space.nodes], axis=1) - 1).max() < 1e-14


@pytest.mark.parallel(first=1)
@both
def test_supports_that_contradict_each_other_are_refused_on_every_rank(triangles):
    domain = cylinder(triangles)
    cloth = shell(domain)
    space = cloth.space
    held, move = supports.grip(domain, space, "end")
    solver = cloth.equilibrium(held + supports.symmetry(domain, space, "top", 0))
    move((0.1, 0.0, 0.0))
    with pytest.raises(InputError, match=r"contradict each other: at \(0, 1, 1\) m one gives 0 and another 0\.1;"):
        solver.solve()
    end = fem.Constant(domain.mesh, 0.0)
    solver = shell(domain).equilibrium([])  # another sheet's conditions do not matter
    solver.solve()
    cloth = shell(domain)
    run, _ = cloth.newmark(
        78.0, supports.hinge(domain, cloth.space, "end") + supports.lead(domain, cloth.space, "end", 1, end)
    )
    end.value = 0.2
    with pytest.raises(InputError, match=r"one gives 0 and another 0\.2;"):
        list(run.march(1e-3, 1e-3))
    # the normals of this edge point along x, and no director lies in three planes
    cloth = shell(domain)
    with pytest.raises(InputError, match="plane"):
        cloth.equilibrium(
            supports.clamp(domain, cloth.space, "side") + supports.symmetry(domain, cloth.space, "side", 0)
        )
    cloth = shell(domain)
    with pytest.raises(InputError, match="plane"):
        cloth.equilibrium([bc for i in range(3) for bc in supports.symmetry(domain, cloth.space, "side", i)])


@pytest.mark.parallel
def test_a_membrane_whose_supports_contradict_is_refused():
    domain = cylinder(1)
    cloth = sheet.Sheet(domain, STEEL, 0.01, kinematics="membrane")
    held = supports.hinge(domain, cloth.space, "end") + supports.lead(domain, cloth.space, "top", 2, -0.1)
    with pytest.raises(InputError, match=r"one gives -0\.1 and another 0;"):
        cloth.equilibrium(held).solve()


# Moments of reactions


def moment(cloth, forces, about=(0.0, 0.0, 0.0)):
    """Moment about a point of nodal forces on a shell, from the places of its unknowns: a loop over nodes."""
    space, q, total = cloth.space, cloth.q.x.array, np.zeros(3)
    x, (_, u), (_, d) = supports.places(space), *(space.V.sub(i).collapse() for i in (0, 1))
    for nodes, at in ((u, x), (d, 0 * x)):
        for node in np.array(nodes).reshape(-1, 3):
            if node[0] < len(forces):
                arm = q[node] + at[node[0]] - (about if nodes is u else 0.0)
                total += np.cross(arm, forces[node])
    return COMM.allreduce(total)


@pytest.mark.parallel(first=1)
@both
def test_the_moment_at_a_clamp_is_the_load_times_its_arm(triangles):
    """At rest and far bent; of a moment at the end, that moment: with no force at all the directors take it."""
    length, width, h, modulus = 2.0, 0.5, 0.02, 1e6
    size = {"length": length, "width": width, "nx": 6, "ny": 2}
    domain = meshing.read(scenes.MESHES / "strip.geo", COMM, gdim=3, triangles=triangles, **size)
    law, about = StVenantKirchhoff.isotropic(modulus, 0.0), np.array([0.3, -0.2, 0.7])
    for part, bent in ((1e-4, False), (1.0, True)):
        cloth = sheet.Sheet(domain, law, h, (modulus / 2, modulus / 2))
        force, couple = (part * 2.0 * modulus * h**3 / 12 / length**k for k in (2, 1))
        pull, turn = (fem.Constant(domain.mesh, (0.0, 0.0, 0.0)) for _ in range(2))
        ends = [supports.over(domain, "pulled_end", degree) for degree in (2, 1)]
        load = weakform.traction(pull, cloth.v, ends[0])
        load += weakform.edge_moment(turn, cloth.director, cloth.delta, ends[1])
        solver = cloth.equilibrium(supports.clamp(domain, cloth.space, "fixed_end"), load, rtol=1e-10)

        def set_load(t, pull=pull, turn=turn, force=force, couple=couple):
            pull.value[2], turn.value[1] = t * force, -t * couple / 4

        list(statics.march(solver, set_load, np.linspace(0, 1, 7)[1:] if bent else [1.0]))
        end = np.array([length, width / 2, 0.0])
        end += [supports.mean(domain, cloth.space, cloth.q, "pulled_end", i) for i in range(3)]
        applied = np.cross(end - about, [0, 0, force * width]) + [0, -couple / 4 * width, 0]
        held = supports.unknowns(domain, cloth.space, "fixed_end")
        reaction = solver.reaction_moment(held, about)
        # the end of triangles is not quite straight, and its nodes do not weigh alike
        np.testing.assert_allclose(reaction, -applied, atol=(3e-5 if triangles else 1e-6) * np.abs(applied).max())
        np.testing.assert_allclose(reaction, -moment(cloth, nodal(load), about), rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(reaction, moment(cloth, restricted(solver.forces(), held), about), rtol=1e-9)
        assert (end[2] > 0.5) == bent


def nodal(load):
    """Forces of a load at the owned unknowns."""
    b = fem.assemble_vector(fem.form(load))
    b.scatter_reverse(la.InsertMode.add)
    return b.array[: b.index_map.size_local * b.block_size]


def restricted(forces, dofs):
    """Nodal forces at some unknowns alone."""
    result = np.zeros_like(forces)
    result[dofs[dofs < len(forces)]] = forces[dofs[dofs < len(forces)]]
    return result


@pytest.mark.parallel
@pytest.mark.parametrize("kind", ["newmark", "explicit"])
def test_the_moment_at_a_clamp_of_a_sheet_in_motion_balances_load_and_inertia(kind):
    """Internal forces have no moment, so what the clamp gives is inertia less the load."""
    domain = meshing.read(scenes.MESHES / "strip.geo", COMM, gdim=3, length=0.4, width=0.1, nx=4, ny=2, triangles=1)
    cloth = sheet.Sheet(domain, StVenantKirchhoff.isotropic(1e5, 0.3), 2e-3, (4e4, 4e4))
    load = weakform.gravity(0.2, fem.Constant(domain.mesh, (1.0, 2.0, -9.81)), cloth.v, cloth.dx)
    run, _ = getattr(cloth, kind)(0.2, supports.clamp(domain, cloth.space, "fixed_end"), load)
    list(run.march(0.06, 0.01))
    assert supports.mean(domain, cloth.space, cloth.q, "pulled_end", 2) < -0.005
    a, size = run.motion.acceleration.x.array, len(run.forces())
    inertia = run.motion.by_mass(run.motion.acceleration).array_r if kind == "newmark" else (run.mass * a)[:size]
    about = (0.1, 0.2, 0.3)
    expected = moment(cloth, inertia, about) - moment(cloth, nodal(load), about)
    reaction = run.reaction_moment(supports.unknowns(domain, cloth.space, "fixed_end"), about)
    np.testing.assert_allclose(reaction, expected, atol=(1e-3 if kind == "newmark" else 1e-9) * np.abs(expected).max())
