"""What a clip shows: people, shots, cameras, transitions, the background scene; everything but the pixels. Seeded."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.intrinsics import K_from_focal
from humanmm.models.geometry.projection import world_to_camera
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.rendering.actors import place_actors, shifted
from humanmm.models.rendering.background_scene import BackgroundScene, Block, build_outdoors, build_room
from humanmm.models.synthetic.mocap import Actor, MocapSequence, resample
from humanmm.models.synthetic.rigs import Kind, move_camera

Array = np.ndarray

SIZES = ((960, 540), (1280, 720), (540, 960), (720, 540))
SIZE_PROBABILITIES = (0.6, 0.15, 0.1, 0.15)
RATES_HZ = (24.0, 25.0, 30000 / 1001, 30.0)
CAMERAS: tuple[Kind, ...] = ("static", "pan", "dolly", "hand-held", "orbit")
CAMERA_PROBABILITIES = (0.4, 0.2, 0.15, 0.15, 0.1)
PERSON_M = 1.75
SHORTEST_SHOT_S = 0.8
DISSOLVE_S = (0.35, 0.8)
LOOK_AT_M = 0.92
CLEAR_M = 1.3
"""Nobody comes nearer to a camera than this."""
CHEST = 9
MOST_HIDDEN = 0.4
"""Largest fraction of a shot in which a block hides the first person."""
LEAST_IN_VIEW = 0.85
"""Least fraction of the main person's joints in view in a shot."""


@dataclass(frozen=True)
class ClipPlan:
    """One clip to be made; the same plan gives the same bytes."""

    name: str
    seed: tuple[int, ...]
    seconds: tuple[float, float] = (7.0, 12.0)
    """Shortest and longest clip."""
    size: tuple[int, int] | None = None
    """Width and height; None picks one at random."""
    transitions: tuple[int, int] = (1, 4)
    """Fewest and most changes of shot."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A camera over frames [start, end); frames of a dissolve belong to both of its shots."""

    start: int
    end: int
    kind: str
    R_world_cam: Float[Array, "n 3 3"]
    t_world_cam: Float[Array, "n 3"]
    focal_px: Float[Array, " n"]
    gain: Float[Array, "3"]
    """Exposure and white balance."""


@dataclass(frozen=True)
class Change:
    """A change of shot over frames [start, end); start = end is a cut. The shot changes at (start + end) // 2."""

    type: Literal["cut", "dissolve"]
    start: int
    end: int

    @property
    def at(self) -> int:
        return (self.start + self.end) // 2


@dataclass(frozen=True, eq=False)
class Clip:
    """A clip before it is rendered. World: z up, metres, first pelvis of the first person above the origin."""

    plan: ClipPlan
    width: int
    height: int
    fps: float
    actors: tuple[Actor, ...]
    shots: tuple[Shot, ...]
    changes: tuple[Change, ...]
    scene: BackgroundScene
    shutter: float
    """Fraction of a frame's time that the shutter is open."""
    noise: float
    """Standard deviation of the sensor's noise, grey levels."""
    crf: int
    """x264's constant rate factor."""
    texture_seed: tuple[int, ...]
    subjects: int | None = None
    """How many of the actors, the first ones, the clip is about; the others pass by. None: all."""
    mesh: Literal["full", "drawn"] = "full"
    """Which triangles of a body are drawn: all 27,420, or the 2,000 of overlays."""
    loose: float = 1.0
    """How many times farther than usual clothes are from the skin."""

    @property
    def num_frames(self) -> int:
        return len(self.actors[0].joints)

    def shot_index(self) -> Array:
        """(F,) the shot of each frame."""
        return np.searchsorted([change.at for change in self.changes], np.arange(self.num_frames), side="right")

    def K(self, shot: Shot, frame: int) -> Float[Array, "3 3"]:  # noqa: N802
        """Pixels with centres at .5."""
        return K_from_focal(float(shot.focal_px[frame - shot.start]), self.width, self.height)


