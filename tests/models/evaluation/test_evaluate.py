"""The whole report: zero for equality, what it does not depend on, known answers, and nothing dropped in silence."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.evaluation.evaluate import evaluate, shot_reports
from humanmm.models.evaluation.people import match_people
from humanmm.models.evaluation.report import MEANINGS, Report, report_table, tables_per
from humanmm.models.evaluation.skeleton import LIMB_NAMES, pick
from humanmm.models.geometry.alignment import yaw_to_rotmat
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.sequence import BodyParameters, MotionSequence, PersonSequence

OWN = {"jitter", "jitter_gt", "foot_sliding_mm", "foot_sliding_gt_mm"}
"""Figures of the motion itself, not zero for a perfect prediction."""

PERFECT = {"cut_precision", "cut_recall", "cut_f1", "coverage"}


def errors(report: Report) -> dict[str, float]:
    """Every figure that must be zero for a perfect prediction."""
    flat = {k: v for k, v in report.to_json().items() if k not in OWN | PERFECT | {"problems", "cam_cut_rot_deg"}}
    assert report.cam_cut_rot_deg is not None
    return {**flat, **{f"cut {i}": v for i, v in enumerate(report.cam_cut_rot_deg)}}  # type: ignore[dict-item]


def with_person(sequence: MotionSequence, **changes: object) -> MotionSequence:
    return dataclasses.replace(sequence, people=(dataclasses.replace(sequence.people[0], **changes),))  # type: ignore[arg-type]


def moved(sequence: MotionSequence, *, yaw: float, shift: np.ndarray) -> MotionSequence:
    """The same sequence in a world that is rotated about the vertical and shifted."""
    R, person, cameras = yaw_to_rotmat(yaw), sequence.people[0], sequence.cameras
    assert cameras is not None and person.R_world_root is not None
    cameras = dataclasses.replace(
        cameras, R_world_cam=R @ cameras.R_world_cam, t_world_cam=cameras.t_world_cam @ R.T + shift
    )
    return dataclasses.replace(
        with_person(sequence, joints=person.joints @ R.T + shift, R_world_root=R @ person.R_world_root, body=None),
        cameras=cameras,
    )


def kept(sequence: MotionSequence, rows: np.ndarray) -> MotionSequence:
    """The sequence with only some of the person's rows."""
    person = sequence.people[0]
    changes = {
        field.name: getattr(person, field.name)[rows]
        for field in dataclasses.fields(PersonSequence)
        if isinstance(getattr(person, field.name), np.ndarray)
    }
    return with_person(sequence, **changes, body=None)


def test_equality_is_perfect(sequence: MotionSequence) -> None:
    report = evaluate(sequence, sequence)
    assert report.problems == ()
    assert all(value == pytest.approx(0.0, abs=1e-6) for value in errors(report).values())
    assert all(getattr(report, name) == 1.0 for name in PERFECT)
    assert report.jitter == report.jitter_gt
    assert report.foot_sliding_mm == report.foot_sliding_gt_mm


@settings(max_examples=10, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(-50, 50), st.floats(-50, 50))
def test_nothing_depends_on_the_heading_and_origin_of_the_world(
    sequence: MotionSequence, yaw: float, x: float, y: float
) -> None:
    report = evaluate(moved(sequence, yaw=yaw, shift=np.array([x, y, 0.5])), sequence)
    assert report.pve_mm is None
    assert all(value == pytest.approx(0.0, abs=1e-5) for value in errors(report).values() if value is not None)


def test_a_larger_body_in_a_larger_world_fails_only_where_size_counts(sequence: MotionSequence) -> None:
    report = evaluate(with_person(sequence, joints=1.1 * sequence.people[0].joints), sequence)
    assert report.pa_mpjpe_mm == pytest.approx(0.0, abs=1e-6)
    assert report.wa_mpjpe100_mm == pytest.approx(0.0, abs=1e-6)
    assert report.w_mpjpe100_mm == pytest.approx(0.0, abs=1e-6)
    assert report.rte_m is not None and report.rte_m > 0.05
    assert report.jitter == pytest.approx(1.1 * report.jitter_gt)  # type: ignore[operator]


def test_a_jump_at_the_cut_is_measured_to_the_millimetre(sequence: MotionSequence) -> None:
    joints = sequence.people[0].joints.copy()
    joints[60:] += [0.3, -0.4, 0.0]
    report = evaluate(with_person(sequence, joints=joints), sequence)
    assert report.cut_jump_m == pytest.approx(0.5)
    assert report.cut_jump_deg == pytest.approx(0.0, abs=1e-6)
    assert report.pa_mpjpe_mm == pytest.approx(0.0, abs=1e-6)


