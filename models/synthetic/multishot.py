"""Multi-shot videos without pixels: a sequence, cut at random times, a random camera for each clip (paper section 4).

A video is everything that the pipeline knows after its stages `people` and `points`, and the truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.camera.background.ground import GroundPicture
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.evaluation.people import projected_boxes
from humanmm.models.evaluation.skeleton import SMPL_NAMES
from humanmm.models.geometry.projection import project, world_to_camera
from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.perception.silhouettes import silhouettes
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.sequence import BodyParameters, CameraSequence, MotionSequence, PersonSequence
from humanmm.models.records.shots import Scenes, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.synthetic.backgrounds import build_room, track, within
from humanmm.models.synthetic.detector_noise import Detections, DetectorNoise, detect, fitted_noise, pitch_and_roll
from humanmm.models.synthetic.mocap import Actor, MocapSequence, leg_length, pose_actor
from humanmm.models.synthetic.rigs import (
    HEIGHT,
    KINDS,
    NUM_CAMERAS,
    PROBABILITIES,
    WIDTH,
    ClipCamera,
    Ring,
    build_ring,
    move_camera,
)

Array = np.ndarray

SHORTEST_CLIP_S = 0.6
LONGEST_FRAMES = 1478
"""The longest video of the paper's set; longer sequences are cropped to it."""
COLOURS_HZ = 3.0


@dataclass(frozen=True)
class VideoPlan:
    """What one video is made of."""

    name: str
    sequence: int
    """Which sequence of the pack."""
    num_transitions: int
    seed: tuple[int, ...]
    longest: int = LONGEST_FRAMES
    noise: DetectorNoise = field(default_factory=fitted_noise)


@dataclass(frozen=True)
class BenchVideo:
    """What the stages after `people` and `points` work on, and the truth."""

    name: str
    split: str
    facts: VideoFacts
    scenes: Scenes
    people: tuple[ScenePeople, ...]
    """One a scene."""
    points: tuple[PointTracks, ...]
    """Of spans none of which is shorter than a shot; empty tracks where nothing is known of the background."""
    truth: MotionSequence
    key_frames: tuple[FrameFeatures, ...] = ()
    """Features of the shots' key frames, people left out; none where there are no pictures."""
    ground: tuple[GroundPicture, ...] = ()
    """The ground around people in some frames of the shots."""
    pictures: tuple[GroundPicture, ...] = ()
    """The shots' key frames."""
    static_cameras: bool = False
    """The user knows that all cameras are static."""
    cuts_known: bool = False
    """`scenes` has every cut: people are not searched for more."""

    def points_of(self, start: int, end: int) -> PointTracks:
        """Point tracks of a shot [start, end)."""
        return within(next(p for p in self.points if p.start <= start and end <= p.end), start, end)


class Performance(Protocol):
    """What videos are cut from."""

    @property
    def name(self) -> str: ...

    @property
    def fps(self) -> float: ...

    @property
    def num_frames(self) -> int: ...


def plan_videos(
    sequences: Sequence[Performance],
    num_videos: int,
    *,
    seed: int,
    transitions: Sequence[int] = (2, 3, 4),
    same: bool = False,
    longest: int = LONGEST_FRAMES,
) -> tuple[VideoPlan, ...]:
    """`num_videos` for each number of transitions; sequences too short for their clips are passed over.

    All sequences are used before one comes again. With `same`, video k shows one and the same body in all numbers of
    transitions (the paper's second set); else all differ.
    """  # fmt: skip
    plans = []
    for count in transitions:
        least = max(transitions) if same else count
        fits = [k for k, one in enumerate(sequences) if one.num_frames >= (least + 1) * SHORTEST_CLIP_S * one.fps]
        if not fits:
            raise ValueError(f"no sequence is long enough for {least} transitions of {SHORTEST_CLIP_S} s clips")
        order = np.random.default_rng([seed, 0 if same else count]).permutation(fits)
        for index in range(num_videos):
            chosen = int(order[index % len(order)])
            name = f"{sequences[chosen].name}-{count}-{index:02d}"
            plans.append(VideoPlan(name, chosen, count, (seed, index, 0 if same else count), longest))
    return tuple(plans)


