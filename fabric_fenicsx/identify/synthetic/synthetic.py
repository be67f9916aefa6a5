"""Synthetic records of a known fabric, with seeded noise, to try the identification on: not measured, and marked so.

The warp, weft and bias tests of section 3.3 at a material point: uniaxial stress, so that the strip is homogeneous,
as the thesis takes it to be in the middle. Load to the displacement of Table 3.4, unload until the force is gone. A
fabric with bending has its bending tests besides (`synthetic_bending`).
"""

from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...fabrics import Fabric
from ...laws import Array, driver
from ...laws.stability import rotate_strain
from ...laws.woven import Woven
from . import synthetic_bending

RATE = 0.003  # nominal strain per second (3.3.2)
PER_SECOND = 25.0  # readings
PHOTOGRAPHS = 40  # of the dots, while the strip is loaded, and 5 at rest
ANGLES = {"warp": 0.0, "weft": 90.0, "bias": 45.0}


def write(fabric: Fabric, folder: str | Path, specimens: int = 3, *, noise: float = 0.02, seed: int = 2010) -> Path:
    """Write the records of all tests and the list of them, `tests.toml`, whose path is returned.

    `noise` is the standard deviation, over the largest value of a test, of the noise on the force, on the shear angle
    and on the change of the distance between neighbouring dots. The displacement, which the machine prescribes,
    has 0.01 mm.
    """
    folder, rng = Path(folder), np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    word = f"# SYNTHETIC: {fabric.name} by the law of fabric_fenicsx, {noise:.0%} noise, seed {seed}; not measured.\n"
    files: dict[str, list[str]] = {}
    for way in ANGLES:
        ideal = _test(fabric, way)
        for k in range(1, specimens + 1):
            _record(folder / f"{way}_{k}.csv", word, ideal, noise, rng)
            files.setdefault(way, []).append(f"{way}_{k}.csv")
            if way != "bias":
                _dots(folder / f"{way}_{k}_dots.csv", word, ideal, noise, rng)
                files.setdefault(f"{way}_dots", []).append(f"{way}_{k}_dots.csv")
    bent = synthetic_bending.write(fabric, folder, specimens, noise, rng, word) if fabric.bending else ""
    listed = "\n".join(f"{key} = {names}".replace("'", '"') for key, names in files.items())
    (folder / "tests.toml").write_text(
        f'{word}name = "{fabric.name} again"\nlabel = "{fabric.label}"\nmaterial = "{fabric.material}"\n'
        f'weave = "{fabric.weave}"\nthickness_mm = {1e3 * fabric.thickness:g}\ndensity_kg_per_m3 = {fabric.density:g}\n'
        f"gauge_length_mm = {1e3 * fabric.gauge_length:g}\nwidth_mm = {1e3 * fabric.width:g}\n"
        f'source = "synthetic records of {fabric.name}, {noise:.0%} noise, seed {seed}"\n\n[records]\n{listed}\n\n'
        + bent,
        encoding="utf-8",
    )
    return folder / "tests.toml"


def _test(fabric: Fabric, way: str) -> dict[str, Array]:
    """The test without noise, by name (n,): time, displacement, force; strains along and across; yarns in bias."""
    reach = fabric.displacement[way] / fabric.gauge_length
    top, angle = reach + reach**2 / 2, np.radians(ANGLES[way])
    curve = {"warp": fabric.warp, "weft": fabric.weft, "bias": fabric.shear}[way]
    # far enough to lose all stress: linear in the unloading modulus, and the ramps of the law
    back = float(curve.stress(2 * top if way == "bias" else top)) / curve.unloading / (2 if way == "bias" else 1)
    down = top - np.linspace(0, min(2.0 * back + 0.01, top), 161)[1:]
    path = np.concatenate([np.linspace(0, top, 121)[1:], down])
    result = driver.uniaxial(Woven(fabric), path, angle=angle)
    axial, stress = np.concatenate([[0], path]), np.concatenate([[0], result.stress[:, 0]])
    inner = np.vstack([np.zeros(3), result.strain])
    E1, E2, gamma = rotate_strain(inner, -angle).T
    gone = 121 + int(np.argmax(stress[121:] <= 0)) + 1
    stretch = np.sqrt(1 + 2 * axial)
    travel = np.concatenate([[0], np.cumsum(np.abs(np.diff(stretch)))]) / RATE
    time = np.arange(0, travel[gone - 1], 1 / PER_SECOND)
    l1, l2 = np.sqrt(1 + 2 * E1), np.sqrt(1 + 2 * E2)
    columns = {
        "displacement": (stretch - 1) * fabric.gauge_length,
        "force": stress * stretch * fabric.width * fabric.thickness,
        "along": axial,
        "across": inner[:, 1],
        "warp_stretch": l1,
        "weft_stretch": l2,
        "angle": np.arccos(np.abs(gamma) / (l1 * l2)),
    }
    kink, out = travel[120], {"time": time}
    for name, values in columns.items():
        up, back_ = PchipInterpolator(travel[:121], values[:121]), PchipInterpolator(travel[120:gone], values[120:gone])
        out[name] = np.where(time < kink, up(np.minimum(time, kink)), back_(np.maximum(time, kink)))
    return out if way == "bias" else {k: v for k, v in out.items() if "stretch" not in k and k != "angle"}


def _record(path: Path, word: str, ideal: dict[str, Array], noise: float, rng: np.random.Generator) -> None:
    def noisy(values: Array, scale: float) -> Array:
        return values + scale * rng.standard_normal(len(values))

    d, force = ideal["displacement"], ideal["force"]
    columns = {
        "time_s": ideal["time"],
        "displacement_mm": noisy(1e3 * d, 0.01 if noise else 0.0),
        "force_N": noisy(force, noise * force.max()),
    }
    if "angle" in ideal:
        change = np.degrees(np.pi / 2 - ideal["angle"].min())
        columns["warp_stretch (-)"], columns["weft_stretch (-)"] = ideal["warp_stretch"], ideal["weft_stretch"]
        columns["angle (deg)"] = noisy(np.degrees(ideal["angle"]), noise * change)
    _write(path, word, columns)


def _dots(path: Path, word: str, ideal: dict[str, Array], noise: float, rng: np.random.Generator) -> None:
    """A grid of 3 x 5 dots, 8 mm apart, the load along y, seen by a camera that is turned by one degree."""
    top = int(ideal["along"].argmax())
    shown = np.concatenate([np.zeros(5, dtype=int), np.linspace(0, top, PHOTOGRAPHS + 1)[1:].astype(int)])
    along, across = (np.sqrt(1 + 2 * ideal[k][shown]) for k in ("along", "across"))
    c, s = np.cos(np.radians(1.0)), np.sin(np.radians(1.0))
    sigma = noise * 8.0 * ideal["along"][top] / np.sqrt(2)
    columns = {"displacement_mm": 1e3 * ideal["displacement"][shown]}
    for i in range(3):
        for j in range(5):
            x, y = 8.0 * (i - 1) * across, 8.0 * (j - 2) * along
            for axis, values in (("x", c * x - s * y), ("y", s * x + c * y)):
                columns[f"{'abc'[i]}{j + 1}_{axis}_mm"] = values + sigma * rng.standard_normal(len(x))
    _write(path, word, columns)


def _write(path: Path, word: str, columns: dict[str, Array]) -> None:
    body = np.column_stack(list(columns.values()))
    np.savetxt(path, body, fmt="%.7g", delimiter=",", header=word + ",".join(columns), comments="", encoding="utf-8")
