"""One training from its first step or its last checkpoint to its end: checkpoints, errors, the curve as a picture."""

import json
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TypeVar

import numpy as np
from torch import Tensor, nn

from humanmm.errors import InputError
from humanmm.flows.training.card import Validation, draw_curve
from humanmm.models.learning.training.loop import Training
from humanmm.storage.training.checkpoints import read_checkpoint, write_checkpoint

log = logging.getLogger(__name__)

CHECKPOINT_STEPS = 200
VALIDATION_STEPS = 400

Net = TypeVar("Net", bound=nn.Module)


def train_to_end(training: Training[Net], out: Path, errors: Callable[[Net], Mapping[str, float]]) -> Net:
    """The network that is best on the development split; a training that was stopped goes on from its last checkpoint.

    `errors` measures a network there: name with unit → figure, for the log and the picture. The first one decides which
    network is best; after `recipe.patience` validations in a row that were no better the training ends early.
    """
    out.mkdir(parents=True, exist_ok=True)
    recipe = training.recipe
    validations, best = _resumed(training, out)
    while training.step < recipe.steps and _since_best(validations) < recipe.patience:
        training.run(CHECKPOINT_STEPS - training.step % CHECKPOINT_STEPS, lambda _, __: None)
        if training.step % VALIDATION_STEPS == 0 or training.step == recipe.steps:
            found = errors(training.with_weights(training.averaged))
            validations.append(Validation(training.step, dict(found)))
            if _since_best(validations) == 0:
                best = {name: value.clone() for name, value in training.averaged.items()}
            log.info("step %d of %d: %s", training.step, recipe.steps, validations[-1].errors)
            draw_curve(out / "curve.png", training.losses, validations)
        kept = json.dumps([asdict(one) for one in validations])
        write_checkpoint(out, training.state() | {"recipe": asdict(recipe), "validations": kept, "best": best})
    return training.with_weights(best)


def _since_best(validations: Sequence[Validation]) -> int:
    """How many validations there were after the best one."""
    deciding = [next(iter(one.errors.values())) for one in validations]
    return len(deciding) - 1 - int(np.argmin(deciding)) if deciding else 0


def _resumed(training: Training[Net], out: Path) -> tuple[list[Validation], dict[str, Tensor]]:
    """Restore the last checkpoint, if there is one; the validations so far, and the weights of the best."""
    state = read_checkpoint(out)
    if state is None:
        return [], {}
    if state["recipe"] != asdict(training.recipe):
        raise InputError(f"{out} holds a training by another recipe; name another folder, or delete it")
    training.restore(state)
    log.info("going on from step %d of %d", training.step, training.recipe.steps)
    return [Validation(one["step"], one["errors"]) for one in json.loads(state["validations"])], state["best"]
