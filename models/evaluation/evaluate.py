"""All figures of a predicted sequence against a true one, gathered into one report.

Errors are over the frames that both have; people are matched by their boxes; a figure is the mean over the truth's
people.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from functools import partial
from typing import TypeVar

import numpy as np

from humanmm.models.evaluation import cameras, contacts, orientation, pose, smoothness, trajectory
from humanmm.models.evaluation.cuts import score_cuts
from humanmm.models.evaluation.pairs import Pair, known_rows, make_pair
from humanmm.models.evaluation.people import alone_without_boxes, match_sequences
from humanmm.models.evaluation.report import CameraFigures, PersonFigures, PersonReport, Report, ShotReport, mean_of
from humanmm.models.evaluation.skeleton import FOOT_NAMES, indices, pick, shared_names
from humanmm.models.evaluation.vertices import pve_mm
from humanmm.models.records.sequence import (
    CameraSequence,
    MotionSequence,
    PersonSequence,
    UndefinedFigureError,
    part_of,
)

T = TypeVar("T")

FPS_TOLERANCE = 0.01
"""Frame rates that differ by more than this fraction belong to different videos."""

LARGEST_BODY_M = 20.0
"""Nobody's joints are further apart than this in one frame."""


class Problems:
    """Collects what could not be had, one sentence each."""

    def __init__(self) -> None:
        self.sentences: list[str] = []

    def note(self, sentence: str) -> None:
        """Add a sentence, once."""
        if sentence not in self.sentences:
            self.sentences.append(sentence)

    def figure(self, names: str, compute: Callable[[], T]) -> T | None:
        """What `compute` returns, or None with the reason noted."""
        try:
            return compute()
        except UndefinedFigureError as reason:
            self.note(f"{names}: {reason}.")
            return None


def evaluate(prediction: MotionSequence, truth: MotionSequence) -> Report:
    """Every figure of the prediction against the truth."""
    problems = Problems()
    for sequence, side in ((truth, "truth"), (prediction, "prediction")):
        for note in sequence.notes:
            problems.note(f"{side}: {note}")
        for person in sequence.people:
            _note_size(person, side, problems)
    if prediction.num_frames != truth.num_frames:
        problems.note(
            f"The prediction has {prediction.num_frames} frames and the truth {truth.num_frames}; "
            "frames are compared by number."
        )
    if abs(prediction.fps / truth.fps - 1.0) > FPS_TOLERANCE:
        problems.note(f"The prediction runs at {prediction.fps:.3f} fps, the truth at {truth.fps:.3f}, which is used.")
    cuts = score_cuts(prediction.cut_frames, truth.transitions)
    people = _people(prediction, truth, match_sequences(prediction, truth), problems)
    return Report(
        cut_precision=cuts.precision,
        cut_recall=cuts.recall,
        cut_f1=cuts.f1,
        **asdict(_mean(people)),
        **asdict(_cameras(prediction, truth, problems)),
        problems=tuple(problems.sentences),
        people=tuple(people),
    )


def _note_size(person: PersonSequence, side: str, problems: Problems) -> None:
    """A word on joints that cannot be in metres."""
    known = person.joints[np.isfinite(person.joints).all(axis=(1, 2))]
    size_m = float(np.ptp(known, axis=1).max(initial=0.0))
    if size_m > LARGEST_BODY_M:
        problems.note(
            f"{side}: the joints of person {person.person:02d} are up to {size_m:.0f} m apart in one frame; expected "
            "metres: are they in millimetres?"
        )


def shot_reports(prediction: MotionSequence, truth: MotionSequence) -> tuple[ShotReport, ...]:
    """The figures of each of the truth's shots, as if the video were that shot; people are who they are in the whole
    video."""
    match = match_sequences(prediction, truth)
    common = min(prediction.num_frames, truth.num_frames)
    reports = []
    for number, (start, end) in enumerate(truth.shots_outside_transitions):
        if start < min(end, common):
            figures, camera = _shot(prediction, truth, match, start, min(end, common))
            reports.append(ShotReport(number, start, min(end, common), figures, camera))
    return tuple(reports)


