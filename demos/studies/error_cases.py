"""The problems of `error_vs_runtime.py`: each is asked for a few numbers, with many settings.

A case builds a scene from settings, a dict, and goes through it; both parts are timed apart. `reference` is finer than
`base` in cells and steps, `coarser` is one step back from it: their difference tells the reference's error.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import drape
import moving
import numpy as np
import poke
import shell_cases
import shell_model
import studies
import ufl
from mpi4py import MPI
from dolfinx import fem

from fabric_fenicsx import fabrics, sheet, specimen
from fabric_fenicsx.contact import bodies
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.laws import driver, named
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.solvers import marching, statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

EXTRAPOLATED = {"way": "extrapolated"}  # from as many cells, half and a quarter of them
STRIP = meshing.MESHES / "strip.geo"
BLEND = fabrics.load("blend")


@dataclass(frozen=True)
class Case:
    """A problem: what is asked for, its settings, the reference's and those one step coarser."""

    name: str
    title: str
    asked: str
    base: dict
    settings: list
    reference: dict
    coarser: dict


def label(setting):
    """Settings in words."""
    before = {name: f"{name} " for name in ("degree", "rtol", "reach", "stiffness", "accuracy")}
    after = {name: f" {name}" for name in ("cells", "steps", "ms", "layers", "ranks")} | {"reach": " mm"}
    after |= {"stiffness": " Pa"}
    usual = (("ranks", 1), ("solver", "direct"), ("rtol", None))
    shown = {name: value for name, value in setting.items() if (name, value) not in usual}
    return ", ".join(f"{before.get(name, '')}{value}{after.get(name, '')}" for name, value in shown.items())


def vary(base, *changes):
    """Settings that each change something of the base, without doubles."""
    found = []
    for change in ({}, *changes):
        if base | change not in found:
            found.append(base | change)
    return found


def each(name, values):
    """One change a value."""
    return [{name: value} for value in values]


# -- (a) a point: pulled at 30 degrees to the warp, and half unloaded --------------------------------------------------


