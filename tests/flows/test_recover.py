"""The flow as Prefect sees it and as the user of the command line sees it, with toy stages."""

import json
import os
import signal
import sqlite3
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from humanmm.flows import stage_tasks
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.units.unit import Unit

pytestmark = pytest.mark.usefixtures("server_cache")

NUM_UNITS = 18
"""Stages × units of the toy's film."""


def _database(cache: Path) -> list[tuple[str, str, str]]:
    """Task name, state type and state name of every task run of the newest flow run."""
    (file,) = cache.glob("prefect-*/prefect.db")
    with sqlite3.connect(file) as connection:
        (flow,) = connection.execute("select id from flow_run order by created desc limit 1").fetchone()
        # the server writes the row of a task run first and that of its state after it, in two transactions
        rows = connection.execute(
            "select t.name, s.type, s.name from task_run t join task_run_state s on s.id = t.state_id "
            "where t.flow_run_id = ?",
            (flow,),
        )
        return sorted(rows.fetchall())


def _settled(cache: Path, expected: int) -> list[tuple[str, str, str]]:
    """Prefect's server writes task runs down a little later."""
    for _ in range(100):
        rows = _database(cache)
        if len(rows) == expected and not {"PENDING", "RUNNING"} & {state for _, state, _ in rows}:
            break
        time.sleep(0.1)
    assert len(rows) == expected
    return rows


def test_a_run_writes_its_folder_and_prefect_shows_every_unit_by_name(toy: Any, server_cache: Path) -> None:
    status, out, message = toy.main("recover", "film.mp4", "--out", "out dir")
    assert (status, out) == (0, "out dir\n"), message
    rows = _settled(server_cache, NUM_UNITS)
    assert [name for name, _, _ in rows][1:4] == ["camera · shot 0", "camera · shot 1", "camera · shot 2"]
    assert {state for _, state, _ in rows} == {"COMPLETED"}
    record = json.loads((toy.folder / "out dir" / "run.json").read_text())
    assert (record["schema"], record["state"]) == ("humanmm.run/1", "done")
    assert record["video"]["num_frames"] == 60 and len(record["video"]["sha256"]) == 64
    assert [(shot["start"], shot["end"]) for shot in record["shots"]] == [(0, 20), (20, 40), (40, 60)]
    assert record["shots"][0]["transition"] is None and record["shots"][1]["transition"]["type"] == "cut"
    assert {stage["state"] for stage in record["stages"]} == {"computed"} and len(record["stages"]) == NUM_UNITS
    assert "decode: a toy" in record["warnings"] and "camera, shot 1: it does not move" in record["warnings"]
    assert record["config"]["camera"] == {"static": False} | record["config"]["camera"]
    assert {"numpy", "python", "humanmm"} <= set(record["versions"])
    assert "align" in (toy.folder / "out dir" / "run.log").read_text()

    with sqlite3.connect(next(server_cache.glob("prefect-*/prefect.db"))) as connection:
        query = "select key, data from artifact where type = 'markdown' order by created desc limit 1"
        ((key, page),) = connection.execute(query).fetchall()
        ((tags,),) = connection.execute("select tags from task_run where name = 'camera · shot 1' limit 1").fetchall()
    assert key.startswith("video-out-dir-") and "# film.mp4: done" in json.loads(page)
    assert json.loads(tags) == [], "Prefect asks the server about each tag of a task before it begins: 2 s"

    again = toy.main("recover", "film.mp4", "--out", "out dir")
    assert again[:2] == (0, "out dir\n")
    assert "up to date" in again[2]
    assert _database(server_cache) == rows, "no flow starts when the store has everything"

    changed = toy.main("recover", "film.mp4", "--out", "out dir", "--hmr.smoothness", "2")
    assert changed[0] == 0, changed[2]
    names = {name: state for name, _, state in _settled(server_cache, NUM_UNITS)}
    assert names["camera · shot 1"] == "Cached" and names["hmr · shot 1"] == "Completed"


def test_a_failed_shot_makes_the_video_partial(toy: Any, server_cache: Path) -> None:
    done = toy.main("recover", "film.mp4", TOY_FAIL="camera:20=stage")
    assert done[:2] == (3, "runs/film\n")
    assert done[2] == "humanmm: camera · shot 1 failed: camera:20 cannot be done\n"
    record = json.loads((toy.folder / "runs/film/run.json").read_text())
    assert record["state"] == "partial"
    assert [shot["failed"] for shot in record["shots"]] == [False, True, False]
    assert record["failures"][0] == {
        "stage": "camera", "unit": "shot 1", "shot": 1, "reason": "camera:20 cannot be done",
    }  # fmt: skip
    (failed,) = [s for s in record["stages"] if s["stage"] == "camera" and s["shot"] == 1]
    assert (failed["state"], failed["attempts"]) == ("failed", 1), "a stage that cannot do it is not asked twice"
    states = {name: (kind, state) for name, kind, state in _settled(server_cache, NUM_UNITS)}
    assert states["camera · shot 1"] == ("FAILED", "Failed")
    assert states["hmr · shot 1"] == ("COMPLETED", "Skipped"), "apart from what failed"
    with sqlite3.connect(next(server_cache.glob("prefect-*/prefect.db"))) as connection:
        last = connection.execute("select state_type, state_name from flow_run order by created desc limit 1")
        assert last.fetchone() == ("FAILED", "Partial")

    status = toy.main("status", "runs/film", "--json")
    assert json.loads(status[1])["state"] == "partial"
    healed = toy.main("recover", "film.mp4")
    assert healed[0] == 0
    assert json.loads((toy.folder / "runs/film/run.json").read_text())["failures"] == []


