"""Reads a scene file; every entry is checked, and a fault is one sentence that names the key and what to do.

Every key, with its default where it has one:

    title = "a sheet hangs by its corners"      # of the pictures

    [mesh]
    file = "drape.geo"                          # beside this file, or one of the package's; as `meshing.read` takes it
    numbers = { side = 1.0, n = 12 }            # of a .geo
    orient = false                              # turn cells so that neighbours face the same side
    scale = 1.0                                 # metres to a unit of the file: 0.001 for millimetres
    merge = 1e-6                                # m; points on free edges that are nearer are one; none if left out
    triangulate = false                         # cut all cells into triangles
                                                # or a sewing pattern (`garments.patterns`): file = "skirt.toml", or a
                                                # .json of GarmentCode; its groups are "panel", "panel.edge" and names
    # cell_m = 0.02                             # of seams, the warp lies along the grain. cell_m: size of its cells;
    # worn = "out/dress/worn.npz"               # worn: where it starts, as a scene with [dressing] has left it, else
                                                # where the pattern places or rolls its panels

    [sheet]
    fabric = "blend"                            # a name, or a TOML file beside this one
    law = "potential"                           # continuous, printed, svk (linear, the fabric's first moduli)
    poisson = "measured"                        # lowered
    shear_hysteresis = true
    warp = [1, 0, 0]                            # a direction; or one for each group: { sleeve = [0, 0, 1] }
    kinematics = "shell"                        # membrane
    element = "mitc4"                           # see `directors.ELEMENTS`
    bending = "layers"                          # as the law does at so many heights; "own", the default without layers:
    layers = 3                                  # as the fabric's [bending] has it, else assumed, which is said

    # [[sheet.material]]                        # or several, each with all of [sheet] but kinematics and element, and
    # at = "lining"                             # on a group of cells; all groups together are the sheet. Of a pattern
                                                # at: the material of its panels, or else their names
    # [[sheet.material.ply]]                    # from the first side of the sheet on, instead of a material's fabric
    # fabric = "muslin"
    # angle_deg = 45                            # of its warp, from that of the material

    [[support]]                                 # as many as are needed
    at = "corners"                              # a named group of the mesh
    kind = "lead"                               # hinge; clamp; symmetry: axis; grip: shift_m, turn_deg, about_m;
                                                # rigid: in itself only, it moves as one under its loads
    axis = "z"
    shift_m = 0.1                               # of a grip three numbers
    path = [[0, 0], [1, 1]]                     # how much of the move, over the load part (statics) or the time in s

    [[load]]
    kind = "gravity"                            # pressure, along the normal: pressure_Pa; surface: force_N_per_m2;
    acceleration_m_per_s2 = [0, 0, -9.81]       # edge: force_N_per_m; moment, of an edge too: moment_N_m_per_m; point:
                                                # force_N; `at`: only these three need it
    path = [[0, 1]]                             # how much of it, as above; in statics [[0, 0], [1, 1]]

    [[body]]                                    # what the sheet may touch, as many as are needed; or [contact] alone
    name = "ball"                               # columns ball_x_N, ball_x_Nm, ...: of the sheet on it, about the origin
    kind = "sphere"                             # plane: normal, point_m, size_m (as it is drawn), the space behind it;
    radius_m = 0.3                              # cylinder, capsule: radius_m, length_m (of a capsule without its ends),
    centre_m = [1, 1, -0.4]                     # centre_m, axis; ring: radius_m, wire_m, centre_m, axis; box: size_m,
                                                # centre_m, orientation_deg; surface: file, numbers, scale, merge, as of
    cells = 12                                  # [mesh]. cells: along a quarter of round
    shift_m = [0, 0, 0.1]                       # ones, along a side of a box. It stays, or is led: shift_m, turn_deg,
    path = [[0, 0], [1, 1]]                     # about_m, path as of a grip; a plane is not turned, a box can be
                                                # frames, a body that deforms: frames, an .npz of arrays frames (frames,
                                                # corners, 3), faces and times (s), or a folder of .obj or .ply with
                                                # rate_per_s; scale; path: how much of its time, else the motion's
    # mass_kg = 0.5                             # instead of a move, in [dynamics]: it moves freely, with this mass and
    # inertia_kg_m2 = "solid"                   # under gravity on the whole sheet; three moments about its middle, or
    # velocity_m_per_s = [0, 0, -2]             # of a filled body; without, it turns not; spin_rad_per_s. It touches
                                                # the sheet alone, no other body

    [contact]                                   # may be left out where there is a body
    friction = 0.0                              # coefficient of sliding, or two: [0.3, 0.2], along warp and weft;
    static_friction = 0.0                       # of sticking, by default the same
    itself = true                               # whether the sheet touches itself; else it goes through itself
    offset_m = 0.5e-3                           # always stays between surfaces; the largest thickness if left out
    reach_m = 2.5e-3                            # beyond it surfaces push; five thicknesses, at most a tenth of an edge
    stiffness_Pa = 1e3                          # pressure at about half the reach; what stops the sheet or a free body
                                                # after a fall over the sheet's size, if left out
    slip_m_per_s = 1e-3                         # from which on all of the friction acts
    creep_m = 2e-5                              # the way in a step that stands for it in statics

    [statics]                                   # or [dynamics], or [dressing]
    turns = [1]                                 # load parts to go to; [1, 0] loads and takes the load away
    steps = 10                                  # to each
    smallest = 0.015625                         # part of a step below which it is not cut any more

    [dynamics]
    end_s = 0.5
    step_ms = 5.0
    method = "implicit"                         # or explicit: many short steps in each, which solve nothing
    rho = 0.8
    damping_per_s = 0.0

    [dressing]                                  # or instead, of a pattern: until it is at rest around the bodies, as
    time_s = 0.4                                # they are at the start, without loads; it leaves worn.npz in its folder
    step_ms = 20.0

    [[probe]]
    name = "centre"                             # a column centre_z_m in history.csv: mean displacement of a group
    at = "centre"
    axis = "z"

    [output]
    colour = "yarn"                             # the strain in pictures: warp, weft, shear, or the larger yarn strain;
                                                # or the pressure of contact
    view = [1, -2, 1.2]                         # from the sheet to the eye
    animation = false
    checkpoint_s = 60                           # seconds of the clock between two checkpoints, for --resume
"""

