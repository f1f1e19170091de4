"""The background in a few key frames of every shot: features, and straight edges; and the ground around people.

By its features (SIFT, Lowe 2004) a place is recognised in another shot; its straight edges (`segments`) give the focal
length, the vertical and the camera's heading; on the ground people's shadows fall (`models.shadows`). A shot is
represented by its first, middle and last frame outside transitions: neighbouring shots meet in the outer ones, and a
camera that moves shows most in all three. They are kept, small and grey, for their floor (`floor_views`); the ground
around people is seen in a few more. Pixels have their centres at (0.5, 0.5).
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.machine import num_processors
from humanmm.models.camera.background.ground import GroundPicture, ground_around, ground_frames, hidden, whole_frame
from humanmm.models.camera.background.segments import SEEN_SIDE_PX, detect_segments
from humanmm.models.geometry.intrinsics import straightened
from humanmm.models.records.shots import Box, Shot, ShotList
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frames import Frame, frames_at
from humanmm.models.video.light import brightened, gain_of
from humanmm.models.video.opened import Video
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.progress import Progress, silent

MAX_FEATURES = 2500
_THREADS = 2
"""Of OpenCV: SIFT takes 0.6 times as long as with one."""
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

    def straightened(self, distortion: float, width: int, height: int) -> "FrameFeatures":
        """As a pinhole camera would see them (`geometry.intrinsics.straightened`)."""
        if not distortion:
            return self
        xy = straightened(self.xy, distortion, width, height)
        ends = straightened(self.segments.reshape(-1, 2), distortion, width, height)
        return replace(self, xy=xy, segments=ends.reshape(-1, 4))

    @cached_property
    def roots(self) -> Float[np.ndarray, "features 128"]:
        """See `roots_of`."""
        return roots_of(self.descriptors)


def roots_of(descriptors: UInt8[np.ndarray, "features 128"]) -> Float[np.ndarray, "features 128"]:
    """Square roots of descriptors at sum 1, float32: their products are the Hellinger kernel (Arandjelović and
    Zisserman 2012)."""
    values = descriptors.astype(np.float32)
    return np.asarray(np.sqrt(values / np.maximum(values.sum(axis=1, keepdims=True), 1e-9)))


@dataclass(frozen=True)
class KeyFrameFeatures:
    """What the shots of a video look like without their people."""

    of_shot: tuple[tuple[FrameFeatures, ...], ...]
    """By shot, in order of time; empty where a shot failed or shows nothing clearly."""
    ground: tuple[tuple[GroundPicture, ...], ...] = ()
    """By shot, the ground around its people, in order of time; none of the only shot of a video."""
    pictures: tuple[tuple[GroundPicture, ...], ...] = ()
    """By shot, its key frames as they are, without their people; none of the only shot of a video."""


def describe_key_frames(
    video: Video, shots: ShotList, people: Sequence[ScenePeople | None], *, progress: Progress = silent
) -> KeyFrameFeatures:
    """Features and straight edges of the background in every shot's key frames, in source pixels, these frames
    themselves, and the ground around the shot's people; all without what is burned in.

    Of the only shot of a video edges alone: there is nothing in which its features could be recognised. `people`: one
    a scene, None where it failed; their boxes are left out of the key frames.
    """
    several = len(shots.shots) > 1
    parts = [_ShotPart.of(shot, people[shot.scene], video.facts, several=several) for shot in shots.shots]
    cv2.setNumThreads(min(_THREADS, num_processors()))
    wanted = [frame for part in parts for frame in part.frames]
    decoded = frames_at(video.stream, video.facts, wanted, pixels="gray", max_side_px=SEEN_SIDE_PX)
    background, grounds, wholes = [], [], []
    with prefetched(decoded) as pictures, prefetched(_with_edges(pictures, parts)) as shown:
        for part in parts:
            described, around, whole = [], [], []
            for picture, image, segments in itertools.islice(shown, len(part.frames)):
                scale = video.facts.width / image.shape[1]
                if segments is not None:
                    features = features_of(image) if several else NO_FEATURES
                    found = FrameFeatures(picture.index, *features, segments)
                    described.append(only_background(_in_source(found, scale), part.tracks, part.burned_in))
                    if several:
                        seen = whole_frame(picture.index, image, part.tracks, scale)
                        whole.append(hidden(seen, part.burned_in))
                if picture.index in part.ground_frames:
                    ground = ground_around(picture.index, image, part.tracks, scale)
                    if ground is not None:
                        around.append(hidden(ground, part.burned_in))
                progress(picture.index + 1, video.facts.num_frames)
            background.append(tuple(described))
            grounds.append(tuple(around))
            wholes.append(tuple(whole))
    if not several:
        return KeyFrameFeatures(tuple(background))
    return KeyFrameFeatures(tuple(background), tuple(grounds), tuple(wholes))


@dataclass(frozen=True)
class _ShotPart:
    """What is looked at of one shot."""

    tracks: tuple[PersonTrack, ...]
    key_frames: tuple[int, ...]
    ground_frames: tuple[int, ...]
    burned_in: tuple[Box, ...] = ()
    gain: float = 1.0
    """What makes its pictures light enough."""

    @classmethod
    def of(cls, shot: Shot, scene: ScenePeople | None, facts: VideoFacts, *, several: bool) -> "_ShotPart":
        """Nothing of a scene that failed; no ground of the only shot of a video, whose light compares with nothing."""
        if scene is None:
            return cls((), (), ())
        ground = ground_frames(shot) if several else ()
        gain = gain_of(facts, shot.start, shot.end)
        return cls(tuple(scene.tracks), key_frames(shot), ground, shot.burned_in, gain)

    @property
    def frames(self) -> tuple[int, ...]:
        """In order of time."""
        return tuple(sorted({*self.key_frames, *self.ground_frames}))


def _with_edges(
    pictures: Iterator[Frame], parts: Iterable[_ShotPart]
) -> Iterator[tuple[Frame, UInt8[np.ndarray, "height width"], Float[np.ndarray, "segments 4"] | None]]:
    """Every picture, as light as it should be, and the edges of key frames."""
    for part in parts:
        for picture in itertools.islice(pictures, len(part.frames)):
            image = brightened(picture.image, part.gain)
            yield picture, image, detect_segments(image) if picture.index in part.key_frames else None


def _in_source(features: FrameFeatures, scale: float) -> FrameFeatures:
    """The same in source pixels, of which one of the picture's is `scale` wide."""
    return replace(features, xy=features.xy * np.float32(scale), segments=features.segments * np.float32(scale))


