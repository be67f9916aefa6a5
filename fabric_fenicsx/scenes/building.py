"""From what a scene file says to the sheet, its supports and its loads."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from ufl.core.expr import Expr
from ufl.form import Form

from .. import fabrics
from ..errors import InputError
from ..laws import named
from ..laws.bending import Bending
from ..laws.lay_up import LayUp, Ply
from ..material import Material
from ..sheet import Loads, Sheet
from ..shell.directors import ELEMENTS
from ..surfaces import meshing, yarns
from ..terms import supports, weakform
from .bodies import led, touching
from .reading import Scene
from .sheet_reading import Entry
from .support_reading import Load, Support

if TYPE_CHECKING:
    from ..contact.contact import Contact
    from ..garments.sewing import Garment


@dataclass
class Built:
    """A scene that is ready to be solved: add your own terms to `loads`, or conditions to `bcs`."""

    scene: Scene
    fabrics: dict[str, fabrics.Fabric]
    """Of each material; the plies of a lay-up have their numbers."""
    cloth: Sheet
    bcs: list[fem.DirichletBC]
    loads: Form | int
    set_load: Callable[[float], None]
    """Puts a load part (statics) or a time in s (dynamics) into supports, loads and bodies."""
    touch: Contact | None = None
    """Contact with bodies and of the sheet with itself, where the scene has it."""

    @property
    def areal_mass(self) -> Expr | float:
        """kg/m2."""
        return self.cloth.areal_mass

    @property
    def acting(self) -> Loads:
        """For a solver: the loads and the terms of contact."""
        if self.touch is None:
            return self.loads
        return [*([] if isinstance(self.loads, int) else [self.loads]), *self.touch.terms]


def build(scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD) -> Built:
    """Read mesh and fabric, and make the sheet. Raises InputError, on every rank, for what does not fit together."""
    garment = None if scene.cell is None else _sewn(scene, scene.cell, comm)
    if garment is not None:
        domain = garment.domain
    else:
        domain = meshing.read(
            scene.mesh,
            comm,
            orient=scene.orient,
            scale=scene.scale,
            merge=scene.merge,
            triangulate=scene.triangulate,
            trust=scene.trust,
            numbers=scene.numbers,
        )
    if domain.pieces > 1 and comm.rank == 0:
        warnings.warn(
            f"The sheet of {scene.mesh.name} is of {domain.pieces} pieces, which no edge joins.", stacklevel=2
        )
    known: dict[str, fabrics.Fabric] = {}
    made = {entry.at: _material(entry, domain, known) for entry in scene.materials}
    cloth = _sheet(scene, domain, made, garment)
    bcs, moves = [], []
    for support in scene.supports:
        conditions, move = _hold(cloth, support)
        bcs += conditions
        moves.append((support.path, move))
    loads: Form | int = 0
    for load in scene.loads:
        whole = np.array(load.value) if len(load.value) > 1 else load.value[0]
        value = fem.Constant(domain.mesh, whole)
        loads += _work(cloth, load, value)
        moves.append((load.path, _setter(value, whole)))
    for probe in scene.probes:
        domain.dims(probe.at)
    solids = [led(solid) for solid in scene.bodies]
    moves += [(solid.path, move) for solid, (_, move) in zip(scene.bodies, solids, strict=True)]

    weights = [load for load in scene.loads if load.kind == "gravity" and not load.at]
    touch: Contact | None = None

    def set_load(t: float) -> None:
        for path, move in moves:
            move(share(path, t, smooth=scene.dynamic))
        if touch is not None and touch.free is not None:
            parts = [share(load.path, t, smooth=scene.dynamic) * np.array(load.value) for load in weights]
            touch.free.gravity[:] = np.sum(parts, axis=0)

    set_load(0.0)
    # dressing has an energy, and friction none
    smooth = None if scene.contact is None else scene.contact | {"friction": 0.0, "static": 0.0}
    touch = touching(cloth, [body for body, _ in solids], smooth if scene.dressing else scene.contact)
    set_load(0.0)
    return Built(scene, known, cloth, bcs, loads, set_load, touch)


def _sewn(scene: Scene, cell: float, comm: MPI.Comm) -> Garment:
    """The garment of a pattern, with cells of the kind that the element needs."""
    from ..garments import patterns, sewing

    pattern = patterns.read(scene.mesh)
    kind = ELEMENTS[scene.element or "mitc4"][0]
    return sewing.sew(pattern.panels, pattern.seams, cell=cell, comm=comm, kind=kind)  # type: ignore[arg-type]


def _sheet(scene: Scene, domain: meshing.Domain, made: dict[str, Material], garment: Garment | None) -> Sheet:
    """Of these materials; of a garment they are those of its panels, and it may be worn."""
    options: dict[str, Any] = {"kinematics": scene.kinematics, "element": scene.element}
    if garment is None:
        return Sheet(domain, made, **options)
    known = {panel.material or panel.name for panel in garment.panels}
    for at in made.keys() - known - {""}:
        raise InputError(f"No panel is of the material {at!r}; those of the pattern are {', '.join(sorted(known))}.")
    if any(entry.warp != (1.0, 0.0, 0.0) for entry in scene.materials):
        raise InputError("The warp of a panel lies along its grain line: leave warp out, and tell grain_deg there.")
    of = made.get("", made)
    if scene.worn is None:
        return garment.sheet(of, **options)
    from ..garments import dressing

    return dressing.worn(scene.worn, garment, of, **options)


def _material(entry: Entry, domain: meshing.Domain, known: dict[str, fabrics.Fabric]) -> Material:
    """Of an entry, and its fabrics into `known`; what is assumed is said."""
    warp = entry.warp if isinstance(entry.warp, tuple) else yarns.patches(domain, entry.warp)
    if not entry.plies:
        fabric = known[entry.at] = fabrics.load(entry.fabric)
        material = Material.of(
            fabric,
            law=entry.law,
            poisson=entry.poisson,
            shear_hysteresis=entry.shear_hysteresis,
            bending=entry.bending,
            layers=entry.layers,
            warp=warp,
        )
        if isinstance(material.bending, Bending) and domain.mesh.comm.rank == 0:
            for what, why in material.bending.curves.assumed.items():
                warnings.warn(f"{fabric.name}: {what} is assumed: {why}", stacklevel=3)
        return material
    own = [fabrics.load(ply.fabric) for ply in entry.plies]
    known.update({f"{entry.at}, ply {k}": fabric for k, fabric in enumerate(own, 1)})
    laws = [named.law(entry.law, fabric, entry.poisson, entry.shear_hysteresis) for fabric in own]
    parts = zip(laws, own, entry.plies, strict=True)
    plies = [Ply(law, fabric.thickness, ply.angle, entry.layers or 2) for law, fabric, ply in parts]
    thickness = np.array([fabric.thickness for fabric in own])
    # one after the other, plies give way across as springs do
    G = float(thickness.sum() / (thickness / [fabric.shear.modulus[0] for fabric in own]).sum())
    mass = sum(fabric.areal_mass for fabric in own)
    return Material(section=LayUp(plies), shear=(G, G), warp=warp, areal_mass=mass)


def share(path: Sequence[tuple[float, float]], t: float, smooth: bool) -> float:
    """How much of a load or move there is at t: straight from point to point, or by half a cosine, without a jerk.

    Without a path, t itself.
    """
    if not path:
        return t
    times, shares = np.array(path).T
    k = int(np.clip(np.searchsorted(times, t, side="right") - 1, 0, max(len(times) - 2, 0)))
    if len(times) == 1:
        return float(shares[0])
    part = (t - times[k]) / (times[k + 1] - times[k])
    if smooth:
        part = 0.5 - 0.5 * np.cos(np.pi * np.clip(part, 0.0, 1.0))
    elif len(times) > 2:
        part = np.clip(part, 0.0, 1.0)
    return float(shares[k] + part * (shares[k + 1] - shares[k]))


def _setter(constant: fem.Constant, whole: np.ndarray | float) -> Callable[[float], None]:
    def put(part: float) -> None:
        constant.value = part * whole

    return put


def _hold(cloth: Sheet, support: Support) -> tuple[list[fem.DirichletBC], Callable[[float], None]]:
    """Conditions of a support, and what puts a share of its move into them."""
    domain, space, at = cloth.domain, cloth.space, support.at

    def rest(part: float) -> None:
        pass

    if support.kind == "hinge":
        return supports.hinge(domain, space, at), rest
    if support.kind == "clamp":
        return supports.clamp(domain, space, at), rest
    if support.kind == "symmetry":
        return supports.symmetry(domain, space, at, support.axis), rest
    if support.kind == "lead":
        value = fem.Constant(domain.mesh, 0.0)
        return supports.lead(domain, space, at, support.axis, value), _setter(value, support.shift[0])
    if cloth.shell is None:
        raise InputError(
            f"The support at {at!r} is {support.kind}, which needs kinematics = 'shell'; a membrane can be led."
        )
    if support.kind == "rigid":
        supports.rigid(domain, cloth.shell, at)
        return [], rest
    conditions, move = supports.grip(domain, cloth.shell, at)
    shift, turn = np.array(support.shift), np.array(support.turn)
    return conditions, lambda part: move(part * shift, part * turn, support.about)


def _work(cloth: Sheet, load: Load, value: fem.Constant) -> Form:
    """Virtual work of a load."""
    needed = {"point": (0, "points"), "edge": (1, "edges"), "moment": (1, "edges")}.get(load.kind, (2, "cells"))
    dx = cloth.dx
    if load.at:
        if needed[0] not in cloth.domain.dims(load.at):
            raise InputError(f"The load {load.kind!r} at {load.at!r} needs a group of {needed[1]}; name one.")
        dx = supports.over(cloth.domain, load.at, degree=1 if load.kind == "moment" else 2, dim=needed[0])
    if load.kind == "gravity":
        return weakform.gravity(cloth.areal_mass, value, cloth.v, dx)
    if load.kind == "pressure":
        return weakform.pressure(value, cloth.u, cloth.v, dx)
    if load.kind == "surface":
        return weakform.surface_traction(value, cloth.v, dx)
    if load.kind == "moment":
        if cloth.shell is None:
            raise InputError(f"The moment at {load.at!r} needs kinematics = 'shell'; a membrane feels none.")
        turning = weakform.drilling_moment(value, cloth.u, cloth.v, cloth.director, cloth.delta, dx)
        return weakform.edge_moment(value, cloth.director, cloth.delta, dx) + turning
    return ufl.inner(value, cloth.v) * dx