def plan_clip(sequences: Sequence[MocapSequence], plan: ClipPlan) -> Clip:
    """Everything about a clip but its pixels. ValueError if no sequence is long enough."""
    rng = np.random.default_rng(plan.seed)
    width, height = plan.size or SIZES[int(rng.choice(len(SIZES), p=SIZE_PROBABILITIES))]
    fps = RATES_HZ[int(rng.integers(len(RATES_HZ)))]
    fits = [sequence for sequence in sequences if (sequence.num_frames - 1) / sequence.fps >= plan.seconds[0]]
    if not fits:
        raise ValueError(f"no sequence is as long as {plan.seconds[0]} s")
    wanted = int(rng.choice([1, 2, 3], p=[0.6, 0.3, 0.1]))
    chosen = [fits[int(k)] for k in rng.choice(len(fits), min(wanted, len(fits)), replace=False)]
    longest = min((sequence.num_frames - 1) / sequence.fps for sequence in chosen)
    seconds = min(rng.uniform(*plan.seconds), longest)
    num_frames = int(seconds * fps)
    parts = [
        resample(sequence, rng.uniform(0, (sequence.num_frames - 1) / sequence.fps - seconds), num_frames, fps)
        for sequence in chosen
    ]
    actors = place_actors(parts, rng)
    origin = actors[0].joints[0, 0] * [1, 1, 0]
    actors = [shifted(actor, -origin) for actor in actors]
    changes = _plan_changes(plan, num_frames, fps, rng)
    focal = width / 2 / math.tan(math.radians(rng.uniform(42, 72)) / 2)
    if height > width:
        focal = height / 2 / math.tan(math.radians(rng.uniform(50, 75)) / 2)
    shots = _plan_shots(actors, changes, num_frames, (width, height, focal, fps), rng)
    scene = build_scene(actors, shots, rng)
    return Clip(
        plan, width, height, fps, tuple(actors), shots, changes, scene,
        shutter=rng.uniform(0.15, 0.6), noise=rng.uniform(0.5, 3.5), crf=int(rng.integers(18, 29)),
        texture_seed=(*plan.seed, 1),
    )  # fmt: skip


def in_view(
    joints: Float[Array, "n 24 3"], shot: Shot, rows: slice, size: tuple[int, int]
) -> tuple[Float[Array, "n 24 2"], Float[Array, "n 24"]]:
    """Pixels and depth of joints in a shot; `rows` counts from the shot's start."""
    R, t, f = shot.R_world_cam[rows], shot.t_world_cam[rows], shot.focal_px[rows]
    in_camera = world_to_camera(joints, R, t)
    depth = in_camera[..., 2]
    safe = np.where(depth > 0.05, depth, 0.05)
    return in_camera[..., :2] / safe[..., None] * f[:, None, None] + np.array(size) / 2, depth


