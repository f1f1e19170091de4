"""The memory of a stage is measured in a process of its own, above what its code takes."""

from typing import Any

import pytest

from humanmm.config import Config
from humanmm.storage.store.store import Store
from humanmm.tasks import pipeline
from humanmm.tasks.engine.stage_memory import measure_memory


def test_what_a_stage_allocates_is_seen_and_what_its_imports_take_is_not(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    toy.edit("decode", 'act("decode", inputs)', "assert np.ones((100, 125_000)).sum() > 0")
    monkeypatch.setattr(pipeline, "STAGES", pipeline.STAGES[:1])
    (unit,) = measure_memory(toy.video, Config(), Store(toy.store))
    assert (unit.stage, unit.unit) == ("decode", "video")
    assert 95 < unit.grown_mb < 140  # 100 MB, and what it takes to write an artifact
    assert unit.before_mb > 50
