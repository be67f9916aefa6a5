"""A sleeve or a trousers' leg on a limb that bends at one joint and straightens again: for `elbow.py` and `knee.py`.

One panel is that of the cone that just holds the straight limb, and `ease` wider. It is sewn along its side, dressed by
metric relaxation, held at its upper edge, or drawn along the limb and held at both ends, and goes along with the limb,
from one balance to the next (statics downhill): what it loses in snaps from one balance to another is told.
"""

import argparse
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import wear_told

from fabric_fenicsx import fabrics
from fabric_fenicsx.app import command
from fabric_fenicsx.contact.bodies import Body
from fabric_fenicsx.contact.contact import Contact
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.garments import dressing, measures
from fabric_fenicsx.garments.panels import Edge, Panel
from fabric_fenicsx.garments.sewing import Seam, sew
from fabric_fenicsx.laws import named
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.material import Material
from fabric_fenicsx.output import results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.solvers.marching import march
from fabric_fenicsx.terms import supports

SOFT = "soft"
"""A cloth without a law of its own: isotropic and elastic, of 0.2 MPa and 200 kg/m3, like a sheet of foam."""
CLEAR = 5e-3  # m, between limb and the inner side of the cloth at the start
NEAR = 1.7  # radii of the limb around the joint, in which strains are told


def material(name, law, thickness=1.0):
    """Of a fabric, or `SOFT`; thickness: of that, mm."""
    if name != SOFT:
        return Material.of(fabrics.load(name), law=law)
    E, nu, h = 2e5, 0.3, 1e-3 * thickness
    shear = E / (2 + 2 * nu)
    return Material(law=StVenantKirchhoff.isotropic(E, nu), thickness=h, shear=(shear, shear), areal_mass=200.0 * h)


