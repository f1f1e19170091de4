"""ms-HMR before any training, and how it knows shots apart."""

from dataclasses import replace

import torch
from motion_sequences import sequence

from humanmm.models.motion.networks.ms_hmr import REACH_S, MsHmr, shot_encoding
from humanmm.models.motion.networks.sequence import RATE_HZ


def untrained() -> MsHmr:
    torch.manual_seed(0)
    return MsHmr(width=20, depth=1, heads=2).eval()


def test_at_first_it_changes_nothing() -> None:
    motion = sequence()
    torch.testing.assert_close(untrained()(motion).rotations, motion.rotations)


def test_shots_are_known_by_their_index() -> None:
    encoding = shot_encoding(torch.tensor([[0, 0, 1, 2]]), 20)[0]
    assert torch.equal(encoding[0], encoding[1])
    assert (encoding[1] - encoding[2]).norm() > 0.5 and (encoding[2] - encoding[3]).norm() > 0.5


def test_a_layer_reaches_a_second() -> None:
    network, motion = untrained(), sequence(80)
    torch.nn.init.normal_(network.outward.weight, generator=torch.Generator().manual_seed(1))
    confidence = motion.confidence.clone()
    confidence[:, -1] = 0.1
    change = (
        (network(replace(motion, confidence=confidence)).rotations - network(motion).rotations).abs().amax((0, 2, 3, 4))
    )
    far = 79 - int(REACH_S * RATE_HZ) - 1
    assert network.reach_s == REACH_S and change[: far + 1].max() == 0 and change[far + 2 :].min() > 0
