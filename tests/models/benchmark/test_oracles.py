"""What the oracles are told: a wrong cut undone, a missed one made, the rotation about the vertical alone put right."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.config import Config
from humanmm.errors import StageError
from humanmm.models.benchmark.methods import MethodMotion, run_methods
from humanmm.models.benchmark.oracles import true_cameras, true_rotations, with_true_cuts, yaw_rotations
from humanmm.models.benchmark.scores import score
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.tracks import PersonTrack, PoseEstimates
from humanmm.models.synthetic.multishot import BenchVideo, hard_cuts


def _wrongly_cut(video: BenchVideo, cuts: tuple[int, ...]) -> BenchVideo:
    """The same video as if other cuts had been found: tracks end there, also one that goes through a true cut."""
    told = with_true_cuts(replace(video, truth=replace(video.truth, transitions=tuple((c, c) for c in cuts))))
    return replace(told, scenes=hard_cuts(len(video.facts.time_s), cuts), truth=video.truth, cuts_known=False)


def test_a_wrong_cut_is_undone_to_the_last_observation(video: BenchVideo) -> None:
    first, last = video.truth.cut_frames
    wrong = _wrongly_cut(video, (first, first + 6, last))
    assert len(wrong.people) == 4
    right = with_true_cuts(wrong)
    assert right.cuts_known
    assert [len(scene.tracks) for scene in right.people] == [1, 1, 1]
    for scene, expected in zip(right.people, video.people, strict=True):
        track, true = scene.tracks[0], expected.tracks[0]
        assert np.array_equal(track.frame, true.frame)
        assert np.array_equal(track.keypoints2d, true.keypoints2d)
        assert np.array_equal(track.masks.data, true.masks.data)
        assert np.array_equal(track.color_histogram, true.color_histogram)
    for points, of_scene in zip(right.points, video.points, strict=True):
        assert np.array_equal(points.xy, of_scene.xy)


def test_what_the_lifter_says_of_a_frame_stays_with_it(video: BenchVideo) -> None:
    def lifted(track: PersonTrack) -> PersonTrack:
        n = len(track.frame)
        named = track.frame.astype(np.float32)
        return replace(track, pose=PoseEstimates(np.zeros((n, 20, 3), np.float32), np.ones((n, 20), np.float32), named))

    scenes = tuple(replace(scene, tracks=tuple(map(lifted, scene.tracks))) for scene in video.people)
    first, last = video.truth.cut_frames
    right = with_true_cuts(_wrongly_cut(replace(video, people=scenes), (first, first + 6, last)))
    for scene in right.people:
        pose = scene.tracks[0].pose
        assert pose is not None and np.array_equal(pose.swap_odds, scene.tracks[0].frame)


def test_oracle_cuts_recover_what_wrong_cuts_cost(video: BenchVideo) -> None:
    first, last = video.truth.cut_frames
    wrong = _wrongly_cut(video, (first, first + 6, last))
    plain = Config.model_validate({"refine": {"refit": False, "networks": "none"}})  # cuts are counted, not motion
    found = run_methods(wrong, plain, ("humanmm without refine", "oracle cuts"))
    without, oracle = (
        next(figure.value for figure in one.figures if figure.name == "cut_f1") for one in score(wrong, found).methods
    )
    assert without < 1
    assert oracle == 1


def test_true_cameras_carry_the_truths_path_and_lens(video: BenchVideo, motion_of: dict[str, MethodMotion]) -> None:
    done = motion_of["humanmm without refine"]
    assert done.shots is not None
    truth = video.truth.cameras
    assert truth is not None
    for camera in true_cameras(video, done.shots):
        first = truth.R_world_cam[camera.start]
        assert np.allclose(first @ camera.R_shot_cam, truth.R_world_cam[camera.start : camera.end])
        path = camera.t_shot_cam @ first.T + truth.t_world_cam[camera.start]
        assert np.allclose(path, truth.t_world_cam[camera.start : camera.end])
        assert np.array_equal(camera.K, truth.K[camera.start : camera.end])


def test_yaw_rotations_leave_the_tilt_that_was_found(video: BenchVideo, motion_of: dict[str, MethodMotion]) -> None:
    done = motion_of["humanmm without refine"]
    assert done.motion is not None
    assert done.shots is not None
    start = video.truth.cut_frames[0]
    turns = yaw_rotations(video, done.shots, done.motion)
    before, after = done.motion.R_world_cam[start - 1 : start + 1]
    told = before @ turns[start]
    assert np.allclose(told[2], after[2])  # heights of the camera's axes: what a rotation about the vertical leaves
    again = yaw_rotations(
        video, done.shots, replace(done.motion, R_world_cam=_turned_after(done.motion.R_world_cam, start))
    )
    assert np.allclose(again[start], turns[start])
    assert set(true_rotations(video, done.shots)) == set(video.truth.cut_frames)


def _turned_after(R_world_cam: np.ndarray, start: int) -> np.ndarray:
    """The cameras with another heading from a cut on."""
    turn = rotvec_to_rotmat(np.array([0.0, 0.0, 1.1]))
    return np.concatenate([R_world_cam[:start], turn @ R_world_cam[start:]])


def test_a_truth_without_cameras_is_a_failure_of_the_oracles_alone(video: BenchVideo) -> None:
    blind = replace(video, truth=replace(video.truth, cameras=None))
    with pytest.raises(StageError, match="does not know the camera"):
        true_rotations(blind, None)  # type: ignore[arg-type]
    found = run_methods(blind, Config(), ("humanmm without refine", "oracle camera", "oracle yaw")).motions
    assert [done.motion is None for done in found] == [False, True, True]
