"""Every load against its exact answer, and every support; on any number of ranks."""

import basix.ufl
import gmsh
import numpy as np
import pytest
import scenes
import ufl
from mpi4py import MPI
from dolfinx import fem, la

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.shell import assumed_strain, directors
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports, weakform

COMM = MPI.COMM_WORLD
G = np.array([1.3, -0.7, -9.81])
cells = pytest.mark.parametrize("triangles", [0, 1], ids=["quadrilaterals", "triangles"])


def strip(comm=COMM, triangles=1, length=2.0, width=0.6, cells=(4, 3), skew=0.0):
    """A flat strip along x; inner nodes moved by up to `skew` of a cell."""
    size = {"length": length, "width": width, "nx": cells[0], "ny": cells[1]}
    domain = meshing.read(scenes.MESHES / "strip.geo", comm, triangles=triangles, **size)
    x = domain.mesh.geometry.x
    place = x[:, :2] / [length, width]
    inner = ((place > 1e-9) & (place < 1 - 1e-9)).all(axis=1)
    noise = np.sin(place @ [[12.9898, 39.346], [78.233, 11.135]] + [0, 1]) * 43758.5453 % 2 - 1
    x[inner, :2] += skew * noise[inner] * [length / cells[0], width / cells[1]]
    return domain


def box(comm=COMM, sides=(1.0, 0.7, 0.5)):
    """The surface of a box, normals out."""

    def build():
        gmsh.model.occ.addBox(0, 0, 0, *sides)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name="sheet")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.model.mesh.generate(2)

    return meshing.from_gmsh(build, comm)


NAILS = np.array([[0.3, 0.2], [0.7, 0.4], [1.0, 1.0], [0.0, 0.5]])


def nailed(comm=COMM):
    """A unit square with a group of points inside and on its rim, the edge x = 0 "fixed", and a cut in the middle."""

    def build():
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        ends = [gmsh.model.occ.addPoint(x, 0.6, 0) for x in (0.4, 0.8)]
        cut = gmsh.model.occ.addLine(*ends)
        tools = [(0, gmsh.model.occ.addPoint(*x, 0)) for x in NAILS] + [(1, cut)]
        _, pieces = gmsh.model.occ.fragment([(2, 1)], tools)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name="sheet")
        gmsh.model.addPhysicalGroup(0, [tag for piece in pieces[1:5] for _, tag in piece], name="nails")
        gmsh.model.addPhysicalGroup(1, [tag for _, tag in pieces[5]], name="inside")
        for name, x in (("fixed", 0.0), ("end", 1.0)):
            found = gmsh.model.getEntitiesInBoundingBox(x - 1e-6, -1e-6, -1e-6, x + 1e-6, 1 + 1e-6, 1e-6, 1)
            gmsh.model.addPhysicalGroup(1, [tag for _, tag in found], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)
        gmsh.model.mesh.generate(2)

    return meshing.from_gmsh(build, comm)


def displacements(domain):
    """Quadratic displacements in space, and the test function."""
    V = fem.functionspace(domain.mesh, ("Lagrange", 2, (3,)))
    return fem.Function(V), ufl.TestFunction(V)


def wave(u, scale):
    """Fill a displacement with a smooth field, the same on any number of ranks."""
    u.interpolate(lambda x: scale * np.sin(5 * x[[1, 2, 0]] + 3 * x[[2, 0, 1]] + np.array([[0.1], [1.1], [2.3]])))
    return u


def virtual(q, shift=(0, 0, 0), turn=(0, 0, 0)):
    """The virtual rigid motion of a sheet as it is: shift + turn x place, and turn x director where there is one."""
    V, shift, turn = q.function_space, np.array(shift, dtype=float), np.array(turn, dtype=float)
    w = fem.Function(V)
    shell = V.num_sub_spaces == 2
    U, nodes = V.sub(0).collapse() if shell else (V, np.arange(len(q.x.array)))
    nodes = np.array(nodes).reshape(-1, 3)
    w.x.array[nodes] = shift + np.cross(turn, U.tabulate_dof_coordinates() + q.x.array[nodes])
    if shell:
        nodes = np.array(V.sub(1).collapse()[1]).reshape(-1, 3)
        w.x.array[nodes] = np.cross(turn, q.x.array[nodes])
    return w


