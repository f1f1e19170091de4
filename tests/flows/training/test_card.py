"""What a training says of itself."""

from dataclasses import asdict

from humanmm.flows.training.card import Validation, lifter_card
from humanmm.models.learning.objective import LifterScore
from humanmm.models.learning.training import Recipe

SCORE = LifterScore((100.0, 120.4), (50.0, 60.0), (8.0, 9.0), (10.0, 11.0), 0.5, 0.01)


def test_a_card_names_the_recipe_and_the_figures() -> None:
    card = lifter_card(Recipe(steps=5), 32, 16, own=SCORE, lifted=SCORE, coco=SCORE)
    assert "steps 5" in card and "32 windows" in card
    assert "| lifted | 50, 60 | 100, 120 | 8, 9 | 10, 11 | 0.50, 0.01 |" in card


def test_a_validation_survives_json() -> None:
    one = Validation(3, SCORE)
    tree = asdict(one)
    tree["score"]["mpjpe_mm"] = list(tree["score"]["mpjpe_mm"])
    assert Validation.read(tree) == one