def test_the_flow_works_on_a_store_in_a_bucket(toy: Any, bucket: str) -> None:
    done = toy.main("recover", "film.mp4", "--store", bucket, "--run.max_retries", "1", TOY_FAIL="camera:20=disk:9")
    assert done[:2] == (3, "runs/film\n"), done[2]
    record = json.loads((toy.folder / "runs/film/run.json").read_text())
    assert record["store"] == bucket and [shot["failed"] for shot in record["shots"]] == [False, True, False]
    (unit,) = [s for s in record["stages"] if s["stage"] == "camera" and s["shot"] == 1]
    assert (unit["state"], unit["attempts"]) == ("failed", 2) and "Input/output error" in unit["reason"]
    assert not toy.store.exists()
    toy.executed()
    assert toy.main("recover", "film.mp4", "--store", bucket)[0] == 0
    assert toy.executed() == ["align", "camera:20", "deliver", "hmr:20", "refine"]


def test_infrastructure_faults_are_tried_again_and_the_attempts_noted(toy: Any) -> None:
    done = toy.main("recover", "film.mp4", TOY_FAIL="camera:20=disk:2")
    assert done[0] == 0, done[2]
    record = json.loads((toy.folder / "runs/film/run.json").read_text())
    (unit,) = [s for s in record["stages"] if s["stage"] == "camera" and s["shot"] == 1]
    assert (unit["state"], unit["attempts"], len(unit["faults"])) == ("computed", 3, 2)
    assert "Input/output error" in unit["faults"][0]
    assert toy.executed().count("camera:20") == 3


def test_a_shot_whose_retries_are_exhausted_is_failed_with_its_attempts_and_the_others_finish(
    toy: Any, server_cache: Path
) -> None:
    done = toy.main("recover", "film.mp4", "--run.max_retries", "1", TOY_FAIL="camera:20=disk:9")
    assert done[0] == 3 and "camera · shot 1" in done[2] and "Input/output error" in done[2]
    record = json.loads((toy.folder / "runs/film/run.json").read_text())
    assert [shot["failed"] for shot in record["shots"]] == [False, True, False]
    _settled(server_cache, NUM_UNITS)
    with sqlite3.connect(next(server_cache.glob("prefect-*/prefect.db"))) as connection:
        found = connection.execute(
            "select t.state_name, t.run_count, s.message from task_run t join task_run_state s on s.id = t.state_id "
            "where t.name = 'camera · shot 1' "
            "and t.flow_run_id = (select id from flow_run order by created desc limit 1)"
        )
        ((state, attempts, message),) = found.fetchall()
    assert (state, attempts) == ("Failed", 2) and "Input/output error" in message


def test_an_error_of_a_stage_for_the_whole_video_ends_the_run_and_leaves_no_folder(
    toy: Any, server_cache: Path
) -> None:
    done = toy.main("recover", "film.mp4", TOY_FAIL="align=stage")
    assert done[:2] == (1, "")
    assert done[2] == "humanmm: align cannot be done\n"
    with sqlite3.connect(next(server_cache.glob("prefect-*/prefect.db"))) as connection:
        query = "select description, data from artifact where type = 'markdown' order by created desc limit 1"
        ((title, page),) = connection.execute(query).fetchall()
    assert title == "film.mp4: failed", "it has a page as a finished one has"
    assert "**align cannot be done**" in json.loads(page) and "| refine | 1 | 0 | 0 | 0 | 1 |" in json.loads(page)
    assert not (toy.folder / "runs").exists()
    toy.executed()
    assert toy.main("recover", "film.mp4")[0] == 0
    assert toy.executed() == ["align", "deliver", "refine"], "everything computed before stays in the store"