def _shot(
    prediction: MotionSequence, truth: MotionSequence, match: Mapping[int, int], start: int, end: int
) -> tuple[PersonFigures, CameraFigures]:
    predicted, true = (part_of(sequence, start, end) for sequence in (prediction, truth))
    seen = [index for index, person in enumerate(true.people) if person.observed.any()]
    of_seen = {row: match[index] for row, index in enumerate(seen) if index in match}
    true = replace(true, people=tuple(true.people[index] for index in seen))
    problems = Problems()  # what a shot lacks is null, and the whole video's problems say why
    return _mean(_people(predicted, true, of_seen, problems)), _cameras(predicted, true, problems)


def _people(
    prediction: MotionSequence, truth: MotionSequence, match: Mapping[int, int], problems: Problems
) -> list[PersonReport]:
    """A report of each of the truth's people; `match`: index in the prediction of those who are found."""
    if not truth.people:
        problems.note("The truth has no people, so every figure of a person is missing.")
        return []
    if alone_without_boxes(prediction, truth):
        problems.note("One side has no boxes; its only person is taken for the other's only person.")
    reports = []
    for index, person in enumerate(truth.people):
        label = f"person {person.person:02d}"
        if index not in match:
            problems.note(
                f"No predicted person overlaps the truth's {label}: coverage 0, and no part in the mean errors."
            )
            reports.append(PersonReport(person.person, None, 0, 0.0, PersonFigures(coverage=0.0)))
            continue
        matched = prediction.people[match[index]]
        suffix = f" of {label}" if len(truth.people) > 1 else ""
        pair = problems.figure(
            f"every error{suffix}",
            partial(make_pair, matched, person, predicted_sequence=prediction, truth_sequence=truth),
        )
        covered = problems.figure(
            f"coverage{suffix}", partial(_coverage, matched, person, prediction=prediction, truth=truth)
        )
        with_observed = covered or (None, None)
        if pair is None:
            alone = PersonFigures(coverage=with_observed[0])
            reports.append(PersonReport(person.person, matched.person, 0, with_observed[1], alone))
            continue
        missing = len(person.frame) - len(pair.frame)
        if missing:
            problems.note(
                f"{missing} of {len(person.frame)} frames of the truth's {label} are in no error: a side lacks joints, "
                "or has all of them on one line."
            )
        figures = _person(pair, with_observed[0], suffix, prediction=prediction, truth=truth, problems=problems)
        reports.append(PersonReport(person.person, matched.person, len(pair.frame), with_observed[1], figures))
    return reports


def _coverage(
    predicted: PersonSequence, person: PersonSequence, *, prediction: MotionSequence, truth: MotionSequence
) -> tuple[float, float]:
    """Predicted ∧ truth-observed frames / truth-observed frames; and the same of predicted frames that are observed."""
    names = shared_names(prediction.joint_names, truth.joint_names)
    if names is None:
        raise UndefinedFigureError("truth and prediction share no skeleton")
    rows = known_rows(predicted, prediction.joint_names, names)
    of_all, of_observed = predicted.frame[rows], predicted.frame[rows[predicted.observed[rows]]]
    wanted = person.frame[person.observed]
    if len(wanted) == 0:
        raise UndefinedFigureError("the truth observes the person in no frame")
    return float(np.isin(wanted, of_all).mean()), float(np.isin(wanted, of_observed).mean())


