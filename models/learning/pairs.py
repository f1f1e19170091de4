"""What the shipped pose networks see of a rendered person, frame by frame, beside what is true.

One window is a few seconds of one person in one shot: a captured motion on a random body, clothed, in a place, seen by
a camera. The networks look at crops as the tracker hands them on, each where the last frame's landmarks say; what they
return is kept as it is, with every lean, left-right swap and lost limb.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.landmarks import load_keypoints, load_landmarks
from humanmm.models.geometry.projection import project, world_to_camera
from humanmm.models.learning.crops import CropRenderer, Degradation
from humanmm.models.perception.keypoints.fusion import located_in
from humanmm.models.perception.keypoints.naming import CROSSED_ODDS
from humanmm.models.perception.observation import observe
from humanmm.models.perception.regions import Region, body_region
from humanmm.models.records import landmarks
from humanmm.models.rendering.places.cameras import CAMERA_KINDS, PROBABILITIES, Lens, film_shot
from humanmm.models.rendering.places.crouching import crouched
from humanmm.models.rendering.places.furnishing import Ground
from humanmm.models.rendering.places.sites import PLACES, build_place
from humanmm.models.rendering.places.takes import MOTIONS, Library, Performance, choose_take, perform, rotated
from humanmm.models.rendering.textures import poster
from humanmm.models.synthetic.mocap import Actor

Array = np.ndarray

FRAMES = 32
STRIDES, STRIDE_PROBABILITIES = (1, 2, 3), (0.35, 0.3, 0.35)
"""Frames of 1/30 s from one frame of a window to the next."""
TEMPO = (0.75, 1.35)
SIZES = ((640, 360), (960, 540), (1280, 720), (540, 960))
VIEW_DEG = (28.0, 78.0)
OTHERS = 0.25
"""How often somebody else is near."""
JITTER = 0.03
"""Standard deviation of the first region's centre, as a fraction of its side."""
LOST = 0.35
"""Distance from the person, in sides of his region, at which a crop has lost him."""
NEAREST_M = 0.3
CUT_OFF = 0.15
"""How often the picture ends within the person."""


class WindowArrays:
    """A dataclass of arrays, one a field."""

    precision: ClassVar[type[np.floating[Any]]] = np.float32

    def packed(self) -> dict[str, Array]:
        """Its arrays, numbers in this precision."""
        arrays = {name: np.asarray(value) for name, value in vars(self).items()}
        return {k: v if v.dtype == bool else v.astype(self.precision) for k, v in arrays.items()}


@dataclass(frozen=True, eq=False)
class PairWindow(WindowArrays):
    """FRAMES frames of one person: n is FRAMES."""

    time_s: Float[Array, " n"]
    K: Float[Array, "n 3 3"]
    size: Float[Array, " 2"]
    """Width and height of the picture."""
    R_world_cam: Float[Array, "n 3 3"]
    t_world_cam: Float[Array, "n 3"]
    keypoints: Float[Array, "n 33 3"]
    """The networks': x, y in pixels of the picture, visibility."""
    keypoint_sigma: Float[Array, "n 33"]
    """Their expected errors, pixels."""
    landmarks3d: Float[Array, "n 33 3"]
    """The network's, metres about the mid-hip, axes of the picture."""
    region: Float[Array, "n 4"]
    """What the networks were shown: x, y, side, angle."""
    presence: Float[Array, " n"]
    confidence: Float[Array, " n"]
    """As the tracker gives it; 0 where it would not have believed this frame."""
    is_crossed: Bool[Array, " n"]
    """The two networks name left and right differently."""
    betas: Float[Array, " 10"]
    body_pose: Float[Array, "n 23 3"]
    R_cam_root: Float[Array, "n 3 3"]
    joints_cam: Float[Array, "n 24 3"]
    truth_cam: Float[Array, "n 33 3"]
    """The landmarks of the true body in camera axes, metres."""
    contacts: Float[Array, "n 4"]


