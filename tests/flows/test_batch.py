"""Batches through a server, a worker and processes of their own: with toy stages, and once with everything real."""

import csv
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import av
import pytest

ROOT = Path(__file__).resolve().parents[2]
CLIP = ROOT / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"

pytestmark = [pytest.mark.server, pytest.mark.timeout(900)]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A cache folder, and so a server and a `humanmm serve`, of this test alone."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("HUMANMM_CACHE", str(folder))
    monkeypatch.setenv("HUMANMM_SERVER_IDLE_S", "20")
    yield folder
    _end(_pids("humanmm.flows.serving", folder), signal.SIGTERM)
    _end(_pids("humanmm.flows.", folder), signal.SIGKILL)


@pytest.fixture
def farm(toy: Any, cache: Path) -> Any:
    """The toy, whose stages are also those of processes that a worker starts; three films and one that is empty."""
    (toy.folder / "sitecustomize.py").write_text(
        "from humanmm.tasks import pipeline\nfrom toyline.table import STAGES\npipeline.STAGES = STAGES\n"
    )
    (toy.folder / "films").mkdir()
    for number in range(3):
        film = toy.folder / f"films/{number}.mp4"
        film.write_text(json.dumps({"num_frames": 60 + number, "cuts": [20, 40]}))
    (toy.folder / "films/empty.mp4").touch()
    return toy


def _pids(command: str, cache: Path) -> list[int]:
    """Processes of this test by a part of their command line."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            environment = (folder / "environ").read_bytes()
            line = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue
        if f"HUMANMM_CACHE={cache}\0".encode() in environment and command in line:
            found.append(int(folder.name))
    return [pid for pid in found if pid != os.getpid()]


def _end(pids: list[int], number: int) -> None:
    for pid in pids:
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            continue
    _until(lambda: not any(Path(f"/proc/{pid}/exe").exists() for pid in pids), 40)


def _until(condition: Callable[[], object], limit_s: float) -> None:
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline, "it took too long"
        time.sleep(0.2)


def _flow_runs(cache: Path) -> list[tuple[str, str]]:
    """Name and state of every flow run that Prefect knows."""
    (file,) = cache.glob("prefect-*/prefect.db")
    with sqlite3.connect(file) as connection:
        return sorted(connection.execute("select name, state_type from flow_run").fetchall())


def _status(farm: Any) -> dict[str, Any]:
    answer = farm.main("batch", "status", "--json")
    assert answer[0] == 0, answer
    tree: dict[str, Any] = json.loads(answer[1])
    return tree


def _states(farm: Any) -> dict[str, str]:
    return {Path(video["video"]).stem: video["state"] for video in _status(farm)["videos"]}


def _press_retry(cache: Path, name: str) -> str:
    """Do what the dashboard's Retry button does; tells how often the flow run ran then, and how it ended."""
    script = (
        "import asyncio, sqlite3, sys\n"
        "from prefect import get_client\n"
        "from prefect.states import AwaitingRetry\n"
        "async def main():\n"
        "    async with get_client() as client:\n"
        "        (run,) = [run.id for run in await client.read_flow_runs() if run.name == sys.argv[1]]\n"
        "        await client.set_flow_run_state(run, AwaitingRetry(), force=True)\n"
        "        while True:\n"
        "            found = await client.read_flow_run(run)\n"
        "            if found.run_count > 1 and found.state.is_final():\n"
        "                break\n"
        "            await asyncio.sleep(0.5)\n"
        "        print(found.run_count, found.state.name)\n"
        "asyncio.run(main())\n"
    )
    url = json.loads(next(cache.glob("prefect-*/server.json")).read_text())["url"]
    environment = {**os.environ, "PREFECT_API_URL": url, "PREFECT_HOME": str(cache / "client")}
    command = [sys.executable, "-c", script, name]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout.strip()


