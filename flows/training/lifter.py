"""The trainings of the lifters as flows: a network, its curve and its card."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool
from prefect import flow

from humanmm.flows.training.card import keypoint_card, lifter_card
from humanmm.flows.training.course import train_to_end
from humanmm.flows.training.sequences import sequences_of
from humanmm.models.learning.keypoint_motion import KeypointMotion
from humanmm.models.learning.other_motion import BODIES_A_TAKE, OtherMotion, takes_on_bodies, takes_to_learn_from
from humanmm.models.learning.training.lifter import KeypointRecipe, LifterRecipe, keypoint_training, lifter_training
from humanmm.models.learning.training.lifter_objective import score
from humanmm.models.learning.windows import Windows, windows_of
from humanmm.models.perception.lifting.network import LifterNetwork
from humanmm.models.perception.lifting.reading import load_lifter
from humanmm.storage.store.files import replace_text
from humanmm.storage.training.networks import read_network, write_network
from humanmm.storage.training.pair_set import read_pairs
from humanmm.tasks.units.process import prepare_process

log = logging.getLogger(__name__)

Array = np.ndarray

SHIPPED, SHIPPED_KEYPOINTS = "lifter.safetensors", "keypoint_lifter.safetensors"
NOBODY = "nobody"
"""Whose motion a routine is (`rendering.places.takes.Performance`)."""
MEASURED = 256
"""Windows of other subjects that the keypoint lifter is measured on."""


@flow(name="train-lifter", persist_result=False)
def train_lifter(
    pairs: Path,
    out: Path,
    recipe: LifterRecipe | None = None,
    packs: tuple[Path, ...] = (),
    device: str = "cpu",
    begin_with: Path | None = None,
) -> Path:
    """Train on the pairs of the split train, measure on those of dev that show captured motion; returns the network's
    file.

    It begins with the weights of the file `begin_with`, else with those of the shipped keypoint lifter. A training that
    was stopped goes on from its last checkpoint in `out`.
    """
    prepare_process()
    recipe = recipe or LifterRecipe()
    arrays, facts = read_pairs(pairs, "train")
    windows, errors = windows_of(arrays)
    dev = _captured(*read_pairs(pairs, "dev"))
    takes = takes_to_learn_from(sequences_of(packs, "train"), np.random.default_rng(recipe.seed))
    training = lifter_training(
        recipe, windows, OtherMotion(takes, arrays, windows, errors, routines=recipe.routines),
        begin_with=_read(begin_with) if begin_with else load_lifter(SHIPPED_KEYPOINTS),
        is_routine=_are_routines(facts), device=device,
    )  # fmt: skip

    def measured(network: LifterNetwork) -> Mapping[str, float]:
        found = score(network, dev)
        return {"PA-MPJPE, mm": found.pa_mpjpe_mm[0], "MPJPE, mm": found.mpjpe_mm[0]}

    network = train_to_end(training, out, measured)
    file = out / SHIPPED
    write_network(file, network)
    card = lifter_card(
        recipe, len(windows), len(dev), own=score(None, dev), lifted=score(network, dev),
        coco=score(network, dev, coco=True),
    )  # fmt: skip
    replace_text(file.with_suffix(".md"), card)
    return file


@flow(name="train-keypoints", persist_result=False)
def train_keypoints(
    out: Path,
    recipe: KeypointRecipe | None = None,
    packs: tuple[Path, ...] = (),
    device: str = "cpu",
    begin_with: Path | None = None,
) -> Path:
    """Train the lifter of COCO's keypoints on the takes of the split train, measure on those of dev; returns the
    network's file.

    It begins with the weights of the file `begin_with`, else with random ones. A training that was stopped goes on from
    its last checkpoint in `out`.
    """
    prepare_process()
    recipe = recipe or KeypointRecipe()
    held_out = [take for take in sequences_of(packs, "dev") for _ in range(BODIES_A_TAKE)]
    shown = takes_on_bodies(held_out, np.random.default_rng(recipe.seed + 1))
    dev = KeypointMotion(shown).draw(MEASURED, np.random.default_rng(recipe.seed))
    takes = takes_to_learn_from(sequences_of(packs, "train"), np.random.default_rng(recipe.seed))
    beginning = _read(begin_with) if begin_with else None
    training = keypoint_training(recipe, KeypointMotion(takes), begin_with=beginning, device=device)

    def measured(network: LifterNetwork) -> Mapping[str, float]:
        found = score(network, dev, coco=True)
        return {"PA-MPJPE, mm": found.pa_mpjpe_mm[0], "MPJPE, mm": found.mpjpe_mm[0]}

    network = train_to_end(training, out, measured)
    write_network(out / SHIPPED_KEYPOINTS, network)
    replace_text(out / "keypoint_lifter.md", keypoint_card(recipe, len(dev), score(network, dev, coco=True)))
    return out / SHIPPED_KEYPOINTS


def _read(file: Path) -> LifterNetwork:
    return read_network(file, LifterNetwork.shaped_as)


def _captured(arrays: Mapping[str, Array], facts: Sequence[Mapping[str, Any]]) -> Windows:
    """The windows that show captured motion; all of them, and a sentence in the log, if none does. Routines are always
    of the kind that a training has seen: they say little of how it does on people."""
    shown = ~_are_routines(facts)
    if not shown.any():
        log.warning("no pairs of the split dev show captured motion: the network is measured on routines")
        return windows_of(arrays)[0]
    return windows_of({name: array[shown] for name, array in arrays.items()})[0]


def _are_routines(facts: Sequence[Mapping[str, Any]]) -> Bool[Array, " W"]:
    return np.array([shown.get("subject") == NOBODY for shown in facts], dtype=bool)
