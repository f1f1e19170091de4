"""One method's motion of one video against the truth."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from humanmm.models.benchmark.methods import MethodMotion, VideoMotions
from humanmm.models.benchmark.oracles import with_true_cuts
from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.evaluation.after_cuts import anchor_mpjpe_mm, root_errors_after_cuts_m
from humanmm.models.evaluation.cameras import errors_inside_shots_m, known, rotation_across
from humanmm.models.evaluation.contacts import contact_f1
from humanmm.models.evaluation.cuts import GRADUAL_TOLERANCE_FRAMES
from humanmm.models.evaluation.evaluate import evaluate
from humanmm.models.evaluation.people import identity_f1
from humanmm.models.evaluation.report import MEANINGS
from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.motion.assemble import assemble, world_joints
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.recording import Recording
from humanmm.models.records.sequence import (
    BodyParameters,
    CameraSequence,
    MotionSequence,
    PersonSequence,
    UndefinedFigureError,
)
from humanmm.models.synthetic.multishot import BenchVideo

FIGURES = tuple(name for name in MEANINGS if name != "cam_cut_rot_deg")
"""Figures of a video that are single numbers."""


@dataclass(frozen=True)
class Figure:
    """One figure of one video."""

    name: str
    value: float


@dataclass(frozen=True)
class CutError:
    """What is wrong at a true cut between shots of one place."""

    angle_deg: float
    """True angle between the two cameras."""
    error_deg: float | None
    """Of the camera's rotation; None where no camera was found."""
    root_m: float | None = None
    """Of the root after the cut, aligned before it; None where nobody was found on both sides."""
    frame: int = 0
    stated_deg: float | None = None
    """Below which the error was said to be with a probability of 68 %; None where nothing was said."""
    stated_95_deg: float | None = None
    """The same with a probability of 95 %."""
    probability: float | None = None
    """That the rotation was said to be the right one."""


@dataclass(frozen=True)
class MethodFigures:
    """One method on one video; no figures where it failed, and its cuts as `failed` has them."""

    method: str
    figures: tuple[Figure, ...]
    cuts: tuple[CutError, ...]
    failure: str = ""


@dataclass(frozen=True)
class VideoFigures:
    """All methods on one video."""

    video: str
    split: str
    methods: tuple[MethodFigures, ...]


def score(video: BenchVideo, motions: VideoMotions) -> VideoFigures:
    """Every figure of every method. Who was not found at all is a failure, as is a motion that was refused.

    Methods that made one and the same of the video are measured once.
    """
    figures: list[MethodFigures] = []
    for done in motions.motions:
        same = (k for k, other in enumerate(motions.motions[: len(figures)]) if _equal(other, done))
        k = next(same, None)
        figures.append(_score(video, done) if k is None else replace(figures[k], method=done.method))
    return VideoFigures(video.name, video.split, tuple(figures))


def _equal(first: MethodMotion, second: MethodMotion) -> bool:
    return first.motion is not None and first.motion is second.motion and first.shots == second.shots


def score_sequence(method: str, predicted: MotionSequence, truth: MotionSequence) -> MethodFigures:
    """The figures of one sequence against its truth."""
    report = evaluate(predicted, truth)
    if report.wa_mpjpe100_mm is None:
        return failed(method, truth, "; ".join(report.problems) or "nobody of the truth was found")
    values = [(name, getattr(report, name)) for name in FIGURES]
    figures = [Figure(name, float(value)) for name, value in values if value is not None]
    errors = report.cam_cut_rot_deg or []
    found = [error for error in errors if error is not None]
    if found:
        figures.append(Figure("cam_cut_rot_deg", float(np.mean(found))))
    figures += _inside_shots(predicted, truth)
    figures.append(Figure("idf1", identity_f1(predicted.people, truth.people)))
    with suppress(UndefinedFigureError):
        figures.append(Figure("contact_f1", contact_f1(predicted, truth)))
    with suppress(UndefinedFigureError):
        figures.append(Figure("anchor_mpjpe_mm", anchor_mpjpe_mm(predicted, truth)))
    cuts = [
        CutError(angle, error, root, cut)
        for angle, error, root, cut in zip(
            cut_angles_deg(truth), errors, root_errors_after_cuts_m(predicted, truth), truth.cut_frames, strict=False
        )
        if cut not in truth.unlinked_cuts
    ]
    return MethodFigures(method, tuple(figures), tuple(cuts))


