"""Progress on the dashboard: of long stages only, now and then, and in the end as it was in the end."""

import re
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import cast
from uuid import UUID, uuid4

import prefect
import pytest

from humanmm.flows.server import dashboard
from humanmm.flows.server.local_server import prefect_server
from humanmm.tasks.units.unit import Unit


@pytest.fixture
def shown(server_cache: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[UUID], list[float]]]:
    """What Prefect's server has of the progress of a flow run; a fifth of a second is long here."""
    monkeypatch.setattr(dashboard, "LOOK_S", 0.01)
    monkeypatch.setattr(dashboard, "LONG_S", 0.2)
    monkeypatch.setattr(dashboard, "EVERY_S", 0.5)
    with prefect_server(), closing(sqlite3.connect(next(server_cache.glob("prefect-*/prefect.db")))) as database:

        def ask(flow_run: UUID) -> list[float]:
            found = database.execute("select data from artifact where flow_run_id = ?", (str(flow_run),))
            return [float(percent) for (percent,) in found]

        yield ask


def begun_flow_run() -> UUID:
    """A flow run that the server knows: it removes artifacts of others when it likes."""
    with prefect.get_client(sync_client=True) as client:
        return client.create_flow_run(prefect.flow(lambda: None, name="shown")).id


def stage(label: str) -> Unit:
    return cast("Unit", SimpleNamespace(label=label))


def test_a_short_stage_is_never_shown(shown: Callable[[UUID], list[float]]) -> None:
    flow_run = begun_flow_run()
    board = dashboard.ProgressBoard(flow_run)
    board.begin(stage("decode"), uuid4())
    board.report(stage("decode"), 1, 2)
    board.report(stage("decode"), 2, 2)
    time.sleep(0.5)  # long after it has ended
    board.end()
    assert shown(flow_run) == []


def test_a_long_stage_that_could_not_be_shown_while_it_ran_is_shown_at_its_end(
    shown: Callable[[UUID], list[float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dashboard, "LOOK_S", 60.0)  # or the server was too busy
    flow_run = begun_flow_run()
    board = dashboard.ProgressBoard(flow_run)
    board.begin(stage("people"), uuid4())
    time.sleep(0.3)
    board.report(stage("people"), 100, 100)
    board.end()
    assert shown(flow_run) == [100.0]


def test_a_long_stage_is_shown_now_and_then_and_its_end_at_once(shown: Callable[[UUID], list[float]]) -> None:
    flow_run = begun_flow_run()
    board = dashboard.ProgressBoard(flow_run)
    board.begin(stage("people"), uuid4())
    begun, seen = time.monotonic(), []
    for done in range(100):
        board.report(stage("people"), done, 100)
        time.sleep(0.01)
        if shown(flow_run) not in ([], seen[-1:]):
            seen += shown(flow_run)
    lasted = time.monotonic() - begun
    board.report(stage("people"), 100, 100)
    board.end()
    assert 1 <= len(seen) <= lasted / 0.5 + 1
    assert seen == sorted(seen)
    assert shown(flow_run) == [100.0]


def test_batches_of_different_names_have_tables_of_their_own() -> None:
    names = ["films-2024", "Films 2024", "試験", "練習", "-", "caf\udce9"]
    keys = [dashboard._key(name) for name in names]
    assert keys[0] == "films-2024" and len(set(keys)) == len(names)
    assert all(re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", key) for key in keys)
