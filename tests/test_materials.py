"""Sheets of several materials: in series and in parallel, as one of them, their energies, checkpoints and cost."""

import re
from dataclasses import replace

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from dolfinx import fem
from scipy.optimize import brentq

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.lay_up import LayUp, Ply
from fabric_fenicsx.laws.section import Section
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.material import Material
from fabric_fenicsx.scenes import building, marks, reading, running, sheet_reading
from fabric_fenicsx.solvers import checkpoint, statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import hook, supports

COMM = MPI.COMM_WORLD
LENGTH, SPLIT, WIDTH = 0.2, 0.08, 0.1
SOFT = StVenantKirchhoff.isotropic(2e6, 0.3)


def yarns_apart(name):
    """A measured fabric without Poisson's ratio: its yarns are springs."""
    fabric = fabrics.load(name)
    return replace(fabric, poisson={"measured": (0.0, 0.0)})


BLEND, MUSLIN = yarns_apart("blend"), yarns_apart("muslin")


def woven(fabric, **more):
    G = fabric.shear.modulus[0]
    values = {"law": Woven(fabric), "thickness": fabric.thickness, "shear": (G, G), "areal_mass": fabric.areal_mass}
    return Material(**values | more)


def elastic(law=SOFT, thickness=1e-3, **more):
    return Material(**{"law": law, "thickness": thickness, "shear": (5e5, 5e5), "areal_mass": 0.3} | more)


def panels(left, right, comm=COMM, kinematics="shell", **numbers):
    numbers = {"length": LENGTH, "split": SPLIT, "width": WIDTH, "nx": 3, "mx": 4, "ny": 3} | numbers
    domain = meshing.read(meshing.MESHES / "panels.geo", comm, **numbers)
    return sheet.Sheet(domain, {"left": left, "right": right}, kinematics=kinematics)


def pulled(cloth, axis):
    """A solver of a flat sheet between two of its edges along x or y, what pulls it, and the force on it."""
    domain, space, end = cloth.domain, cloth.space, fem.Constant(cloth.domain.mesh, 0.0)
    still, moved = (("fixed_end", "pulled_end"), ("bottom", "top"))[axis]
    bcs = supports.lead(domain, space, still, axis, 0.0) + supports.lead(domain, space, moved, axis, end)
    other = ("bottom", "fixed_end")[axis]
    bcs += supports.lead(domain, space, other, 1 - axis, 0.0)
    for group in ("left", "right"):
        bcs += supports.lead(domain, space, group, 2, 0.0)
        bcs += supports.hold(domain, space, group) if cloth.shell else []
    unknowns = supports.unknowns(domain, space, moved, axis)
    solver = cloth.equilibrium(bcs, rtol=1e-9)

    def pull(d):
        end.value = d

    return solver, pull, lambda: solver.reaction(unknowns)


def tension(fabric, stretch, yarns):
    """Force per width of a fabric along its warp or weft, N/m."""
    E = stretch + stretch**2 / 2
    return float(getattr(fabric, yarns).stress(E)) * fabric.thickness * (1 + stretch)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_two_fabrics_in_series_are_springs_in_series(kinematics):
    """Warp of one against weft of the other; one force, and the displacements add up."""
    cloth = panels(woven(BLEND), woven(MUSLIN, warp=(0, 1, 0)), kinematics=kinematics)
    solver, pull, force = pulled(cloth, 0)
    for step in statics.march(solver, pull, np.array([0.01, 0.03, 0.05]) * LENGTH):

        def apart(a, total=step.load):
            b = (total - a * SPLIT) / (LENGTH - SPLIT)
            return tension(BLEND, a, "warp") - tension(MUSLIN, b, "weft")

        a = brentq(apart, 0.0, step.load / SPLIT, xtol=1e-14)
        assert force() == pytest.approx(tension(BLEND, a, "warp") * WIDTH, rel=1e-6)
    seam = supports.mean(cloth.domain, cloth.space, cloth.q, "seam", 0)
    assert seam == pytest.approx(a * SPLIT, rel=1e-6)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_two_fabrics_in_parallel_are_springs_in_parallel(kinematics):
    cloth = panels(woven(BLEND), woven(MUSLIN, warp=(0, 1, 0)), kinematics=kinematics)
    solver, pull, force = pulled(cloth, 1)
    for step in statics.march(solver, pull, np.array([0.02, 0.05]) * WIDTH):
        d = step.load / WIDTH
        expected = tension(BLEND, d, "weft") * SPLIT + tension(MUSLIN, d, "warp") * (LENGTH - SPLIT)
        assert force() == pytest.approx(expected, rel=1e-6)
    strain = cloth.cell_strain()[:, :2]
    of = [cloth.points[k].cells for k in (0, 1)]
    E = d + d * d / 2
    assert np.allclose(strain[of[0], 1], E) and np.allclose(strain[of[1], 0], E)
    stress = cloth.cell_stress()
    assert np.allclose(stress[of[0], 1], BLEND.weft.stress(E)) and np.allclose(stress[of[1], 0], MUSLIN.warp.stress(E))


