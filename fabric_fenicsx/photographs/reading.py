"""Photographs as numbers: how light each pixel is."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..files import in_order
from ..laws import Array

MISSING = "Photographs need OpenCV: pip install 'fabric_fenicsx[photos]', or pip install opencv-python-headless."
ENDINGS = (".bmp", ".jpeg", ".jpg", ".pgm", ".png", ".tif", ".tiff", ".webp")


def toolkit() -> Any:
    """The module `cv2`, which is loaded here and nowhere else, so that nothing but photographs needs it."""
    try:
        import cv2
    except ImportError as error:
        raise InputError(MISSING) from error
    return cv2


def series(paths: Sequence[str | Path]) -> list[Path]:
    """The photographs of files and folders, in the order of the numbers in their names: 2 comes before 10."""
    files: list[Path] = []
    for path in map(Path, paths):
        inside = sorted(p for p in path.iterdir() if p.suffix.lower() in ENDINGS) if path.is_dir() else [path]
        if not inside:
            raise InputError(f"{path}: holds no photograph; give files that end in {', '.join(ENDINGS)}.")
        files += inside
    twice = next((file for file in files if files.count(file) > 1), None)
    if twice:
        raise InputError(f"{twice}: is given twice; a photograph is one moment, so leave one out.")
    return sorted(files, key=in_order)


def light(path: str | Path, size: tuple[int, int] | None = None) -> Array:
    """Light (rows, columns) from 0 to 1 of a photograph, turned as its camera says; refuses another size."""
    cv2 = toolkit()
    try:
        raw = np.fromfile(path, dtype=np.uint8)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a photograph.") from error
    found = cv2.imdecode(raw, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH) if len(raw) else None
    if found is None:
        raise InputError(f"{path}: is no picture that can be read; save it as PNG, TIFF or JPEG.")
    if size and found.shape != size:
        raise InputError(
            f"{path}: is {found.shape[1]} x {found.shape[0]} pixels, and the first photograph {size[1]} x {size[0]}; "
            "take all of a series with one camera, and cut none of them."
        )
    most = np.iinfo(found.dtype).max if found.dtype.kind == "u" else 1.0
    return np.asarray(found / most, dtype=np.float32)
