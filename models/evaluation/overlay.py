"""How far a recovered body lies from its person in the picture: its landmarks against the keypoints that were seen.

No truth is needed. A body's landmarks (`body.landmarks`, where the pose network puts them) are projected with the
recovered camera and compared with the network's own keypoints in that frame, in percent of the person's standing
height in the picture: his stature times focal length over depth, whatever he does with his body. A keypoint counts if
its confidence is above CONFIDENT, it lies inside the picture, and the person is observed in that frame. What the
network itself gets wrong does not show: docs/golden.md has points set by eye.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_keypoints
from humanmm.models.geometry.projection import in_front, project, world_to_camera
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.landmarks import INDEX, NAMES
from humanmm.models.records.recording import RecordedPerson, Recording

Array = np.ndarray

CONFIDENT = 0.5
"""Confidence above which a keypoint counts: the network calls it visible. The fit, too, trusts those below far less."""
NEAR_M = 0.1
"""Landmarks nearer to the camera's plane than this are not seen."""
FASTEST = 0.05
"""Share of a clip's person-frames, by the speed of the faster wrist in the picture, that the row of fast frames has."""

JOINTS: dict[str, tuple[str, ...]] = {
    "face": ("nose", "left_eye", "right_eye", "left_ear", "right_ear", "mouth_left", "mouth_right"),
    "shoulders": ("left_shoulder", "right_shoulder"),
    "elbows": ("left_elbow", "right_elbow"),
    "wrists": ("left_wrist", "right_wrist"),
    "hands": ("left_pinky", "right_pinky", "left_index", "right_index", "left_thumb", "right_thumb"),
    "hips": ("left_hip", "right_hip"),
    "knees": ("left_knee", "right_knee"),
    "ankles": ("left_ankle", "right_ankle"),
    "feet": ("left_heel", "right_heel", "left_foot_index", "right_foot_index"),
}
"""Landmarks that a row of joints has; the eyes' corners, which say what the eyes say, count nowhere."""
COUNTED = np.array([INDEX[name] for names in JOINTS.values() for name in names])
_WRISTS = [INDEX["left_wrist"], INDEX["right_wrist"]]


@dataclass(frozen=True, eq=False)
class PersonOverlay:
    """One person's body beside what was seen of him. N frames."""

    person: int
    offset_pct: Float[Array, "N 33 2"]
    """Body less keypoint, x right and y down, percent of the standing height; NaN where a keypoint does not count."""
    wrist_speed: Float[Array, " N"]
    """Speed of the faster counted wrist in the picture, standing heights a second; NaN where neither is known."""

    @property
    def error_pct(self) -> Float[Array, "N 33"]:
        """Distances; NaN where a keypoint does not count."""
        return np.asarray(np.linalg.norm(self.offset_pct, axis=-1))


def overlay_of(recording: Recording) -> list[PersonOverlay]:
    """Everybody of a recording beside what was seen of him."""
    return [_person_overlay(person, recording) for person in recording.people if len(person.frame)]


def _person_overlay(person: RecordedPerson, recording: Recording) -> PersonOverlay:
    pixels, visible = in_picture(landmarks_in_world(person), person, recording)
    height = standing_height_px(person, recording)
    seen = person.keypoints2d[..., :2].astype(np.float64)
    inside = ((seen > 0) & (seen < (recording.width, recording.height))).all(axis=-1)
    counts = visible & inside & (person.keypoints2d[..., 2] > CONFIDENT) & person.observed[:, None]
    offset = np.where(counts[..., None], 100 * (pixels - seen) / height[:, None, None], np.nan)
    return PersonOverlay(person.person, offset, _wrist_speed(person, recording, seen, counts, height))


def _wrist_speed(
    person: RecordedPerson,
    recording: Recording,
    seen: Float[Array, "N 33 2"],
    counts: Bool[Array, "N 33"],
    height: Float[Array, " N"],
) -> Float[Array, " N"]:
    """By central differences; not across cuts."""
    speed = np.full(len(person.frame), np.nan)
    if len(person.frame) < 3:
        return speed
    wrists = np.where(counts[:, _WRISTS, None], seen[:, _WRISTS], np.nan)
    time_s, shot = recording.time_s[person.frame], recording.shot_index[person.frame]
    moved = np.linalg.norm(wrists[2:] - wrists[:-2], axis=-1) / (time_s[2:] - time_s[:-2])[:, None]
    moved[shot[2:] != shot[:-2]] = np.nan
    faster = np.where(np.isnan(moved).all(axis=1), np.nan, np.fmax(moved[:, 0], moved[:, 1]))
    speed[1:-1] = faster / height[1:-1]
    return speed


