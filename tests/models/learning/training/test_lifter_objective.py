"""The loss is least for the truth; the score is zero for it."""

import numpy as np
import torch
from pair_windows import pair_arrays

from humanmm.models.learning.training.lifter_objective import loss, score
from humanmm.models.learning.windows import windows_of
from humanmm.models.perception.lifting.network import LifterOutput


def test_what_is_true_costs_less_than_what_is_not() -> None:
    windows, _ = windows_of(pair_arrays())
    sure, sides = torch.full((*windows.swapped.shape, 20), -5.0), 20 * (windows.swapped.float() - 0.5)
    perfect = LifterOutput(windows.truth, windows.pose, sure, sides, 20 * (windows.contacts - 0.5))
    best = float(loss(perfect, windows))
    rolled = torch.roll(windows.pose, 1, dims=2)
    for wrong in (
        LifterOutput(windows.truth + torch.tensor([0.0, 0.0, 0.1]), *list(vars(perfect).values())[1:]),
        LifterOutput(windows.truth, rolled, sure, sides, perfect.contacts),
        LifterOutput(windows.truth, windows.pose, sure, -sides, perfect.contacts),
    ):
        assert float(loss(wrong, windows)) > best + 0.1


def test_the_pose_networks_own_landmarks_are_scored() -> None:
    windows, _ = windows_of(pair_arrays())
    found = score(None, windows)
    assert 20 < found.mpjpe_mm[0] < 60 and found.pa_mpjpe_mm[0] < found.mpjpe_mm[0]
    assert np.isnan(found.root_deg[0]) and found.swaps_found == 0
