"""Up, from those who stand and from how a camera pans."""

import numpy as np

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.rotations.gravity import UprightEvidence, pan_axis, up_direction


def test_up_comes_from_those_who_stand_and_not_from_the_one_who_bends() -> None:
    rng = np.random.default_rng(4)
    true = rotvec_to_rotmat(np.array([0.4, -0.3, 0.2])) @ np.array([0.0, 0.0, 1.0])
    standing = [rotvec_to_rotmat(rng.normal(0, 0.05, 3)) @ true for _ in range(4)]
    bent = rotvec_to_rotmat(np.array([1.4, 0.0, 0.0])) @ true
    level = np.cross(true, rng.normal(size=(3, 3)))
    evidence = UprightEvidence(
        np.array([bent, *standing]),
        np.full(5, 8.0),
        level / np.linalg.norm(level, axis=1)[:, None],
        np.full(3, 5.0),
    )
    up = up_direction(evidence)
    assert np.degrees(np.arccos(up @ true)) < 3.0


def test_a_pan_has_an_axis_and_a_static_camera_has_none() -> None:
    axis = np.array([0.1, -0.98, 0.17])
    axis /= np.linalg.norm(axis)
    found = pan_axis(rotvec_to_rotmat(np.outer(np.linspace(0, 0.5, 30), axis)))
    assert found is not None and abs(found @ axis) > 0.9999
    assert pan_axis(np.tile(np.eye(3), (30, 1, 1))) is None
