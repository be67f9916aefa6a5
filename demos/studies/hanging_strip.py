"""A flexible strip hangs by its upper end and swings a little, in each of its first modes in turn.

A chain of length L swings in the shapes J0(j sqrt(s/L)), s being the height above its free end and j a root of
the Bessel function J0, with the frequencies j/2 sqrt(g/L) = 1.20241, 2.76004, 4.32686 ... sqrt(g/L).
The strip starts from rest in such a shape. The checked number: its frequencies, to 1 %.
"""

from mpi4py import MPI  # isort: skip  (first, as in every DOLFINx script: it loads the MPI library)

import argparse
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # the demos

import moving
import numpy as np
from dolfinx import fem
from scipy.special import j0, jn_zeros

from fabric_fenicsx import sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import results
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

MESH = meshing.MESHES / "strip.geo"
LENGTH, WIDTH, THICKNESS, DENSITY, G = 0.5, 0.05, 0.1e-3, 500.0, 9.81
E, NU = 1e7, 0.0
"""Bending stiffness is 1.4e-5 of weight times length squared: a chain."""
SLOPE = 0.05
"""Of the free end at the start."""


def scene(args, mode, comm=MPI.COMM_WORLD):
    """The strip at rest, and in the shape of a mode. It hangs from z = 0 in the plane x = 0."""
    domain = moving.read(MESH, args.element, comm, length=LENGTH, width=WIDTH, nx=args.cells, ny=1)
    x = domain.mesh.geometry.x
    x[:] = np.stack([0 * x[:, 0], x[:, 1], -x[:, 0]], axis=1)
    law, shear = StVenantKirchhoff.isotropic(E, NU), E / 2 / (1 + NU)
    strip = sheet.Sheet(domain, law, THICKNESS, (shear, shear), warp=(0.0, 0.0, -1.0), element=args.element)
    areal_mass = DENSITY * THICKNESS
    weight = strip.weight(areal_mass, fem.Constant(domain.mesh, np.array([0.0, 0.0, -G])))
    bcs = supports.hinge(domain, strip.space, "fixed_end")
    run, ledger = strip.newmark(areal_mass, bcs, weight, rho=args.rho, rotary="thickness", rtol=args.rtol)
    deflect(strip, jn_zeros(0, mode)[-1])
    run.solver.renew()
    probes = {"end_x_m": moving.value_at(strip, 0, "pulled_end")}
    name = f"strip in mode {mode}"
    settings = {"scene": name, "cells": args.cells, "element": args.element, "rho": args.rho}
    return moving.Scene(name, strip, run, ledger, probes, settings)


def deflect(strip, root):
    """Put the strip into the shape that belongs to a root of J0, with directors across it and its weight's stretch."""
    s = np.linspace(0.0, LENGTH, 10_001)
    w = 4 * LENGTH * SLOPE / root**2 * j0(root * np.sqrt(1 - s / LENGTH))
    slope = np.gradient(w, s)
    shortening = np.concatenate([[0.0], np.cumsum((slope[1:] ** 2 + slope[:-1] ** 2) / 4 * np.diff(s))])
    stretch = DENSITY * G / E * (LENGTH * s - s**2 / 2)
    q, along = strip.q, fem.Function(strip.q.function_space)
    q.sub(0).interpolate(lambda x: [np.interp(-x[2], s, w), 0 * x[0], -np.interp(-x[2], s, stretch - shortening)])
    angle = np.arctan(slope)
    q.sub(1).interpolate(lambda x: [np.cos(np.interp(-x[2], s, angle)), 0 * x[0], np.sin(np.interp(-x[2], s, angle))])
    along.sub(1).interpolate(lambda x: [0 * x[0], 1 + 0 * x[0], 0 * x[0]])
    strip.shell.set_axes(along.x.array, q.x.array)


def swing(args, mode, out):
    """Let the strip swing in a mode: the error of its frequency, %."""
    exact = jn_zeros(0, mode)[-1] / 2 * np.sqrt(G / LENGTH)
    args.end, args.step = 2.5 * 2 * np.pi / exact, 1e3 * 2 * np.pi / exact / args.points
    played = scene(args, mode)
    table = moving.play(played, args, results.folder(out / f"mode_{mode}"), progress=True)
    zeros = moving.zeros(table.column("time_s"), table.column("end_x_m"))
    found = np.pi * (len(zeros) - 1) / (zeros[-1] - zeros[0])
    error = 100 * (found / exact - 1)
    unit = np.sqrt(G / LENGTH)
    command.say(f"mode {mode}: {found / unit:.5f} sqrt(g/L), chain {exact / unit:.5f}, error {error:.3f} %")
    moving.summary(table, played.run)
    return abs(error)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--modes", type=command.positive, default=3, help="how many")
    parser.add_argument("--cells", type=command.positive, default=40, help="along the strip")
    parser.add_argument("--points", type=command.positive, default=80, help="time steps a period")
    moving.add_common(parser, rho=1.0, rtol=1e-6)
    parser.add_argument("--out", type=Path, default=Path("out/hanging_strip"))
    parser.set_defaults(resume=None)
    args = command.parse(parser)
    if args.points < 8:
        raise InputError(f"--points {args.points} are too few to see a swing; take at least 8 time steps a period.")
    return args


def main():
    args = arguments()
    out = results.folder(args.out)
    worst = max(swing(args, mode, out) for mode in range(1, args.modes + 1))
    command.say(f"check: frequencies of the hanging chain to 1 %: {'yes' if worst <= 1.0 else 'NO'}; see {out}")
    return 0 if worst <= 1.0 else 1


if __name__ == "__main__":
    command.run(main)
