"""Takes with bent knees: the pelvis is lower, feet stay on the floor, and who sits stays as he is."""

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.axes import R_ZUP_YUP
from humanmm.models.rendering.places.crouching import DEEPEST, LONGER, WIDER, crouched
from humanmm.models.synthetic.mocap import MocapSequence, leg_length

FRAMES, FPS = 90, 30.0
HIPS, ANKLES = (1, 2), (7, 8)
Array = np.ndarray


def standing(knee_rad: float = 0.1) -> MocapSequence:
    """Somebody who stands and waves, knees bent."""
    pose = np.zeros((FRAMES, 23, 3))
    pose[:, [0, 1], 0], pose[:, [3, 4], 0] = -knee_rad / 2, knee_rad
    pose[:, 15, 2] = np.sin(np.arange(FRAMES) / 9)
    leg_m = leg_length(load_body().rest_joints(np.zeros(10)))
    pelvis = np.tile([0.3, -0.2, leg_m * np.cos(knee_rad / 2) + 0.1], (FRAMES, 1))
    return MocapSequence("one", FPS, np.tile(R_ZUP_YUP, (FRAMES, 1, 1)), pose, pelvis, np.ones((FRAMES, 4)), leg_m)


def joints_of(take: MocapSequence) -> Float[Array, "N 24 3"]:
    rest = load_body().rest_joints(np.zeros(10))
    return forward_kinematics(rest, take.R_world_root, take.body_pose, take.pelvis)[0]


def test_the_pelvis_is_lower_and_the_feet_are_where_they_were_or_apart() -> None:
    take = standing()
    for seed in range(8):
        made = crouched(take, np.random.default_rng(seed))
        before, after = joints_of(take), joints_of(made)
        lowered = before[:, 0, 2] - after[:, 0, 2]
        assert (lowered >= -1e-9).all() and lowered.max() <= DEEPEST * take.leg_m + 1e-9
        moved = after[:, ANKLES] - before[:, ANKLES]
        assert np.abs(moved[..., 2]).max() < 0.005  # a leg that does not reach there ends short of it
        assert np.linalg.norm(moved, axis=-1).max() < take.leg_m * np.hypot(WIDER, LONGER)


def test_the_nearer_an_ankle_is_to_its_hip_the_more_the_knee_bends() -> None:
    take = standing()
    made = [crouched(take, np.random.default_rng(seed)) for seed in range(8)]
    joints = [joints_of(one) for one in made]
    reach = np.array([np.linalg.norm(one[:, ANKLES] - one[:, HIPS], axis=-1) for one in joints]).ravel()
    bent = np.array([np.linalg.norm(one.body_pose[:, [3, 4]], axis=-1) for one in made]).ravel()
    assert np.corrcoef(reach, np.cos(bent))[0, 1] > 0.99 and bent.max() > 1.0
    sideways = np.array([one.body_pose[:, [3, 4], 2] for one in made])
    assert np.abs(sideways).max() < 0.05  # a knee is a hinge
    for one in made:
        assert np.array_equal(one.body_pose[:, 12:], take.body_pose[:, 12:])  # arms are as they were


def test_soles_stay_level() -> None:
    take = standing()
    made = crouched(take, np.random.default_rng(3))
    rest = load_body().rest_joints(np.zeros(10))
    (_, before), (_, after) = (
        forward_kinematics(rest, one.R_world_root, one.body_pose, one.pelvis) for one in (take, made)
    )
    np.testing.assert_allclose(after[:, ANKLES], before[:, ANKLES], atol=1e-6)


def test_who_squats_already_is_not_lowered() -> None:
    take = standing(knee_rad=2.2)
    made = crouched(take, np.random.default_rng(0))
    np.testing.assert_allclose(made.pelvis, take.pelvis, atol=1e-9)
    np.testing.assert_allclose(joints_of(made), joints_of(take), atol=1e-6)
    np.testing.assert_allclose(made.body_pose, take.body_pose, atol=1e-6)
