"""The background in a few key frames of every shot: features, and straight edges.

By its features (SIFT, Lowe 2004) a place is recognised in another shot; its straight edges (`segments`) give the focal
length, the vertical and the camera's heading. A shot is represented by its first, middle and last frame outside
transitions: neighbouring shots meet in the outer ones, and a camera that moves shows most in all three. Pixels have
their centres at (0.5, 0.5).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.camera.background.segments import detect_segments
from humanmm.models.records.shots import Shot, ShotList
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.video.frames import frames_at
from humanmm.models.video.opened import Video
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.progress import Progress, silent

MAX_FEATURES = 2500
MAX_SIDE_PX = 1280
"""Reduce larger pictures before features are taken: detail beyond this does not repeat between cameras."""
MAX_BOX_AGE = 10
"""A box seen this many frames before or after a key frame still hides what lies in it."""


@dataclass(frozen=True)
class FrameFeatures:
    """Features and straight edges of one frame."""

    frame: int
    xy: Float[np.ndarray, "features 2"]
    """float32, source pixels, strongest first."""
    descriptors: UInt8[np.ndarray, "features 128"]
    segments: Float[np.ndarray, "segments 4"]
    """float32, x0 y0 x1 y1, source pixels, longest first."""

    @cached_property
    def roots(self) -> Float[np.ndarray, "features 128"]:
        """Square roots of the descriptors at sum 1, float32: their products are the Hellinger kernel (Arandjelović and
        Zisserman 2012)."""
        values = self.descriptors.astype(np.float32)
        return np.asarray(np.sqrt(values / np.maximum(values.sum(axis=1, keepdims=True), 1e-9)))


@dataclass(frozen=True)
class KeyFrameFeatures:
    """What the shots of a video look like without their people."""

    of_shot: tuple[tuple[FrameFeatures, ...], ...]
    """By shot, in order of time; empty where a shot failed or shows nothing clearly."""


def describe_key_frames(
    video: Video, shots: ShotList, people: Sequence[ScenePeople | None], *, progress: Progress = silent
) -> KeyFrameFeatures:
    """Features and straight edges of the background in every shot's key frames, in source pixels.

    Of the only shot of a video edges alone: there is nothing in which its features could be recognised. `people`: one
    a scene, None where it failed; their boxes are left out of the pictures.
    """
    scenes = [people[shot.scene] for shot in shots.shots]
    wanted = [key_frames(shot) if scene is not None else () for shot, scene in zip(shots.shots, scenes, strict=True)]
    cv2.setNumThreads(1)
    numbers = [frame for frames in wanted for frame in frames]
    decoded = frames_at(video.stream, video.facts, numbers, pixels="gray", max_side_px=MAX_SIDE_PX)

    def features(scene: ScenePeople | None) -> FrameFeatures:
        picture = next(pictures)
        found = describe_frame(picture.index, picture.image, features=len(shots.shots) > 1)
        scale = np.float32(video.facts.width / picture.image.shape[1])
        progress(picture.index + 1, video.facts.num_frames)
        in_source = replace(found, xy=found.xy * scale, segments=found.segments * scale)
        return without_people(in_source, scene.tracks if scene is not None else ())

    with prefetched(decoded) as pictures:
        return KeyFrameFeatures(
            tuple(tuple(features(scene) for _ in frames) for scene, frames in zip(scenes, wanted, strict=True))
        )


def describe_frame(frame: int, gray: UInt8[np.ndarray, "height width"], *, features: bool = True) -> FrameFeatures:
    """Straight edges and, if wanted, at most MAX_FEATURES SIFT features of a grey picture, in its own pixels."""
    segments = detect_segments(gray)
    none = FrameFeatures(frame, np.zeros((0, 2), np.float32), np.zeros((0, 128), np.uint8), segments)
    if not features:
        return none
    # A contrast threshold of half the default keeps features on the plain walls that film sets are made of.
    keypoints, descriptors = cv2.SIFT.create(MAX_FEATURES, contrastThreshold=0.02).detectAndCompute(gray, None)
    if descriptors is None:
        return none
    order = np.argsort([-k.response for k in keypoints], kind="stable")[:MAX_FEATURES]
    xy = np.array([keypoints[i].pt for i in order], np.float32) + 0.5
    return FrameFeatures(frame, xy, descriptors[order].astype(np.uint8), segments)


def key_frames(shot: Shot) -> tuple[int, ...]:
    """The first, the middle and the last frame of a shot outside transitions; none where they leave nothing of it."""
    first, end = shot.outside_transitions
    return tuple(sorted({first, (first + end) // 2, end - 1})) if first < end else ()


def without_people(features: FrameFeatures, tracks: Iterable[PersonTrack]) -> FrameFeatures:
    """The features and edges that lie on nobody: outside each person's box of the nearest observed frame, widened by a
    tenth; an edge by its middle."""
    shown, clear = np.ones(len(features.xy), bool), np.ones(len(features.segments), bool)
    middle = 0.5 * (features.segments[:, :2] + features.segments[:, 2:])
    for track in tracks:
        nearest = int(np.argmin(np.abs(track.frame - features.frame)))
        if abs(int(track.frame[nearest]) - features.frame) > MAX_BOX_AGE:
            continue
        margin = 0.1 * (track.bbox[nearest, 2:] - track.bbox[nearest, :2])
        least, most = track.bbox[nearest, :2] - margin, track.bbox[nearest, 2:] + margin
        shown &= ~((features.xy > least) & (features.xy < most)).all(axis=1)
        clear &= ~((middle > least) & (middle < most)).all(axis=1)
    return replace(
        features,
        xy=features.xy[shown], descriptors=features.descriptors[shown], segments=features.segments[clear],
    )  # fmt: skip
