"""Looks for the keypoint refiner: what is to be learnt is where the true person's landmarks are seen."""

import numpy as np

from humanmm.flows.bench.render_set import shipped_packs, takes_of
from humanmm.models.learning.landmark_looks import LOOKS, LookSource
from humanmm.models.learning.pairs import PairSource
from humanmm.models.perception.blazepose import LANDMARK_SIDE
from humanmm.models.perception.keypoints.surroundings import LIMB_ROWS
from humanmm.models.rendering.places.takes import Library
from humanmm.storage.readers.mocap_pack import read_pack


def test_keypoints_are_a_little_off_and_looks_are_made_again_alike() -> None:
    sequences = [sequence for pack in shipped_packs("places", "dev") for sequence in read_pack(pack)]
    source = LookSource(PairSource(Library(takes_of(sequences, "dev")), 5))
    looks, facts = source.looks(1)
    assert facts["motion"] == "walk" and looks.windows.shape == (LOOKS, 22, 7, 7, 74)
    limbs = looks.is_known & (np.arange(22) < len(LIMB_ROWS))
    off = np.linalg.norm(looks.shift, axis=-1)[limbs] / LANDMARK_SIDE
    assert limbs.sum() > 40 and 0.002 < np.median(off) < 0.03
    again = source.looks(1)[0].packed()
    for name, array in looks.packed().items():
        assert np.array_equal(array, again[name]), name
    assert looks.packed()["windows"].dtype == np.float16
