"""Simulated detections take the place of the network's, frame by frame, and people stay who they are."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.synthetic.detector_noise import fitted_noise
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.models.synthetic.multishot import BenchVideo, build_video, plan_videos
from humanmm.models.synthetic.resimulated import resimulated

EXACT = replace(
    fitted_noise(), keypoint_fraction=0.0, hidden_rate=(0, 0), lost_rate=(0, 0), swap_rate=(0, 0), miss_rate=0.0
)


@pytest.fixture
def video(sequences: tuple[MocapSequence, ...]) -> BenchVideo:
    plan = plan_videos(sequences, 1, seed=3, transitions=(2,))[0]
    return build_video(sequences[plan.sequence], replace(plan, noise=EXACT))


def test_without_noise_the_joints_are_where_the_truth_has_them(video: BenchVideo) -> None:
    cameras, person = video.truth.cameras, video.truth.people[0]
    assert cameras is not None
    for scene in resimulated(video, EXACT, 0).people:
        for track in scene.tracks:
            assert scene.start <= track.frame.min()
            assert track.frame.max() < scene.end
            frame = track.frame
            about_camera = person.joints[frame][:, [4, 5]] - cameras.t_world_cam[frame, None]
            seen = about_camera @ cameras.R_world_cam[frame] @ np.swapaxes(cameras.K[frame], 1, 2)
            knees = seen[..., :2] / seen[..., 2:]
            height = np.ptp(track.keypoints2d[..., 1], axis=1)
            off = np.linalg.norm(track.keypoints2d[:, [25, 26], :2] - knees, axis=-1) / height[:, None]
            assert np.median(off) < 0.03  # the landmark of a knee is not quite its joint


def test_a_person_wears_the_same_in_every_scene(video: BenchVideo) -> None:
    scenes = resimulated(video, fitted_noise(), 0).people
    worn = [track.color_histogram.mean(axis=0) for scene in scenes for track in scene.tracks]
    assert len(worn) == 3
    assert all(np.minimum(worn[0], other).sum() > 0.8 for other in worn[1:])


def test_a_truth_without_cameras_is_refused(video: BenchVideo) -> None:
    blind = replace(video, truth=replace(video.truth, cameras=None))
    with pytest.raises(ValueError, match="no cameras"):
        resimulated(blind, fitted_noise(), 0)