def failed(method: str, truth: MotionSequence, reason: str) -> MethodFigures:
    """No figures, and every true cut inside a place without a rotation, so that failing hides no wrong cut."""
    cuts = tuple(
        CutError(angle, None, frame=cut)
        for angle, cut in zip(cut_angles_deg(truth), truth.cut_frames, strict=False)
        if cut not in truth.unlinked_cuts
    )
    return MethodFigures(method, (), cuts, reason)


def _inside_shots(predicted: MotionSequence, truth: MotionSequence) -> list[Figure]:
    """The camera's errors shot by shot, each after a similarity of its own; nothing where no true camera moves."""
    sides = (predicted.cameras, truth.cameras)
    if sides[0] is None or sides[1] is None or predicted.num_frames != truth.num_frames:
        return []
    usable = known(sides[0]) & known(sides[1])
    try:
        ate_m, rpe_m = errors_inside_shots_m(sides[0], sides[1], shots=truth.shots_outside_transitions, usable=usable)
    except UndefinedFigureError:
        return []
    return [Figure("cam_shot_ate_m", ate_m), Figure("cam_shot_rpe_trans_m", rpe_m)]


def cut_angles_deg(truth: MotionSequence) -> list[float]:
    """True angle between the cameras on both sides of every cut, degrees."""
    if truth.cameras is None:
        return []
    return [float(np.rad2deg(rotation_angle(rotation_across(truth.cameras, one)))) for one in truth.transitions]


def _score(video: BenchVideo, done: MethodMotion) -> MethodFigures:
    if done.motion is None:
        return failed(done.method, video.truth, done.reason)
    found = score_sequence(done.method, sequence_of(video, done), video.truth)
    return replace(found, cuts=tuple(_as_stated(cut, done.motion) for cut in found.cuts))


def _as_stated(cut: CutError, motion: WorldMotion) -> CutError:
    """With what the motion says of the rotation at the cut."""
    near = [one for one in motion.cuts if abs(one.cut_frame - cut.frame) <= GRADUAL_TOLERANCE_FRAMES]
    if not near:
        return cut
    said = min(near, key=lambda one: abs(one.cut_frame - cut.frame))
    return replace(cut, stated_deg=said.uncertainty_deg, stated_95_deg=said.within_95_deg, probability=said.probability)


def recording_of(video: BenchVideo, done: MethodMotion) -> Recording:
    """The motion as a run folder would hold it."""
    motion, shots, body = done.motion, done.shots, load_body()
    scenes = with_true_cuts(video).people if done.method == "oracle cuts" else video.people
    if motion is None or shots is None:
        raise ValueError(f"{done.method} has no motion")
    rest = {person.person: body.rest_joints(person.betas) for person in motion.people}
    return assemble(
        video.facts,
        shots,
        scenes,
        motion,
        rest_pelvis={number: joints[0] for number, joints in rest.items()},
        joints_world={person.person: world_joints(person, rest[person.person]) for person in motion.people},
    )


def sequence_of(video: BenchVideo, done: MethodMotion) -> MotionSequence:
    """The motion as `humanmm eval` would read it from a run folder."""
    recording, motion, shots = recording_of(video, done), done.motion, done.shots
    if motion is None or shots is None:
        raise ValueError(f"{done.method} has no motion")
    rotations = {person.person: person.R_world_root for person in motion.people}
    people = tuple(
        PersonSequence(
            person=person.person,
            frame=person.frame.astype(np.int64),
            observed=person.observed,
            joints=person.joints.astype(np.float64),
            R_world_root=rotations[person.person],
            contacts=person.contacts.astype(np.float64),
            bbox_xyxy=person.bbox.astype(np.float64),
            body=BodyParameters("body24", person.root_orient, person.body_pose, person.betas, person.transl),
        )
        for person in recording.people
    )
    spans = [shot.transition for shot in shots.shots]
    transitions = tuple((span.start, span.end) for span in spans if span is not None)
    cameras = CameraSequence(motion.R_world_cam, motion.t_world_cam, motion.K)
    return MotionSequence(len(video.facts.time_s), video.truth.fps, JOINT_NAMES, people, transitions, cameras)
