"""Maintenance as the flow does it: what is sound, what could go, and damage that fails it."""

from typing import Any

from humanmm.flows.maintain import maintain


def test_a_sound_store_is_counted_and_only_removed_from_on_request(toy: Any) -> None:
    run = toy.run()
    num_artifacts = len(run.outcomes)
    state = maintain.fn(store=toy.store, unused_days=0.0, with_runs=True)
    assert state.is_completed() and f"{num_artifacts} artifacts are sound, 0 damaged" in state.message
    assert state.message.endswith("could go")
    assert maintain.fn(store=toy.store, unused_days=0.0, with_runs=True, remove=True).message.endswith("freed")
    assert maintain.fn(store=toy.store).message.startswith("0 artifacts are sound")


def test_a_damaged_artifact_fails_it_and_is_named(toy: Any) -> None:
    run = toy.run()
    manifest = run.manifest("refine")
    next(path for path in toy.store.rglob("manifest.json") if manifest.ref.key in str(path)).write_text("{")
    state = maintain.fn(store=toy.store)
    assert state.is_failed() and "1 damaged" in state.message and manifest.ref.key in state.message