from dataclasses import dataclass
from pathlib import Path

from .. import entries
from ..entries import Table
from ..material import Kinematics
from ..output.pictures import VIEW
from ..output.series import LABELS, Colour
from ..shell.directors import ELEMENTS
from . import shipped, support_reading
from .bodies import Options, Solid, contact, solids
from .sheet_reading import Entry, Vector, materials
from .support_reading import AXES, Load, Support

PATTERNS = (".toml", ".json")
"""Endings of sewing patterns."""
HOW = {
    "statics": ("", "turns steps smallest"),
    "dynamics": ("end_s", "step_ms method rho damping_per_s"),
    "dressing": ("", "time_s step_ms"),
}
"""What a scene goes through -> keys that it needs, and those that it may have."""


@dataclass(frozen=True)
class Probe:
    """A mean displacement to be kept."""

    name: str
    at: str
    axis: int


@dataclass(frozen=True)
class Scene:
    """What the file says, in SI units; paths are found from the file's place."""

    file: str
    title: str
    mesh: Path
    numbers: dict[str, float]
    orient: bool
    scale: float
    merge: float | None
    triangulate: bool
    trust: bool
    cell: float | None
    worn: Path | None
    materials: tuple[Entry, ...]
    kinematics: Kinematics
    element: str | None
    supports: tuple[Support, ...]
    loads: tuple[Load, ...]
    probes: tuple[Probe, ...]
    bodies: tuple[Solid, ...]
    contact: Options | None
    dressing: bool
    dynamic: bool
    turns: Vector
    steps: int
    smallest: float
    end: float
    step: float
    method: str
    rho: float
    damping: float
    colour: Colour
    view: tuple[float, float, float]
    animation: bool
    checkpoint: float


