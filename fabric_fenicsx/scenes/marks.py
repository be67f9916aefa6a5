"""All that the answer of a scene depends on, by name: what a checkpoint must have been made with."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from dolfinx import mesh

from ..surfaces.meshing import Domain
from .building import Built

FREE = {
    "file",
    "title",
    "mesh",
    "numbers",
    "scale",
    "merge",
    "triangulate",
    "trust",
    "materials",
    "supports",
    "loads",
    "probes",
    "bodies",
    "contact",
}
FREE |= {"turns", "steps", "smallest", "end", "step", "colour", "view", "animation", "checkpoint"}
"""What a scene may say otherwise when it is gone on with, or is looked at in another way."""
WORDS = ("name", "label", "material", "weave", "sources", "transverse_source")
"""Of a fabric, what is no number."""


def marks(built: Built) -> dict[str, str]:
    """Of a scene: its sheet, every number of its fabric, supports, loads, and the groups where they are.

    Not in it: the mesh, which a checkpoint looks at itself; where the run ends and in what steps; what is shown.
    To be called on every rank.
    """
    scene = built.scene
    named: dict[str, Any] = {f.name: getattr(scene, f.name) for f in fields(scene) if f.name not in FREE}
    for i, support in enumerate(scene.supports, 1):
        moves = any((*support.shift, *support.turn))
        named[f"support[{i}]"] = support if moves else replace(support, path=())  # which by default goes to the end
    named |= {f"load[{i}]": load for i, load in enumerate(scene.loads, 1)}
    named |= _touching(built)
    groups = {support.at for support in scene.supports} | {load.at for load in scene.loads if load.at}
    for entry in scene.materials:
        of = f"material {entry.at!r}." if entry.at else ""
        said = ("at", "fabric", "plies")
        named |= {f"{of}{f.name}": getattr(entry, f.name) for f in fields(entry) if f.name not in said}
        named |= {f"{of}ply[{k}].angle": ply.angle for k, ply in enumerate(entry.plies, 1)}
        groups |= {entry.at} - {""} | (set(entry.warp) if isinstance(entry.warp, Mapping) else set())
    for at, fabric in built.fabrics.items():
        of = f"fabric of {at}." if at else "fabric."
        named |= {f"{of}{f.name}": getattr(fabric, f.name) for f in fields(fabric) if f.name not in WORDS}
    named |= {
        f"group {name!r}": group(built.cloth.domain, name)
        for name in sorted(groups)
        if name in built.cloth.domain.names
    }
    return {name: str(value) for key, part in named.items() for name, value in _leaves(key, part)}


def _touching(built: Built) -> dict[str, Any]:
    """Of bodies and contact; of what comes from a file it is the triangles that count, and where they are."""
    named: dict[str, Any] = {}
    if built.touch is not None:
        named["contact"] = built.scene.contact
        for i, (said, body) in enumerate(zip(built.scene.bodies, built.touch.bodies, strict=True), 1):
            if said.kind in ("surface", "frames"):
                places = [getattr(body, "frames", body.rest), getattr(body, "times", np.zeros(0))]
                content = b"".join((np.round(x, 9) + 0.0).tobytes() for x in places) + body.faces.tobytes()
                digest = hashlib.sha256(content).hexdigest()[:8]
                said = replace(said, options={"corners": f"of {len(body.rest)} ({digest})"})
            moves = any((*said.shift, *said.turn)) or said.kind == "frames"
            named[f"body[{i}]"] = said if moves else replace(said, path=())
    return named


def group(domain: Domain, name: str) -> str:
    """Which nodes of the mesh's own file a group has: its size and a digest, the same on any number of ranks."""
    surface, every = domain.mesh, set[tuple[int, ...]]()
    for dim in domain.dims(name):
        _, entities = domain.entities(name, dim)
        surface.topology.create_connectivity(dim, surface.topology.dim)
        nodes = mesh.entities_to_geometry(surface, dim, np.asarray(entities, dtype=np.int32))
        own = np.sort(surface.geometry.input_global_indices[nodes], axis=1) if len(entities) else np.empty((0, 1), int)
        every |= {tuple(row) for rows in surface.comm.allgather(own.tolist()) for row in rows}
    return f"of {len(every)} ({hashlib.sha256(repr(sorted(every)).encode()).hexdigest()[:8]})"


def _leaves(name: str, part: Any) -> Iterator[tuple[str, Any]]:
    """Every number and word in a part, with its name."""
    if is_dataclass(part):
        part = {field.name: getattr(part, field.name) for field in fields(part)}
    if isinstance(part, Mapping):
        for key, value in part.items():
            yield from _leaves(f"{name}.{key}", value)
    else:
        yield name, part
