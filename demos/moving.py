"""What the demos in motion share: arguments, and a run that leaves its history, fields, pictures and energies."""

import argparse
import resource
import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from fabric_fenicsx import fabrics, plots, sheet
from fabric_fenicsx.app import command
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws import named
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.output import results
from fabric_fenicsx.output.recording import Recorder
from fabric_fenicsx.output.series import LABELS, coloured
from fabric_fenicsx.shell import directors
from fabric_fenicsx.solvers import linear
from fabric_fenicsx.surfaces import meshing
from fabric_fenicsx.terms import supports

SIDE = 2.0  # m
SOLVERS = {"direct": {}, "lu": linear.DIRECT, "iterative": linear.IN_MOTION}


def law(args, fabric):
    """The law that the command line asks for, and a transverse shear modulus in Pa."""
    if args.isotropic:
        E, nu = args.isotropic
        return StVenantKirchhoff.isotropic(E, nu), E / 2 / (1 + nu)
    return named.law(args.law, fabric, args.poisson, not args.no_shear_hysteresis), fabric.shear.modulus[0]


def read(mesh, element, comm, **numbers):
    """A mesh of the cells that the element needs."""
    return meshing.read(mesh, comm, triangles=int(directors.ELEMENTS[element][0] == "triangle"), **numbers)


def square(mesh, args, a, comm, side=SIDE):
    """The sheet of the drape and of the poke, a square cut at a (m), and its mass in kg/m2."""
    if args.cells % 2:
        raise InputError(f"--cells {args.cells} is odd; take an even number, so that the middle is a node.")
    fabric = fabrics.load(args.fabric)
    own_law, G = law(args, fabric)
    domain = read(mesh, args.element, comm, side=side, n=args.cells, a=a)
    bending = named.bending(args.bending, fabric)
    if bending:
        command.say(f"bending of its own, {bending.curves.describe()}".replace(chr(10), "; "))
    layers = None if bending else args.layers
    cloth = sheet.Sheet(
        domain, own_law, fabric.thickness, (G, G), element=args.element, layers=layers, bending=bending
    )  # fmt: skip
    return cloth, fabric.density * fabric.thickness


def pair(text):
    """Two numbers, as 8e6,0.25."""
    parts = text.split(",")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(f"{text} is not of the form 8e6,0.25")
    return command.number(parts[0]), command.number(parts[1])


def add_arguments(parser, end, rho):
    """What every sheet in motion can be asked."""
    parser.add_argument("--fabric", default="blend", help="name, or a TOML file")
    parser.add_argument("--law", choices=named.NAMES, default=named.DEFAULT, help="svk: elastic, of the first moduli")
    parser.add_argument("--isotropic", type=pair, metavar="E,NU", help="linear elastic instead; Pa")
    parser.add_argument("--poisson", choices=["measured", "lowered"], default="measured", help="Poisson's ratios")
    parser.add_argument("--no-shear-hysteresis", action="store_true", help="shear comes back as it went")
    parser.add_argument("--cells", type=command.positive, default=30, help="along a side, even; the thesis has 20")
    parser.add_argument("--bending", choices=named.BENDING, default="layers", help="own: measured, else assumed")
    parser.add_argument("--layers", type=command.positive, default=3, help="through the thickness")
    parser.add_argument("--step", type=command.number, default=5.0, help="nominal time step, ms")
    parser.add_argument("--end", type=command.number, default=end, help="s")
    parser.add_argument("--method", choices=["implicit", "explicit"], default="implicit", help="of time steps")
    parser.add_argument("--damping", type=command.number, default=0.0, help="a of Rayleigh's a M, 1/s")
    parser.add_argument("--rotary", choices=sheet.ROTARY, default="cell", help="inertia of directors")
    parser.add_argument("--lumped", action="store_true", help="lumped mass, as explicit motion has it")
    parser.add_argument("--solver", choices=SOLVERS, default="direct", help="of linear systems")
    parser.add_argument(
        "--resume", nargs="?", const=True, metavar="FILE", help="go on from this checkpoint, or from the last in --out"
    )
    add_common(parser, rho, None)


