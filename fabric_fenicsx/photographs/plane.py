"""From pixels to places on the plane of the specimen.

A checkerboard that lies in the plane of the specimen gives all of it: the homography of that plane, with the radial
distortion of the lens (Brown 1966, two coefficients) about the middle of the picture; x is then along its rows. A bar
of known length gives the scale alone, for a camera that looks straight at the specimen. Without either, places are in
pixels.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ..errors import InputError
from ..laws import Array
from .marks import contrast
from .reading import toolkit

POOR = 0.5  # pixels by which corners miss the plane, from which on the board is not flat, or not all of it was found
SLENDER = 6.0  # length over width of a bar


@dataclass(frozen=True)
class Plane:
    """Maps pixels to places, x to the right and y upward in the picture, or along those of the board, in `unit`."""

    unit: str = "px"
    scale: float = 1.0
    """mm for a pixel (about the middle of the picture)."""
    said: str = "places are in pixels; ratios and shear need no more"
    middle: tuple[float, float] = (0.0, 0.0)
    distortion: tuple[float, float] = (0.0, 0.0)
    homography: Array | None = None

    def __call__(self, pixels: Array) -> Array:
        """Places (..., 2) of pixels (..., 2)."""
        if self.homography is None:
            return np.asarray(pixels * np.array([self.scale, -self.scale]))
        pixels = np.asarray(pixels, dtype=np.float64)
        return _mapped(pixels, self.middle, self.distortion, self.homography)


def bar(ends: tuple[float, float, float, float], millimetres: float) -> Plane:
    """By a bar from the pixel x1, y1 to x2, y2."""
    length = float(np.hypot(ends[2] - ends[0], ends[3] - ends[1]))
    if not length > 10:
        raise InputError(f"The bar is {length:.3g} pixels long, which tells no scale; give its two ends.")
    scale = millimetres / length
    return Plane("mm", scale, f"{scale:.5g} mm for a pixel, by a bar of {millimetres:g} mm and {length:.1f} pixels")


def find_bar(light: Array) -> tuple[float, float, float, float]:
    """Ends x1, y1, x2, y2 of the longest straight bar, darker than what is around it; InputError if there is none."""
    cv2 = toolkit()
    seen = contrast(light, max(15, round(0.05 * min(light.shape))))
    top = float(np.percentile(seen, 99.9))
    count, labels, stats, _ = cv2.connectedComponentsWithStats((seen > 0.4 * top).astype(np.uint8))
    best, ends = 0.0, None
    for i in range(1, count):
        x, y, w, h, area = stats[i]
        if area < 30 or max(w, h) < 0.05 * max(light.shape):
            continue
        rows, columns = slice(max(y - 3, 0), y + h + 3), slice(max(x - 3, 0), x + w + 3)
        weight = np.where(labels[rows, columns] == i, seen[rows, columns], 0.0)
        weight = np.maximum(cv2.dilate((weight > 0).astype(np.float32), np.ones((5, 5))) * seen[rows, columns], 0)
        at = np.argwhere(weight > 0)[:, ::-1].astype(float)
        weights = weight[weight > 0]
        middle = weights @ at / weights.sum()
        spread, axes = np.linalg.eigh((at - middle).T * weights @ (at - middle) / weights.sum())
        # second moments of a rectangle; blur widens both by about as much
        length, width = np.sqrt(12 * np.maximum(spread[::-1], 1e-9))
        if length > SLENDER * width and length > best and area > 0.5 * length * width:
            half = axes[:, 1] * length / 2 + 0.0
            best, ends = length, (*(middle - half), *(middle + half))
    if ends is None:
        raise InputError("shows no straight dark bar; give its ends, as --bar 50 --ends 120,900,1480,905")
    return tuple(float(round(e, 3)) for e in ends)  # type: ignore[return-value]


def board(light: Array, corners: tuple[int, int], square: float, file: str = "The checkerboard") -> Plane:
    """By a photograph of a checkerboard with so many inner corners across and down, and squares of so many mm."""
    cv2 = toolkit()
    image = np.clip(255 * light / max(float(light.max()), 1e-6), 0, 255).astype(np.uint8)
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    good, found = cv2.findChessboardCornersSB(image, corners, flags=flags)
    if not good:
        raise InputError(
            f"{file}: shows no checkerboard of {corners[0]} x {corners[1]} inner corners; count those where four "
            "squares meet, and photograph all of it, sharp and evenly lit."
        )
    pixels = found.reshape(-1, 2).astype(np.float64)
    places = square * np.stack(np.meshgrid(np.arange(corners[0]), np.arange(corners[1])), axis=-1).reshape(-1, 2)
    middle = ((light.shape[1] - 1) / 2, (light.shape[0] - 1) / 2)
    H, _ = cv2.findHomography(pixels, places)
    scale = float(np.hypot(*(np.ptp(places, axis=0) / np.ptp(pixels, axis=0)))) / np.sqrt(2)

    def miss(v: Array) -> Array:
        H = np.append(v[:8], 1.0).reshape(3, 3)
        return np.asarray((_mapped(pixels, middle, v[8:], H) - places).ravel() / scale)

    v = least_squares(miss, np.append((H / H[2, 2]).ravel()[:8], [0.0, 0.0]), x_scale="jac", method="lm")
    H, k = np.append(v.x[:8], 1.0).reshape(3, 3), (float(v.x[8]), float(v.x[9]))
    off = float(np.sqrt((v.fun**2).mean() * 2))
    if off > POOR:
        raise InputError(f"{file}: its corners miss a plane by {off:.2g} pixels; lay the board flat, and focus on it.")
    H = _upright(middle, k, H)
    scale = float(np.sqrt(abs(np.linalg.det(_slope(middle, k, H)))))
    said = f"{scale:.5g} mm for a pixel in the middle, by {corners[0]} x {corners[1]} corners of a checkerboard, which "
    return Plane("mm", scale, f"{said}miss their plane by {off:.2g} pixels", middle, k, H)


def _mapped(pixels: Array, middle: tuple[float, float], k: Array | tuple[float, float], H: Array) -> Array:
    d = (pixels - middle) / np.hypot(*middle)
    r2 = (d**2).sum(axis=-1, keepdims=True)
    x = middle + (pixels - middle) * (1 + k[0] * r2 + k[1] * r2**2)
    homogeneous = np.concatenate([x, np.ones_like(x[..., :1])], axis=-1) @ H.T
    return np.asarray(homogeneous[..., :2] / homogeneous[..., 2:])


def _slope(middle: tuple[float, float], k: tuple[float, float], H: Array) -> Array:
    """Change of the place with the pixel in the middle of the picture."""
    around = np.array(middle) + np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]])
    x = _mapped(around, middle, k, H)
    return np.stack([x[0] - x[1], x[2] - x[3]], axis=1) / 2


def _upright(middle: tuple[float, float], k: tuple[float, float], H: Array) -> Array:
    """The same by quarter turns, and mirrored if need be, so that x goes to the right of the picture and y upward."""
    u, _, v = np.linalg.svd(_slope(middle, k, H) @ np.diag([1.0, -1.0]))
    R, turn = (u @ v).T, np.zeros((3, 3))
    along = int(np.abs(R[0]).argmax())
    turn[0, along], turn[1, 1 - along], turn[2, 2] = np.sign(R[0, along]), np.sign(R[1, 1 - along]), 1.0
    return np.asarray(turn @ H)
