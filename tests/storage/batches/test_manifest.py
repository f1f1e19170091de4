"""Which videos a folder or a manifest asks for, and what is said of a bad one."""

import json
from pathlib import Path

import pytest

from humanmm.errors import InputError
from humanmm.storage.batches.manifest import read_batch


@pytest.fixture
def videos(tmp_path: Path) -> Path:
    for name in ("a.mp4", "b.MKV", "deep/c.mov", "deep/notes.txt", ".hidden.mp4"):
        path = tmp_path / "videos" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    return tmp_path / "videos"


def _names(source: Path, **options: str) -> list[str]:
    return [entry.video.name for entry in read_batch(source, **options)]


def test_a_folder_gives_every_video_in_it_at_any_depth(videos: Path) -> None:
    assert _names(videos) == ["a.mp4", "b.MKV", "c.mov"]
    assert _names(videos, pattern="*.mov") == ["c.mov"]


def test_a_link_to_nothing_is_kept_to_fail_with_its_reason(videos: Path) -> None:
    (videos / "lost.mp4").symlink_to(videos / "gone.mp4")
    (videos / "deep/folder.mp4").mkdir()
    assert _names(videos) == ["a.mp4", "b.MKV", "c.mov", "lost.mp4"]
    (videos / "m.csv").write_text("video\nl*.mp4\ndeep/*.mp4\n")
    assert _names(videos / "m.csv") == ["lost.mp4"]


def test_a_csv_manifest_gives_settings_tags_and_patterns(videos: Path) -> None:
    manifest = videos / "batch.csv"
    manifest.write_text(
        "video,priority,tags,out,camera.static,people.max_people\n"
        "a.mp4,high,gym; night,first,true,3\n"
        "deep/*.mov,,,,,\n"
        "a*.mp4,low,,,,\n"
        "missing.mp4,,,,,\n"
    )
    first, second, third = read_batch(manifest)
    assert (first.video, first.priority, first.tags, first.out) == (videos / "a.mp4", "high", ("gym", "night"), "first")
    assert first.settings == {"camera": {"static": "true"}, "people": {"max_people": "3"}}
    assert (second.video, second.priority, second.settings) == (videos / "deep/c.mov", "", {})
    assert third.video == videos / "missing.mp4", "it fails later, with its reason, and the others run"


def test_the_line_that_names_a_video_counts_more_than_a_pattern_wherever_it_stands(videos: Path) -> None:
    for lines in ("a.mp4,high\na*.m*,low\n", "a*.m*,low\n*a.mp4,\na.mp4,high\na.mp4,high\n"):
        (videos / "m.csv").write_text("video,priority\n" + lines)
        assert {entry.video.name: entry.priority for entry in read_batch(videos / "m.csv")} == {"a.mp4": "high"}


@pytest.mark.parametrize("lines", ["a.mp4,high\na.mp4,low\n", "*a.mp4,high\na*.mp4,low\n"])
def test_two_lines_that_want_different_things_of_a_video_are_refused(videos: Path, lines: str) -> None:
    (videos / "m.csv").write_text("video,priority\n" + lines)
    with pytest.raises(InputError, match=r"m.csv, line 2, and line 3 want different things of .*a.mp4"):
        read_batch(videos / "m.csv")


@pytest.mark.parametrize("name", ["two\nlines.mp4", "two\r\nlines.mp4", "a\u2028b.mp4", "a\x0cb.mp4"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_names_may_hold_what_ends_a_line_elsewhere(videos: Path, name: str, newline: str) -> None:
    (videos / "m.csv").write_bytes(f'video,priority{newline}"{name}",low{newline}a.mp4,high{newline}'.encode())
    lines = [json.dumps({"video": video}, ensure_ascii=False) for video in (name, "a.mp4")]
    (videos / "m.jsonl").write_bytes(newline.join(lines).encode())
    assert _names(videos / "m.csv") == _names(videos / "m.jsonl") == [name, "a.mp4"]


def test_none_in_a_column_clears_what_need_not_be_given_and_is_a_name_elsewhere(videos: Path) -> None:
    (videos / "batch.csv").write_text("video,intrinsics.focal_px,refine.networks\na.mp4,none,none\n")
    (entry,) = read_batch(videos / "batch.csv")
    assert entry.settings == {"intrinsics": {"focal_px": None}, "refine": {"networks": "none"}}


def test_a_json_lines_manifest_means_the_same(videos: Path) -> None:
    manifest = videos / "batch.jsonl"
    manifest.write_text('{"video": "a.mp4", "tags": ["gym"], "settings": {"camera": {"static": true}}}\n\n')
    (entry,) = read_batch(manifest)
    assert (entry.video, entry.tags, entry.settings) == (videos / "a.mp4", ("gym",), {"camera": {"static": True}})


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("m.csv", "video,prio\na.mp4,high\n", "line 1: unknown column 'prio'"),
        ("m.csv", "video,priority\na.mp4,urgent\n", "priority 'urgent' is none of"),
        ("m.csv", "video,tags\na.mp4\n", "not as many columns"),
        ("m.csv", "priority\nhigh\n", "`video` is missing"),
        ("m.csv", "video;priority\na.mp4;high\n", "line 1: columns are separated by commas"),
        ("m.csv", "video\n", "lists no video"),
        ("m.jsonl", '{"video": "a.mp4"\n', "m.jsonl, line 1: "),
        ("m.jsonl", '{"video": "a.mp4", "speed": 3}\n', "unknown key 'speed'"),
        ("m.jsonl", '{"video": "*.mp4", "tags": "gym"}\n', "`tags` is a list"),
        ("m.jsonl", '{"video": "a.mp4", "out": 5}\n', "line 1: `video` and `out` are paths"),
        ("m.jsonl", '{"video": "a\\u0000.mp4"}\n', "line 1: `video` and `out` are paths"),
        ("m.txt", "a.mp4\n", "neither a folder nor a .csv or .jsonl"),
    ],
)
def test_a_bad_manifest_is_reported_with_its_line(videos: Path, name: str, text: str, message: str) -> None:
    (videos / name).write_text(text)
    with pytest.raises(InputError) as caught:
        read_batch(videos / name)
    assert message in str(caught.value)