def test_an_error_beside_a_unit_that_computes_waits_for_none_and_lets_none_begin(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, raised, before = stage_tasks._task_of, [], set(threading.enumerate())

    def interrupted(run: VideoRun, unit: Unit) -> Any:
        if unit.stage.name != "points":
            return made(run, unit)
        while "people" not in toy.log.read_text():
            time.sleep(0.01)
        raised.append(time.monotonic())
        raise ValueError("Error calling function: KeyboardInterrupt")  # as pydantic's serialiser makes of Ctrl-C

    monkeypatch.setattr(stage_tasks, "_task_of", interrupted)
    done = toy.main("recover", "film.mp4", "--run.threads", "1", TOY_SLEEP="people=4")
    assert time.monotonic() - raised[0] < 3.0
    assert done[0] == 1 and "KeyboardInterrupt" in done[2]
    for thread in set(threading.enumerate()) - before:
        if not thread.daemon:
            thread.join(20.0)
    assert [name for name in toy.executed() if name.startswith("people")] in (["people:0"], ["people:20"])


def test_bad_input_in_one_shot_is_no_partial_result(toy: Any) -> None:
    done = toy.main("recover", "film.mp4", TOY_FAIL="people:20=input")
    assert done[0::2] == (1, "humanmm: people:20 does not like its input\n")
    assert not (toy.folder / "runs").exists()


def test_only_one_stage_runs_and_what_its_change_affects(toy: Any, server_cache: Path) -> None:
    toy.run()
    assert toy.main("recover", "film.mp4")[0] == 0
    toy.executed()
    done = toy.main("recover", "film.mp4", "--only", "camera", "--shot", "1")
    assert done[:2] == (0, "runs/film\n"), done[2]
    assert toy.executed() == ["camera:20"], "its output did not change, so nothing after it runs"
    shown = {name.split(" · ")[0] for name, _, _ in _settled(server_cache, 12)}
    assert "camera" in shown and not shown & {"hmr", "align", "refine", "deliver"}
    done = toy.main("recover", "film.mp4", "--only", "shots", TOY_CUTS="30")
    assert done[0] == 0, done[2]
    executed = toy.executed()
    assert {"shots", "camera:30", "deliver"} <= set(executed) and "people:0" not in executed
    missing = toy.main("recover", "film.mp4", "--only", "hmr", "--camera.static", "true")
    assert missing[0] == 1
    assert missing[2].startswith("humanmm: --only hmr needs the artifact of camera (shot 0)")


@pytest.mark.server
def test_no_socket_but_loopback_from_start_to_end_and_the_server_leaves_by_itself(toy: Any, new_cache: Path) -> None:
    audit = toy.folder / "sockets"
    (toy.folder / "sitecustomize.py").write_text(
        "import os, sys\n"
        "def hook(event, arguments):\n"
        "    if event in ('socket.connect', 'socket.bind', 'socket.getaddrinfo', 'socket.sendto'):\n"
        "        with open(os.environ['TOY_AUDIT'], 'a') as file:\n"
        "            print(os.getpid(), event, arguments[1:] if event[-4:] != 'info' else arguments, file=file)\n"
        "sys.addaudithook(hook)\n"
    )
    settings = {"TOY_AUDIT": str(audit), "HUMANMM_CACHE": str(new_cache), "HUMANMM_SERVER_IDLE_S": "1"}
    done = toy.command(
        "recover", "film.mp4", **settings, HTTP_PROXY="http://192.0.2.1:1", ALL_PROXY="http://192.0.2.1:1"
    )
    assert done.returncode == 0, done.stderr
    seen = audit.read_text().splitlines()
    assert any("socket.connect" in line for line in seen) and any("socket.bind" in line for line in seen)
    assert len({line.split()[0] for line in seen}) >= 2, "both the run and the server were listened to"
    own = ("127.0.0.1", "'localhost'", "AF_UNIX", "socket.sendto ((0, 0),)")  # the last asks the kernel, by netlink
    assert [line for line in seen if not any(name in line for name in own)] == []
    server = int(next(line for line in seen if "socket.bind" in line and "127.0.0.1" in line).split()[0])
    for _ in range(300):
        if not Path(f"/proc/{server}").exists():
            break
        time.sleep(0.1)
    else:
        os.kill(server, signal.SIGKILL)
        raise AssertionError("the server did not leave when nobody needed it")
    assert not list(new_cache.glob("prefect-*/server.json"))


def test_the_flow_loads_as_a_prefect_entry_point() -> None:
    from prefect.flows import load_flow_from_entrypoint  # after `server_cache`: Prefect reads its settings on import

    flow = load_flow_from_entrypoint("humanmm.flows.recover:recover")
    assert flow.name == "recover"
    assert sorted(flow.parameters.model_dump()["properties"]) == ["config", "out", "selection", "store", "video"]


@pytest.mark.server
def test_a_run_needs_nothing_that_linux_alone_has(toy: Any, new_cache: Path) -> None:
    environment = toy.environment(HUMANMM_CACHE=str(new_cache), HUMANMM_SERVER_IDLE_S="5")
    path = os.pathsep.join([str(Path(__file__).parents[1] / "no_linux"), environment["PYTHONPATH"]])
    done = toy.command("recover", "film.mp4", **{**environment, "PYTHONPATH": path})
    assert done.returncode == 0, done.stderr
    assert len(_settled(new_cache, NUM_UNITS)) == NUM_UNITS