def work(form, w, at=None):
    """Work of a form in the test function on w; `at`: on these local unknowns only."""
    b = fem.assemble_vector(fem.form(form))
    b.scatter_reverse(la.InsertMode.add)
    owned = np.zeros(len(b.array), dtype=bool)
    owned[: b.index_map.size_local * b.block_size] = True
    if at is not None:
        owned &= np.isin(np.arange(len(owned)), at)
    return w.function_space.mesh.comm.allreduce(float(b.array[owned] @ w.x.array[owned]))


def resultant(form, q, at=None):
    """Force and moment about the origin (6,) of a form."""
    unit = np.eye(3)
    rigid = [virtual(q, shift=e) for e in unit] + [virtual(q, turn=e) for e in unit]
    return np.array([work(form, w, at) for w in rigid])


# Loads


@pytest.mark.parallel(first=1)
@cells
def test_weight_and_tractions_add_up_to_themselves(triangles):
    domain = strip(triangles=triangles, skew=0.2)
    u, v = displacements(domain)
    dx, end, g = supports.over(domain, "sheet", 2), supports.over(domain, "pulled_end", 2), ufl.as_vector(G)
    for form, force in (
        (weakform.gravity(0.3, g, v, dx), 0.3 * 1.2 * G),
        (weakform.surface_traction(g, v, dx), 1.2 * G),
        (weakform.body_force(g, v, 1e-3, dx), 1.2e-3 * G),
    ):
        moment = np.cross([1.0, 0.3, 0.0], force)
        np.testing.assert_allclose(resultant(form, u), [*force, *moment], rtol=1e-12, atol=1e-14)
    force, moment = 0.6 * G, np.cross([2.0, 0.3, 0.0], 0.6 * G)
    np.testing.assert_allclose(resultant(weakform.traction(g, v, end), u), [*force, *moment], rtol=1e-12)


@pytest.mark.parallel
def test_every_point_of_a_group_gets_its_force_once():
    domain = nailed()
    u, v = displacements(domain)
    form = weakform.point_force(ufl.as_vector(G), v, supports.over(domain, "nails", 1))
    moment = np.cross([*NAILS.sum(axis=0), 0.0], G)
    np.testing.assert_allclose(resultant(form, u), [*4 * G, *moment], rtol=1e-12)


@pytest.mark.parallel
def test_pressure_does_no_work_when_a_closed_surface_moves_as_one_body():
    """However it is deformed; and when it grows, x by s x, it does the work 3 p V s."""
    domain = box()
    u, v = displacements(domain)
    form, volume = weakform.pressure(2.0, u, v, supports.over(domain, "sheet", 4)), 0.35
    w = fem.Function(u.function_space)
    F = np.array([[1.2, 0.3, 0.0], [-0.4, 0.9, 0.2], [0.1, 0.0, 1.5]])
    u.interpolate(lambda x: (F - np.eye(3)) @ x)
    w.interpolate(lambda x: F @ x)
    assert work(form, w) == pytest.approx(3 * 2.0 * volume * np.linalg.det(F), rel=1e-12)
    assert np.abs(resultant(form, wave(u, 0.2))).max() < 1e-12


@pytest.mark.parametrize("closed", [True, False])
def test_tangent_of_the_pressure(closed):
    """Taylor remainders of order 2; symmetric for a closed surface only."""
    domain = box(MPI.COMM_SELF) if closed else strip(MPI.COMM_SELF)
    u, v = displacements(domain)
    w = fem.Function(u.function_space)
    w.interpolate(lambda x: np.cos(4 * x[[2, 0, 1]] + 2 * x))
    form = weakform.pressure(2.0, wave(u, 0.2), v, supports.over(domain, "sheet", 4))
    residual = fem.form(form)
    K = fem.assemble_matrix(fem.form(ufl.derivative(form, u))).to_dense()
    start, at = fem.assemble_vector(residual).array, u.x.array.copy()
    steps, errors = 2.0 ** -np.arange(2, 8), []
    for step in steps:
        u.x.array[:] = at + step * w.x.array
        errors.append(np.linalg.norm(fem.assemble_vector(residual).array - start - step * K @ w.x.array))
    assert 1.9 < np.polyfit(np.log(steps), np.log(errors), 1)[0] < 2.1
    asymmetry = np.abs(K - K.T).max() / np.abs(K).max()
    assert asymmetry < 1e-12 if closed else asymmetry > 0.1