def build_video(sequence: MocapSequence, plan: VideoPlan) -> BenchVideo:
    """The video of a plan; the same plan gives the same video."""
    rng = np.random.default_rng(plan.seed)
    if sequence.num_frames > plan.longest:
        sequence = sequence.cropped(int(rng.integers(sequence.num_frames - plan.longest + 1)), plan.longest)
    actor = pose_actor(sequence, rng)
    ring = build_ring(actor.joints[:, 0], rng)
    room = build_room(ring.centre, float(np.linalg.norm(ring.eyes - ring.centre, axis=1).max()), rng)
    anatomy = rng.normal(0.0, plan.noise.anatomy_m, (33, 3))
    colours = rng.dirichlet(np.full(HISTOGRAM_BINS, 0.15))
    rng = np.random.default_rng((*plan.seed, plan.num_transitions))  # the same body in all versions of a video
    cuts = cut_times(sequence.num_frames, plan.num_transitions, sequence.fps, rng)
    starts = [0, *cuts]
    spans = list(zip(starts, [*cuts, sequence.num_frames], strict=True))
    cameras, people, points = [], [], []
    number = -1
    for clip, (start, end) in enumerate(spans):
        # Streams of their own: another noise must not move the cameras.
        of_noise, of_looks, of_points = (
            np.random.default_rng((*plan.seed, plan.num_transitions, clip, k)) for k in range(3)
        )
        number = another_camera(number, NUM_CAMERAS, rng)
        kind = KINDS[int(rng.choice(len(KINDS), p=PROBABILITIES))]
        camera = move_camera(ring.eyes[number], ring.centre, kind, actor.joints[start:end, 0], sequence.fps, rng)
        seen = _watch(actor, (start, end), camera, ring, anatomy, sequence.fps, plan.noise, of_noise)
        person = person_track(seen, start, sequence.fps, colours, of_looks)
        boxes = np.full((end - start, 4), np.nan)
        boxes[person.frame - start] = person.bbox
        cameras.append(camera)
        people.append(ScenePeople(start, end, (person,) if len(person.frame) else ()))
        points.append(track(room, camera, ring.K, boxes, (start, end), sequence.fps, of_points))
    return BenchVideo(
        name=plan.name,
        split=split_name(plan.num_transitions),
        facts=facts_of(sequence.num_frames, sequence.fps, (WIDTH, HEIGHT)),
        scenes=hard_cuts(sequence.num_frames, cuts),
        people=tuple(people),
        points=tuple(points),
        truth=_truth(actor, cameras, ring, cuts, sequence.fps),
    )


def split_name(num_transitions: int) -> str:
    """How the part of a set with so many transitions is called."""
    return f"{num_transitions} transition{'' if num_transitions == 1 else 's'}"


def cut_times(num_frames: int, num_cuts: int, fps: float, rng: np.random.Generator) -> tuple[int, ...]:
    """Random cuts, clips no shorter than SHORTEST_CLIP_S: what is left over is shared out at random."""
    shortest = int(SHORTEST_CLIP_S * fps)
    spare = num_frames - (num_cuts + 1) * shortest
    slack = np.sort(rng.integers(0, spare + 1, num_cuts))
    return tuple(int(extra) + (k + 1) * shortest for k, extra in enumerate(slack))


def facts_of(num_frames: int, fps: float, size: tuple[int, int]) -> VideoFacts:
    """Container facts of a video that has no container."""
    return VideoFacts(
        width=size[0], height=size[1], time_s=np.arange(num_frames) / fps, keyframe=np.ones(num_frames, bool),
        rotation_deg=0, codec="none", container="none",
    )  # fmt: skip


def hard_cuts(num_frames: int, cuts: Sequence[int]) -> Scenes:
    """The true cuts, as the stage `scenes` would name them."""
    return Scenes(num_frames, tuple(Transition("cut", cut, cut, "scene") for cut in cuts))


