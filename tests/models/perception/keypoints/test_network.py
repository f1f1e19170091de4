"""The refiner's network: untrained it moves nothing, and its shape follows from its numbers."""

import torch

from humanmm.models.perception.keypoints.network import NUMBERS, SIGMA_PX, KeypointRefiner, RefinerInput
from humanmm.models.perception.keypoints.surroundings import CHANNELS, COARSE_CHANNELS, COUNT, WINDOW


def given(crops: int) -> RefinerInput:
    generator = torch.Generator().manual_seed(0)
    shapes = ((WINDOW, WINDOW, CHANNELS), (COARSE_CHANNELS,), (NUMBERS,))
    return RefinerInput(*(torch.randn(crops, COUNT, *shape, generator=generator) for shape in shapes))


def test_an_untrained_network_leaves_keypoints_where_they_are() -> None:
    shift, sigma = KeypointRefiner()(given(3))
    assert shift.shape == (3, COUNT, 2) and not shift.any()
    torch.testing.assert_close(sigma, torch.full((3, COUNT), SIGMA_PX))


def test_crops_do_not_depend_on_one_another_but_landmarks_of_one_do() -> None:
    network = KeypointRefiner().eval()
    torch.nn.init.normal_(network.outward.weight, generator=torch.Generator().manual_seed(1))
    both = given(2)
    shift, _ = network(both)
    alone, _ = network(RefinerInput(*(part[1:] for part in both)))
    torch.testing.assert_close(alone[0], shift[1])
    both.numbers[0, 5] += 1.0
    moved, _ = network(both)
    assert (moved[0] != shift[0]).any(dim=-1).all()
    torch.testing.assert_close(moved[1], shift[1])


def test_a_network_is_built_as_wide_and_deep_as_its_numbers_are() -> None:
    numbers = KeypointRefiner(width=64, depth=2).state_dict()
    KeypointRefiner.shaped_as(numbers).load_state_dict(numbers)