def _plan_changes(plan: ClipPlan, num_frames: int, fps: float, rng: np.random.Generator) -> tuple[Change, ...]:
    shortest = int(SHORTEST_SHOT_S * fps)
    most = max(0, min(plan.transitions[1], num_frames // shortest - 1))
    count = int(rng.integers(min(plan.transitions[0], most), most + 1))
    spare = num_frames - (count + 1) * shortest
    slack = np.sort(rng.integers(0, spare + 1, count))
    changes = []
    for k, extra in enumerate(slack):
        at = int(extra) + (k + 1) * shortest
        half = 0 if rng.random() < 0.8 else round(rng.uniform(*DISSOLVE_S) * fps / 2)
        changes.append(Change("dissolve" if half else "cut", at - half, at + half))
    return tuple(changes)


def _plan_shots(
    actors: Sequence[Actor],
    changes: Sequence[Change],
    num_frames: int,
    lens: tuple[int, int, float, float],
    rng: np.random.Generator,
) -> tuple[Shot, ...]:
    starts = [0, *(change.start for change in changes)]
    ends = [*(change.end for change in changes), num_frames]
    shots: list[Shot] = []
    azimuth = rng.uniform(0, 2 * np.pi)
    for start, end in zip(starts, ends, strict=True):
        shots.append(_plan_shot(actors, (start, end), azimuth, lens, rng))
        azimuth += np.deg2rad(rng.uniform(25, 180)) * rng.choice([-1, 1])
    return tuple(shots)


def _plan_shot(
    actors: Sequence[Actor],
    span: tuple[int, int],
    azimuth: float,
    lens: tuple[int, int, float, float],
    rng: np.random.Generator,
) -> Shot:
    """A camera that holds the first person, far enough from everybody."""
    width, height, focal, fps = lens
    n = span[1] - span[0]
    pelvis = actors[0].joints[slice(*span), 0]
    centre = np.append((pelvis[:, :2].min(axis=0) + pelvis[:, :2].max(axis=0)) / 2, LOOK_AT_M)
    level = float(rng.choice(3, p=[0.55, 0.3, 0.15]))
    eye_height = rng.uniform(*((1.0, 1.8), (1.8, 3.4), (0.3, 1.0))[int(level)])
    roll = np.deg2rad(rng.normal(0, 1.5 if rng.random() < 0.7 else 8.0))
    kind = CAMERAS[int(rng.choice(len(CAMERAS), p=CAMERA_PROBABILITIES))]
    filled = rng.uniform(0.4, 0.9) if height < width else rng.uniform(0.3, 0.65)
    distance = max(2.2, PERSON_M * focal / (filled * height))
    zoom = rng.random() < 0.1
    ramp = np.linspace(1.0, rng.uniform(1.2, 1.5), n) if zoom else np.ones(n)
    ramp = ramp[::-1] if zoom and rng.random() < 0.5 else ramp
    gain = rng.uniform(0.8, 1.1) * rng.uniform(0.95, 1.05, 3)
    state = rng.bit_generator.state
    shot = None
    for _ in range(14):
        rng.bit_generator.state = state  # the same movement from farther away
        arm = np.array([np.cos(azimuth) * distance, np.sin(azimuth) * distance, 0.0])
        eye = np.append((centre + arm)[:2], eye_height)
        camera = move_camera(eye, centre, kind, pelvis, fps, rng)
        R = camera.R_world_cam @ rotvec_to_rotmat(np.array([0.0, 0.0, roll]))
        shot = Shot(*span, f"{kind}, zoom" if zoom else kind, R, camera.t_world_cam, focal * ramp, gain)
        if _holds(actors, shot, (width, height)):
            break
        distance *= 1.12
    assert shot is not None
    return shot


def _holds(actors: Sequence[Actor], shot: Shot, size: tuple[int, int]) -> bool:
    rows = slice(shot.start, shot.end)
    gaps = [np.linalg.norm((actor.joints[rows, 0] - shot.t_world_cam)[:, :2], axis=1).min() for actor in actors]
    pixels, depth = in_view(actors[0].joints[rows], shot, slice(None), size)
    inside = (pixels > 0).all(-1) & (pixels < size).all(-1) & (depth > 0.3)
    return bool(min(gaps) > CLEAR_M and inside.mean() >= LEAST_IN_VIEW)


def build_scene(actors: Sequence[Actor], shots: Sequence[Shot], rng: np.random.Generator) -> BackgroundScene:
    """A room or open ground with the actors and the cameras in it, seldom with something between them."""
    bodies = np.concatenate([actor.joints[::5, 0] for actor in actors])
    eyes = np.concatenate([shot.t_world_cam[::5] for shot in shots])
    build = build_room if rng.random() < 0.6 else build_outdoors
    lines = [
        shot.t_world_cam[::10, :2] * f + actors[0].joints[shot.start : shot.end : 10, 0, :2] * (1 - f)
        for shot in shots
        for f in (0.25, 0.5, 0.75)
    ]
    # A third of the scenes may have something between camera and person.
    clear = [] if rng.random() < 0.33 else lines
    paths = [bodies[:, :2], eyes[:, :2], *clear]
    scene = build(np.concatenate([bodies, eyes]), np.concatenate(paths), rng)
    kept = [block for block in scene.blocks if hidden_fraction(block, actors[0], shots) < MOST_HIDDEN]
    return replace(scene, blocks=tuple(kept))


def hidden_fraction(block: Block, actor: Actor, shots: Sequence[Shot]) -> float:
    """Fraction of frames with a hidden chest, in the shot where the block hides it longest."""
    fractions = [block.hides(shot.t_world_cam, actor.joints[shot.start : shot.end, CHEST]).mean() for shot in shots]
    return float(max(fractions))
