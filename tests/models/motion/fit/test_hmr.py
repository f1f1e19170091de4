"""One person in one shot: what comes back when the evidence was made from a known motion."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_keypoints, load_landmarks
from humanmm.models.body.pose_statistics import load_pose_statistics
from humanmm.models.geometry.rotations import rotvec_to_rotmat, swing
from humanmm.models.motion.fit.evidence import gather
from humanmm.models.motion.fit.hmr import fit_person, fit_shot
from humanmm.models.motion.fit.pose_prior import mirrored
from humanmm.models.motion.fit.state import CameraPath
from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.landmarks import SWAP
from humanmm.models.records.motion import PersonShotMotion
from humanmm.models.records.shots import Appearance, Person, Shot, Transition
from humanmm.models.records.tracks import UNKNOWN_RAD, PersonTrack, PoseEstimates, ScenePeople, Silhouettes

F = 40
K = np.array([[900.0, 0, 480], [0, 900, 270], [0, 0, 1]])
TIME = np.arange(F) / 30
BETAS = np.array([0.5, -0.3, 0.2, 0, 0, 0, 0, 0, 0, 0])


class Scene:
    """A person with swinging arms and legs who turns and walks, as a perfect detector would see them."""

    def __init__(self, turn_camera: float = 0.0, zoom: float = 1.0) -> None:
        body, model = load_body(), load_landmarks()
        phase = 2 * np.pi * TIME
        pose = np.zeros((F, 23, 3))
        pose[:, [15, 16], 2] = [-1.1, 1.1]  # arms down
        pose[:, 0, 0], pose[:, 1, 0] = 0.4 * np.sin(phase) - 0.2, -0.4 * np.sin(phase) - 0.2
        pose[:, 3, 0] = pose[:, 4, 0] = 0.4
        pose[:, 17, 1], pose[:, 18, 1] = -0.6, 0.6
        facing = rotvec_to_rotmat(np.stack([0 * TIME, 0.6 * np.sin(TIME) + 0.4, 0 * TIME], -1))
        R_shot_root = np.diag([1.0, -1, -1]) @ facing  # body y up, facing the camera
        pelvis = np.stack([-0.4 + 0.5 * TIME, 0.1 + 0 * TIME, 4.5 + 0.3 * TIME], -1)
        self.R_shot_cam = rotvec_to_rotmat(np.stack([0 * TIME, turn_camera * TIME, 0 * TIME], -1))
        R_cam_shot = np.swapaxes(self.R_shot_cam, -1, -2)
        self.R_root, self.pelvis = R_cam_shot @ R_shot_root, (R_cam_shot @ pelvis[..., None])[..., 0]
        self.joints, R = forward_kinematics(body.rest_joints(BETAS), self.R_root, pose, self.pelvis)
        points = model.place(BETAS, self.joints, R)
        self.in_picture = load_keypoints().place(BETAS, self.joints, R)
        self.K = np.tile(K, (F, 1, 1))
        self.K[:, [0, 1], [0, 1]] *= np.geomspace(1.0, zoom, F)[:, None]
        self.xy = self.project(points)
        centre = points[:, 23:25].mean(axis=1, keepdims=True)
        ray = centre[:, 0] / np.linalg.norm(centre[:, 0], axis=-1, keepdims=True)
        self.landmarks = (points - centre) @ swing(np.broadcast_to([0, 0, 1.0], ray.shape), ray)
        self.crop = self.project(centre)[:, 0]

    def project(self, points: np.ndarray) -> np.ndarray:
        """(F,n,2) pixels of points in camera axes."""
        return (points / points[..., 2:] @ np.swapaxes(self.K, -1, -2))[..., :2]

    def track(self, frames: np.ndarray, visibility: np.ndarray | float = 1.0) -> PersonTrack:
        n = len(frames)
        seen = np.broadcast_to(np.asarray(visibility), (n, 33))
        affine = np.zeros((n, 2, 3))
        affine[:, 0, 0] = affine[:, 1, 1] = 3
        affine[..., 2] = self.crop[frames] - 3 * 64
        return PersonTrack(
            frame=frames.astype(np.int32),
            keypoints2d=np.concatenate([self.xy[frames], seen[..., None]], -1).astype(np.float32),
            landmarks3d=self.landmarks[frames].astype(np.float32),
            bbox=np.zeros((n, 4), np.float32),
            confidence=np.ones(n, np.float32),
            masks=Silhouettes.pack(np.zeros((n, 128, 128))),
            mask_affine=affine.astype(np.float32),
            color_frame=np.zeros(1, np.int32),
            color_histogram=np.ones((1, 1), np.float32),
        )

    def fit(
        self, track: PersonTrack, swapped: tuple[tuple[int, int], ...] = (), ending: Transition | None = None
    ) -> PersonShotMotion:
        shot = Shot(0, 0, F, 0, None, (Appearance(0, 0, swapped),), ending)
        camera = ShotCamera(
            0, F, self.R_shot_cam, np.zeros((F, 3)), self.K, "rotation_only", False, np.nan,
        )  # fmt: skip
        told: list[tuple[int, int]] = []
        fitted = fit_shot(
            ScenePeople(0, F, (track,)), shot, (Person(0, BETAS, 1.0),), TIME, camera,
            progress=lambda *so_far: told.append(so_far),
        )  # fmt: skip
        (motion,) = fitted.people
        assert told[-1] == (F, F)
        return motion

    def error_m(self, motion: PersonShotMotion) -> np.ndarray:
        """Distances (frames, joints) of the fitted joints to the true ones, in camera axes: position included."""
        rest = load_body().rest_joints(motion.betas)
        joints, _ = forward_kinematics(rest, motion.R_cam_root, motion.body_pose, motion.pelvis_cam)
        return np.linalg.norm(joints - self.joints[motion.frame], axis=-1)


@pytest.mark.parametrize("turn_camera", [0.0, 0.4])
def test_a_clean_view_gives_the_motion_back_also_under_a_turning_camera(turn_camera: float) -> None:
    scene = Scene(turn_camera)
    motion = scene.fit(scene.track(np.arange(F)))
    assert motion.observed.all()
    assert scene.error_m(motion).mean() < 0.03  # the pose prior pulls by about 2 cm
    assert np.nanmedian(motion.residual_px) < 2


def test_keypoints_lie_where_the_networks_of_their_track_see_them() -> None:
    """The lifter's landmarks and the pose networks' keypoints are different points of the body."""
    scene = Scene()
    unknown = PoseEstimates(np.zeros((F, 20, 3), np.float32), np.full((F, 20), UNKNOWN_RAD), np.zeros(F))
    of_networks = replace(scene.track(np.arange(F)), pose=unknown)
    of_networks.keypoints2d[..., :2] = scene.project(scene.in_picture)
    motion = scene.fit(of_networks)
    assert scene.error_m(motion).mean() < 0.03 and np.nanmedian(motion.residual_px) < 2
    ankles = scene.error_m(motion)[:, 7:9].mean()
    of_another_program = replace(of_networks, lifted=True)
    assert scene.error_m(scene.fit(of_another_program))[:, 7:9].mean() > ankles + 0.005


def test_a_keypoint_counts_as_much_as_the_network_is_sure_of_it_and_not_as_it_is_visible() -> None:
    scene = Scene()
    hidden = scene.track(np.arange(F), visibility=0.3)
    wrong = replace(hidden, keypoints2d=hidden.keypoints2d.copy(), landmarks3d=hidden.landmarks3d.copy())
    wrong.keypoints2d[:, 13, 0] += 25  # the left elbow, 12 cm beside where it is
    sure, unsure = np.full((2, F, 33), 1.0, np.float32)
    unsure[:, 13] = 100.0
    believed, not_believed, unknown = (
        scene.error_m(scene.fit(replace(wrong, keypoint_sigma=sigma)))[:, 18].mean() for sigma in (sure, unsure, None)
    )
    assert not_believed < 0.05 < unknown < 0.1 < believed


def test_a_pose_error_is_expected_where_the_lifter_says_something_of_people_in_pictures() -> None:
    scene = Scene()
    known = PoseEstimates(np.zeros((F, 20, 3), np.float32), np.full((F, 20), 0.9), np.zeros(F))
    known.sigma[:10] = UNKNOWN_RAD
    lifted = replace(scene.track(np.arange(F)), pose=known)
    error_m = scene.fit(lifted).pose_error_m
    assert np.isnan(error_m[:10]).all() and (error_m[10:] < 0.08).all()
    assert np.isnan(scene.fit(replace(lifted, lifted=True)).pose_error_m).all()


def test_left_and_right_swapped_on_known_frames_are_put_right() -> None:
    scene = Scene()
    track = scene.track(np.arange(F))
    flipped = slice(10, 25)
    track.keypoints2d[flipped] = track.keypoints2d[flipped][:, SWAP]
    track.landmarks3d[flipped] = track.landmarks3d[flipped][:, SWAP]
    expected = scene.fit(scene.track(np.arange(F)))
    motion = scene.fit(track, swapped=((10, 25),))
    np.testing.assert_allclose(motion.body_pose, expected.body_pose, atol=1e-6)


def test_a_hole_in_the_track_is_bridged_and_says_so() -> None:
    scene = Scene()
    frames = np.concatenate([np.arange(15), np.arange(24, F)])
    motion = scene.fit(scene.track(frames))
    np.testing.assert_array_equal(motion.frame, np.arange(F))
    np.testing.assert_array_equal(motion.observed, np.isin(np.arange(F), frames))
    assert (motion.confidence[15:24] == 0).all()
    assert scene.error_m(motion)[15:24].mean() < 0.06


def test_nobody_flies_off_in_a_long_hole() -> None:
    scene = Scene()
    long = replace(scene.track(np.arange(F)), frame=np.r_[np.arange(12), np.arange(12, F) + 400].astype(np.int32))
    times = np.arange(F + 400) / 30
    evidence = gather(long, (0, F + 400), times, np.tile(K, (F + 400, 1, 1)))
    assert evidence is not None
    n = len(evidence.frame)
    path = CameraPath(*(np.broadcast_to(x, (n, *x.shape)) for x in (np.eye(3), np.zeros(3), K)))
    motion = fit_person(0, evidence, BETAS, path)
    ends = scene.pelvis[[0, F - 1]]
    assert (motion.pelvis_cam > ends.min(axis=0) - 0.5).all() and (motion.pelvis_cam < ends.max(axis=0) + 0.5).all()


def test_legs_out_of_view_leave_the_upper_body_right_and_the_legs_human() -> None:
    scene = Scene()
    visibility = np.ones((F, 33))
    visibility[:, 25:] = 0
    motion = scene.fit(scene.track(np.arange(F), visibility))
    # Distance then rests on the trunk alone: 0.4 m known to 7 mm put the whole person off by 8 cm at 4.5 m.
    assert scene.error_m(motion)[:, [12, 15, 16, 17, 18, 19]].mean() < 0.08
    knees = motion.body_pose[:, [3, 4], 0]
    assert knees.min() > -0.3 and knees.max() < 2.7


def test_a_zooming_camera_is_not_a_person_who_comes_nearer() -> None:
    scene = Scene(turn_camera=0.2, zoom=1.5)
    motion = scene.fit(scene.track(np.arange(F)))
    assert scene.error_m(motion).mean() < 0.03  # as without the zoom
    assert np.nanmedian(motion.residual_px) < 2


def test_frames_mixed_with_the_next_shot_are_no_evidence() -> None:
    scene = Scene()
    track = scene.track(np.arange(F))
    track.keypoints2d[-3:, :, 0] += 200  # in the dissolve the network finds somebody else
    motion = scene.fit(track, ending=Transition("dissolve", F - 8, F + 8, "scene"))
    np.testing.assert_array_equal(motion.frame, np.arange(F - 3))
    assert scene.error_m(motion).mean() < 0.03


def test_a_track_outside_the_shot_gives_nothing() -> None:
    scene = Scene()
    assert gather(scene.track(np.arange(5)), (10, 20), TIME, np.tile(K, (10, 1, 1))) is None


def test_a_single_frame_can_be_fitted() -> None:
    scene = Scene()
    motion = scene.fit(scene.track(np.array([7])))
    assert len(motion.frame) == 1
    assert scene.error_m(motion).mean() < 0.05


def test_the_statistic_of_poses_is_its_own_mirror_image() -> None:
    statistics = load_pose_statistics()
    whole = np.zeros((1, 24, 3))
    free = [j for j in range(1, 24) if j not in (10, 11, 22, 23)]
    wide = statistics.means[-1]  # the Gaussian of all poses together
    whole[0, free] = wide.reshape(-1, 3)
    np.testing.assert_allclose(mirrored(whole)[0, free].ravel(), wide, atol=1e-3)
    assert np.linalg.eigvalsh(statistics.covariances).min() > 0
    np.testing.assert_allclose(statistics.shares.sum(), 1, atol=1e-5)


def test_evidence_of_a_run_of_frames_is_that_part_of_the_whole() -> None:
    scene = Scene()
    track = scene.track(np.setdiff1d(np.arange(F), [13, 14]))
    evidence = gather(track, (2, F - 2), TIME, np.tile(K, (F - 4, 1, 1)), tracking_failures=((5, 9),))
    assert evidence is not None
    whole, part = evidence.frames(slice(0, F - 4)), evidence.frames(slice(4, 16))
    for name in ("seen", "keypoints", "visibility", "landmarks_cam", "bones", "ray"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[4:16])
    believed = evidence.believed(np.arange(F - 4) != 6).frames(slice(4, 16))
    assert not believed.seen[2] and not believed.visibility[2].any() and believed.seen.sum() == part.seen.sum() - 1
