"""Fits of a set of pairs are made once."""

from pathlib import Path

import numpy as np
import pytest
from pair_windows import pair_arrays

from humanmm.flows.training import fits
from humanmm.flows.training.fits import fitted_pairs
from humanmm.storage.training.pair_set import PairSet


def test_fits_are_kept_beside_the_pairs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    PairSet(tmp_path, "a").write("dev-00000", pair_arrays(), [{}] * 4)
    first = fitted_pairs(tmp_path, "dev", threads=1)
    assert first["fitted"].shape == first["time_s"].shape and first["fitted"].any()

    def again(*_: object) -> str:
        raise AssertionError("fitted twice")

    monkeypatch.setattr(fits, "fit_group", again)
    np.testing.assert_array_equal(fitted_pairs(tmp_path, "dev")["R_cam_root_fitted"], first["R_cam_root_fitted"])
