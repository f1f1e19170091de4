"""What is suggested for a wrong word."""

import pytest

from humanmm.cli.mistakes import close_words

FLAGS = ["--focal-px", "--force", "--from", "--out", "--people.max_people", "--people.max_side_px", "--camera.static"]
FORMATS = ["amass", "bvh", "glb", "trc", "gvhmr"]


@pytest.mark.parametrize(
    ("word", "known", "meant"),
    [
        ("--focl-px", FLAGS, ["--focal-px"]),
        ("--focal", FLAGS, ["--focal-px"]),
        ("--people.max_peple", FLAGS, ["--people.max_people"]),
        ("--max-people", FLAGS, ["--people.max_people"]),
        ("--static", FLAGS, ["--camera.static"]),
        ("--output", FLAGS, ["--out"]),
        ("bhv", FORMATS, ["bvh"]),
        ("gltf", FORMATS, ["glb"]),
        ("zzz", FORMATS, []),
        ("cam", ["scenes", "camera"], ["camera"]),
        ("cutt", ["add-cut", "remove-cut", "floor"], ["add-cut", "remove-cut"]),
    ],
)
def test_a_wrong_word_is_answered_with_what_is_like_it_and_nothing_else(
    word: str, known: list[str], meant: list[str]
) -> None:
    assert close_words(word, known) == meant