@dataclass(frozen=True)
class PairSource:
    """Where windows are drawn from; the same seed and number give the same window."""

    takes: Library
    seed: int
    crouched: float = 0.0
    """How often a take is performed with bent knees (`rendering.places.crouching`)."""

    def window(self, number: int) -> tuple[PairWindow, Mapping[str, Any]]:
        """One window, and what it shows."""
        renderer, fps, rng, facts = self.filmed(number)
        return _observed(renderer, fps, rng), facts

    def filmed(self, number: int) -> tuple[CropRenderer, float, np.random.Generator, Mapping[str, Any]]:
        """FRAMES frames of somebody to be looked at, their rate, what chance goes on with, and what is shown."""
        rng = np.random.default_rng((self.seed, number))
        stride = int(rng.choice(STRIDES, p=STRIDE_PROBABILITIES))
        fps = 30.0 / stride
        motion = MOTIONS[number % len(MOTIONS)]
        seconds = (FRAMES + 1) / fps
        first = self._performance(motion, seconds, fps, rng)
        actors = [_placed(first.actor, rng)]
        if rng.random() < OTHERS:
            other = self._performance(MOTIONS[int(rng.integers(len(MOTIONS)))], seconds, fps, rng)
            actors.append(_beside(other.actor, rng))
        lens, shot = _filmed(actors, fps, rng)
        place = tuple(PLACES)[int(rng.integers(len(PLACES)))]
        scene = build_place(place, _ground(actors, shot.t_world_cam, rng), rng)
        renderer = CropRenderer(
            actors=tuple(actors), body=load_body(), shot=shot, scene=scene, size=(lens.width, lens.height),
            degradation=Degradation.random(rng), seed=(self.seed, number),
        )  # fmt: skip
        facts = {
            "number": number, "motion": first.motion, "take": first.take, "subject": first.subject, "body": first.body,
            "stride": stride, "camera": shot.kind, "place": place, "people": len(actors),
        }  # fmt: skip
        return renderer, fps, rng, facts

    def _performance(self, motion: str, seconds: float, fps: float, rng: np.random.Generator) -> Performance:
        """A part of a take at another tempo."""
        tempo = rng.uniform(*TEMPO)
        take = choose_take(self.takes, motion, rng, shortest_s=0.7)
        if rng.random() < self.crouched:
            take = crouched(take, rng)
        return perform(replace(take, fps=take.fps * tempo), seconds, fps, rng)


def _placed(actor: Actor, rng: np.random.Generator) -> Actor:
    return rotated(actor, rng.uniform(0, 2 * np.pi), np.zeros(2))


def _beside(actor: Actor, rng: np.random.Generator) -> Actor:
    """Somebody half a metre to two metres away from the first, whose path is about the origin."""
    angle, away = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 2.2)
    return rotated(actor, rng.uniform(0, 2 * np.pi), away * np.array([np.cos(angle), np.sin(angle)]))


def _filmed(actors: list[Actor], fps: float, rng: np.random.Generator) -> tuple[Lens, Any]:
    """A camera that shows the first actor; sometimes the picture ends within him."""
    size = SIZES[int(rng.integers(len(SIZES)))]
    focal = max(size) / 2 / np.tan(np.deg2rad(rng.uniform(*VIEW_DEG)) / 2)
    lens = Lens(*size, float(focal), fps)
    kind = CAMERA_KINDS[int(rng.choice(len(CAMERA_KINDS), p=PROBABILITIES))]
    shot = film_shot(actors[:1], (0, FRAMES), rng.uniform(0, 2 * np.pi), kind, lens, rng)
    if rng.random() < CUT_OFF:
        shot = replace(shot, focal_px=shot.focal_px * rng.uniform(1.3, 2.2))
    return lens, shot


def _ground(actors: list[Actor], eyes: Float[Array, "n 3"], rng: np.random.Generator) -> Ground:
    """What the place has to hold."""
    walked = np.concatenate([*(actor.joints[:, 0, :2] for actor in actors), eyes[:, :2]])
    everybody = np.concatenate([actor.joints.reshape(-1, 3) for actor in actors])
    towards = np.linspace(eyes[::8, :2], np.zeros_like(eyes[::8, :2]), 7).reshape(-1, 2)
    return Ground(np.concatenate([everybody, eyes]), np.concatenate([walked, towards]), walked, (), (poster(rng),))


