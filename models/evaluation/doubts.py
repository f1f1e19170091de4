"""Whether what is wrong in a finished run was doubted in it: run.json beside a truth.

A run that is `done` without a warning says that nothing in it is doubtful. Here that is held against the truth, in the
terms in which run.json states its doubts: which way bodies face, their poses, the cameras' rotations at cuts, focal
lengths, the paths of travelling cameras; and in those of which it knows no doubt: cuts that are missed or invented,
people who are not found.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.evaluation.cameras import rotation_across
from humanmm.models.evaluation.cuts import match_cuts, score_cuts
from humanmm.models.evaluation.pairs import Pair, pairs_of
from humanmm.models.evaluation.pose import pa_mpjpe_mm
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.geometry.rotations import angle_between_deg, rotation_distance
from humanmm.models.motion.fit.orientation_doubt import MISORIENTED_DEG
from humanmm.models.motion.world.doubts import (
    DOUBTFUL_DEG,
    is_doubtful_cut,
    is_doubtful_facing,
    is_doubtful_path,
    is_doubtful_pose,
)
from humanmm.models.records.camera import is_doubtful_focal
from humanmm.models.records.sequence import CameraSequence, MotionSequence
from humanmm.models.records.shots import DOUBTFUL

Array = np.ndarray
Cameras = tuple[CameraSequence, CameraSequence]
"""Of a prediction and of its truth."""

TURNED_SHARE, TURNED_S = 0.2, 0.3
"""A body is turned the wrong way in a shot if it is in more of its frames than this, or for so long without a break."""
WRONG_FOCAL = 0.2
WRONG_SCALE, WRONG_PATH_M = 0.3, 0.1
"""A path is wrong if it is longer or shorter than the true one by so much, as a fraction and in metres."""
WRONG_POSE_MM = 100.0
"""PA-MPJPE of a person in a shot."""
LEAST_FRAMES = 5
CLIP = "clip"

KINDS: Mapping[str, str] = {
    "facing": f"a body in a shot: more than {MISORIENTED_DEG:.0f}° off in {100 * TURNED_SHARE:.0f} % of its frames, "
    f"or for {TURNED_S} s",
    "pose": f"a body in a shot: joints more than {WRONG_POSE_MM:.0f} mm off (PA-MPJPE)",
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
    pairs, cameras = pairs_of(prediction, truth), (prediction.cameras, truth.cameras)
    starts = [start for start, _ in truth.transitions]
    cuts_f1 = score_cuts([start for start, _ in prediction.transitions], truth.transitions).f1
    found = [Judgement("shots", cuts_f1 < 1, False), *_people(record, pairs, truth), *_poses(record, pairs)]
    if cameras[0] is not None and cameras[1] is not None:
        both = cameras[0], cameras[1]
        found += _facings(record, pairs, both, truth.fps)
        found += _cuts(record, both, truth)
        found += _lenses_and_paths(record, both, starts)
    wrong = any(one.wrong for one in found)
    return [*found, Judgement(CLIP, wrong, bool(record["warnings"]))]


def _facings(record: Mapping[str, Any], pairs: Sequence[Pair], both: Cameras, fps: float) -> Iterator[Judgement]:
    for pair in pairs:
        off_deg = _in_camera_deg(pair, both)
        for said, inside, certain in _in_shots(record, pair, "facing"):
            turned = off_deg[inside] > MISORIENTED_DEG
            longest = max((run.end - run.start for run in runs_of_true(turned)), default=0)
            wrong = bool(turned.mean() > TURNED_SHARE) or longest >= TURNED_S * fps
            yield Judgement("facing", wrong, certain and is_doubtful_facing(said["probability"], said["worst_s"]))


def _poses(record: Mapping[str, Any], pairs: Sequence[Pair]) -> Iterator[Judgement]:
    for pair in pairs:
        for said, inside, certain in _in_shots(record, pair, "pose"):
            error_mm = pa_mpjpe_mm(pair.joints_predicted[inside], pair.joints_truth[inside])
            expected_mm = said["error_mm"]
            doubtful = certain and expected_mm is not None and is_doubtful_pose(expected_mm / 1000)
            yield Judgement("pose", error_mm > WRONG_POSE_MM, doubtful)


def _in_shots(
    record: Mapping[str, Any], pair: Pair, what: str
) -> Iterator[tuple[Mapping[str, Any], Bool[Array, " n"], bool]]:
    """What run.json says of a person in each shot in which he is seen, the rows of these frames, and whether he is
    surely a person: of somebody who may be none the pipeline says that, and nothing else."""
    certain = {one["person"] for one in record["people"] if one["probability"] >= DOUBTFUL}
    for shot in record["shots"]:
        said = next((one for one in shot[what] if one["person"] == pair.predicted.person), None)
        inside = (pair.frame >= shot["start"]) & (pair.frame < shot["end"])
        inside &= pair.predicted.observed[pair.rows_predicted]
        if said is not None and inside.sum() >= LEAST_FRAMES:
            yield said, inside, said["person"] in certain


def _in_camera_deg(pair: Pair, both: Cameras) -> Float[Array, " n"]:
    """Error of the body's orientation as the camera sees it."""
    seen = (
        np.swapaxes(cameras.R_world_cam[pair.frame], -1, -2) @ R
        for cameras, R in zip(both, pair.orientations, strict=True)
    )
    return np.asarray(np.degrees(rotation_distance(*seen)))