def test_a_batch_runs_to_its_end_and_a_second_time_nothing_is_scheduled(farm: Any, cache: Path) -> None:
    done = farm.command(
        "batch", "submit", "films", "--wait", "--name", "toys", "--tag", "gym", TOY_FAIL="camera:40=stage"
    )
    assert (done.returncode, done.stdout) == (3, "toys\n"), done.stderr
    tree = _status(farm)
    assert (tree["batch"], tree["counts"]) == ("toys", {"partial": 3, "failed": 1})
    first = tree["videos"][0]
    assert set(first) == {"video", "state", "stage", "reason", "run_dir", "seconds"}
    assert (first["stage"], first["reason"]) == ("camera · shot 2", "camera · shot 2: camera:40 cannot be done")
    assert "is empty (0 bytes)" in tree["videos"][3]["reason"] and first["seconds"] > 0
    assert json.loads((farm.folder / "runs/0/run.json").read_text())["state"] == "partial"
    assert (farm.folder / "runs/0/run.log").exists() and not (farm.folder / "runs/empty").exists()

    runs = _flow_runs(cache)
    assert [state for _, state in runs] == ["FAILED"] * 4
    again = farm.command("batch", "submit", "films", "--wait", "--name", "toys")
    assert again.returncode == 3 and "0 to do" in again.stderr
    assert _flow_runs(cache) == runs

    farm.executed()
    assert _press_retry(cache, "1.mp4") == "2 Partial"
    assert farm.executed() == ["camera:40"], "the dashboard's Retry runs what failed, and nothing else"

    # `humanmm serve` still has the environment in which camera fails: have a new one
    _end(_pids("humanmm.flows.serving", cache), signal.SIGTERM)
    assert _pids("humanmm.flows.", cache) == [], "it takes its server and worker along"
    healed = farm.command("batch", "retry-failed", "--stage", "camera", "--wait")
    assert healed.returncode == 3, "one is empty still"
    assert _states(farm) == {"0": "done", "1": "done", "2": "done", "empty": "failed"}
    executed = farm.executed()
    assert executed.count("camera:40") == 3 and "people:0" not in executed and "camera:0" not in executed


def test_what_a_killed_serve_leaves_behind_is_crashed_and_can_be_tried_again(farm: Any, cache: Path) -> None:
    slow = {"TOY_SLEEP": "align=30"}
    done = farm.command("batch", "submit", "films", "--limit", "2", **slow)
    assert done.returncode == 0, done.stderr
    _until(lambda: list(_states(farm).values()).count("running") == 2, 90)
    _until(lambda: "align" in {video["stage"] for video in _status(farm)["videos"]}, 60)
    _end(_pids("humanmm.flows.", cache) + _pids("prefect.engine", cache), signal.SIGKILL)
    states = _states(farm)
    assert sorted(states.values()) in (["failed", "failed", "scheduled", "scheduled"], ["failed"] * 3 + ["scheduled"])
    lost = next(video for video in _status(farm)["videos"] if video["state"] == "failed" and video["stage"])
    assert "its process was lost during align" in lost["reason"]

    done = farm.command("batch", "submit", "films", "--wait", "--limit", "2")
    assert done.returncode == 3
    _until(lambda: not {"RUNNING", "PENDING", "SCHEDULED"} & {state for _, state in _flow_runs(cache)}, 60)
    assert [state for _, state in _flow_runs(cache)].count("CRASHED") == 2
    done = farm.command("batch", "retry-failed", "--wait")
    assert _states(farm) == {"0": "done", "1": "done", "2": "done", "empty": "failed"}, done.stderr


def test_a_batch_survives_the_death_of_the_server_and_can_be_cancelled(farm: Any, cache: Path) -> None:
    done = farm.command("batch", "submit", "films", "--limit", "1", TOY_SLEEP="align=25")
    assert done.returncode == 0, done.stderr
    _until(lambda: "align" in {video["stage"] for video in _status(farm)["videos"]}, 90)
    before = next(cache.glob("prefect-*/port")).read_text()
    _end(_pids("humanmm.flows.local_server", cache), signal.SIGKILL)
    _until(lambda: "done" in _states(farm).values(), 120)
    assert next(cache.glob("prefect-*/port")).read_text() == before
    _until(lambda: "running" in _states(farm).values(), 90)
    assert farm.command("batch", "cancel").returncode == 0
    states = list(_states(farm).values())
    assert states.count("cancelled") >= 1 and not {"running", "scheduled"} & set(states)
    _until(lambda: not _pids("prefect.engine", cache), 60)  # one may just have begun, and leaves by itself
    _until(lambda: not {"RUNNING", "PENDING", "SCHEDULED", "CANCELLING"} & {s for _, s in _flow_runs(cache)}, 60)


def test_three_real_clips_and_a_bad_file_end_to_end(tmp_path: Path, cache: Path) -> None:
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
