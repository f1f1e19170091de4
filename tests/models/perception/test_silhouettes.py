"""Masks drawn from keypoints."""

import numpy as np

from humanmm.models.perception.regions import invert, transform
from humanmm.models.perception.silhouettes import silhouettes
from humanmm.models.records.landmarks import INDEX, NUM_LANDMARKS

STANDING = np.full((NUM_LANDMARKS, 2), (300.0, 120.0))
for _joint, _height, _width in (("ear", 110, 9), ("shoulder", 150, 20), ("elbow", 190, 30), ("wrist", 225, 35),
                                ("index", 235, 36), ("hip", 230, 12), ("knee", 280, 13), ("ankle", 330, 13),
                                ("heel", 335, 13), ("foot_index", 338, 18)):  # fmt: skip
    for _side, _sign in (("left", 1), ("right", -1)):
        STANDING[INDEX[f"{_side}_{_joint}"]] = 300 + _sign * _width, _height


def test_joints_and_bones_lie_on_the_mask_and_the_picture_beside_the_person_does_not() -> None:
    masks, affine = silhouettes(STANDING[None])
    mask, to_mask = masks.mask(0), invert(affine[0].astype(float))

    def covered(point: np.ndarray) -> bool:
        column, row = np.floor(transform(to_mask, point)).astype(int)
        return bool(mask[row, column])

    for bone in (("left_hip", "left_knee"), ("right_knee", "right_ankle"), ("left_shoulder", "left_elbow")):
        start, end = (STANDING[INDEX[name]] for name in bone)
        assert all(covered(start + at * (end - start)) for at in (0.0, 0.3, 0.7, 1.0)), bone
    assert not covered(STANDING[INDEX["left_ankle"]] + (25, 0))
    assert not covered(np.array([300.0, 320.0]))  # between the legs


def test_a_person_twice_as_large_has_the_same_mask_and_pixels_half_as_fine() -> None:
    one, affine = silhouettes(STANDING[None])
    two, doubled = silhouettes(2 * STANDING[None])
    np.testing.assert_allclose(doubled, 2 * affine, rtol=1e-6)
    assert (one.mask(0) != two.mask(0)).mean() < 0.005  # rounding of line widths
