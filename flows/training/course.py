"""One training from its first step or its last checkpoint to its end: checkpoints, errors, the curve as a picture."""

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TypeVar

from torch import nn

from humanmm.errors import InputError
from humanmm.flows.training.card import Validation, draw_curve
from humanmm.models.learning.training import Training
from humanmm.storage.training.checkpoints import read_checkpoint, write_checkpoint

log = logging.getLogger(__name__)

CHECKPOINT_STEPS = 200
VALIDATION_STEPS = 400

Net = TypeVar("Net", bound=nn.Module)


def train_to_end(training: Training[Net], out: Path, errors: Callable[[Net], Mapping[str, float]]) -> Net:
    """The trained network; a training that was stopped goes on from its last checkpoint in `out`.

    `errors` measures a network on the development split: name with unit → figure, for the log and the picture.
    """
    out.mkdir(parents=True, exist_ok=True)
    validations = _resumed(training, out)
    steps = training.recipe.steps
    while training.step < steps:
        training.run(CHECKPOINT_STEPS - training.step % CHECKPOINT_STEPS, lambda _, __: None)
        if training.step % VALIDATION_STEPS == 0 or training.step == steps:
            validations.append(Validation(training.step, dict(errors(training.result))))
            log.info("step %d of %d: %s", training.step, steps, validations[-1].errors)
            draw_curve(out / "curve.png", training.losses, validations)
        kept = [asdict(one) for one in validations]
        write_checkpoint(out, training.state() | {"recipe": asdict(training.recipe), "validations": json.dumps(kept)})
    return training.result


def _resumed(training: Training[Net], out: Path) -> list[Validation]:
    """Restore the last checkpoint, if there is one; the validations so far."""
    state = read_checkpoint(out)
    if state is None:
        return []
    if state["recipe"] != asdict(training.recipe):
        raise InputError(f"{out} holds a training by another recipe; name another folder, or delete it")
    training.restore(state)
    log.info("going on from step %d of %d", training.step, training.recipe.steps)
    return [Validation(one["step"], one["errors"]) for one in json.loads(state["validations"])]
