"""Computed photographs of marks at known places: what of each pixel a mark covers, blurred, lit unevenly, noisy."""

import numpy as np
from scipy import ndimage

FINE = 4  # subdivisions of a pixel


def inside(kind, q, size):
    """By how much points q (..., 2), from the middle of a mark on the unstrained cloth, are inside of it; in pixels."""
    x, y = np.abs(q[..., 0]), np.abs(q[..., 1])
    if kind == "dots":
        return size / 2 - np.hypot(x, y)
    return np.maximum(np.minimum(size / 2 - x, size / 9 - y), np.minimum(size / 2 - y, size / 9 - x))


def soft(depth):
    """Which part of a subdivision is marked: steps of 0 and 1 would move an edge by up to half of one."""
    return np.clip(0.5 + FINE * depth, 0, 1)


def coverage(kind, pixels, places, F, size, spacing):
    """Which part of each pixel (rows, columns) is marked; marks at places (n, 2), on cloth of gradient F."""
    rows, columns = pixels
    out, back = np.zeros(pixels), np.linalg.inv(F)
    fine = (np.arange(FINE) + 0.5) / FINE - 0.5
    if kind == "grid":
        y, x = np.meshgrid((np.arange(rows)[:, None] + fine).ravel(), (np.arange(columns)[:, None] + fine).ravel(),
                           indexing="ij")  # fmt: skip
        q = (np.stack([x, y], axis=-1) - places[0]) @ back.T
        near = np.abs((q + spacing / 2) % spacing - spacing / 2)
        reach = np.ptp((places - places[0]) @ back.T, axis=0)
        rim = 0.5 * spacing
        on = soft(size / 2 - near.min(axis=-1)) * ((q > -rim) & (q < reach + rim)).all(axis=-1)
        return on.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3))
    reach = int(np.ceil(0.8 * size * np.linalg.norm(F, 2))) + 1
    for place in places:
        i, j = np.round(place[::-1]).astype(int)
        r, c = (np.arange(max(a - reach, 0), min(a + reach + 1, n)) for a, n in ((i, rows), (j, columns)))
        if not (len(r) and len(c)):
            continue
        y, x = np.meshgrid((r[:, None] + fine).ravel(), (c[:, None] + fine).ravel(), indexing="ij")
        on = soft(inside(kind, (np.stack([x, y], axis=-1) - place) @ back.T, size))
        out[np.ix_(r, c)] += on.reshape(len(r), FINE, len(c), FINE).mean(axis=(1, 3))
    return np.clip(out, 0, 1)


def light(kind, pixels, places, F=None, *, size=10.0, spacing=40.0, dark=0.25, cloth=0.75, blur=1.0, noise=0.015,
          lamp=(0.0, 0.0), level=1.0, rng=None):  # fmt: skip
    """Light (rows, columns), 8 bit. lamp: how it changes across the picture, by part of it; level: of all of it."""
    F = np.eye(2) if F is None else F
    sheet = cloth + (dark - cloth) * coverage(kind, pixels, places, F, size, spacing)
    sheet = ndimage.gaussian_filter(sheet, blur)
    y, x = np.meshgrid(*[np.linspace(-0.5, 0.5, n) for n in pixels], indexing="ij")
    sheet = sheet * level * (1 + lamp[0] * x + lamp[1] * y)
    if noise:
        sheet = sheet + noise * (rng or np.random.default_rng(0)).standard_normal(pixels)
    return np.round(255 * np.clip(sheet, 0, 1)).astype(np.uint8)


def grid(columns, rows, spacing, start, turn=0.0):
    """Places (n, 2) of a grid, turned by an angle in radians."""
    x = spacing * np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    c, s = np.cos(turn), np.sin(turn)
    return np.array(start) + x @ np.array([[c, s], [-s, c]])


def checkerboard(pixels, corners, to_board):
    """Light (rows, columns) of a checkerboard with so many inner corners; to_board: squares from pixels (..., 2)."""
    rows, columns = pixels
    fine = (np.arange(FINE) + 0.5) / FINE - 0.5
    y, x = np.meshgrid((np.arange(rows)[:, None] + fine).ravel(), (np.arange(columns)[:, None] + fine).ravel(),
                       indexing="ij")  # fmt: skip
    q = to_board(np.stack([x, y], axis=-1))
    inside = ((q > -1) & (q < np.array(corners))).all(axis=-1)
    black = inside & (np.floor(q).sum(axis=-1) % 2 == 0)
    sheet = 0.85 - 0.7 * black.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3))
    return np.round(255 * ndimage.gaussian_filter(sheet, 0.8)).astype(np.uint8)


def save(path, light):
    """As a picture."""
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(light).save(path)
    return path


def speckle(pixels, F, shift, *, size=1.6, noise=0.015, level=1.0, lamp=0.0, seed=3, rng=None):
    """Light (rows, columns), 8 bit, of a random pattern, smooth over `size` pixels, of gradient F about the middle."""
    rows, columns = pixels
    wide = np.random.default_rng(seed).standard_normal((2 * rows, 2 * columns))
    pattern = ndimage.gaussian_filter(wide, size)
    pattern = 0.5 + 0.16 * pattern / pattern.std()
    y, x = np.mgrid[:rows, :columns].astype(float)
    q = (np.stack([x, y], axis=-1) - middle(pixels) - shift) @ np.linalg.inv(F).T + [columns, rows]
    sheet = ndimage.map_coordinates(pattern, [q[..., 1], q[..., 0]], order=5, mode="mirror")
    sheet = ndimage.gaussian_filter(sheet, 0.5) * level * (1 + lamp * (x / columns - 0.5))
    sheet = sheet + noise * (rng or np.random.default_rng(0)).standard_normal(pixels)
    return np.round(255 * np.clip(sheet, 0, 1)).astype(np.uint8)


def middle(pixels):
    """About which a pattern is strained: (x, y)."""
    return np.array([pixels[1], pixels[0]]) / 2
