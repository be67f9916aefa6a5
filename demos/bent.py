"""What the demos of bending share: which cloth, by its fabric or by numbers of a laboratory, and strips of it."""

import argparse

import numpy as np
from dolfinx import fem

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import BendingCurve, BendingCurves
from fabric_fenicsx.fabrics.bending import assumed_twist, bias_of_twist, quantile, twist_of_bias
from fabric_fenicsx.laws import named
from fabric_fenicsx.laws.bending import Bending
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.shell import directors
from fabric_fenicsx.surfaces import meshing

GRAVITY = 9.80665
WAYS = {"warp": 0.0, "weft": np.pi / 2, "bias": np.pi / 4}
"""Angle from the strip to the warp."""


def add_arguments(parser):
    """Cloth and element."""
    parser.add_argument("--fabric", default="blend", help="name, or a TOML file: the plane law, mass and bending")
    parser.add_argument("--law", choices=named.NAMES, default="svk", help="of the plane; svk: elastic")
    given = parser.add_argument_group("bending in numbers, alike along warp and weft, instead of that of the fabric")
    given.add_argument("--B", type=command.above_zero, metavar="UNM", help="uN m (KES: 1 gf cm2/cm is 98.0665)")
    given.add_argument("--softening", type=command.number, default=0.0, metavar="NNM2", help="B2, nN m2")
    given.add_argument("--hysteresis", type=command.number, default=0.0, metavar="MN", help="2HB, mN")
    given.add_argument(
        "--percentile",
        type=command.number,
        metavar="P",
        help="mass and bending of 618 published fabrics: 5, 25, 50 ...",
    )
    parser.add_argument("--mass", type=command.above_zero, help="g/m2, instead of that of the fabric")
    parser.add_argument("--element", choices=directors.ELEMENTS, default="mitc4")


class Cloth:
    """What the command line says: `fabric`, plane `law`, `curves` of bending, `mass` in kg/m2."""

    def __init__(self, args: argparse.Namespace):
        self.element, self.fabric = args.element, fabrics.load(args.fabric)
        self.law, self.shear = named.law(args.law, self.fabric), self.fabric.shear.modulus[0]
        self.mass = args.mass / 1000 if args.mass else self.fabric.areal_mass
        self.name = self.fabric.name
        self.curves = self.fabric.bending or fabrics.estimated_bending(self.mass)
        if args.percentile is not None:
            self._published(args.percentile, args.mass)
        if args.B:
            one = BendingCurve(1e-6 * args.B, 1e-9 * args.softening, 1e-3 * args.hysteresis)
            twist, said = assumed_twist(one, one)
            self.curves, self.name = BendingCurves(one, one, twist, assumed={"twist": said}), str(one)

    def _published(self, percent, mass):
        """The percentiles of mass, B1 and B2 of 618 fabrics, which hold friction; the plane is assumed."""
        if not 0 <= percent <= 100:
            raise InputError(f"--percentile {percent:g} is not from 0 to 100.")
        warp, weft, bias = (
            BendingCurve(1e-6 * quantile(f"B1_{way}_uNm", percent), 1e-9 * quantile(f"B2_{way}_nNm2", 100 - percent))
            for way in ("warp", "weft", "diag")
        )
        self.curves = BendingCurves(warp, weft, twist_of_bias(warp, weft, bias, wide=False))
        self.mass = mass / 1000 if mass else quantile("density_kg_m2", percent)
        h = self.fabric.thickness
        self.law, self.shear = StVenantKirchhoff.orthotropic(2e3 / h, 2e3 / h, 0.0, 60.0 / h), 60.0 / h
        self.name = f"{percent:g} % quantiles of 618 fabrics, tension 2 kN/m, shear 60 N/m"

    def say(self):
        """Mass and bending, with what of it is assumed."""
        command.say(f"{self.name}, {1000 * self.mass:.4g} g/m2")
        for line in self.curves.describe().splitlines():
            command.say(f"  bending, {line}")

    def sheet(self, domain, warp=(1.0, 0.0, 0.0)):
        """A shell of it on a mesh."""
        shear, bending = (self.shear, self.shear), Bending(self.curves)
        return sheet.Sheet(
            domain, self.law, self.fabric.thickness, shear, warp=warp, element=self.element, bending=bending
        )

    def strip_curve(self, way):
        """The bending curve of a narrow strip along warp, weft or bias."""
        c = self.curves
        return getattr(c, way) if way != "bias" else bias_of_twist(c.warp, c.weft, c.twist, False, c.coupling)

    def strip(self, length, width, cells, way="warp", across=None):
        """A strip (m) of so many cells along it, and across or about square; its sheet, along the yarns of `way`."""
        ny = across or max(1, round(cells * width / length))
        domain = meshing.read(
            meshing.MESHES / "strip.geo", length=length, width=width, nx=cells, ny=ny,
            triangles=int(directors.ELEMENTS[self.element][0] == "triangle"),
        )  # fmt: skip
        return self.sheet(domain, (np.cos(WAYS[way]), np.sin(WAYS[way]), 0.0))


def lowering(g, over):
    """What brings the weight, a Constant acceleration g, in so many s, as if the cloth was lowered."""

    def set_load(t):
        part = min(t / over, 1.0)
        g.value[2] = -GRAVITY * part**2 * (3 - 2 * part)

    return set_load


def height(cloth):
    """Mean height of each local cell, mm."""
    u = cloth.displacement()
    values = fem.Function(fem.functionspace(u.function_space.mesh, ("DG", 0)))
    values.interpolate(fem.Expression(1e3 * u[2], values.function_space.element.interpolation_points))
    return values.x.array
