"""What a report draws: paths aligned with the truth, errors about the cuts."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.benchmark.tables.charts import TRUTH, colour_of
from humanmm.models.benchmark.tables.drawings import error_about_cuts, world_views
from humanmm.models.benchmark.traces import OFFSETS_S, trace_video
from humanmm.models.geometry.alignment import yaw_to_rotmat
from humanmm.models.records.sequence import MotionSequence
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.models.synthetic.multishot import build_video, plan_videos


@pytest.fixture
def truth(sequences: tuple[MocapSequence, ...]) -> MotionSequence:
    plan = plan_videos(sequences, 1, seed=4, transitions=(2,), longest=90)[0]
    return build_video(sequences[plan.sequence], plan).truth


def moved(
    sequence: MotionSequence, *, since: int, shift: tuple[float, float, float], yaw: float = 0.0
) -> MotionSequence:
    """The sequence in another world, its person displaced from a frame on."""
    person, R = sequence.people[0], yaw_to_rotmat(yaw)
    joints = person.joints.copy()
    joints[since:] += shift
    assert sequence.cameras is not None
    cameras = replace(
        sequence.cameras, R_world_cam=R @ sequence.cameras.R_world_cam, t_world_cam=sequence.cameras.t_world_cam @ R.T
    )
    return replace(sequence, people=(replace(person, joints=joints @ R.T),), cameras=cameras)


def test_the_same_motion_in_another_world_lies_on_the_truth_and_in_the_same_pixels(truth: MotionSequence) -> None:
    trace = trace_video("v", "s", truth, [("humanmm", moved(truth, since=0, shift=(3, 1, 0.5), yaw=1.0))])
    assert np.allclose(trace.path[1], trace.path[0], atol=1e-4)
    same = trace_video("v", "s", truth, [("humanmm", moved(truth, since=0, shift=(0, 0, 0), yaw=1.0))])
    assert np.allclose(same.pixels[1], same.pixels[0], atol=0.1)
    assert np.nanmax(trace.cut_error_mm) < 1e-3


def test_a_jump_at_a_cut_is_seen_from_the_cut_on(truth: MotionSequence) -> None:
    cut = truth.cut_frames[0]
    trace = trace_video("v", "s", truth, [("humanmm", moved(truth, since=cut, shift=(0.3, 0, 0)))])
    before = np.array([offset < 0 for offset in OFFSETS_S])
    errors = trace.cut_error_mm[0, 0]
    assert np.nanmax(errors[before]) < 1e-3
    assert np.allclose(errors[~before & np.isfinite(errors)], 300, atol=0.1)
    curves = error_about_cuts([trace])
    assert curves is not None
    assert curves.series[0][1][OFFSETS_S.index(0.0)] == pytest.approx(150, abs=0.1)  # the second cut has no jump


def test_a_method_that_failed_has_no_lines_and_the_truth_stays(truth: MotionSequence) -> None:
    trace = trace_video("v", "s", truth, [("humanmm", None), ("concat", truth)])
    for view in world_views(trace, [0, 1]):
        (axes,) = view.figure.axes
        drawn = {line.get_color(): line.get_xydata() for line in axes.lines if np.isfinite(line.get_xydata()).any()}
        assert set(drawn) == {colour_of(TRUTH), colour_of(1)}
        points = np.concatenate([points[np.isfinite(points).all(axis=1)] for points in drawn.values()])
        left, right, bottom, top = *axes.get_xlim(), *axes.get_ylim()
        assert (points >= [left, top]).all()
        assert (points <= [right, bottom]).all()
