"""The truth of a clip: who is person 00, and where the world begins."""

import numpy as np
import pytest

from humanmm.models.evaluation.truth import contract_sequence
from humanmm.models.rendering.script import Clip
from humanmm.models.rendering.truth import joined, person_order, truth_arrays


@pytest.fixture(scope="module")
def arrays(clip: Clip) -> dict[str, np.ndarray]:
    """The second actor is the larger one in the picture; half of the joints are visible in every other frame."""
    boxes = np.zeros((2, clip.num_frames, 4))
    boxes[0, :, 2:], boxes[1, :, 2:] = 10, 20
    seen = np.zeros((clip.num_frames, 2, 24), bool)
    seen[::2, :, :12] = True
    return truth_arrays(clip, seen, boxes)


def test_the_largest_comes_first_and_equals_keep_their_order() -> None:
    boxes = np.zeros((3, 2, 4))
    boxes[:, :, 2:] = np.array([2, 5, 2])[:, None, None]
    assert person_order(boxes) == [1, 0, 2]


def test_the_world_begins_under_the_first_pelvis_of_person_00(clip: Clip, arrays: dict[str, np.ndarray]) -> None:
    np.testing.assert_allclose(arrays["people/00/joints"][0, 0, :2], 0, atol=1e-6)
    apart = clip.actors[0].joints[0, 0] - clip.actors[1].joints[0, 0]
    np.testing.assert_allclose(arrays["people/01/joints"][0, 0, :2], apart[:2], atol=1e-5)


def test_visibility_is_the_fraction_of_visible_joints_and_decides_on_observed(
    arrays: dict[str, np.ndarray],
) -> None:
    assert arrays["people/00/visibility"][:4].tolist() == [0.5, 0, 0.5, 0]
    assert arrays["people/00/observed"][:4].tolist() == [True, False, True, False]


def test_the_evaluation_reads_it_and_keypoints_are_the_projected_joints(
    clip: Clip, arrays: dict[str, np.ndarray]
) -> None:
    sequence = contract_sequence(arrays)
    assert sequence.cut_frames == tuple(change.at for change in clip.changes)
    assert sequence.cameras is not None
    cameras, person = sequence.cameras, sequence.people[0]
    in_camera = np.einsum("nba,nkb->nka", cameras.R_world_cam, person.joints - cameras.t_world_cam[:, None])
    projected = np.einsum("nab,nkb->nka", cameras.K, in_camera)
    pixels = projected[..., :2] / projected[..., 2:]
    far = in_camera[..., 2] > 0.5
    np.testing.assert_allclose(arrays["people/00/keypoints2d"][..., :2][far], pixels[far], atol=0.05)


def test_parts_are_joined_one_after_the_other_and_their_people_are_others(arrays: dict[str, np.ndarray]) -> None:
    n, cuts = int(arrays["num_frames"]), len(arrays["cut_frames"])
    whole = joined([arrays, arrays], lost_s=[0.0] * (2 * cuts + 1), features={"split": "dev"})
    sequence = contract_sequence(whole)
    assert sequence.num_frames == 2 * n
    assert sequence.unlinked_cuts == (n,)
    assert [person.person for person in sequence.people] == [0, 1, 2, 3]
    assert sequence.people[2].frame.tolist() == list(range(n, 2 * n))
    np.testing.assert_array_equal(sequence.people[2].joints, sequence.people[0].joints)
    assert sequence.cameras is not None
    np.testing.assert_array_equal(sequence.cameras.K[n:], sequence.cameras.K[:n])
    assert whole["shot_index"].tolist() == [*arrays["shot_index"], *(arrays["shot_index"] + len(arrays["shot_kinds"]))]
