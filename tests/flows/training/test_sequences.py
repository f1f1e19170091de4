"""Who is shown in training, and who is measured on."""

import pytest

from humanmm.errors import InputError
from humanmm.flows.bench.render_set import SPLITS, shipped_packs
from humanmm.flows.training.sequences import sequences_of


def test_named_packs_are_for_training_and_what_is_measured_on_stays_the_same() -> None:
    packs = (shipped_packs("places", "train")[1],)
    shown, everybody = sequences_of(packs, "train"), sequences_of((), "train")
    assert 0 < len(shown) < len(everybody)
    measured = sequences_of(packs, "dev")
    assert {take.subject for take in measured} <= SPLITS["dev"]
    assert len(measured) == len(sequences_of((), "dev")) > 0


def test_a_pack_of_those_who_are_measured_on_is_refused() -> None:
    (pack,) = (pack for pack in shipped_packs() if pack.name == "cmu_test.npz")
    with pytest.raises(InputError, match=r"cmu_test\.npz: nobody's motion is left for training"):
        sequences_of((pack,), "train")
