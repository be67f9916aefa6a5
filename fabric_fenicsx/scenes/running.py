"""Goes through the loads or the time of a scene, and writes what it finds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..output import results
from ..output.recording import Recorder
from ..solvers.continuation import Step
from ..solvers.marching import March
from ..terms import supports
from .building import Built, build
from .marks import marks
from .reading import Scene
from .support_reading import AXES

if TYPE_CHECKING:
    from ..garments.dressing import Dressing


def run(scene: Scene, out: Path, progress: bool = True, resume: Path | bool | None = None) -> results.Table:
    """Run a scene to its end; its history, which is also in the folder.

    The folder gets what `recording.Recorder` writes, with animation.gif where the scene asks for it; of a garment that
    is dressed, worn.npz, see `garments.dressing`. Raises InputError and StepFailed, on every rank. resume: as there.
    """
    built = build(scene)
    cloth = built.cloth
    dress = _dressing(built) if scene.dressing else None
    if dress is not None:
        steps, solver, going = dress.march(scene.step, progress=scene.title if progress else None), dress.solver, None
    else:
        steps, solver, going = _start(built, progress)
    timed = scene.dynamic or scene.dressing
    names = [support.at for support in scene.supports if support.kind != "rigid"]
    held = {at: [supports.unknowns(cloth.domain, cloth.space, at, k) for k in range(3)] for at in names}
    everything = {at: supports.unknowns(cloth.domain, cloth.space, at) for at in held}

    def probes(step: Step) -> dict[str, float]:
        row = {"time_s": step.load} if timed else {"step": step.number, "load_part": step.load}
        for probe in scene.probes:
            mean = supports.mean(cloth.domain, cloth.space, cloth.q, probe.at, probe.axis)
            row[f"{probe.name}_{AXES[probe.axis]}_m"] = mean
        for at, unknowns in held.items():
            row |= {f"{at}_{AXES[k]}_N": solver.reaction(unknowns[k]) for k in range(3)}
            moment = solver.reaction_moment(everything[at])
            row |= {f"{at}_{AXES[k]}_Nm": moment[k] for k in range(3)}
        return row

    with Recorder(
        cloth, out, probes, title=scene.title, when=_time if timed else _load, colour=scene.colour,
        view=scene.view, run=going, touch=built.touch, marks=marks(built), resume=resume, film=scene.animation,
        save_s=scene.checkpoint,
    ) as record:  # fmt: skip
        ended = going is not None and (going.time >= scene.end * (1 - 1e-12) if scene.dynamic else going.ended)
        for step in () if ended and record.table.rows else steps:
            record(step)
    if dress is not None:
        dress.save(out / "worn.npz")
    return record.table


def _time(step: Step) -> str:
    return f"t = {step.load:.4g} s"


def _load(step: Step) -> str:
    return f"load {step.load:.4g}"


def _dressing(built: Built) -> Dressing:
    """What dresses the garment of a scene."""
    from ..garments.dressing import Dressing

    return Dressing(built.cloth, built.acting, built.bcs, time=built.scene.end)


def _start(built: Built, progress: bool) -> tuple[Iterator[Step], Any, Any]:
    """The steps to come, the solver that tells reactions, and what a checkpoint keeps of them."""
    scene, name = built.scene, built.scene.title if progress else None
    if scene.dynamic:
        same: dict[str, Any] = {"damping": scene.damping, "set_load": built.set_load}
        if scene.method == "explicit":
            fast, _ = built.cloth.explicit(built.areal_mass, built.bcs, built.acting, **same)
            return fast.march(scene.end, scene.step, progress=name), fast, fast
        motion, _ = built.cloth.newmark(built.areal_mass, built.bcs, built.acting, rho=scene.rho, **same)
        return motion.march(scene.end, scene.step, scene.smallest, name), motion.solver, motion
    solver, parts, last = built.cloth.equilibrium(built.bcs, built.acting), [], 0.0
    for turn in scene.turns:
        parts += [*np.linspace(last, turn, scene.steps + 1)[1:]]
        last = turn
    march = March(solver, built.set_load, parts, smallest=scene.smallest, progress=name)
    return march.steps(), solver, march
