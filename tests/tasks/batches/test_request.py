"""One batch as a user wants it: its name, its videos, and what each of them gets where it says nothing itself."""

import json
from pathlib import Path
from typing import Any

import pytest

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.storage.batches.batch_table import open_batches
from humanmm.tasks.batches.batch import batch_name
from humanmm.tasks.batches.request import BatchRequest


@pytest.fixture
def manifest(toy: Any) -> Path:
    """Two videos; the second has a priority and a tag."""
    for number, name in enumerate("ab"):
        (toy.folder / f"{name}.mp4").write_text(json.dumps({"num_frames": 60 + number, "cuts": [20, 40]}))
    path = Path(toy.folder / "videos.csv")
    path.write_text("video,priority,tags\na.mp4,,\nb.mp4,high,gym\n")
    return path


def test_the_defaults_of_a_batch_fill_what_a_video_does_not_say(toy: Any, manifest: Path) -> None:
    request = BatchRequest(
        source=manifest, out=toy.folder / "runs", config=Config(), name="mine", priority="low", tags=("night",)
    )
    table = open_batches(toy.store)
    assert {planned.row.batch for planned in request.forecast(table, request.videos())} == {"mine"}
    rows = request.submit(table, request.videos()).to_schedule
    assert [(Path(row.video).name, row.priority, json.loads(row.tags)) for row in rows] == [
        ("a.mp4", "low", ["night"]), ("b.mp4", "high", ["gym", "night"]),
    ]  # fmt: skip


def test_a_batch_without_a_name_is_named_after_its_source(tmp_path: Path) -> None:
    request = BatchRequest(source=tmp_path / "films", out=tmp_path, config=Config())
    assert request.batch == batch_name(tmp_path / "films") != batch_name(tmp_path / "other" / "films")


def test_a_source_without_videos_is_an_error_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "films").mkdir()
    request = BatchRequest(source=tmp_path / "films", out=tmp_path, config=Config(), pattern="*.mkv")
    with pytest.raises(InputError, match=r"films holds no video named \*\.mkv"):
        request.videos()
