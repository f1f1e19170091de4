"""`humanmm serve`: its flags; `tests/flows/service/test_serve.py` has the service itself."""

from typing import Any

import pytest

from humanmm.cli import main
from humanmm.flows.service import serve


def test_it_prints_the_dashboards_address_and_takes_as_many_videos_as_are_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given: list[dict[str, Any]] = []

    def run(*, on_ready: Any, **flags: Any) -> None:
        given.append(flags)
        on_ready("http://127.0.0.1:4200")

    monkeypatch.setattr(serve, "serve", run)
    monkeypatch.setattr(serve, "num_processors", lambda: 9)
    assert main(["serve"]) == 0
    assert main(["serve", "--limit", "3", "--idle", "2.5"]) == 0
    assert given == [{"limit": 4, "idle_s": None}, {"limit": 3, "idle_s": 2.5}], "two stages a video, by itself"
    assert capsys.readouterr().out == "dashboard: http://127.0.0.1:4200\n" * 2
