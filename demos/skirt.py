"""A half-circle skirt of two panels, sewn at its sides, is dressed onto hips, falls, and swings while they walk.

The pattern is a part of a ring (--circle: how much of it), a cone about the elliptic waist unrolled, to which the upper
edge of the skirt is fixed. There the skirt starts, and is dressed (`garments.dressing`): its stress-free state goes to
the flat panels, from which only the chords of cells differ. Then its weight comes over 0.8 s, it settles with damping,
and the thighs swing as in walking on the spot. The cloth, with the whole law of the fabric and its measured bending,
touches hips and thighs with friction; with --self itself, too.

    python demos/skirt.py --cell 80 --animation
    python demos/skirt.py --cell 36 --step 5 --skin 20 --self    # smooth folds that touch; 5 minutes

The checked numbers: nothing passes through anything, the garment is at rest when it has been dressed, and at most 1 %
of the largest external work is not accounted for. Folds are told of the hem: where its distance from the axis has its
maxima. Which ones come is not unique.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import time
from pathlib import Path

import bent
import moving
import numpy as np
import touching
from dolfinx import fem
from scipy.optimize import brentq
from scipy.signal import find_peaks

from fabric_fenicsx import fabrics
from fabric_fenicsx.app import command
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments import dressing
from fabric_fenicsx.garments.hips import hips
from fabric_fenicsx.garments.panels import Edge, Panel
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.laws import named
from fabric_fenicsx.material import Material
from fabric_fenicsx.output import results
from fabric_fenicsx.terms import supports

LOWERED = 0.8  # s
DRESSED = 0.05  # s, a step of it
EASE = 6e-3  # m, between the skin of the waist and the skirt
BELOW = 0.02  # m, of the waist's height
WAVES = 10
FOLD = 0.01  # m, by which a fold sticks out at least


class Cone:
    """A cone about an ellipse, which can be unrolled: of so many circles where it is flat.

    Args:
        half: axes of the ellipse, m; circle: angle of the pattern, of a whole one; length: of the skirt, m; level:
            height of the waist, m.
        waves: height (m) and seed of the waves that it starts with.
    """

    def __init__(self, half, circle, length, level, waves):
        self.turn = np.linspace(0.0, 2 * np.pi, 4001)
        self.waist = np.column_stack([half[0] * np.cos(self.turn), half[1] * np.sin(self.turn)])
        self.length, self.level = length, level

        def above(apex):
            return self._unrolled(apex)[-1] - 2 * np.pi * circle

        self.apex = brentq(above, 0.0, 1.0 / circle) if circle < 1.0 else 0.0
        self.angle, self.inner = self._unrolled(self.apex), np.hypot(np.hypot(*self.waist.T), self.apex)
        rng = np.random.default_rng(waves[1])
        self.waves = waves[0] * rng.normal(size=WAVES) / np.sqrt(WAVES / 2), rng.uniform(0, 2 * np.pi, WAVES)

    def _unrolled(self, apex):
        """Angles of the pattern about the apex, at so many m above the waist."""
        rays = np.column_stack([self.waist, np.full(len(self.waist), -apex)])
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        return np.concatenate([[0.0], np.cumsum(2 * np.arcsin(np.linalg.norm(np.diff(rays, axis=0), axis=1) / 2))])

    def panel(self, name, facing):
        """One half of the skirt, which faces -y or y; the warp goes down its middle."""
        middle = float(np.interp(facing * np.pi / 2 % (2 * np.pi), self.turn, self.angle))
        ends = middle + self.angle[-1] / 4 * np.array([-1.0, 1.0])
        angles = np.linspace(*ends, 121)
        inner = np.interp(angles, self.angle, self.inner, period=self.angle[-1])
        ways = np.column_stack([np.sin(angles - middle), -np.cos(angles - middle)])
        upper, lower = (inner[:, None] * ways)[::-1], (inner + self.length)[:, None] * ways

        def edge(points):
            return Edge(tuple(points[0]), [tuple(x) for x in points[1:-1]], "points")

        outline = {"hem": edge(lower), "left": Edge(tuple(lower[-1])), "waist": edge(upper),
                   "right": Edge(tuple(upper[-1]))}  # fmt: skip
        return Panel(name, outline, placed=lambda points: self.start(points, middle), regular=True)

    def start(self, points, middle):
        """Places in space."""
        away, angle = np.linalg.norm(points, axis=1), middle + np.arctan2(points[:, 0], -points[:, 1])
        turn = np.interp(angle, self.angle, self.turn, period=self.angle[-1])
        waist = np.column_stack([np.interp(turn, self.turn, x) for x in self.waist.T])
        rays = np.column_stack([waist, np.full(len(waist), -self.apex)])
        inner = np.linalg.norm(rays, axis=1)
        sizes, phases = self.waves
        wave = (sizes * np.sin(np.outer(turn, np.arange(1, WAVES + 1)) + phases)).sum(axis=1)
        far = np.linalg.norm(waist, axis=1)
        out = np.column_stack([self.apex * waist / far[:, None], far])
        across = (wave * ((away - inner) / self.length) ** 2 / inner)[:, None] * out
        return rays * (away / inner)[:, None] + across + [0.0, 0.0, self.level + self.apex]


def sewn(args, shape, comm=MPI.COMM_WORLD):
    """The skirt about the waist of hips."""
    half = np.array(shape.waist) + EASE
    cone = Cone(half, args.circle, args.length, shape.height - BELOW, (1e-3 * args.imperfection, args.seed))
    panels = [cone.panel("front", -1), cone.panel("back", 1)]
    seams = [Seam(("front", "left"), ("back", "right")), Seam(("front", "right"), ("back", "left"))]
    return sew(panels, seams, cell=1e-3 * args.cell, comm=comm)


def held(cloth):
    """The upper edge, which may turn."""
    return [bc for name in ("front.waist", "back.waist") for bc in supports.hinge(cloth.domain, cloth.space, name)]


def touches(args, cloth, body, friction):
    """Contact with the body, and with itself if that is asked for."""
    return Contact(
        cloth, [body], friction=friction, itself=args.self, reach=1e-3 * args.reach, stiffness=args.stiffness,
        creep=1e-4,
    )  # fmt: skip


def dressed(args, shape, body, out):
    """The skirt where it is without stress; the chords of its cells are a little too short where it starts."""
    clock, cloth = time.process_time(), sewn(args, shape).sheet(material(args))
    touch = touches(args, cloth, body, 0.0)
    dress = dressing.Dressing(cloth, touch.terms, held(cloth))
    steps = list(dress.march(DRESSED, progress="dressing"))
    cuts, iterations = sum(step.step_cuts for step in steps), sum(step.newton_iterations for step in steps)
    command.say(
        f"dressed in {len(steps)} steps of {iterations / len(steps):.1f} Newton iterations, {cuts} cuts, "
        f"{time.process_time() - clock:.1f} s of processor; kinetic energy {dress.stir:.1e} of the work"
    )
    dress.save(out / "worn.npz")
    return dressing.worn(out / "worn.npz", sewn(args, shape), material(args))


def material(args):
    """The whole law of the fabric, and its bending."""
    return Material.of(fabrics.load(args.fabric), law=args.law)


def hem(cloth):
    """Places of the nodes of the hem in its order (n, 3), m; the same on every rank."""
    domain, space, dofmap = cloth.domain, cloth.space, cloth.q.function_space.dofmap
    own, places, columns = dofmap.index_map.size_local * dofmap.index_map_bs, supports.places(space), []
    for k in range(3):
        dofs = np.unique(np.concatenate([supports.unknowns(domain, space, f"{p}.hem", k) for p in ("front", "back")]))
        dofs = dofs[dofs < own]
        rows = np.column_stack([places[dofs], cloth.q.x.array[dofs]])
        rows = np.concatenate(domain.mesh.comm.allgather(rows))
        rows = rows[np.argsort(np.arctan2(rows[:, 1], rows[:, 0]))]
        columns.append(rows[:, k] + rows[:, 3])
    return np.column_stack(columns)


class Hem:
    """What is told of the hem: `folds`, `radius` (mean and range), `height` and `clearance` of the skin, m."""

    def __init__(self, cloth, touch):
        self.cloth, self.touch = cloth, touch
        self.middle = hem(cloth)[:, :2].mean(axis=0)

    def radii(self):
        """Distances of the nodes from the axis of the body, m."""
        return np.linalg.norm(hem(self.cloth)[:, :2] - self.middle, axis=1)

    def folds(self):
        """Maxima of the distance around the hem."""
        r = self.radii()
        r = np.roll(r, -int(r.argmin()))
        return len(find_peaks(np.append(r, r[0]), prominence=FOLD)[0])

    def clearance(self):
        """Mean distance of the nodes from the skin, m."""
        import pyvista

        body = self.touch.bodies[0]
        skin = pyvista.PolyData.from_regular_faces(self.touch.places(body), body.faces)
        x = hem(self.cloth)
        return float(np.linalg.norm(x - skin.find_closest_cell(x, return_closest_point=True)[1], axis=1).mean())

    def probes(self):
        """Columns of the history."""
        return {
            "hem_height_m": lambda: float(hem(self.cloth)[:, 2].mean()), "clearance_m": self.clearance,
            "hem_inner_m": lambda: float(self.radii().min()), "hem_outer_m": lambda: float(self.radii().max()),
            "folds": self.folds, "crossed": self.touch.crossed,
        }  # fmt: skip


def scene(args, out):
    """The skirt about the waist, without weight, and what happens to it."""
    shape = hips(args.of, size=1e-3 * args.skin)
    body = shape.walk(args.strides, args.stride, flexion=args.flexion, extension=args.extension)
    cloth = dressed(args, shape, body, out)
    g = fem.Constant(cloth.domain.mesh, (0.0, 0.0, 0.0))
    lower, touch = bent.lowering(g, LOWERED), touches(args, cloth, body, args.friction)
    command.say(touch.describe())

    def set_load(t):
        lower(t)
        body.at(t - args.settle)

    run, ledger = cloth.newmark(
        cloth.areal_mass, held(cloth), [cloth.weight(cloth.areal_mass, g), *touch.terms], rho=args.rho,
        damping=args.damping, set_load=set_load, rtol=args.rtol, accuracy=2e-4,
    )  # fmt: skip
    made_with = touching.marks(args)
    name = f"{args.circle:g} circle of {args.fabric}"
    return moving.Scene(name, cloth, run, ledger, Hem(cloth, touch).probes(), made_with, touch)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--fabric", default="blend", help="name, or a TOML file")
    parser.add_argument("--law", choices=named.NAMES, default=named.DEFAULT, help="svk: elastic, of the first moduli")
    parser.add_argument("--of", choices=["man", "woman"], default="woman", help="whose hips")
    parser.add_argument("--circle", type=command.above_zero, default=0.5, help="part of a circle, at most 1")
    parser.add_argument("--length", type=command.above_zero, default=0.45, help="of the skirt, m")
    parser.add_argument("--cell", type=command.above_zero, default=60.0, help="mm, at the hem")
    parser.add_argument("--skin", type=command.above_zero, default=30.0, help="triangles of the body, mm")
    parser.add_argument("--friction", type=command.number, default=0.3, help="coefficient")
    parser.add_argument("--self", action="store_true", help="the skirt touches itself, too")
    parser.add_argument("--reach", type=command.above_zero, default=2.0, help="of contact, mm")
    parser.add_argument("--stiffness", type=command.above_zero, help="of contact, Pa; by default what stops a fall")
    parser.add_argument("--imperfection", type=command.above_zero, default=1.0, help="height of the first waves, mm")
    parser.add_argument("--seed", type=int, default=0, help="of the waves")
    parser.add_argument("--settle", type=command.above_zero, default=1.0, help="s, before the first step")
    parser.add_argument("--strides", type=command.positive, default=1, help="of two steps each")
    parser.add_argument("--stride", type=command.above_zero, default=1.1, help="time of one, s")
    parser.add_argument("--flexion", type=command.number, default=20.0, help="of the hip, degrees")
    parser.add_argument("--extension", type=command.number, default=10.0, help="of the hip, degrees")
    touching.add_arguments(parser, step=10.0, damping=4.0)
    parser.add_argument("--end", type=command.above_zero, help="s; by default after the walk")
    parser.add_argument("--out", type=Path, default=Path("out/skirt"))
    args = command.parse(parser)
    if args.circle > 1.0:
        raise InputError(f"--circle {args.circle:g}: a skirt is a part of a circle, at most 1.")
    args.end = args.end or args.settle + (args.strides + 0.5) * args.stride
    args.resume = None
    return args


def main():
    args = arguments()
    out = results.folder(args.out)
    clock = time.perf_counter()
    played = scene(args, out)
    table = moving.play(played, args, out, progress=True, every=4)
    imbalance = moving.summary(table, played.run)
    touching.draw(played, out / "deformed.png", "rise since the start (mm)")
    good = touching.passed(table) and imbalance <= 1.0
    for said, at in (("settled", args.settle), ("in the end", args.end)):
        row = table.rows[int(np.abs(table.column("time_s") - at).argmin())]
        command.say(
            f"{said}: {row['folds']:g} folds of a hem at {1e3 * row['hem_inner_m']:.0f} to "
            f"{1e3 * row['hem_outer_m']:.0f} mm from the axis, {1e3 * row['clearance_m']:.0f} mm from the skin"
        )
    command.say(f"{time.perf_counter() - clock:.0f} s in all")
    command.say(f"check: nothing passes, imbalance at most 1 %: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