def _cuts(record: Mapping[str, Any], both: Cameras, truth: MotionSequence) -> Iterator[Judgement]:
    """Of each shot whose beginning `match_cuts` gives to a true cut; rotations from before both to after both."""
    shots = record["shots"][1:]
    for index, true in match_cuts([shot["start"] for shot in shots], truth.transitions).items():
        shot, (start, end) = shots[index], truth.transitions[true]
        if shot["join"] is not None and shot["linked"] and truth.cut_frames[true] not in truth.unlinked_cuts:
            span = min(start, shot["start"]), max(end, shot["start"])
            across = [rotation_across(cameras, span) for cameras in both]
            warned = is_doubtful_cut(shot["join"]["uncertainty_deg"], shot["join"]["probability"])
            yield Judgement("cut", angle_between_deg(*across) > DOUBTFUL_DEG, warned)


def _lenses_and_paths(record: Mapping[str, Any], both: Cameras, true_starts: Sequence[int]) -> Iterator[Judgement]:
    """Of each shot that no true cut divides. That a camera zooms, or might, and that a shot's own lens is
    uncertain, run.json says in warnings alone."""
    focal = record["focal"]
    doubtful_focal = is_doubtful_focal(focal["source"], focal["relative_uncertainty"])
    for index, shot in enumerate(record["shots"]):
        if shot["camera"] is None or any(shot["start"] < start < shot["end"] for start in true_starts):
            continue
        frames = slice(shot["start"], shot["end"])
        said = [text for text in record["warnings"] if text.startswith((f"camera, shot {index}:", f"shot {index}:"))]
        log_focal = [np.log(cameras.K[frames, 0, 0]) for cameras in both]
        off = float(np.median(np.abs(log_focal[0] - log_focal[1])))
        doubtful_lens = any("zoom" in text for text in said) or any(
            text.startswith(f"intrinsics: frames {frames.start} to {frames.stop - 1} ") for text in record["warnings"]
        )
        yield Judgement("focal", off > np.log1p(WRONG_FOCAL), doubtful_focal or doubtful_lens)
        scale = shot["camera"]["path_scale"]
        if scale is not None:
            path_m, true_m = (_extent_m(cameras.t_world_cam[frames]) for cameras in both)
            apart = abs(path_m - true_m) > max(WRONG_PATH_M, WRONG_SCALE * min(path_m, true_m))
            doubtful = is_doubtful_path(scale["source"], scale["relative_uncertainty"], both[0].t_world_cam[frames])
            yield Judgement("path", apart, bool(said) or doubtful)


def _extent_m(path: Float[Array, "n 3"]) -> float:
    """Largest distance from a path's middle, twice."""
    return 2 * float(np.linalg.norm(path - path.mean(axis=0), axis=1).max())


def _people(record: Mapping[str, Any], pairs: Sequence[Pair], truth: MotionSequence) -> Iterator[Judgement]:
    found = {pair.truth.person: pair for pair in pairs}
    for person in truth.people:
        seen = person.frame[person.observed]
        if len(seen) >= LEAST_FRAMES:
            pair = found.get(person.person)
            missing = seen if pair is None else seen[~_covered(pair, seen)]
            spans = [(one["start"], one["end"]) for one in record["unfollowed"]]
            warned = any(((missing >= start) & (missing < end)).any() for start, end in spans)
            yield Judgement("people", len(missing) > 0.5 * len(seen), warned)


def _covered(pair: Pair, frame: Array) -> Bool[Array, " n"]:
    return np.isin(frame, pair.frame[pair.predicted.observed[pair.rows_predicted]])