def hanging(materials, comm=COMM, kinematics="shell", method="newmark", **settings):
    """A sheet that hangs by one edge and falls: its run and ledger."""
    domain = meshing.read(meshing.MESHES / "panels.geo", comm, nx=2, mx=2, ny=2)
    cloth = sheet.Sheet(domain, materials, kinematics=kinematics)
    weight = cloth.weight(cloth.areal_mass, ufl.as_vector([0.0, 0.0, -9.81]))
    bcs = supports.hinge(domain, cloth.space, "fixed_end")
    settings = {"rtol": 1e-9, **settings} if method == "newmark" else settings
    run, ledger = getattr(cloth, method)(cloth.areal_mass, bcs, weight, **settings)
    return cloth, run, ledger


@pytest.mark.parallel(first=2)
@pytest.mark.parametrize("method", ["newmark", "explicit"])
@pytest.mark.parametrize("make", [lambda: woven(BLEND), elastic], ids=["woven", "elastic"])
@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_twice_the_same_material_is_one(method, make, kinematics):
    """A motion and where its energy goes; of an explicit one the stable step, too."""
    found = []
    for groups in (("left", "right"), ("",)):
        cloth, run, ledger = hanging({group: make() for group in groups}, kinematics=kinematics, method=method)
        for _ in run.march(6e-3, 2e-3):
            pass
        found.append((cloth.q.x.array.copy(), np.array(list(ledger.totals.values())), getattr(run, "stable", 1.0)))
    (u, energies, step), (u1, energies1, step1) = found
    assert np.abs(u - u1).max() < 1e-7 * np.abs(u1).max()
    assert np.abs(energies - energies1).max() < 1e-6 * np.abs(energies1).max()
    assert step == pytest.approx(step1, rel=1e-3)


def test_what_a_material_does_not_need_costs_nothing_on_its_cells():
    """Layers and history of the fabric are on its cells only; the linear material has neither law nor history."""
    cloth = panels(woven(BLEND, layers=4), elastic(), MPI.COMM_SELF)
    (points,) = cloth.points
    own = len(cloth.domain.entities("left", 2)[1])
    assert points.strain.shape[0] == own < len(cloth.cell_strain())
    assert points.history.committed.shape == (own * 4, 4 * Woven(BLEND).initial_state.size)
    both = panels(woven(BLEND, layers=4), woven(MUSLIN, layers=2), MPI.COMM_SELF)
    sizes = [p.history.committed.shape[1] for p in both.points]
    assert sizes == [4 * Woven(BLEND).initial_state.size, 2 * Woven(MUSLIN).initial_state.size]
    assert not panels(elastic(), elastic(thickness=2e-3), MPI.COMM_SELF).points


@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
@pytest.mark.parametrize("make", [lambda: woven(BLEND), elastic], ids=["woven", "elastic"])
def test_a_dictionary_of_one_material_is_the_plain_sheet(make, kinematics):
    """To the last digit, in a motion: no fields of numbers where a number does."""
    material, found = make(), []
    more = {} if kinematics == "membrane" else {"shear": material.shear}
    for given in (True, False):
        domain = meshing.read(meshing.MESHES / "strip.geo", MPI.COMM_SELF, nx=4, ny=2, length=LENGTH, width=WIDTH)
        if given:
            cloth = sheet.Sheet(domain, {"sheet": material}, kinematics=kinematics)
        else:
            cloth = sheet.Sheet(domain, material.law, material.thickness, kinematics=kinematics, **more)
        weight = cloth.weight(0.3, ufl.as_vector([0.0, 0.0, -9.81]))
        run, ledger = cloth.newmark(0.3, supports.hinge(domain, cloth.space, "fixed_end"), weight)
        for _ in run.march(6e-3, 2e-3):
            pass
        found.append((cloth.q.x.array.copy(), ledger.totals, cloth.cell_strain()))
    (u, energies, strain), (u1, energies1, strain1) = found
    assert np.array_equal(u, u1) and energies == energies1 and np.array_equal(strain, strain1)


