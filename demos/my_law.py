"""My own law: yarns that soften for good, as a class that a sheet takes unchanged.

A law is a class with three members (`laws.Law`): the state of a point that was never strained, whether the tangent
is symmetric, and `respond`, from strains (n, 3) = (E11, E22, 2 E12) and the committed state to stresses, tangents
and the new state. It works on all points at once and forgets nothing itself: what it must remember is state.

The checked number: a strip, a shell with three layers, is pulled to 8 % and back to 4 %; its force, and the work that
is lost round the cycle, are those of the formulas.
"""

# %% [markdown]
# ## The law
# A yarn keeps the largest strain $m$ that it has had, and
#
# $$ S = k\,E\,e^{-m/e} . $$
#
# While it loads, $m = E$; on the way back it is a straight line to the origin, softer than before. Shear is linear.

# %%
from mpi4py import MPI  # noqa: F401, isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import numpy as np

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws import driver
from fabric_fenicsx.output import pictures, results
from fabric_fenicsx.solvers import statics
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

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


# %% [markdown]
# `laws.driver.check` asks a law for everything that it promised, and names the first promise broken: shapes, purity,
# the tangent against differences, no state left behind.

# %%
args = command.script(__doc__, "out/my_law")
law = Softening()
command.say("driver:", driver.check(law))

# %% [markdown]
# ## A strip of it
# A shell of one material on a mesh; one end is clamped, the other gripped by a rigid clamp that is led along x.

# %%
domain = meshing.read(meshing.MESHES / "strip.geo", length=LENGTH, width=WIDTH)
strip = sheet.Sheet(domain, law, THICKNESS, shear=(law.G, law.G))
held, move = supports.grip(domain, strip.space, "pulled_end")
solver = strip.equilibrium(supports.clamp(domain, strip.space, "fixed_end") + held)
end = supports.unknowns(domain, strip.space, "pulled_end", 0)
pulls = LENGTH * np.concatenate([np.linspace(0, 0.08, 41)[1:], np.linspace(0.08, 0.0, 41)[1:]])
with results.Table(args.out / "history.csv") as table:
    for step in statics.march(solver, lambda pull: move((pull, 0, 0)), pulls, progress="strip"):
        table.row(displacement_m=step.load, force_N=solver.reaction(end))
        if step.number == 40:
            u, strain, yarns = strip.displacement(), strip.cell_strain()[:, 0], strip.yarns()
            pictures.picture(args.out / "deformed.png", u, strain, "warp strain E11 (-)", "at 8 %", yarns=yarns)

# %% [markdown]
# ![The strip at 8 %](deformed.png)
#
# ## The check
# With the stretch $\lambda$ the force is $A\,\lambda\,k E\,e^{-m/e}$, and the work lost in a cycle, per volume,
#
# $$ k\left( e^2\left(1 - (1 + m/e)\,e^{-m/e}\right) - \tfrac12 m^2 e^{-m/e} \right) . $$

# %%
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
command.check(miss <= 1e-5 and abs(work / lost - 1) <= 5e-3, "force to 0.001 %, lost work to 0.5 %", args.out)
