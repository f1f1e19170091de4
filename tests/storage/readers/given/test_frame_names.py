"""A file's name says which frame it shows."""

import pytest

from humanmm.errors import InputError
from humanmm.storage.readers.given.frame_names import frame_number


@pytest.mark.parametrize(
    "name", ["12.png", "take2/frame_000012.jpg", "clip3_000000000012_keypoints.json", "7/000012", "v2.1_0012.png"]
)
def test_the_last_number_of_the_name_is_the_frame(name: str) -> None:
    assert frame_number(name) == 12


def test_a_name_without_a_number_is_refused() -> None:
    with pytest.raises(InputError, match="no number in the name"):
        frame_number("take2/first.png")
