"""What of a batch is scheduled, what is finished already, and where each video's run folder goes."""

import hashlib
import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from humanmm.config import Config
from humanmm.errors import ConfigError, InputError, StoreError
from humanmm.storage.batches.batch_table import BatchTable, open_batches
from humanmm.storage.batches.manifest import read_batch
from humanmm.storage.batches.owner import Owner
from humanmm.storage.batches.video_row import VideoRow, counts
from humanmm.storage.pages.batch_report import write_report
from humanmm.tasks.batches import batch as batches
from humanmm.tasks.engine import finish


@pytest.fixture
def toy(any_toy: Any) -> Any:
    """Everything here is so on a store of each kind."""
    return any_toy


@pytest.fixture
def table(toy: Any) -> BatchTable:
    return open_batches(toy.store)


def _submit(toy: Any, table: BatchTable, source: Path, **settings: Any) -> batches.Submission:
    config = Config.model_validate(settings)
    return batches.submit(table, "test", read_batch(source), config, toy.folder / "runs")


def _films(toy: Any, *names: str) -> Path:
    for number, name in enumerate(names):
        path = Path(toy.folder / "films" / name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"num_frames": 60 + number, "cuts": [20, 40]}))
    return Path(toy.folder / "films")


def _end(table: BatchTable, row: VideoRow, state: str, reason: str = "", stage: str | None = None) -> None:
    if state in ("done", "partial"):
        Path(row.run_dir).mkdir(parents=True)
        Path(row.run_dir, "run.json").write_text("{}")
    assert table.change(row, state=state, reason=reason, stage=stage, seconds=2.0)


