"""Scenes and meshes that come with the package, found by their names."""

from pathlib import Path

from ..surfaces.meshing import MESHES

SCENES = Path(__file__).parent / "examples"


def names() -> tuple[str, ...]:
    """The scenes that come with the package, in alphabetical order."""
    return tuple(sorted(file.stem for file in SCENES.glob("*.toml")))


def scene(name_or_path: str | Path) -> Path:
    """The file of a scene."""
    return SCENES / f"{name_or_path}.toml" if str(name_or_path) in names() else Path(name_or_path)


def mesh(folder: Path, file: str) -> Path:
    """A mesh beside a scene, or else the package's of that name."""
    own, packaged = folder / file, MESHES / file
    return packaged if file == own.name and not own.exists() and packaged.exists() else own