def read(path: str | Path, *, trust: bool = False) -> Scene:
    """Read a scene file, or one of `shipped.names()`; trust: whether its mesh may run programs.

    Raises InputError for a fault, which it names.
    """
    path = shipped.scene(path)
    file = entries.read(path, "a scene file", "the example of 'fabric-fenicsx run --keys'")
    needed = "mesh sheet" if "body" in file.entries else "mesh sheet support"
    file.expect(needed, "title support load body contact statics dynamics dressing probe output")
    mesh, sheet = file.table("mesh"), file.table("sheet")
    made, sewn = materials(sheet, path.parent), Path(mesh.text("file")).suffix.lower() in PATTERNS
    mesh.expect("file cell_m" if sewn else "file", "worn" if sewn else "numbers orient scale merge triangulate")
    numbers = mesh.table("numbers") if "numbers" in mesh.entries else Table(file.file, "mesh.numbers.", {})
    which = [key for key in HOW if key in file.entries]
    if len(which) != 1:
        there = " and ".join(which) or "none"
        file.refuse(
            f"{', '.join(HOW)}:", f"a scene has one of them, not {there}", "keep [statics] or [dynamics] or [dressing]"
        )
    how, dynamic, dressing = file.table(which[0]), which == ["dynamics"], which == ["dressing"]
    how.expect(*HOW[which[0]])
    if dressing:
        _may_dress(file, sewn)
    end, rho, damping = how.positive("end_s", 1.0), how.real("rho", 0.8), how.real("damping_per_s", 0.0)
    end = how.positive("time_s", 0.4) if dressing else end
    if not 0.0 <= rho <= 1.0:
        how.refuse("rho", "is not from 0 to 1", "take 0.8, or 1 for no dissipation by the scheme")
    smallest = how.positive("smallest", 1 / 64)
    if smallest > 1.0:
        how.refuse("smallest", "is more than a whole step", "give the part of a step below which none is cut, up to 1")
    if damping < 0.0:
        how.refuse("damping_per_s", "is negative", "give 0 or more")
    supports = tuple(support_reading.support(table, dynamic, end) for table in file.tables("support"))
    _once(
        file.tables("support"),
        [[(s.at, axis) for axis in support_reading.axes(s)] for s in supports],
        "is held along {1} already",
    )
    probes = tuple(_probe(table) for table in file.tables("probe"))
    _once(file.tables("probe"), [[(p.name, AXES[p.axis])] for p in probes], "names another probe along {1}", "name")
    bodies = solids(file, path.parent, dynamic, end, trust)
    _once(file.tables("body"), [[(body.name, "")] for body in bodies], "names another body", "name")
    for table, body in zip(file.tables("body"), bodies, strict=True):
        if body.name in {support.at for support in supports}:
            table.refuse("name", "is also a place of a support, and both have columns in the history", "change it")
    output = file.table("output") if "output" in file.entries else Table(file.file, "output.", {})
    output.expect("", "colour view animation checkpoint_s")
    colour, touches = output.choice("colour", tuple(LABELS)), contact(file)
    if colour == "pressure" and touches is None:
        output.refuse("colour", "is of contact, and there is none", "add a [[body]], or choose a strain")
    checkpoint = output.real("checkpoint_s", 60.0)
    if checkpoint < 0.0:
        output.refuse("checkpoint_s", "is negative", "give the seconds between two checkpoints, 0 for one a step")
    element = sheet.choice("element", tuple(ELEMENTS)) if "element" in sheet.entries else None
    view = output.numbers("view", 3) if "view" in output.entries else VIEW
    if not any(view):
        output.refuse("view", "is no direction", "write it as [1, -2, 1.2]")
    return Scene(
        file=file.file,
        title=file.text("title") if "title" in file.entries else path.stem,
        mesh=shipped.mesh(path.parent, mesh.text("file")),
        numbers={key: numbers.number(key, value) for key, value in numbers.entries.items()},
        orient=mesh.yes("orient"),
        scale=mesh.positive("scale", 1.0),
        merge=mesh.positive("merge") if "merge" in mesh.entries else None,
        triangulate=mesh.yes("triangulate"),
        trust=trust,
        cell=mesh.positive("cell_m") if sewn else None,
        worn=path.parent / mesh.text("worn") if "worn" in mesh.entries else None,
        materials=made,
        kinematics=sheet.choice("kinematics", ("shell", "membrane")),
        element=element,
        supports=supports,
        loads=tuple(support_reading.load(table, dynamic) for table in file.tables("load")),
        probes=probes,
        bodies=bodies,
        contact=touches,
        dressing=dressing,
        dynamic=dynamic,
        turns=how.numbers("turns") if "turns" in how.entries else (1.0,),
        steps=how.count("steps", 10),
        smallest=smallest,
        end=end,
        step=how.positive("step_ms", 20.0 if dressing else 5.0) * 1e-3,
        method=how.choice("method", ("implicit", "explicit")),
        rho=rho,
        damping=damping,
        colour=colour,
        view=(view[0], view[1], view[2]),
        animation=output.yes("animation"),
        checkpoint=checkpoint,
    )


def _may_dress(file: Table, sewn: bool) -> None:
    """Refuse what cannot be dressed."""
    if not sewn:
        file.refuse("dressing", "is of a sewing pattern", "name one as the file of [mesh], or keep [statics]")
    if "load" in file.entries:
        file.refuse("load", "does not go with dressing, which ends at rest without it", "leave it out")
    if "body" not in file.entries:
        file.refuse("dressing", "has nothing to be dressed", "add a [[body]]")
    for table in file.tables("body"):
        if "mass_kg" in table.entries:
            table.refuse("mass_kg", "lets a body move freely, which takes time", "leave it out while it is dressed")


def _once(tables: list[Table], claims: list[list[tuple[str, str]]], reason: str, key: str = "at") -> None:
    """Refuse a table that claims what one before it has claimed: a place and an axis, say."""
    before: set[tuple[str, str]] = set()
    for table, own in zip(tables, claims, strict=True):
        for claim in own:
            if claim in before:
                table.refuse(key, reason.format(*claim), "leave one of the two out, or change it")
        before.update(own)


def _probe(table: Table) -> Probe:
    table.expect("name at axis")
    return Probe(table.text("name"), table.text("at"), AXES.index(table.choice("axis", AXES)))
