"""The finished recording: everything that motion.zarr holds, as one validated value.

The writer of the run folder, the exporters and the pictures all start from it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from humanmm.models.records import landmarks
from humanmm.models.records.video import mean_rate_hz

CONTACT_JOINTS = (7, 10, 8, 11)
"""Joints of the four contact probabilities: left ankle, left toe base, right ankle, right toe base."""


@dataclass(frozen=True)
class RecordedPerson:
    """One person, N frames without holes. Meanings, units, axes as in the arrays `people/<nn>/…` of motion.zarr."""

    person: int
    frame: np.ndarray
    """(N,) int32."""
    observed: np.ndarray
    """(N,) bool."""
    root_orient: np.ndarray
    """(N,3) float32, axis-angle, body to world, continuous in time."""
    body_pose: np.ndarray
    """(N,23,3) float32, axis-angle."""
    betas: np.ndarray
    """(10,) float32."""
    transl: np.ndarray
    """(N,3) float32, pelvis − J0(betas), metres."""
    joints: np.ndarray
    """(N,24,3) float32, world, metres."""
    contacts: np.ndarray
    """(N,4) float32, probabilities of `CONTACT_JOINTS`."""
    keypoints2d: np.ndarray
    """(N,33,3) float32, source pixels and confidence; zero where the detector saw nothing."""
    bbox: np.ndarray
    """(N,4) float32, xyxy, source pixels: the detector's, else that of the projected joints, else zero."""
    confidence: np.ndarray
    """(N,) float32, 0..1."""
    probability: float = 1.0
    """That this is a person at all (`records.shots.Person`)."""
    hand_pose: np.ndarray | None = None
    """(N,30,3) float32, axis-angle of the finger joints (`body.fingers`), those of the left hand first; None where
    nobody asked for hands."""
    hand_confidence: np.ndarray | None = None
    """(N,2) float32, 0..1, left and right; 0 where the hand was not seen and is drawn at ease."""

    def __post_init__(self) -> None:
        num_frames = len(self.frame)
        shapes = {
            "frame": (num_frames,), "observed": (num_frames,), "root_orient": (num_frames, 3),
            "body_pose": (num_frames, 23, 3), "betas": (10,), "transl": (num_frames, 3), "joints": (num_frames, 24, 3),
            "contacts": (num_frames, 4), "bbox": (num_frames, 4), "confidence": (num_frames,),
        }  # fmt: skip
        if self.hand_pose is not None:
            shapes |= {"hand_pose": (num_frames, 30, 3), "hand_confidence": (num_frames, 2)}
        for name, shape in shapes.items():
            found = np.shape(getattr(self, name))
            if found != shape:
                raise ValueError(f"person {self.person}: {name} has shape {found}, expected {shape}")
        if num_frames and not np.array_equal(self.frame, np.arange(self.frame[0], self.frame[0] + num_frames)):
            raise ValueError(f"person {self.person}: frames must rise by one without holes")

    def pose(self, rows: slice = slice(None)) -> np.ndarray:
        """(n,23,3) axis-angle of all joints below the root; with fingers (n,51,3): 21 of the body, 30 of the hands."""
        if self.hand_pose is None:
            return self.body_pose[rows]
        return np.concatenate([self.body_pose[rows, :21], self.hand_pose[rows]], axis=1)

    @property
    def pelvis(self) -> np.ndarray:
        """(N,3) pelvis joint in the world, metres."""
        return self.joints[:, 0]


@dataclass(frozen=True)
class Recording:
    """One video's people and cameras in one world: z up, metres, floor at z = 0. F frames."""

    width: int
    height: int
    time_s: np.ndarray
    """(F,) float64."""
    shot_index: np.ndarray
    """(F,) int32."""
    cut_frames: tuple[int, ...]
    R_world_cam: np.ndarray
    """(F,3,3) float32."""
    t_world_cam: np.ndarray
    """(F,3) float32, metres."""
    K: np.ndarray
    """(F,3,3) float32, source pixels with centres at .5."""
    camera_source: np.ndarray
    """(F,) uint8, index into records.camera.SOURCES."""
    people: tuple[RecordedPerson, ...]
    body_model: str = "body24"
    keypoint_names: tuple[str, ...] = landmarks.NAMES
    worlds: tuple[int, ...] = ()
    """The world of each shot of the video, from 0: positions in two worlds cannot be compared (`motion.worlds`). Empty
    where all are one."""

    def __post_init__(self) -> None:
        num_frames = len(self.time_s)
        shapes = {
            "shot_index": (num_frames,), "R_world_cam": (num_frames, 3, 3), "t_world_cam": (num_frames, 3),
            "K": (num_frames, 3, 3), "camera_source": (num_frames,),
        }  # fmt: skip
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, expected {shape}")

    @property
    def num_frames(self) -> int:
        return len(self.time_s)

    @property
    def fps(self) -> float:
        """Mean frame rate, Hz; 0 for a single frame."""
        return mean_rate_hz(self.time_s)

    @property
    def shot_spans(self) -> tuple[tuple[int, int], ...]:
        """Frames [start, end) of each shot."""
        return tuple(pairwise((0, *self.cut_frames, self.num_frames)))

    def world_of_shot(self, shot: int) -> int:
        """The world of a shot of the video."""
        return self.worlds[shot] if self.worlds else 0

    @property
    def cast(self) -> str:
        """How many people and shots, in words."""
        people, shots = len(self.people), len(self.cut_frames) + 1
        return f"{people} {'person' if people == 1 else 'people'}, {shots} shot{'s' if shots > 1 else ''}"


@dataclass(frozen=True)
class IdentityGuess:
    """How sure it is that somebody in a shot is who he is said to be."""

    person: int
    shot: int
    probability: float
    """From clothes and the pose at the cut, against the best other answer."""
    other: int | None = None
    """That answer: another person's number; None: nobody who was seen before."""


@dataclass(frozen=True)
class OffFloor:
    """Somebody whose soles stand, and not on the floor: on something, or he is misplaced."""

    person: int
    start: int
    end: int
    """Frames [start, end) in which he does."""
    height_m: float
    """Of the soles above the floor, median."""


HEIGHT_ERROR = 0.08
"""Heights from bones are wrong by less in 68 %, by less than 0.15 in 90 % (35 people in 22 rendered clips)."""


@dataclass(frozen=True)
class Guesses:
    """What no picture shows by itself, and how sure it is (`motion.guesses`)."""

    floor_m: float
    """68 % of the standing soles lie within this distance of the floor before they are put on it; nan if too few
    stand."""
    standing_soles: int
    identities: tuple[IdentityGuess, ...] = ()
    off_floor: tuple[OffFloor, ...] = ()


@dataclass(frozen=True)
class Delivery:
    """What the stage `deliver` leaves: the recording, and the names of its pictures among the artifact's files."""

    recording: Recording
    files: tuple[str, ...]
    guesses: Guesses | None = None
