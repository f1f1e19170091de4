"""Videos whose cuts are known: our own lists, and the two layouts of BBC Planet Earth."""

import json
from pathlib import Path

import pytest

from humanmm.errors import InputError
from humanmm.storage.readers.cut_truth import read_cut_clips


def test_a_list_of_transitions_beside_its_video_is_read(tmp_path: Path) -> None:
    (tmp_path / "film.mp4").touch()
    (tmp_path / "alone.mp4").touch()
    spans = [{"type": "cut", "start": 50, "end": 50}, {"type": "dissolve", "start": 213, "end": 225}]
    (tmp_path / "film.json").write_text(json.dumps({"transitions": spans}))
    (clip,) = read_cut_clips(tmp_path)
    assert (clip.video.name, clip.transitions) == ("film.mp4", ((50, 50), (213, 225)))


@pytest.mark.parametrize(
    ("table", "video"),
    [("fixed/01-From_Pole_to_Pole.txt", "videos/bbc_01.mp4"), ("annotations/shots/bbc_01.txt", "bbc_01.mp4")],
)
def test_bbc_lists_shots_by_first_and_last_frame(tmp_path: Path, table: str, video: str) -> None:
    for name, text in ((table, "0\t99\n100\t149\n160\t300\n"), (video, "")):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (clip,) = read_cut_clips(tmp_path)
    assert clip.video == tmp_path / video
    assert clip.transitions == ((100, 100), (150, 160))  # a hard cut, and ten frames that belong to no shot


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    (tmp_path / "fixed").mkdir()
    (tmp_path / "fixed" / "02-Mountains.txt").write_text("0 9\n10 20\n")
    with pytest.raises(InputError, match=r"videos/bbc_02\.mp4 is missing"):
        read_cut_clips(tmp_path)
    with pytest.raises(InputError, match="holds no video beside"):
        read_cut_clips(tmp_path / "fixed")


def test_shots_that_overlap_are_refused(tmp_path: Path) -> None:
    (tmp_path / "film.mp4").touch()
    spans = [{"start": 50, "end": 60}, {"start": 55, "end": 70}]
    (tmp_path / "film.json").write_text(json.dumps({"transitions": spans}))
    with pytest.raises(InputError, match="must rise"):
        read_cut_clips(tmp_path)


@pytest.mark.parametrize(
    "text", ["{", "[" * 200_000, '{"transitions": 5}', '{"transitions": [{"start": 1e999, "end": 2}]}', '{"a": [1]}']
)
def test_a_list_that_is_none_is_told_without_the_words_of_a_library(tmp_path: Path, text: str) -> None:
    (tmp_path / "film.mp4").touch()
    (tmp_path / "film.json").write_text(text)
    with pytest.raises(
        InputError, match=r"film\.json is no list of transitions, each with whole numbers start and end$"
    ):
        read_cut_clips(tmp_path)
