"""Floors drawn from above, and what cameras see of them."""

import cv2
import numpy as np

CELL, SIDE = 0.02, 800
"""The drawn floor: 16 m square about the origin."""


def carpet(seed: int = 1) -> np.ndarray:
    """A floor that nowhere repeats, with detail of 4 to 60 cm."""
    random = np.random.default_rng(seed)
    layers = [cv2.GaussianBlur(random.normal(0, 1, (SIDE, SIDE)), (0, 0), blur) for blur in (2, 5, 12)]
    total = sum(layer / layer.std() for layer in layers)
    return np.clip(128 + 30 * total, 1, 255).astype(np.uint8)


def tiles(seed: int = 2, noise: float = 0.0) -> np.ndarray:
    """A chessboard of tiles of 40 cm, each a little different with `noise`."""
    rows, columns = np.indices((SIDE, SIDE)) * CELL
    board = ((rows // 0.4 + columns // 0.4) % 2) * 90.0 + 80
    cloud = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, (SIDE, SIDE)), (0, 0), 15)
    return np.clip(board + noise * cloud / cloud.std(), 1, 255).astype(np.uint8)


def picture(floor: np.ndarray, K: np.ndarray, R: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """What a camera of 640 x 360 sees of the floor, z = 0; a grey sky above it. `R`: R_world_cam."""
    half = SIDE * CELL / 2
    on_floor = np.array([[CELL, 0, -half - centre[0]], [0, -CELL, half - centre[1]], [0, 0, -centre[2]]])
    to_picture = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]]) @ K @ R.T @ on_floor
    rows, columns = np.indices((360, 640)) + 0.5
    rays = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(K).T @ R.T
    seen = cv2.warpPerspective(floor, to_picture, (640, 360), flags=cv2.INTER_LINEAR, borderValue=1)
    return np.where(rays[..., 2] < 0, np.maximum(seen, 1), 128).astype(np.uint8)
