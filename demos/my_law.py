"""My own law: yarns that soften for good, as a class that a sheet takes unchanged.

A law is a class with three members (`laws.Law`): the state of a point that was never strained, whether the tangent
is symmetric, and `respond`, from strains (n, 3) = (E11, E22, 2 E12) and the committed state to stresses, tangents
and the new state. It works on all points at once and forgets nothing itself: what it must remember is state.
`laws.driver.check` asks it for everything that it promised, and names the first promise broken.

Here a yarn keeps the largest strain m that it has had, and S = k E exp(-m/e): while it loads, m = E; on the way back
it is a straight line to the origin, softer than before. Shear is linear.

The checked number: a strip, a shell with three layers, is pulled to 8 % and back to 4 %; its force is that of the
formula, and the work that is lost round the cycle is k (e^2 (1 - (1 + m/e) exp(-m/e)) - m^2 exp(-m/e)/2) a volume.
"""

from mpi4py import MPI  # noqa: F401, isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import numpy as np

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws import driver
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

STRIP = meshing.MESHES / "strip.geo"
LENGTH, WIDTH, THICKNESS = 0.1, 0.03, 0.5e-3  # m


class Softening:
    """S_a = k_a E_a exp(-m_a/e) for warp and weft, m_a the largest strain so far; S12 = G 2 E12. Pa."""

    symmetric = True

    def __init__(self, k=(50e6, 30e6), e=0.2, G=0.5e6):
        self.k, self.e, self.G = np.array(k), e, G
        self.initial_state = np.zeros(2)  # m of warp and of weft

    def respond(self, strain, state, out=None):
        """See `laws.Law.respond`."""
        n = len(strain)
        stress, tangent, new = out or (np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 2)))
        E = strain[:, :2]
        new[:] = np.maximum(state, E)
        soft = self.k * np.exp(-new / self.e)
        loading = E > state
        stress[:, :2], stress[:, 2] = soft * E, self.G * strain[:, 2]
        stress[~np.isfinite(strain).all(axis=1)] = np.nan  # the one way to say that a point has failed
        tangent[:] = 0.0
        tangent[:, [0, 1], [0, 1]] = np.where(loading, soft * (1 - E / self.e), soft)
        tangent[:, 2, 2] = self.G
        return stress, tangent, new


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/my_law"))
    out = results.folder(command.parse(parser).out)
    law = Softening()
    command.say("driver:", driver.check(law))

    domain = meshing.read(STRIP, length=LENGTH, width=WIDTH)
    strip = sheet.Sheet(domain, law, THICKNESS, shear=(law.G, law.G))
    held, move = supports.grip(domain, strip.space, "pulled_end")
    solver = strip.equilibrium(supports.clamp(domain, strip.space, "fixed_end") + held)
    end = supports.unknowns(domain, strip.space, "pulled_end", 0)
    pulls = LENGTH * np.concatenate([np.linspace(0, 0.08, 41)[1:], np.linspace(0.08, 0.0, 41)[1:]])
    with results.Table(out / "history.csv") as table:
        for step in statics.march(solver, lambda pull: move((pull, 0, 0)), pulls, progress="strip"):
            table.row(displacement_m=step.load, force_N=solver.reaction(end))
            if step.number == 40:
                u, strain, yarns = strip.displacement(), strip.cell_strain()[:, 0], strip.yarns()
                pictures.picture(out / "deformed.png", u, strain, "warp strain E11 (-)", "at 8 %", yarns=yarns)

    stretch = table.column("displacement_m") / LENGTH
    E = stretch + stretch**2 / 2
    m = np.maximum.accumulate(E)
    area, force = WIDTH * THICKNESS, table.column("force_N")
    expected = area * (1 + stretch) * law.k[0] * E * np.exp(-m / law.e)
    miss = np.abs(force - expected).max() / force.max()
    soft, x = np.exp(-m[-1] / law.e), m[-1] / law.e
    lost = law.k[0] * (law.e**2 * (1 - (1 + x) * soft) - m[-1] ** 2 * soft / 2) * area * LENGTH
    work = np.trapezoid(np.append(0, force), np.append(0, table.column("displacement_m")))
    command.say(f"largest force {force.max():.4f} N, miss {100 * miss:.2g} %")
    command.say(f"work lost {work:.6f} J by the force, {lost:.6f} J by the formula")
    good = miss <= 1e-5 and abs(work / lost - 1) <= 5e-3
    command.say(f"check: force to 0.001 %, lost work to 0.5 %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