def newton(space, q, thickness, E, nu, loads, bcs, warp=(1, 0, 0)):
    """Newton, to round-off, on an isotropic shell under loads."""
    residual = [scenes.shell(space, q, thickness, E, nu, warp), -sum(loads)]
    return statics.StaticSolver(residual, q, bcs, rtol=1e-11, options={"snes_max_it": 50}, space=space)


def largest(q, dofs):
    """Largest of some local unknowns over all ranks."""
    return COMM.allreduce(q.x.array[dofs].max(initial=-np.inf), MPI.MAX)


@pytest.mark.parallel
def test_an_inflated_cylinder_is_the_exact_ring():
    """Hoops F times longer carry S = C (F^2 - 1) / 2, and p r = F S h with r = F R."""
    R, h, E, nu, F = 2.0, 0.01, 1e6, 0.3, 1.3
    domain = meshing.read(scenes.MESHES / "cylinder.geo", COMM, radius=R, length=1.0, angle=90, nx=12, ny=2)
    space = directors.ShellSpace(domain.mesh)
    q, (v, _) = space.function(), ufl.TestFunctions(space.V)
    u, _ = ufl.split(q)
    p, sheet = fem.Constant(domain.mesh, 0.0), supports.over(domain, "sheet", 6)
    bcs = supports.symmetry(domain, space, "top", 0) + supports.symmetry(domain, space, "side", 2)
    bcs += supports.symmetry(domain, space, "middle", 1) + supports.symmetry(domain, space, "end", 1)
    solver = newton(space, q, h, E, nu, [weakform.pressure(p, u, v, sheet)], bcs, warp=(0, 1, 0))
    out = ufl.inner(ufl.SpatialCoordinate(domain.mesh), ufl.CellNormal(domain.mesh))
    outward = np.sign(COMM.allreduce(fem.assemble_scalar(fem.form(out * sheet))))
    final = E / (1 - nu**2) * (F**2 - 1) / 2 * h / R

    def inflate(value):
        p.value = outward * value

    list(statics.march(solver, inflate, np.linspace(0, final, 6)[1:]))
    assert largest(q, supports.unknowns(domain, space, "A", 2)) == pytest.approx((F - 1) * R, rel=1e-4)
    # the length along the axis is 1, and the cut at the side carries p r
    held = solver.reaction(supports.unknowns(domain, space, "side", 2))
    assert held == pytest.approx(-final * F * R, rel=1e-4)


def strains(space, q):
    """Membrane and bending strains at the points of all owned cells, shape (n, 6)."""
    strain, _ = assumed_strain.shell_strains(space, q, (1, 0, 0))
    element = basix.ufl.quadrature_element(space.mesh.basix_cell(), degree=directors.DEGREE)
    points = fem.functionspace(space.mesh, element).element.interpolation_points
    owned = np.arange(space.mesh.topology.index_map(2).size_local, dtype=np.int32)
    return fem.Expression(strain, points).eval(space.mesh, owned).reshape(-1, 6)


@pytest.mark.parallel(first=1)
@cells
def test_an_edge_moment_bends_a_strip_to_the_curvature_m_over_ei(triangles):
    """About -y at x = L it lifts the end: the director turns towards -x, and the lower side is stretched."""
    L, width, h, E, angle = 2.0, 0.6, 0.02, 1e6, 1e-3
    domain = strip(triangles=triangles, length=L, width=width, cells=(8, 2))
    space = directors.ShellSpace(domain.mesh)
    q, (_, delta) = space.function(), ufl.TestFunctions(space.V)
    _, d = ufl.split(q)
    M = E * h**3 / 12 * angle / L
    load = weakform.edge_moment(ufl.as_vector([0.0, -M, 0.0]), d, delta, supports.over(domain, "pulled_end", 1))
    solver = newton(space, q, h, E, 0.0, [load], supports.clamp(domain, space, "fixed_end"))
    solver.solve()
    np.testing.assert_allclose(strains(space, q)[:, 3], -angle / L, rtol=1e-6)
    assert largest(q, supports.unknowns(domain, space, "pulled_end", 2)) == pytest.approx(L * angle / 2, rel=1e-5)


