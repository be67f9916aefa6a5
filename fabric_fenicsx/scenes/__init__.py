"""A scene as data: a TOML file that says which sheet, how it is held and loaded, and what to keep of it.

    scene = read("demos/scenes/hanging.toml")
    run(scene, results.folder("out/hanging"))

The keys, with their defaults, are told in `fabric_fenicsx.scenes.reading`, and `fabric-fenicsx run --keys` prints
them; `building` makes the sheet and its solver, and `running` goes through the loads or the time and writes what
`fabric-fenicsx view` draws. What a file cannot say (a load, a law or a term of your own) takes a script: see
`demos/my_load.py` and its neighbours, and start from `build(scene)`.
"""

from .building import Built, build
from .reading import Scene, read
from .running import run

__all__ = ["Built", "Scene", "build", "read", "run"]
