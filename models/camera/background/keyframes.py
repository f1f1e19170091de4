"""Features of the background in a few key frames of every shot, by which shots of one scene are recognised.

SIFT (Lowe 2004). A shot is represented by its first, middle and last frame outside transitions: neighbouring shots meet
in the outer ones, and a camera that moves shows most in all three. Pixels have their centres at (0.5, 0.5).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.records.shots import Shot, ShotList
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.video.frames import frames_at
from humanmm.models.video.opened import Video
from humanmm.models.video.prefetch import prefetched

MAX_FEATURES = 2500
MAX_SIDE_PX = 1280
"""Reduce larger pictures before features are taken: detail beyond this does not repeat between cameras."""
MAX_BOX_AGE = 10
"""A box seen this many frames before or after a key frame still hides what lies in it."""


@dataclass(frozen=True)
class FrameFeatures:
    """Features of one frame, strongest first."""

    frame: int
    xy: Float[np.ndarray, "features 2"]
    """float32, source pixels."""
    descriptors: UInt8[np.ndarray, "features 128"]


@dataclass(frozen=True)
class KeyFrameFeatures:
    """What the shots of a video look like without their people."""

    of_shot: tuple[tuple[FrameFeatures, ...], ...]
    """By shot, in order of time; empty where a shot failed, shows nothing clearly, or is the only one."""


def describe_key_frames(video: Video, shots: ShotList, people: Sequence[ScenePeople | None]) -> KeyFrameFeatures:
    """Features of the background in every shot's key frames, in source pixels; none where there is only one shot.

    `people`: one a scene, None where it failed; their boxes are left out of the pictures.
    """
    if len(shots.shots) < 2:
        return KeyFrameFeatures(of_shot=((),) * len(shots.shots))
    scenes = [people[shot.scene] for shot in shots.shots]
    wanted = [key_frames(shot) if scene is not None else () for shot, scene in zip(shots.shots, scenes, strict=True)]
    cv2.setNumThreads(1)
    numbers = [frame for frames in wanted for frame in frames]
    decoded = frames_at(video.stream, video.facts, numbers, pixels="gray", max_side_px=MAX_SIDE_PX)

    def features(scene: ScenePeople | None) -> FrameFeatures:
        picture = next(pictures)
        found = describe_frame(picture.index, picture.image)
        scale = np.float32(video.facts.width / picture.image.shape[1])
        in_source = FrameFeatures(found.frame, found.xy * scale, found.descriptors)
        return without_people(in_source, scene.tracks if scene is not None else ())

    with prefetched(decoded) as pictures:
        return KeyFrameFeatures(
            tuple(tuple(features(scene) for _ in frames) for scene, frames in zip(scenes, wanted, strict=True))
        )


def describe_frame(frame: int, gray: UInt8[np.ndarray, "height width"]) -> FrameFeatures:
    """SIFT features of a grey picture of at most MAX_SIDE_PX, in its own pixels; no more than MAX_FEATURES."""
    # A contrast threshold of half the default keeps features on the plain walls that film sets are made of.
    keypoints, descriptors = cv2.SIFT.create(MAX_FEATURES, contrastThreshold=0.02).detectAndCompute(gray, None)
    if descriptors is None:
        return FrameFeatures(frame, np.zeros((0, 2), np.float32), np.zeros((0, 128), np.uint8))
    order = np.argsort([-k.response for k in keypoints], kind="stable")[:MAX_FEATURES]
    xy = np.array([keypoints[i].pt for i in order], np.float32) + 0.5
    return FrameFeatures(frame, xy, descriptors[order].astype(np.uint8))


def key_frames(shot: Shot) -> tuple[int, ...]:
    """The first, the middle and the last frame of a shot outside transitions; none where they leave nothing of it."""
    first, end = shot.outside_transitions
    return tuple(sorted({first, (first + end) // 2, end - 1})) if first < end else ()


def without_people(features: FrameFeatures, tracks: Iterable[PersonTrack]) -> FrameFeatures:
    """The features that lie on nobody: outside each person's box of the nearest observed frame, widened by a tenth."""
    hidden = np.zeros(len(features.xy), bool)
    for track in tracks:
        nearest = int(np.argmin(np.abs(track.frame - features.frame)))
        if abs(int(track.frame[nearest]) - features.frame) > MAX_BOX_AGE:
            continue
        x0, y0, x1, y1 = track.bbox[nearest]
        margin_x, margin_y = 0.1 * (x1 - x0), 0.1 * (y1 - y0)
        x, y = features.xy[:, 0], features.xy[:, 1]
        hidden |= (x > x0 - margin_x) & (x < x1 + margin_x) & (y > y0 - margin_y) & (y < y1 + margin_y)
    return FrameFeatures(features.frame, features.xy[~hidden], features.descriptors[~hidden])
