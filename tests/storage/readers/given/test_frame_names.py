"""A file's name says which frame it shows."""

import pytest

from humanmm.errors import InputError
from humanmm.storage.readers.given.frame_names import doubts, frame_number


@pytest.mark.parametrize(
    "name", ["12.png", "take2/frame_000012.jpg", "clip3_000000000012_keypoints.json", "7/000012", "v2.1_0012.png"]
)
def test_the_last_number_of_the_name_is_the_frame(name: str) -> None:
    assert frame_number(name) == 12


def test_a_name_without_a_number_is_refused() -> None:
    with pytest.raises(InputError, match="no number in the name"):
        frame_number("take2/first.png")


def test_a_file_is_doubted_where_it_ends_early_or_begins_at_one() -> None:
    assert doubts("boxes", 0, 149, 150) == doubts("boxes", 0, 145, 150) == doubts("boxes", 0, 0, 3) == ()
    assert doubts("boxes", 0, 239, 250)[0].startswith("given boxes end at frame 239, the video at 249")
    assert len(doubts("boxes", 1, 74, 150)) == 2 and len(doubts("boxes", 1, 74, 150, sure_of_first=True)) == 1
