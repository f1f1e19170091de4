"""Whether a truth belongs to the video of a run: figures against the truth of another video mean nothing."""

from pathlib import Path

from humanmm.errors import InputError, TruthError
from humanmm.models.records.sequence import MotionSequence
from humanmm.storage.batches.manifest import SUFFIXES
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.files import file_sha256

FRAMES_SHARE, FRAMES = 0.02, 3
"""Decoders may lose frames at the ends of a video: so many more or fewer, or this share of them, are the same video."""
RATE_SHARE = 0.01


def check_same_video(run: Path, truth: Path, prediction: MotionSequence, reference: MotionSequence) -> None:
    """TruthError if a truth is that of another video than the run's, by its content, its length or its frame rate."""
    said = f"{truth} is the truth of another video than that of {run}"
    mine, other = _digest_of_run(run), _digest_of_truth(truth)
    if mine and other:
        if mine != other:
            raise TruthError(f"{said}: their videos differ in content; give the truth of the same file")
        return
    frames = prediction.num_frames, reference.num_frames
    if abs(frames[0] - frames[1]) > max(FRAMES, FRAMES_SHARE * frames[1]):
        raise TruthError(f"{said}: the run has {frames[0]} frames and the truth {frames[1]}")
    if abs(prediction.fps / reference.fps - 1.0) > RATE_SHARE:
        raise TruthError(f"{said}: the run has {prediction.fps:.3f} frames a second and the truth {reference.fps:.3f}")


def _digest_of_run(folder: Path) -> str | None:
    """sha256 of the video of a run; None where no run.json says it."""
    try:
        return str(read_run_record(folder)["video"]["sha256"])
    except (InputError, KeyError, TypeError):
        return None


def _digest_of_truth(truth: Path) -> str | None:
    """sha256 of the video that a truth is about: of a run, or of <name>.mp4 beside <name>_gt.npz; None if unknown."""
    if truth.is_dir():
        return _digest_of_run(truth)
    name = truth.stem.removesuffix("_gt")
    found = next((path for suffix in sorted(SUFFIXES) if (path := truth.with_name(name + suffix)).is_file()), None)
    if found is None or name == truth.stem:
        return None
    return file_sha256(found)