def test_forces_are_those_of_the_forms():
    """Each material's batches against its form in UFL, on its cells, far from rest."""
    cloth = panels(woven(BLEND), elastic(), MPI.COMM_SELF)
    cloth.q.x.array[:] += np.random.default_rng(3).uniform(-2e-3, 2e-3, len(cloth.q.x.array))
    for work in cloth.terms:
        force = np.zeros_like(cloth.q.x.array)
        assert work.evaluate()
        work.add_force(force)
        form, hooks = hook.plain(work.form)
        assert all(law.evaluate() for law in hooks)
        expected = fem.assemble_vector(fem.form(form)).array
        assert np.abs(force - expected).max() < 1e-11 * np.abs(expected).max()


def test_the_stable_step_is_that_of_the_stiffest_material():
    soft, stiff = elastic(), elastic(StVenantKirchhoff.isotropic(5e7, 0.3))
    both, hard, weak = (
        hanging({"left": left, "right": right}, MPI.COMM_SELF, "membrane", "explicit")[1].stable
        for left, right in ((soft, stiff), (stiff, stiff), (soft, soft))
    )
    assert hard < 0.3 * weak and both == pytest.approx(hard, rel=0.1)


@pytest.mark.parallel(first=1)
@pytest.mark.parametrize("right", [lambda: woven(MUSLIN, layers=2), elastic], ids=["woven", "elastic"])
def test_a_motion_of_two_materials_closes_its_account_and_goes_on_from_a_checkpoint(right, tmp_path):
    path = COMM.bcast(tmp_path) / "state.npz"
    materials, ends = {"left": woven(BLEND), "right": right()}, []
    for stop in (False, True):
        cloth, run, ledger = hanging(materials)
        for step in run.march(0.03, 3e-3):
            if stop and step.number == 5:
                checkpoint.save(path, run)
                cloth, run, ledger = hanging(materials)
                checkpoint.load(path, run)
                for _ in run.march(0.03, 3e-3):
                    pass
                break
        ends.append((cloth.q.x.array.copy(), run.numbers()))
        assert ledger.worst < 5e-3 * ledger.most
    assert np.array_equal(ends[0][0], ends[1][0]) and ends[0][1] == ends[1][1]

    # all of it on each rank
    alone, run, _ = hanging(materials, MPI.COMM_SELF)
    for _ in run.march(0.03, 3e-3):
        pass
    here, there = (supports.mean(c.domain, c.space, c.q, "pulled_end", 2) for c in (cloth, alone))
    assert here == pytest.approx(there, rel=1e-6) and here < -1e-3
    with pytest.raises(InputError, match=r"has another size|the law, the shell"):
        checkpoint.load(path, hanging({"left": woven(BLEND), "right": woven(BLEND)})[1])


def bent(material, **more):
    """Deflection of a strip of one material, clamped at an end under its weight."""
    domain = meshing.read(meshing.MESHES / "strip.geo", MPI.COMM_SELF, length=LENGTH, width=WIDTH, nx=6, ny=2)
    cloth = sheet.Sheet(domain, {"": material}, **more)
    g = fem.Constant(domain.mesh, np.zeros(3))
    solver = cloth.equilibrium(supports.clamp(domain, cloth.space, "fixed_end"), cloth.weight(0.3, g), rtol=1e-10)

    def weigh(share):
        g.value[2] = -9.81 * share

    list(statics.march(solver, weigh, [0.25, 0.5, 1.0]))
    return cloth.q.x.array.copy()


