"""What is computed again after which change, and what it says about it."""

from typing import Any

EVERYTHING = [
    "align", "camera:0", "camera:20", "camera:40", "decode", "deliver", "hmr:0", "hmr:20", "hmr:40", "intrinsics",
    "people:0", "people:20", "points:0", "points:20", "points:40", "refine", "scenes", "shots",
]  # fmt: skip


def test_a_cold_store_computes_everything_once_and_a_warm_one_nothing(toy: Any) -> None:
    toy.run()
    assert toy.executed() == EVERYTHING
    run = toy.run()
    assert toy.executed() == []
    assert {outcome.state for outcome in run.outcomes.values()} == {"cached"}
