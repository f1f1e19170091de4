from pathlib import Path

import pytest

from humanmm.cli import main
from humanmm.cli.camera import camera


def test_a_folder_that_is_there_is_refused_before_anything_is_computed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["camera", str(tmp_path / "film.mp4"), "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err == f"humanmm: {tmp_path} is there already; --force replaces it\n"


def test_two_ways_to_give_the_lens_exclude_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["camera", "film.mp4", "--focal-px", "900", "--fov-deg", "60"]) == 2
    assert "exclude each other" in capsys.readouterr().err


def test_its_help_says_what_a_shot_is_in() -> None:
    assert "axes of its own first camera" in str(camera.__doc__)
