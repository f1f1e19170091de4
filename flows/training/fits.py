"""Body fits of a set of pairs, made once and kept beside them: ms-HMR and the trajectory networks learn from them."""

import logging
from pathlib import Path

import numpy as np

from humanmm.flows.bench.render_set import Split
from humanmm.models.learning.body_fits import fit_window
from humanmm.models.perception.lifting.lift import lift
from humanmm.models.weights.shipped import manifest
from humanmm.storage.training.pair_set import PairSet, identity_of, read_group, read_pairs
from humanmm.tasks.units.digest import code_digest
from humanmm.tasks.units.process import made_in_processes, prepare_process

log = logging.getLogger(__name__)

FOLDER = "fits"
MODULE = "humanmm.models.learning.body_fits"


def fitted_pairs(pairs: Path, split: Split, threads: int = 2) -> dict[str, np.ndarray]:
    """The arrays of all windows of a split with those of their fits; fits that are missing are made first."""
    arrays, _ = read_pairs(pairs, split)
    fits = PairSet(pairs / FOLDER, _identity())
    fits.folder.mkdir(exist_ok=True)
    names = [path.stem for path in sorted(pairs.glob(f"{split}-*.zarr"))]
    missing = [(pairs, fits, name) for name in names if not fits.has(name)]
    for done, name in enumerate(made_in_processes(fit_group, missing, threads), start=1):
        log.info("%s: fits of %d of %d groups", name, done, len(missing))
    return arrays | read_pairs(fits.folder, split)[0]


def fit_group(pairs: Path, fits: PairSet, name: str) -> str:
    """Fit the windows of one group; returns its name. Runs in a process of its own."""
    prepare_process()
    arrays, facts = read_group(pairs / f"{name}.zarr")
    packed = [fit_window({key: values[w] for key, values in arrays.items()}, lift).packed() for w in range(len(facts))]
    fits.write(name, {key: np.stack([one[key] for one in packed]) for key in packed[0]}, facts)
    return name


def _identity() -> str:
    """Of the code and the lifters that decide a fit."""
    lifters = {name: file.sha256 for name, file in manifest().items() if name.endswith("lifter.safetensors")}
    return identity_of({"code": code_digest(MODULE).modules, "lifters": lifters})