@dataclass(frozen=True)
class Wear:
    """A limb, the name of the joint that bends, and what is worn there; `args` as of `arguments`."""

    limb: object
    joint: str
    fabric: str
    ease: float
    args: argparse.Namespace
    comm: object

    @property
    def place(self):
        """Of the joint along the limb, m."""
        return self.limb.joints[self.joint].place

    @cached_property
    def body(self):
        return Body(self.limb.pose(), self.limb.faces, self.limb.name)

    @cached_property
    def cloth(self):
        """What it is made of."""
        return material(self.fabric, self.args.law, self.args.thickness)

    @property
    def ends(self):
        """Of the sleeve that are held: the hem, too, where it is drawn along the limb."""
        return ("sleeve.top", "sleeve.hem") if self.args.stretch else ("sleeve.top",)

    def bend(self, angle):
        """Lead the limb to an angle of its joint, degrees."""
        self.body.deform(self.limb.pose(**{self.joint: angle}))

    def garment(self):
        """Sewn along its side; y goes up the limb, which hangs down."""
        low, high = -(self.place + self.args.length / 2), -(self.place - self.args.length / 2)
        if not 0.0 < -high < -low < self.limb.length:
            raise InputError(f"--length {self.args.length:g} m is longer than the limb on both sides of its joint.")
        y = np.linspace(low, high, 50)
        slope, middle = np.polyfit(y, self.limb.radius(-y), 1)
        slope = max(slope, 1e-3)  # upwards it becomes no narrower
        most = (self.limb.radius(-y) - middle - slope * y).max()
        radii = (1 + self.ease) * (middle + most + slope * np.array([low, high]))
        slant = np.hypot(high - low, np.diff(radii)[0]) / (1 + self.args.stretch / 100)
        steep = np.diff(radii)[0] / slant  # the sine of half the angle of its tip
        inner, outer = radii / steep
        t = np.pi * steep * np.array([-1, 1])
        (left, right), up = np.column_stack([np.sin(t), np.cos(t)]), np.array([0.0, 1.0])
        outline = {
            "hem": Edge(inner * left, [inner * up], "arc"),
            "right": Edge(inner * right),
            "top": Edge(outer * right, [outer * up], "arc"),
            "left": Edge(outer * left),
        }

        def around(points):
            """Rolled up so that the side meets itself, at the back of the limb."""
            far = np.linalg.norm(points, axis=1)
            z = low + (high - low) * (far - inner) / (outer - inner)
            angle = np.arctan2(points[:, 0], points[:, 1]) / steep - np.pi / 2
            radius = np.maximum(steep * far, self.limb.radius(-z))
            radius += self.cloth.thickness + CLEAR
            radius += (1e-3 * self.args.cell) ** 2 / (8 * radius)  # flat cells stand inside of it
            return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])

        panel = Panel("sleeve", outline, placed=around, regular=True)
        seam = Seam(("sleeve", "left"), ("sleeve", "right"), name="seam")
        return sew([panel], [seam], cell=1e-3 * self.args.cell, comm=self.comm)

    def touching(self, cloth, friction):
        args = self.args
        return Contact(
            cloth, [self.body], friction=friction, lagged=True, carried=True, itself=args.itself,
            stiffness=1e3 * args.stiffness, reach=1e-3 * args.reach,
        )  # fmt: skip

    def dressed(self, out):
        """The cloth on the straight limb, where it is at rest."""
        cloth = self.garment().sheet(self.cloth)
        touch = self.touching(cloth, 0.0)
        held = [bc for end in self.ends for bc in supports.lead(cloth.domain, cloth.space, end, 2, 0.0)]
        put_on = dressing.Dressing(cloth, touch.terms, held)
        steps = list(put_on.march(progress="dressing"))
        put_on.save(out / "worn.npz")
        strain = measures.cloth_strain(cloth.cell_strain())
        fold = measures.fold(self.cloth, float(self.limb.radius(self.place)))
        command.say(
            f"{self.fabric}, {100 * self.ease:g} % ease: dressed in {len(steps)} steps and "
            f"{sum(step.newton_iterations for step in steps)} iterations, kinetic energy {put_on.stir:.1e} of the "
            f"work; strains from {100 * strain.min(initial=0.0):.2f} to {100 * strain.max(initial=0.0):.2f} %, least "
            f"gap {1e3 * touch.least_gap():.3f} mm; were it tight, a fold {1e3 * fold:.0f} mm long, "
            f"{1e3 * fold / self.args.cell:.1f} cells"
        )
        return dressing.worn(out / "worn.npz", self.garment(), self.cloth)

    def cycle(self, out, back=True):
        """Dress, bend and straighten: the table of a row for each angle; or bend alone."""
        args, limb = self.args, self.limb
        cloth = self.dressed(out)
        touch = self.touching(cloth, args.friction)
        held, moves = zip(*(supports.grip(cloth.domain, cloth.space, end) for end in self.ends), strict=True)
        solver = cloth.equilibrium([bc for bcs in held for bc in bcs], touch.terms, rtol=args.rtol)
        hem = supports.unknowns(cloth.domain, cloth.space, self.ends[-1])
        count = max(round(args.angle / args.step), 1)
        bent = args.angle * np.arange(count + 1) / count
        effort, slip = measures.Effort(touch, solver), measures.Slip(touch, self.body)
        joint, near = limb.joint(self.joint), NEAR * float(limb.radius(self.place))
        start = limb.pose()
        least, last = limb.joints[self.joint].most, (0.0, 0.0)  # angle, and moment at the hem

        def bend(angle):
            self.bend(angle)
            for move in moves[1:]:
                move((0, 0, 0), np.radians(angle) * np.array(joint.axis), joint.centre)

        def probes(step):
            nonlocal last
            angle, held = float(np.clip(step.load, -least, least)), 0.0
            if moves[1:]:
                held = float(solver.reaction_moment(hem, joint.centre) @ joint.axis)
            effort.step(np.radians(angle - last[0]) * (held + last[1]) / 2)
            last = angle, held
            slip.step()
            skin = touch.places(self.body)
            pressed = measures.pressed(touch.pressure(self.body), skin, self.body.faces)
            about = measures.near(skin[self.body.faces].mean(axis=1), joint, near)
            bare = measures.skin_strain(start, skin, self.body.faces)[about, 0].max()
            worn = measures.cloth_strain(cloth.cell_strain())
            worn = worn[measures.near(measures.middles(cloth), joint, near)][:, 0].max(initial=0.0)
            moment = measures.joint_moment(touch.forces(self.body), limb.rates(self.joint, **{self.joint: angle}))
            return {
                "number": step.number, "angle_deg": angle, "moment_Nm": held - moment, **effort.row(),
                "pressure_mean_Pa": pressed.mean, "pressure_peak_Pa": pressed.peak, "pressed_m2": pressed.area,
                "strain_cloth": max(self.comm.allgather(worn)), "strain_skin": bare,
                "slip_mean_m": float(slip.way.mean()), "slip_max_m": float(slip.way.max()), "crossed": touch.crossed(),
            }  # fmt: skip

        title = f"{self.fabric}, {100 * self.ease:g} % ease"
        record = Recorder(
            cloth, out, probes, title=title, when=lambda step: f"{step.load:.0f}°", colour="pressure",
            view=(-1.0, -0.5, 0.25), film=args.film, picture=count + 1, touch=touch,
        )  # fmt: skip
        with record:
            clock = time.process_time()
            angles = [*bent, *bent[-2::-1]] if back else bent
            for step in march(solver, bend, angles, progress=f"{self.fabric} {100 * self.ease:g} %"):
                record(step, cpu_s=time.process_time() - clock)
                clock = time.process_time()
        return record.table


