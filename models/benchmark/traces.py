"""What a report draws of a video: paths through the world, bodies at a few moments, and the error about each cut."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.evaluation.pairs import Pair, make_pair
from humanmm.models.evaluation.people import match_people
from humanmm.models.evaluation.pose import METRES_TO_MM
from humanmm.models.evaluation.skeleton import LIMB_NAMES, mid_hip, pick
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.geometry.projection import in_front, project, world_to_camera
from humanmm.models.records.sequence import CameraSequence, MotionSequence, PersonSequence, UndefinedFigureError

Array = np.ndarray

MOMENTS = 96
"""Frames at which the path is kept."""
BODIES = 8
"""Of these, moments at which the body is kept."""
BEFORE_S, AFTER_S, STEP_S = 1.0, 2.0, 0.1
OFFSETS_S = tuple(round(-BEFORE_S + k * STEP_S, 3) for k in range(round((BEFORE_S + AFTER_S) / STEP_S) + 1))
"""Times about a cut at which the error is kept; 0 is the first frame of the new shot."""
FEWEST_FRAMES = 3
"""Frames before a cut without which nothing can be aligned there."""
NEAR_M = 0.1


@dataclass(frozen=True)
class VideoTraces:
    """One video's main person in the truth (row 0) and by each method (row 1 + k); NaN where there is none.

    Every method is aligned with the truth by one rigid motion over the whole video.
    """

    video: str
    split: str
    methods: tuple[str, ...]
    frame: Int[Array, "moments"]
    path: Float[Array, "rows moments 3"]
    """Mid-hip in the truth's world, metres."""
    bodies: Float[Array, "rows bodies 12 3"]
    """Limb joints in the truth's world at every MOMENTS/BODIES-th moment."""
    pixels: Float[Array, "rows bodies 12 2"]
    """The same moments as the true camera sees the truth and as each method's own camera sees its own body."""
    picture: tuple[float, float]
    """Width and height of the picture, pixels."""
    cut_error_mm: Float[Array, "methods cuts offsets"]
    """Mean distance of the limb joints about each true cut, after one rigid motion over the second before it; up to the
    next cut and from the last one on."""


