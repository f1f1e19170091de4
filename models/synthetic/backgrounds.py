"""Tracked points on a room about the scene, as the stage `points` would leave them: what the camera is found from.

Points lie on the walls and the floor of a box. A track ends where it leaves the picture or a person hides it; pictures
that stood still are not recorded; some tracks drift.
"""

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.klt import MAX_UNRECORDED, NUM_POINTS, STILL_PX
from humanmm.models.geometry.projection import in_front, project, world_to_camera
from humanmm.models.records.camera import PointTracks
from humanmm.models.synthetic.rigs import HEIGHT, WIDTH, ClipCamera

Array = np.ndarray

NEAR_M = 0.3
"""Points nearer to the camera's plane than this are not tracked."""
ROOM_M = (3.0, 8.0)
"""The walls lie this far outside the ring of cameras."""
HEIGHT_M = (3.0, 6.0)
DENSITY = 9000
"""Points on all walls and the floor; what is too much in a picture is left out."""
TRACKER_PX = 640
"""Longest side of the picture in which the stage tracks."""
JITTER_PX, DRIFT_PX, DRIFTING = 0.12, 0.25, 0.05
"""Error of a tracked point and drift a frame of the few tracks that slip, in pixels of that picture."""
LIFE_S = 2.0
"""Mean life of a track for other reasons: light, blur, likeness."""


def build_room(centre: Float[Array, "3"], reach_m: float, rng: np.random.Generator) -> Float[Array, "P 3"]:
    """Random points on four walls and the floor of a box about a centre whose inside holds `reach_m`."""
    half = reach_m + rng.uniform(*ROOM_M, 2)
    top = rng.uniform(*HEIGHT_M)
    face = rng.integers(0, 6, DENSITY)
    points = rng.uniform(-1, 1, (DENSITY, 3)) * [half[0], half[1], top / 2] + [0, 0, top / 2]
    for wall, (axis, side) in enumerate(((0, -1), (0, 1), (1, -1), (1, 1))):
        points[face == wall, axis] = side * half[axis]
    points[face >= 4, 2] = 0.0
    # Walls are not bare: shelves, doors and people's things stand out of them.
    points[:, :2] *= 1 - 0.12 * rng.random((DENSITY, 1))
    return np.asarray(points + centre * [1, 1, 0])


def track(
    room: Float[Array, "P 3"],
    camera: ClipCamera,
    K: Float[Array, "3 3"],
    boxes: Float[Array, "n 4"],
    span: tuple[int, int],
    fps: float,
    rng: np.random.Generator,
) -> PointTracks:
    """Point tracks of one clip [start, end); `boxes` (xyxy, NaN for none) is where the person hides the wall."""
    scale = WIDTH / TRACKER_PX
    n = span[1] - span[0]
    in_camera = world_to_camera(room[None], camera.R_world_cam, camera.t_world_cam)
    xy = project(in_camera, K, near_m=NEAR_M)
    seen = in_front(in_camera, NEAR_M) & (xy > 4 * scale).all(-1) & (xy < np.array([WIDTH, HEIGHT]) - 4 * scale).all(-1)
    with np.errstate(invalid="ignore"):
        on_person = (xy > boxes[:, None, :2]).all(-1) & (xy < boxes[:, None, 2:]).all(-1)
    usual = max(float(seen.sum(axis=1).mean()), 1.0)
    keep = rng.random(len(room)) < 1.2 * NUM_POINTS / usual
    xy, seen = xy[:, keep], (seen & ~on_person)[:, keep]
    recorded = _recorded(xy, seen, STILL_PX * scale, MAX_UNRECORDED)
    xy, seen = xy[recorded], seen[recorded]
    frames = np.arange(*span)[recorded]
    dies = rng.random(seen.shape) < 1 - np.exp(-np.diff(frames, prepend=frames[0])[:, None] / (LIFE_S * fps))
    begins = seen & (~np.vstack([np.zeros_like(seen[:1]), seen[:-1]]) | dies)
    number = np.cumsum(begins.T.ravel()).reshape(begins.T.shape).T - 1
    row, column = np.nonzero(seen)
    name = number[row, column]
    slips = rng.random(int(number.max()) + 1 if number.size else 1) < DRIFTING
    heading = rng.normal(0, DRIFT_PX, (len(slips), 2)) * slips[:, None]
    born = np.full(len(slips), n + span[1])
    np.minimum.at(born, name, frames[row])
    age = frames[row] - born[name]
    noise = rng.normal(0, JITTER_PX, (len(row), 2)) + heading[name] * age[:, None]
    return PointTracks(
        span[0], span[1], name.astype(np.int32), frames[row].astype(np.int32),
        (xy[row, column] + scale * noise).astype(np.float32),
        rng.uniform(0.7, 1.0, len(row)).astype(np.float32), window_px=15 * scale,
    )  # fmt: skip


def _recorded(xy: Float[Array, "n p 2"], seen: Array, still_px: float, longest: int) -> Array:
    """First and last frame, and every frame whose picture moved since the last one recorded."""
    chosen = [0]
    for frame in range(1, len(xy)):
        both = seen[chosen[-1]] & seen[frame]
        moved = np.median(np.linalg.norm(xy[frame, both] - xy[chosen[-1], both], axis=-1)) if both.any() else np.inf
        if moved >= still_px or frame - chosen[-1] >= longest or frame == len(xy) - 1:
            chosen.append(frame)
    return np.array(chosen)


def within(points: PointTracks, start: int, end: int) -> PointTracks:
    """The tracks of a part [start, end) of the clip."""
    inside = (points.frame >= start) & (points.frame < end)
    return PointTracks(
        start, end, points.track[inside], points.frame[inside], points.xy[inside], points.confidence[inside],
        points.window_px,
    )  # fmt: skip
