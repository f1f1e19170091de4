"""Captured motion for trainings: who is shown in training and who is measured on."""

from pathlib import Path

from humanmm.errors import InputError
from humanmm.flows.bench.render_set import Split, shipped_packs, takes_of
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.storage.readers.mocap_pack import read_pack


def sequences_of(packs: tuple[Path, ...], split: Split) -> list[MocapSequence]:
    """All takes of a split; of `packs` where they are named, but for what is measured on, which stays the same.

    Raises InputError where named packs show nobody of the split train.
    """
    files = packs if packs and split == "train" else shipped_packs("places", split)
    found = [take for pack in files for take in takes_of(read_pack(pack), split)]
    if not found:
        named = ", ".join(str(pack) for pack in files)
        raise InputError(f"{named}: nobody's motion is left for training: all subjects are those that are measured on")
    return found