def point(name, law):
    def case(quick):
        base = {"law": law, "steps": 40}
        counts = (5, 20) if quick else (2, 5, 10, 20, 40, 80, 160, 320)
        laws = named.THESIS if law in named.THESIS else (law,)
        settings = vary(base, *({"law": other, "steps": n} for other in laws for n in counts))
        finest, asked = 640 if quick else 2560, "stress at both ends"
        return Case(name, f"Material point, uniaxial at 30° to the warp, half unloaded, {law} law", asked, base,
                    settings, base | {"steps": finest}, base | {"steps": finest // 2})  # fmt: skip

    return case


def build_point(s, comm):
    return named.law(s["law"], BLEND)


def go_point(s, law):
    n, top = s["steps"], 0.12
    path = np.concatenate([np.linspace(0, top, n + 1)[1:], np.linspace(top, 0.9 * top, n + 1)[1:]])
    result = driver.uniaxial(law, path, angle=np.radians(30.0))
    return np.array([result.stress[n - 1, 0], result.stress[-1, 0]])


# -- (b) the tensile strip in bias between clamps, pulled and half unloaded --------------------------------------------


def strip(name, law):
    def case(quick):
        base = {"law": law, "cells": 3, "degree": 1, "steps": 10, "rtol": 1e-6}
        sizes = (1, 3) if quick else (1, 2, 3, 6, 12, 24)
        changes = [{"cells": n, "degree": d} for n in sizes for d in (1, 2) if n * d <= 24]
        if not quick:
            changes += each("steps", (1, 2, 5, 20, 40))
            changes += each("rtol", (1e-1, 1e-2, 1e-4, 1e-8))
            changes += [{"cells": 1, "steps": 2}, {"cells": 6, "steps": 5, "rtol": 1e-2}, {"cells": 12, "steps": 5}]
            changes += [{"degree": 2, "steps": 2, "rtol": 1e-2, "cells": n} for n in (2, 3, 6, 12, 16)]
            changes += [{"degree": 2, "steps": 2, "rtol": 1e-4, "cells": n} | EXTRAPOLATED for n in (8, 12, 16, 24)]
        if not quick and law in named.THESIS:
            changes += [{"law": "printed", "steps": n} for n in (5, 10, 20, 40, 80)]
        fine, title = 8 if quick else 48, f"Tensile strip in bias between clamps, half unloaded, {law} law"
        finest = base | {"cells": fine, "degree": 2, "steps": 5, "rtol": 1e-8} | EXTRAPOLATED
        return Case(name, title, "force at both ends of the way", base, vary(base, *changes), finest,
                    finest | {"cells": fine // 2})  # fmt: skip

    return case


def build_strip(s, comm):
    n = s["cells"]
    domain = meshing.read(STRIP, comm, gdim=2, nx=3 * n, ny=n, length=BLEND.gauge_length, width=BLEND.width)
    law = named.law(s["law"], BLEND)
    scene = specimen.strip(domain, BLEND, law, np.radians(45.0), ends="clamped", degree=s["degree"])
    scene.solver.rtol = s["rtol"]
    return scene


def go_strip(s, scene):
    n, top = s["steps"], 8e-3
    path = np.concatenate([np.linspace(0, top, n + 1)[1:], np.linspace(top, 0.95 * top, n + 1)[1:]])
    forces = [scene.solver.reaction(scene.ends[1]) for _ in statics.march(scene.solver, scene.pull, path)]
    return np.array([forces[n - 1], forces[-1]])


# -- (c) end shear -----------------------------------------------------------------------------------------------------


def shear(slender):
    def case(quick):
        base = {"element": "regge", "cells": 16, "steps": 5}
        sizes = (4, 8) if quick else (2, 4, 8, 16, 32)
        elements = ("regge", "mitc4") if quick else ("regge", "mitc4", "p2cr1", "q1")
        changes = [{"element": e, "cells": n} for e in elements for n in sizes]
        if not quick:
            changes += each("steps", (1, 2, 10, 20)) + [{"cells": 4, "steps": 1}, {"cells": 8, "steps": 1}]
            changes += [{"element": "mitc4", "cells": n, "steps": 1} for n in (4, 8, 16)]
        fine = 32 if quick else 128
        return Case(f"end_shear_{slender:g}", f"End shear, h/L = {slender:g}", "both displacements of the tip", base,
                    vary(base, *changes), base | {"cells": fine}, base | {"cells": fine // 2})  # fmt: skip

    return case


def build_shear(slender):
    def build(s, comm):
        case = shell_cases.end_shear(shell_model.Settings(s["element"], s["cells"], 10 * slender), comm)
        return case, case.shell.solver()

    return build


def go_shear(s, scene):
    case, solver = scene

    def set_load(value):
        case.shell.load.value = value

    loads = np.linspace(0, 1, s["steps"] + 1)[1:]
    for _ in marching.march(solver, set_load, loads):
        pass
    return np.array([case.shell.mean("pulled_end", axis) for axis in "xz"])


# -- (d), (e) sheets in motion ----------------------------------------------------------------------------------------


def motion(name, title, end):
    """With bending as the law has it in layers, or, of the name `..._bending`, with one of its own."""

    def case(quick):
        own = name.endswith("_bending")
        base = {"element": "mitc4", "cells": 30, "ms": 5.0, "rtol": None, "method": "implicit", "ranks": 1,
                "solver": "direct", **({} if own else {"layers": 3})}  # fmt: skip
        asked = "work done on the fabric, at thirds of the time"
        if quick:
            base |= {"cells": 10, "ms": 10.0}
            fine = base | {"ms": 2.5}
            return Case(name, title, asked, base, vary(base, {"ms": 5.0}), fine, base | {"ms": 5.0})
        changes = each("cells", (10, 20, 40)) + each("ms", (2.5, 10.0)) + each("rtol", (1e-2, 1e-4))
        # a step is cut where its energies do not balance
        changes += each("accuracy", (1e-4, 8e-3)) + [{"accuracy": 8e-3, "ms": ms} for ms in (10.0, 20.0)]
        if own:
            changes += [{"cells": n, "ms": 10.0, "rtol": 1e-2} for n in (10, 20, 30)] + each("method", ("explicit",))
            changes += [{"cells": 40, "ms": 2.5}]
        else:
            changes += each("layers", (2, 5)) + each("solver", ("iterative",))
            changes += each("element", ("regge", "q1")) + each("ranks", (2,)) + each("method", ("explicit",))
            changes += [{"cells": 10, "ms": ms} for ms in (2.5, 10.0, 20.0)] + [{"cells": 10, "ms": 10.0, "rtol": 1e-2}]
            changes += [{"element": "regge", "cells": 10}] + [{"cells": n, "method": "explicit"} for n in (10, 20)]
            changes += [{"cells": n, "ms": 10.0, "rtol": 1e-2} for n in (20, 30, 40)]
        fine = base | {"cells": 80, "ms": 1.25, "rtol": 1e-4}
        return Case(name, title, asked, base, vary(base, *changes), fine, fine | {"cells": 40, "ms": 2.5})

    return case


def build_motion(room, end, bending="layers"):
    def build(s, comm):
        parser = argparse.ArgumentParser()
        moving.add_arguments(parser, end=end, rho=0.8)
        args = parser.parse_args([])
        args.cells, args.step, args.rtol, args.bending = s["cells"], s["ms"], s["rtol"], bending
        args.layers = s.get("layers", 3)
        args.element, args.method, args.solver = s["element"], s["method"], s["solver"]
        args.patch, args.jerk = 0.2, False
        scene = studies.scene_of(room, args, comm)
        if "accuracy" in s:
            scene.run.accuracy = s["accuracy"]
        return scene

    return build


def go_motion(end):
    def go(s, scene):
        ledger, every = scene.ledger, end / 3 if s["method"] == "explicit" else s["ms"] * 1e-3
        work = [ledger.totals["recoverable"] + ledger.totals["by_law"] for _ in scene.run.march(end, every)]
        third = len(work) // 3
        return np.array([work[third - 1], work[2 * third - 1], work[-1]])

    return go


# -- (f) a strip lifted off a plane ------------------------------------------------------------------------------------


def lift(quick):
    base = {"cells": 80, "reach": 0.4, "stiffness": 2.2}
    changes = each("reach", (0.2, 1.6)) + each("cells", (40,))
    if not quick:
        changes += each("reach", (0.1, 0.8)) + each("stiffness", (0.22, 22.0, 220.0)) + each("cells", (20, 160))
        changes += [{"cells": cells, "reach": reach} for cells in (80, 160) for reach in (0.025, 0.05)]
    finest = {"cells": 320, "reach": 0.0125, "stiffness": 2.2}
    return Case("lift", "Strip lifted off a plane", "force at 5 and 10 mm", base, vary(base, *changes), finest,
                finest | {"cells": 160, "reach": 0.025})  # fmt: skip


def build_lift(s, comm):
    E, length, width, h = 4e9, 1.0, 0.05, 4e-4
    domain = meshing.read(STRIP, comm, length=length, width=width, nx=s["cells"], ny=1)
    strip = sheet.Sheet(domain, StVenantKirchhoff.isotropic(E, 0.0), h, (E / 2, E / 2))
    plane = bodies.Plane(point=(0, 0, -h - 0.5e-3 * s["reach"]))
    touch = Contact(strip, [plane], itself=False, reach=1e-3 * s["reach"], stiffness=s["stiffness"])
    weight, height = strip.weight(0.224, ufl.as_vector((0, 0, -9.81))), fem.Constant(domain.mesh, 0.0)
    held = supports.lead(domain, strip.space, "sheet", 1, 0.0) + supports.lead(domain, strip.space, "fixed_end", 0, 0.0)
    held += supports.lead(domain, strip.space, "pulled_end", 2, height)
    solver = strip.equilibrium(held, [weight, *touch.terms])
    return solver, height, supports.unknowns(domain, strip.space, "pulled_end", 2)


def go_lift(s, scene):
    solver, height, end = scene

    def set_load(value):
        height.value = value

    return np.array([solver.reaction(end) for _ in marching.march(solver, set_load, [1e-3, 5e-3, 1e-2])][1:])


DRAPE, POKE = 0.12, 0.06  # s; multiples of three of the longest step
BENT = "Drape held over patches, bending of its own"
CASES = {
    "point": (point("point", "continuous"), build_point, go_point),
    "point_potential": (point("point_potential", "potential"), build_point, go_point),
    "strip": (strip("strip", "continuous"), build_strip, go_strip),
    "strip_potential": (strip("strip_potential", "potential"), build_strip, go_strip),
    "end_shear_0.01": (shear(1e-2), build_shear(1e-2), go_shear),
    "end_shear_0.0001": (shear(1e-4), build_shear(1e-4), go_shear),
    "lift": (lift, build_lift, go_lift),
    "drape": (motion("drape", "Drape held over patches", DRAPE), build_motion(drape, DRAPE), go_motion(DRAPE)),
    "drape_bending": (motion("drape_bending", BENT, DRAPE), build_motion(drape, DRAPE, "own"), go_motion(DRAPE)),
    "poke": (motion("poke", "Poke, on its way out", POKE), build_motion(poke, POKE), go_motion(POKE)),
}
"""Name -> settings, what builds a scene and what goes through it."""


def build(name, setting, comm=MPI.COMM_SELF):
    """The scene of a case."""
    return CASES[name][1](setting, comm)


def go(name, setting, scene):
    """The numbers that a scene is asked for."""
    return CASES[name][2](setting, scene)