def add_common(parser, rho, rtol):
    """What every motion can be asked."""
    parser.add_argument("--element", choices=directors.ELEMENTS, default="mitc4")
    parser.add_argument("--rho", type=command.number, default=rho, help="left of the fastest oscillation after a step")
    said = "of Newton's method" + ("; by default, a part of the time rule's own error" if rtol is None else "")
    parser.add_argument("--rtol", type=command.number, default=rtol, help=said)
    parser.add_argument("--animation", action="store_true", help="a gif of 50 frames")


def runner(args, cloth, areal_mass, bcs, loads, **led):
    """The time integrator that the command line asks for, and its ledger; loads: virtual work, a form or 0.

    led: `set_load`, if anything is led.
    """
    same = {"damping": args.damping, "rotary": args.rotary, **led}
    if args.method == "implicit":
        same["options"] = SOLVERS[args.solver]
        run, ledger = cloth.newmark(areal_mass, bcs, loads, rho=args.rho, lumped=args.lumped, rtol=args.rtol, **same)
        command.say(f"linear systems by {linear.method(run.solver.snes)}")
        return run, ledger
    run, ledger = cloth.explicit(areal_mass, bcs, loads, **same)
    command.say(f"stable step {run.stable * 1e6:.3g} us; directors have the inertia of a {args.rotary}")
    return run, ledger


def settings(scene, args, **more):
    """What a checkpoint must have been made with."""
    law = f"isotropic {args.isotropic}" if args.isotropic else f"{args.fabric}, {args.law}, {args.poisson}"
    bends = f"{args.layers} layers" if args.bending == "layers" else "bending of its own"
    mesh = f"{args.cells} cells, {args.element}, {bends}"
    shear = "no shear hysteresis" if args.no_shear_hysteresis else "shear hysteresis"
    motion = {"method": args.method, "rho": args.rho, "damping": args.damping, "rotary": args.rotary}
    return {"scene": scene, "law": law, "shear": shear, "mesh": mesh, **motion, **more}


@dataclass
class Scene:
    """A run in motion and what is asked of it. probes: column -> function; touch: contact, if there is any."""

    name: str
    sheet: object
    run: object
    ledger: object
    probes: dict
    settings: dict
    touch: object = None


def play(scene, args, out, progress, watch=None, every=1):
    """Run to the end: the table. What fails, or is interrupted, leaves a checkpoint in the folder.

    `watch(row, *shown)` is called at the start and after every step, with the row of the table (at the start its time
    alone), and the sheet as `pictures.picture` wants it. every: so manieth step has fields.
    """
    sheet, run = scene.sheet, scene.run

    def probes(step):
        return {"time_s": step.load} | {name: probe() for name, probe in scene.probes.items()}

    def shown():
        return sheet.displacement(), coloured(sheet.cell_strain(), "yarn"), LABELS["yarn"]

    record = Recorder(
        sheet, out, probes, title=scene.name, run=run, marks=scene.settings, resume=args.resume, film=args.animation,
        every=every, touch=scene.touch,
    )  # fmt: skip
    if args.resume:
        command.say(f"gone on from t = {run.time:g} s")
    taken, solved, made = run.ts.getStepNumber(), run.linear_iterations, run.matrices
    with record:
        if watch:
            watch({"time_s": run.time}, *shown())
        clock = time.process_time()
        for step in run.march(args.end, args.step * 1e-3, progress=progress and scene.name):
            row = record(
                step,
                linear_iterations=run.linear_iterations - solved,
                matrices=run.matrices - made,
                steps_taken=run.ts.getStepNumber() - taken,
                cpu_s=time.process_time() - clock,
                unknowns=sheet.q.function_space.dofmap.index_map.size_global,
                memory_MB=run.comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1024,
            )
            taken, solved, made = run.ts.getStepNumber(), run.linear_iterations, run.matrices
            if watch:
                watch(row, *shown())
            clock = time.process_time()
    results.on_root(run.comm, lambda: plot(out / "energy.png", record.table, scene))
    return record.table


