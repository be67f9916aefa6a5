"""Synthetic records of strips at any angle, of biaxial specimens and of picture frames, with seeded noise.

Of any law, or of anything that gives a stress: `noise` is the standard deviation over the largest force of a test.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...laws import Array
from ..tensile.strips import Ends

MACHINE = 0.01  # mm, of the displacement, where there is noise
WORD = "# SYNTHETIC: by fabric_fenicsx; not measured.\n"


def strips(
    folder: Path, angle: float, strain: Array, stress: Array, thickness: float, specimens: int, noise: float,
    rng: np.random.Generator, size: tuple[float, float] = (0.2, 0.05), *, ends: Ends = "free", held_out: bool = False,
) -> str:  # fmt: skip
    """Records of strips of an angle (degrees), axial stress (Pa) over strain (n,); their table [[strip]].

    thickness, and size, the gauge length and width, in m.
    """
    stretch, (length, width) = np.sqrt(1 + 2 * strain), size
    columns = {"displacement_mm": 1e3 * length * (stretch - 1), "force_N": stress * stretch * width * thickness}
    files = _several(folder, f"strip_{angle:g}", columns, specimens, noise, rng)
    return (
        f"[[strip]]\nfiles = {files}\nangle_deg = {angle:g}\ngauge_length_mm = {1e3 * length:g}\n"
        f'width_mm = {1e3 * width:g}\nends = "{ends}"\nheld_out = {str(held_out).lower()}\n'
    )


def biaxial(
    folder: Path, drawn: str, strain: Array, stress: Array, thickness: float, specimens: int, noise: float,
    rng: np.random.Generator, held_out: bool = False, side: float = 0.1,
) -> str:  # fmt: skip
    """Records of square specimens (side in m), stresses (n, 2) over strains (n, 2); their table [[biaxial]]."""
    stretch = np.sqrt(1 + 2 * strain)
    force = stress * stretch * side * thickness
    columns = {f"{way} displacement (mm)": 1e3 * side * (stretch[:, i] - 1) for i, way in enumerate(("warp", "weft"))}
    columns |= {f"{way} force (N)": force[:, i] for i, way in enumerate(("warp", "weft"))}
    files = _several(folder, f"biaxial_{drawn}", columns, specimens, noise, rng)
    return (
        f'[[biaxial]]\nfiles = {files}\ndrawn = "{drawn}"\nlength_mm = [{1e3 * side:g}, {1e3 * side:g}]\n'
        f"width_mm = [{1e3 * side:g}, {1e3 * side:g}]\nheld_out = {str(held_out).lower()}\n"
    )


def frames(
    folder: Path, E12: Array, stress: Array, thickness: float, specimens: int, noise: float, rng: np.random.Generator,
    side: float = 0.15, cloth: float = 0.11,
) -> str:  # fmt: skip
    """Records of picture frames (sides in m), S12 (Pa) over E12 (n,) in the order of the test; tables [[frame]]."""
    half = np.sqrt(E12 + 0.5)  # cosine of half the angle between the bars
    columns = {
        "displacement_mm": 1e3 * side * (2 * half - np.sqrt(2)),
        "force_N": stress * thickness * cloth**2 / side * 2 * half,
    }
    files = _several(folder, "frame", columns, specimens, noise, rng)
    names = [name.strip(' "') for name in files.strip("[]").split(",")]
    text = f"frame_mm = {1e3 * side:g}\nspecimen_mm = {1e3 * cloth:g}\n"
    return "\n".join(f'[[frame]]\nfile = "{name}"\n{text}' for name in names)


def _several(
    folder: Path, name: str, columns: dict[str, Array], specimens: int, noise: float, rng: np.random.Generator
) -> str:
    """Write a file a specimen; the list of their names."""
    names: Sequence[str] = [f"{name}_{k}.csv" for k in range(1, specimens + 1)]
    for file in names:
        noisy = []
        for head, values in columns.items():
            forced = "force" in head
            scale = noise * np.abs(values).max() if forced else MACHINE * bool(noise) * bool(np.ptp(values))
            noisy.append(values + scale * rng.standard_normal(len(values)))
        head = WORD + ",".join(columns)
        np.savetxt(folder / file, np.column_stack(noisy), "%.7g", ",", header=head, comments="", encoding="utf-8")
    return f"{names}".replace("'", '"')
