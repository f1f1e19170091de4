"""The stores that `humanmm serve` looks after."""

from pathlib import Path

from humanmm.flows.server.known_stores import known_stores, note_store
from humanmm.flows.server.local_server import ServerFiles


def test_stores_are_noted_once_and_forgotten_when_they_are_gone(tmp_path: Path) -> None:
    files = ServerFiles(tmp_path)
    for name in ("a", "b", "a"):
        (tmp_path / name).mkdir(exist_ok=True)
        note_store(files, str(tmp_path / name))
    note_store(files, "s3://far/away")
    (tmp_path / "b").rmdir()
    assert known_stores(files) == [str(tmp_path / "a"), "s3://far/away"]
    assert files.stores.read_text().count("\n") == 3
