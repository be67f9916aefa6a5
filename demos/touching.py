"""What the demos of contact share: an elastic cloth, and what is told of a run."""

import numpy as np

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.svk import StVenantKirchhoff

THICKNESS, MASS, G = 0.4e-3, 0.224, 9.81
E, NU = 8e6, 0.0


def elastic(domain, warp=(1.0, 0.0, 0.0), element="mitc4", thickness=THICKNESS):
    """A sheet of one elastic material, as soft as cloth."""
    law, shear = StVenantKirchhoff.isotropic(E, NU), E / 2 / (1 + NU)
    return sheet.Sheet(domain, law, thickness, (shear, shear), warp=warp, element=element)


def wave(domain, inner, outer, height, seed, count=8):
    """Raise a flat sheet about the origin by waves around it, of random height (m) and phase, from a radius on."""
    x, rng = domain.mesh.geometry.x, np.random.default_rng(seed)
    out = np.maximum(np.hypot(x[:, 0], x[:, 1]) - inner, 0.0) / (outer - inner)
    angle = np.arctan2(x[:, 1], x[:, 0])
    sizes, phases = rng.normal(size=count), rng.uniform(0, 2 * np.pi, count)
    waves = sum(a * np.cos((k + 1) * angle + p) for k, (a, p) in enumerate(zip(sizes, phases, strict=True)))
    x[:, 2] += height * out**2 * waves / np.sqrt(count / 2)


def crosses(table):
    """Whether triangles crossed in any row of a table, if it tells."""
    return bool("crossed" in table.rows[0] and table.column("crossed").any())


def clear(table):
    """Whether every gap stayed above zero and nothing crossed, as a table tells."""
    return bool(table.column("least_gap_m").min() > 0.0 and not crosses(table))


def passed(table):
    """The same, said in a line."""
    gap = table.column("least_gap_m").min()
    told = f"least gap {1e3 * gap:.3f} mm" if np.isfinite(gap) else "nothing touches"
    command.say(told + (", and triangles cross" if crosses(table) else ""))
    return clear(table)


def obj(path, points, faces):
    """Write points (n, 3) and faces, rows of their numbers, as an .obj file."""
    lines = [f"v {a:.12g} {b:.12g} {c:.12g}" for a, b, c in points]
    path.write_text("\n".join(lines + [" ".join(map(str, ["f", *(1 + np.array(face))])) for face in faces]) + "\n")