def plot(path, table, scene):
    """Where the work is, over time, and the first probe."""
    t = table.column("time_s")
    figure, (left, right) = plots.panels(2, width=5.0, height=3.8)
    kinds = {
        "kinetic_J": "kinetic", "recoverable_J": "recoverable", "dissipated_J": "dissipated by the law",
        "damped_J": "by damping", "scheme_J": "by the scheme",
    }  # fmt: skip
    kinds = {name: label for name, label in kinds.items() if np.abs(table.column(name)).max() > 0}
    parts = [np.maximum(table.column(name), 0.0) for name in kinds]
    left.stackplot(t, parts, labels=kinds.values(), colors=plots.shades(len(parts)))
    left.plot(t, table.column("external_work_J"), "k-", lw=1.5, label="external work")
    plots.label(left, f"{scene.name}: where the work goes", "time (s)", "energy (J)")
    name = next(iter(scene.probes))
    right.plot(t, table.column(name), "k.-", ms=3, lw=1)
    quantity, unit = name.rsplit("_", 1)
    plots.label(right, "", "time (s)", f"{quantity.replace('_', ' ')} ({unit})")
    plots.legend(figure, 6)
    plots.save(figure, path)


def summary(table, run):
    """Lines on steps, cost and energies; the largest imbalance in percent of the largest external work."""
    ledger = run.ledger
    iterations, imbalance = table.column("newton_iterations"), 100 * ledger.worst / max(ledger.most, 1e-300)
    cuts, taken, seconds = (table.column(name).sum() for name in ("step_cuts", "steps_taken", "wall_s"))
    t, newton = ledger.totals, f"{iterations.sum() / taken:.1f} Newton iterations a step taken"
    command.say(
        f"{len(iterations)} steps, {cuts:g} cuts, {taken:g} steps taken, the smallest {run.finest:g} of the whole"
    )
    made = table.column("matrices").sum() / taken
    command.say(f"{newton}{f', {made:.1f} of them with a matrix of their own' if made else ''}, {seconds:.1f} s")
    unknowns = ledger.motion.q.function_space.dofmap.index_map.size_global
    cpu = 1e6 * table.column("cpu_s") / unknowns
    best = (cpu / table.column("steps_taken")).min()
    command.say(f"processor time: {cpu.sum() / taken:.3g} us per unknown and step taken, {best:.3g} in the fastest row")
    command.say(
        f"energy: external work {t['external']:.4g} J, {ledger.most:.4g} J at most; kinetic {t['kinetic']:.3g}, "
        f"recoverable {t['recoverable']:.3g}, by the law {t['by_law']:.3g}, by damping {t['by_damping']:.3g}, "
        f"by the scheme {t['by_scheme']:.3g} J; largest imbalance {imbalance:.2f} %"
    )
    if ledger.made > 0.01 * ledger.most:
        made = f"{ledger.made:.4g} J, {100 * ledger.made / ledger.most:.3g} % of the external work"
        command.say(f"warning: a law without potential made {made}; --poisson lowered makes less")
    return imbalance


def value_at(sheet, component, group):
    """Mean displacement along an axis at a group of the mesh, m; a function."""
    return partial(supports.mean, sheet.domain, sheet.space, sheet.q, group, component)


def zeros(t, x):
    """Times at which a swinging x goes through zero, between two of its times by a straight line."""
    at = np.flatnonzero((x[:-1] > 0) != (x[1:] > 0))
    return t[at] + x[at] / (x[at] - x[at + 1]) * (t[at + 1] - t[at])
