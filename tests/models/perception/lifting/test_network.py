"""The lifter's network: rotations, and what a frame depends on."""

import dataclasses

import torch

from humanmm.models.perception.lifting.network import REACH_S, LifterInput, LifterNetwork, rotations_of


def given(n: int, seed: int = 0) -> LifterInput:
    generator = torch.Generator().manual_seed(seed)
    normal = lambda *shape: torch.randn(*shape, generator=generator)  # noqa: E731
    return LifterInput(
        torch.arange(n)[None] / 10, torch.ones(1, n, dtype=torch.bool), normal(1, n, 33, 2), torch.ones(1, n, 33),
        normal(1, n, 33, 3), torch.ones(1, n, dtype=torch.bool), torch.full((1, n), 0.3),
    )  # fmt: skip


def network() -> LifterNetwork:
    torch.manual_seed(0)
    found = LifterNetwork(width=24, depth=2, heads=2).eval()
    torch.nn.init.normal_(found.outward.weight, std=0.1)
    return found


def test_six_numbers_are_a_rotation() -> None:
    R = rotations_of(torch.randn(50, 6, generator=torch.Generator().manual_seed(1)))
    assert torch.allclose(R @ R.transpose(-1, -2), torch.eye(3).expand(50, 3, 3), atol=1e-5)
    assert torch.allclose(torch.linalg.det(R), torch.ones(50), atol=1e-5)


def test_untrained_it_gives_its_mean() -> None:
    assert torch.equal(LifterNetwork().eval()(given(5)).landmarks, torch.zeros(1, 5, 33, 3))


def test_it_can_be_told_to_forget_the_landmarks_that_it_is_given() -> None:
    net, one = network(), given(5)
    other = dataclasses.replace(one, landmarks=one.landmarks + 1.0)
    with torch.inference_mode():
        assert not torch.equal(net(one).landmarks, net(other).landmarks)
        net.forget_landmarks()
        assert torch.equal(net(one).landmarks, net(other).landmarks)
        elsewhere = dataclasses.replace(one, points=one.points + 1.0)
        assert not torch.equal(net(one).landmarks, net(elsewhere).landmarks)


def test_a_deeper_network_says_what_it_said() -> None:
    net, one = network(), given(12)
    deeper = net.deepened(5)
    assert len(LifterNetwork.shaped_as(deeper.state_dict()).blocks) == len(deeper.blocks) == 5
    with torch.inference_mode():
        assert torch.allclose(deeper(one).landmarks, net(one).landmarks, atol=1e-6)
    assert len(net.blocks) == 2


def test_a_frame_depends_on_nothing_beyond_the_reach() -> None:
    net, one = network(), given(60)
    assert net.reach_s == 2 * REACH_S
    changed = one.landmarks.clone()
    changed[:, 0] += 1.0
    with torch.inference_mode():
        a, b = net(one).landmarks, net(dataclasses.replace(one, landmarks=changed)).landmarks
    moved = (a - b).abs().amax(dim=(0, 2, 3))
    assert moved[15] > 0 and (moved[21:] == 0).all()


def test_frames_without_anybody_change_nothing() -> None:
    net, one = network(), given(12)
    exists = one.exists.clone()
    exists[:, 6] = False
    a = dataclasses.replace(one, exists=exists)
    other = one.points.clone()
    other[:, 6] += 3.0
    b = dataclasses.replace(a, points=other)
    rest = [k for k in range(12) if k != 6]
    with torch.inference_mode():
        assert torch.equal(net(a).landmarks[:, rest], net(b).landmarks[:, rest])