def trace_video(
    name: str, split: str, truth: MotionSequence, predictions: Sequence[tuple[str, MotionSequence | None]]
) -> VideoTraces:
    """The traces of all methods; None for one that failed."""
    person = _main(truth)
    frame: Array = person.frame[np.unique(np.linspace(0, len(person.frame) - 1, MOMENTS).round().astype(int))]
    shown = frame[:: max(1, len(frame) // BODIES)][:BODIES]
    limbs = _limbs(person, truth)
    rows, bodies, pixels = [_at(limbs, person.frame, frame)], [_at(limbs, person.frame, shown)], []
    pixels.append(_projected(bodies[0], shown, truth.cameras))
    errors = np.full((len(predictions), len(truth.cut_frames), len(OFFSETS_S)), np.nan)
    for k, (_, prediction) in enumerate(predictions):
        pair = None if prediction is None else _pair(prediction, truth, person)
        if pair is None or prediction is None:
            rows.append(np.full_like(rows[0], np.nan))
            bodies.append(np.full_like(bodies[0], np.nan))
            pixels.append(np.full_like(pixels[0], np.nan))
            continue
        predicted, true = _limbs_of(pair)
        fit = umeyama_alignment(predicted.reshape(-1, 3), true.reshape(-1, 3), with_scale=False)
        aligned = fit.apply(predicted.reshape(-1, 3)).reshape(predicted.shape)
        rows.append(_at(aligned, pair.frame, frame))
        bodies.append(_at(aligned, pair.frame, shown))
        pixels.append(_projected(_at(predicted, pair.frame, shown), shown, prediction.cameras))
        for c, cut in enumerate(truth.cut_frames):
            errors[k, c] = _about_cut(pair.frame, predicted, true, cut, truth)
    hips = [mid_hip(row, LIMB_NAMES) for row in rows]
    return VideoTraces(
        video=name,
        split=split,
        methods=tuple(method for method, _ in predictions),
        frame=frame.astype(np.int32),
        path=np.stack(hips).astype(np.float32),
        bodies=np.stack(bodies).astype(np.float32),
        pixels=np.stack(pixels).astype(np.float32),
        picture=_picture(truth.cameras),
        cut_error_mm=errors.astype(np.float32),
    )


def _main(truth: MotionSequence) -> PersonSequence:
    return max(truth.people, key=lambda person: (int(person.observed.sum()), -person.person))


def _limbs(person: PersonSequence, sequence: MotionSequence) -> Float[Array, "frames 12 3"]:
    return pick(person.joints, sequence.joint_names, LIMB_NAMES)


def _pair(prediction: MotionSequence, truth: MotionSequence, person: PersonSequence) -> Pair | None:
    found = match_people(prediction.people, (person,))
    if 0 not in found:
        return None
    try:
        return make_pair(prediction.people[found[0]], person, predicted_sequence=prediction, truth_sequence=truth)
    except UndefinedFigureError:
        return None


def _limbs_of(pair: Pair) -> tuple[Float[Array, "frames 12 3"], Float[Array, "frames 12 3"]]:
    both = (pair.joints_predicted, pair.joints_truth)
    predicted, true = (pick(joints, pair.joint_names, LIMB_NAMES) for joints in both)
    return predicted, true


def _at(joints: Float[Array, "n 12 3"], known: Int[Array, " n"], wanted: Int[Array, " m"]) -> Float[Array, "m 12 3"]:
    """The joints of the wanted frames, NaN where a frame is not known."""
    out = np.full((len(wanted), *joints.shape[1:]), np.nan)
    _, at, source = np.intersect1d(wanted, known, assume_unique=True, return_indices=True)
    out[at] = joints[source]
    return out


def _projected(
    joints: Float[Array, "m 12 3"], frame: Int[Array, " m"], cameras: CameraSequence | None
) -> Float[Array, "m 12 2"]:
    if cameras is None:
        return np.full((*joints.shape[:2], 2), np.nan)
    in_camera = world_to_camera(joints, cameras.R_world_cam[frame], cameras.t_world_cam[frame])
    pixels = project(in_camera, cameras.K[frame], near_m=NEAR_M)
    return np.where(in_front(in_camera, NEAR_M)[..., None], pixels, np.nan)


def _picture(cameras: CameraSequence | None) -> tuple[float, float]:
    """Twice the principal point."""
    if cameras is None or not len(cameras.K):
        return 0.0, 0.0
    return 2 * float(cameras.K[0, 0, 2]), 2 * float(cameras.K[0, 1, 2])


def _about_cut(
    frame: Int[Array, " n"],
    predicted: Float[Array, "n 12 3"],
    true: Float[Array, "n 12 3"],
    cut: int,
    truth: MotionSequence,
) -> Float[Array, " offsets"]:
    """Error, mm, at every offset; NaN where the neighbouring shots do not reach or nobody is known."""
    out = np.full(len(OFFSETS_S), np.nan)
    first = max((c for c in truth.cut_frames if c < cut), default=0)
    stop = min((c for c in truth.cut_frames if c > cut), default=truth.num_frames)
    base = np.flatnonzero((frame >= max(first, cut - BEFORE_S * truth.fps)) & (frame < cut))
    if len(base) < FEWEST_FRAMES:
        return out
    fit = umeyama_alignment(predicted[base].reshape(-1, 3), true[base].reshape(-1, 3), with_scale=False)
    for k, offset in enumerate(OFFSETS_S):
        wanted = cut + round(offset * truth.fps)
        row = int(np.searchsorted(frame, wanted))
        if first <= wanted < stop and row < len(frame) and frame[row] == wanted:
            out[k] = METRES_TO_MM * np.linalg.norm(fit.apply(predicted[row]) - true[row], axis=-1).mean()
    return out
