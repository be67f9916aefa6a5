"""Another cloth than that of the package: yarns that lose their crimp for good, by associated plasticity.

Decrimping g1, g2 >= 0 of the two families, which only grows:

    psi = phi(E11 - g1 + n21 g2) + phi(E22 - g2 + n12 g1) + int Y1 dg1 + int Y2 dg2,

phi the energy of the unloading curve (modulus U, and c0 without tension), Y the stress at which a yarn that was loaded
to the virgin strain x goes on to yield: Y = f(x) at g = x - f(x)/U. Under uniaxial stress it follows f; contraction is
flow. Shear is elastic. For loading from rest all of it is one convex minimum in (E, g).
"""

import numpy as np
from scipy.optimize import minimize

from fabric_fenicsx.laws.stability import rotate_strain


class Decrimping:
    """Strips off the yarns, and biaxial specimens, of a fabric with these curves."""

    def __init__(self, fabric):
        self.fabric, self.nu = fabric, fabric.poisson["measured"]
        self.curves = fabric.warp, fabric.weft
        self.tables = []
        for curve in self.curves:
            x = np.linspace(0, 1.5 * curve.limit, 4001)
            Y = curve.stress(x)
            g = x - Y / curve.unloading
            work = np.concatenate([[0.0], np.cumsum((Y[1:] + Y[:-1]) / 2 * np.diff(g))])
            self.tables.append((g, Y, work))

    def energy(self, E, g):
        """psi (J/m3) and its derivatives by E (3,) and g (2,)."""
        n12, n21 = self.nu
        taut = np.array([E[0] - g[0] + n21 * g[1], E[1] - g[1] + n12 * g[0]])
        total, tension, yields = 0.0, np.empty(2), np.empty(2)
        for i, curve in enumerate(self.curves):
            stiff = curve.unloading if taut[i] > 0 else curve.modulus[0]
            tension[i] = stiff * taut[i]
            at, Y, work = self.tables[i]
            beyond = max(g[i] - at[-1], 0.0)
            yields[i] = np.interp(g[i], at, Y)
            total += stiff * taut[i] ** 2 / 2 + np.interp(g[i], at, work) + beyond * Y[-1]
        shear = self.fabric.shear
        gamma = np.linspace(0, abs(E[2]), 17)
        total += np.trapezoid(shear.stress(gamma), gamma)
        S = np.array([*tension, np.sign(E[2]) * shear.stress(abs(E[2]))])
        by_g = yields + np.array([n12 * tension[1] - tension[0], n21 * tension[0] - tension[1]])
        return total, S, by_g

    def strip(self, axial, degrees):
        """Axial stress (Pa) of a strip that pulls evenly, at axial strains (n,)."""
        out, guess, scale = [], np.zeros(4), np.array([1.0, 1.0, 1.0, 1.0])
        for e in axial:

            def value(z, e=e):
                E = rotate_strain(np.array([[e, z[0], z[1]]]), -np.radians(degrees))[0]
                W, S, by_g = self.energy(E, z[2:])
                T = rotate_strain(np.eye(3), -np.radians(degrees))  # row: what a strain of the strip is along the yarns
                return W / 1e6, np.array([S @ T[1], S @ T[2], *by_g]) / 1e6

            bounds = [(None, None), (None, None), (0, None), (0, None)]
            found = minimize(value, guess * scale, jac=True, method="L-BFGS-B", bounds=bounds,
                             options={"ftol": 1e-14, "gtol": 1e-9, "maxiter": 2000})  # fmt: skip
            guess = found.x
            E = rotate_strain(np.array([[e, *guess[:2]]]), -np.radians(degrees))[0]
            S = self.energy(E, guess[2:])[1]
            out.append(S @ rotate_strain(np.eye(3), -np.radians(degrees))[0])
        return np.array(out)

    def biaxial(self, strain):
        """S11, S22 (n, 2) at strains (n, 2)."""
        out, guess = [], np.zeros(2)
        for E1, E2 in strain:
            E = np.array([E1, E2, 0.0])

            def value(g, E=E):
                W, _, by_g = self.energy(E, g)
                return W / 1e6, by_g / 1e6

            found = minimize(value, guess, jac=True, method="L-BFGS-B", bounds=[(0, None)] * 2,
                             options={"ftol": 1e-14, "gtol": 1e-9, "maxiter": 2000})  # fmt: skip
            guess = found.x
            out.append(self.energy(E, guess)[1][:2])
        return np.array(out)
