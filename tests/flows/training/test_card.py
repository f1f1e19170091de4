"""What a training says of itself."""

from humanmm.flows.training.card import lifter_card, pose_card, trajectory_card
from humanmm.models.learning.training.lifter_objective import LifterScore
from humanmm.models.learning.training.loop import Recipe
from humanmm.models.learning.training.motion_objective import PoseScore, TrajectoryScore

SCORE = LifterScore((100.0, 120.4), (50.0, 60.0), (8.0, 9.0), (10.0, 11.0), 0.5, 0.01)


def test_a_card_names_the_recipe_and_the_figures() -> None:
    card = lifter_card(Recipe(steps=5), 32, 16, own=SCORE, lifted=SCORE, coco=SCORE)
    assert "steps 5" in card and "32 windows" in card
    assert "| lifted | 50, 60 | 100, 120 | 8, 9 | 10, 11 | 0.50, 0.01 |" in card


def test_cards_of_motion_networks_have_a_row_for_each_way() -> None:
    pose = pose_card(Recipe(steps=5), "clips", {"ms-HMR": PoseScore((61.25, 70.0), (9.0, 12.0), (2.0, 3.0))})
    assert "Trained on clips" in pose and "| ms-HMR | 61.2, 70.0 | 9.0, 12.0 | 2.0, 3.0 |" in pose
    rows = {
        "fit": TrajectoryScore(0.0, (0.1, 0.2), (0.01, 0.02)),
        "refiner": TrajectoryScore(0.9, (0.1, 0.2), (0.01, 0.02)),
    }
    card = trajectory_card(Recipe(steps=5), "clips", rows)
    assert "| fit | none given | 0.100, 0.200 | 0.010, 0.020 |" in card and "| refiner | 0.90 |" in card
