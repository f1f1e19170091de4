"""ms-AIST at geometry level: real detections of real calibrated cameras, cut at random as the paper does (section 4).

AIST's cameras all stand; the detections are COCO-17 keypoints, so that 3D landmarks, masks and colours are missing and
the pipeline starts from 2D alone. The truth are joints triangulated from all cameras.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.benchmark.coco import coco_track
from humanmm.models.camera.intrinsics import default_focal_px
from humanmm.models.evaluation.people import projected_boxes
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.sequence import CameraSequence, MotionSequence, PersonSequence
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.synthetic.multishot import (
    BenchVideo,
    VideoPlan,
    another_camera,
    cut_times,
    facts_of,
    hard_cuts,
    split_name,
)

Array = np.ndarray

COCO_NAMES = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle",
    "right_ankle",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class AistSequence:
    """One dance, F frames, seen by C standing cameras; metres, world z up."""

    name: str
    sha256: str
    """Of the file it was read from."""
    fps: float
    keypoints: Float[Array, "C F 17 3"]
    """Source pixels and score."""
    joints: Float[Array, "F 17 3"]
    K: Float[Array, "C 3 3"]
    R_world_cam: Float[Array, "C 3 3"]
    t_world_cam: Float[Array, "C 3"]
    size: tuple[int, int]

    @property
    def num_frames(self) -> int:
        return len(self.joints)


def build_aist(sequence: AistSequence, plan: VideoPlan) -> BenchVideo:
    """The video of a plan; the same plan gives the same video. Cuts are given, as in ms-Mocap."""
    rng = np.random.default_rng((*plan.seed, plan.num_transitions))
    n = min(sequence.num_frames, plan.longest)
    first = int(rng.integers(sequence.num_frames - n + 1))
    cuts = cut_times(n, plan.num_transitions, sequence.fps, rng)
    spans = list(zip([0, *cuts], [*cuts, n], strict=True))
    facts = facts_of(n, sequence.fps, sequence.size)
    focal = default_focal_px(*sequence.size)
    rough = np.array([[focal, 0, sequence.size[0] / 2], [0, focal, sequence.size[1] / 2], [0, 0, 1.0]])
    camera, number = np.zeros(n, np.int64), -1
    people, points = [], []
    for start, end in spans:
        number = another_camera(number, len(sequence.K), rng)
        camera[start:end] = number
        frame = np.arange(start, end)
        seen = sequence.keypoints[number, first + start : first + end]
        track = coco_track(frame, seen, time_s=facts.time_s[start:end], K=rough, size=sequence.size)
        people.append(ScenePeople(start, end, (track,) if len(track.frame) else ()))
        points.append(_no_background(start, end))
    return BenchVideo(
        name=plan.name,
        split=split_name(plan.num_transitions),
        facts=facts,
        scenes=hard_cuts(n, cuts),
        people=tuple(people),
        points=tuple(points),
        truth=_truth(sequence, first, camera, cuts),
        static_cameras=True,
    )


def _no_background(start: int, end: int) -> PointTracks:
    none = np.zeros(0, np.int32)
    return PointTracks(start, end, none, none, np.zeros((0, 2), np.float32), np.zeros(0, np.float32), window_px=1.0)


def _truth(sequence: AistSequence, first: int, camera: Array, cuts: tuple[int, ...]) -> MotionSequence:
    n = len(camera)
    cameras = CameraSequence(sequence.R_world_cam[camera], sequence.t_world_cam[camera], sequence.K[camera])
    frame, joints = np.arange(n), sequence.joints[first : first + n]
    person = PersonSequence(
        person=0,
        frame=frame,
        observed=np.isfinite(joints).all(axis=(1, 2)),
        joints=joints,
        bbox_xyxy=projected_boxes(joints, frame, cameras),
    )
    return MotionSequence(n, sequence.fps, COCO_NAMES, (person,), tuple((cut, cut) for cut in cuts), cameras)
