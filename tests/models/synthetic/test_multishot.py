"""Videos made of motion capture: repeatable, cut as promised, and seen by the cameras that the truth names."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.models.benchmark.tables.statistics import statistics_of
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.synthetic.detector_noise import fitted_noise
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.models.synthetic.multishot import BenchVideo, build_video, cut_times, plan_videos
from humanmm.storage.readers.mocap_pack import read_pack
from humanmm.storage.store.codec import encode

SILENT = replace(
    fitted_noise(), keypoint_fraction=0.0, landmark_deviation_m=(0, 0, 0), rotation_deg=(0, 0, 0), landmark_scale=1.0,
    tilt_deg=0.0, tilt_per_pitch=0.0, lean_per_roll=0.0, anatomy_m=0.0, hidden_rate=(0, 0), lost_rate=(0, 0),
    swap_rate=(0, 0), miss_rate=0,
)  # fmt: skip


def silent(sequences: tuple[MocapSequence, ...], transitions: int = 3) -> BenchVideo:
    """A video without any noise of the detector."""
    plan = plan_videos(sequences, 1, seed=3, transitions=(transitions,))[0]
    return build_video(sequences[plan.sequence], replace(plan, noise=SILENT))


def test_the_same_plan_gives_the_same_bytes_and_another_seed_others(sequences: tuple[MocapSequence, ...]) -> None:
    def digests(seed: int) -> list[str]:
        plan = plan_videos(sequences, 1, seed=seed, transitions=(2,), longest=90)[0]
        video = build_video(sequences[plan.sequence], plan)
        return [encode(scene, ScenePeople).digest() for scene in video.people]

    assert digests(1) == digests(1)
    assert digests(1) != digests(2)


def test_cuts_leave_no_clip_shorter_than_promised() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        cuts = cut_times(120, 4, 30.0, rng)
        assert min(np.diff([0, *cuts, 120])) >= 18


def test_a_version_with_more_transitions_shows_the_same_body(sequences: tuple[MocapSequence, ...]) -> None:
    plans = plan_videos(sequences, 1, seed=0, same=True)
    two, four = (build_video(sequences[plan.sequence], plan) for plan in (plans[0], plans[2]))
    assert (len(two.truth.transitions), len(four.truth.transitions)) == (2, 4)
    assert np.array_equal(two.truth.people[0].joints, four.truth.people[0].joints)


def test_without_noise_keypoints_are_the_true_joints_in_the_true_camera(sequences: tuple[MocapSequence, ...]) -> None:
    video = silent(sequences)
    cameras, joints = video.truth.cameras, video.truth.people[0].joints
    assert cameras is not None
    knees = [4, 5]
    for scene in video.people:
        track = scene.tracks[0]
        in_camera = np.einsum(
            "nba,nkb->nka",
            cameras.R_world_cam[track.frame],
            joints[track.frame] - cameras.t_world_cam[track.frame, None],
        )
        pixels = (in_camera @ cameras.K[0].T)[..., :2] / in_camera[..., 2:]
        shift = np.linalg.norm(track.keypoints2d[:, [25, 26], :2] - pixels[:, knees], axis=-1)
        offset_m = np.linalg.norm(load_landmarks().offset_template[25])  # the detector's knee is not quite the joint
        depth = in_camera[:, knees, 2]
        assert (shift <= 1.5 * offset_m * cameras.K[0, 0, 0] / depth).all()


def test_without_noise_landmarks_are_the_true_ones_seen_along_the_ray(sequences: tuple[MocapSequence, ...]) -> None:
    track = silent(sequences).people[0].tracks[0]
    thigh = np.linalg.norm(track.landmarks3d[:, 23] - track.landmarks3d[:, 25], axis=-1)
    assert np.ptp(thigh) < 0.03  # the hip landmark moves a little about its joint
    assert np.abs(track.landmarks3d[:, 23:25].mean(axis=1)).max() < 1e-6


def test_noise_has_the_size_that_it_is_said_to_have(sequences: tuple[MocapSequence, ...]) -> None:
    plan = plan_videos(sequences, 1, seed=3, transitions=(3,))[0]
    plain = replace(SILENT, keypoint_fraction=0.02, shot_fraction=0.0, new_fraction=1.0)
    clean, noisy = (build_video(sequences[plan.sequence], replace(plan, noise=noise)) for noise in (SILENT, plain))
    errors = []
    for one, other in zip(clean.people, noisy.people, strict=True):
        a, b = one.tracks[0], other.tracks[0]
        height = np.ptp(a.keypoints2d[..., 1], axis=1)[:, None, None]
        errors.append(((b.keypoints2d - a.keypoints2d)[:, 11:, :2] / height).ravel())
    assert np.std(np.concatenate(errors)) == pytest.approx(0.02, rel=0.1)


def test_points_of_a_static_camera_stand_and_masked_ones_are_none(sequences: tuple[MocapSequence, ...]) -> None:
    plans, still = plan_videos(sequences, 6, seed=1, transitions=(3,), longest=120), 0
    for plan in plans:
        video = build_video(sequences[plan.sequence], plan)
        assert video.truth.cameras is not None
        for (start, end), points in zip(video.scenes.spans, video.points, strict=True):
            assert points.frame.min() == start
            assert points.frame.max() == end - 1
            if np.ptp(video.truth.cameras.t_world_cam[start:end], axis=0).max() > 0:
                continue
            if np.ptp(video.truth.cameras.R_world_cam[start:end], axis=0).max() > 0:
                continue
            first, last = points.track[points.frame == start], points.track[points.frame == end - 1]
            _, i, j = np.intersect1d(first, last, return_indices=True)
            moved = points.xy[points.frame == end - 1][j] - points.xy[points.frame == start][i]
            assert np.median(np.linalg.norm(moved, axis=1)) < 1.5
            still += 1
        if still >= 2:
            return
    raise AssertionError("hardly any camera is static")


def test_a_set_is_reported_in_the_numbers_of_the_papers_table() -> None:
    facts = statistics_of([300, 600], [30.0, 30.0], [2, 4])
    assert (facts.duration_s, facts.videos, facts.longest, facts.shortest) == (15.0, 2, 600, 300)
    assert facts.transitions == (2, 4)


def test_a_pack_is_rotated_from_y_up_to_z_up(sequences: tuple[MocapSequence, ...]) -> None:
    assert [sequence.num_frames for sequence in sequences] == [100, 150]
    assert np.allclose(sequences[0].pelvis[:, 2], 0.92)
    assert np.allclose(sequences[0].R_world_root[0] @ [0, 1, 0], [0, 0, 1])


def test_a_pack_that_lacks_an_array_is_reported_in_one_sentence(tmp_path: Path) -> None:
    np.savez(tmp_path / "bad.npz", poses=np.zeros((4, 72)))
    with pytest.raises(InputError, match="lacks trans"):
        read_pack(tmp_path / "bad.npz")
