"""Arrays of strangers' files: what fits is converted, what does not is named with its key and its row."""

from typing import Any

import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.models.records import foreign_arrays
from humanmm.models.records.foreign_arrays import frame_numbers, numbers, rotations, whole_numbers


def test_numbers_become_doubles_of_the_expected_shape() -> None:
    found = numbers({"a": np.arange(6, dtype=np.int16).reshape(2, 1, 3)}, "a", (None, 3))
    assert found.shape == (2, 3) and found.dtype == np.float64
    assert numbers({"a": [[True, False]]}, "a", (1, 2)).tolist() == [[1.0, 0.0]]
    assert numbers({"a": 3}, "a", ()) == 3.0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.zeros((4, 2)), r"a has shape 4×2; expected N×3"),
        (np.float64(1), r"a has a single value; expected N×3"),
        (np.array([["1", "2", "3"]]), r"a has type <U1; expected numbers"),
        ([[1, 2, 3], [1]], r"a is no array of numbers"),
        (np.array([[0, 0, 0], [0, np.nan, 0]]), r"a holds numbers that are not finite, the first in row 1"),
    ],
)
def test_an_array_that_does_not_fit_is_named_with_what_was_found(value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        numbers({"a": value}, "a", (None, 3), finite=True)


def test_a_missing_array_and_one_that_is_too_long_are_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="a is missing"):
        numbers({"b": 1}, "a", ())
    monkeypatch.setattr(foreign_arrays, "MAX_ROWS", 3)
    assert len(numbers({"a": np.zeros(3)}, "a", (None,))) == 3
    with pytest.raises(InputError, match="shape 4"):
        numbers({"a": np.zeros(4)}, "a", (None,))


def test_whole_numbers_may_be_written_as_floats() -> None:
    assert whole_numbers({"a": [1.0, -2.0]}, "a", (2,)).tolist() == [1, -2]
    with pytest.raises(InputError, match=r"holds 0\.5; expected whole numbers"):
        whole_numbers({"a": [1.0, 0.5]}, "a", (2,))


def test_numbers_whose_products_would_be_infinite_are_refused() -> None:
    for read in (numbers, whole_numbers):
        with pytest.raises(InputError, match=r"a holds -1e\+200; expected numbers up to 1e\+12"):
            read({"a": [1.0, -1e200]}, "a", (2,))


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([-1, 0], "negative frame -1"),
        ([0, 2, 2], "does not rise strictly: 2 follows 2"),
        ([0, 9], "goes to frame 9; the frames end at 8"),
    ],
)
def test_frames_rise_from_zero_and_end_with_the_video(frames: list[int], message: str) -> None:
    assert frame_numbers({"f": [0, 3, 8]}, "f", 3, below=9).tolist() == [0, 3, 8]
    assert frame_numbers({"f": []}, "f", None, below=9).tolist() == []
    with pytest.raises(InputError, match=message):
        frame_numbers({"f": frames}, "f", len(frames), below=9)


def test_matrices_are_rotations_up_to_rounding_or_unknown() -> None:
    R = np.tile(np.eye(3), (3, 1, 1))
    R[1] += 0.005
    R[2] = np.nan
    np.testing.assert_array_equal(rotations({"R": R}, "R", (None, 3, 3)), R)
    with pytest.raises(InputError, match="not finite, the first in row 2"):
        rotations({"R": R}, "R", (None, 3, 3), finite=True)
    for wrong in (np.diag([1.0, 1.0, -1.0]), 1.1 * np.eye(3), np.full((3, 3), 1e12)):
        with pytest.raises(InputError, match="R holds 1 matrices that are no rotations, the first in row 2"):
            rotations({"R": np.stack([R[0], R[1], wrong])}, "R", (None, 3, 3))
