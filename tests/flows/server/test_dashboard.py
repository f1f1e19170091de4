"""Progress on the dashboard: of long stages only, now and then, and in the end as it was in the end."""

import time
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, cast
from uuid import uuid4

import pytest

from humanmm.flows.server import dashboard
from humanmm.tasks.units.unit import Unit


class Server:
    """Notes what it is told."""

    def __init__(self) -> None:
        self.asked = 0
        self.told: list[float] = []

    def create_artifact(self, asked: Any) -> Any:
        self.told.append(asked.data)
        return SimpleNamespace(id=uuid4())

    def update_artifact(self, _: Any, asked: Any) -> None:
        self.told.append(asked.data)


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Server:
    found = Server()

    def client(**_: Any) -> Any:
        found.asked += 1
        return nullcontext(found)

    monkeypatch.setattr(dashboard, "get_client", client)
    monkeypatch.setattr(dashboard, "LOOK_S", 0.01)
    monkeypatch.setattr(dashboard, "LONG_S", 0.2)
    monkeypatch.setattr(dashboard, "EVERY_S", 0.5)
    return found


def stage(label: str) -> Unit:
    return cast("Unit", SimpleNamespace(label=label))


def test_a_short_stage_is_never_told_and_the_server_is_not_even_asked(server: Server) -> None:
    board = dashboard.ProgressBoard(uuid4())
    board.begin(stage("decode"), uuid4())
    board.report(stage("decode"), 1, 2)
    time.sleep(0.1)
    board.end()
    assert (server.asked, server.told) == (0, [])


def test_a_long_stage_is_told_now_and_then_and_its_end_at_once(server: Server) -> None:
    board = dashboard.ProgressBoard(uuid4())
    board.begin(stage("people"), uuid4())
    begun = time.monotonic()
    for done in range(100):
        board.report(stage("people"), done, 100)
        time.sleep(0.01)
    lasted = time.monotonic() - begun
    board.report(stage("people"), 100, 100)
    board.end()
    assert 2 <= len(server.told) <= lasted / 0.5 + 2
    assert server.told[-1] == 100.0
    assert server.told == sorted(server.told)
