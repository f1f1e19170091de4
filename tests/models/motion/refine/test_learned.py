"""What networks say as evidence and as correction."""

import numpy as np
from motion_sequences import aligned

from humanmm.models.body.body24 import NUM_JOINTS, ROTATED_JOINTS
from humanmm.models.geometry.rotations import rotation_angle, rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.fit.evidence import person_skeleton
from humanmm.models.motion.fit.state import LongMotion
from humanmm.models.motion.networks.interfaces import AlignedMotion, Integrated, nothing
from humanmm.models.motion.refine.fit import RootVelocity
from humanmm.models.motion.refine.learned import MS_HMR_SHARE, Learned

N = 12


def motion() -> LongMotion:
    given = aligned(N)
    vectors = np.zeros((N, NUM_JOINTS, 3))
    vectors[:, list(ROTATED_JOINTS)] = rotmat_to_rotvec(given.rotations)
    return LongMotion(person_skeleton(np.zeros(10)), vectors, given.pelvis)


def turned(given: AlignedMotion) -> Integrated:
    """Every joint is a fifth of a radian further; the pelvis goes a metre a second forwards."""
    rotations = given.rotations @ rotvec_to_rotmat(np.array([0.0, 0.2, 0.0]))
    velocity = np.tile([0.0, 0.0, 1.0], (N, 1))
    return Integrated(given.rotations[:, 0], velocity, np.full((N, 3), 0.1), rotations)


def learned(networks: object) -> Learned:
    given = aligned(N)
    return Learned(networks, given.time_s, given.known, given.confidence, given.shot)  # type: ignore[arg-type]


def test_a_share_of_the_correction_of_poses_is_made() -> None:
    before, after = motion(), learned(turned).corrected(motion())
    R_before, R_after = (rotvec_to_rotmat(one.vectors[:, list(ROTATED_JOINTS)]) for one in (before, after))
    np.testing.assert_allclose(rotation_angle(np.swapaxes(R_before, -1, -2) @ R_after), 0.2 * MS_HMR_SHARE, atol=1e-5)
    np.testing.assert_array_equal(after.pelvis_ref, before.pelvis_ref)


def test_the_velocity_is_that_of_the_frames_of_a_window() -> None:
    one = learned(turned)
    (term,) = one.terms(one.read(motion()), slice(3, 9))
    assert isinstance(term, RootVelocity) and len(term.velocity) == 6
    np.testing.assert_array_equal(term.time_s, aligned(N).time_s[3:9])


def test_no_network_says_nothing() -> None:
    given, one = motion(), learned(nothing)
    assert one.read(given) is None and one.terms(None, slice(0, 4)) == () and one.corrected(given) is given
