"""A window of pairs: the truth is what the picture shows, and the seed decides it."""

import numpy as np
import pytest

from humanmm.flows.bench.render_set import shipped_packs, takes_of
from humanmm.models.learning import pairs
from humanmm.models.rendering.places.takes import Library
from humanmm.storage.readers.mocap_pack import read_pack


def test_keypoints_lie_on_the_true_person_and_a_window_is_made_again_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pairs, "FRAMES", 3)
    monkeypatch.setattr(pairs, "OTHERS", 0.0)
    sequences = [sequence for pack in shipped_packs("places", "dev") for sequence in read_pack(pack)]
    source = pairs.PairSource(Library(takes_of(sequences, "dev")), 5)
    window, facts = source.window(1)
    assert facts["motion"] == "walk" and facts["subject"] in {"03", "06", "11"} and len(window.time_s) == 3
    seen = window.confidence > 0.5
    assert seen.any()
    pixels = pairs.project(window.truth_cam, window.K, near_m=0.3)
    limbs = slice(11, 29)
    off = np.linalg.norm(window.keypoints[:, limbs, :2] - pixels[:, limbs], axis=-1) / window.region[:, 2:3]
    assert np.median(off[seen]) < 0.04
    again, _ = source.window(1)
    for name, array in window.packed().items():
        assert np.array_equal(array, again.packed()[name]), name