def test_sliding_is_the_way_of_the_feet_that_stand_in_the_truth(sequence: MotionSequence) -> None:
    joints = sequence.people[0].joints.copy()
    joints[:, [7, 10]] = [0.0, 0.0, 0.1]
    joints[:, 7, 0] += 0.004 * np.arange(sequence.num_frames)
    report = evaluate(with_person(sequence, joints=joints), sequence)
    assert report.foot_sliding_mm == pytest.approx(2.0)  # 4 mm a frame at the ankle, none at the toes


def test_missing_frames_cost_coverage_and_are_reported(sequence: MotionSequence) -> None:
    report = evaluate(kept(sequence, np.r_[0:60, 73:130]), sequence)
    assert report.coverage == pytest.approx(0.9)
    assert any("13 of 130 frames" in sentence for sentence in report.problems)
    assert report.wa_mpjpe100_mm == pytest.approx(0.0, abs=1e-6)
    assert report.cut_jump_m is None
    assert any("the cut at 60 is left out" in sentence for sentence in report.problems)


def test_frames_that_were_filled_in_count_as_predicted(sequence: MotionSequence) -> None:
    assert evaluate(with_person(sequence, observed=np.zeros(sequence.num_frames, bool)), sequence).coverage == 1.0


def test_coverage_counts_only_frames_in_which_the_truth_sees_the_person(sequence: MotionSequence) -> None:
    seen = np.arange(sequence.num_frames) < 60
    assert evaluate(kept(sequence, np.arange(30)), with_person(sequence, observed=seen)).coverage == 0.5


def test_a_prediction_of_nobody_has_no_coverage_and_no_errors(sequence: MotionSequence) -> None:
    report = evaluate(dataclasses.replace(sequence, people=()), sequence)
    assert report.coverage == 0.0
    assert report.pa_mpjpe_mm is None
    assert any("person 00" in sentence for sentence in report.problems)
    assert report.cam_ate_m == pytest.approx(0.0, abs=1e-9)


def test_people_are_matched_by_their_boxes_not_by_their_numbers(sequence: MotionSequence) -> None:
    person = sequence.people[0]
    assert person.bbox_xyxy is not None
    aside = dataclasses.replace(
        person,
        person=1,
        joints=person.joints + np.array([0.0, 3.0, 0.0]),
        bbox_xyxy=person.bbox_xyxy + np.array([900.0, 0.0, 900.0, 0.0]),
    )
    truth = dataclasses.replace(sequence, people=(person, aside))
    prediction = dataclasses.replace(sequence, people=(aside, person))
    assert match_people(prediction.people, truth.people) == {0: 1, 1: 0}
    assert evaluate(prediction, truth).wa_mpjpe100_mm == pytest.approx(0.0, abs=1e-6)
    half = evaluate(sequence, truth)
    assert half.coverage == 0.5
    assert any("person 01" in sentence for sentence in half.problems)


def test_a_partial_truth_is_compared_on_the_twelve_limb_joints(sequence: MotionSequence) -> None:
    names = tuple(name.replace("_", "") for name in LIMB_NAMES)
    joints = pick(sequence.people[0].joints, sequence.joint_names, LIMB_NAMES)
    partial = with_person(sequence, joints=joints, R_world_root=None, contacts=None, body=None)
    truth = dataclasses.replace(partial, joint_names=names)
    report = evaluate(sequence, truth)
    assert all(value == pytest.approx(0.0, abs=1e-6) for value in errors(report).values() if value is not None)
    assert report.roe_deg is not None
    assert report.pve_mm is None
    assert any(sentence.startswith("pve_mm") for sentence in report.problems)


def test_frames_with_unknown_true_joints_are_reported(sequence: MotionSequence) -> None:
    joints = sequence.people[0].joints.copy()
    joints[5:9, 18] = np.nan
    report = evaluate(sequence, with_person(sequence, joints=joints))
    assert any("4 of 130 frames" in sentence for sentence in report.problems)


