"""A sleeve or a trousers' leg on a limb that bends at one joint and straightens again: for `elbow.py` and `knee.py`.

One panel is that of the cone that just holds the straight limb, and `ease` wider. It is sewn along its side, dressed by
metric relaxation, held at its upper edge, and goes along with the limb, from one balance to the next (statics
downhill): what it loses in snaps from one balance to another is told.
"""

import argparse
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from fabric_fenicsx import fabrics, plots
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
"""A cloth without a law of its own: isotropic and elastic, of 0.2 MPa and 1 mm, like a thin sheet of foam."""
CLEAR = 6e-3  # m, between limb and cloth at the start
NEAR = 1.7  # radii of the limb around the joint, in which strains are told


def material(name, law):
    """Of a fabric, or `SOFT`."""
    if name != SOFT:
        return Material.of(fabrics.load(name), law=law)
    E, nu = 2e5, 0.3
    shear = E / (2 + 2 * nu)
    return Material(law=StVenantKirchhoff.isotropic(E, nu), thickness=1e-3, shear=(shear, shear), areal_mass=0.2)


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
        most = (self.limb.radius(-y) - middle - slope * y).max()
        radii = (1 + self.ease) * (middle + most + slope * np.array([low, high]))
        slope = np.diff(radii)[0] / (high - low)
        steep = max(slope / np.sqrt(1 + slope**2), 1e-3)  # the sine of half the angle of its tip
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
            radius += CLEAR + (1e-3 * self.args.cell) ** 2 / (8 * radius)  # flat cells stand inside of it
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
        of = material(self.fabric, self.args.law)
        cloth = self.garment().sheet(of)
        touch = self.touching(cloth, 0.0)
        held = supports.lead(cloth.domain, cloth.space, "sleeve.top", 2, 0.0)
        put_on = dressing.Dressing(cloth, touch.terms, held)
        steps = list(put_on.march(progress="dressing"))
        put_on.save(out / "worn.npz")
        strain = measures.cloth_strain(cloth.cell_strain())
        command.say(
            f"{self.fabric}, {100 * self.ease:g} % ease: dressed in {len(steps)} steps and "
            f"{sum(step.newton_iterations for step in steps)} iterations, kinetic energy {put_on.stir:.1e} of the "
            f"work; strains from {100 * strain.min(initial=0.0):.2f} to {100 * strain.max(initial=0.0):.2f} %, least "
            f"gap {1e3 * touch.least_gap():.3f} mm"
        )
        return dressing.worn(out / "worn.npz", self.garment(), of)

    def cycle(self, out):
        """Dress, bend and straighten: the table of a row for each angle."""
        args, limb = self.args, self.limb
        cloth = self.dressed(out)
        touch = self.touching(cloth, args.friction)
        solver = cloth.equilibrium(supports.clamp(cloth.domain, cloth.space, "sleeve.top"), touch.terms, rtol=args.rtol)
        count = max(round(args.angle / args.step), 1)
        bent = args.angle * np.arange(count + 1) / count
        effort, slip = measures.Effort(touch, solver), measures.Slip(touch, self.body)
        centre, near = limb.joint(self.joint), NEAR * float(limb.radius(self.place))
        start = limb.pose()
        least = limb.joints[self.joint].most

        def probes(step):
            angle = float(np.clip(step.load, -least, least))
            effort.step()
            slip.step()
            skin = touch.places(self.body)
            pressed = measures.pressed(touch.pressure(self.body), skin, self.body.faces)
            about = measures.near(skin[self.body.faces].mean(axis=1), centre, near)
            bare = measures.skin_strain(start, skin, self.body.faces)[about, 0].max()
            worn = measures.cloth_strain(cloth.cell_strain())
            worn = worn[measures.near(measures.middles(cloth), centre, near)][:, 0].max(initial=0.0)
            moment = -measures.joint_moment(touch.forces(self.body), limb.rates(self.joint, **{self.joint: angle}))
            return {
                "number": step.number, "angle_deg": angle, "moment_Nm": moment, **effort.row(),
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
            for step in march(
                solver, self.bend, [*bent, *bent[-2::-1]], progress=f"{self.fabric} {100 * self.ease:g} %"
            ):
                record(step, cpu_s=time.process_time() - clock)
                clock = time.process_time()
        return record.table


def arguments(doc, **defaults):
    parser = argparse.ArgumentParser(description=doc, formatter_class=command.Help)
    parser.add_argument("--fabric", nargs="+", help=f"names, TOML files, or {SOFT!r}: isotropic, 0.2 MPa, 1 mm")
    parser.add_argument("--ease", type=command.number, nargs="+", help="over the girth of a cone around the limb, %%")
    parser.add_argument("--law", choices=named.NAMES, default=named.DEFAULT, help="of a fabric")
    parser.add_argument("--length", type=command.above_zero, help="along the limb, m, half of it beyond the joint")
    parser.add_argument("--angle", type=command.above_zero, help="to which the joint bends, degrees")
    parser.add_argument("--step", type=command.above_zero, default=4.0, help="degrees")
    parser.add_argument("--friction", type=command.number, default=0.25, help="coefficient on the skin")
    parser.add_argument("--cell", type=command.above_zero, default=15.0, help="size of the cloth's, mm")
    parser.add_argument(
        "--skin", type=command.above_zero, help="size of the skin's triangles, mm; by default 0.8 cells"
    )
    parser.add_argument("--reach", type=command.above_zero, default=2.0, help="of contact, mm")
    parser.add_argument("--stiffness", type=command.above_zero, default=100.0, help="of contact, kPa")
    parser.add_argument("--itself", action="store_true", help="the cloth touches itself, too")
    parser.add_argument("--rtol", type=command.above_zero, default=1e-3, help="of the balance")
    parser.add_argument("--film", action="store_true", help="a gif")
    parser.add_argument("--out", type=Path)
    parser.set_defaults(**defaults)
    args = command.parse(parser)
    args.skin = args.skin or 0.8 * args.cell
    args.ease = [ease / 100 for ease in args.ease]
    return args


def play(limb, joint, args, comm):
    """All fabrics and fits: what is said, the plot, and whether all is well."""
    out, tables = results.folder(args.out), {}
    for fabric in args.fabric:
        for ease in args.ease:
            name = f"{Path(fabric).stem}, {100 * ease:g} % ease"
            folder = results.folder(out / f"{Path(fabric).stem}_{100 * ease:g}")
            tables[name] = Wear(limb, joint, fabric, ease, args, comm).cycle(folder)
            _say(name, tables[name], joint)
    _table(tables)
    results.on_root(comm, lambda: _plot(out / "moment.png", tables, joint))
    good = all([_good(table) for table in tables.values()])
    command.say(
        "check: nothing passes through the skin, and at most 1 % of the work comes from nowhere: "
        f"{'yes' if good else 'NO'}; see {out}"
    )
    return 0 if good else 1


def _good(table):
    work, released = table.column("work_J"), table.column("released_J")
    most = np.abs(work).max()
    paid = measures.work(table.column("angle_deg"), table.column("moment_Nm")) + table.column("onset_J")
    agree = np.abs(paid - work).max() <= 0.01 * most
    return bool(not table.column("crossed").any() and released.min() >= -0.01 * most and agree)


def _say(name, table, joint):
    """What is told of one fabric and fit, in a line."""
    angle, moment, last = table.column("angle_deg"), table.column("moment_Nm"), table.rows[-1]
    paid = measures.work(angle, moment) + table.column("onset_J")
    work = table.column("work_J")
    agree = np.abs(paid - work).max() / np.abs(work).max()
    count, cuts, seconds = (table.column(column).sum() for column in ("newton_iterations", "step_cuts", "cpu_s"))
    command.say(
        f"{name}: {joint} to {angle.max():.0f} degrees and back in {len(angle) - 1} steps, {count:g} iterations, "
        f"{cuts:g} cuts, {seconds:.0f} s of processor; moment over the angle off the work of all forces by "
        f"{100 * agree:.2f} %; slip {1e3 * last['slip_mean_m']:.1f} mm on average, the skin stretches by "
        f"{100 * table.column('strain_skin').max():.0f} %"
    )


COLUMNS = ("at 90", "at most", "where", "work up", "in cycle", "law", "friction", "snaps", "pressure", "strain")
UNITS = ("mN m", "mN m", "degrees", "mJ", "mJ", "mJ", "mJ", "mJ", "kPa", "%")


def _table(tables):
    """A row for each fabric and fit: moments, work up to the largest angle, and where that of the cycle went."""
    command.say(" " * 20 + "".join(f"{column:>10}" for column in COLUMNS))
    command.say(" " * 20 + "".join(f"{unit:>10}" for unit in UNITS))
    for name, table in tables.items():
        angle, moment, work = (table.column(column) for column in ("angle_deg", "moment_Nm", "work_J"))
        k, last = int(angle.argmax()), table.rows[-1]
        at_90 = np.interp(90.0, angle[: k + 1], moment[: k + 1], right=np.nan)
        lost = [1e3 * last[f"{key}_J"] for key in ("dissipated", "friction", "released")]
        peak, strain = (table.column(column).max() for column in ("pressure_peak_Pa", "strain_cloth"))
        row = [1e3 * at_90, 1e3 * moment.max(), angle[moment.argmax()], 1e3 * work[k], 1e3 * work[-1], *lost]
        command.say(f"{name:20}" + "".join(f"{x:10.4g}" for x in [*row, 1e-3 * peak, 100 * strain]))


def _plot(path, tables, joint):
    figure, (left, right) = plots.panels(2, width=5.0, height=3.8)
    for name, table in tables.items():
        angle = table.column("angle_deg")
        left.plot(angle, 1e3 * table.column("moment_Nm"), lw=1.2, label=name)
        right.plot(angle, 1e-3 * table.column("pressure_peak_Pa"), lw=1.2)
    plots.label(left, "", f"{joint} (degrees)", "moment against the bend (mN m)")
    plots.label(right, "", f"{joint} (degrees)", "peak pressure (kPa)")
    plots.legend(figure)
    plots.save(figure, path)
