"""Numbers in eight bits come back as what they were, to a part of their neighbours' size."""

import torch

from humanmm.models.weights.eight_bits import GROUP, LARGEST, packed, unpacked


def test_numbers_come_back_to_half_a_step_of_the_largest_of_their_group() -> None:
    generator = torch.Generator().manual_seed(0)
    weight = torch.randn(5, 2 * GROUP, generator=generator)
    weight[:, :GROUP] *= 1e-3  # a group of its own: it does not suffer from the larger one beside it
    weight[2], weight[3, 0] = 0.0, 100.0
    again = unpacked(packed({"weight": weight}))["weight"]
    assert again.shape == weight.shape
    largest = weight.reshape(5, 2, GROUP).abs().amax(dim=-1)
    step = (largest / LARGEST)[..., None].expand(5, 2, GROUP).reshape(weight.shape)
    assert ((again - weight).abs() <= 0.55 * step + 1e-7).all()


def test_what_is_not_a_matrix_of_whole_groups_keeps_half_precision() -> None:
    numbers = {"bias": torch.randn(GROUP), "first": torch.randn(3, GROUP + 1)}
    stored = packed(numbers)
    assert {name: value.dtype for name, value in stored.items()} == dict.fromkeys(numbers, torch.float16)
    again = unpacked(stored)
    for name, value in numbers.items():
        torch.testing.assert_close(again[name], value, atol=1e-3, rtol=1e-3)


def test_what_is_packed_is_packed_to_the_same_numbers_again() -> None:
    once = unpacked(packed({"weight": torch.randn(4, GROUP)}))
    twice = unpacked(packed(once))
    torch.testing.assert_close(twice["weight"], once["weight"], atol=2e-3, rtol=0)
