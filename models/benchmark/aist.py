"""ms-AIST at geometry level: real detections of real calibrated cameras, cut at random as the paper does (section 4).

AIST's cameras are all static; the detections are COCO-17 keypoints, so that 3D landmarks, masks and colours are missing
and the pipeline starts from 2D alone. The truth are joints triangulated from all cameras.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.evaluation.people import projected_boxes
from humanmm.models.geometry.axes import R_ZUP_YUP, zup_camera_pose
from humanmm.models.geometry.intrinsics import K_from_focal, default_focal_px
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.perception.interfaces import KeypointLifter
from humanmm.models.perception.lifting.coco import coco_track
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.landmarks import COCO_NAMES
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

RATE_HZ = 30.0
"""Sequences at a multiple of this are thinned out to it, as the paper's videos are."""
_CM = 0.01


@dataclass(frozen=True, eq=False)
class AistSequence:
    """One dance, F frames, seen by C static cameras; metres, world z up."""

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


def aist_sequence(name: str, sha256: str, arrays: Mapping[str, Array], *, joints: str) -> AistSequence:
    """A sequence from AIST++'s arrays (checked; cm, y up), in metres, z up, thinned out to about RATE_HZ.

    `joints`: the array that holds the truth.
    """
    rate = float(np.ravel(arrays["fps"])[0])
    step = max(1, round(rate / RATE_HZ))
    width, height = (int(side) for side in np.ravel(arrays["cam_size"])[:2])
    R_cam_world = rotvec_to_rotmat(arrays["cam_rotvec"].astype(np.float64))
    R_world_cam, t_world_cam = zup_camera_pose(R_cam_world, arrays["cam_t"].astype(np.float64) * _CM)
    return AistSequence(
        name=name,
        sha256=sha256,
        fps=rate / step,
        keypoints=np.nan_to_num(arrays["keypoints2d"][:, ::step].astype(np.float64)),  # nothing found: score 0
        joints=arrays[joints][::step].astype(np.float64) * _CM @ R_ZUP_YUP.T,
        K=arrays["cam_K"].astype(np.float64),
        R_world_cam=R_world_cam,
        t_world_cam=t_world_cam,
        size=(width, height),
    )


def build_aist(sequence: AistSequence, plan: VideoPlan, *, lifter: KeypointLifter) -> BenchVideo:
    """The video of a plan; the same plan gives the same video. Cuts are given, as in ms-Mocap."""
    rng = np.random.default_rng((*plan.seed, plan.num_transitions))
    n = min(sequence.num_frames, plan.longest)
    first = int(rng.integers(sequence.num_frames - n + 1))
    cuts = cut_times(n, plan.num_transitions, sequence.fps, rng)
    spans = list(zip([0, *cuts], [*cuts, n], strict=True))
    facts = facts_of(n, sequence.fps, sequence.size)
    rough = K_from_focal(default_focal_px(*sequence.size), *sequence.size)
    camera, number = np.zeros(n, np.int64), -1
    people, points = [], []
    for start, end in spans:
        number = another_camera(number, len(sequence.K), rng)
        camera[start:end] = number
        frame = np.arange(start, end)
        seen = sequence.keypoints[number, first + start : first + end]
        track = coco_track(frame, seen, time_s=facts.time_s[start:end], K=rough, size=sequence.size, lifter=lifter)
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
