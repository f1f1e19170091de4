"""What in a finished world is doubtful, in sentences for its user: nothing doubtful is left without one."""

from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Float

from humanmm.models.cuts.camera_rotation import GAP_WARNING_S
from humanmm.models.cuts.continuity import goes_on
from humanmm.models.cuts.hypotheses import SIDES_SWAPPED
from humanmm.models.geometry.intervals import frame_intervals, in_intervals, merged
from humanmm.models.motion.rotations.shot_results import ShotResults, motions_of
from humanmm.models.motion.rotations.shot_rotations import ShotRotations
from humanmm.models.records.landmarks import COCO_LANDMARKS, NUM_LANDMARKS
from humanmm.models.records.motion import CutAlignment, Facing, PathScale, PoseError
from humanmm.models.video.frame_times import shown_s

Array = np.ndarray

DOUBTFUL_DEG, DOUBTFUL_PROBABILITY = 30.0, 0.88
"""A camera rotation that is less certain than this gets a warning: of 170 at cuts, 13 of them wrong by more than 30°,
0.8 warns of 46 and leaves two wrong ones without one, 0.88 of 56 and none (docs/measurements/cuts.md)."""
KNOWN_DEG = 5.0
"""A rotation this certain comes from walls or a background: people alone reach 10° at best."""
DOUBTFUL_SCALE, DOUBTFUL_PATH_M = 0.3, 0.1
"""A camera's path whose scale is less certain than this gets a warning, if it may be off by so much."""
CERTAIN_FACING = 0.925
"""A body that is turned the right way with less than this probability gets a warning: in 24 rendered development clips
nine of twelve such bodies, and four of 68 others, are turned the wrong way in a fifth of their frames or for 0.3 s."""
DOUBTFUL_FRAME = 0.2
"""Probability of being turned the wrong way from which a frame is named in it."""
WORST_S = 0.15
"""One run of doubtful frames in which a body is expected to be turned the wrong way for so long is a warning by itself:
in a long shot it hardly changes the mean."""
DOUBTFUL_POSE_M = 0.06
"""A body whose pose is expected to be off by more gets a warning: on 28 development clips 29 of 117 bodies in a shot
have one, four of the six that are off by more than 100 mm among them."""
APART_S = 5 / 30
"""Doubtful frames no further apart are named as one run,"""
NAMED_RUNS = 3
"""and so many runs, the longest ones."""


def pose_errors_of(results: ShotResults) -> list[PoseError]:
    """How far everybody's pose is expected to be off in every shot."""
    errors, gap = [], _frames_apart(results)
    for shot in range(len(results.shots.shots)):
        for person, motion in motions_of(results, shot).items():
            known = motion.observed & np.isfinite(motion.pose_error_m)
            frame, error = motion.frame[known], motion.pose_error_m[known]
            runs = merged(frame_intervals(frame, error > DOUBTFUL_POSE_M), gap=gap)
            shown = shown_s(results.time_s, frame)
            mean = float(np.average(error, weights=shown)) if len(error) else float("nan")
            errors.append(PoseError(person, shot, mean, tuple(runs)))
    return errors


def of_pose_errors(errors: Sequence[PoseError], certain: Collection[int]) -> list[str]:
    """Whose pose is likely to be far off in a shot; `certain` as in `of_facings`."""
    return [
        f"shot {one.shot}: the pose of person {one.person} is doubtful{_where(one.doubtful)}: "
        f"joints are expected to be off by {1000 * one.error_m:.0f} mm"
        for one in errors
        if one.person in certain and is_doubtful_pose(one.error_m)
    ]


def is_doubtful_pose(error_m: float) -> bool:
    """Whether that of a `PoseError` is a warning."""
    return error_m > DOUBTFUL_POSE_M


def facings_of(results: ShotResults) -> list[Facing]:
    """Whether everybody in every shot is turned the right way."""
    facings, gap = [], _frames_apart(results)
    for shot in range(len(results.shots.shots)):
        for person, motion in motions_of(results, shot).items():
            frame, doubt = motion.frame[motion.observed], motion.misoriented[motion.observed]
            runs = merged(frame_intervals(frame, doubt > DOUBTFUL_FRAME), gap=gap)
            shown = shown_s(results.time_s, frame)
            probability = 1 - float(np.average(doubt, weights=shown)) if len(doubt) else 1.0
            worst_s = max((float((shown * doubt)[in_intervals(frame, [run])].sum()) for run in runs), default=0.0)
            facings.append(Facing(person, shot, probability, tuple(runs), worst_s))
    return facings


def _frames_apart(results: ShotResults) -> int:
    """APART_S in frames."""
    return round(APART_S / float(np.median(np.diff(results.time_s))))


def of_facings(facings: Sequence[Facing], certain: Collection[int]) -> list[str]:
    """Whose body may be turned the wrong way in part of a shot. `certain`: numbers of the people who are not doubtful
    (`ShotResults.certain`); who may be no person at all has his own warning."""
    return [
        _of_facing(one) for one in facings if one.person in certain and is_doubtful_facing(one.probability, one.worst_s)
    ]


def is_doubtful_facing(probability: float, worst_s: float) -> bool:
    """Whether that of a `Facing` is a warning."""
    return probability < CERTAIN_FACING or worst_s > WORST_S


