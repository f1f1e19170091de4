"""A video is known by its content, which is read once."""

import os
from pathlib import Path

import pytest

from humanmm.errors import VideoError
from humanmm.storage.store import identity as video_identity
from humanmm.storage.store.identity import identify
from humanmm.storage.store.store import Store


def test_the_content_is_read_once_and_again_when_the_file_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    video, store = tmp_path / "a.mp4", Store(tmp_path / "store")
    video.write_bytes(b"one")
    first = identify(video, store)
    with monkeypatch.context() as patched:
        patched.setattr(video_identity.hashlib, "file_digest", None)
        assert identify(video, store) == first
    video.write_bytes(b"two")
    os.utime(video, ns=(1, 1))
    assert identify(video, store).sha256 != first.sha256


def test_the_same_content_at_another_path_has_the_same_hash(tmp_path: Path) -> None:
    store = Store(tmp_path / "store")
    names = ["a.mp4", " two  spaces 'and' \"quotes\"\nnewline.mp4", "ünïcödé 映画.mp4", b"\xff\xfe.mp4"]
    hashes = set()
    for name in names:
        path = tmp_path / os.fsdecode(name)
        path.write_bytes(b"film")
        hashes.add(identify(path, store).sha256)
    assert len(hashes) == 1


def test_a_file_that_changes_during_the_run_is_not_read_as_if_it_had_not(tmp_path: Path) -> None:
    video = tmp_path / "a.mp4"
    video.write_bytes(b"one")
    identity = identify(video, Store(tmp_path / "store"))
    video.write_bytes(b"other")
    with pytest.raises(VideoError, match="changed while it was read"):
        identity.open()


def test_content_that_was_changed_behind_an_old_time_is_read_again(tmp_path: Path) -> None:
    video, store = tmp_path / "a.mp4", Store(tmp_path / "store")
    video.write_bytes(b"one")
    first, before = identify(video, store), video.stat()
    video.write_bytes(b"two")
    os.utime(video, ns=(before.st_atime_ns, before.st_mtime_ns))
    with pytest.raises(VideoError, match="changed while it was read"):
        first.open()
    assert identify(video, store).sha256 != first.sha256


def test_a_file_that_changes_while_it_is_hashed_gets_no_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    video, store = tmp_path / "a.mp4", Store(tmp_path / "store")
    video.write_bytes(b"one")
    digest = video_identity.hashlib.file_digest

    def grow(file: object, kind: str) -> object:
        with video.open("ab") as more:
            more.write(b"two")
        return digest(file, kind)  # type: ignore[arg-type]

    monkeypatch.setattr(video_identity.hashlib, "file_digest", grow)
    with pytest.raises(VideoError, match="changed while it was read"):
        identify(video, store)
    assert video_identity.known_content(video, store) == {}


def test_a_read_only_store_is_not_written(tmp_path: Path) -> None:
    video = tmp_path / "a.mp4"
    video.write_bytes(b"one")
    identify(video, Store(tmp_path / "store", read_only=True))
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: None, "no such video"),
        (lambda path: path.mkdir(), "is a folder"),
        (lambda path: path.touch(), "is empty"),
        (lambda path: os.mkfifo(path), "not a regular file"),
    ],
)
def test_what_is_no_video_file_is_reported_in_one_sentence(tmp_path: Path, make: object, message: str) -> None:
    path = tmp_path / "x.mp4"
    make(path)  # type: ignore[operator]
    with pytest.raises(VideoError, match=message):
        identify(path, Store(tmp_path / "store"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "x.mp4"
    path.write_bytes(b"x")
    path.chmod(0)
    with pytest.raises(VideoError, match="Permission denied"):
        identify(path, Store(tmp_path / "store"))


def test_a_video_may_be_named_with_a_tilde(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("~film.mp4").write_bytes(b"film")
    assert identify(Path("~film.mp4"), Store(tmp_path / "store")).path == tmp_path / "~film.mp4"