@pytest.mark.parametrize("side", ["prediction", "truth"])
def test_frames_whose_joints_lie_on_one_line_are_in_no_error_and_reported(sequence: MotionSequence, side: str) -> None:
    joints = sequence.people[0].joints.copy()
    joints[5:7] = 0.0
    joints[7:9] = np.arange(joints.shape[1])[:, None] * [0.1, -0.2, 0.3] + [100.0, 50.0, 0.1]
    flat = with_person(sequence, joints=joints)
    report = evaluate(flat, sequence) if side == "prediction" else evaluate(sequence, flat)
    assert report.pa_mpjpe_mm == pytest.approx(0.0, abs=1e-6)
    assert any("4 of 130 frames" in sentence and "on one line" in sentence for sentence in report.problems)


def test_without_cameras_the_camera_figures_are_null_and_named(sequence: MotionSequence) -> None:
    report = evaluate(dataclasses.replace(sequence, cameras=None), sequence)
    assert report.cam_cut_rot_deg is None
    assert report.mpjpe_cam_mm is None
    assert any("cam_shot_drift_deg" in sentence for sentence in report.problems)


def test_the_error_of_the_skin_is_that_of_every_vertex_skinned_by_hand(sequence: MotionSequence) -> None:
    person = sequence.people[0].body
    assert person is not None
    nodding = person.body_pose.copy()
    nodding[:, 14, 0] += 0.5  # the head alone
    changed = dataclasses.replace(person, body_pose=nodding, betas=np.full(10, 0.5))
    report = evaluate(with_person(sequence, body=changed), sequence)
    body = load_body()

    def skinned(parameters: BodyParameters, row: int) -> np.ndarray:
        rest = body.rest_joints(parameters.betas)
        R_root = rotvec_to_rotmat(parameters.root_orient[row : row + 1])
        joints, R = forward_kinematics(rest, R_root, parameters.body_pose[row : row + 1], np.zeros((1, 3)))
        points = body.rest_vertices(parameters.betas)
        moved = sum(
            body.skin_weight[:, k, None]
            * (
                np.einsum("vab,vb->va", R[0, body.skin_joint[:, k]], points - rest[body.skin_joint[:, k]])
                + joints[0, body.skin_joint[:, k]]
            )
            for k in range(4)
        )
        return np.asarray(moved - joints[0, [1, 2]].mean(axis=0))

    rows = range(0, sequence.num_frames)
    errors = [np.linalg.norm(skinned(changed, k) - skinned(person, k), axis=1).mean() for k in rows]
    assert report.pve_mm == pytest.approx(1000 * float(np.mean(errors)), abs=1e-2)


def test_the_report_is_plain_json_with_every_figure_explained(sequence: MotionSequence) -> None:
    report = evaluate(sequence, sequence)
    assert json.loads(json.dumps(report.to_json(), allow_nan=False))["coverage"] == 1.0
    assert set(MEANINGS) == set(report.to_json()) - {"problems"}
    table = report_table(dataclasses.replace(report, problems=("[/] \x1b[31m",)), title="[/x] \x1b]0;title\x07")
    assert table.row_count == len(MEANINGS)
    assert [str(table.title), str(table.caption)] == [r"[/x] \x1b]0;title\x07", r"[/] \x1b[31m"], (
        "no markup, no commands"
    )


def test_frames_that_were_filled_in_are_told_beside_the_coverage_and_not_in_the_flat_object(
    sequence: MotionSequence,
) -> None:
    seen = np.arange(sequence.num_frames) < 39
    report = evaluate(with_person(sequence, observed=seen), sequence)
    assert (report.coverage, report.coverage_observed) == (1.0, 0.3)
    assert set(report.to_json()) == {*MEANINGS, "problems"}
    column = list(report_table(report, title="").columns[2].cells)
    assert any("(0.300 observed, the others filled in)" in str(cell) for cell in column)


def two_people(sequence: MotionSequence) -> MotionSequence:
    """The person, and another one aside who is in the first shot alone."""
    person = sequence.people[0]
    first = kept(sequence, np.arange(60)).people[0]
    assert first.bbox_xyxy is not None
    aside = dataclasses.replace(first, person=1, bbox_xyxy=first.bbox_xyxy + np.array([900.0, 0.0, 900.0, 0.0]))
    return dataclasses.replace(sequence, people=(person, aside))