def _of_facing(facing: Facing) -> str:
    return (
        f"shot {facing.shot}: which way person {facing.person} faces is doubtful{_where(facing.doubtful)}: "
        f"one frame in {1 / max(1 - facing.probability, 1e-3):.0f} is expected to be off by more than 45°"
    )


def _where(doubtful: Sequence[tuple[int, int]]) -> str:
    """The longest of some runs of frames, in words."""
    longest = sorted(sorted(doubtful, key=lambda run: run[0] - run[1])[:NAMED_RUNS])
    frames = ", ".join(f"{start}" if end - start == 1 else f"{start}-{end - 1}" for start, end in longest)
    return f", above all in frames {frames}" if frames else ""


def of_paths(scales: Sequence[PathScale], paths: Sequence[Float[Array, "n 3"]]) -> list[str]:
    """Whose camera's path may be much too long or too short; `paths`: of each shot's camera in the world, metres."""
    return [
        _of_path(one, _length_m(paths[one.shot]))
        for one in scales
        if is_doubtful_path(one.source, one.relative_uncertainty, paths[one.shot])
    ]


def is_doubtful_path(source: str, relative_uncertainty: float, path: Float[Array, "n 3"]) -> bool:
    """Whether a path with such a `PathScale` may be much too long or too short."""
    if source == "assumed":
        return True
    return relative_uncertainty > max(DOUBTFUL_SCALE, DOUBTFUL_PATH_M / max(_length_m(path), 1e-9))


def _length_m(path: Float[Array, "n 3"]) -> float:
    """How far it goes along one axis of the world."""
    return float(np.ptp(path, axis=0).max())


def _of_path(scale: PathScale, length_m: float) -> str:
    if scale.source == "assumed":
        return (
            f"shot {scale.shot}: nobody's feet determine the scale of the camera's path; its unit is taken for a metre"
        )
    witness = "the floor and the feet on it" if scale.source == "floor" else "feet that stand still"
    return (
        f"shot {scale.shot}: the camera travels {length_m:.1f} m ± {100 * scale.relative_uncertainty:.0f} %: "
        f"{witness} hardly give the scale of its path"
    )


def of_cut(cut: CutAlignment) -> tuple[str, ...]:
    """Whether the rotation at a cut is hardly known; else what its method has to say, unless walls or a background
    determine the rotation: then errors of the people there do not matter."""
    doubtful = is_doubtful_cut(cut.uncertainty_deg, cut.probability)
    if cut.linked and cut.uncertainty_deg <= KNOWN_DEG and not doubtful:
        return ()
    if not cut.linked or not doubtful:
        return cut.warnings
    unseen = f" after {cut.gap_s:.2f} s without anyone seen" if cut.gap_s > GAP_WARNING_S else ""
    return (
        f"cut at frame {cut.cut_frame}{unseen}: the camera's rotation across it is uncertain (probability "
        f"{cut.probability:.2f}, 68 % within {cut.uncertainty_deg:.0f}°): the shots on both sides may be rotated "
        "against each other",
    )


def is_doubtful_cut(uncertainty_deg: float, probability: float) -> bool:
    """Whether a rotation of which a `CutAlignment` says so is hardly known."""
    return uncertainty_deg > DOUBTFUL_DEG or probability < DOUBTFUL_PROBABILITY


def of_jumps(cuts: Sequence[CutAlignment], certain: Collection[int]) -> list[str]:
    """At which cuts somebody does not go on as he did: his path is not known across them. `certain` as in
    `of_facings`."""
    return [
        f"cut at frame {cut.cut_frame}: person {one.person} does not go on as before (limbs are {one.jump_m:.2f} m "
        "from where they were going): time is lost there, or the pose is wrong on one side; how far the person went "
        "meanwhile is uncertain"
        for cut in cuts
        for one in cut.pose_jumps
        if one.person in certain and not goes_on(one.jump_m, one.expected_m)
    ]


def of_sides(rotations: ShotRotations) -> list[str]:
    """Who may face the wrong way, because his sides as they were found do not fit the rest of the video."""
    return [
        f"shots {one.edge.a} and {one.edge.b} fit best if left and right of {one.edge.source} are swapped in one: "
        "the body may face the wrong way there"
        for one in rotations.believed
        if one.hypothesis.source.endswith(SIDES_SWAPPED)
    ]


_NOT_IN_COCO = np.setdiff1d(np.arange(NUM_LANDMARKS), COCO_LANDMARKS)
"""Landmarks that a body which is given in space has, and a detector of COCO's keypoints has not."""


def of_lifted(results: ShotResults) -> list[str]:
    """Who is known from 2D keypoints alone."""
    people = {
        appearance.person
        for shot in results.shots.shots
        for appearance in shot.people
        if (scene := results.scenes[shot.scene]) is not None
        and (track := scene.tracks[appearance.track]).lifted
        and not track.keypoints2d[:, _NOT_IN_COCO, 2].any()
    }
    return [
        f"person {person}: the detector gives 2D keypoints only; depth and orientation were lifted from them, rougher"
        for person in sorted(people)
    ]


def of_groups(groups: Sequence[Sequence[int]]) -> list[str]:
    """Which shots are worlds of their own; `groups`: the shots of each world."""
    if len(groups) < 2:
        return []
    names = ", ".join(str(group[0]) for group in groups[1:])
    return [f"shots {names} share nobody with the shots before: from each on the world has a new origin"]
