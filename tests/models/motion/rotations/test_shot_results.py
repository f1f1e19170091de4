"""What the alignment reads of shots: which can be used, who moves in them, and bodies in rotated axes."""

from dataclasses import replace

import numpy as np
import pytest
from three_shots import results

from humanmm.models.geometry.projection import project
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.motion.rotations.shot_results import SOLES, camera_of, motions_of, posed, refocused, usable


def test_a_shot_without_camera_or_motion_is_not_usable() -> None:
    whole = results()
    lost = replace(whole, cameras=[None, *whole.cameras[1:]], motions=[*whole.motions[:2], None])
    assert [usable(lost, shot) for shot in range(3)] == [False, True, False]
    assert motions_of(lost, 2) == {}
    with pytest.raises(ValueError, match="shot 0 has no camera"):
        camera_of(lost, 0)


def test_motions_are_found_by_the_number_of_the_person() -> None:
    whole = results((4, 0, 4))
    assert [list(motions_of(whole, shot)) for shot in range(3)] == [[4], [0], [4]]
    assert camera_of(whole, 1) is whole.cameras[1]


def test_a_body_is_posed_about_its_pelvis_in_the_axes_that_are_given() -> None:
    motion = motions_of(results(), 0)[0]
    plain = np.tile(np.eye(3), (len(motion.frame), 1, 1))
    R = np.tile(rotvec_to_rotmat(np.array([0.3, -0.8, 0.2])), (len(motion.frame), 1, 1))
    (joints, soles), (rotated_joints, rotated_soles) = posed(motion, plain), posed(motion, R)
    assert joints.shape == (20, 24, 3) and soles.shape == (20, len(SOLES), 3)
    np.testing.assert_allclose(joints[:, 0], 0, atol=1e-9)
    np.testing.assert_allclose(rotated_joints, np.einsum("nab,njb->nja", R, joints), atol=1e-6)
    np.testing.assert_allclose(rotated_soles, np.einsum("nab,njb->nja", R, soles), atol=1e-6)
    assert soles[..., 1].min() > joints[:, :20, 1].max() - 0.15  # y is down in the camera, and the body stands


def test_with_another_lens_everybody_is_where_the_picture_shows_and_a_long_pan_is_a_shorter_one() -> None:
    before = results()
    camera = camera_of(before, 0)
    num_frames, turns = camera.end - camera.start, 1.25
    pan = rotvec_to_rotmat(np.outer(np.linspace(0, 2 * np.pi * turns, num_frames), [0.0, 1.0, 0.0]))
    before = replace(before, cameras=[replace(camera, R_shot_cam=pan), *before.cameras[1:]])
    after = refocused(before, 1.2)
    seen, farther = motions_of(before, 1)[0], motions_of(after, 1)[0]
    pixels = [
        project(motion.pelvis_cam, camera_of(one, 1).K[0], near_m=0.1)
        for one, motion in ((before, seen), (after, farther))
    ]
    assert np.allclose(*pixels)
    assert np.allclose(farther.pelvis_cam[:, 2], 1.2 * seen.pelvis_cam[:, 2])
    R = camera_of(after, 0).R_shot_cam
    steps = rotation_angle(np.swapaxes(R[:-1], -1, -2) @ R[1:])
    assert np.allclose(steps.sum(), 2 * np.pi * turns / 1.2) and np.ptp(steps) < 1e-9


def test_with_another_lens_a_camera_rolls_as_the_picture_shows() -> None:
    before = results()
    camera = camera_of(before, 0)
    roll = rotvec_to_rotmat(np.outer(np.linspace(0, np.radians(20), camera.end - camera.start), [0.0, 0.0, 1.0]))
    before = replace(before, cameras=[replace(camera, R_shot_cam=roll), *before.cameras[1:]])
    np.testing.assert_allclose(camera_of(refocused(before, 1.2), 0).R_shot_cam, roll, atol=1e-12)