def test_every_person_has_figures_of_his_own_and_their_mean_is_the_report(sequence: MotionSequence) -> None:
    truth = two_people(sequence)
    joints = truth.people[1].joints.copy()
    joints[:, 15] += [0.1, 0.0, 0.0]
    larger = dataclasses.replace(truth.people[1], person=7, joints=joints)
    report = evaluate(dataclasses.replace(truth, people=(truth.people[0], larger)), truth)
    one, other = report.people
    assert [(who.person, who.predicted, who.frames) for who in report.people] == [(0, 0, 130), (1, 7, 60)]
    assert one.figures.pa_mpjpe_mm == pytest.approx(0.0, abs=1e-6)
    assert other.figures.pa_mpjpe_mm is not None and other.figures.pa_mpjpe_mm > 1.0
    assert report.pa_mpjpe_mm == pytest.approx(other.figures.pa_mpjpe_mm / 2)
    lost = evaluate(dataclasses.replace(truth, people=truth.people[:1]), truth).people[1]
    assert (lost.predicted, lost.figures.coverage, lost.figures.pa_mpjpe_mm) == (None, 0.0, None)
    assert json.loads(json.dumps(other.to_json(), allow_nan=False))["predicted"] == 7
    (table,) = tables_per(report.people, title="")
    assert [str(column.header) for column in table.columns] == [
        "figure", "person 0, found as 0", "person 1, found as 7"
    ]  # fmt: skip


def test_every_shot_has_figures_as_if_it_were_the_video(sequence: MotionSequence) -> None:
    truth = two_people(sequence)
    joints = truth.people[0].joints.copy()
    joints[60:] += [0.3, -0.4, 0.0]  # a jump at the cut, and a head that is off after it
    joints[60:, 15] += [0.1, 0.0, 0.0]
    jumping = dataclasses.replace(truth.people[0], joints=joints)
    first, second = shot_reports(dataclasses.replace(truth, people=(jumping,)), truth)
    assert [(shot.shot, shot.start, shot.end) for shot in (first, second)] == [(0, 0, 60), (1, 60, 130)]
    assert first.figures.rte_m == pytest.approx(0.0, abs=1e-9)
    assert second.figures.rte_m == pytest.approx(0.0, abs=1e-9)
    assert first.figures.pa_mpjpe_mm == pytest.approx(0.0, abs=1e-6)
    assert second.figures.pa_mpjpe_mm is not None and second.figures.pa_mpjpe_mm > 1.0
    assert (first.figures.coverage, second.figures.coverage) == (0.5, 1.0), "the other one is in the first alone"
    assert second.cameras.cam_shot_drift_deg == pytest.approx(0.0, abs=1e-6)
    assert "cut_jump_m" not in json.loads(json.dumps(second.to_json(), allow_nan=False))
    assert len(tables_per([second] * 8, title="")) == 2


def test_shots_of_a_frame_or_of_nobody_have_null_figures(sequence: MotionSequence) -> None:
    short = dataclasses.replace(sequence, transitions=((60, 60), (61, 61)))
    reports = shot_reports(short, short)
    assert [(one.start, one.end) for one in reports] == [(0, 60), (60, 61), (61, 130)]
    assert reports[1].figures.pa_mpjpe_mm == pytest.approx(0.0, abs=1e-6)
    assert reports[1].figures.accel_ms2 is None
    empty = dataclasses.replace(sequence, people=())
    assert [one.figures.coverage for one in shot_reports(empty, empty)] == [None, None]


def test_that_two_camera_places_leave_no_trajectory_error_is_told(sequence: MotionSequence) -> None:
    cameras = sequence.cameras
    assert cameras is not None

    def standing(first: list[float], second: list[float]) -> MotionSequence:
        centres = np.where((np.arange(sequence.num_frames) < 60)[:, None], first, second)
        return dataclasses.replace(sequence, cameras=dataclasses.replace(cameras, t_world_cam=centres))

    truth = standing([5.0, 0.0, 1.0], [0.0, 5.0, 1.0])
    report = evaluate(standing([-9.0, 3.0, 1.0], [-9.0, 3.5, 7.0]), truth)
    assert report.cam_ate_m == pytest.approx(0.0, abs=1e-9)
    assert any(sentence.startswith("cam_ate_m says nothing") for sentence in report.problems)
    assert not any("says nothing" in sentence for sentence in evaluate(sequence, sequence).problems)


def test_joints_in_millimetres_are_suspected(sequence: MotionSequence) -> None:
    truth = with_person(sequence, joints=1000 * sequence.people[0].joints)
    (sentence,) = (one for one in evaluate(sequence, truth).problems if "millimetres" in one)
    assert sentence.startswith("truth: the joints of person 00 are up to 1")
