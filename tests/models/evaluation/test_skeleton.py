"""Names of joints."""

import pytest

from humanmm.models.evaluation.skeleton import LIMB_NAMES, SMPL_NAMES, canonical, indices, shared_names

COCO = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle",
    "right_ankle",
)  # fmt: skip


@pytest.mark.parametrize("spelling", ["L_Hip", "LHip", "left_hip", "LeftHip", "left hip"])
def test_spellings_of_a_joint_are_one(spelling: str) -> None:
    assert canonical(spelling) == "lhip"


def test_coco_and_smpl_share_the_limbs() -> None:
    assert shared_names(SMPL_NAMES, COCO) == LIMB_NAMES
    assert indices(COCO, ("L_Hip", "R_Hip")) == [11, 12]


def test_two_full_skeletons_share_everything_and_strangers_nothing() -> None:
    assert shared_names(SMPL_NAMES, SMPL_NAMES) == SMPL_NAMES
    assert shared_names(SMPL_NAMES, ("tail",)) is None
