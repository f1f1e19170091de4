"""A training that is stopped goes on to the same bytes."""

import io

import torch
from pair_windows import pair_arrays, walk

from humanmm.models.learning.other_motion import OtherMotion
from humanmm.models.learning.training.lifter import LifterRecipe, lifter_training
from humanmm.models.learning.training.loop import Training
from humanmm.models.learning.windows import windows_of
from humanmm.models.perception.lifting.network import LifterNetwork

RECIPE = LifterRecipe(steps=6, batch=2, warm_up=2)


def training() -> Training[LifterNetwork]:
    windows, errors = windows_of(pair_arrays())
    other = OtherMotion([walk()], pair_arrays(), windows, errors, routines=0.3)
    torch.manual_seed(0)
    return lifter_training(RECIPE, windows, other, begin_with=LifterNetwork(depth=2))


def test_a_restored_training_gives_the_same_weights() -> None:
    seen: list[int] = []
    whole = training()
    whole.run(6, lambda step, _: seen.append(step))
    first = training()
    first.run(3, lambda _, __: None)
    file = io.BytesIO()
    torch.save(first.state(), file)
    file.seek(0)
    second = training()
    second.restore(torch.load(file, weights_only=True))
    second.run(100, lambda _, __: None)
    assert seen == [1, 2, 3, 4, 5, 6] and second.step == 6
    for name, weights in whole.averaged.items():
        assert torch.equal(weights, second.averaged[name]), name