def _person(
    pair: Pair,
    coverage: float | None,
    suffix: str,
    *,
    prediction: MotionSequence,
    truth: MotionSequence,
    problems: Problems,
) -> PersonFigures:
    def figure(names: str, compute: Callable[[], T]) -> T | None:
        return problems.figure(names + suffix, compute)

    frame, fps = pair.frame, truth.fps
    relative_predicted, relative_truth = pair.about_hips
    aligned = pose.rotated_by_one_yaw(relative_predicted, relative_truth)
    root_predicted, root_truth = pair.roots
    R_predicted, R_truth = pair.orientations
    sliding = figure("foot_sliding_mm, foot_sliding_gt_mm", lambda: _sliding(pair, prediction=prediction, truth=truth))
    jump = figure("cut_jump_m, cut_jump_deg", lambda: _jumps(pair, truth.cut_frames, problems))
    return PersonFigures(
        coverage=coverage,
        pa_mpjpe_mm=pose.pa_mpjpe_mm(pair.joints_predicted, pair.joints_truth),
        mpjpe_mm=pose.point_error_mm(aligned, relative_truth),
        mpjpe_cam_mm=figure("mpjpe_cam_mm", lambda: _in_camera(pair, *_camera_rotations(pair, prediction, truth))),
        pve_mm=figure("pve_mm", lambda: _vertices(pair, prediction=prediction, truth=truth)),
        wa_mpjpe100_mm=trajectory.chunked_mpjpe_mm(pair.joints_predicted, pair.joints_truth, align_frames=None),
        w_mpjpe100_mm=trajectory.chunked_mpjpe_mm(pair.joints_predicted, pair.joints_truth, align_frames=2),
        rte_pct=figure("rte_pct", lambda: trajectory.root_trajectory_error_pct(root_predicted, root_truth)),
        rte_m=trajectory.root_trajectory_error_m(root_predicted, root_truth),
        roe_deg=orientation.root_orientation_error_deg(R_predicted, R_truth),
        roe_yaw_deg=orientation.heading_error_deg(R_predicted, R_truth),
        accel_ms2=figure(
            "accel_ms2",
            lambda: smoothness.acceleration_error_ms2(aligned, relative_truth, frame=frame, fps=fps),
        ),
        jitter=figure("jitter", lambda: smoothness.jitter_10ms3(pair.joints_predicted, frame=frame, fps=fps)),
        jitter_gt=figure("jitter_gt", lambda: smoothness.jitter_10ms3(pair.joints_truth, frame=frame, fps=fps)),
        foot_sliding_mm=sliding[0] if sliding else None,
        foot_sliding_gt_mm=sliding[1] if sliding else None,
        cut_jump_m=jump[0] if jump else None,
        cut_jump_deg=jump[1] if jump else None,
    )


def _camera_rotations(pair: Pair, prediction: MotionSequence, truth: MotionSequence) -> tuple[np.ndarray, np.ndarray]:
    """R_world_cam of the pair's frames on both sides; raises where one is not known."""
    both = []
    for sequence, side in ((prediction, "prediction"), (truth, "truth")):
        if sequence.cameras is None:
            raise UndefinedFigureError(f"the {side} has no cameras")
        R = sequence.cameras.R_world_cam[pair.frame]
        unknown = int((~np.isfinite(R).all(axis=(1, 2))).sum())
        if unknown:
            raise UndefinedFigureError(f"the {side}'s camera is not known in {unknown} common frames")
        both.append(R)
    return both[0], both[1]


def _in_camera(pair: Pair, R_predicted: np.ndarray, R_truth: np.ndarray) -> float:
    relative_predicted, relative_truth = pair.about_hips
    return pose.point_error_mm(
        pose.in_camera_axes(relative_predicted, R_predicted), pose.in_camera_axes(relative_truth, R_truth)
    )


def _vertices(pair: Pair, *, prediction: MotionSequence, truth: MotionSequence) -> float:
    R_predicted, R_truth = _camera_rotations(pair, prediction, truth)
    return pve_mm(
        pair.predicted.body,
        pair.truth.body,
        predicted_rows=pair.rows_predicted,
        truth_rows=pair.rows_truth,
        R_world_cam_predicted=R_predicted,
        R_world_cam_truth=R_truth,
    )


def _sliding(pair: Pair, *, prediction: MotionSequence, truth: MotionSequence) -> tuple[float, float]:
    """Foot sliding of the prediction and of the truth, mm per frame, over the feet that both skeletons have."""
    shared = [
        column
        for column, name in enumerate(FOOT_NAMES)
        if indices(prediction.joint_names, (name,)) is not None and indices(truth.joint_names, (name,)) is not None
    ]
    names = tuple(FOOT_NAMES[column] for column in shared)
    if not names:
        raise UndefinedFigureError("the skeletons share no foot joint")
    feet_predicted = pick(pair.predicted.joints[pair.rows_predicted], prediction.joint_names, names)
    feet_truth = pick(pair.truth.joints[pair.rows_truth], truth.joint_names, names)
    if pair.truth.contacts is not None:
        standing = contacts.standing_steps(pair.truth.contacts[pair.rows_truth][:, shared], pair.frame)
    else:
        standing = contacts.slow_steps(feet_truth, pair.frame, fps=truth.fps)
    standing &= np.isfinite(feet_predicted[1:] - feet_predicted[:-1]).all(axis=-1)
    return contacts.foot_sliding_mm(feet_predicted, standing), contacts.foot_sliding_mm(feet_truth, standing)


