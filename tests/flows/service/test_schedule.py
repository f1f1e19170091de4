"""Batches that go on: at the times of a cron line, and whenever a video comes into a folder."""

import json
import signal
import subprocess
import time
from collections.abc import Callable
from typing import Any

import pytest

pytestmark = [pytest.mark.server, pytest.mark.timeout(2400)]

States = Callable[[], dict[str, dict[str, Any]]]


def test_a_schedule_fires_and_survives_a_restart_and_ends_by_signal(farm: Any, place: Any, states: States) -> None:
    (farm.folder / "films/empty.mp4").unlink()
    wrong = farm.command("batch", "submit", "films", "--schedule", "at night")
    assert wrong.returncode == 1 and "is no cron line such as '0 2 * * *'" in wrong.stderr, wrong.stderr
    done = farm.command(
        "batch", "submit", "films", "--name", "nightly", "--schedule", "* * * * *", "--settle", "0", "--tag", "gym"
    )
    assert (done.returncode, done.stdout) == (0, "nightly\n") and "next at" in done.stderr, done.stderr
    timed = farm.command("batch", "status", "nightly")
    assert "schedule of batch nightly: '* * * * *' (" in timed.stdout and "), next at 2" in timed.stdout, timed.stdout
    place.end("humanmm.flows.service.serve", signal.SIGTERM)
    serving = subprocess.Popen(
        farm.command_line("serve", "--limit", "1"), env=farm.environment(), cwd=farm.folder, stdout=subprocess.DEVNULL
    )
    place.until(lambda: farm.main("batch", "status")[0] == 0, 200)
    place.until(lambda: [video["state"] for video in states().values()] == ["done"] * 3, 200)
    tags = [set(json.loads(tags)) for (tags,) in place.ask("select tags from flow_run where name = '0.mp4'")]
    assert len(tags) == 1 and {"batch:nightly", "gym"} <= tags[0]
    fired = (
        "select count(*) from flow_run join flow on flow.id = flow_run.flow_id "
        "where flow.name = 'recover-batch' and flow_run.state_type = 'COMPLETED'"
    )
    place.until(lambda: place.ask(fired)[0][0] >= 2, 150)
    begun = (
        "select distinct flow_run.name, work_queue_name from flow_run join flow on flow.id = flow_run.flow_id "
        "where flow.name = 'recover-batch' and flow_run.state_type = 'COMPLETED'"
    )
    assert place.ask(begun) == [("nightly", "submit")]
    assert len([name for name, _ in place.flow_runs() if name.endswith(".mp4")]) == 3, "nothing is scheduled twice"
    ended = farm.command("batch", "submit", "films", "--name", "nightly", "--schedule", "none")
    assert "not on a schedule any more" in ended.stderr
    assert place.ask("select count(*) from deployment_schedule where slug = 'nightly'") == [(0,)]
    serving.send_signal(signal.SIGTERM)
    assert serving.wait(timeout=60) == 0


def test_a_watched_folder_takes_videos_when_they_have_stopped_growing(farm: Any, place: Any, states: States) -> None:
    inbox = farm.folder / "inbox"
    inbox.mkdir()
    command = farm.command_line("batch", "submit", "inbox", "--watch", "--settle", "6", "--name", "inbox")
    with (farm.folder / "watch.log").open("w") as log:
        watching = subprocess.Popen(command, env=farm.environment(), cwd=farm.folder, stderr=log)
    whole = json.dumps({"num_frames": 60, "cuts": [20, 40]})
    for size in range(1, len(whole) + 1, 6):
        (inbox / "film.mp4").write_text(whole[:size])
        time.sleep(1.5)
    (inbox / "film.mp4").write_text(whole)
    place.until(lambda: farm.main("batch", "status")[0] == 0, 120)
    place.until(lambda: states()["film"]["state"] == "done", 200)
    (inbox / "second.mp4").write_text(whole.replace("60", "61"))
    place.until(lambda: states().get("second", {}).get("state") == "done", 120)
    watching.send_signal(signal.SIGTERM)
    assert watching.wait(timeout=30) == 0, (farm.folder / "watch.log").read_text()
    assert farm.executed().count("decode") == 2, "no half file was ever looked at"
