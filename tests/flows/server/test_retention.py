"""What the local server keeps of runs that have ended, and for how long."""

import json
from typing import Any

import pytest

pytestmark = [pytest.mark.server, pytest.mark.timeout(2400)]


def test_what_ended_more_than_thirty_days_ago_is_forgotten_with_all_that_belongs_to_it(
    toy: Any, place: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PREFECT_SERVER_SERVICES_DB_VACUUM_LOOP_SECONDS", "3")
    for number, days in enumerate((31, 29)):
        (toy.folder / f"{days}.mp4").write_text(json.dumps({"num_frames": 60 + number, "cuts": [20, 40]}))
        done = toy.command("recover", f"{days}.mp4")
        assert done.returncode == 0, done.stderr
    place.until(lambda: place.ask("select count(*) from task_run where state_type = 'COMPLETED'") == [(36,)], 60)
    runs = dict(place.ask("select name, id from flow_run"))
    belong = ("task_run", "flow_run_state", "artifact", "log")
    before = {table: _of(place, table, runs["31.mp4"]) for table in belong}
    assert all(before.values()), before
    for days in (31, 29):
        place.change(f"update flow_run set end_time = datetime(end_time, '-{days} days') where name = '{days}.mp4'")
    place.until(lambda: place.flow_runs() == [("29.mp4", "COMPLETED")], 60)
    place.until(lambda: not any(_of(place, table, runs["31.mp4"]) for table in belong), 60)
    assert all(_of(place, table, runs["29.mp4"]) for table in belong)
    assert place.ask("select count(*) from events") == [(0,)], "the largest table of all is not written"


def _of(place: Any, table: str, flow_run: str) -> int:
    return int(place.ask(f"select count(*) from {table} where flow_run_id = ?", flow_run)[0][0])
