"""Whether what is wrong in a finished run was doubted in it: run.json beside a truth.

A run that is `done` without a warning says that nothing in it is doubtful. Here that is held against the truth, in the
terms in which run.json states its doubts: which way bodies face, the cameras' rotations at cuts, focal lengths, the
paths of travelling cameras; and in those of which it knows no doubt: cuts that are missed or invented, people who are
not found.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.evaluation.cuts import score_cuts
from humanmm.models.evaluation.pairs import Pair, pairs_of
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.geometry.rotations import angle_between_deg, rotation_distance
from humanmm.models.motion.fit.orientation_doubt import MISORIENTED_DEG
from humanmm.models.motion.world.doubts import DOUBTFUL_DEG, DOUBTFUL_PROBABILITY, is_doubtful
from humanmm.models.records.sequence import CameraSequence, MotionSequence

Array = np.ndarray

TURNED_SHARE, TURNED_S = 0.2, 0.3
"""A body is turned the wrong way in a shot if it is in more of its frames than this, or for so long without a break."""
WRONG_FOCAL = 0.2
WRONG_SCALE, WRONG_PATH_M = 0.3, 0.1
"""A path is wrong if it is longer or shorter than the true one by so much, as a fraction and in metres."""
LEAST_FRAMES = 5
CLIP = "clip"

KINDS: Mapping[str, str] = {
    "facing": f"a body in a shot: more than {MISORIENTED_DEG:.0f}° off in {100 * TURNED_SHARE:.0f} % of its frames, "
    f"or for {TURNED_S} s",
    "cut": f"the camera's rotation at a cut that was found: more than {DOUBTFUL_DEG:.0f}° off",
    "focal": f"the focal length of a shot: more than {100 * WRONG_FOCAL:.0f} % off",
    "path": f"the path of a travelling camera: {100 * WRONG_SCALE:.0f} % and {WRONG_PATH_M} m too long or too short",
    "shots": "the cuts of a clip: one missed or invented",
    "people": "somebody of the truth: not found in half of his frames",
    CLIP: "a clip: anything of the above; any warning",
}
"""What is judged, and when it is wrong."""


@dataclass(frozen=True)
class Judgement:
    """One thing in a run that may be wrong."""

    kind: str
    wrong: bool
    warned: bool


def judged(record: Mapping[str, Any], prediction: MotionSequence, truth: MotionSequence) -> list[Judgement]:
    """Everything in a run that can be held against its truth; `record`: its run.json."""
    found = [
        *_facings(record, prediction, truth),
        *_cuts(record, prediction, truth),
        *_cameras(record, prediction, truth),
        Judgement("shots", score_cuts(_starts(prediction), truth.transitions).f1 < 1, False),
        *_people(prediction, truth),
    ]
    wrong = any(one.wrong for one in found)
    return [*found, Judgement(CLIP, wrong, bool(record["warnings"]))]


def _starts(sequence: MotionSequence) -> list[int]:
    return [start for start, _ in sequence.transitions]


def _facings(record: Mapping[str, Any], prediction: MotionSequence, truth: MotionSequence) -> Iterator[Judgement]:
    if prediction.cameras is None or truth.cameras is None:
        return
    for pair in pairs_of(prediction, truth):
        off_deg = _in_camera_deg(pair, prediction.cameras, truth.cameras)
        for shot in record["shots"]:
            said = next((one for one in shot["facing"] if one["person"] == pair.predicted.person), None)
            inside = (pair.frame >= shot["start"]) & (pair.frame < shot["end"])
            inside &= pair.predicted.observed[pair.rows_predicted]
            if said is not None and inside.sum() >= LEAST_FRAMES:
                turned = off_deg[inside] > MISORIENTED_DEG
                longest = max((run.end - run.start for run in runs_of_true(turned)), default=0)
                wrong = bool(turned.mean() > TURNED_SHARE) or longest >= TURNED_S * truth.fps
                yield Judgement("facing", wrong, is_doubtful(said["probability"], said["worst_s"]))


def _in_camera_deg(pair: Pair, predicted: CameraSequence, truth: CameraSequence) -> Float[Array, " n"]:
    """Error of the body's orientation as the camera sees it."""
    of_predicted, of_truth = pair.orientations
    seen = (
        np.swapaxes(cameras.R_world_cam[pair.frame], -1, -2) @ R
        for cameras, R in ((predicted, of_predicted), (truth, of_truth))
    )
    return np.asarray(np.degrees(rotation_distance(*seen)))


def _cuts(record: Mapping[str, Any], prediction: MotionSequence, truth: MotionSequence) -> Iterator[Judgement]:
    if prediction.cameras is None or truth.cameras is None:
        return
    for shot in record["shots"]:
        cut = shot["start"]
        if not shot["linked"] or shot["join"] is None or (cut, cut) not in truth.transitions:
            continue
        if cut not in truth.unlinked_cuts:
            across = [cameras.R_world_cam[cut - 1].T @ cameras.R_world_cam[cut] for cameras in _both(prediction, truth)]
            join = shot["join"]
            warned = join["uncertainty_deg"] > DOUBTFUL_DEG or join["probability"] < DOUBTFUL_PROBABILITY
            yield Judgement("cut", angle_between_deg(*across) > DOUBTFUL_DEG, warned)


def _cameras(record: Mapping[str, Any], prediction: MotionSequence, truth: MotionSequence) -> Iterator[Judgement]:
    """Focal lengths and paths, in the frames of each shot that no true cut divides."""
    if prediction.cameras is None or truth.cameras is None:
        return
    for index, shot in enumerate(record["shots"]):
        if shot["camera"] is None or any(shot["start"] < start < shot["end"] for start in _starts(truth)):
            continue
        frames = slice(shot["start"], shot["end"])
        said = [text for text in record["warnings"] if text.startswith((f"camera, shot {index}:", f"shot {index}:"))]
        log_focal = [np.log(cameras.K[frames, 0, 0]) for cameras in _both(prediction, truth)]
        off = float(np.median(np.abs(log_focal[0] - log_focal[1])))
        assumed = any(text.startswith("intrinsics:") for text in record["warnings"])
        yield Judgement("focal", off > np.log1p(WRONG_FOCAL), assumed or any("zoom" in text for text in said))
        if shot["camera"]["path_scale"] is not None:
            path_m, true_m = (_extent_m(cameras.t_world_cam[frames]) for cameras in _both(prediction, truth))
            apart = abs(path_m - true_m) > max(WRONG_PATH_M, WRONG_SCALE * min(path_m, true_m))
            yield Judgement("path", apart, bool(said))


def _both(prediction: MotionSequence, truth: MotionSequence) -> tuple[CameraSequence, CameraSequence]:
    assert prediction.cameras is not None and truth.cameras is not None
    return prediction.cameras, truth.cameras


def _extent_m(path: Float[Array, "n 3"]) -> float:
    """Largest distance from a path's middle, twice."""
    return 2 * float(np.linalg.norm(path - path.mean(axis=0), axis=1).max())


def _people(prediction: MotionSequence, truth: MotionSequence) -> Iterator[Judgement]:
    found = {pair.truth.person: pair for pair in pairs_of(prediction, truth)}
    for person in truth.people:
        seen = person.frame[person.observed]
        if len(seen) >= LEAST_FRAMES:
            pair = found.get(person.person)
            yield Judgement("people", pair is None or _covered(pair, seen).mean() < 0.5, False)


def _covered(pair: Pair, frame: Array) -> Bool[Array, " n"]:
    return np.isin(frame, pair.frame[pair.predicted.observed[pair.rows_predicted]])