def _jumps(pair: Pair, cut_frames: tuple[int, ...], problems: Problems) -> tuple[float, float]:
    """Worst jump of the root over the truth's cuts: (metres, degrees)."""
    if not cut_frames:
        raise UndefinedFigureError("the truth has no cut")
    root_predicted, root_truth = pair.roots
    R_predicted, R_truth = pair.orientations
    metres, degrees = [], []
    for cut in cut_frames:
        rows = pair.rows_across(cut)
        if rows is None:
            problems.note(f"cut_jump_m, cut_jump_deg: the cut at {cut} is left out: a frame beside it is missing.")
            continue
        metres.append(
            trajectory.cut_jump_m(
                root_predicted=root_predicted[rows],
                root_truth=root_truth[rows],
                R_predicted=R_predicted[rows[0]],
                R_truth=R_truth[rows[0]],
            )
        )
        degrees.append(trajectory.cut_jump_deg(R_predicted[rows], R_truth[rows]))
    if not metres:
        raise UndefinedFigureError("no cut has both its neighbouring frames in truth and prediction")
    return max(metres), max(degrees)


def _cameras(prediction: MotionSequence, truth: MotionSequence, problems: Problems) -> CameraFigures:
    sides = (prediction.cameras, truth.cameras)
    if sides[0] is None or sides[1] is None:
        side = "prediction" if sides[0] is None else "truth"
        problems.note(f"{', '.join(field.name for field in fields(CameraFigures))}: the {side} has no cameras.")
        return CameraFigures()
    common = min(prediction.num_frames, truth.num_frames)
    predicted, true = (_first(side, common) for side in sides if side is not None)
    usable = cameras.known(predicted) & cameras.known(true)
    if not usable.all():
        problems.note(
            f"{int((~usable).sum())} of {common} frames are in no camera error: one side's camera is not known."
        )
    shots = [(start, min(end, common)) for start, end in truth.shots_outside_transitions if start < common]
    steps = problems.figure(
        "cam_rpe_rot_deg, cam_rpe_trans_m",
        lambda: cameras.relative_pose_errors(predicted, true, shots=shots, usable=usable),
    )
    at_cuts = cameras.cut_rotation_errors_deg(predicted, true, transitions=truth.transitions, usable=usable)
    if truth.unlinked_cuts:
        problems.note(
            "The shots lie in worlds that nothing joins: cam_ate_m is missing, cam_cut_rot_deg null between them."
        )
        at_cuts = [
            None if cut in truth.unlinked_cuts else error for cut, error in zip(truth.cut_frames, at_cuts, strict=True)
        ]
    elif None in at_cuts:
        problems.note("cam_cut_rot_deg: the camera is not known on both sides of every cut; those are null.")
    return CameraFigures(
        cam_ate_m=None
        if truth.unlinked_cuts
        else _trajectory_error_m(predicted.t_world_cam[usable], true.t_world_cam[usable], problems),
        cam_rpe_rot_deg=steps[0] if steps else None,
        cam_rpe_trans_m=steps[1] if steps else None,
        cam_cut_rot_deg=at_cuts,
        cam_shot_drift_deg=problems.figure(
            "cam_shot_drift_deg", lambda: cameras.shot_drift_deg(predicted, true, shots=shots, usable=usable)
        ),
        focal_err_pct=problems.figure("focal_err_pct", lambda: cameras.focal_error_pct(predicted.K, true.K)),
    )


def _trajectory_error_m(predicted: np.ndarray, true: np.ndarray, problems: Problems) -> float | None:
    error_m = problems.figure("cam_ate_m", lambda: cameras.absolute_trajectory_error_m(predicted, true))
    if error_m is not None and cameras.stands_in_two_places(true):
        problems.note(
            "cam_ate_m says nothing of where the cameras stand: the true ones stand in two places, and a similarity "
            "takes any two to these."
        )
    return error_m


def _first(camera: CameraSequence, num_frames: int) -> CameraSequence:
    return CameraSequence(camera.R_world_cam[:num_frames], camera.t_world_cam[:num_frames], camera.K[:num_frames])


def _mean(people: Sequence[PersonReport]) -> PersonFigures:
    """Mean over the people who have the figure; None where none has it."""
    names = [field.name for field in fields(PersonFigures)]
    return PersonFigures(**{name: mean_of([getattr(one.figures, name) for one in people]) for name in names})
