"""`humanmm train`: what a user types reaches the training that he means."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from humanmm.cli import main
from humanmm.flows.training.motion import Material
from humanmm.models.learning.training.keypoint_refiner import RefinerRecipe
from humanmm.models.learning.training.lifter import KeypointRecipe, LifterRecipe
from humanmm.models.learning.training.motion import MotionRecipe

Typed = Callable[..., tuple[Any, ...]]


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Typed:
    """What a training was given for some words; it prints the network's path."""

    def typed(flow: str, *words: str) -> tuple[Any, ...]:
        calls: list[tuple[Any, ...]] = []

        def fn(*arguments: Any) -> Path:
            calls.append(arguments)
            return Path("network.safetensors")

        monkeypatch.setattr(f"humanmm.flows.training.{flow}", SimpleNamespace(fn=fn))
        assert main(["train", *words]) == 0
        assert capsys.readouterr().out == "network.safetensors\n"
        (arguments,) = calls
        return arguments

    return typed


def test_a_network_is_trained_by_the_recipe_unless_steps_or_seed_are_given(given: Typed) -> None:
    where = ["--pairs", "pairs", "--out", "out"]
    plain = given("lifter.train_lifter", "lifter", *where)
    assert plain == (Path("pairs"), Path("out"), LifterRecipe(), (), "cpu", None)
    changed = given("lifter.train_lifter", "lifter", *where, "--steps", "5", "--seed", "7", "--device", "cuda")
    assert changed[2:] == (LifterRecipe(steps=5, seed=7), (), "cuda", None)
    begun = given("lifter.train_lifter", "lifter", *where, "--steps", "5", "--begin-with", "k")
    assert begun[2:] == (LifterRecipe(steps=5), (), "cpu", Path("k"))
    where_looks = ["--looks", "looks", "--out", "out"]
    refined = given("keypoint_refiner.train_keypoint_refiner", "keypoint-refiner", *where_looks, "--seed", "3")
    assert refined == (Path("looks"), Path("out"), RefinerRecipe(seed=3), "cpu")
    lifted = given("lifter.train_keypoints", "keypoints", "--out", "out", "--steps", "5", "--mocap", "a")
    assert lifted == (Path("out"), KeypointRecipe(steps=5), (Path("a"),), "cpu", None)
    found = given("motion.train_ms_hmr", "ms-hmr", *where, "--steps", "5", "--seed", "7", "--mocap", "a", "b")
    assert found == (Material(Path("pairs"), (Path("a"), Path("b"))), Path("out"), MotionRecipe(steps=5, seed=7), "cpu")


def test_a_network_is_trained_on_those_before_it(given: Typed) -> None:
    where = ["--pairs", "pairs", "--out", "out"]
    material, recipe = Material(Path("pairs")), MotionRecipe()
    trajectory = given("motion.train_trajectory", "trajectory", *where, "--ms-hmr", "m")
    assert trajectory == (material, Path("out"), Path("m"), recipe, "cpu")
    before = ["--predictor", "p", "--ms-hmr", "m"]
    refiner = given("motion.train_refiner", "refiner", *where, *before)
    assert refiner == (material, Path("out"), Path("m"), Path("p"), recipe, "cpu")
    assert given("motion.train_refiner", "refiner", *where)[2:4] == (None, None), "the flow's defaults"


def test_pairs_are_made_of_the_split_that_is_asked_for(given: Typed) -> None:
    plain = given("pairs.build_pairs", "pairs", "--out", "out")
    assert plain == ("train", 640, Path("out"), (), 2, "pairs")
    assert given("pairs.build_pairs", "looks", "--out", "out") == ("train", 2048, Path("out"), (), 2, "looks")
    words = ["--out", "out", "--split", "dev", "--count", "32", "--mocap", "a", "--threads", "1"]
    assert given("pairs.build_pairs", "pairs", *words) == ("dev", 32, Path("out"), (Path("a"),), 1, "pairs")


def test_what_training_needs_has_no_default(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "lifter", "--out", "out"]) == 2
    assert "--pairs" in capsys.readouterr().err
    assert main(["train", "pairs", "--out", "out", "--split", "all"]) == 2
    assert "--split" in capsys.readouterr().err