Features = tuple[Float[np.ndarray, "features 2"], UInt8[np.ndarray, "features 128"]]
"""Where they are, strongest first, and what they look like."""
NO_FEATURES: Features = (np.zeros((0, 2), np.float32), np.zeros((0, 128), np.uint8))


def features_of(gray: UInt8[np.ndarray, "height width"]) -> Features:
    """At most MAX_FEATURES SIFT features of a grey picture, in its own pixels."""
    # A contrast threshold of half the default keeps features on the plain walls that film sets are made of.
    keypoints, descriptors = cv2.SIFT.create(MAX_FEATURES, contrastThreshold=0.02).detectAndCompute(gray, None)
    if descriptors is None:
        return NO_FEATURES
    order = np.argsort([-k.response for k in keypoints], kind="stable")[:MAX_FEATURES]
    xy = np.array([keypoints[i].pt for i in order], np.float32) + 0.5
    return xy, descriptors[order].astype(np.uint8)


def key_frames(shot: Shot) -> tuple[int, ...]:
    """The first, the middle and the last frame of a shot outside transitions; none where they leave nothing of it."""
    first, end = shot.outside_transitions
    return tuple(sorted({first, (first + end) // 2, end - 1})) if first < end else ()


def only_background(
    features: FrameFeatures, tracks: Iterable[PersonTrack], burned_in: Iterable[Box] = ()
) -> FrameFeatures:
    """The features and edges that lie on nobody and on nothing burned in; an edge by its middle."""
    shown, clear = np.ones(len(features.xy), bool), np.ones(len(features.segments), bool)
    middle = 0.5 * (features.segments[:, :2] + features.segments[:, 2:])
    for box in (*_boxes(tracks, features.frame), *(np.array(box) for box in burned_in)):
        shown &= ~((features.xy > box[:2]) & (features.xy < box[2:])).all(axis=1)
        clear &= ~((middle > box[:2]) & (middle < box[2:])).all(axis=1)
    return replace(
        features,
        xy=features.xy[shown], descriptors=features.descriptors[shown], segments=features.segments[clear],
    )  # fmt: skip


def _boxes(tracks: Iterable[PersonTrack], frame: int) -> Iterator[Float[np.ndarray, " 4"]]:
    """Each person's box, xyxy in source pixels, of the observed frame nearest to a frame, widened by a tenth."""
    for track in tracks:
        nearest = int(np.argmin(np.abs(track.frame - frame)))
        if abs(int(track.frame[nearest]) - frame) <= MAX_BOX_AGE:
            margin = 0.1 * (track.bbox[nearest, 2:] - track.bbox[nearest, :2])
            yield np.concatenate([track.bbox[nearest, :2] - margin, track.bbox[nearest, 2:] + margin])
