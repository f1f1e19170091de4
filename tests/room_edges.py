"""A room with known walls, as straight edges in the picture of a known camera."""

import numpy as np

Array = np.ndarray


def edges_of_a_room(random: np.random.Generator, each: int = 14, anywhere: int = 10) -> Array:
    """(n, 2, 3) ends of edges about the origin, metres: along x, y and z, and along any direction."""
    directions = np.repeat(np.eye(3), each, axis=0)
    directions = np.concatenate([directions, random.normal(size=(anywhere, 3))])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    middle = random.uniform(-2.5, 2.5, directions.shape)
    half = random.uniform(0.3, 1.0, (len(directions), 1)) * directions
    return np.stack([middle - half, middle + half], axis=1)


def seen_by(ends_world: Array, R_world_cam: Array, K: Array, *, distance_m: float = 7.0) -> Array:
    """(n, 4) x0 y0 x1 y1 of the edges, from a camera that looks at the origin."""
    centre = -distance_m * R_world_cam[:, 2]
    in_camera = (ends_world - centre) @ R_world_cam
    pixels = in_camera @ K.T
    return (pixels[..., :2] / pixels[..., 2:]).reshape(-1, 4)


def camera_towards(heading_deg: float, down_deg: float, roll_deg: float = 0.0) -> Array:
    """R_world_cam of a camera in a world whose z is up."""
    heading, down, roll = np.radians([heading_deg, down_deg, roll_deg])
    ahead = np.array([np.cos(heading) * np.cos(down), np.sin(heading) * np.cos(down), -np.sin(down)])
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    below = np.cross(ahead, right)
    level = np.stack([right, below, ahead], axis=1)
    c, s = np.cos(roll), np.sin(roll)
    return level @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
