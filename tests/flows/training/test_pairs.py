"""Sets of pairs: which groups there are, and that only those that lack are made."""

from pathlib import Path

import numpy as np
import pytest

from humanmm.flows.bench.render_set import shipped_packs
from humanmm.flows.training import pairs
from humanmm.flows.training.pairs import PairPlan, build_pairs
from humanmm.storage.training.pair_set import PairSet


def plan(count: int) -> PairPlan:
    return PairPlan("dev", count, shipped_packs("places", "dev"))


def test_a_larger_set_begins_with_the_smaller_one() -> None:
    small, large = plan(20), plan(40)
    assert small.groups()[0] == large.groups()[0] and small.groups()[1][1] == range(16, 20)
    assert small.identity() == large.identity()


def test_no_seed_serves_twice() -> None:
    seeds = [seed for splits in pairs.SEEDS.values() for seed in splits.values()]
    assert len(set(seeds)) == len(seeds)


def test_only_what_lacks_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def make(_: PairPlan, pair_set: PairSet, name: str, numbers: range) -> str:
        pair_set.write(name, {"x": np.zeros((len(numbers), 1))}, [{}] * len(numbers))
        made.append(name)
        return name

    monkeypatch.setattr(pairs, "make_group", make)
    build_pairs.fn("dev", 16, tmp_path, threads=1)
    build_pairs.fn("dev", 48, tmp_path, threads=1)
    assert made == ["dev-00000", "dev-00001", "dev-00002"]