def _observed(renderer: CropRenderer, fps: float, rng: np.random.Generator) -> PairWindow:
    """Every frame rendered and looked at."""
    actor, shot = renderer.actors[0], renderer.shot
    rows = slice(0, FRAMES)
    true = true_body(renderer)
    K, pixels = true.K, true.pixels
    seen: list[dict[str, Any]] = []
    region: Region | None = None
    for frame in range(FRAMES):
        own = true_region(pixels[frame])
        if region is None or region.outlier_of(own, shift=LOST, ratio=1.6):
            region = jittered(own, rng)
        crop = renderer.crop(frame, region, rng)
        output = located_in(crop, region)
        found = observe(output, renderer.size)
        seen.append({
            "keypoints": output.keypoints, "keypoint_sigma": output.keypoint_sigma,
            "landmarks3d": output.landmarks3d, "presence": output.presence,
            "region": (region.x, region.y, region.side, region.angle), "is_crossed": output.side_odds < CROSSED_ODDS,
            "confidence": found.confidence if found else 0.0,
        })  # fmt: skip
        following = output.next_region
        if frame + 1 < FRAMES:
            step = true_region(pixels[frame + 1])
            region = following.moved(step.x - own.x, step.y - own.y)
    columns = {name: np.array([row[name] for row in seen]) for name in seen[0]}
    return PairWindow(
        time_s=np.arange(FRAMES) / fps, K=K, size=np.array(renderer.size, float), R_world_cam=shot.R_world_cam,
        t_world_cam=shot.t_world_cam, betas=actor.betas, body_pose=actor.body_pose[rows],
        R_cam_root=true.R_cam_root, joints_cam=true.joints, truth_cam=true.landmarks, contacts=actor.contacts[rows],
        **columns,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class TrueBody:
    """The first actor of n frames, camera axes, metres."""

    K: Float[Array, "n 3 3"]
    joints: Float[Array, "n 24 3"]
    R_cam_root: Float[Array, "n 3 3"]
    landmarks: Float[Array, "n 33 3"]
    pixels: Float[Array, "n 33 2"]
    """Of the landmarks, in the whole picture."""
    keypoints: Float[Array, "n 33 2"]
    """Where people, and networks that people taught, see the landmarks there (`body.landmarks.load_keypoints`)."""


def true_body(renderer: CropRenderer) -> TrueBody:
    """Whom crops of FRAMES frames show."""
    actor, shot, rows = renderer.actors[0], renderer.shot, slice(0, FRAMES)
    K = np.stack([renderer.intrinsics(frame) for frame in range(FRAMES)])
    joints = world_to_camera(actor.joints[rows], shot.R_world_cam, shot.t_world_cam)
    R_cam_joint = np.swapaxes(shot.R_world_cam, -1, -2)[:, None] @ actor.R_world_joint[rows]
    truth = load_landmarks().place(actor.betas, joints, R_cam_joint)
    seen = load_keypoints().place(actor.betas, joints, R_cam_joint)
    pixels, keypoints = (project(points, K, near_m=NEAREST_M) for points in (truth, seen))
    return TrueBody(K, joints, R_cam_joint[:, 0], truth, pixels, keypoints)


def jittered(region: Region, rng: np.random.Generator) -> Region:
    """As far off as where a tracker begins to look."""
    side = region.side
    return Region(
        region.x + side * rng.normal(0, JITTER), region.y + side * rng.normal(0, JITTER),
        side * float(np.exp(rng.normal(0, 0.05))), region.angle + rng.normal(0, 0.08),
    )  # fmt: skip


def true_region(pixels: Float[Array, "33 2"]) -> Region:
    """Where BlazePose would look: a circle about the hips that holds the body, upright along the trunk."""
    hips, shoulders = (pixels[list(pair)].mean(axis=0) for pair in (landmarks.HIPS, landmarks.SHOULDERS))
    radius = float(np.linalg.norm(pixels - hips, axis=1).max())
    along = shoulders - hips
    along = along / max(float(np.linalg.norm(along)), 1e-6)
    return body_region(hips, hips + radius * along)
