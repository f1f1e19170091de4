"""Sets of pairs on a disk."""

from pathlib import Path

import numpy as np
import pytest
import zarr

from humanmm.errors import InputError
from humanmm.storage.training.pair_set import PairSet, read_pairs


def test_what_is_written_is_read_in_the_order_of_the_groups(tmp_path: Path) -> None:
    pair_set = PairSet(tmp_path, "a")
    for k in (1, 0):
        pair_set.write(
            f"dev-{k:05d}", {"x": np.full((2, 3), k, np.float32)}, [{"number": 2 * k}, {"number": 2 * k + 1}]
        )
    arrays, facts = read_pairs(tmp_path, "dev")
    assert arrays["x"][:, 0].tolist() == [0, 0, 1, 1] and [one["number"] for one in facts] == [0, 1, 2, 3]


def test_groups_of_another_identity_are_made_again(tmp_path: Path) -> None:
    PairSet(tmp_path, "a").write("dev-00000", {"x": np.zeros((1, 1))}, [{}])
    assert PairSet(tmp_path, "a").has("dev-00000") and not PairSet(tmp_path, "b").has("dev-00000")
    assert not PairSet(tmp_path, "a").has("dev-00001")


def test_an_empty_or_foreign_folder_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no pairs of the split train"):
        read_pairs(tmp_path, "train")
    zarr.open_group(tmp_path / "train-00000.zarr", mode="w")
    with pytest.raises(InputError, match="no group of pairs"):
        read_pairs(tmp_path, "train")


def test_groups_that_hold_different_things_are_no_set(tmp_path: Path) -> None:
    PairSet(tmp_path, "a").write("dev-00000", {"x": np.zeros((1, 1))}, [{}])
    PairSet(tmp_path, "b").write("dev-00001", {"x": np.zeros((1, 1)), "y": np.zeros((1, 1))}, [{}])
    with pytest.raises(InputError, match="made by different programs"):
        read_pairs(tmp_path, "dev")
