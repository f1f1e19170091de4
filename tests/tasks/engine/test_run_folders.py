"""Which run folder a video gets."""

import json
import logging
from hashlib import sha256
from pathlib import Path

import pytest

from humanmm.errors import InputError
from humanmm.storage.run_folder.corrections_file import FILE as CORRECTIONS
from humanmm.storage.store.identity import identify
from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.run_folders import RunFolders, check_replaceable, content_of, run_dir_of


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store")


def _video(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()


def _run(folder: Path, text: str) -> Path:
    """The run folder of a video of this content."""
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"schema": "humanmm.run/1", "video": {"sha256": _digest(text)}}))
    return folder


def _one(out: Path, video: Path, store: Store) -> str:
    return RunFolders(out, store).of(video).name


def test_a_video_keeps_its_folder_when_it_moves_and_another_of_its_name_gets_its_own(
    tmp_path: Path, store: Store, caplog: pytest.LogCaptureFixture
) -> None:
    out, here = tmp_path / "runs", _video(tmp_path / "film.mp4", "one")
    assert _one(out, here, store) == "film"
    assert not (store.root / "videos").exists(), "it is not hashed where nothing has its name"
    _run(out / "film", "one")
    assert _one(out, here, store) == _one(out, _video(tmp_path / "moved/film.mp4", "one"), store) == "film"
    assert not caplog.records
    other = _video(tmp_path / "b/film.mp4", "two")
    digits = f"film-{_digest('two')[:8]}"
    assert _one(out, other, store) == digits
    assert "film holds the run of another video; that of " in caplog.text
    _run(out / digits, "two")
    (out / "film" / "run.json").unlink()
    caplog.clear()
    assert _one(out, other, store) == digits, "also when the first run is gone"
    assert not caplog.records


def test_a_run_that_cannot_be_read_is_nobodys(tmp_path: Path, store: Store) -> None:
    video = _video(tmp_path / "film.mp4", "one")
    (_run(tmp_path / "runs/film", "two") / "run.json").write_text("{")
    assert content_of(tmp_path / "runs/film") is None
    assert _one(tmp_path / "runs", video, store) == "film"


def test_copies_under_one_name_and_files_that_are_not_there_get_a_folder_each(tmp_path: Path, store: Store) -> None:
    folders = RunFolders(tmp_path, store)
    names = [folders.of(_video(tmp_path / place / "a.mp4", "one")).name for place in "xyz"]
    digits = _digest("one")[:8]
    assert names == ["a", f"a-{digits}", f"a-{digits}-2"]
    assert folders.of(tmp_path / "gone/a.mp4").name.startswith("a-")
    assert folders.take(tmp_path / "b") and not folders.take(tmp_path / "b")
    assert folders.of(tmp_path / "b.mp4").name.startswith("b-")


def test_without_a_wish_the_folder_is_in_runs(tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    video = identify(_video(tmp_path / "film.mp4", "one"), store)
    assert run_dir_of(video, None, store) == Path("runs/film")
    assert run_dir_of(video, Path("mine"), store) == Path("mine")


def test_a_run_of_another_video_is_replaced_with_a_warning_and_not_if_it_has_corrections(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING, "humanmm")
    folder = _run(tmp_path / "run", "one")
    check_replaceable(tmp_path / "none", _digest("two"))
    check_replaceable(folder, _digest("one"))
    assert not caplog.records
    check_replaceable(folder, _digest("two"))
    assert "holds the run of another video, which this run replaces" in caplog.text
    (folder / CORRECTIONS).touch()
    check_replaceable(folder, _digest("one"))
    with pytest.raises(InputError, match=r"with corrections; name another folder with --out, or move .* away"):
        check_replaceable(folder, _digest("two"))
