"""The training of the lifter as a flow: checkpoints, the curve as a picture, the network and its card."""

import json
import logging
from dataclasses import asdict
from pathlib import Path

import numpy as np
from prefect import flow

from humanmm.errors import InputError
from humanmm.flows.bench.render_set import shipped_packs, takes_of
from humanmm.flows.training.card import Validation, draw_curve, lifter_card
from humanmm.models.learning.objective import score
from humanmm.models.learning.other_motion import OtherMotion, takes_on_bodies
from humanmm.models.learning.training import LifterTraining, Recipe
from humanmm.models.learning.windows import windows_of
from humanmm.storage.readers.mocap_pack import read_pack
from humanmm.storage.store.files import replace_text
from humanmm.storage.training.checkpoints import read_checkpoint, write_checkpoint
from humanmm.storage.training.networks import write_network
from humanmm.storage.training.pair_set import read_pairs
from humanmm.tasks.units.process import prepare_process

log = logging.getLogger(__name__)

CHECKPOINT_STEPS = 200
VALIDATION_STEPS = 400
SHIPPED = "lifter.safetensors"


@flow(name="train-lifter", persist_result=False)
def train_lifter(
    pairs: Path, out: Path, recipe: Recipe | None = None, packs: tuple[Path, ...] = (), device: str = "cpu"
) -> Path:
    """Train on the pairs of the split train, measure on those of dev; returns the network's file.

    A training that was stopped goes on from its last checkpoint in `out`.
    """
    prepare_process()
    recipe = recipe or Recipe()
    arrays, _ = read_pairs(pairs, "train")
    windows, errors = windows_of(arrays)
    dev, _ = windows_of(read_pairs(pairs, "dev")[0])
    sequences = [
        sequence
        for pack in packs or shipped_packs("places", "train")
        for sequence in takes_of(read_pack(pack), "train")
    ]
    takes = takes_on_bodies(sequences, np.random.default_rng(recipe.seed))
    training = LifterTraining(recipe, windows, OtherMotion(takes, arrays, windows, errors), device=device)
    out.mkdir(parents=True, exist_ok=True)
    validations = _resumed(training, out, recipe)
    while training.step < recipe.steps:
        training.run(CHECKPOINT_STEPS - training.step % CHECKPOINT_STEPS, lambda _, __: None)
        if training.step % VALIDATION_STEPS == 0 or training.step == recipe.steps:
            validations.append(Validation(training.step, score(training.result, dev)))
            log.info("step %d of %d: %s", training.step, recipe.steps, validations[-1].score)
            draw_curve(out / "curve.png", training.losses, validations)
        kept = [asdict(one) for one in validations]
        write_checkpoint(out, training.state() | {"recipe": asdict(recipe), "validations": json.dumps(kept)})
    network = training.result
    write_network(out / SHIPPED, network)
    card = lifter_card(
        recipe, len(windows), len(dev), own=score(None, dev), lifted=score(network, dev),
        coco=score(network, dev, coco=True),
    )  # fmt: skip
    replace_text(out / "lifter.md", card)
    return out / SHIPPED


def _resumed(training: LifterTraining, out: Path, recipe: Recipe) -> list[Validation]:
    """Restore the last checkpoint, if there is one; the validations so far."""
    state = read_checkpoint(out)
    if state is None:
        return []
    if state["recipe"] != asdict(recipe):
        raise InputError(f"{out} holds a training by another recipe; name another folder, or delete it")
    training.restore(state)
    log.info("going on from step %d of %d", training.step, recipe.steps)
    return [Validation.read(one) for one in json.loads(state["validations"])]
