"""Goes through the loads or the time of a scene, and writes what it finds."""

from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..output import results
from ..output.frames import Frames, Series, coloured
from ..solvers import checkpoint, statics
from ..solvers.continuation import Step
from ..solvers.energy import Ledger
from ..terms import supports
from .building import Built, build
from .marks import marks
from .reading import AXES, Scene


def run(scene: Scene, out: Path, progress: bool = True, resume: Path | None = None) -> results.Table:
    """Run a scene to its end; its history, which is also in the folder.

    Writes history.csv, fields.bp (ParaView), frames (for `view`), deformed.png, energy and checkpoint of a motion, and
    animation.gif where the scene asks for it. Raises InputError and StepFailed, on every rank.
    """
    if resume and not scene.dynamic:
        raise InputError(
            f"--resume {str(resume)!r} goes on with a motion, and {scene.file} has [statics]; leave it out."
        )
    built = build(scene)
    cloth, comm = built.cloth, built.cloth.domain.mesh.comm
    steps, solver, ledger, motion = _start(built, progress)
    guard: Any = checkpoint.guard(out / "checkpoint.npz", motion, marks(built)) if motion else None
    if motion and resume:
        checkpoint.load(resume, motion, marks(built))
    held = {s.at: [supports.unknowns(cloth.domain, cloth.space, s.at, k) for k in range(3)] for s in scene.supports}
    everything = {at: supports.unknowns(cloth.domain, cloth.space, at) for at in held}
    u = cloth.displacement()
    fields = results.Fields(out / "fields.bp", u, ("value",))
    frames = Frames(out / "frames", scene.title, "t = {:.4g} s" if scene.dynamic else "load {:.4g}", scene.view, comm)
    with results.Table(out / "history.csv", comm) as table, guard or nullcontext():
        for step in steps:
            u, strain = cloth.displacement(), cloth.cell_strain()[:, :3]
            row = {"time_s" if scene.dynamic else "load_part": step.load}
            for probe in scene.probes:
                mean = supports.mean(cloth.domain, cloth.space, cloth.q, probe.at, probe.axis)
                row[f"{probe.name}_{AXES[probe.axis]}_m"] = mean
            for at, unknowns in held.items():
                row |= {f"{at}_{AXES[k]}_N": solver.reaction(unknowns[k]) for k in range(3)}
                moment = solver.reaction_moment(everything[at])
                row |= {f"{at}_{AXES[k]}_Nm": moment[k] for k in range(3)}
            row |= {"newton_iterations": step.newton_iterations, "step_cuts": step.step_cuts}
            row |= ledger.row() if ledger else {}
            table.row(**row, wall_s=step.wall_s)
            fields.write(step.load, value=coloured(strain, scene.colour))
            frames.add(step.load, u, strain, cloth.yarns())
    fields.close()
    if comm.rank == 0:
        series = Series(out / "frames")
        series.picture(out / "deformed.png", -1, scene.colour)
        if scene.animation:
            series.animation(out / "animation.gif", scene.colour)
    comm.Barrier()
    return table


def _start(built: Built, progress: bool) -> tuple[Iterator[Step], Any, Ledger | None, Any]:
    """The steps to come, the solver that tells reactions, and of a motion its ledger and itself."""
    scene, name = built.scene, built.scene.title if progress else None
    if scene.dynamic:
        motion, ledger = built.cloth.newmark(
            built.areal_mass, built.bcs, built.loads, scene.rho, scene.damping, set_load=built.set_load
        )
        return motion.march(scene.end, scene.step, scene.smallest, name), motion.solver, ledger, motion
    solver, parts, last = built.cloth.equilibrium(built.bcs, built.loads), [], 0.0
    for turn in scene.turns:
        parts += [*np.linspace(last, turn, scene.steps + 1)[1:]]
        last = turn
    return statics.march(solver, built.set_load, parts, smallest=scene.smallest, progress=name), solver, None, None