def landmarks_in_world(person: RecordedPerson) -> Float[Array, "N 33 3"]:
    """The body's landmarks, where the pose networks see them, metres."""
    joints, R = forward_kinematics(
        load_body().rest_joints(person.betas),
        rotvec_to_rotmat(person.root_orient.astype(np.float64)),
        person.body_pose.astype(np.float64),
        person.pelvis.astype(np.float64),
    )
    return load_keypoints().place(person.betas, joints, R)


def in_picture(
    landmarks: Float[Array, "N k 3"], person: RecordedPerson, recording: Recording
) -> tuple[Float[Array, "N k 2"], Bool[Array, "N k"]]:
    """Source pixels of points of a person's frames as the recovered camera sees them, and which are in front of it."""
    in_camera = world_to_camera(
        landmarks,
        recording.R_world_cam[person.frame].astype(np.float64),
        recording.t_world_cam[person.frame].astype(np.float64),
    )
    return project(in_camera, recording.K[person.frame].astype(np.float64), near_m=NEAR_M), in_front(in_camera, NEAR_M)


def stature_m(betas: Float[Array, " B"]) -> float:
    """Height of a body that stands upright, from its soles to the top of its head."""
    return float(np.ptp(load_body().rest_vertices(betas)[:, 1]))


def standing_height_px(person: RecordedPerson, recording: Recording) -> Float[Array, " N"]:
    """How high the person would be in the picture if he stood upright at the depth of his pelvis."""
    in_camera = world_to_camera(
        person.pelvis[:, None].astype(np.float64),
        recording.R_world_cam[person.frame].astype(np.float64),
        recording.t_world_cam[person.frame].astype(np.float64),
    )
    focal = recording.K[person.frame, 1, 1].astype(np.float64)
    return np.asarray(stature_m(person.betas) * focal / np.maximum(in_camera[:, 0, 2], NEAR_M))


@dataclass(frozen=True)
class OverlayError:
    """Percent of the standing height over some person-frames."""

    median: float
    p95: float
    count: int
    """Keypoints that counted."""


def overlay_error(people: Sequence[PersonOverlay], names: Sequence[str] = ()) -> OverlayError | None:
    """Over everybody's counted keypoints, or those of these names; None if there are none."""
    chosen = np.array([INDEX[name] for name in names]) if names else COUNTED
    return _summary([person.error_pct[:, chosen] for person in people])


def fast_overlay_error(clips: Sequence[Sequence[PersonOverlay]], names: Sequence[str] = ()) -> OverlayError | None:
    """The same in the FASTEST fraction of the person-frames of each clip; None if no wrist's speed is known."""
    chosen = np.array([INDEX[name] for name in names]) if names else COUNTED
    errors = []
    for people in clips:
        speeds = np.concatenate([np.zeros(0), *(person.wrist_speed for person in people)])
        known = speeds[np.isfinite(speeds)]
        least = np.quantile(known, 1 - FASTEST) if len(known) else np.inf
        errors += [person.error_pct[person.wrist_speed >= least][:, chosen] for person in people]
    return _summary(errors)


def _summary(errors: Sequence[Array]) -> OverlayError | None:
    values = np.concatenate([np.zeros(0), *(error[np.isfinite(error)] for error in errors)])
    if not len(values):
        return None
    median, p95 = np.percentile(values, [50, 95])
    return OverlayError(float(median), float(p95), len(values))


def mean_offsets(people: Sequence[PersonOverlay]) -> dict[str, tuple[float, float]]:
    """Where a body's landmarks lie on average beside the keypoints: percent to the right and percent downwards."""
    offsets = np.concatenate([np.zeros((0, len(NAMES), 2)), *(person.offset_pct for person in people)])
    found = {}
    for k in COUNTED:
        values = offsets[np.isfinite(offsets[:, k, 0]), k]
        if len(values):
            right, down = np.median(values, axis=0)
            found[NAMES[k]] = (float(right), float(down))
    return found
