"""A part of a recording for other tools: some of its people, a span of time, another frame rate, other axes and units.

Without another rate every number stays as it is. At another rate rotations are interpolated on the sphere (slerp), the
pelvis and the camera's centre on straight lines, joints follow by forward kinematics. A new frame shows the nearest one
of the video, and is of its shot. People move on through a cut; cameras do not: between the last frame of one shot and
the first of the next they stand where the nearer of the two has them.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.errors import InputError
from humanmm.models.body.body24 import NUM_JOINTS, load_body
from humanmm.models.body.fingers import body_of
from humanmm.models.body.kinematics import chunks, forward_kinematics, local_rotations
from humanmm.models.geometry.axes import R_ZUP_YUP
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.geometry.rotations import (
    interpolate_rotations,
    rotmat_to_rotvec,
    rotmat_to_unitquat_wxyz,
    rotvec_to_rotmat,
)
from humanmm.models.motion.assemble import continuous_rotvec
from humanmm.models.records.recording import RecordedPerson, Recording

WorldScenery = Mapping[int, Float[np.ndarray, "p 3"]]
"""By shot, points of its background; world (z up), metres (`motion.scenery`)."""
Up = Literal["y", "z"]
Unit = Literal["m", "cm", "mm"]
UNITS_PER_METRE: dict[Unit, float] = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
MAX_FPS = 1000.0
UNSEEN_S = 2.0
"""Motion that is filled in for longer than this is no more than a guess."""

_SAME_TIME_S = 1e-6
_SAME_RATE = 1e-5
"""Relative: 29.97 is 30000/1001."""
_SINGLE_FRAME_HZ = 30.0
"""Stated where there is but one frame and no rate."""
_R_CV_SCENE = np.diag([1.0, -1.0, -1.0])
_STEADY = 0.1
"""Share of a frame by which the times of a video with a constant rate may differ from that rate."""


@dataclass(frozen=True)
class Wishes:
    """What a user wants of an export; None and () leave it as it is."""

    fps: float | None = None
    people: tuple[int, ...] = ()
    start_s: float | None = None
    end_s: float | None = None
    """Frames with start ≤ time < end are kept; seconds from the first frame on, as the page of the run shows them."""
    up: Up | None = None
    unit: Unit | None = None
    keep_unseen: bool = False
    """Show people in scenes also where they were not observed for more than `UNSEEN_S`."""


@dataclass(frozen=True, eq=False)
class Excerpt:
    """People and cameras as they go into a file: F frames from 0 on. The recording itself stays z up, in metres."""

    recording: Recording
    source_frame: Int[np.ndarray, " F"]
    """Frame of the video that is nearest to each time."""
    resampled: bool
    fps: float
    """Rate of the frames for files that state only one; the mean where it varies."""
    up: Up
    unit: Unit
    R_file_world: Float[np.ndarray, "3 3"]
    """World axes (z up) to those of the file. With y up: x stays, z becomes y, y becomes −z."""
    R_file_body: Float[np.ndarray, "3 3"]
    """Axes of the body at rest (y up) to those of the file, so that the rest pose stands upright there."""
    hidden: Mapping[int, Bool[np.ndarray, " F"]] = field(default_factory=dict)
    """By person, the frames in which scenes hide him although his motion is filled in."""
    scenery: WorldScenery = field(default_factory=dict)
    """For files that have a place for it."""

    @property
    def scale(self) -> float:
        """Units of the file per metre."""
        return UNITS_PER_METRE[self.unit]

    @property
    def seconds(self) -> Float[np.ndarray, " F"]:
        """Time of each frame from the excerpt's first."""
        return np.asarray(self.recording.time_s - self.recording.time_s[0])

    def points(self, points_world: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3"]:
        """World points, metres, in the axes and the unit of the file, float64."""
        return np.asarray(self.scale * (np.asarray(points_world, np.float64) @ self.R_file_world.T))

    def rest_joints(self, person: RecordedPerson) -> Float[np.ndarray, "J 3"]:
        """Joints of the rest pose of the person's body (`body_of`) in the axes and the unit of the file.

        InputError for another body model.
        """
        self._expect_body24()
        return np.asarray(self.scale * body_of(person).rest_joints(person.betas) @ self.R_file_body.T)

    def local_rotations(self, person: RecordedPerson, rows: slice) -> Float[np.ndarray, "n J 3 3"]:
        """Each joint relative to its parent, the pelvis to the file's axes; they pose `rest_joints`."""
        A = self.R_file_body
        R = local_rotations(rotvec_to_rotmat(person.root_orient[rows]), person.pose(rows))
        R = A @ R @ A.T
        R[:, 0] = self.R_file_world @ rotvec_to_rotmat(person.root_orient[rows]) @ A.T
        return np.asarray(R)

    def cameras(self, frames: slice) -> tuple[Float[np.ndarray, "n 3 3"], Float[np.ndarray, "n 3"]]:
        """Rotation and centre of cameras in the file. Camera axes are those of glTF, USD and Blender: y up, z back."""
        R_world_cam = self.recording.R_world_cam[frames].astype(np.float64)
        return self.R_file_world @ R_world_cam @ _R_CV_SCENE, self.points(self.recording.t_world_cam[frames])

    def shown(self, person: RecordedPerson) -> Bool[np.ndarray, " F"]:
        """The frames in which a scene shows a person: from his first to his last, but for the `hidden` ones."""
        there = np.zeros(self.recording.num_frames, bool)
        there[person.frame] = True
        return there & ~self.hidden[person.person] if person.person in self.hidden else there

    def shots(self) -> list[slice]:
        """Frames of each shot."""
        return [slice(*span) for span in self.recording.shot_spans]

    def shot_of(self, frames: slice) -> int:
        """The number of one of `shots` in the video."""
        return int(self.recording.shot_index[frames.start])

    def _expect_body24(self) -> None:
        if self.recording.body_model != "body24":
            raise InputError(
                f"the run has the body model {self.recording.body_model!r}; a skeleton can be written of body24 alone"
            )


def excerpt(recording: Recording, wishes: Wishes, *, up: Up, unit: Unit, fps: float | None = None) -> Excerpt:
    """The part of a recording that a user wishes. `up`, `unit` and `fps` are the format's own, for what he leaves open.

    `fps` None keeps the frames of the video. InputError if there is no such person, rate or time.
    """
    rate = wishes.fps if wishes.fps is not None else fps
    if rate is not None and not 0 < rate <= MAX_FPS:
        raise InputError(f"{rate:g} frames per second cannot be written; expected more than 0, at most {MAX_FPS:g}")
    frames = _frames_between(recording.time_s - recording.time_s[0], wishes.start_s, wishes.end_s)
    part = _slice(_with_people(recording, wishes.people), frames)
    source_frame = np.arange(frames.start, frames.stop)
    resampled = (
        rate is not None and part.num_frames > 1 and not (is_steady(part) and np.isclose(rate, part.fps, _SAME_RATE))
    )
    if resampled:
        assert rate is not None
        part, nearest = resample(part, rate)
        source_frame = source_frame[nearest]
    up, unit = wishes.up or up, wishes.unit or unit
    if up not in get_args(Up) or unit not in UNITS_PER_METRE:
        raise InputError(f"{up!r} cannot be up, or {unit!r} is no unit; expected y or z, and m, cm or mm")
    R_file_world, R_file_body = (np.eye(3), R_ZUP_YUP) if up == "z" else (R_ZUP_YUP.T, np.eye(3))
    shown_hz = rate or part.fps or _SINGLE_FRAME_HZ
    unseen = {} if wishes.keep_unseen else {one.person: unseen_for_long(recording, one) for one in recording.people}
    hidden = {one.person: unseen[one.person][source_frame] for one in part.people if one.person in unseen}
    return Excerpt(part, source_frame, resampled, shown_hz, up, unit, R_file_world, R_file_body, hidden)


def unseen_for_long(recording: Recording, person: RecordedPerson) -> Bool[np.ndarray, " F"]:
    """The frames of spans in which a person is not observed for more than `UNSEEN_S`."""
    unseen = np.zeros(recording.num_frames, bool)
    for start, end in runs_of_true(~person.observed):
        before, after = person.frame[max(start - 1, 0)], person.frame[min(end, len(person.frame) - 1)]
        if recording.time_s[after] - recording.time_s[before] > UNSEEN_S:
            unseen[person.frame[start:end]] = True
    return unseen


def is_steady(recording: Recording) -> bool:
    """Whether the frames come at a constant rate, to a tenth of a frame."""
    steps = np.arange(recording.num_frames)
    late = (recording.time_s - recording.time_s[0]) * recording.fps - steps
    return bool(np.abs(late).max() <= _STEADY)


def resample(recording: Recording, fps: float) -> tuple[Recording, Int[np.ndarray, " n"]]:
    """The recording at a constant rate, from its first frame on, and the old frame that is nearest to each new one.

    Contacts are interpolated too; what is neither a position nor a rotation comes from the nearest frame.
    """
    known_s = recording.time_s
    count = int((known_s[-1] - known_s[0]) * fps + _SAME_TIME_S * fps) + 1
    at_s = np.minimum(known_s[0] + np.arange(count) / fps, known_s[-1])
    nearest = _nearest(at_s, known_s)
    shot_index = recording.shot_index[nearest]
    R, t, K = (
        np.array(array[nearest], np.float64) for array in (recording.R_world_cam, recording.t_world_cam, recording.K)
    )
    for shot in np.unique(shot_index):
        new, old = shot_index == shot, recording.shot_index == shot
        R[new] = interpolate_rotations(at_s[new], known_s[old], np.asarray(recording.R_world_cam[old], np.float64))
        t[new] = _linear(at_s[new], known_s[old], recording.t_world_cam[old])
        K[new] = _linear(at_s[new], known_s[old], recording.K[old])
    resampled = dataclasses.replace(
        recording,
        time_s=at_s,
        shot_index=shot_index,
        cut_frames=_cut_frames(shot_index),
        R_world_cam=R.astype(np.float32),
        t_world_cam=t.astype(np.float32),
        K=K.astype(np.float32),
        camera_source=recording.camera_source[nearest],
        people=tuple(_resampled_person(person, at_s, known_s) for person in recording.people),
    )
    return resampled, nearest


def continuous_quaternions(R: Float[np.ndarray, "n *joints 3 3"]) -> Float[np.ndarray, "n *joints 4"]:
    """Unit quaternions (w, x, y, z) over time, with signs that make neighbours agree: the short way between them."""
    wxyz = rotmat_to_unitquat_wxyz(R)
    agree = np.sum(wxyz[1:] * wxyz[:-1], axis=-1) >= 0
    wxyz[1:] *= np.cumprod(np.where(agree, 1.0, -1.0), axis=0)[..., None]
    return wxyz


def _resampled_person(person: RecordedPerson, at_s: np.ndarray, known_s: np.ndarray) -> RecordedPerson:
    own_s = known_s[person.frame]
    inside = (at_s >= own_s[0] - _SAME_TIME_S) & (at_s <= own_s[-1] + _SAME_TIME_S)
    if not inside.any():  # all his frames lie between two new ones
        inside[np.argmin(np.abs(at_s - own_s[0]))] = True
    frame = np.flatnonzero(inside)
    new_s = at_s[frame]
    R_root = interpolate_rotations(new_s, own_s, rotvec_to_rotmat(person.root_orient))
    pose = _resampled_rotations(person.body_pose, new_s, own_s)
    pelvis = _linear(new_s, own_s, person.pelvis)
    rest = load_body().rest_joints(person.betas)
    joints = np.empty((len(frame), NUM_JOINTS, 3), np.float32)
    for rows in chunks(len(frame)):
        joints[rows] = forward_kinematics(rest, R_root[rows], pose[rows], pelvis[rows])[0]
    nearest = _nearest(new_s, own_s)
    return dataclasses.replace(
        person,
        frame=frame.astype(np.int32),
        root_orient=continuous_rotvec(R_root).astype(np.float32),
        body_pose=pose.astype(np.float32),
        transl=_linear(new_s, own_s, person.transl).astype(np.float32),
        joints=joints,
        contacts=_linear(new_s, own_s, person.contacts).astype(np.float32),
        **_resampled_hands(person, new_s, own_s),
        **{name: getattr(person, name)[nearest] for name in ("observed", "keypoints2d", "bbox", "confidence")},
    )


def _resampled_rotations(
    vectors: Float[np.ndarray, "N joints 3"], new_s: np.ndarray, own_s: np.ndarray
) -> Float[np.ndarray, "n joints 3"]:
    resampled = np.empty((len(new_s), *vectors.shape[1:]))
    for joint in range(vectors.shape[1]):
        R = interpolate_rotations(new_s, own_s, rotvec_to_rotmat(vectors[:, joint]))
        resampled[:, joint] = rotmat_to_rotvec(R)
    return resampled


def _resampled_hands(person: RecordedPerson, new_s: np.ndarray, own_s: np.ndarray) -> dict[str, Any]:
    if person.hand_pose is None or person.hand_confidence is None:
        return {}
    return {
        "hand_pose": _resampled_rotations(person.hand_pose, new_s, own_s).astype(np.float32),
        "hand_confidence": _linear(new_s, own_s, person.hand_confidence).astype(np.float32),
    }


def _nearest(at_s: np.ndarray, known_s: np.ndarray) -> Int[np.ndarray, " n"]:
    """The index of the known time that is nearest to each other time; of two as near, the earlier."""
    return np.searchsorted((known_s[:-1] + known_s[1:]) / 2, at_s - _SAME_TIME_S)


def _linear(at: np.ndarray, known_at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values interpolated on straight lines over the first axis; the ends are held."""
    flat = np.asarray(values, np.float64).reshape(len(known_at), -1)
    columns = [np.interp(at, known_at, column) for column in flat.T]
    return np.stack(columns, axis=1).reshape(len(at), *values.shape[1:])


def _with_people(recording: Recording, numbers: Sequence[int]) -> Recording:
    there = {person.person: person for person in recording.people}
    for number in numbers:
        if number not in there:
            raise InputError(f"there is no person {number}; the run has {', '.join(map(str, there)) or 'nobody'}")
    return dataclasses.replace(recording, people=tuple(there[n] for n in there if n in numbers or not numbers))


def _frames_between(times: Float[np.ndarray, " F"], start_s: float | None, end_s: float | None) -> slice:
    first = 0 if start_s is None else int(np.searchsorted(times, start_s - _SAME_TIME_S))
    stop = len(times) if end_s is None else int(np.searchsorted(times, end_s - _SAME_TIME_S))
    if first >= stop:
        start, end = times[0] if start_s is None else start_s, times[-1] if end_s is None else end_s
        known = f"the video runs from {times[0]:.2f} s to {times[-1]:.2f} s"
        raise InputError(f"there is no frame from {start:g} s to {end:g} s; {known}")
    return slice(first, stop)


def _slice(recording: Recording, frames: slice) -> Recording:
    people = []
    for person in recording.people:
        rows = (person.frame >= frames.start) & (person.frame < frames.stop)
        if rows.any():
            arrays_of = {name: values for name, values in vars(person).items() if _is_over_time(name)}
            over_time = {name: values[rows] for name, values in arrays_of.items() if values is not None}
            over_time["frame"] = (over_time["frame"] - frames.start).astype(np.int32)
            people.append(dataclasses.replace(person, **over_time))
    names = ("time_s", "shot_index", "R_world_cam", "t_world_cam", "K", "camera_source")
    arrays = {name: getattr(recording, name)[frames] for name in names}
    return dataclasses.replace(recording, people=tuple(people), cut_frames=_cut_frames(arrays["shot_index"]), **arrays)


def _is_over_time(name: str) -> bool:
    return name not in ("person", "betas", "probability")


def _cut_frames(shot_index: np.ndarray) -> tuple[int, ...]:
    return tuple(int(frame) for frame in np.flatnonzero(np.diff(shot_index)) + 1)
