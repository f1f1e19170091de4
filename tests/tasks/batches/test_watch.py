"""Files that are still being written are left alone."""

import os
import time
from pathlib import Path

from humanmm.storage.batches.manifest import Entry, videos_in
from humanmm.tasks.batches.watch import Settled, is_quiet


def test_a_file_is_taken_when_it_has_not_changed_for_a_while(tmp_path: Path) -> None:
    film, other = tmp_path / "film.mp4", tmp_path / "other.mp4"
    settled = Settled(10)

    def look(now: float) -> list[str]:
        return [path.name for path in settled.look(videos_in(tmp_path), now)]

    assert look(0) == []
    film.write_text("a")
    assert (look(5), look(14.9)) == ([], [])
    film.write_text("ab")
    os.utime(film, ns=(1, 1))  # a copying program sets the time of the original: it says nothing
    assert (look(20), look(29.9)) == ([], [])
    other.write_text("c")
    assert look(30) == ["film.mp4"]
    assert look(40) == ["film.mp4", "other.mp4"]
    film.write_text("abc")
    assert look(41) == ["other.mp4"], "a file that changes is taken anew"
    film.unlink()
    assert (look(60), look(80)) == (["other.mp4"], ["other.mp4"])


def test_a_schedule_leaves_fresh_files_for_the_next_time(tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    film.write_text("a")
    assert not is_quiet(film, 30) and is_quiet(film, 0)
    an_hour_ago = time.time() - 3600
    os.utime(film, (an_hour_ago, an_hour_ago))
    assert is_quiet(film, 30)
    in_a_year = time.time() + 365 * 86400
    os.utime(film, (in_a_year, in_a_year))
    assert is_quiet(film, 30), "a camera's clock was wrong: it would wait for a year"
    assert is_quiet(tmp_path / "gone.mp4", 30), "its own run tells why"


def test_what_an_entry_names_itself_comes_before_the_batchs_defaults() -> None:
    own = Entry(Path("/a.mp4"), priority="high", tags=("gym",))
    assert own.with_defaults(priority="low", tags=["night", "gym"]).tags == ("gym", "night")
    assert own.with_defaults(priority="low", tags=[]).priority == "high"
    assert Entry(Path("/b.mp4")).with_defaults(priority="low", tags=[]).priority == "low"