@pytest.mark.parallel(first=1)
@cells
def test_an_edge_moment_is_in_balance_at_a_finite_rotation(triangles):
    L, width, h, E = 2.0, 0.6, 0.02, 1e6
    domain = strip(triangles=triangles, length=L, width=width, cells=(8, 2))
    space = directors.ShellSpace(domain.mesh)
    q, (_, delta) = space.function(), ufl.TestFunctions(space.V)
    _, d = ufl.split(q)
    moment = fem.Constant(domain.mesh, (0.0, 0.0, 0.0))
    # the element of triangles has its directors at the middles of edges, that of quadrilaterals at their ends
    end = supports.over(domain, "pulled_end", 1)
    load = weakform.edge_moment(moment, d, delta, end)
    bcs = supports.clamp(domain, space, "fixed_end")
    solver = newton(space, q, h, E, 0.0, [load], bcs)

    def bend(angle):
        moment.value[1] = -E * h**3 / 12 * angle / L

    list(statics.march(solver, bend, np.linspace(0, 2.0, 9)[1:]))
    M = moment.value[1] * width
    # in the wide a strip with nu = 0 stays a cylinder, and its directors along an edge are one
    np.testing.assert_allclose(resultant(load, q), [0, 0, 0, 0, M, 0], atol=1e-6 * abs(M))
    held = np.concatenate([bc.dof_indices()[0] for bc in bcs])
    reaction = resultant(scenes.shell(space, q, h, E, 0.0).form, q, held)
    np.testing.assert_allclose(reaction + resultant(load, q), np.zeros(6), atol=1e-8 * abs(M))
    tip = 1 - np.cos(2.0)
    assert largest(q, supports.unknowns(domain, space, "pulled_end", 2)) == pytest.approx(L * tip / 2.0, rel=0.01)


@pytest.mark.parallel(first=1)
@cells
def test_an_edge_traction_stretches_a_skewed_sheet_evenly(triangles):
    """S11 = T / (F h), S22 = 0, at a stretch F of 1.1."""
    h, E, nu, F = 0.01, 1e6, 0.3, 1.1
    domain = strip(triangles=triangles, skew=0.2)
    space = directors.ShellSpace(domain.mesh)
    q, (v, _) = space.function(), ufl.TestFunctions(space.V)
    E11 = (F**2 - 1) / 2
    load = weakform.traction(ufl.as_vector([E * E11 * F * h, 0.0, 0.0]), v, supports.over(domain, "pulled_end", 2))
    bcs = supports.symmetry(domain, space, "fixed_end", 0)
    bcs += supports.lead(domain, space, "pin", 1, 0.0) + supports.lead(domain, space, "sheet", 2, 0.0)
    solver = newton(space, q, h, E, nu, [load], bcs)
    solver.solve()
    assert np.abs(strains(space, q) - [E11, -nu * E11, 0, 0, 0, 0]).max(initial=0.0) < 1e-10
    assert largest(q, supports.unknowns(domain, space, "pulled_end", 0)) == pytest.approx(2.0 * (F - 1), rel=1e-10)
    force = solver.reaction(supports.unknowns(domain, space, "fixed_end", 0))
    assert force == pytest.approx(-E * E11 * F * h * 0.6, rel=1e-9)


@pytest.mark.parallel
def test_reactions_balance_all_loads_at_once_and_their_tangent_is_exact():
    """A sheet clamped at one edge, far bent: forces and moments of the reactions and of all loads."""
    domain = nailed()
    space = directors.ShellSpace(domain.mesh)
    q, (v, delta) = space.function(), ufl.TestFunctions(space.V)
    u, d = ufl.split(q)
    t, g = fem.Constant(domain.mesh, 0.0), ufl.as_vector(G / 10)
    dx, end = supports.over(domain, "sheet", 4), supports.over(domain, "end", 1)
    loads = [
        weakform.gravity(0.1 * t, g, v, dx),
        weakform.surface_traction(0.1 * t * g, v, dx),
        weakform.traction(0.1 * t * g, v, end),
        weakform.pressure(0.1 * t, u, v, dx),
        weakform.point_force(0.1 * t * g, v, supports.over(domain, "nails", 1)),
        weakform.edge_moment(0.1 * t * g, d, delta, end),
    ]
    h, E, nu = 0.02, 1e6, 0.3
    bcs = supports.clamp(domain, space, "fixed")
    solver = newton(space, q, h, E, nu, loads, bcs)

    def load(value):
        t.value = value

    list(statics.march(solver, load, np.linspace(0, 1, 5)[1:]))
    assert largest(q, supports.unknowns(domain, space, "end", 2)) < -0.1
    applied = np.sum([resultant(form, q) for form in loads], axis=0)
    held = np.concatenate([bc.dof_indices()[0] for bc in bcs])
    inner = scenes.shell(space, q, h, E, nu).form
    reaction = resultant(inner - sum(loads), q, held)
    np.testing.assert_allclose(reaction, -applied, atol=1e-8 * np.abs(applied).max())
    forces = [solver.reaction(supports.unknowns(domain, space, "fixed", i)) for i in range(3)]
    np.testing.assert_allclose(forces, reaction[:3], rtol=1e-9, atol=1e-12)

    # the assembled tangent in displacement and angles, away from equilibrium: Taylor remainders of order 2
    x = solver.begin().copy()
    rng = np.random.default_rng(COMM.rank)
    x.array_w[:] += 0.02 * rng.standard_normal(x.local_size)
    along = x.duplicate()
    along.array_w[:] = rng.standard_normal(x.local_size)
    start = solver.residual(x).copy()
    change = x.duplicate()
    solver.factorised().getOperators()[0].mult(along, change)
    steps, errors = 2.0 ** -np.arange(8, 14), []
    for step in steps:
        errors.append((solver.residual(x + along * float(step)) - start - change * float(step)).norm())
    assert 1.9 < np.polyfit(np.log(steps), np.log(errors), 1)[0] < 2.1