def test_a_section_by_its_stiffness_and_a_lay_up_are_materials():
    """As the law through the thickness: the stiffness of the section as a matrix, and two plies, half as thick each."""
    law, h, shear = StVenantKirchhoff.isotropic(5e7, 0.3), 2e-3, (5e5, 5e5)
    expected = bent(Material(law=law, thickness=h, shear=shear))
    plies = LayUp([Ply(law, h / 2), Ply(law, h / 2, np.pi / 2)])
    for section in (Section(law, h).elastic(law.stiffness), plies):
        found = bent(Material(section=section, thickness=h, shear=shear))
        assert np.abs(found - expected).max() < 1e-8 * np.abs(expected).max()


def test_an_unsymmetric_lay_up_curls_when_it_is_stretched():
    """Coupling of stretch and curvature, B of the classical lamination theory: K = -B E / D for nu = 0."""
    stiff, soft, h = StVenantKirchhoff.isotropic(4e6, 0.0), StVenantKirchhoff.isotropic(1e6, 0.0), 1e-3
    plies = LayUp([Ply(stiff, h), Ply(soft, h)])
    domain = meshing.read(meshing.MESHES / "strip.geo", MPI.COMM_SELF, length=LENGTH, width=WIDTH, nx=8, ny=1)
    cloth = sheet.Sheet(domain, {"": Material(section=plies, shear=(5e6, 5e6))})
    end = fem.Constant(domain.mesh, 0.0)
    bcs = supports.hinge(domain, cloth.space, "fixed_end") + supports.lead(domain, cloth.space, "pulled_end", 0, end)
    bcs += supports.lead(domain, cloth.space, "sheet", 1, 0.0) + supports.lead(
        domain, cloth.space, "pulled_end", 2, 0.0
    )
    middle = fem.form(cloth.u[2] * cloth.dx)
    solver = cloth.equilibrium(bcs)
    strain = 1e-7
    end.value = strain * LENGTH
    solver.solve()
    A, B, D = (plies.stiffness[i, j] for i, j in ((0, 0), (0, 3), (3, 3)))
    held = supports.unknowns(domain, cloth.space, "pulled_end", 0)
    assert abs(B * B / D) > 0.1 * A
    assert solver.reaction(held) == pytest.approx((A - B * B / D) * strain * WIDTH, rel=1e-3)
    # an arc of the curvature K over its chord: the mean of K x (L - x)/2
    curvature = -B / D * strain
    mean = fem.assemble_scalar(middle) / (LENGTH * WIDTH)
    assert abs(mean) == pytest.approx(abs(curvature) * LENGTH**2 / 12, rel=0.02)


@pytest.mark.parallel
def test_cells_without_a_material_or_with_two_are_named(tmp_path):
    with pytest.raises(InputError, match=r"In cell \d+ at .* there is no material: it is in none of left"):
        sheet.Sheet(meshing.read(meshing.MESHES / "panels.geo", COMM), {"left": elastic()})

    path = COMM.bcast(tmp_path) / "two.inp"
    if COMM.rank == 0:
        nodes = "1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n5, 2, 0\n6, 2, 1\n"
        cells = "*ELEMENT, TYPE=S4, ELSET=one\n1, 1, 2, 3, 4\n*ELEMENT, TYPE=S4\n2, 2, 5, 6, 3\n"
        path.write_text(f"*NODE\n{nodes}{cells}*ELSET, ELSET=both\none, 2\n")
    COMM.barrier()
    with pytest.raises(InputError, match=r"In cell 0 at .* there are two materials, of 'both'"):
        sheet.Sheet(meshing.read(path, COMM), {"one": elastic(), "both": elastic()})


@pytest.mark.parametrize(
    ("material", "said"),
    [(lambda: elastic(thickness=-1.0), "thickness of -1.0"), (lambda: elastic(shear=None), "two transverse shear"),
     (lambda: Material(thickness=1e-3, shear=(1e5, 1e5)), "a law or a section"),
     (lambda: elastic(areal_mass=0.0), "areal mass of 0.0"),
     (lambda: Material(section=np.eye(3), thickness=1e-3, shear=(1e5, 1e5)), "six strains")],
)  # fmt: skip
def test_faults_name_their_material(material, said):
    with pytest.raises(InputError, match=said) as error:
        panels(elastic(), material(), MPI.COMM_SELF)
    assert "'right'" in str(error.value) or said == "six strains"