def person_track(
    seen: Detections, start: int, fps: float, colours: Float[Array, " bins"], rng: np.random.Generator,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> PersonTrack:  # fmt: skip
    """Detections of one clip as the stage `people` leaves them."""
    rows = np.flatnonzero(seen.found)
    keypoints = seen.keypoints[rows]
    visible = keypoints[..., 2:] > 0.15
    low = np.where(visible, keypoints[..., :2], np.inf).min(axis=1, initial=np.inf)
    high = np.where(visible, keypoints[..., :2], -np.inf).max(axis=1, initial=-np.inf)
    margin = 0.05 * (high - low)  # of flesh about the landmarks
    masks, affine = silhouettes(keypoints)
    sampled = rows[:: max(1, round(fps / COLOURS_HZ))]
    shades = rng.dirichlet(80 * colours + 1e-3, len(sampled)) if len(sampled) else np.zeros((0, len(colours)))
    return PersonTrack(
        frame=(rows + start).astype(np.int32),
        keypoints2d=keypoints.astype(np.float32),
        landmarks3d=seen.landmarks[rows].astype(np.float32),
        bbox=np.concatenate([np.clip(low - margin, 0, size), np.clip(high + margin, 0, size)], axis=1).astype(
            np.float32
        ),
        confidence=np.clip(keypoints[:, 11:33, 2].mean(axis=1), 0, 1).astype(np.float32),
        masks=masks,
        mask_affine=affine,
        color_frame=(sampled + start).astype(np.int32),
        color_histogram=shades.astype(np.float32),
    )


def another_camera(number: int, num_cameras: int, rng: np.random.Generator) -> int:
    """A camera other than the last; any at first (number -1)."""
    step = int(rng.integers(1, num_cameras)) if number >= 0 else int(rng.integers(num_cameras)) + 1
    return (number + step) % num_cameras


def _watch(
    actor: Actor,
    span: tuple[int, int],
    camera: ClipCamera,
    ring: Ring,
    anatomy: Float[Array, "33 3"],
    fps: float,
    noise: DetectorNoise,
    rng: np.random.Generator,
) -> Detections:
    rows = slice(*span)
    model, body = load_landmarks(), load_body()
    offset = model.offsets(actor.betas) + anatomy
    points = actor.joints[rows][:, model.joint] + np.einsum(
        "nkab,kb->nka", actor.R_world_joint[rows][:, model.joint], offset
    )
    to_camera = camera.t_world_cam - actor.joints[rows, 0]
    facing = actor.R_world_root[rows, :, 2]
    in_camera = world_to_camera(points, camera.R_world_cam, camera.t_world_cam)
    stature = leg_length(body.rest_joints(actor.betas)) / leg_length(body.J_template)
    pitch, roll = pitch_and_roll(camera.R_world_cam, in_camera[:, 23:25].mean(axis=1))
    behind = (facing * to_camera).sum(axis=1) < 0
    return detect(in_camera, ring.K, (WIDTH, HEIGHT), behind, stature, fps, noise, rng, pitch=pitch, roll=roll)


def _truth(actor: Actor, cameras: Sequence[ClipCamera], ring: Ring, cuts: Sequence[int], fps: float) -> MotionSequence:
    n = len(actor.joints)
    path = CameraSequence(
        np.concatenate([camera.R_world_cam for camera in cameras]),
        np.concatenate([camera.t_world_cam for camera in cameras]),
        np.tile(ring.K, (n, 1, 1)),
    )
    in_camera = world_to_camera(actor.joints, path.R_world_cam, path.t_world_cam)
    pixels = project(in_camera, ring.K, near_m=1e-6)
    in_view = (in_camera[..., 2] > 0) & (pixels > 0).all(-1) & (pixels < [WIDTH, HEIGHT]).all(-1)
    frame = np.arange(n)
    person = PersonSequence(
        person=0,
        frame=frame,
        observed=in_view.mean(axis=1) >= 0.3,
        joints=actor.joints,
        R_world_root=actor.R_world_root,
        contacts=actor.contacts,
        bbox_xyxy=projected_boxes(actor.joints, frame, path),
        body=BodyParameters(
            "body24",
            rotmat_to_rotvec(actor.R_world_root),
            actor.body_pose,
            actor.betas,
            actor.joints[:, 0] - load_body().rest_joints(actor.betas)[0],
        ),
    )
    return MotionSequence(n, fps, SMPL_NAMES, (person,), tuple((cut, cut) for cut in cuts), path)
