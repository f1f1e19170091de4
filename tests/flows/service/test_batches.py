"""Batches through a server, a worker and processes of their own: with toy stages, and once with everything real."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import pytest

from humanmm.storage.batches.batch_table import open_batches

ROOT = Path(__file__).resolve().parents[3]
CLIP = ROOT / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"

pytestmark = [pytest.mark.server, pytest.mark.timeout(2400)]

States = Callable[[], dict[str, dict[str, Any]]]
AT_WORK = {"RUNNING", "PENDING", "SCHEDULED", "CANCELLING"}
PRESS_RETRY = """
from prefect.states import AwaitingRetry
(run,) = [run.id for run in await client.read_flow_runs() if run.name == sys.argv[1]]
await client.set_flow_run_state(run, AwaitingRetry(), force=True)
while True:
    found = await client.read_flow_run(run)
    if found.run_count > 1 and found.state.is_final():
        break
    await asyncio.sleep(0.5)
print(found.run_count, found.state.name)
"""


def _batch(farm: Any) -> str:
    return open_batches(farm.store).newest()


def _named(states: dict[str, dict[str, Any]]) -> dict[str, str]:
    return {name: video["state"] for name, video in states.items()}


def test_a_batch_runs_to_its_end_and_a_second_time_nothing_is_scheduled(farm: Any, place: Any, states: States) -> None:
    done = farm.command(
        "batch", "submit", "films", "--wait", "--name", "toys", "--tag", "gym", TOY_FAIL="camera:40=stage"
    )
    assert (done.returncode, done.stdout) == (3, "toys\n"), done.stderr
    tree = json.loads(farm.main("batch", "status", "--json")[1])
    assert (tree["batch"], tree["counts"]) == ("toys", {"partial": 3, "failed": 1})
    first = tree["videos"][0]
    assert set(first) == {"video", "state", "stage", "reason", "run_dir", "seconds"}
    assert (first["stage"], first["reason"]) == ("camera · shot 2", "camera · shot 2: camera:40 cannot be done")
    assert "is empty (0 bytes)" in tree["videos"][3]["reason"] and first["seconds"] > 0
    assert json.loads((farm.folder / "runs/0/run.json").read_text())["state"] == "partial"
    assert (farm.folder / "runs/0/run.log").exists() and not (farm.folder / "runs/empty").exists()

    runs = place.flow_runs()
    assert [state for _, state in runs] == ["FAILED"] * 4
    again = farm.command("batch", "submit", "films", "--wait", "--name", "toys")
    assert again.returncode == 3 and "0 to do" in again.stderr
    assert place.flow_runs() == runs

    farm.executed()
    assert place.client(PRESS_RETRY, "1.mp4") == "2 Partial"
    assert farm.executed() == ["camera:40"], "the dashboard's Retry runs what failed, and nothing else"

    # `humanmm serve` still has the environment in which camera fails: have a new one
    place.end("humanmm.flows.service.serve", signal.SIGTERM)
    assert place.pids("humanmm.flows.") == [], "it takes its server and worker along"
    healed = farm.command("batch", "retry-failed", "--stage", "camera", "--wait")
    assert healed.returncode == 3, "one is empty still"
    assert _named(states()) == {"0": "done", "1": "done", "2": "done", "empty": "failed"}
    executed = farm.executed()
    assert executed.count("camera:40") == 3 and "people:0" not in executed and "camera:0" not in executed


def test_the_dashboards_retry_runs_what_failed_and_what_depends_on_it(farm: Any, place: Any, states: States) -> None:
    for film in ("0", "2", "empty"):
        (farm.folder / f"films/{film}.mp4").unlink()
    done = farm.command("batch", "submit", "films", "--wait", TOY_FAIL="camera:40=stage:1")
    assert done.returncode == 3, done.stderr
    assert _named(states()) == {"1": "partial"}
    assert farm.log.read_text().split().count("camera:40") == 1
    before = farm.log.read_text().split()
    assert place.client(PRESS_RETRY, "1.mp4") == "2 Completed"
    assert _named(states()) == {"1": "done"}
    again = farm.log.read_text().split()[len(before) :]
    assert sorted(again) == ["align", "camera:40", "deliver", "hmr:40", "refine"]


def test_what_a_killed_serve_leaves_behind_is_crashed_and_resumed_by_the_next(
    farm: Any, place: Any, states: States
) -> None:
    done = farm.command("batch", "submit", "films", "--limit", "2", TOY_SLEEP="align=60")
    assert done.returncode == 0, done.stderr
    place.until(lambda: [video["stage"] for video in states().values()].count("align") == 2, 150)
    place.end("humanmm.flows.")
    killed = time.monotonic()

    def lost() -> list[str]:
        found = states().values()
        return [video["state"] for video in found if "its process was lost during align" in video["reason"]]

    place.until(lambda: lost() == ["scheduled"] * 2, 50)
    assert time.monotonic() - killed < 120, "lost workers are noticed within two minutes"
    farm.executed()

    done = farm.command("batch", "submit", "films", "--wait", "--limit", "2")
    assert done.returncode == 3, "one is empty"
    assert _named(states()) == {"0": "done", "1": "done", "2": "done", "empty": "failed"}, done.stderr
    assert farm.executed().count("people:0") <= 1, "what the store has is not computed again"
    place.until(lambda: not AT_WORK & {state for _, state in place.flow_runs()}, 60)
    assert [state for _, state in place.flow_runs()].count("CRASHED") == 2


def test_a_video_whose_process_is_killed_is_tried_again_by_itself(farm: Any, place: Any, states: States) -> None:
    done = farm.command("batch", "submit", "films", "--limit", "1", TOY_SLEEP="align=8")
    assert done.returncode == 0, done.stderr
    place.until(lambda: "align" in {video["stage"] for video in states().values()}, 120)
    (row,) = open_batches(farm.store).rows(_batch(farm), "running")
    os.kill(row.pid or 0, signal.SIGKILL)
    # `batch status` is not asked here: it would itself notice the loss
    place.until(lambda: len(place.flow_runs()) == 5, 120)
    place.until(lambda: not AT_WORK & {state for _, state in place.flow_runs()}, 300)
    assert [state for _, state in place.flow_runs()].count("CRASHED") == 1
    assert _named(states()) == {"0": "done", "1": "done", "2": "done", "empty": "failed"}
    executed = farm.executed()
    assert executed.count("align") == 4 and executed.count("decode") == 4 - 1, "only what was lost ran twice"


def test_a_batch_survives_a_restart_and_the_death_of_the_server_and_can_be_cancelled(
    farm: Any, place: Any, states: States
) -> None:
    done = farm.command("batch", "submit", "films", "--limit", "1", TOY_SLEEP="align=25")
    assert done.returncode == 0, done.stderr
    place.until(lambda: "align" in {video["stage"] for video in states().values()}, 120)
    place.end("humanmm.flows.service.serve", signal.SIGTERM)
    stopped = states()
    assert "resumes when `humanmm serve` runs" in " ".join(video["reason"] for video in stopped.values()), stopped
    serving = subprocess.Popen(
        farm.command_line("serve", "--limit", "1"), env=farm.environment(TOY_SLEEP="align=25"),
        stdout=subprocess.DEVNULL,  # else what it prints is taken for an answer of `batch status`
    )  # fmt: skip
    place.until(lambda: "align" in {video["stage"] for video in states().values()}, 120)
    before = next(place.folder.glob("prefect-*/port")).read_text()
    place.end("humanmm.flows.server.server_process")
    place.until(lambda: "done" in _named(states()).values(), 120)
    assert next(place.folder.glob("prefect-*/port")).read_text() == before
    place.until(lambda: "running" in _named(states()).values(), 90)
    assert farm.command("batch", "cancel").returncode == 0
    found = list(_named(states()).values())
    assert found.count("cancelled") >= 1 and not {"running", "scheduled"} & set(found)
    place.until(lambda: not place.pids("humanmm-video"), 60)  # one may just have begun, and leaves by itself
    place.until(lambda: not AT_WORK & {state for _, state in place.flow_runs()}, 60)
    serving.send_signal(signal.SIGTERM)
    assert serving.wait(timeout=60) == 0


def test_three_real_clips_and_a_bad_file_end_to_end(tmp_path: Path, place: Any) -> None:
    def humanmm(*arguments: str) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "HUMANMM_STORE": str(tmp_path / "store")}
        command = [sys.executable, "-m", "humanmm.cli", *arguments]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    clips = tmp_path / "clips"
    for name, start in (("one/take.mp4", 0), ("two/take.mp4", 24), ("three.mp4", 58)):
        _cut(clips / name, start, 24)
    (clips / "bad.mp4").write_text("these are notes\n" * 100)
    done = humanmm("batch", "submit", "clips", "--wait")
    assert done.returncode == 3, done.stderr
    tree = json.loads(humanmm("batch", "status", "--json").stdout)
    assert tree["counts"] == {"done": 3, "failed": 1}, tree
    bad = next(video for video in tree["videos"] if video["state"] == "failed")
    assert bad["video"].endswith("bad.mp4") and bad["stage"] == "decode" and "Traceback" not in bad["reason"]
    folders = {Path(video["run_dir"]).name for video in tree["videos"] if video["state"] == "done"}
    assert len(folders) == 3 and {"three", "take"} < folders
    for folder in folders:
        assert (tmp_path / "runs" / folder / "view/overlay.mp4").stat().st_size > 0

    assert humanmm("batch", "report", "--out", "report").returncode == 0
    rows = list(csv.DictReader((tmp_path / "report/report.csv").read_text().splitlines()))
    assert [row["frames"] for row in rows] == ["", "24", "24", "24"]
    again = humanmm("batch", "submit", "clips", "--wait")
    assert "0 to do, 3 finished, 1 failed" in again.stderr


def _cut(path: Path, start: int, count: int) -> None:
    """Frames [start, start + count) of the shipped clip, encoded again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(CLIP)) as source, av.open(str(path), "w") as target:
        video = source.streams.video[0]
        stream = target.add_stream("libx264", rate=video.average_rate)
        stream.width, stream.height, stream.pix_fmt = video.width, video.height, "yuv420p"
        for number, frame in enumerate(source.decode(video)):
            if start <= number < start + count:
                fresh = av.VideoFrame.from_ndarray(frame.to_ndarray(format="rgb24"), format="rgb24")
                target.mux(stream.encode(fresh))
        target.mux(stream.encode())