@pytest.mark.parametrize("wrong", [2, 25])
def test_every_line_that_is_wrong_is_named_and_of_many_their_number(videos: Path, wrong: int) -> None:
    (videos / "m.csv").write_text("video,priority\na.mp4,high\n" + "a.mp4,urgent\n" * wrong)
    with pytest.raises(InputError) as caught:
        read_batch(videos / "m.csv")
    lines = str(caught.value).splitlines()
    assert [line.split(": ")[0].rpartition("/")[2] for line in lines[:20]] == [
        f"m.csv, line {number}" for number in range(3, 3 + min(wrong, 20))
    ]
    assert lines[20:] == ([] if wrong < 20 else ["and 5 more mistakes"])


def test_a_pattern_with_one_run_folder_for_many_videos_is_refused(videos: Path) -> None:
    (videos / "z.mp4").touch()
    (videos / "m.csv").write_text("video,out\n*.mp4,same\n")
    with pytest.raises(InputError, match="names one run folder"):
        read_batch(videos / "m.csv")


def test_a_missing_manifest_and_an_empty_folder_are_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read"):
        read_batch(tmp_path / "none.csv")
    with pytest.raises(InputError, match="holds no video"):
        read_batch(tmp_path)


@pytest.fixture
def with_runs(videos: Path) -> Path:
    """The folder with two run folders in it, one of them of a name of its own."""
    for run in ("runs/a", "deep/mine"):
        (videos / run / "motion.zarr").mkdir(parents=True)
        (videos / run / "run.json").write_text("{}")
        (videos / run / "view").mkdir()
        (videos / run / "view" / "overlay.mp4").touch()
    return videos


def test_run_folders_in_a_folder_are_left_out_whatever_their_name(with_runs: Path) -> None:
    assert _names(with_runs) == ["a.mp4", "b.MKV", "c.mov"]
    assert _names(with_runs, pattern="*.mp4") == ["a.mp4"]
    (with_runs / "runs/a/run.json").unlink()
    assert _names(with_runs) == ["a.mp4", "b.MKV", "c.mov", "overlay.mp4"], "without it, it is a folder like any other"


@pytest.mark.parametrize("inside", ["runs/a", "runs/a/view"])
def test_a_folder_that_lies_in_a_run_folder_is_refused(with_runs: Path, inside: str) -> None:
    with pytest.raises(InputError, match=r"is in a run folder or store \(.*runs/a\) .*; name a video's file"):
        read_batch(with_runs / inside)


def test_a_pattern_of_a_manifest_finds_nothing_in_run_folders_and_a_name_does(with_runs: Path) -> None:
    manifest = with_runs / "batch.csv"
    manifest.write_text("video\n**/[!.]*.mp4\nruns/a/view/*.mp4\n")
    assert _names(manifest) == ["a.mp4"]
    manifest.write_text("video\nruns/a/view/overlay.mp4\n")
    assert _names(manifest) == ["overlay.mp4"]


def test_a_pattern_may_name_folders(videos: Path) -> None:
    assert _names(videos, pattern="deep/*.mov") == ["c.mov"]
    assert _names(videos, pattern="deep/**/*.mov") == ["c.mov"]
    assert _names(videos, pattern="**/*.m*") == ["a.mp4", "c.mov"]


def test_the_films_of_a_store_are_left_out_and_those_beside_it_found(videos: Path) -> None:
    for name in ("artifacts/deliver/files", "locks", "tmp", "videos"):
        (videos / "deep" / name).mkdir(parents=True)
    (videos / "deep/artifacts/deliver/files/overlay.mp4").touch()
    assert _names(videos) == ["a.mp4", "b.MKV", "c.mov"]


def test_a_name_with_a_tilde_is_a_name_and_a_pattern_that_cannot_be_read_is_reported(videos: Path) -> None:
    manifest = videos / "batch.csv"
    manifest.write_text("video\n~nobody-here.mp4\n")
    assert [entry.video for entry in read_batch(manifest)] == [videos / "~nobody-here.mp4"]
    manifest.write_text("video\n**a.mp4\n")
    with pytest.raises(InputError, match=r"batch.csv, line 2: the pattern \*\*a.mp4 cannot be read: "):
        read_batch(manifest)