def arguments(doc, **defaults):
    parser = argparse.ArgumentParser(description=doc, formatter_class=command.Help)
    parser.add_argument("--fabric", nargs="+", help=f"names, TOML files, or {SOFT!r}: isotropic, 0.2 MPa")
    parser.add_argument("--ease", type=command.number, nargs="+", help="over the girth of a cone around the limb, %%")
    parser.add_argument("--law", choices=named.NAMES, default=named.DEFAULT, help="of a fabric")
    parser.add_argument("--thickness", type=command.above_zero, default=1.0, help=f"of {SOFT!r}, mm")
    parser.add_argument(
        "--stretch",
        type=command.above_zero,
        default=0.0,
        help="by which it is drawn along, and held by its hem, too, %%",
    )
    parser.add_argument("--length", type=command.above_zero, help="along the limb, m, half of it beyond the joint")
    parser.add_argument("--angle", type=command.above_zero, help="to which the joint bends, degrees")
    parser.add_argument("--step", type=command.above_zero, default=4.0, help="degrees")
    parser.add_argument("--friction", type=command.number, default=0.25, help="coefficient on the skin")
    parser.add_argument("--cell", type=command.above_zero, default=15.0, help="size of the cloth's, mm")
    parser.add_argument(
        "--skin", type=command.above_zero, help="size of the skin's triangles, mm; by default 0.8 cells"
    )
    parser.add_argument("--reach", type=command.above_zero, default=2.0, help="of contact, mm")
    parser.add_argument("--stiffness", type=command.above_zero, default=700.0, help="of contact, kPa")
    parser.add_argument("--itself", action="store_true", help="the cloth touches itself, too")
    parser.add_argument("--rtol", type=command.above_zero, default=1e-3, help="of the balance")
    parser.add_argument(
        "--about", type=command.above_zero, nargs=2, default=(90.0, 10.0), metavar=("AT", "WITHIN"),
        help="degrees at which the moment is told, and within which its mean is: work over angle, snaps included",
    )  # fmt: skip
    parser.add_argument("--converge", action="store_true", help="bend alone, on these cells and on half of them")
    parser.add_argument("--film", action="store_true", help="a gif")
    parser.add_argument("--out", type=Path)
    parser.set_defaults(**defaults)
    args = command.parse(parser)
    args.skin = args.skin or 0.8 * args.cell
    args.ease = [ease / 100 for ease in args.ease]
    if args.converge and args.angle < sum(args.about):
        raise InputError(f"--converge tells of {args.about[0]:g} degrees: --angle {sum(args.about):g} at least.")
    return args


def play(limb, joint, args, comm):
    """All fabrics and fits: what is said, the plot, and whether all is well."""
    out, tables, same = results.folder(args.out), {}, True
    for fabric in args.fabric:
        for ease in args.ease:
            name, label = f"{Path(fabric).stem}, {100 * ease:g} % ease", f"{Path(fabric).stem}_{100 * ease:g}"
            runs = {name: args}
            if args.converge:
                fine = argparse.Namespace(**{**vars(args), "cell": args.cell / 2})
                runs = {f"{name}, {each.cell:g} mm": each for each in (args, fine)}
            for run, settings in runs.items():
                folder = results.folder(out / (f"{label}_{settings.cell:g}" if args.converge else label))
                tables[run] = Wear(limb, joint, fabric, ease, settings, comm).cycle(folder, back=not args.converge)
                wear_told.say(run, tables[run], joint)
            if args.converge:
                same &= wear_told.same(*(tables[run] for run in runs), args.about)
    wear_told.rows(tables, args.about)
    results.on_root(comm, lambda: wear_told.plot(out / "moment.png", tables, joint))
    good = all([wear_told.good(table) for table in tables.values()])
    command.say(
        "check: nothing passes through the skin, and at most 1 % of the work comes from nowhere, or is lost "
        "without friction, hysteresis or snaps"
        f"{f', half the cells change the moment by {100 * wear_told.SAME:g} % at most' if args.converge else ''}: "
        f"{'yes' if good and same else 'NO'}; see {out}"
    )
    return 0 if good and same else 1