def test_the_same_batch_twice_schedules_nothing_new(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4", "b.mp4", "c.mp4")
    first = _submit(toy, table, films)
    assert [(Path(row.video).name, row.attempt) for row in first.to_schedule] == [
        ("a.mp4", 1), ("b.mp4", 1), ("c.mp4", 1),
    ]  # fmt: skip
    _end(table, first.to_schedule[0], "done")
    _end(table, first.to_schedule[1], "failed", "no people")
    again = _submit(toy, table, films)
    assert [(Path(row.video).name, row.attempt) for row in again.to_schedule] == [("c.mp4", 1)]
    assert (again.finished, again.failed) == (1, 1)


def test_a_dry_run_says_what_a_submission_does_and_writes_nothing(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4", "b.mp4", "c.mp4")

    def there() -> list[Path]:
        own = ("cache", "data")  # of a store in a bucket: copies of what was read
        return sorted(path for path in toy.folder.rglob("*") if path.relative_to(toy.folder).parts[0] not in own)

    def message() -> dict[str, str]:
        before = there()
        reading = open_batches(toy.store, read_only=True)
        plan = batches.forecast_submission(reading, "test", read_batch(films), Config(), toy.folder / "runs")
        assert there() == before
        return {Path(one.row.video).name: one.sentence for one in plan}

    assert message() == dict.fromkeys(("a.mp4", "b.mp4", "c.mp4"), "to do: it is new")
    first = _submit(toy, table, films)
    _end(table, first.to_schedule[0], "done")
    _end(table, first.to_schedule[1], "failed", "no people")
    assert message() == {"a.mp4": "finished", "b.mp4": "failed before: no people", "c.mp4": "to do"}
    (films / "a.mp4").write_text(json.dumps({"num_frames": 50, "cuts": [20]}))
    assert message()["a.mp4"] == "to do: the file has changed"
    assert [Path(row.video).name for row in _submit(toy, table, films).to_schedule] == ["a.mp4", "c.mp4"]


def test_a_new_video_a_changed_one_and_changed_settings_are_scheduled(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4", "b.mp4")
    for row in _submit(toy, table, films).to_schedule:
        _end(table, row, "done")
    (films / "new.mp4").write_text("{}")
    (films / "b.mp4").write_text('{"num_frames": 70, "cuts": []}')
    asked = _submit(toy, table, films).to_schedule
    assert [(Path(row.video).name, row.attempt) for row in asked] == [("b.mp4", 2), ("new.mp4", 1)]
    assert len(_submit(toy, table, films, camera={"static": True}).to_schedule) == 3
    for row in table.rows("test"):
        Path(row.run_dir).mkdir(exist_ok=True)
        Path(row.run_dir, "run.json").touch()
        table.change(row, state="done")
    assert _submit(toy, table, films, camera={"static": True}, run={"threads": 1}).finished == 3, "same result"


def test_a_video_whose_run_folder_another_batch_rewrote_is_not_finished(toy: Any, table: BatchTable) -> None:
    films, out = _films(toy, "a.mp4"), toy.folder / "runs"
    (row,) = _submit(toy, table, films).to_schedule
    _end(table, row, "done")
    static = Config.model_validate({"camera": {"static": True}})
    second = batches.submit(table, "second", read_batch(films), static, out)
    assert "1 write over run folders of batch test, with another result" in second.sentence
    assert _submit(toy, table, films).finished == 1, "nothing was written yet"
    table.change(second.to_schedule[0], state="done")
    (noted,) = batches.with_notes(table, table.rows("test"))
    assert (noted.state, noted.reason) == ("done", "its run folder was rewritten by batch second")
    (plan,) = batches.forecast_submission(table, "test", read_batch(films), Config(), out)
    assert plan.sentence == "to do: its run folder was rewritten by batch second"
    (again,) = _submit(toy, table, films).to_schedule
    table.change(again, state="done")
    assert _submit(toy, table, films).finished == 1
    (plan,) = batches.forecast_submission(table, "second", read_batch(films), static, out)
    assert plan.sentence == "to do: its run folder was rewritten by batch test"


def test_corrections_in_a_run_folder_make_its_video_be_computed_once_more(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4", "b.mp4")
    for row in _submit(toy, table, films).to_schedule:
        _end(table, row, "done")
    path = toy.folder / "runs" / "b" / "corrections.toml"
    path.write_text('[[correction]]\nkind = "floor"\nmetres = 0.5\n')
    (again,) = _submit(toy, table, films).to_schedule
    assert Path(again.video).name == "b.mp4"
    table.change(again, state="done")
    assert not _submit(toy, table, films).to_schedule
    path.write_text("[[correction]]\n")  # a mistake: told when the video is computed
    assert len(_submit(toy, table, films).to_schedule) == 1


def test_a_video_that_recover_finished_elsewhere_gets_its_folder_by_a_run_that_computes_nothing(
    toy: Any, table: BatchTable
) -> None:
    films = _films(toy, "film.mp4")
    assert toy.main("recover", "films/film.mp4", "--out", "elsewhere")[0] == 0
    assert toy.executed()
    (row,) = _submit(toy, table, films).to_schedule
    assert toy.main("recover", row.video, "--out", row.run_dir)[0] == 0
    assert not toy.executed()


def test_a_run_folder_that_recover_wrote_with_other_settings_is_not_finished(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4")
    (row,) = _submit(toy, table, films).to_schedule
    assert toy.main("recover", row.video, "--out", row.run_dir)[0] == 0
    table.change(row, state="done")
    assert _submit(toy, table, films).finished == 1
    assert toy.main("recover", row.video, "--out", row.run_dir, "--camera.static", "true")[0] == 0
    (noted,) = batches.with_notes(table, table.rows("test"))
    (plan,) = batches.forecast_submission(table, "test", read_batch(films), Config(), toy.folder / "runs")
    (again,) = _submit(toy, table, films).to_schedule
    assert (noted.state, noted.reason) == ("done", "its run folder was written again since")
    assert plan.sentence == "to do: its run folder was written again since"
    assert toy.main("recover", row.video, "--out", row.run_dir)[0] == 0
    table.change(again, state="done")
    assert _submit(toy, table, films).finished == 1


def test_what_recover_wrote_once_more_with_the_same_settings_is_finished(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4")
    (row,) = _submit(toy, table, films).to_schedule
    assert toy.main("recover", row.video, "--out", row.run_dir)[0] == 0
    table.change(row, state="done")
    assert toy.main("recover", row.video, "--out", row.run_dir, "--force")[0] == 0
    assert _submit(toy, table, films).finished == 1
    assert [one.reason for one in batches.with_notes(table, table.rows("test"))] == [""]


def test_a_file_changed_under_its_old_size_and_time_is_another_video_and_one_with_a_new_mode_is_not(
    toy: Any, table: BatchTable
) -> None:
    films = _films(toy, "a.mp4")
    (row,) = _submit(toy, table, films).to_schedule
    assert toy.main("recover", row.video, "--out", row.run_dir)[0] == 0
    table.change(row, state="done")
    video = films / "a.mp4"
    video.chmod(0o600)
    assert _submit(toy, table, films).finished == 1
    before = video.stat()
    with video.open("r+") as file:
        file.write(video.read_text().replace("40", "41"))
    os.utime(video, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert (video.stat().st_size, video.stat().st_ino) == (before.st_size, before.st_ino)
    (plan,) = batches.forecast_submission(table, "test", read_batch(films), Config(), toy.folder / "runs")
    assert plan.state == "to do"
    assert len(_submit(toy, table, films).to_schedule) == 1


def test_what_recover_finished_as_the_batch_wants_it_is_known_by_one_record(
    toy: Any, table: BatchTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    toy.run()
    films = toy.folder / "films"
    films.mkdir()
    toy.video.rename(films / "film.mp4")
    assert toy.main("recover", str(films / "film.mp4"))[0] == 0
    looked_up: list[str] = []
    forecast = batches.forecast
    monkeypatch.setattr(batches, "forecast", lambda run: looked_up.append("all stages") or forecast(run))
    other = _submit(toy, table, films, camera={"static": True})
    assert len(other.to_schedule) == 1 and looked_up == ["all stages"], "with other settings it is not what is there"
    submission = _submit(toy, table, films)
    assert (submission.to_schedule, submission.finished, len(looked_up)) == ((), 1, 1)


def test_a_finished_video_whose_folder_is_gone_is_looked_up_in_the_store_again(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4")
    (row,) = _submit(toy, table, films).to_schedule
    _end(table, row, "done")
    Path(row.run_dir, "run.json").unlink()
    (again,) = _submit(toy, table, films).to_schedule
    assert again.attempt == 2


def test_videos_of_one_name_get_folders_by_their_content(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "x/take.mp4", "y/take.mp4", "y/take.mov")
    rows = {Path(row.video): Path(row.run_dir).name for row in _submit(toy, table, films).to_schedule}
    digest = {path: hashlib.sha256(path.read_bytes()).hexdigest()[:8] for path in rows}
    assert sorted(rows.values()) == sorted(
        ["take", f"take-{digest[films / 'y/take.mov']}", f"take-{digest[films / 'y/take.mp4']}"]
    )
    again = {Path(row.video): Path(row.run_dir).name for row in _submit(toy, table, films).to_schedule}
    assert again == rows


def test_copies_of_one_video_under_one_name_still_get_a_folder_each(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "x/take.mp4", "y/take.mp4", "z/take.mp4")
    for folder in ("y", "z"):
        (films / folder / "take.mp4").write_bytes((films / "x/take.mp4").read_bytes())
    assert len({row.run_dir for row in _submit(toy, table, films).to_schedule}) == 3


def test_settings_of_one_video_reach_it_alone_and_a_bad_one_is_reported(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4", "b.mp4")
    (films / "m.csv").write_text("video,camera.static,shots.person\na.mp4,true,\nb.mp4,,1\n")
    first, second = _submit(toy, table, films / "m.csv", shots={"person": 0}).to_schedule
    assert json.loads(first.config)["camera"]["static"] is True and json.loads(first.config)["shots"]["person"] == 0
    assert json.loads(second.config)["camera"]["static"] is False and json.loads(second.config)["shots"]["person"] == 1
    (films / "m.csv").write_text("video,camera.statik\na.mp4,true\n")
    with pytest.raises(ConfigError, match=r"line 2: unknown setting camera.statik; did you mean static\?"):
        _submit(toy, table, films / "m.csv")
    (films / "m.csv").write_text("video,out\na.mp4,same\nb.mp4,same\n")
    with pytest.raises(InputError, match="is another video's"):
        batches.submit(table, "other", read_batch(films / "m.csv"), Config(), toy.folder / "runs")


def test_only_what_failed_in_a_stage_is_tried_again(toy: Any, table: BatchTable) -> None:
    a, b, c, d = _submit(toy, table, _films(toy, "a.mp4", "b.mp4", "c.mp4", "d.mp4")).to_schedule
    _end(table, a, "partial", "no points", "camera · shot 1")
    _end(table, b, "failed", "no people", "people · scene 0")
    _end(table, c, "done")
    assert [row.video for row in batches.retry(table, "test", stage="camera")] == [a.video]
    assert [(row.video, row.attempt) for row in batches.retry(table, "test")] == [(b.video, 2)]
    assert counts(table.rows("test")) == {"scheduled": 3, "done": 1}
    assert not table.change(a, state="done"), "its first attempt has nothing to say any more"
    assert table.row("test", d.video) == table.rows("test")[3]


def test_a_video_that_failed_is_run_again_with_the_limits_that_are_given_now(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4", "b.mp4")
    first = _submit(toy, table, films, run={"limit_s": 0.2}).to_schedule
    _end(table, first[0], "failed", "camera took longer than its limit of 0.2 s", "camera · shot 0")
    _end(table, first[1], "done")
    assert not _submit(toy, table, films, run={"limit_s": 0.2}).to_schedule
    plan = batches.forecast_submission(table, "test", read_batch(films), Config(), toy.folder / "runs")
    assert [one.sentence for one in plan] == ["to do: failed before, with other settings of `run`", "finished"]
    (again,) = _submit(toy, table, films).to_schedule
    assert (again.video, again.attempt) == (first[0].video, 2) and json.loads(again.config)["run"]["limit_s"] is None
    _end(table, again, "failed", "it is dark", "camera · shot 0")
    (again,) = batches.retry(table, "test", values={"run.limit_s": 60})
    assert (again.attempt, json.loads(again.config)["run"]["limit_s"]) == (3, 60)


def test_a_dry_run_says_that_an_empty_file_will_fail(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4")
    (films / "empty.mp4").touch()
    plan = batches.forecast_submission(table, "test", read_batch(films), Config(), toy.folder / "runs")
    assert [one.sentence for one in plan] == ["to do: it is new", "to do: it is empty: it will fail"]


def test_a_dry_run_says_which_setting_has_changed(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "film.mp4")
    (row,) = _submit(toy, table, films).to_schedule
    assert toy.main("recover", row.video, "--out", row.run_dir)[0] == 0
    table.change(row, state="done")
    config = Config.model_validate({"camera": {"static": True}})
    (plan,) = batches.forecast_submission(table, "test", read_batch(films), config, toy.folder / "runs")
    assert plan.sentence == "to do: camera: setting changed: camera.static False → True"


def test_a_video_that_another_machine_has_finished_is_finished_here(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4")
    (row,) = _submit(toy, table, films).to_schedule
    table.change(row, state="done", host="another")
    assert _submit(toy, table, films).finished == 1, "its run folder is there, where nobody can look"
    again = batches.submit(table, "other", read_batch(films), Config(), toy.folder / "runs")
    assert again.finished == 1
    page, _ = write_report(toy.folder / "report", "test", table.rows("test"))
    assert "its run folder is on another" in page.read_text()


def test_of_two_who_submit_at_once_the_first_counts_and_the_second_is_reported(
    toy: Any, table: BatchTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    films = _films(toy, "a.mp4", "b.mp4")
    put = table.put

    def late(rows: Any) -> Any:
        monkeypatch.setattr(table, "put", put)
        (first, _) = _submit(toy, table, films).to_schedule
        assert table.change(first, state="running")
        return put(rows)

    monkeypatch.setattr(table, "put", late)
    assert [Path(row.video).name for row in _submit(toy, table, films).to_schedule] == ["b.mp4"]
    assert counts(table.rows("test")) == {"running": 1, "scheduled": 1}

    def other(rows: Any) -> Any:
        monkeypatch.setattr(table, "put", put)
        (films / "c.mp4").touch()
        _submit(toy, table, films, camera={"static": True})
        return put(rows)

    table.change(table.rows("test")[0], state="done")
    monkeypatch.setattr(table, "put", other)
    with pytest.raises(InputError, match="was submitted with other settings by somebody else just now"):
        _submit(toy, table, films)


def test_a_section_of_settings_that_is_none_is_refused_with_its_line(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a.mp4")
    (films / "m.jsonl").write_text('{"video": "a.mp4", "settings": {"camera": true}}\n')
    with pytest.raises(ConfigError, match=r"m\.jsonl, line 1: setting camera: "):
        _submit(toy, table, films / "m.jsonl")


def test_a_video_that_changes_while_it_runs_is_left_alone_and_the_others_are_submitted(
    toy: Any, table: BatchTable
) -> None:
    films = _films(toy, "a.mp4")
    (row,) = _submit(toy, table, films).to_schedule
    assert table.change(row, state="running", owner=str(Owner.this_process()))
    (films / "a.mp4").write_text(json.dumps({"num_frames": 90, "cuts": [20]}))
    films = _films(toy, "b.mp4")
    (plan, _) = batches.forecast_submission(table, "test", read_batch(films), Config(), toy.folder / "runs")
    assert plan.state == "running" and "the file has changed" in plan.reason
    submission = _submit(toy, table, films)
    assert [Path(one.video).name for one in submission.to_schedule] == ["b.mp4"]
    assert submission.outdated == (row.video,) and "1 running as asked for before" in submission.sentence
    assert table.row("test", row.video) is not None and counts(table.rows("test")) == {"running": 1, "scheduled": 1}
    table.change(row, state="done")
    assert _submit(toy, table, films).outdated == ()
    assert table.rows("test")[0].attempt == 2


def test_a_video_that_is_lost_again_and_again_fails(toy: Any, table: BatchTable) -> None:
    _submit(toy, table, _films(toy, "a.mp4"))
    for attempt in (1, 2, 3):
        (row,) = table.rows("test")
        assert (row.state, row.attempt) == ("scheduled", attempt)
        table.change(row, state="running", stage="align")
        table.find_lost("test")
    (row,) = table.rows("test")
    assert (row.state, row.attempt) == ("failed", 3) and "lost during align" in row.reason
    assert table.unscheduled() == []
    (again,) = batches.retry(table, "test")
    assert (again.attempt, again.losses) == (4, 0)


def test_what_comes_of_a_fault_of_the_machine_is_reported_as_that_fault(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOY_FAIL", "people:0=disk:9;shots=input")
    message = finish.fatal_error(toy.run(expect_failure=True))
    assert isinstance(message, StoreError) and "people · scene 0" in str(message)
    monkeypatch.setenv("TOY_FAIL", "people:0=stage;shots=input")
    message = finish.fatal_error(toy.run(expect_failure=True))
    assert isinstance(message, InputError) and "shots does not like its input" in str(message)


def test_two_thousand_finished_videos_are_known_within_four_seconds(toy: Any, table: BatchTable) -> None:
    films = toy.folder / "films"
    films.mkdir()
    for number in range(2_000):
        (films / f"{number:05d}.mp4").write_text("x")
    rows = _submit(toy, table, films).to_schedule
    for row in rows:
        Path(row.run_dir).mkdir(parents=True)
        Path(row.run_dir, "run.json").touch()
    table.put([replace(row, attempt=2, state="done") for row in rows])
    began = time.process_time()
    assert _submit(toy, table, films).finished == 2_000
    assert time.process_time() - began < 4  # 10,000 within 20 s
    renamed = batches.submit(table, "other", read_batch(films), Config(), toy.folder / "runs")
    assert (renamed.finished, renamed.to_schedule) == (2_000, ())


def test_the_report_has_a_row_a_video_with_links_and_survives_strange_names(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "a <b>.mp4", "c.mp4")
    toy.run()
    rows = _submit(toy, table, films).to_schedule
    assert toy.main("recover", "film.mp4", "--out", rows[0].run_dir)[0] == 0
    table.change(rows[0], state="done", seconds=1.25)
    table.change(rows[1], state="failed", reason="it has <no> people", stage="people · scene 0")
    page, table = write_report(toy.folder / "report", "test", table.rows("test"))
    text = page.read_text()
    assert "a &lt;b&gt;.mp4" in text and "it has &lt;no&gt; people" in text
    assert 'href="../runs/a__b_/view/overlay.mp4"' in text
    first, second = table.read_text().splitlines()[1:]
    assert ",done," in first and ",60,3,1,1.25," in first
    assert second.split(",")[1:4] == ["failed", "people · scene 0", "it has <no> people"]


def test_a_batch_leaves_the_run_folder_of_another_video_of_that_name_alone(toy: Any, table: BatchTable) -> None:
    films = _films(toy, "x/take.mp4", "y/take.mp4")
    (first,) = batches.submit(table, "x", read_batch(films / "x"), Config(), toy.folder / "runs").to_schedule
    _end(table, first, "done")
    content = hashlib.sha256((films / "x/take.mp4").read_bytes()).hexdigest()
    record = {"schema": "humanmm.run/1", "video": {"sha256": content}}
    Path(first.run_dir, "run.json").write_text(json.dumps(record))
    (second,) = batches.submit(table, "y", read_batch(films / "y"), Config(), toy.folder / "runs").to_schedule
    digits = hashlib.sha256((films / "y/take.mp4").read_bytes()).hexdigest()[:8]
    assert Path(second.run_dir).name == f"take-{digits}"


def test_a_name_that_is_no_text_is_left_out_with_one_warning_and_the_others_are_scheduled(
    toy: Any, table: BatchTable, caplog: pytest.LogCaptureFixture
) -> None:
    films = _films(toy, "a.mp4", "z.mp4", os.fsdecode(b"caf\xe9.mp4"))
    for _ in range(2):
        assert [Path(row.video).name for row in _submit(toy, table, films).to_schedule] == ["a.mp4", "z.mp4"]
    assert [record.getMessage() for record in caplog.records if "no text" in record.getMessage()] == [
        f"the name '{films}/caf\\udce9.mp4' is no text: the video is left out; rename the file to use it in a batch"
    ]
