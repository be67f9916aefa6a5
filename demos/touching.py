"""What the demos of contact share: an elastic cloth, and what is told of a run."""

import bent
import numpy as np

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import pictures
from fabric_fenicsx.output.solids import drawn

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


def add_arguments(parser, step, damping):
    """What a motion that settles can be asked; step in ms, damping in 1/s."""
    parser.add_argument("--step", type=command.above_zero, default=step, help="ms")
    parser.add_argument("--damping", type=command.number, default=damping, help="a of Rayleigh's a M, 1/s")
    parser.add_argument("--rho", type=command.number, default=0.5, help="left of the fastest oscillation after a step")
    parser.add_argument("--rtol", type=command.above_zero, default=1e-3, help="of Newton's method")
    parser.add_argument("--animation", action="store_true", help="a gif of 50 frames")


def marks(args):
    """What a checkpoint must have been made with."""
    return {k: v for k, v in vars(args).items() if k not in ("out", "end", "resume", "animation")}


def draw(played, path, label="height (mm)", view=pictures.VIEW):
    """The sheet at the end, coloured by how far it has risen, and what it touches."""
    cloth = played.sheet
    pictures.picture(
        path, cloth.displacement(), bent.height(cloth), label, played.name, view=view, bodies=drawn(played.touch)
    )


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
