"""The training of the keypoint refiner as a flow: a network, its curve and its card."""

from collections.abc import Mapping
from pathlib import Path

from prefect import flow

from humanmm.flows.training.card import keypoint_refiner_card
from humanmm.flows.training.course import train_to_end
from humanmm.models.learning.training.keypoint_refiner import Looks, RefinerRecipe, refiner_score, refiner_training
from humanmm.models.perception.keypoints.network import KeypointRefiner
from humanmm.models.perception.keypoints.surroundings import WEIGHTS
from humanmm.storage.store.files import replace_text
from humanmm.storage.training.networks import write_network
from humanmm.storage.training.pair_set import read_pairs
from humanmm.tasks.units.process import prepare_process


@flow(name="train-keypoint-refiner", persist_result=False)
def train_keypoint_refiner(looks: Path, out: Path, recipe: RefinerRecipe | None = None, device: str = "cpu") -> Path:
    """Train on the looks of the split train, measure on those of dev; returns the network's file.

    A training that was stopped goes on from its last checkpoint in `out`.
    """
    prepare_process()
    recipe = recipe or RefinerRecipe()
    train, dev = (Looks.of(read_pairs(looks, split, "looks")[0]) for split in ("train", "dev"))
    training = refiner_training(recipe, train, device=device)

    def measured(network: KeypointRefiner) -> Mapping[str, float]:
        found = refiner_score(network, dev)
        return {"limbs, mean, % of the side": found.limbs[1], "limbs, median": found.limbs[0], "feet": found.feet[0]}

    network = train_to_end(training, out, measured)
    file = out / WEIGHTS
    write_network(file, network)
    rows = {"as the pose networks have them": refiner_score(None, dev), "refined": refiner_score(network, dev)}
    replace_text(file.with_suffix(".md"), keypoint_refiner_card(recipe, len(train), len(dev), rows))
    return file
