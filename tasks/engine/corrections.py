"""What became of the user's corrections in a run: which were applied, and why the others do not fit any more."""

from humanmm.config import Config
from humanmm.corrections import Correction, Focal, StaticShot
from humanmm.models.records.shots import ShotList
from humanmm.storage.run_folder.run_record import OTHER_VIDEO, CorrectionRecord


def outcomes(config: Config, shots: ShotList, *, video: str) -> list[CorrectionRecord]:
    """One entry for each correction, in their order; `video` is the sha256 of the video of the run."""
    notes = {note.identity: (note.applied, note.reason) for note in shots.corrections}
    wanted = config.corrections
    other = "" if wanted.video in (None, video) else OTHER_VIDEO
    found = [
        _recorded(one, applied, reason or other)
        for one in wanted.correction
        for applied, reason in [notes.get(one.identity) or _judged(one, config, shots)]
    ]
    reason = f"{OTHER_VIDEO} (`--corrections {wanted.origin}` applies it all the same)"
    return [*found, *(_recorded(one, False, reason) for one in wanted.left_aside)]


def _recorded(one: Correction, applied: bool, reason: str) -> CorrectionRecord:
    return CorrectionRecord(one.model_dump(mode="json", exclude_none=True), str(one), applied, reason)


def _judged(correction: Correction, config: Config, shots: ShotList) -> tuple[bool, str]:
    """The same for corrections that need no looking at people: whether it was applied, and a remark or why not."""
    if isinstance(correction, StaticShot) and correction.frame >= shots.num_frames:
        return False, f"frame {correction.frame} does not exist: the video ends with frame {shots.num_frames - 1}"
    if isinstance(correction, Focal):
        given = config.intrinsics.focal_px or config.intrinsics.fov_deg
        return True, "it takes the place of the focal length in the settings" if given else ""
    return True, ""