# Supports


@pytest.mark.parallel(first=1)
@cells
def test_between_two_grips_a_strip_moves_as_one_body(triangles):
    domain = strip(triangles=triangles)
    space = directors.ShellSpace(domain.mesh)
    q = space.function()
    grips = [supports.grip(domain, space, name) for name in ("fixed_end", "pulled_end")]
    solver = newton(space, q, 0.01, 1e6, 0.3, [], [bc for bcs, _ in grips for bc in bcs])
    axis, centre, shift = np.array([0.6, 0.0, 0.8]), np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -0.5])

    def move(angle):
        for _, grip in grips:
            grip(angle * shift, angle * axis, centre)

    list(statics.march(solver, move, np.linspace(0, 2 * np.pi + 1, 13)[1:]))
    angle = 2 * np.pi + 1
    K = np.array([[0, -0.8, 0], [0.8, 0, -0.6], [0, 0.6, 0]])
    R = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    for part, exact in ((0, lambda x: (x - centre) @ R.T + centre + angle * shift - x), (1, lambda x: 0 * x + R[:, 2])):
        value, nodes = space.V.sub(part).collapse()
        expected = exact(value.tabulate_dof_coordinates())
        assert np.abs(q.x.array[nodes].reshape(-1, 3) - expected).max(initial=0.0) < 1e-9
    assert np.abs(strains(space, q)).max(initial=0.0) < 1e-9


@pytest.mark.parallel
def test_a_led_component_pulls_and_leaves_the_others_free():
    domain = strip()
    space = directors.ShellSpace(domain.mesh)
    q, end = space.function(), fem.Constant(domain.mesh, 0.0)
    bcs = supports.symmetry(domain, space, "fixed_end", 0) + supports.lead(domain, space, "pulled_end", 0, end)
    bcs += supports.lead(domain, space, "pin", 1, 0.0) + supports.lead(domain, space, "sheet", 2, 0.0)
    solver = newton(space, q, 0.01, 1e6, 0.3, [], bcs)
    end.value = 0.2
    solver.solve()
    E11 = 0.1 + 0.1**2 / 2
    assert np.abs(strains(space, q) - [E11, -0.3 * E11, 0, 0, 0, 0]).max(initial=0.0) < 1e-9


@pytest.mark.parallel
def test_a_membrane_is_clamped_by_its_displacement():
    domain = strip()
    u, _ = displacements(domain)
    for hold in (supports.clamp, supports.hinge):
        held = [set(bc.dof_indices()[0].tolist()) for bc in hold(domain, u.function_space, "fixed_end")]
        expected = fem.locate_dofs_topological(u.function_space, *domain.entities("fixed_end"))
        assert set().union(*held) == {3 * node + i for node in expected.tolist() for i in range(3)}
    assert len(supports.symmetry(domain, u.function_space, "fixed_end", 1)) == 1


@pytest.mark.parallel
def test_a_load_on_edges_inside_the_sheet_is_refused():
    domain = nailed()
    with pytest.raises(InputError, match="'inside' has edges inside the sheet"):
        supports.over(domain, "inside", 2)
    with pytest.raises(InputError, match="no physical group 'nowhere'"):
        supports.over(domain, "nowhere", 2)