def test_a_mass_that_is_not_known_is_asked_for():
    with pytest.raises(InputError, match="'right' has no areal mass"):
        _ = panels(elastic(), elastic(areal_mass=None), MPI.COMM_SELF).areal_mass
    domain = meshing.read(meshing.MESHES / "strip.geo", MPI.COMM_SELF, nx=1, ny=1)
    with pytest.raises(InputError, match="The sheet has no areal mass"):
        _ = sheet.Sheet(domain, SOFT, 1e-3, kinematics="membrane").areal_mass


TWO = """
[mesh]
file = "{mesh}"
numbers = {{ nx = 2, mx = 2, ny = 2 }}

[sheet]
kinematics = "shell"

[[sheet.material]]
at = "left"
fabric = "blend"
warp = [0, 1, 0]
layers = 3

[[sheet.material]]
at = "right"
{right}

[[support]]
at = "fixed_end"
kind = "clamp"

[[load]]
kind = "gravity"
acceleration_m_per_s2 = [0, 0, -9.81]

[dynamics]
end_s = 0.01
step_ms = 5.0
"""
FABRIC = 'fabric = "muslin"'
PLIES = '[[sheet.material.ply]]\nfabric = "muslin"\n[[sheet.material.ply]]\nfabric = "blend"\nangle_deg = 45'


def scene(tmp_path, right):
    path = tmp_path / "two.toml"
    path.write_text(TWO.format(mesh=meshing.MESHES / "panels.geo", right=right))
    return reading.read(path)


@pytest.mark.filterwarnings("ignore:.* is assumed")
@pytest.mark.parametrize("right", [FABRIC, PLIES], ids=["fabric", "plies"])
def test_a_scene_of_two_materials(tmp_path, right):
    """Each with its own law, thickness and mass; the weight is theirs, and a checkpoint knows both."""
    told = scene(tmp_path, right)
    built = building.build(told, MPI.COMM_SELF)
    muslin, blend = fabrics.load("muslin"), fabrics.load("blend")
    masses = [blend.areal_mass, muslin.areal_mass + (blend.areal_mass if right is PLIES else 0.0)]
    weight = fem.assemble_vector(fem.form(built.loads)).array
    down = supports.unknowns(built.cloth.domain, built.cloth.space, "left", 2)
    down = np.union1d(down, supports.unknowns(built.cloth.domain, built.cloth.space, "right", 2))
    assert weight[down].sum() == pytest.approx(-9.81 * 0.1 * 0.1 * sum(masses))
    warp = built.cloth.yarns()[:, 0]
    left = built.cloth.domain.entities("left", 2)[1]
    assert np.allclose(warp[left], [0, 1, 0]) and np.allclose(np.delete(warp, left, axis=0), [1, 0, 0])
    known = marks.marks(built)
    assert "material 'left'.law" in known and "group 'right'" in known
    assert any(name.startswith("fabric of right") for name in known)
    (tmp_path / "out").mkdir()
    running.run(told, tmp_path / "out", progress=False)
    assert (tmp_path / "out" / "history.csv").read_text().count("\n") == 3


def test_the_material_that_the_keys_show_is_one(tmp_path):
    """It stands there as a comment, since a scene has either this or a fabric of the whole sheet."""
    text = reading.__doc__
    shown = text[text.index("    # [[sheet.material]]") : text.index("    [[support]]")]
    plies = re.sub("^    # ", "", shown, flags=re.M).split("\n", 2)[2]  # after its first line, and `at`
    (left, right) = scene(tmp_path, plies).materials
    assert right.plies == (sheet_reading.Ply("muslin", np.pi / 4),) and right.layers == 2 and not left.plies


@pytest.mark.parametrize(
    ("right", "said"),
    [("fabric = \"muslin\"\nlayer = 3", "layer = 3 is not a known"),
     (PLIES.replace("angle_deg", "angle"), "angle = 45 is not a known key"), ("", r"material\[2\].fabric is missing"),
     ('fabric = "muslin"\n[[sheet.material]]\nat = "left"\nfabric = "duck"', "two materials at one group")],
)  # fmt: skip
def test_faults_of_a_scene_of_two_materials(tmp_path, right, said):
    with pytest.raises(InputError, match=said):
        scene(tmp_path, right)
