"""Bodies of another system become tracks that say the same: landmarks, rotations, where they are in the picture."""

from dataclasses import replace

import numpy as np
from two_people import recording

from humanmm.models.body.body24 import FREE_JOINTS
from humanmm.models.geometry.projection import ray_axes, viewing_rays, world_to_camera
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.perception.tracking.given_bodies import GIVEN_RAD, GivenBody, people_of_bodies, smpl_body
from humanmm.models.records.tracks import MASK_SIDE, UNKNOWN_RAD
from humanmm.models.records.video import VideoFacts

RECORDING = recording()
FACTS = VideoFacts(1280, 720, RECORDING.time_s, np.ones(40, bool), 0, "h264", "mp4")


def bodies() -> tuple[GivenBody, ...]:
    """The two people of the recording, in their cameras."""
    found = []
    for person in RECORDING.people:
        R_world_cam, t_world_cam = RECORDING.R_world_cam[person.frame], RECORDING.t_world_cam[person.frame]
        pelvis_cam = world_to_camera(person.pelvis[:, None], R_world_cam, t_world_cam)[:, 0]
        R_cam_root = np.swapaxes(R_world_cam, -1, -2) @ rotvec_to_rotmat(person.root_orient)
        K = RECORDING.K[person.frame].astype(np.float64)
        found.append(smpl_body(person.frame, R_cam_root, person.body_pose, pelvis_cam, K, betas=person.betas))
    return tuple(found)


def test_a_track_holds_the_rotations_and_the_places_that_were_given() -> None:
    for body in bodies():
        (track,) = people_of_bodies([body], FACTS, (0, 25), max_people=6).tracks
        rows = np.searchsorted(body.frame, track.frame)
        centre = track.mask_affine.astype(np.float64) @ np.array([MASK_SIDE / 2, MASK_SIDE / 2, 1.0])
        R_cam_ray = ray_axes(viewing_rays(centre[:, None], body.K[rows])[:, 0])
        assert track.pose is not None and body.R_local is not None
        R = rotvec_to_rotmat(track.pose.vectors.astype(np.float64))
        np.testing.assert_allclose(R_cam_ray @ R[:, 0], body.R_local[rows, 0], atol=1e-5)
        np.testing.assert_allclose(R[:, 1:], body.R_local[rows][:, list(FREE_JOINTS)], atol=1e-5)
        assert (track.pose.sigma == np.float32(GIVEN_RAD)).all()
        in_camera = track.landmarks3d @ np.swapaxes(R_cam_ray, -1, -2)
        expected = body.landmarks_cam[rows] - body.landmarks_cam[rows][:, 23:25].mean(axis=1, keepdims=True)
        np.testing.assert_allclose(in_camera, expected, atol=1e-5)
        pixels = body.landmarks_cam[rows] @ np.swapaxes(body.K[rows], -1, -2)
        seen = track.keypoints2d[..., 2] > 0
        np.testing.assert_allclose(track.keypoints2d[seen][:, :2], (pixels[..., :2] / pixels[..., 2:])[seen], atol=1e-3)


def test_places_alone_say_nothing_of_rotations() -> None:
    body = bodies()[0]
    known = np.zeros(33, bool)
    known[[0, 11, 12, 13, 14, 23, 24, 25, 26]] = True
    places = GivenBody(body.frame, body.landmarks_cam, known, body.K)
    (track,) = people_of_bodies([places], FACTS, (0, 25), max_people=6).tracks
    assert track.pose is not None and (track.pose.sigma == UNKNOWN_RAD).all()
    assert (track.keypoints2d[:, ~known, 2] == 0).all()


def test_a_system_that_saw_pixels_which_are_not_square_is_not_believed_silently() -> None:
    body = bodies()[0]
    for factor, words in ((1.0, ""), (16 / 11, "1.45 times narrower"), (2 / 3, "1.50 times wider")):
        given = replace(body, K=body.K * np.array([factor, 1.0, 1.0])[:, None])
        warnings = people_of_bodies([given], FACTS, (0, 25), max_people=6).warnings
        assert len(warnings) == bool(words) and all(words in warning for warning in warnings)


def test_whoever_is_behind_the_camera_or_out_of_the_picture_is_not_seen() -> None:
    body = bodies()[0]
    behind = GivenBody(body.frame, body.landmarks_cam * [1, 1, -1], body.known, body.K, body.R_local)
    assert people_of_bodies([behind], FACTS, (0, 25), max_people=6).tracks == ()


def test_of_more_bodies_than_wanted_the_smaller_are_left_out_and_reported() -> None:
    scenes = [people_of_bodies(bodies(), FACTS, (0, 25), max_people=k) for k in (1, 2)]
    assert [len(scene.tracks) for scene in scenes] == [1, 2]
    assert [[one.crowded for one in scene.unfollowed] for scene in scenes] == [[True], []]
    (left,) = scenes[0].unfollowed
    smaller = scenes[1].tracks[1]
    assert (left.first, left.last) == (smaller.frame[0], smaller.frame[-1])
